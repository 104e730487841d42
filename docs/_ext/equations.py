"""Show which code an equation of a paper became: `equations` reads docs/equations.toml and checks every place."""

from __future__ import annotations

import importlib
import re
import tomllib
from pathlib import Path
from typing import Any

from docutils import nodes
from prose import inline
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
TABLE = DOCS / "equations.toml"


def papers() -> list[dict[str, Any]]:
    """Read the table."""
    found: list[dict[str, Any]] = tomllib.loads(TABLE.read_text(encoding="utf-8"))["paper"]
    return found


def fault(place: str) -> str | None:
    """Say what is wrong with a place; None where it exists."""
    file, colon, name = place.partition(":")
    if colon:
        if not (ROOT / file).is_file():
            return f"{place}: there is no file {file}"
        defined = rf"^(?:#define |[a-z].*?\b\*?){re.escape(name)}\("
        return None if re.search(defined, (ROOT / file).read_text(), re.M) else f"{place}: not defined in {file}"
    parts = place.split(".")
    for length in range(len(parts), 0, -1):
        try:
            thing: Any = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            if not hasattr(thing, part):
                return f"{place}: {'.'.join(parts[:length])} has no {part}"
            thing = getattr(thing, part)
        return None
    return f"{place}: no such module"


class Equations(SphinxDirective):
    """Show a table for each paper."""

    def run(self) -> list[nodes.Node]:
        """Return the tables."""
        self.env.note_dependency(str(TABLE))
        lines: list[str] = []
        for paper in papers():
            title = f"Paper {paper['number']}"
            lines += [title, "-" * len(title), "", inline(paper["title"]), "", ".. list-table::"]
            lines += ["   :header-rows: 1", "   :widths: 14 30 16 40", ""]
            lines += ["   * - equation", "     - what", "     - symbols", "     - code"]
            for equation in paper["equation"]:
                for place in equation["places"]:
                    if (wrong := fault(place)) is not None:
                        raise self.error(f"{TABLE.name}: {wrong}")
                code = [f"| ``{place}``" for place in equation["places"]]
                lines += [f"   * - {inline(equation['at'])}", f"     - {inline(equation['what'])}"]
                lines += [f"     - {inline(equation['symbols'])}", f"     - {code[0]}"]
                lines += [f"       {line}" for line in code[1:]]
            lines += [""]
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("equations", Equations)
    return {"parallel_read_safe": True}
