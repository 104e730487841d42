"""Generators, pumps, conveyors, decanters, shafts and coilers, of which slow drives, limits and shapes are left out.

As seventh_author_rotors.py. With `complete` nothing is hidden, which is a null in seventh_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, pi, sin, tanh

import numpy as np
from second_author_parts import Case, Column, equations, flips, known, plateaus, smooth, state_space
from seventh_author_parts import begun, sampled, started, twisting
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged, ramps, skewed
from third_author_parts import rk, told


def genset(rng: np.random.Generator) -> Case:
    """A diesel generator of 1 MW alone on its grid (Kiencke and Nielsen 2005; Woodward 2011, Governing Fundamentals).

    Hidden: the hydraulic actuator of the rack answers at 7 rad/s with a damping of 0.45. The governor's demand and the
    load's torque are recorded, the load's flicker is not; two recordings of 450 rows.
    """
    name, rows, step, w = "diesel_rack", 900, 0.05, 7.0
    load, flicker = plateaus(rng, rows, 55, 3.4, 6.6), gust(rng, rows, 6, 0.05)
    heard, wanted = hiss(rng, rows, 0.04), plateaus(rng, rows, 160, 103.5, 106)
    shake, total = flips(rng, rows, 13, 1.5), [50.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        total[0] += 5.0 * step * error
        return max(min(total[0] + 6 * error + shake[k], 100), 0), load[k], flicker[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        torque = 0.105 * x[1] - 0.02 * (x[0] - 104.7)
        return (torque - u[1] + u[2]) / 0.36, x[2], w * w * (u[0] - x[1]) - 0.9 * w * x[2]

    x, u = rk(slope, [104.7, 50, 0], rows, step, command, 8)
    true = {"Jg": 0.36, "kr": 0.105, "dg": 0.02}
    values = {"Jg": fixed(rng, 0.36, "1000 kg m2", 0.02)} | declared(
        rng, {k: true[k] for k in ("kr", "dg")}, 0.06, kr="kN m/%", dg="kN m s")  # fmt: skip
    text = equations("generating set", values, {
        "w": ("(kr*rack_demand - dg*(w - 104.7) - load)/Jg", 104.7, "rad/s")},
        {"speed": ("w*30/pi", "rpm")})  # fmt: skip
    columns: dict[str, Column] = {
        "rack_demand": (np.round(u[:, 0], 2), "%", "input"), "load": (np.round(load, 3), "kN m", "disturbance"),
        "speed": (logged(rng, (x[:, 0] + heard) * 30 / pi, 0.0, ends=(0, 1500), bits=14), "rpm", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("actuator_second_order",), (), {"omega_rad_s": w}, context=LOOP,
                cuts=(450,), true=true)  # fmt: skip


def pump(rng: np.random.Generator) -> Case:
    """A drainage pump on a converter and its rising main (Karassik et al. 2008, Pump Handbook; rigid water column).

    Hidden: the converter ramps the speed by 4 % a second at most. An operator steps the reference; the level of the pit
    wanders, which nobody records. Three short recordings at about their own flows.
    """
    name, rows, step, rate = "pump_ramp", 900, 0.25, 4.0
    about = np.repeat([80.0, 88.0, 94.0], (280, 300, 320))  # each is reached before its recording begins
    u = np.c_[about + plateaus(rng, rows, 30, -7, 6), gust(rng, rows, 30, 0.12)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        move = max(min((u[0] - x[0]) / 0.3, rate), -rate)
        lift = 62 * (x[0] / 100) ** 2 - 2.6e-4 * x[1] ** 2
        return move, (lift - 21 + u[1] - 6.2e-4 * x[1] * abs(x[1])) / 0.54

    x, _ = rk(slope, [80, 145], rows, step, told(u), 8)
    true = {"H0": 62.0, "hs": 21.0, "hp": 2.6, "hr": 6.2, "Lq": 0.54, "tn": 0.3}
    units = {"H0": "m", "hs": "m", "hp": "1e-4 m h2/m6", "hr": "1e-4 m h2/m6", "Lq": "m h s/m3"}
    free = declared(rng, {k: true[k] for k in ("H0", "hs", "hp", "hr", "Lq")}, 0.05, **units)
    text = equations("rising main", {"tn": known(0.3, "s")} | free, {
        "n": ("(reference - n)/tn", 80, "%"),
        "q": ("(H0*(n/100)**2 - (hp + hr)/10000*q*abs(q) - hs)/Lq", 145, "m3/h")},
        {"flow": ("q", "m3/h"), "pressure": ("H0*(n/100)**2 - hp/10000*q**2", "m")})  # fmt: skip
    head = 62 * (x[:, 0] / 100) ** 2 - 2.6e-4 * x[:, 1] ** 2
    columns: dict[str, Column] = {
        "reference": (np.round(u[:, 0], 1), "%", "input"),
        "flow": (logged(rng, x[:, 1], 0.02, lag=3, ends=(0, 300), bits=12), "m3/h", "output"),
        "pressure": (logged(rng, head, 0.02, ends=(0, 100), bits=12), "m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("rate_limit",), (), {"rate_per_s": rate}, cuts=(300, 600), true=true)


def conveyor(rng: np.random.Generator) -> Case:
    """A belt conveyor that starts loaded (DIN 22101; Lodewijks 2011, Beltcon 16), in its speed loop.

    Hidden: the converter gives 80 % of the torque at most, whatever is asked for. Three recordings of 500 rows begin at
    rest; a belt scale's load is recorded, its spill is not. Speed is all that is read.
    """
    name, lengths, step, most = "conveyor_limit", (500,) * 3, 0.1, 80.0
    rows = sum(lengths)
    load = 2.4 + smooth(rng, rows, 90, 0.5)
    wanted, shake = plateaus(rng, rows, 70, 0.8, 2.6), flips(rng, rows, 12, 4.0)
    heard, spill = hiss(rng, rows, 0.004), gust(rng, rows, 20, 0.03)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        return max(min(60 * error + x[1] + shake[k], 100), 0), load[k], spill[k], error

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        push, mass = 0.09 * min(u[0], most), 5.2 + u[1]
        rub = 0.024 * 9.81 * mass * tanh(x[0] / 0.05)
        return (push - rub - 0.95 * x[0] + u[2]) / mass, 6.0 * u[3]

    x, u = started(slope, [0, 20], lengths, step, command, 8)
    true = {"mb": 5.2, "kt": 0.09, "fr": 24.0, "bb": 0.95}
    free = declared(rng, {k: true[k] for k in ("kt", "fr", "bb")}, 0.06, kt="kN/%", fr="1e-3", bb="kN s/m")
    mass = "(mb + load)"
    text = equations("belt conveyor", {"mb": fixed(rng, 5.2, "t", 0.02)} | free, {
        "v": (f"(kt*torque - bb*v)/{mass} - fr*9.81/1000*tanh(v/0.05)", 0, "m/s")},
        {"belt_speed": ("v", "m/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "torque": (np.round(u[:, 0], 1), "%", "input"), "load": (np.round(load, 3), "t", "disturbance"),
        "belt_speed": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 5), bits=13), "m/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("input_saturation",), (), {"high": most}, context=LOOP, cuts=begun(lengths),
                true=true)  # fmt: skip


def decanter(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A decanter behind its V-belts, its model linear (Dresig and Holzweißig 2010, Dynamics of Machinery, chapter 4).

    Hidden: motor and bowl swing against each other at 5.5 Hz with a damping of 0.05, as the belts give; the model turns
    as one. The motor's torque about its mean is held between rows, the slurry is not recorded. The null is in discrete
    time, has both bodies and the bowl's speed, and one gain up to 4 % off.
    """
    name, rows, step = ("null_decanter" if complete else "decanter_belt"), 2000, 0.02
    w = 2 * pi * 5.5
    joint = 0.9 * 2.6 / 3.5
    spring, damping = joint * w * w, 0.1 * joint * w
    drive = plateaus(rng, rows, 60, -5, 5) + flips(rng, rows, 7 if complete else 3, 3.0)
    slurry = gust(rng, rows, 8, 0.12)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        through = spring * x[2] + damping * (x[0] - x[1])
        return (u[0] - through) / 0.9, (through - 0.55 * x[1] + u[1]) / 2.6, x[0] - x[1]

    x, _ = rk(slope, [0, 0, 0], rows, step, told(np.c_[drive, slurry]), 10)
    right, off = 30 / pi, skewed(rng, 1, 0.04)
    speeds = [logged(rng, right * x[:, i], 0.01, lag=3 * i, ends=(-200, 200), bits=14) for i in range(2)]
    columns: dict[str, Column] = {"torque": (np.round(drive, 3), "N m", "input"),
                                  "motor_speed": (speeds[0], "rpm", "output")}  # fmt: skip
    if complete:
        a, b = twisting((0.9, 2.6), spring, damping, 0.55)
        columns["bowl_speed"] = (speeds[1], "rpm", "output")
        matrices = sampled(a, b * off, right * np.eye(3)[:2], step)
        return Case(name, step, columns, state_space(step, {"torque": "N m"}, {"motor_speed": "rpm",
                    "bowl_speed": "rpm"}, matrices), cuts=(1000,), lost=8)  # fmt: skip
    whole = (np.array([[-0.55 / 3.5]]), np.array([[off / 3.5]]), np.array([[right]]), np.zeros((1, 1)))
    model = state_space(0, {"torque": "N m"}, {"motor_speed": "rpm"}, whole)
    return Case(name, step, columns, model, ("structural_mode",), ("drivetrain_torsion",), {"frequency_hz": 5.5})


def cardan(rng: np.random.Generator) -> Case:
    """A flywheel behind a single universal joint on a test bench (Seherr-Thoss et al. 2006), which no entry has.

    Not in the model: bent by 22 degrees, the joint turns the flywheel faster and slower twice a turn; the model has it
    turn as the motor. Neither angle is recorded, nor the belt's pull that wanders.
    """
    name, rows, step = "cardan_bench", 1800, 0.01
    u = np.c_[plateaus(rng, rows, 130, 4, 15) + flips(rng, rows, 15, 1.5), gust(rng, rows, 15, 0.25)]
    bent, tilt = cos(22 * pi / 180), sin(22 * pi / 180) ** 2

    def ratio(angle: float) -> tuple[float, float]:
        below = 1 - tilt * cos(angle) ** 2
        return bent / below, -bent * tilt * sin(2 * angle) / below**2

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        g, by = ratio(x[1])
        torque = u[0] + u[1] - 0.14 * x[0] - 0.16 * g * g * x[0] - 0.11 * g * by * x[0] ** 2
        return torque / (0.16 + 0.11 * g * g), x[0]

    x, _ = rk(slope, [30, float(rng.uniform(0, 6))], rows, step, told(u), 10)
    driven = np.array([ratio(a)[0] for a in x[:, 1].tolist()]) * x[:, 0]
    true = {"Jm": 0.16, "Jf": 0.11, "bm": 0.14, "bf": 0.16}
    values = {"Jm": fixed(rng, 0.16, "kg m2", 0.02), "Jf": fixed(rng, 0.11, "kg m2", 0.02)} | declared(
        rng, {"bm": 0.14, "bf": 0.16}, 0.06, bm="N m s", bf="N m s")  # fmt: skip
    text = equations("bench", values, {"w": ("(torque - (bm + bf)*w)/(Jm + Jf)", 30, "rad/s")},
                     {"motor_speed": ("w", "rad/s"), "flywheel_speed": ("w", "rad/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "torque": (np.round(u[:, 0], 2), "N m", "input"),
        "motor_speed": (logged(rng, x[:, 0], 0.01, lag=2, ends=(0, 80), bits=13), "rad/s", "output"),
        "flywheel_speed": (logged(rng, driven, 0.01, ends=(0, 80), bits=13), "rad/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, cuts=(900,), true=true)


def coiler(rng: np.random.Generator) -> Case:
    """A coiler in a strip mill (Roberts 1978, Cold Rolling of Steel, chapter 11), its coil growing, no entry.

    Not in the model: the strip builds up, by which radius and moment of inertia grow; it has those of half a coil. The
    strip's tension is recorded, the bearings' warmth and the plant's hum are not.
    """
    name, rows, step = "coiler_builds", 1600, 0.25
    pull = ramps(rng, rows, 120, (2.2, 3.0), 0.05)
    wanted, shake, hum = ramps(rng, rows, 150, (1.6, 3.0), 0.02), flips(rng, rows, 17, 0.2), gust(rng, rows, 20, 0.01)
    heard = hiss(rng, rows, 0.01)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] * x[1] - heard[k]
        return 1.0 * error + pull[k] * x[1] + 0.05 * x[0] + shake[k], pull[k], hum[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        inertia = 0.10 + 7.85 * pi * 0.8 * (x[1] ** 4 - 0.25**4) / 2
        return (u[0] + u[2] - u[1] * x[1] - 0.05 * x[0]) / inertia, 6e-5 * x[0] / (2 * pi)

    x, u = rk(slope, [8, 0.27], rows, step, command, 4)
    half = float(np.mean(x[:, 1]))
    true = {"Jc": 0.10 + 7.85 * pi * 0.8 * (half**4 - 0.25**4) / 2, "rc": half, "bc": 0.05}
    free = declared(rng, {"bc": 0.05}, bc="kN m s")
    values = {"Jc": fixed(rng, true["Jc"], "1000 kg m2"), "rc": fixed(rng, half, "m", 0.01)} | free
    text = equations("coiler", values, {"w": ("(torque - tension*rc - bc*w)/Jc", 8, "rad/s")},
                     {"coil_speed": ("w", "rad/s"), "strip_speed": ("rc*w", "m/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "torque": (np.round(u[:, 0], 3), "kN m", "input"), "tension": (np.round(pull, 3), "kN", "disturbance"),
        "coil_speed": (logged(rng, x[:, 0], 0.01, lag=3, ends=(0, 20), bits=13), "rad/s", "output"),
        "strip_speed": (logged(rng, x[:, 0] * x[:, 1] + heard, 0.0, ends=(0, 8)), "m/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, context=LOOP, true=true)


DRIVES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "diesel_rack": (506, genset), "pump_ramp": (507, pump), "conveyor_limit": (508, conveyor),
    "decanter_belt": (509, decanter), "cardan_bench": (537, cardan), "coiler_builds": (538, coiler),
}  # fmt: skip
