"""Shunts, sumps, receivers, drums and presses, of which play, a brim, coarse levels, an offset or laps are left out.

As seventh_author_rotors.py. With `complete` nothing is hidden, which is a null in seventh_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import sqrt

import numpy as np
from second_author_parts import Case, Column, equations, flips, known, plateaus, smooth
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged
from third_author_parts import rk, told


def shunt(rng: np.random.Generator) -> Case:
    """A heating circuit behind a valve with three ways, in its loop (Petitjean 1994, Total Hydronic Balancing).

    Hidden: the linkage between motor and valve has 4 % of play. The primary's temperature is recorded, what the rooms
    draw besides is not; the loop hears the flow's thermometer, whose pocket the model has.
    """
    name, rows, step, play, place, total = "shunt_linkage", 1200, 5.0, 4.0, [42.0], [40.0]
    wanted, primary = plateaus(rng, rows, 110, 48, 57), 75 + smooth(rng, rows, 60, 1.5)
    heard, rooms, shake = hiss(rng, rows, 0.06), gust(rng, rows, 25, 1.0), flips(rng, rows, 21, 3.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        total[0] += 0.028 * step * error
        asked = max(min(total[0] + 1.3 * error + shake[k], 100), 0)
        place[0] = min(max(place[0], asked - play / 2), asked + play / 2)
        return asked, place[0], primary[k], rooms[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        mixed = x[1] + u[1] / 100 * (u[2] - x[1])
        return (mixed - x[0]) / 9, (4.6 * (mixed - x[1]) - 1.9 * (x[1] - 6) - u[3]) / 900

    x, u = rk(slope, [53, 39], rows, step, command, 8)
    true = {"tp": 9.0, "mc": 4.6, "ua": 1.9, "Cr": 900.0}
    values = {"Cr": fixed(rng, 900.0, "kJ/K")} | declared(
        rng, {k: true[k] for k in ("tp", "mc", "ua")}, 0.08, tp="s", mc="kW/K", ua="kW/K")  # fmt: skip
    mixed = "(tr + valve/100*(primary - tr))"
    text = equations("shunt", values, {
        "tf": (f"({mixed} - tf)/tp", 53, "degC"),
        "tr": (f"(mc*({mixed} - tr) - ua*(tr - 6))/Cr", 39, "degC")},
        {"flow_temp": ("tf", "degC"), "return_temp": ("tr", "degC")})  # fmt: skip
    columns: dict[str, Column] = {
        "valve": (np.round(u[:, 0], 1), "%", "input"), "primary": (np.round(primary, 1), "degC", "disturbance"),
        "flow_temp": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 128), bits=13), "degC", "output"),
        "return_temp": (logged(rng, x[:, 1], 0.02, lag=4, ends=(0, 128), bits=13), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("backlash",), (), {"width": play}, context=LOOP, lost=6,
                time="time [min]", time_scale=1 / 60, true=true)  # fmt: skip


def sump(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """The sump of a scrubber with a drain and a pump (Coulson and Richardson 1999, Chemical Engineering 1).

    Hidden: above 1.75 m it runs over into the sewer within 20 s. Inflow and pump are recorded, what the gas carries off
    is not; the drain's flow is read, too. The null's sump is deep, but its area is off a drawing of the one before, 21
    % too small, and not fitted.
    """
    name, rows, step, brim = "null_sump" if complete else "sump_brim", 900, 10.0, 1.75
    u = np.c_[plateaus(rng, rows, 32, 2.1, 4.1), plateaus(rng, rows, 45, 0.2, 1.0), gust(rng, rows, 12, 0.05)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        spill = max(x[0] - brim, 0) / 20 * (not complete)
        return ((u[0] - u[1] + u[2] - 2.2 * sqrt(max(x[0], 0))) / 480 - spill,)

    x, _ = rk(slope, [1.4], rows, step, told(u), 6)
    drain = 2.2 * np.sqrt(x[:, 0])
    true = {"As": 0.48, "kd": 2.2}
    area = known(0.38, "m2") if complete else fixed(rng, 0.48, "m2")
    text = equations("sump", {"As": area} | declared(rng, {"kd": 2.2}, kd="l/s"), {
        "h": ("(inflow - pump - kd*sqrt(max(h, 0)))/(1000*As)", 1.4, "m")},
        {"level": ("h", "m"), "drain": ("kd*sqrt(max(h, 0))", "l/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "inflow": (np.round(u[:, 0], 2), "l/s", "input"), "pump": (np.round(u[:, 1], 2), "l/s", "input"),
        "level": (logged(rng, x[:, 0], 0.015, lag=4, ends=(0, 3), bits=12), "m", "output"),
        "drain": (logged(rng, drain, 0.03, ends=(0, 8), bits=12), "l/s", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, ("parameter_error",), cuts=(450,), true=true)
    return Case(name, step, columns, text, ("overflow",), (), {"brim_level": brim}, cuts=(450,), true=true)


def receiver(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A compressor's receiver and the net behind a filter (Barber 1997, Pneumatic Handbook; ideal gas, isothermal).

    The fault: the receiver's gauge shows steps of 0.25 bar only. Compressor and draw are recorded, leaks that wander
    are not. The null's gauge is fine, in three recordings with a jittering clock.
    """
    name, rows, step = "null_receiver" if complete else "receiver_steps", 750, 2.0
    u = np.c_[plateaus(rng, rows, 30, 50, 78), plateaus(rng, rows, 22, 38, 57), gust(rng, rows, 10, 0.6)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        through = 170 * (x[0] - x[1])
        return (1.45 * u[0] - through - 3.5 * x[0] + u[2]) / 380, (through - 0.21 * u[1] * x[1]) / 140

    x, _ = rk(slope, [7, 6.6], rows, step, told(u), 24)
    true = {"kc": 1.45, "gf": 170.0, "lk": 3.5, "kd": 0.21, "V1": 380.0, "V2": 140.0}
    values = {"V1": fixed(rng, 380.0, "l/bar"), "V2": fixed(rng, 140.0, "l/bar")} | declared(
        rng, {k: true[k] for k in ("kc", "gf", "lk", "kd")}, 0.06, kc="l/s/%", gf="l/s/bar", lk="l/s/bar")  # fmt: skip
    text = equations("air net", values, {
        "p1": ("(kc*compressor - gf*(p1 - p2) - lk*p1)/V1", 7, "bar"),
        "p2": ("(gf*(p1 - p2) - kd*draw*p2)/V2", 6.6, "bar")},
        {"receiver": ("p1", "bar"), "net": ("p2", "bar")})  # fmt: skip
    shown = logged(rng, x[:, 0], 0.01, lag=3, jitter=0.02)
    shown = np.round(shown, 3) if complete else np.round(shown / 0.25) * 0.25
    columns: dict[str, Column] = {
        "compressor": (np.round(u[:, 0], 1), "%", "input"), "draw": (np.round(u[:, 1], 1), "%", "disturbance"),
        "receiver": (shown, "bar", "output"),
        "net": (logged(rng, x[:, 1], 0.015, ends=(0, 16), bits=12, jitter=0.02), "bar", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, cuts=(250, 500), true=true)
    return Case(name, step, columns, text, ("sensor_quantisation",), (), {}, cuts=(250, 500), true=true)


def drum(rng: np.random.Generator) -> Case:
    """A flash drum whose level a valve holds (Luyben 1990, Process Modeling, Simulation and Control, chapter 3).

    The fault: the outlet's meter reads 0.15 l/s too much, which the level contradicts. The feed is recorded, the vapour
    that leaves is not; the loop hears the level with noise.
    """
    name, rows, step, bias, total = "flash_meter", 800, 4.0, 0.15, [50.0]
    feed = plateaus(rng, rows, 45, 3.2, 4.8)
    wanted, shake = plateaus(rng, rows, 120, 1.0, 1.5), flips(rng, rows, 12, 4.0)
    heard, vapour = hiss(rng, rows, 0.004), gust(rng, rows, 15, 0.04)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - wanted[k]
        total[0] = max(min(total[0] + 0.25 * step * error, 90), 10)
        return max(min(total[0] + 45 * error + shake[k], 100), 0), feed[k], vapour[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return ((u[1] - u[2] - 0.072 * u[0] * sqrt(max(x[0], 0))) / 260,)

    x, u = rk(slope, [1.2], rows, step, command, 6)
    outlet = 0.072 * u[:, 0] * np.sqrt(x[:, 0])
    true = {"Ad": 0.26, "cv": 72.0}
    values = {"Ad": fixed(rng, 0.26, "m2")} | declared(rng, {"cv": 72.0}, cv="1e-3 l/s/%")
    text = equations("flash drum", values, {
        "h": ("(feed - cv/1000*valve*sqrt(max(h, 0)))/(1000*Ad)", 1.2, "m")},
        {"level": ("h", "m"), "outlet": ("cv/1000*valve*sqrt(max(h, 0))", "l/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "valve": (np.round(u[:, 0], 2), "%", "input"), "feed": (np.round(feed, 2), "l/s", "disturbance"),
        "level": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 3), bits=12), "m", "output"),
        "outlet": (logged(rng, outlet + bias, 0.03, lag=3, ends=(0, 10), bits=12), "l/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_bias",), (), {"bias": bias}, context=LOOP, lost=5, true=true)


def press(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A blanking press's cushion on a valve and a cylinder (Merritt 1967, Hydraulic Control Systems, chapter 6).

    Hidden: the spool covers its ports by 2 % to either side, and the stroke's transducer reads 9 % too little, which
    the flow meter contradicts. Sheets that push are not recorded; the null's model has the laps, its stroke is right.
    """
    name, rows, step, lap = "null_cushion" if complete else "cushion_press", 1500, 0.02, 2.0
    factor = 1.0 if complete else 0.91
    wanted, shake = plateaus(rng, rows, 100, -55, 55), flips(rng, rows, 14, 9.0)
    heard, sheet = hiss(rng, rows, 0.08), gust(rng, rows, 9, 2.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return max(min(0.9 * (wanted[k] - factor * x[0] - heard[k]) + 0.25 * wanted[k] + shake[k], 60), -60), sheet[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        opened = u[0] - max(min(u[0], lap), -lap)
        return x[1] - 1.2 * x[0] + u[1], (5.5 * opened - x[1]) / 0.05

    x, u = rk(slope, [0, 0], rows, step, command, 8)
    true = {"kq": 5.5, "tv": 0.05, "lk": 1.2} | ({"lap": lap} if complete else {})
    units = {"kq": "mm/s/%", "tv": "s", "lk": "1/s", "lap": "%"}
    opened = "(valve - max(min(valve, lap), -lap))" if complete else "valve"
    text = equations("cushion", declared(rng, true, 0.06, **units), {
        "q": ("f - lk*q", 0, "mm"), "f": (f"(kq*{opened} - f)/tv", 0, "mm/s")},
        {"stroke": ("q", "mm"), "speed": ("f - lk*q", "mm/s"), "oil": ("f", "mm/s")})  # fmt: skip
    speed = x[:, 1] - 1.2 * x[:, 0] + u[:, 1]
    columns: dict[str, Column] = {
        "valve": (np.round(u[:, 0], 2), "%", "input"),
        "stroke": (logged(rng, factor * x[:, 0] + heard, 0.0, ends=(-128, 128), bits=14), "mm", "output"),
        "speed": (logged(rng, speed, 0.02, lag=3, ends=(-500, 500), bits=13), "mm/s", "output"),
        "oil": (logged(rng, x[:, 1], 0.02, ends=(-500, 500), bits=13), "mm/s", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, context=LOOP, cuts=(500, 1000), true=true)
    return Case(name, step, columns, text, ("deadband", "sensor_scale"), (), {"width": lap, "factor": factor},
                context=LOOP, cuts=(500, 1000), true=true)  # fmt: skip


FLOWS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "shunt_linkage": (510, shunt), "sump_brim": (511, sump), "receiver_steps": (512, receiver),
    "flash_meter": (513, drum), "cushion_press": (523, press),
}  # fmt: skip
