"""The stochastic predictor: derivatives, optimum, gain and noise model against independent references."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.ahead import foretold
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.noise import (
    colour_var,
    estimate_noise,
    filter_var,
    levelled_density,
    log_density,
    preferred_order,
    scored_rows,
    touched,
)
from aeolid.diagnose.predictor.point import Free, Point, Prior, Scales
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.predictor.riccati import exponential, steady_gain
from aeolid.diagnose.predictor.sensitivity import sensitivity
from aeolid.models import equations_file
from aeolid.models.integrate import compile_equations

Array = NDArray[np.float64]
OSCILLATOR = """
[parameters]
w = { value = 3.0, min = 0.5, max = 10.0, free = true }
d = { value = 0.6, min = 0.0, max = 5.0, free = true }
b = { value = 2.0, min = -10.0, max = 10.0, free = true }
[[state]]
name = "q"
derivative = "v"
[[state]]
name = "v"
derivative = "-w**2*q - d*v + b*u"
[[output]]
name = "position"
equation = "q"
[[output]]
name = "speed"
equation = "v"
"""
DISTURBANCE = """
pole = { value = 0.5, min = 0.0, max = 10.0, free = true }
[[state]]
name = "sway"
derivative = "-pole*sway"
"""
TRUTH = np.array([3.4, 0.9, 2.6])
STEP = 0.1


@cache
def compiled():  # type: ignore[no-untyped-def]
    return compile_equations(equations_file.from_toml(tomllib.loads(OSCILLATOR), OSCILLATOR, "model.toml"))


@cache
def recording(seed: int, samples: int = 300) -> Segment:
    """Simulate with scipy-free exact steps: x⁺ = Φ x + Γ u + process noise, both outputs noisy."""
    from scipy.linalg import expm

    w, d, b = TRUTH
    flow = expm(np.array([[0, 1, 0], [-(w**2), -d, b], [0, 0, 0]]) * STEP)
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 4 + 1), 4)[:samples]
    x, y = np.zeros(2), np.empty((samples, 2))
    for k in range(samples):
        y[k] = x + rng.standard_normal(2) * (0.02, 0.06)
        x = flow[:2, :2] @ x + flow[:2, 2] * u[k] + [0, 0.08] * rng.standard_normal(2)
    return Segment(u[:, None], y, STEP, f"recording {seed}", 0.0, 0)


def predictor(segments: tuple[Segment, ...], order: int = 0, prior: Array | None = None) -> Predictor:
    spread = np.vstack([s.y for s in segments]).std(axis=0)
    known = np.column_stack([TRUTH, np.full(3, np.inf)]) if prior is None else prior
    scales = Scales(
        np.abs(TRUTH), np.outer(spread, 1 / spread), spread, np.array([0.5, 0.0, -10.0]), np.array([10.0, 5.0, 10.0]),
        Prior(known[:, 0], np.diag(1 / known[:, 1])), spread,
    )  # fmt: skip
    return Predictor(compiled(), segments, scales, order)


def point(count: int, *, gain: bool) -> Point:
    start = tuple(np.array([0.05, -0.1]) for _ in range(count))
    if gain:
        return Point(np.array([3.0, 0.6, 2.0]), np.zeros(4), np.array([[0.3, 0.05], [0.1, 0.2]]), start)
    return Point(np.array([3.0, 0.6, 2.0]), np.array([0.0, 0.2, 1.0, 0.7]), None, start)


def moved(p: Point, kind: str, where: tuple[int, ...], by: float) -> Point:
    if kind == "theta":
        theta = p.theta.copy()
        theta[where[0]] += by
        return replace(p, theta=theta)
    if kind == "noise":
        noise = p.noise.copy()
        noise[where[0]] = np.sqrt(noise[where[0]] ** 2 + by)
        return replace(p, noise=noise)
    if kind == "gain":
        assert p.K is not None
        K = p.K.copy()
        K[where] += by
        return replace(p, K=K)
    x0 = [x.copy() for x in p.x0]
    x0[where[0]][where[1]] += by
    return replace(p, x0=tuple(x0))


@pytest.mark.parametrize("gain", [False, True], ids=["Kalman gain", "free gain"])
@pytest.mark.parametrize("order", [0, 2])
def test_sensitivities_are_the_derivatives(gain: bool, order: int) -> None:
    """Forward differences of 1e-5 relative against central ones of 1e-4: agree to the second derivative times 1e-5."""
    segments = (recording(1), recording(2, 200))
    p, at = predictor(segments, order), point(2, gain=gain)
    noise = p.noise_of(p.innovations(at))
    assert noise is not None
    base = p.whitened(p.innovations(at), noise)
    free = Free((0, 1, 2), () if gain else (1, 3), ((0, 0), (0, 1), (1, 0), (1, 1)) if gain else (), (0, 1))
    J = sensitivity(p, at, noise, base, free)
    places: list[tuple[str, tuple[int, ...]]] = [("theta", (i,)) for i in free.theta]
    places += [("noise", (i,)) for i in free.noise] + [("gain", ij) for ij in free.gain]
    places += [("start", (s, i)) for s in range(2) for i in free.x0]
    assert J.shape == (len(base), len(places) + 4 * order)
    for column, (kind, where) in enumerate(places):
        h = 1e-4
        sides = [p.whitened(p.innovations(moved(at, kind, where, s * h)), noise) for s in (1, -1)]
        reference = -(sides[0] - sides[1]) / (2 * h)
        error = np.linalg.norm(J[:, column] - reference) / np.linalg.norm(reference)
        assert error < (5e-3 if kind == "noise" else 1e-3), (
            kind,
            where,
            error,
        )  # the gain's own tolerance is 1e-10/1e-10


@pytest.mark.parametrize("gain", [False, True], ids=["Kalman gain", "free gain"])
def test_what_is_kept_of_a_point_is_what_a_new_predictor_says_of_it(gain: bool) -> None:
    """Points in any order, each asked for again: innovations, noise and likelihood, to the last bit."""
    segments, rng = (recording(1), recording(2, 200)), np.random.default_rng(4)
    kept = predictor(segments, 2)
    points = [moved(point(2, gain=gain), "theta", (0,), by) for by in (0.0, 0.1, -0.2)]
    for k in rng.integers(0, 3, 30):
        new = predictor(segments, 2)
        assert kept.objective(points[k]) == new.objective(points[k])
        mine, its = kept.innovations(points[k]), new.innovations(points[k])
        assert all(np.array_equal(a, b) for a, b in zip(mine, its, strict=True))
        noise, same = kept.noise_of(mine), new.noise_of(its)
        assert noise is not None and same is not None
        assert np.array_equal(noise.var, same.var) and np.array_equal(noise.factor, same.factor)


@pytest.mark.parametrize("seed", range(4))
def test_what_moves_nothing_but_rounding_has_no_slope(seed: int) -> None:
    """The pole of a disturbance without a gain: its slope was 1e-9 of rounding, its first step as far as it could go.

    Baselines begin so. Which end it ran to differed between processors, and with it where fits ended (40 nats).
    """
    text = OSCILLATOR.replace('position"\nequation = "q', 'position"\nequation = "q + sway').replace(
        "[[state]]", DISTURBANCE + "[[state]]", 1
    )
    model, plain = (
        compile_equations(equations_file.from_toml(tomllib.loads(text), text, "model.toml")),
        predictor((recording(seed),)),
    )
    assert [s.name for s in model.model.states] == ["sway", "q", "v"] and model.model.index("pole") == 3
    theta = np.append(TRUTH, 0.5)
    scales = replace(
        plain.scales, theta=theta, x0=np.ones(3), gain=np.ones((3, 2)), low=np.append(plain.scales.low, 0.0),
        high=np.append(plain.scales.high, 10.0), prior=Prior(theta, np.zeros((0, 4))),
    )  # fmt: skip
    other = Predictor(model, plain.segments, scales, 0)
    start = Point(theta, np.zeros(5), np.array([[0.0, 0.0], [0.3, 0.05], [0.1, 0.2]]), (np.zeros(3),))
    free = Free((0, 1, 2, 3), (), tuple(np.ndindex(3, 2)), (0, 1, 2))
    noise = other.noise_of(other.innovations(start))
    assert noise is not None
    slopes = sensitivity(other, start, noise, other.whitened(other.innovations(start), noise), free)
    assert np.flatnonzero(~np.any(slopes, axis=0)).tolist() == [3]
    found = other.climb(start, free, iterations=1)
    assert found is not None and found[1].theta[3] == 0.5 and np.all(found[1].theta[:3] != TRUTH)


def test_noise_model_sensitivities_are_the_derivatives() -> None:
    """Residuals are linear in the VAR coefficients: equality to rounding."""
    p, at = predictor((recording(1),), 2), point(1, gain=False)
    e = p.innovations(at)
    noise = p.noise_of(e)
    assert noise is not None
    base = p.whitened(e, noise)
    J = sensitivity(p, at, noise, base, Free((0,), (), (), ()))[:, 1:]
    column = 0
    for i in range(2):
        for a in range(2):
            for b in range(2):
                var = noise.var.copy()
                var[i, a, b] += 1.0
                change = base - (filter_var(e[0], var) @ noise.factor).ravel()
                change[:4] = 0.0  # two rows whose lags are not known
                np.testing.assert_allclose(J[:, column], change, atol=1e-9)
                column += 1


@pytest.mark.parametrize("gain", [False, True])
def test_gradient_of_the_likelihood_is_minus_the_scores_sum(gain: bool) -> None:
    """∂/∂p ½ N log|Σ̂| = Σ rᵀ ∂r/∂p = −Jᵀ r: the sum of scores is the gradient, noise concentrated out."""
    p, at = predictor((recording(3),)), point(1, gain=gain)
    fit = p.at(at, Free((0, 1, 2), (), (), (0, 1)))
    scores = -fit.jacobian.T @ fit.residual
    places: list[tuple[str, tuple[int, ...]]] = [
        *(("theta", (i,)) for i in range(3)),
        *(("start", (0, i)) for i in range(2)),
    ]
    for score, (kind, where) in zip(scores, places, strict=True):
        h = 1e-5
        slope = (p.objective(moved(at, kind, where, h)) - p.objective(moved(at, kind, where, -h))) / (2 * h)
        assert score == pytest.approx(slope, rel=5e-3, abs=0.05)  # nats a unit; forward differences in the scores


@pytest.mark.parametrize("order", [0, 1])
def test_gauss_newton_reaches_the_optimum_that_scipy_finds(order: int) -> None:
    """The fit stops below 0.02 nats an iteration; a simplex search from there and from afar must not beat it by 0.1."""
    p, start = predictor((recording(4),), order), point(1, gain=False)
    free = Free((0, 1, 2), (1, 3), (), (0, 1))
    fit = p.fit(start, free, iterations=40)
    assert fit is not None

    def unpack(z: Array) -> Point:
        noise = np.array([0.0, np.exp(z[3]), 1.0, np.exp(z[4])])
        return Point(np.clip(z[:3], [0.5, 0, -10], [10, 5, 10]), noise, None, (z[5:7],))

    best = fit.point
    origin = np.concatenate([best.theta, np.log(best.noise[[1, 3]]), best.x0[0]])
    simplex = minimize(lambda z: p.objective(unpack(z)), origin, method="Nelder-Mead",
                       options={"maxfev": 700, "xatol": 1e-6, "fatol": 1e-4})  # fmt: skip
    assert p.objective(fit.point) - simplex.fun < 0.1
    assert p.objective(start) - p.objective(fit.point) > 50
    np.testing.assert_array_less(np.abs(fit.point.theta - TRUTH) / fit.std[:3], 3.5)  # true values within the spread


def test_standard_deviations_are_those_of_the_information() -> None:
    p = predictor((recording(4),))
    fit = p.at(point(1, gain=False), Free((0, 1, 2), (), (), (0, 1)))
    reference = np.sqrt(np.diag(np.linalg.inv(fit.jacobian.T @ fit.jacobian)))
    np.testing.assert_allclose(fit.std, reference, rtol=1e-6)


def test_standard_deviations_cover_the_truth() -> None:
    """|θ̂ − θ|/σ over 12 recordings times 3 parameters: chi² of 36; the 99.9 % range is 13.1 … 67.9."""
    total = 0.0
    for seed in range(12):
        p = predictor((recording(20 + seed, 250),), 1)
        fit = p.fit(point(1, gain=False), Free((0, 1, 2), (1, 3), (), (0, 1)), iterations=30)
        assert fit is not None
        total += float(np.sum(((fit.point.theta - TRUTH) / fit.std[:3]) ** 2))
    assert 13.1 < total < 67.9, total


def test_a_prior_holds_and_bounds_hold() -> None:
    prior = np.column_stack([[3.0, 0.6, 1.0], [np.inf, np.inf, 1e-6]])
    p = predictor((recording(5),), 0, prior)
    fit = p.fit(point(1, gain=False), Free((0, 1, 2), (1, 3), (), (0, 1)))
    assert fit is not None and fit.point.theta[2] == pytest.approx(1.0, abs=1e-4)
    tight = predictor((recording(5),))
    tight.scales = replace(tight.scales, high=np.array([3.1, 5.0, 10.0]))
    fit = tight.fit(point(1, gain=False), Free((0, 1, 2), (1, 3), (), (0, 1)))
    assert fit is not None and fit.point.theta[0] <= 3.1


def test_two_segments_add_up() -> None:
    one, two = predictor((recording(6),)), predictor((recording(6), recording(6)))
    a = one.at(point(1, gain=False), Free((0, 1), (), (), (0,)))
    b = two.at(point(2, gain=False), Free((0, 1), (), (), (0,)))
    assert b.log_likelihood == pytest.approx(2 * a.log_likelihood, rel=1e-9)
    assert b.jacobian.shape[1] == 4  # each segment has a start of its own
    np.testing.assert_allclose(b.jacobian[: len(a.residual), 3], 0)


def test_missing_rows_are_left_out() -> None:
    """A row that nobody measured changes nothing, nor do the two behind it: the same innovations fewer in number."""
    segment = recording(7)
    y = segment.y.copy()
    y[40:60] = np.nan
    y[100, 0] = np.nan
    p, at = predictor((replace(segment, y=y),)), point(1, gain=False)
    p.scales = predictor((segment,)).scales
    fit = p.at(at, Free((0, 1, 2), (), (), (0, 1)))
    rows = fit.residual.reshape(-1, 2)
    assert np.all(np.isfinite(fit.residual)) and np.all(np.isfinite(fit.jacobian))
    assert np.all(rows[40:60] == 0) and np.all(rows[100] == 0)
    assert np.count_nonzero(np.all(rows == 0, axis=1)) == 21 + 2 + 2
    seen = ~touched(y, 2)
    assert np.linalg.norm(rows[seen].T @ rows[seen] / seen.sum() - np.eye(2)) < 1e-6


def test_data_that_blow_up_are_worth_nothing() -> None:
    p, at = predictor((recording(8),)), point(1, gain=True)
    assert at.K is not None
    assert p.objective(replace(at, K=-50 * np.eye(2))) >= 1e299
    assert p.fit(replace(at, K=-50 * np.eye(2)), Free((0,), (), (), ())) is None


@pytest.mark.parametrize("seed", range(6))
def test_steady_gain_solves_the_riccati_equation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 7)), int(rng.integers(1, 4))
    A = rng.standard_normal((n, n))
    A *= rng.uniform(0.3, 1.3) / np.max(np.abs(np.linalg.eigvals(A)))  # some are unstable
    C, half, R = rng.standard_normal((m, n)), rng.standard_normal((n, n)), np.diag(rng.uniform(0.1, 2.0, m))
    Q = half @ half.T * rng.uniform(1e-3, 10)
    P = solve_discrete_are(A.T, C.T, Q, R)
    reference = A @ P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
    np.testing.assert_allclose(steady_gain(A, C, Q, R), reference, rtol=1e-6, atol=1e-8 * np.abs(reference).max())


def test_steady_gain_without_process_noise_is_zero() -> None:
    A, C = np.array([[0.9, 0.1], [0.0, 0.8]]), np.array([[1.0, 0.0]])
    np.testing.assert_allclose(steady_gain(A, C, np.zeros((2, 2)), np.eye(1)), 0, atol=1e-12)


@pytest.mark.parametrize("size", [1e-3, 0.4, 30.0])
def test_the_exponential_is_that_of_scipy(size: float) -> None:
    """From slow to fast modes within a row; tolerance: rounding, doubled by each of up to seven squarings."""
    rng = np.random.default_rng(4)
    for n in (1, 3, 12):
        A = rng.standard_normal((n, n))
        A = size * (A - 2.0 * np.eye(n) * np.linalg.norm(A, 2)) / np.linalg.norm(A, 2)  # stable: e^A stays finite
        reference = expm(A)
        np.testing.assert_allclose(exponential(A), reference, atol=1e-12 * np.abs(reference).max(), rtol=0)
    assert not np.any(np.isfinite(exponential(np.full((2, 2), np.nan))))
    assert not np.any(np.isfinite(exponential(np.full((2, 2), 1e12))))


@pytest.mark.parametrize("order", [0, 1, 3])
def test_the_noise_model_equals_a_plain_loop(order: int) -> None:
    rng = np.random.default_rng(order)
    parts = [rng.standard_normal((n, 2)) @ np.array([[1.0, 0.4], [0.0, 0.5]]) for n in (120, 80)]
    parts[0][30] = np.nan
    parts[1][50, 1] = np.nan
    burns = [10, 0]
    rows, targets = [], []
    for e, burn in zip(parts, burns, strict=True):
        for t in range(max(burn, order), len(e)):
            past = [e[t - i] for i in range(1, order + 1)]
            if np.all(np.isfinite(e[max(t - max(order, 2), 0) : t + 1])):  # two rows behind a gap are left out
                rows.append(np.concatenate(past) if past else np.zeros(0))
                targets.append(e[t])
    Z, Y = np.array(rows).reshape(len(targets), 2 * order), np.array(targets)
    W = np.linalg.lstsq(Z, Y, rcond=None)[0] if order else np.zeros((0, 2))
    noise = estimate_noise(parts, burns, order)
    np.testing.assert_allclose(noise.covariance, (Y - Z @ W).T @ (Y - Z @ W) / len(Y), rtol=1e-8)
    for i in range(order):
        np.testing.assert_allclose(noise.var[i], W[2 * i : 2 * i + 2].T, atol=1e-8)
    factor = noise.factor
    np.testing.assert_allclose(factor.T @ noise.covariance @ factor, np.eye(2), atol=1e-9)


def test_whitening_and_colouring_are_inverse() -> None:
    rng = np.random.default_rng(1)
    e, var = rng.standard_normal((60, 2)), 0.15 * rng.standard_normal((2, 2, 2))  # stable
    np.testing.assert_allclose(colour_var(filter_var(e, var), var), e, atol=1e-12)
    np.testing.assert_allclose(filter_var(colour_var(e, var), var), e, atol=1e-12)


def test_the_order_of_the_noise_model_follows_the_noise() -> None:
    """White innovations get no colour; a second-order disturbance of the output gets two."""
    segment = recording(9, 600)
    p = predictor((segment,), 0)
    fit = p.fit(point(1, gain=False), Free((0, 1, 2), (1, 3), (), (0, 1)), iterations=30)
    assert fit is not None and p.choose_var_order(fit.point) == 0
    rng, coloured = np.random.default_rng(2), np.zeros((600, 2))
    for k in range(2, 600):
        coloured[k] = 1.2 * coloured[k - 1] - 0.6 * coloured[k - 2] + 0.3 * rng.standard_normal(2)
    noisy = predictor((replace(segment, y=segment.y + coloured),), 0)
    assert noisy.choose_var_order(replace(fit.point, noise=np.array([0, 1e-6, 1.0, 1.0]))) == 2


def test_other_data_are_scored_from_a_start_of_their_own() -> None:
    """A sealed part that begins in mid-motion is settled on its head, not started at rest."""
    p = predictor((recording(10),))
    fit = p.fit(point(1, gain=False), Free((0, 1, 2), (1, 3), (), (0, 1)), iterations=30)
    assert fit is not None
    whole = recording(11)
    late = Segment(whole.u[100:], whole.y[100:], STEP, "late", 10.0, 30)
    density, _, settled = p.score_elsewhere(fit, (late,))
    assert len(density) == 170
    states = p.on((whole,)).run(replace(fit.point, x0=(np.zeros(2),)), 0)[2]
    assert np.all(np.abs(settled.x0[0] - states[100]) < 0.5 * states.std(axis=0))
    assert density.mean() > fit.per_sample.mean() - 0.5  # half a nat a sample: the same world, other noise
    held = p.score_elsewhere(replace(fit, free=replace(fit.free, x0=(0,))), (late,))[2]
    assert held.x0[0][1] in (0.0, fit.point.x0[0][1])  # a state that is not in the fit is left where it was
    assert held.x0[0][0] != fit.point.x0[0][0]


def undamped(burn: int) -> tuple[Predictor, Fit, Segment]:
    """Return a free run of the oscillator that never forgets its start, at the truth, and other data to score."""
    rng, theta, first = np.random.default_rng(4), np.array([3.4, 0.0, 2.6]), np.array([0.4, -0.5])
    u = np.repeat(rng.choice([-1.0, 1.0], 75), 4)[:, None]
    y = compiled().predict(u, np.full((300, 2), np.nan), theta, np.zeros((2, 2)), first, STEP, 1, 1, False)[1]
    segment = Segment(u, y + rng.standard_normal((300, 2)) * (0.02, 0.06), STEP, "undamped", 0.0, 0)
    p = predictor((segment,))
    fit = p.at(Point(theta, np.zeros(4), np.zeros((2, 2)), (first,)), Free((), (), (), (0, 1)))
    return p, fit, replace(segment, burn=burn)


def test_a_start_that_is_not_forgotten_is_learnt_on_the_way() -> None:
    """The rows far behind the start are foretold alike however few rows settled it; extrapolated they lost 6 nats."""
    few, many = (p.score_elsewhere(fit, (s,))[0] for p, fit, s in (undamped(4), undamped(80)))
    assert few[-200:].sum() == pytest.approx(many[-200:].sum(), abs=1.0)


def test_other_data_have_the_likelihood_with_their_start_integrated_out() -> None:
    """Row by row it is that of r = J δ + white noise, δ normal as the settling rows leave it: one dense Gaussian."""
    p, fit, segment = undamped(4)
    other = p.on((segment,))
    start = p.score_elsewhere(fit, (segment,))[2]
    found = foretold(other, start, fit.noise, (0, 1))
    assert found is not None
    whole = p.on((replace(segment, burn=0),))
    r = whole.whitened(whole.innovations(start), fit.noise)
    J = sensitivity(whole, start, fit.noise, r, fit.free)
    P = np.linalg.inv(J[:8].T @ J[:8] + np.diag(1 / (10 * p.scales.x0) ** 2))
    dense = multivariate_normal(np.zeros(len(r) - 8), np.eye(len(r) - 8) + J[8:] @ P @ J[8:].T).logpdf(r[8:])
    density = -0.5 * (found[0] @ found[0] + len(found[0]) * np.log(2 * np.pi)) + found[1].sum()
    assert density == pytest.approx(float(dense), abs=1e-6)


def test_a_predictor_that_forgets_is_scored_as_it_predicts() -> None:
    p = predictor((recording(10),))
    fit = p.at(point(1, gain=True), Free((), (), (), (0, 1)))
    late = replace(recording(11), burn=120)
    density, other, start = p.score_elsewhere(fit, (late,))
    white = other.whitened(other.innovations(start), fit.noise)
    assert density == pytest.approx(levelled_density(white, fit.noise, [180], *other.rows(0)), abs=1e-6)


def test_what_is_fitted_is_what_is_reported() -> None:
    """The likelihood with its noise model concentrated out, and the sum over rows, are one; also from gaps and starts.

    A noise model of two rows says of the first two of a stretch how large they are, and nothing of the two behind a
    missing row. As the first rows' lags, left out, were counted, they cost 1,300 nats and bent every fit.
    """
    segment = recording(5)
    holed = replace(segment, y=segment.y.copy())
    holed.y[100] = np.nan
    holed.y[200:240, 1] = np.nan
    p = predictor((holed, recording(6, 150)), 2)
    at = replace(point(2, gain=False), x0=(np.array([4.0, -3.0]), np.array([0.1, 0.0])))  # a start that is far off
    fit = p.at(at, Free((0,), (), (), ()))
    rows = (300 - 2 - 3 - 42) + (150 - 2)
    known, early = p.rows(2)
    assert (int(np.sum(known & ~early)), int(np.sum(known & early))) == (rows, 4)
    assert int(np.sum(fit.per_sample != 0)) == rows + 4
    constant = rows * (1 + np.log(2 * np.pi)) + 4 * np.log(2 * np.pi)
    assert fit.log_likelihood == pytest.approx(-p.objective(at) - constant, rel=1e-9)
    squares = np.sum(fit.residual.reshape(-1, 2) ** 2, axis=1)
    assert not np.any(squares[~known])
    assert float(squares[~early].sum()) == pytest.approx(2 * rows, rel=1e-6)
    e = p.innovations(at)[0][:2]
    np.testing.assert_allclose(squares[:2], np.einsum("ij,jk,ik->i", e, np.linalg.inv(fit.noise.whole), e), rtol=1e-9)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_noise_models_of_every_order_are_compared_on_the_same_rows(unit: float) -> None:
    """Beside gaps an order gains what colour there is: of white noise next to nothing, whatever the outputs' unit."""
    rng = np.random.default_rng(5)
    e = rng.standard_normal((1500, 2)) * unit
    e[rng.random(1500) < 0.05] = np.nan
    likelihood = []
    for order in (0, 1, 2, 4):
        noise = estimate_noise([e], [20], order)
        known, early = (rows[20:] for rows in scored_rows(e, order))
        assert int(known.sum()) == int(np.sum(~touched(e, 2)[20:]))
        white = filter_var(e, noise.var)[20:] @ noise.factor
        white[early] = e[20:][early] @ noise.early_factor
        white[~known] = 0.0
        likelihood.append(float(log_density(white.ravel(), noise, known, early).sum()))
    # four coefficients a lag that fit chance gain two nats; ten is far beyond, and far below a unit's hundreds
    assert np.all(np.abs(np.diff(likelihood)) < 10)


def test_rows_in_turn_are_scored_where_nothing_else_is_left() -> None:
    y = np.ones((400, 1))
    y[::2] = np.nan
    known, early = scored_rows(y, 1)
    assert int(known.sum()) == 200
    assert np.all(early[known])


@pytest.mark.parametrize("missing", [0.0, 0.1, 0.3])
def test_gaps_do_not_make_white_noise_coloured(missing: float) -> None:
    """BIC takes a colour that is not there in few of 200 records, however many rows are missing."""
    rng = np.random.default_rng(0)
    chosen = 0
    for _ in range(200):
        e = rng.standard_normal((600, 1))
        e[rng.random(600) < missing] = np.nan
        chosen += preferred_order([e], [0]) > 0
    assert chosen <= 12  # one or two in a hundred are expected


def test_an_output_in_every_second_row_has_a_noise_model() -> None:
    """No two rows follow each other: there is no colour to be estimated, and nothing to be solved for."""
    e = np.random.default_rng(1).standard_normal((1000, 1))
    e[::2] = np.nan
    assert preferred_order([e], [0]) == 0
    noise = estimate_noise([e], [0], 2)
    assert not np.any(noise.var)
    np.testing.assert_allclose(noise.covariance, noise.whole)
    assert 0.8 < noise.whole[0, 0] < 1.2


def test_rows_without_a_measurement_say_nothing_of_other_data() -> None:
    """Two models differ by what the measured rows tell, however many are missing beside them."""
    p = predictor((recording(10),))
    fits = [p.at(replace(point(1, gain=True), theta=np.array([w, 0.6, 2.0])), Free((), (), (), ())) for w in (3.0, 3.6)]
    whole = replace(recording(11), burn=20)
    y = np.vstack([whole.y, np.full((200, 2), np.nan)])
    longer = replace(whole, y=y, u=np.vstack([whole.u, np.zeros((200, 1))]))
    short, long = ([p.score_elsewhere(f, (s,))[0].sum() for f in fits] for s in (whole, longer))
    assert long == pytest.approx(short, rel=1e-9)


def test_a_start_that_no_fit_moved_pays_nothing() -> None:
    """With no state's start settled, each row's density is that of its whitened residual alone."""
    p, fit, segment = undamped(4)
    found = foretold(p.on((segment,)), fit.point, fit.noise, ())
    assert found is not None
    white, paid = found
    whole = p.on((replace(segment, burn=0),))
    np.testing.assert_array_equal(white, whole.whitened(whole.innovations(fit.point), fit.noise)[2 * segment.burn :])
    assert len(paid) == 296 and not paid.any()


@pytest.mark.parametrize("order", [0, 2])
def test_a_model_that_runs_away_on_other_data_is_worth_nothing(order: int) -> None:
    """Its rows once counted as gaps, predicted without error: 33,000 nats for a spring that had lost its tower."""
    p = predictor((recording(10),), order)
    fit = p.fit(point(1, gain=False), Free((0, 1, 2), (1, 3), (), (0, 1)), iterations=30)
    assert fit is not None
    y = recording(11).y.copy()
    y[120] = np.nan
    gap = replace(recording(11), y=y, burn=30)
    free_run = np.array([0.0, 0.0, 1.0, 0.7])  # no process noise, so no gain that could hold it
    lost = replace(fit, point=replace(fit.point, theta=np.array([3.0, -60.0, 2.0]), noise=free_run))
    there, gone = (np.delete(p.score_elsewhere(f, (gap,))[0], range(90, 93)) for f in (fit, lost))
    assert np.all(np.isfinite(there)) and np.all(gone < there - 10) and np.all(np.isneginf(gone[-100:]))


def test_a_sensor_without_noise_is_no_crash() -> None:
    """A fit drove one sensor's noise to 6e-17 of the process noise: the doubling met a matrix singular to rounding."""
    A = np.zeros((7, 7))
    A[:3, :3] = [[0.9887, 0.0195, 1e-4], [-1.117, 0.94677, 0.01], [0, 0, 0.993]]
    A[3:5, 3:5] = [[0.99986, 0.016746], [-0.016746, 0.99885]]
    A[5:, 5:] = [[-0.191, 0.43326], [-0.43326, -0.4358]]
    C = np.zeros((2, 7))
    C[[0, 0, 1, 1], [0, 3, 1, 5]] = 1
    Q = np.diag([3e-4, 1.52, 1.77, 0, 0, 0.203, 1.285])
    for noise in 10.0 ** np.arange(-10, -320, -10.0):
        K = steady_gain(A, C, Q, np.diag([0.011, noise]))
        assert np.all(np.isfinite(K)) and np.max(abs(np.linalg.eigvals(A - K @ C))) < 1, noise


def test_a_parameter_at_the_end_of_its_range_does_not_hold_up_the_others() -> None:
    """The best damping lies beyond the range: fitting it too ends where the others' own best is, as quickly.

    Cut off after the step, its share spoiled the step of all: fits stopped up to a hundred nats short.
    """
    segments = (recording(1), recording(2, 200))
    p = predictor(segments)
    low = np.array([0.5, 2.5, -10.0])  # the true damping is 0.9
    bounded = Predictor(p.compiled, p.segments, replace(p.scales, low=low), 0)
    start = replace(point(2, gain=True), theta=np.array([3.0, 2.5, 2.0]))
    gains = tuple((i, j) for i in range(2) for j in range(2))
    held = bounded.fit(start, Free((0, 2), (), gains, (0, 1)), iterations=60, tolerance=1e-6)
    fit = bounded.fit(start, Free((0, 1, 2), (), gains, (0, 1)), iterations=6)
    assert held is not None and fit is not None
    assert fit.point.theta[1] == 2.5
    assert fit.log_likelihood == pytest.approx(held.log_likelihood, abs=0.05)


def test_a_parameter_whose_small_step_runs_away_says_nothing() -> None:
    """Near a cliff: exp of a large power of w is finite at 3.0, infinite a millionth above it; gaps stay gaps."""
    text = OSCILLATOR.replace("-w**2*q - d*v + b*u", "-w**2*q - d*v + b*u + 0*exp(709.7827*(w/3)**9 + 0*d)")
    model = compile_equations(equations_file.from_toml(tomllib.loads(text), text, "model.toml"))
    y = recording(1).y.copy()
    y[100:103] = np.nan
    p = Predictor(model, (replace(recording(1), y=y),), predictor((recording(1),)).scales, 0)
    at = point(1, gain=True)
    noise = p.noise_of(p.innovations(at))
    assert noise is not None
    base = p.whitened(p.innovations(at), noise)
    J = sensitivity(p, at, noise, base, Free((0, 1), (), (), ()))
    assert not np.any(J[:, 0]) and np.all(np.isfinite(J)) and np.any(J[:, 1])
    assert not np.any(J[200:206, 1])
    assert np.isinf(p.at(at, Free((0, 1), (), (), ())).std).tolist() == [True, False]
