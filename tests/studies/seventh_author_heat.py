"""Autoclaves, greenhouses, boilers, stores and dryers, of which dead times, the weather or melting are left out.

As seventh_author_rotors.py. With `complete` nothing is hidden, which is a null in seventh_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp

import numpy as np
from second_author_parts import Case, Column, equations, flips, known, plateaus, smooth, state_space
from seventh_author_parts import between, sampled
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged, skewed
from third_author_parts import rk, told


def autoclave(rng: np.random.Generator) -> Case:
    """The jacket and the load of an autoclave about its working point (Seborg et al. 2004, chapter 7).

    Hidden: the steam takes 45 s through its trap and line; cooling water acts at once. The model is linear and in
    discrete time, two gains up to 3 % off. The loop hears the load's thermometer; losses that wander are not recorded.
    """
    name, rows, step, late, total = "autoclave_steam", 800, 10.0, 45.0, [0.0]
    wanted, shake = plateaus(rng, rows, 70, -6, 6), flips(rng, rows, 9, 5.0)
    water = plateaus(rng, rows, 50, -8, 8)
    heard, losses, steam = hiss(rng, rows, 0.03), gust(rng, rows, 15, 0.3), np.zeros(rows + 1)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[1] - heard[k]
        total[0] += 0.004 * step * error
        steam[k] = round(total[0] + 2.2 * error + shake[k], 2)
        return steam[k], water[k], losses[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        given = steam[int((t - late) / step + 1e-9)] if t >= late else 0.0
        return (1.3 * given - 0.7 * u[1] + u[2] - x[0] - 1.5 * (x[0] - x[1])) / 190, (x[0] - x[1]) / 260

    x, _ = rk(slope, [0, 0], rows, step, command, 8)
    a = np.array([[-2.5 / 190, 1.5 / 190], [1 / 260, -1 / 260]])
    b = np.array([[1.3 * skewed(rng, 1, 0.03), -0.7 * skewed(rng, 1, 0.03)], [0, 0]]) / 190
    ways = {"steam": "%", "water": "%"}, {"jacket": "K", "load": "K"}
    model = state_space(step, *ways, sampled(a, b, np.eye(2), step))
    columns: dict[str, Column] = {
        "steam": (steam[:rows], "%", "input"), "water": (np.round(water, 2), "%", "input"),
        "jacket": (logged(rng, x[:, 0], 0.015, lag=4, ends=(-64, 64), bits=13), "K", "output"),
        "load": (logged(rng, x[:, 1] + heard, 0.0, ends=(-64, 64), bits=13), "K", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("transport_delay",), (), {"delay_s": late}, context=LOOP, cuts=(400,))


def greenhouse(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Air and soil of a greenhouse over three days (van Straten et al. 2011, Greenhouse Cultivation).

    Hidden: the sun, which is recorded, warms the air, 6 W for each W/m2, and the model has no way for it. Outdoor
    temperature is recorded in steps of 0.1 K; what the vents let out is not. The null's model has the sun.
    """
    name, rows, step, warm = "null_greenhouse" if complete else "greenhouse_sun", 864, 300.0, 6.0
    t, total = np.arange(rows) * step, [50.0]
    day = np.maximum(np.sin(2 * np.pi * (t / 86400 - 0.27)), 0)
    sun = np.round(620 * day * np.clip(0.7 + smooth(rng, rows, 9, 0.3), 0.1, 1), 0)
    outside = np.round(4 - 4 * np.cos(2 * np.pi * (t / 86400 - 0.12)) + smooth(rng, rows, 30, 0.8), 1)
    wanted, shake = plateaus(rng, rows, 70, 15.5, 20), flips(rng, rows, 8, 6.0)
    shine, cold = between(sun, step), between(outside, step)
    heard, vents = hiss(rng, rows, 0.05), gust(rng, rows, 12, 0.7)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        total[0] = max(min(total[0] + 0.0022 * step * error, 90), 5)
        return max(min(total[0] + 8 * error + shake[k], 100), 0), vents[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        out, soil = 2.6 * (x[0] - cold(t)), 1.8 * (x[0] - x[1])
        return (0.70 * u[0] + warm / 1e3 * shine(t) - out - soil + u[1]) / 2600, (soil - 0.4 * (x[1] - 10)) / 3.2e4

    x, u = rk(slope, [17, 15.5], rows, step, command, 8)
    true = {"kh": 0.70, "ua": 2.6, "us": 1.8, "Ca": 2.6, "Cs": 32.0} | ({"ks": warm} if complete else {})
    units = {"kh": "kW/%", "ua": "kW/K", "us": "kW/K", "ks": "m2"}
    values = {"Ca": fixed(rng, 2.6, "MJ/K"), "Cs": fixed(rng, 32.0, "MJ/K"), "ub": known(0.4, "kW/K")} | declared(
        rng, {k: true[k] for k in ("kh", "ua", "us", "ks") if k in true}, 0.08, **units)  # fmt: skip
    more = " + ks/1000*sun" if complete else ""
    text = equations("greenhouse", values, {
        "Ta": (f"(kh*heating{more} - ua*(Ta - outdoor) - us*(Ta - Ts))/(1000*Ca)", 17, "degC"),
        "Ts": ("(us*(Ta - Ts) - ub*(Ts - 10))/(1000*Cs)", 15.5, "degC")},
        {"air": ("Ta", "degC"), "soil": ("Ts", "degC")})  # fmt: skip
    columns: dict[str, Column] = {
        "heating": (np.round(u[:, 0], 1), "%", "input"), "outdoor": (outside, "degC", "disturbance"),
        "sun": (sun, "W/m2", "disturbance"),
        "air": (logged(rng, x[:, 0] + heard, 0.0, ends=(-20, 60), bits=12), "degC", "output"),
        "soil": (logged(rng, x[:, 1], 0.02, lag=5, ends=(-20, 60), bits=13), "degC", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, context=LOOP, gap=(300, 318), time="time [h]", time_scale=1 / 3600,
                    true=true)  # fmt: skip
    return Case(name, step, columns, text, ("missing_disturbance",), (), {"gain": warm / 2.6e6}, context=LOOP,
                time="time [h]", time_scale=1 / 3600, true=true)  # fmt: skip


def spray(rng: np.random.Generator) -> Case:
    """Spray water behind a superheater (Dolezal and Varcop 1970, Process Dynamics of Steam Generators).

    Hidden: above 70 % of load, at which a second boiler draws from the same header, each per cent of the valve cools 40
    % less. Fuel and load are recorded, slag on the tubes is not.
    """
    name, rows, step, change, edge = "spray_header", 1400, 4.0, -0.40, 70.0
    load = 70 + smooth(rng, rows, 60, 5.0)
    valve, fuel = plateaus(rng, rows, 24, 25, 65), plateaus(rng, rows, 40, -6, 6) + 0.3 * (load - 70)
    u, middle = np.c_[valve, fuel, load, gust(rng, rows, 20, 1.2)], float(np.mean(valve))

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        cooled = 0.9 * (1 + change * (u[2] > edge)) * (u[0] - middle)
        return (480 + 1.1 * u[1] - cooled + u[3] - x[0]) / 16, (x[0] - x[1]) / 45

    x, _ = rk(slope, [480, 480], rows, step, told(u), 4)
    true = {"s0": 480.0, "kf": 1.1, "ks": 0.9, "t1": 16.0, "t2": 45.0}
    free = declared(rng, {k: true[k] for k in ("kf", "ks", "t1", "t2")}, 0.08, kf="K/%", ks="K/%", t1="s", t2="s")
    values = {"s0": known(480.0, "degC"), "sm": known(round(middle, 6), "%")} | free
    text = equations("superheater", values, {
        "T1": ("(s0 + kf*fuel - ks*(spray - sm) - T1)/t1", 480, "degC"), "T2": ("(T1 - T2)/t2", 480, "degC")},
        {"after_spray": ("T1", "degC"), "outlet": ("T2", "degC")})  # fmt: skip
    columns: dict[str, Column] = {
        "spray": (np.round(valve, 2), "%", "input"), "fuel": (np.round(fuel, 2), "%", "disturbance"),
        "load": (np.round(load, 1), "%", "scheduling"),
        "after_spray": (logged(rng, x[:, 0], 0.015, lag=4, ends=(0, 800), bits=14), "degC", "output"),
        "outlet": (logged(rng, x[:, 1], 0.015, ends=(0, 800), bits=14), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("operating_region_switch",), (),
                {"gain_change": change, "threshold": edge}, lost=7, true=true)  # fmt: skip


def wax(rng: np.random.Generator) -> Case:
    """A store of paraffin that a heating rod charges and water empties (Mehling and Cabeza 2008), no entry.

    Not in the model: the wax melts about 57 degC, where it takes up more heat for each kelvin. Power and draw are
    recorded, losses that wander are not. Twenty seconds a row.
    """
    name, rows, step = "wax_store", 1500, 20.0
    u = np.c_[plateaus(rng, rows, 40, 0.0, 6.0), plateaus(rng, rows, 55, 0.008, 0.030), gust(rng, rows, 20, 0.05)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        holds = 190 + 230 * exp(-(((x[0] - 57) / 3.5) ** 2))
        drawn = 0.55 * (x[0] - x[1])
        return (u[0] + u[2] - drawn - 0.012 * (x[0] - 20)) / holds, (drawn - 4.18 * u[1] * (x[1] - 15)) / 18

    x, _ = rk(slope, [52, 45], rows, step, told(u), 8)
    true = {"Cw": 250.0, "ge": 0.55, "Cx": 18.0, "ul": 12.0, "kw": 4.18}
    values = {"ul": known(12.0, "W/K"), "kw": known(4.18, "kJ/K/l")} | declared(
        rng, {k: true[k] for k in ("Cw", "ge", "Cx")}, 0.08, Cw="kJ/K", ge="kW/K", Cx="kJ/K")  # fmt: skip
    text = equations("wax store", values, {
        "Tw": ("(power - ge*(Tw - Tx) - ul/1000*(Tw - 20))/Cw", 52, "degC"),
        "Tx": ("(ge*(Tw - Tx) - kw*draw*(Tx - 15))/Cx", 45, "degC")},
        {"wax": ("Tw", "degC"), "outlet": ("Tx", "degC")})  # fmt: skip
    columns: dict[str, Column] = {
        "power": (np.round(u[:, 0], 2), "kW", "input"), "draw": (np.round(u[:, 1], 3), "l/s", "disturbance"),
        "wax": (logged(rng, x[:, 0], 0.01, lag=4, ends=(0, 128), bits=13), "degC", "output"),
        "outlet": (logged(rng, x[:, 1], 0.01, ends=(0, 128), bits=13), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, true=true)


def veneer(rng: np.random.Generator) -> Case:
    """A dryer for veneer with a gas burner (Mujumdar 2014, Handbook of Industrial Drying, chapter 32).

    Hidden: hot gas is 15 s in its duct; and the wood's moisture, which is recorded, cools the zone by 0.7 K a per cent.
    The belt is in the model. The burner answers a loop on the zone; draughts are not recorded.
    """
    name, rows, step, late, wet, total = "veneer_dryer", 1400, 3.0, 15.0, 0.7, [50.0]
    wanted, shake = plateaus(rng, rows, 90, 150, 166), flips(rng, rows, 11, 4.0)
    moist, belt = np.round(8 + smooth(rng, rows, 25, 1.6), 1), plateaus(rng, rows, 60, 0.8, 1.2)
    heard, air, burner = hiss(rng, rows, 0.2), gust(rng, rows, 12, 0.6), np.full(rows + 1, 50.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        total[0] = max(min(total[0] + 0.006 * step * error, 95), 5)
        burner[k] = round(max(min(total[0] + 0.35 * error + shake[k], 100), 0), 2)
        return burner[k], moist[k], belt[k], air[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        given = burner[int((t - late) / step + 1e-9)] if t >= late else 50.0
        zone = 158 + 1.9 * (given - 50) - wet * (u[1] - 8) - 24 * (u[2] - 1) + u[3]
        return (zone - x[0]) / 38, (0.8 * (x[0] - 158) + 120 - x[1]) / 22

    x, u = rk(slope, [158, 120], rows, step, command, 6)
    true = {"z0": 158.0, "kb": 1.9, "kv": 24.0, "tz": 38.0, "ke": 0.8, "te": 22.0}
    units = {"kb": "K/%", "kv": "K s/m", "tz": "s", "te": "s"}
    values = {"z0": known(158.0, "degC")} | declared(
        rng, {k: true[k] for k in ("kb", "kv", "tz", "ke", "te")}, 0.08, **units)  # fmt: skip
    text = equations("veneer dryer", values, {
        "Tz": ("(z0 + kb*(burner - 50) - kv*(belt - 1) - Tz)/tz", 158, "degC"),
        "Te": ("(ke*(Tz - z0) + 120 - Te)/te", 120, "degC")},
        {"zone": ("Tz", "degC"), "exhaust": ("Te", "degC")})  # fmt: skip
    columns: dict[str, Column] = {
        "burner": (u[:, 0], "%", "input"), "belt": (np.round(belt, 3), "m/s", "input"),
        "moisture": (moist - 8, "%", "disturbance"),
        "zone": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 256), bits=13), "degC", "output"),
        "exhaust": (logged(rng, x[:, 1], 0.02, lag=4, ends=(0, 256), bits=13), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("transport_delay", "missing_disturbance"), (),
                {"delay_s": late, "gain": -wet / 38}, context=LOOP, true=true)  # fmt: skip


HEAT: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "autoclave_steam": (514, autoclave), "greenhouse_sun": (515, greenhouse), "spray_header": (516, spray),
    "wax_store": (539, wax), "veneer_dryer": (524, veneer),
}  # fmt: skip
