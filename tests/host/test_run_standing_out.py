"""A mode that the runs lack altogether stands out of the spectra: on made turbines with and without their tower."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

from aeolid.diagnose.deadline import unlimited
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior import explain as explaining
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.explain import explain
from aeolid.diagnose.run_prior.modal import Absent, Modal, compare_modes
from aeolid.diagnose.run_prior.pair import NOTHING, Change, Side
from aeolid.diagnose.run_prior.proof import _foretold, _series, prove
from aeolid.diagnose.run_prior.search import Search
from aeolid.diagnose.run_prior.standing_out import local_of, local_rise, lone_mode, once_of, risen_of
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, SAMPLES, SPEED, FIT = 0.05, 12_000, 1.2, 0.7
CONTEXT = {"machine": "wind turbine", "blades": 3, "rated_speed_rad_s": SPEED}
CHANNELS = (
    Channel("pitch", "deg", "input"), Channel("rotor_speed", "rad/s", "output"),
    Channel("tower_acc_fore_aft", "m/s^2", "output"), Channel("tower_acc_side_side", "m/s^2", "output"),
    Channel("azimuth", "rad", "azimuth"),
)  # fmt: skip
TOWER = (0.33, 0.08)  # Hz and damping ratio


def swung(force: Array, hz: float, damping: float) -> Array:
    """Return the acceleration of a mass on a spring that a force moves, held between samples."""
    w = 2 * np.pi * hz
    b, a, _ = cont2discrete(([1.0, 0.0, 0.0], [1.0, 2 * damping * w, w * w]), STEP, "zoh")
    out: Array = lfilter(b.ravel(), a, force)
    return out


@cache
def turbine(seed: int, hz: float = TOWER[0], line: float = 0.0, bent: float = 1.0) -> Record:
    """Return a recording with the tower's modes at hz and 0.95 hz, of 0 none; line: of a force once a revolution.

    bent: size of a further mode at 2.9 Hz in both accelerations.
    """
    rng = np.random.default_rng(seed)
    wind = lfilter([0.1], [1, -0.99], rng.standard_normal(SAMPLES))
    pitch = lfilter([0.3], [1, -0.9], rng.standard_normal(SAMPLES))
    force, aside = wind - 0.3 * pitch, 0.1 * rng.standard_normal(SAMPLES)
    azimuth = np.cumsum(np.full(SAMPLES, SPEED)) * STEP
    second = bent * 0.02 * swung(force, 2.9, 0.02)
    towers = np.zeros((2, SAMPLES)) if hz == 0 else np.array([swung(force, hz, 0.08), swung(aside, 0.95 * hz, 0.01)])
    speed = lfilter([STEP], [1, -0.99], force)
    outputs = [speed, towers[0] + second, towers[1] + second + line * np.cos(azimuth)]
    values = np.column_stack([pitch, *outputs, azimuth])
    values[:, 1:4] += 1e-3 * rng.standard_normal((SAMPLES, 3))
    return Record(STEP * np.arange(SAMPLES), values, CHANNELS, STEP, f"turbine {seed}", "")


def test_a_tower_that_the_run_lacks_is_found_with_its_frequency() -> None:
    pair = pair_of([turbine(1)], [turbine(2, 0.0)], CONTEXT)
    found = lone_mode(pair, compare_modes(pair, CONTEXT), CONTEXT, FIT)
    assert found is not None
    hz = {"tower_fore_aft": TOWER[0], "tower_side_side": 0.95 * TOWER[0]}[found.kind]
    assert found.frequency_hz == pytest.approx(hz, rel=0.05)
    assert found.output == f"tower_acc_{found.kind.removeprefix('tower_')}"


def stiff(seed: int) -> Record:
    """Return a turbine whose tower leaves over what a mode of 4 Hz moves, a thousandth of it."""
    made = turbine(seed, 0.0, bent=0.0)
    values = made.values.copy()
    values[:, 2] = 1e-3 * swung(np.gradient(made.values[:, 1], STEP), 4.0, 0.05)
    return replace(made, values=values)


def test_the_mode_of_a_rigid_tower_is_where_the_recording_swings_most() -> None:
    """The ratio of powers grows towards slow motion, far below the mode."""
    pair = pair_of([turbine(1)], [stiff(2)], CONTEXT)
    rigid = in_force().run_prior.rigid_log
    found = lone_mode(pair, compare_modes(pair, CONTEXT), CONTEXT, FIT, rigid)
    assert found is not None and found.kind == "tower_fore_aft"
    assert found.frequency_hz == pytest.approx(TOWER[0], rel=0.05)
    assert explain(pair, CONTEXT, {}, unlimited()).found[0].mode is not None


def test_swapped_axes_are_no_rigid_tower_and_a_rigid_tower_no_swapped_axes() -> None:
    rigid = in_force().run_prior.rigid_log
    order = [0, 1, 3, 2, 4]
    recorded = turbine(1)
    swapped = replace(recorded, values=recorded.values[:, order])
    change = Change(order=(0, 2, 1))
    pair = pair_of([swapped], [turbine(2)], CONTEXT)
    behind = pair.rewired(change)
    assert lone_mode(behind, compare_modes(behind, CONTEXT), CONTEXT, FIT, rigid) is None
    found = explain(pair, CONTEXT, {c.name: c.unit for c in CHANNELS}, unlimited()).found
    assert [f.scored.hypothesis.entry for f in found if f.scored is not None] == ["data_channel_swap"]
    rigidly = pair_of([recorded], [stiff(2)], CONTEXT)
    assert lone_mode(rigidly.rewired(change), compare_modes(rigidly, CONTEXT), CONTEXT, FIT, rigid) is not None


@pytest.mark.parametrize(
    "recording", [turbine(3), turbine(4, 0.9 * TOWER[0]), turbine(5, line=3.0)], ids=["wind", "softer", "imbalance"]
)
def test_other_wind_a_softer_tower_and_an_imbalance_are_no_missing_mode(recording: Record) -> None:
    """Both sides swing; a line once a revolution is left out, however far it stands out."""
    pair = pair_of([recording], [turbine(2)], CONTEXT)
    assert lone_mode(pair, compare_modes(pair, CONTEXT), CONTEXT, FIT) is None


def test_the_power_once_a_revolution_grows_where_it_turns() -> None:
    grown = once_of(pair_of([turbine(5, line=3.0)], [turbine(2)], CONTEXT), CONTEXT)
    assert grown["tower_acc_side_side"] > 2
    assert abs(grown["tower_acc_fore_aft"]) < 1.5  # of seven segments each, one line: deviations of 0.3 to 0.6
    assert once_of(pair_of([turbine(5)], [turbine(2)], CONTEXT), {"machine": "pump"}) == {}


def test_short_sides_gaps_and_other_machines_end_without_an_answer() -> None:
    """No segment fits a sealed part of 90 s; a segment with a gap is left out; a machine without a rotor has none."""
    long, run = turbine(1), turbine(2, 0.0)
    short = replace(long, values=long.values[:3000], time_s=long.time_s[:3000])
    pair = pair_of([short], [run], CONTEXT)
    assert lone_mode(pair, Modal((), (), ()), CONTEXT, FIT) is None
    holes = long.values.copy()
    holes[5000:5040, 2] = np.nan
    gappy = pair_of([replace(long, values=holes)], [run], CONTEXT)
    risen = risen_of(gappy, SPEED / (2 * np.pi), FIT)
    assert risen is not None and np.isfinite(risen.whole).all()
    whole = pair_of([long], [run], CONTEXT)
    assert lone_mode(whole, Modal((), (), ()), CONTEXT, FIT) is None  # no mode is known there
    assert lone_mode(whole, Modal((), (), ()), {"machine": "pump"}, FIT) is None


def test_a_further_mode_that_the_run_lacks_stands_out_beside_its_own_frequency() -> None:
    """Errors one row ahead grow by 4 % at most, and modes of noise are absent, too, which do not stand out."""
    pair = pair_of([turbine(6, bent=4.0)], [turbine(9, bent=0.0)], CONTEXT)
    found = explain(pair, CONTEXT, {}, unlimited())
    assert len(found.found) == 1 and found.found[0].mode is not None and found.found[0].rise is not None
    assert found.found[0].mode.frequency_hz == pytest.approx(2.9, rel=0.02)
    proof = prove(pair, found, Search(pair).ridge)
    assert proof.interval[0] > 3.0


@pytest.mark.parametrize(("lacking", "entry"), [("tower_acc_side_side", ""), ("rotor_speed", "edge"), (None, "edge")])
def test_an_edgewise_pair_is_one_unless_the_output_that_shows_it_lacks_its_own_mode(
    lacking: str | None, entry: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A simulated tower that does not sway shows no blade whirl either: with it missing, 0.88 and 1.28 Hz are, too."""
    turn, side = SPEED / (2 * np.pi), "tower_acc_side_side"
    whirl = tuple(Absent(1.08 + k * turn, 0.003, 0.01, 0.002, side, "", (side,)) for k in (-1, 1))
    lone = None if lacking is None else Absent(0.32, 0.001, 0.005, 0.001, lacking, "tower_side_side", (lacking,))
    monkeypatch.setattr(explaining, "lone_mode", lambda *_: lone)
    pair = pair_of([turbine(3)], [turbine(2)], CONTEXT)
    found = explaining._from_modes(Modal((), (), whirl), dict.fromkeys(pair.shown, 2.0), CONTEXT, pair, False)
    assert len(found) == 1 and found[0].edge is (entry == "edge")
    assert found[0].mode is lone or entry == "edge"


def test_what_differs_otherwise_does_not_stand_out_beside_any_mode() -> None:
    """Other wind, a stronger wind, an imbalance: the ratio of powers goes on beside every mode of the recording."""
    for recording in (turbine(3), turbine(5, line=3.0)):
        pair = pair_of([recording], [turbine(2)], CONTEXT)
        for hz, damping in ((TOWER[0], TOWER[1]), (2.9, 0.02), (1.1, 0.05)):
            absent = Absent(hz, 0.01, damping, 0.01, pair.shown[1], "", pair.shown[1:])
            assert local_of(pair, absent, SPEED / (2 * np.pi), FIT) is None


def test_blades_that_pass_are_no_mode_where_their_other_multiples_rise_as_well() -> None:
    """Lines three and six times a revolution, alike: one of them is not told to be a mode at its frequency."""
    made = turbine(7)
    angle = made.column("azimuth")
    noise = np.random.default_rng(1).standard_normal(SAMPLES)
    loads = sum(np.cos(k * angle + 0.02 * np.cumsum(noise)) for k in (3, 6, 9))
    values = made.values.copy()
    values[:, 2] += 0.3 * loads
    pair = pair_of([replace(made, values=values)], [turbine(2)], CONTEXT)
    hz = 6 * SPEED / (2 * np.pi)
    rise = local_rise(pair, "tower_acc_fore_aft", hz, 0.01, FIT)
    assert rise is not None and rise.is_plain
    absent = Absent(hz, 0.01, 0.01, 0.01, "tower_acc_fore_aft", "", ("tower_acc_fore_aft",))
    assert local_of(pair, absent, SPEED / (2 * np.pi), FIT) is None


def test_an_effect_beside_a_missing_mode_is_in_the_proof() -> None:
    """Lines of the rotor's angle beside a missing tower are regressors of the sealed part and of its series, too."""
    pair = pair_of([turbine(8, line=3.0)], [turbine(2, 0.0)], CONTEXT)
    found = explain(pair, CONTEXT, {}, unlimited())
    assert any(f.mode is not None for f in found.found)

    def turning(side: Side) -> Array:
        assert side.azimuth is not None
        return np.column_stack([np.cos(side.azimuth), np.sin(side.azimuth)])

    alone, ridge = replace(found, change=NOTHING), Search(pair).ridge
    both = prove(pair, replace(alone, change=Change(extra=turning)), ridge)
    assert both.gain > prove(pair, alone, ridge).gain + 20
    assert set(both.series) == set(pair.shown)


def test_the_sealed_part_of_every_recording_is_in_the_series() -> None:
    """Each in its turn, as if it had been the only one of the recordings."""
    pair = pair_of([turbine(8, line=3.0), turbine(9, line=3.0)], [turbine(2, 0.0)], CONTEXT)
    bare = _foretold(pair, NOTHING, Search(pair).ridge, np.linspace(FIT, 1.0, 3), 0.3)
    series = _series(pair, bare, bare, NOTHING)[pair.shown[0]]
    stretch = np.array(series["stretch"])
    assert len(stretch) == len(series["time_s"]) == len(series["after"]) and set(stretch.tolist()) == {1, 2}  # type: ignore[arg-type]
    for number, side in enumerate(pair.recordings, start=1):
        theta = np.zeros((pair.past * len(pair.scale) + pair.held + 1, len(pair.shown)))
        times, measured, _ = pair.predicted(side, NOTHING, theta, FIT)
        np.testing.assert_array_equal(np.array(series["time_s"])[stretch == number], times)
        np.testing.assert_array_equal(np.array(series["measured"])[stretch == number], measured[:, 0])


def test_a_band_beyond_what_samples_show_has_no_answer() -> None:
    pair = pair_of([turbine(1)], [turbine(2)], CONTEXT)
    assert local_rise(pair, "tower_acc_fore_aft", 9.5, 0.02, FIT) is None
