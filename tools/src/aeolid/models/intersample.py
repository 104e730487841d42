"""How a recorded input goes on between its samples: held, straight, or as smooth as its band allows.

A row holds the input at one instant; a model needs it all through the sample. A command goes out and is held; a
measured signal went on changing. Held instead, it acts half a sample late and its staircase adds what it never had.
Sample k lasts from k to k + 1 (in samples); its row may belong to the instant k − o, the common offset of the logger.
What moves the states is the mean m_k = ∫ ũ(t − o) dt over the sample and a slope about it. For a
mode of 68 Hz at 610 samples a second (θ = ωh = 0.7) the answer is off by 0.3 % with the smooth curve, by θ²/12 = 4 %
with straight lines (they let sinc²(θ/2) of a sine through), by 35 % held, most of it the half sample. What lies beyond
the Nyquist frequency is not in the samples, whatever is laid between them (Åström and Wittenmark 1997, section 2.4).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.models.smooth_curve import smooth_curve

Array = NDArray[np.float64]
HOLDS = ("zoh", "foh", "band_limited")
"""Held over the sample, straight from one to the next, the smooth curve through all of them."""
FILTERED = "filtered"
"""Held, of a recording whose outputs passed an anti-alias filter."""
OFFSET = "intersample_offset"  # parameter: by how much inputs act after their stamps, s
FILTER = "intersample_delay"  # parameter: low-frequency delay of the outputs' anti-alias filter, s
PREFIX = "intersample_"  # kind of the input filter: this and one of HOLDS, or FILTERED
MOVING = (f"{PREFIX}foh", f"{PREFIX}band_limited")  # kinds whose input changes within a sample
_FEWEST = 16  # samples through which the smooth curve is laid: fewer are joined by straight lines
_REACH, _BAND = 6, 2.4  # samples on either side that tell a slope; radians a sample up to which they do


def straight(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Return the means of straight lines between the samples (first-order hold), `values` the offset in s."""
    samples = np.ascontiguousarray(u[:: len(pieces)])
    at = np.arange(len(samples) + 1) - values[0] / step
    mean: Array = np.diff(_straight_integral(samples, at))
    return _in_pieces(mean, lambda: _straight(samples, at[:-1]), pieces)


def smooth(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Return the means of the spline of degree 7 through the samples, `values` the offset in s.

    Of a sine it misses about (f/(1 - f))⁸, f its frequency over the sampling rate: 0.3 % at a third.
    """
    samples = np.ascontiguousarray(u[:: len(pieces)])
    if len(samples) < _FEWEST or not np.all(np.isfinite(samples)):
        return straight(u, values, step, pieces)
    curve, shift = smooth_curve(samples), -float(values[0]) / step
    return _in_pieces(curve.means(shift), lambda: curve.values(shift), pieces)


def _in_pieces(mean: Array, begins: Callable[[], Array], pieces: Array) -> Array:
    """Return the means over the samples; in two pieces the value as a sample begins, and what makes up the mean."""
    if len(pieces) == 1:
        return mean
    first = begins()
    result: Array = np.column_stack([first, (mean - pieces[0] * first) / pieces[1]]).ravel()
    return result


def _straight(u: Array, t: Array) -> Array:
    found: Array = np.interp(t, np.arange(len(u), dtype=float), u)
    return found


def _straight_integral(u: Array, t: Array) -> Array:
    """Return the integral from 0 to t (k,) of straight lines between samples u (N,), held before and after."""
    last = len(u) - 1
    total = np.concatenate([[0.0], np.cumsum(0.5 * (u[1:] + u[:-1]))])
    inside = np.clip(t, 0.0, last)
    k = np.minimum(inside.astype(np.int64), max(last - 1, 0))
    f = inside - k
    rise = u[np.minimum(k + 1, last)] - u[k]
    beyond = np.minimum(t, 0.0) * u[0] + np.maximum(t - last, 0.0) * u[last]
    found: Array = total[k] + f * u[k] + 0.5 * f * f * rise + beyond
    return found


def slopes(means: Array, moving: NDArray[np.bool_]) -> Array:
    """Return by how much each input changes within each sample (N, r) of `means` (N, r); 0 where it is held.

    The line that is nearest to a sine over a sample has a slope of j a(θ) times its mean, θ = ωh; six means on either
    side give that to 1.3 % where it counts, θ of 0.7 to 2.4. At the ends, half the difference of the neighbours.
    """
    change = np.zeros_like(means)
    if len(means) < 2:
        return change
    for column in np.flatnonzero(moving):
        m = means[:, column]
        slope = np.concatenate([m[1:2] - m[:1], 0.5 * (m[2:] - m[:-2]), m[-1:] - m[-2:-1]])
        if len(m) > 2 * _REACH:
            slope[_REACH:-_REACH] = np.correlate(m, _WEIGHTS)
        change[:, column] = slope
    return change


def slopes_of_quarters(quarters: Array) -> Array:
    """Return by how much an input changes within each sample (N,), from its means over the quarters (N·4,).

    The line about the mean that has the same first moment, 12 ∫ (t - 1/2) u dt: exact for steps at quarters (1.5 of one
    in the middle), 6 % less than a straight line changes.
    """
    first, second, third, last = quarters.reshape(-1, 4).T
    found: Array = 0.375 * (third - second) + 1.125 * (last - first)
    return found


def _slope_weights() -> Array:
    """Return the weights (13,) of six means on either side and the one between, fitted to a(θ) over the band."""
    angle = np.linspace(0.02, _BAND, 200)
    half = angle / 2
    wanted = 12 * (np.sin(half) - half * np.cos(half)) * 2 / angle**2 / (np.sin(half) / half)
    found: Array = lstsq(2 * np.sin(np.outer(angle, np.arange(1, _REACH + 1))), wanted)
    return np.concatenate([-found[::-1], [0.0], found])


_WEIGHTS = _slope_weights()


def straightened(samples: Array, smooth: NDArray[np.bool_]) -> Array:
    """Return inputs (N, r) whose straight lines act as the smooth curve through these samples does: m less δ²m/12.

    Straight lines let sinc²(θ/2) of a sine through, θ = ωh: 1 + θ²/12 makes up for it. smooth (r,): inputs
    that are.
    """
    found = samples.copy()
    if len(samples) > 2:
        m = samples[:, smooth]
        found[1:-1, smooth] -= (m[2:] - 2 * m[1:-1] + m[:-2]) / 12
    return found
