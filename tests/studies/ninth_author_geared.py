"""A turbine of 2 MW with a gearbox above rated wind, of which a piece is left out.

Every plant is a function of a random generator that returns its case; with `complete` nothing is hidden.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import pi

import numpy as np
from ninth_author_aero import GEARED
from ninth_author_parts import (
    LOOP,
    WT,
    Air,
    Makers,
    daq,
    integrate,
    model_text,
    near,
    paired,
    rates,
    stairs,
    stands,
    wander,
)
from ninth_author_plant import Plant, Run, linear_onshore, onshore_text, operated
from second_author_parts import Case, Column
from textbook_plants import Array

SETTING = "blades = 3\nrated_speed_rad_s = 1.8\ngearbox_ratio = 98.0\n"


def logged(rng: np.random.Generator, run: Run, efficiency: float, *, corner: float = 0.0,
           speed: Array | None = None, bits: int = 14, jitter: float = 0.0, zero: float = 0.0,
           ) -> dict[str, Column]:  # fmt: skip
    """Return what the controller's logger keeps of a run."""
    om = run.x[:, 0] if speed is None else speed
    read = (om + run.heard) * 30 / pi * 98
    power = efficiency * run.u[:, 1] * run.x[:, 0]
    return {
        "wind": (np.round(run.wind, 2), "m/s", "disturbance"), "pitch": (run.u[:, 0], "deg", "input"),
        "torque": (run.u[:, 1], "kN m", "input"),
        "generator_speed": (daq(rng, read, (0, 2400), bits, corner=corner, jitter=jitter), "rpm", "output"),
        "power": (daq(rng, power, (-200, 2800), bits, noise=3, slow=2, corner=corner, jitter=jitter), "kW",
                  "output"),
        "tower_top_fa_acc": (daq(rng, run.fore + zero, (-2, 2), bits, noise=0.006, slow=0.003, corner=corner,
                                 jitter=jitter), "m/s^2", "output")}  # fmt: skip


def servo(rng: np.random.Generator) -> Case:
    """Rotor and tower in turbulence of 15 m/s, two recordings of 150 s at 10 Hz.

    Hidden: the pitch drive is of second order, 5.5 rad/s with a damping of 0.6; the model has the demand at once.
    """
    rows, step = 3000, 0.1
    air = Air(rng, rows, step, 15.0, intensity=0.11, gusts=[(80, 5.0), (210, 6.0)])
    run = operated(rng, Plant(GEARED, air, ("second", 5.5, 0.6)), rows, step, 15.0)
    text, true = onshore_text(rng, GEARED, 15.0, 0.05)
    return Case("geared_servo", step, logged(rng, run, 0.94), text, ("actuator_second_order",), (),
                {"omega_rad_s": 5.5, "damping": 0.6}, machine=WT, context=SETTING + LOOP, cuts=(1500,),
                true=true)  # fmt: skip


def slow(rng: np.random.Generator) -> Case:
    """Rotor and tower in gusts of 16 m/s, 240 s at 10 Hz, jitter of the clock, some rows lost.

    Hidden: the pitch moves by 3.5 deg/s at most, and the logger's speed comes behind a filter of 2.5 rad/s.
    """
    rows, step, om, z = 2400, 0.1, 2.5, 0.75
    air = Air(rng, rows, step, 16.0, intensity=0.12, gusts=[(40, 6.0), (100, 7.0), (170, 6.0)])
    run = operated(rng, Plant(GEARED, air, ("rate", 3.5, 0)), rows, step, 16.0, shake=1.8,
                   frequency=0.35)  # fmt: skip
    true_speed = np.r_[run.x[:, 0], run.x[-1, 0]]

    def filtering(_: float, m: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return m[1], om * om * (u[0] - m[0]) - 2 * z * om * m[1]

    behind, _ = integrate(filtering, [float(true_speed[0]), 0], rows, step,
                          lambda k, _: [float(true_speed[k : k + 2].mean())], 4)  # fmt: skip
    text, true = onshore_text(rng, GEARED, 16.0, 0.05)
    columns = logged(rng, replace(run, heard=0.2 * run.heard), 0.94, speed=behind[:, 0], jitter=0.02)
    return Case("geared_slow_pitch", step, columns, text, ("rate_limit", "sensor_second_order"), (),
                {"rate_per_s": 3.5, "omega_rad_s": om, "damping": z}, machine=WT, context=SETTING + LOOP, lost=6,
                headings=True, true=true)  # fmt: skip


def swapped(rng: np.random.Generator) -> Case:
    """The linear model of a design tool at 14 m/s, 200 s at 20 Hz.

    The fault: the accelerometers fore and aft and to the side stand under each other's names.
    """
    rows, step = 4000, 0.05
    plant = Plant(GEARED, Air(rng, rows, step, 14.0, intensity=0.08), linear=14.0)
    run = operated(rng, plant, rows, step, 14.0)
    model = linear_onshore(rng, plant, 0.05)
    columns = logged(rng, replace(run, fore=run.side), 0.94)
    del columns["power"]
    columns["tower_top_ss_acc"] = (daq(rng, run.fore, (-2, 2), 14, noise=0.006), "m/s^2", "output")
    return Case("geared_plugs", step, columns, model, ("data_channel_swap",), (), machine=WT,
                context=SETTING + LOOP, true={})  # fmt: skip


def stalled(rng: np.random.Generator) -> Case:
    """An active-stall machine of 2 MW on an induction generator, its speed nearly fixed (Burton et al. 2011, ch. 6).

    Hidden: above 14.5 m/s of the nacelle's averaged wind the blades' vortex generators give up, and the pitch does
    40 % more than below. Pitch is negative, towards stall; power and speed follow the slip. 400 s at 5 Hz.
    """
    rows, step, more, edge = 2000, 0.2, 0.4, 14.5
    air = Air(rng, rows, step, 14.5, intensity=0.13)
    mean = np.array([np.mean(air.at[max(0, k - 25) : k + 1]) for k in range(rows)])
    sched = np.round(mean + 0.05 * rng.standard_normal(rows), 2)
    u = np.c_[np.round(stairs(rng, rows, 15, 60, (-7, -6, -5, -4, -3)), 2), wander(rng, rows, 4, 0.15), sched > edge]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v, b = air(t) + u[1] - x[2] - 14.5, (u[0] + 5) * (1 + more * u[2])
        q = 1090 + 95 * v + 62 * b - 310 * (x[0] - 1.832) - 13500 * (x[0] - 1.8)
        w = 2 * pi * 0.335
        return q / 6000, x[2], (205 + 17 * v + 6.5 * b) / 165 - w * w * x[1] - 0.06 * w * x[2]

    w = 2 * pi * 0.335
    x, _ = integrate(slope, [1.85, 205 / 165 / w**2, 0], rows, step, lambda k, _: u[k].tolist(), 6)
    return _stall_case(rng, air, u, x, rates(slope, step, x, u)[:, 2], sched, more)


def _stall_case(rng: np.random.Generator, air: Air, u: Array, x: Array, acc: Array, sched: Array, more: float) -> Case:
    """Return the case of the active-stall machine."""
    true = {"kv": 95.0, "kb": 62.0, "kw": 310.0, "ks": 13500.0, "tv": 17.0, "tb": 6.5, "ft": 0.335, "zt": 0.03}
    values = stands({"Jr": 6000.0, "mt": 165.0}) | near(rng, {k: true[k] for k in true if k != "ft"}, 0.05)
    values |= near(rng, {"ft": 0.335}, 0.01, ft="Hz") | near(rng, {"q0": 1090.0}, 0.02)
    fore = "(205 + tv*(wind - vf - 14.5) + tb*(pitch + 5))/mt - (2*pi*ft)**2*xf - 4*pi*ft*zt*vf"
    torque = "q0 + kv*(wind - vf - 14.5) + kb*(pitch + 5) - kw*(om - 1.832)"
    text = model_text("active stall", values, {}, {
        "om": (f"({torque} - ks*(om - 1.8))/Jr", 1.85, "rad/s"), "xf": ("vf", float(x[0, 1]), "m"),
        "vf": (fore, 0.0, "m/s")}, {"generator_speed": ("om*30/pi*98", "rpm"), "power": ("0.94*ks*(om - 1.8)*om", "kW"),
        "tower_top_fa_acc": (fore, "m/s^2")})  # fmt: skip
    om = x[:, 0]
    columns: dict[str, Column] = {
        "wind": (np.round(air.at, 2), "m/s", "disturbance"), "pitch": (u[:, 0], "deg", "input"),
        "nacelle_wind": (sched, "m/s", "scheduling"),
        "generator_speed": (daq(rng, om * 30 / pi * 98, (1500, 2000), 13, noise=0.3), "rpm", "output"),
        "power": (daq(rng, 0.94 * 13500 * (om - 1.8) * om, (0, 3000), 13, noise=12, slow=6), "kW", "output"),
        "tower_top_fa_acc": (daq(rng, acc, (-2, 2), 13, noise=0.008), "m/s^2", "output")}  # fmt: skip
    return Case("stall_regions", 0.2, columns, text, ("operating_region_switch",), (), {"gain_change": more},
                machine=WT, context="blades = 3\n", true=true)  # fmt: skip


def simulated(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Ten minutes of the machine against ten minutes of its simulator in other turbulence, both at 10 Hz.

    Hidden: the pitch drive lags by 0.35 s where the simulator's moves at once, and the power that arrives is 4 % less.
    The turbine's accelerometer has a zero of 0.03 m/s2.
    """
    rows, step, wind = (4000, 0.1, 17.0) if complete else (5000, 0.1, 15.0)
    made: list[dict[str, Column]] = []
    for drive, part in ((("direct", 0.0, 0.0), 1.0), (("lag", 0.35, 0.0), 0.96)):
        drive, part = (("direct", 0.0, 0.0), 1.0) if complete else (drive, part)
        air = Air(rng, rows, step, wind, intensity=0.11)
        twin = GEARED if not made else replace(GEARED, inertia=6060.0, mass=167.0, fore=0.334, kb=0.0594)
        run = operated(rng, Plant(twin, air, drive), rows, step, wind, shake=0.9)
        made.append(logged(rng, run, 0.94 * part, corner=0.45, zero=0.03 if made else 0.0))
    if complete:
        case = Case("null_geared_run", step, made[1], {}, machine=WT, context=SETTING + LOOP, lost=5,
                    beside=("sensor_bias",))  # fmt: skip
    else:
        case = Case("geared_twin", step, made[1], {}, ("actuator_lag", "efficiency_loss"), ("sensor_scale",),
                    {"tau_s": 0.35, "loss": 0.04}, ("sensor_bias",), machine=WT, context=SETTING + LOOP)  # fmt: skip
    return paired(case, [made[0]])


GEARED_MAKERS: Makers = {
    "geared_servo": (901, servo), "geared_slow_pitch": (902, slow), "geared_plugs": (903, swapped),
    "stall_regions": (904, stalled), "geared_twin": (905, simulated),
}  # fmt: skip
