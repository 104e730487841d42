"""Generators, cells, evaporators, leaf springs and robots after public recordings, of which a piece is left out.

As eighth_author_heat.py. The leaf spring and the robot are laws without states.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from eighth_author_parts import Makers, harmonics, levels
from second_author_parts import Case, Column, Tones, equations, flips, known, plateaus
from seventh_author_parts import begun, started
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged
from third_author_parts import rk, told


def exciter(rng: np.random.Generator, *, size: float = 2.2) -> Case:
    """A generator in no-load tests of its voltage regulator (Kundur 1994, chapter 8; IEEE Std 421.2), three of them.

    Hidden: the thyristor bridge gives 2.2 times the rated field voltage at most. The regulator hears the terminal
    voltage with noise; its demand is recorded, the turbine's speed, which wanders, is not.
    """
    name, lengths, step = "field_ceiling", (500,) * 3, 0.02
    rows = sum(lengths)
    wanted, shake = levels(rng, rows, 125, (0.92, 0.97, 1.02, 1.06)), flips(rng, rows, 9, 0.15)
    heard, turning = hiss(rng, rows, 1e-3), gust(rng, rows, 30, 8e-3)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[1] - heard[k]
        return round(min(max(22 * error + x[2] + shake[k], 0.0), 3.2), 3), turning[k], error

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (min(u[0], size) - x[0]) / 0.09, (x[0] - 0.98 * x[1] + u[1]) / 2.6, 3.0 * u[2] * (0.2 < x[2] < 1.8)

    x, u = started(slope, [0.95, 0.97, 0.95], lengths, step, command, 6)
    true = {"te": 0.09, "td": 2.6, "kx": 0.98}
    text = equations("generator at no load", declared(rng, true, 0.08, te="s", td="s"), {
        "ef": ("(demand - ef)/te", 0.95, "pu"), "et": ("(ef - kx*et)/td", 0.97, "pu")},
        {"field": ("ef", "pu"), "terminal": ("et", "pu")})  # fmt: skip
    columns: dict[str, Column] = {
        "demand": (u[:, 0], "pu", "input"),
        "field": (logged(rng, x[:, 0], 0.03, ends=(-4, 4), bits=12), "pu", "output"),
        "terminal": (logged(rng, x[:, 1] + heard, 0.0, ends=(0, 2), bits=13), "pu", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("input_saturation",), (), {"high": size}, context=LOOP, cuts=begun(lengths),
                true=true)  # fmt: skip


def cell(rng: np.random.Generator, *, size: float = 9.0) -> Case:
    """A lithium iron phosphate cell under a driving cycle (Plett 2004, J. Power Sources 134), no entry.

    Not in the model: the voltage at rest is 9 mV higher after charging than after discharging, and moves between as
    charge passes. 16000 rows of a second in two recordings, voltage in steps of 1 mV.
    """
    name, rows, step = "iron_cell", 16000, 1.0
    amps = plateaus(rng, rows, 12, -9, 11) + 3.0 * flips(rng, rows, 700, 1.0)
    wander = gust(rng, rows, 300, 0.3)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        h = -(abs(u[0]) / 2000) * x[2] - u[0] / 2000
        return -u[0] / 36000, (1.9 * u[0] - x[1]) / 28, h

    x, _ = rk(slope, [0.6, 0, 0], rows, step, told(np.round(amps, 2)), 1)
    amps = np.round(amps, 2)
    volt = 3255 + 60 * (x[:, 0] - 0.5) - 2.4 * amps - x[:, 1] + size * x[:, 2] + wander
    true = {"Q": 10.0, "R0": 2.4, "R1": 1.9, "t1": 28.0, "u0": 3255.0, "us": 60.0}
    values = {"Q": known(10.0, "A h"), "u0": known(3255.0, "mV")} | declared(
        rng, {k: true[k] for k in ("R0", "R1", "t1", "us")}, 0.08, R0="mohm", R1="mohm", t1="s", us="mV"
    )
    text = equations("iron phosphate cell", values, {
        "soc": ("-current/(3600*Q)", 0.6, ""), "v1": ("(R1*current - v1)/t1", 0, "mV")},
        {"voltage": ("u0 + us*(soc - 0.5) - R0*current - v1", "mV")})  # fmt: skip
    columns: dict[str, Column] = {
        "current": (amps, "A", "input"),
        "voltage": (np.round(volt + 0.6 * rng.standard_normal(rows)), "mV", "output"),
    }
    return Case(name, step, columns, text, outside=True, beside=("sensor_quantisation",), cuts=(8000,), true=true)


def _boiler(rng: np.random.Generator) -> tuple[str, dict[str, float]]:
    """Return the model of an evaporator without seal and refractometer, and its true values."""
    true = {"Mw": 20.0, "ks": 0.05, "kp": 0.035, "kc": 0.032, "kq": 0.11, "xf": 5.0, "Cp": 4.0}
    values = {"Mw": fixed(rng, 20.0, "kg", 0.01), "xf": known(5.0, "%"), "Cp": fixed(rng, 4.0, "kg/kPa", 0.02)}
    values |= declared(rng, {k: true[k] for k in ("ks", "kp", "kc", "kq")}, 0.06)
    boil, cold = "(8 + ks*(steam - 194) - kp*(P - 50))", "(8 + kc*(cooling - 208) + kq*(P - 50))"
    return equations("evaporator", values, {
        "L": (f"(feed - {boil} - product)/(60*Mw)", 1, "m"), "X": ("(xf*feed - X*product)/(60*Mw)", 25, "%"),
        "P": (f"({boil} - {cold})/(60*Cp)", 50, "kPa")},
        {"level": ("L", "m"), "solids": ("X", "%"), "pressure": ("P", "kPa")}), true  # fmt: skip


def evaporator(rng: np.random.Generator, *, size: tuple[float, float] = (1.6, 0.9)) -> Case:
    """An evaporator with forced circulation (Newell and Lee 1989, Applied Process Control), half a minute a row.

    Hidden: water that seals the pump, which is recorded and a hand valve sets, thins the liquor by 1.6 % of
    solids for each kg/min in the time that 20 kg take; and the refractometer follows with 54 s.
    """
    name, rows, step, (thin, tau), total = "sealed_evaporator", 3000, 0.5, size, [2.0]
    steam, cooling = plateaus(rng, rows, 40, 170, 215), plateaus(rng, rows, 50, 190, 225)
    seal, feed = levels(rng, rows, 60, (0.2, 0.8, 1.6)), plateaus(rng, rows, 70, 9.5, 10.5)
    heard, dirt, shake = hiss(rng, rows, 4e-3), gust(rng, rows, 30, 0.02), flips(rng, rows, 11, 0.15)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 1.0
        total[0] += 0.02 * step * error
        return (
            steam[k],
            cooling[k],
            feed[k],
            seal[k],
            round(min(max(total[0] + 1.2 * error + shake[k], 0.4), 5), 3),
            dirt[k],
        )

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        boil = 0.05 * (u[0] - 194) + 8.0 - 0.035 * (x[2] - 50) + u[5]
        cold = 0.032 * (u[1] - 208) + 0.11 * (x[2] - 50) + 8.0
        return ((u[2] - boil - u[4]) / 20, (5.0 * u[2] - x[1] * u[4] - thin * (u[3] - 0.8)) / 20,
                (boil - cold) / 4, (x[1] - x[3]) / tau if tau else 0.0)  # fmt: skip

    x, u = rk(slope, [1, 25, 50, 25], rows, step, command, 6)
    text, true = _boiler(rng)
    solids = x[:, 3] if tau else x[:, 1]
    columns: dict[str, Column] = {n: (np.round(u[:, k], 3), unit, role) for k, n, unit, role in (
        (0, "steam", "kPa", "input"), (1, "cooling", "kg/min", "input"), (2, "feed", "kg/min", "disturbance"),
        (3, "seal", "kg/min", "input"), (4, "product", "kg/min", "input"))}  # fmt: skip
    columns |= {"level": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 2), bits=12), "m", "output"),
                "solids": (logged(rng, solids, 0.015, ends=(0, 60), bits=13), "%", "output"),
                "pressure": (logged(rng, x[:, 2], 0.015, lag=3, ends=(0, 128), bits=13), "kPa", "output")}  # fmt: skip
    return Case(name, 60 * step, columns, text, ("missing_coupling", "sensor_lag"), (), {"tau_s": 60 * tau},
                context=LOOP, true=true)  # fmt: skip


def leaf(rng: np.random.Generator, *, size: float = 0.22) -> Case:
    """A leaf spring on a test stand, force over motion (Fancher et al. 1980, SAE 800905), a law without states.

    Hidden: the leaves stick to one another with 0.22 kN/mm until 0.9 mm of slip. Motion and its speed are recorded;
    three recordings of 500 rows at 100 Hz.
    """
    name, rows, step, slips = "leaf_spring", 1500, 0.01, 0.9
    tone = Tones.drawn(rng, 0.2, 3.0, 9, 11.0, 0.0)
    t = np.arange(rows) * step
    place, speed = (
        tone(t),
        tone.height * np.sum(tone.speeds * np.cos(np.multiply.outer(t, tone.speeds) + tone.phases), -1),
    )
    held, slid = np.zeros(rows), 0.0
    for k, q in enumerate(tone(np.arange(20 * rows) * step / 20).tolist()):
        slid = min(max(slid, q - slips), q + slips)
        if k % 20 == 0:
            held[k // 20] = q - slid
    force = 6.0 + 0.21 * place + 1.2e-3 * speed + size * held
    true = {"f0": 6.0, "kl": 0.21, "cl": 1.2}
    text = equations("leaf spring", declared(rng, true, 0.07, f0="kN", kl="kN/mm", cl="N s/mm"), {},
                     {"force": ("f0 + kl*place + cl/1000*speed", "kN")})  # fmt: skip
    columns: dict[str, Column] = {
        "place": (np.round(place, 3), "mm", "input"), "speed": (np.round(speed, 2), "mm/s", "input"),
        "force": (logged(rng, force, 0.015, lag=2, ends=(-20, 20), bits=12), "kN", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("play_hysteresis",), ("bouc_wen_hysteresis",), {"half_width": slips},
                cuts=(500, 1000), true=true)  # fmt: skip


def joint(rng: np.random.Generator, *, size: float = 1.5) -> Case:
    """A joint of an industrial robot on an exciting path (Swevers et al. 1997; Weigand et al. 2022), inverse dynamics.

    Hidden: grease brakes with 1.5 N m at 1 rad/s. The model has inertia, weight and an offset of the torque. Angle,
    speed and acceleration of the path are recorded; one recording of 1800 rows, a law without states.
    """
    name, rows, step = "robot_joint", 1800, 0.02
    path = harmonics(rng, 1, 6, 0.1, 0.55)
    t = np.arange(rows) * step
    waves = np.multiply.outer(t, path.speeds) + path.phases
    angle, speed = path(t), path.height * np.sum(path.speeds * np.cos(waves), -1)
    grows = -path.height * np.sum(path.speeds**2 * np.sin(waves), -1)
    torque = 3.1 * grows + 21 * np.sin(angle) + 1.5 + size * speed + gust(rng, rows, 3, 0.35)
    true = {"Jj": 3.1, "gl": 21.0, "o0": 1.5}
    text = equations("robot joint", declared(rng, true, 0.06, Jj="kg m2", gl="N m", o0="N m"), {},
                     {"torque": ("Jj*grows + gl*sin(angle) + o0", "N m")})  # fmt: skip
    columns: dict[str, Column] = {
        "angle": (np.round(angle, 4), "rad", "input"), "speed": (np.round(speed, 4), "rad/s", "input"),
        "grows": (np.round(grows, 3), "rad/s^2", "input"),
        "torque": (logged(rng, torque, 0.02, ends=(-128, 128), bits=12), "N m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("viscous_friction_change",), ("missing_coupling",),
                {"damping_change": size}, true=true)  # fmt: skip


PLANTS: Makers = {
    "field_ceiling": (623, exciter), "iron_cell": (624, cell), "sealed_evaporator": (625, evaporator),
    "leaf_spring": (626, leaf), "robot_joint": (627, joint),
}  # fmt: skip
