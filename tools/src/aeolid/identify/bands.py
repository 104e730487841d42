"""Give the frequency response of an identified model with its deviation: gain and phase of each pair over frequency.

G(z) = C (zI − A)⁻¹ B + D at z = exp(2πifh). A change of the matrices moves it by
    ΔG = [C (zI − A)⁻¹, I] [ΔA ΔB; ΔC ΔD] [(zI − A)⁻¹ B; I],
linear in the spread of the matrices and free of the states' basis. Near a pole whose deviation is not small beside its
distance, as an integrator's at low frequencies, the next term counts, R Δλ²/(z − λ)³ with the pole's residue R: along
the thin axis of the first order's ellipse it is the larger one, even at a tenth of the distance. Its second moment is
added. The covariance is that of real and imaginary part; gain and phase follow by linearisation, which holds while the
95 % ellipse is well off the origin: where it reaches it the phase is unknown and the gain may be zero, so that its
interval begins there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.frequency import transfer
from aeolid.identify.subspace import ScaledModel
from aeolid.identify.uncertainty import MatrixSpread, covariance_of
from aeolid.models.modes import continuous_poles, frequency_and_damping

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
POINTS = 60  # of the even grid; five more at each mode with less damping than LIGHT
LIGHT = 0.1
ELLIPSE = 2.447747  # 95 % of the radius of two normal deviates


@dataclass(frozen=True, eq=False)
class Band:
    """Hold G (points, l, r) at frequency_hz (points,), and the covariance (points, l, r, 2, 2) of its two parts."""

    frequency_hz: Array
    response: ComplexArray
    covariance: Array

    @property
    def gain_std(self) -> Array:
        """Return the standard deviation of |G| (points, l, r): along G, where G is 0 along the longer axis."""
        s = self.covariance
        half, slant = (s[..., 0, 0] - s[..., 1, 1]) / 2, s[..., 0, 1]
        longest = (s[..., 0, 0] + s[..., 1, 1]) / 2 + np.sqrt(half**2 + slant**2)
        out: Array = np.where(self.response == 0, np.sqrt(np.maximum(longest, 0.0)), self._along(1.0))
        return out

    @property
    def phase_std(self) -> Array:
        """Return that of the phase in rad (points, l, r), NaN where the 95 % ellipse reaches the origin."""
        g, s = np.stack([self.response.real, self.response.imag], axis=-1), self.covariance
        determinant = s[..., 0, 0] * s[..., 1, 1] - s[..., 0, 1] ** 2
        reach = g[..., 0] ** 2 * s[..., 1, 1] + g[..., 1] ** 2 * s[..., 0, 0] - 2 * g[..., 0] * g[..., 1] * s[..., 0, 1]
        known = (reach >= ELLIPSE**2 * determinant) & (np.abs(self.response) > 0)
        out: Array = np.where(known, self._along(1j) / np.where(known, np.abs(self.response), 1.0), np.nan)
        return out

    def _along(self, turn: complex) -> Array:
        size = np.abs(self.response)
        unit = turn * np.where(size > 0, self.response / np.where(size > 0, size, 1.0), 1.0)
        direction = np.stack([unit.real, unit.imag], axis=-1)
        square = np.einsum("...i,...ij,...j->...", direction, self.covariance, direction)
        out: Array = np.sqrt(np.maximum(square, 0.0))
        return out

    def in_units(self, output_scale: Array, input_scale: Array) -> Band:
        """Return the band of a model in scaled units in the channels' units."""
        factor = output_scale[:, None] / input_scale
        return Band(self.frequency_hz, self.response * factor, self.covariance * factor[..., None, None] ** 2)

    def to_json(self, inputs: Sequence[str], outputs: Sequence[str]) -> dict[str, Any]:
        """Return the band as JSON facts, five digits: for each pair gain, phase and their standard deviations."""
        gain, phase = np.abs(self.response), np.degrees(np.angle(self.response))
        spread, turn = self.gain_std, np.degrees(self.phase_std)
        pairs = [
            {
                "input": source, "output": target, "gain": _digits(gain[:, i, j]), "gain_std": _digits(spread[:, i, j]),
                "phase_deg": _digits(phase[:, i, j]), "phase_std_deg": _digits(turn[:, i, j]),
            }
            for i, target in enumerate(outputs)
            for j, source in enumerate(inputs)
        ]  # fmt: skip
        return {"frequency_hz": _digits(self.frequency_hz), "pairs": pairs}


def grid(sample_time_s: float, eigenvalues: ComplexArray) -> Array:
    """Return frequencies in Hz: even on the logarithm from 1/1000 of the Nyquist frequency, and closer at the modes."""
    top = 0.5 / sample_time_s
    even: Array = np.geomspace(top * 1e-3, 0.98 * top, POINTS)
    near = [even]
    for s in continuous_poles(eigenvalues[eigenvalues.imag > 0], sample_time_s):
        frequency, damping = frequency_and_damping(complex(s))
        if abs(damping) < LIGHT:
            near.append(frequency * (1 + max(abs(damping), 1e-3) * np.arange(-2.0, 3.0)))
    every = np.concatenate(near)
    return np.unique(every[(every >= even[0]) & (every <= even[-1])])


def frequency_response(model: ScaledModel, z: ComplexArray) -> ComplexArray:
    """Return G(z) (points, l, r)."""
    return transfer(model.A, model.B, model.C, model.D, z)


def response_covariance(model: ScaledModel, spread: MatrixSpread, z: ComplexArray) -> Array:
    """Return the covariance (points, l, r, 2, 2) of real and imaginary part of G(z), pushed through the model."""
    n, r, outputs = len(model.A), model.B.shape[1], len(model.C)
    shifted = z[:, None, None] * np.eye(n) - model.A
    right = np.linalg.solve(shifted, model.B[None].astype(complex))  # (points, n, r)
    left = np.linalg.solve(shifted.transpose(0, 2, 1), model.C.T[None].astype(complex))  # (points, n, l)
    out = np.empty((len(z), outputs, r, 2, 2))
    for j in range(r):
        unit = np.broadcast_to(np.eye(r)[j], (len(z), r))
        column = np.hstack([right[:, :, j], unit])
        for i in range(outputs):
            row = np.hstack([left[:, :, i], np.broadcast_to(np.eye(outputs)[i], (len(z), outputs))])
            out[:, i, j] = covariance_of(spread.reach(row, column))
    return out


def curvature_covariance(model: ScaledModel, poles: Array, z: ComplexArray) -> Array:
    """Return the second moment (points, l, r, 2, 2) of the terms R Δλ²/(z − λ)³ of all poles.

    poles (n, 2, 2): covariance of real and imaginary part a, b of each Δλ, taken as normal, in the order of eig(A), so
    that those of Δλ² = (a² − b²) + 2i a b follow. Odd moments vanish: the first order does not correlate with it.
    Zero where A has no full set of eigenvectors.
    """
    out = np.zeros((len(z), len(model.C), model.B.shape[1], 2, 2))
    values, right = np.linalg.eig(model.A)
    try:
        left = np.linalg.inv(right)  # rows wᴴ
    except np.linalg.LinAlgError:
        return out
    for value, v, w, s in zip(values, right.T, left, poles, strict=True):
        if not np.isfinite(s).all():
            continue
        mixed, slant = s[0, 0] * s[1, 1] + 2 * s[0, 1] ** 2, 6 * s[0, 1] * (s[0, 0] - s[1, 1])
        moment = np.array([[3 * s[0, 0] ** 2 + 3 * s[1, 1] ** 2 - 2 * mixed, slant], [slant, 4 * mixed]])
        c = np.outer(model.C @ v, w @ model.B) / (z - value)[:, None, None] ** 3
        turn = np.stack([np.stack([c.real, -c.imag], axis=-1), np.stack([c.imag, c.real], axis=-1)], axis=-2)
        out += turn @ moment @ np.swapaxes(turn, -1, -2)
    return out


def on_circle(frequency_hz: Array, sample_time_s: float) -> ComplexArray:
    """Return z = exp(2πifh)."""
    out: ComplexArray = np.exp(2j * np.pi * frequency_hz * sample_time_s)
    return out


def _digits(values: Array) -> list[float | None]:
    return [float(f"{v:.5g}") if np.isfinite(v) else None for v in values]
