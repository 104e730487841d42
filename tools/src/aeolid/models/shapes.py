"""Give modes their complex shapes: how far and how late each output moves beside a reference channel.

With A v = λ v the outputs of the mode alone are C v λᵏ. Its shape is C v divided by the entry of the reference, whose
value is then 1: the basis of the states and the size of v drop out. Amplitudes are in units of the output a unit of the
reference; the phase is that by which the output leads it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
ELLIPSE = 2.447747  # 95 % of the radius of two normal deviates


@dataclass(frozen=True)
class Shape:
    """Hold a mode's shape: values maps each output to its complex amplitude, 1 at the output `reference`.

    covariance maps each output to the variance of the real part, the covariance of the parts and the variance of the
    imaginary part, all in the units of values; None where no uncertainty is known.
    """

    reference: str
    values: Mapping[str, complex]
    covariance: Mapping[str, tuple[float, float, float]] | None = None

    def amplitude_std(self, output: str) -> float | None:
        """Return the standard deviation of the amplitude of an output, linearised; None where it is not known."""
        return self._along(output, 1.0)

    def phase_std(self, output: str) -> float | None:
        """Return that of the phase in rad; None where it is not known, and where the 95 % ellipse holds the origin."""
        around, value = self._covariance(output), self.values[output]
        if around is None or value == 0:
            return None
        g = np.array([value.real, value.imag])
        if around.any() and _reaches_origin(g, around):
            return None
        along = self._along(output, 1j)
        return None if along is None else along / abs(value)

    def to_json(self) -> dict[str, Any]:
        """Return the shape as JSON facts: reference, and for each output its parts, amplitude and phase."""
        return {"reference": self.reference, "outputs": {name: self._entry(name) for name in self.values}}

    def _entry(self, name: str) -> dict[str, Any]:
        value = complex(self.values[name])
        turn = self.phase_std(name)
        return {
            "re": value.real, "im": value.imag,
            "covariance": None if self.covariance is None else list(self.covariance[name]),
            "amplitude": abs(value), "amplitude_std": self.amplitude_std(name),
            "phase_deg": float(np.degrees(np.angle(value))),
            "phase_std_deg": None if turn is None else float(np.degrees(turn)),
        }  # fmt: skip

    def _covariance(self, output: str) -> Array | None:
        if self.covariance is None:
            return None
        rr, ri, ii = self.covariance[output]
        return np.array([[rr, ri], [ri, ii]])

    def _along(self, output: str, turn: complex) -> float | None:
        around, value = self._covariance(output), self.values[output]
        if around is None:
            return None
        unit = turn * (value / abs(value) if value else 1.0)
        direction = np.array([unit.real, unit.imag])
        return float(np.sqrt(max(direction @ around @ direction, 0.0)))


def _reaches_origin(g: Array, around: Array) -> bool:
    """Say whether the 95 % ellipse about g holds zero, without an inverse: a phase may be known exactly."""
    (rr, ri), (_, ii) = around
    reach = g[0] ** 2 * ii + g[1] ** 2 * rr - 2 * g[0] * g[1] * ri
    return bool(reach <= ELLIPSE**2 * (rr * ii - ri**2)) and rr + ii > 0


def shape_from_json(facts: Any) -> Shape | None:
    """Return the shape that JSON facts hold; None where they hold none that is complete."""
    try:
        outputs = facts["outputs"]
        values = {str(n): complex(float(e["re"]), float(e["im"])) for n, e in outputs.items()}
        known = all(e.get("covariance") is not None for e in outputs.values())
        around = {str(n): _three(e["covariance"]) for n, e in outputs.items()} if known else None
        reference = str(facts["reference"])
    except (AttributeError, LookupError, TypeError, ValueError):
        return None
    finite = all(np.isfinite(v) for v in values.values())
    return Shape(reference, values, around) if reference in values and finite else None


def _three(numbers: Sequence[Any]) -> tuple[float, float, float]:
    rr, ri, ii = map(float, numbers)
    return rr, ri, ii


def reference_outputs(shapes: ComplexArray, chosen: int | None = None) -> NDArray[np.intp]:
    """Return the index of each shape's reference (n,): the chosen output, by default the one that moves most.

    shapes (l, n): in comparable units.
    """
    if chosen is not None:
        return np.full(shapes.shape[1], chosen, dtype=np.intp)
    return np.asarray(np.argmax(abs(shapes), axis=0), dtype=np.intp)


def index_of_reference(outputs: Sequence[str], reference: str | None) -> int | None:
    """Return the index of the reference channel, None for None; raises UsageError where it is no output."""
    if reference is None:
        return None
    if reference not in outputs:
        raise UsageError(f"reference {reference!r} is no output; they are {', '.join(outputs)}")
    return list(outputs).index(reference)


def scaled_to(shapes: ComplexArray, reference: NDArray[np.intp]) -> ComplexArray:
    """Return shapes (l, n) divided by the entry of their reference; NaN where that does not move at all."""
    base = shapes[reference, np.arange(shapes.shape[1])]
    out: ComplexArray = shapes / np.where(base == 0, np.nan, base)
    return out


def assurance(a: ComplexArray, b: ComplexArray) -> Array:
    """Return the modal assurance criterion |aᴴ b|²/(aᴴa bᴴb) of shapes a (l, j), b (l, k), (j, k): 1 for the same.

    Free of size and phase of either; outputs of different units must be brought to comparable ones first.
    """
    size = np.outer((abs(a) ** 2).sum(axis=0), (abs(b) ** 2).sum(axis=0))
    out: Array = abs(a.conj().T @ b) ** 2 / np.maximum(size, np.finfo(float).tiny)
    return out
