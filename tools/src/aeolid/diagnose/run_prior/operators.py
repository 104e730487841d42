"""Operators on single channels (N,) at the recording's own sample time: what actuators, sensors and loggers do.

Filters of inputs take the signal between its samples as the cubic spline through them, so that a lag told is the lag
of the continuous element and not of a held command. A filter of outputs takes lines: a spline knows the next sample,
and windows would hold a part of what they are to foretell. Every operator starts at rest at the first sample.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.ndimage import shift
from scipy.signal import lfilter

from aeolid.compiled import njit

Array = NDArray[np.float64]
_CUBIC = 4  # coefficients of a piece


def first_order(x: Array, tau: float, step: float) -> Array:
    """Return the response of 1/(1 + tau s), tau in s; x itself where tau is 0."""
    if tau <= 1e-9 * step:
        return x
    return _filtered(x, np.array([[-1.0 / tau]]), np.array([1.0 / tau]), np.array([1.0]), step)


def first_order_of_past(x: Array, tau: float, step: float) -> Array:
    """Return the response of 1/(1 + tau s) for lines between samples: of no later sample, tau in s."""
    if tau <= 1e-9 * step:
        return x
    a, ratio = np.exp(-step / tau), step / tau
    g1 = 1.0 - (1.0 - a) / ratio
    drive = np.zeros(len(x))
    drive[1:] = (1.0 - a - g1) * (x[:-1] - x[0]) + g1 * (x[1:] - x[0])
    out: Array = x[0] + lfilter([1.0], [1.0, -a], drive)
    return out


def second_order(x: Array, omega: float, damping: float, step: float) -> Array:
    """Return the response of ω²/(s² + 2 ζ ω s + ω²), ω in rad/s."""
    A = np.array([[0.0, 1.0], [-(omega**2), -2 * damping * omega]])
    return _filtered(x, A, np.array([0.0, omega**2]), np.array([1.0, 0.0]), step)


def resonance_moved(x: Array, zero: tuple[float, float], pole: tuple[float, float], step: float) -> Array:
    """Return the response of (s² + 2 ζ₀ ω₀ s + ω₀²)/(s² + 2 ζ₁ ω₁ s + ω₁²), zero (ω₀ in rad/s, ζ₀), pole (ω₁, ζ₁).

    A resonance at the zero goes to the pole; what is quick is left as it is.
    """
    (w0, z0), (w1, z1) = zero, pole
    A = np.array([[0.0, 1.0], [-(w1**2), -2 * z1 * w1]])
    c = np.array([w0**2 - w1**2, 2 * z0 * w0 - 2 * z1 * w1])
    middle = x.mean()
    moves = _filtered(np.concatenate([[0.0], x - middle]), A, np.array([0.0, 1.0]), c, step)[1:]
    out: Array = x + moves
    return out


def delayed(x: Array, delay: float, step: float) -> Array:
    """Return x some seconds later (earlier where negative), by cubic splines between the samples."""
    out: Array = shift(x, delay / step, order=3, mode="nearest")
    return out


def stamped_later(x: Array, delay: float, step: float) -> Array:
    """Return x some seconds later (earlier where negative), by lines between the samples: of no later sample."""
    out: Array = shift(x, delay / step, order=1, mode="nearest")
    return out


def _filtered(x: Array, A: Array, b: Array, c: Array, step: float) -> Array:
    """Return c of ẋ = A x + b u for the cubic spline u through the samples, at rest before the first sample.

    Exact: u and its derivatives are further states of a matrix whose exponential is the step. At least two samples.
    """
    n = len(A)
    M = np.zeros((n + _CUBIC, n + _CUBIC))
    M[:n, :n], M[:n, n] = A * step, b * step
    M[np.arange(n, n + _CUBIC - 1), np.arange(n + 1, n + _CUBIC)] = 1.0
    E = expm(M)
    F = np.ascontiguousarray(E[:n, :n])
    pieces = CubicSpline(np.arange(len(x)), x - x[0]).c[::-1]  # of 1, s, s², s³, 0 ≤ s < 1, in each interval
    derivatives = pieces * np.array([1.0, 1.0, 2.0, 6.0])[:, None]
    drive = np.zeros((len(x), n))
    drive[1:] = derivatives.T @ E[:n, n:].T
    follows = _run(F, drive) @ c if n > 1 else lfilter([1.0], [1.0, -F[0, 0]], drive[:, 0]) * c[0]
    out: Array = x[0] + follows
    return out


@njit(cache=True)
def _run(F: Array, drive: Array) -> Array:
    out = np.empty_like(drive)
    state = np.zeros(len(F))
    for k in range(len(drive)):
        state = F @ state + drive[k]
        out[k] = state
    return out


@njit(cache=True)
def play(x: Array, width: float) -> Array:
    """Return what follows x through a clearance of `width` in all.

    Where x turns between samples it is taken to reach half as far beyond them as lines from both sides would: a kink
    gets there, a round turn does not.
    """
    out = np.empty_like(x)
    at, half = x[0], 0.5 * width
    for k in range(len(x)):
        if 1 < k < len(x) - 1:
            before, after = x[k - 1] - x[k - 2], x[k + 1] - x[k]
            if before * after < 0:
                # x[k−1] + s before = x[k] − (1 − s) after
                s = (x[k] - x[k - 1] - after) / (before - after)
                if 0 < s < 1:
                    turn = x[k - 1] + 0.5 * s * before
                    at = min(max(at, turn - half), turn + half)
        at = min(max(at, x[k] - half), x[k] + half)
        out[k] = at
    return out


@njit(cache=True)
def rate_limited(x: Array, rate: float, step: float) -> Array:
    """Return what follows x no faster than `rate` a second."""
    out = np.empty_like(x)
    at, most = x[0], rate * step
    for k in range(len(x)):
        at += min(max(x[k] - at, -most), most)
        out[k] = at
    return out


@njit(cache=True)
def dead_band(x: Array, width: float) -> Array:
    """Return what follows x only when it has left a band of ± width about where it stood."""
    out = np.empty_like(x)
    at = x[0]
    for k in range(len(x)):
        if abs(x[k] - at) > width:
            at = x[k]
        out[k] = at
    return out


def turning_step(x: Array) -> float:
    """Return by how much x changes from sample to sample where it turns, on average: what its turns are known to."""
    step = np.diff(x)
    turns = np.flatnonzero(step[:-1] * step[1:] < 0)
    return float(0.5 * np.mean(np.abs(step[turns]) + np.abs(step[turns + 1]))) if len(turns) else 0.0
