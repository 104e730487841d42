"""Valves, batteries, belts and kilns, of which models lack a limit, a dead time, the weather or a thermocouple's age.

As sixth_author_turbines.py. With `complete` nothing is hidden, which is a null in sixth_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.signal import cont2discrete
from second_author_parts import Case, Column, equations, flips, plateaus, smooth, state_space
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged, ramps, skewed
from third_author_parts import rk, told


def positioner(rng: np.random.Generator) -> Case:
    """A pneumatic valve in a flow loop and the header behind it (Seborg, Edgar and Mellichamp 2004, chapter 9).

    Hidden: a clogged supply lets the positioner move 2.5 % a second at most. An operator's steps move the loop; the
    pressure before the valve wanders, which nobody records.
    """
    name, rows, step, rate = "valve_positioner", 2400, 0.5, 2.5
    wanted, shake = plateaus(rng, rows, 90, 38, 62), flips(rng, rows, 21, 6.0)
    heard, supply, total = hiss(rng, rows, 0.1), gust(rng, rows, 15, 0.35), [50.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[1] - heard[k]
        total[0] = max(min(total[0] + 0.06 * step * error, 95), 5)
        return max(min(total[0] + 0.35 * error + shake[k], 100), 0), supply[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        move = max(min(8 * (u[0] - x[0]), rate), -rate)
        return move, (1.05 * (x[0] - 50) + 50 + u[1] - x[1]) / 1.6, (0.08 * (x[1] - 50) + 4 - x[2]) / 7

    x, u = rk(slope, [50, 50, 4], rows, step, command, 6)
    true = {"kf": 1.05, "f0": 50.0, "tf": 1.6, "kp": 0.08, "p0": 4.0, "tp": 7.0}
    text = equations("flow loop", declared(rng, true, kf="t/h/%", f0="t/h", tf="s", kp="bar h/t", p0="bar", tp="s"), {
        "f": ("(kf*(valve - 50) + f0 - f)/tf", 50, "t/h"), "p": ("(kp*(f - 50) + p0 - p)/tp", 4, "bar")},
        {"flow": ("f", "t/h"), "header": ("p", "bar")})  # fmt: skip
    columns: dict[str, Column] = {
        "valve": (u[:, 0], "%", "input"),
        "flow": (logged(rng, x[:, 1] + heard, 0.0, ends=(0, 100), bits=13), "t/h", "output"),
        "header": (logged(rng, x[:, 2], 0.02, lag=4, ends=(0, 10), bits=12), "bar", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("rate_limit",), (), {"rate_per_s": rate}, context=LOOP, lost=9,
                true=true)  # fmt: skip


def pack(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A battery on a cooling plate in a climate chamber (Plett 2015, Battery Management Systems), ten seconds a row.

    Hidden: the pack feels the chamber's air, which is recorded; the linear model in discrete time has no way for it.
    The null's model has the way, its recordings a gap; gains are up to 6 % off. Heat that wanders is not recorded.
    """
    name, rows, step = "null_pack" if complete else "pack_ambient", 2200, 10.0
    heat, cool = plateaus(rng, rows, 30, 0, 900), plateaus(rng, rows, 75, -6, 6)
    air = ramps(rng, rows, 120, (-14, 14), 0.25) + smooth(rng, rows, 20, 0.5)
    air = np.round(air - np.mean(air), 2)
    u = np.c_[heat - np.mean(heat), cool, air, gust(rng, rows, 20, 8.0)]
    c, g, h, e = np.array([[2.6e4], [9.0e3], [5.5e3]]), (38.0, 60.0), 120.0, (9.0, 4.0)
    a = np.array([[-g[0] - e[0], g[0], 0], [g[0], -g[0] - g[1], g[1]], [0, g[1], -g[1] - h - e[1]]]) / c
    b = np.array([[1.0, 0, e[0]], [0, 0, 0], [0, h, e[1]]]) / c

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        own = (u[0] + u[3], u[1], u[2])
        return [sum(float(a[i, j]) * x[j] + float(b[i, j]) * own[j] for j in range(3)) for i in range(3)]

    x, _ = rk(slope, [0, 0, 0], rows, step, told(u), 4)
    used, most = (3, 0.06) if complete else (2, 0.04)
    wrong = b[:, :used] * np.array([skewed(rng, 1, most) for _ in range(used)])
    seen = np.eye(3)[[0, 2]]
    discrete = cont2discrete((a, wrong, seen, np.zeros((2, used))), step, "zoh")[:4]
    ways = dict([("heat", "W"), ("coolant", "K"), ("air", "K")][:used]), {"cells": "K", "plate": "K"}
    model = state_space(step, *ways, discrete)
    columns: dict[str, Column] = {
        "heat": (u[:, 0], "W", "input"), "coolant": (cool, "K", "input"), "air": (air, "K", "disturbance"),
        "cells": (logged(rng, x[:, 0], 0.01, ends=(-64, 64), bits=13), "K", "output"),
        "plate": (logged(rng, x[:, 2], 0.02, lag=4, ends=(-64, 64), bits=13), "K", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, model, gap=(400, 430), cuts=(1100,))
    return Case(name, step, columns, model, ("missing_disturbance",), (), lost=6)


def belt(rng: np.random.Generator) -> Case:
    """A mill behind a belt conveyor, its model three transfer functions (Lynch 1977, Mineral Crushing and Grinding).

    Hidden: the ore is 26 s on the belt. Water reaches the mill at once. The model is linear and in discrete time, two
    gains are up to 3 % off; the ore's hardness wanders, which nobody records.
    """
    name, rows, step, late = "belt_mill", 2200, 4.0, 26.0
    gate = plateaus(rng, rows, 28, -14, 14) + flips(rng, rows, 9, 2.5)
    u = np.c_[gate, plateaus(rng, rows, 40, -5, 5), gust(rng, rows, 12, 0.5)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        ore = float(gate[max(int((t - late) / step + 1e-9), 0)])
        return (1.5 * ore + u[2] - x[0]) / 55, (4.0 * x[0] - 3.0 * u[1] - x[1]) / 24

    x, _ = rk(slope, [0, 0], rows, step, told(u), 8)
    a = np.array([[-1 / 55, 0], [4.0 / 24, -1 / 24]])
    b = np.array([[1.5 / 55 * skewed(rng, 1, 0.03), 0], [0, -3.0 / 24 * skewed(rng, 1, 0.03)]])
    discrete = cont2discrete((a, b, np.eye(2), np.zeros((2, 2))), step, "zoh")[:4]
    model = state_space(step, {"gate": "%", "water": "m3/h"}, {"filling": "t", "motor": "kW"}, discrete)
    columns: dict[str, Column] = {
        "gate": (gate, "%", "input"), "water": (u[:, 1], "m3/h", "input"),
        "filling": (logged(rng, x[:, 0], 0.02, ends=(-64, 64), bits=13), "t", "output"),
        "motor": (logged(rng, x[:, 1], 0.02, lag=4, ends=(-256, 256), bits=13), "kW", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("transport_delay",), (), {"delay_s": late}, lost=7)


def kiln(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Two zones of a tunnel kiln with burners (Incropera et al. 2007, chapter 5), twenty seconds a row.

    Hidden: the second zone's thermocouple ages and loses 0.45 mK a second. Ware that is drawn through at another
    temperature is not recorded. The null's thermocouples stay, in one recording with a gap.
    """
    name, rows, step, lost = "null_kiln" if complete else "kiln_thermocouple", 2000, 20.0, -4.5e-4
    u = np.c_[ramps(rng, rows, 60, (35, 75), 1.5), plateaus(rng, rows, 80, 30, 70), gust(rng, rows, 10, 0.5),
              gust(rng, rows, 10, 0.5)]  # fmt: skip

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        flow = 0.09 * (x[0] - x[1])
        return ((0.95 * u[0] - flow - 0.055 * (x[0] - 30) + u[2]) / 95,
                (0.80 * u[1] + flow - 0.060 * (x[1] - 30) + u[3]) / 120)  # fmt: skip

    x, _ = rk(slope, [810, 760], rows, step, told(u), 4)
    true = {"b1": 0.95, "b2": 0.80, "g": 0.09, "h1": 0.055, "h2": 0.060}
    free = declared(rng, true, 0.08, b1="kW/%", b2="kW/%", g="kW/K", h1="kW/K", h2="kW/K")
    values = {"C1": fixed(rng, 95.0, "kJ/K"), "C2": fixed(rng, 120.0, "kJ/K")} | free
    true |= {"C1": 95.0, "C2": 120.0}
    text = equations("kiln", values, {
        "T1": ("(b1*burner1 - g*(T1 - T2) - h1*(T1 - 30))/C1", 810, "degC"),
        "T2": ("(b2*burner2 + g*(T1 - T2) - h2*(T2 - 30))/C2", 760, "degC")},
        {"zone1": ("T1", "degC"), "zone2": ("T2", "degC")})  # fmt: skip
    aged = x[:, 1] + (0.0 if complete else lost) * step * np.arange(rows)
    columns: dict[str, Column] = {
        "burner1": (u[:, 0], "%", "input"), "burner2": (u[:, 1], "%", "input"),
        "zone1": (logged(rng, x[:, 0], 0.01, ends=(0, 1600), bits=14), "degC", "output"),
        "zone2": (logged(rng, aged, 0.01, lag=4, ends=(0, 1600), bits=14), "degC", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, gap=(600, 660), time="time [min]", time_scale=1 / 60, true=true)
    return Case(name, step, columns, text, ("sensor_drift",), (), {"rate_per_s": lost}, time="time [min]",
                time_scale=1 / 60, true=true)  # fmt: skip


PROCESSES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "valve_positioner": (421, positioner), "pack_ambient": (422, pack), "belt_mill": (423, belt),
    "kiln_thermocouple": (424, kiln),
}  # fmt: skip
