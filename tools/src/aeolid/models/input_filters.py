"""What may lie between a recorded input and the plant: lags, delays, limits, play; each exact for a held input.

What moves the states over a step is the mean of what acts in it. An output that reads an input at once, as an
accelerometer does, is sampled as the step begins: it sees the mean of the first tenth. Told by the mean of the whole
step, a dead time of 24 ms in a pitch drive came out at 81 ± 5 ms beside an acceleration every 100 ms. So a step comes
in pieces, of which each filter says the mean of what it lets through: one, or two where an output looks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit
from aeolid.models import intersample, late_inputs

Array = NDArray[np.float64]
WHOLE, SPLIT = np.array([1.0]), np.array([0.1, 0.9])  # pieces of a step; the first of two is what an output sees
QUARTERS = np.full(4, 0.25)  # which tell by how much an input that steps changes within the step
_ROUNDING = 1e-12  # steps
_REPEATED = 1e-5  # √|1 − ζ²| below which two poles are one: what differs is its square
_NONE = 1e-3  # steps: what is faster only begins to lag, and is spread over the step; its slope at none is known


@dataclass(frozen=True)
class FilterKind:
    """Hold a kind of input filter: the parameters it takes, and its rule.

    rule(u (N·p,), values (k,), step in s, pieces (p,) of a step) → (N·p,): means over the pieces, one after another.
    """

    slots: tuple[str, ...]
    rule: Callable[[Array, Array, float, Array], Array]

    def fault(self, values: Sequence[float]) -> str | None:
        """Say which value lies outside its range, and the range; None where all are inside."""
        given = dict(zip(self.slots, values, strict=True))
        for slot, value in given.items():
            low, high = RANGES.get(slot, (-math.inf, math.inf))
            if not low <= value <= high:
                return f"{slot} = {value:g} lies outside {low:g} … {high:g}"
        if given.get("low", -math.inf) > given.get("high", math.inf):
            return f"low = {given['low']:g} lies above high = {given['high']:g}"
        return None


def _lag(u: Array, values: Array, step: float, pieces: Array) -> Array:
    return lag_held_input(u, float(values[0]) / step, pieces)


def _delay(u: Array, values: Array, step: float, pieces: Array) -> Array:
    if abs(values[0]) >= _NONE * step and _is_held(u, len(pieces)):
        return late_inputs.late(u, values, step, pieces)  # what passed no filter before: a tenth of the time
    return delay_held_input(u, float(values[0]) / step, pieces)


@njit(cache=True)
def _is_held(u: Array, count: int) -> bool:
    """Tell whether all pieces of each step are the same."""
    held = True
    for k in range(len(u)):
        held = held and u[k] == u[k - k % count]
    return held


@njit(cache=True)
def lag_held_input(u: Array, tau: float, pieces: Array = WHOLE) -> Array:
    """Return each piece's mean of a first-order lag driven by a held input; tau in samples, 0 is no lag.

    Over a time p w(t) = u + (w₀ − u) e^(−t/τ): mean u + (w₀ − u) τ/p (1 − e^(−p/τ)), exact for a held input.
    """
    out = np.empty_like(u)
    if tau <= 1e-9:
        out[:] = u
        return out
    count = len(pieces)
    decay, share = np.exp(-pieces / tau), -np.expm1(-pieces / tau) * tau / pieces
    w = u[0]
    for k in range(len(u)):
        i = k % count
        out[k] = u[k] + (w - u[k]) * share[i]
        w = u[k] + (w - u[k]) * decay[i]
    if tau < _NONE:
        _spread(u, out, pieces)
    return out


@njit(cache=True)
def _spread(u: Array, out: Array, pieces: Array) -> None:
    """Give every piece of a step the mean of what has changed in it."""
    count = len(pieces)
    for k in range(0, len(u), count):
        mean = 0.0
        for i in range(count):
            mean += pieces[i] * (out[k + i] - u[k + i])
        for i in range(count):
            out[k + i] = u[k + i] + mean


@njit(cache=True)
def delay_held_input(u: Array, delay: float, pieces: Array = WHOLE) -> Array:
    """Return each piece's mean of a held input delayed by `delay` samples (exact); below 0 it comes early.

    Before the first sample and after the last it holds. Of a delay that is no number nothing comes but NaN.
    """
    out, count, last = np.full_like(u, np.nan), len(pieces), len(u) - 1
    if not math.isfinite(delay):
        return out
    if delay == 0.0:
        out[:] = u
        return out
    starts, far = np.cumsum(pieces) - pieces, math.floor(delay)
    for k in range(len(u)):
        i = k % count
        at, left, total = starts[i] - (delay - far), pieces[i], 0.0  # steps, from the start of the one `far` before
        while left > 0.0:
            whole = math.floor(at)
            j = count - 1
            while j > 0 and at - whole < starts[j] - _ROUNDING:
                j -= 1
            end = starts[j] + pieces[j] + whole
            room = min(max(end - at, _ROUNDING), left)
            total += room * u[min(max(k - i + (whole - far) * count + j, 0), last)]
            at, left = max(at + room, end) if room < left else at + room, left - room
        out[k] = total / pieces[i]
    if abs(delay) < _NONE:
        _spread(u, out, pieces)
    return out


@njit(cache=True)
def _second_order(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Follow w'' = ω² (u − w) − 2ζω w' from rest, values (1/ω in s, ζ); the mean over each piece, exact.

    The mean of w over a time p is u − (w'_end − w'_start)/(ω² p) − 2ζ (w_end − w_start)/(ω p).
    """
    out = np.empty_like(u)
    if values[0] <= 1e-9 * step:
        out[:] = u
        return out
    count, zeta = len(pieces), max(values[1], 0.0)
    w, root = pieces * step / values[0], max(math.sqrt(abs(1.0 - zeta * zeta)), _REPEATED)
    if zeta < 1.0:
        decay, c, s = np.exp(-zeta * w), np.cos(w * root), np.sin(w * root)
    else:  # two lags: e^(−ζw) cosh and sinh of w·root, neither of which may overflow
        slow, fast = np.exp(-(zeta - root) * w), np.exp(-(zeta + root) * w)
        decay, c, s = np.ones(count), 0.5 * (slow + fast), 0.5 * (slow - fast)
    x, v = u[0], 0.0  # v is w'/ω
    for k in range(len(u)):
        i = k % count
        d = x - u[k]
        d_next = decay[i] * (d * (c[i] + zeta / root * s[i]) + v / root * s[i])
        v_next = decay[i] * (v * (c[i] - zeta / root * s[i]) - d / root * s[i])
        out[k] = u[k] - ((v_next - v) + 2.0 * zeta * (d_next - d)) / w[i]
        x, v = u[k] + d_next, v_next
    if values[0] < _NONE * step:
        _spread(u, out, pieces)
    return out


@njit(cache=True)
def _rate_limit(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Follow the command at no more than values[0] a second; blended in by values[1]; the mean over each piece."""
    out = np.empty_like(u)
    count, x = len(pieces), u[0]
    for k in range(len(u)):
        gap, most = u[k] - x, values[0] * step * pieces[k % count]
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
def _saturation(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Keep the input within values (low, high); blended in by values[2]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        out[k] = u[k] + values[2] * (min(max(u[k], values[0]), values[1]) - u[k])
    return out


@njit(cache=True)
def _deadband(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Hold the last value until the command has moved by values[0]; blended in by values[1]."""
    out = np.empty_like(u)
    x = u[0]
    for k in range(len(u)):
        if abs(u[k] - x) > values[0]:
            x = u[k]
        out[k] = u[k] + values[1] * (x - u[k])
    return out


@njit(cache=True)
def _dead_zone(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Let nothing through within ±values[0], beyond it what exceeds that; blended in by values[1]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        x = math.copysign(max(abs(u[k]) - values[0], 0.0), u[k])
        out[k] = u[k] + values[1] * (x - u[k])
    return out


@njit(cache=True)
def _backlash(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Follow with a play of full width values[0]; blended in by values[1]."""
    out = np.empty_like(u)
    x, half = u[0], 0.5 * values[0]
    for k in range(len(u)):
        x = min(max(x, u[k] - half), u[k] + half)
        out[k] = u[k] + values[1] * (x - u[k])
    return out


@njit(cache=True)
def _quantisation(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Round to multiples of values[0]; blended in by values[1]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        rounded = math.floor(u[k] / values[0] + 0.5) * values[0] if values[0] > 0 else u[k]
        out[k] = u[k] + values[1] * (rounded - u[k])
    return out


@njit(cache=True)
def _mid_rise(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Round to the odd multiples of half of values[0], none of which is zero; blended in by values[1]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        between = (math.floor(u[k] / values[0]) + 0.5) * values[0] if values[0] > 0 else u[k]
        out[k] = u[k] + values[1] * (between - u[k])
    return out


@njit(cache=True)
def _floor(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Cut down to the multiple of values[0] below; blended in by values[1]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        below = math.floor(u[k] / values[0]) * values[0] if values[0] > 0 else u[k]
        out[k] = u[k] + values[1] * (below - u[k])
    return out


@njit(cache=True)
def _truncation(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Cut off to the multiple of values[0] towards zero; blended in by values[1]."""
    out = np.empty_like(u)
    for k in range(len(u)):
        cut = math.trunc(u[k] / values[0]) * values[0] if values[0] > 0 else u[k]
        out[k] = u[k] + values[1] * (cut - u[k])
    return out


@njit(cache=True)
def _lead_lag(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Add values[1] times what is left of the input's changes, which die away with time constant values[0] s."""
    slow = lag_held_input(u, values[0] / step, pieces)
    out: Array = u + values[1] * (u - slow)
    return out


@njit(cache=True)
def _indicial(u: Array, values: Array, step: float, pieces: Array) -> Array:
    """Add values[1] times what is left of the input's changes: two thirds of it die away 6.6 times as fast as the rest.

    The two terms of Jones' approximation to Wagner's function, 0.165 e^(-0.0455 s) and 0.335 e^(-0.3 s); values[0] is
    the slow time constant in s.
    """
    fast = lag_held_input(u, values[0] * (0.0455 / 0.3) / step, pieces)
    slow = lag_held_input(u, values[0] / step, pieces)
    out: Array = u + values[1] * (u - 0.67 * fast - 0.33 * slow)
    return out


def _scale(u: Array, values: Array, step: float, pieces: Array) -> Array:
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
    "input_mid_rise": FilterKind(("spacing", "share"), _mid_rise),
    "input_floor": FilterKind(("spacing", "share"), _floor),
    "input_truncation": FilterKind(("spacing", "share"), _truncation),
    "input_scale": FilterKind(("factor", "share"), _scale),
    "lead_lag": FilterKind(("tau_s", "gain"), _lead_lag),
    "indicial": FilterKind(("tau_s", "gain"), _indicial),
    "intersample_zoh": FilterKind(("offset_s",), _delay),
    "intersample_foh": FilterKind(("offset_s",), intersample.straight),
    "intersample_band_limited": FilterKind(("offset_s",), intersample.smooth),
    "intersample_filtered": FilterKind(("offset_s", "delay_s"), late_inputs.filtered),
}
"""Every kind a model file may name; `share` blends the effect in from 0 (none) to 1 (all of it)."""
RANGES = {
    "tau_s": (0.0, math.inf), "inverse_omega_s": (0.0, math.inf), "damping": (0.0, math.inf),
    "rate_per_s": (0.0, math.inf), "width": (0.0, math.inf), "spacing": (0.0, math.inf), "share": (0.0, 1.0),
}  # fmt: skip
"""What a value of these names may be; any finite number of the others. A negative delay lets the input come early."""
CHANGING = (
    "actuator_lag", "transport_delay", "actuator_second_order", "rate_limit", "lead_lag", "indicial",
    "intersample_zoh", "intersample_filtered",
)  # fmt: skip
"""Kinds behind which a held input changes within a step; the others let it step with the samples."""
HELD_LATE = ("intersample_zoh", "intersample_filtered")
"""Kinds by which a held input is late as a whole."""
LIMITING = (
    "rate_limit", "input_saturation", "deadband", "dead_zone", "backlash",
    "input_quantisation", "input_mid_rise", "input_floor", "input_truncation",
)  # fmt: skip
"""Kinds that are not linear, which do not let through the mean of a step what they let through of its parts."""
