"""Estimate a few parameters recursively, sample by sample or batch by batch, with forgetting, in square-root form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GROWTH_MAX = 10.0  # of a variance over its start 1/ρ, before forgetting stops
REGULARISATION = 1e-4  # ρ: as if that part of a sample of unit size had been seen in each direction
FAINTEST = 1e-12  # of ρ, that a restart leaves: far below any data, and still invertible where there are none


class SmallRls:
    """Estimate Θ (t, k) of target = Θ φ recursively, with forgetting, in square-root form.

    P = root rootᵀ is updated by an orthogonal transformation of [√λ, 0; φᵀ root, root] (Potter's form), so it stays
    positive. A quiet spell cannot wind it up: forgetting stops while a variance is above GROWTH_MAX/ρ.
    """

    def __init__(
        self, targets: int, regressors: int, forgetting: float, regularisation: float = REGULARISATION
    ) -> None:
        self.forgetting = forgetting
        self.theta: Array = np.zeros((targets, regressors))
        self.root: Array = np.eye(regressors) / np.sqrt(regularisation)
        self._most = GROWTH_MAX / regularisation
        self._least = regularisation

    def update(self, regressor: Array, target: Array) -> Array:
        """Take one sample; returns the residual target − Θ φ (t,) with the new Θ. Cost: 3 k² + 2 t k."""
        f = self.root.T @ regressor
        rest = float(f @ f)
        lam = self.forgetting if (self.root**2).sum(axis=1).max() < self._most else 1.0
        alpha = lam + rest
        gain = self.root @ f
        error = target - self.theta @ regressor
        self.theta += np.outer(error, gain / alpha)
        self.root = (self.root - np.outer(gain, f / (alpha + np.sqrt(lam * alpha)))) / np.sqrt(lam)
        residual: Array = error * (lam / alpha)
        return residual

    def update_many(self, regressors: Array, targets: Array) -> Array:
        """Take samples (N, k) and (N, t), oldest first, at once; returns the residuals (N, t) with the last Θ.

        Θ and P are those of `update` one by one, but whether forgetting stops is asked once. Cost: 2 N k (k + t) + k³.
        """
        N = len(regressors)
        lam = self.forgetting if (self.root**2).sum(axis=1).max() < self._most else 1.0
        fade = np.sqrt(lam) ** np.arange(N)[::-1]
        faded = regressors * fade[:, None]
        R = np.linalg.qr(np.vstack([np.sqrt(lam) ** N * np.linalg.inv(self.root), faded]), mode="r")
        self.root = np.linalg.inv(R)
        error = (targets - regressors @ self.theta.T) * fade[:, None]
        self.theta = self.theta + error.T @ faded @ self.root @ self.root.T
        out: Array = targets - regressors @ self.theta.T
        return out

    def restart(self, regressors: Array, targets: Array) -> None:
        """Start again as if these samples, (N, k) and (N, t), oldest first, had come one by one."""
        N, k = regressors.shape
        fade = np.sqrt(self.forgetting) ** np.arange(N)[::-1]
        first = np.sqrt(self._least * max(self.forgetting**N, FAINTEST)) * np.eye(k)  # what is left of P = I/ρ
        R = np.linalg.qr(np.vstack([first, regressors * fade[:, None]]), mode="r")
        self.root = np.linalg.inv(R)
        self.theta = (targets * (fade**2)[:, None]).T @ regressors @ self.root @ self.root.T
