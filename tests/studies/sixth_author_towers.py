"""Towers, their dampers and floats: a rub, an unbalance, a shadow, a sensor askew, a softer ground or drag is hidden.

As sixth_author_turbines.py. With `complete` nothing is hidden, which is a null in sixth_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, exp, pi, sin, tanh

import numpy as np
from second_author_parts import Case, Column, Tones, equations, state_space
from sixth_author_parts import WT, declared, fixed, gust, logged, modes, ramps, shaken, skewed, slopes, turning
from third_author_parts import looked_up, rk, told


def guides(rng: np.random.Generator) -> Case:
    """A damper mass in the top of a tower that slides on rails (Lackner and Rotea 2011, Wind Energy 14).

    Hidden: its guides rub with 120 N. The nacelle's acceleration drives it and is recorded by a good sensor; of the
    mass there are stroke and speed.
    """
    name, rows, step, fine, rub, w = "damper_guides", 2800, 0.05, 8, 120.0, 2 * pi * 0.31
    push = Tones.drawn(rng, 0.08, 1.2, 44, 0.12, 0.0)
    shake = looked_up(push, rows, step, fine)

    def slope(t: float, x: Sequence[float], _: Sequence[float]) -> Sequence[float]:
        drag = rub * tanh(x[1] / 0.002) / 5200
        return x[1], -shake(t) - w * w * x[0] - 0.24 * w * x[1] - drag

    x, _ = rk(slope, [0, 0], rows, step, told(np.zeros(rows)), fine)
    true = {"md": 5200.0, "kd": 5.2 * w * w, "cd": 5.2 * 0.24 * w}
    free = declared(rng, {k: true[k] for k in ("kd", "cd")}, kd="kN/m", cd="kN s/m")
    text = equations("sliding damper", {"md": fixed(rng, 5200.0, "kg", 0.02)} | free, {
        "r": ("vr", 0, "m"), "vr": ("-nacelle_acc - (1000*kd*r + 1000*cd*vr)/md", 0, "m/s")},
        {"stroke": ("1000*r", "mm"), "speed": ("vr", "m/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "nacelle_acc": (push(np.arange(rows) * step), "m/s2", "input"),
        "stroke": (logged(rng, 1e3 * x[:, 0], 0.02, ends=(-800, 800), bits=13), "mm", "output"),
        "speed": (logged(rng, x[:, 1], 0.03, lag=4, ends=(-2, 2), bits=12), "m/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("coulomb_friction",), (), {"force_N": rub}, machine=WT, cuts=(1400,),
                lost=6, true=true)  # fmt: skip


def lattice(rng: np.random.Generator) -> Case:
    """A lattice tower of 250 kW whose rotor is out of balance (Niebsch and Ramlau 2014, Renewable Energy 70).

    Hidden: a static moment of 34 and -21 kg m of mass. Thrust and torque are measured at the main bearing, gusts on the
    lattice are not.
    """
    name, rows, step, fine, even, odd, w = "lattice_tower", 3000, 0.05, 6, 34.0, -21.0, 2 * pi * 1.1
    push, twist = Tones.drawn(rng, 0.03, 2.2, 44, 900, 1.9e4), Tones.drawn(rng, 0.03, 2.2, 44, 2.4e3, 4.2e4)
    rotor = turning(rng, rows, step, 4.1, 0.22)
    thrust, torque = (looked_up(a, rows, step, fine) for a in (push, twist))
    u = np.c_[rotor, gust(rng, rows, 8, 60.0), gust(rng, rows, 8, 40.0)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        a = u[0] + u[1] * (t - u[2])
        side = 0.11 * torque(t) + u[1] ** 2 * (even * cos(a) + odd * sin(a)) + u[4]
        return (x[1], (thrust(t) + u[3] - 1.1e4 * x[1]) / 2.1e4 - w * w * x[0],
                x[3], (side - 8e3 * x[3]) / 2.1e4 - w * w * x[2])  # fmt: skip

    k = 2.1e4 * w * w
    start = [1.9e4 / k, 0, 0.11 * 4.2e4 / k, 0]
    x, _ = rk(slope, start, rows, step, told(u), fine)
    acc, t = slopes(slope, step, x, u), np.arange(rows) * step
    true = {"mt": 2.1e4, "kt": 1e-3 * k, "cf": 1.1e4, "cs": 8e3, "gt": 0.11}
    free = declared(rng, {n: true[n] for n in ("kt", "cf", "cs", "gt")}, 0.08, kt="kN/m", cf="N s/m", cs="N s/m")
    fore, side = "(thrust - cf*vf - 1000*kt*xf)/mt", "(gt*torque - cs*vs - 1000*kt*xs)/mt"
    text = equations("lattice tower", {"mt": fixed(rng, 2.1e4, "kg", 0.02)} | free, {
        "xf": ("vf", start[0], "m"), "vf": (fore, 0, "m/s"), "xs": ("vs", start[2], "m"), "vs": (side, 0, "m/s")},
        {"tower_top_fa_acc": (fore, "m/s2"), "tower_top_ss_acc": (side, "m/s2")})  # fmt: skip
    columns: dict[str, Column] = {
        "thrust": (push(t), "N", "input"), "torque": (twist(t), "N m", "input"),
        "azimuth": (np.degrees(rotor[:, 0]) % 360, "deg", "azimuth"),
        "tower_top_fa_acc": (logged(rng, acc[:, 1], 0.03, lag=3, ends=(-2, 2), bits=14), "m/s2", "output"),
        "tower_top_ss_acc": (logged(rng, acc[:, 3], 0.03, ends=(-2, 2), bits=14), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("mass_imbalance",), (),
                {"static_moment_cos": even, "static_moment_sin": odd}, machine=WT,
                context="blades = 3\nrated_speed_rad_s = 4.2\n", true=true)  # fmt: skip


def shadow(rng: np.random.Generator) -> Case:
    """A rotor with two blades that runs behind its tower (Hansen 2015, Aerodynamics of Wind Turbines, chapter 2).

    Hidden: each blade loses thrust in the wake of the tower, a dip of 14 degrees of 1.5 kN. The thrust that is told
    comes from the mean wind at the rotor; small gusts on the tower are not recorded.
    """
    name, rows, step, fine, dip, wide = "downwind_shadow", 3000, 0.04, 8, 1.5e3, 0.24
    push, rotor = Tones.drawn(rng, 0.03, 1.6, 44, 450, 9e3), turning(rng, rows, step, 5.6, 0.25)
    thrust, w, mean = looked_up(push, rows, step, fine), 2 * pi * 0.95, dip * wide / np.sqrt(pi)
    u = np.c_[rotor, gust(rng, rows, 10, 30.0)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        a = (u[0] + u[1] * (t - u[2])) % pi  # either blade passes the tower once in half a turn
        lost = dip * exp(-(((a - pi / 2) / wide) ** 2)) - mean
        return x[1], (thrust(t) - lost + u[3] - 3.4e3 * x[1]) / 6800 - w * w * x[0]

    x, _ = rk(slope, [9e3 / (6800 * w * w), 0], rows, step, told(u), fine)
    acc = slopes(slope, step, x, u)[:, 1]
    true = {"mt": 6800.0, "kt": 6.8 * w * w, "ct": 3.4e3}
    free = declared(rng, {k: true[k] for k in ("kt", "ct")}, 0.08, kt="kN/m", ct="N s/m")
    fore = "(thrust - ct*vf - 1000*kt*xf)/mt"
    text = equations("tube tower", {"mt": fixed(rng, 6800.0, "kg", 0.02)} | free, {
        "xf": ("vf", 0.037, "m"), "vf": (fore, 0, "m/s")},
        {"tower_top_fa_acc": (fore, "m/s2"), "tower_top_fa_speed": ("vf", "m/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "thrust": (push(np.arange(rows) * step), "N", "input"),
        "azimuth": (np.degrees(rotor[:, 0]) % 360, "deg", "azimuth"),
        "tower_top_fa_acc": (logged(rng, acc, 0.03, ends=(-2, 2), bits=14), "m/s2", "output"),
        "tower_top_fa_speed": (logged(rng, x[:, 1], 0.03, lag=3, ends=(-1, 1), bits=13), "m/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("tower_shadow",), (), machine=WT,
                context="blades = 2\nrated_speed_rad_s = 5.8\n", lost=6, true=true)  # fmt: skip


def tilted(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A tower of 1.5 MW with two accelerometers in one block, its model linear (Hansen 2015, chapter 11).

    Hidden: the fore-aft accelerometer is askew and shows 0.17 of the side-side motion. The null's block is straight,
    its logger filters against aliases, and gains are up to 6 % off. Gusts on the tower are not recorded.
    """
    name, rows, step, fine = "null_mast_tower" if complete else "nacelle_tilt", 3600, 0.05, 8
    w, z, share = 2 * pi * np.array([0.42, 0.45]), np.array([0.05, 0.02]), 0.0 if complete else 0.17
    push, twist = Tones.drawn(rng, 0.05, 1.5, 44, 9.0, 0.0), Tones.drawn(rng, 0.05, 1.5, 44, 95.0, 0.0)
    drive = np.diag([5.6e-3, 3.4e-4])
    thrust, torque = looked_up(push, rows, step, fine), looked_up(twist, rows, step, fine)
    wind = np.c_[gust(rng, rows, 10, 0.4), gust(rng, rows, 10, 3.0)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (x[2], x[3], drive[0, 0] * (thrust(t) + u[0]) - w[0] ** 2 * x[0] - 2 * z[0] * w[0] * x[2],
                drive[1, 1] * (torque(t) + u[1]) - w[1] ** 2 * x[1] - 2 * z[1] * w[1] * x[3])  # fmt: skip

    x, _ = rk(slope, [0, 0, 0, 0], rows, step, told(wind), fine)
    acc, t = slopes(slope, step, x, wind)[:, 2:], np.arange(rows) * step
    most, corner = (0.06, 0.4) if complete else (0.03, 0.0)
    wrong = np.diag([skewed(rng, 1, most), skewed(rng, 1, most)])
    matrices = shaken(w, z, drive @ wrong, np.eye(2))
    ways = {"thrust": "kN", "torque": "kN m"}, {"tower_top_fa_acc": "m/s2", "tower_top_ss_acc": "m/s2"}
    model = state_space(0, *ways, matrices)
    fore = logged(rng, acc[:, 0] + share * acc[:, 1], 0.03, lag=3, ends=(-1, 1), bits=13, corner=corner)
    columns: dict[str, Column] = {
        "thrust": (push(t), "kN", "input"), "torque": (twist(t), "kN m", "input"),
        "tower_top_fa_acc": (fore, "m/s2", "output"),
        "tower_top_ss_acc": (logged(rng, acc[:, 1], 0.03, ends=(-1, 1), bits=13, corner=corner), "m/s2",
                             "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, model, machine=WT, context="blades = 3\n", cuts=(1800,), lost=8)
    return Case(name, step, columns, model, ("sensor_cross_axis",), (), {"share": share}, machine=WT,
                context="blades = 3\n")  # fmt: skip


def scour(rng: np.random.Generator) -> Case:
    """A monopile around which a storm washes the sand away, its model linear (Sumer and Fredsøe 2002).

    Hidden: from 130 s on the first mode is 7 % softer. An exciter in the nacelle shakes the tower, gusts on it are not
    recorded; one gain of the model is 2 % off at most.
    """
    name, rows, step, fine, lost, when = "scour_storm", 2600, 0.1, 8, -0.07, 130.0
    push = Tones.drawn(rng, 0.08, 2.2, 44, 14.0, 0.0)
    w, z = 2 * pi * np.array([0.31, 1.45]), np.array([0.05, 0.03])
    drive, seen = np.array([[2.2e-3], [6.0e-3]]), np.array([[1e3, 1e3], [430.0, -900.0]])
    force, wind = looked_up(push, rows, step, fine), np.c_[gust(rng, rows, 5, 0.5), gust(rng, rows, 5, 0.5)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        stiff = w[0] ** 2 * (1 + lost * (t >= when))
        return (x[2], x[3], 2.2e-3 * (force(t) + u[0]) - stiff * x[0] - 2 * z[0] * w[0] * x[2],
                6.0e-3 * (force(t) + u[1]) - w[1] ** 2 * x[1] - 2 * z[1] * w[1] * x[3])  # fmt: skip

    x, _ = rk(slope, [0, 0, 0, 0], rows, step, told(wind), fine)
    y = x[:, :2] @ seen.T
    wrong = np.array([[skewed(rng, 1, 0.02)], [1.0]])
    ways = {"exciter": "kN"}, {"tower_top_fa": "mm", "tower_mid_fa": "mm"}
    model = state_space(0, *ways, modes(w, z, drive * wrong, seen))
    columns: dict[str, Column] = {
        "exciter": (push(np.arange(rows) * step), "kN", "input"),
        "tower_top_fa": (logged(rng, y[:, 0], 0.02, ends=(-200, 200), bits=14), "mm", "output"),
        "tower_mid_fa": (logged(rng, y[:, 1], 0.02, lag=4, ends=(-100, 100), bits=14), "mm", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("stiffness_change",), (), {"stiffness_change": lost, "time_s": when},
                machine=WT)  # fmt: skip


def barge(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Surge of a floating turbine that tugs pull off its place (Faltinsen 1990, Sea Loads, chapters 7 and 8).

    Hidden: 60 kN/(m/s)2 of drag on its columns. A winch's force is recorded in four pulls, slow waves are not; the
    null's model has the drag, in six short recordings with coloured noise.
    """
    name, rows, step, fine, drag = "null_barge" if complete else "barge_pull", 2400, 1.0, 4, 60.0
    u = np.c_[ramps(rng, rows, 55, (-350, 450), 25.0), gust(rng, rows, 12, 4.0)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (u[0] + u[1] - 58 * x[0] - 45 * x[1] - drag * x[1] * abs(x[1])) / 5600

    x, _ = rk(slope, [0.5, 0], rows, step, told(u), fine)
    true = {"ms": 5600.0, "km": 58.0, "c1": 45.0} | ({"c2": drag} if complete else {})
    free = declared(rng, {k: v for k, v in true.items() if k != "ms"}, 0.08, km="kN/m", c1="kN s/m")
    more = " - c2*v*abs(v)" if complete else ""
    text = equations("surge", {"ms": fixed(rng, 5600.0, "t", 0.02)} | free, {
        "q": ("v", 0.5, "m"), "v": (f"(winch - km*q - c1*v{more})/ms", 0, "m/s")},
        {"platform_surge": ("q", "m"), "platform_surge_speed": ("v", "m/s")})  # fmt: skip
    lag = 8 if complete else 0
    columns: dict[str, Column] = {
        "winch": (u[:, 0], "kN", "input"),
        "platform_surge": (logged(rng, x[:, 0], 0.015, lag=lag, ends=(-30, 30), bits=13), "m", "output"),
        "platform_surge_speed": (logged(rng, x[:, 1], 0.03, lag=4, ends=(-3, 3), bits=12), "m/s",
                                 "output")}  # fmt: skip
    context = "blades = 3\noffshore = true\n"
    if complete:
        return Case(name, step, columns, text, machine=WT, context=context, cuts=(400, 800, 1200, 1600, 2000),
                    true=true)  # fmt: skip
    return Case(name, step, columns, text, ("quadratic_damping",), (), {"c2": drag}, machine=WT, context=context,
                cuts=(600, 1200, 1800), true=true)  # fmt: skip


TOWERS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "damper_guides": (406, guides), "lattice_tower": (407, lattice), "downwind_shadow": (408, shadow),
    "nacelle_tilt": (409, tilted), "scour_storm": (410, scour), "barge_pull": (411, barge),
}  # fmt: skip
