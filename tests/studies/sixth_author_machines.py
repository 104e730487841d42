"""Valves, arms, steering, bearings, spindles and tables; a rub, a lag, a spring, a mode or a sensor's fault is hidden.

As sixth_author_turbines.py. With `complete` nothing is hidden, which is a null in sixth_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp, pi

import numpy as np
from second_author_parts import Case, Column, Tones, equations, flips, plateaus, state_space
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged, modes, ramps, skewed, slopes, sweep, tabled
from third_author_parts import looked_up, rk, told


def spool(rng: np.random.Generator) -> Case:
    """A spool in dirty oil that a proportional magnet pushes against a spring (Merritt 1967; Canudas de Wit 1995).

    Hidden: 3.5 N of friction in motion and 3.5 N more at rest, which dies away over 20 mm/s, on bristles that give
    0.03 mm. An operator's ramps and a small dither make the current; the flow's force that wanders is not recorded.
    """
    name, rows, step, fine = "spool_sticks", 3600, 0.005, 20
    u = np.c_[ramps(rng, rows, 70, (0.25, 1.75), 0.02) + flips(rng, rows, 7, 0.05), gust(rng, rows, 12, 0.4)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        most = 3.5 + 3.5 * exp(-((x[1] / 0.02) ** 2))
        bend = x[1] - 2.2e5 * abs(x[1]) / most * x[2]
        rub = 2.2e5 * x[2] + 150 * bend
        return x[1], (60 * u[0] + u[1] - 9000 * x[0] - 110 * x[1] - rub) / 1.4, bend

    first = 60 * float(u[0, 0]) / 9000
    x, _ = rk(slope, [first, 0, 0], rows, step, told(u), fine)
    true = {"mv": 1.4, "kf": 60.0, "ks": 9.0, "cv": 110.0}
    free = declared(rng, {k: true[k] for k in ("kf", "ks", "cv")}, kf="N/A", ks="N/mm", cv="N s/m")
    text = equations("spool", {"mv": fixed(rng, 1.4, "kg")} | free, {
        "q": ("v", first, "m"), "v": ("(kf*current - 1000*ks*q - cv*v)/mv", 0, "m/s")},
        {"stroke": ("1000*q", "mm"), "speed": ("v", "m/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "current": (u[:, 0], "A", "input"),
        "stroke": (logged(rng, 1e3 * x[:, 0], 0.004, ends=(-2, 16), bits=14), "mm", "output"),
        "speed": (logged(rng, x[:, 1], 0.03, lag=3, ends=(-1, 1), bits=13), "m/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("stiction",), ("coulomb_friction",), {}, true=true)


def arm(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """An arm of a quadrotor on a hinge, held by its controller (Mahony, Kumar and Corke 2012, IEEE RAM 19).

    Hidden: the propellers' thrust follows the demand with 60 ms. Draughts in the hall are not recorded. The null's
    model has the lag as a state.
    """
    name, rows, step, tau = "null_arm" if complete else "rotor_arm", 3000, 0.01, 0.06
    wanted, shake = plateaus(rng, rows, 140, -0.25, 0.25), flips(rng, rows, 9, 0.35)
    heard, air = hiss(rng, rows, 0.01), gust(rng, rows, 15, 0.004)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return 2.6 * (wanted[k] - x[0]) - 0.5 * (x[1] + heard[k]) + 1.4 * wanted[k] + shake[k], air[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (0.24 * x[2] - 0.35 * x[0] - 0.02 * x[1] + u[1]) / 0.031, (u[0] - x[2]) / tau

    x, u = rk(slope, [0, 0, 0], rows, step, command, 5)
    true = {"Ja": 31.0, "kg": 0.35, "ba": 20.0} | ({"ta": tau} if complete else {})
    free = declared(rng, {k: v for k, v in true.items() if k != "Ja"}, kg="N m/rad", ba="1e-3 N m s", ta="s")
    force = "F" if complete else "thrust"
    states = {"a": ("w", 0.0, "rad"), "w": (f"1000*(0.24*{force} - kg*a - ba/1000*w)/Ja", 0.0, "rad/s")}
    states |= {"F": ("(thrust - F)/ta", 0.0, "N")} if complete else {}
    text = equations("arm", {"Ja": fixed(rng, 31.0, "g m2", 0.02)} | free, states,
                     {"angle": ("a*180/pi", "deg"), "rate": ("w*180/pi", "deg/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "thrust": (u[:, 0], "N", "input"),
        "angle": (logged(rng, np.degrees(x[:, 0]), 0.01, ends=(-45, 45), bits=12), "deg", "output"),
        "rate": (logged(rng, np.degrees(x[:, 1] + heard), 0.0, ends=(-500, 500), bits=15), "deg/s",
                 "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, context=LOOP, cuts=(1500,), lost=12, true=true)
    return Case(name, step, columns, text, ("actuator_lag",), (), {"tau_s": tau}, context=LOOP, true=true)


def steering(rng: np.random.Generator) -> Case:
    """A steering rack on a test bench with springs for tyres (Pfeffer and Harrer 2013, Lenkungshandbuch).

    Hidden: the seals of the rack bend and slip, 110 N over 0.9 mm with round shoulders. The pinion's force is analogue
    and sampled, in three recordings; the bench shakes a little, which nobody records.
    """
    name, rows, step, fine, most, over = "steer_rack", 3000, 0.01, 8, 110.0, 9e-4
    push = Tones.drawn(rng, 0.15, 5.0, 44, 420, 0.0)
    force, bench = looked_up(push, rows, step, fine), gust(rng, rows, 6, 7.0)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        bend = (x[1] - 0.5 * abs(x[1]) * x[2] - 0.5 * x[1] * abs(x[2])) / over
        return x[1], (force(t) + u[0] - 1.1e5 * x[0] - 1400 * x[1] - most * x[2]) / 34, bend

    x, _ = rk(slope, [0, 0, 0], rows, step, told(bench), fine)
    true = {"mr": 34.0, "kt": 110.0, "ct": 1.4}
    free = declared(rng, {k: true[k] for k in ("kt", "ct")}, kt="N/mm", ct="N s/mm")
    text = equations("rack", {"mr": fixed(rng, 34.0, "kg")} | free, {
        "q": ("v", 0, "m"), "v": ("(pinion - 1000*kt*q - 1000*ct*v)/mr", 0, "m/s")},
        {"rack": ("1000*q", "mm"), "rack_speed": ("1000*v", "mm/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "pinion": (push(np.arange(rows) * step), "N", "input"),
        "rack": (logged(rng, 1e3 * x[:, 0], 0.01, ends=(-40, 40), bits=14), "mm", "output"),
        "rack_speed": (logged(rng, 1e3 * x[:, 1], 0.02, lag=4, ends=(-1e3, 1e3), bits=14), "mm/s",
                       "output")}  # fmt: skip
    return Case(name, step, columns, text, ("bouc_wen_hysteresis",), ("play_hysteresis",), {}, cuts=(1000, 2000),
                true=true)  # fmt: skip


def flywheel(rng: np.random.Generator) -> Case:
    """A flywheel's magnetic bearing in its loop, unstable by itself (Schweitzer and Maslen 2009, Magnetic Bearings).

    Hidden: the pull of the magnets grows with the cube of the displacement, too, -9e10 N/m3. The loop hears the probe
    with noise; the rotor's hum is not recorded.
    """
    name, rows, step, bent = "flywheel_bearing", 3600, 0.005, -9e10
    wanted, shake = plateaus(rng, rows, 90, -1.5e-4, 1.5e-4), flips(rng, rows, 5, 0.05)
    heard, hum = hiss(rng, rows, 8e-7), gust(rng, rows, 3, 0.12)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        seen = x[0] + heard[k]
        return 780 * (wanted[k] - seen) - 13 * x[1] - 250 * wanted[k] + shake[k], hum[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (80 * u[0] + 2.0e4 * x[0] - bent * x[0] ** 3 + u[1] - 6 * x[1]) / 18

    x, u = rk(slope, [0, 0], rows, step, command, 5)
    true = {"mf": 18.0, "ki": 80.0, "ks": 20.0, "cf": 6.0}
    free = declared(rng, {k: true[k] for k in ("ki", "ks", "cf")}, 0.06, ki="N/A", ks="N/mm", cf="N s/m")
    text = equations("magnetic bearing", {"mf": fixed(rng, 18.0, "kg", 0.02)} | free, {
        "q": ("v", 0, "m"), "v": ("(ki*current + 1000*ks*q - cf*v)/mf", 0, "m/s")},
        {"gap": ("1000000*q", "um")})  # fmt: skip
    columns: dict[str, Column] = {
        "current": (u[:, 0], "A", "input"),
        "gap": (logged(rng, 1e6 * (x[:, 0] + heard), 0.0, ends=(-512, 512), bits=13), "um", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("cubic_stiffness",), (), {"k3": bent}, context=LOOP, true=true)


def tapped(rng: np.random.Generator) -> Case:
    """A spindle's housing on a shaker, its model linear (Ewins 2000, Modal Testing), in five short recordings.

    Hidden: besides the mode at 13.5 Hz there is one at 29 Hz with a damping of 0.02. The shaker's force is analogue and
    sampled, a pump that hums is not recorded.
    """
    name, rows, step, fine = "spindle_tap", 3500, 0.005, 8
    push = Tones.drawn(rng, 4, 55, 60, 60.0, 0.0)
    w, z = 2 * pi * np.array([13.5, 29.0]), np.array([0.03, 0.02])
    drive, seen = np.array([[0.016], [0.014]]), np.array([[1e6, 0.8e6], [0.6e6, -1.1e6]])
    force, pump = looked_up(push, rows, step, fine), np.c_[gust(rng, rows, 3, 2.0), gust(rng, rows, 3, 2.0)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        f = force(t)
        return (x[2], x[3], drive[0, 0] * (f + u[0]) - w[0] ** 2 * x[0] - 2 * z[0] * w[0] * x[2],
                drive[1, 0] * (f + u[1]) - w[1] ** 2 * x[1] - 2 * z[1] * w[1] * x[3])  # fmt: skip

    x, _ = rk(slope, [0, 0, 0, 0], rows, step, told(pump), fine)
    y = x[:, :2] @ seen.T
    ways = {"shaker": "N"}, {"housing": "um", "nose": "um"}
    gain = drive[:1] * skewed(rng, 1, 0.03)
    model = state_space(0, *ways, modes(w[:1], z[:1], gain, seen[:, :1]))
    columns: dict[str, Column] = {
        "shaker": (push(np.arange(rows) * step), "N", "input"),
        "housing": (logged(rng, y[:, 0], 0.02, ends=(-4000, 4000), bits=16), "um", "output"),
        "nose": (logged(rng, y[:, 1], 0.02, lag=3, ends=(-4000, 4000), bits=16), "um", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("structural_mode",), (), {"frequency_hz": 29.0},
                cuts=(700, 1400, 2100, 2800))  # fmt: skip


def table(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A shaker's table on flexures that is swept from 0.8 to 15 Hz (Lang and Snyder 2001, Sound and Vibration 35).

    Hidden: the geophone reads 15 % too much. Filters against aliases and a jittering clock stand before the converters,
    steps on the floor are not recorded. The null's geophone is right, in three recordings.
    """
    name, rows, step, fine, factor = "null_table" if complete else "shaker_table", 3600, 0.005, 8, 1.15
    span, factor = rows * step / 3, 1.0 if complete else factor
    swept, tones = sweep(0.8, 15, span, 45.0), Tones.drawn(rng, 0.5, 14, 40, 35, 0.0)

    def push(t: np.typing.NDArray[np.float64]) -> np.typing.NDArray[np.float64]:
        return np.asarray(swept(np.mod(t, span)) + tones(t))

    force, floor = tabled(push, rows, step, fine), gust(rng, rows, 4, 2.5)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (force(t) + u[0] - 9.5e4 * x[0] - 620 * x[1]) / 85

    x, _ = rk(slope, [0, 0], rows, step, told(floor), fine)
    acc = slopes(slope, step, x, floor[:, None])[:, 1]
    true = {"mt": 85.0, "kt": 95.0, "ct": 620.0}
    free = declared(rng, {k: true[k] for k in ("kt", "ct")}, 0.08, kt="N/mm", ct="N s/m")
    motion = "(shaker - 1000*kt*q - ct*v)/mt"
    text = equations("table", {"mt": fixed(rng, 85.0, "kg", 0.01)} | free, {
        "q": ("v", 0, "m"), "v": (motion, 0, "m/s")},
        {"geophone": ("1000*v", "mm/s"), "acc": (motion, "m/s2")})  # fmt: skip
    speed = logged(rng, 1e3 * factor * x[:, 1], 0.02, lag=4, ends=(-200, 200), bits=14, corner=0.4, jitter=0.02)
    columns: dict[str, Column] = {
        "shaker": (logged(rng, push(np.arange(rows) * step), 0.003, ends=(-500, 500), bits=14), "N", "input"),
        "geophone": (speed, "mm/s", "output"),
        "acc": (logged(rng, acc, 0.02, ends=(-20, 20), bits=14, corner=0.4, jitter=0.02), "m/s2",
                "output")}  # fmt: skip
    late = ("data_time_offset", "sensor_second_order")  # as a filter against aliases is
    if complete:
        return Case(name, step, columns, text, cuts=(1200, 2400), true=true)
    return Case(name, step, columns, text, ("sensor_scale",), (), {"factor": factor}, beside=late, lost=8,
                true=true)  # fmt: skip


MACHINES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "spool_sticks": (412, spool), "rotor_arm": (413, arm), "steer_rack": (414, steering),
    "flywheel_bearing": (415, flywheel), "spindle_tap": (416, tapped), "shaker_table": (417, table),
}  # fmt: skip
