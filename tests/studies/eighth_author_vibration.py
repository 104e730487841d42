"""Circuits, structures, wings, buildings, wave chambers and stages after public recordings; something is left out.

As eighth_author_heat.py. Signals of shakers and of the ground are analogue and sampled, those of converters are held.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi

import numpy as np
from eighth_author_parts import Makers, each, harmonics, quake
from scipy.interpolate import CubicSpline
from second_author_parts import Case, Column, equations, plateaus, state_space
from sixth_author_parts import declared, fixed, gust, logged, modes, skewed
from textbook_plants import Array
from third_author_parts import looked_up, rk, told

Push = Callable[[float], float]


def circuit(rng: np.random.Generator, *, size: float = 2.0) -> Case:
    """An electronic circuit that swings like a mass on a spring (Wigren and Schoukens 2013, Silverbox benchmark).

    Hidden: its spring hardens, at 0.2 V by a twelfth. Noise that grows and a multisine, held at 610 Hz in one
    recording; the model is linear, its gain and frequency up to 1 % off.
    """
    name, rows, step, w = "swinging_circuit", 9000, 1 / 610.35, 2 * pi * 68.0
    grown = np.linspace(0.001, 0.03, 6000) * rng.standard_normal(6000)
    tone = harmonics(rng, 5, 200, 610.35 / 1024, 0.018)
    volts = np.round(np.concatenate([grown, tone(np.arange(3000) * step)]), 5)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], w * w * (u[0] - x[0] - size * x[0] ** 3) - 0.1 * w * x[1]

    x, _ = rk(slope, [0, 0], rows, step, told(volts), 6)
    gain, speed = skewed(rng, 1.0, 0.01), skewed(rng, w, 0.003)
    a, b = np.array([[0, 1], [-speed * speed, -0.1 * w]]), np.array([[0], [gain * w * w]])
    model = state_space(0, {"drive": "V"}, {"swing": "V"}, (a, b, np.array([[1.0, 0.0]]), np.zeros((1, 1))))
    read = x[:, 0] + 8e-4 * rng.standard_normal(rows)
    columns: dict[str, Column] = {"drive": (volts, "V", "input"),
                                  "swing": (np.round(read / 1e-4) * 1e-4, "V", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("cubic_stiffness",), ())


def frame(rng: np.random.Generator, *, size: float = 5.0) -> Case:
    """A steel frame whose bolted joints slip (Noël and Schoukens 2016, Bouc-Wen benchmark), of one degree of freedom.

    Hidden: the joints give up to 5 N over 0.6 mm, with round shoulders. Multisines of two levels at 400 Hz; the force
    is analogue and sampled, the floor's tremor is not.
    """
    name, rows, step, fine, gone = "slipping_frame", 4800, 1 / 400, 5, 0.6e-3
    loud, soft = harmonics(rng, 4, 160, 400 / 2048, 24.0, every=2), harmonics(rng, 4, 160, 400 / 2048, 9.0, every=2)
    parts, tremor = [], gust(rng, rows, 3, 0.2)
    for tone, begin in ((loud, 0), (soft, 2400)):
        force = looked_up(tone, 2400, step, fine)

        def slope(
            t: float, x: Sequence[float], u: Sequence[float], force: Callable[[float], float] = force
        ) -> Sequence[float]:
            v, z = x[1], x[2]
            pull = force(t) + u[0] - 3.1e4 * x[0] - 9.5 * v - size * z
            return v, pull / 1.4, (v - abs(v) * z / 2 - v * abs(z) / 2) / gone

        parts.append(rk(slope, [0, 0, 0], 2400, step, told(tremor[begin : begin + 2400]), fine)[0])
    x, t = np.vstack(parts), np.arange(2400) * step
    true = {"mf": 1.4, "kf": 31.0, "cf": 9.5}
    values = {"mf": fixed(rng, 1.4, "kg", 0.01)} | declared(rng, {"kf": 31.0, "cf": 9.5}, 0.05, kf="kN/m", cf="N s/m")
    text = equations("steel frame", values, {
        "q": ("v", 0, "m"), "v": ("(force - 1000*kf*q - cf*v)/mf", 0, "m/s")}, {"sway": ("1000*q", "mm")})  # fmt: skip
    columns: dict[str, Column] = {
        "force": (np.round(np.concatenate([loud(t), soft(t)]), 3), "N", "input"),
        "sway": (logged(rng, 1e3 * x[:, 0], 0.01, ends=(-8, 8), bits=14), "mm", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("bouc_wen_hysteresis",), ("play_hysteresis",), {"force_N": size},
                cuts=(2400,), true=true)  # fmt: skip


def arm(rng: np.random.Generator, *, size: float = 0.30) -> Case:
    """A flexible robot arm on a motor (after the robot arm of De Moor 1997, DaISy), its model linear.

    Hidden: a third bending mode at 17.5 Hz; the model has those at 4.2 and 10.6 Hz. Strain gauges at the root and the
    middle; a multisine of torque, held, 1024 rows at 100 Hz and another 1024 in a second recording.
    """
    name, rows, step = "flexible_arm", 2048, 0.01
    tone = harmonics(rng, 3, 250, 100 / 1024, 1.2)
    torque, bumps = np.round(tone(np.arange(rows) * step), 3), gust(rng, rows, 3, 0.02)
    w, z = 2 * pi * np.array([4.2, 10.6, 17.5]), np.array([0.03, 0.025, 0.02])
    seen = np.array([[220.0, 310.0, 620.0 * size], [150.0, -240.0, 900.0 * size]])

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        q, v = np.asarray(x[:3]), np.asarray(x[3:])
        return [*x[3:], *(u[0] + u[1] - w * w * q - 2 * z * w * v).tolist()]

    x, _ = rk(slope, [0] * 6, rows, step, told(np.c_[torque, bumps]), 6)
    y = x[:, :3] @ seen.T
    drive = np.array([[skewed(rng, 1, 0.03)], [skewed(rng, 1, 0.03)]])
    ways = {"torque": "N m"}, {"root": "um/m", "middle": "um/m"}
    model = state_space(
        0, *ways, modes(each(rng, w[:2].tolist(), 0.003), each(rng, z[:2].tolist(), 0.06), drive, seen[:, :2])
    )
    top = float(np.ceil(1.5 * np.abs(y).max()))
    columns: dict[str, Column] = {
        "torque": (torque, "N m", "input"),
        "root": (logged(rng, y[:, 0], 0.02, ends=(-top, top), bits=14), "um/m", "output"),
        "middle": (logged(rng, y[:, 1], 0.02, ends=(-top, top), bits=14), "um/m", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("structural_mode",), (), {"frequency_hz": 17.5}, cuts=(1024,))


def wing(rng: np.random.Generator, *, size: float = -0.022) -> Case:
    """A wing on springs that plunges and pitches in a tunnel (Waszak 1996, the BACT rig), its model linear.

    Hidden: at 24 s the tunnel's fan is set higher, and the damping ratio of plunge falls from 0.05 to 0.028. The flap
    follows a multisine, the tunnel's turbulence is not recorded; one recording.
    """
    name, rows, step, fine, when = "wing_tunnel", 3000, 0.02, 5, 24.0
    tone = harmonics(rng, 20, 360, 1 / 60, 1.6, every=3)
    flap, air = looked_up(tone, rows, step, fine), np.c_[gust(rng, rows, 4, 0.12), gust(rng, rows, 4, 0.12)]
    w, z = 2 * pi * np.array([2.1, 3.6]), np.array([0.05, 0.06])
    drive, seen = np.array([[14.0], [-9.0]]), np.array([[10.0, 3.0], [-2.0, 12.0]])

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        f, less = flap(t), z[0] + size * (t >= when)
        return (x[2], x[3], 14 * (f + u[0]) - w[0] ** 2 * x[0] - 2 * less * w[0] * x[2],
                -9 * (f + u[1]) - w[1] ** 2 * x[1] - 2 * z[1] * w[1] * x[3])  # fmt: skip

    x, _ = rk(slope, [0] * 4, rows, step, told(air), fine)
    y = x[:, :2] @ seen.T
    wrong = np.array([[skewed(rng, 1, 0.03)], [skewed(rng, 1, 0.03)]])
    model = state_space(
        0, {"flap": "deg"}, {"plunge": "mm", "pitch": "mrad"}, modes(w.tolist(), z.tolist(), drive * wrong, seen)
    )
    columns: dict[str, Column] = {
        "flap": (np.round(tone(np.arange(rows) * step), 3), "deg", "input"),
        "plunge": (logged(rng, y[:, 0], 0.02, ends=(-64, 64), bits=13), "mm", "output"),
        "pitch": (logged(rng, y[:, 1], 0.02, lag=2, ends=(-64, 64), bits=13), "mrad", "output")}  # fmt: skip
    return Case(name, step, columns, model, ("damping_change",), (), {"time_s": when})


def storeys(w: Sequence[float], z: Sequence[float]) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D of two modes of a building, driven by the ground, seen by accelerometers on two floors."""
    shape, share = np.array([[0.55, -0.95], [1.0, 0.6]]), np.array([[1.25], [0.35]])
    a, b, _, _ = modes(w, z, -share, shape)
    return a, b, shape @ a[2:], np.zeros((2, 1))


def building(rng: np.random.Generator, *, size: float = -0.05) -> Case:
    """A building of two storeys on a shaking table (after the benchmark of Johnson et al. 2004, ASCE), linear model.

    Hidden: the main shock cracks its joints at 20 s, and the first mode loses 5 % of its stiffness. The floors'
    accelerations beside the table's are recorded; the table is analogue and sampled. One recording.
    """
    name, rows, step, fine, when = "cracked_frame", 4000, 0.02, 5, 20.0
    ground = quake(rng, rows, step, ((8, 9, 2.4), (34, 7, 1.0), (55, 6, 1.3)))
    move, tremor = (
        CubicSpline(np.arange(rows) * step, ground),
        np.c_[gust(rng, rows, 4, 0.006), gust(rng, rows, 4, 0.006)],
    )
    table = np.asarray(move(np.arange(2 * fine * rows + 2) * step / fine / 2)).tolist()
    w, z = 2 * pi * np.array([1.6, 4.3]), np.array([0.03, 0.035])

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        g, soft = table[int(t * 2 * fine / step + 0.5)], 1 + size * (t >= when)
        return (x[2], x[3], -1.25 * g + u[0] - soft * w[0] ** 2 * x[0] - 2 * z[0] * w[0] * x[2],
                -0.35 * g + u[1] - w[1] ** 2 * x[1] - 2 * z[1] * w[1] * x[3])  # fmt: skip

    x, _ = rk(slope, [0] * 4, rows, step, told(tremor), fine)
    first = -(1 + size * (np.arange(rows) * step >= when)) * w[0] ** 2 * x[:, 0] - 2 * z[0] * w[0] * x[:, 2]
    second = -(w[1] ** 2) * x[:, 1] - 2 * z[1] * w[1] * x[:, 3]
    floors = np.c_[0.55 * first - 0.95 * second, first + 0.6 * second]
    model = state_space(0, {"ground": "m/s2"}, {"floor1": "m/s2", "floor2": "m/s2"},
                        storeys(each(rng, w.tolist(), 0.004), each(rng, z.tolist(), 0.08)))  # fmt: skip
    columns: dict[str, Column] = {"ground": (np.round(ground, 4), "m/s2", "input")}
    columns |= {
        f"floor{k + 1}": (logged(rng, floors[:, k], 0.02, ends=(-20, 20), bits=14), "m/s2", "output") for k in (0, 1)
    }
    return Case(name, step, columns, model, ("stiffness_change",), (), {"stiffness_change": size, "time_s": when})


def chamber(rng: np.random.Generator, *, size: float = 70.0) -> Case:
    """Water in the chamber of a small wave power plant, moved by a blower (Falcão 2010, oscillating water columns).

    Hidden: the water sheds eddies at the chamber's lip and is braked by 70 N at 1 m/s, with its speed squared. The
    pressure above it is analogue and sampled; a gauge reads the level. Three recordings, each louder than the last;
    ripples are not recorded.
    """
    name, rows, step, fine = "wave_chamber", 900, 0.04, 6
    tones = [harmonics(rng, 8, 60, 1 / 54, rms, every=2) for rms in (60.0, 150.0, 330.0)]
    ripples, parts = gust(rng, 3 * rows, 6, 0.8), []
    for k, tone in enumerate(tones):
        press = looked_up(tone, rows, step, fine)

        def slope(t: float, x: Sequence[float], u: Sequence[float], press: Push = press) -> Sequence[float]:
            v = x[1]
            return v, (0.12 * press(t) + u[0] - 1177 * x[0] - 14 * v - size * v * abs(v)) / 78

        parts.append(rk(slope, [0, 0], rows, step, told(ripples[k * rows : (k + 1) * rows]), fine)[0])
    x, pressure = np.vstack(parts), np.concatenate([tone(np.arange(rows) * step) for tone in tones])
    true = {"mw": 78.0, "aw": 0.12, "kw": 1177.0, "cw": 14.0}
    values = {"mw": fixed(rng, 78.0, "kg", 0.02), "aw": fixed(rng, 0.12, "m2", 0.01)} | declared(
        rng, {"kw": 1177.0, "cw": 14.0}, 0.06, kw="N/m", cw="N s/m")  # fmt: skip
    text = equations("water column", values, {
        "q": ("v", 0, "m"), "v": ("(aw*pressure - kw*q - cw*v)/mw", 0, "m/s")},
        {"level": ("1000*q", "mm")})  # fmt: skip
    columns: dict[str, Column] = {
        "pressure": (np.round(pressure, 1), "Pa", "input"),
        "level": (logged(rng, 1e3 * x[:, 0], 0.02, lag=2, ends=(-400, 400), bits=12), "mm", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("quadratic_damping",), (), {"c2": size}, cuts=(900, 1800), true=true)


def stage(rng: np.random.Generator, *, size: float = 0.04) -> Case:
    """A positioning stage on a lever that a piezo moves (Devasia et al. 2007, IEEE Trans. Control Syst. Techn. 15).

    Not in the model, and no entry: the ceramic creeps after each step for tenths of a second to a minute. Voltage is
    held at 200 Hz, a strain gauge reads the place; two recordings of 10 s.
    """
    name, rows, step, w = "piezo_creep", 4000, 0.005, 2 * pi * 16.0
    volts, tremor = np.round(plateaus(rng, rows, 180, -40, 40), 2), gust(rng, rows, 4, 0.02)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        given = u[0] + size * sum(x[2:])
        return (x[1], w * w * (0.31 * given + 0.1 * u[1] - x[0]) - 0.11 * w * x[1],
                *((u[0] - c) / tau for c, tau in zip(x[2:], (0.2, 1.6, 13.0), strict=True)))  # fmt: skip

    x, _ = rk(slope, [0.31 * volts[0], 0, 0, 0, 0], rows, step, told(np.c_[volts, tremor]), 8)
    true = {"kp": 0.31, "fs": 16.0, "zs": 0.055}
    text = equations("piezo stage", declared(rng, true, 0.05, kp="um/V", fs="Hz"), {
        "q": ("v", 0.31 * volts[0], "um"),
        "v": ("(2*pi*fs)**2*(kp*volts - q) - 2*zs*2*pi*fs*v", 0, "um/s")}, {"place": ("q", "um")})  # fmt: skip
    columns: dict[str, Column] = {
        "volts": (volts, "V", "input"),
        "place": (logged(rng, x[:, 0], 0.006, ends=(-25, 25), bits=14), "um", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, cuts=(2000,), true=true)


VIBRATION: Makers = {
    "swinging_circuit": (616, circuit), "slipping_frame": (617, frame), "flexible_arm": (618, arm),
    "wing_tunnel": (619, wing), "cracked_frame": (620, building), "wave_chamber": (621, chamber),
    "piezo_creep": (622, stage),
}  # fmt: skip
