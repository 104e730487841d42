"""Tractors, cars and lifts, of which models or recordings lack a dead zone, a sign, an end of a range or a right mass.

As sixth_author_turbines.py. With `complete` nothing is hidden, which is a null in sixth_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from second_author_parts import Case, Column, Tones, equations, flips, known, plateaus
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged, ramps
from third_author_parts import looked_up, rk, told


def hitch(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """The rear hitch of a tractor with a proportional valve, in its loop (Renius 2020, Fundamentals of Tractor Design).

    Hidden: the valve's spool covers its ports by 6 % to either side. Height and oil flow are read, the plough's jolts
    are not. The null's model has the overlap, its sensors few bits.
    """
    name, rows, step, zone = "null_hitch" if complete else "hitch_valve", 2600, 0.05, 6.0
    wanted, shake = ramps(rng, rows, 110, (-18, 18), 0.6), flips(rng, rows, 13, 7.0)
    heard, jolts = hiss(rng, rows, 0.05), gust(rng, rows, 5, 1.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return max(min(4.5 * (wanted[k] - x[0] - heard[k]) + 1.4 * wanted[k] + shake[k], 100), -100), jolts[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        opened = u[0] - max(min(u[0], zone), -zone)
        return (x[1] - 9 * x[0] + u[1]) / 14, (0.62 * opened - x[1]) / 0.18

    x, u = rk(slope, [0, 0], rows, step, command, 6)
    true = {"Ah": 14.0, "lh": 9.0, "kq": 0.62, "tq": 0.18} | ({"db": zone} if complete else {})
    free = declared(rng, {k: v for k, v in true.items() if k != "Ah"}, 0.08, kq="0.1 l/s/%", tq="s", db="%")
    opened = "(valve - max(min(valve, db), -db))" if complete else "valve"
    text = equations("hitch", {"Ah": fixed(rng, 14.0, "dm2", 0.02)} | free, {
        "h": ("(f - lh*h)/Ah", 0, "cm"), "f": (f"(kq*{opened} - f)/tq", 0, "0.1 l/s")},
        {"height": ("h", "cm"), "flow": ("f", "0.1 l/s")})  # fmt: skip
    columns: dict[str, Column] = {
        "valve": (u[:, 0], "%", "input"),
        "height": (logged(rng, x[:, 0] + heard, 0.0, ends=(-50, 50), bits=11 if complete else 14), "cm", "output"),
        "flow": (logged(rng, x[:, 1], 0.02, lag=4, ends=(-100, 100), bits=12), "0.1 l/s", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, beside=("sensor_quantisation",), verdicts=("named",), context=LOOP,
                    lost=10, true=true)  # fmt: skip
    return Case(name, step, columns, text, ("deadband",), (), {"width": zone}, context=LOOP, true=true)


def car(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A car at 25 m/s, steered by a robot and by its rear motors' torque (Gillespie 1992, chapter 6; Wong 2008).

    The fault: the moment of the motors is recorded with the sign of another convention. The null's sign is right, but
    the moment of inertia, which is not fitted, is told 24 % too small. Side wind is not recorded.
    """
    name, rows, step, fine = "null_car" if complete else "steered_car", 3000, 0.02, 5
    wheel, way = Tones.drawn(rng, 0.15, 2.5, 40, 0.017, 0.0), 1.0 if complete else -1.0
    steer, speed, force, angle = looked_up(wheel, rows, step, fine), 25.0, (9.0e4, 1.15e5), (1.25, 1.45)
    u = np.c_[plateaus(rng, rows, 60, -650, 650) + flips(rng, rows, 11, 250.0), gust(rng, rows, 12, 70.0)]

    def forces(t: float, x: Sequence[float]) -> tuple[float, float]:
        front = force[0] * (steer(t) - (x[0] + angle[0] * x[1]) / speed)
        return front, -force[1] * (x[0] - angle[1] * x[1]) / speed

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        front, rear = forces(t, x)
        return (front + rear + u[1]) / 1620 - speed * x[1], (angle[0] * front - angle[1] * rear + u[0]) / 2700

    x, _ = rk(slope, [0, 0], rows, step, told(u), fine)
    side = np.array([sum(forces(k * step, a)) for k, a in enumerate(x.tolist())]) + u[:, 1]
    true = {"ms": 1620.0, "Iz": 2700.0, "cf": 90.0, "cr": 115.0}
    inertia = known(0.76 * 2700, "kg m2") if complete else fixed(rng, 2700.0, "kg m2", 0.02)
    values = {"ms": fixed(rng, 1620.0, "kg", 0.02), "Iz": inertia} | declared(
        rng, {"cf": 90.0, "cr": 115.0}, cf="kN/rad", cr="kN/rad")  # fmt: skip
    front, rear = "1000*cf*(steer*pi/180 - (vy + 1.25*r)/25)", "1000*cr*(vy - 1.45*r)/25"
    text = equations("single track", values, {
        "vy": (f"({front} - {rear})/ms - 25*r", 0, "m/s"),
        "r": (f"(1.25*{front} + 1.45*{rear} + moment)/Iz", 0, "rad/s")},
        {"yaw_rate": ("r*180/pi", "deg/s"), "side_acc": (f"({front} - {rear})/ms", "m/s2")})  # fmt: skip
    columns: dict[str, Column] = {
        "steer": (np.degrees(wheel(np.arange(rows) * step)), "deg", "input"), "moment": (way * u[:, 0], "N m", "input"),
        "yaw_rate": (logged(rng, np.degrees(x[:, 1]), 0.015, ends=(-75, 75), bits=14), "deg/s", "output"),
        "side_acc": (logged(rng, side / 1620, 0.03, lag=3, ends=(-20, 20), bits=13, corner=0.45), "m/s2",
                     "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, ("parameter_error",), true=true)
    return Case(name, step, columns, text, ("sensor_sign",), (), lost=8, true=true)


def bump(rng: np.random.Generator) -> Case:
    """A quarter of a van over kerbs, its road read by a laser (Gillespie 1992, chapter 5), in four short recordings.

    The fault: the body's accelerometer ends at 2.5 m/s2 either way. The tyre's own unevenness is not recorded; both
    masses are off the scales and not fitted.
    """
    name, rows, step, fine = "speed_bump", 2800, 0.01, 8
    rough = Tones.drawn(rng, 0.4, 12, 44, 0.006, 0.0)
    places = np.sort(rng.uniform(0.5, rows * step - 0.5, 26))
    heights = rng.choice([-1, 1], 26) * rng.uniform(0.01, 0.035, 26)

    def ground(t: np.typing.NDArray[np.float64]) -> np.typing.NDArray[np.float64]:
        kerbs = heights * np.exp(-(((np.asarray(t)[..., None] - places) / 0.07) ** 2))
        return np.asarray(rough(t) + np.sum(kerbs, -1))

    path, tyre = np.asarray(ground(np.arange(2 * fine * rows + 3) * step / fine / 2)).tolist(), gust(rng, rows, 3, 25.0)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        pull = 2.4e4 * (x[2] - x[0]) + 1700 * (x[3] - x[1])
        road = path[int(t / step * 2 * fine + 0.5)]
        return x[1], pull / 390, x[3], (1.9e5 * (road - x[2]) + u[0] - pull) / 42

    x, _ = rk(slope, [0, 0, 0, 0], rows, step, told(tyre), fine)
    acc = (2.4e4 * (x[:, 2] - x[:, 0]) + 1700 * (x[:, 3] - x[:, 1])) / 390
    true = {"mb": 390.0, "mw": 42.0, "ks": 24.0, "cs": 1700.0, "kt": 190.0}
    free = declared(rng, {k: true[k] for k in ("ks", "cs", "kt")}, ks="kN/m", cs="N s/m", kt="kN/m")
    pull = "(1000*ks*(zw - zb) + cs*(vw - vb))"
    values = {"mb": fixed(rng, 390.0, "kg", 0.02), "mw": fixed(rng, 42.0, "kg", 0.02)} | free
    text = equations("quarter van", values, {
        "zb": ("vb", 0, "m"), "vb": (f"{pull}/mb", 0, "m/s"),
        "zw": ("vw", 0, "m"), "vw": (f"(1000*kt*(road - zw) - {pull})/mw", 0, "m/s")},
        {"body_acc": (f"{pull}/mb", "m/s2"), "travel": ("1000*(zw - zb)", "mm")})  # fmt: skip
    columns: dict[str, Column] = {
        "road": (np.round(ground(np.arange(rows) * step), 4), "m", "disturbance"),
        "body_acc": (logged(rng, acc, 0.02, lag=3, ends=(-2.5, 2.5), bits=12), "m/s2", "output"),
        "travel": (logged(rng, 1e3 * (x[:, 2] - x[:, 0]), 0.02, ends=(-200, 200), bits=13), "mm",
                   "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_saturation",), (), {"high": 2.5, "low": -2.5},
                cuts=(700, 1400, 2100), true=true)  # fmt: skip


def lift(rng: np.random.Generator) -> Case:
    """A goods lift with counterweight in its speed loop (Strakosch 2010, The Vertical Transportation Handbook).

    Nothing is missing but people: the mass that moves, which is not fitted, is told 16 % too small. What sways in the
    car is not recorded, the loop hears the encoder with noise.
    """
    name, rows, step = "null_lift", 3000, 0.02
    wanted, shake = ramps(rng, rows, 260, (-1.4, 1.4), 0.014), flips(rng, rows, 14, 110.0)
    heard, sway, total = hiss(rng, rows, 0.004), gust(rng, rows, 9, 40.0), [700.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        total[0] += 1800 * step * error
        return (total[0] + 2600 * error + shake[k]) / 4.2, sway[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return ((4.2 * u[0] + u[1] - 700 - 380 * x[0]) / 2150,)

    x, u = rk(slope, [0], rows, step, command, 4)
    acc = np.array([slope(0, a, b)[0] for a, b in zip(x.tolist(), u.tolist(), strict=True)])
    true = {"ml": 2150.0, "ub": 700.0, "bl": 380.0}
    values = {"ml": known(1806.0, "kg"), "kt": known(4.2, "N/(N m)")} | declared(
        rng, {"ub": 700.0, "bl": 380.0}, ub="N", bl="N s/m")  # fmt: skip
    motion = "(kt*torque - ub - bl*v)/ml"
    text = equations("lift", values, {"v": (motion, 0, "m/s")},
                     {"car_speed": ("v", "m/s"), "car_acc": (motion, "m/s2")})  # fmt: skip
    columns: dict[str, Column] = {
        "torque": (u[:, 0], "N m", "input"),
        "car_speed": (logged(rng, x[:, 0] + heard, 0.0, ends=(-4, 4), bits=14), "m/s", "output"),
        "car_acc": (logged(rng, acc, 0.05, lag=3, ends=(-5, 5), bits=12), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("parameter_error",), context=LOOP, cuts=(1500,), true=true)


VEHICLES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "hitch_valve": (418, hitch), "steered_car": (419, car), "speed_bump": (420, bump),
}  # fmt: skip
