"""Make the signals of an experiment for several inputs at a time, within the bounds of each.

Every signal begins at 0, one sample before its first, and ends at 0; it never leaves ± its amplitude and never moves
faster than its rate. Sequences of several inputs are the same one, shifted by equal parts of its period; multisines
share the grid of frequencies, each input has every r-th line, so that neither tells the other's tale.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.excitation.quantities import Bound
from aeolid.excitation.sequences import (
    TAPS,
    Lines,
    filtered_signs,
    random_lines,
    rate_limited,
    register_bits,
    schroeder_lines,
    seed_after,
)

Array = NDArray[np.float64]
KINDS = ("prbs", "multisine", "filtered")
PHASES = ("schroeder", "random")
INSIDE = 1 - 1e-12  # of a rate: sums of steps are rounded
DIGITS = 6  # of amplitudes that are not the bound itself


@dataclass(frozen=True)
class Shape:
    """Hold what a signal is like: kind, one of KINDS; rows a bit of prbs; band, line spacing and phases of the others.

    low_hz … high_hz: of multisine and filtered; spacing_hz: between neighbouring lines of all inputs together.
    """

    kind: str
    clock_rows: int = 0
    low_hz: float = 0.0
    high_hz: float = 0.0
    spacing_hz: float = 0.0
    phases: str = "schroeder"

    def text(self, step_s: float) -> str:
        """Return it in words; step_s: seconds a row."""
        if self.kind == "prbs":
            return f"prbs, {self.clock_rows * step_s:.4g} s a bit"
        band = f"{self.low_hz:.4g} to {self.high_hz:.4g} Hz"
        if self.kind == "filtered":
            return f"filtered binary, {band}"
        return f"multisine, {band}, a line every {self.spacing_hz:.4g} Hz, {self.phases} phases"


@dataclass(frozen=True)
class Played:
    """Hold one input's signal in the numbers of `port/discon/excitation.h`; zero where the kind has no such number.

    rate: inf where none is held. rows: after so many the signal turns to 0.
    """

    name: str
    unit: str
    amplitude: float
    rate: float
    rows: int
    seed: int
    order: int = 0
    low_hz: float = 0.0
    high_hz: float = 0.0
    lines: int = 0


@dataclass(frozen=True, eq=False)
class Signals:
    """Hold values (rows, inputs) in the units of the bounds, and how each was made."""

    shape: Shape
    step_s: float
    values: Array
    played: tuple[Played, ...]

    @property
    def crest(self) -> tuple[float, ...]:
        """Return peak over rms of each input."""
        rms = np.sqrt((self.values**2).mean(axis=0))
        return tuple(
            float(p / r) if r > 0 else math.inf for p, r in zip(abs(self.values).max(axis=0), rms, strict=True)
        )


def make_signals(
    shape: Shape, bounds: Sequence[Bound], rows: int, step_s: float, seed: int, part: float = 1.0
) -> Signals:
    """Make `rows` samples of each input, step_s apart, with `part` (0 … 1) of the amplitudes that the bounds allow."""
    columns, played = [], []
    for i, bound in enumerate(bounds):
        amplitude = bound.amplitude if part >= 1 else _below(bound.amplitude * part)
        most = bound.rate * step_s * INSIDE
        back = math.ceil(amplitude / most) if math.isfinite(most) else 1  # rows that the way to 0 takes
        first = Played(bound.name, bound.unit, amplitude, bound.rate, max(rows - back, 0), seed)
        unit, told = _unit_signal(shape, first, i, len(bounds), rows, step_s)
        target = told.amplitude * unit
        target[told.rows :] = 0.0
        columns.append(rate_limited(target, most))
        played.append(told)
    return Signals(shape, step_s, np.stack(columns, axis=1), tuple(played))


def lines_of(shape: Shape, which: int, inputs: int) -> Array:
    """Return the lines (L,) in Hz of one of several inputs."""
    first, last = math.ceil(shape.low_hz / shape.spacing_hz - 1e-9), math.floor(shape.high_hz / shape.spacing_hz + 1e-9)
    numbers = np.arange(max(first, 1) + which, last + 1, inputs)
    return np.asarray(numbers * shape.spacing_hz)


def register_order(rows: int, clock_rows: int) -> int:
    """Return the largest order of a register whose period fits into so many rows, the least one where none does."""
    return max((n for n in TAPS if ((1 << n) - 1) * clock_rows <= rows), default=min(TAPS))


def _unit_signal(shape: Shape, told: Played, which: int, inputs: int, rows: int, step_s: float) -> tuple[Array, Played]:
    """Return a signal of size 1 (rows,), and what makes it; the amplitude is lowered where a sum is too steep."""
    if shape.kind == "prbs":
        order = register_order(rows, shape.clock_rows)
        seed = seed_after(order, told.seed, which * (((1 << order) - 1) // inputs))
        bits = np.where(register_bits(order, seed), 1.0, -1.0)
        return bits[np.arange(rows) // shape.clock_rows % len(bits)], replace(told, seed=seed, order=order)
    if shape.kind == "filtered":
        seed = int(np.random.SeedSequence([told.seed, which]).generate_state(1)[0])
        return filtered_signs(shape.low_hz, shape.high_hz, step_s, rows, seed), replace(told, seed=seed)
    lines = _lines(shape, told, which, inputs, (told.rows - 0.5) * step_s)
    frequency = lines.frequency_hz
    steep = told.rate * INSIDE / lines.steepest() if math.isfinite(told.rate) else math.inf
    amplitude = told.amplitude if told.amplitude <= steep else _below(steep)
    more = {"low_hz": float(frequency[0]), "high_hz": float(frequency[-1]), "lines": len(frequency)}
    return lines.at(np.arange(rows) * step_s), replace(told, amplitude=amplitude, **more)  # type: ignore[arg-type]


def _lines(shape: Shape, told: Played, which: int, inputs: int, span_s: float) -> Lines:
    frequency = lines_of(shape, which, inputs)
    if shape.phases == "random":
        return random_lines(frequency, int(np.random.SeedSequence([told.seed, which]).generate_state(1)[0]))
    return schroeder_lines(frequency, told.seed, span_s)


def _below(value: float) -> float:
    """Return the value with a few digits, not above it."""
    scale = 10.0 ** (DIGITS - 1 - math.floor(math.log10(value)))
    return math.floor(value * scale) / scale
