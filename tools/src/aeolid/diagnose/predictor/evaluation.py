"""Evaluate a stochastic predictor at a point: gain, innovations, noise model, likelihood.

Innovations form: x⁺ = F(x, u, θ) + K s e, y = h(x, u, θ) + e, e coloured by a VAR(q) noise model (S1 of the method).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.deadline import Deadline, unlimited
from aeolid.diagnose.predictor.gains import forgets, kalman_gain
from aeolid.diagnose.predictor.noise import Noise, ScoredRows, estimate_noise, filter_var, preferred_order, scored_rows
from aeolid.diagnose.predictor.point import LEAST_VARIANCE, Free, Point, Prior, Scales
from aeolid.models.integrate import Compiled, driven
from aeolid.models.integration_steps import substeps
from aeolid.models.machine_code import LANES

Array = NDArray[np.float64]
HUGE = 1e300  # objective of a point that diverges
RUN_AWAY = -1e3  # log-density of a sample that a model cannot foretell at all
_LOST = 1e100  # deviations: squares still have a value


class Evaluator:
    """Evaluate one compiled model on a set of segments."""

    def __init__(
        self, compiled: Compiled, segments: Sequence[Segment], scales: Scales, var_order: int | None = None,
        deadline: Deadline | None = None, places: tuple[tuple[Array, Array], ...] = (),
    ) -> None:  # fmt: skip
        self.compiled = compiled
        self.deadline = deadline or unlimited()
        self.segments = tuple(segments)
        self.scales = scales
        self.var_order = var_order
        self.places = places  # (x, u) at which a free gain has to forget, beside the middle
        self._acting: dict[int, tuple[bytes, Array]] = {}
        self._counts: dict[int, tuple[bytes, int]] = {}
        self._gain: tuple[bytes, Array] | None = None
        self._last: tuple[tuple[Point, list[Array]], ...] = ()
        self._noise: tuple[Sequence[Array], Noise | None] | None = None
        self._rows: dict[int, tuple[NDArray[np.bool_], NDArray[np.bool_]]] = {}
        self._tallies: dict[int, tuple[int, int]] = {}
        self._scored: dict[tuple[int, int], ScoredRows] = {}

    def on(self, segments: Sequence[Segment]) -> Self:
        """Return the same predictor for other data."""
        return type(self)(self.compiled, segments, self.scales, self.var_order, self.deadline)

    def informed(self, prior: Prior) -> Self:
        """Return the same predictor with other knowledge of its parameters."""
        scales = replace(self.scales, prior=prior)
        return type(self)(self.compiled, self.segments, scales, self.var_order, self.deadline)

    def with_order(self, order: int) -> Self:
        """Return the same predictor with another noise-model order."""
        return type(self)(self.compiled, self.segments, self.scales, order, self.deadline)

    def held_at(self, places: tuple[tuple[Array, Array], ...]) -> Self:
        """Return the same predictor for gains that forget at these states and inputs (x, u), too."""
        return type(self)(self.compiled, self.segments, self.scales, self.var_order, self.deadline, places)

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
        return self._behind_filters(point, index), self._count(point, index)

    def _count(self, point: Point, index: int) -> int:
        """Return a segment's integration steps a sample; kept for who asks for the same point again."""
        known, asked = self._counts.get(index), point.theta.tobytes() + point.x0[index].tobytes()
        if known is not None and known[0] == asked:
            return known[1]
        segment = self.segments[index]
        start = substeps(self.compiled, segment.middle, point.theta, point.x0[index], segment.fine_step)
        count = max(start, segment.least_steps)
        self._counts[index] = asked, count
        return count

    def _behind_filters(self, point: Point, index: int) -> Array:
        """Return a segment's inputs behind their filters; kept for the next point whose filters are the same."""
        segment, values = self.segments[index], point.theta[self.compiled.places_of_filters].tobytes()
        known = self._acting.get(index)
        if known is not None and known[0] == values:
            return known[1]
        history = segment.history if self.compiled.model.filters else segment.u
        u = driven(self.compiled, history, point.theta, segment.fine_step)[len(history) - len(segment.u) :]
        self._acting[index] = values, u
        return u

    def wide(self, base: Point, points: Sequence[Point], gains: Array, index: int) -> Array:
        """Return innovations (N, l, LANES) of one segment for up to LANES points near `base`, side by side.

        All have the same values of the input filters' parameters; gains (n, l, LANES) are theirs (`wide_gain`). The
        integration steps are those of `base`, so that a small step never changes them. Lanes without a point of their
        own repeat the first.
        """
        segment, lanes = self.segments[index], [*points, *[points[0]] * (LANES - len(points))]
        u, count = self._behind_filters(points[0], index), self._count(base, index)
        theta, x0 = np.stack([p.theta for p in lanes], axis=1), np.stack([p.x0[index] for p in lanes], axis=1)
        return self.compiled.predict_wide(u, segment.y, theta, gains, x0, segment.fine_step, count, segment.stride)

    def wide_gain(self, points: Sequence[Point]) -> Array:
        """Return the gains (n, l, LANES) of up to LANES points, the first one's in lanes that are left over."""
        gains = [self.gain(p) for p in points]
        return np.stack([*gains, *[gains[0]] * (LANES - len(gains))], axis=2)

    def gain(self, point: Point) -> Array:
        """Return the predictor's gain (n, l): given, or the Kalman gain of the noise amplitudes."""
        if point.K is not None and not np.any(point.noise):
            return point.K
        known, asked = self._gain, point.theta.tobytes() + point.noise.tobytes()
        if known is not None and known[0] == asked:  # starts that differ have one gain
            K = known[1]
        else:
            sizes, first = (self.scales.x0, self.scales.spread, self.scales.excursion), self.segments[0]
            K = kalman_gain(self.compiled, sizes, point.theta, point.noise, first.middle, first.step)
            self._gain = asked, K
        return K if point.K is None else K + point.K

    def innovations(self, point: Point) -> list[Array]:
        """Return the innovations (N, l) of every segment, the burn-in included; not to be written into.

        Those of the last two points are kept: a fit asks for a point again where it takes the next step.
        """
        for known, kept in self._last:
            if known is point:
                return kept
        K, found = self.gain(point), []
        for i, s in enumerate(self.segments):
            u, count = self.ready(point, i)
            found.append(self.compiled.innovations(u, s.y, point.theta, K, point.x0[i], s.fine_step, count, s.stride))
        self._last = ((point, found), *self._last[:1])
        return found

    def noise_of(self, innovations: Sequence[Array]) -> Noise | None:
        """Estimate the noise model of innovations; None where they are not finite. The last one is kept."""
        if self._noise is None or self._noise[0] is not innovations:
            self._noise = innovations, self._estimated(innovations)
        return self._noise[1]

    def _estimated(self, innovations: Sequence[Array]) -> Noise | None:
        for e, segment in zip(innovations, self.segments, strict=True):
            scored = np.abs(e[segment.burn :])
            if scored.max(initial=0.0) < 1e12:
                continue
            if np.any(np.isfinite(segment.y[segment.burn :][~(scored < 1e12)])):
                return None
        order = self.var_order if self.var_order is not None else 0
        return estimate_noise(innovations, [s.burn for s in self.segments], order)

    @cached_property
    def middle(self) -> tuple[Array, Array]:
        """Return the state (n,) and the input (r,) that the model is linearised at."""
        x = self.compiled.model.x0[: len(self.scales.x0)] + self.scales.excursion
        return x, self.segments[0].middle

    def objective(self, point: Point) -> float:
        """Return minus the log-likelihood, noise model concentrated out, plus the priors; huge where it diverges.

        A free gain that leaves the predictor unstable counts as diverging: over a short stretch its own start hides
        the growth, over other data nothing does.
        """
        if point.K is not None and not self._forgets(point):
            return HUGE
        innovations = self.innovations(point)
        noise = self.noise_of(innovations)
        if noise is None:
            return HUGE
        rows, early = self._tally(len(noise.var))
        value = 0.5 * rows * float(np.linalg.slogdet(noise.covariance)[1]) + self._penalty(point)
        return value + self._of_early_rows(innovations, noise, early)

    def _forgets(self, point: Point) -> bool:
        step, K = self.segments[0].step, self.gain(point)
        return all(forgets(self.compiled, at, point.theta, K, step) for at in (self.middle, *self.places))

    def _of_early_rows(self, innovations: Sequence[Array], noise: Noise, count: int) -> float:
        """Return minus the log-likelihood of rows whose lags are not known, but for a constant."""
        if not count:
            return 0.0
        squares = 0.0
        for i, e in enumerate(innovations):
            squares += float(np.sum((e[self.scored(i, len(noise.var)).measured_early] @ noise.early_factor) ** 2))
        return 0.5 * (squares + count * float(np.linalg.slogdet(noise.whole)[1]))

    def _penalty(self, point: Point) -> float:
        return 0.5 * float(np.sum(self.scales.prior.residual(point.theta) ** 2))

    def whitened(self, innovations: Sequence[Array], noise: Noise) -> Array:
        """Return the whitened, normalised innovations of all segments behind their burn-in as one vector (M,).

        Rows that are not scored are 0, those of a model that ran away infinite.
        """
        parts = []
        for i, (e, segment) in enumerate(zip(innovations, self.segments, strict=True)):
            rows = self.scored(i, len(noise.var))
            white = filter_var(e, noise.var)[segment.burn :] @ noise.factor
            white[rows.early - segment.burn] = e[rows.early] @ noise.early_factor
            if not np.abs(white).max(initial=0.0) < _LOST:  # NaN too
                white[~np.all(np.abs(white) < _LOST, axis=1)] = np.inf
            white[rows.silent - segment.burn] = 0.0
            parts.append(white)
        return np.concatenate(parts).ravel()

    def rows(self, order: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Tell of each row behind the burn-in whether it is scored, and whether one of its lags is not known.

        order: of the noise model. A row is scored where every output was measured, whatever the order.
        """
        if order not in self._rows:
            parts = [[r[s.burn :] for r in self.scored(i, order).masks] for i, s in enumerate(self.segments)]
            known, early = (np.concatenate(p) for p in zip(*parts, strict=True))
            self._rows[order] = known, early
        return self._rows[order]

    def _tally(self, order: int) -> tuple[int, int]:
        """Return how many rows are scored by their lags, and how many without."""
        if order not in self._tallies:
            known, early = self.rows(order)
            self._tallies[order] = int(np.sum(known & ~early)), int(np.sum(known & early))
        return self._tallies[order]

    def scored(self, index: int, order: int) -> ScoredRows:
        """Return which rows of a segment are scored under a noise model of this order."""
        if (index, order) not in self._scored:
            segment = self.segments[index]
            self._scored[index, order] = ScoredRows(scored_rows(segment.y, order), segment.burn)
        return self._scored[index, order]

    def choose_var_order(self, point: Point) -> int:
        """Return the noise-model order that BIC prefers; 0 where the gain is free and colours noise itself."""
        if point.K is not None:
            return 0
        burns = [s.burn for s in self.segments]
        return preferred_order(self.innovations(point), burns, stateless=not len(self.scales.x0))

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
