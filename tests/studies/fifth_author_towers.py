"""Towers and blades of wind turbines, of which models lack a load once a turn, a mode or what lags in the air.

Every plant is a function of a random generator that returns its case. A size is the deviation of what the effect
changes over that of the output, without noise, gusts and logger, at the recorded inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, pi, sin

import numpy as np
from fifth_author_parts import LOOP, WT, declared, frozen, gust, hiss, logged, slopes, turning
from second_author_parts import Case, Column, Tones, equations, flips, known, plateaus
from third_author_parts import looked_up, rk, told


def pitched(rng: np.random.Generator) -> Case:
    """A tower of 2 MW whose rotor has a blade at another pitch (Niebsch and Ramlau 2014, Renewable Energy 70).

    Hidden: a force once a turn fore and aft, growing with the wind squared, and half of it to the side a quarter turn
    later. Size: 9 % of the fore-aft, 15 % of the side-side acceleration. Wind stands beside as scheduling, gusts on the
    tower are not recorded.
    """
    name, rows, step, fine = "blade_pitched", 3000, 0.08, 6
    push, air = Tones.drawn(rng, 0.02, 1.5, 40, 8e3, 2.4e5), Tones.drawn(rng, 0.001, 0.02, 16, 1.2, 9.0)
    twist, rotor = Tones.drawn(rng, 0.01, 1.0, 30, 90, 900), turning(rng, rows, step, 1.75, 0.07)
    thrust, torque, wind = (looked_up(a, rows, step, fine) for a in (push, twist, air))
    u = np.c_[rotor, gust(rng, rows, 12, 900.0), gust(rng, rows, 12, 300.0)]
    even, odd, ratio, w = 950.0, -520.0, 0.5, 2 * pi * 0.36

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        a, v = u[0] + u[1] * (t - u[2]), wind(t)
        grown = (v / 9) ** 2
        fore = thrust(t) + 8e3 * (v - 9) + grown * (even * cos(a) + odd * sin(a)) + u[3]
        side = 21.0 * torque(t) + ratio * grown * (even * sin(a) - odd * cos(a)) + u[4]
        return (x[1], (fore - 5.2e4 * x[1] - 1.9e5 * w**2 * x[0]) / 1.9e5,
                x[3], (side - 2.2e4 * x[3] - 1.9e5 * w**2 * x[2]) / 1.9e5)  # fmt: skip

    start = [0.247, 0, 0.0194, 0]
    x, _ = rk(slope, start, rows, step, told(u), fine)
    t, acc = np.arange(rows) * step, slopes(slope, step, x, u)
    true = {"mt": 190.0, "kt": 190 * w**2, "cf": 52.0, "cs": 22.0, "gt": 21.0}
    fore, side = "(thrust - cf*vf - kt*xf)/mt", "(gt*torque/1000 - cs*vs - kt*xs)/mt"
    text = equations("tower", declared(rng, true, mt="t", kt="kN/m", cf="kN s/m", cs="kN s/m"), {
        "xf": ("vf", start[0], "m"), "vf": (fore, 0, "m/s"), "xs": ("vs", start[2], "m"), "vs": (side, 0, "m/s")},
        {"tower_top_fa_acc": (fore, "m/s2"), "tower_top_ss_acc": (side, "m/s2")})  # fmt: skip
    columns: dict[str, Column] = {
        "thrust": ((push(t) + 8e3 * (air(t) - 9)) / 1e3, "kN", "input"), "torque": (twist(t), "kN m", "input"),
        "wind": (np.round(air(t), 2), "m/s", "scheduling"),
        "azimuth": (rotor[:, 0] % (2 * pi), "rad", "azimuth")}  # fmt: skip
    for k, key in ((1, "tower_top_fa_acc"), (3, "tower_top_ss_acc")):
        columns[key] = (logged(rng, acc[:, k], 0.03, lag=3, ends=(-1, 1), bits=14), "m/s2", "output")
    return Case(name, step, columns, text, ("aero_imbalance",), (), {"side_over_fore_aft": ratio}, machine=WT,
                context="blades = 3\nrated_speed_rad_s = 1.8\n", lost=6, true=true)  # fmt: skip


def sheared(rng: np.random.Generator) -> Case:
    """Three flapping blades in a wind that grows with height (Burton et al. 2011, Wind Energy Handbook, chapter 3).

    Hidden: 95 kN m once a turn in every blade's moment, most when it is up. Size: 24 % of each moment. The collective
    pitch is moved by a service computer, the mast's wind is common to the blades, their own gusts nobody records.
    """
    name, rows, step, fine = "blade_shear", 2200, 0.1, 8
    air, rotor = Tones.drawn(rng, 0.004, 0.6, 40, 1.1, 12), turning(rng, rows, step, 1.55, 0.07)
    wind, w0, vertical = looked_up(air, rows, step, fine), 2 * pi * 0.95, 95.0
    own = [gust(rng, rows, 8, 14.0) for _ in range(3)]
    u = np.column_stack([plateaus(rng, rows, 60, 4.0, 9.0), *own])

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        load, found = 210 * wind(t) - 95 * u[0], []
        for k in range(3):
            found += [x[2 * k + 1], w0**2 * (load + u[1 + k] - x[2 * k]) - 0.7 * w0 * x[2 * k + 1]]
        return found

    x, _ = rk(slope, [1900, 0] * 3, rows, step, told(u), fine)
    true = {"f0": 0.95, "ze": 0.35, "gv": 210.0, "gp": 95.0}
    states, outputs = {}, {}
    for k in (1, 2, 3):
        states[f"m{k}"] = (f"d{k}", 1900.0, "kN m")
        states[f"d{k}"] = (f"(2*pi*f0)**2*(gv*wind - gp*pitch - m{k}) - 2*ze*2*pi*f0*d{k}", 0.0, "kN m/s")
        outputs[f"blade{k}_flap_moment"] = (f"m{k}", "kN m")
    values = declared(rng, true, f0="Hz", gv="kN s", gp="kN m/deg")
    text = equations("three blades", values, states, outputs)
    columns: dict[str, Column] = {
        "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"), "pitch": (u[:, 0], "deg", "input"),
        "azimuth": (np.degrees(rotor[:, 0]) % 360, "deg", "azimuth")}  # fmt: skip
    for k in range(3):
        moment = x[:, 2 * k] + vertical * np.cos(rotor[:, 0] + 2 * pi * k / 3)
        columns[f"blade{k + 1}_flap_moment"] = (logged(rng, moment, 0.02, lag=5, ends=(0, 4000), bits=13), "kN m",
                                                "output")  # fmt: skip
    return Case(name, step, columns, text, ("wind_shear",), (), {"vertical": vertical}, machine=WT,
                context="blades = 3\nrated_speed_rad_s = 1.6\n", lost=10, headings=True, true=true)  # fmt: skip


def flapping(rng: np.random.Generator) -> Case:
    """A rotor of 2.3 MW above rated wind whose blades bend flapwise (Hansen 2007, Wind Energy 10).

    Hidden: 0.37 of the moment at a blade's root goes by a mode at 0.8 Hz with a damping of 0.25, the rest is there at
    once, as all of the model's. Size: 28 % of the moment. The loop hears the speed with noise; the lidar's wind lacks
    gusts.
    """
    name, rows, step, fine = "blade_bends", 2600, 0.05, 6
    air, total = Tones.drawn(rng, 0.004, 1.4, 44, 1.0, 13), [8.0]
    wind, w, d, share = looked_up(air, rows, step, fine), 2 * pi * 0.8, 0.25, 0.37
    shake, heard, blown = flips(rng, rows, 14, 0.5), hiss(rng, rows, 0.003), gust(rng, rows, 12, 0.08)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 1.9
        total[0] += 0.8 * step * error
        return max(min(total[0] + 5 * error + shake[k], 25), 0), blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = wind(t) + u[1] - 13
        load = 260 * v - 190 * (u[0] - 8)
        return (140 * v - 95 * (u[0] - 8) - 700 * (x[0] - 1.9)) / 4200, x[2], w * w * (load - x[1]) - 2 * d * w * x[2]

    x, u = rk(slope, [1.9, 0, 0], rows, step, command, fine)
    v = air(np.arange(rows) * step)
    moment = 1850 + (1 - share) * (260 * (v + blown - 13) - 190 * (u[:, 0] - 8)) + share * x[:, 1]
    true = {"kv": 140.0, "kb": 95.0, "kw": 700.0, "m0": 1850.0, "gv": 260.0, "gp": 190.0}
    units = {"m0": "kN m", "gv": "kN s", "gp": "kN m/deg"}
    values = {"J": known(4.2, "1e6 kg m2")} | declared(rng, true, **units)
    text = equations("rotor and blade", values, {
        "om": ("(kv*(wind - 13) - kb*(pitch - 8) - kw*(om - 1.9))/(1000*J)", 1.9, "rad/s")},
        {"rotor_speed": ("om", "rad/s"),
         "blade1_flap_moment": ("m0 + gv*(wind - 13) - gp*(pitch - 8)", "kN m")})  # fmt: skip
    columns = {"pitch": (u[:, 0], "deg", "input"), "wind": (np.round(v, 2), "m/s", "disturbance"),
               "rotor_speed": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 4), bits=14), "rad/s", "output"),
               "blade1_flap_moment": (logged(rng, moment, 0.03, lag=3, ends=(0, 5000), bits=13), "kN m",
                                      "output")}  # fmt: skip
    return Case(name, step, columns, text, ("blade_flap",), ("structural_mode",), {"frequency_hz": 0.8}, machine=WT,
                context="blades = 3\n" + LOOP, true=true)  # fmt: skip


def edging(rng: np.random.Generator) -> Case:
    """A rotor of 1 MW whose blades ring edgewise as its generator's torque jumps (Riziotis et al. 2004, Wind Energy 7).

    Hidden: half of what the torque bends a blade's root goes by a mode at 1.45 Hz with a damping of 0.03. Size: 7 % of
    the moment. The logger has taken the weight out of the moment; the torque follows the speed and is shaken. Once the
    reading hangs.
    """
    name, rows, step, fine = "blade_edges", 2800, 0.04, 6
    air, w, d, share = Tones.drawn(rng, 0.004, 0.4, 40, 0.9, 9), 2 * pi * 1.45, 0.03, 0.5
    wind, shake, blown = looked_up(air, rows, step, fine), flips(rng, rows, 21, 9.0), gust(rng, rows, 8, 3.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return 72 * x[0] ** 2 + shake[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = wind(t) - 9
        rotor = 390 + 95 * v - 130 * (x[0] - 2.33) + u[1]
        return (rotor - u[0]) / 950, x[2], w * w * (0.31 * u[0] - x[1]) - 2 * d * w * x[2]

    x, u = rk(slope, [2.33, 120.9, 0], rows, step, command, fine)
    v = air(np.arange(rows) * step)
    moment = (1 - share) * 0.31 * u[:, 0] + share * x[:, 1] + 7.5 * (v - 9)
    true = {"J": 950.0, "q0": 390.0, "kv": 95.0, "kw": 130.0, "ge": 0.31, "ga": 7.5}
    units = {"J": "1000 kg m2", "q0": "kN m", "kv": "kN s", "kw": "kN m s", "ga": "kN s"}
    text = equations("rotor and edge", declared(rng, true, **units), {
        "om": ("(q0 + kv*(wind - 9) - kw*(om - 2.33) - torque)/J", 2.33, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "blade1_edge_moment": ("ge*torque + ga*(wind - 9)", "kN m")})  # fmt: skip
    speed = logged(rng, x[:, 0] * 30 / pi, 0.01, ends=(0, 60), bits=14)
    edge = frozen(rng, logged(rng, moment, 0.03, lag=4, ends=(0, 400), bits=13), 1, 25)
    columns = {"torque": (u[:, 0], "kN m", "input"), "wind": (np.round(v, 2), "m/s", "disturbance"),
               "rotor_speed": (speed, "rpm", "output"), "blade1_edge_moment": (edge, "kN m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("blade_edge",), ("structural_mode",), {"frequency_hz": 1.45}, machine=WT,
                context="blades = 3\n" + LOOP, true=true)  # fmt: skip


def sideways(rng: np.random.Generator) -> Case:
    """A tower of 3 MW that the generator's torque bends to the side (Burton et al. 2011, section 8.3).

    Hidden: 0.6 of the moment at its foot goes by a mode at 0.31 Hz with a damping of 0.02; the model has it at once.
    Size: 28 % of the moment. Side gusts that nobody records ring the mode; the torque follows the speed, and the wind,
    turbulent, is not recorded. A filter is on the moment, there are two recordings.
    """
    name, rows, step, fine = "tower_sideways", 2600, 0.2, 6
    air, w, d, share = Tones.drawn(rng, 0.002, 0.25, 40, 1.1, 8.5), 2 * pi * 0.31, 0.02, 0.6
    wind, shake, blown = looked_up(air, rows, step, fine), flips(rng, rows, 40, 70.0), gust(rng, rows, 3, 20.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return 1100 * x[0] ** 2 + shake[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        rotor = 1240 + 300 * (wind(t) - 8.5) - 900 * (x[0] - 1.06)
        return (rotor - u[0]) / 1.1e4, x[2], w * w * (1.25 * u[0] + u[1] - x[1]) - 2 * d * w * x[2]

    x, u = rk(slope, [1.06, 1550, 0], rows, step, command, fine)
    moment = (1 - share) * (1.25 * u[:, 0] + blown) + share * x[:, 1]
    true = {"J": 11.0, "q0": 1240.0, "kw": 900.0, "gs": 1.25}
    units = {"J": "1e6 kg m2", "q0": "kN m", "kw": "kN m s"}
    text = equations("rotor and tower", declared(rng, true, **units), {
        "om": ("(q0 - kw*(om - 1.06) - torque)/(1000*J)", 1.06, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "tower_base_ss_moment": ("gs*torque", "kN m")})  # fmt: skip
    columns = {"torque": (u[:, 0], "kN m", "input"),
               "rotor_speed": (logged(rng, x[:, 0] * 30 / pi, 0.01, ends=(0, 25), bits=14), "rpm", "output"),
               "tower_base_ss_moment": (logged(rng, moment, 0.02, ends=(0, 6000), bits=14, corner=0.45), "kN m",
                                        "output")}  # fmt: skip
    return Case(name, step, columns, text, ("tower_side_side",), ("structural_mode",),
                {"frequency_hz": 0.31}, machine=WT, context="blades = 3\n" + LOOP, cuts=(1300,), true=true)  # fmt: skip


def shed(rng: np.random.Generator) -> Case:
    """A rotor of 10 m in a wind tunnel whose pitch jumps (Hand et al. 2001, NREL/TP-500-29955; R. T. Jones 1938).

    Hidden: half of the blades' answer to the pitch builds up, two thirds of it with a time constant of 0.3/6.6 s, the
    rest with 0.3 s. Size: 22 % of the moment, 7 % of the power. A generator with slip holds the speed; the tunnel's
    turbulence is not recorded.
    """
    name, rows, step, fine, half, tau = "tunnel_steps", 3200, 0.02, 6, 0.5, 0.3
    u = np.c_[plateaus(rng, rows, 40, 1.0, 6.0) + flips(rng, rows, 7, 0.7), gust(rng, rows, 5, 0.05)]
    push = Tones.drawn(rng, 0.02, 0.5, 16, 0.35, 8.0)
    wind = looked_up(push, rows, step, fine)

    def felt(x: Sequence[float], pitch: float) -> float:
        return pitch - half * (pitch - (2 * x[1] + x[2]) / 3)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        torque = 0.95 + 0.28 * (wind(t) + u[1] - 8) - 0.11 * (felt(x, u[0]) - 3.5)
        return ((torque - 1.9 * (x[0] - 7.0)) / 0.95, (u[0] - x[1]) * 6.6 / tau, (u[0] - x[2]) / tau)

    first = float(u[0, 0])
    x, _ = rk(slope, [7.5, first, first], rows, step, told(u), fine)
    v, late = push(np.arange(rows) * step), np.array([felt(a, b) for a, b in zip(x, u[:, 0], strict=True)])
    moment = 1.35 + 0.19 * (v + u[:, 1] - 8) - 0.13 * (late - 3.5)
    true = {"J": 0.95, "q0": 0.95, "kv": 0.28, "kb": 0.11, "sl": 1.9, "m0": 1.35, "gv": 0.19, "gp": 0.13}
    units = {"J": "1000 kg m2", "q0": "kN m", "m0": "kN m", "gp": "kN m/deg"}
    text = equations("tunnel rotor", declared(rng, true, **units), {
        "om": ("(q0 + kv*(wind - 8) - kb*(pitch - 3.5) - sl*(om - 7))/J", 7.5, "rad/s")},
        {"shaft_power": ("sl*(om - 7)*om", "kW"),
         "blade1_flap_moment": ("m0 + gv*(wind - 8) - gp*(pitch - 3.5)", "kN m")})  # fmt: skip
    power = 1.9 * (x[:, 0] - 7) * x[:, 0]
    columns = {"pitch": (u[:, 0], "deg", "input"), "wind": (np.round(v, 3), "m/s", "disturbance"),
               "shaft_power": (logged(rng, power, 0.015, ends=(0, 20), bits=14, jitter=0.02), "kW", "output"),
               "blade1_flap_moment": (logged(rng, moment, 0.02, ends=(0, 4), bits=14), "kN m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("unsteady_aero",), (), {"lagging_share": half, "tau_s": tau}, machine=WT,
                context="blades = 2\n", true=true)  # fmt: skip


TOWERS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "blade_pitched": (301, pitched), "blade_shear": (302, sheared), "blade_bends": (303, flapping),
    "blade_edges": (304, edging), "tower_sideways": (305, sideways), "tunnel_steps": (306, shed),
}  # fmt: skip
