"""The catalogue of physics a model may lack: every module of the folder `entries` is one effect."""

from __future__ import annotations

import importlib
import pkgutil

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


def entry(identifier: str) -> Entry:
    """Return the entry with this id. Raises KeyError."""
    return _BY_ID[identifier]
