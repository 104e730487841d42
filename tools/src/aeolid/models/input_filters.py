"""What may lie between a recorded input and the plant: lags, delays, limits, play; each exact for a held input.

What moves the states over a step is the mean of what acts in it. An output that reads an input at once, as an
accelerometer does, is sampled as the step begins: it sees the mean of the first tenth. Told by the mean of the whole
step, a dead time of 24 ms in a pitch drive came out at 81 ± 5 ms beside an acceleration every 100 ms.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


SEEN = 0.1  # of a step: what a sample of the input is the mean of
_NONE = 1e-3  # steps: what is faster begins to lag; its slope at none is that of the mean over the whole step


@dataclass(frozen=True)
class FilterKind:
    """Hold a kind of input filter: the parameters it takes, and its rule.

    rule(u (N,), values (k,), step in s, part) → (N,) is the mean over the first `part` of each step. lasting: it moves
    within a step; what does not gives the same whatever the part is.
    """

    slots: tuple[str, ...]
    rule: Callable[[Array, Array, float, float], Array]
    lasting: bool = True


def _lag(u: Array, values: Array, step: float, part: float) -> Array:
    return lag_held_input(u, float(values[0]) / step, part)


def _delay(u: Array, values: Array, step: float, part: float) -> Array:
    return delay_held_input(u, float(values[0]) / step, part)


@njit(cache=True)
def lag_held_input(u: Array, tau: float, part: float = 1.0) -> Array:
    """Return the mean over each step's first `part` of a lag driven by a held input; tau in samples, 0 is no lag.

    Over one step w(t) = u + (w_k − u) e^(−t/τ): mean u + (w_k − u) τ/p (1 − e^(−p/τ)), exact for a held input.
    """
    out = np.empty_like(u)
    if tau <= 1e-9:
        out[:] = u
        return out
    part = 1.0 if tau < _NONE else part
    decay, share = math.exp(-1.0 / tau), tau / part * -math.expm1(-part / tau)
    w = u[0]
    for k in range(len(u)):
        out[k] = u[k] + (w - u[k]) * share
        w = u[k] + (w - u[k]) * decay
    return out


@njit(cache=True)
def delay_held_input(u: Array, delay: float, part: float = 1.0) -> Array:
    """Return the mean over each step's first `part` of a held input delayed by `delay` samples; below 0 it is early."""
    out = np.empty_like(u)
    part = 1.0 if abs(delay) < _NONE else part
    whole = math.floor(delay)
    late = min((delay - whole) / part, 1.0)
    last = len(u) - 1
    for k in range(len(u)):
        near = u[min(max(k - whole, 0), last)]
        far = u[min(max(k - whole - 1, 0), last)]
        out[k] = (1.0 - late) * near + late * far
    return out


@njit(cache=True)
def _second_order(u: Array, values: Array, step: float, part: float) -> Array:
    """Follow w'' = ω² (u − w) − 2ζω w' from rest, values (1/ω in s, ζ); the mean over each step's first part, exact.

    The mean of w over a time p is u − (w'_end − w'_start)/(ω² p) − 2ζ (w_end − w_start)/(ω p).
    """
    out = np.empty_like(u)
    if values[0] <= 1e-9 * step:
        out[:] = u
        return out
    part = 1.0 if values[0] < _NONE * step else part
    zeta = min(max(values[1], 0.05), 0.999)
    w = part * step / values[0]
    seen, whole = _turn(w, zeta), _turn(step / values[0], zeta)
    x, v = u[0], 0.0  # v is w'/ω
    for k in range(len(u)):
        d = x - u[k]
        d_seen, v_seen = seen[0] * d + seen[1] * v, seen[2] * v - seen[1] * d
        out[k] = u[k] - ((v_seen - v) + 2.0 * zeta * (d_seen - d)) / w
        x, v = u[k] + whole[0] * d + whole[1] * v, whole[2] * v - whole[1] * d
    return out


@njit(cache=True)
def _turn(w: float, zeta: float) -> tuple[float, float, float]:
    """Return what deviation d and rate v/ω become after an angle w: d a + v b, v c − d b."""
    root = math.sqrt(1.0 - zeta * zeta)
    decay, c, s = math.exp(-zeta * w), math.cos(w * root), math.sin(w * root)
    return decay * (c + zeta / root * s), decay / root * s, decay * (c - zeta / root * s)


@njit(cache=True)
def _rate_limit(u: Array, values: Array, step: float, part: float) -> Array:
    """Follow the command at no more than values[0] a second; blended in by values[1]; the mean over each first part."""
    out = np.empty_like(u)
    most, x = values[0] * step, u[0]
    for k in range(len(u)):
        gap = u[k] - x
        if abs(gap) <= most * part:
            mean = u[k] - 0.5 * gap * abs(gap) / (most * part) if most > 0 else u[k]  # a ramp, then there
        else:
            mean = x + 0.5 * math.copysign(most * part, gap)
        x = u[k] if abs(gap) <= most else x + math.copysign(most, gap)
        out[k] = u[k] + values[1] * (mean - u[k])
    return out


@njit(cache=True)
def _saturation(u: Array, values: Array, step: float, part: float) -> Array:
    """Keep the input within values (low, high); blended in by values[2]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        out[k] = u[k] + values[2] * (min(max(u[k], values[0]), values[1]) - u[k])
    return out


@njit(cache=True)
def _deadband(u: Array, values: Array, step: float, part: float) -> Array:
    """Hold the last value until the command has moved by values[0]; blended in by values[1]."""
    out = np.empty_like(u)
    x = u[0]
    for k in range(len(u)):
        if abs(u[k] - x) > values[0]:
            x = u[k]
        out[k] = u[k] + values[1] * (x - u[k])
    return out


@njit(cache=True)
def _dead_zone(u: Array, values: Array, step: float, part: float) -> Array:
    """Let nothing through within ±values[0], beyond it what exceeds that; blended in by values[1]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        x = math.copysign(max(abs(u[k]) - values[0], 0.0), u[k])
        out[k] = u[k] + values[1] * (x - u[k])
    return out


@njit(cache=True)
def _backlash(u: Array, values: Array, step: float, part: float) -> Array:
    """Follow with a play of full width values[0]; blended in by values[1]."""
    out = np.empty_like(u)
    x, half = u[0], 0.5 * values[0]
    for k in range(len(u)):
        x = min(max(x, u[k] - half), u[k] + half)
        out[k] = u[k] + values[1] * (x - u[k])
    return out


@njit(cache=True)
def _quantisation(u: Array, values: Array, step: float, part: float) -> Array:
    """Round to multiples of values[0]; blended in by values[1]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        rounded = math.floor(u[k] / values[0] + 0.5) * values[0] if values[0] > 0 else u[k]
        out[k] = u[k] + values[1] * (rounded - u[k])
    return out


@njit(cache=True)
def _lead_lag(u: Array, values: Array, step: float, part: float) -> Array:
    """Add values[1] times what is left of the input's changes, which die away with time constant values[0] s."""
    slow = lag_held_input(u, values[0] / step, part)
    out: Array = u + values[1] * (u - slow)
    return out


@njit(cache=True)
def _indicial(u: Array, values: Array, step: float, part: float) -> Array:
    """Add values[1] times what is left of the input's changes: two thirds of it die away 6.6 times as fast as the rest.

    The two terms of Jones' approximation to Wagner's function, 0.165 e^(-0.0455 s) and 0.335 e^(-0.3 s); values[0] is
    the slow time constant in s.
    """
    fast = lag_held_input(u, values[0] * (0.0455 / 0.3) / step, part)
    slow = lag_held_input(u, values[0] / step, part)
    out: Array = u + values[1] * (u - 0.67 * fast - 0.33 * slow)
    return out


def _scale(u: Array, values: Array, step: float, part: float) -> Array:
    scaled: Array = u * (1.0 + values[1] * (values[0] - 1.0))
    return scaled


KINDS: dict[str, FilterKind] = {
    "actuator_lag": FilterKind(("tau_s",), _lag),
    "transport_delay": FilterKind(("delay_s",), _delay),
    "actuator_second_order": FilterKind(("inverse_omega_s", "damping"), _second_order),
    "rate_limit": FilterKind(("rate_per_s", "share"), _rate_limit),
    "input_saturation": FilterKind(("low", "high", "share"), _saturation, lasting=False),
    "deadband": FilterKind(("width", "share"), _deadband, lasting=False),
    "dead_zone": FilterKind(("width", "share"), _dead_zone, lasting=False),
    "backlash": FilterKind(("width", "share"), _backlash, lasting=False),
    "input_quantisation": FilterKind(("spacing", "share"), _quantisation, lasting=False),
    "input_scale": FilterKind(("factor", "share"), _scale, lasting=False),
    "lead_lag": FilterKind(("tau_s", "gain"), _lead_lag),
    "indicial": FilterKind(("tau_s", "gain"), _indicial),
}
"""Every kind a model file may name; `share` blends the effect in from 0 (none) to 1 (all of it)."""
