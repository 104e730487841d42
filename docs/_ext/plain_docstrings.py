"""Docstrings of the package are plain text, with sections of entries in the public interface; show them as such."""

from __future__ import annotations

import re
import textwrap
from typing import Any

from prose import inline, to_rst
from sphinx.application import Sphinx

SECTION = re.compile(r"^(Parameters|Returns|Raises|Attributes)\n-+\n", re.M)


def markup(text: str) -> list[str]:
    """Return a docstring as markup: prose, and behind it each section with its entries."""
    head, *rest = SECTION.split(text)
    lines = to_rst(head)
    for title, body in zip(rest[::2], rest[1::2], strict=True):
        lines += [f".. rubric:: {title}", "", *entries(body), ""]
    return lines


def entries(body: str) -> list[str]:
    """Return the entries of a section, a name or type and an indented text each, as a definition list."""
    lines: list[str] = []
    for entry in re.split(r"\n(?=\S)", body.strip("\n")):
        term, _, text = entry.partition("\n")
        name, colon, kind = term.partition(" : ")
        told = inline(" ".join(textwrap.dedent(text).split()))
        lines += [f"``{name.strip()}``" + (f" : {inline(kind)}" if colon else ""), f"   {told or '.'}", ""]
    return lines


def show(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Replace a docstring's lines by markup."""
    lines[:] = markup("\n".join(lines))


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("autodoc-process-docstring", show)
    return {"parallel_read_safe": True}
