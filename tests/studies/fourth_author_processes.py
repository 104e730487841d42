"""Rooms, water, mixers, cells of yeast, blood, heat: what their models or recordings lack.

As fourth_author_machines.py. Integrated by Runge-Kutta steps of third_author_parts.py.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from fourth_author_parts import LOOP, declared, gust, hiss, logged
from second_author_parts import Case, Tones, equations, flips, known, plateaus
from third_author_parts import looked_up, rk, told


def room(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A room, its walls and its radiator in a loop (Madsen and Holst 1995, Energy and Buildings 22).

    Hidden: the valve's stepper stands at multiples of 5 % only. Size: 5 % of the room's and 6 % of the radiator's
    temperature. Sun and people heat, which nobody records. The null's valve stands where it is told to.
    """
    name, rows, step, fine = "null_room" if complete else "radiator_steps", 1700, 60.0, 4
    air = Tones.drawn(rng, 1e-5, 8e-4, 20, 3.0, 4)
    out, total, last = looked_up(air, rows, step, fine), [45.0], [0.0]
    wanted, heard = plateaus(rng, rows, 170, 18.5, 22.5), hiss(rng, rows, 0.03)
    sun, shake = gust(rng, rows, 40, 0.06), flips(rng, rows, 13, 4.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        last[0] = max(min(total[0] + 14 * error + shake[k], 100), 0)
        total[0] += 0.25 * error if 0 < last[0] < 100 else 0.0
        return last[0], last[0] if complete else 5 * round(last[0] / 5), sun[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        warm, wall = 0.052 * (x[2] - x[0]), 0.35 * (x[0] - x[1])
        return ((warm - wall - 0.028 * (x[0] - out(t)) + u[2]) / 260, (wall - 0.03 * (x[1] - out(t))) / 9500,
                (0.034 * u[1] - warm) / 38)  # fmt: skip

    x, u = rk(slope, [20, 18, 40], rows, step, command, fine)
    true = {"Ci": 260.0, "Cr": 38.0, "gv": 0.034, "hr": 0.052, "gw": 0.35, "ua": 0.028}
    values = declared(rng, true, 0.08 if complete else 0.1, Ci="kJ/K", Cr="kJ/K", gv="kW/%", hr="kW/K", ua="kW/K")
    text = equations("room", values | {"Cw": known(9500, "kJ/K")}, {
        "ti": ("(hr*(tr - ti) - gw*(ti - tw) - ua*(ti - outdoor))/Ci", 20, "degC"),
        "tw": ("(gw*(ti - tw) - 0.03*(tw - outdoor))/Cw", 18, "degC"),
        "tr": ("(gv*valve - hr*(tr - ti))/Cr", 40, "degC")},
        {"room": ("ti", "degC"), "radiator": ("tr", "degC")})  # fmt: skip
    columns = {"valve": (u[:, 0], "%", "input"),
               "outdoor": (np.round(air(np.arange(rows) * step), 1), "degC", "disturbance"),
               "room": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 50), bits=12), "degC", "output"),
               "radiator": (logged(rng, x[:, 2], 0.01, ends=(0, 100), bits=13), "degC", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, context=LOOP, lost=12, true=true)
    return Case(name, step, columns, text, ("input_quantisation",), (), {"spacing": 5.0}, context=LOOP, true=true)


def canal(rng: np.random.Generator) -> Case:
    """A reach of an irrigation canal under its gate (Litrico and Fromion 2009, Modeling and Control of Hydrosystems).

    Hidden: the gate's spindle has 1.2 cm of play. Size: 16 % of the level, 9 % of the inflow. The farmers' offtake
    is recorded, their small siphons are not; the level loop hears waves.
    """
    name, rows, step, play = "canal_gate", 2000, 60.0, 1.2
    take, shake = plateaus(rng, rows, 140, 0.5, 1.6), flips(rng, rows, 22, 2.2)
    heard, leak, total, place = hiss(rng, rows, 0.004), gust(rng, rows, 30, 0.03), [30.0], [30.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = 1.5 - x[1] - heard[k]
        total[0] += 0.35 * error
        asked = max(min(total[0] + 26 * error + shake[k], 80), 1)
        place[0] = min(max(place[0], asked - play / 2), asked + play / 2)
        return asked, place[0], take[k], leak[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (0.055 * u[1] - x[0]) / 420, (x[0] - u[2] - 0.38 * max(x[1], 0.01) ** 1.5 - u[3]) / 5200

    x, u = rk(slope, [1.65, 1.4], rows, step, command, 3)
    true = {"gg": 0.055, "tc": 7.0, "As": 5.2, "cw": 0.38}
    text = equations("canal reach", declared(rng, true, gg="m3/s/cm", tc="min", As="1000 m2"), {
        "inflow": ("(gg*gate - inflow)/(60*tc)", 1.65, "m3/s"),
        "h": ("(inflow - offtake - cw*max(h,0.01)**1.5)/(1000*As)", 1.4, "m")},
        {"level": ("100*h", "cm"), "head_flow": ("inflow", "m3/s")})  # fmt: skip
    columns = {"gate": (u[:, 0], "cm", "input"), "offtake": (take, "m3/s", "disturbance"),
               "level": (logged(rng, 100 * (x[:, 1] + heard), 0.0, ends=(0, 300), bits=12), "cm", "output"),
               "head_flow": (logged(rng, x[:, 0], 0.03, lag=3, ends=(0, 5), bits=12), "m3/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("backlash",), (), {"width": play}, context=LOOP, time="time [min]",
                time_scale=1 / 60, true=true)  # fmt: skip


def mixer(rng: np.random.Generator) -> Case:
    """Brine and water in a stirred tank (Coughanowr and LeBlanc 2009, Process Systems Analysis, chapter 5).

    Hidden: the brine comes through a hose with 10 s of dead time, and the conductivity meter ends at 6.2 mS/cm.
    Size: 19 % of the conductivity, one row in twenty of which is cut, and 15 % of the temperature. The brine is
    hot, so that a thermometer feels it, too.
    """
    name, rows, step, late = "mixer_hose", 1500, 4.0, 10.0
    u = np.c_[plateaus(rng, rows, 26, 1.0, 6.5), plateaus(rng, rows, 34, 6, 14), gust(rng, rows, 10, 0.04)]
    brine = u[:, 0].tolist()

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        hot = brine[max(int((t - late) / step + 1e-9), 0)]
        return ((hot / 60 * (16.0 - x[0]) - u[1] / 60 * x[0]) / 12.0,
                (hot / 60 * (55.0 - x[1]) + u[1] / 60 * (11.0 - x[1]) - 0.02 * (x[1] - 20)) / 12.0
                + u[2] / 60)  # fmt: skip

    x, _ = rk(slope, [4.5, 23], rows, step, told(u), 8)
    true = {"Vm": 12.0, "cb": 16.0, "Tb": 55.0, "ul": 0.02}
    text = equations("mixing tank", declared(rng, true, Vm="l", cb="mS/cm", Tb="degC") | {"Tw": known(11, "degC")}, {
        "c": ("(brine/60*(cb - c) - water/60*c)/Vm", 4.5, "mS/cm"),
        "T": ("(brine/60*(Tb - T) + water/60*(Tw - T) - ul*(T - 20))/Vm", 23, "degC")},
        {"conductivity": ("c", "mS/cm"), "temperature": ("T", "degC")})  # fmt: skip
    salt = np.minimum(logged(rng, x[:, 0], 0.015), 6.2)
    columns = {"brine": (u[:, 0], "l/min", "input"), "water": (u[:, 1], "l/min", "input"),
               "conductivity": (np.round(salt, 3), "mS/cm", "output"),
               "temperature": (logged(rng, x[:, 1], 0.015, ends=(0, 100), bits=13, jitter=0.02),
                               "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("transport_delay", "sensor_saturation"), (),
                {"delay_s": late, "high": 6.2}, cuts=(700,), true=true)  # fmt: skip


def basin(rng: np.random.Generator) -> Case:
    """A storage basin of a water tower's network and the reach below (Mays 2000, Water Distribution Systems Handbook).

    Hidden: the basin's pumps stop at 0.85 m, so that it cannot fall below; the model's basin does. Size: 9 % of
    either level. Seepage and rain act, which nobody records.
    """
    name, rows, step, floor = "basin_floor", 1400, 300.0, 0.85
    u = np.c_[plateaus(rng, rows, 50, 0.02, 0.16), plateaus(rng, rows, 35, 0.0, 0.09), gust(rng, rows, 15, 0.002)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return ((u[0] - u[1] - 0.028 * x[0] + u[2]) / 620, (0.028 * x[0] - 0.041 * x[1]) / 380)

    def after(x: list[float]) -> None:
        x[0] = max(x[0], floor)

    x, _ = rk(slope, [1.6, 1.1], rows, step, told(u), 12, after)
    true = {"Ab": 620.0, "kb": 0.028, "Ar": 380.0, "kr": 0.041}
    text = equations("basin", declared(rng, true, Ab="m2", kb="m2/s", Ar="m2", kr="m2/s"), {
        "hb": ("(inflow - drawn - kb*hb)/Ab", 1.6, "m"), "hr": ("(kb*hb - kr*hr)/Ar", 1.1, "m")},
        {"basin": ("hb", "m"), "reach": ("hr", "m")})  # fmt: skip
    columns = {"inflow": (u[:, 0], "m3/s", "input"), "drawn": (u[:, 1], "m3/s", "input"),
               "basin": (logged(rng, x[:, 0], 0.02, ends=(0, 8), bits=12), "m", "output"),
               "reach": (logged(rng, x[:, 1], 0.02, lag=3, ends=(0, 6), bits=12), "m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("one_sided_storage",), (), {"floor_level": floor}, lost=13, true=true)


def glucose(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Sugar and insulin of a patient with pump and sensor (Bergman et al. 1979, Am. J. Physiol. 236).

    Hidden: sport burns sugar; it is recorded as heart rate over rest, and the model ignores it. Size: 19 % of the
    sugar. What the body does besides wanders and nobody records it. The null's model knows the sport.
    """
    name, rows, step = "null_blood" if complete else "blood_sport", 1500, 300.0
    meal = np.maximum(plateaus(rng, rows, 18, -3.0, 2.4), 0)
    pump = 8 + np.maximum(plateaus(rng, rows, 22, -12, 16), 0) + plateaus(rng, rows, 40, 0, 6)
    sport = np.maximum(plateaus(rng, rows, 16, -70, 55), 0)
    u = np.c_[meal, pump, sport, gust(rng, rows, 12, 0.08)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        made = -0.02 * (x[0] - 105) - x[1] * x[0] + u[0] - 0.013 * u[2] + u[3]
        return made / 60, (-0.022 * x[1] + 1.6e-5 * (u[1] - 10)) / 60

    x, _ = rk(slope, [120, 0.002], rows, step, told(u), 8)
    true = {"p1": 2.0, "p2": 2.2, "p3": 1.6, "gm": 1.0, "Gb": 105.0} | ({"ks": 1.3} if complete else {})
    burnt = " - ks/100*(sport)" if complete else ""
    values = declared(rng, true, 0.08 if complete else 0.1, p1="1/(100 min)", p2="1/(100 min)", Gb="mg/dl")
    text = equations("blood sugar", values, {
        "G": (f"(-p1/100*(G - Gb) - X*G/1000 + gm*meal{burnt})/60", 120, "mg/dl"),
        "X": ("(-p2/100*X + p3/100*(insulin - 10))/60", 2, "1/(1000 min)")},
        {"sugar": ("G", "mg/dl")})  # fmt: skip
    columns = {"meal": (meal, "mg/dl/min", "input"), "insulin": (pump, "mU/l", "input"),
               "sport": (sport, "1/min", "disturbance"),
               "sugar": (np.round(logged(rng, x[:, 0], 0.02, lag=2)), "mg/dl", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, cuts=(500, 1000), beside=("sensor_quantisation",),
                    verdicts=("named",), true=true)  # fmt: skip
    return Case(name, step, columns, text, ("missing_disturbance",), (), {"gain": -0.013 / 60},
                beside=("sensor_quantisation",), time="time [h]", time_scale=1 / 3600, true=true)  # fmt: skip
