"""Starts from the simulation error: two tanks that run over, of which only the lower one's level is measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates.refit import free_with
from aeolid.diagnose.candidates.simulation_starts import simulation_starts
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.scoring.scores import Row, score_bank

STEP_S, SAMPLES, NOISE = 4.0, 900, 0.02
FLOW, PUMP, BRIM, PASSED = 0.05, 0.04, (9.0, 8.0), 0.6  # V^0.5/s, 1/s, V, share of the upper spill that is caught
MODEL = """
[model]
name = "two tanks"
time = "continuous"
[parameters]
k = { value = 0.05, min = 0.01, max = 0.5, unit = "V^0.5/s", free = true }
pump = { value = 0.045, min = 0.01, max = 0.5, unit = "1/s", free = true }
[[state]]
name = "upper"
derivative = "-k*sqrt(max(upper, 0)) + pump*u"
initial = { value = 4.0, free = true }
unit = "V"
[[state]]
name = "lower"
derivative = "k*sqrt(max(upper, 0)) - k*sqrt(max(lower, 0))"
initial = { value = 4.0, free = true }
unit = "V"
[[output]]
name = "y"
equation = "lower"
unit = "V"
"""
CASE = """
[case]
title = "two tanks"
[recordings]
files = ["recording.csv"]
roles = "roles.toml"
[baseline]
kind = "equations"
file = "model.toml"
"""
ROLES = """
[recording]
time = "time"
time_unit = "s"
[[channel]]
name = "u"
role = "input"
unit = "V"
[[channel]]
name = "y"
role = "output"
unit = "V"
"""


def filled(u: NDArray[np.float64], fine: int = 40) -> NDArray[np.float64]:
    """Return the lower level (N,) at each row by Euler steps, `fine` a sample; what is above a brim spills."""
    upper, lower, seen = 4.0, 4.0, []
    for value in u:
        seen.append(lower)
        for _ in range(fine):
            down, out = FLOW * np.sqrt(max(upper, 0.0)), FLOW * np.sqrt(max(lower, 0.0))
            spill = [max(level - brim, 0.0) / 2.0 for level, brim in zip((upper, lower), BRIM, strict=True)]
            upper += STEP_S / fine * (PUMP * value - down - spill[0])
            lower += STEP_S / fine * (down - out + PASSED * spill[0] - spill[1])
    return np.array(seen)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> tuple[Prepared, list[Row]]:
    rng, folder = np.random.default_rng(3), tmp_path_factory.mktemp("tanks")
    u = np.repeat(rng.uniform(1.5, 4.2, SAMPLES // 30), 30)
    y = filled(u) + NOISE * rng.standard_normal(SAMPLES)
    rows = "\n".join(f"{STEP_S * k},{a:.6f},{b:.6f}" for k, (a, b) in enumerate(zip(u, y, strict=True)))
    (folder / "recording.csv").write_text(f"time,u,y\n{rows}\n")
    for name, text in (("case.toml", CASE), ("model.toml", MODEL), ("roles.toml", ROLES)):
        (folder / name).write_text(text)
    prepared = prepare(load_case(folder))
    brims = [a for a in prepared.hypotheses if a.entry == "overflow"]
    return prepared, list(score_bank(prepared, tuple(brims), 1).rows)


def test_both_brims_are_found_by_the_simulation_error(stage: tuple[Prepared, list[Row]]) -> None:
    """The measured level's to a twentieth; the other's is one with the scale of a level that nobody measures."""
    prepared, rows = stage
    assert {r.attachment.location["entry"] for r in rows} == {"state:upper", "state:lower"}
    both = prepared.only([r.attachment for r in rows])
    free = free_with(both.free, [r.attachment for r in rows], both)
    ladder = simulation_starts(both, both.fit, rows, free)
    assert len(ladder) > 1 and len({tuple(p.theta) for p in ladder}) == 1, "one point, several noises"
    point = min(ladder, key=lambda p: float(np.max(p.noise[: len(p.x0[0])])))
    brim = point.theta[both.extended.index("overflow_2_level")]
    assert brim == pytest.approx(BRIM[1], rel=0.05)
    (e,) = both.predictor.innovations(point)
    assert np.std(e) < 3 * NOISE  # what no simulation without both reaches


def test_the_same_every_time_and_nothing_for_a_free_gain(stage: tuple[Prepared, list[Row]]) -> None:
    prepared, rows = stage
    one = prepared.only([rows[0].attachment])
    free = free_with(one.free, [rows[0].attachment], one)
    first, second = (simulation_starts(one, one.fit, rows[:1], free) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.theta, b.theta)
    states, outputs = len(one.fit.point.x0[0]), len(one.extended.outputs)
    given = replace(one.fit, point=replace(one.fit.point, K=np.zeros((states, outputs))))
    assert simulation_starts(one, given, rows[:1], free) == []
