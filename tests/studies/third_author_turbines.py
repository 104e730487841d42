"""Wind turbines and their parts whose models lack a piece of their physics: drives, rotor, tower, blade, mooring.

As third_author_machines.py. Where wind or waves act that nobody records, the docstring says so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import copysign, inf, pi, tanh

import numpy as np
from second_author_parts import Case, Tones, coloured, equations, flips, known, plateaus, smooth
from textbook_plants import Array, noisy
from third_author_parts import looked_up, off, rk, told, white

WT = "wind turbine"
CAP, LATE, BIAS, BEND = 6.6, 11.0, 0.6, 1.9  # kN m, s, m/s, rad/s: what the cases of `turbine` hide


def pitch(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A hydraulic pitch drive in its loop, the valve in per cent (Merritt 1967, Hydraulic Control Systems, chapter 5).

    Its spool overlaps by 3 % to either side; the model's valve has no overlap, and a play is no answer. The null's has
    none either, but a coarse encoder, a gap, and a load on the blade that wanders and that nobody records.
    """
    name, rows, step, width = "null_pitch" if complete else "pitch_overlap", 2510, 0.02, 0.0 if complete else 3.0
    wanted = 8 + plateaus(rng, rows, 110, -2.5, 2.5) + smooth(rng, rows, 60, 0.5)
    load, shake = smooth(rng, rows, 120, 0.25 if complete else 0.1), flips(rng, rows, 11, 2.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return max(min(14 * (wanted[k] - x[0]), 60), -60) + shake[k], load[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        valve = copysign(max(abs(u[0]) - width, 0), u[0])
        return x[1], (0.16 * valve - x[1] - u[1]) / 0.09

    x, u = rk(slope, [8, 0], rows, step, command, 6)
    true = {"kq": 0.16, "tv": 0.09}
    text = equations("pitch drive", off(rng, true, kq="deg/s/%", tv="s"), {
        "beta": ("rate", 8, "deg"), "rate": ("(kq*valve - rate)/tv", 0, "deg/s")},
        {"pitch_angle": ("beta", "deg")})  # fmt: skip
    grain = 0.05 if complete else 0.01
    read = np.round(white(rng, x[:, 0], 0.01) / grain) * grain
    columns = {"valve": (u[:, 0], "%", "input"), "pitch_angle": (read, "deg", "output")}
    if complete:
        return Case(name, step, columns, text, context="closed_loop = true\n", gap=(900, 1010),
                    beside=("sensor_quantisation",), verdicts=("named",))  # fmt: skip
    return Case(name, step, columns, text, ("deadband",), (), {"width": width}, context="closed_loop = true\n",
                beside=("sensor_quantisation",))  # fmt: skip


def yaw(rng: np.random.Generator) -> Case:
    """A yaw drive against its brake's dry friction, which the model lacks (Burton et al. 2011, Wind Energy Handbook).

    The wind's moment on the nacelle wanders and nobody records it. Inertia, gain and damping are all free, so that only
    ratios are known and no value is asked for.
    """
    name, rows, step = "yaw_brake", 1480, 0.1
    u, wind = plateaus(rng, rows, 35, -650, 650), smooth(rng, rows, 40, 25e3)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (1000 * u[0] + u[1] - 2.5e7 * x[1] - 2.2e5 * tanh(x[1] / 2e-4)) / 6e6

    x, _ = rk(slope, [0.4, 0], rows, step, told(np.c_[u, wind]), 40)
    true = {"Jn": 6e6, "gm": 1.0, "by": 2.5e7}
    text = equations("yaw drive", off(rng, true, Jn="kg m2", by="N m s/rad"), {
        "psi": ("om", 0.4, "rad"), "om": ("(gm*1000*motors - by*om)/Jn", 0, "rad/s")},
        {"heading": ("psi*180/pi", "deg"), "yaw_rate": ("om*180/pi", "deg/s")})  # fmt: skip
    clean = {"heading": np.degrees(x[:, 0]), "yaw_rate": np.degrees(x[:, 1])}
    columns = {"motors": (u, "kN m", "input"), "heading": (np.round(clean["heading"] / 0.01) * 0.01, "deg", "output"),
               "yaw_rate": (white(rng, clean["yaw_rate"], 0.02), "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("coulomb_friction",), ("stiction",), machine=WT,
                beside=("sensor_quantisation",))  # fmt: skip


# name, rows, entries that are right, that may stand in for them, and what is asked for
KINDS: dict[str, tuple[str, int, tuple[str, ...], tuple[str, ...], dict[str, float]]] = {
    "cap": ("wt_torque_cap", 1490, ("input_saturation",), (), {"high": CAP}),
    "mast": ("wt_mast_late", 1210, ("transport_delay",), (), {"delay_s": LATE}),
    "bias": ("wt_vane_bias", 900, ("sensor_bias",), (), {"bias": BIAS}),
    "filter": ("wt_speed_filter", 1800, ("sensor_second_order",), ("sensor_lag",), {"omega_rad_s": BEND}),
    "null": ("null_turbine", 1530, (), (), {}),
}


def turned(wind: Callable[[float], float], dither: Array, step: float, fine: int, most: float) -> tuple[Array, Array]:
    """Return rotor speed, filtered speed and its slope, and the torque asked for and given, which has a limit."""
    area, law = 0.5 * 1.225 * pi * 40.0**2, 173.2 / 90

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = wind(t)
        drive = area * (0.45 - 0.011 * (x[0] * 40 / v - 8) ** 2) * v**3 / x[0]
        return ((drive - 90e3 * u[1]) / 6.1e6, x[2], BEND**2 * (x[0] - x[1]) - 1.4 * BEND * x[2])

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        asked = law * x[0] ** 2 + dither[k]
        return asked, min(asked, most)

    return rk(slope, [1.75, 1.75, 0], len(dither), step, command, fine)


def turbine(rng: np.random.Generator, kind: str) -> Case:
    """A rotor of 2 MW with its torque law, wind from a mast (Bianchi et al. 2007, Wind Turbine Control Systems).

    The model lacks the converter's limit, the way from the mast to the rotor, the offset of the nacelle's anemometer or
    the filter of the speed. The null has coloured noise, three recordings and lost rows.
    """
    (name, rows, right, alike, values), step, fine = KINDS[kind], 0.2, 4
    air = Tones.drawn(rng, 0.003, 0.3, 40, 1.1, 9.0)
    wind, dither = looked_up(air, rows, step, fine), flips(rng, rows, 9, 0.5)
    x, u = turned(wind, dither, step, fine, CAP if kind == "cap" else inf)
    t = np.arange(rows) * step
    mast = np.asarray(air(t + LATE if kind == "mast" else t))  # the mast feels the wind earlier
    outputs = {"gen_speed": ("90*om*30/pi", "rpm"), "power": ("eta*90*om*torque", "kW")}
    clean = {"gen_speed": 90 * 30 / pi * x[:, 1 if kind == "filter" else 0], "power": 0.955 * 90 * x[:, 0] * u[:, 1]}
    if kind == "bias":
        outputs["nacelle_wind"] = ("0.9*mast", "m/s")
        clean["nacelle_wind"] = 0.9 * mast + BIAS
    driven = "0.5*1.225*pi*40**2*(cpm - 0.011*(om*40/mast - 8)**2)*mast**3/om"
    text = equations("rotor", off(rng, {"J": 6.1, "cpm": 0.45, "eta": 0.955}, J="1e6 kg m2"), {
        "om": (f"({driven} - 90*1000*torque)/(J*1e6)", 1.75, "rad/s")}, outputs)  # fmt: skip
    std = {"gen_speed": 0.8, "power": 5.0, "nacelle_wind": 0.25}
    read = {key: coloured(rng, y, 0.015, 5) if kind == "null" else white(rng, y, std[key]) for key, y in clean.items()}
    columns = {"torque": (u[:, 0], "kN m", "input"), "mast": (mast, "m/s", "disturbance")}
    columns |= {key: (y, outputs[key][1], "output") for key, y in read.items()}
    context = "blades = 3\nclosed_loop = true\n"
    if kind == "null":
        return Case(name, step, columns, text, machine=WT, context=context, cuts=(510, 1020), lost=9, headings=True)
    return Case(name, step, columns, text, right, alike, values, machine=WT, context=context)


def tower(rng: np.random.Generator) -> Case:
    """A tower with an accelerometer in g and a strain gauge (Hansen 2015, Aerodynamics of Wind Turbines, chapter 11).

    The model has the first mode only; the second, at 1.9 Hz, may be told as a mode of the structure or of the tower.
    """
    name, rows, step = "tower_second", 2050, 0.1
    u = 420 + flips(rng, rows, 5, 60) + plateaus(rng, rows, 60, -90, 90)
    w1, w2, m1, m2 = 2 * pi * 0.31, 2 * pi * 1.9, 3.6e5, 1.6e5

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (x[1], 1e3 * u[0] / m1 - w1**2 * x[0] - 2 * 0.03 * w1 * x[1],
                x[3], 1e3 * u[0] / m2 - w2**2 * x[2] - 2 * 0.012 * w2 * x[3])  # fmt: skip

    x, _ = rk(slope, [0.3, 0, 0.02, 0], rows, step, told(u), 12)
    acc = np.array([s[1] + s[3] for s in (slope(0, a, [b]) for a, b in zip(x.tolist(), u, strict=True))]) / 9.80665
    moment = 85 * m1 * w1**2 * x[:, 0] / 1e6 + 25 * m2 * w2**2 * x[:, 2] / 1e6
    true = {"Mt": 360.0, "Kt": 360.0 * w1**2, "Ct": 360.0 * 0.06 * w1, "hh": 85.0}
    spring = "(thrust - Kt*defl - Ct*ddefl)/Mt"
    text = equations("tower", off(rng, true, Mt="t", Kt="kN/m", hh="m"), {
        "defl": ("ddefl", 0.3, "m"), "ddefl": (spring, 0, "m/s")},
        {"tower_top_acc": (f"{spring}/9.80665", "g"), "tower_base_moment": ("hh*Kt*defl/1000", "MN m")})  # fmt: skip
    columns = {"thrust": (u, "kN", "input"), "tower_top_acc": (noisy(rng, acc, 0.02), "g", "output"),
               "tower_base_moment": (noisy(rng, moment, 0.02), "MN m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("structural_mode",), ("tower_fore_aft",), {"frequency_hz": 1.9}, machine=WT,
                context="blades = 3\n")  # fmt: skip


def blade(rng: np.random.Generator) -> Case:
    """Edgewise moment of a blade that weighs once a turn (Hansen 2015, Aerodynamics of Wind Turbines, chapter 12).

    The model has the rotor's torque only. Unequal masses and wind shear are no answers.
    """
    name, rows, step = "blade_weight", 1960, 0.05
    u = plateaus(rng, rows, 70, 500, 1300) + flips(rng, rows, 6, 60)
    speed = 1.35 + smooth(rng, rows, 150, 0.12)
    angle = 0.7 + np.r_[0, np.cumsum(speed)[:-1]] * step
    w, side = 2 * pi * 1.3, 210.0

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], w**2 * (u[0] / 3 - x[0]) - 2 * 0.03 * w * x[1]

    x, _ = rk(slope, [300, 0], rows, step, told(u), 8)
    moment = x[:, 0] + side * np.sin(angle)
    true = {"fe": 1.3, "ze": 0.03, "ge": 1 / 3}
    text = equations("blade edge", off(rng, true, fe="Hz"), {
        "edge": ("dedge", 300, "kN m"),
        "dedge": ("(2*pi*fe)**2*(ge*rotor_torque - edge) - 2*ze*2*pi*fe*dedge", 0, "kN m/s")},
        {"blade1_edge_moment": ("edge", "kN m")})  # fmt: skip
    columns = {"rotor_torque": (u, "kN m", "input"), "azimuth": (np.degrees(angle) % 360, "deg", "azimuth"),
               "blade1_edge_moment": (white(rng, moment, 8.0), "kN m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("gravity_1p",), (), machine=WT, context="blades = 3\n")


def surge(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Surge of a floating turbine whose mooring stiffens downwind (Faltinsen 1990, Sea Loads, chapter 8).

    The model's mooring is linear; as the lines pull to one side only, a cubic stiffness comes near. Mass and force are
    in units of their own, so no value is asked for. The null's mooring stiffens, too, the slow drift force that nobody
    records is larger, and there is a gap.
    """
    name, rows, step = ("null_surge", 1310, 2.0) if complete else ("surge_mooring", 1420, 2.0)
    u = plateaus(rng, rows, 45, 50, 750)
    drift = smooth(rng, rows, 30, 45 if complete else 12)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (u[0] + u[1] - 145 * x[1] - 62 * x[0] - 4.4 * x[0] ** 2) / 14.2e3

    x, _ = rk(slope, [4, 0], rows, step, told(np.c_[u, drift]), 4)
    true = {"ms": 14.2, "cs": 145.0, "k1": 62.0} | ({"k2": 4.4} if complete else {})
    more = " - k2*sx**2" if complete else ""
    text = equations("platform surge", off(rng, true, ms="kt", cs="kN s/m", k1="kN/m"), {
        "sx": ("sv", 4, "m"), "sv": (f"(thrust - cs*sv - k1*sx{more})/(1000*ms)", 0, "m/s")},
        {"surge": ("sx", "m"), "surge_speed": ("sv", "m/s")})  # fmt: skip
    columns = {"thrust": (u, "kN", "input"), "surge": (white(rng, x[:, 0], 0.05), "m", "output"),
               "surge_speed": (white(rng, x[:, 1], 0.01), "m/s", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, machine="floating platform", gap=(600, 655))
    return Case(name, step, columns, text, ("quadratic_stiffness",), ("cubic_stiffness",), machine="floating platform")


def demanded(rng: np.random.Generator, rows: int, dt: float, kp: float, ki: float, pk: float) -> Array:
    """Return generator speed as read and pitch demand (N, 2) of a rotor in turbulence behind a drive of 0.3 s."""
    gust, total, last, speed, angle = smooth(rng, rows, 80, 1.0), 11.0, 11.0, 1173.0, 11.0
    found = np.zeros((rows, 2))
    for k in range(rows):
        heard = float(np.round(speed + 0.5 * rng.standard_normal(), 2))
        error, scheduled = heard - 1173.7, 1 / (1 + max(last, 0) / pk)
        asked = kp * scheduled * error * 10 + total
        found[k] = heard, asked
        total, last = total + ki * scheduled * dt * error, asked
        angle += dt / 0.3 * (asked - angle)
        speed += dt * (-0.08 * (speed - 1173.7) + 22 * gust[k] - 9 * (angle - 11.0))
    return found


def controller(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A pitch controller with gain schedule in discrete time (Jonkman et al. 2009, NREL/TP-500-38060).

    The proportional gain, declared as known, is 18 % too small. The null's values are free, its output comes in steps
    of 0.01 degrees in two recordings.
    """
    name, rows, dt = "null_pi" if complete else "pi_constant", 1900, 0.05
    true = {"Kp": 0.0225, "Ki": 0.0072, "PK": 6.3}  # deg/rpm, deg/(rpm s), deg
    found = demanded(rng, rows, dt, *true.values())
    values, declared = off(rng, true, Kp="deg/rpm", PK="deg"), float(f"{true['Kp'] * 0.82:.4g}")
    if not complete:
        values["Kp"] = known(declared, "deg/rpm")
    lines = ["[model]", 'name = "pitch controller"', 'time = "discrete"', f"sample_time_s = {dt}", "[parameters]"]
    lines += [f"{key} = {v}" for key, v in values.items()]
    lines += ["[[auxiliary]]", 'name = "sched"', 'equation = "1/(1 + max(last,0)/PK)"',
              "[[auxiliary]]", 'name = "err"', 'equation = "gen_speed - 1173.7"',
              "[[state]]", 'name = "integral"', f'next = "integral + Ki*sched*{dt}*err"',
              "initial = { value = 11.0, free = true }", 'unit = "deg"',
              "[[state]]", 'name = "last"', 'next = "10*Kp*sched*err + integral"',
              "initial = { value = 11.0, free = true }", 'unit = "deg"',
              "[[output]]", 'name = "pitch_demand"', 'equation = "10*Kp*sched*err + integral"',
              'unit = "deg"']  # fmt: skip
    read = white(rng, found[:, 1], 0.02)
    columns = {"gen_speed": (found[:, 0], "rpm", "input"),
               "pitch_demand": (np.round(read, 2) if complete else read, "deg", "output")}  # fmt: skip
    text = "\n".join(lines) + "\n"
    loop = "closed_loop = true\n"
    if complete:
        return Case(name, dt, columns, text, context=loop, cuts=(950,), clean={"pitch_demand": found[:, 1]}, true=true)
    return Case(name, dt, columns, text, ("parameter_error",), (), {"change": true["Kp"] - declared}, context=loop)


TURBINES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "pitch_overlap": (111, pitch), "yaw_brake": (112, yaw), "wt_torque_cap": (113, partial(turbine, kind="cap")),
    "wt_mast_late": (114, partial(turbine, kind="mast")), "wt_vane_bias": (115, partial(turbine, kind="bias")),
    "wt_speed_filter": (116, partial(turbine, kind="filter")), "tower_second": (117, tower),
    "blade_weight": (118, blade), "surge_mooring": (119, surge), "pi_constant": (125, controller),
}  # fmt: skip
