"""The catalogue of physics a model may lack: every module of the folder `entries` is one effect."""

from __future__ import annotations

import importlib
import pkgutil
import re

from aeolid.diagnose.hypotheses import entries
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.hypotheses.parts.base import Entry
from aeolid.errors import DataError


def _found() -> tuple[Entry, ...]:
    """Return the entries in the order of their rank; a module without one, or under another name, is a mistake."""
    found = []
    for module in pkgutil.iter_modules(entries.__path__):
        found.append(importlib.import_module(f"{entries.__name__}.{module.name}").ENTRY)
        if found[-1].id != module.name:
            raise DataError(f"{module.name}.py holds the entry {found[-1].id!r}; a module has the name of its entry")
    return tuple(sorted(found, key=lambda e: (e.rank, e.id)))


ENTRIES: tuple[Entry, ...] = _found()
_BY_ID = {e.id: e for e in (*ENTRIES, unlisted.ENTRY)}
_LISTED = re.compile(rf"\b(?:{'|'.join(i for i in _BY_ID if '_' in i)})\b")


def entry(identifier: str) -> Entry:
    """Return the entry with this id. Raises KeyError."""
    return _BY_ID[identifier]


def name_of(identifier: str) -> str:
    """Return the words for an effect; what is no entry keeps its own, without underscores."""
    return _BY_ID[identifier].name if identifier in _BY_ID else identifier.replace("_", " ")


def in_words(text: str) -> str:
    """Return a text with the ids of effects in it as their words."""
    return _LISTED.sub(lambda found: _BY_ID[found[0]].name, text)


def meaning_of(identifier: str, symbol: str) -> str:
    """Return what a parameter of an effect means, in words; empty where the entry does not say."""
    quantities = _BY_ID[identifier].quantities if identifier in _BY_ID else ()
    return next((q.meaning for q in quantities if q.symbol == symbol), "")
