"""Fits whose likelihood has kinks: they go on beyond them, and rounding does not choose where they end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from small_cases import swinging

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates import refit
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.candidates.starts import starts_of
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.predictor.kinks import beyond_kinks
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.scoring.scores import score_bank

ONE = Free((0,), (), (), ())


def valley(*bottoms: tuple[float, float]) -> Any:
    """A predictor whose objective is the lowest of V-shaped valleys (place, depth); its tally counts the calls."""
    tally: list[float] = []

    def objective(point: Point) -> float:
        tally.append(float(point.theta[0]))
        return min(abs(point.theta[0] - place) - depth for place, depth in bottoms)

    scales = SimpleNamespace(theta=np.ones(1), low=np.full(1, -5.0), high=np.full(1, 5.0))
    return SimpleNamespace(objective=objective, scales=scales, tally=tally)


def at(theta: float) -> Point:
    return Point(np.array([theta]), np.zeros(0), None, ())


def test_a_deeper_valley_is_found_and_a_kink_without_one_is_said() -> None:
    found = beyond_kinks(valley((0.0, 0.0), (3.0, 1.0)), 0.0, at(0.0), ONE, np.ones(1))
    assert (found.point.theta[0], found.value, found.kinks) == (3.0, -1.0, ())
    alone = beyond_kinks(valley((0.0, 0.0)), 0.0, at(0.0), ONE, np.ones(1))
    assert (alone.point.theta[0], alone.value, alone.kinks) == (0.0, 0.0, (0,))


def test_nothing_is_looked_at_that_promises_nothing_or_lies_out_of_range() -> None:
    quiet = valley((0.0, 0.0), (3.0, 1.0))
    assert beyond_kinks(quiet, 0.0, at(0.0), ONE, np.zeros(1)).kinks == () and quiet.tally == []
    near_the_end = valley((4.9, 0.0), (8.0, 1.0))
    assert beyond_kinks(near_the_end, 0.0, at(4.9), ONE, np.ones(1)).kinks == (0,)
    assert max(near_the_end.tally) == 5.0


def test_rounding_does_not_choose_where_a_saturated_drive_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Starts that differ in the 13th digit: within half a nat (they were 2 apart, other starts 400 short)."""
    prepared = prepare(load_case(swinging(tmp_path, bend=-0.15)))
    bank = score_bank(prepared, [a for a in prepared.hypotheses if a.entry == "input_saturation"], 1)
    gains = []
    for seed in range(4):

        def shaken(stage: Prepared, base: Any, rows: Any, seed: int = seed) -> list[list[Point]]:
            rng = np.random.default_rng(seed)
            return [
                [replace(s, theta=s.theta * (1 + 1e-13 * rng.standard_normal(s.theta.shape))) for s in group]
                for group in starts_of(stage, base, rows)
            ]

        monkeypatch.setattr(refit, "starts_of", shaken)
        (found,) = fit_rows(prepared, [bank.rows[0]])
        gains.append(found.fit_gain)
    assert max(gains) - min(gains) < 0.5, gains
