"""Compute what the figures of a model show: poles and frequency response from model.json."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.frequency import transfer

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def frequencies(model: dict[str, Any], points: int = 400) -> Array:
    """Return frequencies in Hz, from a thousandth of the Nyquist frequency to just below it, logarithmic."""
    top = 0.5 / model["sample_time_s"] if model["sample_time_s"] else 10.0
    grid: Array = np.geomspace(top * 1e-3, 0.98 * top, points)
    return grid


def response(model: dict[str, Any], frequency_hz: Array) -> Complex:
    """Return G(f) = C (zI − A)⁻¹ B + D, (points, l, r), with z = exp(2πifh), or z = 2πif in continuous time."""
    A, B, C = (np.asarray(model[k], dtype=float) for k in "ABC")
    D = np.zeros((len(C), B.shape[1])) if model.get("D") is None else np.asarray(model["D"], dtype=float)
    h = model["sample_time_s"]
    z: Complex = (np.exp(2j * np.pi * frequency_hz * h) if h else 2j * np.pi * frequency_hz).astype(np.complex128)
    return transfer(A, B, C, D, z)


def poles(entries: Any) -> Complex:
    """Return poles from [[re, im], …], [{"re", "im"}, …] or complex numbers."""
    values = [_pole(entry) for entry in entries]
    return np.array(values, dtype=complex)


def _pole(entry: Any) -> complex:
    if isinstance(entry, dict):
        return complex(float(entry["re"]), float(entry["im"]))
    if isinstance(entry, list | tuple):
        return complex(entry[0], entry[1])
    return complex(entry)
