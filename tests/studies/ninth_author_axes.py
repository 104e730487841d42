"""A frame on a shaking table, a voice coil and a belt axis, of which a piece is left out.

As ninth_author_geared.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np
from ninth_author_parts import LOOP, Makers, daq, integrate, off, paired, sampled, stairs, wander
from second_author_parts import Case, Column, state_space
from textbook_plants import Array


def _storeys(masses: Sequence[float], springs: Sequence[float], dashpots: Sequence[float]) -> tuple[Array, Array]:
    """Return stiffness and damping over mass of three storeys, one above the other."""
    found = []
    for k in (springs, dashpots):
        one = np.array([[k[0] + k[1], -k[1], 0], [-k[1], k[1] + k[2], -k[2]], [0, -k[2], k[2]]])
        found.append(one / np.array(masses)[:, None])
    return found[0], found[1]


def frame(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A steel frame of three storeys on a shaking table, 80 s at 100 Hz, accelerometers on the floors, linear.

    Hidden: after 47 s a bolt of the lowest brace comes loose, and the storey loses 7 % of its stiffness. The complete
    one keeps its bolts, in two recordings through filters against aliases.
    """
    rows, step, when = (6000 if complete else 8000), 0.01, 47.0
    masses, dashpots = (48.0, 46.0, 39.0), (95.0, 75.0, 60.0)
    whole, cut = (62000.0, 55000.0, 50000.0), (0.93 * 62000.0, 55000.0, 50000.0)
    (k1, c1), (k2, _) = _storeys(masses, whole, dashpots), _storeys(masses, cut, dashpots)
    ground = wander(rng, rows, 1.2, 1.0) * (0.5 + 0.4 * np.sin(2 * pi * np.arange(rows) * step / 33) ** 2)
    floors = np.c_[[wander(rng, rows, 1.0, 0.02) for _ in range(3)]].T
    u = np.c_[np.round(ground, 4), floors]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        k = k2 if t > when and not complete else k1
        own = [u[1 + i] - u[0] - sum(k[i, j] * x[j] + c1[i, j] * x[3 + j] for j in range(3)) for i in range(3)]
        return (*x[3:], *own)

    x, _ = integrate(slope, [0] * 6, rows, step, lambda k, _: u[k].tolist(), 4)
    acc = np.array([np.array(slope(k * step, x[k], u[k])[3:]) + u[k, 0] for k in range(rows)])
    k, c = _storeys([off(rng, m, 0.01) for m in masses], [off(rng, s, 0.015) for s in whole],
                    [off(rng, d, 0.05) for d in dashpots])  # fmt: skip
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [-k, -c]])
    names = {f"floor{i}_acc": "m/s^2" for i in (1, 2, 3)}
    model = state_space(0, {"table_acc": "m/s^2"}, names,
                        (a, np.array([[0, 0, 0, -1, -1, -1.0]]).T, np.hstack([-k, -c]), np.zeros((3, 1))))  # fmt: skip
    columns: dict[str, Column] = {"table_acc": (u[:, 0], "m/s^2", "input")}
    corner = 0.45 if complete else 0.0
    for i, name in enumerate(names):
        columns[name] = (daq(rng, acc[:, i], (-20, 20), 14, noise=0.012, corner=corner), "m/s^2", "output")
    if complete:
        return Case("null_frame", step, columns, model, cuts=(3000,))
    return Case("frame_bolt", step, columns, model, ("stiffness_change",), (), {"time_s": when})


def coil(rng: np.random.Generator) -> Case:
    """A voice-coil stage on flexures, 8 s at 500 Hz, position and acceleration, its model linear in discrete time.

    Hidden: the carriage bends at 41 Hz; the model has the flexures' 6.2 Hz alone.
    """
    rows, step, w, z, b = 4000, 0.002, 2 * pi * np.array([6.2, 41.0]), (0.08, 0.012), (1.0, 0.25)
    u = np.c_[np.round(0.8 * stairs(rng, rows, 6, 90, (-1, -0.4, 0.4, 1)), 3), wander(rng, rows, 5, 0.01)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        own = [5.2 * b[i] * (u[0] + u[1]) - w[i] ** 2 * x[i] - 2 * z[i] * w[i] * x[2 + i] for i in (0, 1)]
        return x[2], x[3], own[0], own[1]

    x, _ = integrate(slope, [0] * 4, rows, step, lambda k, _: u[k].tolist(), 8)
    acc = np.array([sum(slope(0, x[k], u[k])[2:]) for k in range(rows)])
    v, g = off(rng, float(w[0]), 0.006), off(rng, 5.2, 0.03)
    low = [-v * v, -2 * z[0] * v]
    a, drive = np.array([[0, 1], low]), np.array([[0.0], [g]])
    model = state_space(step, {"current": "A"}, {"position": "mm", "stage_acc": "m/s^2"},
                        (*sampled(a, drive, step), np.array([[1e3, 0], low]), np.array([[0], [g]])))  # fmt: skip
    columns: dict[str, Column] = {
        "current": (u[:, 0], "A", "input"),
        "position": (daq(rng, 1e3 * (x[:, 0] + x[:, 1]), (-20, 20), 15, noise=0.003), "mm", "output"),
        "stage_acc": (daq(rng, acc, (-50, 50), 13, noise=0.03), "m/s^2", "output")}  # fmt: skip
    return Case("coil_bends", step, columns, model, ("structural_mode",), (), {"frequency_hz": 41.0})


def _axis(rng: np.random.Generator, rows: int, step: float, late: int, stiff: float) -> tuple[Array, Array, Array]:
    """Return states of a motor with a carriage on a belt in its loop, the torque asked for, and the twist's pull."""
    wanted, push = stairs(rng, rows, 70, 200, (-0.25, -0.1, 0.0, 0.12, 0.3)), wander(rng, rows, 8, 1.2)
    shake, given = 0.25 * stairs(rng, rows, 5, 25, (-1, 0, 1)), [0.0] * late
    heard = 0.05 * rng.standard_normal(rows)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        ask = 7.0 * (wanted[k] - 0.02 * x[1])
        given.append(round(min(max(0.055 * (ask / 0.02 - x[0] - heard[k]) + shake[k], -3), 3), 3))
        return given[k + late], given[k], push[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        pull = stiff * (0.02 * x[1] - x[3]) + 60 * (0.02 * x[0] - x[2])
        return (u[1] - 0.02 * pull - 0.004 * x[0]) / 2.2e-3, x[0], (pull - 14 * x[2] + u[2]) / 4.5, x[2]

    x, u = integrate(slope, [0] * 4, rows, step, command, 8)
    return x, u, heard


def belt(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A carriage on a toothed belt behind a servo, its loop over a bus, held against a simulation on another path.

    Hidden: the torque demand arrives 20 ms late; and the fault that the carriage's place is in inches, not in
    millimetres. 200 Hz. The complete one has neither.
    """
    rows, step = (2600, 0.005) if complete else (3200, 0.005)
    late, unit, made = (0 if complete else 4), (1.0 if complete else 1 / 25.4), []
    for dead, scale, stiff in ((0, 1.0, 22300.0), (late, unit, 22000.0)):
        x, u, heard = _axis(rng, rows, step, dead, stiff)
        made.append({
            "torque": (u[:, 0], "N m", "input"),
            "motor_speed": (daq(rng, (x[:, 0] + heard) * 30 / pi, (-1200, 1200), 15), "rpm", "output"),
            "carriage": (scale * daq(rng, 1000 * x[:, 3], (-600, 600), 16, noise=0.02), "mm", "output"),
            "carriage_speed": (daq(rng, 1000 * x[:, 2], (-4000, 4000), 15, noise=0.8), "mm/s", "output")})  # fmt: skip
    if complete:
        case = Case("null_belt_run", step, made[1], {}, context=LOOP)
    else:
        case = Case("belt_bus", step, made[1], {}, ("transport_delay", "sensor_scale"), (),
                    {"delay_s": late * step, "factor": unit}, context=LOOP)  # fmt: skip
    return paired(case, [made[0]])


AXIS_MAKERS: Makers = {"frame_bolt": (971, frame), "coil_bends": (972, coil), "belt_bus": (973, belt)}
