"""Predictions over the sealed data are followed as far as they say something."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aeolid.diagnose.conclusion.export import write_series
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.point import Free, Point, Prior, Scales
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.validation.proof import _errs_more, is_material, prove
from aeolid.models import equations_file
from aeolid.models.integrate import compile_equations

STEP, ROWS = 0.1, 4000
MODEL = """
[model]
time = "discrete"
sample_time_s = 0.1
[parameters]
a = { value = 0.5, min = -2.0, max = 2.0, free = true }
[[state]]
name = "x"
next = "a*x + u"
[[output]]
name = "y"
equation = "x"
"""


def pair(pole: float, sealed: Segment):  # type: ignore[no-untyped-def]
    """Return a predictor whose gain holds a state of this pole, and the fit there."""
    model = compile_equations(equations_file.from_toml(tomllib.loads(MODEL), MODEL, "model.toml"))
    scales = Scales(
        np.ones(1), np.ones((1, 1)), np.ones(1), np.array([-2.0]), np.array([2.0]),
        Prior(np.zeros(1), np.zeros((0, 1))), np.ones(1),
    )  # fmt: skip
    predictor = Predictor(model, (sealed,), scales, 0)
    point = Point(np.array([pole]), np.zeros(2), np.array([[pole - 0.3]]), (np.zeros(1),))
    return predictor, predictor.at(point, Free((0,), (), (), (0,)))


def held(pole: float) -> Segment:
    """Play a state of this pole that feedback holds, the noise of the sensor fed back too."""
    rng = np.random.default_rng(4)
    u, y, x = np.empty((ROWS, 1)), np.empty((ROWS, 1)), 0.0
    for k in range(ROWS):
        y[k] = x + 0.1 * rng.standard_normal()
        u[k] = (0.6 - pole) * y[k] + rng.choice([-1.0, 1.0])
        x = pole * x + u[k, 0]
    return Segment(u, y, STEP, "sealed", 0.0, 20)


@pytest.mark.parametrize(("pole", "rows"), [(1.04, 25), (1.3, 20), (1.0, 100), (0.9, 100)])
def test_predictions_end_where_a_growing_model_has_lost_its_start(pole: float, rows: int) -> None:
    """1/ln 1.04 = 25.5 rows; no fewer than 20; all of the settling time, 100 rows, where nothing grows."""
    sealed = held(pole)
    proof = prove(pair(pole, sealed), pair(pole, sealed), (sealed,), 100 * STEP, 1)
    assert proof.horizon_s == pytest.approx(rows * STEP)
    assert proof.nrmse_before == proof.nrmse_after
    assert proof.gain == 0.0


def test_one_growing_model_ends_the_predictions_of_both() -> None:
    """Errors are compared over the same stretches, whichever of the two models grows; over 100 rows 1.04 makes 50."""
    sealed = held(1.04)
    fits = pair(0.98, sealed), pair(1.04, sealed)
    for before, after in (fits, fits[::-1]):
        proof = prove(before, after, (sealed,), 100 * STEP, 1)
        assert proof.horizon_s == pytest.approx(25 * STEP)
    error = prove(*fits, (sealed,), 100 * STEP, 1).nrmse_after["y"]
    assert error < 0.5  # noise of a tenth through a start that grows by e, on outputs that spread by more than one


def test_a_segment_shorter_than_the_horizon_has_no_part_in_it() -> None:
    """A gap in the recording leaves 40 rows: errors 50 rows ahead come from the long segment alone, as without it."""
    long = held(0.9)
    short = Segment(long.u[:40], long.y[:40], STEP, "sealed", ROWS * STEP, 20)
    alone, beside = (
        prove(pair(0.9, long), pair(0.9, long), parts, 100 * STEP, 1).profile["y"] for parts in ((long,), (long, short))
    )
    assert beside["steps"] == alone["steps"]
    far = alone["steps"].index(50.0)
    assert beside["before"][far] == pytest.approx(alone["before"][far], rel=0.01)


def test_all_sealed_stretches_are_shown_and_told_apart(tmp_path: Path) -> None:
    """What the table holds has the errors that are reported, which are those over all stretches."""
    parts = held(0.9), replace(held(0.9), source="other", start_s=50.0, burn=30)
    proof = prove(pair(0.9, parts[0]), pair(0.7, parts[0]), parts, 100 * STEP, 1)
    write_series(proof.series, tmp_path / "series.csv")
    table = np.genfromtxt(tmp_path / "series.csv", delimiter=",", names=True)
    assert table.dtype.names == ("time_s", "y_measured", "y_before", "y_after", "stretch")
    for number, part in enumerate(parts, start=1):
        own = table[table["stretch"] == number]
        np.testing.assert_allclose(own["time_s"], part.start_s + STEP * np.arange(part.burn, ROWS))
        np.testing.assert_allclose(own["y_measured"], part.y[part.burn :, 0], rtol=1e-8)
    for name, told in (("y_before", proof.nrmse_before), ("y_after", proof.nrmse_after)):
        error = np.sqrt(np.mean((table["y_measured"] - table[name]) ** 2)) / np.std(table["y_measured"])
        assert error == pytest.approx(told["y"], rel=1e-6)


@pytest.mark.parametrize(
    ("after", "static", "material"), [(0.25, True, False), (0.25, False, True), (0.14, True, True)]
)
def test_a_law_without_states_is_judged_far_ahead(after: float, static: bool, material: bool) -> None:
    """One row ahead its noise foretells: a lag of 5 s behind a torque law gained thousands of nats and erred more."""
    profile = {"torque": {"steps": [1.0], "before": [0.09], "after": [0.02]}}
    proof: Any = SimpleNamespace(nrmse_before={"torque": 0.19}, nrmse_after={"torque": after}, profile=profile)
    assert is_material(proof, static) is material


@pytest.mark.parametrize(("factor", "more"), [(1.0, False), (0.8, False), (1.05, False), (1.5, True)])
def test_errors_are_larger_where_blocks_of_rows_agree(factor: float, more: bool) -> None:
    """Errors of a half larger in every block are; of other noise, or a twentieth larger in 400 rows, nobody knows."""
    rng = np.random.default_rng(7)
    measured, before = rng.standard_normal((400, 1)), 0.3 * rng.standard_normal((400, 1))
    after = factor * 0.3 * rng.standard_normal((400, 1))
    after[5] = before[7] = np.nan
    assert _errs_more(measured, [[measured - before], [measured - after]], 1) is more
