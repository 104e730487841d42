"""Rotors, pitch links, converters and power meters of wind turbines; a play, a limit, a lag or cables are not told.

Every plant is a function of a random generator that returns its case. With `complete` nothing is hidden, which is a
null in sixth_author_nulls.py. At the recorded inputs, without noise, gusts and logger, an effect of this set changes an
output by a tenth to a half of its deviation, speeds that nearly stand by more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi

import numpy as np
from second_author_parts import Case, Column, Tones, equations, flips, plateaus
from sixth_author_parts import LOOP, WT, declared, fixed, gust, hiss, logged
from third_author_parts import looked_up, rk, told


def linkage(rng: np.random.Generator) -> Case:
    """A rotor of 850 kW whose blades are turned by one rod through levers (Burton et al. 2011, section 8.2).

    Hidden: 7 mm of play in the worn bearings of the levers. The speed loop moves the rod; the wind of a mast is
    recorded, gusts at the rotor are not.
    """
    name, rows, step, fine, play = "pitch_linkage", 2600, 0.1, 5, 7.0
    air, place, total = Tones.drawn(rng, 0.004, 0.3, 40, 1.0, 14.0), [150.0], [150.0]
    wind, heard, blown = looked_up(air, rows, step, fine), hiss(rng, rows, 0.004), gust(rng, rows, 7, 0.08)
    shake = flips(rng, rows, 17, 5.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 2.6
        total[0] += 22 * step * error
        asked = total[0] + 75 * error + shake[k]
        place[0] = min(max(place[0], asked - play / 2), asked + play / 2)
        return asked, place[0], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = wind(t) + u[2] - 14
        return ((62 * v - 2.8 * (u[1] - 150) - 210 * (x[0] - 2.6)) / 620,)

    x, u = rk(slope, [2.6], rows, step, command, fine)
    v = air(np.arange(rows) * step)
    moment = 9.0 + 0.95 * (v + u[:, 2] - 14) - 0.052 * (u[:, 1] - 150)
    true = {"J": 620.0, "kv": 62.0, "kb": 2.8, "kw": 210.0, "m0": 9.0, "gv": 0.95, "gb": 0.052}
    units = {"kv": "kN s", "kb": "kN m/mm", "kw": "kN m s", "m0": "MN m", "gb": "MN m/mm"}
    free = declared(rng, {k: true[k] for k in ("kv", "kb", "kw", "m0", "gv", "gb")}, **units)
    text = equations("rotor and rod", {"J": fixed(rng, 620.0, "1000 kg m2", 0.02)} | free, {
        "om": ("(kv*(wind - 14) - kb*(rod - 150) - kw*(om - 2.6))/J", 2.6, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"),
         "tower_base_fa_moment": ("m0 + gv*(wind - 14) - gb*(rod - 150)", "MN m")})  # fmt: skip
    columns: dict[str, Column] = {
        "rod": (u[:, 0], "mm", "input"), "wind": (np.round(v, 2), "m/s", "disturbance"),
        "rotor_speed": (logged(rng, (x[:, 0] + heard) * 30 / pi, 0.0, ends=(0, 50), bits=14), "rpm", "output"),
        "tower_base_fa_moment": (logged(rng, moment, 0.03, lag=4, ends=(0, 20), bits=13), "MN m",
                                 "output")}  # fmt: skip
    return Case(name, step, columns, text, ("backlash",), (), {"width": play}, machine=WT,
                context="blades = 3\n" + LOOP, lost=8, true=true)  # fmt: skip


def metered(rng: np.random.Generator) -> Case:
    """A rotor of 2 MW below rated wind whose power goes through a transducer of the grid (IEC 61400-12-1).

    Hidden: the transducer follows with 1.2 s. The torque follows the speed and is shaken by the grid's service; wind of
    a lidar is recorded, gusts are not.
    """
    name, rows, step, fine, tau = "power_meter", 2400, 0.2, 5, 1.2
    air = Tones.drawn(rng, 0.003, 0.2, 40, 0.9, 8.5)
    wind, shake, blown = looked_up(air, rows, step, fine), flips(rng, rows, 15, 55.0), gust(rng, rows, 6, 12.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return 245 * x[0] ** 2 + shake[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        rotor = 705 + 165 * (wind(t) - 8.5) - 390 * (x[0] - 1.7) + u[1]
        return (rotor - u[0]) / 3900, (0.92 * u[0] * x[0] - x[1]) / tau

    x, u = rk(slope, [1.7, 1107], rows, step, command, fine)
    true = {"J": 3.9, "q0": 705.0, "kv": 165.0, "kw": 390.0, "ef": 0.92}
    units = {"q0": "kN m", "kv": "kN s", "kw": "kN m s"}
    free = declared(rng, {k: true[k] for k in ("q0", "kv", "kw", "ef")}, 0.08, **units)
    text = equations("rotor and power", {"J": fixed(rng, 3.9, "1e6 kg m2")} | free, {
        "om": ("(q0 + kv*(wind - 8.5) - kw*(om - 1.7) - torque)/(1000*J)", 1.7, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "power": ("ef*torque*om", "kW")})  # fmt: skip
    columns: dict[str, Column] = {
        "torque": (u[:, 0], "kN m", "input"),
        "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
        "rotor_speed": (logged(rng, x[:, 0] * 30 / pi, 0.01, ends=(0, 30), bits=14), "rpm", "output"),
        "power": (logged(rng, x[:, 1], 0.015, lag=4, ends=(0, 3000), bits=13), "kW", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_lag",), (), {"tau_s": tau}, machine=WT,
                context="blades = 3\n" + LOOP, cuts=(1200,), true=true)  # fmt: skip


def clipped(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A rotor of 300 kW on a converter that follows the speed squared (Bianchi et al. 2007, chapter 4).

    Hidden: a warm converter gives 67 kN m at most, whatever is asked for. Wind of a mast is recorded, gusts at the
    rotor are not; the null's converter gives all, its logger filters against aliases.
    """
    name, rows, step, fine = "null_torque_loop" if complete else "converter_clip", 2400, 0.1, 4
    most, air = 1e9 if complete else 67.0, Tones.drawn(rng, 0.003, 0.25, 40, 1.0, 9.0)
    wind, shake, blown = looked_up(air, rows, step, fine), flips(rng, rows, 19, 4.0), gust(rng, rows, 6, 1.2)
    heard = hiss(rng, rows, 0.006)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        asked = 3.6 * (x[0] + heard[k]) ** 2 + shake[k]
        return asked, min(asked, most), blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return ((58 + 13 * (wind(t) - 9) - 20 * (x[0] - 4) + u[2] - u[1]) / 95,)

    x, u = rk(slope, [4.0], rows, step, command, fine)
    true = {"J": 95.0, "q0": 58.0, "kv": 13.0, "kw": 20.0, "ef": 0.93}
    units = {"q0": "kN m", "kv": "kN s", "kw": "kN m s"}
    free = declared(rng, {k: true[k] for k in ("q0", "kv", "kw", "ef")}, 0.08, **units)
    text = equations("rotor and converter", {"J": fixed(rng, 95.0, "1000 kg m2")} | free, {
        "om": ("(q0 + kv*(wind - 9) - kw*(om - 4) - torque)/J", 4.0, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "power": ("ef*torque*om", "kW")})  # fmt: skip
    power, corner = 0.93 * u[:, 1] * x[:, 0], 0.4 if complete else 0.0
    columns: dict[str, Column] = {
        "torque": (u[:, 0], "kN m", "input"),
        "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
        "rotor_speed": (logged(rng, (x[:, 0] + heard) * 30 / pi, 0.0, ends=(0, 80), bits=14), "rpm", "output"),
        "power": (logged(rng, power, 0.02, lag=3, ends=(-50, 500), bits=13, corner=corner), "kW",
                  "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, machine=WT, context="blades = 3\n" + LOOP, lost=9, true=true)
    return Case(name, step, columns, text, ("input_saturation",), (), {"high": most}, machine=WT,
                context="blades = 3\n" + LOOP, true=true)  # fmt: skip


def cables(rng: np.random.Generator) -> Case:
    """Three blades that are pitched one by one, strain gauges at their roots (Bossanyi 2003, Wind Energy 6).

    The fault: the gauges of the second and the third blade are plugged into each other's place. A service computer
    moves the pitch, all together and each by itself; the wind of a lidar is recorded, the blades' own gusts are not.
    """
    name, rows, step, fine = "blade_cables", 2200, 0.1, 6
    air, w0 = Tones.drawn(rng, 0.004, 0.5, 40, 0.9, 13.0), 2 * pi * 0.8
    wind, both = looked_up(air, rows, step, fine), plateaus(rng, rows, 70, 6.0, 10.0)
    moved = [both + flips(rng, rows, d, 0.55) for d in (13, 17, 22)]
    u = np.column_stack(moved + [gust(rng, rows, 6, 25.0) for _ in range(3)])

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        found: list[float] = []
        for k in range(3):
            load = 2400 + 260 * (wind(t) - 13) - 210 * (u[k] - 8) + u[3 + k]
            found += [x[2 * k + 1], w0**2 * (load - x[2 * k]) - 0.8 * w0 * x[2 * k + 1]]
        return found

    x, _ = rk(slope, [2400, 0] * 3, rows, step, told(u), fine)
    true = {"f0": 0.8, "ze": 0.4, "m0": 2400.0, "gv": 260.0, "gp": 210.0}
    states, outputs = {}, {}
    for k in (1, 2, 3):
        load = f"m0 + gv*(wind - 13) - gp*(pitch{k} - 8)"
        states[f"m{k}"] = (f"d{k}", 2400.0, "kN m")
        states[f"d{k}"] = (f"(2*pi*f0)**2*({load} - m{k}) - 2*ze*2*pi*f0*d{k}", 0.0, "kN m/s")
        outputs[f"blade{k}_flap_moment"] = (f"m{k}", "kN m")
    values = declared(rng, true, 0.08, f0="Hz", m0="kN m", gv="kN s", gp="kN m/deg")
    text = equations("three pitched blades", values, states, outputs)
    columns: dict[str, Column] = {f"pitch{k + 1}": (u[:, k], "deg", "input") for k in range(3)}
    columns["wind"] = (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance")
    for k, source in enumerate((0, 2, 1)):
        moment = logged(rng, x[:, 2 * source], 0.02, lag=4, ends=(0, 5000), bits=13)
        columns[f"blade{k + 1}_flap_moment"] = (moment, "kN m", "output")
    return Case(name, step, columns, text, ("data_channel_swap",), (), machine=WT, context="blades = 3\n", lost=7,
                headings=True, true=true)  # fmt: skip


def derated(rng: np.random.Generator) -> Case:
    """A rotor of 3 MW above rated wind that a grid operator derates (Hansen 2015, chapter 12).

    Hidden: the pitch turns 2.2 degrees a second at most, and a clogged cooler costs 4 % of the power between shaft and
    grid. The speed loop and the operator's jumps move the pitch; gusts are not recorded.
    """
    name, rows, step, fine, rate, lost = "derated_rotor", 2600, 0.1, 5, 2.2, 0.04
    air, total = Tones.drawn(rng, 0.003, 0.2, 40, 1.0, 15.0), [10.0]
    wind, heard, blown = looked_up(air, rows, step, fine), hiss(rng, rows, 0.003), gust(rng, rows, 8, 0.1)
    jumps, turned = flips(rng, rows, 32, 2.2), plateaus(rng, rows, 130, 1500, 1800)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 1.6
        total[0] += 0.9 * step * error
        return total[0] + 6 * error + jumps[k], turned[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        move = max(min(25 * (u[0] - x[1]), rate), -rate)
        rotor = 1650 + 310 * (wind(t) + u[2] - 15) - 260 * (x[1] - 10) - 1700 * (x[0] - 1.6)
        return (rotor - u[1]) / 5200, move

    x, u = rk(slope, [1.6, 10.0], rows, step, command, fine)
    true = {"J": 5200.0, "q0": 1650.0, "kv": 310.0, "kb": 260.0, "kw": 1700.0}
    units = {"q0": "kN m", "kv": "kN s", "kb": "kN m/deg", "kw": "kN m s"}
    free = declared(rng, {k: true[k] for k in ("q0", "kv", "kb", "kw")}, 0.08, **units)
    text = equations("derated rotor", {"J": fixed(rng, 5200.0, "1000 kg m2", 0.02)} | free, {
        "om": ("(q0 + kv*(wind - 15) - kb*(pitch - 10) - kw*(om - 1.6) - torque)/J", 1.6, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "power": ("0.94*torque*om", "kW")})  # fmt: skip
    power = 0.94 * (1 - lost) * u[:, 1] * x[:, 0]
    columns: dict[str, Column] = {
        "pitch": (u[:, 0], "deg", "input"), "torque": (u[:, 1], "kN m", "input"),
        "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
        "rotor_speed": (logged(rng, (x[:, 0] + heard) * 30 / pi, 0.0, ends=(0, 40), bits=15), "rpm", "output"),
        "power": (logged(rng, power, 0.02, lag=3, ends=(0, 4000), bits=14), "kW", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("rate_limit", "efficiency_loss"), (), {"rate_per_s": rate, "loss": lost},
                machine=WT, context="blades = 3\n" + LOOP, true=true)  # fmt: skip


TURBINES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "pitch_linkage": (401, linkage), "power_meter": (402, metered), "converter_clip": (403, clipped),
    "blade_cables": (404, cables), "derated_rotor": (405, derated),
}  # fmt: skip
