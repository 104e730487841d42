"""Sample a functional mock-up unit around the recording: its run then serves as a simulator's run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.models.exchange.fmu import Fmu, run_fmu
from aeolid.record import Record

Array = NDArray[np.float64]
_PROBE = 0.5  # of an input's own spread: as large as what the recording does, so that the same range is seen
_HOLD = 5  # samples between two changes of the probe
_SEED = 20
_NOISE = 0.01  # of an output's spread, so that a noise-free run does not claim to be known without end


def sample_fmu(unit: Fmu, record: Record) -> Record:
    """Run the unit on the recorded inputs plus random binary probes, from the recording's first value.

    Inputs of a closed loop, or one that never moves, would not tell the unit's paths apart; the probes do. Returns a
    recording of the unit: inputs and outputs, under the names and units of the real one.
    """
    names, outputs = record.names("input"), record.names("output")
    u = record.columns(names)
    if not np.all(np.isfinite(u)):
        row, column = np.argwhere(~np.isfinite(u))[0]
        raise NotIdentifiable(
            f"{record.source}: input {names[column]} is missing at sample {row + 1}; the unit needs it"
        )
    rng = np.random.default_rng(_SEED)
    size = np.maximum(np.std(u, axis=0), 1e-3 * np.maximum(np.abs(u).max(axis=0, initial=0.0), 1e-6))
    probe = np.repeat(rng.choice([-1.0, 1.0], size=(len(u) // _HOLD + 1, len(names))), _HOLD, axis=0)[: len(u)]
    driven = u + _PROBE * size * probe
    y = run_fmu(unit, dict(zip(names, driven.T, strict=True)), outputs, record.sample_time_s)
    y = y + _NOISE * np.std(y, axis=0) * rng.standard_normal(y.shape)
    kept = [c for c in record.channels if c.role in ("input", "output")]
    columns = {**dict(zip(names, driven.T, strict=True)), **dict(zip(outputs, y.T, strict=True))}
    return replace(
        record, values=np.column_stack([columns[c.name] for c in kept]), channels=tuple(kept), source=str(unit.path)
    )
