"""Held inputs that come late, or behind the anti-alias filter of all outputs: their means over each sample, exact."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit

Array = NDArray[np.float64]
_SHORTEST, _FADED = 1e-6, 20.0  # samples, of a filter's delay; delays after which its step response has ended


def late(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Return the means of a held input, `values` the offset in s: exact. Before the first and after the last it holds.

    u (N·p,): the same over the pieces of a sample.
    """
    if not math.isfinite(values[0]):
        return np.full_like(u, np.nan)
    return _late(np.ascontiguousarray(u), float(values[0]) / step, pieces)


def filtered(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Return the means of a held input behind a second-order Butterworth filter, `values` offset and delay in s.

    The filter stands for one on every output: of a linear plant they are the same. Its step response has the integral
    I(t) = t - d (1 - exp(-t/d) cos(t/d)), d its delay at low frequencies, √2 over its corner in rad/s; each change of
    the input adds the difference of I over a piece: exact. Without a delay it is the held input, offset alone. Of an
    input that a limit has made change within a sample its mean over the sample counts.
    """
    if not (math.isfinite(values[0]) and math.isfinite(values[1])):
        return np.full_like(u, np.nan)
    return _filtered(np.ascontiguousarray(u), float(values[0]) / step, float(values[1]) / step, pieces)


@njit(cache=True)
def _filtered(u: Array, offset: float, delay: float, pieces: Array) -> Array:
    """Return `filtered`, offset and delay in samples."""
    most = len(u) / len(pieces) + 1.0
    offset, delay = min(max(offset, -most), most), min(max(delay, 0.0), most)
    first, count, end = math.floor(offset), len(pieces), np.cumsum(pieces)
    lacking = np.empty((math.ceil(_FADED * delay) + 2, count))
    for i in range(len(lacking)):
        for j in range(count):
            at = (first + i - offset) + end[j] - pieces[j]
            lacking[i, j] = (_step_integral(at + pieces[j], delay) - _step_integral(at, delay)) / pieces[j] - 1.0
    return _with_changes(_held_means(u, pieces), lacking, first, count)


@njit(cache=True)
def _held_means(u: Array, pieces: Array) -> Array:
    """Return the mean over each sample in all its pieces; what is held stays to the last digit."""
    count, out = len(pieces), u.copy()
    for k in range(0, len(u), count):
        change = 0.0
        for j in range(1, count):
            change += pieces[j] * (u[k + j] - u[k])
        for j in range(count):
            out[k + j] = u[k] + change if change != 0.0 else u[k + j]
    return out


@njit(cache=True)
def _late(u: Array, offset: float, pieces: Array) -> Array:
    """Return `filtered` without a filter, whose step response is a step: its integral is the time since."""
    most = len(u) / len(pieces) + 1.0
    offset = min(max(offset, -most), most)
    first, count, end = math.floor(offset), len(pieces), np.cumsum(pieces)
    lacking = np.empty((2, count))
    for j in range(count):
        for i in range(2):
            at = (first + i - offset) + end[j] - pieces[j]
            lacking[i, j] = (max(at + pieces[j], 0.0) - max(at, 0.0)) / pieces[j] - 1.0
    return _with_changes(u, lacking, first, count)


@njit(cache=True)
def _with_changes(u: Array, lacking: Array, first: int, count: int) -> Array:
    """Return u of `first` samples before less what its changes still lack, Σ lacking_i Δu_{k-i}.

    u (N·p,): the same over the `count` pieces of a sample; lacking (lags, p), the first of `first` samples.
    """
    out, samples = np.empty_like(u), len(u) // count
    for k in range(samples):
        value = u[min(max(k - first, 0), samples - 1) * count]
        for j in range(count):
            out[k * count + j] = value
    for k in range(1, samples):
        change = u[k * count] - u[(k - 1) * count]
        if change != 0.0:
            begin = k + first
            for i in range(max(0, -begin), min(len(lacking), samples - begin)):
                for j in range(count):
                    out[(begin + i) * count + j] += lacking[i, j] * change
    return out


@njit(cache=True)
def _step_integral(t: float, delay: float) -> float:
    """Return the integral of the filter's step response from 0 to t, times and delay in samples; 0 before."""
    after = max(t, 0.0)
    if delay < _SHORTEST:
        return after
    x = after / delay
    return after - delay * (1.0 - math.exp(-x) * math.cos(x))
