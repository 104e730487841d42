"""A turbine of 50 kW with two blades on a teetering hub, of which a piece is left out.

As ninth_author_geared.py. Torques are in kN m at the slow shaft.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import cos, pi, sin

import numpy as np
from ninth_author_aero import SMALL
from ninth_author_parts import (
    LOOP,
    WT,
    Air,
    Makers,
    Slope,
    daq,
    integrate,
    model_text,
    near,
    off,
    paired,
    stairs,
    wander,
)
from ninth_author_plant import Plant, Run, operated
from second_author_parts import Case, Column, known
from textbook_plants import Array

SETTING = "blades = 2\nrated_speed_rad_s = 7.6\n"


def teetering(rng: np.random.Generator) -> Case:
    """A hub that teeters in sheared wind, 80 s at 50 Hz (Eggleston and Stoddard 1987, Wind Turbine Engineering Design).

    Hidden: rubber stops at 5 deg either way, which only gusts reach. A mast tells wind and its difference over the
    rotor, a counter the rotor's angle without wrapping; the torque follows the speed squared and is shaken.
    """
    rows, step, stop, hard = 4000, 0.02, float(np.radians(5.0)), 3200.0
    air = Air(rng, rows, step, 11.0, intensity=0.14, rotor=7.6, gusts=[(25, 4.0), (58, 4.5)])
    share = 0.19 + wander(rng, 16 * rows + 40, 16 * 90, 0.07)
    asked = 0.6 * stairs(rng, rows, 25, 120, (-1, 0, 1))
    gust = wander(rng, rows, 5, 0.3)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = air(t)
        dv = v * float(share[int(t / air.h + 0.5)])
        rub = min(x[2] + stop, 0) * max(1 - 0.5 * x[3], 0) + max(x[2] - stop, 0) * max(1 + 0.5 * x[3], 0)
        back = -1.05 * x[0] ** 2 * x[2] - 0.62 * x[0] * x[3] - hard * rub
        push = x[0] * (0.145 * dv * cos(x[1]) + 0.07 * dv * sin(x[1])) + 0.4 * u[1]
        return ((6.5 + 1.4 * (v - 11) - 1.5 * (x[0] - 7.6) - u[0]) / 3.1, x[0], x[3], back + push)

    x, u = integrate(slope, [7.6, 0.4, 0.02, 0], rows, step,
                     lambda k, x: (round(6.5 * (x[0] / 7.6) ** 2 + asked[k], 3), gust[k]), 6)  # fmt: skip
    true = {"q0": 6.5, "kv": 1.4, "kw": 1.5, "kt": 1.05, "dt": 0.62, "gc": 0.145, "gs": 0.07}
    values = {"Jr": known(off(rng, 3.1, 0.02))} | near(rng, true, 0.04)
    text = model_text("teetering rotor", values, {}, {
        "om": ("(q0 + kv*(wind - 11) - kw*(om - 7.6) - torque)/Jr", 7.6, "rad/s"), "tt": ("td", 0.02, "rad"),
        "td": ("-kt*om**2*tt - dt*om*td + om*shear*(gc*cos(turned) + gs*sin(turned))", 0.0, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "teeter": ("tt*180/pi", "deg"),
         "power": ("0.9*torque*om", "kW")})  # fmt: skip
    columns: dict[str, Column] = {
        "wind": (np.round(air.at, 2), "m/s", "disturbance"),
        "shear": (np.round(air.at * share[: 16 * rows : 16], 3), "m/s", "disturbance"),
        "turned": (np.round(x[:, 1], 4), "rad", "disturbance"), "torque": (u[:, 0], "kN m", "input"),
        "rotor_speed": (daq(rng, x[:, 0] * 30 / pi, (0, 120), 12, noise=0.02), "rpm", "output"),
        "teeter": (daq(rng, np.degrees(x[:, 2]), (-10, 10), 12, noise=0.02), "deg", "output"),
        "power": (daq(rng, 0.9 * u[:, 0] * x[:, 0], (0, 100), 12, noise=0.15), "kW", "output")}  # fmt: skip
    return Case("teeter_stops", step, columns, text, ("end_stop",), (), {"high_stop": stop}, machine=WT,
                context=SETTING + LOOP, true=true)  # fmt: skip


def logged(rng: np.random.Generator, run: Run, late: int = 0, corner: float = 0.45) -> dict[str, Column]:
    """Return what a logger of 12 bits keeps of a run; the power meter's rows may come late."""
    power = 0.9 * run.u[:, 1] * run.x[:, 0]
    power = np.r_[np.full(late, power[0]), power[: len(power) - late]]
    return {
        "wind": (np.round(run.wind, 2), "m/s", "disturbance"), "pitch": (run.u[:, 0], "deg", "input"),
        "torque": (np.round(run.u[:, 1], 3), "kN m", "input"),
        "rotor_speed": (daq(rng, (run.x[:, 0] + run.heard) * 30 / pi, (0, 120), 12, corner=corner), "rpm", "output"),
        "power": (daq(rng, power, (0, 80), 12, noise=0.1, slow=0.05, corner=corner), "kW", "output"),
        "tower_top_fa_acc": (daq(rng, run.fore, (-5, 5), 12, noise=0.015, corner=corner), "m/s^2",
                             "output")}  # fmt: skip


def metered(rng: np.random.Generator) -> Case:
    """Five minutes at 20 Hz held against a simulator's run in other turbulence; both have the blades' passing.

    The fault: the power meter is on another logger, whose clock is 0.6 s late.
    """
    rows, step, wind, made = 5000, 0.05, 13.5, []
    for late in (0, 12):
        twin = SMALL if late else replace(SMALL, inertia=3.13, mass=3.43, kb=0.0505)
        air = Air(rng, rows, step, wind, intensity=0.11, rotor=7.6)
        plant = Plant(twin, air, extra=lambda _, x: (0.12 * cos(2 * x[5]), 0.03 * sin(2 * x[5])))
        run = operated(rng, plant, rows, step, wind, frequency=0.9, still=0.2, fine=3)
        made.append(logged(rng, run, late))
    case = Case("small_meter", step, made[1], {}, ("data_time_offset",), (), {"offset_s": 0.6}, machine=WT,
                context=SETTING + LOOP, headings=True)  # fmt: skip
    return paired(case, [made[0]])


def _warming(air: Air, gust: Array, fade: float, back: float) -> Slope:
    """Return the slope of rotor and magnets; `back` is the torque of a current of 1 A."""

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = air(t) + float(gust[int(t / air.h / 16)])
        torque = back * u[0] * (1 - fade * x[1])
        return ((3.6 + 0.95 * (v - 8.5) - 0.62 * (x[0] - 6) - torque) / 3.1, ((u[0] / 60) ** 2 - x[1]) / 70)

    return slope


def magnets(rng: np.random.Generator) -> Case:
    """A generator with magnets behind the two blades, its current steered; the simulator had the same wind and current.

    Hidden: the magnets lose an eighth of their flux when the windings are warm, over 70 s; no entry of the catalogue
    has that, and no temperature is recorded. Ten minutes at 5 Hz.
    """
    rows, step = 3000, 0.2
    air = Air(rng, rows, step, 8.5, intensity=0.12, rotor=7.6)
    gust = wander(rng, rows + 1, 4, 0.12)
    level = stairs(rng, rows, 150, 500, (-28, -14, 0, 12)) + 2.5 * stairs(rng, rows, 10, 40, (-1, 0, 1))
    real, model = _warming(air, gust, 0.13, 0.072), _warming(air, 0 * gust, 0.0, 0.0665)
    x, u = integrate(real, [6, 0.6], rows, step, lambda k, x: (round(50 + level[k] + 11 * (x[0] - 6), 1),), 5)
    y, _ = integrate(model, [6, 0], rows, step, lambda k, _: u[k], 5)
    made = []
    for z, real_one in ((y, False), (x, True)):
        torque = (0.072 * (1 - 0.13 * x[:, 1]) if real_one else 0.0665) * u[:, 0]
        noise = 1.0 if real_one else 0.0
        made.append({
            "wind": (np.round(air.at, 2), "m/s", "disturbance"), "current": (u[:, 0], "A", "input"),
            "rotor_speed": (daq(rng, z[:, 0] * 30 / pi, (0, 120), 13, noise=0.03 * noise), "rpm", "output"),
            "power": (daq(rng, 0.93 * torque * z[:, 0], (0, 80), 13, noise=0.08 * noise), "kW", "output")})  # fmt: skip
    case = Case("small_magnets", step, made[1], {}, outside=True, machine=WT, context=SETTING + LOOP)
    return paired(case, [made[0]], same_inputs=True)


SMALL_MAKERS: Makers = {
    "teeter_stops": (931, teetering), "small_meter": (932, metered), "small_magnets": (933, magnets),
}  # fmt: skip
