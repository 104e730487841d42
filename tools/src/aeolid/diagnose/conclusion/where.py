"""Locate what has no name."""

from __future__ import annotations

from typing import Any

import numpy as np

from aeolid.diagnose.conclusion.declared import form_speaking
from aeolid.diagnose.localise.locate import whereabouts
from aeolid.diagnose.pipeline import Study


def where_of(study: Study, verdict: str) -> dict[str, Any] | None:
    """Locate a mismatch without a name: the cells that stand out, and what the correction depends on."""
    if verdict == "data_fault":
        first = next(f for f in study.findings if f.severity == "fault")
        return {"entry": f"channel:{first.channel}", "finding": first.finding}
    if verdict != "unnamed":
        return None
    bands = sorted(
        (b for b in study.bands if b["significant"]), key=lambda b: -abs(np.log(float(str(b["ratio"])) + 1e-9))
    )
    outputs = list(dict.fromkeys(str(b["output"]) for b in bands)) or [o.name for o in study.prepared.extended.outputs]
    form = form_speaking(study)
    return {
        "entry": form.attachments[0].location["entry"] if form else "unknown", "outputs": outputs,
        "frequency_hz": bands[0]["frequency_hz"] if bands else None, **whereabouts(study.cells),
        "depends_on": [{"what": g, "share": s} for g, s in study.ceiling.groups[:4]],
    }  # fmt: skip
