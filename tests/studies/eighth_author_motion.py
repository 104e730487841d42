"""Belts, balls, servos, throttles, pendulums and an idling engine after public rigs, of which a piece is left out.

As eighth_author_heat.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin, tanh

import numpy as np
from eighth_author_parts import Makers, each, levels, prbs
from second_author_parts import Case, Column, equations, flips, known, plateaus, smooth, state_space
from seventh_author_parts import begun, sampled, started
from sixth_author_parts import LOOP, declared, fixed, gust, hiss, logged
from textbook_plants import Array
from third_author_parts import rk, told


def belts(rng: np.random.Generator, *, size: float = 1.0) -> Case:
    """Two motors drive a pulley by a belt on springs (Wigren and Schoukens 2017, coupled electric drives benchmark).

    Hidden: the pulse counter of the pulley does not know which way it turns. Binary voltages of changing levels, three
    recordings of 500 rows from rest at 50 Hz; the belt slips a little, which is not recorded.
    """
    name, lengths, step = "coupled_belts", (500,) * 3, 0.02
    rows = sum(lengths)
    volts = prbs(rng, rows, 5, -1, 1) * plateaus(rng, rows, 90, 0.5, 1.5) + plateaus(rng, rows, 100, -0.3, 0.5)
    slip = gust(rng, rows, 6, 0.04)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (2.3 * u[0] + u[1] - x[0]) / 0.28, x[0] - x[2], 420 * x[1] + 5.5 * (x[0] - x[2])

    x, _ = started(slope, [0, 0, 0], lengths, step, told(np.c_[volts, slip]), 8)
    true = {"kb": 2.3, "tm": 0.28, "kp": 420.0, "dp": 5.5}
    text = equations("coupled drives", declared(rng, true, 0.08, kb="1/V", tm="s", kp="1/s2", dp="1/s"), {
        "motor": ("(kb*volts - motor)/tm", 0, ""), "twist": ("motor - pulley", 0, "s"),
        "pulley": ("kp*twist + dp*(motor - pulley)", 0, "")}, {"speed": ("pulley", "1/ms")})  # fmt: skip
    read = np.abs(x[:, 2]) if size else x[:, 2]
    columns: dict[str, Column] = {
        "volts": (np.round(volts, 3), "V", "input"),
        "speed": (logged(rng, read, 0.025, ends=(0 if size else -4, 4), bits=11), "1/ms", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_rectified",), (), cuts=begun(lengths), true=true)


def ball(rng: np.random.Generator, *, size: float = 0.5) -> Case:
    """A ball on a beam that a servo tilts (the recording of De Moor 1997, DaISy; Wellstead's ball and beam).

    Hidden: the gear between servo and beam has 0.5 deg of play. A loop on the camera's place of the ball moves the
    servo, 0.1 s a row; draughts are not recorded.
    """
    name, rows, step, beam = "ball_beam", 1000, 0.1, [0.0]
    wanted, shake, push = (
        levels(rng, rows, 60, (-0.2, 0.0, 0.12, 0.2)),
        flips(rng, rows, 5, 0.6),
        gust(rng, rows, 5, 5e-3),
    )
    heard = hiss(rng, rows, 5e-4)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        asked = 10 * (wanted[k] - x[0] - heard[k]) - 13 * (x[1] + 8 * heard[k]) + shake[k]
        asked = round(max(min(asked, 12), -12), 2)
        beam[0] = min(max(beam[0], asked - size / 2), asked + size / 2)
        return asked, beam[0], push[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], 0.71 * 9.81 * sin(u[1] * pi / 180) + u[2] - 0.12 * x[1]

    x, u = rk(slope, [0, 0], rows, step, command, 8)
    true = {"kr": 0.71, "dr": 0.12}
    text = equations("ball on beam", {"gr": known(9.81, "m/s2")} | declared(rng, true, 0.07, dr="1/s"), {
        "place": ("speed", 0, "m"), "speed": ("kr*gr*sin(tilt*pi/180) - dr*speed", 0, "m/s")},
        {"ball": ("place", "m")})  # fmt: skip
    columns: dict[str, Column] = {
        "tilt": (u[:, 0], "deg", "input"),
        "ball": (logged(rng, x[:, 0] + heard, 0.0, ends=(-0.5, 0.5), bits=11), "m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("backlash",), (), {"width": size}, context=LOOP, true=true)


def servo(rng: np.random.Generator, *, size: float = 0.15) -> Case:
    """A geared servo with a disc (the rotary servo of teaching laboratories; Apkarian et al. 2012), open loop.

    Hidden: the amplifier gives nothing within 0.15 V of zero and less by as much beyond. Angle by encoder and speed by
    tachometer; two recordings of 1200 rows.
    """
    name, lengths, step = "servo_disc", (1200, 1200), 0.01
    rows = sum(lengths)
    t = np.arange(rows) * step
    volts = np.round(
        1.4 * np.sin(2 * np.pi * 0.37 * t) + 0.9 * np.sin(2 * np.pi * 0.91 * t + 1) + flips(rng, rows, 45, 0.6), 3
    )
    rub = gust(rng, rows, 12, 0.15)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        given = u[0] - max(min(u[0], size), -size)
        return (1.68 * given + 0.1 * u[1] - x[0]) / 0.065, x[0]

    x, _ = started(slope, [0, 0], lengths, step, told(np.c_[volts, rub]), 8)
    true = {"kd": 1.68, "td": 0.065}
    text = equations("servo with disc", declared(rng, true, 0.06, kd="rad/s/V", td="s"), {
        "w": ("(kd*volts - w)/td", 0, "rad/s"), "angle": ("w", 0, "rad")},
        {"tacho": ("w", "rad/s"), "encoder": ("angle*180/pi", "deg")})  # fmt: skip
    columns: dict[str, Column] = {
        "volts": (volts, "V", "input"),
        "tacho": (logged(rng, x[:, 0], 0.03, ends=(-20, 20), bits=12), "rad/s", "output"),
        "encoder": (np.round(np.degrees(x[:, 1]) / 0.0879) * 0.0879, "deg", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("deadband",), (), {"width": size}, cuts=begun(lengths), true=true)


def throttle(rng: np.random.Generator, *, size: tuple[float, float] = (0.011, 60.0)) -> Case:
    """A throttle plate with motor and spring (Vašak et al. 2006, an electronic throttle; the MATLAB recording).

    Hidden: gear and bearings rub with 11 mN m, and the plate meets stops at 0.10 and 1.35 rad. Duty cycles are held,
    200 Hz; the air that streams past is not recorded. Two recordings.
    """
    name, rows, step, (rub, stop) = "throttle_plate", 2400, 0.005, size
    duty, air = plateaus(rng, rows, 60, 0.0, 0.42) + flips(rng, rows, 20, 0.05), gust(rng, rows, 15, 1.5e-3)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        over, under = max(x[0] - 1.35, 0.0), min(x[0] - 0.10, 0.0)
        ends = stop * (over * max(1 + 0.3 * x[1], 0) + under * max(1 - 0.3 * x[1], 0))
        pull = 0.21 * u[0] - 0.075 * (x[0] - 0.45) - 0.006 * x[1] - rub * tanh(x[1] / 0.03)
        return x[1], (pull - ends + u[1]) / 2.1e-3

    x, _ = rk(slope, [0.45, 0], rows, step, told(np.c_[np.round(duty, 3), air]), 20)
    true = {"Jp": 2.1, "kt": 210.0, "ks": 75.0, "bp": 6.0, "p0": 0.45}
    values = {"Jp": fixed(rng, 2.1, "g m2", 0.02)} | declared(
        rng, {k: true[k] for k in ("kt", "ks", "bp", "p0")}, 0.06, kt="mN m", ks="mN m/rad", bp="mN m s", p0="rad"
    )
    text = equations("throttle plate", values, {
        "plate": ("turn", 0.45, "rad"), "turn": ("(kt*duty - ks*(plate - p0) - bp*turn)/Jp", 0, "rad/s")},
        {"angle": ("plate", "rad")})  # fmt: skip
    columns: dict[str, Column] = {
        "duty": (np.round(duty, 3), "", "input"),
        "angle": (logged(rng, x[:, 0], 0.006, ends=(-pi, pi), bits=13), "rad", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("coulomb_friction", "end_stop"), ("stiction",),
                {"high_stop": 1.35}, cuts=(1200,), true=true)  # fmt: skip


def _kicks(rng: np.random.Generator, rows: int) -> Array:
    """Return short torques in N m at random rows, none in the first half of a recording."""
    found = np.zeros(rows)
    for place in range(rows // 2, rows - 30, 70):
        found[place : place + int(rng.integers(8, 22))] = rng.choice([-1, 1]) * rng.uniform(0.1, 0.45)
    return found


def pendulum(rng: np.random.Generator, *, size: tuple[float, float] = (0.007, 0.0008)) -> Case:
    """A rod with a plate that swings down after it is let go, and is kicked by a small motor (Squire 1986, AJP 54).

    Hidden: the bearing rubs with 7 mN m and the plate is braked by 0.8 mN m at 1 rad/s, with the speed squared. Four
    recordings of 800 rows from four angles; the torque is zero while the rod decays.
    """
    name, long, step, (rub, drag) = "swinging_plate", 800, 0.02, size
    torque = np.concatenate([_kicks(rng, long) for _ in range(4)])
    air, begin = gust(rng, 4 * long, 10, 8e-4), (1.15, -0.8, 0.5, -1.4)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        lost = 2.5e-3 * x[1] + rub * tanh(x[1] / 0.02) + drag * x[1] * abs(x[1])
        return x[1], (u[0] + u[1] - 1.62 * sin(x[0]) - lost) / 0.058

    u = np.c_[torque, air]
    parts = [rk(slope, [a, 0], long, step, told(u[k * long : (k + 1) * long]), 10)[0] for k, a in enumerate(begin)]
    x = np.vstack(parts)
    true = {"Jr": 0.058, "gm": 1.62, "br": 2.5}
    values = {"Jr": fixed(rng, 0.058, "kg m2", 0.02)} | declared(
        rng, {"gm": 1.62, "br": 2.5}, 0.08, gm="N m", br="mN m s"
    )
    text = equations("swinging plate", values, {
        "q": ("v", 1.1, "rad"), "v": ("(torque - gm*sin(q) - br/1000*v)/Jr", 0, "rad/s")},
        {"swing": ("q", "rad")})  # fmt: skip
    columns: dict[str, Column] = {
        "torque": (torque, "N m", "input"),
        "swing": (logged(rng, x[:, 0], 0.004, ends=(-pi, pi), bits=12), "rad", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("coulomb_friction", "quadratic_damping"), ("stiction",),
                {"force_N": rub, "c2": drag}, cuts=(long, 2 * long, 3 * long), true=true)  # fmt: skip


def furuta(rng: np.random.Generator, *, size: float = 1.0) -> Case:
    """An arm that turns with a rod hanging at its end (Furuta et al. 1992; Cazzolato and Prime 2011), no entry.

    Not in the model: the rod is flung out as the arm turns, and its own swing changes the arm's inertia. Torque is held
    at 100 Hz; both encoders are read in steps; two recordings.
    """
    name, rows, step, arm, hook, rod, weight = "hanging_rod", 2000, 0.01, 4.6e-3, 1.9e-3, 1.35e-3, 0.088
    push, shake = (
        0.035 * np.sin(2 * pi * 0.23 * np.arange(rows) * step) + flips(rng, rows, 22, 0.02),
        gust(rng, rows, 6, 1e-3),
    )

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        s, c = sin(x[2]), cos(x[2])
        twice = 2 * s * c * rod * size
        first = u[0] + u[1] - 6e-3 * x[1] + hook * s * x[3] ** 2 - twice * x[1] * x[3]
        second = 0.5 * twice * x[1] ** 2 - weight * s - 2.2e-4 * x[3]
        a, b = arm + rod * size * s * s, hook * c
        det = a * rod - b * b
        return x[1], (rod * first - b * second) / det, x[3], (a * second - b * first) / det

    x, _ = rk(slope, [0] * 4, rows, step, told(np.c_[np.round(push, 4), shake]), 10)
    true = {"Ja": 4.6, "hk": 1.9, "Jr": 1.35, "gw": 88.0, "ba": 6.0, "br": 0.22}
    values = {"Ja": fixed(rng, 4.6, "g m2", 0.01), "hk": fixed(rng, 1.9, "g m2", 0.01)} | declared(
        rng, {k: true[k] for k in ("Jr", "gw", "ba", "br")}, 0.05, Jr="g m2", gw="mN m", ba="mN m s", br="mN m s"
    )
    first, second = "(1000*torque - ba*w + hk*sin(al)*v**2)", "(-gw*sin(al) - br*v)"
    det = "(Ja*Jr - (hk*cos(al))**2)"
    text = equations("hanging rod", values, {
        "th": ("w", 0, "rad"), "w": (f"(Jr*{first} - hk*cos(al)*{second})/{det}", 0, "rad/s"),
        "al": ("v", 0, "rad"), "v": (f"(Ja*{second} - hk*cos(al)*{first})/{det}", 0, "rad/s")},
        {"arm": ("th*180/pi", "deg"), "rod": ("al*180/pi", "deg")})  # fmt: skip
    columns: dict[str, Column] = {"torque": (np.round(push, 4), "N m", "input")}
    columns |= {
        n: (np.round(np.degrees(x[:, k]) / 0.176) * 0.176, "deg", "output") for k, n in ((0, "arm"), (2, "rod"))
    }
    return Case(name, step, columns, text, outside=True, beside=("sensor_quantisation",), cuts=(1000,), true=true)


def idle(rng: np.random.Generator, *, size: float = 0.12) -> Case:
    """An engine that idles, with throttle bypass and spark (Hrovat and Sun 1997, Control Eng. Practice 5), linear.

    The fault: the logger of speed and manifold pressure runs 0.12 s late. The loads of lamps and pumps are not
    recorded; the bypass is stepped and the spark is a binary sequence. Two recordings; gains up to 4 % off.
    """
    name, rows, step, late = "idle_logger", 1200, 0.04, round(size / 0.04)
    u = np.c_[
        levels(rng, rows + 40, 30, (-6, -2, 2, 6)), prbs(rng, rows + 40, 6, -4, 4), smooth(rng, rows + 40, 15, 0.7)
    ]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (0.9 * u[0] - 0.022 * x[1] - x[0]) / 0.35, (26 * x[0] + 9 * u[1] + 4 * u[2] - x[1]) / 0.7

    x, _ = rk(slope, [0, 0], rows + 40, step, told(u), 8)
    g = each(rng, [0.9, 0.022, 26.0, 9.0], 0.04)
    a = np.array([[-1 / 0.35, -g[1] / 0.35], [g[2] / 0.7, -1 / 0.7]])
    b = np.array([[g[0] / 0.35, 0], [0, g[3] / 0.7]])
    ways = {"bypass": "%", "spark": "deg"}, {"manifold": "kPa", "speed": "rpm"}
    model = state_space(step, *ways, sampled(a, b, np.eye(2), step))
    now, then = slice(40, rows + 40), slice(40 - late, rows + 40 - late)
    columns: dict[str, Column] = {
        "bypass": (u[now, 0], "%", "input"), "spark": (u[now, 1], "deg", "input"),
        "manifold": (logged(rng, x[then, 0], 0.02, lag=2, ends=(-32, 32), bits=11), "kPa", "output"),
        "speed": (logged(rng, x[then, 1], 0.015, ends=(-500, 500), bits=11), "rpm", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("data_time_offset",), (), {"offset_s": size}, cuts=(600,))


MOTION: Makers = {
    "coupled_belts": (609, belts), "ball_beam": (610, ball), "servo_disc": (611, servo),
    "throttle_plate": (612, throttle), "swinging_plate": (613, pendulum), "hanging_rod": (614, furuta),
    "idle_logger": (615, idle),
}  # fmt: skip
