"""Climate, water, oil, fire and ropes, of which models or recordings lack a path, a brim, a limit or a sign.

As fifth_author_towers.py. With `complete` nothing is hidden, which is a null in fifth_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import sqrt

import numpy as np
from fifth_author_parts import LOOP, declared, gust, hiss, logged, skewed
from scipy.signal import cont2discrete
from second_author_parts import (
    Case,
    Tones,
    converted,
    equations,
    flips,
    known,
    plateaus,
    smooth,
    state_space,
)
from third_author_parts import looked_up, rk, told


def chamber(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A climate chamber with heater and mist nozzle (ASHRAE 2017, Fundamentals, chapter 1), its air held by a loop.

    Hidden: the mist cools the air by 1.2 W a per cent, to which the model has no path. Size: 24 % of the air's
    temperature, loops with and without 7 %. Draughts are not recorded; the null's model has the cooling.
    """
    name, rows, step = "null_chamber" if complete else "chamber_mist", 1900, 10.0
    wanted, mist = plateaus(rng, rows, 170, 30, 42), plateaus(rng, rows, 35, 5, 90)
    shake, heard, air = flips(rng, rows, 13, 4.0), hiss(rng, rows, 0.04), gust(rng, rows, 20, 9.0)
    wet, total, cold = gust(rng, rows, 15, 4e-4), [38.0], 1.2

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        total[0] = max(min(total[0] + 0.02 * step * error, 90), 0)
        return max(min(9 * error + total[0] + shake[k], 100), 0), mist[k], air[k], wet[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        heat = 12 * u[0] + 150 - 21 * (x[0] - 20) - cold * u[1] + u[2]
        return heat / 1.4e4, (0.036 * u[1] - 0.22 * (x[1] - 6)) / 240 + u[3]

    x, u = rk(slope, [32, 12], rows, step, command, 4)
    true = {"Ct": 14.0, "q0": 150.0, "ua": 21.0, "km": 0.036, "ve": 0.22} | ({"gc": cold} if complete else {})
    more = " - gc*mist" if complete else ""
    values = declared(rng, true, 0.08, Ct="kJ/K", q0="W", ua="W/K", gc="W/%")
    text = equations("climate chamber", values | {"kh": known(12.0, "W/%")}, {
        "T": (f"(kh*heater + q0{more} - ua*(T - 20))/(1000*Ct)", 32, "degC"),
        "X": ("(km*mist - ve*(X - 6))/240", 12, "g/m3")},
        {"air": ("T", "degC"), "vapour": ("X", "g/m3")})  # fmt: skip
    columns = {"heater": (u[:, 0], "%", "input"), "mist": (mist, "%", "input"),
               "air": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 64), bits=13), "degC", "output"),
               "vapour": (logged(rng, x[:, 1], 0.03, lag=5, ends=(0, 50), bits=12), "g/m3", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, context=LOOP, lost=11, time="time [min]", time_scale=1 / 60,
                    true=true)  # fmt: skip
    return Case(name, step, columns, text, ("missing_coupling",), (), {"gain": -cold / 1.4e4}, context=LOOP,
                time="time [min]", time_scale=1 / 60, true=true)  # fmt: skip


def lakes(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Two ponds of an irrigation, hour by hour (Chow, Maidment and Mays 1988, Applied Hydrology, chapter 8).

    Hidden: above 2.7 m the upper one spills over a weir into the lower one, which takes 4 h. Size: 10 and 6 % of the
    levels. Rain that nobody records falls on both; the null's model has the weir.
    """
    name, rows, step, brim, slow = "null_ponds" if complete else "pond_weir", 1700, 3600.0, 2.7, 14400.0
    u = np.c_[plateaus(rng, rows, 34, 0.15, 0.85), gust(rng, rows, 10, 1.2e-7), gust(rng, rows, 10, 1.2e-7)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        out, spill = 0.42 * sqrt(max(x[0], 0)), max(x[0] - brim, 0) / slow
        return ((u[0] - out) / 2.1e4 - spill + u[1],
                (out - 0.38 * sqrt(max(x[1], 0))) / 3.4e4 + spill * 2.1 / 3.4 + u[2])  # fmt: skip

    x, _ = rk(slope, [1.7, 2.1], rows, step, told(u), 8)
    true = {"a1": 0.42, "a2": 0.38, "A1": 2.1, "A2": 3.4} | ({"brim": brim, "ts": 4.0} if complete else {})
    spill = "max(h1 - brim, 0)/(3600*ts)" if complete else ""
    more = (f" - {spill}", f" + {spill}*A1/A2") if complete else ("", "")
    text = equations("ponds", declared(rng, true, 0.08, A1="ha", A2="ha", brim="m", ts="h"), {
        "h1": (f"(inlet - a1*sqrt(max(h1, 0)))/(10000*A1){more[0]}", 1.7, "m"),
        "h2": (f"(a1*sqrt(max(h1, 0)) - a2*sqrt(max(h2, 0)))/(10000*A2){more[1]}", 2.1, "m")},
        {"upper": ("h1", "m"), "lower": ("h2", "m")})  # fmt: skip
    columns = {"inlet": (u[:, 0], "m3/s", "input"),
               "upper": (logged(rng, x[:, 0], 0.015, lag=6, ends=(0, 6), bits=12), "m", "output"),
               "lower": (logged(rng, x[:, 1], 0.015, ends=(0, 8), bits=12), "m", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, time="time [h]", time_scale=1 / 3600, gap=(300, 312), cuts=(850,),
                    true=true)  # fmt: skip
    return Case(name, step, columns, text, ("overflow",), (), {"brim_level": brim, "spill_time_s": slow,
                "share_into_next": 2.1 / 3.4}, time="time [h]", time_scale=1 / 3600, true=true)  # fmt: skip


def drum(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A mixer's drum on a hydraulic motor whose oil warms and leaks (Merritt 1967, Hydraulic Control Systems, ch. 4).

    Hidden: the valve's flow acts 1 % less a kelvin of the oil's recorded temperature. Size: 7 % of either speed. The
    drum turns both ways; the load that wanders is not recorded. The null's model has the leak, in four short
    recordings.
    """
    name, rows, step, slip = "null_drum" if complete else "drum_oil", 2400, 0.1, 0.010
    t = np.arange(rows) * step
    oil = 45 + 12 * np.sin(2 * np.pi * t / 95 + 0.4) + smooth(rng, rows, 150, 2.0)
    mean = round(float(np.mean(oil)), 2)
    u = np.c_[plateaus(rng, rows, 45, -85, 85), oil, gust(rng, rows, 15, 0.06)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        flow = 0.062 * (1 - slip * (u[1] - mean)) * u[0]
        return (flow - x[0] + u[2] - 0.35 * (x[0] - x[1])) / 0.9, (x[0] - x[1]) / 2.2

    x, _ = rk(slope, [0, 0], rows, step, told(u), 4)
    true = {"kq": 0.062, "Jm": 0.9, "tc": 2.2, "cm": 0.35} | ({"sl": slip} if complete else {})
    leak = f"*(1 - sl*(oil - {mean}))" if complete else ""
    text = equations("drum", declared(rng, true, 0.08, kq="rad/s/%", Jm="s", tc="s"), {
        "w": (f"(kq*valve{leak} - w - cm*(w - wm))/Jm", 0, "rad/s"), "wm": ("(w - wm)/tc", 0, "rad/s")},
        {"drum_speed": ("w*30/pi", "rpm"), "mix_speed": ("wm*30/pi", "rpm")})  # fmt: skip
    columns = {"valve": (u[:, 0], "%", "input"), "oil": (np.round(oil, 1), "degC", "disturbance"),
               "drum_speed": (logged(rng, x[:, 0] * 30 / np.pi, 0.015, ends=(-80, 80), bits=13), "rpm", "output"),
               "mix_speed": (logged(rng, x[:, 1] * 30 / np.pi, 0.015, lag=4, ends=(-80, 80), bits=12), "rpm",
                             "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, cuts=(600, 1200, 1800), true=true)
    return Case(name, step, columns, text, ("temperature_dependence",), (), {"gain_slope": -slip}, lost=8, true=true)


def fire(rng: np.random.Generator) -> Case:
    """Oxygen of a boiler's flue gas under its air damper (Dukelow 1991, The Control of Boilers), in a loop.

    Hidden: the damper's positioner moves once the demand has left its place by more than 1.6 %. Size: 24 % of the
    oxygen, 15 % of the pressure. Fuel is recorded; its calorific value wanders, which is not.
    """
    name, rows, step, wide = "air_damper", 2400, 1.0, 1.6
    wanted, fuel = plateaus(rng, rows, 260, 2.6, 4.2), plateaus(rng, rows, 140, 45, 60)
    shake, heard, place = flips(rng, rows, 17, 1.1), hiss(rng, rows, 0.02), [52.0]
    value, total = gust(rng, rows, 40, 0.06), [52.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        total[0] = max(min(total[0] + 0.12 * error, 95), 5)
        asked = total[0] + 1.5 * error + 0.9 * (fuel[k] - 52) + shake[k]
        place[0] = asked if abs(asked - place[0]) > wide else place[0]
        return asked, fuel[k], value[k], place[0]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (3.4 + 0.21 * (u[3] - 52) - 0.2 * (u[1] - 52) + u[2] - x[0]) / 7, (1.4 * (u[3] - 52) - x[1]) / 2.5

    x, u = rk(slope, [3.4, 0], rows, step, command, 4)
    true = {"o0": 3.4, "ka": 0.21, "kf": 0.2, "to": 7.0, "kp": 1.4, "tp": 2.5}
    text = equations("boiler", declared(rng, true, o0="%O2", to="s", tp="s", kp="Pa/%"), {
        "o2": ("(o0 + ka*(damper - 52) - kf*(fuel - 52) - o2)/to", 3.4, "%O2"),
        "p": ("(kp*(damper - 52) - p)/tp", 0, "Pa")}, {"oxygen": ("o2", "%O2"), "furnace": ("p", "Pa")})  # fmt: skip
    columns = {"damper": (u[:, 0], "%", "input"), "fuel": (fuel, "%", "disturbance"),
               "oxygen": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 10), bits=12), "%O2", "output"),
               "furnace": (logged(rng, x[:, 1], 0.04, lag=3, ends=(-50, 50), bits=12), "Pa", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("deadband",), (), {"width": wide}, context=LOOP, lost=10, true=true)


def heatpump(rng: np.random.Generator) -> Case:
    """A house with a heated floor and a heat pump (Madsen and Holst 1995, Energy and Buildings 22), two minutes a row.

    Hidden: the compressor turns with 84 % at most, whatever is asked for. Size: 26 % of either temperature. The outdoor
    temperature is recorded in steps of 0.1 K, sun and people are not.
    """
    name, rows, step, fine, most = "compressor_cap", 1800, 120.0, 4, 84.0
    outside = Tones.drawn(rng, 2e-6, 2e-4, 16, 3.0, 2.0)
    cold, wanted = looked_up(outside, rows, step, fine), plateaus(rng, rows, 90, 19, 22.5)
    shake, sun, heard = flips(rng, rows, 9, 9.0), gust(rng, rows, 25, 0.12), hiss(rng, rows, 0.03)
    total = [50.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[1] - heard[k]
        total[0] = max(min(total[0] + 0.5 * error, 80), 20)
        return max(min(total[0] + 14 * error + shake[k], 100), 0), sun[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        heat = 0.11 * min(u[0], most)
        return (heat - 1.25 * (x[0] - x[1])) / 7.5e3, (1.25 * (x[0] - x[1]) - 0.28 * (x[1] - cold(t)) + u[1]) / 5.5e3

    x, u = rk(slope, [25, 20.5], rows, step, command, fine)
    true = {"hf": 1.25, "ua": 0.28, "Cf": 7.5, "Cr": 5.5}
    values = {"kc": known(0.11, "kW/%")} | declared(rng, true, hf="kW/K", ua="kW/K", Cf="MJ/K", Cr="MJ/K")
    text = equations("house", values, {
        "tf": ("(kc*compressor - hf*(tf - tr))/(1000*Cf)", 25, "degC"),
        "tr": ("(hf*(tf - tr) - ua*(tr - outdoor))/(1000*Cr)", 20.5, "degC")},
        {"floor": ("tf", "degC"), "room": ("tr", "degC")})  # fmt: skip
    columns = {"compressor": (u[:, 0], "%", "input"),
               "outdoor": (np.round(outside(np.arange(rows) * step), 1), "degC", "disturbance"),
               "floor": (logged(rng, x[:, 0], 0.02, lag=4, ends=(0, 51.2), bits=12), "degC", "output"),
               "room": (logged(rng, x[:, 1] + heard, 0.0, ends=(0, 40), bits=13), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("input_saturation",), (), {"high": most}, context=LOOP, lost=9,
                time="time [min]", time_scale=1 / 60, true=true)  # fmt: skip


def winch(rng: np.random.Generator) -> Case:
    """A winch that heaves and lowers a load (Strakosch 2010), with a counter that does not know which way.

    The fault: the drum's counter gives the amount of its speed; the rope's force cell does not. Size: 11 % of the
    speed. The rope swings, which nobody records.
    """
    name, rows, step = "winch_counter", 2200, 0.05
    u = np.c_[14 + plateaus(rng, rows, 50, -1.1, 4.2) + flips(rng, rows, 8, 0.3), gust(rng, rows, 10, 18.0)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return ((95 * u[0] - 620 * x[0] - 130 * 9.81 + u[1]) / 210,)

    x, _ = rk(slope, [0.2], rows, step, told(u), 4)
    acc = np.array([slope(0, a, b)[0] for a, b in zip(x.tolist(), u.tolist(), strict=True)])
    true = {"mw": 210.0, "bw": 620.0, "ml": 130.0}
    motion = "(95*current - bw*v - ml*9.81)/mw"
    text = equations("winch", declared(rng, true, mw="kg", bw="N s/m", ml="kg"), {"v": (motion, 0.2, "m/s")},
                     {"rope_speed": ("v", "m/s"), "rope_force": (f"ml*(9.81 + {motion})", "N")})  # fmt: skip
    speed = converted(np.abs(logged(rng, x[:, 0], 0.01)), 0, 2, 12)
    columns = {"current": (u[:, 0], "A", "input"), "rope_speed": (speed, "m/s", "output"),
               "rope_force": (logged(rng, 130 * (9.81 + acc), 0.02, lag=3, ends=(0, 4000), bits=14), "N",
                              "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_rectified",), (), lost=7, true=true)


def barrel(rng: np.random.Generator) -> Case:
    """Three zones of an extruder's barrel about their working point (Rauwendaal 2014, Polymer Extrusion); complete.

    The model is linear and in discrete time, the three heaters' gains up to 6 % off. Heaters are held between rows; the
    melt draws heat that wanders, which nobody records.
    """
    name, rows, step = "null_barrel", 1800, 5.0
    u = np.c_[[plateaus(rng, rows, d, -25, 25) for d in (40, 55, 33)]].T
    seen = np.c_[u, gust(rng, rows, 12, 0.6), gust(rng, rows, 12, 0.6)]

    c, g, h = np.array([[620.0], [780.0], [560.0]]), (1.9, 2.4), (2.2, 1.6, 2.9)
    a = np.array([[-g[0] - h[0], g[0], 0], [g[0], -g[0] - g[1] - h[1], g[1]], [0, g[1], -g[1] - h[2]]]) / c
    b = np.diag([4.5, 5.2, 4.1]) / c

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        own = u[3], 0.0, u[4]
        return [sum(a[i, j] * x[j] for j in range(3)) + b[i, i] * (u[i] + own[i]) for i in range(3)]

    x, _ = rk(slope, [0, 0, 0], rows, step, told(seen), 4)
    b = b * np.array([skewed(rng, 1.0, 0.06) for _ in range(3)])
    discrete = cont2discrete((a, b, np.eye(3), np.zeros((3, 3))), step, "zoh")[:4]
    ways = {f"heat{k}": "%" for k in (1, 2, 3)}, {f"zone{k}": "K" for k in (1, 2, 3)}
    model = state_space(step, *ways, discrete)
    columns = {f"heat{k + 1}": (u[:, k], "%", "input") for k in range(3)}
    for k, lag in enumerate((0, 4, 0)):
        columns[f"zone{k + 1}"] = (logged(rng, x[:, k], 0.01, lag=lag, ends=(-128, 128), bits=12), "K", "output")
    return Case(name, step, columns, model, lost=6)


PROCESSES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "chamber_mist": (319, chamber), "pond_weir": (320, lakes), "drum_oil": (321, drum), "air_damper": (322, fire),
    "compressor_cap": (323, heatpump), "winch_counter": (324, winch),
}  # fmt: skip
