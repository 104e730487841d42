"""What is decided by sizes: of parameters, of strays, of a run beside its recordings, of an input never recorded."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import aeolid.diagnose.baseline.prepare as preparing
from aeolid.diagnose.baseline.frame import scales_of
from aeolid.diagnose.baseline.simulated import check_run
from aeolid.diagnose.data.split import split_records
from aeolid.diagnose.data.strays import strays_of
from aeolid.errors import NotIdentifiable
from aeolid.models.equations import Equations, Parameter
from aeolid.record import Channel, Record

CHANNELS = (Channel("u", "V", "input"), Channel("y", "m", "output"))


@pytest.mark.parametrize(
    ("value", "low", "high", "size"),
    [(1.3e-15, -np.inf, np.inf, 1.3e-15), (-2e-9, -1e-8, 0.0, 2e-9), (0.0, 0.0, 1e-6, 1e-9), (0.0, -1.0, np.inf, 1e-6)],
)
def test_a_parameter_has_the_size_of_its_value_in_any_unit(value: float, low: float, high: float, size: float) -> None:
    model = Equations("capacitor", 0.0, (Parameter("C", value, "F", low, high),), (), (), (), ())
    assert scales_of(model, np.zeros(0), np.ones(1), {}).theta[0] == pytest.approx(size, abs=0.0)


@pytest.mark.parametrize(("rows", "at"), [(300, [120]), (300, [0]), (300, [299]), (4000, [0, 3999]), (2000, [7, 900])])
def test_single_samples_far_off_are_strays_in_recordings_of_any_length(rows: int, at: list[int]) -> None:
    """The first and the last sample are no neighbours."""
    values = np.random.default_rng(1).standard_normal(rows)
    values[at] = 1e4
    assert np.flatnonzero(strays_of(values)).tolist() == at


@pytest.mark.parametrize(("rows", "at"), [(300, [120, 200]), (300, [120, 121]), (4000, [5, 6]), (2000, [7, 90, 900])])
def test_many_samples_far_off_are_no_strays(rows: int, at: list[int]) -> None:
    values = np.random.default_rng(1).standard_normal(rows)
    values[at] = 1e4
    assert not strays_of(values).any()


def _record(y: Any, source: str = "monday", u: Any = None) -> Record:
    values = np.column_stack([np.random.default_rng(len(source)).standard_normal(len(y)) if u is None else u, y])
    return Record(0.01 * np.arange(len(y)), values, CHANNELS, 0.01, source, "")


def test_a_run_that_rests_and_then_moves_as_recorded_does_not_run_away() -> None:
    t = 0.01 * np.arange(2000)
    moving = np.where(t > 12, np.sin(t - 12), 0.0)
    noise = 1e-9 * np.random.default_rng(2).standard_normal(len(t))
    recorded = _record(moving + 0.01 * np.cos(t))
    check_run(_record(moving + noise), [recorded])
    for wild in (np.sin(t) * np.exp(2 * t), moving + noise + np.where(t > 15, np.exp(5 * (t - 15)), 0.0)):
        with pytest.raises(NotIdentifiable, match="diverges, y at sample"):
            check_run(_record(wild), [recorded])
    with pytest.raises(NotIdentifiable, match="diverges"):
        check_run(_record(np.sin(t) * np.exp(2 * t)), [_record(np.full(len(t), np.nan))])


def test_an_input_that_one_recording_lacks_does_not_decide_which_is_sealed() -> None:
    """Their spreads are 3, unknown, 1 and 2."""
    rng = np.random.default_rng(4)
    names = ("most", "nothing", "least", "middle")
    records = [
        _record(np.arange(800.0), n, s * rng.standard_normal(800))
        for n, s in zip(names, (3, np.nan, 1, 2), strict=True)
    ]
    assert {s.source for s in split_records(records, ["u"], ["y"], 0.05).sealed} == {"middle"}


def test_of_several_fits_of_the_baseline_the_one_that_priors_allow_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    likely, allowed = (SimpleNamespace(log_likelihood=a, log_posterior=b, point=a) for a, b in ((9.0, 1.0), (8.0, 7.0)))
    fits = iter((likely, allowed))
    predictor: Any = SimpleNamespace(with_order=lambda order: predictor, choose_var_order=lambda point: 0)
    for name, value in (
        ("fit_best", lambda *rest: likely), ("explore", lambda *rest: ()), ("fit_quietly", lambda *rest: next(fits)),
        ("with_forces_awake", lambda *rest: (None,)), ("awakened", lambda predictor, fit, free: fit),
    ):  # fmt: skip
        monkeypatch.setattr(preparing, name, value)
    free: Any = None
    case: Any = None
    start: Any = None
    assert preparing._fit_baseline(predictor, free, [start], case)[1] is allowed
