"""Show text that others wrote: names from files, from file systems and from the bus, on a terminal or in a page."""

from __future__ import annotations

import re
import unicodedata

_UNSEEN = ("Cc", "Cf", "Cs", "Zl", "Zp")  # control, format (bidirectional, zero width), half a pair, line ends
MOST = 2000  # characters of one message
_QUOTED = re.compile(r"""b?"[^"]*"?|(?<!\w)b?'[^']*'?""")
_KEPT = frozenset("\n\t")


def is_unseen(character: str) -> bool:
    """Tell whether a character acts on what is around it instead of being seen: ESC, U+202E, a zero-width space."""
    return unicodedata.category(character) in _UNSEEN


def has_unseen(*texts: str) -> bool:
    """Tell whether one of the texts holds such a character, a line end among them."""
    return any(is_unseen(c) for text in texts if not text.isascii() or not text.isprintable() for c in text)


def visible(text: str, *, keep: frozenset[str] = frozenset()) -> str:
    r"""Return a text with every control, bidirectional and zero-width character written out, as \x1b or \u202e.

    keep: characters of this kind that may stand as they are.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(_written_out(c) if is_unseen(c) and c not in keep else c for c in text)


def visible_lines(text: str) -> str:
    """Return a text of several lines as `visible` does, its line ends and tabs kept."""
    return visible(text, keep=_KEPT)


def sentence(text: str) -> str:
    """Return a message as one line of at most 2000 characters, of which the middle is left out where it is longer."""
    line = visible(" ".join(text.splitlines()))
    return line if len(line) <= MOST else f"{line[: MOST * 3 // 4]} … {line[-MOST // 4 :]}"


def token(text: object, most: int = 40) -> str:
    """Return a piece of a file for a message: written out, at most `most` characters."""
    whole = str(text)
    return visible(whole if len(whole) <= most else whole[: most - 1] + "…")


def without_quotes(message: str) -> str:
    """Return a message of another library without what it quotes: that may be the content of any file."""
    return _QUOTED.sub("…", message)


def _written_out(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")
