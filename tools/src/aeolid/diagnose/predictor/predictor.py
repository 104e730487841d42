"""Fit a stochastic predictor by prediction-error maximum likelihood: damped Gauss–Newton over its free values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.ahead import foretold
from aeolid.diagnose.predictor.bounded import held_starts, runs_away_at
from aeolid.diagnose.predictor.evaluation import HUGE, Evaluator
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.kinks import beyond_kinks
from aeolid.diagnose.predictor.noise import Noise, levelled_density, log_density
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.reflection import reflected
from aeolid.diagnose.predictor.sensitivity import sensitivity
from aeolid.diagnose.predictor.settling import settled
from aeolid.diagnose.predictor.steps import expected_gain, limited_step, limits_of, next_damping

Array = NDArray[np.float64]
_STEPS = 6  # with one set of sensitivities
_TRIES = 8  # dampings of one step


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Hold sensitivities J (M, k), those of the prior (p, k), and JᵀJ of both (k, k)."""

    jacobian: Array
    prior: Array
    gram: Array


class Predictor(Evaluator):
    """Evaluate and fit one compiled model on a set of segments."""

    def fit(self, start: Point, free: Free, iterations: int = 20, tolerance: float = 0.02) -> Fit | None:
        """Maximise the likelihood from `start` and return what stands there; None where the start itself diverges.

        A free gain that lets errors grow at states that the data lead to is fitted again among those that do not.
        """
        found = self.climb(start, free, iterations, tolerance)
        if found is None:
            return None
        places = runs_away_at(self, found[1]) if free.gain else ()
        if places:
            held = self.held_at(places)
            starts = held_starts(held, (found[1], start), free)
            reached = [held.climb(s, free, iterations, tolerance) for s in starts]
            found = min((r for r in reached if r is not None), key=lambda r: r[0], default=found)
        return self.at(found[1], free)

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
        if value >= HUGE:
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
            if trial_value >= HUGE and trial.K is not None:  # most often through the unit circle: go on behind it
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
        per_sample = log_density(base, noise, *self.rows(len(noise.var)))
        jacobian = sensitivity(self, point, noise, base, free)
        prior = self.scales.prior.residual(point.theta), self._prior_columns(free, jacobian.shape[1])
        return Fit(point, free, noise, float(per_sample.sum()), per_sample, base, jacobian, *prior)

    def _prior_columns(self, free: Free, width: int) -> Array:
        """Return the sensitivities (p, k) of the prior's residuals."""
        root: Array = self.scales.prior.root
        return np.hstack([root[:, list(free.theta)], np.zeros((len(root), width - len(free.theta)))])

    def score_elsewhere(self, fit: Fit, segments: Sequence[Segment]) -> tuple[Array, Predictor, Point]:
        """Return the per-sample log-likelihood of other data.

        Initial states are fitted on the burn-in; each segment has a noise level of its own (another wind, another
        amplitude), estimated on it for every model alike, so that what counts is the size of the errors. A free gain
        may forget a start slowly: what the burn-in leaves open of it is then learnt on the way, not extrapolated.
        """
        other = self.on(segments)
        point = replace(fit.point, x0=tuple(settled(self.on([s.head(s.burn)]), fit) for s in segments))
        lengths = [len(s.y) - s.burn for s in segments]
        known, early = other.rows(len(fit.noise.var))
        ahead = None if point.K is None else foretold(other, point, fit.noise, fit.free.x0)
        if ahead is not None:
            return levelled_density(ahead[0], fit.noise, lengths, known, early) + ahead[1], other, point
        white = other.whitened(other.innovations(point), fit.noise)
        return levelled_density(white, fit.noise, lengths, known, early), other, point
