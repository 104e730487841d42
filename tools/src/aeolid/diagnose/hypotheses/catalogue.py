"""The catalogue of physics a model may lack: every module of the folder `entries` is one effect."""

from __future__ import annotations

import importlib
import pkgutil
import re

from aeolid.diagnose.hypotheses import entries
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.hypotheses.parts.base import Entry, Quantity
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
_FORCE = re.compile(r"^(force_N|torque_N_m|acceleration|amplitude)(?=_|$)")
_BY_NAME = "theta"  # a declared parameter, reported by its own name
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


def quantity_of(identifier: str, label: str) -> Quantity | None:
    """Return the quantity of an entry that a reported parameter is; None where the entry has none.

    A force is named by what it is in a model (a torque, an acceleration, what an output shows of it), one of several
    places or modes with its place or number within the name, and a declared parameter by itself.
    """
    own = _BY_ID[identifier].quantities if identifier in _BY_ID else ()
    bare = re.sub(r"\d+(?=_hz$|$)", "", label)
    plain = [bare, *(_FORCE.sub(name, bare) for name in ("force_N", "torque_N_m"))]
    alike = [*plain, *(re.sub(r"^(force_N|torque_N_m)_.*(?=_(cos|sin)$)", r"\1", name) for name in plain)]
    fits = (q for name in (label, *alike) for q in own if q.symbol == name)
    begun = (q for q in own if label.startswith(f"{q.symbol}_") or q.symbol == _BY_NAME)
    return next(fits, None) or next(begun, None)


def meaning_of(identifier: str, symbol: str) -> str:
    """Return what a parameter of an effect means, in words; empty where the entry does not say."""
    found = quantity_of(identifier, symbol)
    return "" if found is None else found.meaning
