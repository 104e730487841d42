"""Hold what a predictor runs on and what a fit may move: data, parameter values, free sets, scales."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aeolid.models.equations import Equations

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Segment:
    """Hold a gap-free stretch of one recording; the first `burn` rows settle the state and are not scored.

    y (N, l) one row every `step` seconds; u (N · stride, r) at the recording's own rate.
    """

    u: Array
    y: Array
    step: float
    source: str
    start_s: float
    burn: int
    stride: int = 1

    @property
    def fine_step(self) -> float:
        """Return the sample time of u in seconds."""
        return self.step / self.stride

    @cached_property
    def middle(self) -> Array:
        """Return the typical input (r,)."""
        return np.median(self.u, axis=0) if len(self.u) else np.zeros(self.u.shape[1])

    @property
    def stop_s(self) -> float:
        """Return where the stretch ends, in seconds."""
        return self.start_s + len(self.y) * self.step

    def head(self, rows: int) -> Segment:
        """Return the first rows, all scored."""
        return replace(self, u=self.u[: rows * self.stride], y=self.y[:rows], burn=0)


@dataclass(frozen=True, eq=False)
class Point:
    """Hold everything the predictor needs.

    theta (np,); noise: amplitudes (n + l,) of process and sensor noise in units of each state's and output's size,
    from which the Kalman gain follows, or K (n, l) itself where the noise has no physical home; x0 (n,) a segment.
    """

    theta: Array
    noise: Array
    K: Array | None
    x0: tuple[Array, ...]


def shifted(point: Point, model: Equations, values: Mapping[str, float]) -> Point:
    """Return the point with some parameters set by name."""
    theta = point.theta.copy()
    for name, value in values.items():
        theta[model.index(name)] = value
    return replace(point, theta=theta)


@dataclass(frozen=True)
class Free:
    """Name what a fit may move: entries of θ, noise amplitudes, entries of K, entries of every segment's x0."""

    theta: tuple[int, ...]
    noise: tuple[int, ...]
    gain: tuple[tuple[int, int], ...]
    x0: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Prior:
    """Hold what is known of θ before the recording: root (p, np) of its precision about mean (np,)."""

    mean: Array
    root: Array

    def residual(self, theta: Array) -> Array:
        """Return root (mean − θ), (p,): as many standard normal variables, if θ is as was known."""
        result: Array = self.root @ (self.mean - theta)
        return result

    def redrawn(self, theta: Array, rng: np.random.Generator) -> Prior:
        """Return the prior that another occasion of learning about this θ might have left."""
        drawn = np.linalg.pinv(self.root) @ rng.standard_normal(len(self.root))
        return Prior(theta + drawn, self.root)


@dataclass(frozen=True, eq=False)
class Scales:
    """Hold the typical sizes that finite differences and damping are measured in."""

    theta: Array
    gain: Array
    x0: Array
    low: Array
    high: Array
    prior: Prior
    spread: Array  # (l,): standard deviation of each output
