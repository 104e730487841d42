"""Two test benches: a mass on a spring, and two inertias on a flexible shaft.

Every effect has two forms: `other` 0 is the textbook one, 1 another mechanism: bristles (LuGre, Canudas de Wit 1995)
for dry friction, a stretched wire and a exponential spring for power laws, a Hertzian contact for a stop, sliders that
give way one after the other for a single one, drag of power 1.8, changes that take their time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit

Array = NDArray[np.float64]
STATES = 13  # three of the plant, then what effects remember
LOOP, SLIDERS, BRISTLE, BRACKET, RELAX = 3, 4, 7, 8, 10


class Bench(NamedTuple):
    """Hold the constants of a bench; everything after `gain` is an effect, zero: not there."""

    m: float = 2.0  # kg, or kg m² of the load
    c: float = 1.5  # N s/m, or N m s of the shaft
    k: float = 80.0  # N/m, or N m of the shaft
    gain: float = 4.0  # N/V
    motor: float = 0.6  # kg m²
    bearing: float = 0.25  # N m s, of the motor
    load: float = 0.35  # N m s, of the load
    rigid: float = 0.0  # 1: the shaft does not twist
    other: float = 0.0  # 1: the other form of every effect
    dry: float = 0.0  # N
    excess: float = 0.0  # N, at break-away
    slow: float = 0.1  # m/s over which it dies away
    cubic: float = 0.0  # N/m³
    square: float = 0.0  # N/m²
    stop: float = 0.0  # N/m, from stop_at on
    stop_at: float = 1.0  # m
    gap: float = 0.0  # m to either side
    loop: float = 0.0  # N
    loop_at: float = 0.05  # m
    slider: float = 0.0  # N/m
    slider_at: float = 0.05  # m
    drag: float = 0.0  # N/(m/s)²
    softer: float = 0.0  # share of k, from `at` on
    damper: float = 0.0  # N s/m, from `at` on
    at: float = 0.0  # s
    melt: float = 0.0  # N/m/K
    extra: float = 0.0  # share of m
    seen: float = 0.0  # N of a recorded disturbance
    bracket: float = 0.0  # rad/s of the sensor's bracket
    bracket_damping: float = 0.03
    swing: float = 0.0  # share of k that swings
    swing_s: float = 9.0
    lively: float = 0.0  # N s/m³: damping that falls with the stroke (van der Pol)
    relax: float = 0.0  # N/m of a spring behind a dashpot
    relax_s: float = 1.0
    teeth: float = 0.0  # N m locked to the position
    pitch: float = 0.02  # m between two teeth


@njit(cache=True)
def spring_force(e: Bench, q: float, t: float, warm: float) -> float:
    """Return what springs add to −k q."""
    force = 0.0
    if e.cubic:
        if e.other:  # a wire of length 1 across the motion: k₃ q³ (1 − 3 q²/4 …)
            length = math.hypot(1.0, q)
            force -= 2 * e.cubic * (length - 1.0) * q / length
        else:
            force -= e.cubic * q**3
    if e.square:
        a = 2 * e.square / e.k
        force -= e.k * (math.expm1(a * q) / a - q) if e.other else e.square * q * q
    if e.stop:
        deep = abs(q) - e.stop_at
        if deep > 0:
            force -= math.copysign(e.stop * (deep**1.5 / 0.2 if e.other else deep), q)
    if e.gap:
        free = e.gap * math.tanh(q / e.gap) if e.other else min(max(q, -e.gap), e.gap)
        force += e.k * free
    if e.softer:
        grown = 0.5 * (1 + math.tanh((t - e.at) / (0.03 * e.at))) if e.other else (1.0 if t > e.at else 0.0)
        force += e.softer * e.k * grown * q
    if e.melt:
        force -= e.melt * (18.0 * math.tanh(warm / 18.0) if e.other else warm) * q
    if e.swing:
        force -= e.swing * e.k * math.sin(2 * math.pi * t / e.swing_s) * q
    if e.teeth:
        force -= e.teeth * math.sin(2 * math.pi * q / e.pitch)
    return force


@njit(cache=True)
def loss_force(e: Bench, q: float, v: float, t: float, s: Array, ds: Array) -> float:
    """Return what friction, drag and hysteresis add to −c v; writes the rates of what they remember."""
    force = 0.0
    if e.dry or e.excess:
        level = e.dry + e.excess * math.exp(-((v / e.slow) ** 2))
        if e.other:
            stiff = 200.0 * (e.dry + e.excess)  # bends by 5 mm before it slips: within the rule's reach
            z = s[BRISTLE]
            ds[BRISTLE] = v - abs(v) * stiff * z / level
            force -= stiff * z + 0.2 * math.sqrt(stiff) * ds[BRISTLE]
        else:
            force -= level * math.tanh(v / 0.002)
    if e.loop:
        z, d, beta = s[LOOP], e.loop_at, 0.65 if e.other else 0.5
        ds[LOOP] = v - (beta * abs(v) * z + (1 - beta) * v * abs(z)) / d
        force -= e.loop * z / d
    if e.slider:
        for i in range(3 if e.other else 1):
            width = e.slider_at * (0.7 + 0.3 * i if e.other else 1.0)
            z = s[SLIDERS + i]
            held = min(abs(z) / width, 1.0) ** 16 if v * z > 0 else 0.0
            ds[SLIDERS + i] = v * (1 - held)
            force -= e.slider * (1.0 / 3 if e.other else 1.0) * z
    if e.drag:
        force -= e.drag * math.copysign(abs(v) ** 1.8 if e.other else v * v, v)
    if e.damper:
        grown = 0.5 * (1 + math.tanh((t - e.at) / (0.03 * e.at))) if e.other else (1.0 if t > e.at else 0.0)
        force -= e.damper * grown * v
    if e.lively:
        force += e.lively * q * q * v
    if e.relax:
        ds[RELAX] = v - s[RELAX] / e.relax_s
        force -= e.relax * s[RELAX]
    return force


@njit(cache=True)
def spring_flow(e: Bench, t: float, s: Array, u: Array, w: Array, ds: Array) -> None:
    """Write ds/dt of the mass: position, speed (state 2 is not used); w: push N, warmth K, recorded push."""
    ds[:] = 0.0
    force = e.gain * u[0] + w[0] + e.seen * w[2] - e.c * s[1] - e.k * s[0]
    force += spring_force(e, s[0], t, w[1]) + loss_force(e, s[0], s[1], t, s, ds)
    ds[0], ds[1] = s[1], force / (e.m * (1 + e.extra))
    if e.bracket:
        z, rate = s[BRACKET], s[BRACKET + 1]
        ds[BRACKET] = rate
        ds[BRACKET + 1] = -ds[1] - e.bracket**2 * z - 2 * e.bracket_damping * e.bracket * rate


@njit(cache=True)
def spring_see(e: Bench, s: Array, u: Array, w: Array, y: Array) -> None:
    """Write position and speed as the sensor on its bracket has them."""
    y[0], y[1] = s[0] + s[BRACKET], s[1] + s[BRACKET + 1]


@njit(cache=True)
def spring_control(e: Bench, y: Array, aim: float, c: Array, u: Array, dt: float) -> None:
    """Hold a position: proportional, with a difference of the position over the last sample."""
    u[0] += 6.0 * (aim - y[0]) - 0.4 * (y[0] - c[0]) / dt
    c[0] = y[0]


@njit(cache=True)
def shaft_flow(e: Bench, t: float, s: Array, u: Array, w: Array, ds: Array) -> None:
    """Write ds/dt: twist, motor speed, load speed; w: load torque N m, warmth K, recorded torque."""
    ds[:] = 0.0
    twist, vm, vl = s[0], s[1], s[1] if e.rigid else s[2]
    load = w[0] + e.seen * w[2] - e.load * vl + loss_force(e, twist, vl, t, s, ds)
    drive = e.gain * u[0] - e.bearing * vm
    if e.rigid:
        ds[1] = ds[2] = (drive + load) / (e.motor + e.m)
        return
    shaft = e.k * twist + e.c * (vm - vl) - spring_force(e, twist, t, w[1])
    ds[0], ds[1], ds[2] = vm - vl, (drive - shaft) / e.motor, (load + shaft) / (e.m * (1 + e.extra))


@njit(cache=True)
def shaft_see(e: Bench, s: Array, u: Array, w: Array, y: Array) -> None:
    """Write the speeds of motor and load."""
    y[0], y[1] = s[1], s[1] if e.rigid else s[2]


@njit(cache=True)
def shaft_control(e: Bench, y: Array, aim: float, c: Array, u: Array, dt: float) -> None:
    """Hold the motor's speed: proportional and integral."""
    c[0] += 1.2 * (aim - y[0]) * dt
    u[0] += 0.8 * (aim - y[0]) + c[0]
