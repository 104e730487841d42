"""How inputs are read is settled with the baseline: rigs simulated apart, at a fiftieth of the sample time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt
from small_cases import SWING, SWING_CHANNELS, write_case

from aeolid.compiled import njit
from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates import sampling_stage, settle_sampling
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.feedback import feedback_of
from aeolid.diagnose.candidates.sampling_choice import Choice, choice_of
from aeolid.diagnose.candidates.settle_sampling import settle
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.data.intersample import Sampling, sampling_findings, traits_of
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, FINE, ROWS = 0.05, 50, 1000  # s, parts of it, samples


@njit(cache=True)
def swing(u: Array, w: Array, h: float) -> tuple[Array, Array]:
    """Return position and speed of the mass of SWING, semi-implicit steps of h (the middle one for the position)."""
    q, v, x, s = 0.0, 0.0, np.empty(len(u)), np.empty(len(u))
    for i in range(len(u)):
        x[i], s[i] = q, v
        after = v + h * (u[i] + w[i] - v - 40.0 * (q + 0.5 * h * v))
        q, v = q + 0.5 * h * (v + after), after
    return x, s


def rows(kind: str, late: float, seed: int = 4, corner: float = 0.0) -> Array:
    """Return push, position, speed; the outputs are read `late` samples after the instant of the push beside them.

    corner: of the outputs' Butterworth filter over the sampling rate, 0: none.
    """
    rng = np.random.default_rng(seed)
    count, h = (ROWS + 3) * FINE, STEP / FINE
    if kind == "analogue":
        push = sosfilt(butter(4, 3.0, fs=1 / h, output="sos"), rng.standard_normal(count))
        push *= 5 / push.std()
    else:
        dwell = {"held": 7, "fresh": 1}[kind]
        push = np.repeat(rng.choice(np.array([-5.0, 5.0]), (ROWS + 3) // dwell + 1), dwell * FINE)[:count]
    x, s = swing(push, 0.3 * rng.standard_normal(count) / np.sqrt(FINE), h)
    if corner:
        x, s = sosfilt(butter(2, corner, fs=FINE, output="sos"), np.array([x, s]))
    at, noise = FINE * np.arange(2, ROWS + 2), rng.standard_normal((ROWS, 2)) * [1e-3, 5e-3]
    shifted = at + round(late * FINE)
    return np.column_stack([push[at], x[shifted] + noise[:, 0], s[shifted] + noise[:, 1]])


def stage(folder: Path, values: Array) -> tuple[Prepared, object]:
    """Return the stage of a case around these rows, and what is settled with it."""
    case = load_case(write_case(folder, SWING, STEP, SWING_CHANNELS, values))
    prepared = prepare(case)
    return prepared, settle(case, prepared)


@pytest.mark.parametrize("late", [0.0, 0.5, 1.0])
def test_an_analogue_input_is_no_held_one(tmp_path: Path, late: float) -> None:
    prepared, found = stage(tmp_path, rows("analogue", late))
    assert dict(found.holds) == {"push": "band_limited"}
    assert found.offset_s == pytest.approx(-late * STEP, abs=0.02 * STEP)  # a hundredth is a step of the rig
    notes = sampling_findings(prepared.records, found, STEP)
    assert all(n.severity == "info" for n in notes)
    assert {n.check for n in notes} == ({"intersample", "offset"} if found.offset_s else {"intersample"})


def test_a_command_beside_the_output_at_its_end_acts_one_sample_early(tmp_path: Path) -> None:
    _, found = stage(tmp_path, rows("fresh", 1.0))
    assert found.holds == (("push", "zoh"),)
    assert (found.offset_s, found.free) == (-STEP, False)


def test_a_command_as_it_is_stays_as_it_is(tmp_path: Path) -> None:
    assert stage(tmp_path, rows("held", 0.0))[1] is None


@pytest.mark.parametrize("late", [0.4, 0.8])
def test_a_command_late_by_part_of_a_sample_is_a_habit(tmp_path: Path, late: float) -> None:
    """A drive faster than the sampling and an anti-alias filter look alike: neither is a finding."""
    prepared, found = stage(tmp_path, rows("held", -late))
    assert found.late_s == pytest.approx(late * STEP, abs=0.02 * STEP)
    assert all(n.severity == "info" for n in sampling_findings(prepared.records, found, STEP))


def test_where_an_input_that_moves_would_be_too_late_a_held_one_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a slow controller gives out looks measured: held and half a sample late, or moving and a whole one.

    A heated block in its loop, late by 0.57 of a sample, was named a dead time (212 nats on a null).
    """
    moving = Sampling((("push", "band_limited"),), 1.05 * STEP, 0.0, free=True, gain=188.0)
    held = Sampling((("push", "zoh"),), 0.57 * STEP, 0.0, free=True, gain=175.0)
    monkeypatch.setattr(settle_sampling, "_best", lambda stage, choice: moving if choice.moving else held)
    monkeypatch.setattr(settle_sampling, "goes_on", lambda stage, best: best is moving)
    stage = SimpleNamespace(
        predictor=SimpleNamespace(segments=[SimpleNamespace(y=np.zeros((1000, 2)))]), step=STEP,
        sampling=replace(held, offset_s=0.0, free=False, gain=0.0),
    )  # fmt: skip
    assert settle_sampling._likelier(stage, Choice(("push",), True, False)) == held


@pytest.mark.parametrize(("alone", "read"), [(95.0, True), (80.0, False)])
def test_a_filter_as_slow_as_it_may_be_is_physics_unless_a_lateness_does_as_well(
    alone: float, read: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Play and a drive's range round what is late: the filter ran to its end, and dead time and lag had the name."""
    slow = Sampling((("push", "filtered"),), -0.37 * STEP, STEP, free=True, gain=100.0)
    late = Sampling((("push", "zoh"),), 0.66 * STEP, 0.0, free=True, gain=alone)
    monkeypatch.setattr(
        settle_sampling, "_best", lambda stage, choice: None if not choice.late else slow if choice.filtered else late
    )
    stage = SimpleNamespace(
        predictor=SimpleNamespace(segments=[SimpleNamespace(y=np.zeros((1000, 2)))]), step=STEP,
        sampling=replace(late, offset_s=0.0, free=False, gain=0.0),
    )  # fmt: skip
    assert settle_sampling._likelier(stage, Choice((), False, False)) == (late if read else None)


@pytest.mark.parametrize(("moving", "chosen"), [(8.4, 0.0), (7.0, -STEP)])
def test_inputs_are_not_read_early_where_another_reading_is_as_likely(moving: float, chosen: float) -> None:
    """Beside a dead time of the pitch a row early was worth 9.2 nats, and a wind that goes on between its rows 8.4."""
    held = (("wind", "zoh"), ("pitch", "zoh"))
    early = Sampling(held, -STEP, gain=9.2)
    going_on = Sampling((("wind", "foh"), ("pitch", "zoh")), gain=moving)
    half_late = Sampling(held, 0.5 * STEP, free=True, gain=9.1)
    assert settle_sampling._not_early([early, going_on, half_late], early).offset_s == chosen
    assert settle_sampling._not_early([going_on, half_late], half_late) == half_late


def test_a_mix_that_may_not_be_late_is_not_tried_where_moving_inputs_may() -> None:
    """Pitch and torque of a turbine, 0.8 rows late: with the torque held 4 nats more, which may not be late."""
    both = Sampling((("pitch", "foh"), ("torque", "foh")), 0.08, 0.0, free=True, gain=449.0)

    def tried(sampling: Sampling, iterations: int = 4) -> Sampling:
        return replace(sampling, gain=453.0 if ("torque", "zoh") in sampling.holds else 449.0 if sampling.free else 0.0)

    stage: Any = SimpleNamespace(step=0.1, tried=tried)
    assert settle_sampling._finished(stage, Choice(("pitch", "torque"), True, False), both).holds == both.holds


def test_outputs_behind_an_anti_alias_filter_are_read_so(tmp_path: Path) -> None:
    """A Butterworth filter with its corner at 0.8 of the Nyquist frequency, read 0.2 samples early."""
    values, delay = rows("fresh", -0.2, corner=0.4), 2**0.5 / (2 * np.pi * 0.4)
    prepared, found = stage(tmp_path, values)
    assert found.is_filtered
    assert found.filter_s == pytest.approx(delay * STEP, abs=0.05 * STEP)
    assert found.late_s == pytest.approx((delay + 0.2) * STEP, abs=0.02 * STEP)
    assert {n.check for n in sampling_findings(prepared.records, found, STEP)} == {"intersample", "filter", "offset"}


def test_a_filter_and_an_offset_are_fitted_further_before_one_is_chosen() -> None:
    """After four iterations both gain alike; the filter's fit goes the longer way, and is 18 nats ahead at its end."""
    held, short = (("push", "zoh"),), SimpleNamespace(y=np.zeros((1000, 2)))
    offset = Sampling(held, 0.01, 0.0, free=True, gain=966.0)
    behind = Sampling((("push", "filtered"),), 0.0, 0.01, free=True, gain=967.0)
    ends = {offset: 994.0, behind: 1012.0}
    stage = SimpleNamespace(
        predictor=SimpleNamespace(segments=[short]), tried=lambda s, n: replace(s, gain=ends[s] if n > 4 else s.gain)
    )
    assert settle_sampling._likeliest(stage, [offset, behind]) == replace(behind, gain=1012.0)
    assert settle_sampling._likeliest(stage, [offset]) == offset
    assert settle_sampling._likeliest(stage, []) is None


def test_a_command_late_by_more_is_physics(tmp_path: Path) -> None:
    """That is what a lag or a dead time does, and the catalogue names both."""
    assert stage(tmp_path, rows("held", -1.6))[1] is None


@pytest.mark.parametrize("late", [0.0, 0.5, 1.0])
def test_a_command_beside_a_measured_input_is_never_late(late: float) -> None:
    """One offset holds for all inputs: 0.105 s at 10 Hz beside a recorded speed was a steering drive's lag."""
    both = Choice(("speed", "command"), any_offset=True, whole=False)
    mixed = Sampling((("speed", "foh"), ("command", "zoh")), 1.05 * late * STEP, free=True)
    smooth = replace(mixed, holds=(("speed", "foh"), ("command", "foh")))
    assert both.allows(mixed, STEP) is (late == 0.0)
    assert both.allows(smooth, STEP)


def test_feedback_lets_no_output_be_foretold_from_itself(tmp_path: Path) -> None:
    """A controller answers within the row: fractions and curves would bring the output's own error along."""
    rng, q, v, values = np.random.default_rng(2), 0.0, 0.0, []
    for _ in range(ROWS):
        y = np.array([q, v]) + rng.standard_normal(2) * [1e-3, 5e-3]
        push = -30.0 * y[0] - 6.0 * y[1] + rng.standard_normal()
        values.append([push, *y])
        force = 2.0 * rng.standard_normal()
        for _ in range(FINE):
            v += STEP / FINE * (push + force - v - 40.0 * q)
            q += STEP / FINE * v
    case = load_case(write_case(tmp_path, SWING, STEP, SWING_CHANNELS, np.array(values)))
    assert settle(case, prepare(case)) is None


GEARS = """[model]
name = "geared motor"
[parameters]
k = { value = 10.0, unit = "N m/rad", min = 2.0, max = 50.0, free = true }
d = { value = 0.9, unit = "N m s/rad", min = 0.2, max = 4.5, free = true }
[[input]]
name = "command"
unit = "rad"
[[state]]
name = "q"
unit = "rad"
derivative = "w"
[[state]]
name = "w"
unit = "rad/s"
derivative = "(k*(command - q) - d*w)/0.03"
[[output]]
name = "angle"
unit = "rad"
equation = "q"
[[output]]
name = "speed"
unit = "rad/s"
equation = "w"
"""


def servo(rng: np.random.Generator) -> Array:
    """Return a smooth command, angle and speed of a stiff servo in open loop, read a third of a row late."""
    fine = 20
    top, bottom = butter(2, 0.05, fs=fine)
    command = lfilter(top, bottom, np.repeat(np.repeat(rng.uniform(-1, 1, ROWS // 25 + 1), 25)[:ROWS], fine))
    q, w, states = 0.0, 0.0, []
    for u in command:
        states.append([q, w])
        w += 0.01 / fine * (10.0 * (u - q) - 0.9 * w) / 0.03
        q += 0.01 / fine * w
    at = np.minimum(fine * np.arange(ROWS) + fine // 3, len(states) - 1)
    return np.column_stack([command[::fine], np.array(states)[at] + rng.standard_normal((ROWS, 2)) * [2e-4, 2e-3]])


def loop(rng: np.random.Generator) -> Array:
    """Return the same of a command that answers the angle and the speed of its own row, held until the next."""
    q, w, rows = 0.0, 0.0, []
    wanted = sosfilt(butter(2, 0.04, output="sos"), rng.standard_normal(ROWS))
    for r in wanted:
        y = np.array([q, w]) + rng.standard_normal(2) * [2e-2, 0.5]
        u = 5.0 * r - 0.8 * y[0] - 0.05 * y[1]
        rows.append([u, *y])
        for _ in range(50):
            w += 2e-4 * (10.0 * (u - q) - 0.9 * w) / 0.03
            q += 2e-4 * w
    return np.array(rows)


@pytest.mark.parametrize(("rows_of", "least", "most"), [(servo, 0.0, 0.05), (loop, 0.9, 1.1)])
def test_what_errors_tell_of_a_command_is_feedback_where_no_reading_takes_it_away(
    tmp_path: Path, rows_of: Callable[[np.random.Generator], Array], least: float, most: float
) -> None:
    """Late outputs of a stiff servo tell almost all of the smooth command of their row; so does a controller."""
    channels = (("command", "rad", "input"), ("angle", "rad", "output"), ("speed", "rad/s", "output"))
    case = load_case(write_case(tmp_path, GEARS, 0.01, channels, rows_of(np.random.default_rng(5))))
    prepared = prepare(case)
    now, choice = settle_sampling.stage_of(prepared, None), choice_of(case, prepared)
    assert now is not None
    told = feedback_of(now.predictor, now.point, choice.kinds)
    best = now.tried(Sampling((("command", "band_limited"),), -0.003, 0.0, True))
    assert told > 20  # nats: far beyond chance
    assert least * told <= settle_sampling._feedback(now, choice, best) <= most * told


def test_a_case_that_says_closed_loop_has_whole_samples_only(tmp_path: Path) -> None:
    folder = write_case(tmp_path, SWING, STEP, SWING_CHANNELS, rows("analogue", 0.0))
    with (folder / "case.toml").open("a") as file:
        file.write("closed_loop = true\n")
    case = load_case(folder)
    choice = choice_of(case, prepare(case))
    assert (choice.moving, choice.any_offset, choice.whole) == ((), False, True)


def test_a_declared_hold_is_not_chosen_again(tmp_path: Path) -> None:
    folder = write_case(tmp_path, SWING, STEP, SWING_CHANNELS, rows("analogue", 0.0))
    roles = folder / "roles.toml"
    roles.write_text(roles.read_text().replace('role = "input"', 'role = "input"\nhold = "foh"'))
    case = load_case(folder)
    prepared = prepare(case)
    assert dict(prepared.sampling.holds) == {"push": "foh"}
    assert [f.kind for f in prepared.extended.filters] == ["intersample_foh"]
    found = settle(case, prepared)
    assert found is None or dict(found.holds) == {"push": "foh"}


def record(channels: Sequence[Channel], columns: Sequence[Array]) -> Record:
    """Return a recording of these columns."""
    values = np.column_stack(columns)
    return Record(STEP * np.arange(len(values)), values, tuple(channels), STEP, "recording", "")


def test_inputs_are_known_by_their_samples() -> None:
    rng, n = np.random.default_rng(1), 2000
    noise = rng.standard_normal(n)
    columns = [
        np.repeat(noise[: n // 5], 5), noise, sosfilt(butter(4, 0.5, output="sos"), noise), np.cumsum(noise), noise,
    ]  # fmt: skip
    roles = ["input", "input", "disturbance", "input", "azimuth"]
    channels = [Channel(f"c{i}", "", r, hold="foh" if i == 3 else "auto") for i, r in enumerate(roles)]
    found = traits_of([record(channels, columns)], [c.name for c in channels])
    assert [(t.kind, t.hold) for t in found] == [
        ("held", "zoh"), ("rough", "zoh"), ("smooth", None), ("declared", "foh"),
    ]  # fmt: skip


def test_beside_what_ran_to_its_end_it_is_asked_whatever_the_slope(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    """A value that its range holds takes the slope of all else away: 147 nats of a filter promised none."""
    prepared, alone = stage(tmp_path, rows("held", -0.4))
    monkeypatch.setattr(sampling_stage, "_promised", lambda predictor, at, place: (0.0, 0.0))
    fitted = {
        at_end: SimpleNamespace(
            predictor=prepared.predictor, fit=prepared.fit, attachments=prepared.attachments, at_end=at_end
        )
        for at_end in (False, True)
    }
    case = load_case(tmp_path)
    assert settle(case, prepared, cast(Candidate, fitted[False])) is None
    found = settle(case, prepared, cast(Candidate, fitted[True]))
    assert found is not None and found.late_s == pytest.approx(alone.late_s, abs=0.02 * STEP)


def test_a_candidate_that_predicts_nothing_where_it_ended_chooses_no_reading(tmp_path: Path) -> None:
    """A lag that ran to none left a gain that is unstable without it, and the search ended in an assertion."""
    prepared, _ = stage(tmp_path, rows("held", 0.0))
    theta = prepared.fit.point.theta * np.array([1.0, -1e6, 1.0, 1.0])  # a spring that pushes away
    lost = replace(prepared.fit, point=replace(prepared.fit.point, theta=theta))
    ended = SimpleNamespace(predictor=prepared.predictor, fit=lost, attachments=prepared.attachments, at_end=True)
    assert prepared.predictor.objective(lost.point) >= 1e300
    assert settle(load_case(tmp_path), prepared, cast(Candidate, ended)) is None


def test_readings_are_asked_beside_what_leads_and_what_nearly_leads_at_its_end() -> None:
    def fitted(entry: str, score: float, plausible: bool = True, at_end: bool = False, undriven: bool = False) -> Any:
        return SimpleNamespace(
            attachments=[SimpleNamespace(entry=entry)], score=score, plausible=plausible, at_end=at_end,
            undriven=undriven,
        )  # fmt: skip

    lag, twin, limit = fitted("lag", 100.0), fitted("lag", 90.0), fitted("limit", 80.0)
    lift, mode = fitted("lift", 95.0, False, True), fitted("mode", 99.0, False, True, True)
    faint, refused = fitted("faint", 40.0, False, True), fitted("refused", 97.0, False)
    found = settle_sampling._leaders([faint, mode, limit, lift, twin, lag, refused])
    assert found == [lag, limit, lift]
    assert settle_sampling._leaders([lift]) == []  # nothing leads
