"""Axes, buoys and mixers with two effects at once; cylinders, muscles and valves with physics that no entry has.

As sixth_author_turbines.py. With `complete` nothing is hidden, which is a null in sixth_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp, sqrt, tanh

import numpy as np
from second_author_parts import Case, Column, Tones, equations, flips, known, plateaus
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged, ramps
from third_author_parts import looked_up, rk, told


def screw(rng: np.random.Generator) -> Case:
    """A ball screw and its carriage in a position loop (Altintas 2012, Manufacturing Automation, chapter 5).

    Hidden: 40 N of dry friction in the guides, and the drive's force follows with 25 ms. Speed and position are read;
    the process pushes a little, which nobody records.
    """
    name, rows, step, rub, tau = "screw_axis", 3600, 0.005, 40.0, 0.025
    wanted, shake = ramps(rng, rows, 170, (-0.12, 0.12), 9e-4), flips(rng, rows, 9, 1.6)
    heard, cut = hiss(rng, rows, 5e-4), gust(rng, rows, 10, 6.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        asked = 55 * (9 * (wanted[k] - x[0]) - x[1] - heard[k]) + shake[k]
        return max(min(asked, 25), -25), cut[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (44 * x[2] + u[1] - 900 * x[1] - rub * tanh(x[1] / 1.5e-3)) / 205, (u[0] - x[2]) / tau

    x, u = rk(slope, [float(wanted[0]), 0, 0], rows, step, command, 6)
    true = {"mc": 205.0, "bv": 900.0, "kt": 44.0}
    values = {"mc": fixed(rng, 205.0, "kg", 0.02), "kt": known(44.0, "N/A")} | declared(
        rng, {"bv": 900.0}, bv="N s/m")  # fmt: skip
    text = equations("ball screw", values, {
        "q": ("v", float(wanted[0]), "m"), "v": ("(kt*current - bv*v)/mc", 0, "m/s")},
        {"place": ("1000*q", "mm"), "speed": ("1000*v", "mm/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "current": (u[:, 0], "A", "input"),
        "place": (logged(rng, 1e3 * x[:, 0], 2e-4, ends=(-256, 256), bits=16), "mm", "output"),
        "speed": (logged(rng, 1e3 * (x[:, 1] + heard), 0.0, ends=(-400, 400), bits=15), "mm/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("coulomb_friction", "actuator_lag"), (),
                {"force_N": rub, "tau_s": tau}, context=LOOP, true=true)  # fmt: skip


def buoy(rng: np.random.Generator) -> Case:
    """A wave power buoy that its generator heaves in calm water (Falnes 2002, Ocean Waves and Oscillating Systems).

    Hidden: 300 N/(m/s)2 of drag, and a mooring that stiffens with 3 kN/m3. The generator's force is recorded, small
    waves are not; the mass with the water that moves along is off a tank test and not fitted.
    """
    name, rows, step, fine, drag, bent = "heaving_buoy", 2800, 0.1, 6, 300.0, 3000.0
    push = Tones.drawn(rng, 0.1, 1.1, 44, 2100, 0.0)
    force, waves = looked_up(push, rows, step, fine), gust(rng, rows, 8, 90.0)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        own = drag * x[1] * abs(x[1]) + bent * x[0] ** 3
        return x[1], (force(t) + u[0] - 7200 * x[0] - 650 * x[1] - own) / 980

    x, _ = rk(slope, [0, 0], rows, step, told(waves), fine)
    true = {"mb": 980.0, "kb": 7.2, "cb": 0.65}
    free = declared(rng, {k: true[k] for k in ("kb", "cb")}, kb="kN/m", cb="kN s/m")
    text = equations("buoy", {"mb": fixed(rng, 980.0, "kg")} | free, {
        "q": ("v", 0, "m"), "v": ("(generator - 1000*kb*q - 1000*cb*v)/mb", 0, "m/s")},
        {"heave": ("q", "m"), "heave_speed": ("v", "m/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "generator": (push(np.arange(rows) * step), "N", "input"),
        "heave": (logged(rng, x[:, 0], 0.01, ends=(-4, 4), bits=14), "m", "output"),
        "heave_speed": (logged(rng, x[:, 1], 0.02, lag=4, ends=(-8, 8), bits=13), "m/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("quadratic_damping", "cubic_stiffness"), (), {"c2": drag, "k3": bent},
                cuts=(1400,), true=true)  # fmt: skip


def mixer(rng: np.random.Generator) -> Case:
    """A stirred vessel that live steam warms, its draw read in a thermowell (Shinskey 1996, Process Control Systems).

    Hidden: the steam comes 12 s late through its line, and the thermowell of the draw follows with 25 s. The vessel's
    own sensor is quick; the feed is recorded, its temperature wanders, which is not.
    """
    name, rows, step, late, tau = "steam_mixer", 2200, 3.0, 12.0, 25.0
    steam = plateaus(rng, rows, 26, 30, 70) + flips(rng, rows, 9, 4.0)
    u = np.c_[steam, plateaus(rng, rows, 50, 1.4, 2.2), gust(rng, rows, 12, 4.0)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        given = float(steam[max(int((t - late) / step + 1e-9), 0)])
        return ((4.4 * given - 4.18 * u[1] * (x[0] - 18) + u[2]) / 520, (x[0] - x[1]) / 14, (x[1] - x[2]) / tau)

    x, _ = rk(slope, [47, 47, 47], rows, step, told(u), 6)
    true = {"ks": 4.4, "Cv": 520.0, "td": 14.0}
    values = {"td": fixed(rng, 14.0, "s")} | declared(
        rng, {"ks": 4.4, "Cv": 520.0}, 0.08, ks="kW/%", Cv="kJ/K")  # fmt: skip
    text = equations("steam mixer", values, {
        "Tv": ("(ks*steam - 4.18*feed*(Tv - 18))/Cv", 47, "degC"), "Td": ("(Tv - Td)/td", 47, "degC")},
        {"vessel": ("Tv", "degC"), "draw": ("Td", "degC")})  # fmt: skip
    columns: dict[str, Column] = {
        "steam": (steam, "%", "input"), "feed": (u[:, 1], "kg/s", "input"),
        "vessel": (logged(rng, x[:, 0], 0.015, ends=(0, 128), bits=13), "degC", "output"),
        "draw": (logged(rng, x[:, 2], 0.015, lag=4, ends=(0, 128), bits=13), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("transport_delay", "sensor_lag"), (), {"delay_s": late, "tau_s": tau},
                lost=8, true=true)  # fmt: skip


def rod(rng: np.random.Generator) -> Case:
    """A press table on a cylinder with one rod (Merritt 1967, Hydraulic Control Systems, chapter 6), no entry.

    Not in the model: the sides of the piston differ, so that a per cent of the valve moves it 34 % less one way. Leaks
    bring the table back; loads that wander are not recorded.
    """
    name, rows, step = "single_rod", 2600, 0.02
    u = np.c_[plateaus(rng, rows, 60, -42, 42) + flips(rng, rows, 9, 12.0), gust(rng, rows, 10, 1.2)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        flow = (5.2 if u[0] > 0 else 3.45) * u[0]
        return x[1] - 1.1 * x[0], (flow + u[1] - x[1]) / 0.06

    x, _ = rk(slope, [0, 0], rows, step, told(u), 6)
    true = {"kq": 4.3, "tv": 0.06, "lk": 1.1}
    text = equations("press table", declared(rng, true, kq="mm/s/%", tv="s", lk="1/s"), {
        "q": ("f - lk*q", 0, "mm"), "f": ("(kq*valve - f)/tv", 0, "mm/s")},
        {"place": ("q", "mm"), "speed": ("f - lk*q", "mm/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "valve": (u[:, 0], "%", "input"),
        "place": (logged(rng, x[:, 0], 0.01, ends=(-400, 400), bits=14), "mm", "output"),
        "speed": (logged(rng, x[:, 1] - 1.1 * x[:, 0], 0.03, lag=3, ends=(-800, 800), bits=13), "mm/s",
                  "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, lost=9, true=true)


def muscle(rng: np.random.Generator) -> Case:
    """A robot's joint between two pneumatic muscles (Chou and Hannaford 1996, IEEE Trans. Robot. Autom. 12), no entry.

    Not in the model: both pressures together stiffen the joint; its spring is that of their mean. In three short
    recordings; touches of a person are not recorded.
    """
    name, rows, step = "muscle_joint", 2700, 0.01
    both, turn = ramps(rng, rows, 90, (2.2, 6.2), 0.06), flips(rng, rows, 16, 0.4) + plateaus(rng, rows, 45, -0.7, 0.7)
    u = np.c_[both + turn, both - turn, gust(rng, rows, 8, 0.12)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        pull = 4.6 * (u[0] - u[1]) - 1.7 * (u[0] + u[1]) * x[0]
        return x[1], (pull - 0.75 * x[1] + u[2]) / 0.075

    x, _ = rk(slope, [0, 0], rows, step, told(u), 6)
    true = {"Jm": 0.075, "kp": 4.6, "km": 14.3, "bm": 0.75}
    free = declared(rng, {k: true[k] for k in ("kp", "km", "bm")}, kp="N m/bar", km="N m/rad", bm="N m s")
    text = equations("joint", {"Jm": fixed(rng, 0.075, "kg m2", 0.02)} | free, {
        "a": ("w", 0, "rad"), "w": ("(kp*(flexor - extensor) - km*a - bm*w)/Jm", 0, "rad/s")},
        {"angle": ("a*180/pi", "deg"), "rate": ("w*180/pi", "deg/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "flexor": (u[:, 0], "bar", "input"), "extensor": (u[:, 1], "bar", "input"),
        "angle": (logged(rng, np.degrees(x[:, 0]), 0.01, ends=(-128, 128), bits=13), "deg", "output"),
        "rate": (logged(rng, np.degrees(x[:, 1]), 0.02, lag=3, ends=(-800, 800), bits=13), "deg/s",
                 "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, cuts=(900, 1800), true=true)


def trim(rng: np.random.Generator) -> Case:
    """A vessel that a valve of equal percentage fills (Seborg, Edgar and Mellichamp 2004, chapter 9), no entry.

    Not in the model: each per cent of the stroke lets 3.7 % more flow, not so much more; the model has the slope at the
    middle. The pressure before the valve wanders, which nobody records.
    """
    name, rows, step = "trim_valve", 2200, 2.0
    u = np.c_[plateaus(rng, rows, 35, 33, 66) + flips(rng, rows, 9, 2.5), gust(rng, rows, 15, 0.08)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (6 * exp(0.037 * (u[0] - 50)) + u[1] - x[0]) / 5, (x[0] - 4.7 * sqrt(max(x[1], 0))) / 95

    x, _ = rk(slope, [6, 1.6], rows, step, told(u), 4)
    true = {"f0": 6.0, "kf": 0.222, "tf": 5.0, "ao": 4.7, "Av": 95.0}
    text = equations("vessel", declared(rng, true, 0.08, f0="l/s", kf="l/s/%", tf="s", Av="dm2"), {
        "f": ("(f0 + kf*(valve - 50) - f)/tf", 6, "l/s"), "h": ("(f - ao*sqrt(max(h, 0)))/Av", 1.6, "dm")},
        {"inflow": ("f", "l/s"), "level": ("h", "dm")})  # fmt: skip
    columns: dict[str, Column] = {
        "valve": (u[:, 0], "%", "input"),
        "inflow": (logged(rng, x[:, 0], 0.015, ends=(0, 20), bits=13), "l/s", "output"),
        "level": (logged(rng, x[:, 1], 0.01, lag=5, ends=(0, 10), bits=13), "dm", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, time="time [min]", time_scale=1 / 60, true=true)


PAIRS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "screw_axis": (425, screw), "heaving_buoy": (426, buoy), "steam_mixer": (427, mixer),
    "single_rod": (428, rod), "muscle_joint": (429, muscle), "trim_valve": (430, trim),
}  # fmt: skip
