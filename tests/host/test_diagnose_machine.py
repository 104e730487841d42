"""What kind of machine a case is about, and the angle of its rotor in any unit, are read the same way everywhere."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aeolid.diagnose.data.case import make_case
from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts.forces import per
from aeolid.diagnose.run_prior.laws import shifts_of
from aeolid.diagnose.run_prior.pair import side_of
from aeolid.diagnose.structure.anatomy import base_unit
from aeolid.errors import DataError
from aeolid.models.angles import radians_a_unit
from aeolid.record import Channel, Record

DEGREES = np.arange(8000) * 7.0 % 360.0
IN_UNITS = [
    ("deg", 1.0), ("Deg", 1.0), (" degrees", 1.0), ("°", 1.0), ("", 1.0), ("rev", 1 / 360), ("", 1 / 360),
    ("rad", np.pi / 180), ("", np.pi / 180),
]  # fmt: skip


@pytest.mark.parametrize(
    ("machine", "wind"),
    [
        ("wind turbine", True), ("turbine", True), ("5 MW wind turbine", True), ("wind-turbine", True),
        ("Offshore wind_turbine", True), ("WindTurbine", True), ("steam turbine", False), ("turbine blade rig", False),
        ("rig", False), ("", False),
    ],
)  # fmt: skip
def test_a_wind_turbine_is_one_however_it_is_written(machine: str, wind: bool) -> None:
    assert is_turbine({"machine": machine}) == wind


@pytest.mark.parametrize(("unit", "scale"), IN_UNITS)
def test_an_angle_is_in_radians_whatever_its_unit(unit: str, scale: float) -> None:
    values = DEGREES * scale
    values[[10, 500]] = np.nan
    assert radians_a_unit(unit, values) * scale == pytest.approx(np.pi / 180)


def _record(unit: str, scale: float, load: float) -> Record:
    """Return a rotor whose blades feel the wind above more than below; load: what they feel on average."""
    rng = np.random.default_rng(3)
    wind = 10 + np.repeat(rng.standard_normal(80), 100)
    blades = [
        load * wind + 5 * np.cos(np.radians(DEGREES + 120 * b)) + 0.1 * rng.standard_normal(len(wind)) for b in range(3)
    ]
    channels = (
        Channel("pitch", "deg", "input"), *(Channel(f"flap{b}", "kN m", "output") for b in (1, 2, 3)),
        Channel("wind", "m/s", "scheduling"), Channel("angle", unit, "azimuth"),
    )  # fmt: skip
    values = np.column_stack([rng.standard_normal(len(wind)), *blades, wind, DEGREES * scale])
    return Record(0.1 * np.arange(len(wind)), values, channels, 0.1, "monday", "")


@pytest.mark.parametrize(("unit", "scale"), IN_UNITS)
def test_a_pair_and_its_laws_see_the_same_rotor_in_any_unit(unit: str, scale: float) -> None:
    record = _record(unit, scale, 2.0)
    side = side_of(record, ("pitch",), ("flap1",), {})
    assert side.azimuth is not None
    np.testing.assert_allclose(side.azimuth, np.radians(DEGREES), atol=1e-9)
    tilts = [
        shifts_of([_record(u, s, 2.0)], [_record("deg", 1.0, 2.2)], {"blades": 3})["tilt"]
        for u, s in ((unit, scale), ("deg", 1.0))
    ]
    assert tilts[0].level == pytest.approx(5.0, rel=0.05)
    assert tilts[0].value == pytest.approx(tilts[1].value, abs=1e-9)


def test_a_case_from_memory_is_checked_as_one_from_a_folder() -> None:
    """A rated speed in rpm, where the recorded angle turns as a turbine does."""
    record = _record("deg", 1.0, 2.0)
    context = {"machine": "wind turbine", "blades": 3, "rated_speed_rad_s": 1.2217 * 30 / np.pi}
    with pytest.raises(DataError, match="rad/s are wanted, not rpm"):
        make_case([record], record, title="rotor", source="run", sha256="", context=context)


@pytest.mark.parametrize(
    ("unit", "position"),
    [
        ("mm/s", "mm"), ("m / s^2", "m"), ("rad/s**2", "rad"), ("m/s2", "m"), ("m/s²", "m"), ("rpm", "rpm s"),
        ("1/min", "1/min s"), ("rad/min", "rad/min s"), ("km/h", "km/h s"), ("g", "g s^2"), ("N/m", "N/m"),
        ("1/s", "1"), ("", "1"), ("mm", "mm"),
    ],
)  # fmt: skip
def test_the_unit_of_a_position_is_what_a_velocity_adds_up_to_in_seconds(unit: str, position: str) -> None:
    assert base_unit(unit) == position


@pytest.mark.parametrize(
    ("position", "per_position", "per_velocity"),
    [("m", "N/m", "N/(m/s)"), ("rpm s", "N/(rpm s)", "N/rpm"), ("", "N/1", "N/(1/s)")],
)
def test_coefficients_of_a_force_have_units_that_are_true(position: str, per_position: str, per_velocity: str) -> None:
    motion: Any = SimpleNamespace(position_unit=position, force_unit="N")
    assert per(motion, 1) == per_position and per(motion, 2) == f"{per_position}^2"
    assert per(motion, 1, velocity=True) == per_velocity
