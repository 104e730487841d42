"""What turns with a rotor whose angle is not recorded, found by its recorded speed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from aeolid.diagnose.deadline import unlimited
from aeolid.diagnose.run_prior.beside import without
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.conclude import diagnosis_of, study_run
from aeolid.diagnose.run_prior.turning import turned
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, SAMPLES, GEAR = 0.1, 5000, 97.0
CONTEXT = {"machine": "wind turbine", "blades": 3, "rated_speed_rad_s": 1.2, "gearbox_ratio": GEAR}
CHANNELS = (
    Channel("pitch", "deg", "input"), Channel("generator_speed", "rpm", "output"),
    Channel("tower_acc_side_side", "m/s^2", "output"),
)  # fmt: skip


@cache
def machine(seed: int, heavy: float = 0.0) -> Record:
    """Return a rotor that wind and pitch speed up, on a tower (0.3 Hz) that sways; heavy: a force that turns, m/s^2."""
    rng = np.random.default_rng(seed)
    pitch = lfilter([0.3], [1.0, -0.7], rng.choice([-1.0, 1.0], SAMPLES // 10).repeat(10))
    wind = lfilter([0.05], [1.0, -0.95], rng.standard_normal(SAMPLES))
    speed = 1.2 + lfilter([0.004], [1.0, -0.98], wind - 0.5 * pitch)
    angle = np.cumsum(speed) * STEP
    w, h = 2 * np.pi * 0.3, STEP
    force = wind + 0.3 * pitch + heavy * np.sin(angle + 0.7) + 0.3 * rng.standard_normal(SAMPLES)
    r = np.exp(-0.05 * w * h)
    sway = lfilter([1.0, -2.0, 1.0], [1.0, -2 * r * np.cos(w * h), r * r], force)
    values = np.column_stack([pitch, speed * GEAR * 30 / np.pi, sway + 0.01 * rng.standard_normal(SAMPLES)])
    return Record(STEP * np.arange(SAMPLES), values, CHANNELS, STEP, f"machine {seed}", "")


@pytest.mark.parametrize(("unit", "of_rotor"), [("rpm", 1.0), ("rad/s", 1.0), ("rpm", GEAR), ("deg/s", GEAR)])
def test_the_angle_is_the_integral_of_either_speed(unit: str, of_rotor: float) -> None:
    t = STEP * np.arange(300)
    speed = 1.1 + 0.1 * np.sin(0.5 * t)
    in_unit = speed * of_rotor * {"rpm": 30 / np.pi, "rad/s": 1.0, "deg/s": 180 / np.pi}[unit]
    name = "rotor_speed" if of_rotor == 1.0 else "generator_speed"
    record = Record(t, in_unit[:, None], (Channel(name, unit, "output"),), STEP, "", "")
    angle = turned(record, CONTEXT)
    assert angle is not None
    np.testing.assert_allclose(angle, 1.1 * t + 0.2 * (1 - np.cos(0.5 * t)), atol=1e-3)


def test_no_angle_without_a_speed_that_fits_the_machine() -> None:
    record = machine(1)
    assert turned(record, {}) is None
    assert turned(record, {**CONTEXT, "gearbox_ratio": 20.0}) is None
    renamed = replace(record, channels=(record.channels[0], replace(record.channels[1], name="y"), record.channels[2]))
    assert turned(renamed, CONTEXT) is None


def told(recording: Record, run: Record) -> tuple[str, list[str]]:
    """Return verdict and names of a pair."""
    study = study_run([recording], [run], CONTEXT, lambda text, share: None, unlimited())
    found = diagnosis_of(study, "rotor", {c.name: c.unit for c in CHANNELS})
    return found["verdict"], [e["id"] for e in found["effects"]]


def test_an_imbalance_is_named_without_a_recorded_angle_and_nothing_where_there_is_none() -> None:
    verdict, names = told(machine(3, heavy=0.15), machine(2))
    assert verdict in ("named", "ambiguous")
    assert names[0] == "mass_imbalance"
    assert set(names) <= {"mass_imbalance", "aero_imbalance"}
    assert told(machine(4), machine(2)) == ("no_mismatch", [])
    assert told(machine(5, heavy=0.15), machine(6, heavy=0.15)) == ("no_mismatch", [])  # the simulation has it, too


def test_a_pair_without_an_output_is_that_of_the_other_channels() -> None:
    pair = pair_of([machine(3)], [machine(2)], CONTEXT)
    rest = without(pair, {"tower_acc_side_side"})
    assert rest is not None
    assert rest.shown == ("generator_speed",)
    held = len(pair.inputs) * pair.stride
    m = held + len(pair.shown)
    places = [i * m + j for i in range(pair.past) for j in range(held + 1)]
    np.testing.assert_allclose(
        rest.of_runs().regions[0].Z[: len(places), : len(places)],
        pair.of_runs().regions[0].Z[np.ix_(places, places)],
        rtol=1e-9,
    )
    assert without(pair, set(pair.shown)) is None
