"""A plunger, a fish pond, a surge tank and a solenoid: two effects at once, or physics that no entry has.

As fifth_author_towers.py. With `complete` nothing is hidden, which is a null in fifth_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from fifth_author_parts import declared, frozen, gust, logged, slopes
from second_author_parts import Case, Tones, equations, flips, known, plateaus
from third_author_parts import looked_up, rk, told


def plunger(rng: np.random.Generator) -> Case:
    """A wave maker's plunger on its springs in water (Hughes 1993, Physical Models in Coastal Engineering).

    Hidden: 220 N/(m/s)2 of drag and rubber stops of 11 kN/m at -62 and 58 mm. Size: 20 % of the stroke by the drag, 9 %
    by the stops. The force is analogue and sampled, reflected waves nobody records.
    """
    name, rows, step, fine, drag, stop, low, high = "wave_plunger", 3000, 0.02, 8, 220.0, 1.1e4, -0.062, 0.058
    push = Tones.drawn(rng, 0.15, 3.0, 44, 200, 0.0)
    force, waves = looked_up(push, rows, step, fine), gust(rng, rows, 12, 8.0)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        touched = stop * (max(x[0] - high, 0) + min(x[0] - low, 0))
        pull = 8200 * x[0] + 260 * x[1] + drag * x[1] * abs(x[1]) + touched
        return x[1], (force(t) + u[0] - pull) / 64

    x, _ = rk(slope, [0, 0], rows, step, told(waves), fine)
    acc = slopes(slope, step, x, waves[:, None])[:, 1]
    true = {"mp": 64.0, "kp": 8200.0, "cp": 260.0}
    motion = "(force - kp*q - cp*v)/mp"
    text = equations("plunger", declared(rng, true, mp="kg", kp="N/m", cp="N s/m"), {
        "q": ("v", 0, "m"), "v": (motion, 0, "m/s")}, {"stroke": ("q", "m"), "acc": (motion, "m/s2")})  # fmt: skip
    columns = {"force": (push(np.arange(rows) * step), "N", "input"),
               "stroke": (logged(rng, x[:, 0], 0.01, ends=(-0.2, 0.2), bits=14, corner=0.45), "m", "output"),
               "acc": (logged(rng, acc, 0.02, lag=3, ends=(-40, 40), bits=14, corner=0.45), "m/s2",
                       "output")}  # fmt: skip
    return Case(name, step, columns, text, ("end_stop", "quadratic_damping"), (), {"high_stop": high, "c2": drag},
                lost=9, true=true)  # fmt: skip


def fishpond(rng: np.random.Generator) -> Case:
    """Oxygen and warmth of a fish pond with an aerator (Boyd 1998, Aquacultural Engineering 18), ten minutes a row.

    Hidden: the aerator turns in steps of 10 % of the demand; and the light that is recorded makes oxygen, which the
    model leaves out. Size: 11 % of the oxygen by the steps, 28 % by the light. Feeding that wanders is not recorded.
    """
    name, rows, step, level, made = "pond_aerator", 2000, 600.0, 10.0, 1.0e-7
    t = np.arange(rows) * step
    cloud = 1 - 0.35 * (plateaus(rng, rows, 9, 0.0, 1.0) > 0.6)
    light = np.round(700 * np.maximum(np.sin(2 * np.pi * (t / 86400 - 0.27)), 0) * cloud)
    mean = float(np.mean(light))
    u = np.c_[plateaus(rng, rows, 14, 12, 92) + flips(rng, rows, 3, 4.0), light, plateaus(rng, rows, 40, 10, 30),
              gust(rng, rows, 15, 1.5e-5)]  # fmt: skip

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        acting = level * round(u[0] / level)
        return (0.9e-6 * acting * (10.2 - x[0]) - 3.2e-4 * x[0] / 8 - 4e-5 + made * (u[1] - mean) + u[3],
                u[2] * (17 - x[1]) / 2.4e6 + 2e-8 * acting * (21 - x[1]))  # fmt: skip

    x, _ = rk(slope, [6.5, 19], rows, step, told(u), 4)
    true = {"ka": 0.9, "br": 3.2, "fl": 2.4}
    text = equations("fish pond", declared(rng, true, ka="1e-6/s/%", br="1e-4/s", fl="1e6 l"), {
        "ox": ("ka/1000000*aerator*(10.2 - ox) - br/10000*ox/8 - 0.00004", 6.5, "mg/l"),
        "wa": ("inflow*(17 - wa)/(1000000*fl) + 0.00000002*aerator*(21 - wa)", 19, "degC")},
        {"oxygen": ("ox", "mg/l"), "water": ("wa", "degC")})  # fmt: skip
    columns = {"aerator": (u[:, 0], "%", "input"), "inflow": (u[:, 2], "l/s", "input"),
               "light": (light, "W/m2", "disturbance"),
               "oxygen": (logged(rng, x[:, 0], 0.015, ends=(0, 20), bits=12), "mg/l", "output"),
               "water": (logged(rng, x[:, 1], 0.02, lag=5, ends=(0, 40), bits=13), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("input_quantisation", "missing_disturbance"), (),
                {"spacing": level, "gain": made}, lost=8, time="time [h]", time_scale=1 / 3600, true=true)  # fmt: skip


def surge(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Tunnel and surge tank of a hydropower station (Chaudhry 2014, Applied Hydraulic Transients, chapter 11).

    Hidden: the gate's discharge changes by 1 m3/s each second at most, and the tunnel's flow meter follows with 10 s.
    Size: 13 % of the level by the gate, 14 % of the flow by its meter. The lake's level is recorded, brooks are not;
    the null has neither.
    """
    name, rows, step, rate, tau = "null_surge_tank" if complete else "surge_gate", 2000, 4.0, 1.0, 10.0
    u = np.c_[plateaus(rng, rows, 20, 18, 42), 120 + plateaus(rng, rows, 200, -1.5, 1.5), gust(rng, rows, 8, 0.3)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        move = max(min(4 * (u[0] - x[2]), rate), -rate)
        out = u[0] if complete else x[2]
        loss = 0.0055 * x[0] * abs(x[0])
        return (9.81 * 15 / 3200 * (u[1] - x[1] - loss), (x[0] - out + u[2]) / 130, move, (x[0] - x[3]) / tau)

    first = float(u[0, 0])
    x, _ = rk(slope, [30, 115, first, 30], rows, step, told(u), 8)
    true = {"Lt": 3200.0, "ls": 5.5, "As": 130.0}
    values = declared(rng, true, 0.08, Lt="m", ls="1e-3 s2/m5", As="m2")
    text = equations("surge tank", values | {"At": known(15.0, "m2")}, {
        "Q": ("9.81*At/Lt*(lake - z - ls/1000*Q*abs(Q))", 30, "m3/s"), "z": ("(Q - gate)/As", 115, "m")},
        {"tunnel_flow": ("Q", "m3/s"), "tank_level": ("z", "m")})  # fmt: skip
    flow = x[:, 0] if complete else x[:, 3]
    level = logged(rng, x[:, 1], 0.01, ends=(80, 150), bits=14)
    columns = {"gate": (u[:, 0], "m3/s", "input"), "lake": (np.round(u[:, 1], 2), "m", "disturbance"),
               "tunnel_flow": (logged(rng, flow, 0.015, lag=3, ends=(-20, 80), bits=13), "m3/s", "output"),
               "tank_level": (frozen(rng, level, 2, 15) if complete else level, "m", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, verdicts=("data_fault",), cuts=(1000,), true=true)
    return Case(name, step, columns, text, ("rate_limit", "sensor_lag"), (), {"rate_per_s": rate, "tau_s": tau},
                true=true)  # fmt: skip


def solenoid(rng: np.random.Generator) -> Case:
    """A proportional magnet that pulls with the square of its current (Woodson and Melcher 1968), no entry.

    Not in the model: the square; it has a force in proportion to the current less its mean. Size: 17 % of the stroke,
    21 % of the speed. The current is analogue and sampled; flow forces on the plunger nobody records.
    """
    name, rows, step, fine = "magnet_square", 3200, 1e-4, 6
    feed = Tones.drawn(rng, 8, 600, 44, 0.24, 1.0)
    current, flow = looked_up(feed, rows, step, fine), gust(rng, rows, 12, 0.35)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (11 * current(t) ** 2 - 11 + u[0] - 5200 * x[0] - 1.1 * x[1]) / 1.1e-3

    x, _ = rk(slope, [0, 0], rows, step, told(flow), fine)
    true = {"ks": 5.2, "cs": 1.1, "kf": 22.0}
    text = equations("magnet", {"mm": known(1.1, "g")} | declared(rng, true, ks="N/mm", cs="N s/m", kf="N/A"), {
        "q": ("v", 0, "m"), "v": ("1000*(kf*(current - 1) - 1000*ks*q - cs*v)/mm", 0, "m/s")},
        {"stroke": ("1000*q", "mm"), "speed": ("v", "m/s")})  # fmt: skip
    speed = logged(rng, x[:, 1], 0.02, lag=3, ends=(-15, 15), bits=13)
    columns = {"current": (feed(np.arange(rows) * step), "A", "input"),
               "stroke": (logged(rng, 1e3 * x[:, 0], 0.01, ends=(-8, 8), bits=14), "mm", "output"),
               "speed": (speed, "m/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, time="time [ms]", time_scale=1e3, true=true)


PAIRS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "wave_plunger": (326, plunger), "pond_aerator": (327, fishpond), "surge_gate": (328, surge),
    "magnet_square": (330, solenoid),
}  # fmt: skip
