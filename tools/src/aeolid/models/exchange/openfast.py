"""Read the linearisation files (.lin) of OpenFAST.

A file is text: counts and conditions, tables of operating points with a description "module quantity, unit" a row, and
the matrices of x' = A x + B u, y = C x + D u in deviations from the operating point. One file is one rotor azimuth. On
a turning rotor the matrices vary with it; averaging several files through the multiblade transform is not done here, so
such a model holds near its own azimuth.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd]?[+-]\d+|[EeDd]\d+)?"
_ROW = rf"\s*(\d+)\s+({_NUMBER}(?:\s*,\s*{_NUMBER})*)\s+([TF])\s+"
_PLAIN_ROW = re.compile(_ROW + r"(\S.*)$")
_ORDERED_ROW = re.compile(_ROW + r"\d+\s+(\S.*)$")  # since release 2.4: with the order of the derivative
_NO_LETTER = re.compile(r"(?<=\d)([+-]\d+)$")  # Fortran drops the E of an exponent of three digits
_MATRIX = re.compile(r"\s*([A-Za-z_]+):\s*(\d+)\s*x\s*(\d+)\s*$")
_COUNTS = ("continuous states", "discrete states", "constraint states", "inputs", "outputs")
_MOST = 20_000  # states, inputs or outputs; a count above it is damage


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Hold a continuous-time model in deviations from its operating point, and the conditions it was made at.

    azimuth_rad, rotor_speed_rad_s, wind_speed_m_s: NaN where the file does not say. rotating: names of the inputs,
    outputs and states that turn with the rotor.
    """

    model: StateSpace
    azimuth_rad: float
    rotor_speed_rad_s: float
    wind_speed_m_s: float
    rotating: tuple[str, ...]


def read_lin(path: str | Path) -> Linearisation:
    """Read a .lin file; raises DataError that names file and line."""
    try:
        lines = Path(path).read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None
    return _File(str(path), lines).read()


class _File:
    """Read the parts of one file, each found by its heading, so that their order does not matter."""

    def __init__(self, source: str, lines: list[str]) -> None:
        self.source, self.lines = source, lines
        self.rotating: list[str] = []

    def read(self) -> Linearisation:
        n, discrete, _, r, m = (self._count(name) for name in _COUNTS)
        if discrete:
            raise DataError(f"{self.source}: {discrete} discrete states; only models in continuous time are read")
        if n == 0 or m == 0:
            lacking, remedy = ("outputs", "LinOutputs") if n else ("continuous states", "a degree of freedom")
            raise DataError(f"{self.source}: no {lacking}; linearise with {remedy} switched on")
        states, inputs, outputs = (
            self._table(name, size) for name, size in (("continuous states", n), ("inputs", r), ("outputs", m))
        )
        shapes = {"A": (n, n), "B": (n, r), "C": (m, n), "D": (m, r)}
        A, B, C, D = (self._matrix(name, shape) for name, shape in shapes.items())
        model = StateSpace(A, B, C, D, None, np.zeros(n), None, 0.0, inputs, outputs, states)
        azimuth, speed, wind = (self._condition(name) for name in ("Azimuth", "Rotor Speed", "Wind Speed"))
        return Linearisation(model, azimuth, speed, wind, tuple(self.rotating))

    def _fault(self, line: int, what: str) -> DataError:
        return DataError(f"{self.source}: line {line + 1}: {what}")

    def _find(self, start: str) -> int | None:
        return next((i for i, line in enumerate(self.lines) if line.strip().startswith(start)), None)

    def _count(self, name: str) -> int:
        line = self._find(f"Number of {name}:")
        if line is None:
            raise DataError(
                f"{self.source}: no line 'Number of {name}:', so it is not a linearisation file of OpenFAST"
            )
        text = self.lines[line].split(":", 1)[1].strip()
        if not text.isascii() or not text.isdigit() or int(text[:9]) > _MOST:
            raise self._fault(line, f"the number of {name} is {text!r}, a count up to {_MOST} is needed")
        return int(text)

    def _condition(self, name: str) -> float:
        line = self._find(f"{name}:")
        if line is None:
            return float("nan")  # releases before 2.4 do not write the wind speed
        words = self.lines[line].split(":", 1)[1].split()
        return self._number(words[0] if words else "", line)

    def _number(self, text: str, line: int) -> float:
        try:
            plain = text.upper().replace("D", "E")
            value = float(plain if "E" in plain else _NO_LETTER.sub(r"E\1", plain))
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise self._fault(line, f"{text!r} is not a finite number; linearise again with a wider OutFmt")
        return value

    def _table(self, name: str, size: int) -> tuple[Signal, ...]:
        """Read a table of operating points: row, value (or three of an orientation), frame, [order], description."""
        if size == 0:
            return ()
        start = self._find(f"Order of {name}:")
        if start is None:
            raise DataError(f"{self.source}: the table 'Order of {name}:' is missing; {size} were announced")
        ordered = start + 1 < len(self.lines) and "Derivative Order" in self.lines[start + 1]
        form = _ORDERED_ROW if ordered else _PLAIN_ROW
        found, turning = [], []
        for i in range(size):
            line = start + 3 + i  # heading, column names, rule
            match = form.match(self.lines[line].rstrip()) if line < len(self.lines) else None
            if match is None or int(match[1]) != i + 1:
                what = f"row {i + 1} of the {size} {name} was expected: number, operating point, T or F, description"
                raise self._fault(min(line, len(self.lines) - 1), what)
            label, comma, unit = match[4].rpartition(", ")
            values = [self._number(v.strip(), line) for v in match[2].split(",")]
            # an orientation's operating point is a row of a rotation matrix; its deviation is a small angle about zero
            offset = values[0] if len(values) == 1 else 0.0
            found.append(Signal(label if comma else unit, _plain_unit(unit) if comma else "", offset))
            turning.append(match[3] == "T")
        signals = _distinct(found)
        self.rotating += [s.name for s, t in zip(signals, turning, strict=True) if t]
        return signals

    def _matrix(self, name: str, shape: tuple[int, int]) -> Array:
        """Read a matrix by its heading "A: rows x columns"; one without columns is not written."""
        if 0 in shape:
            return np.zeros(shape)
        headings = ((i, _MATRIX.match(line)) for i, line in enumerate(self.lines))
        start, match = next(((i, m) for i, m in headings if m and m[1] == name), (0, None))
        if match is None:
            raise DataError(f"{self.source}: matrix {name} ({shape[0]} x {shape[1]}) is missing; the file may be cut")
        if (int(match[2]), int(match[3])) != shape:
            raise self._fault(
                start, f"matrix {name} is {match[2]} x {match[3]}, the counts say {shape[0]} x {shape[1]}"
            )
        rows = np.empty(shape)
        for i in range(shape[0]):
            line = start + 1 + i
            words = self.lines[line].split() if line < len(self.lines) else []
            if len(words) != shape[1]:
                what = f"row {i + 1} of matrix {name} has {len(words)} numbers, {shape[1]} are needed"
                raise self._fault(min(line, len(self.lines) - 1), what)
            rows[i] = [self._number(w, line) for w in words]
        return rows


def _plain_unit(text: str) -> str:
    """Take the brackets off a unit: (kN-m)."""
    text = text.strip()
    return text[1:-1] if text.startswith("(") and text.endswith(")") else text


def _distinct(signals: list[Signal]) -> tuple[Signal, ...]:
    """Add the row's number to names that occur more than once; OpenFAST lists an output asked for twice twice."""
    counts = Counter(s.name for s in signals)
    return tuple(
        Signal(f"{s.name} (row {i + 1})" if counts[s.name] > 1 else s.name, s.unit, s.offset)
        for i, s in enumerate(signals)
    )
