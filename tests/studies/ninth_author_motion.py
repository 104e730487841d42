"""A crane, a hydraulic cylinder, a levitated ball and a motor that cogs, of which a piece is left out.

As ninth_author_geared.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, cos, pi, sin, sqrt, tanh

import numpy as np
from ninth_author_parts import LOOP, Makers, daq, integrate, model_text, near, off, sampled, stairs, stands, wander
from second_author_parts import Case, Column, known, state_space


def crane(rng: np.random.Generator) -> Case:
    """A gantry crane of a laboratory in its loop against sway, 60 s at 50 Hz, encoders on trolley and rope.

    Hidden: the bus sends a new voltage to the trolley's drive only when it differs by more than 0.45 V from the last
    one that was sent.
    """
    rows, step, width = 3000, 0.02, 0.45
    wanted, push = stairs(rng, rows, 110, 220, (-0.35, -0.1, 0.15, 0.4)), wander(rng, rows, 8, 0.02)
    swing, sent = wander(rng, rows, 20, 0.01), [0.0]
    more = stairs(rng, rows, 12, 40, (-0.5, 0.0, 0.5))

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        volts = round(min(max(9 * (wanted[k] - x[0]) - 4 * x[1] + 6 * x[2] + more[k], -10), 10), 3)
        if abs(volts - sent[0]) > width:
            sent[0] = volts
        return volts, sent[0], push[k], swing[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        a = (0.115 * u[1] - x[1]) / 0.11 + u[2]
        return x[1], a, x[3], -(9.81 * sin(x[2]) + a * cos(x[2])) / 0.62 - 0.09 * x[3] + u[3]

    x, u = integrate(slope, [0, 0, 0, 0], rows, step, command, 6)
    true = {"kc": 0.115, "tc": 0.11, "lr": 0.62, "dr": 0.09}
    values = {"gr": known(9.81, "m/s^2")} | near(rng, true, 0.04, kc="m/s/V", tc="s", lr="m", dr="1/s")
    a = "(kc*volts - speed)/tc"
    text = model_text("gantry crane", values, {"acc": a}, {
        "place": ("speed", 0.0, "m"), "speed": ("acc", 0.0, "m/s"), "sway": ("rate", 0.0, "rad"),
        "rate": ("-(gr*sin(sway) + acc*cos(sway))/lr - dr*rate", 0.0, "rad/s")},
        {"trolley": ("1000*place", "mm"), "rope_angle": ("sway*180/pi", "deg")})  # fmt: skip
    columns: dict[str, Column] = {
        "volts": (u[:, 0], "V", "input"),
        "trolley": (np.round(1000 * x[:, 0] / 0.2) * 0.2, "mm", "output"),
        "rope_angle": (np.round(np.degrees(x[:, 2]) / 0.044) * 0.044, "deg", "output")}  # fmt: skip
    return Case("crane_bus", step, columns, text, ("deadband",), (), {"width": width}, context=LOOP,
                beside=("sensor_quantisation",), true=true)  # fmt: skip


def cylinder(rng: np.random.Generator) -> Case:
    """A servo-hydraulic axis in its position loop, 16 s at 250 Hz (Jelali and Kroll 2003, Hydraulic Servo-systems).

    Hidden: the valve opens as far as for 5.5 V, whatever is asked for, and the seals rub with 400 N.
    """
    rows, step, most, rub = 4000, 0.004, 5.5, 400.0
    wanted = stairs(rng, rows, 120, 350, (-0.07, -0.03, 0.0, 0.04, 0.08)) + 0.002 * stairs(rng, rows, 9, 30, (-1, 0, 1))
    load, heard = wander(rng, rows, 25, 60.0), 2e-5 * rng.standard_normal(rows)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        volts = round(min(max(115 * (wanted[k] - x[0] - heard[k]), -10), 10), 3)
        return volts, min(max(volts, -most), most), load[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        flow = 0.05 * u[1] * sqrt(max(1 - copysign(1, u[1]) * x[2] / 160, 0.02))
        force = 125 * x[2] - 900 * x[1] - rub * tanh(x[1] / 0.002) + u[2]
        return x[1], force / 180, 35500 * (flow - x[1] - 2.2e-4 * x[2])

    x, u = integrate(slope, [0, 0, 0], rows, step, command, 10)
    true = {"kq": 0.05, "bv": 900.0, "kh": 35500.0, "cl": 2.2e-4}
    values = stands({"ps": 160.0, "ac": 125.0}, ps="bar", ac="N/bar") | {"mp": known(off(rng, 180.0, 0.01), "kg")}
    values |= near(rng, true, 0.04, kq="m/s/V", bv="N s/m", kh="bar/m", cl="m/s/bar")
    flow = "kq*volts*sqrt(max(1 - sign(volts)*pl/ps, 0.02))"
    text = model_text("servo axis", values, {}, {
        "place": ("speed", 0.0, "m"), "speed": ("(ac*pl - bv*speed)/mp", 0.0, "m/s"),
        "pl": (f"kh*({flow} - speed - cl*pl)", 0.0, "bar")},
        {"position": ("1000*place", "mm"), "load_pressure": ("pl", "bar")})  # fmt: skip
    columns: dict[str, Column] = {
        "volts": (u[:, 0], "V", "input"),
        "position": (daq(rng, 1000 * (x[:, 0] + heard), (-150, 150), 16), "mm", "output"),
        "load_pressure": (daq(rng, x[:, 2], (-200, 200), 12, noise=0.15), "bar", "output")}  # fmt: skip
    return Case("hydraulic_axis", step, columns, text, ("input_saturation", "coulomb_friction"), ("stiction",),
                {"high": most, "force_N": rub}, context=LOOP, true=true)  # fmt: skip


def levitated(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A steel ball of 80 g under a magnet with a current amplifier, in its loop, 1 kHz (Woodson and Melcher 1968).

    Hidden: the optical gap sensor follows with 2.2 ms; the loop hears it so. The pull is read by a load cell at the
    magnet. The complete one has a sensor that follows at once, and two recordings.
    """
    rows, step, tau = (5000 if complete else 6000), 0.001, 0.0022
    wanted, push = 8e-3 + 1e-3 * stairs(rng, rows, 60, 240, (-0.8, -0.3, 0.2, 0.7)), wander(rng, rows, 10, 0.05)
    heard, memory = 1.5e-6 * rng.standard_normal(rows), [8e-3, 0.0, 0.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        gap = (x[0] if complete else x[2]) + heard[k]
        memory[1] += 0.35 * ((gap - memory[0]) / step - memory[1])
        memory[0] = gap
        memory[2] += 2.0 * (gap - wanted[k])
        return min(max(1.0 + 390 * (gap - wanted[k]) + 5.6 * memory[1] + memory[2], 0), 3), push[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], 9.81 - 5.02e-5 / 0.08 * (u[0] / x[0]) ** 2 + u[1], (x[0] - x[2]) / tau

    x, u = integrate(slope, [8e-3, 0, 8e-3], rows, step, command, 6)
    true = {"cm": 50.2}
    values = stands({"mb": 0.08, "gr": 9.81}) | near(rng, {"cm": 50.2}, 0.02, cm="1e-6 N m2/A2")
    text = model_text("levitated ball", values, {"pull": "cm*1e-6*(current/gap)**2"}, {
        "gap": ("fall", 8e-3, "m"), "fall": ("gr - pull/mb", 0.0, "m/s")},
        {"gap_sensor": ("1000*gap", "mm"), "pull_cell": ("pull", "N")})  # fmt: skip
    seen = x[:, 0] if complete else x[:, 2]
    columns: dict[str, Column] = {
        "current": (u[:, 0], "A", "input"),
        "gap_sensor": (daq(rng, 1000 * (seen + heard), (0, 20), 16), "mm", "output"),
        "pull_cell": (daq(rng, 5.02e-5 * (u[:, 0] / x[:, 0]) ** 2, (0, 5), 12, noise=0.008), "N",
                      "output")}  # fmt: skip
    if complete:
        return Case("null_levitated", step, columns, text, context=LOOP, cuts=(2500,), true=true)
    return Case("levitated_ball", step, columns, text, ("sensor_lag",), (), {"tau_s": tau}, context=LOOP, true=true)


def cogging(rng: np.random.Generator) -> Case:
    """A motor with magnets that turns slowly, with tachometer and encoder; the model linear in discrete time, 200 Hz.

    Hidden: the rotor's magnets hold on to the teeth 18 times a turn, as much as 0.5 V would; no entry has that.
    """
    rows, step, hold = 4000, 0.005, 0.5
    volts = stairs(rng, rows, 60, 220, (-2.2, -1.3, 1.1, 1.6, 2.5)) + 0.25 * stairs(rng, rows, 5, 25, (-1, 1))
    u = np.c_[np.round(volts, 3), wander(rng, rows, 6, 0.04)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (4.1 * (u[0] + u[1] - hold * sin(18 * x[1])) - x[0]) / 0.07, x[0]

    x, _ = integrate(slope, [0, 0.3], rows, step, lambda k, _: u[k].tolist(), 8)
    gain, lag = off(rng, 4.1, 0.04), off(rng, 0.07, 0.04)
    a, b = sampled(np.array([[-1 / lag, 0], [1, 0]]), np.array([[gain / lag], [0]]), step)
    c = np.diag([30 / pi, 180 / pi])
    model = state_space(step, {"volts": "V"}, {"tacho": "rpm", "encoder": "deg"}, (a, b, c, np.zeros((2, 1))))
    columns: dict[str, Column] = {
        "volts": (u[:, 0], "V", "input"),
        "tacho": (daq(rng, x[:, 0] * 30 / pi, (-250, 250), 12, noise=0.4), "rpm", "output"),
        "encoder": (np.round(np.degrees(x[:, 1] - 0.3) / 0.09) * 0.09, "deg", "output")}  # fmt: skip
    return Case("motor_cogs", step, columns, model, outside=True, beside=("sensor_quantisation",))


MOTION_MAKERS: Makers = {
    "crane_bus": (941, crane), "hydraulic_axis": (942, cylinder), "levitated_ball": (943, levitated),
    "motor_cogs": (944, cogging),
}  # fmt: skip
