"""A reduced turbine above rated: rotor, shaft, tower both ways, three blades that each meet their own wind.

Aerodynamic loads are a second-order expansion about the operating point (`curve` 1) or its linear part (`curve` 0).
Rotor-locked effects are pulses and profiles, not harmonics: a logarithmic wind profile, a Gaussian dip before the
tower, a blade that sits at an angle. Slow aerodynamics have two stages.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit

Array = NDArray[np.float64]
STATES = 13  # twist, rotor, generator, azimuth, fore-aft 2, side-side 2, wake 2, lift, flap 2
V0, B0, W0 = 17.0, 13.8, 1.267  # m/s, deg, rad/s
Q0, T0 = 4.05e6, 3.9e5  # N m, N
HUB, ARM, BLADES = 90.0, 44.0, 3  # m


class Turbine(NamedTuple):
    """Hold the constants of the turbine; everything after `curve` is an effect, zero: not there."""

    jr: float = 3.9e7  # kg m²
    jg: float = 5.1e6
    ks: float = 8.7e8  # N m
    cs: float = 6.2e6  # N m s
    mass: float = 4.2e5  # kg, of nacelle and rotor with a share of the tower
    k_fa: float = 1.75e6
    c_fa: float = 1.1e4
    k_ss: float = 1.69e6
    c_ss: float = 1.5e4
    roll: float = 1.5 / 90.0  # N of side force by N m
    q_v: float = 9.6e5
    q_b: float = -1.05e6
    q_w: float = -2.9e6
    t_v: float = 8.6e4
    t_b: float = -5.8e4
    t_w: float = 2.1e5
    curve: float = 1.0
    other: float = 0.0
    torsion: float = 0.0  # 1: the shaft twists
    heavy: float = 0.0  # kg m
    skewed: float = 0.0  # deg that blade 1 is off
    weight: float = 0.0  # N m
    shear: float = 0.0  # exponent
    yaw: float = 0.0  # deg
    shadow: float = 0.0  # share of the wind missing before the tower
    eddies: float = 0.0  # m/s at three times the speed
    wake: float = 0.0
    wake_s: float = 8.0
    lift: float = 0.0
    lift_s: float = 0.8
    bend: float = 0.0  # 1/(m/s)
    region: float = 0.0
    soiled: float = 0.0
    density: float = 0.0
    loss: float = 0.0
    sea: float = 0.0  # N by metre of water
    seen: float = 0.0  # m/s of a recorded gust
    flap: float = 0.0  # rad/s of the blades' first flapwise mode
    shed: float = 0.0  # N of eddies shed by the tower, at shed_hz
    stall: float = 0.0  # N s²/m²: the tower's damping has the sign of its speed's square


@njit(cache=True)
def _wind(e: Turbine, hub: float, angle: float) -> float:
    """Return the wind a blade at `angle` from upright meets."""
    up, side, w = math.cos(angle), math.sin(angle), hub
    if e.shear:
        if e.other:  # a logarithmic profile that has the same slope at the hub
            w += V0 * e.shear * math.log(1 + ARM / HUB * up)
        else:
            w += V0 * ((1 + ARM / HUB * up) ** e.shear - 1)
    if e.yaw:
        turn = e.yaw * math.pi / 180
        w += -V0 * V0 * math.sin(turn) * 0.35 / (W0 * ARM) * up + 0.09 * V0 * math.tan(0.55 * turn) * side
    if e.shadow:
        if e.other:  # the potential flow round a cylinder, blades below the hub only
            if up < 0:
                y, x = ARM * side, 6.0
                w += V0 * e.shadow * 60.0 * (y * y - x * x) / (x * x + y * y) ** 2
        else:
            away = angle % (2 * math.pi) - math.pi  # from straight down
            w -= V0 * e.shadow * math.exp(-0.5 * (away / 0.17) ** 2)
    return w


@njit(cache=True)
def _loads(e: Turbine, s: Array, pitch: float, hub: float) -> tuple[float, float, float, float, float]:
    """Return torque, thrust, tilting moment, side force and the flap moment of blade 1."""
    acting = pitch - B0
    if e.wake:
        acting += e.wake * (acting - s[9])
    if e.lift:
        acting -= e.lift * (acting - s[10])
    gain = 1.0
    if e.bend:
        gain *= 1 + e.bend * (hub - V0) if e.other else math.exp(e.bend * (hub - V0))
    if e.region:
        gain *= 1 + e.region * (0.5 * (1 + math.tanh((hub - V0) / 0.15)) if e.other else (1.0 if hub > V0 else 0.0))
    torque = thrust = tilt = plane = first = 0.0
    for b in range(BLADES):
        angle = s[3] + 2 * math.pi / BLADES * b
        v = _wind(e, hub, angle) - V0
        d = gain * acting + (e.skewed if b == 0 else 0.0)
        turn = Q0 + e.q_v * v + e.q_b * d + e.q_w * (s[1] - W0)
        push = T0 + e.t_v * v + e.t_b * d + e.t_w * (s[1] - W0)
        if e.curve:
            turn += 1.6e4 * v * v - 2.4e4 * d * d - 3.0e4 * v * d
            push += -1.1e3 * v * v - 9.0e2 * d * d + 1.8e3 * v * d
        turn, push = turn * (1 + e.density) * (1 + e.soiled) / BLADES, push * (1 + e.density) / BLADES
        torque, thrust, tilt = torque + turn, thrust + push, tilt + push * ARM * math.cos(angle)
        plane += turn / ARM * math.sin(angle)
        if b == 0:
            first = push * ARM
    return torque, thrust, tilt, plane, first


@njit(cache=True)
def rotor_flow(e: Turbine, t: float, s: Array, u: Array, w: Array, ds: Array) -> None:
    """Write ds/dt; u: pitch deg, torque kN m; w: gust m/s, side N, water m, recorded gust, eddies cos and sin m/s."""
    ds[:] = 0.0
    hub = V0 + w[0] + e.seen * w[3] - s[5]
    if e.eddies:
        hub += e.eddies * (w[4] * math.cos(3 * s[3]) + w[5] * math.sin(3 * s[3]))
    torque, thrust, tilt, plane, first = _loads(e, s, u[0], hub)
    turned = s[3] + 0.7
    torque += (9.81 * e.heavy + e.weight) * math.sin(turned)
    generator = 1e3 * u[1]
    if e.torsion:
        shaft = e.ks * s[0] + e.cs * (s[1] - s[2])
        ds[0], ds[1], ds[2] = s[1] - s[2], (torque - shaft) / e.jr, (shaft - generator) / e.jg
    else:
        ds[1] = ds[2] = (torque - generator) / (e.jr + e.jg)
    ds[3] = s[1]
    lean = 1.5 / HUB * tilt if e.skewed else 0.0
    ds[4] = s[5]
    ds[5] = (thrust - T0 + lean + e.sea * w[2] - e.c_fa * s[5] - e.k_fa * s[4] + e.stall * s[5] * s[5]) / e.mass
    side = e.roll * (generator - Q0) + w[1] + e.heavy * s[1] * s[1] * math.sin(turned) + 0.5 * e.sea * w[2]
    if e.skewed:
        side += plane
    if e.shed:
        side += e.shed * math.sin(2 * math.pi * 0.61 * t + 2.0 * math.sin(0.11 * t))
    ds[6], ds[7] = s[7], (side - e.c_ss * s[7] - e.k_ss * s[6]) / e.mass
    if e.wake:  # two stages after Øye, the second a fifth as slow
        ds[8] = (u[0] - B0 - s[8]) / e.wake_s
        ds[9] = (s[8] - s[9]) / (0.2 * e.wake_s) if e.other else (u[0] - B0 - s[9]) / e.wake_s
    if e.lift:
        ds[10] = (u[0] - B0 - s[10]) / e.lift_s
    if e.flap:
        ds[11], ds[12] = s[12], e.flap**2 * (first - T0 * ARM / BLADES - s[11]) - 2 * 0.25 * e.flap * s[12]


@njit(cache=True)
def rotor_see(e: Turbine, s: Array, u: Array, w: Array, y: Array) -> None:
    """Write speed rad/s, fore-aft and side-side m/s², power kW, flap moment kN m, azimuth deg."""
    d = np.zeros(STATES)
    rotor_flow(e, 0.0, s, u, w, d)
    hub = V0 + w[0] + e.seen * w[3] - s[5]
    if e.eddies:
        hub += e.eddies * (w[4] * math.cos(3 * s[3]) + w[5] * math.sin(3 * s[3]))
    first = _loads(e, s, u[0], hub)[4]
    speed = s[2] if e.torsion else s[1]
    y[0], y[1], y[2] = speed, d[5], d[7]
    y[3] = 0.944 * (1 - e.loss) * u[1] * speed
    y[4] = (T0 * ARM / BLADES + s[11] if e.flap else first) / 1e3
    y[5] = s[3] * 180 / math.pi


@njit(cache=True)
def rotor_control(e: Turbine, y: Array, aim: float, c: Array, u: Array, dt: float) -> None:
    """Hold the speed by a scheduled PI pitch loop on a filtered speed, the power by the torque in part."""
    if c[3] == 0.0:
        c[0], c[1], c[3] = W0, B0, 1.0
    c[0] += (1 - math.exp(-dt / 0.25)) * (y[0] - c[0])
    schedule = (1 + B0 / 6.3) / (1 + max(c[1], 0.0) / 6.3)
    c[1] += dt * 4.2 * schedule * (c[0] - W0)
    u[0] = c[1] + 11.0 * schedule * (c[0] - W0)
    u[1] *= 1 - 0.3 * (c[0] / W0 - 1)
