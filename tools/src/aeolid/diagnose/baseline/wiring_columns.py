"""Make a model's channels of a recording's columns: other signs, units, names and instants, and sensors that lag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
_AROUND = (-1, 0, 1, 2)  # rows between which a column is interpolated
_ANGLES = 512  # frequencies of a mean


@dataclass(frozen=True)
class Wiring:
    """Say how columns of a recording become channels: channel j is factor_j times (column order_j less its zero_j).

    late: rows, in whole or in part, by which each output's column is late, negative where it is early; empty where none
    is.
    """

    inputs: tuple[float, ...]
    outputs: tuple[float, ...]
    input_order: tuple[int, ...]
    output_order: tuple[int, ...]
    input_zeros: tuple[float, ...]
    output_zeros: tuple[float, ...]
    late: tuple[float, ...] = ()

    @property
    def log_determinant(self) -> float:
        """Return the logarithm, a row, of how much larger the transformed outputs are."""
        return float(np.sum(np.log(np.abs(self.outputs)))) + sum(_narrowing(rows) for rows in self.late)

    def apply(self, u: Array, y: Array) -> tuple[Array, Array]:
        """Return inputs (N, r) and outputs (N, l) as this wiring has them."""
        v, z = u[:, list(self.input_order)] - self.input_zeros, y[:, list(self.output_order)] - self.output_zeros
        z = z * self.outputs
        for j, rows in enumerate(self.late):
            z[:, j] = moved_ahead(z[:, j], rows, beyond="edge")
        return v * self.inputs, z


@dataclass(frozen=True)
class Sensor:
    """Hold what an output of the model passes on its way into the recording: gain/a(q⁻¹), of gain 1 at rest."""

    output: int
    a: tuple[float, ...]

    @property
    def gain(self) -> float:
        """Return the part of a step that shows in the same row."""
        return float(sum(self.a))

    def behind(self, signal: Array) -> Array:
        """Return a signal (N,) behind the sensor, settled at its start."""
        late: Array = signal[0] + np.asarray(lfilter([self.gain], self.a, signal - signal[0]))
        return late


def moved_ahead(column: Array, rows: float, beyond: Literal["edge", "missing"]) -> Array:
    """Return a column (N,) as it is so many rows later, between rows by Lagrange's polynomial through four.

    beyond: what it is where the rows end, the last one or missing. A missing row makes all missing that it takes part
    in.
    """
    whole = int(np.floor(rows))
    reach = abs(whole) + 2
    padding = {"mode": "edge"} if beyond == "edge" else {"constant_values": np.nan}
    wide = np.pad(column, reach, **padding)
    start = reach + whole
    if rows == whole:
        result: Array = wide[start : start + len(column)]
        return result
    around = np.column_stack([wide[start + k : start + k + len(column)] for k in _AROUND])
    between: Array = around @ _weights(rows - whole)
    return between


def _weights(part: float) -> Array:
    """Return Lagrange's weights of the rows _AROUND one, for what lies a part of a row behind it."""
    return np.array([
        np.prod([(part - other) / (k - other) for other in _AROUND if other != k]) for k in _AROUND
    ])  # fmt: skip


def _narrowing(rows: float) -> float:
    """Return the mean over frequencies of log|F| of what interpolates: the log-determinant, a row, of doing so."""
    part = rows - np.floor(rows)
    if part == 0.0:
        return 0.0
    angles = np.pi * (np.arange(_ANGLES) + 0.5) / _ANGLES
    response = np.exp(1j * np.outer(angles, _AROUND)) @ _weights(part)
    return float(np.mean(np.log(np.abs(response))))


def all_behind(sensor: Sensor | None, u: Array, y: Array) -> tuple[Array, Array]:
    """Return inputs and outputs, all but a sensor's own output behind its filter."""
    if sensor is None:
        return u, y
    behind = np.column_stack([y[:, j] if j == sensor.output else sensor.behind(y[:, j]) for j in range(y.shape[1])])
    return (np.column_stack([sensor.behind(c) for c in u.T]) if u.shape[1] else u), behind


def one_behind(sensor: Sensor | None, y: Array) -> Array:
    """Return a model's outputs, a sensor's own behind its filter."""
    if sensor is None:
        return y
    behind = y.copy()
    behind[:, sensor.output] = sensor.behind(y[:, sensor.output])
    return behind
