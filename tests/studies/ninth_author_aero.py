"""The aerodynamics, machines and pitch controllers of the turbines of ninth_author.py.

Power and thrust follow the tip-speed ratio lam and the pitch in deg: cp = cm (1 - ((lam - l0)/wl)^2) - kb pitch
(lam/l0)^2, ct = ca lam/l0 - cb pitch (lam/l0)^2, which is what blade elements give near the working point (Burton et
al. 2011, Wind Energy Handbook, chapter 3). Torques are in kN m, forces in kN, inertias in t m^2, masses in t.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np


@dataclass(frozen=True)
class Machine:
    """Hold the numbers of a rotor, its drive train and its tower."""

    radius: float
    inertia: float  # of rotor and generator at the slow shaft, t m2
    ratio: float  # of the gearbox
    rated: float  # power, kW
    speed: float  # rated, rad/s
    mass: float  # of the tower's first mode at the top, t
    fore: float  # Hz
    side: float  # Hz
    damping: float  # ratio of both
    cm: float = 0.46
    l0: float = 7.6
    wl: float = 6.5
    kb: float = 0.06
    ca: float = 0.80
    cb: float = 0.06
    rho: float = 1.225

    def torque(self, om: float, v: float, pitch: float) -> float:
        """Return the torque of the wind, kN m."""
        lam = om * self.radius / v
        cp = self.cm * (1 - ((lam - self.l0) / self.wl) ** 2) - self.kb * pitch * (lam / self.l0) ** 2
        return 0.5e-3 * self.rho * pi * self.radius**2 * v**3 * cp / om

    def thrust(self, om: float, v: float, pitch: float) -> float:
        """Return the thrust of the wind, kN."""
        s = om * self.radius / v / self.l0
        return 0.5e-3 * self.rho * pi * self.radius**2 * v * v * (self.ca * s - self.cb * pitch * s * s)

    def trim(self, v: float) -> float:
        """Return the pitch in deg at which the rotor turns with rated torque at rated speed in this wind."""
        lo, hi = 0.0, 40.0
        for _ in range(50):
            mid = (lo + hi) / 2
            lo, hi = (mid, hi) if self.torque(self.speed, v, mid) > self.rated / self.speed else (lo, mid)
        return lo

    def slopes(self, v: float, pitch: float) -> dict[str, float]:
        """Return the slopes of torque (q) and thrust (t) by wind (v), pitch (b) and speed (w)."""
        point, found = {"w": self.speed, "v": v, "b": pitch}, {}
        for key in point:
            up, down = dict(point), dict(point)
            up[key] += 1e-3
            down[key] -= 1e-3
            for letter, law in (("q", self.torque), ("t", self.thrust)):
                rise = law(up["w"], up["v"], up["b"]) - law(down["w"], down["v"], down["b"])
                found[letter + key] = rise / 2e-3
        return found

    def declared(self) -> dict[str, float]:
        """Return the values of the aerodynamics by the names that `helpers` uses."""
        return {"rad": self.radius, "cm": self.cm, "l0": self.l0, "wl": self.wl, "kb": self.kb, "ca": self.ca,
                "cb": self.cb, "rho": self.rho}  # fmt: skip


GEARED = Machine(40.0, 6000.0, 98.0, 2000.0, 1.80, 165.0, 0.335, 0.342, 0.006)
DIRECT = Machine(120.0, 318000.0, 1.0, 15000.0, 0.792, 1420.0, 0.172, 0.176, 0.008, cm=0.48, l0=9.0, wl=7.4)
SMALL = Machine(7.6, 3.1, 19.0, 50.0, 7.6, 3.4, 1.35, 1.38, 0.012, cm=0.42, l0=6.6, wl=5.6, kb=0.05)


def helpers(v: str = "wind - vf", speed: str = "om", pitch: str = "pitch") -> dict[str, str]:
    """Return what the equations of a rotor share: tip-speed ratio, torque in kN m, thrust in kN."""
    return {
        "vr": v,
        "lam": f"{speed}*rad/vr",
        "qa": f"0.0005*rho*pi*rad**2*vr**3*(cm*(1-((lam-l0)/wl)**2) - kb*{pitch}*(lam/l0)**2)/{speed}",
        "ta": f"0.0005*rho*pi*rad**2*vr**2*(ca*lam/l0 - cb*{pitch}*(lam/l0)**2)",
    }


@dataclass
class Loop:
    """A pitch controller with gain schedule on a speed that it hears with noise, and a torque that keeps the power."""

    machine: Machine
    step: float
    wind: float
    frequency: float = 0.6
    softness: float = 0.8
    digits: int = 2

    def __post_init__(self) -> None:
        """Place the gains where the rotor alone would have the frequency in rad/s and the damping."""
        m = self.machine
        self.total = m.trim(self.wind)
        effect = m.slopes(self.wind, self.total)["qb"]
        self.kp = -2 * self.softness * self.frequency * m.inertia / effect
        self.ki = -(self.frequency**2) * m.inertia / effect
        self.start = self.total

    def pitch(self, heard: float, shake: float = 0.0) -> float:
        """Return the next demand in deg."""
        error = heard - self.machine.speed
        less = (1 + self.start / 9) / (1 + max(self.total, 0) / 9)
        self.total += self.ki * less * error * self.step
        self.total = min(max(self.total, 0.0), 40.0)
        asked = self.total + self.kp * less * error + shake
        return round(float(np.clip(asked, -2, 40)), self.digits)

    def torque(self, heard: float, service: float = 0.0) -> float:
        """Return the next demand of torque in kN m: constant power, and what the service computer adds."""
        rated = self.machine.rated / self.machine.speed
        return float(np.clip(self.machine.rated / max(heard, 0.3), 0.8 * rated, 1.15 * rated)) + service


def bent(x: Sequence[float], first: int, force: float, machine: Machine, frequency: float) -> float:
    """Return the acceleration of a tower's mode under a force in kN; its place and speed begin at `first`."""
    w = 2 * pi * frequency
    return force / machine.mass - w * w * x[first] - 2 * machine.damping * w * x[first + 1]
