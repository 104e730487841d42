"""Show the catalogue of effects: `aeolid-catalogue` asks the package that diagnoses by it."""

from __future__ import annotations

from itertools import groupby

from docutils import nodes
from prose import inline
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from aeolid.diagnose.hypotheses.catalogue import ENTRIES


class Catalogue(SphinxDirective):
    """Show every entry, one section a family."""

    def run(self) -> list[nodes.Node]:
        """Return sections by family, entries within by id."""
        lines: list[str] = []
        for family, entries in groupby(sorted(ENTRIES, key=lambda e: (e.family, e.id)), key=lambda e: e.family):
            title = family.replace("_", " ").capitalize()
            lines += [title, "-" * len(title), ""]
            for e in entries:
                lines += [
                    f".. _effect-{e.id}:",
                    "",
                    e.id,
                    "~" * len(e.id),
                    "",
                    f"{inline(e.name[:1].upper() + e.name[1:])}.",
                    "",
                ]
                lines += [".. code-block:: none", "   :class: wrap", ""]
                lines += [*(f"   {line}" for line in e.equation.splitlines()), ""]
                for q in e.quantities:
                    symbol = f"{q.symbol} [{q.unit}]" if q.unit else q.symbol
                    lines += [f"* {inline(symbol)}, {_end(q.low)} … {_end(q.high)}: {inline(q.meaning)}"]
                lines += ["", f"Attaches to {inline(e.attaches_to)}; shows as: {inline(e.signature)}.", ""]
                for rival, told in e.confused_with:
                    known = any(other.id == rival for other in ENTRIES)  # else a whole family, in words
                    link = f":ref:`{rival} <effect-{rival}>`" if known else inline(rival)
                    lines += [f"* not {link}: {inline(told)}"]
                lines += ["", f"Source: {inline(e.source)}", ""]
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def _end(value: float) -> str:
    return f"{value:g}" if abs(value) < 1e300 else "open"


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("aeolid-catalogue", Catalogue)
    return {"parallel_read_safe": True}
