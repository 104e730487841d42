"""Faults of channels against a simulator's run: units, names, clocks, the zero of the rotor angle, dropouts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.forensics import examine
from aeolid.diagnose.data.masking import masked_case
from aeolid.diagnose.data.strays import dropouts_of
from aeolid.diagnose.deadline import unlimited
from aeolid.diagnose.run_prior.conclude import diagnosis_of, study_run
from aeolid.diagnose.run_prior.pair import Change
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, SAMPLES, TURN = 0.1, 3000, 1.2
CONTEXT = {"machine": "wind turbine", "blades": 3, "rated_speed_rad_s": TURN}
CHANNELS = (
    Channel("pitch", "deg", "input"), Channel("speed", "rpm", "output"), Channel("tower_fa", "m/s^2", "output"),
    Channel("tower_ss", "m/s^2", "output"), Channel("flap_1", "kN m", "output"), Channel("flap_2", "kN m", "output"),
    Channel("flap_3", "kN m", "output"), Channel("azimuth", "rad", "azimuth"),
)  # fmt: skip


def turbine(seed: int) -> Record:
    """Return a rotor whose pitch acts on speed, tower (0.3 Hz) and three blades that tilt and yaw loads turn past."""
    rng = np.random.default_rng(seed)
    wind, up, side = (lfilter([0.1], [1.0, -0.9], rng.standard_normal(SAMPLES)) for _ in range(3))
    pitch = lfilter([0.3], [1.0, -0.7], rng.choice([-1.0, 1.0], SAMPLES // 8).repeat(8))
    speed = TURN + lfilter([0.01], [1.0, -0.95], wind - 0.5 * pitch)
    azimuth = np.cumsum(speed) * STEP
    w = 2 * np.pi * 0.3 * STEP
    r = np.exp(-0.05 * w)
    poles = [1.0, -2 * r * np.cos(w), r * r]
    thrust = lfilter([0.5], [1.0, -0.5], wind - 0.8 * pitch)
    axial = lfilter([0.1, -0.2, 0.1], poles, thrust) + 0.01 * rng.standard_normal(SAMPLES)
    lateral = lfilter([0.1, -0.2, 0.1], poles, side + 0.1 * pitch) + 0.01 * rng.standard_normal(SAMPLES)
    around = [azimuth + b for b in 2 * np.pi / 3 * np.arange(3)]
    blades = [9.0 + thrust + (1.0 + up) * np.cos(a) + (0.4 + side) * np.sin(a) for a in around]
    noise = 0.01 * rng.standard_normal((SAMPLES, 3))
    values = np.column_stack([14 + pitch, speed * 30 / np.pi, axial, lateral, np.column_stack(blades) + noise, azimuth])
    return Record(STEP * np.arange(SAMPLES), values, CHANNELS, STEP, f"turbine {seed}", "")


def changed(record: Record, **of: Callable[[Array], Array] | str) -> Record:
    """Return a recording with channels changed by a function or taken from another channel, by name."""
    values, names = record.values.copy(), [c.name for c in record.channels]
    for name, f in of.items():
        values[:, names.index(name)] = record.column(f) if isinstance(f, str) else f(record.column(name))
    return replace(record, values=values)


def told(recording: Record) -> dict[str, Any]:
    """Return the diagnosis of a recording against a run in other wind."""
    study = study_run([recording], [turbine(1)], CONTEXT, lambda text, share: None, unlimited())
    return diagnosis_of(study, "turbine", {c.name: c.unit for c in CHANNELS})


def later(samples: int) -> Callable[[Array], Array]:
    """Return what stamps a channel some samples late."""
    return lambda x: np.concatenate([np.full(samples, x[0]), x[:-samples]])


FAULTS: dict[str, tuple[dict[str, Callable[[Array], Array] | str], str, str, dict[str, float]]] = {
    "nothing": ({}, "", "", {}),
    "pitch in radians": ({"pitch": np.deg2rad}, "sensor_scale", "input:pitch", {"factor": np.pi / 180}),
    "speed in rad/s": ({"speed": lambda x: x * np.pi / 30}, "sensor_scale", "output:speed", {"factor": np.pi / 30}),
    "tower's axes": ({"tower_fa": "tower_ss", "tower_ss": "tower_fa"}, "data_channel_swap",
                     "outputs:tower_fa and tower_ss", {}),
    "blades' order": ({"flap_1": "flap_2", "flap_2": "flap_1"}, "data_channel_swap", "outputs:flap_1 and flap_2", {}),
    "a slow logger": ({"tower_fa": later(4)}, "data_time_offset", "output:tower_fa", {"offset_s": 0.4}),
    "angle's zero": ({"azimuth": lambda x: x + np.deg2rad(40)}, "sensor_bias", "channel:azimuth", {"bias": 40.0}),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_channels_is_told_as_such(fault: str) -> None:
    """Before, a pitch in radians was a wake or thin air, a late speed a missing mode, swapped axes a blade's mode."""
    change, entry, place, values = FAULTS[fault]
    found = told(changed(turbine(2), **change))
    effects = [(e["id"], e["location"]["entry"]) for e in found["effects"]]
    if not entry:
        assert (found["verdict"], effects) == ("no_mismatch", []), found["statement"]
        return
    assert (found["verdict"], effects) == ("data_fault", [(entry, place)]), found["statement"]
    for name, value in values.items():
        said = found["effects"][0]["parameters"][name]
        assert abs(said["value"] - value) < 3 * said["std"] + 0.02 * value


@pytest.mark.parametrize("blade", [3])
def test_the_blade_whose_moments_are_scaled_is_told(blade: int) -> None:
    """In the fixed frame a factor on one blade gains as much as on another: the levels among them tell."""
    found = told(changed(turbine(2), **{f"flap_{blade}": lambda x: 1.2 * x}))
    assert [e["location"]["entry"] for e in found["effects"]] == [f"output:flap_{blade}"], found["statement"]
    assert found["effects"][0]["id"] == "sensor_scale"


def test_changes_of_order_and_angle_add_up() -> None:
    first, then = Change(order=(1, 0, 2), turned=0.5), Change(order=(0, 2, 1), turned=0.25)
    both = then.after(first)
    y = np.array(["a", "b", "c"])
    assert [*y[list(both.order)]] == [*y[list(first.order)][list(then.order)]]
    assert both.turned == 0.75
    assert not both.is_of_recordings


def dropped(record: Record, name: str, share: float = 0.01, value: float = 0.0) -> Record:
    """Return a recording of which samples of a channel never arrived, and a number stands there."""
    lost = np.random.default_rng(5).random(SAMPLES) < share
    return changed(record, **{name: lambda x: np.where(lost, value, x)})


def test_dropouts_are_left_out_and_said() -> None:
    recording = dropped(turbine(2), "flap_1")
    case = Case("turbine", (recording,), "run", turbine(1), "run.csv", "", CONTEXT, Path())
    masked, _ = masked_case(case)
    lost = np.isnan(masked.records[0].column("flap_1"))
    np.testing.assert_array_equal(lost, recording.column("flap_1") == 0.0)
    assert any(f.check == "dropout" and "flap_1" in f.channel for f in examine([recording]))
    assert told(masked.records[0])["verdict"] == "no_mismatch"


@pytest.mark.parametrize(
    "signal",
    [
        np.round(np.sin(np.arange(3000) / 7), 1),  # coarse
        np.clip(np.sin(np.arange(3000) / 7.3), 0.0, 1.0),  # rests at zero
        np.where(np.arange(3000) % 50 == 0, 1.0, 0.0),  # pulses
        np.random.default_rng(1).standard_normal(3000).round(3),
        np.full(3000, np.nan),
        np.zeros(3000),
    ],
)  # fmt: skip
def test_levels_that_a_signal_has_are_no_dropouts(signal: Array) -> None:
    assert not dropouts_of(signal).any()
