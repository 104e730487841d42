"""Values of an effect with their deviations: all of them together, so that what two share is in both."""

from __future__ import annotations

import numpy as np
import pytest
from test_run_prior import rig

from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.evidence import evidence_at
from aeolid.diagnose.run_prior.explain import Found
from aeolid.diagnose.run_prior.hypotheses import all_hypotheses
from aeolid.diagnose.run_prior.pair import NOTHING
from aeolid.diagnose.run_prior.search import Scored, Search
from aeolid.diagnose.run_prior.values import quadratic_peak, values_of

OMEGA, DAMPING = 25.0, 0.7


@pytest.mark.parametrize("values", [1, 2, 3])
def test_a_quadratic_peaks_where_it_does_with_the_deviations_of_all_its_values(values: int) -> None:
    """Against the inverse of minus its second derivatives: the covariance of a Gaussian whose logarithm it is."""
    rng = np.random.default_rng(values)
    for _ in range(20):
        half = rng.standard_normal((values, values))
        precision, peak = half @ half.T + 0.1 * np.eye(values), rng.uniform(-2, 2, values)
        x = rng.uniform(-2, 2, (1 + 4 * values + 4 * values, values))
        y = 1e3 - 0.5 * np.einsum("mi,ij,mj->m", x - peak, precision, x - peak)
        found, deviations = quadratic_peak(x, y)
        np.testing.assert_allclose(found, peak, atol=1e-7)
        np.testing.assert_allclose(deviations, np.sqrt(np.diag(np.linalg.inv(precision))), rtol=1e-7)


def test_a_value_that_changes_nothing_stays_where_it_is() -> None:
    x = np.array([[a, b] for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0)])
    found, deviations = quadratic_peak(x, -((x[:, 0] - 0.5) ** 2))
    np.testing.assert_allclose(found, [0.5, 0.0], atol=1e-9)
    assert deviations[0] == pytest.approx(np.sqrt(0.5))
    assert np.all(quadratic_peak(x, x[:, 0] ** 2)[0] == 0.0)  # a valley has no peak


def test_what_frequency_and_damping_share_is_in_both_deviations() -> None:
    """Of a drive the data tell the delay 2 ζ/ω best: each value alone, the other held, would be told far too surely."""
    pair = pair_of([rig(50, omega=OMEGA)], [rig(51)], {})
    h = next(h for h in all_hypotheses(pair, {}) if h.entry == "actuator_second_order")
    search = Search(pair)
    start = (1.15 * OMEGA, 1.15 * DAMPING)  # the delay is right
    weight = search.gain(h, start)[1]
    values, deviations = values_of(pair, search.ridge, Found(Scored(h, start, 0, 0, weight), None, ()), NOTHING)
    for value, deviation, truth in zip(values, deviations, (OMEGA, DAMPING), strict=True):
        assert abs(value - truth) < 3 * deviation < 0.4 * truth

    def at(point: tuple[float, ...]) -> float:
        return evidence_at(search.prior, pair.of_recordings(h.change(point)), weight)

    def alone(place: int) -> float:
        x = np.array([[-1.0], [0.0], [1.0]])
        moved = [tuple(v * (1 + 0.03 * k[0] * (i == place)) for i, v in enumerate(values)) for k in x]
        return float(quadratic_peak(x, np.array([at(v) for v in moved]))[1][0] * 0.03 * values[place])

    model = 0.03 * np.array(values)
    own = np.sqrt(np.array(deviations) ** 2 - model**2)
    assert np.all(own > 1.3 * np.array([alone(0), alone(1)]))
