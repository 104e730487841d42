"""What may lie between a recorded input and the plant: lags, delays, limits, play; each exact for a held input."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FilterKind:
    """Hold a kind of input filter: the parameters it takes, and rule(u (N,), values (k,), step in s) → (N,)."""

    slots: tuple[str, ...]
    rule: Callable[[Array, Array, float], Array]


def _lag(u: Array, values: Array, step: float) -> Array:
    return lag_held_input(u, float(values[0]) / step)


def _delay(u: Array, values: Array, step: float) -> Array:
    return delay_held_input(u, float(values[0]) / step)


@njit(cache=True)
def lag_held_input(u: Array, tau: float) -> Array:
    """Return each step's mean of a first-order lag driven by a held input; tau in samples, 0 is no lag.

    Over one step w(t) = u + (w_k − u) e^(−t/τ): mean u + (w_k − u) τ (1 − e^(−1/τ)), exact for a held input.
    """
    out = np.empty_like(u)
    if tau <= 1e-9:
        out[:] = u
        return out
    decay = math.exp(-1.0 / tau)
    w = u[0]
    for k in range(len(u)):
        out[k] = u[k] + (w - u[k]) * tau * (1.0 - decay)
        w = u[k] + (w - u[k]) * decay
    return out


@njit(cache=True)
def delay_held_input(u: Array, delay: float) -> Array:
    """Return each step's mean of a held input delayed by `delay` samples (exact); below 0 it comes early."""
    out = np.empty_like(u)
    whole = math.floor(delay)
    part = delay - whole
    last = len(u) - 1
    for k in range(len(u)):
        near = u[min(max(k - whole, 0), last)]
        far = u[min(max(k - whole - 1, 0), last)]
        out[k] = (1.0 - part) * near + part * far
    return out


@njit(cache=True)
def _second_order(u: Array, values: Array, step: float) -> Array:
    """Follow w'' = ω² (u − w) − 2ζω w' from rest, values (1/ω in s, ζ); the mean over each step, exact.

    The mean of w over a step is u − (w'_end − w'_start)/(ω² h) − 2ζ (w_end − w_start)/(ω h).
    """
    out = np.empty_like(u)
    if values[0] <= 1e-9 * step:
        out[:] = u
        return out
    w, zeta = step / values[0], min(max(values[1], 0.05), 0.999)
    root = math.sqrt(1.0 - zeta * zeta)
    decay, c, s = math.exp(-zeta * w), math.cos(w * root), math.sin(w * root)
    x, v = u[0], 0.0  # v is w'/ω
    for k in range(len(u)):
        d = x - u[k]
        d_next = decay * (d * (c + zeta / root * s) + v / root * s)
        v_next = decay * (v * (c - zeta / root * s) - d / root * s)
        out[k] = u[k] - ((v_next - v) + 2.0 * zeta * (d_next - d)) / w
        x, v = u[k] + d_next, v_next
    return out


@njit(cache=True)
def _rate_limit(u: Array, values: Array, step: float) -> Array:
    """Follow the command at no more than values[0] a second; blended in by values[1]; the mean over each step."""
    out = np.empty_like(u)
    most, x = values[0] * step, u[0]
    for k in range(len(u)):
        gap = u[k] - x
        if abs(gap) <= most:
            mean = u[k] - 0.5 * gap * abs(gap) / most if most > 0 else u[k]  # a ramp, then there
            x = u[k]
        else:
            move = math.copysign(most, gap)
            mean = x + 0.5 * move
            x += move
        out[k] = u[k] + values[1] * (mean - u[k])
    return out


@njit(cache=True)
def _saturation(u: Array, values: Array, step: float) -> Array:
    """Keep the input within values (low, high); blended in by values[2]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        out[k] = u[k] + values[2] * (min(max(u[k], values[0]), values[1]) - u[k])
    return out


@njit(cache=True)
def _deadband(u: Array, values: Array, step: float) -> Array:
    """Hold the last value until the command has moved by values[0]; blended in by values[1]."""
    out = np.empty_like(u)
    x = u[0]
    for k in range(len(u)):
        if abs(u[k] - x) > values[0]:
            x = u[k]
        out[k] = u[k] + values[1] * (x - u[k])
    return out


@njit(cache=True)
def _dead_zone(u: Array, values: Array, step: float) -> Array:
    """Let nothing through within ±values[0], beyond it what exceeds that; blended in by values[1]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        x = math.copysign(max(abs(u[k]) - values[0], 0.0), u[k])
        out[k] = u[k] + values[1] * (x - u[k])
    return out


@njit(cache=True)
def _backlash(u: Array, values: Array, step: float) -> Array:
    """Follow with a play of full width values[0]; blended in by values[1]."""
    out = np.empty_like(u)
    x, half = u[0], 0.5 * values[0]
    for k in range(len(u)):
        x = min(max(x, u[k] - half), u[k] + half)
        out[k] = u[k] + values[1] * (x - u[k])
    return out


@njit(cache=True)
def _quantisation(u: Array, values: Array, step: float) -> Array:
    """Round to multiples of values[0]; blended in by values[1]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        rounded = math.floor(u[k] / values[0] + 0.5) * values[0] if values[0] > 0 else u[k]
        out[k] = u[k] + values[1] * (rounded - u[k])
    return out


@njit(cache=True)
def _lead_lag(u: Array, values: Array, step: float) -> Array:
    """Add values[1] times what is left of the input's changes, which die away with time constant values[0] s."""
    slow = lag_held_input(u, values[0] / step)
    out: Array = u + values[1] * (u - slow)
    return out


@njit(cache=True)
def _indicial(u: Array, values: Array, step: float) -> Array:
    """Add values[1] times what is left of the input's changes: two thirds of it die away 6.6 times as fast as the rest.

    The two terms of Jones' approximation to Wagner's function, 0.165 e^(-0.0455 s) and 0.335 e^(-0.3 s); values[0] is
    the slow time constant in s.
    """
    fast = lag_held_input(u, values[0] * (0.0455 / 0.3) / step)
    slow = lag_held_input(u, values[0] / step)
    out: Array = u + values[1] * (u - 0.67 * fast - 0.33 * slow)
    return out


def _scale(u: Array, values: Array, step: float) -> Array:
    scaled: Array = u * (1.0 + values[1] * (values[0] - 1.0))
    return scaled


KINDS: dict[str, FilterKind] = {
    "actuator_lag": FilterKind(("tau_s",), _lag),
    "transport_delay": FilterKind(("delay_s",), _delay),
    "actuator_second_order": FilterKind(("inverse_omega_s", "damping"), _second_order),
    "rate_limit": FilterKind(("rate_per_s", "share"), _rate_limit),
    "input_saturation": FilterKind(("low", "high", "share"), _saturation),
    "deadband": FilterKind(("width", "share"), _deadband),
    "dead_zone": FilterKind(("width", "share"), _dead_zone),
    "backlash": FilterKind(("width", "share"), _backlash),
    "input_quantisation": FilterKind(("spacing", "share"), _quantisation),
    "input_scale": FilterKind(("factor", "share"), _scale),
    "lead_lag": FilterKind(("tau_s", "gain"), _lead_lag),
    "indicial": FilterKind(("tau_s", "gain"), _indicial),
}
"""Every kind a model file may name; `share` blends the effect in from 0 (none) to 1 (all of it)."""
