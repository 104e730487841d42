"""What changes behind the fit data, or lasts beyond them: fit data on both sides, and drives that remember."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.candidates.reestimate import baseline_of_all
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.split import Split, segments_of, split_records
from aeolid.diagnose.predictor.point import Point, Prior, Scales
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import score_bank
from aeolid.diagnose.selection import first_effect
from aeolid.diagnose.selection.first_effect import First, find_first
from aeolid.diagnose.selection.lasting import does_not_last, explains_more, worsening
from aeolid.models import equations_file
from aeolid.models.equations import Equations, InputFilter, Parameter
from aeolid.models.integrate import compile_equations, simulate
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP = 0.1
SPRING = """
[model]
name = "spring"
time = "continuous"
[parameters]
k = { value = 4.2, min = 1.0, max = 20.0, unit = "1/s2", free = true }
d = { value = 0.5, min = 0.05, max = 5.0, unit = "1/s", free = true }
[[state]]
name = "x"
derivative = "v"
unit = "m"
[[state]]
name = "v"
derivative = "u - k*x - d*v"
unit = "m/s"
[[output]]
name = "y"
equation = "x"
unit = "m"
[[input]]
name = "u"
"""
CHANNELS = (Channel("u", "m/s2", "input"), Channel("y", "m", "output"))


def spring() -> Equations:
    text = SPRING.replace('[[input]]\nname = "u"\n', "")
    return equations_file.from_toml(tomllib.loads(text), text, "spring.toml")


def recording(rows: int, softer_from: float, seed: int) -> Record:
    """Return a spring of 4 per s², of 3 from a share of the rows on, behind white noise of a fiftieth."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.standard_normal(rows // 10 + 1), 10)[:rows]
    y = simulate_softening(u, softer_from, seed + 100)
    return Record(STEP * np.arange(rows), np.column_stack([u, y]), CHANNELS, STEP, "a.csv", "")


def simulate_softening(acting: Array, softer_from: float, seed: int) -> Array:
    """Return the position of that spring (N,) under what acts (N,)."""
    model, u, rows = compile_equations(spring()), acting[:, None], len(acting)
    first, state = int(softer_from * rows), np.zeros(2)
    y = simulate(model, u[:first], np.array([4.0, 0.6]), state, STEP)[:, 0]
    if first < rows:
        blank, gain = np.full((first, 1), np.nan), np.zeros((2, 1))
        state = model.predict(u[:first], blank, np.array([4.0, 0.6]), gain, state, STEP, 1, 1, False)[2][-1]
        y = np.r_[y, simulate(model, u[first:], np.array([3.0, 0.6]), state, STEP)[:, 0]]
    noisy: Array = y + 0.02 * y.std() * np.random.default_rng(seed).standard_normal(rows)
    return noisy


def first_of(record: Record) -> First:
    case = Case("spring", (record,), "equations", spring(), "spring.toml", "", {}, Path(), False)
    return find_first(case, 1, lambda name, share: lambda: None)


def rows_of(split: Split, use: str) -> list[tuple[int, int]]:
    return [(round(s.start_s / STEP), round(s.stop_s / STEP)) for s in getattr(split, use)]


def test_fit_data_lie_on_both_sides_of_the_selection_data_where_that_is_asked() -> None:
    """As many rows for each use as in order, none in two, and the sealed ones are the same."""
    record = recording(1000, 1.0, 0)
    plain, around = (split_records([record], ["u"], ["y"], 1.0, around=a) for a in (False, True))
    assert rows_of(plain, "sealed") == rows_of(around, "sealed")
    (a, b), (c, d) = rows_of(around, "fit")
    ((e, f),) = rows_of(around, "select")
    assert a == 0 and b <= e < f <= c < d == 700
    for use in ("fit", "select"):
        counts = [sum(stop - start for start, stop in rows_of(split, use)) for split in (plain, around)]
        assert abs(counts[0] - counts[1]) <= 60  # two gaps of three settling times
    several = [replace(recording(500, 1.0, k), source=f"{k}.csv") for k in range(3)]
    split = split_records(several, ["u"], ["y"], 1.0, around=True)
    assert len(split.fit) == 2 * len(split.select) == 4


def test_a_gauge_that_is_lost_for_all_of_one_part_leaves_another_division() -> None:
    """It was refused, for the selection data had nothing."""
    record = recording(1000, 1.0, 0)
    record.values[500:705, 1] = np.nan
    split = split_records([record], ["u"], ["y"], 1.0)
    for part in (split.fit, split.select, split.sealed):
        assert sum(int(np.isfinite(s.y).sum()) for s in part) >= 100


@pytest.mark.parametrize(("softer_from", "found"), [(0.6, True), (1.0, False)])
def test_a_spring_that_softens_behind_the_fit_data_is_found(softer_from: float, found: bool) -> None:
    """With the fit data in front it was `no_mismatch`: the first half has nothing of it."""
    first = first_of(recording(1600, softer_from, 3))
    assert (first.winner is not None) == found
    assert (len(first.prepared.split.fit) == 2) == found
    if first.winner is not None:
        ((entry, values),) = ((a.entry, first.winner.values[a.key]) for a in first.winner.attachments)
        assert entry == "stiffness_change"
        assert abs(values["time_s"][0] - 96) < 2  # two rows of the slowest input
        assert abs(values["stiffness_change"][0] + 1.0) < 4 * values["stiffness_change"][1]


def test_what_lasts_and_what_explains_more_is_told_of_an_effect_as_well() -> None:
    """The change lasts, the baseline of the first half does not, nor does what is fitted to it there."""
    record = recording(1600, 0.6, 3)
    later = first_of(record)
    case = Case("spring", (record,), "equations", spring(), "spring.toml", "", {}, Path(), False)
    early = prepare(case)
    lags = [r for r in score_bank(early, early.hypotheses, 1).rows if r.attachment.entry == "actuator_lag"]
    (other,) = fit_rows(early, lags)
    assert later.winner is not None
    assert does_not_last(early, None, 1) and does_not_last(early, other, 1)
    assert not does_not_last(later.prepared, later.winner, 1)
    assert explains_more(early, other, later.prepared, later.winner)
    assert not explains_more(later.prepared, later.winner, early, other)


@pytest.mark.parametrize(("softer_from", "least", "most"), [(1.0, 0.0, 0.0), (0.25, 0.0, 0.0), (0.55, 1.0, 10.0)])
def test_how_much_worse_all_other_data_are_foretold(softer_from: float, least: float, most: float) -> None:
    """Where the spring softens behind the fit data; not where it stays, nor where the fit data have half of each."""
    record = recording(1600, softer_from, 3)
    case = Case("spring", (record,), "equations", spring(), "spring.toml", "", {}, Path(), False)
    early = prepare(case)
    assert least <= worsening(early, baseline_of_all(early), 1) <= most


def test_what_only_badly_foretold_selection_data_show_is_no_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    """A load that was hung on behind the fit data was a sensor's range; a gain on the fit data is kept."""
    record = recording(1600, 0.6, 3)
    early = prepare(Case("spring", (record,), "equations", spring(), "spring.toml", "", {}, Path(), False))
    bank = score_bank(early, early.hypotheses, 1)
    (lag,) = fit_rows(early, [r for r in bank.rows if r.attachment.entry == "actuator_lag"])
    assert does_not_last(early, lag, 1)
    for gain, kept in ((0.0, False), (lag.handicap + 50.0, True)):
        winner = replace(lag, plausible=True, fit_gain=gain)
        looks = iter([First(early, bank, [winner], winner), First(early, bank, [], None)])
        monkeypatch.setattr(first_effect, "_find", lambda *_, looks=looks: next(looks))
        found = first_of(record)
        assert (found.winner is not None) is kept and found.candidates[0].plausible is kept
        assert kept or "explains nothing of the fit data" in found.candidates[0].reason


def test_a_drive_that_holds_remembers_what_came_before_a_stretch() -> None:
    """A valve that sticks stands where the rows before the stretch have left it; so does a play."""
    rng, rows = np.random.default_rng(5), 600
    u = np.cumsum(0.1 * rng.standard_normal(rows))[:, None]
    for kind, width in (("deadband", 0.7), ("backlash", 1.0)):
        plain = spring()
        filters = (InputFilter("u", kind, ("width", "share")),)
        more = (Parameter("width", width), Parameter("share", 1.0))
        model = replace(plain, parameters=(*plain.parameters, *more), filters=filters)
        compiled = compile_equations(model)
        y = simulate(compiled, u, model.theta, model.x0, STEP)
        record = Record(STEP * np.arange(rows), np.column_stack([u, y]), CHANNELS, STEP, "a.csv", "")
        scales = Scales(
            np.ones(4), np.ones((2, 1)), np.ones(2), np.zeros(4), np.full(4, 9.0), Prior(model.theta, np.zeros((0, 4))),
            np.ones(1),
        )  # fmt: skip
        whole, late = (
            Predictor(compiled, segments_of(record, (a, rows), ["u"], ["y"], 0.0), scales, 0) for a in (0, 250)
        )
        at = Point(model.theta, np.array([0, 0, 1.0]), None, (model.x0,))
        acting = [p.ready(at, 0)[0][:, 0] for p in (whole, late)]
        np.testing.assert_array_equal(acting[0][250:], acting[1])
        assert len(late.segments[0].history) == rows


def test_what_a_drive_remembers_ends_where_the_command_was_lost() -> None:
    """And at the bound that keeps recordings of many stretches quick."""
    record = recording(900, 1.0, 1)
    record.values[300:310, 0] = np.nan
    a, b = segments_of(record, (0, 900), ["u"], ["y"], 0.0)
    assert a.before is None and b.before is None
    (late,) = segments_of(record, (500, 900), ["u"], ["y"], 0.0)
    assert late.before is not None and len(late.before) == 500 - 310
    assert in_force().data.remembered_samples >= 1000
