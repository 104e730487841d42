"""What may lie between a command and the plant, and between a quantity and its recorded column.

Each effect has two forms: form 0 is the textbook one; form 1 is another mechanism of the same physics (several lags in
a row for one, a spread of dead times for one dead time, rounded knees for corners, compliant walls for rigid play).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import bilinear, lfilter

from aeolid.compiled import njit

Array = NDArray[np.float64]
PARTS = 16  # of a fine step, for drives that follow
RING = 16384  # fine steps of commands that are remembered: the longest dead time
DRIVES = ("none", "lag", "second_order", "delay", "rate", "saturation", "deadband", "backlash", "levels", "hidden",
          "bent")  # fmt: skip


@dataclass(frozen=True)
class Drive:
    """Hold what the drive of input `which` does: kind (of DRIVES), form, and up to two sizes in its units."""

    which: int = 0
    kind: str = "none"
    form: int = 0
    a: float = 0.0
    b: float = 0.0

    def packed(self) -> Array:
        """Return the row the compiled loop reads."""
        return np.array([self.which, DRIVES.index(self.kind), self.form, self.a, self.b], dtype=float)


@dataclass(frozen=True)
class Sensor:
    """Hold what a sensor or logger does to column `which`: kind, form, and up to two sizes in its units."""

    which: int
    kind: str
    form: int = 0
    a: float = 0.0
    b: float = 0.0


@njit(cache=True)
def drive(row: Array, s: Array, ring: Array, k: int, command: float, dt: float, rest: float) -> float:
    """Return the mean over fine step k of what acts after a command; s (3,) is the drive's state, ring starts at rest.

    The mean, not the end: a lag of τ held at what it ends each step with acts like one of τ − dt/2.
    """
    kind, form, a, b = int(row[1]), int(row[2]), row[3], row[4]
    ring[k % RING] = command
    if kind == 3:
        if form == 0:
            return _late(ring, k, a / dt)
        total = 0.0  # a bus that is busy by turns: dead times spread over a quarter to either side
        for j in range(9):
            total += _late(ring, k, a * (0.75 + j / 16.0) / dt)
        return total / 9.0
    if kind not in (1, 2, 4):
        return _bent(kind, form, a, b, s, command, dt, rest)
    mean, place = 0.0, 2 if kind == 1 and form == 1 else 0
    for _ in range(PARTS):
        before = s[place]
        if kind == 4:  # a by second; other form: a servo whose speed levels off
            gap, most = command - s[0], a * dt / PARTS
            s[0] += most * math.tanh(gap / (4.0 * dt * a)) if form == 1 else min(max(gap, -most), most)
        else:
            _follow(kind, form, a, b, s, command, dt / PARTS)
        mean += 0.5 * (before + s[place]) / PARTS
    return mean


@njit(cache=True)
def _late(ring: Array, k: int, steps: float) -> float:
    """Return the mean over fine step k of a held command that comes `steps` fine steps late."""
    whole = math.floor(steps)
    part = steps - whole
    return float((1.0 - part) * ring[(k - whole) % RING] + part * ring[(k - whole - 1) % RING])


@njit(cache=True)
def _follow(kind: int, form: int, a: float, b: float, s: Array, command: float, dt: float) -> None:
    """Advance a drive that lags or rings."""
    if kind == 1 and form == 0:
        s[0] += (command - s[0]) * -math.expm1(-dt / a)
    elif kind == 1:
        s[0] += (command - s[0]) * -math.expm1(-dt / (0.75 * a))  # three lags in a row, of a in sum
        s[1] += (s[0] - s[1]) * -math.expm1(-dt / (0.15 * a))
        s[2] += (s[1] - s[2]) * -math.expm1(-dt / (0.10 * a))
    else:  # a rad/s, damping b; other form: behind a valve that is three times as fast
        if form == 1:
            s[2] += (command - s[2]) * -math.expm1(-dt * 5.0 * a)
            command = s[2]
        s[0] += 0.5 * dt * s[1]  # drift, kick, drift: neither early nor late
        s[1] = (s[1] * (1 - b * a * dt) + dt * a * a * (command - s[0])) / (1 + b * a * dt)
        s[0] += 0.5 * dt * s[1]


@njit(cache=True)
def _bent(kind: int, form: int, a: float, b: float, s: Array, command: float, dt: float, rest: float) -> float:
    """Return what acts behind a drive that is not linear, or that hides a state of its own."""
    gap, away = command - s[0], command - rest
    if kind == 5:  # at a above and below its rest
        return rest + (away / (1 + (away / a) ** 16) ** 0.0625 if form == 1 else min(max(away, -a), a))
    if kind == 6:  # of half width a about rest
        beyond = max(abs(away) - a, 0.0)
        if form == 1:
            beyond = 0.5 * (abs(away) - a + math.hypot(abs(away) - a, 0.15 * a))
        return rest + math.copysign(beyond, away)
    if kind == 7:  # of full width a; other form: a wall that gives
        over = max(gap - 0.5 * a, 0.0) + min(gap + 0.5 * a, 0.0)
        s[0] += over * (-math.expm1(-dt / b) if form == 1 else 1.0)
        return float(s[0])
    if kind == 8:  # spaced a; other form: cut off instead of rounded
        return rest + a * (math.floor(away / a) + 0.5 if form == 1 else math.floor(away / a + 0.5))
    if kind == 9:  # a times the mean of the last b seconds on top
        s[0] += (away - s[0]) * -math.expm1(-dt / b)
        return float(command + a * s[0])
    if kind == 10:  # a valve's curve: even powers, which no entry of a drive has
        return command + a * away * away
    return command


def read(
    sensors: tuple[Sensor, ...], fine: Array, jitter: Array, every: int, dt: float, at: Array | None = None
) -> Array:  # fmt: skip
    """Return the logged outputs (N, l) of those at every fine step (N·every, l) with sensor noise (N, l).

    at: where the logger looks, in samples; without it at every sample.
    """
    fine = fine.copy()
    for s in sensors:
        if s.kind in ("lag", "second_order"):
            fine[:, s.which] = _filtered(s, fine[:, s.which], dt)
    late = next((s for s in sensors if s.kind == "offset"), None)
    rows = (np.arange(0.0, len(fine), every) if at is None else at * every) - (0.0 if late is None else late.a / dt)
    if late is not None and late.form == 1:  # a clock that walks by a tenth of its offset
        rows -= 0.1 * late.a / dt * np.sin(np.arange(len(rows)) * 2 * np.pi / len(rows))
    steps = np.arange(len(fine))
    seen = np.column_stack([np.interp(rows, steps, column) for column in fine.T]) + jitter
    times: Array = dt * every * np.arange(len(seen), dtype=float)
    for s in sensors:
        if s.kind == "swap":
            seen[:, [s.which, int(s.b)]] = seen[:, [int(s.b), s.which]]
        else:
            seen[:, s.which] = _logged(s, seen, jitter, times)
    return seen


def _filtered(s: Sensor, x: Array, dt: float) -> Array:
    if s.kind == "lag":
        for tau in (s.a,) if s.form == 0 else (0.8 * s.a, 0.2 * s.a):
            x = lfilter(*bilinear([1.0], [tau, 1.0], 1 / dt), x - x[0]) + x[0]
        return np.asarray(x)
    top, bottom = bilinear([s.a**2], [1, 2 * s.b * s.a, s.a**2], 1 / dt)
    if s.form == 1:  # the filter works on an average over a quarter of its period
        width = max(1, round(0.25 * 2 * np.pi / s.a / dt))
        x = lfilter(np.ones(width) / width, [1.0], x - x[0]) + x[0]
    return np.asarray(lfilter(top, bottom, x - x[0]) + x[0])


def _logged(s: Sensor, seen: Array, jitter: Array, times: Array) -> Array:
    x, noise, other = seen[:, s.which], jitter[:, s.which], s.form == 1
    clean = x - noise
    if s.kind == "rectified":
        return np.sqrt(clean**2 + (0.02 * np.std(clean)) ** 2) + noise if other else np.abs(x)
    if s.kind == "saturation":
        return np.clip(clean, s.b - s.a, s.b + s.a) + noise if other else np.clip(x, s.b - s.a, s.b + s.a)
    if s.kind == "levels":
        return s.a * (np.floor(x / s.a) if other else np.rint(x / s.a))
    if s.kind == "scale":
        return s.a * x
    if s.kind == "bias":
        return x + s.a
    if s.kind == "drift":
        return x + s.a * (times[-1] / 2 * (1 - np.exp(-2 * times / times[-1])) if other else times)
    if s.kind == "skew":
        neighbour = seen[:, int(s.b)]
        return math.cos(s.a) * x + math.sin(s.a) * neighbour if other else x + s.a * neighbour
    if s.kind == "stuck":
        held = (times >= s.a * times[-1]) & (times < (s.a + s.b) * times[-1])
        return np.where(held, x[np.argmax(held)], x)
    if s.kind == "twin":
        return seen[:, int(s.b)]
    return np.asarray(x)
