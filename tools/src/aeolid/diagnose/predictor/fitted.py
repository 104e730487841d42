"""Hold a fitted predictor: where it stands, its residuals and their sensitivities."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.predictor.noise import Noise
from aeolid.diagnose.predictor.point import Free, Point

Array = NDArray[np.float64]
_NOTHING = 1e12  # variance along a direction that the data say nothing of, in sizes of its parameters


@dataclass(frozen=True, eq=False)
class Fit:
    """Hold a fitted predictor: where it stands, its noise, its residuals r (M,) and sensitivities J (M, k).

    prior_residual (p,), prior_jacobian (p, k): the same for what was known before, as if it had been measured. jumps:
    standard deviations of parameters on which the likelihood depends in jumps, by their index in θ: slopes tell none.
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
    jumps: tuple[tuple[int, float], ...] = ()

    @property
    def log_posterior(self) -> float:
        """Return what the fit maximises: the log-likelihood less what leaving the priors costs."""
        return self.log_likelihood - 0.5 * float(self.prior_residual @ self.prior_residual)

    @cached_property
    def std(self) -> Array:
        """Return the asymptotic standard deviation (k,) of the free parameters; inf where the data say nothing."""
        size, inverse, vectors = self._directions
        known = inverse < _NOTHING
        variance = np.einsum("ij,j,ij->i", vectors, np.where(known, inverse, 0.0), vectors)
        left_open = _NOTHING * np.sum(vectors[:, ~known] ** 2, axis=1) > 1.0  # by more than rounding of directions
        result: Array = np.where(left_open, np.inf, np.sqrt(variance) / size)
        for index, deviation in self.jumps:
            result[self.free.theta.index(index)] = deviation
        return result

    @cached_property
    def correlation(self) -> Array:
        """Return the correlations (k, k) of the estimates, asymptotically; -1 or 1 where only a sum is determined."""
        _, inverse, vectors = self._directions
        covariance = (vectors * inverse) @ vectors.T
        spread = np.sqrt(np.diag(covariance))
        result: Array = covariance / np.outer(spread, spread)
        return result

    def newton_step(self) -> Array:
        """Return the Gauss-Newton step (k,) from where the fit stands; none along what the data say nothing of."""
        downhill = self.jacobian.T @ self.residual + self.prior_jacobian.T @ self.prior_residual
        size, inverse, vectors = self._directions
        known = np.where(inverse < _NOTHING, inverse, 0.0)
        result: Array = vectors @ (known * (vectors.T @ (downhill / size))) / size
        return result

    @cached_property
    def _directions(self) -> tuple[Array, Array, Array]:
        """Return the sizes (k,) that parameters are scaled by, and variances (k,) along directions (k, k) of these."""
        gram = self.jacobian.T @ self.jacobian + self.prior_jacobian.T @ self.prior_jacobian
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        values, vectors = np.linalg.eigh(gram / np.outer(size, size))
        inverse = np.where(values > 1 / _NOTHING, 1.0 / np.maximum(values, 1 / _NOTHING), _NOTHING)
        return size, inverse, vectors
