"""Check the test for feedback of a disturbance: its level, its power against theory, and what it says."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import beta, binom, chi2, ncx2

from aeolid.identify.ort import identify_ort
from aeolid.identify.ort.feedback import LAGS, LEVEL, _compare, check_feedback
from aeolid.identify.ort.joint import Layout
from aeolid.identify.windows import Scaling, factorise
from aeolid.plants.disturbed_loop import simulate_disturbed_loop

LAYOUT = Layout((1,), (0,), (2,), 12, 10, (True,))  # blocks [u, r, y]
UNIT = Scaling(("u", "r"), ("y",), np.zeros(3), np.ones(3))


def feedback_test(samples, seed, back=0.0):
    record = simulate_disturbed_loop(samples, seed, back=back)
    joint = replace(record, channels=tuple(replace(c, role="input") if c.name == "r" else c for c in record.channels))
    return check_feedback(factorise([joint], UNIT, 22), LAYOUT, ("r",))[0]


def test_level_of_the_feedback_test():
    """No feedback: as many p-values below 5 % and 30 % as chance and the correction for the lags allow, at the most."""
    p = np.array([feedback_test(1000, seed).p_value for seed in range(60)])
    for level in (0.05, 0.3):
        assert np.count_nonzero(p < level) <= binom.ppf(0.999, len(p), level), level


@pytest.mark.parametrize("samples, back", [(1000, 0.05), (1000, 0.03), (4000, 0.02)])
def test_power_of_the_feedback_test(samples, back):
    """5, 3 or 2 % of y in r: found as often as the noncentral χ² of the best number of lags alone would, at least.

    The noncentrality of each number of lags follows from one recording of 100,000 samples.
    """
    record = simulate_disturbed_loop(100_000, 1000, back=back)
    r, w = record.column("r"), record.columns(["y", "u"])
    own = np.column_stack([r[12 - i : -i] for i in range(1, 13)])
    power = []
    for lags in sorted({min(n, 12) for n in LAGS}):
        past = np.column_stack([w[12 - i : -i] for i in range(1, lags + 1)])
        left = [np.linalg.lstsq(X, r[12:], rcond=None)[1][0] for X in (own, np.hstack([own, past]))]
        limit = chi2.isf(LEVEL / len(LAGS), 2 * lags)
        power.append(ncx2.sf(limit, 2 * lags, samples * np.log(left[0] / left[1])))
    found = sum(feedback_test(samples, seed, back).p_value < LEVEL for seed in range(40))
    assert found >= binom.ppf(0.001, 40, max(power)), (found, power)


@pytest.mark.parametrize("N, own, count", [(60, 5, 10), (200, 12, 24), (1000, 20, 40)])
def test_p_values_are_those_of_the_exact_test(N, own, count):
    """Where nothing returns, RSS′/RSS of Gaussian news is a beta variable: of N − own − c − 1 and c squares, halved."""
    for level in (0.5, 0.1, 0.01, 1e-4):
        ratio = 1 / beta.ppf(level, (N - own - 1 - count) / 2, count / 2)
        p_value, share = _compare(ratio, 1.0, own, count, N)
        assert p_value == pytest.approx(level, rel=1e-9)
        assert share == pytest.approx(max(1 - (N - own - 1) / (N - own - count - 1) / ratio, 0.0))


def test_feedback_is_said_with_its_remedy():
    result = identify_ort([simulate_disturbed_loop(8000, 1, back=0.05)], past=15, order=2)
    assert (
        result.feedback[0].alarms and "'r' is not free of feedback: past inputs and outputs explain" in result.notes[0]
    )
    assert "give it the role input and use method varx" in result.notes[0]
    assert not any(t.alarms for t in identify_ort([simulate_disturbed_loop(1000, 1)], past=15, order=2).feedback)
