"""Machines whose models lack a force, a lag, a play or a stop, and two that lack what no entry of the catalogue has.

Every plant is a function of a random generator that returns its case; with `complete` nothing is hidden, which is the
null in second_author_nulls.py. Sources stand beside each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from second_author_parts import (
    Case,
    Column,
    Tones,
    coloured,
    converted,
    equations,
    flips,
    free,
    free_time,
    held,
    known,
    march,
    plateaus,
    smooth,
    state_space,
)  # fmt: skip
from textbook_plants import Array, noisy


def fan(rng: np.random.Generator) -> Case:
    """A fan on a direct-current motor (Leonhard 2001, Control of Electrical Drives, chapter 1).

    Air takes a torque that grows with the square of the speed; the model has friction in proportion to it only.
    """
    rows, step, drag = 1500, 0.05, 6e-5
    u = plateaus(rng, rows, 40, 4, 22)[:, None]
    x = held(
        lambda _, x, u: ((0.12 * x[1] - 2e-3 * x[0] - drag * x[0] * abs(x[0])) / 0.02,
                         (u[0] - 0.9 * x[1] - 0.12 * x[0]) / 0.02), [40, 1.0], u, step)  # fmt: skip
    values = {"J": free(0.022, 0.005, 0.08, "kg m2"), "b": free(2.1e-3, 1e-4, 2e-2, "N m s/rad"),
              "kt": free(0.118, 0.05, 0.3), "R": free(0.92, 0.3, 3, "ohm"), "L": known(0.02)}  # fmt: skip
    text = equations("fan drive", values, {"w": ("(kt*i - b*w)/J", 40, "rad/s"),
                                           "i": ("(voltage - R*i - kt*w)/L", 1, "A")},
                     {"speed": ("w*30/pi", "rpm"), "current": ("i", "A")})  # fmt: skip
    columns = {
        "voltage": (u[:, 0], "V", "input"),
        "speed": (x[:, 0] * 30 / np.pi + 1.5 * rng.standard_normal(rows), "rpm", "output"),
        "current": (x[:, 1] + 0.03 * rng.standard_normal(rows), "A", "output"),
    }
    return Case("fan_quad", step, columns, text, ("quadratic_damping",), (), {"c2": drag}, headings=True,
                time="t [s]")  # fmt: skip


def cylinder(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A cylinder against a spring, its valve in per cent (Merritt 1967, Hydraulic Control Systems, chapter 6).

    Oil leaks past the piston in proportion to the load pressure; the model has no leak, and no entry has one.
    """
    rows, step, area, leak, oil = 1000, 0.004, 1.5e-3, 2.2e-11, 2.4e12
    u = np.clip(smooth(rng, rows, 25, 0.25), -1, 1)[:, None]
    u = np.repeat(u[::4], 4, 0)[:rows]

    def slope(_: float, x: Array, u: Array) -> Sequence[float]:
        flow = 9e-4 * u[0] - area * x[1] - leak * x[2] * 1e5
        return x[1], (area * x[2] * 1e5 - 900.0 * x[1] - 2.0e4 * x[0]) / 120.0, oil * flow / 1e5

    x = held(slope, [0, 0, 0], u, step)
    values = {"M": free(118, 60, 240, "kg"), "b": free(930, 100, 4000, "N s/m"), "K0": known(2.0e4, "N/m"),
              "AP": known(area, "m2"), "KH": free(2.3e12, 5e11, 1e13), "KQ": free(9.1e-4, 2e-4, 4e-3)}  # fmt: skip
    if complete:
        values["CL"] = free(leak * 1.02, leak / 5, leak * 5)
    lost = " - CL*p*1e5" if complete else ""
    text = equations("cylinder", values, {"s": ("v", 0, "m"), "v": ("(AP*p*1e5 - b*v - K0*s)/M", 0, "m/s"),
                                          "p": (f"KH*(KQ*valve/100 - AP*v{lost})/1e5", 0, "bar")},
                     {"stroke": ("1000*s", "mm"), "load_pressure": ("p", "bar")})  # fmt: skip
    columns = {
        "valve": (u[:, 0] * 100, "%", "input"), "stroke": (noisy(rng, x[:, 0] * 1e3, 0.01), "mm", "output"),
        "load_pressure": (converted(noisy(rng, x[:, 2], 0.01), -250, 250, 14), "bar", "output"),
    }  # fmt: skip
    return Case("null_hyd" if complete else "hyd_leak", step, columns, text, outside=not complete)


def motor(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A direct-current motor with an encoder of 4096 counts (Leonhard 2001, chapter 5).

    Its magnets hold the rotor at eight angles of a turn by 0.012 N m; the model has no such torque, nor has an entry.
    """
    rows, step, cogging, least = 1500, 0.005, 0.0 if complete else 0.012, 2 * np.pi / 4096
    u = plateaus(rng, rows, 60, -3, 3)[:, None]

    def slope(_: float, x: Array, u: Array) -> Sequence[float]:
        driving = 0.05 * (u[0] - 0.05 * x[1]) / 1.2
        return x[1], (driving - 1.5e-3 * x[1] - cogging * np.sin(8 * x[0])) / 4e-4

    x = held(slope, [0, 0], u, step)
    values = {"J": free(4.1e-4, 1e-4, 2e-3, "kg m2"), "b": free(1.45e-3, 1e-4, 1e-2, "N m s/rad"), "kt": known(0.05),
              "R": free(1.23, 0.4, 4, "ohm")}  # fmt: skip
    text = equations("dc motor", values, {"th": ("w", 0, "rad"), "w": ("(kt*(u - kt*w)/R - b*w)/J", 0, "rad/s")},
                     {"angle": ("th", "rad"), "current": ("(u - kt*w)/R", "A")})  # fmt: skip
    current = (u[:, 0] - 0.05 * x[:, 1]) / 1.2 + 0.01 * rng.standard_normal(rows)
    columns = {"u": (u[:, 0], "V", "input"), "angle": (np.round(x[:, 0] / least) * least, "rad", "output"),
               "current": (current, "A", "output")}  # fmt: skip
    return Case("null_motor" if complete else "dc_cogging", step, columns, text, outside=not complete)


def crane(rng: np.random.Generator) -> Case:
    """Sway of a load below a trolley (Abdel-Rahman, Nayfeh and Masoud 2003, J. Vib. Control 9).

    The rope gets longer from 4 to 5.2 m between 50 and 51 s, stiffness and gain change; the model has one length.
    """
    rows, step = 1600, 0.05
    u = plateaus(rng, rows, 50, -0.5, 0.5)[:, None]

    def slope(t: float, x: Array, u: Array) -> Sequence[float]:
        rope = 4.0 if t < 50 else (4 + 1.2 * (t - 50) if t < 51 else 5.2)
        return x[1], -9.81 / rope * np.sin(x[0]) - u[0] / rope * np.cos(x[0]) - 0.05 * x[1]

    x = held(slope, [0, 0], u, step)
    text = equations("crane sway", {"L": free(4.1, 2, 9, "m"), "c": free(0.05, 0.005, 0.5, "1/s")},
                     {"phi": ("om", 0, "rad"), "om": ("-9.81/L*sin(phi) - trolley/L*cos(phi) - c*om", 0, "rad/s")},
                     {"sway": ("phi*180/pi", "deg")})  # fmt: skip
    columns = {"trolley": (u[:, 0], "m/s2", "input"),
               "sway": (x[:, 0] * 180 / np.pi + 0.05 * rng.standard_normal(rows), "deg", "output")}  # fmt: skip
    return Case("crane_length", step, columns, text, ("stiffness_change",), headings=True)


def vehicle(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A car on slopes that are known (Gillespie 1992, Fundamentals of Vehicle Dynamics, chapter 4).

    The drag of the air grows with the square of the speed; the model has rolling resistance only. The null has the
    drag, but a converter of 12 bits that ends at 250 km/h, coloured noise, three recordings, lost rows and a gap.
    """
    rows, step, mass = 1800 if complete else 900, 0.2, 1450.0
    hills = Tones.drawn(rng, 0.003, 0.05, 12, 1.6, 0.0)
    u = plateaus(rng, rows, 60, 5, 75)

    def slope(t: float, x: Array, u: Array) -> Sequence[float]:
        resistance = 190.0 + 8 * x[0] + 0.42 * x[0] ** 2
        return ((60.0 * u[0] - resistance - mass * 9.81 * hills(t) / 100) / mass,)

    speed = march(slope, [15.0], rows, step, lambda k, _: u[k : k + 1], rtol=1e-9, atol=1e-9)[0][:, 0] * 3.6
    values = {"M": free(1480, 800, 3000, "kg"), "F": free(59, 20, 200, "N"), "c0": free(195, 20, 900, "N"),
              "c1": free(8, 1, 80, "N s/m")}  # fmt: skip
    if complete:
        values["cw"] = free(0.43, 0.1, 2)
    drag = " - cw*v*v" if complete else ""
    text = equations("car", values, {"v": (f"(F*throttle - c0 - c1*v{drag} - M*9.81*slope/100)/M", 15, "m/s")},
                     {"speed": ("3.6*v", "km/h")})  # fmt: skip
    read = noisy(rng, speed, 0.004)
    if complete:
        read = converted(coloured(rng, speed, 0.006, 6), 0, 250, 12)
    columns = {"throttle": (u, "%", "input"), "slope": (hills(np.arange(rows) * step), "%", "disturbance"),
               "speed": (read, "km/h", "output")}  # fmt: skip
    if complete:  # where the converter ends, the value stands still: a fault of the recording is the truth, too
        return Case("null_vehicle", step, columns, text, verdicts=("data_fault",), cuts=(600, 1200), lost=9,
                    gap=(200, 225))  # fmt: skip
    return Case("vehicle_drag", step, columns, text, ("quadratic_damping",), (), {"c2": 0.42})


def magnet(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A ball under a magnet, held by a loop (Sinha 1987, Electromagnetic Suspension).

    The current follows its command with 4 ms; the model has it at once. The null has it at once, too, but reads the gap
    0.4 of a sample late, with 16 bits.
    """
    rows, step, lag, weight = 1000 if complete else 1200, 0.001, 0.004, 9.81
    pull = 0.08 * weight * 0.008**2 / 1.0**2  # N m2/A2
    wanted, dither = 0.008 + 0.0009 * smooth(rng, rows, 60, 1), flips(rng, rows, 5, 0.05)

    def command(k: int, x: Array) -> Sequence[float]:
        read = x[0] + 1e-6 * rng.standard_normal()
        return (1.0 + 340 * (read - wanted[k]) + 9.0 * x[1] + dither[k],)

    def slope(_: float, x: Array, u: Array) -> Sequence[float]:
        current = u[0] if complete else x[2]
        follows = (u[0] - x[2]) / (1 if complete else lag)
        return x[1], weight - pull / 0.08 * (current / x[0]) ** 2 - 0.4 * x[1], follows

    x, u = march(slope, [0.008, 0, 1.0], rows, step, command, rtol=1e-9, atol=1e-12)
    y, k = x[:, 0] * 1e3, np.arange(rows)
    if complete:
        y = np.interp(k + 0.4, k, y)
    y = y + 0.003 * rng.standard_normal(rows)
    c = pull / 0.08
    values = {"C": free(c * 0.98, c / 4, c * 4), "c": free(0.41, 0.01, 10, "1/s"), "G": known(9.81)}
    text = equations("magnetic levitation", values, {"z": ("v", 0.008, "m"),
                     "v": ("G - C*(coil/z)**2 - c*v", 0, "m/s")}, {"gap": ("1000*z", "mm")})  # fmt: skip
    columns = {"coil": (u[:, 0], "A", "input"), "gap": (converted(y, 0, 20, 16) if complete else y, "mm", "output")}
    if complete:
        return Case("null_maglev", step, columns, text, context="closed_loop = true\n")
    return Case("maglev_lag", step, columns, text, ("actuator_lag",), ("sensor_lag",), {"tau_s": lag},
                context="closed_loop = true\n")  # fmt: skip


def antenna(rng: np.random.Generator) -> Case:
    """A dish behind an elastic gear in a loop (Gawronski 2008, Modeling and Control of Antennas and Telescopes).

    The teeth have a play of a quarter of a degree to either side, within which neither spring nor damper acts; the
    model has none. Encoders have 14 bits; the binary signal on the loop's torque is the same for every generator.
    """
    rows, step, gap, least = 1500, 0.01, float(np.radians(0.25)), 360 / 2**14
    wanted = np.radians(plateaus(rng, rows, 150, -6, 6))
    dither = flips(np.random.default_rng(99), rows, 7, 2.5)

    def command(k: int, x: Array) -> Sequence[float]:
        return (np.clip(60 * (wanted[k] - x[0]) - 14 * x[2], -12, 12) + dither[k],)

    def slope(_: float, x: Array, u: Array) -> Sequence[float]:
        twist = x[0] - x[1]
        touching = twist - np.clip(twist, -gap, gap)
        torque = 900.0 * touching + 4.0 * (x[2] - x[3]) * (1.0 if touching != 0 else 0.0)
        return x[2], x[3], (u[0] - torque - 1.2 * x[2]) / 0.8, (torque - 2.0 * x[3]) / 2.4

    x, u = march(slope, [0, 0, 0, 0], rows, step, command, rtol=1e-7, atol=1e-9, max_step=step / 4)
    values = {"J1": free(0.82, 0.2, 3, "kg m2"), "J2": free(2.35, 0.6, 10, "kg m2"),
              "k": free(910, 200, 4000, "N m/rad"), "c": free(4.1, 0.2, 40, "N m s/rad"),
              "b1": free(1.2, 0.1, 10), "b2": free(2.0, 0.1, 10)}  # fmt: skip
    text = equations("antenna drive", values,
                     {"q1": ("w1", 0, "rad"), "q2": ("w2", 0, "rad"),
                      "w1": ("(u - k*(q1-q2) - c*(w1-w2) - b1*w1)/J1", 0, "rad/s"),
                      "w2": ("(k*(q1-q2) + c*(w1-w2) - b2*w2)/J2", 0, "rad/s")},
                     {"motor_angle": ("q1*180/pi", "deg"), "dish_angle": ("q2*180/pi", "deg")})  # fmt: skip
    angles = np.round(np.degrees(x[:, :2]) / least) * least
    columns = {"u": (u[:, 0], "N m", "input"), "motor_angle": (angles[:, 0], "deg", "output"),
               "dish_angle": (angles[:, 1], "deg", "output")}  # fmt: skip
    return Case("antenna_backlash", step, columns, text, ("clearance",), (), {"half_gap": gap},
                context="closed_loop = true\n")  # fmt: skip


def isolator(rng: np.random.Generator) -> Case:
    """A mass on soft mounts that reach rubber stops 12 mm to either side (Rivin 2003, Passive Vibration Isolation).

    The model has mounts without stops.
    """
    rows, step, natural, stop = 1500, 0.004, 2 * np.pi * 3, 0.012
    base = Tones.drawn(rng, 1.0, 12, 24, 4.5, 0.0)

    def force(q: float, v: float) -> float:
        stops = max(q - stop, 0) + min(q + stop, 0)
        return -(natural**2) * q - 2 * 0.08 * natural * v - 3e4 / 40.0 * stops

    x = free_time(lambda t, x: (x[1], force(x[0], x[1]) - base(t)), [0, 0], rows, step, step / 2)
    text = equations("vibration isolator", {"w0": free(19.2, 8, 50, "rad/s"), "z": free(0.082, 0.01, 0.5)},
                     {"q": ("v", 0, "m"), "v": ("-w0*w0*q - 2*z*w0*v - base", 0, "m/s")},
                     {"stroke": ("1000*q", "mm"), "acceleration": ("-w0*w0*q - 2*z*w0*v", "m/s2")})  # fmt: skip
    acceleration = np.array([force(q, v) for q, v in x])
    columns = {
        "base": (base(np.arange(rows) * step), "m/s2", "input"),
        "stroke": (noisy(rng, x[:, 0] * 1e3, 0.01), "mm", "output"),
        "acceleration": (noisy(rng, acceleration, 0.01), "m/s2", "output"),
    }  # fmt: skip
    return Case("isolator_stops", step, columns, text, ("end_stop",), (), {"high_stop": stop, "low_stop": -stop})


def damper(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A damper on a test stand that sweeps from 0.3 to 5 Hz, force over motion (Dixon 2007, Shock Absorber Handbook).

    Dry friction of 0.75 kN opposes the motion; the model has spring, damper and preload. The null's has no friction.
    """
    rows, step, dry = 1000 if complete else 1200, 0.005, 0 if complete else 0.75
    t = np.arange(rows) * step
    phase = 2 * np.pi * (0.3 * t + (5 - 0.3) / (2 * rows * step) * t**2)
    x = 22 * (1 - 0.5 * t / (rows * step)) * np.sin(phase) + 6 * np.sin(2 * np.pi * 0.21 * t)
    v = np.gradient(x, step)
    force = 0.045 * x + 0.0062 * v + dry * np.tanh(v / 2.0) + 0.4
    read = coloured(rng, force, 0.02, 4) if complete else noisy(rng, force, 0.02)
    values = {
        "k": free(0.044, 0.005, 0.3, "kN/mm"),
        "c": free(0.0063, 5e-4, 0.05, "kN s/mm"),
        "f0": free(0.4, -3, 3, "kN"),
    }
    text = equations("damper", values, {}, {"force": ("k*position + c*velocity + f0", "kN")})
    columns: dict[str, Column] = {"position": (x, "mm", "input"), "velocity": (v, "mm/s", "input"),
                                  "force": (read, "kN", "output")}  # fmt: skip
    if complete:
        return Case("null_damper", step, columns, text)
    return Case("damper_friction", step, columns, text, ("coulomb_friction",), (), {"force_kN": dry})


def beam(rng: np.random.Generator) -> Case:
    """A beam with a strip at its tip (Worden and Tomlinson 2001, Nonlinearity in Structural Dynamics).

    The strip pulls with the cube of the tip's deflection; the model has two linear modes. A shaker sweeps
    from 3 to 45 Hz.
    """
    rows, step, cubic = 6000, 0.002, 4.0e5
    natural, ratio, mass = 2 * np.pi * np.array([8.0, 37.0]), np.array([0.012, 0.015]), np.array([1.2, 0.7])
    at_tip, at_middle = np.array([1.0, -0.8]), np.array([0.4, 0.9])

    def shaker(t: float | NDArray[Any]) -> Any:
        return 6 * np.sin(2 * np.pi * (3 * t + (45 - 3) / (2 * rows * step) * t**2))

    def slope(t: float, x: Array) -> Any:
        q, v = x[:2], x[2:]
        force = shaker(t) * 1.0 - cubic * (at_tip @ q) ** 3
        return np.r_[v, -(natural**2) * q - 2 * ratio * natural * v + at_tip * force / mass]

    x, t = free_time(slope, [0, 0, 0, 0], rows, step, step), np.arange(rows) * step
    acceleration = np.array([at_middle @ slope(at, row)[2:] for at, row in zip(t, x, strict=True)])
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag(natural**2), -np.diag(2 * ratio * natural)]])
    b = np.r_[np.zeros(2), at_tip / mass][:, None]
    c = np.vstack([np.r_[at_tip * 1e3, 0, 0], at_middle @ a[2:]])
    d = np.array([[0], [at_middle @ b[2:, 0]]])
    model = state_space(0, {"shaker": "N"}, {"tip": "mm", "mid_acceleration": "m/s2"}, [a, b, c, d])
    columns = {
        "shaker": (np.asarray(shaker(t)), "N", "input"),
        "tip": (noisy(rng, x[:, :2] @ at_tip * 1e3, 0.01), "mm", "output"),
        "mid_acceleration": (noisy(rng, acceleration, 0.01), "m/s2", "output"),
    }  # fmt: skip
    # told over the mass of the first mode, its deflection in mm
    return Case("beam_cubic", step, columns, model, ("cubic_stiffness",), (), {"k3": cubic / mass[0] * 1e-6})


PLANTS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "fan_quad": (3, fan), "hyd_leak": (5, cylinder), "dc_cogging": (6, motor), "crane_length": (7, crane),
    "vehicle_drag": (8, vehicle), "maglev_lag": (13, magnet), "antenna_backlash": (15, antenna),
    "isolator_stops": (16, isolator), "damper_friction": (17, damper), "beam_cubic": (18, beam),
}  # fmt: skip
