"""Choose a fit's next step: damped Gauss–Newton within ranges and within what still forgets its start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq, pinv
from aeolid.diagnose.predictor.evaluation import Evaluator
from aeolid.diagnose.predictor.gains import closed_loop
from aeolid.diagnose.predictor.point import LEAST_VARIANCE, Free, Point

Array = NDArray[np.float64]
_ROUNDS = 12  # times the limits are looked through
_NEAR = 0.97  # eigenvalues from this modulus on are kept off the unit circle
_SHARE = 0.5  # of its distance from the unit circle an eigenvalue may cover in one step
_LEAST = 1e-5  # damping
_STEEP = 1e100  # a slope beyond is none
_STEP = 1e-4  # of a typical size, for the eigenvalues' slopes


@dataclass(frozen=True, eq=False)
class Limits:
    """Hold what a step (k,) must respect: ranges of its first entries; walls: slopes (w, k) · step ≤ slack (w,)."""

    value: Array
    low: Array
    high: Array
    slopes: Array
    slack: Array

    def holding(self, places: Sequence[int]) -> Limits:
        """Return the limits with some of the first entries held where they are."""
        low, high = self.low.copy(), self.high.copy()
        low[list(places)] = high[list(places)] = self.value[list(places)]
        return replace(self, low=low, high=high)


def limits_of(predictor: Evaluator, point: Point, free: Free, width: int) -> Limits:
    """Return the ranges of the free θ and noise variances and, where gains are free, the walls, for `width` entries.

    A variance may fall to a tenth and grow tenfold in a step: its effect on the gain is far from straight beyond.
    """
    theta, scales = list(free.theta), predictor.scales
    variance = point.noise[list(free.noise)] ** 2
    value = np.concatenate([point.theta[theta], variance])
    low = np.concatenate([scales.low[theta], np.maximum(0.1 * variance, LEAST_VARIANCE)])
    high = np.concatenate([scales.high[theta], 10 * variance + 1e-6])
    limits = Limits(value, low, high, np.zeros((0, width)), np.zeros(0))
    return limits if point.K is None or not free.gain else _with_walls(limits, predictor, point, free)


def _with_walls(limits: Limits, predictor: Evaluator, point: Point, free: Free) -> Limits:
    """Add that no eigenvalue of A − K C comes closer to the unit circle than half its distance.

    d|λ| = Re(λ̄/|λ| · wᴴ d(A − K C) v / wᴴ v), v and w the right and left eigenvectors. Without it a fit runs against
    the unit circle and stands still there: every step that gains leads through it (130 nats were left on an OpenFAST
    recording).
    """
    closed, C = _closed(predictor, point, point.theta)
    values, right = np.linalg.eig(closed)
    near = np.abs(values) > _NEAR
    if not np.any(near):
        return limits
    left = pinv(right)[near]  # rows wᴴ with wᴴ v = 1
    turn = np.conj(values[near]) / np.abs(values[near])
    slopes = np.zeros((int(near.sum()), limits.slopes.shape[1]))
    for place, index in enumerate(free.theta):
        h = _STEP * max(float(predictor.scales.theta[index]), abs(float(point.theta[index])))
        theta = point.theta.copy()
        theta[index] += h
        change = (_closed(predictor, point, theta)[0] - closed) / h
        if np.any(change):
            slopes[:, place] = np.real(turn * np.einsum("wi,ij,jw->w", left, change, right[:, near]))
    seen, first = C @ right[:, near], len(free.theta) + len(free.noise)  # (l, w)
    for place, (i, j) in enumerate(free.gain, first):
        slopes[:, place] = -np.real(turn * left[:, i] * seen[j])
    slack = _SHARE * np.maximum(1 - np.abs(values[near]), 0.0)
    good = np.all(np.abs(slopes) < _STEEP, axis=1)  # not a number either: a defective pair has no slope
    return replace(limits, slopes=slopes[good], slack=slack[good])


def _closed(predictor: Evaluator, point: Point, theta: Array) -> tuple[Array, Array]:
    assert point.K is not None
    return closed_loop(predictor.compiled, predictor.middle, theta, point.K, predictor.segments[0].step)


def expected_gain(squares: float, count: int) -> float:
    """Return the nats that a fall of half the squared residuals by `squares` brings, of `count` residuals of size one.

    The noise level follows the residuals: count/2 · log of their ratio, not the fall itself.
    """
    left = max(1.0 - 2.0 * squares / max(count, 1), 1e-3)
    return max(-0.5 * count * float(np.log(left)), 1e-300)


def next_damping(damping: float, share: float) -> float:
    """Return the damping of the next step: less where the last one gained what was expected of it (Nielsen 1999).

    A damping that falls with every success lets weakly determined gains jump far into other optima.
    """
    return max(damping * (0.2 if share > 0.75 else 1.0 if share > 0.25 else 5.0), _LEAST)


def limited_step(gram: Array, downhill: Array, damping: float, limits: Limits) -> Array:
    """Solve the damped normal equations (Levenberg–Marquardt) within the limits, by a small active set.

    What would leave its range ends there, and the others follow: cut off afterwards, its share would spoil theirs.
    """
    count, size = len(limits.value), np.sqrt(np.maximum(gram.diagonal(), 1e-300))
    scaled = gram / (size[:, None] * size)
    scaled.flat[:: len(size) + 1] += damping + 1e-10
    walls, push = limits.slopes / size, downhill / size
    low, high = ((end - limits.value) * size[:count] for end in (limits.low, limits.high))
    side, held = np.zeros(len(downhill), dtype=int), np.zeros(len(limits.slack), dtype=bool)
    step = np.zeros(len(downhill))
    for _ in range(_ROUNDS):
        moving, active, freed = side == 0, walls[held], np.zeros(count, dtype=bool)
        if moving.all():
            step, force = _solve(scaled, push, active, limits.slack[held])
        else:
            step[:] = 0.0
            step[:count] = np.where(side[:count] < 0, low, np.where(side[:count] > 0, high, 0.0))
            room = limits.slack[held] - active @ step
            step[moving], force = _solve(
                scaled[np.ix_(moving, moving)], (push - scaled @ step)[moving], active[:, moving], room
            )
            pull = (push - scaled @ step - active.T @ force)[:count]
            freed = ((side[:count] < 0) & (pull > 0)) | ((side[:count] > 0) & (pull < 0))
        own, free = step[:count], moving[:count]
        below, above = free & (own < low), free & (own > high)
        through = (walls @ step > limits.slack) & ~held
        if not (below | above | freed).any() and not through.any():
            break
        side[:count] = np.where(freed, 0, np.where(below, -1, np.where(above, 1, side[:count])))
        held |= through
    step[:count] = np.clip(step[:count], low, high)
    result: Array = step / size
    return result


def _solve(matrix: Array, push: Array, walls: Array, slack: Array) -> tuple[Array, Array]:
    """Minimise ½ sᵀ M s − pᵀ s with W s = slack; returns s and the walls' multipliers (w,)."""
    if not len(slack):
        return np.asarray(np.linalg.solve(matrix, push[:, None])[:, 0], dtype=np.float64), slack
    solved = np.asarray(np.linalg.solve(matrix, np.column_stack([push, walls.T])), dtype=np.float64)
    step, back = solved[:, 0], solved[:, 1:]
    needed = lstsq(walls @ back, walls @ step - slack)
    force = np.maximum(np.asarray(needed, dtype=np.float64), 0.0)
    return step - back @ force, force
