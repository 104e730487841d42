"""Springs, poles, drives and vehicles of which models or recordings lack a spring, a mass, a play or a fault.

As fifth_author_towers.py. With `complete` nothing is hidden, which is a null in fifth_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi

import numpy as np
from fifth_author_parts import LOOP, declared, frozen, gust, hiss, logged, modes, skewed, slopes
from second_author_parts import Case, Tones, equations, flips, known, plateaus, state_space
from third_author_parts import looked_up, rk, told


def airspring(rng: np.random.Generator) -> Case:
    """A table on air springs that are stiffer as they are pressed (Harris and Piersol 2002, Shock and Vibration).

    Hidden: 1.2e6 N/m2 of quadratic stiffness. Size: 24 % of the lift. A shaker pushes in three recordings, analogue and
    sampled; the floor shakes a little, which nobody records.
    """
    name, rows, step, fine, bent = "air_spring", 3000, 0.01, 6, 1.2e6
    push = Tones.drawn(rng, 0.3, 7, 40, 260, 0.0)
    force, floor = looked_up(push, rows, step, fine), gust(rng, rows, 6, 5.0)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (force(t) + u[0] - 8.0e4 * x[0] - bent * x[0] ** 2 - 1150 * x[1]) / 420

    x, _ = rk(slope, [0, 0], rows, step, told(floor), fine)
    acc = slopes(slope, step, x, floor[:, None])[:, 1]
    true = {"mt": 420.0, "ks": 8.0e4, "cs": 1150.0}
    motion = "(shaker - ks*q - cs*v)/mt"
    text = equations("table", declared(rng, true, mt="kg", ks="N/m", cs="N s/m"), {
        "q": ("v", 0, "m"), "v": (motion, 0, "m/s")},
        {"lift": ("1000*q", "mm"), "acc": (motion, "m/s2")})  # fmt: skip
    columns = {"shaker": (push(np.arange(rows) * step), "N", "input"),
               "lift": (logged(rng, 1e3 * x[:, 0], 0.02, ends=(-40, 40), bits=13, corner=0.45), "mm", "output"),
               "acc": (logged(rng, acc, 0.03, lag=3, ends=(-20, 20), bits=13, corner=0.45), "m/s2",
                       "output")}  # fmt: skip
    return Case(name, step, columns, text, ("quadratic_stiffness",), (), {"k2": bent}, cuts=(1000, 2000), true=true)


def loosened(rng: np.random.Generator) -> Case:
    """A pump's skid one of whose bolts comes loose (Worden et al. 2007, Proc. R. Soc. A 463), shaken by its drive.

    Hidden: from 6.4 s on the frame is 6 % softer. Size: 20 % of either output. The drive's force is recorded from a
    cell with noise of its own; the pump's flow shakes beside it.
    """
    name, rows, step, fine, lost, when = "skid_bolt", 3200, 0.004, 6, 6.0e5, 6.4
    push = Tones.drawn(rng, 4, 45, 44, 1500, 0.0)
    force, flow = looked_up(push, rows, step, fine), gust(rng, rows, 3, 50.0)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        stiff = 1.0e7 - lost * (t >= when)
        return x[1], (force(t) + u[0] - stiff * x[0] - 1.45e4 * x[1]) / 860

    x, _ = rk(slope, [0, 0], rows, step, told(flow), fine)
    acc = slopes(slope, step, x, flow[:, None])[:, 1]
    true = {"ms": 860.0, "ks": 1.0e7, "cs": 1.45e4}
    motion = "(drive - ks*q - cs*v)/ms"
    text = equations("skid", declared(rng, true, ms="kg", ks="N/m", cs="N s/m"), {
        "q": ("v", 0, "m"), "v": (motion, 0, "m/s")},
        {"geophone": ("1000*v", "mm/s"), "acc": (motion, "m/s2")})  # fmt: skip
    columns = {"drive": (logged(rng, push(np.arange(rows) * step), 0.002, ends=(-8e3, 8e3), bits=16), "N", "input"),
               "geophone": (logged(rng, 1e3 * x[:, 1], 0.02, ends=(-200, 200), bits=14), "mm/s", "output"),
               "acc": (logged(rng, acc, 0.02, lag=4, ends=(-20, 20), bits=14, jitter=0.02), "m/s2",
                       "output")}  # fmt: skip
    return Case(name, step, columns, text, ("stiffness_change",), (), {"stiffness_change": -lost, "time_s": when},
                time="time [ms]", time_scale=1e3, true=true)  # fmt: skip


def pole(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A lamp pole shaken on two bending modes, its model linear (Blevins 1979, Flow-Induced Vibration; ISO 12494).

    Hidden: ice of 6 % of the first mode's mass, where the second has a node. Size: 22 % of either output. The model in
    continuous time is right but for the ice; the null's has two gains and a damping ratio off. Wind that nobody records
    acts.
    """
    name, rows, step, fine, more = "null_pole" if complete else "pole_ice", 3000, 0.02, 8, 0.0 if complete else 0.06
    push = Tones.drawn(rng, 0.5, 14, 44, 45.0, 0.0)
    w, z = 2 * pi * np.array([2.6, 8.9]), np.array([0.08, 0.05])
    drive, seen = np.array([[0.028], [-0.035]]), np.array([[1e3, 1e3], [420.0, -900.0]])
    force, wind = looked_up(push, rows, step, fine), np.c_[gust(rng, rows, 5, 3.0), gust(rng, rows, 5, 3.0)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        f = force(t)
        return (x[2], x[3], (0.028 * (f + u[0]) - w[0] ** 2 * x[0] - 2 * z[0] * w[0] * x[2]) / (1 + more),
                -0.035 * (f + u[1]) - w[1] ** 2 * x[1] - 2 * z[1] * w[1] * x[3])  # fmt: skip

    x, _ = rk(slope, [0, 0, 0, 0], rows, step, told(wind), fine)
    y = x[:, :2] @ seen.T
    wrong = np.array([[skewed(rng, 1, 0.06)], [skewed(rng, 1, 0.06)]]) if complete else 1.0
    ratio = [skewed(rng, z[0], 0.08), z[1]] if complete else z
    model = state_space(0, {"shaker": "N"}, {"top": "mm", "middle": "mm"}, modes(w, ratio, drive * wrong, seen))
    columns = {"shaker": (push(np.arange(rows) * step), "N", "input"),
               "top": (logged(rng, y[:, 0], 0.02, ends=(-60, 60), bits=14), "mm", "output"),
               "middle": (logged(rng, y[:, 1], 0.02, lag=4, ends=(-30, 30), bits=14), "mm", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, model, cuts=(1500,), lost=10)
    return Case(name, step, columns, model, ("added_mass",), (), {"mass_ratio": more})


def cable(rng: np.random.Generator) -> Case:
    """A stay cable whose damper fails on the way (Krenk 2000, J. Appl. Mech. 67), its model linear.

    Hidden: from 33 s on the first mode's damping ratio is 0.036 and no more 0.06. Size: 24 % of either output. A shaker
    swings it; wind that nobody records does, too. Two gains of the model are up to 4 % off.
    """
    name, rows, step, fine, when, lost = "cable_damper", 3000, 0.02, 8, 33.0, -0.024
    push = Tones.drawn(rng, 0.4, 9, 44, 160.0, 0.0)
    w, z = 2 * pi * np.array([1.9, 3.75]), np.array([0.06, 0.04])
    drive, seen = np.array([[0.006], [0.007]]), np.array([[1e3, 1e3], [1.2e3, -600.0]])
    force, wind = looked_up(push, rows, step, fine), np.c_[gust(rng, rows, 5, 9.0), gust(rng, rows, 5, 9.0)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        f, ratio = force(t), z[0] + lost * (t >= when)
        return (x[2], x[3], 0.006 * (f + u[0]) - w[0] ** 2 * x[0] - 2 * ratio * w[0] * x[2],
                0.007 * (f + u[1]) - w[1] ** 2 * x[1] - 2 * z[1] * w[1] * x[3])  # fmt: skip

    x, _ = rk(slope, [0, 0, 0, 0], rows, step, told(wind), fine)
    y = x[:, :2] @ seen.T
    wrong = np.array([[skewed(rng, 1, 0.04)], [skewed(rng, 1, 0.04)]])
    model = state_space(0, {"shaker": "N"}, {"quarter": "mm", "third": "mm"}, modes(w, z, drive * wrong, seen))
    columns = {"shaker": (push(np.arange(rows) * step), "N", "input"),
               "quarter": (logged(rng, y[:, 0], 0.02, lag=3, ends=(-120, 120), bits=14), "mm", "output"),
               "third": (logged(rng, y[:, 1], 0.02, ends=(-120, 120), bits=14), "mm", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("damping_change",), (), {"damping_change": lost, "time_s": when},
                lost=7)  # fmt: skip


def cabinet(rng: np.random.Generator) -> Case:
    """A gantry on its footing that carries a switch cabinet on rubber (Den Hartog 1956, Mechanical Vibrations, ch. 3).

    Hidden: 0.025 of the mass is the cabinet and swings at 3.4 Hz with a damping of 0.1; the model has one body. Size:
    26 % of the sway. The drive's reaction is recorded; steps on the floor are not.
    """
    name, rows, step, fine, part = "gantry_cabinet", 2800, 0.02, 6, 0.025
    push = Tones.drawn(rng, 0.2, 9, 44, 800, 0.0)
    force, floor = looked_up(push, rows, step, fine), gust(rng, rows, 4, 40.0)
    w, low, high = 2 * pi * 3.4, 1500 * (1 - part), 1500 * part

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        pull = high * (w * w * (x[2] - x[0]) + 0.2 * w * (x[3] - x[1]))
        return x[1], (force(t) + u[0] - 1.1e6 * x[0] - 5.5e3 * x[1] + pull) / low, x[3], -pull / high

    x, _ = rk(slope, [0, 0, 0, 0], rows, step, told(floor), fine)
    acc = slopes(slope, step, x, floor[:, None])[:, 1]
    true = {"mg": 1500.0, "kg": 1.1e6, "cg": 5.5e3}
    motion = "(reaction - kg*q - cg*v)/mg"
    text = equations("gantry", declared(rng, true, mg="kg", kg="N/m", cg="N s/m"), {
        "q": ("v", 0, "m"), "v": (motion, 0, "m/s")},
        {"sway": ("1000*q", "mm"), "acc": (motion, "m/s2")})  # fmt: skip
    columns = {"reaction": (push(np.arange(rows) * step), "N", "input"),
               "sway": (logged(rng, 1e3 * x[:, 0], 0.02, ends=(-15, 15), bits=13), "mm", "output"),
               "acc": (logged(rng, acc, 0.02, lag=4, ends=(-10, 10), bits=13), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("structural_mode",), (), {"frequency_hz": 3.4, "share": part}, lost=8,
                true=true)  # fmt: skip


def clutch(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """An engine's dynamometer with a dog clutch between (Kiencke and Nielsen 2005, Automotive Control Systems, ch. 6).

    Hidden: a play of 1.15 degrees to either side, within which spring and damper do not act. Size: 7 and 4 % of the
    speeds. Both torques are held between rows; the null's model has the play.
    """
    name, rows, step, gap = "null_clutch" if complete else "dog_clutch", 3600, 0.002, 0.02
    u = np.c_[plateaus(rng, rows, 60, -60, 80) + flips(rng, rows, 9, 18), plateaus(rng, rows, 90, -60, 60),
              gust(rng, rows, 10, 1.0)]  # fmt: skip

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        d = x[0] - x[2]
        pull = (2600 * (d - max(min(d, gap), -gap)) + 5.0 * (x[1] - x[3])) if abs(d) > gap else 0.0
        return x[1], (u[0] + u[2] - pull - 0.9 * x[1]) / 0.21, x[3], (pull - u[1] - 1.3 * x[3]) / 0.34

    x, _ = rk(slope, [0.0, 0, 0, 0], rows, step, told(u), 12)
    true = {"Je": 0.21, "Jd": 0.34, "kc": 2600.0, "cc": 5.0} | ({"gap": gap} if complete else {})
    twist = "(ae - ad)"
    if complete:
        inside = f"(1 - max(sign(gap - abs{twist}), 0))"
        pull = f"(kc*({twist} - max(min{twist[:-1]}, gap), -gap)) + cc*(we - wd)*{inside})"
    else:
        pull = f"(kc*{twist} + cc*(we - wd))"
    values = declared(rng, true, 0.08, Je="kg m2", Jd="kg m2", kc="N m/rad", gap="rad")
    text = equations("dynamometer", values | {"be": known(0.9, "N m s"), "bd": known(1.3, "N m s")}, {
        "ae": ("we", 0, "rad"), "we": (f"(engine - {pull} - be*we)/Je", 0, "rad/s"),
        "ad": ("wd", 0, "rad"), "wd": (f"({pull} - brake - bd*wd)/Jd", 0, "rad/s")},
        {"engine_speed": ("we", "rad/s"), "brake_speed": ("wd", "rad/s")})  # fmt: skip
    columns = {"engine": (u[:, 0], "N m", "input"), "brake": (u[:, 1], "N m", "input"),
               "engine_speed": (logged(rng, x[:, 1], 0.01, ends=(-150, 150), bits=15), "rad/s", "output"),
               "brake_speed": (logged(rng, x[:, 3], 0.01, lag=3, ends=(-150, 150), bits=15), "rad/s",
                               "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, cuts=(1200, 2400), true=true)
    return Case(name, step, columns, text, ("clearance",), (), {"half_gap": gap}, true=true)


def rov(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Depth of an underwater vehicle in its loop (Fossen 2011, Handbook of Marine Craft, chapter 7).

    The fault: the sink rate of the acoustic log reads 0.022 m/s too much, which its depth gauge contradicts. Size: 23 %
    of the sink rate's deviation. Swell on the vehicle is not recorded; the null's log is right, and the vehicle waits
    twice.
    """
    name, rows, step, bias = "null_diver" if complete else "diver_log", 2400, 0.25, 0.0 if complete else 0.022
    wanted, shake = plateaus(rng, rows, 130, 4, 9), flips(rng, rows, 16, 6.0)
    heard, swell, total = hiss(rng, rows, 0.01), gust(rng, rows, 12, 3.0), [9.0]
    for begin in (800, 1700) if complete else ():
        wanted[begin : begin + 120], shake[begin : begin + 120] = wanted[begin], 0.0

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = max(min(wanted[k] - x[0] - heard[k], 1.0), -1.0)
        total[0] = max(min(total[0] + 0.4 * step * error, 40), -40)
        return max(min(60 * error - 160 * (x[1] + bias) + total[0] + shake[k], 100), -100), swell[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (3.1 * u[0] - 28 + u[1] - 90 * x[1] - 260 * x[1] * abs(x[1])) / 340

    x, u = rk(slope, [float(wanted[0]), 0], rows, step, command, 6)
    true = {"mr": 340.0, "bl": 28.0, "d1": 90.0, "d2": 260.0}
    text = equations("vehicle", declared(rng, true, 0.08, mr="kg", bl="N", d1="N s/m") | {"kt": known(3.1, "N/%")}, {
        "z": ("w", float(wanted[0]), "m"), "w": ("(kt*thrust - bl - d1*w - d2*w*abs(w))/mr", 0, "m/s")},
        {"depth": ("z", "m"), "sink_rate": ("w", "m/s")})  # fmt: skip
    rate = logged(rng, x[:, 1] + bias, 0.04, lag=3, ends=(-1, 1), bits=12)
    columns = {"thrust": (u[:, 0], "%", "input"),
               "depth": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 50), bits=14), "m", "output"),
               "sink_rate": (rate if complete else frozen(rng, rate, 2, 12), "m/s", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, context=LOOP, lost=9, true=true)
    return Case(name, step, columns, text, ("sensor_bias",), (), {"bias": bias}, context=LOOP, true=true)


MACHINES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "air_spring": (312, airspring), "skid_bolt": (313, loosened), "pole_ice": (314, pole),
    "cable_damper": (315, cable), "gantry_cabinet": (316, cabinet), "dog_clutch": (317, clutch),
    "diver_log": (318, rov),
}  # fmt: skip
