"""A turbine on land for ninth_author.py: rotor, tower fore and aft and to the side, pitch drive, wake, loop.

States are the rotor's speed, place and speed of the tower's top fore and aft, the same to the side, the rotor's angle,
the blades' pitch and its rate, and the pitch that the wake has settled to. What is held over a row: the demands of
pitch and torque, the gust that nobody records, and forces in kN that push fore and aft and to the side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import pi

import numpy as np
from ninth_author_aero import Loop, Machine, bent, helpers
from ninth_author_parts import Air, integrate, model_text, near, off, rates, stairs, stands, wander
from second_author_parts import known, state_space
from textbook_plants import Array

HEIGHT = {40.0: 78.0, 120.0: 150.0, 7.6: 24.0}  # of the hub, by the rotor's radius


@dataclass
class Plant:
    """Hold a turbine and how its pitch drive, its wake and its aerodynamics behave."""

    machine: Machine
    air: Air
    drive: tuple[str, float, float] = ("direct", 0.0, 0.0)  # what it is and its numbers
    wake: tuple[float, float] = (0.0, 10.0)  # overshoot and time constant
    linear: float = 0.0  # the wind about which the aerodynamics are straight, 0 where they are not
    extra: Callable[[float, Sequence[float]], tuple[float, float]] | None = (
        None  # forces in kN fore-aft and to the side
    )
    about: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Find the working point."""
        if self.linear:
            b = self.machine.trim(self.linear)
            self.about = self.machine.slopes(self.linear, b) | {"b": b, "w": self.machine.speed, "v": self.linear,
                          "q": self.machine.torque(self.machine.speed, self.linear, b),
                          "t": self.machine.thrust(self.machine.speed, self.linear, b)}  # fmt: skip

    def blades(self, x: Sequence[float], u: Sequence[float]) -> float:
        """Return the pitch in deg that the air feels."""
        b = u[0] if self.drive[0] == "direct" else x[6]
        return b + self.wake[0] * (b - x[8])

    def moved(self, x: Sequence[float], u: Sequence[float]) -> tuple[float, float]:
        """Return the slopes of the blades' pitch and of its rate."""
        kind, first, second = self.drive
        if kind == "lag":
            return (u[0] - x[6]) / first, 0.0
        if kind == "second":
            return x[7], first * first * (u[0] - x[6]) - 2 * second * first * x[7]
        if kind == "rate":
            return max(min(30 * (u[0] - x[6]), first), -first), 0.0
        return 0.0, 0.0

    def loads(self, om: float, v: float, b: float) -> tuple[float, float]:
        """Return torque and thrust of the wind."""
        m, a = self.machine, self.about
        if not a:
            return m.torque(om, v, b), m.thrust(om, v, b)
        v, b, om = v - a["v"], b - a["b"], om - a["w"]
        return (a["q"] + a["qv"] * v + a["qb"] * b + a["qw"] * om, a["t"] + a["tv"] * v + a["tb"] * b + a["tw"] * om)

    def slope(self, t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        """Return the slopes of all states."""
        m = self.machine
        q, thrust = self.loads(x[0], self.air(t) + u[2] - x[2], self.blades(x, u))
        fore, side = self.extra(t, x) if self.extra else (0.0, 0.0)
        push = 1.5 * u[1] / HEIGHT[m.radius]
        settled = u[0] if self.drive[0] == "direct" else x[6]
        return (
            (q - u[1]) / m.inertia, x[2], bent(x, 1, thrust + u[3] + fore, m, m.fore), x[4],
            bent(x, 3, push + u[4] + side, m, m.side), x[0], *self.moved(x, u), (settled - x[8]) / self.wake[1],
        )  # fmt: skip


@dataclass(frozen=True)
class Run:
    """Hold what a turbine did: states and commands at the rows, accelerations, and what the loop added to the speed."""

    x: Array
    u: Array
    fore: Array
    side: Array
    heard: Array
    wind: Array


def operated(rng: np.random.Generator, plant: Plant, rows: int, step: float, wind: float, *, shake: float = 0.8,
             service: float = 0.05, still: float = 0.03, hiss: float = 0.002, frequency: float = 0.6,
             fine: int = 4) -> Run:  # fmt: skip
    """Run a turbine in its loop while a service computer shakes pitch (deg) and torque (share of the rated one).

    `still` is the deviation of the gusts that nobody records, `hiss` the share of the rated speed that the loop hears
    as noise.
    """
    m = plant.machine
    loop = Loop(m, step, wind, frequency)
    a = rng.uniform(0, 2 * pi)
    heard = hiss * m.speed * rng.standard_normal(rows)
    unit = max(int(1 / step), 2)
    bump = shake * stairs(rng, rows, unit, 4 * unit, (-1, 0, 1))
    rated = m.rated / m.speed
    more = service * rated * stairs(rng, rows, 2 * unit, 9 * unit, (-1, -0.3, 0.5, 1))
    gust = wander(rng, rows, 0.7 / step, still)
    fore, side = wander(rng, rows, 3, 0.003 * m.mass), wander(rng, rows, 3, 0.0015 * m.mass)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        read = x[0] + heard[k]
        return loop.pitch(read, bump[k]), loop.torque(read, more[k]), gust[k], fore[k], side[k]

    b, w = loop.start, 2 * pi * m.fore
    thrust, push = m.thrust(m.speed, wind, b), 1.5 * rated / HEIGHT[m.radius]
    start = [m.speed, thrust / m.mass / w**2, 0, push / m.mass / (2 * pi * m.side) ** 2, 0, a, b, 0, b]
    x, u = integrate(plant.slope, start, rows, step, command, fine)
    slopes = rates(plant.slope, step, x, u)
    return Run(x, u, slopes[:, 2], slopes[:, 4], heard, plant.air.at)


def onshore_text(rng: np.random.Generator, machine: Machine, wind: float, most: float, *, efficiency: float = 0.94,
                 side: bool = False, generator: bool = True, aero_free: bool = True,
                 ) -> tuple[str, dict[str, float]]:  # fmt: skip
    """Return the model of a turbine in equations and its true values; masses and the geometry stand."""
    m, base = machine, machine.declared()
    true = {"Jr": m.inertia, "mt": m.mass, "ff": m.fore, "zf": m.damping, "ef": efficiency} | base
    held = {k: known(off(rng, true[k], 0.02)) for k in ("Jr", "mt")} | stands({"rad": m.radius, "rho": base["rho"]})
    loose = {k: base[k] for k in ("cm", "l0", "wl", "kb", "ca", "cb")}
    values = held | (near(rng, loose, most) if aero_free else stands(loose))
    values |= near(rng, {"ff": m.fore}, 0.015, ff="Hz") | near(rng, {"zf": m.damping, "ef": efficiency}, most)
    b, w = m.trim(wind), 2 * pi * m.fore
    fore = "ta/mt - (2*pi*ff)**2*xf - 4*pi*ff*zf*vf"
    states = {"om": ("(qa - torque)/Jr", m.speed, "rad/s"),
              "xf": ("vf", m.thrust(m.speed, wind, b) / m.mass / w**2, "m"),
              "vf": (fore, 0.0, "m/s")}  # fmt: skip
    speed = ("generator_speed", f"om*30/pi*{m.ratio!r}") if generator else ("rotor_speed", "om*30/pi")
    outputs = {speed[0]: (speed[1], "rpm"), "power": ("ef*torque*om", "kW"), "tower_top_fa_acc": (fore, "m/s^2")}
    if side:
        true |= {"fs": m.side, "zs": m.damping}
        values |= near(rng, {"fs": m.side}, 0.015, fs="Hz") | near(rng, {"zs": m.damping}, most)
        push = 1.5 * m.rated / m.speed / HEIGHT[m.radius] / m.mass / (2 * pi * m.side) ** 2
        across = f"1.5*torque/{HEIGHT[m.radius]}/mt - (2*pi*fs)**2*xs - 4*pi*fs*zs*vs"
        states |= {"xs": ("vs", push, "m"), "vs": (across, 0.0, "m/s")}
        outputs["tower_top_ss_acc"] = (across, "m/s^2")
    return model_text("rotor and tower", values, helpers(), states, outputs), true


def linear_onshore(rng: np.random.Generator, plant: Plant, most: float) -> dict[str, object]:
    """Return the linear model of a turbine about its working point: wind, pitch, torque to speed and accelerations."""
    m, a = replace(plant.machine, mass=off(rng, plant.machine.mass, 0.02)), dict(plant.about)
    for key in ("qv", "qb", "tv", "tb", "qw", "tw"):
        a[key] = off(rng, a[key], most)
    j, w, s = off(rng, m.inertia, 0.02), 2 * pi * off(rng, m.fore, 0.01), 2 * pi * off(rng, m.side, 0.01)
    lever = 1.5 / HEIGHT[m.radius] / m.mass
    big = np.array([[a["qw"] / j, 0, -a["qv"] / j, 0, 0], [0, 0, 1, 0, 0],
                    [a["tw"] / m.mass, -w * w, -2 * m.damping * w - a["tv"] / m.mass, 0, 0], [0, 0, 0, 0, 1],
                    [0, 0, 0, -s * s, -2 * m.damping * s]])  # fmt: skip
    drive = np.array([[a["qv"] / j, a["qb"] / j, -1 / j], [0, 0, 0], [a["tv"] / m.mass, a["tb"] / m.mass, 0], [0, 0, 0],
                      [0, 0, lever]])  # fmt: skip
    factor = 30 / pi * m.ratio
    c, d = np.vstack([factor * np.eye(5)[0], big[2], big[4]]), np.vstack([np.zeros(3), drive[2], drive[4]])
    speed = "generator_speed" if m.ratio > 1 else "rotor_speed"
    model = state_space(0, {"wind": "m/s", "pitch": "deg", "torque": "kN m"},
                        {speed: "rpm", "tower_top_fa_acc": "m/s^2", "tower_top_ss_acc": "m/s^2"},
                        (big, drive, c, d))  # fmt: skip
    rated = m.rated / m.speed
    for signal, value in zip(model["inputs"], (a["v"], round(a["b"], 3), round(rated, 2)), strict=True):
        signal["offset"] = value
    model["outputs"][0]["offset"] = round(m.speed * factor, 3)
    return model
