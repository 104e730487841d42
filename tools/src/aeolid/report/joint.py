"""Write the page that shows an identification and a diagnosis one after the other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aeolid.report.diagnosis import diagnosis_parts
from aeolid.report.identification import identification_parts
from aeolid.report.markup import join, tag, write_page


def render_demo(facts: dict[str, Any], diagnosis: dict[str, Any], evidence: dict[str, Any], path: str | Path) -> None:
    """Write both parts on one page; the arguments are those of the two single pages."""
    title = str(facts.get("title") or "From the controller's bus to named modes and a named effect")
    parts = [
        tag("h1", title),
        tag("p", str(facts["introduction"])) if facts.get("introduction") else None,
        tag("h2", "1  What the turbine's dynamics are"),
        identification_parts(facts),
    ]
    if diagnosis:
        parts += [
            tag("h2", "2  What the model lacks"),
            tag("p", str(evidence["title"])) if evidence.get("title") else None,
            diagnosis_parts(diagnosis, evidence),
        ]
    write_page(path, title, join(parts))
