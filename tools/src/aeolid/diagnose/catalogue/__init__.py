"""The catalogue of physics a model may lack: one small declarative module an entry."""

from __future__ import annotations

from aeolid.diagnose.catalogue import (
    actuator_lag,
    coulomb_friction,
    cubic_stiffness,
    parameter_error,
    sensor_rectified,
    structural_mode,
    transport_delay,
)
from aeolid.diagnose.catalogue.base import Entry

ENTRIES: tuple[Entry, ...] = (
    actuator_lag.ENTRY,
    transport_delay.ENTRY,
    coulomb_friction.ENTRY,
    cubic_stiffness.ENTRY,
    sensor_rectified.ENTRY,
    structural_mode.ENTRY,
    parameter_error.ENTRY,
)


def entry(identifier: str) -> Entry:
    """Return the entry with this id."""
    return next(e for e in ENTRIES if e.id == identifier)
