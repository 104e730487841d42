"""Bodies that move, whose models lack a play, a stop, a drag, a slider, a sign, or what a damper was before it leaked.

Every machine is a function of a random generator that returns its case; with `complete` nothing is hidden, which is
the null in third_author_nulls.py. Sources stand beside each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, sin

import numpy as np
from second_author_parts import Case, Tones, coloured, equations, flips, known, plateaus, smooth
from textbook_plants import noisy
from third_author_parts import looked_up, off, rk, told, white


def wing(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A wing tip with a payload on a mount with play (after Noël and Schoukens 2017, F-16 benchmark).

    The model's mount has none; cubic stiffness, whose resonance rises with the level, too, is no answer. The null's has
    six short recordings of bursts and decay, and coloured noise.
    """
    name, rows, step, gap = ("null_wing", 2340, 0.005, 0.0) if complete else ("wing_mount", 3100, 0.005, 8e-4)
    true = {"m1": 8.2, "k1": 8100.0, "c1": 7.0, "m2": 2.1, "k2": 6600.0, "c2": 3.4}
    m1, k1, c1, m2, k2, c2 = true.values()
    u = smooth(rng, rows, 3, 32)
    if complete:
        u = u * (np.arange(rows) % 390 < 150)

    def forces(x: Sequence[float]) -> tuple[float, float]:
        d = x[0] - x[1]
        return k1 * x[0] + c1 * x[2], k2 * (d - max(min(d, gap), -gap)) + c2 * (x[2] - x[3])

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        f, g = forces(x)
        return x[2], x[3], (u[0] - f - g) / m1, g / m2

    x, _ = rk(slope, [0, 0, 0, 0], rows, step, told(u), 20)
    acc = np.array([slope(0, a, [b])[2:] for a, b in zip(x.tolist(), u, strict=True)]) / 9.80665
    mount = "(k2*(xw-xp) + c2*(vw-vp))"
    text = equations("wing with payload", off(rng, true, m1="kg", m2="kg", k1="N/m", k2="N/m"), {
        "xw": ("vw", 0, "m"), "xp": ("vp", 0, "m"), "vw": (f"(shaker - k1*xw - c1*vw - {mount})/m1", 0, "m/s"),
        "vp": (f"{mount}/m2", 0, "m/s")}, {
        "acc_wing": (f"(shaker - k1*xw - c1*vw - {mount})/m1/9.80665", "g"),
        "acc_payload": (f"{mount}/m2/9.80665", "g")})  # fmt: skip
    clean = {"acc_wing": acc[:, 0], "acc_payload": acc[:, 1]}
    read = [coloured(rng, y, 0.02, 4) if complete else noisy(rng, y, 0.01) for y in clean.values()]
    columns = {"shaker": (u, "N", "input"), "acc_wing": (read[0], "g", "output"),
               "acc_payload": (read[1], "g", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, cuts=tuple(range(390, rows, 390)), headings=True, time="t [s]",
                    clean=clean, true=true)  # fmt: skip
    return Case(name, step, columns, text, ("clearance",), (), {"half_gap": gap})


def pick_place(rng: np.random.Generator) -> Case:
    """A mounting head that presses on a plate 11 mm below (Juloski et al. 2004, a hybrid identification benchmark).

    The model never meets the plate. Mass, gain and friction are all free, so that only their ratios count.
    """
    name, rows, step, stop = "pick_place", 1900, 0.002, 0.011
    u = np.convolve(plateaus(rng, rows + 12, 70, -1.0, 2.6), np.ones(13) / 13, mode="valid")

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        touching = 2.4e4 * max(x[0] - stop, 0) * max(1 + 0.4 * x[1], 0)
        return x[1], (4.1 * u[0] - 9.0 * x[1] - 560.0 * x[0] - touching) / 0.9

    x, _ = rk(slope, [0, 0], rows, step, told(u), 20)
    true = {"mass": 0.9, "kf": 4.1, "fr": 9.0, "ks": 560.0}
    text = equations("mounting head", off(rng, true, mass="kg", kf="N/V", ks="N/m"), {
        "head": ("speed", 0, "m"), "speed": ("(kf*amp - fr*speed - ks*head)/mass", 0, "m/s")},
        {"depth": ("head*1000", "mm")})  # fmt: skip
    columns = {"amp": (u, "V", "input"), "depth": (white(rng, 1e3 * x[:, 0], 0.02), "mm", "output")}
    return Case(name, step, columns, text, ("end_stop",), (), {"high_stop": stop}, gap=(700, 760))


def roll(rng: np.random.Generator) -> Case:
    """Roll of a ship under its rudder in a beam sea that nobody records (Lewis 1989, Principles of Naval Architecture).

    Drag grows with the square of the roll rate; the model has damping in proportion to it only. Dry friction, which
    damps small motion more, is no answer.
    """
    name, rows, step, fine = "roll_sea", 1850, 0.5, 6
    sea = looked_up(Tones.drawn(rng, 0.075, 0.15, 16, 0.006, 0.0), rows, step, fine)
    u = flips(rng, rows, 8, 12.0) + plateaus(rng, rows, 80, -4, 4)
    drag = 1.1

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (-(0.62**2) * sin(x[0]) - 0.035 * x[1] - drag * x[1] * abs(x[1]) + 0.0035 * u[0] + sea(t))

    x, _ = rk(slope, [0, 0], rows, step, told(u), fine)
    true = {"wr": 0.62, "br": 0.035, "kr": 0.0035}
    text = equations("roll", off(rng, true, wr="rad/s"), {
        "phi": ("p", 0, "rad"), "p": ("-wr**2*sin(phi) - br*p + kr*rudder", 0, "rad/s")},
        {"roll": ("phi*57.29578", "deg"), "roll_rate": ("p*180/pi", "deg/s")})  # fmt: skip
    clean = {"roll": np.degrees(x[:, 0]), "roll_rate": np.degrees(x[:, 1])}
    columns = {"rudder": (u, "deg", "input"), "roll": (white(rng, clean["roll"], 0.08), "deg", "output"),
               "roll_rate": (white(rng, clean["roll_rate"], 0.08), "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("quadratic_damping",), (), {"c2": drag})


def cart(rng: np.random.Generator) -> Case:
    """A trolley with a hanging rod whose encoder counts backwards (Åström and Furuta 2000, Automatica 36)."""
    name, rows, step = "cart_reversed", 1270, 0.02
    u = flips(rng, rows, 20, 3.0) + plateaus(rng, rows, 50, -2, 2)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        acc = (2.1 * u[0] - 7.5 * x[1] - 6.0 * x[0]) / 1.4
        return x[1], acc, x[3], -9.81 / 0.62 * sin(x[2]) - acc / 0.62 * cos(x[2]) - 0.18 * x[3]

    x, _ = rk(slope, [0, 0, 0, 0], rows, step, told(u), 8)
    true = {"mc": 1.4, "fu": 2.1, "bc": 7.5, "kb": 6.0, "le": 0.62, "br": 0.18}
    acc = "(fu*amp - bc*cv - kb*cx)/mc"
    text = equations("trolley with rod", off(rng, true, mc="kg", le="m"), {
        "cx": ("cv", 0, "m"), "cv": (acc, 0, "m/s"), "th": ("om", 0, "rad"),
        "om": (f"-9.81/le*sin(th) - {acc}/le*cos(th) - br*om", 0, "rad/s")},
        {"place": ("100*cx", "cm"), "rod": ("th*180/pi", "deg")})  # fmt: skip
    clean = {"place": 100 * x[:, 0], "rod": -np.degrees(x[:, 2])}
    columns = {"amp": (u, "V", "input"), "place": (white(rng, clean["place"], 0.05), "cm", "output"),
               "rod": (np.round(white(rng, clean["rod"], 0.03) / 0.088) * 0.088, "deg", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_sign",), (), beside=("sensor_quantisation",))


def strut(rng: np.random.Generator) -> Case:
    """A test rig of a spring strut that loses its oil after 31 s (Dixon 2007, Shock Absorber Handbook).

    The model's damper stays as it was; an accelerometer in g and the stroke are read.
    """
    name, rows, step, fine = "strut_leaks", 3050, 0.02, 10
    road = Tones.drawn(rng, 0.3, 8, 40, 500, 0.0)
    f = looked_up(road, rows, step, fine)

    def slope(t: float, x: Sequence[float], _: Sequence[float]) -> Sequence[float]:
        return x[1], (f(t) - (1150.0 if t < 31 else 520.0) * x[1] - 2.1e4 * x[0]) / 310

    x, _ = rk(slope, [0, 0], rows, step, lambda k, x: (0,), fine)
    t = np.arange(rows) * step
    acc = np.array([slope(a, b, ())[1] for a, b in zip(t, x.tolist(), strict=True)])
    true = {"ms": 310.0, "ks": 21.0, "ds": 1.15}
    motion = "(actuator - 1000*ds*ve - 1000*ks*st)/ms"
    text = equations("strut", off(rng, true, ms="kg", ks="N/mm", ds="N s/mm"), {
        "st": ("ve", 0, "m"), "ve": (motion, 0, "m/s")},
        {"stroke": ("1000*st", "mm"), "body_acc": (f"{motion}/9.81", "g")})  # fmt: skip
    clean = {"stroke": 1e3 * x[:, 0], "body_acc": acc / 9.81}
    columns = {"actuator": (np.asarray(road(t)), "N", "input"),
               "stroke": (noisy(rng, clean["stroke"], 0.015), "mm", "output"),
               "body_acc": (noisy(rng, clean["body_acc"], 0.03), "g", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("damping_change",), (), {"time_s": 31.0, "damping_change": -630.0})


def gimbal(rng: np.random.Generator) -> Case:
    """A camera on a gimbal whose cable bundle rubs (Hilkert 2008, IEEE Control Systems Magazine 28).

    The bundle is a spring behind a slider; the model has a linear spring.
    """
    name, rows, step, k, half = "gimbal_cable", 1750, 0.01, 7.0, 0.03
    u = smooth(rng, rows, 18, 0.95)
    u = np.repeat(u[::3], 3)[:rows]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (2.0 * u[0] - 0.22 * x[1] - 9.5 * x[0] - k * (x[0] - x[2])) / 0.05, 0.0

    def after(x: list[float]) -> None:
        x[2] = min(max(x[2], x[0] - half), x[0] + half)

    x, _ = rk(slope, [0, 0, 0], rows, step, told(u), 30, after)
    true = {"Jg": 0.05, "bg": 0.22, "kg": 9.5}
    text = equations("camera gimbal", off(rng, true, Jg="kg m2", kg="N m/rad") | {"kt": known(2.0, "N m/A")}, {
        "an": ("ra", 0, "rad"), "ra": ("(kt*coil - bg*ra - kg*an)/Jg", 0, "rad/s")},
        {"angle": ("an*180/pi", "deg"), "gyro": ("ra*180/pi", "deg/s")})  # fmt: skip
    clean = {"angle": np.degrees(x[:, 0]), "gyro": np.degrees(x[:, 1])}
    columns = {"coil": (u, "A", "input"), "angle": (np.round(clean["angle"] / 0.022) * 0.022, "deg", "output"),
               "gyro": (noisy(rng, clean["gyro"], 0.01), "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("play_hysteresis",), ("bouc_wen_hysteresis",), {"half_width": half},
                beside=("sensor_quantisation",))  # fmt: skip


MACHINES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "wing_mount": (101, wing), "pick_place": (106, pick_place), "roll_sea": (107, roll), "cart_reversed": (124, cart),
    "strut_leaks": (128, strut), "gimbal_cable": (129, gimbal),
}  # fmt: skip
