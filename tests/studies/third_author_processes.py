"""Tanks, reactors, heat, water and cells whose models or recordings lack a piece of their physics.

As third_author_machines.py: a brim, sensors that lag or stand still, delays, a thermostat, a thermistor that warms up.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import asinh, exp, inf, log, sqrt

import numpy as np
from second_author_parts import Case, Tones, coloured, converted, equations, flips, known, plateaus, smooth
from textbook_plants import noisy
from third_author_parts import looked_up, off, rk, told, white


def cascade(rng: np.random.Generator) -> Case:
    """Two tanks, the lower one is read, the upper one spills (Schoukens and Noël 2017, cascaded tanks benchmark).

    The model's upper tank is endless. The pump's gain is known, which fixes the level of the brim.
    """
    name, rows, step = "cascade_spill", 1130, 4.0
    u = np.clip(plateaus(rng, rows, 40, 3.0, 7.5) + smooth(rng, rows, 15, 0.6), 0, 10)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        spill, a, b = max(x[0] - 10, 0) / 4.0, sqrt(max(x[0], 0.01)), sqrt(max(x[1], 0.01))
        return 0.0294 * u[0] - 0.06 * a - spill, 0.05 * a - 0.052 * b + 0.4 * spill

    x, _ = rk(slope, [6, 5.5], rows, step, told(u), 20)
    true = {"k1": 0.06, "k2": 0.05, "k3": 0.052}
    text = equations("cascaded tanks", off(rng, true) | {"k4": known(0.0294)}, {
        "h1": ("k4*pump - k1*sqrt(max(h1,0.01))", 6, "cm"),
        "h2": ("k2*sqrt(max(h1,0.01)) - k3*sqrt(max(h2,0.01))", 5.5, "cm")}, {"lower": ("h2", "cm")})  # fmt: skip
    columns = {"pump": (u, "V", "input"), "lower": (white(rng, x[:, 1], 0.03), "cm", "output")}
    return Case(name, step, columns, text, ("overflow",), (), {"brim_level": 10.0}, cuts=(565,))


def ph(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Neutralisation in a stirred vessel (McAvoy, Hsu and Lowenthal 1972, Ind. Eng. Chem. Process Des. Dev. 11).

    Its pH electrode lags 14 s, the cell of the conductivity does not; the model has neither. The null's electrode is
    immediate, noise is coloured, rows are lost and there is a gap.
    """
    name, rows, step, lag = "null_ph" if complete else "ph_electrode", 970, 2.0, 14.0
    u = np.c_[plateaus(rng, rows, 25, 5.5, 9.5), plateaus(rng, rows, 60, 6.5, 8.5)]
    true = {"V": 9.0, "Cb": 21.0, "buf": 0.35, "kc": 0.113}

    def acidity(x: Sequence[float]) -> float:
        return 7 + asinh(x[0] / 0.7) / log(10)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        through = (u[0] + u[1]) / 60
        return ((u[0] / 60 * 21.0 - u[1] / 60 * 20.0 - through * x[0]) / 9.0,
                (u[0] / 60 * 21.0 - through * x[1]) / 9.0, (acidity(x) - x[2]) / lag)  # fmt: skip

    x, _ = rk(slope, [0.3, 10.4, acidity([0.3])], rows, step, told(u), 8)
    values = off(rng, true, V="l", Cb="mmol/l", kc="mS l/(cm mmol)") | {"Ca": known(20.0, "mmol/l")}
    text = equations("neutralisation", values, {
        "xb": ("(base/60*Cb - acid/60*Ca - (base + acid)/60*xb)/V", 0.3, "mmol/l"),
        "xs": ("(base/60*Cb - (base + acid)/60*xs)/V", 10.4, "mmol/l")},
        {"pH": ("7 + log(xb/(2*buf) + sqrt((xb/(2*buf))**2 + 1))/log(10)", ""),
         "conductivity": ("kc*xs", "mS/cm")})  # fmt: skip
    clean = {"pH": np.array([acidity(r) for r in x]) if complete else x[:, 2], "conductivity": 0.113 * x[:, 1]}
    read = [coloured(rng, y, 0.02, 6) if complete else noisy(rng, y, 0.02) for y in clean.values()]
    columns = {"base": (u[:, 0], "l/min", "input"), "acid": (u[:, 1], "l/min", "input"),
               "pH": (read[0], "", "output"), "conductivity": (read[1], "mS/cm", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, gap=(410, 455), lost=7, clean=clean, true=true)
    return Case(name, step, columns, text, ("sensor_lag",), ("sensor_second_order",), {"tau_s": lag})


def exchanger(rng: np.random.Generator) -> Case:
    """A heat exchanger behind a long steam line (Shinskey 1996, Process Control Systems), 21 s of dead time.

    Flow and cold temperature come at once, so that no clock of a logger can stand for the delay.
    """
    name, rows, step, late, fine = "hx_delay", 1105, 3.0, 7, 6
    u = plateaus(rng, rows, 35, 20, 80)
    acting = np.r_[np.full(late, u[0]), u[:-late]]
    flow, cold = Tones.drawn(rng, 5e-4, 0.02, 20, 0.09, 0.7), Tones.drawn(rng, 3e-4, 0.01, 16, 2.5, 18)
    f, c = looked_up(flow, rows, step, fine), looked_up(cold, rows, step, fine)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return ((2.6 * u[0] - 4.18 * f(t) * (x[0] - c(t)) - 0.35 * (x[0] - 15)) / 130,)

    x, _ = rk(slope, [55], rows, step, told(acting), fine)
    true = {"gs": 2.6, "Cw": 130.0, "ua": 0.35}
    text = equations("steam heater", off(rng, true, gs="kW/%", Cw="kJ/K", ua="kW/K"), {
        "T": ("(gs*steam - 4.18*flow*(T - cold) - ua*(T - 15))/Cw", 55, "degC")},
        {"outlet": ("T", "degC")})  # fmt: skip
    t = np.arange(rows) * step
    columns = {"steam": (u, "%", "input"), "flow": (np.asarray(flow(t)), "kg/s", "disturbance"),
               "cold": (np.asarray(cold(t)), "degC", "disturbance"),
               "outlet": (white(rng, x[:, 0], 0.15), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("transport_delay",), (), {"delay_s": late * step}, time="time [min]",
                time_scale=1 / 60)  # fmt: skip


def mains(rng: np.random.Generator, kind: str) -> Case:
    """A pump and two junctions of a water main (Larock et al. 2000, Hydraulics of Pipeline Systems).

    One gauge is in psi and said to be in bar, or stands still in the middle of its range, a fault of the data.
    """
    name, rows, step = f"mains_{kind}", 1160 if kind == "stuck" else 730, 1.0
    u = np.c_[plateaus(rng, rows, 30, 40, 95), plateaus(rng, rows, 22, 10, 60)]

    def root(d: float) -> float:
        return d / sqrt(abs(d) + 0.01)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        pipe = 9.0 * root(x[0] - x[1])
        pa, pb = sqrt(max(x[0], 0.01)), sqrt(max(x[1], 0.01))
        return (0.28 * u[0] - pipe - 1.2 * pa) / 30, (pipe - 0.055 * u[1] * pb - 2.0 * pb) / 48

    x, _ = rk(slope, [9, 8], rows, step, told(u), 10)
    true = {"gp": 0.28, "kp": 9.0, "ca": 30.0, "cb": 48.0, "kv": 0.055, "lb": 2.0}
    flow, down = "kp*(pa-pb)/sqrt(abs(pa-pb) + 0.01)", "sqrt(max(pb,0.01))"
    text = equations("water main", off(rng, true), {
        "pa": (f"(gp*pump - {flow} - 1.2*sqrt(max(pa,0.01)))/ca", 9, "bar"),
        "pb": (f"({flow} - kv*valve*{down} - lb*{down})/cb", 8, "bar")},
        {"p_pump": ("pa", "bar"), "p_town": ("pb", "bar")})  # fmt: skip
    clean = {"p_pump": x[:, 0], "p_town": x[:, 1]}
    if kind == "psi":
        clean["p_town"] = 14.5038 * clean["p_town"]
    read = {key: noisy(rng, y, 0.012) for key, y in clean.items()}
    if kind == "stuck":
        read["p_town"][640:835] = read["p_town"][640]
    columns = {"pump": (u[:, 0], "%", "input"), "valve": (u[:, 1], "%", "input"),
               "p_pump": (read["p_pump"], "bar", "output"), "p_town": (read["p_town"], "bar", "output")}  # fmt: skip
    if kind == "psi":
        return Case(name, step, columns, text, ("sensor_scale",), (), {"factor": 14.5038})
    return Case(name, step, columns, text, outside=True, verdicts=("data_fault",))


def gearbox(rng: np.random.Generator) -> Case:
    """Oil of a gearbox and its thermostat (Incropera et al. 2007, Fundamentals of Heat and Mass Transfer).

    A cooler opens at 62 degrees and closes at 58, which no entry has; the model has no cooler.
    """
    name, rows, step, fine, open_ = "oil_thermostat", 1640, 15.0, 5, [False]
    u = plateaus(rng, rows, 60, 200, 1900)
    air = Tones.drawn(rng, 1e-5, 5e-4, 12, 4, 12)
    a = looked_up(air, rows, step, fine)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        cooled = 0.55 * (x[0] - a(t)) if open_[0] else 0.0
        return ((2.0 + 0.022 * u[0] - 0.48 * (x[0] - a(t)) - cooled) / 620,)

    def after(x: list[float]) -> None:
        open_[0] = x[0] > (58 if open_[0] else 62)

    x, _ = rk(slope, [45], rows, step, told(u), fine, after)
    true = {"lost": 0.022, "idle": 2.0, "ua": 0.48, "co": 620.0}
    text = equations("gearbox oil", off(rng, true, ua="kW/K", co="kJ/K", idle="kW"), {
        "oil": ("(idle + lost*power - ua*(oil - ambient))/co", 45, "degC")}, {"sump": ("oil", "degC")})  # fmt: skip
    columns = {"power": (u, "kW", "input"), "ambient": (np.asarray(air(np.arange(rows) * step)), "degC", "disturbance"),
               "sump": (converted(white(rng, x[:, 0], 0.1), -20, 120, 11), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, beside=("sensor_quantisation",), time="time [h]",
                time_scale=1 / 3600)  # fmt: skip


def brake(rng: np.random.Generator) -> Case:
    """A brake disc that cools the quicker the faster it turns (Limpert 2011, Brake Design and Safety); complete."""
    name, rows, step = "null_brake", 1010, 1.0
    u = np.c_[np.maximum(plateaus(rng, rows, 16, -3, 2.2), 0), plateaus(rng, rows, 40, 15, 130)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = u[1] / 3.6
        return ((0.9 * 1000 * u[0] * v - (9 + 0.85 * v) * (x[0] - 20)) / 4300,)

    x, _ = rk(slope, [120], rows, step, told(u), 5)
    true = {"share": 0.9, "h0": 9.0, "hv": 0.85, "cd": 4.3}
    text = equations("brake disc", off(rng, true, h0="W/K", cd="kJ/K"), {
        "disc": ("(share*1000*force*road/3.6 - (h0 + hv*road/3.6)*(disc - 20))/(1000*cd)", 120, "degC")},
        {"pyrometer": ("disc", "degC")})  # fmt: skip
    columns = {"force": (u[:, 0], "kN", "input"), "road": (u[:, 1], "km/h", "input"),
               "pyrometer": (coloured(rng, x[:, 0], 0.015, 7), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, lost=12, clean={"pyrometer": x[:, 0]}, true=true)


def thermistor(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A thermistor in a divider under changing supply (Fraden 2010, Handbook of Modern Sensors), a law without states.

    It heats itself, which no entry has. The null's does not, its noise is coloured and its converter has 12 bits.
    """
    name, rows, step = "null_ntc" if complete else "ntc_warm", 620, 1.0
    bath, supply = 35 + smooth(rng, rows, 60, 14), plateaus(rng, rows, 18, 2.5, 12)
    warm = 0.0 if complete else 70.0
    volt = np.zeros(rows)
    for k in range(rows):
        v, r = supply[k] / 2, inf  # cold at first
        for _ in range(60):
            kelvin = bath[k] + 273.15 + warm * v * v / r / 1e3
            r = exp(3950 * (1 / kelvin - 1 / 298.15))
            v = 0.5 * v + 0.5 * supply[k] * r / (r + 0.82)
        volt[k] = v
    true = {"R25": 1.0, "beta": 3950.0}
    law = "R25*exp(beta*(1/(bath + 273.15) - 1/298.15))"
    values = off(rng, true, R25="kohm", beta="K") | {"Rs": known(0.82, "kohm")}
    text = equations("thermistor", values, {}, {"divider": (f"supply*({law})/({law} + Rs)", "V")})
    read = converted(coloured(rng, volt, 0.004, 8), 0, 12, 12) if complete else white(rng, volt, 0.004)
    columns = {"bath": (bath, "degC", "input"), "supply": (supply, "V", "input"), "divider": (read, "V", "output")}
    if complete:
        return Case(name, step, columns, text, cuts=(310,), clean={"divider": volt}, true=true)
    return Case(name, step, columns, text, outside=True)


def cell(rng: np.random.Generator) -> Case:
    """A cell with two time constants and a bent open-circuit voltage (Plett 2015, Battery Management Systems).

    The model is complete; there are four drives, the voltage comes in steps of 1 mV and all values are free.
    """
    name, rows, step = "null_cell", 2430, 2.0
    u = plateaus(rng, rows, 14, -18, 22)
    true = {"Q": 26.0, "R0": 2.1, "R1": 1.4, "t1": 17.0, "R2": 1.9, "t2": 240.0, "ua": 3.42, "ub": 0.62}

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return -u[0] / (3600 * 26.0), (1.4e-3 * u[0] - x[1]) / 17.0, (1.9e-3 * u[0] - x[2]) / 240.0

    x, _ = rk(slope, [0.85, 0, 0], rows, step, told(u), 3)
    volt = 3.42 + 0.62 * x[:, 0] - 0.25 * np.exp(-14 * x[:, 0]) - 2.1e-3 * u - x[:, 1] - x[:, 2]
    text = equations("cell", off(rng, true, Q="A h", R0="mohm", R1="mohm", R2="mohm", t1="s", t2="s"), {
        "soc": ("-load/(3600*Q)", 0.85, ""), "u1": ("(R1/1000*load - u1)/t1", 0, "V"),
        "u2": ("(R2/1000*load - u2)/t2", 0, "V")},
        {"terminal": ("ua + ub*soc - 0.25*exp(-14*soc) - R0/1000*load - u1 - u2", "V")})  # fmt: skip
    columns = {"load": (u, "A", "input"), "terminal": (np.round(white(rng, volt, 5e-4), 3), "V", "output")}
    return Case(name, step, columns, text, cuts=(600, 1250, 1800), beside=("sensor_quantisation",), verdicts=("named",),
                clean={"terminal": volt}, true=true)  # fmt: skip


def gas_turbine(rng: np.random.Generator) -> Case:
    """A gas turbine under its governor (Rowen 1983, J. Eng. Power 105) whose fuel valve follows with 0.55 s.

    The model's valve follows at once. A drive of second order and a delay come near, but are no answer.
    """
    name, rows, step, fine, lag = "gt_fuel_lag", 1570, 0.1, 8, 0.55
    grid = Tones.drawn(rng, 0.004, 0.25, 24, 450, 5200)
    load, dither, total = looked_up(grid, rows, step, fine), flips(rng, rows, 7, 3.0), [62.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = 100 * (1.0 - x[0])
        total[0] += 0.8 * step * error
        return (total[0] + 5 * error + dither[k],)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        power = 1.35 * (x[2] - 23) * 100
        heating = (410 + 3.6 * (x[2] - 60) / x[0] - x[1]) / 4.2
        return (power - load(t)) / (11.5 * 1000 * x[0]), heating, (u[0] - x[2]) / lag

    x, u = rk(slope, [1.0, 410, 61.5], rows, step, command, fine)
    true = {"gf": 1.35, "w0": 23.0, "Ta": 11.5, "kT": 3.6, "tt": 4.2, "Tx": 410.0}
    text = equations("gas turbine", off(rng, true, Ta="s", tt="s", Tx="degC"), {
        "n": ("(100*gf*(fuel - w0) - load)/(Ta*1000*n)", 1.0, ""),
        "tx": ("(Tx + kT*(fuel - 60)/n - tx)/tt", 410, "degC")},
        {"shaft_speed": ("3000*n", "rpm"), "exhaust": ("tx", "degC")})  # fmt: skip
    clean = {"shaft_speed": 3000 * x[:, 0], "exhaust": x[:, 1]}
    columns = {"fuel": (u[:, 0], "%", "input"), "load": (np.asarray(grid(np.arange(rows) * step)), "kW", "disturbance"),
               "shaft_speed": (white(rng, clean["shaft_speed"], 0.4), "rpm", "output"),
               "exhaust": (white(rng, clean["exhaust"], 0.3), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("actuator_lag",), (), {"tau_s": lag}, context="closed_loop = true\n")


PROCESSES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "cascade_spill": (103, cascade), "gt_fuel_lag": (108, gas_turbine), "ph_electrode": (109, ph),
    "hx_delay": (110, exchanger), "mains_psi": (122, partial(mains, kind="psi")),
    "mains_stuck": (123, partial(mains, kind="stuck")), "oil_thermostat": (130, gearbox), "ntc_warm": (133, thermistor),
}  # fmt: skip
