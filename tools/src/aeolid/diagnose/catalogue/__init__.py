"""The catalogue of physics a model may lack: one small declarative module an entry."""

from __future__ import annotations

from aeolid.diagnose.catalogue import (
    actuator_lag,
    aero_imbalance,
    aero_nonlinearity,
    air_density,
    controller_state,
    coulomb_friction,
    cp_change,
    cubic_stiffness,
    dynamic_inflow,
    efficiency_loss,
    gravity_1p,
    mass_imbalance,
    missing_coupling,
    missing_disturbance,
    operating_region_switch,
    parameter_error,
    rotational_sampling,
    sensor_rectified,
    structural_mode,
    tower_shadow,
    transport_delay,
    unsteady_aero,
    wave_load,
    wind_shear,
    yaw_misalignment,
)
from aeolid.diagnose.catalogue.base import Entry

ENTRIES: tuple[Entry, ...] = (
    actuator_lag.ENTRY,
    transport_delay.ENTRY,
    coulomb_friction.ENTRY,
    cubic_stiffness.ENTRY,
    sensor_rectified.ENTRY,
    structural_mode.ENTRY,
    mass_imbalance.ENTRY,
    aero_imbalance.ENTRY,
    gravity_1p.ENTRY,
    wind_shear.ENTRY,
    yaw_misalignment.ENTRY,
    tower_shadow.ENTRY,
    rotational_sampling.ENTRY,
    dynamic_inflow.ENTRY,
    unsteady_aero.ENTRY,
    aero_nonlinearity.ENTRY,
    operating_region_switch.ENTRY,
    cp_change.ENTRY,
    air_density.ENTRY,
    efficiency_loss.ENTRY,
    wave_load.ENTRY,
    missing_coupling.ENTRY,
    missing_disturbance.ENTRY,
    controller_state.ENTRY,
    parameter_error.ENTRY,
)


def entry(identifier: str) -> Entry:
    """Return the entry with this id."""
    return next(e for e in ENTRIES if e.id == identifier)
