"""Move one mode of the runs: what they would have recorded, had it another frequency or damping.

The runs' model x⁺ = A x + B u + K e, y = C x + D u + e gives the mode's own coordinate ξ = wᴴ x and what drives it,
ξ_{k+1} − λ ξ_k. With another λ the same drive gives ξ′, and the outputs move by 2 Re(c′ ξ′ − c ξ), c = C v. What the
model leaves out stays as it was recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from aeolid.diagnose.run_prior.pair import Side
from aeolid.models.modes import Mode
from aeolid.models.recursion import run_states
from aeolid.models.state_space import StateSpace
from aeolid.record import Record

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Swing:
    """Hold one mode in every run: coordinate and drive (N,) by run, its parts (l,) of the outputs, eigenvalue, step."""

    sides: tuple[Side, ...]
    coordinates: tuple[ComplexArray, ...]
    drives: tuple[ComplexArray, ...]
    parts: ComplexArray
    eigenvalue: complex
    step: float

    @property
    def frequency_hz(self) -> float:
        """Return the mode's undamped frequency."""
        return float(abs(np.log(self.eigenvalue)) / (2 * np.pi * self.step))

    @property
    def damping(self) -> float:
        """Return the mode's damping ratio, at least a thousandth."""
        s = np.log(self.eigenvalue)
        return max(float(-s.real / abs(s)), 1e-3)

    def moved(self, side: Side, frequency_hz: float, damping: float, powers: Array) -> Array:
        """Return by how much the outputs (N, l) of a run move; parts go with the frequency's ratio to these powers."""
        place = next(i for i, s in enumerate(self.sides) if s is side)
        w, w0 = 2 * np.pi * frequency_hz, abs(np.log(self.eigenvalue)) / self.step
        new = np.exp((-damping + 1j * np.sqrt(1 - damping**2)) * w * self.step)
        xi = lfilter([0.0, 1.0], [1.0, -new], self.drives[place])
        parts = self.parts * (w / w0) ** powers
        return 2 * np.real(np.outer(xi, parts) - np.outer(self.coordinates[place], self.parts))


def swing_of(model: StateSpace, records: Sequence[Record], sides: Sequence[Side], mode: Mode) -> Swing:
    """Return the mode of the runs' model that is nearest to one of another rate, as the runs swing in it."""
    assert model.K is not None
    values, right = np.linalg.eig(model.A)
    w, zeta = 2 * np.pi * mode.frequency_hz, mode.damping
    k = int(np.argmin(np.abs(values - np.exp((-zeta + 1j * np.sqrt(1 - zeta**2)) * w * model.sample_time_s))))
    left = np.linalg.inv(right)[k]
    coordinates, drives = [], []
    for record in records:
        u = np.nan_to_num(record.matrix("input") - model.u_offset)
        y = record.matrix("output") - model.y_offset
        y = np.where(np.isfinite(y), y, 0.0)
        A, B = model.A - model.K @ model.C, model.B - model.K @ model.D
        states = run_states(A, u @ B.T + y @ model.K.T, np.zeros(model.order))[:-1]
        xi = states @ left
        drives.append(np.append(xi[1:] - values[k] * xi[:-1], 0.0))
        coordinates.append(xi)
    return Swing(tuple(sides), tuple(coordinates), tuple(drives), model.C @ right[:, k], complex(values[k]),
                 model.sample_time_s)  # fmt: skip
