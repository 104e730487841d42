"""A climatic chamber, a pump with its tank and a test bench of drives, of which a piece is left out.

As ninth_author_geared.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sqrt

import numpy as np
from ninth_author_parts import LOOP, Makers, daq, integrate, model_text, near, off, paired, stairs, wander
from second_author_parts import Case, Column, known
from textbook_plants import Array


def chamber(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Air and walls of a test chamber with an electric heater in a loop, eight hours, 20 s a row.

    Hidden: the hall around it warms and cools between 16 and 27 degC, which is recorded; the model has 21 degC. The
    complete one has what is recorded, and sensors of fewer bits.
    """
    rows, step, total = (1100 if complete else 1450), 20.0, [0.35]
    hours = np.arange(rows) * step / 3600
    hall = np.round(21 + 4 * np.sin(2 * pi * hours / 5 + rng.uniform(0, 6)) + wander(rng, rows, 40, 1.2), 2)
    wanted, leak = stairs(rng, rows, 50, 160, (38, 46, 55, 63)), wander(rng, rows, 4, 6.0)
    shake = 0.06 * stairs(rng, rows, 4, 20, (-1, 0, 1))

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0]
        total[0] = min(max(total[0] + 0.0004 * error * step, 0), 1)
        return round(600 * min(max(total[0] + 0.05 * error + shake[k], 0), 1), 0), hall[k], leak[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        across = 24 * (x[0] - x[1])
        return (u[0] - across + u[2]) / 9000, (across - 7 * (x[1] - u[1])) / 52000

    x, u = integrate(slope, [45, 41], rows, step, command, 4)
    true = {"ca": 9.0, "cw": 52.0, "ha": 24.0, "hw": 7.0}
    values = {"ca": known(off(rng, 9.0, 0.02), "kJ/K")}
    values |= near(rng, {k: true[k] for k in ("cw", "ha", "hw")}, 0.03, cw="kJ/K", ha="W/K", hw="W/K")
    around = "hall" if complete else "21"
    text = model_text("chamber", values, {}, {
        "air": ("(heater - ha*(air - wall))/(1000*ca)", 45.0, "degC"),
        "wall": (f"(ha*(air - wall) - hw*(wall - {around}))/(1000*cw)", 41.0, "degC")},
        {"air_temp": ("air", "degC"), "wall_temp": ("wall", "degC")})  # fmt: skip
    bits = 11 if complete else 13
    columns: dict[str, Column] = {
        "heater": (u[:, 0], "W", "input"), "hall": (hall, "degC", "disturbance"),
        "air_temp": (daq(rng, x[:, 0], (-20, 120), bits, noise=0.03), "degC", "output"),
        "wall_temp": (daq(rng, x[:, 1], (-20, 120), bits, noise=0.03), "degC", "output")}  # fmt: skip
    if complete:
        return Case("null_chamber_hall", step, columns, text, context=LOOP, lost=5, headings=True,
                    beside=("sensor_quantisation",), true=true)  # fmt: skip
    return Case("chamber_hall", step, columns, text, ("missing_disturbance",), (), {"gain": 7 / 52000}, context=LOOP,
                true=true)  # fmt: skip


def pump(rng: np.random.Generator) -> Case:
    """A centrifugal pump on a converter fills a tank that drains through an orifice, ten minutes at 4 Hz.

    Hidden: pump and converter follow the demand with 1.1 s, and the flow meter ends at 46 l/min.
    """
    rows, step, tau, end = 2400, 0.25, 1.1, 46.0
    asked = np.round(stairs(rng, rows, 20, 90, (60, 68, 76, 84, 92, 97)), 1)
    u = np.c_[asked, 1 + wander(rng, rows, 30, 0.008), wander(rng, rows, 3, 0.03)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        head = 12 * (x[0] / 100) ** 2 - 0.0012 * x[1] ** 2
        out = 51 * u[1] * sqrt(max(x[2], 1e-4))
        return (u[0] - x[0]) / tau, (head - 0.002 * x[1] ** 2 - 3 - x[2] + u[2]) / 0.051, (x[1] - out) / 3000

    x, _ = integrate(slope, [60, 17, 0.2], rows, step, lambda k, _: u[k].tolist(), 12)
    true = {"hp": 12.0, "rp": 1.2, "rl": 2.0, "lift": 3.0, "iq": 0.051, "ko": 51.0, "at": 3.0}
    values = near(rng, true, 0.03, hp="m", lift="m")
    text = model_text("pump and tank", values, {"head": "hp*(demand/100)**2 - rp/1000*flow**2"}, {
        "flow": ("(head - rl/1000*flow**2 - lift - level)/iq", 17.0, "l/min"),
        "level": ("(flow - ko*sqrt(max(level, 0.0001)))/(1000*at)", 0.2, "m")},
        {"flow_meter": ("flow", "l/min"), "tank_level": ("100*level", "cm"),
         "discharge": ("0.0981*head", "bar")})  # fmt: skip
    head = 12 * (x[:, 0] / 100) ** 2 - 0.0012 * x[:, 1] ** 2
    flow = daq(rng, x[:, 1], (0, 80), 13, noise=0.12, slow=0.05)
    columns: dict[str, Column] = {
        "demand": (u[:, 0], "%", "input"), "flow_meter": (np.minimum(flow, end), "l/min", "output"),
        "tank_level": (daq(rng, 100 * x[:, 2], (0, 150), 12, noise=0.1, slow=0.05), "cm", "output"),
        "discharge": (daq(rng, 0.0981 * head, (0, 2.5), 12, noise=0.002), "bar", "output")}  # fmt: skip
    return Case("pump_and_tank", step, columns, text, ("actuator_lag", "sensor_saturation"), (),
                {"tau_s": tau, "high": end}, lost=5, true=true)  # fmt: skip


def _bench(x: Sequence[float], u: Sequence[float], factor: float, spring: float) -> Sequence[float]:
    """Return the slopes of both machines' speeds and of the shaft's twist; motor and brake in N m, forces unknown."""
    twist = spring * x[2] + 1.6 * (x[0] - x[1])
    return ((u[0] - twist - 0.02 * x[0] + u[2]) / 0.35, (twist - factor * u[1] - 0.13 * x[1] - 4) / 0.9, x[0] - x[1])


def bench(rng: np.random.Generator) -> Case:
    """A drive and an eddy-current brake on a bench, 100 Hz, held against a simulation with the same two torques.

    Hidden: the brake, worn in, gives 9 % more than its demand. Speed of the motor and torque of the shaft are read.
    """
    rows, step, factor, total = 4000, 0.01, 1.09, [70.0]
    wanted, brake = stairs(rng, rows, 200, 500, (90, 120, 150, 170)), stairs(rng, rows, 90, 260, (20, 35, 50, 65))
    brake = np.round(brake + 4 * stairs(rng, rows, 8, 30, (-1, 0, 1)), 1)
    rough = wander(rng, rows, 4, 0.5)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0]
        total[0] += 0.02 * error
        return round(min(max(total[0] + 2.5 * error, -150), 200), 1), brake[k], rough[k]

    x, u = integrate(lambda _, x, u: _bench(x, u, factor, 900.0), [100, 100, 0.06], rows, step, command, 8)
    still: Array = np.c_[u[:, :2], np.zeros(rows)]
    y, _ = integrate(lambda _, x, u: _bench(x, u, 1.0, 905.0), [100, 100, 0.06], rows, step,
                     lambda k, _: still[k].tolist(), 8)  # fmt: skip
    made = []
    for z, noise in ((y, 0.0), (x, 1.0)):
        shaft = 900 * z[:, 2] + 1.6 * (z[:, 0] - z[:, 1])
        made.append({
            "motor": (u[:, 0], "N m", "input"), "brake": (u[:, 1], "N m", "input"),
            "motor_speed": (daq(rng, z[:, 0] * 30 / pi, (-500, 6000), 15, noise=noise), "rpm", "output"),
            "shaft_torque": (daq(rng, shaft, (-500, 500), 14, noise=0.3 * noise, slow=0.2 * noise), "N m",
                             "output")})  # fmt: skip
    case = Case("bench_brake", step, made[1], {}, ("parameter_error",), (), {"factor": factor}, context=LOOP)
    return paired(case, [made[0]], same_inputs=True)


PROCESS_MAKERS: Makers = {
    "chamber_hall": (951, chamber), "pump_and_tank": (952, pump), "bench_brake": (953, bench),
}  # fmt: skip
