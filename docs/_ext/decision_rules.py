"""Show the numbers that decide in a diagnosis: `aeolid-rules` asks the package for each section's declarations."""

from __future__ import annotations

import sys
from itertools import groupby

from docutils import nodes
from prose import inline
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from aeolid.diagnose.rules import every_rule, in_force
from aeolid.diagnose.rules.declaring import DECISIONS, RUN_DECISIONS

PAGES = {DECISIONS: ":doc:`/decisions/diagnosis`", RUN_DECISIONS: ":doc:`/decisions/run_as_prior`"}
COLUMNS = {"name": 24, "value": 8, "unit": 12, "meaning": 40, "source": 16}


class DecisionRules(SphinxDirective):
    """Show a table for each section: name, value, unit, meaning, source."""

    def run(self) -> list[nodes.Node]:
        """Return the tables, each with what its section is about."""
        lines: list[str] = []
        for section, rules in groupby(every_rule(), key=lambda r: r.name.split(".")[0]):
            about = sys.modules[type(getattr(in_force(), section)).__module__].__doc__ or ""
            lines += [section, "-" * len(section), "", inline(about), "", ".. list-table::", "   :header-rows: 1"]
            lines += [f"   :widths: {' '.join(map(str, COLUMNS.values()))}", "", *_row(tuple(COLUMNS))]
            for r in rules:
                source = PAGES.get(r.source) or inline(r.source)
                name = f"``{r.name.split('.')[1]}``"
                lines += _row((name, f"{r.value:.6g}", inline(r.unit), inline(r.meaning), source))
            lines.append("")
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def _row(cells: tuple[str, ...]) -> list[str]:
    return [f"   {'  -' if place else '* -'} {cell}" for place, cell in enumerate(cells)]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("aeolid-rules", DecisionRules)
    return {"parallel_read_safe": True}
