"""More textbook systems: loops, several recordings, disturbances that nobody records, laws without states.

As textbook_plants.py, with what recordings of machines have: loads that wander, controllers that answer to noise,
pauses between recordings, and physics that no entry of the catalogue has.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from textbook_plants import Array, Case, binary, levels, march, model, multisine, noisy, wander

NO_NAME = ("unnamed", "no_mismatch", "immaterial", "parameter")  # what may be said of physics outside the catalogue


def late(u: Array, rows: int) -> Array:
    """Return a signal that comes so many rows later."""
    return np.vstack([np.repeat(u[:1], rows, axis=0), u[: len(u) - rows]])


def dryer(rng: np.random.Generator) -> list[Case]:
    """Air that passes a tube behind a heater, in a draught (Ljung 1999, System Identification, section 17.3)."""
    u, found = 5 + binary(rng, 2400, 6, 1.4), []
    draught = wander(rng, 2400, 8, 0.06)[:, 0]
    text = model("dryer", {"t": 0.36, "g": 0.9}, {"a": ("(g*power - a)/t", 4.5)}, {"air": "a"})
    for rows in (3, 0):
        x = march(lambda x, u: ((0.9 * u[0] - x[0]) / 0.36,), [4.5], late(u, rows), 0.08)
        columns = {"power": u[:, 0], "air": x[:, 0] + draught + 0.01 * rng.standard_normal(2400)}
        found.append(Case(f"dryer{'' if rows else '_null'}", 0.08, ("power",), ("air",), columns, text,
                          ("transport_delay",) if rows else (), ("data_time_offset",),
                          {"delay_s": 0.24} if rows else {}))  # fmt: skip
    return found


def servo(rng: np.random.Generator) -> list[Case]:
    """A cylinder in a position loop behind a valve with overlap (Jelali and Kroll 2003, Hydraulic Servo-systems)."""
    found = []
    text = model("cylinder", {"kv": 0.5, "t": 0.04}, {"x": ("v", 0), "v": ("(kv*valve - v)/t", 0)}, {"stroke": "x"})
    for overlap in (0.12, 0.0):
        wanted, load = levels(rng, 3000, 50, -0.1, 0.1)[:, 0], wander(rng, 3000, 60, 0.01)[:, 0]
        u, read, state = np.zeros(3000), np.zeros(3000), np.zeros(2)
        for k in range(3000):
            read[k] = state[0] + 1e-4 * rng.standard_normal()
            u[k] = float(np.clip(12 * (wanted[k] - read[k]), -1, 1))
            flow = float(np.sign(u[k]) * max(abs(u[k]) - overlap, 0))
            at = np.array([[flow, load[k]], [flow, load[k]]])
            state = march(lambda x, u: (x[1], (0.5 * u[0] - x[1] - u[1]) / 0.04), [*state], at, 0.01)[1]
        columns = {"valve": u, "stroke": read}
        found.append(Case(f"servo{'' if overlap else '_null'}", 0.01, ("valve",), ("stroke",), columns, text,
                          ("deadband",) if overlap else (), (), {"width": 0.12} if overlap else {}))  # fmt: skip
    return found


def belt(rng: np.random.Generator) -> list[Case]:
    """Dry friction of the load of a belt drive, four recordings (Ellis 2012, Control System Design Guide)."""
    u, found = wander(rng, 3200, 25, 1.5), []
    text = model("belt", {"JM": 0.02, "JL": 0.05, "k": 40, "d": 0.1, "bm": 0.04, "bl": 0.1},
                 {"a": ("va", 0), "va": ("(torque - bm*va - k*(a - b) - d*(va - vb))/JM", 0), "b": ("vb", 0),
                  "vb": ("(k*(a - b) + d*(va - vb) - bl*vb)/JL", 0)}, {"motor": "va", "load": "vb"}, 0.9)  # fmt: skip
    for dry in (0.25, 0.0):

        def slope(x: Array, u: Array, dry: float = dry) -> Sequence[float]:
            a, va, b, vb = x
            t = 40 * (a - b) + 0.1 * (va - vb)
            return va, (u[0] - 0.04 * va - t) / 0.02, vb, (t - 0.1 * vb - dry * np.tanh(vb / 0.02)) / 0.05

        x = march(slope, [0, 0, 0, 0], u, 0.01, 40)
        columns = {"torque": u[:, 0], "motor": noisy(rng, x[:, 1], 0.01), "load": noisy(rng, x[:, 3], 0.01)}
        found.append(Case(f"belt{'' if dry else '_null'}", 0.01, ("torque",), ("motor", "load"), columns, text,
                          ("coulomb_friction",) if dry else (), ("stiction",), {"force": 0.25} if dry else {},
                          parts=4))  # fmt: skip
    return found


def multirotor(rng: np.random.Generator) -> list[Case]:
    """Climb of a quadrotor in gusts, with the rotors' lag (Mahony, Kumar and Corke 2012, IEEE Robotics Autom. 19)."""
    found = []
    text = model("climb", {"m": 1.2, "c": 0.25, "G": 9.81},
                 {"z": ("v", 0), "v": ("(thrust - c*v)/m - G", 0)}, {"height": "z", "climb": "v"}, 1.05)  # fmt: skip
    for lag in (0.12, 0.0):
        wanted, gust = levels(rng, 3000, 120, 0, 8)[:, 0], wander(rng, 3000, 25, 0.25)[:, 0]
        u, read, x = np.zeros(3000), np.zeros((3000, 2)), np.array([4.0, 0.0, 1.2 * 9.81])
        for k in range(3000):
            read[k] = x[:2] + np.array([0.02, 0.03]) * rng.standard_normal(2)
            u[k] = 1.2 * 9.81 + float(np.clip(1.5 * (wanted[k] - read[k, 0]) - 2.2 * read[k, 1], -5, 5))
            if not lag:
                x[2] = u[k]
            at = np.array([[u[k], gust[k]]] * 2)
            x = march(lambda x, u, lag=lag: (x[1], (x[2] - 0.25 * x[1] + u[1]) / 1.2 - 9.81,
                                             (u[0] - x[2]) / lag if lag else 0.0), [*x], at, 0.02)[1]  # fmt: skip
        columns = {"thrust": u, "height": read[:, 0], "climb": read[:, 1]}
        found.append(Case(f"multirotor{'' if lag else '_null'}", 0.02, ("thrust",), ("height", "climb"), columns, text,
                          ("actuator_lag",) if lag else (), (), {"tau_s": 0.12} if lag else {}))  # fmt: skip
    return found


def steering_gear(rng: np.random.Generator) -> list[Case]:
    """A ship's autopilot in waves behind a steering gear with play (Fossen 2011, Marine Craft Hydrodynamics, ch. 7)."""
    found = []
    text = model("course", {"t": 12, "k": 0.12}, {"psi": ("r", 0), "r": ("(k*rudder - r)/t", 0)}, {"heading": "psi"})
    for play in (4.0, 0.0):
        wanted = levels(rng, 3000, 150, -25, 25)[:, 0]
        waves = wander(rng, 3000, 3, 0.05)[:, 0]
        u, read, x, gear = np.zeros(3000), np.zeros(3000), np.zeros(2), 0.0
        for k in range(3000):
            read[k] = x[0] + 0.05 * rng.standard_normal()
            u[k] = float(np.clip(0.9 * (wanted[k] - read[k]) - 14 * x[1], -30, 30))
            gear = min(max(gear, u[k] - play / 2), u[k] + play / 2)
            at = np.array([[gear, waves[k]]] * 2)
            x = march(lambda x, u: (x[1], (0.12 * u[0] - x[1] + u[1]) / 12), [*x], at, 0.5)[1]
        columns = {"rudder": u, "heading": read}
        found.append(Case(f"steering_gear{'' if play else '_null'}", 0.5, ("rudder",), ("heading",), columns, text,
                          ("backlash",) if play else (), (), {"width": 4.0} if play else {}))  # fmt: skip
    return found


def ball(rng: np.random.Generator) -> list[Case]:
    """A ball on a beam whose drive is of second order (Wellstead 1979, Introduction to Physical System Modelling)."""
    found = []
    text = model("ball", {"g": 7.0, "c": 0.1}, {"x": ("v", 0), "v": ("g*angle - c*v", 0)}, {"place": "x"})
    for w in (14.0, 0.0):
        wanted = levels(rng, 2500, 100, -0.3, 0.3)[:, 0]
        u, read, x, slow = np.zeros(2500), np.zeros(2500), np.zeros(4), 0.0
        for k in range(2500):
            read[k] = x[0] + 0.001 * rng.standard_normal()
            slow += 0.25 * (read[k] - slow)
            u[k] = float(np.clip(0.25 * (wanted[k] - slow) - 0.35 * x[1] + 0.02 * rng.standard_normal(), -0.25, 0.25))
            if not w:
                x[2:] = u[k], 0
            x = march(lambda x, u, w=w: (x[1], 7 * x[2] - 0.1 * x[1], x[3], w * w * (u[0] - x[2]) - 1.2 * w * x[3]),
                      [*x], np.array([[u[k]]] * 2), 0.02)[1]  # fmt: skip
        found.append(Case(f"ball{'' if w else '_null'}", 0.02, ("angle",), ("place",), {"angle": u, "place": read},
                          text, ("actuator_second_order",) if w else (), ("actuator_lag",)))  # fmt: skip
    return found


def stand(rng: np.random.Generator) -> list[Case]:
    """Dry friction of a damper on a test stand, force over motion, three recordings (Dixon 2007, Shock Absorber)."""
    t, found = 0.004 * np.arange(2700), []
    x = 0.02 * np.sin(2 * np.pi * 0.8 * t + 3 * np.sin(0.3 * t)) + wander(rng, 2700, 60, 0.006)[:, 0]
    x = np.convolve(x, np.hanning(15) / np.hanning(15).sum(), mode="same")
    v = np.gradient(x, 0.004)
    text = model("damper", {"k": 4000, "c": 900}, {}, {"force": "k*stroke + c*rate"}, 1.1)
    for dry in (35.0, 0.0):
        force = 4000 * x + 900 * v + dry * np.tanh(v / 0.001)
        columns = {"stroke": x, "rate": v, "force": noisy(rng, force, 0.03)}
        found.append(Case(f"stand{'' if dry else '_null'}", 0.004, ("stroke", "rate"), ("force",), columns, text,
                          ("coulomb_friction",) if dry else (), ("stiction",), {"force": 35.0} if dry else {},
                          parts=3))  # fmt: skip
    return found


def flow_valve(rng: np.random.Generator) -> list[Case]:
    """A flow loop whose valve sticks until the command has left it by a band (Choudhury et al. 2005, as the tank)."""
    found = []
    text = model("flow", {"t": 4, "k": 1.4}, {"q": ("(k*valve - q)/t", 0)}, {"flow": "q"})
    for band in (0.12, 0.0):
        wanted, push = levels(rng, 3000, 80, -1, 1)[:, 0], wander(rng, 3000, 30, 0.06)[:, 0]
        u, read, q, total, stem = np.zeros(3000), np.zeros(3000), 0.0, 0.0, 0.0
        for k in range(3000):
            read[k] = q + 0.01 * rng.standard_normal()
            total += 0.03 * (wanted[k] - read[k])
            u[k] = 0.5 * (wanted[k] - read[k]) + total
            stem = float(u[k]) if abs(u[k] - stem) > band or not band else stem
            q += (1 - np.exp(-0.5 / 4)) * (1.4 * stem + push[k] - q)
        found.append(Case(f"flow_valve{'' if band else '_null'}", 0.5, ("valve",), ("flow",),
                          {"valve": u, "flow": read}, text, ("deadband",) if band else (), ("backlash",),
                          {"width": 0.12} if band else {}))  # fmt: skip
    return found


def gyroscope(rng: np.random.Generator) -> list[Case]:
    """A platform with encoder and gyroscope: one that drifts, one whose scale is off (Titterton and Weston 2004)."""
    u, t = wander(rng, 3000, 30, 1.0), 0.02 * np.arange(3000)
    x = march(lambda x, u: (x[1], (2.5 * u[0] - 0.8 * x[1] - 3 * x[0]) / 0.4), [0, 0], u, 0.02)
    text = model("platform", {"J": 0.4, "kt": 2.5, "b": 0.8, "k": 3}, {"q": ("w", 0),
                 "w": ("(kt*current - b*w - k*q)/J", 0)}, {"angle": "q", "rate": "w"}, 1.1)  # fmt: skip
    kinds: tuple[tuple[str, Array, tuple[str, ...]], ...] = (
        ("gyroscope", x[:, 1] + 0.012 * t, ("sensor_drift",)), ("gyroscope_scale", 0.9 * x[:, 1], ("sensor_scale",)),
        ("gyroscope_null", x[:, 1], ()),
    )  # fmt: skip
    return [
        Case(name, 0.02, ("current",), ("angle", "rate"),
             {"current": u[:, 0], "angle": noisy(rng, x[:, 0], 0.01), "rate": y + 0.02 * x[:, 1].std() *
              rng.standard_normal(3000)}, text, hidden,
             verdicts=("ambiguous",) if "sensor_scale" in hidden else ())  # which of two is off nobody can tell
        for name, y, hidden in kinds
    ]  # fmt: skip


def oven(rng: np.random.Generator) -> list[Case]:
    """An oven that radiates, its model does not (Incropera et al. 2007, chapter 1); no entry has this."""
    u = levels(rng, 2000, 60, 0, 900)
    x = march(lambda x, u: ((u[0] - 0.6 * (x[0] - 295) - 2.2e-9 * (x[0] ** 4 - 295**4)) / 400,), [400], u, 5.0)
    text = model("oven", {"h": 0.9, "c": 400, "T0": 295}, {"T": ("(power - h*(T - T0))/c", 400)}, {"temp": "T"}, 1.05)
    columns = {"power": u[:, 0], "temp": x[:, 0] + 0.5 * rng.standard_normal(2000)}
    return [Case("oven", 5.0, ("power",), ("temp",), columns, text, verdicts=NO_NAME)]


def cell(rng: np.random.Generator) -> list[Case]:
    """A cell whose diffusion is slow, too, the model has one time constant (Plett 2015, Battery Management, ch. 2)."""
    u = levels(rng, 3000, 40, -2, 2)
    x = march(lambda x, u: ((0.015 * u[0] - x[0]) / 20, (0.025 * u[0] - x[1]) / 300), [0, 0], u, 1.0)
    text = model("cell", {"t": 20, "r": 0.015, "r0": 0.02}, {"v": ("(r*current - v)/t", 0)},
                 {"volt": "3.7 - r0*current - v"}, 1.1)  # fmt: skip
    columns = {"current": u[:, 0], "volt": 3.7 - 0.02 * u[:, 0] - x.sum(axis=1) + 5e-4 * rng.standard_normal(3000)}
    return [Case("cell", 1.0, ("current",), ("volt",), columns, text, verdicts=NO_NAME)]


def bilinear(rng: np.random.Generator) -> list[Case]:
    """A damper that is thrice as hard to one side (Savaresi et al. 2010, chapter 2); no entry has this."""
    u = multisine(rng, 3000, 0.002, 0.05, 1.0)
    x = march(lambda x, u: (x[1], 4 * u[0] - 60 * x[0] - (1.5 + 1.5 * np.tanh(x[1] / 0.002)) * x[1] - 0.5 * x[1]),
              [0, 0], u, 0.01, held=False)  # fmt: skip
    text = model("damped", {"k": 60, "c": 2, "g": 4}, {"x": ("v", 0), "v": ("g*force - k*x - c*v", 0)}, {"y": "x"})
    columns = {"force": u[:, 0], "y": noisy(rng, x[:, 0], 0.005)}
    return [Case("bilinear", 0.01, ("force",), ("y",), columns, text, verdicts=NO_NAME)]


def axes(rng: np.random.Generator) -> list[Case]:
    """Two axes of a table, one sensor of speed turned by three degrees (Titterton and Weston 2004, chapter 8)."""
    u = np.hstack([wander(rng, 2500, 5, 1.0), wander(rng, 2500, 9, 1.0)])

    def slope(x: Array, u: Array) -> Sequence[float]:
        return x[1], 2 * u[0] - 90 * x[0] - 1.2 * x[1], x[3], 1.5 * u[1] - 50 * x[2] - 0.9 * x[3]

    x, found = march(slope, [0, 0, 0, 0], u, 0.02), []
    text = model("table", {"ka": 90, "ca": 1.2, "ga": 2, "kb": 50, "cb": 0.9, "gb": 1.5},
                 {"a": ("va", 0), "va": ("ga*left - ka*a - ca*va", 0), "b": ("vb", 0),
                  "vb": ("gb*right - kb*b - cb*vb", 0)}, {"rate_x": "va", "rate_y": "vb"}, 1.05)  # fmt: skip
    for turned in (0.052, 0.0):
        read = [noisy(rng, x[:, 1] + turned * x[:, 3], 0.01), noisy(rng, x[:, 3], 0.01)]
        columns: dict[str, Any] = {"left": u[:, 0], "right": u[:, 1], "rate_x": read[0], "rate_y": read[1]}
        found.append(Case(f"axes{'' if turned else '_null'}", 0.02, ("left", "right"), ("rate_x", "rate_y"), columns,
                          text, ("sensor_cross_axis",) if turned else (), ("missing_coupling",)))  # fmt: skip
    return found


MACHINES: tuple[Callable[[np.random.Generator], list[Case]], ...] = (
    dryer, servo, belt, multirotor, steering_gear, ball, stand, flow_valve, gyroscope, oven, cell, bilinear, axes,
)  # fmt: skip
