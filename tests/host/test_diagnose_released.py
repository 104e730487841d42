"""A body that is let go far from its rest: the predictor is linearised where the body usually is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from small_cases import write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.experiments.closer import describe_closer
from aeolid.diagnose.experiments.experiment import describe
from aeolid.diagnose.predictor.gains import forgets
from aeolid.diagnose.scoring.scores import score_bank

Array = NDArray[np.float64]
STEP, SAMPLES, START, HARDENING = 0.1, 600, 1.0, 3.0
MODEL = """[model]
name = "ring"
time = "continuous"
[parameters]
k = { value = 4.0, min = 1.0, max = 16.0, free = true, prior_std = 0.4 }
c = { value = 0.1, min = 0.01, max = 5.0, free = true, prior_std = 0.1 }
[[state]]
name = "x"
derivative = "v"
initial = { value = START, free = true }
unit = "m"
[[state]]
name = "v"
derivative = "-k*x - c*v"
initial = 0.0
unit = "m/s"
[[output]]
name = "position"
equation = "x"
unit = "m"
"""


def ring() -> Array:
    """Return the position (N, 1) of a hardening spring that is let go, by scipy's RK45, with noise of 3 mm."""
    times = np.arange(SAMPLES) * STEP
    found = solve_ivp(
        lambda _, s: [s[1], -4.0 * s[0] - 0.1 * s[1] - HARDENING * s[0] ** 3], (0.0, times[-1]), [START, 0.0],
        t_eval=times, rtol=1e-9, atol=1e-12,
    )  # fmt: skip
    noise = np.random.default_rng(5).standard_normal(SAMPLES)
    return np.asarray(found.y[0] + 3e-3 * noise)[:, None]


@pytest.mark.parametrize("start", [START, 0.0], ids=["declared where it is let go", "declared at its rest"])
def test_errors_of_the_right_model_die_out_also_near_the_rest(start: float, tmp_path: Path) -> None:
    """Linearised a size beyond the start, errors grew by 3 % a row near the rest, and the selection data lost by it."""
    model = MODEL.replace("START", str(start))
    prepared = prepare(load_case(write_case(tmp_path, model, STEP, (("position", "m", "output"),), ring())))
    bank = score_bank(prepared, prepared.hypotheses, 0)
    (found,) = fit_rows(prepared, [r for r in bank.rows if r.attachment.key == "cubic_stiffness state:v"])
    assert found.values["cubic_stiffness state:v"]["k3"][0] == pytest.approx(HARDENING, rel=0.03)
    assert found.select_gain > 20.0
    predictor, point = found.predictor, found.fit.point
    rest = np.zeros_like(predictor.middle[0])
    assert forgets(predictor.compiled, (rest, predictor.middle[1]), point.theta, predictor.gain(point), STEP)


def test_advice_speaks_of_no_steps_on_inputs_that_are_not_there() -> None:
    for inputs in (True, False):
        told = [describe(None, ["a", "b"], "look", inputs)["text"], describe_closer(None, inputs)["text"]]
        assert ["teps on the recorded inputs" in str(t) or "No steps on the" in str(t) for t in told] == [inputs] * 2
