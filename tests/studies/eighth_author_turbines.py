"""Wind turbines with pitch, as recordings of power, speeds, pitch and tower acceleration, of which a piece is left out.

As eighth_author_heat.py. The wind that is recorded is a lidar's; small gusts are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, pi, sin

import numpy as np
from eighth_author_parts import Makers, each
from second_author_parts import Case, Column, Tones, equations, flips, known, plateaus, state_space
from sixth_author_parts import LOOP, WT, declared, fixed, gust, hiss, logged, modes, slopes, turning
from third_author_parts import looked_up, rk, told

SETTING = "blades = 3\n"


def unbalanced(rng: np.random.Generator, *, size: float = 6500.0) -> Case:
    """A tower of 5 MW of which both motions are read, its model linear (Jonkman et al. 2009, NREL/TP-500-38060).

    Hidden: the blades' masses differ, by a static moment of 6500 kg m. Wind and pitch bend the tower fore and aft, the
    generator's torque to the side; gains up to 4 % off. One recording of 150 s.
    """
    name, rows, step, fine = "tower_wobbles", 3000, 0.05, 5
    air, turn = Tones.drawn(rng, 0.01, 0.9, 50, 1.1, 0.0), Tones.drawn(rng, 0.02, 0.9, 40, 190.0, 0.0)
    wind, torque, rotor = (
        looked_up(air, rows, step, fine),
        looked_up(turn, rows, step, fine),
        turning(rng, rows, step, 1.24, 0.03),
    )
    pitch, phase, w, z = (
        plateaus(rng, rows, 90, -1.5, 1.5),
        0.6,
        2 * pi * np.array([0.32, 0.33]),
        np.array([0.06, 0.012]),
    )
    u = np.c_[pitch, rotor, gust(rng, rows, 12, 4.0), gust(rng, rows, 12, 1.2)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        a = u[1] + u[2] * (t - u[3])
        fore = 62 * wind(t) - 34 * u[0] + u[4]
        side = 0.014 * torque(t) + u[5] + size * 1e-3 * u[2] ** 2 * sin(a + phase)
        return (x[2], x[3], fore / 410 - w[0] ** 2 * x[0] - 2 * z[0] * w[0] * x[2],
                side / 410 - w[1] ** 2 * x[1] - 2 * z[1] * w[1] * x[3])  # fmt: skip

    x, _ = rk(slope, [0] * 4, rows, step, told(u), fine)
    acc, t, g = slopes(slope, step, x, u)[:, 2:], np.arange(rows) * step, each(rng, [62.0, -34.0, 0.014], 0.04)
    a, b, _, _ = modes(w.tolist(), z.tolist(), np.array([[g[0], g[1], 0], [0, 0, g[2]]]) / 410, np.eye(2))
    ways = {"wind": "m/s", "pitch": "deg", "torque": "kN m"}, {"tower_top_fa_acc": "m/s2", "tower_top_ss_acc": "m/s2"}
    model = state_space(0, *ways, (a, b, a[2:], b[2:]))
    columns: dict[str, Column] = {
        "wind": (np.round(air(t), 2), "m/s", "disturbance"), "pitch": (np.round(pitch, 2), "deg", "input"),
        "torque": (np.round(turn(t), 1), "kN m", "input"), "azimuth": (np.degrees(rotor[:, 0]) % 360, "deg", "azimuth"),
        "tower_top_fa_acc": (logged(rng, acc[:, 0], 0.03, ends=(-2, 2), bits=14), "m/s2", "output"),
        "tower_top_ss_acc": (logged(rng, acc[:, 1], 0.03, ends=(-2, 2), bits=14), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("mass_imbalance",), (), machine=WT,
                context=SETTING + "rated_speed_rad_s = 1.267\n")  # fmt: skip


def _curtailed(rng: np.random.Generator) -> tuple[str, dict[str, float]]:
    """Return the model of a rotor whose wake is always settled, and its true values."""
    true = {"J": 15.0, "kv": 260.0, "kb": 300.0, "kw": 1500.0, "m0": 6.2, "mv": 0.41, "mb": 0.52}
    values = {"J": fixed(rng, 15.0, "1e6 kg m2", 0.02), "ef": known(0.95)} | declared(
        rng, {k: true[k] for k in true if k != "J"}, 0.07, kv="kN s", kb="kN m/deg", kw="kN m s", m0="MN m", mv="MN s",
        mb="MN m/deg")  # fmt: skip
    return equations("curtailed rotor", values, {
        "om": ("(2550 + kv*(wind - 16) - kb*(pitch - 11) - kw*(om - 1.23) - torque)/(1000*J)", 1.23, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "power": ("ef*torque*om/1000", "MW"),
         "blade_flap_moment": ("m0 + mv*(wind - 16) - mb*(pitch - 11)", "MN m")}), true  # fmt: skip


def wake(rng: np.random.Generator, *, size: float = 0.22) -> Case:
    """A rotor of 3.4 MW above rated wind whose grid asks for less power now and then (Bortolotti et al. 2019, IEA 37).

    Hidden: speed and bending answer a change of pitch by 22 % too much at first, and settle over 7 s as the wake does.
    The loop hears the speed with noise, torque follows the grid; two recordings of 300 s.
    """
    name, rows, step, fine, tau, total = "grid_curtailed", 3000, 0.2, 4, 7.0, [11.0]
    air = Tones.drawn(rng, 0.003, 0.2, 40, 0.9, 16)
    wind, asked = looked_up(air, rows, step, fine), plateaus(rng, rows, 130, 2300, 2800)
    shake, heard, blown = flips(rng, rows, 17, 0.8), hiss(rng, rows, 0.002), gust(rng, rows, 6, 0.10)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 1.23
        total[0] += 1.4 * step * error
        return total[0] + 9 * error + shake[k], asked[k], blown[k]

    def felt(t: float, x: Sequence[float], u: Sequence[float]) -> tuple[float, float]:
        return wind(t) + u[2] - 16, u[0] - 11 + size * (u[0] - x[1])

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v, b = felt(t, x, u)
        return (2550 + 260 * v - 300 * b - 1500 * (x[0] - 1.23) - u[1]) / 15000, (u[0] - x[1]) / tau

    x, u = rk(slope, [1.23, 11.0], rows, step, command, fine)
    v, b = np.array([felt(k * step, x[k].tolist(), u[k].tolist()) for k in range(rows)]).T
    text, true = _curtailed(rng)
    columns: dict[str, Column] = {
        "pitch": (np.round(u[:, 0], 3), "deg", "input"), "torque": (np.round(asked, 0), "kN m", "input"),
        "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
        "rotor_speed": (logged(rng, (x[:, 0] + heard) * 30 / pi, 0.0, ends=(0, 20), bits=15), "rpm", "output"),
        "power": (logged(rng, 0.95e-3 * asked * x[:, 0], 0.02, ends=(0, 8), bits=13), "MW", "output"),
        "blade_flap_moment": (logged(rng, 6.2 + 0.41 * v - 0.52 * b, 0.03, lag=3, ends=(-4, 20), bits=13), "MN m",
                              "output")}  # fmt: skip
    return Case(name, step, columns, text, ("dynamic_inflow",), (), {"overshoot": size}, machine=WT,
                context=SETTING + LOOP, cuts=(1500,), true=true)  # fmt: skip


def shaded(rng: np.random.Generator, *, size: float = 9.0) -> Case:
    """A rotor of 1.5 MW before its tubular tower, below rated wind (Burton et al. 2011, Wind Energy Handbook, ch. 5).

    Hidden: each blade loses 9 kN of thrust over 11 degrees as it passes the tower. Power, speed, pitch, rotor angle and
    the tower's acceleration are recorded, the wind by a lidar; one recording of 150 s.
    """
    name, rows, step, fine, w, wide = "tube_passing", 3000, 0.05, 5, 2 * pi * 0.41, 0.19
    air, blown = Tones.drawn(rng, 0.01, 0.7, 46, 0.7, 9.0), gust(rng, rows, 8, 0.03)
    wind, pitch = looked_up(air, rows, step, fine), plateaus(rng, rows, 140, 0, 3)
    asked, mean = plateaus(rng, rows, 160, 380, 460), 3 * size * wide / (2 * np.sqrt(pi))

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        away = (x[1] + pi / 3) % (2 * pi / 3) - pi / 3
        v = wind(t) + u[2] - x[3] - 9
        push = 150 + 22 * v - 9 * (u[0] - 1.5) - size * exp(-((away / wide) ** 2)) + mean
        return ((420 + 75 * v - 30 * (u[0] - 1.5) - 160 * (x[0] - 1.7) - u[1]) / 3100, x[0], x[3],
                (push - 2.4 * x[3]) / 120 - w * w * x[2])  # fmt: skip

    u = np.c_[np.round(pitch, 2), np.round(asked, 1), blown]
    x, _ = rk(slope, [1.7, float(rng.uniform(0, 6)), 150 / (120 * w * w), 0], rows, step, told(u), fine)
    acc, t = slopes(slope, step, x, u)[:, 3], np.arange(rows) * step
    true = {"J": 3.1, "kv": 75.0, "kb": 30.0, "kw": 160.0, "tv": 22.0, "tb": 9.0, "ft": 0.41, "ct": 2.4, "mt": 120.0}
    values = {"J": fixed(rng, 3.1, "1e6 kg m2", 0.02), "mt": fixed(rng, 120.0, "t", 0.02), "ef": known(0.94)}
    values |= declared(
        rng, {k: true[k] for k in ("kv", "kb", "kw", "tv", "tb", "ct")}, 0.07, kv="kN s", kb="kN m/deg", kw="kN m s",
        tv="kN s/m", tb="kN/deg", ct="kN s/m") | declared(rng, {"ft": 0.41}, 0.02, ft="Hz")  # fmt: skip
    fore = "((150 + tv*(wind - vf - 9) - tb*(pitch - 1.5) - ct*vf)/mt - (2*pi*ft)**2*xf)"
    text = equations("rotor and tube", values, {
        "om": ("(420 + kv*(wind - vf - 9) - kb*(pitch - 1.5) - kw*(om - 1.7) - torque)/(1000*J)", 1.7, "rad/s"),
        "xf": ("vf", 150 / (120 * w * w), "m"), "vf": (fore, 0, "m/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "power": ("ef*torque*om", "kW"),
         "tower_top_fa_acc": (fore, "m/s2")})  # fmt: skip
    columns: dict[str, Column] = {
        "pitch": (u[:, 0], "deg", "input"), "torque": (u[:, 1], "kN m", "input"),
        "wind": (np.round(air(t), 2), "m/s", "disturbance"), "azimuth": (np.degrees(x[:, 1]) % 360, "deg", "azimuth"),
        "rotor_speed": (logged(rng, x[:, 0] * 30 / pi, 0.01, ends=(0, 40), bits=14), "rpm", "output"),
        "power": (logged(rng, 0.94 * asked * x[:, 0], 0.02, ends=(0, 2000), bits=13), "kW", "output"),
        "tower_top_fa_acc": (logged(rng, acc, 0.03, lag=2, ends=(-2, 2), bits=13), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("tower_shadow",), (), machine=WT,
                context=SETTING + "rated_speed_rad_s = 1.8\n", true=true)  # fmt: skip


def _with_tower(rng: np.random.Generator) -> tuple[str, dict[str, float]]:
    """Return the model of a rotor whose pitch acts at once and of its tower, and its true values."""
    true = {"J": 5.2, "kv": 180.0, "kb": 150.0, "kw": 800.0, "tv": 26.0, "tb": 25.0, "ct": 3.0, "ft": 0.36}
    true |= {"mt": 190.0}
    values = {"J": fixed(rng, 5.2, "1e6 kg m2", 0.02), "mt": fixed(rng, 190.0, "t", 0.02), "ef": known(0.95)}
    values |= declared(
        rng, {k: true[k] for k in ("kv", "kb", "kw", "tv", "tb", "ct")}, 0.06, kv="kN s", kb="kN m/deg", kw="kN m s",
        tv="kN s/m", tb="kN/deg", ct="kN s/m") | declared(rng, {"ft": 0.36}, 0.02, ft="Hz")  # fmt: skip
    fore = "((210 + tv*(wind - vf - 15.5) - tb*(pitch - 10) - ct*vf)/mt - (2*pi*ft)**2*xf)"
    return equations("rotor, generator, tower", values, {
        "om": ("(1250 + kv*(wind - vf - 15.5) - kb*(pitch - 10) - kw*(om - 1.65) - torque)/(1000*J)", 1.65, "rad/s"),
        "xf": ("vf", 210 / (190 * (2 * pi * 0.36) ** 2), "m"), "vf": (fore, 0, "m/s")},
        {"generator_speed": ("91*om*30/pi", "rpm"), "power": ("ef*torque*om", "kW"),
         "tower_top_fa_acc": (fore, "m/s2")}), true  # fmt: skip


def losing(rng: np.random.Generator, *, size: tuple[float, float] = (0.4, 0.04)) -> Case:
    """A rotor of 2.3 MW above rated wind with its tower (Hansen 2015, Aerodynamics of Wind Turbines), two recordings.

    Hidden: the pitch demand reaches the blades 0.4 s late, and gearbox and generator lose 4 % more than the model says.
    Generator speed, power and the tower's acceleration are read; the loop hears the speed with noise.
    """
    name, rows, step, fine, (dead, loss), w = "late_and_lossy", 2400, 0.1, 4, size, 2 * pi * 0.36
    air, total, behind = Tones.drawn(rng, 0.004, 0.3, 44, 0.8, 15.5), [10.0], round(dead / step)
    wind, asked, given = looked_up(air, rows, step, fine), plateaus(rng, rows, 110, 1150, 1350), [10.0] * behind
    shake, heard, blown = flips(rng, rows, 13, 0.9), hiss(rng, rows, 0.002), gust(rng, rows, 8, 0.08)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 1.65
        total[0] += 0.9 * step * error
        given.append(round(total[0] + 6 * error + shake[k], 3))
        return given[-1], asked[k], blown[k], given[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v, b = wind(t) + u[2] - x[2] - 15.5, u[3] - 10
        push = 210 + 26 * v - 25 * b - 3.0 * x[2]
        return (1250 + 180 * v - 150 * b - 800 * (x[0] - 1.65) - u[1]) / 5200, x[2], push / 190 - w * w * x[1]

    x, u = rk(slope, [1.65, 210 / (190 * w * w), 0], rows, step, command, fine)
    acc = slopes(slope, step, x, u)[:, 2]
    text, true = _with_tower(rng)
    columns: dict[str, Column] = {
        "pitch": (u[:, 0], "deg", "input"), "torque": (np.round(asked, 1), "kN m", "input"),
        "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
        "generator_speed": (logged(rng, 91 * (x[:, 0] + heard) * 30 / pi, 0.0, ends=(0, 2400), bits=14), "rpm",
                            "output"),
        "power": (logged(rng, 0.95 * (1 - loss) * asked * x[:, 0], 0.02, ends=(0, 3000), bits=13), "kW", "output"),
        "tower_top_fa_acc": (logged(rng, acc, 0.03, lag=2, ends=(-4, 4), bits=13), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("transport_delay", "efficiency_loss"), (), {"delay_s": dead, "loss": loss},
                machine=WT, context=SETTING + LOOP, cuts=(1200,), true=true)  # fmt: skip


TURBINES: Makers = {
    "tower_wobbles": (628, unbalanced), "grid_curtailed": (629, wake), "tube_passing": (630, shaded),
    "late_and_lossy": (631, losing),
}  # fmt: skip
