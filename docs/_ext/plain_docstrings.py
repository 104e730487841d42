"""Docstrings of the package are plain text; show them as such."""

from __future__ import annotations

from typing import Any

from prose import to_rst
from sphinx.application import Sphinx


def show(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Replace a docstring's lines by markup."""
    lines[:] = to_rst("\n".join(lines))


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("autodoc-process-docstring", show)
    return {"parallel_read_safe": True}
