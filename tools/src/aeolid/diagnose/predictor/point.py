"""Hold what a predictor needs beside data and what a fit may move: parameter values, free sets, scales."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import pinv
from aeolid.models.equations import Equations

Array = NDArray[np.float64]
LEAST_VARIANCE = 1e-16  # of process and sensor noise, in squares of their typical size


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
        drawn = pinv(self.root) @ rng.standard_normal(len(self.root))
        return Prior(theta + drawn, self.root)


@dataclass(frozen=True, eq=False)
class Scales:
    """Hold the typical sizes that finite differences and damping are measured in.

    away (n,): how far from the model's start its states usually are, where that is farther than twice their size x0.
    """

    theta: Array
    gain: Array
    x0: Array
    low: Array
    high: Array
    prior: Prior
    spread: Array  # (l,): standard deviation of each output
    away: Array | None = None

    @property
    def excursion(self) -> Array:
        """Return where the model is linearised, from its start (n,): a size away from where the states usually are."""
        return self.x0 if self.away is None else self.away + self.x0
