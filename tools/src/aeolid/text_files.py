"""Read the TOML and JSON files of others: regular files within stated bounds, checked before a parser sees them.

The parsers of TOML and JSON build an object for every bracket and every part of a dotted key, some of them several
hundred bytes for two of text, and descend once a level of nesting. Counting brackets and dots first takes milliseconds
and bounds both.
"""

from __future__ import annotations

import json
import math
import re
import reprlib
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any, TypeGuard

from aeolid.errors import DataError
from aeolid.inputs import read_bounded
from aeolid.wording import did_you_mean

MOST_TOML = 1 << 20  # bytes: roles of 10,000 channels; the equations of a surrogate with 40 states take a tenth
MOST_JSON = 16 << 20  # bytes: a model with 800 states, all matrices full
MOST_DEPTH = 8  # levels of lists and tables: an LPV model's matrices, the deepest of our files, have four
MOST_LETTERS = 200  # of a name, a unit or a heading
_MOST_TOML_PARTS = 20_000  # tables, lists and dots of keys: 1 kB each in the parser, so 20 MB
_MOST_JSON_PARTS = 400_000  # lists and tables: a row of a matrix is one; 0.3 kB each, so 120 MB
_TOML_TEXT = re.compile(
    r'''"""(?:[^\\]|\\.)*?(?:"""|\Z)|'{3}.*?(?:'{3}|\Z)|"(?:[^"\\\n]|\\.)*+"?|'[^'\n]*+'?|#[^\n]*+''', re.DOTALL
)
_JSON_TEXT = re.compile(r'"(?:[^"\\]|\\.)*+"?', re.DOTALL)
_KEY = re.compile(r"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++)++")
_brief = reprlib.Repr()
_brief.maxstring = _brief.maxother = _brief.maxlong = 60
_brief.maxlevel = 3


def shown(value: Any) -> str:
    """Return a value of a file as a message shows it: its Python form, long or nested ones shortened.

    >>> len(shown("a" * 200))
    60
    """
    return _brief.repr(value)


def is_number(value: Any) -> TypeGuard[int | float]:
    """Tell whether a value of a file is a finite number: no truth value, and no integer beyond double precision."""
    try:
        return not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value)
    except OverflowError:
        return False


def is_short(value: Any) -> TypeGuard[str]:
    """Tell whether a value of a file is a text no longer than a name, a unit or a heading may be."""
    return isinstance(value, str) and len(value) <= MOST_LETTERS


def check_keys(table: Any, allowed: set[str], where: str) -> None:
    """Refuse keys nobody reads; a mistyped key must not be ignored."""
    if not isinstance(table, dict):
        raise DataError(f"{where}: a table is needed here, found {type(table).__name__}")
    unknown = sorted(set(table) - allowed)
    if unknown:
        hint = did_you_mean(unknown[0], sorted(allowed)) or ";"
        raise DataError(f"{where}: unknown key {shown(unknown[0])}{hint} allowed are {', '.join(sorted(allowed))}")


def read_text(path: str | Path, most: int = MOST_TOML) -> str:
    """Return the text of a regular file in UTF-8; raises DataError as `read_bounded` does, and where it is no text."""
    try:
        return read_bounded(path, most).decode("utf-8")
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: byte {error.start + 1} is no UTF-8 text") from None


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Return the content of a TOML text; raises DataError that names the source and what is wrong."""
    bare = _TOML_TEXT.sub(_blank, text)
    longest = max((key.count(".") + 1 for key in _KEY.findall(bare)), default=0)
    if longest > MOST_DEPTH:
        raise DataError(f"{source}: a key of {longest} dotted parts; at most {MOST_DEPTH} are read")
    _require_flat(bare, source, _MOST_TOML_PARTS, ".[{")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: TOMLDecodeError, and an integer of thousands of digits
        raise DataError(f"{source}: not valid TOML: {error}") from None


def parse_json(text: str, source: str) -> Any:
    """Return the content of a JSON text; raises DataError that names the source and what is wrong."""
    _require_flat(_JSON_TEXT.sub("_", text), source, _MOST_JSON_PARTS, "[{")
    try:
        return json.loads(text, object_pairs_hook=lambda pairs: _without_doubles(pairs, source))
    except (ValueError, RecursionError) as error:
        raise DataError(f"{source}: not valid JSON: {error}") from None


def _without_doubles(pairs: list[tuple[str, Any]], source: str) -> dict[str, Any]:
    """Return the pairs of a JSON object; refuses a key that stands there twice."""
    found = dict(pairs)
    if len(found) < len(pairs):
        double = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise DataError(f"{source}: the key {shown(double)} stands twice in one object; leave one of them out")
    return found


def load_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file of at most MOST_TOML bytes; raises DataError that names the file and the line."""
    return parse_toml(read_text(path), str(path))


def load_json(path: str | Path) -> Any:
    """Read a JSON file of at most MOST_JSON bytes; raises DataError that names the file."""
    return parse_json(read_text(path, MOST_JSON), str(path))


def _blank(found: re.Match[str]) -> str:
    """Return what stands for a string or a comment: a part of a key, or nothing."""
    return "" if found[0].startswith("#") else "_"


def _require_flat(bare: str, source: str, most: int, marks: str) -> None:
    """Refuse more brackets (and dots) or levels than the files read here have; `bare` is free of strings."""
    count = sum(bare.count(mark) for mark in marks)
    if count > most:
        raise DataError(f"{source}: {count} tables and lists, more than the {most} that such a file may have")
    depth = 0
    for bracket in re.findall(r"[\[\]{}]", bare):
        depth += 1 if bracket in "[{" else -1
        if depth > MOST_DEPTH:
            raise DataError(f"{source}: nested more than {MOST_DEPTH} levels deep")
