"""Build the small pieces of HTML that notebooks show; names come from files, so all text is escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from aeolid.display import token, visible
from aeolid.wording import counted


def shown(title: str, *parts: str, lines: Sequence[str] = ()) -> str:
    """Return a title, plain lines below it, and parts that are HTML already."""
    told = "".join(f"<div>{escape(visible(line))}</div>" for line in lines)
    return f"<div><b>{escape(visible(title))}</b>{told}{''.join(parts)}</div>"


def count(number: int, what: str) -> str:
    """Return a number with its noun: "1 state", "2 states"."""
    return counted(number, what)


def fit_of(what: str, worst: float | None) -> str:
    """Return a fit in percent for a line of text; None where no output has a score, since all are constant.

    >>> fit_of("free-run", 87.4), fit_of("free-run", None)
    ('free-run fit 87 %', 'no free-run fit (constant outputs)')
    """
    return f"no {what} fit (constant outputs)" if worst is None else f"{what} fit {worst:.0f} %"


def title(text: str) -> str:
    """Return a name from a file for a line of text: written out, and short."""
    return token(text, 60)
