"""Match the channels of a roles file with the headings of a table, and their units; write headings that are found.

A heading that begins with =, +, -, @ or a tab is a formula to a spreadsheet. Where we write one an apostrophe goes
before it, which the reader takes off again; names that begin with apostrophes and then such a sign get one more.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from aeolid.display import has_unseen, token, visible
from aeolid.errors import DataError
from aeolid.formats.table import listed
from aeolid.units import conversion
from aeolid.units import plain_unit as plain_unit  # part of this module's face, too
from aeolid.units import same_unit as same_unit
from aeolid.wording import did_you_mean

_FORMULA = re.compile("'*[=+\\-@\t\r＝＋－＠]")
_GUARDED = re.compile("'+[=+\\-@\t\r＝＋－＠]")


def heading_line(names: Sequence[str]) -> str:
    """Return the first line of a CSV file, its end included: quoted where needed, formulas made harmless."""
    cells = [f"'{n}" if _FORMULA.match(n) else n for n in names]
    return ",".join('"' + c.replace('"', '""') + '"' if any(s in c for s in ',;\t"\n\r') else c for c in cells) + "\n"


def bare_heading(cell: str) -> str:
    """Return the name behind a heading as `heading_line` writes it."""
    return cell[1:] if _GUARDED.match(cell) else cell


def fault_of_name(name: str, unit: str = "") -> str:
    """Say why a channel of this name and unit would not be found again in a file of ours; empty where it would."""
    if not name.strip() or name != name.strip():
        return "is empty" if not name.strip() else "begins or ends with a blank"
    if has_unseen(name):
        return "holds a control character"
    found = split_heading(name)[1]
    if found is not None and unit and plain_unit(found) and not same_unit(found, unit):
        return f"ends in what reads as the unit {visible(found)!r}"
    return ""


def require_readable(source: str, names: Sequence[str], units: Mapping[str, str]) -> None:
    """Refuse names that a file cannot hold so that its reader finds them; raises DataError."""
    for name in names:
        fault = fault_of_name(name, units.get(name, ""))
        if fault:
            raise DataError(f"{source}: the name {visible(name)!r} {fault}, so it is not written; rename the channel")


def harmless_name(name: str, unit: str) -> str:
    """Return a name as near as possible to one that a device sent, which every file of ours can hold; empty for blanks.

    Unseen characters are written out, and so are brackets that would read as a unit.
    """
    plain = visible(name).strip()
    if fault_of_name(plain, unit):
        plain = re.sub(r"[\[\]()]", lambda m: f"\\x{ord(m[0]):02x}", plain)
    return plain


def split_heading(heading: str) -> tuple[str, str | None]:
    """Split 'pitch [deg]', 'pitch (deg)' or 'pitch_[deg]' into name and unit; the unit is None where none stands."""
    text = heading.strip()
    opening = text.rfind({"]": "[", ")": "("}.get(text[-1:], "\0"))
    unit, end = text[opening + 1 : -1], max(opening, 0)
    while end and (text[end - 1] == "_" or text[end - 1].isspace()):
        end -= 1
    if end == 0 or text[-1] in unit:
        return text, None
    return text[:end], unit.strip()


def find_heading(wanted: str, names: Sequence[str], source: str) -> str:
    """Return the heading that is `wanted`, with or without a unit behind it.

    Raises DataError when it is absent (listing what exists and the nearest name) or stands there twice.
    """
    headings, own = _by_name(tuple(names)), bare_heading(wanted)
    exact = [wanted] * headings.count[wanted] or [own] * headings.count[own]
    found = exact or headings.bare.get(wanted, [])
    if len(found) == 1:
        return found[0]
    if found:
        told = f" ({listed(found)}); name one of them in full" if len(set(found)) > 1 else "; rename all but one"
        raise DataError(f"{source}: the heading {token(wanted)!r} stands there {len(found)} times{told}")
    hint = did_you_mean(wanted, headings.bare) if len(names) > 1 else ""
    # the first line of what is no table is not shown
    held = listed(list(headings.bare)) if len(names) > 1 else "one column only"
    raise DataError(
        f"{source}: no channel {token(wanted)!r}{hint or '.'} The file holds {held or 'no named channel'};"
        f" set `column` in the roles file to the heading"
    )


@dataclass(frozen=True)
class _Headings:
    """Hold how often each heading stands in a table, and the headings behind each name without its unit."""

    count: Counter[str]
    bare: dict[str, list[str]]


@lru_cache(maxsize=4)
def _by_name(names: tuple[str, ...]) -> _Headings:
    bare: dict[str, list[str]] = {}
    for name in names:
        bare.setdefault(split_heading(name)[0], []).append(name)
    return _Headings(Counter(names), bare)


def check_unit(source: str, channel: str, wanted: str, found: str | None) -> None:
    """Refuse a unit in the file that differs from the roles file; either may be silent about it."""
    if found is None or not wanted or same_unit(wanted, found):
        return
    if not plain_unit(found):
        return
    raise DataError(
        f"{source}: channel {channel!r} is in {found[:40]!r} in the file and in {wanted!r} in the roles file;"
        f" correct the unit in the roles file or {conversion(found, wanted)}"
    )
