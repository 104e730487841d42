"""Two process rigs: tanks in cascade, and a heated block with its surroundings."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit

Array = NDArray[np.float64]
STATES = 4


class Tanks(NamedTuple):
    """Hold the constants of the tanks; everything after `drain` is an effect, zero: not there."""

    fill: float = 0.02  # m/s by volt of the pump
    drain: float = 0.06  # m^0.5/s, of either outlet
    other: float = 0.0
    brim: float = 0.0  # m, of the upper tank
    share: float = 0.6  # of what spills, into the lower tank
    floor: float = 0.0  # m, of the lower tank: its outlet lies that high
    seen: float = 0.0  # m/s of a recorded second inflow into the lower tank
    leak: float = 0.0  # m/s by metre and metre: a wall that lets through under pressure
    foam: float = 0.0  # share of the outflow lost to a thick layer that grows with the inflow


class Heater(NamedTuple):
    """Hold the constants of the heated block; everything after `air` is an effect, zero: not there."""

    heat: float = 0.0125  # K/s by watt-hundredth of the heater
    couple: float = 0.012  # 1/s from block to shell
    shell: float = 0.02  # 1/s from shell to block
    air: float = 0.008  # 1/s from shell to air
    other: float = 0.0
    seen: float = 0.0  # share of the recorded air temperature that acts
    glow: float = 0.0  # 1/s: radiation at 1000 K
    boil: float = 0.0  # K/s taken above boil_at
    boil_at: float = 30.0


@njit(cache=True)
def tanks_flow(e: Tanks, t: float, s: Array, u: Array, w: Array, ds: Array) -> None:
    """Write ds/dt of both levels, m; w: inflow that nobody measures, warmth, the recorded second inflow."""
    ds[:] = 0.0
    out, below = e.drain * math.sqrt(max(s[0], 0.0)), e.drain * math.sqrt(max(s[1], 0.0))
    if e.floor:  # the last of it does not run out
        deep = s[1] - e.floor
        below *= 0.5 * (1 + math.tanh(deep / 0.02)) if e.other else (1.0 if deep > 0 else 0.0)
    spill = 0.0
    if e.brim and s[0] > e.brim:
        spill = 1.2 * (s[0] - e.brim) ** 1.5 if e.other else 2.0 * (s[0] - e.brim)
    if e.foam:
        out *= 1 - e.foam * max(u[0], 0.0)
    ds[0] = e.fill * u[0] + w[0] - out - spill
    ds[1] = out - below + e.share * spill + 0.5 * w[0] + e.seen * w[2] - e.leak * s[1] ** 2


@njit(cache=True)
def tanks_see(e: Tanks, s: Array, u: Array, w: Array, y: Array) -> None:
    """Write both levels."""
    y[0], y[1] = s[0], s[1]


@njit(cache=True)
def tanks_control(e: Tanks, y: Array, aim: float, c: Array, u: Array, dt: float) -> None:
    """Hold the lower level: proportional and integral."""
    c[0] += 0.02 * (aim - y[1]) * dt
    u[0] += 2.0 * (aim - y[1]) + c[0]


@njit(cache=True)
def heater_flow(e: Heater, t: float, s: Array, u: Array, w: Array, ds: Array) -> None:
    """Write ds/dt of block and shell, K above the room; w: draught, K/s; warmth; the air's recorded temperature."""
    ds[:] = 0.0
    ds[0] = e.heat * u[0] - e.couple * (s[0] - s[1]) + w[0]
    ds[1] = e.shell * (s[0] - s[1]) - e.air * (s[1] - e.seen * w[2])
    if e.glow:
        ds[0] -= e.glow * 1e3 * (((s[0] + 293.0) / 1e3) ** 4 - 0.293**4)
    if e.boil and s[0] > e.boil_at:
        ds[0] -= e.boil


@njit(cache=True)
def heater_see(e: Heater, s: Array, u: Array, w: Array, y: Array) -> None:
    """Write the temperatures of block and shell, K above the room."""
    y[0], y[1] = s[0], s[1]


@njit(cache=True)
def heater_control(e: Heater, y: Array, aim: float, c: Array, u: Array, dt: float) -> None:
    """Hold the block's temperature: proportional and integral."""
    c[0] += 0.03 * (aim - y[0]) * dt
    u[0] += 4.0 * (aim - y[0]) + c[0]
