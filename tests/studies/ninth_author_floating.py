"""A turbine of 12 MW on a floating hull: rotor, surge and pitch of the platform in wind and waves.

As ninth_author_geared.py. States are the rotor's speed, surge in m and its rate, the hull's pitch in rad and its rate.
Forces are in kN, masses in t (added water included), the thrust acts 150 m above the middle (Jonkman 2010).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np
from ninth_author_aero import Loop, Machine, helpers
from ninth_author_parts import (
    LOOP,
    WT,
    Air,
    Makers,
    daq,
    integrate,
    model_text,
    near,
    off,
    paired,
    rates,
    stairs,
    stands,
    wander,
)
from second_author_parts import Case, Column, Tones, known, state_space
from textbook_plants import Array

HULL = Machine(107.0, 225000.0, 1.0, 12000.0, 0.86, 1.0, 1.0, 1.0, 0.0, cm=0.47, l0=8.6, wl=7.0)
SETTING = "blades = 3\nrated_speed_rad_s = 0.86\noffshore = true\n"
ARM = 150.0


@dataclass(frozen=True)
class Hull:
    """Hold the numbers of hull and mooring, those of the effects included, which are 0 in a model."""

    mass: float = 26000.0
    surge: float = 0.0095  # Hz
    turn: float = 4.4e7  # inertia, t m2
    roll: float = 0.036  # frequency of pitching, Hz
    drag: float = 150.0  # kN s/m
    turning: float = 9.0e5  # kN m s
    waves: float = 1500.0  # kN/m
    tilt: float = 30000.0  # kN m/m
    square: float = 0.0  # kN s2/m2
    cubic: float = 0.0  # kN/m3
    grown: float = 0.0  # share of the inertia
    straight: float = 0.0  # the wind about which the aerodynamics are straight


def sea(rng: np.random.Generator, height: float) -> Tones:
    """Return an elevation of a sea with its peak at 0.1 Hz, by its significant height."""
    return Tones.drawn(rng, 0.075, 0.16, 36, height / 4, 0.0)


@dataclass
class Afloat:
    """Hold what acts on a hull, and how it answers."""

    hull: Hull
    air: Air
    wave: Array  # sixteen values a row
    h: float

    def __post_init__(self) -> None:
        """Find the slopes of the working point where the aerodynamics are straight."""
        at = self.hull.straight
        self.trim = HULL.trim(at) if at else 0.0
        self.about = HULL.slopes(at, self.trim) if at else {}
        self.thrust = HULL.thrust(HULL.speed, at, self.trim) if at else 0.0

    def loads(self, om: float, v: float, b: float) -> tuple[float, float]:
        """Return torque and thrust, straight about a working point where there is one."""
        a = self.about
        if not a:
            return HULL.torque(om, v, b), HULL.thrust(om, v, b)
        dv, db, dw = v - self.hull.straight, b - self.trim, om - HULL.speed
        return (HULL.rated / HULL.speed + a["qv"] * dv + a["qb"] * db + a["qw"] * dw,
                self.thrust + a["tv"] * dv + a["tb"] * db + a["tw"] * dw)  # fmt: skip

    def slope(self, t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        """Return the slopes of all states."""
        k, eta = self.hull, float(self.wave[int(t / self.h + 0.5)])
        q, thrust = self.loads(x[0], self.air(t) + u[2] - x[2] - ARM * x[4], u[0])
        stiff = (2 * pi * k.surge) ** 2 * k.mass * x[1] + k.cubic * x[1] ** 3
        damp = k.drag * x[2] + k.square * x[2] * abs(x[2])
        turn = k.turn * (2 * pi * k.roll) ** 2 * x[3] + k.turning * x[4]
        return ((q - u[1]) / HULL.inertia, x[2], (thrust - stiff - damp + k.waves * eta + u[3]) / k.mass, x[4],
                (ARM * thrust - turn + k.tilt * eta) / (k.turn * (1 + k.grown)))  # fmt: skip


def floated(rng: np.random.Generator, hull: Hull, rows: int, step: float, wind: float, height: float,
            intensity: float = 0.10) -> dict[str, Column]:  # fmt: skip
    """Return what the controller's logger keeps of a floating turbine in its loop."""
    air, waves = Air(rng, rows, step, wind, intensity=intensity, rotor=107.0), sea(rng, height)
    plant = Afloat(hull, air, np.asarray(waves(np.arange(16 * rows + 40) * step / 16)), step / 16)
    loop = Loop(HULL, step, wind, 0.16, 1.0)
    unit = int(4 / step)
    shake = 1.0 * stairs(rng, rows, unit, 8 * unit, (-1, 0, 1))
    more = 0.06 * HULL.rated / HULL.speed * stairs(rng, rows, 2 * unit, 9 * unit, (-1, 0, 1))
    heard, gust, drift = 0.0015 * rng.standard_normal(rows), wander(rng, rows, 3, 0.03), wander(rng, rows, 60, 12.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return loop.pitch(x[0] + heard[k], shake[k]), loop.torque(x[0] + heard[k], more[k]), gust[k], drift[k]

    thrust = HULL.thrust(HULL.speed, wind, loop.start)
    place = thrust / hull.mass / (2 * pi * hull.surge) ** 2
    lean = ARM * thrust / hull.turn / (2 * pi * hull.roll) ** 2
    start = [HULL.speed, place + rng.uniform(-3, 3), 0.2, lean + 0.01, 0.0]
    x, u = integrate(plant.slope, start, rows, step, command, 6)
    moved = rates(plant.slope, step, x, u)
    acc = moved[:, 2] + ARM * moved[:, 4]
    return {
        "wind": (np.round(air.at, 2), "m/s", "disturbance"),
        "wave": (np.round(waves(np.arange(rows) * step), 3), "m", "disturbance"),
        "pitch": (u[:, 0], "deg", "input"), "torque": (np.round(u[:, 1], 0), "kN m", "input"),
        "rotor_speed": (daq(rng, (x[:, 0] + heard) * 30 / pi, (0, 14), 15), "rpm", "output"),
        "surge": (daq(rng, x[:, 1], (-20, 60), 13, noise=0.04, slow=0.03), "m", "output"),
        "platform_pitch": (daq(rng, np.degrees(x[:, 3]), (-15, 15), 13, noise=0.02, slow=0.01), "deg", "output"),
        "tower_top_fa_acc": (daq(rng, acc, (-5, 5), 14, noise=0.01), "m/s^2", "output")}  # fmt: skip


def hull_text(rng: np.random.Generator, wind: float, most: float) -> tuple[str, dict[str, float]]:
    """Return the model of a floating turbine in equations, and its true values."""
    k, base = Hull(), HULL.declared()
    true = {"fs": k.surge, "fp": k.roll, "ds": k.drag, "dp": k.turning, "ws": k.waves, "wp": k.tilt}
    values = {"Jr": known(off(rng, HULL.inertia, 0.02)), "ms": known(off(rng, k.mass, 0.02)),
              "ip": known(off(rng, k.turn, 0.02))} | stands({"rad": HULL.radius, "rho": 1.225, "arm": ARM})  # fmt: skip
    values |= near(rng, {n: base[n] for n in ("cm", "l0", "wl", "kb", "ca", "cb")}, most) | near(rng, true, most)
    b = HULL.trim(wind)
    thrust = HULL.thrust(HULL.speed, wind, b)
    along = "(ta - ds*vs + ws*wave)/ms - (2*pi*fs)**2*xs"
    about = "(arm*ta - dp*vp + wp*wave)/ip - (2*pi*fp)**2*xp"
    text = model_text("floating turbine", values, helpers("wind - vs - arm*vp"), {
        "om": ("(qa - torque)/Jr", HULL.speed, "rad/s"),
        "xs": ("vs", thrust / k.mass / (2 * pi * k.surge) ** 2, "m"), "vs": (along, 0.0, "m/s"),
        "xp": ("vp", ARM * thrust / k.turn / (2 * pi * k.roll) ** 2, "rad"), "vp": (about, 0.0, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "surge": ("xs", "m"), "platform_pitch": ("xp*180/pi", "deg"),
         "tower_top_fa_acc": (f"{along} + arm*({about})", "m/s^2")})  # fmt: skip
    return text, true | base | {"Jr": HULL.inertia, "ms": k.mass, "ip": k.turn, "arm": ARM}


def moored(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Twenty minutes in wind of 15 m/s and a sea of 3 m, at 2 Hz.

    Hidden: the hull's drag grows with the square of its speed, by 700 kN s2/m2, and the mooring is stiffer far out, by
    0.035 kN/m3. The complete one hides neither, in wind of 17 m/s.
    """
    rows, step, wind = (2000, 0.5, 17.0) if complete else (2600, 0.5, 15.0)
    hull = Hull() if complete else Hull(square=700.0, cubic=0.035)
    columns = floated(rng, hull, rows, step, wind, 3.0)
    text, true = hull_text(rng, wind, 0.03)
    if complete:
        return Case("null_afloat", step, columns, text, machine=WT, context=SETTING + LOOP, lost=3, true=true)
    return Case("afloat_moored", step, columns, text, ("quadratic_damping", "cubic_stiffness"), (),
                {"c2": 700.0, "k3": 0.035}, machine=WT, context=SETTING + LOOP, true=true)  # fmt: skip


def linear_hull(rng: np.random.Generator, wind: float, most: float) -> dict[str, object]:
    """Return the linear model of a floating turbine about its working point."""
    k, b0 = Hull(), HULL.trim(wind)
    a = {key: off(rng, value, most) for key, value in HULL.slopes(wind, b0).items()}
    j, m, i = HULL.inertia, off(rng, k.mass, most), off(rng, k.turn, most)
    s, p = (2 * pi * k.surge) ** 2, (2 * pi * off(rng, k.roll, 0.01)) ** 2
    big = np.array([
        [a["qw"] / j, 0, -a["qv"] / j, 0, -ARM * a["qv"] / j], [0, 0, 1, 0, 0],
        [a["tw"] / m, -s, -(a["tv"] + k.drag) / m, 0, -ARM * a["tv"] / m], [0, 0, 0, 0, 1],
        [ARM * a["tw"] / i, 0, -ARM * a["tv"] / i, -p, -(ARM**2 * a["tv"] + k.turning) / i]])  # fmt: skip
    drive = np.array([
        [a["qv"] / j, 0, a["qb"] / j, -1 / j], [0, 0, 0, 0], [a["tv"] / m, k.waves / m, a["tb"] / m, 0], [0, 0, 0, 0],
        [ARM * a["tv"] / i, off(rng, k.tilt, most) / i, ARM * a["tb"] / i, 0]])  # fmt: skip
    c = np.vstack([np.eye(5)[0] * 30 / pi, np.eye(5)[1], np.degrees(np.eye(5)[3]), big[2] + ARM * big[4]])
    d = np.vstack([np.zeros((3, 4)), drive[2] + ARM * drive[4]])
    model = state_space(0, {"wind": "m/s", "wave": "m", "pitch": "deg", "torque": "kN m"},
                        {"rotor_speed": "rpm", "surge": "m", "platform_pitch": "deg", "tower_top_fa_acc": "m/s^2"},
                        (big, drive, c, d))  # fmt: skip
    thrust = HULL.thrust(HULL.speed, wind, b0)
    points = (wind, 0.0, round(b0, 3), round(HULL.rated / HULL.speed, 1))
    for signal, value in zip(model["inputs"], points, strict=True):
        signal["offset"] = value
    lean = ARM * thrust / k.turn / (2 * pi * k.roll) ** 2
    ends = (HULL.speed * 30 / pi, thrust / k.mass / s, float(np.degrees(lean)), 0.0)
    for signal, value in zip(model["outputs"], ends, strict=True):
        signal["offset"] = round(value, 4)
    return model


def grown(rng: np.random.Generator) -> Case:
    """Linear aerodynamics and hull about 16 m/s, twenty minutes at 2 Hz in a sea of 2.5 m.

    Hidden: mussels and ballast make the hull's inertia in pitch 15 % larger than the model's.
    """
    rows, step, wind = 2400, 0.5, 16.0
    columns = floated(rng, Hull(grown=0.15, straight=wind), rows, step, wind, 2.5, 0.07)
    return Case("afloat_mussels", step, columns, linear_hull(rng, wind, 0.03), ("added_mass",), ("parameter_error",),
                {"mass_ratio": 0.15}, machine=WT, context=SETTING + LOOP)  # fmt: skip


def seaway(rng: np.random.Generator) -> Case:
    """A recording at 2 Hz held against a simulator that ran in other wind and in still water.

    Hidden: a sea of 2.2 m with its peak at 0.1 Hz; no buoy records it, and the surge is not read.
    """
    rows, step, wind, made = 2600, 0.5, 15.0, []
    for height in (0.0, 2.2):
        hull = Hull() if height else replace(Hull(), turn=4.44e7, roll=0.0362)
        columns = floated(rng, hull, rows, step, wind, height)
        made.append({k: v for k, v in columns.items() if k not in ("wave", "surge")})
    case = Case("afloat_seaway", step, made[1], {}, ("wave_load",), (), machine=WT, context=SETTING + LOOP)
    return paired(case, [made[0]])


FLOATING_MAKERS: Makers = {
    "afloat_moored": (921, moored), "afloat_mussels": (922, grown), "afloat_seaway": (923, seaway),
}  # fmt: skip
