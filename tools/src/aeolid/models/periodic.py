"""Write a scheduled model whose scheduling is an angle as a Fourier series in the angle of the rotor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError, UsageError
from aeolid.models.hill import MOST_HARMONICS, Complex, Indices
from aeolid.models.lpv import LpvStateSpace

Array = NDArray[np.float64]
PARTS = {"_cos": (0.5, 0.5), "_sin": (0.5j, -0.5j)}  # of cosine and sine at the harmonics −1 and +1
LARGEST = 1e9  # an entry of A, which the eigenvalue problem still resolves beside others of 1e-6


@dataclass(frozen=True, eq=False)
class Series:
    """Hold A_h (2M + 1, n, n) and C_h (2M + 1, l, n), h = −M … M, of A(ψ) = Σ A_h e^{ihψ}; weights (m, 2M + 1).

    weights: the series of each entry of μ = [1, s], so that A_h = Σ_i weights_ih A⁽ⁱ⁾; angle: what turns.
    """

    A: Complex
    C: Complex
    weights: Complex
    angle: str

    def seen(self, vector: Complex, orders: Indices) -> tuple[Indices, Complex]:
        """Return the orders and c_n = Σ_m C_{n−m} v_m, (·, l), of a solution v (orders, n)."""
        reach = (len(self.C) - 1) // 2
        out = np.zeros((len(vector) + 2 * reach, self.C.shape[1]), complex)
        for i, part in enumerate(self.C):
            out[i : i + len(vector)] += vector @ part.T
        return np.arange(orders[0] - reach, orders[-1] + reach + 1), out


@dataclass(frozen=True, eq=False)
class Covariance:
    """Hold the covariance of the entries of [A⁽¹⁾ A⁽²⁾ …] (n, blocks n), row by row, over a scaled scheduling.

    μ_i = (s_i − offset_i)/scale_i: weights (m, 2M + 1) is its series in the angle.
    """

    matrix: Array
    weights: Complex

    def derivative(self, v: Complex, w: Complex, orders: Indices, theta: float) -> Complex:
        """Return dλ by each entry of A: Σ_n e^{−inθ} w_n* Σ_h weights_jh v_{n−h}, for v, w (orders, n) with wᴴv = 1."""
        states = v.shape[1]
        blocks = self.matrix.shape[0] // states**2
        reach = (self.weights.shape[1] - 1) // 2
        left = w.conj() * np.exp(-1j * theta * orders)[:, None]
        wide = np.vstack([np.zeros((reach, states)), v, np.zeros((reach, states))])
        shifted = np.stack([wide[2 * reach - k : 2 * reach - k + len(v)] for k in range(2 * reach + 1)])  # v_{n−h}
        return np.asarray(np.einsum("na,jh,hnb->ajb", left, self.weights[:blocks], shifted).ravel())

    def of(self, derivative: Complex) -> Array:
        """Return the covariance (2, 2) of real and imaginary part."""
        parts = np.stack([derivative.real, derivative.imag])
        return np.asarray(parts @ self.matrix @ parts.T)


def angle_of(name: str) -> str:
    """Return the angle whose cosine or sine a scheduling channel is, empty where it is none.

    >>> angle_of("azimuth_cos"), angle_of("wind")
    ('azimuth', '')
    """
    return name[:-4] if name[-4:] in PARTS else ""


def angles_of(model: LpvStateSpace) -> tuple[str, ...]:
    """Return the angles that a model is scheduled by."""
    return tuple(dict.fromkeys(a for s in model.scheduling if (a := angle_of(s.name))))


def series_of(model: LpvStateSpace, at: Mapping[str, float], multiples: Mapping[str, int]) -> Series:
    """Return the model as a Fourier series in the angle of the rotor.

    at: values of the scheduling channels that are no angle; multiples: how often each angle turns in a revolution,
    default once. Raises UsageError where there is no angle or several without multiples, or a value is missing;
    DataError on entries beyond any size.
    """
    angles = angles_of(model)
    names = ", ".join(s.name for s in model.scheduling)
    if not angles:
        raise UsageError(
            f"the model is scheduled by {names}, none of them the cosine or sine of an angle (azimuth_cos, "
            "azimuth_sin): it is not periodic; modes at an operating point are those of at(...)"
        )
    largest = max(float(abs(model.A).max()), float(abs(model.C).max(initial=0.0)))
    if largest > LARGEST:
        raise DataError(f"the model's matrices hold {largest:.3g}; entries of at most {LARGEST:g} are analysed")
    weights = weights_of(model, at, multiples)
    A = np.einsum("ih,iab->hab", weights, model.A)
    C = np.einsum("ih,iab->hab", weights, model.C)
    return Series(A, C, weights, ", ".join(angles))


def weights_of(model: LpvStateSpace, at: Mapping[str, float], multiples: Mapping[str, int]) -> Complex:
    """Return the series (m, 2M + 1) of μ = [1, s]: cosines and sines, and what stands still. Raises as `series_of`."""
    unknown = [n for n in at if n not in {s.name for s in model.scheduling} or angle_of(n)]
    if unknown:
        raise UsageError(f"{unknown[0]!r} is no scheduling channel that stands still during a revolution")
    angles = angles_of(model)
    _require_multiples(angles, multiples)
    reach = max(multiples.get(a, 1) for a in angles)
    out = np.zeros((1 + len(model.scheduling), 2 * reach + 1), complex)
    out[0, reach] = 1.0
    for i, signal in enumerate(model.scheduling, 1):
        angle = angle_of(signal.name)
        if angle:
            k = multiples.get(angle, 1)
            out[i, reach - k], out[i, reach + k] = PARTS[signal.name[-4:]]
        elif signal.name in at and np.isfinite(at[signal.name]):
            out[i, reach] = float(at[signal.name])
        else:
            raise UsageError(f"scheduling channel {signal.name!r} is no angle: a value that it keeps is needed, "
                             f"{signal.name}=…")  # fmt: skip
    return out


def scaled_weights(weights: Complex, offset: Array, scale: Array) -> Complex:
    """Return the series of μ = [1, (s − offset)/scale] from that of [1, s]; offset, scale (m − 1,)."""
    out = weights.copy()
    out[1:] = (weights[1:] - offset[:, None] * weights[:1]) / scale[:, None]
    return out


def _require_multiples(angles: tuple[str, ...], multiples: Mapping[str, int]) -> None:
    for name, k in multiples.items():
        if name not in angles:
            raise UsageError(f"{name!r} is no angle of the model; it has {', '.join(angles)}")
        if not (isinstance(k, int) and 1 <= k <= MOST_HARMONICS // 4):
            raise UsageError(f"{name} = {k}: an angle turns 1 … {MOST_HARMONICS // 4} times in a revolution")
    if len(angles) > 1 and len(multiples) < len(angles):
        raise UsageError(
            f"the model has {len(angles)} angles, {', '.join(angles)}: how often each turns in a revolution of the "
            f"rotor is needed, such as {angles[0]}=1, {angles[1]}=3"
        )
