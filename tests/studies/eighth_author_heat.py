"""Dryers, exchangers, columns, walls, furnaces and tanks after public recordings, of which a piece is left out.

Every plant is a function of a random generator that returns its case; `size` is how large what is hidden is. The
machines are those behind well-known recordings, with equations and numbers of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np
from eighth_author_parts import Makers, each, levels, prbs
from second_author_parts import Case, Column, equations, flips, known, plateaus, smooth, state_space
from seventh_author_parts import between, sampled
from sixth_author_parts import declared, fixed, gust, logged, skewed
from third_author_parts import rk, told


def dryer(rng: np.random.Generator, *, size: float = 0.16) -> Case:
    """A hair dryer blown through a tube (Ljung 1999, System Identification, the process trainer PT326).

    Hidden: the air takes 0.16 s from the heater to the thermistor. The heater's voltage is binary, the model is linear
    in discrete time, its gain and lags up to 4 % off.
    """
    name, rows, step = "hair_dryer", 1000, 0.08
    heat, air = prbs(rng, rows, 4, -1.5, 1.5), gust(rng, rows, 12, 0.03)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        given = heat[min(int((t - size) / step + 1e-9), rows - 1)] if t >= size else 0.0
        return (0.92 * given + u[0] - x[0]) / 0.31, (x[0] - x[1]) / 0.13

    x, _ = rk(slope, [0, 0], rows, step, told(air), 8)
    gain, slow, quick = skewed(rng, 0.92, 0.03), skewed(rng, 0.31, 0.04), skewed(rng, 0.13, 0.04)
    a, b = np.array([[-1 / slow, 0], [1 / quick, -1 / quick]]), np.array([[gain / slow], [0]])
    model = state_space(step, {"heater": "V"}, {"outlet": "V"}, sampled(a, b, np.array([[0.0, 1.0]]), step))
    columns: dict[str, Column] = {
        "heater": (heat, "V", "input"),
        "outlet": (logged(rng, x[:, 1], 0.04, lag=2, ends=(-5, 5), bits=12), "V", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("transport_delay",), (), {"delay_s": size})


def condenser(rng: np.random.Generator, *, size: float = 0.22) -> Case:
    """Water that saturated steam heats through copper tubes (Bittanti and Piroddi 1997, J. Franklin Inst. 334).

    Hidden: the pressure of the steam, which is recorded, changes what the valve does, by 22 % for each of its
    deviations. Flow of the water is recorded, fouling is not.
    """
    name, rows, step = "steam_condenser", 2400, 1.0
    valve, flow = plateaus(rng, rows, 30, 30, 70), 0.30 + plateaus(rng, rows, 45, -0.08, 0.08)
    pressure = np.round(3.2 + smooth(rng, rows, 120, 0.25), 2)
    middle, mean, spread = 50.0, float(np.mean(pressure)), float(np.std(pressure))
    u = np.c_[valve, flow, pressure, gust(rng, rows, 40, 0.25)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        heat = 24 + 0.42 * (u[0] - middle) * (1 + size * (u[2] - mean) / spread)
        through = 2.4 * (x[0] - x[1])
        return (heat + u[3] - through) / 22, (through - 4.18 * u[1] * (x[1] - 24)) / 14

    x, _ = rk(slope, [53, 43], rows, step, told(u), 5)
    true = {"ks": 0.42, "gw": 2.4, "Cm": 22.0, "Cw": 14.0, "h0": 24.0}
    values = {"cp": known(4.18, "kJ/K/kg"), "Ti": known(24.0, "degC"), "vm": known(middle, "%")} | declared(
        rng, true, 0.07, ks="kW/%", gw="kW/K", Cm="kJ/K", Cw="kJ/K", h0="kW")  # fmt: skip
    text = equations("steam condenser", values, {
        "Tm": ("(h0 + ks*(valve - vm) - gw*(Tm - Tw))/Cm", 53, "degC"),
        "Tw": ("(gw*(Tm - Tw) - cp*flow*(Tw - Ti))/Cw", 43, "degC")}, {"outlet": ("Tw", "degC")})  # fmt: skip
    columns: dict[str, Column] = {
        "valve": (valve, "%", "input"), "flow": (np.round(flow, 4), "kg/s", "disturbance"),
        "pressure": (pressure, "bar", "scheduling"),
        "outlet": (logged(rng, x[:, 1], 0.015, lag=3, ends=(0, 100), bits=12), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("aero_nonlinearity",), (), true=true)


def column(rng: np.random.Generator, *, size: float = 54.0) -> Case:
    """A pilot column that parts ethane from ethylene about its working point (after De Moor 1997, DaISy).

    Hidden: the valve of the reboiler's steam follows its demand with 54 s. Analysers read the impurities at both
    ends, half a minute a row, three short recordings. The model is linear in discrete time, gains up to 4 % off.
    """
    name, rows, step = "column_reboiler", 480, 30.0
    u = np.c_[plateaus(rng, rows, 12, -2, 2), plateaus(rng, rows, 10, -3, 3), gust(rng, rows, 8, 0.05)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        steam = x[2] if size else u[1]
        top = -0.85 * u[0] + 0.52 * steam + u[2]
        bottom = 0.60 * u[0] - 0.90 * steam
        return (top - x[0]) / 204, (bottom - x[1]) / 132, (u[1] - x[2]) / (size or 1)

    x, _ = rk(slope, [0, 0, 0], rows, step, told(u), 12)
    gains = np.reshape(each(rng, [-0.85, 0.52, 0.60, -0.90], 0.04), (2, 2))
    slow = np.array(each(rng, [204.0, 132.0], 0.03))
    a, b = np.diag(-1 / slow), gains / slow[:, None]
    ways = {"reflux": "kg/min", "steam": "kg/min"}, {"top": "%", "bottom": "%"}
    model = state_space(step, *ways, sampled(a, b, np.eye(2), step))
    columns: dict[str, Column] = {
        "reflux": (np.round(u[:, 0], 2), "kg/min", "input"), "steam": (np.round(u[:, 1], 2), "kg/min", "input"),
        "top": (logged(rng, x[:, 0], 0.02, lag=2, ends=(-5, 5), bits=11), "%", "output"),
        "bottom": (logged(rng, x[:, 1], 0.03, ends=(-6, 6), bits=11), "%", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("actuator_lag",), (), {"tau_s": size}, cuts=(160, 320))


def wall(rng: np.random.Generator, *, size: float = 2.5e-6) -> Case:
    """A wall of brick and insulation between a room and the weather (after the thermic wall of De Moor 1997, DaISy).

    Hidden: the plate that reads the flow of heat into the wall drifts by 2.5e-6 W/m2 a second. Five minutes a row;
    both surfaces are recorded, a thermometer between the layers and the flow to the outside are read.
    """
    name, rows, step = "wall_heat_plate", 1680, 300.0
    t = np.arange(rows) * step
    inside = np.round(21 + plateaus(rng, rows, 150, -2.5, 2.5) + smooth(rng, rows, 8, 0.15), 2)
    outside = np.round(6 - 5 * np.cos(2 * np.pi * (t / 86400 - 0.1)) + smooth(rng, rows, 60, 2.2), 2)
    warm, cold = between(inside, step), between(outside, step)
    sun = gust(rng, rows, 20, 0.5)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        across = (x[0] - x[1]) / 0.62
        return ((warm(t) - x[0]) / 0.14 - across) / 1.35e5, (across - (x[1] - cold(t)) / 0.55 + u[0]) / 0.45e5

    x, _ = rk(slope, [18.5, 10.5], rows, step, told(sun), 6)
    enters, leaves = (inside - x[:, 0]) / 0.14, (x[:, 1] - outside) / 0.55
    true = {"R1": 0.14, "R2": 0.62, "R3": 0.55, "C1": 1.35, "C2": 0.45}
    values = declared(rng, true, 0.08, R1="m2 K/W", R2="m2 K/W", R3="m2 K/W", C1="1e5 J/m2/K", C2="1e5 J/m2/K")
    text = equations("two-layer wall", values, {
        "T1": ("((inside - T1)/R1 - (T1 - T2)/R2)/(1e5*C1)", 18.5, "degC"),
        "T2": ("((T1 - T2)/R2 - (T2 - outside)/R3)/(1e5*C2)", 10.5, "degC")},
        {"flow_in": ("(inside - T1)/R1", "W/m2"), "flow_out": ("(T2 - outside)/R3", "W/m2"),
         "joint": ("T1", "degC")})  # fmt: skip
    columns: dict[str, Column] = {
        "inside": (inside, "degC", "input"), "outside": (outside, "degC", "disturbance"),
        "flow_in": (logged(rng, enters + size * t, 0.03, ends=(-100, 100), bits=13), "W/m2", "output"),
        "flow_out": (logged(rng, leaves, 0.02, ends=(-100, 100), bits=13), "W/m2", "output"),
        "joint": (logged(rng, x[:, 0], 0.01, ends=(-20, 60), bits=13), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_drift",), (), {"rate_per_s": size}, time="time [h]",
                time_scale=1 / 3600, true=true)  # fmt: skip


def furnace(rng: np.random.Generator, *, size: float = 8.0) -> Case:
    """Three thermocouples of a glass furnace about its working point (Van Overschee and De Moor 1994, Automatica 30).

    The fault: the transmitter of the crown ends at 8 K above the working point. Two burners and the cooling air are
    recorded, the draw of glass is not. The model is linear in discrete time, a minute a row; gains up to 3 % off.
    """
    name, rows, step = "glass_crown", 1247, 60.0
    u = np.c_[plateaus(rng, rows, 25, -4, 4), plateaus(rng, rows, 30, -4, 4), plateaus(rng, rows, 40, -5, 5)]
    u = np.c_[np.round(u, 1), gust(rng, rows, 40, 0.15)]
    slow = np.array([520.0, 900.0, 700.0])
    mix = np.array([[-1.0, 0.35, 0.1], [0.3, -1.0, 0.25], [0.1, 0.35, -1.0]])
    pull = np.array([[2.1, 0.3, -0.2], [0.6, 1.1, -1.2], [0.2, 1.9, -0.5]])

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        drive = mix @ np.asarray(x) + pull @ np.asarray(u[:3]) + u[3]
        return [float(v) for v in drive / slow]

    x, _ = rk(slope, [0, 0, 0], rows, step, told(u), 4)
    wrong = np.reshape(each(rng, pull.ravel().tolist(), 0.03), (3, 3))
    places = {"crown": "K", "melt": "K", "throat": "K"}
    model = state_space(step, {"burner1": "%", "burner2": "%", "air": "%"}, places,
                        sampled(mix / slow[:, None], wrong / slow[:, None], np.eye(3), step))  # fmt: skip
    columns: dict[str, Column] = {n: (np.round(u[:, k], 1), "%", "input")
                                  for k, n in enumerate(("burner1", "burner2", "air"))}  # fmt: skip
    columns |= {n: (logged(rng, x[:, k], 0.02, lag=3, ends=(-64, 64), bits=12), "K", "output")
                for k, n in enumerate(places)}  # fmt: skip
    columns["crown"] = (np.minimum(columns["crown"][0], size), "K", "output")
    return Case(name, step, columns, model, ("sensor_saturation",), (), {"high": size})


def tanks(rng: np.random.Generator, *, size: float = 1.0) -> Case:
    """Three tanks in a row with two pumps (Amira DTS200; Blanke et al. 2006, Diagnosis and Fault-Tolerant Control).

    The fault: the levels of the middle and the right tank are recorded under each other's names. Pumps are held; two
    recordings of 700 rows, two seconds a row. Waves on the levels are not recorded.
    """
    name, rows, step = "three_tanks", 1400, 2.0
    u = np.c_[plateaus(rng, rows, 60, 20, 55), plateaus(rng, rows, 60, 15, 45), gust(rng, rows, 10, 0.4)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        a, b = x[0] - x[1], x[1] - x[2]
        left = 11.5 * a / sqrt(abs(a) + 0.3)
        right = 12.4 * b / sqrt(abs(b) + 0.3)
        return (u[0] + u[2] - left) / 154, (left - right) / 154, (u[1] + right - 13.6 * sqrt(max(x[2], 1e-3))) / 154

    x, _ = rk(slope, [32, 26, 22], rows, step, told(u), 6)
    true = {"c1": 11.5, "c2": 12.4, "c0": 13.6}
    values = {"At": fixed(rng, 154.0, "cm2", 0.01)} | declared(rng, true, 0.08, c1="cm2.5/s", c2="cm2.5/s")
    a, b = "c1*(h1 - h2)/sqrt(abs(h1 - h2) + 0.3)", "c2*(h2 - h3)/sqrt(abs(h2 - h3) + 0.3)"
    text = equations("three tanks", values, {
        "h1": (f"(pump1 - {a})/At", 32, "cm"), "h2": (f"({a} - {b})/At", 26, "cm"),
        "h3": (f"(pump2 + {b} - c0*sqrt(max(h3, 0.001)))/At", 22, "cm")},
        {"left": ("h1", "cm"), "middle": ("h2", "cm"), "right": ("h3", "cm")})  # fmt: skip
    seen = (0, 2, 1) if size else (0, 1, 2)
    columns: dict[str, Column] = {"pump1": (u[:, 0], "ml/s", "input"), "pump2": (u[:, 1], "ml/s", "input")}
    columns |= {n: (logged(rng, x[:, k], 0.015, ends=(0, 64), bits=12), "cm", "output")
                for k, n in zip(seen, ("left", "middle", "right"), strict=True)}  # fmt: skip
    return Case(name, step, columns, text, ("data_channel_swap",), (), cuts=(700,), true=true)


def stirred(rng: np.random.Generator, *, size: float = 1.0) -> Case:
    """Two stirred tanks in a row in which a dye is bleached (Fogler 2016, Chemical Reaction Engineering), no entry.

    Not in the model: the reaction is of order one and a half, the model has one of the first order. Flow and feed are
    recorded; photometers read both tanks; two recordings of 400 rows.
    """
    name, rows, step = "bleach_tanks", 800, 30.0
    u = np.c_[levels(rng, rows, 20, (0.8, 1.1, 1.4, 1.8)), plateaus(rng, rows, 16, 1.1, 2.5)]
    u = np.c_[u, gust(rng, rows, 6, 0.02)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        first, second = (0.0052 * c * (sqrt(c / 0.9) if size else 1.0) for c in x)
        change = u[0] / 260
        return change * (u[1] + u[2] - x[0]) - first, change * (x[0] - x[1]) - second

    x, _ = rk(slope, [1.0, 0.55], rows, step, told(u), 8)
    true = {"kr": 5.2, "Vt": 260.0}
    values = {"Vt": fixed(rng, 260.0, "ml", 0.02)} | declared(rng, {"kr": 5.2}, 0.08, kr="1e-3/s")
    text = equations("bleaching tanks", values, {
        "c1": ("flow/Vt*(feed - c1) - kr/1000*c1", 1.0, "g/l"),
        "c2": ("flow/Vt*(c1 - c2) - kr/1000*c2", 0.55, "g/l")},
        {"first": ("c1", "g/l"), "second": ("c2", "g/l")})  # fmt: skip
    columns: dict[str, Column] = {
        "flow": (u[:, 0], "ml/s", "input"), "feed": (np.round(u[:, 1], 2), "g/l", "disturbance"),
        "first": (logged(rng, x[:, 0], 0.02, lag=2, ends=(0, 4), bits=11), "g/l", "output"),
        "second": (logged(rng, x[:, 1], 0.02, ends=(0, 4), bits=11), "g/l", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, cuts=(400,), true=true)


def drum(rng: np.random.Generator, *, size: float = 30.0) -> Case:
    """Drum of a steam generator about its working point (Pellegrinetti and Bentsman 1996), its model linear, no entry.

    Not in the model: bubbles swell the drum's level as steam is drawn, and shrink again over a minute. Three seconds a
    row; feed water answers the level, fuel is stepped, the steam's flow is recorded.
    """
    name, rows, step, total = "drum_swell", 2400, 3.0, [0.0]
    fuel, steam = prbs(rng, rows, 30, -4, 4), plateaus(rng, rows, 50, -5, 5)
    shake, hot, heard = flips(rng, rows, 25, 1.2), gust(rng, rows, 30, 0.06), gust(rng, rows, 1, 0.8)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = -(x[2] + size * (x[3] - x[4]) + heard[k])
        total[0] += 0.0006 * step * error
        return fuel[k], round(total[0] + 0.12 * error + shake[k], 2), steam[k], hot[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return ((u[0] + u[3] - x[0]) / 24, (0.016 * x[0] - 0.011 * u[2] - 0.004 * u[1] - 0.004 * x[1]),
                0.09 * u[1] - 0.085 * u[2], (0.2 * u[2] - x[3]) / 8, (0.2 * u[2] - x[4]) / 55)  # fmt: skip

    x, u = rk(slope, [0] * 5, rows, step, command, 6)
    g = each(rng, [0.016, 0.011, 0.004, 0.09, 0.085], 0.01)
    a = np.array([[-1 / 24, 0, 0], [g[0], -0.004, 0], [0, 0, 0]])
    b = np.array([[1 / 24, 0, 0], [0, -g[2], -g[1]], [0, g[3], -g[4]]])
    c = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    ways = {"fuel": "%", "feed": "%", "steam": "%"}, {"pressure": "bar", "level": "mm"}
    model = state_space(step, *ways, sampled(a, b, c, step))
    level = x[:, 2] + size * (x[:, 3] - x[:, 4]) + heard
    columns: dict[str, Column] = {
        "fuel": (fuel, "%", "input"), "feed": (u[:, 1], "%", "input"),
        "steam": (np.round(steam, 2), "%", "disturbance"),
        "pressure": (logged(rng, x[:, 1], 0.015, lag=3, ends=(-40, 40), bits=13), "bar", "output"),
        "level": (logged(rng, level, 0.0, ends=(-250, 250), bits=12), "mm", "output")}  # fmt: skip
    return Case(name, step, columns, model, outside=True, context="closed_loop = true\n")


HEAT: Makers = {
    "hair_dryer": (601, dryer), "steam_condenser": (602, condenser), "column_reboiler": (603, column),
    "wall_heat_plate": (604, wall), "glass_crown": (605, furnace), "three_tanks": (606, tanks),
    "bleach_tanks": (607, stirred), "drum_swell": (608, drum),
}  # fmt: skip
