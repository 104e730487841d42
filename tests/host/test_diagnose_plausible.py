"""Whether fitted values can be what they stand for, and which of them the data know at all."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from study_modules import load_study

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.candidates.plausible import objection, undetermined, undriven, values_of, without_the_mute
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.hypotheses.entries import end_stop
from aeolid.diagnose.hypotheses.parts.base import Z90, Slot
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point

SIZE = Slot("inverse", "period_s", "s", 0.0, 0.02, 5.0, 0.1)
SHAPE = Slot("zeta", "damping", "1", 0.7, 0.2, 0.98, 0.05, local=False)


def fitted(slots: tuple[Slot, ...], values: tuple[float, ...], stds: tuple[float, ...]) -> tuple[Fit, Any]:
    """A fit with these values and deviations, and the model that knows their places."""
    noise: Any = SimpleNamespace(factor=np.eye(1))
    none = np.zeros(0)
    point = Point(np.array(values), np.zeros(0), None, ())
    free = Free(tuple(range(len(slots))), (), (), ())
    names = [s.name for s in slots]
    jacobian = np.diag(1 / np.array(stds))
    fit = Fit(point, free, noise, 0.0, none, none, jacobian, none, np.zeros((0, len(slots))))
    return fit, SimpleNamespace(index=names.index)


def effect(*slots: Slot, **more: Any) -> Any:
    usual = {"essential": (), "credible": lambda values: "", "gain_states": (), "noise_driven": False, "share": None,
             "drives": (), "entry": "sensor_second_order"}  # fmt: skip
    return SimpleNamespace(key="filter", slots=slots, **(usual | more))


@pytest.mark.parametrize(
    ("value", "std", "word"), [(0.98, 0.5, ""), (0.98, 0.05, "damping of filter ran to the end"), (0.7, 0.05, "")],
    ids=["open: an end like any other", "known, at its end", "known, inside"],
)  # fmt: skip
def test_a_shape_that_the_data_leave_open_is_no_objection(value: float, std: float, word: str) -> None:
    """A second-order filter that fitted as well as a lag was refused so, and the lag named alone."""
    fit, model = fitted((SIZE, SHAPE), (1.0, value), (0.1, std))
    told = objection([effect(SIZE, SHAPE)], fit, model, 90.0, 2)
    assert told.startswith(word) and bool(told) is bool(word)
    assert undetermined([effect(SIZE, SHAPE)], fit, model) == (std > 0.3)


def test_a_size_at_its_end_is_refused_however_uncertain() -> None:
    fit, model = fitted((SIZE,), (5.0,), (9.0,))
    assert "ran to the end" in objection([effect(SIZE)], fit, model, 90.0, 1)


@pytest.mark.parametrize(("gain", "refused"), [(92.0, False), (15.0, True)])
def test_values_that_trade_are_judged_together(gain: float, refused: bool) -> None:
    """Period 1 ± 0.8 and damping 0.77 ± 0.15 are each uncertain, and worth 92 nats: there is a filter.

    A period alone, too: without it the 92 nats are lost, whatever the curvature where it is says.
    """
    fit, model = fitted((SIZE, SHAPE), (1.0, 0.77), (0.8, 0.15))
    assert bool(objection([effect(SIZE, SHAPE)], fit, model, gain, 2)) is refused
    alone, lag = fitted((SIZE,), (1.0,), (0.8,))
    assert bool(objection([effect(SIZE)], alone, lag, gain, 1)) is refused
    essential = effect(SIZE, SHAPE, essential=("inverse",))
    assert "does not differ from none" in objection([essential], fit, model, gain, 2)


def test_a_stop_is_there_though_its_stiffness_is_open(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few impacts tell that there is one, 69 nats, and not how stiff: 184,000 +- 920,000 per s²."""
    found: list[Any] = []
    monkeypatch.setattr(
        end_stop, "force_on", lambda motion, number, kind, slots, form, **more: found.append((slots, more))
    )
    motion: Any = SimpleNamespace(
        position_unit="rad", recorded=None, velocity_size=1.0, position_size=1.0, force_size=30.0, location="state:v",
        force_unit="rad/s^2",
    )  # fmt: skip
    monkeypatch.setattr(end_stop, "travel", lambda site, motion: (0.0, 1.0))
    end_stop._on(SimpleNamespace(model=SimpleNamespace(sample_time_s=0.0)), motion, 0)  # type: ignore[arg-type]
    slots, more = found[0]
    fit, model = fitted(slots, (1.84e5, -0.9, 0.9, 0.0), (9.2e5, 1e9, 0.02, 6.0))
    stop = effect(*slots, fixed={}, **{k: more[k] for k in ("essential",) if k in more})
    told = objection([stop], fit, model, 69.4, 4)
    assert "stop_stiffness" not in told and bool(objection([stop], fit, model, 9.0, 4))


@pytest.mark.parametrize(("std", "refused"), [(1.9, True), (0.2, True), (0.1, False)])
def test_an_effect_without_its_essential_value_is_another(std: float, refused: bool) -> None:
    """A play 0.26 +- 1.3 rad wide, 904 nats where a drive's lag had 635, was that lag: its film drew the load along.

    Its width has no null of its own and is no local value, but it is what makes it a play.
    """
    width = Slot("width", "width", "rad", 0.03, 0.0, 3.0, 0.01, local=False)
    fit, model = fitted((width,), (0.26,), (std,))
    assert bool(objection([effect(width, essential=("width",))], fit, model, 900.0, 5)) is refused


@pytest.mark.parametrize(("stds", "refused"), [((60.0, 1.2), True), ((5.0, 1.2), True), ((60.0, 0.02), False)])
def test_a_loop_of_which_is_not_known_where_it_yields_is_a_spring(stds: tuple[float, float], refused: bool) -> None:
    """A frequency 1.5 % off beside a friction was a loop of 46 ± 60 rad/s² that yields over 0.71 ± 1.2 rad.

    One 1.3 % off was a slider of 233 ± 5 rad/s²/rad that slips 0.033 ± 0.30 rad away.
    """
    force = Slot("force", "acceleration", "rad/s^2", 0.0, 0.0, 1e4, 1.0)
    length = Slot("length", "yield_length", "rad", 0.2, 0.006, 5.0, 0.2, local=False)
    fit, model = fitted((force, length), (46.0, 0.71), stds)
    told = objection([effect(force, length, entry="bouc_wen_hysteresis")], fit, model, 90.0, 2)
    assert ("so that it is a spring" in told) is refused
    assert not objection([effect(force, length)], fit, model, 90.0, 2)


def test_an_entry_may_object_to_its_own_values() -> None:
    fit, model = fitted((SIZE,), (1.0,), (0.1,))
    own = effect(SIZE, credible=lambda values: f"period {values['period_s']:.0f} s")
    assert objection([own], fit, model, 90.0, 1) == "filter: period 1 s"
    assert values_of(own, fit, model) == {"period_s": (1.0, pytest.approx(math.hypot(0.1, 0.01)))}


@pytest.mark.parametrize(
    ("slot", "value", "share"),
    [
        (SIZE, 4.0, 0.04), (replace(SIZE, label="time_s", local=False), 4.0, 0.0), (replace(SIZE, null=1.0), 4.0, 0.03),
        (replace(SIZE, show=lambda v: 1 / v if v else math.inf), 4.0, 0.0025),
    ],
    ids=["a size", "a moment", "a factor", "a frequency"],
)  # fmt: skip
def test_a_value_is_known_to_a_hundredth_at_best(slot: Slot, value: float, share: float) -> None:
    """Of the distance from none; of all of it where none is at infinity; a moment in time has no size."""
    fit, model = fitted((slot,), (value,), (1e-9,))
    ((_, std),) = values_of(effect(slot), fit, model).values()
    assert std == pytest.approx(share, rel=1e-3, abs=1e-8)


def test_what_no_input_drives_is_the_colour_of_noise() -> None:
    drive = Slot("drive", None, "", 0.0, -9.0, 9.0, 1.0)
    fit, model = fitted((drive,), (0.5,), (0.3,))
    assert "no input drives it" in undriven([effect(drive, gain_states=("m",))], fit, model)
    assert not undriven([effect(drive, gain_states=("m",), noise_driven=True)], fit, model)
    clear, _ = fitted((drive,), (0.5,), (0.1,))
    assert not undriven([effect(drive, gain_states=("m",))], clear, model)


def test_what_no_output_shows_is_mute_and_put_back_to_none() -> None:
    """A size the data say nothing of may run anywhere: the model that is written has none of it; known ones stay."""
    slots = (
        Slot("gain", "gain", "", 0.0, -1.0, 1.0, 0.1), Slot("other", "other", "", 0.0, -1.0, 1.0, 0.1),
        Slot("tau", "tau", "", 0.5, -1.0, 1.0, 0.1, local=False),
    )  # fmt: skip
    fit, model = fitted(slots, (1.0, 1.0, 1.0), (1000.0, 0.1, 1000.0))
    np.testing.assert_array_equal(without_the_mute([effect(*slots)], fit, model).point.theta, [0.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("excess", "std", "objected"),
    [
        (0.0, 1.2, "which dry friction may do"), (1.0, 1.2, "does not differ from none"), (9.0, 1.2, ""),
        (0.09, 1e-3, "which dry friction may do"), (0.2, 1e-3, ""),
    ],
)  # fmt: skip
def test_sticking_takes_an_excess(excess: float, std: float, objected: str, tmp_path: Path) -> None:
    """Without one it is dry friction, however many nats both gain: a positioning stage's was called sticking.

    Nor is it one where it is surely there and 4 % of the friction, as another form of the same curve has it.
    """
    study = load_study("diagnosis")
    case = study.write_case(tmp_path / "case", study.Hidden("null", "equations", {}), 600, 5)
    (stiction,) = (a for a in prepare(load_case(case)).hypotheses if a.entry == "stiction")
    slots = tuple(s for s in stiction.slots if s.name not in stiction.fixed)
    assert [s.label for s in slots] == ["force_N", "breakaway_excess", "stribeck_speed"]
    fit, model = fitted(slots, (2.0, excess, 0.5 * (slots[2].low + slots[2].high)), (0.1, std, 0.01))
    told = objection([replace(stiction, slots=slots)], fit, model, 400.0, 3)
    assert objected in told and (told == "") is (objected == "")


@pytest.mark.parametrize(("std", "told"), [(1e-4, 27.25), (3e-3, np.inf), (np.inf, np.inf), (0.0, 0.0)])
def test_a_frequency_has_the_far_end_of_its_inverse(std: float, told: float) -> None:
    """2 ± 0.1 ms reach 1.8355 ms in 90 %, 544.8 rad/s; 142 ± 36 rad/s, the slope's, left out the 221 that it was.

    Where the inverse may be none there is no highest: 535 rad/s of a drive were told to 0.0003, its deviation in s.
    """
    slot = Slot("inverse", "omega_rad_s", "rad/s", 0.0, 0.0, 5.0, 0.1, show=lambda x: 1 / x if x > 0 else math.inf)
    assert slot.reported(0.002, std) == pytest.approx((500.0, told), rel=1e-3)


@pytest.mark.parametrize(
    ("time", "std", "refused"), [(1.3, 1.6, True), (1.3, 0.5, False), (99.0, 0.6, True), (50.0, 9.0, False)]
)
def test_what_may_have_been_so_all_along_is_no_change(time: float, std: float, refused: bool) -> None:
    """A damping that "changed" 1.3 ± 1.6 s after the start of the recording, of a spring that relaxes."""
    size = Slot("change", "damping_change", "1", 0.0, -5.0, 5.0, 0.1)
    when = Slot("when", "time_s", "s", 50.0, 0.0, 100.0, 10.0, local=False, change=("change", 1e-6))
    fit, model = fitted((size, when), (0.03, time), (0.002, std))
    told = objection([effect(size, when)], fit, model, 90.0, 2)
    assert bool(told) is refused and (not refused or "may have been so all along" in told)


def test_nine_of_ten_bands_hold_the_moment_of_a_change() -> None:
    """A step in white noise, its moment by the highest likelihood of all rows, 2000 times: 90 % ± 3 deviations of it.

    By the curvature of the likelihood a damping that changed at 36 s was told to do so at 43.3 ± 0.9 s.
    """
    rng, rows, at, size = np.random.default_rng(6), 400, 200, 0.8
    y = rng.standard_normal((2000, rows)) + size * (np.arange(rows) >= at)
    after = np.cumsum(y[:, ::-1], axis=1)[:, ::-1]  # of the rows from each on
    count = rows - np.arange(rows)
    found = np.argmax(np.where((count > 20) & (count < rows - 20), after**2 / count, -np.inf), axis=1)
    change = Slot("change", "damping_change", "1", 0.0, -5.0, 5.0, 0.1)
    when = Slot("when", "time_s", "s", 100.0, 0.0, 40.0, 10.0, local=False, change=("change", 0.1))
    inside = []
    for sums, k in zip(after, found, strict=True):
        fit, model = fitted((change, when), (sums[k] / count[k], 0.1 * k), (1.0, 1e-6))
        jacobian = np.column_stack([np.arange(rows) >= k, np.zeros(rows)]).astype(float)
        jacobian[0, 1] = 1e6
        _, std = values_of(effect(change, when), replace(fit, jacobian=jacobian), model)["time_s"]
        inside.append(abs(0.1 * k - 0.1 * at) <= Z90 * std)
    assert 0.87 < np.mean(inside) < 0.93  # 0.898; 2000 draws know it to 0.007


def test_what_only_a_sum_determines_has_no_deviation() -> None:
    """Two columns of one direction, one of nothing, one of its own: in units far apart."""
    fit = fitted(tuple(replace(SIZE, name=n) for n in "abcd"), (1.0, 2.0, 3.0, 4.0), (1.0, 1.0, 1.0, 1.0))[0]
    rng = np.random.default_rng(1)
    one, own = np.linalg.qr(rng.standard_normal((500, 2)))[0].T
    columns = np.column_stack([1e6 * one, -2e-4 * one, 0 * one, 50.0 * own])
    fit = replace(fit, jacobian=columns, residual=rng.standard_normal(500))
    assert np.isinf(fit.std).tolist() == [True, True, True, False]
    assert fit.std[3] == pytest.approx(1 / np.linalg.norm(columns[:, 3]))
    assert np.all(np.isfinite(fit.newton_step())) and abs(fit.correlation[0, 1]) == pytest.approx(1.0)
    known = replace(fit, prior_jacobian=np.array([[3e4, 0, 0, 0], [0, 0, 2.0, 0]]), prior_residual=np.zeros(2))
    assert known.std[[0, 2]] == pytest.approx([1 / 3e4, 1 / 2])
