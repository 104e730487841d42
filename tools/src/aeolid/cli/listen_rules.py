"""Decide of which nodes modes are followed, and which of their samples are handed on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from aeolid.can.limits import MODES_REGRESSORS

if TYPE_CHECKING:
    from aeolid.can.configuration import Configuration
    from aeolid.can.tables import SampleTable
    from aeolid.identify.live import LiveModes

SETTLE = 16  # samples that an incomplete one may be late


def find_problem(configuration: Configuration) -> str:
    """Say why a node cannot have live modes, empty where it can."""
    d = configuration.description
    if d.sample_every != 1:
        sent = f"one sample in {d.sample_every}" if d.sample_every else "no samples"
        return f"the node sends {sent}; modes need every one"
    if d.regressors > MODES_REGRESSORS:
        return (
            f"the node's filter has {d.regressors} regressors (past window {d.past}); modes are followed up to"
            f" {MODES_REGRESSORS}: record, and use aeolid identify"
        )
    return ""


def live_of(configuration: Configuration, order: int | None) -> LiveModes:
    """Return live modes for what a node described; raises AeolidError where it cannot be."""
    from aeolid.can.run import channels_of
    from aeolid.identify.live import LiveModes, LiveSettings

    d = configuration.description
    m = d.inputs + d.outputs
    return LiveModes(
        LiveSettings(
            d.names[: d.inputs], d.names[d.inputs : m], d.past, d.sample_time_s, d.forgetting, d.regularisation,
            d.feedthrough, d.model_set, np.asarray(d.offset[:m]), np.asarray(d.scale[:m]), order,
            channels_of(configuration)[m:], d.units[d.inputs : m],
        )
    )  # fmt: skip


def starts_again(tables: list[SampleTable], used: int | None, before: int) -> bool:
    """Tell whether the newest run is not the one that was followed: its index went back.

    used: index of the last sample handed on; before: tables at the last look.
    """
    newest = tables[-1].index
    if used is None:
        return False
    return int(newest[-1]) < used or (len(tables) > before and int(newest[0]) <= used)


def fresh(table: SampleTable, used: int | None, last: bool) -> NDArray[np.int64]:
    """Return the rows of a table that are new and settled: complete, or older than a sample may come late."""
    rows = np.flatnonzero(table.index > (-1 if used is None else used))
    if last or not len(rows):
        return rows
    whole = np.isfinite(table.values[rows]).all(axis=1)
    late = table.index[rows] > table.index[-1] - SETTLE
    open_ones = np.flatnonzero(late & ~whole)
    return rows[: open_ones[0]] if len(open_ones) else rows
