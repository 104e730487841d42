"""Plants of processes, electrics and sensors whose models or recordings lack a piece of their physics.

As second_author_plants.py: delays, a valve that sticks, analysers that are late, faults of sensors, and laws that no
entry of the catalogue has.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter
from second_author_parts import (
    Case,
    Column,
    coloured,
    converted,
    equations,
    flips,
    free,
    held,
    known,
    march,
    plateaus,
    smooth,
)  # fmt: skip
from textbook_plants import Array, noisy


def grid(rng: np.random.Generator) -> Case:
    """An inductance between converter and grid, in rotating axes (Teodorescu et al. 2011, Grid Converters).

    Both voltages act three samples of 50 microseconds late, as computation and modulation take; the model has no delay.
    The converters of 12 bits end at 50 A, which both currents pass.
    """
    rows, step, late, turning = 1500, 50e-6, 3, 314.16
    u = np.c_[flips(rng, rows, 12, 25) + plateaus(rng, rows, 200, -10, 10), flips(rng, rows, 9, 25)]
    x = held(
        lambda _, x, u: ((u[0] - 0.15 * x[0]) / 3e-3 + turning * x[1], (u[1] - 0.15 * x[1]) / 3e-3 - turning * x[0]),
        [0, 0], np.vstack([np.zeros((late, 2)), u[:-late]]), step)  # fmt: skip
    values = {"R": free(0.16, 0.02, 1, "ohm"), "L": free(2.9e-3, 1e-3, 1e-2, "H"), "W": known(turning, "rad/s")}
    text = equations("grid filter in dq", values,
                     {"id": ("(vd - R*id)/L + W*iq", 0, "A"), "iq": ("(vq - R*iq)/L - W*id", 0, "A")},
                     {"i_d": ("id", "A"), "i_q": ("iq", "A")})  # fmt: skip
    read = [converted(x[:, i] + 0.02 * rng.standard_normal(rows), -50, 50, 12) for i in range(2)]
    columns = {"vd": (u[:, 0], "V", "input"), "vq": (u[:, 1], "V", "input"), "i_d": (read[0], "A", "output"),
               "i_q": (read[1], "A", "output")}  # fmt: skip
    return Case("grid_delay", step, columns, text, ("transport_delay", "data_time_offset"), (),
                {"delay_s": late * step, "offset_s": late * step}, beside=("sensor_saturation",),
                time="time [ms]", time_scale=1e3)  # fmt: skip


def valve(rng: np.random.Generator) -> Case:
    """Flow into a tank through a valve that sticks, in a level loop (Choudhury et al. 2005, Control Eng. Practice 13).

    The stem stays until the command is more than 2 % away and then jumps to it; the model's valve follows at once.
    """
    rows, step, band = 1200, 0.5, 2.0
    wanted, total, stem = plateaus(rng, rows, 150, 35, 60), 45.0, 45.0

    def command(k: int, x: Array) -> Sequence[float]:
        nonlocal total, stem
        error = wanted[k] - x[1]
        total += 0.012 * step * error * 1.2
        asked = float(np.clip(total + 1.8 * error, 0, 100))
        stem = asked if abs(asked - stem) > band else stem
        return asked, stem

    x, u = march(lambda _, x, u: ((0.9 * u[1] - x[0]) / 2.5, (x[0] - 6.2 * np.sqrt(max(x[1], 0))) / 9.0), [40.0, 45.0],
                 rows, step, command, rtol=1e-8, atol=1e-9)  # fmt: skip
    values = {"g": free(0.92, 0.3, 3, "l/min"), "tau": free(2.6, 0.5, 10, "s"), "A": free(9.3, 2, 40, "l"),
              "ko": free(6.1, 2, 20)}  # fmt: skip
    text = equations("flow valve and tank", values,
                     {"q": ("(g*valve - q)/tau", 40, "l/min"), "hh": ("(q - ko*sqrt(max(hh,0.01)))/A", 45, "%")},
                     {"flow": ("q", "l/min"), "level": ("hh", "%")})  # fmt: skip
    columns = {
        "valve": (u[:, 0], "%", "input"), "flow": (noisy(rng, x[:, 0], 0.015), "l/min", "output"),
        "level": (noisy(rng, x[:, 1], 0.01), "%", "output"),
    }  # fmt: skip
    return Case("valve_stiction", step, columns, text, ("deadband",), ("backlash", "stiction"), {"width": band},
                context="closed_loop = true\n")  # fmt: skip


def reactor(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A stirred reactor with a cooling jacket (Seborg, Edgar and Mellichamp 2004, Process Dynamics and Control, ch. 2).

    Its analyser tells the concentration of 14 s before, a dead time of an output that no entry has; a sensor of second
    order comes near. The null's is immediate, noise is coloured and rows are lost.
    """
    rows, step, late = 500 if complete else 600, 4.0, 14.0
    u = np.c_[plateaus(rng, rows, 30, 288, 306), plateaus(rng, rows, 45, 0.8, 1.25)]

    def slope(_: float, x: Array, u: Array) -> Sequence[float]:
        rate, through = 7.2e10 * np.exp(-8750 / x[1]) * x[0], u[1] * 60.0 / 100.0
        heat = 2.0e2 * 0.85 * rate + 3.3e2 * 1.6 / 100.0 * (u[0] - x[1])
        return (through * (1.0 - x[0]) - rate) / 60, (through * (350.0 - x[1]) + heat) / 60

    x, t = held(slope, [0.9, 325], u, step), np.arange(rows) * step
    values = {"k0": free(7.0, 2, 20), "dH": free(172, 60, 400, "K"), "UA": free(5.2, 1, 20), "E": known(8750)}
    burnt = "k0*1e10*exp(-E/temp)*ca"
    text = equations("stirred reactor", values,
                     {"ca": (f"(feed*0.6*(1 - ca) - {burnt})/60", 0.9, "mol/l"),
                      "temp": (f"(feed*0.6*(350 - temp) + dH*{burnt} + UA*(coolant + 273.15 - temp))/60", 325, "K")},
                     {"concentration": ("ca", "mol/l"), "temperature": ("temp - 273.15", "degC")})  # fmt: skip
    celsius = x[:, 1] - 273.15
    if complete:
        read = coloured(rng, x[:, 0], 0.03, 8), coloured(rng, celsius, 0.02, 5)
    else:
        analysed = np.asarray(CubicSpline(t, x[:, 0])(np.maximum(t - late, 0)))
        read = noisy(rng, analysed, 0.02), noisy(rng, celsius, 0.01)
    columns = {
        "coolant": (u[:, 0] - 273.15, "degC", "input"), "feed": (u[:, 1], "l/min", "input"),
        "concentration": (read[0], "mol/l", "output"), "temperature": (read[1], "degC", "output"),
    }  # fmt: skip
    if complete:
        return Case("null_cstr", step, columns, text, lost=6)
    return Case("cstr_delay", step, columns, text, ("data_time_offset",), ("sensor_second_order", "sensor_lag"),
                {"offset_s": late}, time="time [min]", time_scale=1 / 60)  # fmt: skip


def _plates(rng: np.random.Generator, rows: int) -> tuple[Array, Array]:
    """Return heaters and ambient (N, 3) and the four temperatures of coupled plates with noise (N, 4)."""
    heaters = np.c_[plateaus(rng, rows, 40, 0, 900), plateaus(rng, rows, 60, 0, 600)]
    u = np.c_[heaters, 18 + smooth(rng, rows + 1, 200, 1.5)[:rows]]
    capacity, between, to_air = (9e3, 1.4e4, 1.1e4, 2e4), (12.0, 8.0, 10.0), (3.0, 2.0, 4.0, 5.0)

    def slope(_: float, x: Array, u: Array) -> Sequence[float]:
        q = [between[i] * (x[i] - x[i + 1]) for i in range(3)]
        net = (u[0] - q[0], q[0] - q[1], u[1] + q[1] - q[2], q[2])
        return [(net[i] - to_air[i] * (x[i] - u[2])) / capacity[i] for i in range(4)]

    x = held(slope, [70, 55, 60, 50], u, 10.0)
    return u, x + 0.05 * rng.standard_normal(x.shape)


def _plates_model() -> str:
    """Return the complete model of the plates, capacities in kJ/K."""
    values = {"c1": free(9.1, 3, 30, "kJ/K"), "c2": free(13.8, 3, 60), "c3": free(11.1, 3, 30), "c4": free(19.6, 6, 60),
              "g1": free(12.2, 3, 50, "W/K"), "g2": free(7.9, 2, 40), "g3": free(10.1, 3, 50), "l1": known(3),
              "l2": known(2), "l3": known(4), "l4": known(5)}  # fmt: skip
    return equations("heated plates", values, {
        "x1": ("(heater_a - g1*(x1-x2) - l1*(x1-ambient))/c1/1000", 70, "degC"),
        "x2": ("(g1*(x1-x2) - g2*(x2-x3) - l2*(x2-ambient))/c2/1000", 55, "degC"),
        "x3": ("(heater_b + g2*(x2-x3) - g3*(x3-x4) - l3*(x3-ambient))/c3/1000", 60, "degC"),
        "x4": ("(g3*(x3-x4) - l4*(x4-ambient))/c4/1000", 50, "degC"),
    }, {f"t{i}": (f"x{i}", "degC") for i in range(1, 5)})  # fmt: skip


def plates(rng: np.random.Generator, kind: str, rows: int) -> Case:
    """Four coupled plates, two of them heated (Incropera et al. 2007, chapter 5), of which the model is complete.

    At fault is the recording: t1 ends at its 90 % quantile (clip), t2 and t3 stand under each other's name (swap), t2
    drifts by 0.25 mK a second (drift), or t4 is in degrees Fahrenheit (unit). The null has 14 bits, coloured noise,
    lost rows and a gap.
    """
    u, y = _plates(rng, rows)
    right: tuple[str, ...] = ()
    values: dict[str, float] = {}
    if kind == "clip":
        y[:, 0] = np.minimum(y[:, 0], np.quantile(y[:, 0], 0.9))
        right, values = ("sensor_saturation",), {"high": float(y[:, 0].max())}
    elif kind == "swap":
        y[:, [1, 2]] = y[:, [2, 1]]
        right = ("data_channel_swap",)
    elif kind == "drift":
        y[:, 1] += np.arange(rows) * 10.0 * 2.5e-4
        right, values = ("sensor_drift",), {"rate_per_s": 2.5e-4}
    elif kind == "unit":
        y[:, 3] = y[:, 3] * 1.8 + 32
        right, values = ("sensor_scale",), {"factor": 1.8}
    else:
        y = np.column_stack([converted(coloured(rng, y[:, i], 0.006, 6), -20, 180, 14) for i in range(4)])
    columns: dict[str, Column] = {"heater_a": (u[:, 0], "W", "input"), "heater_b": (u[:, 1], "W", "input"),
                                  "ambient": (u[:, 2], "degC", "disturbance")}  # fmt: skip
    columns |= {f"t{i + 1}": (y[:, i], "degC", "output") for i in range(4)}
    if kind == "null":
        return Case("null_chain", 10.0, columns, _plates_model(), lost=8, gap=(400, 440))
    return Case(f"chain_{kind}", 10.0, columns, _plates_model(), right, (), values)


def gimbal(rng: np.random.Generator, kind: str, rows: int) -> Case:
    """A platform on two axes with gyroscopes (Hilkert 2008, IEEE Control Systems 28), the model of which is complete.

    At fault are the sensors: one also shows 7 % of the other axis (cross), or one is in radians, though its unit says
    degrees (scale). The null's sensors stand behind a filter against aliases.
    """
    step, u = 0.01, np.c_[flips(rng, rows, 12, 1.5), flips(rng, rows, 17, 1.2)]
    x = held(
        lambda _, x, u: (x[2], x[3], (u[0] - 40.0 * x[0] - 1.6 * x[2]) / 0.5, (u[1] - 30.0 * x[1] - 1.1 * x[3]) / 0.35),
        [0, 0, 0, 0], u, step)  # fmt: skip
    y: Array = np.degrees(x[:, 2:])
    right: tuple[str, ...] = ()
    values: dict[str, float] = {}
    if kind == "cross":
        y[:, 0] += 0.07 * y[:, 1]
        right, values = ("sensor_cross_axis",), {"share": 0.07}
    elif kind == "scale":
        y[:, 1] = np.radians(y[:, 1])
        right, values = ("sensor_scale",), {"factor": float(np.radians(1))}
    else:
        y = lfilter(*butter(2, 0.45), y, axis=0)
    names = {"J1": free(0.51, 0.1, 2, "kg m2"), "J2": free(0.34, 0.1, 2, "kg m2"), "k1": free(40.5, 10, 150, "N m/rad"),
             "k2": free(29.6, 8, 120, "N m/rad"), "c1": free(1.6, 0.2, 10), "c2": free(1.12, 0.2, 10)}  # fmt: skip
    text = equations("two-axis gimbal", names,
                     {"p": ("wp", 0, "rad"), "q": ("wq", 0, "rad"),
                      "wp": ("(torque_x - k1*p - c1*wp)/J1", 0, "rad/s"),
                      "wq": ("(torque_y - k2*q - c2*wq)/J2", 0, "rad/s")},
                     {"rate_x": ("wp*180/pi", "deg/s"), "rate_y": ("wq*180/pi", "deg/s")})  # fmt: skip
    columns = {
        "torque_x": (u[:, 0], "N m", "input"), "torque_y": (u[:, 1], "N m", "input"),
        "rate_x": (noisy(rng, y[:, 0], 0.01), "deg/s", "output"),
        "rate_y": (noisy(rng, y[:, 1], 0.01), "deg/s", "output"),
    }  # fmt: skip
    name = "null_gimbal" if kind == "null" else f"gimbal_{kind}"
    return Case(name, step, columns, text, right, (), values, digits=6)


def furnace(rng: np.random.Generator) -> Case:
    """A furnace that radiates with the fourth power of its temperature (Incropera et al. 2007, chapter 1).

    The model loses heat in proportion to the temperature only; no entry has radiation.
    """
    rows, step, radiating = 400, 30.0, 0.7 * 5.67e-8 * 0.25
    u = plateaus(rng, rows, 20, 2e3, 26e3)[:, None]

    def slope(_: float, x: Array, u: Array) -> Sequence[float]:
        return ((u[0] - 14.0 * (x[0] - 20) - radiating * ((x[0] + 273) ** 4 - 293**4)) / 4.2e4,)

    x = held(slope, [600.0], u, step)
    text = equations("furnace", {"C": free(4.1e4, 1e4, 2e5, "J/K"), "hA": free(16, 2, 80, "W/K")},
                     {"T": ("(1000*power - hA*(T-20))/C", 600, "degC")}, {"temperature": ("T", "degC")})  # fmt: skip
    columns = {"power": (u[:, 0] / 1e3, "kW", "input"),
               "temperature": (x[:, 0] + 0.8 * rng.standard_normal(rows), "degC", "output")}  # fmt: skip
    return Case("furnace_rad", step, columns, text, outside=True)


def vessels(rng: np.random.Generator) -> Case:
    """Two vessels with a check valve between (Wellstead 1979, Introduction to Physical System Modelling).

    Water passes from the first to the second only; the model's pipe lets it through both ways. No entry has a valve.
    """
    rows, step = 900, 2.0
    u = np.c_[plateaus(rng, rows, 40, 0, 9), plateaus(rng, rows, 40, 0, 7)]

    def slope(_: float, x: Array, u: Array) -> Sequence[float]:
        through = 1.1 * max(x[0] - x[1], 0)
        return (u[0] - through - 0.55 * x[0]) / 60, (u[1] + through - 0.6 * x[1]) / 45

    x = held(slope, [5, 5], u, step)
    values = {"A1": free(61, 20, 200), "A2": free(44, 15, 150), "kc": free(1.05, 0.2, 5), "k1": free(0.56, 0.1, 3),
              "k2": free(0.59, 0.1, 3)}  # fmt: skip
    text = equations("two vessels", values, {"h1": ("(pump_a - kc*(h1-h2) - k1*h1)/A1", 5, "m"),
                                             "h2": ("(pump_b + kc*(h1-h2) - k2*h2)/A2", 5, "m")},
                     {"level_a": ("h1", "m"), "level_b": ("h2", "m")})  # fmt: skip
    read = [x[:, i] + 0.01 * rng.standard_normal(rows) for i in range(2)]
    columns = {"pump_a": (u[:, 0], "l/s", "input"), "pump_b": (u[:, 1], "l/s", "input"),
               "level_a": (read[0], "m", "output"), "level_b": (read[1], "m", "output")}  # fmt: skip
    return Case("checkvalve", step, columns, text, outside=True)


MACHINES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "grid_delay": (4, grid), "valve_stiction": (12, valve), "cstr_delay": (14, reactor),
    "chain_clip": (19, partial(plates, kind="clip", rows=1500)),
    "chain_swap": (19, partial(plates, kind="swap", rows=700)),
    "chain_unit": (51, partial(plates, kind="unit", rows=600)),
    "chain_drift": (52, partial(plates, kind="drift", rows=800)),
    "gimbal_cross": (20, partial(gimbal, kind="cross", rows=1200)),
    "gimbal_scale": (50, partial(gimbal, kind="scale", rows=1000)),
    "furnace_rad": (21, furnace), "checkvalve": (22, vessels),
}  # fmt: skip
