"""Masses on springs: a rubber spring in the cold, a seat, a feeder that carries ore, a wheelset, a telescope, a muscle.

As fourth_author_machines.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi

import numpy as np
from fourth_author_parts import declared, filtered, gust, logged
from second_author_parts import Case, Tones, equations, flips, known, plateaus, smooth
from third_author_parts import looked_up, rk, told


def rubber(rng: np.random.Generator) -> Case:
    """A rubber spring of a bogie on a shaker, on six days (Iwnicki 2006, Railway Vehicle Dynamics, chapter 6).

    Hidden: the spring softens by 0.1 % a kelvin; the model knows no temperature, which is recorded. Size: 9 % of
    stroke and acceleration. The days go from -14 to 33 degrees and back.
    """
    name, rows, step, fine = "rubber_cold", 3600, 0.01, 6
    shaker = Tones.drawn(rng, 1, 22, 60, 1900, 0)
    force, days = looked_up(shaker, rows, step, fine), np.repeat([8, -14, 21, 33, 16, -3], 600)
    felt = days + smooth(rng, rows, 150, 0.4)
    stiff, soft = 9.2e5, -9.2e5 * 0.001

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (force(t) + u[1] - 2900 * x[1] - (stiff + soft * (u[0] - 20)) * x[0]) / 620

    seen = np.c_[felt, gust(rng, rows, 4, 25.0)]
    x, _ = rk(slope, [0, 0], rows, step, told(seen), fine)
    t = np.arange(rows) * step
    acc = np.array([slope(a, b, c)[1] for a, b, c in zip(t, x.tolist(), seen.tolist(), strict=True)])
    true = {"mr": 620.0, "kr": 9.2e5, "cr": 2900.0}
    motion = "(shaker - kr*q - cr*v)/mr"
    text = equations("rubber spring", declared(rng, true, mr="kg", kr="N/m", cr="N s/m"), {
        "q": ("v", 0, "m"), "v": (motion, 0, "m/s")},
        {"stroke": ("1000*q", "mm"), "acc": (motion, "m/s2")})  # fmt: skip
    columns = {"shaker": (filtered(np.asarray(shaker(t)), 0.45), "N", "input"),
               "temperature": (np.round(felt, 1), "degC", "disturbance"),
               "stroke": (logged(rng, 1e3 * x[:, 0], 0.015, ends=(-25, 25), bits=13, corner=0.45), "mm", "output"),
               "acc": (logged(rng, acc, 0.02, corner=0.45), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("temperature_dependence",), (), {"stiffness_slope": soft},
                cuts=tuple(range(600, rows, 600)), headings=True, true=true)  # fmt: skip


def seat(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A seat on an air spring and a magnetorheological damper (Spencer et al. 1997, J. Eng. Mech. 123).

    Hidden: the damper's Bouc-Wen force of 16 N, which yields over 1.8 mm. Size: 22 % of the stroke, 20 % of the
    acceleration. A slider on a spring is the same loop with sharp corners and may stand in. The null's model has
    the force and the null has two recordings.
    """
    name, rows, step, fine = "null_seat" if complete else "seat_damper", 3000, 0.005, 10
    shaker = Tones.drawn(rng, 0.5, 11, 50, 130, 0)
    force, seen = looked_up(shaker, rows, step, fine), gust(rng, rows, 8, 3.0)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        z, v = x[2], x[1]
        acc = (force(t) + u[0] - 210 * v - 1.15e4 * x[0] - 16 * z) / 76
        return v, acc, (v - 0.5 * abs(v) * z - 0.5 * v * abs(z)) / 1.8e-3

    x, _ = rk(slope, [0, 0, 0], rows, step, told(seen), fine)
    t = np.arange(rows) * step
    acc = np.array([slope(a, b, [c])[1] for a, b, c in zip(t, x.tolist(), seen, strict=True)])
    true = {"ms": 76.0, "ka": 1.15e4, "ca": 210.0} | ({"fy": 16.0, "yl": 1.8} if complete else {})
    motion = f"(shaker - ka*q - ca*v{' - fy*z' if complete else ''})/ms"
    states = {"q": ("v", 0.0, "m"), "v": (motion, 0.0, "m/s")}
    if complete:
        states["z"] = ("1000*(v - abs(v)*z/2 - v*abs(z)/2)/yl", 0.0, "")
    values = declared(rng, true, 0.08 if complete else 0.1, ms="kg", ka="N/m", ca="N s/m", yl="mm")
    text = equations("seat", values, states, {"stroke": ("1000*q", "mm"), "seat_acc": (motion, "m/s2")})
    columns = {"shaker": (np.asarray(shaker(t)), "N", "input"),
               "stroke": (logged(rng, 1e3 * x[:, 0], 0.01, ends=(-60, 60), bits=14, corner=0.4), "mm", "output"),
               "seat_acc": (logged(rng, acc, 0.02, lag=4 if complete else 0, corner=0.4),
                            "m/s2", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, cuts=(1600,), true=true)
    return Case(name, step, columns, text, ("bouc_wen_hysteresis",), ("play_hysteresis",), {"force_N": 16.0}, true=true)


def feeder(rng: np.random.Generator) -> Case:
    """A vibrating feeder whose trough carries ore (Blekhman 2000, Vibrational Mechanics), in modal values.

    Hidden: 2.5 % more mass than in the hammer test of the empty trough, whose values stand. Size: 19 % of the
    stroke, 20 % of the acceleration. Only the exciter's lag is free.
    """
    name, rows, step, fine = "feeder_ore", 2400, 0.005, 8
    drive = Tones.drawn(rng, 2, 28, 60, 260, 0)
    force, w, more = looked_up(drive, rows, step, fine), 2 * pi * 9.3, 1.025

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (x[1], (0.021 * x[2] - w**2 * x[0] - 0.07 * w * x[1] + u[0]) / more, (force(t) - x[2]) / 0.009)

    seen = gust(rng, rows, 3, 0.08)
    x, _ = rk(slope, [0, 0, 0], rows, step, told(seen), fine)
    t = np.arange(rows) * step
    acc = np.array([slope(a, b, [c])[1] for a, b, c in zip(t, x.tolist(), seen, strict=True)])
    motion = "g0*exciter - (2*pi*f0)**2*q - 2*z0*2*pi*f0*v"
    true = {"te": 9.0, "f0": 9.3, "z0": 0.035, "g0": 0.021}
    values = declared(rng, {"te": 9.0}, te="ms") | {
        "f0": known(9.3, "Hz"), "z0": known(0.035), "g0": known(0.021, "1/kg")}  # fmt: skip
    text = equations("feeder", values, {"q": ("v", 0, "m"), "v": (motion, 0, "m/s"),
                                        "exciter": ("1000*(drive - exciter)/te", 0, "N")},
                     {"stroke": ("1000*q", "mm"), "trough_acc": (motion, "m/s2")})  # fmt: skip
    columns = {"drive": (np.asarray(drive(t)), "N", "input"),
               "stroke": (logged(rng, 1e3 * x[:, 0], 0.01, ends=(-20, 20), bits=14), "mm", "output"),
               "trough_acc": (logged(rng, acc, 0.02, lag=3, ends=(-100, 100), bits=14), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("added_mass",), (), {"mass_ratio": 0.025}, cuts=(1300,), true=true)


def wheelset(rng: np.random.Generator) -> Case:
    """A wheelset between its flanges on a rough track (Wickens 2003, Fundamentals of Rail Vehicle Dynamics); complete.

    The flanges' contact at 6 mm is in the model; the bogie pulls with what nobody records. Four stretches of track.
    """
    name, rows, step, fine = "null_wheelset", 3200, 0.005, 10
    track = Tones.drawn(rng, 0.4, 7, 50, 3.2, 0)
    rough, pull = looked_up(track, rows, step, fine), gust(rng, rows, 20, 120.0)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        flange = 4.5e6 * (max(x[0] - 6e-3, 0) + min(x[0] + 6e-3, 0))
        return x[1], (6.2e5 * (rough(t) / 1e3 - x[0]) - 1.1e4 * x[1] - flange + u[0]) / 1250

    x, _ = rk(slope, [0, 0], rows, step, told(pull), fine)
    t = np.arange(rows) * step
    acc = np.array([slope(a, b, [c])[1] for a, b, c in zip(t, x.tolist(), pull, strict=True)])
    true = {"mw": 1250.0, "kg": 0.62, "cw": 11.0, "kf": 4.5, "gap": 6.0}
    flange = "1000000*kf*(max(y - gap/1000, 0) + min(y + gap/1000, 0))"
    motion = f"(1000*kg*(track - 1000*y) - 1000*cw*v - {flange})/mw"
    text = equations("wheelset", declared(rng, true, 0.08, mw="kg", kg="kN/mm", cw="kN s/m", kf="kN/mm", gap="mm"), {
        "y": ("v", 0, "m"), "v": (motion, 0, "m/s")},
        {"lateral": ("1000*y", "mm"), "axle_acc": (motion, "m/s2")})  # fmt: skip
    columns = {"track": (np.asarray(track(t)), "mm", "disturbance"),
               "lateral": (logged(rng, 1e3 * x[:, 0], 0.015, ends=(-20, 20), bits=12, corner=0.45), "mm", "output"),
               "axle_acc": (logged(rng, acc, 0.03, lag=3, corner=0.45), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, cuts=(800, 1600, 2400), true=true)


def mount(rng: np.random.Generator) -> Case:
    """A telescope of 1 m on two axes with gyroscopes in one block (Bely 2003, Design of Large Optical Telescopes).

    Hidden: the block sits askew, so that 5 % of the azimuth's rate show in elevation. Size: 8 % of the elevation's
    rate. Wind that nobody records turns both axes.
    """
    name, rows, step, share = "mount_askew", 2500, 0.02, 0.05
    u = np.c_[smooth(rng, rows, 40, 90.0), smooth(rng, rows, 30, 42.0)]
    u = np.repeat(u[::2], 2, axis=0)[:rows]
    seen = np.c_[u, gust(rng, rows, 30, 2.5), gust(rng, rows, 30, 2.0)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return ((u[0] + u[2] - 260 * x[0]) / 410, x[2], (u[1] + u[3] - 105 * x[2] - 520 * x[1]) / 230)

    x, _ = rk(slope, [0, 0, 0], rows, step, told(seen), 5)
    true = {"Ja": 410.0, "ba": 260.0, "Je": 230.0, "be": 105.0, "ke": 520.0}
    text = equations("telescope", declared(rng, true, Ja="kg m2", Je="kg m2", ke="N m/rad"), {
        "wa": ("(torque_az - ba*wa)/Ja", 0, "rad/s"), "el": ("we", 0, "rad"),
        "we": ("(torque_el - be*we - ke*el)/Je", 0, "rad/s")},
        {"rate_az": ("wa*180/pi", "deg/s"), "rate_el": ("we*180/pi", "deg/s")})  # fmt: skip
    rates = np.degrees(x[:, [0, 2]])
    rates[:, 1] += share * rates[:, 0]
    columns = {"torque_az": (u[:, 0], "N m", "input"), "torque_el": (u[:, 1], "N m", "input"),
               "rate_az": (logged(rng, rates[:, 0], 0.012, ends=(-60, 60), bits=15), "deg/s", "output"),
               "rate_el": (logged(rng, rates[:, 1], 0.012, ends=(-60, 60), bits=15), "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_cross_axis",), (), {"share": share}, lost=10, true=true)


def muscle(rng: np.random.Generator) -> Case:
    """An arm that a stimulated muscle bends (Zajac 1989, Crit. Rev. Biomed. Eng. 17; Winters 1995).

    The muscle switches on in 25 ms and off in 70 ms, which no entry has; the model has one lag of activation. Size:
    13 % of the force, 10 % of the angle. Force and angle are recorded.
    """
    name, rows, step = "muscle_onset", 2600, 0.01
    u = np.clip(plateaus(rng, rows, 26, 0.05, 0.75) + flips(rng, rows, 7, 0.12), 0, 1)
    seen = np.c_[u, gust(rng, rows, 12, 0.05)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        lag = 0.025 if u[0] > x[0] else 0.07
        return (u[0] - x[0]) / lag, x[2], (0.035 * 420 * x[0] + u[1] - 0.9 * x[2] - 9.5 * x[1]) / 0.085

    x, _ = rk(slope, [0.3, 0.45, 0], rows, step, told(seen), 8)
    true = {"ta": 40.0, "Fm": 420.0, "Ia": 0.085, "ba": 0.9, "ka": 9.5}
    text = equations("arm", declared(rng, true, ta="ms", Fm="N", Ia="kg m2", ka="N m/rad"), {
        "act": ("1000*(stimulus - act)/ta", 0.3, ""), "an": ("om", 0.45, "rad"),
        "om": ("(0.035*Fm*act - ba*om - ka*an)/Ia", 0, "rad/s")},
        {"tendon_force": ("Fm*act", "N"), "elbow": ("an*180/pi", "deg")})  # fmt: skip
    columns = {"stimulus": (u, "", "input"),
               "tendon_force": (logged(rng, 420 * x[:, 0], 0.025, ends=(-100, 500), bits=12), "N", "output"),
               "elbow": (logged(rng, np.degrees(x[:, 1]), 0.01, lag=4, ends=(-90, 180), bits=14),
                         "deg", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, cuts=(650, 1300, 1950), true=true)


VIBRATION: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "rubber_cold": (215, rubber), "seat_damper": (216, seat), "feeder_ore": (217, feeder), "mount_askew": (218, mount),
    "muscle_onset": (228, muscle),
}  # fmt: skip
