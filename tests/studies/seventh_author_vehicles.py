"""Ships, tugs, cranes, cars and ferries, of which a bent arm, a sign, a drift, tyres at their end or drag are left out.

As seventh_author_rotors.py. With `complete` nothing is hidden, which is a null in seventh_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan, pi, sin

import numpy as np
from second_author_parts import Case, Column, Tones, equations, flips, known, plateaus, state_space
from seventh_author_parts import begun, started
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged, skewed
from third_author_parts import looked_up, rk, told


def roll(rng: np.random.Generator) -> Case:
    """A ferry that its fins make roll in calm water (Perez 2005, Ship Motion Control), its model linear.

    Hidden: the righting arm bends over, by 1.1 of the angle's cube. Two trials of 450 rows begin upright; the fins'
    angle is analogue and sampled, the swell is not recorded. The fins' gain is up to 4 % off.
    """
    name, lengths, step, fine, w, bent = "ferry_roll", (450, 450), 0.5, 8, 2 * pi * 0.095, 1.1
    rows = sum(lengths)
    fins = Tones.drawn(rng, 0.03, 0.22, 40, 9.0, 0.0)
    angle, swell = looked_up(fins, rows, step, fine), gust(rng, rows, 5, 0.06)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        heel = x[0] * (1 - bent * (x[0] * pi / 180) ** 2)
        return x[1], 0.125 * angle(t) + u[0] - w * w * heel - 0.17 * w * x[1]

    x, _ = started(slope, [0, 0], lengths, step, told(swell), fine)
    a, b = np.array([[0, 1], [-w * w, -0.17 * w]]), np.array([[0], [0.125 * skewed(rng, 1, 0.04)]])
    model = state_space(0, {"fins": "deg"}, {"roll": "deg", "roll_rate": "deg/s"}, (a, b, np.eye(2), np.zeros((2, 1))))
    columns: dict[str, Column] = {
        "fins": (np.round(fins(np.arange(rows) * step), 2), "deg", "input"),
        "roll": (logged(rng, x[:, 0], 0.01, ends=(-45, 45), bits=13), "deg", "output"),
        "roll_rate": (logged(rng, x[:, 1], 0.02, lag=3, ends=(-30, 30), bits=13), "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("cubic_stiffness",), (), {}, machine="ship", cuts=begun(lengths))


def tug(rng: np.random.Generator) -> Case:
    """A tug on its autopilot (Nomoto 1957; Fossen 2011, Handbook of Marine Craft, chapter 7).

    The fault: the gyro was mounted upside down, so that the rate has the wrong sign beside the compass. Side wind on
    the house is not recorded; 600 rows.
    """
    name, rows, step = "tug_gyro", 600, 0.5
    wanted, shake = plateaus(rng, rows, 60, -30, 30), flips(rng, rows, 14, 5.0)
    heard, wind = hiss(rng, rows, 0.05), gust(rng, rows, 20, 0.03)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return max(min(1.2 * (wanted[k] - x[0] - heard[k]) - 5.0 * x[1] + shake[k], 35), -35), wind[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (0.16 * u[0] + u[1] - x[1]) / 4.5

    x, u = rk(slope, [0, 0], rows, step, command, 8)
    true = {"K": 0.16, "T": 4.5}
    text = equations("tug", declared(rng, true, K="1/s", T="s"), {
        "psi": ("r", 0, "deg"), "r": ("(K*rudder - r)/T", 0, "deg/s")},
        {"heading": ("psi", "deg"), "yaw_rate": ("r", "deg/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "rudder": (np.round(u[:, 0], 1), "deg", "input"),
        "heading": (logged(rng, x[:, 0] + heard, 0.0, ends=(-180, 180), bits=13), "deg", "output"),
        "yaw_rate": (logged(rng, -x[:, 1], 0.02, lag=3, ends=(-20, 20), bits=12), "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_sign",), (), machine="ship", context=LOOP, true=true)


def gantry(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """The trolley of a container crane and its swinging load (Sawodny, Aschemann and Lahres 2002, Control Eng. Pract.).

    The fault: the spreader's inclinometer warms up and creeps by 6 mdeg a second; a gyro and the trolley's speed do not
    show it. Wind on the load is not recorded. The null's inclinometer is right, in three short recordings.
    """
    name, rows, step, creep = "null_gantry" if complete else "gantry_incline", 1200, 0.1, 6e-3
    wanted, shake = plateaus(rng, rows, 95, -1.6, 1.6), flips(rng, rows, 13, 1.5)
    heard, wind = hiss(rng, rows, 0.004), gust(rng, rows, 12, 0.25)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return max(min(14 * (wanted[k] - x[0] - heard[k]) + 2.2 * wanted[k] + shake[k], 22), -22), wind[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        pull = (u[0] - 2.2 * x[0] + 18 * 9.81 * x[1]) / 14
        return pull, x[2], (-9.81 * x[1] - pull - 0.35 * x[2] + u[1] / 18) / 16

    x, u = rk(slope, [0, 0, 0], rows, step, command, 6)
    true = {"mt": 14.0, "ml": 18.0, "bt": 2.2, "lr": 16.0, "cs": 0.35}
    free = declared(rng, {k: true[k] for k in ("bt", "lr", "cs")}, 0.06, bt="kN s/m", lr="m", cs="m/s")
    pull = "((drive - bt*v + ml*9.81*s)/mt)"
    values = {"mt": fixed(rng, 14.0, "t", 0.02), "ml": fixed(rng, 18.0, "t", 0.02)} | free
    text = equations("crane trolley", values, {
        "v": (pull, 0, "m/s"), "s": ("ws", 0, "rad"), "ws": (f"(-9.81*s - {pull} - cs*ws)/lr", 0, "rad/s")},
        {"trolley_speed": ("v", "m/s"), "sway": ("s*180/pi", "deg"), "sway_rate": ("ws*180/pi", "deg/s")})  # fmt: skip
    crept = np.degrees(x[:, 1]) + creep * step * np.arange(rows) * (not complete)
    columns: dict[str, Column] = {
        "drive": (np.round(u[:, 0], 2), "kN", "input"),
        "trolley_speed": (logged(rng, x[:, 0] + heard, 0.0, ends=(-4, 4), bits=13), "m/s", "output"),
        "sway": (logged(rng, crept, 0.02, lag=3, ends=(-20, 20), bits=13), "deg", "output"),
        "sway_rate": (logged(rng, np.degrees(x[:, 2]), 0.02, lag=2, ends=(-20, 20), bits=13), "deg/s",
                      "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, context=LOOP, machine="crane", cuts=(400, 800), true=true)
    return Case(name, step, columns, text, ("sensor_drift",), (), {"rate_per_s": creep}, context=LOOP, machine="crane",
                true=true)  # fmt: skip


def car(rng: np.random.Generator) -> Case:
    """A car at 22 m/s that a robot steers on a wet track (Pacejka 2012, Tire and Vehicle Dynamics), no entry.

    Not in the model: the tyres' side forces bend over toward their end; it has them in proportion to the slip. The
    robot's angle is analogue and sampled, gusts of side wind are not recorded. Three recordings.
    """
    name, rows, step, fine, speed = "tyre_limit", 1500, 0.02, 6, 22.0
    wheel = Tones.drawn(rng, 0.1, 2.0, 40, 0.027, 0.0)
    angle, wind = looked_up(wheel, rows, step, fine), gust(rng, rows, 15, 60.0)

    def forces(t: float, x: Sequence[float]) -> tuple[float, float]:
        front, rear = angle(t) - (x[0] + 1.2 * x[1]) / speed, -(x[0] - 1.5 * x[1]) / speed
        return 4400 * sin(1.4 * atan(13 * front)), 3700 * sin(1.4 * atan(20 * rear))

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        front, rear = forces(t, x)
        return (front + rear + u[0]) / 1450 - speed * x[1], (1.2 * front - 1.5 * rear) / 2300

    x, _ = rk(slope, [0, 0], rows, step, told(wind), fine)
    side = np.array([sum(forces(k * step, a)) for k, a in enumerate(x.tolist())]) + wind
    true = {"ms": 1450.0, "Iz": 2300.0, "cf": 4.4 * 1.4 * 13, "cr": 3.7 * 1.4 * 20}
    values = {"ms": fixed(rng, 1450.0, "kg", 0.02), "Iz": fixed(rng, 2300.0, "kg m2", 0.02)} | declared(
        rng, {k: true[k] for k in ("cf", "cr")}, 0.06, cf="kN/rad", cr="kN/rad")  # fmt: skip
    front, rear = "1000*cf*(steer*pi/180 - (vy + 1.2*r)/22)", "1000*cr*(vy - 1.5*r)/22"
    text = equations("single track", values, {
        "vy": (f"({front} - {rear})/ms - 22*r", 0, "m/s"),
        "r": (f"(1.2*{front} + 1.5*{rear})/Iz", 0, "rad/s")},
        {"yaw_rate": ("r*180/pi", "deg/s"), "side_acc": (f"({front} - {rear})/ms", "m/s2")})  # fmt: skip
    columns: dict[str, Column] = {
        "steer": (np.round(np.degrees(wheel(np.arange(rows) * step)), 3), "deg", "input"),
        "yaw_rate": (logged(rng, np.degrees(x[:, 1]), 0.015, ends=(-75, 75), bits=14), "deg/s", "output"),
        "side_acc": (logged(rng, side / 1450, 0.03, lag=3, ends=(-20, 20), bits=13), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, machine="car", cuts=(500, 1000), true=true)


def ferry(rng: np.random.Generator) -> Case:
    """A double-ended ferry that goes to and fro between its berths (Fossen 2011, Handbook of Marine Craft, chapter 6).

    Hidden: 4 kN/(m/s)2 of drag beside the linear one, and the thrusters follow their demand with 2.2 s. Tide and gusts
    are not recorded; mass with the water that moves along is off a model test and not fitted.
    """
    name, rows, step, drag, tau = "ferry_thrust", 1200, 0.5, 4.0, 2.2
    u = np.c_[plateaus(rng, rows, 60, -45, 45) + flips(rng, rows, 11, 12.0), gust(rng, rows, 25, 0.8)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (x[1] + u[1] - 14 * x[0] - drag * x[0] * abs(x[0])) / 260, (u[0] - x[1]) / tau

    x, _ = rk(slope, [0, 0], rows, step, told(u), 6)
    true = {"ms": 260.0, "c1": 14.0, "kt": 1.0}
    values = {"ms": fixed(rng, 260.0, "t"), "kt": known(1.0, "kN/kN")} | declared(rng, {"c1": 14.0}, c1="kN s/m")
    text = equations("ferry", values, {"v": ("(kt*thrust - c1*v)/ms", 0, "m/s")}, {"speed": ("v", "m/s")})
    columns: dict[str, Column] = {
        "thrust": (np.round(u[:, 0], 1), "kN", "input"),
        "speed": (logged(rng, x[:, 0], 0.01, lag=2, ends=(-6, 6), bits=13), "m/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("actuator_lag", "quadratic_damping"), (), {"tau_s": tau, "c2": drag},
                machine="ship", cuts=(600,), true=true)  # fmt: skip


VEHICLES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "ferry_roll": (517, roll), "tug_gyro": (518, tug), "gantry_incline": (519, gantry),
    "tyre_limit": (540, car), "ferry_thrust": (525, ferry),
}  # fmt: skip
