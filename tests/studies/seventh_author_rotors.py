"""Spindles, washers, mills, flywheels, extruders: a rub, an unbalance, play, windage or a clock is left out.

Every plant is a function of a random generator that returns its case. With `complete` nothing is hidden, which is a
null in seventh_author_nulls.py. At the recorded inputs, without noise, gusts and logger, an effect of this set changes
an output by a twentieth to a half of its deviation, a reversed sign by two of them. Here, only speeds, currents and, of
the extruder, a pressure are recorded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, pi, sin, tanh

import numpy as np
from scipy.interpolate import CubicSpline
from second_author_parts import Case, Column, equations, flips, known, plateaus
from seventh_author_parts import begun, started
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged
from third_author_parts import rk, told


def tapping(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A spindle that cuts threads and turns both ways, from rest (Altintas 2012, Manufacturing Automation, chapter 5).

    Hidden: belt and seals rub with 0.22 N m. Three recordings of 600 rows begin at rest; the cut is not recorded, the
    loop hears the encoder with noise. The null's model has the rub, its recordings are four of 400 rows.
    """
    name, lengths = ("null_tapping", (400,) * 4) if complete else ("tapping_spindle", (600,) * 3)
    rows, step, rub = sum(lengths), 0.02, 0.22
    wanted, shake = plateaus(rng, rows, 75, -60, 60), flips(rng, rows, 6, 0.5)
    heard, cut = hiss(rng, rows, 0.15), gust(rng, rows, 8, 0.03)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        return max(min(0.09 * error + x[1] + shake[k], 12), -12), cut[k], error

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (0.85 * u[0] + u[1] - 0.022 * x[0] - rub * tanh(x[0] / 0.4)) / 0.042, 0.06 * u[2]

    x, u = started(slope, [0, 0], lengths, step, command, 10)
    true = {"Js": 0.042, "kt": 0.85, "bs": 0.022} | ({"tc": rub} if complete else {})
    values = {"Js": fixed(rng, 0.042, "kg m2", 0.02), "kt": known(0.85, "N m/A")} | declared(
        rng, {k: true[k] for k in ("bs", "tc") if k in true}, bs="N m s", tc="N m")  # fmt: skip
    more = " - tc*tanh(w/0.4)" if complete else ""
    text = equations("spindle", values, {"w": (f"(kt*current - bs*w{more})/Js", 0, "rad/s")},
                     {"speed": ("w*30/pi", "rpm")})  # fmt: skip
    columns: dict[str, Column] = {
        "current": (np.round(u[:, 0], 3), "A", "input"),
        "speed": (logged(rng, (x[:, 0] + heard) * 30 / pi, 0.0, ends=(-1e3, 1e3), bits=13), "rpm",
                  "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, context=LOOP, cuts=begun(lengths), true=true)
    return Case(name, step, columns, text, ("coulomb_friction",), ("stiction",), {}, context=LOOP, cuts=begun(lengths),
                true=true)  # fmt: skip


def washer(rng: np.random.Generator) -> Case:
    """A front loader that spreads its laundry over the drum (Boyraz and Gündüz 2013, Mechatronics 23).

    Hidden: 0.25 kg lie on one side at 0.24 m, whose weight turns the drum with 0.45 and -0.38 N m of cosine and sine of
    its angle. Two recordings; the loop hears the tacho with noise, tumbling laundry is not recorded.
    """
    name, rows, step, even, odd = "washer_load", 1800, 0.02, 0.45, -0.38
    wanted, shake = plateaus(rng, rows, 170, 8.4, 11.4), flips(rng, rows, 14, 0.22)
    heard, tumble = hiss(rng, rows, 0.02), gust(rng, rows, 6, 0.08)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        return 0.42 * error + x[2] + shake[k], tumble[k], error

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        weight = even * cos(x[1]) + odd * sin(x[1])
        return (1.9 * u[0] + u[1] + weight - 0.085 * x[0]) / 0.38, x[0], 0.2 * u[2]

    x, u = rk(slope, [9.5, float(rng.uniform(0, 6)), 0.42], rows, step, command, 8)
    true = {"Jd": 0.38, "kt": 1.9, "bd": 0.085}
    free = declared(rng, {k: true[k] for k in ("kt", "bd")}, kt="N m/A", bd="N m s")
    text = equations("drum", {"Jd": fixed(rng, 0.38, "kg m2", 0.02)} | free, {
        "w": ("(kt*current - bd*w)/Jd", 9.5, "rad/s")}, {"drum_speed": ("w", "rad/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "current": (np.round(u[:, 0], 3), "A", "input"),
        "drum_angle": (np.round(np.degrees(x[:, 1]) % 360, 1), "deg", "azimuth"),
        "drum_speed": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 16), bits=12), "rad/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("gravity_1p",), (), {"torque_N_m_cos": even, "torque_N_m_sin": odd},
                context="rated_speed_rad_s = 9.9\n" + LOOP, cuts=(900,), true=true)  # fmt: skip


def reversing(rng: np.random.Generator) -> Case:
    """The drive of a reversing mill: motor, spindle and rolls (Roberts 1983, Flat Processing of Steel, chapter 4).

    Hidden: worn wobblers leave 14 mrad of play to either side, within which neither spring nor damper act. The torque
    is held between rows, the speed loop hears the motor with noise; the slab between the rolls is not recorded.
    """
    name, rows, step, gap, spring, damper = "mill_spindle", 2400, 0.01, 0.014, 900.0, 2.6
    wanted, shake = plateaus(rng, rows, 160, -6, 6), flips(rng, rows, 11, 5.0)
    heard, slab = hiss(rng, rows, 0.01), gust(rng, rows, 12, 0.3)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return max(min(11 * (wanted[k] - x[0] - heard[k]) + 0.95 * wanted[k] + shake[k], 40), -40), slab[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        over = x[2] - max(min(x[2], gap), -gap)
        through = spring * over + (damper * (x[0] - x[1]) if over else 0.0)
        return (u[0] - through) / 4.2, (through - 0.95 * x[1] + u[1]) / 1.5, x[0] - x[1]

    x, u = rk(slope, [0, 0, 0], rows, step, command, 16)
    true = {"Jm": 4.2, "Jr": 1.5, "kc": spring, "cc": damper, "br": 0.95}
    free = declared(rng, {k: true[k] for k in ("kc", "cc", "br")}, kc="kN m/rad", cc="kN m s", br="kN m s")
    through = "(kc*twist + cc*(wm - wr))"
    values = {"Jm": fixed(rng, 4.2, "1000 kg m2", 0.02), "Jr": fixed(rng, 1.5, "1000 kg m2", 0.02)} | free
    text = equations("mill drive", values, {
        "wm": (f"(torque - {through})/Jm", 0, "rad/s"), "wr": (f"({through} - br*wr)/Jr", 0, "rad/s"),
        "twist": ("wm - wr", 0, "rad")},
        {"motor_speed": ("wm", "rad/s"), "roll_speed": ("wr", "rad/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "torque": (np.round(u[:, 0], 3), "kN m", "input"),
        "motor_speed": (logged(rng, x[:, 0] + heard, 0.0, ends=(-10, 10), bits=14), "rad/s", "output"),
        "roll_speed": (logged(rng, x[:, 1], 0.006, lag=2, ends=(-10, 10), bits=13), "rad/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("clearance",), (), {"half_gap": gap}, context=LOOP, cuts=(800, 1600),
                true=true)  # fmt: skip


def store(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A flywheel that stores energy in air, charged from rest (Genta 1985, Kinetic Energy Storage, chapter 4).

    Hidden: windage, 8e-6 N m/(rad/s)2 beside the bearings' drag. Three recordings of 500 rows begin at rest, the
    supply's droop is not recorded. The null's model has the windage, but a moment of inertia off an old drawing that is
    24 % too small and not fitted.
    """
    name, lengths, step, air = "null_flywheel" if complete else "flywheel_windage", (500,) * 3, 1.0, 8e-6
    rows = sum(lengths)
    level = plateaus(rng, rows, 60, -2.5, 5.5) + flips(rng, rows, 12, 0.6)
    droop = gust(rng, rows, 10, 0.06)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        asked = level[k] + 2.5 * (k % 500 < 90)
        return max(asked, 0.0) if x[0] < 60 else min(asked, 0.02 * (330 - x[0]) + 2), droop[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return ((0.62 * u[0] + u[1] - 1.6e-3 * x[0] - air * x[0] * abs(x[0])) / 2.4,)

    x, u = started(slope, [0], lengths, step, command, 4)
    true = {"Jf": 2.4, "kt": 0.62, "bf": 1.6} | ({"ca": 8.0} if complete else {})
    wheel = known(round(0.76 * 2.4, 3), "kg m2") if complete else fixed(rng, 2.4, "kg m2", 0.02)
    values = {"Jf": wheel, "kt": known(0.62, "N m/A")} | declared(
        rng, {k: true[k] for k in ("bf", "ca") if k in true}, 0.08, bf="1e-3 N m s", ca="1e-6 N m s2")  # fmt: skip
    more = " - ca/1000000*w*abs(w)" if complete else ""
    text = equations("flywheel store", values, {"w": (f"(kt*current - bf/1000*w{more})/Jf", 0, "rad/s")},
                     {"speed": ("w*30/pi", "rpm")})  # fmt: skip
    columns: dict[str, Column] = {
        "current": (np.round(u[:, 0], 2), "A", "input"),
        "speed": (logged(rng, x[:, 0] * 30 / pi, 0.004, lag=3, ends=(-500, 5e3), bits=14), "rpm",
                  "output")}  # fmt: skip
    right = ("parameter_error",) if complete else ("quadratic_damping",)
    return Case(name, step, columns, text, right, (), {} if complete else {"c2": air}, cuts=begun(lengths), true=true)


def extruder(rng: np.random.Generator) -> Case:
    """Screw and head of an extruder (Rauwendaal 2014, Polymer Extrusion, chapter 7; viscosity by a power law).

    The fault: melt pressure comes from another logger whose clock is 0.4 s late. Speed and current are from the drive;
    the melt's viscosity wanders, which nobody records.
    """
    name, rows, step, late = "extruder_clock", 1500, 0.1, 0.4
    u = np.c_[plateaus(rng, rows, 40, 35, 75) + flips(rng, rows, 9, 4.0), gust(rng, rows, 25, 0.8)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        load = 5.5 * x[0] + 0.22 * x[1]
        flow = 0.52 * x[0] - 0.012 * x[1]
        return (1.9 * u[0] + u[1] - load) / 6.0, (flow - 0.9e-3 * max(x[1], 0) ** 1.6) / 0.016

    x, _ = rk(slope, [15, 100], rows, step, told(u), 10)
    true = {"Js": 6.0, "kt": 1.9, "bs": 5.5, "kp": 0.22, "qd": 0.52, "ql": 0.012, "kh": 0.9, "ch": 16.0}
    units = {"bs": "N m s", "kp": "N m/bar", "qd": "cm3", "ql": "cm3/s/bar", "ch": "1e-3 cm3/bar"}
    free = declared(rng, {k: true[k] for k in ("bs", "kp", "qd", "kh", "ch")}, 0.06, **units)
    values = {"Js": fixed(rng, 6.0, "kg m2"), "kt": known(1.9, "N m/A"), "ql": fixed(rng, 0.012, "cm3/s/bar")} | free
    text = equations("extruder", values, {
        "w": ("(kt*current - bs*w - kp*p)/Js", 15, "rad/s"),
        "p": ("(qd*w - ql*p - kh/1000*max(p, 0)**1.6)/(ch/1000)", 100, "bar")},
        {"screw_speed": ("w", "rad/s"), "melt_pressure": ("p", "bar")})  # fmt: skip
    rows_at = np.arange(rows)
    shown = CubicSpline(rows_at, x[:, 1])(np.maximum(rows_at - late / step, 0))
    columns: dict[str, Column] = {
        "current": (np.round(u[:, 0], 2), "A", "input"),
        "screw_speed": (logged(rng, x[:, 0], 0.01, ends=(0, 32), bits=13), "rad/s", "output"),
        "melt_pressure": (logged(rng, shown, 0.015, lag=3, ends=(0, 512), bits=13), "bar", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("data_time_offset",), ("sensor_second_order",), {"offset_s": late}, lost=6,
                true=true)  # fmt: skip


ROTORS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "tapping_spindle": (501, tapping), "washer_load": (502, washer), "mill_spindle": (503, reversing),
    "flywheel_windage": (504, store), "extruder_clock": (505, extruder),
}  # fmt: skip
