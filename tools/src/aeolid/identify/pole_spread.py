"""Find the deviations of poles and shapes straight from those of Ξ, for the many models of a stabilisation diagram.

The same first-order analysis as `uncertainty`, whose symbols are used, with the product by a pole's eigenvectors taken
first. Of Δλ = wᴴ ΔA v and Δψ of `shape_spread` each is Σ_ab G_ab ΔΞ_ab with a matrix G (l, p m + r) that costs a
product with the f shifts of a vector; cov(vec ΔΞ) = Λ ⊗ (spread spreadᵀ) gives the covariance. A pole costs 2 f l p m
and 2 l (p m) rank operations, where the spread of all entries of the matrices costs n² times as much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from aeolid.identify.markov import MarkovEstimate
from aeolid.identify.subspace import ScaledModel, StateBasis
from aeolid.identify.uncertainty import covariance_of, projections, root_of
from aeolid.identify.windows import WindowFactor
from aeolid.models.shapes import reference_outputs, scaled_to

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Poles:
    """Hold the poles of one model: values (k,), one of each pair; covariance (k, 2, 2) of real and imaginary part.

    shapes (l, k): outputs in their scales, 1 at the reference (k,).
    """

    values: ComplexArray
    covariance: Array
    shapes: ComplexArray
    reference: NDArray[np.intp]


class Spreader:
    """Hold a model with what carries ΔΞ to it; one for each order of a diagram."""

    def __init__(
        self, factor: WindowFactor, basis: StateBasis, model: ScaledModel, markov: MarkovEstimate,
        through: tuple[bool, ...] = (),
    ) -> None:  # fmt: skip
        """Take a model of the regressions on a factor, its basis and the Ξ it came from; through: feedthrough."""
        n, outputs = len(model.A), factor.outputs
        self.model, self.channels, self.width = model, factor.channels, factor.past * factor.channels
        self.S = basis.selector(n).reshape(n, -1, outputs).transpose(1, 0, 2)  # (f, n, l): S_i
        self.parts = projections(factor, basis.state_map(n), model, through)
        self.spread, self.noise = markov.spread, root_of(markov.residual_covariance)
        self.values, self.right = (part.astype(complex) for part in np.linalg.eig(model.A))
        try:
            self.left: ComplexArray | None = np.linalg.inv(self.right)  # rows wᴴ
        except np.linalg.LinAlgError:  # no full set of eigenvectors: no first-order expansion
            self.left = None

    def poles(self) -> Poles:
        """Return the poles above the real axis with their covariance, and the shapes without."""
        up = np.flatnonzero(self.values.imag > 0)
        raw = self.model.C @ self.right[:, up]
        at = reference_outputs(raw)
        covariance = np.array([self._pole(int(i)) for i in up]).reshape(-1, 2, 2)
        return Poles(self.values[up], covariance, scaled_to(raw, at), at)

    def covariances(self) -> Array:
        """Return the covariance (n, 2, 2) of every pole, real ones too, in the order of `values`."""
        return np.array([self._pole(i) for i in range(len(self.values))]).reshape(-1, 2, 2)

    def shape_covariance(self, value: complex, reference: int) -> Array:
        """Return the covariance (l, 2, 2) of the shape of the pole nearest to a value, scaled to an output."""
        return np.array([covariance_of(row) for row in self.shape_reach(value, reference)])

    def shape_reach(self, value: complex, reference: int) -> ComplexArray:
        """Return what white noise of unit variance reaches of that shape, (l, k): all entries by the same noise."""
        i = int(np.argmin(abs(self.values - value)))
        outputs = len(self.model.C)
        if self.left is None:
            return np.full((outputs, 1), np.nan, dtype=complex)
        raw, v = self.model.C @ self.right, self.right[:, i]
        apart = self.values[i] - self.values
        weight = np.divide(1.0, apart, where=apart != 0, out=np.zeros(len(apart), dtype=complex))
        L = (raw * weight) @ self.left  # (l, n): C (λI − A)⁺
        psi = raw[:, i] / raw[reference, i]
        rows = (L - np.outer(psi, L[reference])) / raw[reference, i]
        own = (np.eye(outputs) - np.outer(psi, np.eye(outputs)[reference])) / raw[reference, i]
        return np.array([self._of_output(a, b, v) for a, b in zip(rows, own, strict=True)])

    def _pole(self, i: int) -> Array:
        if self.left is None:
            return np.full((2, 2), np.nan)
        return covariance_of(self._reach(self._of_state(self.left[i], self.right[:, i])))

    def _of_output(self, left: ComplexArray, own: ComplexArray, v: ComplexArray) -> ComplexArray:
        """Return what white noise reaches of left · ΔA v + own · ΔC v: left (n,), own (l,)."""
        fitted, now = self.parts[5][:, : len(v)] @ v, self.parts[4][:, : len(v)] @ v
        G = self._of_state(left, v)
        G[:, : len(fitted)] += np.outer(own, fitted)
        G[:, : self.width] -= self._shifted(own @ self.model.C, now)
        return self._reach(G)

    def _of_state(self, left: ComplexArray, v: ComplexArray) -> ComplexArray:
        """Return G (l, p m + r) of left · ΔA v."""
        before, after, rest, direct = (part[:, : len(v)] @ v for part in self.parts[:4])
        model, G = self.model, np.zeros((len(self.model.C), len(self.spread)), dtype=complex)
        G[:, : self.width] = self._shifted(left, after) - self._shifted(left @ model.A, before)
        G[:, : self.width] += self._shifted(left @ model.K @ model.C, rest)
        G[:, : len(direct)] += np.outer(left @ model.K, direct)
        return G

    def _shifted(self, row: ComplexArray, column: ComplexArray) -> ComplexArray:
        """Return Σ_i (row S_i)ᵀ times the column moved up by i blocks, (l, p m): row S ΔΓK column as G."""
        f, m, width = len(self.S), self.channels, self.width
        padded = np.concatenate([column[:width], np.zeros(f * m, dtype=complex)])
        step = padded.strides[0]
        moved = as_strided(padded, (f, width), (m * step, step), writeable=False)
        out: ComplexArray = np.einsum("n,inl->il", row, self.S).T @ moved
        return out

    def _reach(self, G: ComplexArray) -> ComplexArray:
        out: ComplexArray = (self.noise.T @ G @ self.spread).ravel()
        return out
