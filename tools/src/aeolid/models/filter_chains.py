"""Pass inputs through all filters that lie in front of the plant, one behind another."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from aeolid.models.input_filters import CHANGING, HELD_LATE, KINDS, LIMITING, WHOLE
from aeolid.models.intersample import PREFIX

Array = NDArray[np.float64]
_SHIFTING = (*HELD_LATE, "transport_delay")  # which let everything pass, later: their place in the order is free
_PARTS = 8  # of a piece, where what changes within a sample passes another filter: errors below 1 % of the input


class Filter(Protocol):
    """What is asked of an input filter: its channel, its kind, and the names of its parameters."""

    @property
    def channel(self) -> str:
        """Return the name of the input."""

    @property
    def kind(self) -> str:
        """Return which of KINDS it is."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Return the names of the parameters, in the order of the kind's slots."""


class Named(Protocol):
    """What is asked of an input."""

    @property
    def name(self) -> str:
        """Return its name."""


class Filtering(Protocol):
    """What is asked of a model: its inputs, the filters in front of them, and the place of each parameter."""

    @property
    def inputs(self) -> Sequence[Named]:
        """Return the inputs."""

    @property
    def filters(self) -> tuple[Filter, ...]:
        """Return the filters."""

    def index(self, parameter: str) -> int:
        """Return the place of a parameter in theta."""


F = TypeVar("F", bound=Filter)


def behind_filters(model: Filtering, u: Array, theta: Array, step: float, pieces: Array = WHOLE) -> dict[int, Array]:
    """Pass inputs (N, r) through what lies in front of the plant, in the order of the model's filters.

    A dead time, or a held command that is late or whose outputs are filtered, passes limits, plays and steps first, as
    it was given: the mean of a step that comes late by a part of a sample is a command that nobody gave. Where what
    changes within a sample passes another filter the samples are divided further: neither a limit nor a dead time
    lets through of the mean of a sample what it lets through of its parts.

    pieces (p,): of a step. Returns the means over them (N·p,), one after another, by the column of each input that
    passes a filter.
    """
    names, found = [s.name for s in model.inputs], dict[int, Array]()
    ordered, divided = in_order(model.filters), _divided(model.filters)
    finer = np.repeat(pieces / _PARTS, _PARTS)
    for f in ordered:
        column, own = names.index(f.channel), finer if f.channel in divided else pieces
        if column not in found:
            found[column] = np.repeat(u[:, column], len(own)).astype(np.float64, copy=False)
        values = np.array([theta[model.index(p)] for p in f.parameters])
        found[column] = KINDS[f.kind].rule(found[column], values, step, own)
    for channel in divided:
        column = names.index(channel)
        found[column] = found[column].reshape(-1, _PARTS).mean(axis=1)
    return found


@lru_cache(maxsize=256)
def in_order(filters: tuple[F, ...]) -> tuple[F, ...]:
    """Return filters with those that only shift in time behind what is not linear; the rest stays in order."""
    late = tuple(f for f in filters if f.kind in _SHIFTING)
    if not late or not any(f.kind in LIMITING for f in filters):
        return filters
    last = max(i for i, f in enumerate(filters) if f.kind in LIMITING)
    before = tuple(f for f in filters[: last + 1] if f not in late)
    return (*before, *late, *(f for f in filters[last + 1 :] if f not in late))


@lru_cache(maxsize=256)
def _divided(filters: tuple[Filter, ...]) -> tuple[str, ...]:
    """Return the channels whose held command changes within a sample before it passes a limit or another such filter.

    Not those that change between samples by themselves: their means are known a whole sample at a time.
    """
    result = []
    for channel in dict.fromkeys(f.channel for f in filters):
        kinds = [f.kind for f in in_order(filters) if f.channel == channel]
        changing = [k in CHANGING for k in kinds]
        chained = any(any(changing[:i]) and (k in LIMITING or changing[i]) for i, k in enumerate(kinds))
        if chained and not any(k.startswith(PREFIX) for k in kinds):
            result.append(channel)
    return tuple(result)
