"""Compute frequency responses of state-space models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
INTEGRATES = 1e-9  # of the fastest pole: slower ones are an integrator's, off zero by rounding
BEYOND = 10.0  # of the slowest and fastest pole: a decade on, a response is near its asymptote


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Hold G(e^{jωh}) over frequency: response (F, l, r) complex, in output units per input unit."""

    frequency_hz: Array
    response: NDArray[np.complex128]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def magnitude_db(self) -> Array:
        """Return 20 log₁₀ |G|, (F, l, r); −∞ where G is zero."""
        with np.errstate(divide="ignore"):
            out: Array = 20 * np.log10(abs(self.response))
        return out

    @property
    def phase_deg(self) -> Array:
        """Return the phase (F, l, r) in degrees, unwrapped along frequency."""
        out: Array = np.degrees(np.unwrap(np.angle(self.response), axis=0))
        return out


def default_frequencies(model: StateSpace, count: int = 400) -> Array:
    """Return `count` frequencies in Hz, logarithmic from 1/2000 of the Nyquist frequency to just below it.

    In continuous time from a tenth of the slowest pole's frequency, integrators left out, to ten times the fastest's.
    """
    if model.sample_time_s > 0:
        nyquist = 0.5 / model.sample_time_s
        return np.geomspace(nyquist / 2000, 0.999 * nyquist, count)
    poles = abs(np.linalg.eigvals(model.A)) / (2 * np.pi)
    moving = poles[poles > INTEGRATES * poles.max(initial=0.0)]
    lowest, highest = (moving.min(), moving.max()) if len(moving) else (1.0, 1.0)  # a gain, integrators: any will do
    return np.geomspace(lowest / BEYOND, highest * BEYOND, count)


def frequency_response(
    model: StateSpace, frequency_hz: Array | None = None, *, noise: bool = False
) -> FrequencyResponse:
    """Return G = D + C (ζ I − A)⁻¹ B at each frequency, ζ = exp(2πj f h), or 2πj f in continuous time.

    frequency_hz: (F,), default `default_frequencies`; noise: respond to the innovation, H = I + C (ζ I − A)⁻¹ K.

    >>> from aeolid.plants.hawt import build_turbine
    >>> frequency_response(build_turbine().model(), np.array([0.1])).response.shape
    (1, 3, 2)
    """
    f = default_frequencies(model) if frequency_hz is None else np.asarray(frequency_hz, float)
    h = model.sample_time_s
    points = (np.exp(2j * np.pi * f * h) if h > 0 else 2j * np.pi * f).astype(np.complex128)
    B, D = model.B, model.D
    names = tuple(s.name for s in model.inputs)
    if noise:
        if model.K is None:
            raise ValueError("the model has no noise model K")
        B, D, names = model.K, np.eye(len(model.outputs)), tuple(s.name for s in model.outputs)
    return FrequencyResponse(f, transfer(model.A, B, model.C, D, points), names, tuple(s.name for s in model.outputs))


def transfer(A: Array, B: Array, C: Array, D: Array, points: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return D + C (ζ I − A)⁻¹ B at each of the points ζ (F,): (F, l, r) complex."""
    resolvent = points[:, None, None] * np.eye(len(A)) - A  # (F, n, n)
    states = np.linalg.solve(resolvent, np.broadcast_to(B.astype(np.complex128), (len(points), *B.shape)))
    out: NDArray[np.complex128] = np.asarray(C @ states + D, dtype=np.complex128)
    return out
