"""Turn a model into a stochastic predictor and fit it by prediction-error maximum likelihood.

Innovations form: x⁺ = F(x, u, θ) + K s e, y = h(x, u, θ) + e, e coloured by a VAR(q) noise model (S1 of the method).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.deadline import Deadline, unlimited
from aeolid.diagnose.gains import forgets, kalman_gain
from aeolid.diagnose.kinks import beyond_kinks
from aeolid.diagnose.noise import (
    Noise,
    estimate_noise,
    filter_var,
    levelled_density,
    log_density,
    preferred_order,
    touched,
)
from aeolid.diagnose.point import Free, Point, Prior, Scales, Segment
from aeolid.diagnose.reflection import reflected
from aeolid.diagnose.sensitivity import sensitivity
from aeolid.diagnose.settling import settled
from aeolid.diagnose.steps import LEAST_VARIANCE, expected_gain, limited_step, limits_of, next_damping
from aeolid.models.integrate import Compiled, driven, substeps
from aeolid.models.machine_code import LANES

Array = NDArray[np.float64]
_HUGE = 1e300
_STEPS = 6  # with one set of sensitivities
_TRIES = 8  # dampings of one step
_LOST = 1e100  # deviations: squares still have a value


@dataclass(frozen=True, eq=False)
class Fit:
    """Hold a fitted predictor: where it stands, its noise, its residuals r (M,) and sensitivities J (M, k).

    prior_residual (p,), prior_jacobian (p, k): the same for what was known before, as if it had been measured.
    """

    point: Point
    free: Free
    noise: Noise
    log_likelihood: float
    per_sample: Array
    residual: Array
    jacobian: Array
    prior_residual: Array
    prior_jacobian: Array

    @property
    def log_posterior(self) -> float:
        """Return what the fit maximises: the log-likelihood less what leaving the priors costs."""
        return self.log_likelihood - 0.5 * float(self.prior_residual @ self.prior_residual)

    @cached_property
    def std(self) -> Array:
        """Return the asymptotic standard deviation (k,) of the free parameters; inf where the data say nothing."""
        gram = self.jacobian.T @ self.jacobian + self.prior_jacobian.T @ self.prior_jacobian
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        values, vectors = np.linalg.eigh(gram / np.outer(size, size))
        inverse = np.where(values > 1e-12, 1.0 / np.maximum(values, 1e-12), 1e12)
        variance = np.einsum("ij,j,ij->i", vectors, inverse, vectors)
        result: Array = np.sqrt(variance) / size
        return result


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Hold sensitivities J (M, k), those of the prior (p, k), and JᵀJ of both (k, k)."""

    jacobian: Array
    prior: Array
    gram: Array


class Predictor:
    """Evaluate and fit one compiled model on a set of segments."""

    def __init__(
        self, compiled: Compiled, segments: Sequence[Segment], scales: Scales, var_order: int | None = None,
        deadline: Deadline | None = None,
    ) -> None:  # fmt: skip
        self.compiled = compiled
        self.deadline = deadline or unlimited()
        self.segments = tuple(segments)
        self.scales = scales
        self.var_order = var_order

    def on(self, segments: Sequence[Segment]) -> Predictor:
        """Return the same predictor for other data."""
        return Predictor(self.compiled, segments, self.scales, self.var_order, self.deadline)

    def informed(self, prior: Prior) -> Predictor:
        """Return the same predictor with other knowledge of its parameters."""
        scales = replace(self.scales, prior=prior)
        return Predictor(self.compiled, self.segments, scales, self.var_order, self.deadline)

    def with_order(self, order: int) -> Predictor:
        """Return the same predictor with another noise-model order."""
        return Predictor(self.compiled, self.segments, self.scales, order, self.deadline)

    def run(self, point: Point, index: int) -> tuple[Array, Array, Array]:
        """Return innovations (N, l), predictions (N, l) and states (N + 1, n) of one segment."""
        segment = self.segments[index]
        return self.run_rows(point, index, 0, segment.y, point.x0[index], self.gain(point))

    def run_rows(
        self, point: Point, index: int, first: int, y: Array, x: Array, K: Array, generate: bool = False,
        ready: tuple[Array, int] | None = None,
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        """Run rows first … first + len(y) − 1 of a segment from state x with measurements (or innovations) y."""
        segment = self.segments[index]
        u, count = ready or self.ready(point, index)
        part = u[first * segment.stride : (first + len(y)) * segment.stride]
        return self.compiled.predict(
            part, np.ascontiguousarray(y), point.theta, K, x, segment.fine_step, count, segment.stride, generate
        )

    def ready(self, point: Point, index: int) -> tuple[Array, int]:
        """Return a segment's inputs behind their filters and its integration steps a sample; short runs share it."""
        segment = self.segments[index]
        u = driven(self.compiled, segment.u, point.theta, segment.fine_step)
        return u, substeps(self.compiled, segment.middle, point.theta, point.x0[index], segment.fine_step)

    def wide(self, base: Point, points: Sequence[Point], index: int) -> Array:
        """Return innovations (N, l, LANES) of one segment for up to LANES points near `base`, side by side.

        All have the same values of the input filters' parameters. The integration steps are those of `base`, so that
        a small step never changes them. Lanes without a point of their own repeat the first.
        """
        segment, first = self.segments[index], points[0]
        lanes = [*points, *[first] * (LANES - len(points))]
        u = driven(self.compiled, segment.u, first.theta, segment.fine_step)
        count = substeps(self.compiled, segment.middle, base.theta, base.x0[index], segment.fine_step)
        theta, x0 = np.stack([p.theta for p in lanes], axis=1), np.stack([p.x0[index] for p in lanes], axis=1)
        gains = [self.gain(points[0])]
        for before, p in pairwise(points):  # starts that differ have one gain
            same = before.K is p.K and np.array_equal(before.theta, p.theta) and np.array_equal(before.noise, p.noise)
            gains.append(gains[-1] if same else self.gain(p))
        K = np.stack([*gains, *[gains[0]] * (LANES - len(gains))], axis=2)
        return self.compiled.predict_wide(u, segment.y, theta, K, x0, segment.fine_step, count, segment.stride)

    def gain(self, point: Point) -> Array:
        """Return the predictor's gain (n, l): given, or the Kalman gain of the noise amplitudes."""
        if point.K is not None and not np.any(point.noise):
            return point.K
        sizes, first = (self.scales.x0, self.scales.spread), self.segments[0]
        K = kalman_gain(self.compiled, sizes, point.theta, point.noise, first.middle, first.step)
        return K if point.K is None else K + point.K

    def innovations(self, point: Point) -> list[Array]:
        """Return the innovations (N, l) of every segment, the burn-in included."""
        K, found = self.gain(point), []
        for i, s in enumerate(self.segments):
            u, count = self.ready(point, i)
            found.append(self.compiled.innovations(u, s.y, point.theta, K, point.x0[i], s.fine_step, count, s.stride))
        return found

    def noise_of(self, innovations: Sequence[Array]) -> Noise | None:
        """Estimate the noise model of innovations; None where they are not finite."""
        for e, segment in zip(innovations, self.segments, strict=True):
            bounded = np.abs(e[segment.burn :]) < 1e12
            if not np.all(bounded) and np.any(np.isfinite(segment.y[segment.burn :][~bounded])):
                return None
        order = self.var_order if self.var_order is not None else 0
        return estimate_noise(innovations, [s.burn for s in self.segments], order)

    @cached_property
    def middle(self) -> tuple[Array, Array]:
        """Return the state (n,) and the input (r,) that the model is linearised at."""
        x = self.compiled.model.x0[: len(self.scales.x0)] + self.scales.x0
        return x, self.segments[0].middle

    def objective(self, point: Point) -> float:
        """Return minus the log-likelihood, noise model concentrated out, plus the priors; huge where it diverges.

        A free gain that leaves the predictor unstable counts as diverging: over a short stretch its own start hides
        the growth, over other data nothing does.
        """
        step = self.segments[0].step
        if point.K is not None and not forgets(self.compiled, self.middle, point.theta, self.gain(point), step):
            return _HUGE
        noise = self.noise_of(self.innovations(point))
        if noise is None:
            return _HUGE
        rows = sum(int(np.sum(np.all(np.isfinite(s.y), axis=1))) for s in self.segments)
        return 0.5 * rows * float(np.linalg.slogdet(noise.covariance)[1]) + self._penalty(point)

    def _penalty(self, point: Point) -> float:
        return 0.5 * float(np.sum(self.scales.prior.residual(point.theta) ** 2))

    def whitened(self, innovations: Sequence[Array], noise: Noise) -> Array:
        """Return the scored, whitened, normalised innovations of all segments as one vector (M,).

        Rows that a missing measurement touches are 0, those of a model that ran away infinite.
        """
        parts = []
        for e, segment in zip(innovations, self.segments, strict=True):
            white = filter_var(e, noise.var)[segment.burn :] @ noise.factor
            gone = ~np.all(np.abs(white) < _LOST, axis=1)
            white[gone] = np.where(touched(segment.y, len(noise.var))[segment.burn :][gone], 0.0, np.inf)[:, None]
            parts.append(white)
        return np.concatenate(parts).ravel()

    def choose_var_order(self, point: Point) -> int:
        """Return the noise-model order that BIC prefers; 0 where the gain is free and colours noise itself."""
        if point.K is not None:
            return 0
        return preferred_order(
            self.innovations(point), [s.burn for s in self.segments], stateless=not self.scales.x0.size
        )

    def fit(self, start: Point, free: Free, iterations: int = 20, tolerance: float = 0.02) -> Fit | None:
        """Maximise the likelihood from `start` and return what stands there; None where the start itself diverges."""
        found = self.climb(start, free, iterations, tolerance)
        return None if found is None else self.at(found[1], free)

    def climb(
        self, start: Point, free: Free, iterations: int = 20, tolerance: float = 0.02
    ) -> tuple[float, Point] | None:
        """Minimise the objective from `start` by damped Gauss–Newton until the deadline; None where `start` diverges.

        Sensitivities serve several steps, as long as each still gains a fifth of the first one. Stops when one set of
        them gains less than `tolerance` nats and promises no more; where it does, kinks are looked beyond, then the
        values on them held. Cost: k + 1 filter passes an iteration, a few for each further step.
        """
        value, point, damping = self.objective(start), start, 1e-3
        held: tuple[int, ...] = ()
        if value >= _HUGE:
            return None
        for _ in range(iterations):
            if self.deadline.skips("the last iterations of fits"):
                break
            begun, slopes, first = value, None, 0.0
            for _ in range(_STEPS):
                before, kept = value, damping
                slopes, value, point, damping = self._step(value, point, free, damping, slopes, held)
                damping = kept if value == before else damping  # old sensitivities failed, new ones need not
                first = max(first, before - value)
                if before - value < max(tolerance, 0.2 * first) or self.deadline.passed:
                    break
            if begun - value < tolerance:
                promised = self._promised(point, free, slopes, tolerance)
                found = beyond_kinks(self, value, point, free, promised)
                if found.value > value - tolerance and (held or not found.kinks):
                    break
                held = found.kinks if found.value > value - tolerance else ()
                value, point, damping = found.value, found.point, 1e-3
        return value, point

    def _promised(self, point: Point, free: Free, slopes: _Slopes | None, tolerance: float) -> Array:
        """Return the nats that each free θ alone would gain by its slope, 0 below the tolerance or out of its range."""
        count = len(free.theta)
        if slopes is None or not count:
            return np.zeros(count)
        downhill = self._downhill(point, slopes, self._noise_and_base(point)[1])[:count]
        theta, low, high = (v[list(free.theta)] for v in (point.theta, self.scales.low, self.scales.high))
        blocked = ((theta <= low) & (downhill < 0)) | ((theta >= high) & (downhill > 0))
        alone = downhill**2 / np.maximum(2 * np.diag(slopes.gram)[:count], 1e-300)
        return np.where((alone > tolerance) & ~blocked, alone, 0.0)

    def _step(
        self, value: float, point: Point, free: Free, damping: float, slopes: _Slopes | None, held: tuple[int, ...]
    ) -> tuple[_Slopes, float, Point, float]:
        """Take one damped step with given or new sensitivities; returns them, the value, the point, the damping.

        held: places in the free θ that stay.
        """
        noise, base = self._noise_and_base(point)
        slopes = self._slopes(sensitivity(self, point, noise, base, free), free) if slopes is None else slopes
        downhill = self._downhill(point, slopes, base)
        limits = limits_of(self, point, free, len(downhill)).holding(held)
        for _ in range(_TRIES):
            step = limited_step(slopes.gram, downhill, damping, limits)
            trial = self.move(point, free, step)
            trial_value = self.objective(trial)
            if trial_value >= _HUGE and trial.K is not None:  # most often through the unit circle: go on behind it
                trial = reflected(self.compiled, self.middle, trial, free, noise.covariance, self.segments[0].step)
                trial_value = self.objective(trial)
            if trial_value < value:
                squares = float(downhill @ step - 0.5 * step @ slopes.gram @ step)
                share = (value - trial_value) / expected_gain(squares, len(base))
                return slopes, trial_value, trial, next_damping(damping, share)
            damping = min(damping * 10 + 1e-6, 1e6)
        return slopes, value, point, damping

    def _noise_and_base(self, point: Point) -> tuple[Noise, Array]:
        innovations = self.innovations(point)
        noise = self.noise_of(innovations)
        assert noise is not None  # the objective was finite here
        return noise, self.whitened(innovations, noise)

    def _downhill(self, point: Point, slopes: _Slopes, base: Array) -> Array:
        found: Array = slopes.jacobian.T @ base + slopes.prior.T @ self.scales.prior.residual(point.theta)
        return found

    def _slopes(self, jacobian: Array, free: Free) -> _Slopes:
        prior = self._prior_columns(free, jacobian.shape[1])
        return _Slopes(jacobian, prior, jacobian.T @ jacobian + prior.T @ prior)

    def at(self, point: Point, free: Free) -> Fit:
        """Return residuals, sensitivities and likelihood at a point, noise model estimated there."""
        noise, base = self._noise_and_base(point)
        per_sample = log_density(base, noise, self.segments[0].y.shape[1])
        jacobian = sensitivity(self, point, noise, base, free)
        prior = self.scales.prior.residual(point.theta), self._prior_columns(free, jacobian.shape[1])
        return Fit(point, free, noise, float(per_sample.sum()), per_sample, base, jacobian, *prior)

    def _prior_columns(self, free: Free, width: int) -> Array:
        """Return the sensitivities (p, k) of the prior's residuals."""
        root: Array = self.scales.prior.root
        return np.hstack([root[:, list(free.theta)], np.zeros((len(root), width - len(free.theta)))])

    def move(self, point: Point, free: Free, step: Array) -> Point:
        """Return the point a step (k,) further: free θ, noise variances, gains and starts, in that order."""
        theta, amplitude, x0 = point.theta.copy(), point.noise.copy(), [x.copy() for x in point.x0]
        K = None if point.K is None else point.K.copy()
        c = len(free.theta)
        a, b = c + len(free.noise), c + len(free.noise) + len(free.gain)
        for i, d in zip(free.theta, step[:c], strict=True):
            theta[i] = np.clip(theta[i] + d, self.scales.low[i], self.scales.high[i])
        for i, d in zip(free.noise, step[c:a], strict=True):
            amplitude[i] = np.sqrt(max(amplitude[i] ** 2 + d, LEAST_VARIANCE))
        if K is not None:
            for (i, j), d in zip(free.gain, step[a:b], strict=True):
                K[i, j] += d
        for s in range(len(x0)):
            for k, i in enumerate(free.x0):
                x0[s][i] += step[b + s * len(free.x0) + k]
        return Point(theta, amplitude, K, tuple(x0))

    def score_elsewhere(self, fit: Fit, segments: Sequence[Segment]) -> tuple[Array, Predictor, Point]:
        """Return the per-sample log-likelihood of other data.

        Initial states are fitted on the burn-in; each segment has a noise level of its own (another wind, another
        amplitude), estimated on it for every model alike, so that what counts is the size of the errors.
        """
        other = self.on(segments)
        point = replace(fit.point, x0=tuple(settled(self.on([s.head(s.burn)]), fit) for s in segments))
        white = other.whitened(other.innovations(point), fit.noise)
        lengths = [len(s.y) - s.burn for s in segments]
        return levelled_density(white, fit.noise, lengths), other, point
