"""Hammer mills and pneumatic slides with two effects at once.

As seventh_author_rotors.py. The other pairs stand in seventh_author_flows.py, _heat.py and _vehicles.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi, tanh

import numpy as np
from second_author_parts import Case, Column, equations, flips, known, plateaus
from seventh_author_parts import begun, started
from sixth_author_parts import LOOP, declared, fixed, gust, logged
from third_author_parts import rk, told


def crusher(rng: np.random.Generator) -> Case:
    """A hammer mill for scrap on a converter (Schubert and Bernotat 2004, Int. J. Miner. Process. 74), from rest.

    Hidden: the converter gives 98 A at most, whatever is asked for, and the tacho's filter follows with 0.35 s. Three
    recordings of 400 rows begin at rest; the feeder is recorded, single pieces of scrap are not.
    """
    name, lengths, step, most, tau = "hammer_mill", (400,) * 3, 0.1, 98.0, 0.35
    rows = sum(lengths)
    feed, scrap = plateaus(rng, rows, 30, 0.5, 3.0), gust(rng, rows, 4, 5.0)
    wanted, shake = plateaus(rng, rows, 60, 40, 75), flips(rng, rows, 9, 9.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[1]
        return max(min(3.2 * error + x[2] + shake[k], 110), -110), feed[k], scrap[k], error

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        torque = 5.2 * min(u[0], most) - (40 * u[1] + 2.1 * x[0]) * tanh(x[0] / 2)
        return (torque + u[2]) / 24, (x[0] - x[1]) / tau, 0.8 * u[3]

    x, u = started(slope, [0, 0, 30], lengths, step, command, 8)
    true = {"Jh": 24.0, "kt": 5.2, "kf": 40.0, "bh": 2.1}
    free = declared(rng, {k: true[k] for k in ("kf", "bh")}, 0.08, kf="N m h/t", bh="N m s")
    values = {"Jh": fixed(rng, 24.0, "kg m2", 0.02), "kt": known(5.2, "N m/A")} | free
    text = equations("hammer mill", values, {
        "w": ("(kt*current - (kf*feed + bh*w)*tanh(w/2))/Jh", 0, "rad/s")}, {"speed": ("w*30/pi", "rpm")})  # fmt: skip
    columns: dict[str, Column] = {
        "current": (np.round(u[:, 0], 1), "A", "input"), "feed": (np.round(feed, 2), "t/h", "disturbance"),
        "speed": (logged(rng, x[:, 1] * 30 / pi, 0.006, ends=(0, 1500), bits=13), "rpm", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("input_saturation", "sensor_lag"), (), {"high": most, "tau_s": tau},
                context=LOOP, cuts=begun(lengths), true=true)  # fmt: skip


def slide(rng: np.random.Generator) -> Case:
    """A pneumatic slide against a spring, its valve at the end of a hose (Beater 2007, Pneumatic Drives, chapter 5).

    Hidden: pressure takes 25 ms through the hose, and the seals rub with 6 N. The valve's demand is recorded, touches
    of parts are not; three recordings. The model has the lag of the chamber.
    """
    name, rows, step, late, rub = "slide_hose", 2100, 0.01, 0.025, 6.0
    asked, touch = plateaus(rng, rows, 55, -0.8, 0.8) + flips(rng, rows, 13, 0.1), gust(rng, rows, 10, 1.5)
    table = asked.tolist()

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        given = table[max(int((t - late) / step + 1e-9), 0)]
        force = 125 * x[2] - 900 * x[0] - 62 * x[1] - rub * tanh(x[1] / 4e-3)
        return x[1], (force + u[0]) / 6, (given - x[2]) / 0.05

    first = table[0]
    x, _ = rk(slope, [125 * first / 900, 0, first], rows, step, told(touch), 20)
    true = {"mp": 6.0, "ap": 125.0, "ks": 0.9, "cs": 62.0, "tp": 0.05}
    free = declared(rng, {k: true[k] for k in ("ap", "ks", "cs")}, 0.06, ap="N/bar", ks="N/mm", cs="N s/m")
    values = {"mp": fixed(rng, 6.0, "kg", 0.02), "tp": known(0.05, "s")} | free
    start = 125 * first / 900
    text = equations("pneumatic slide", values, {
        "q": ("v", start, "m"), "v": ("(ap*p - 1000*ks*q - cs*v)/mp", 0, "m/s"), "p": ("(valve - p)/tp", first, "bar")},
        {"place": ("1000*q", "mm"), "speed": ("v", "m/s"), "chamber": ("p", "bar")})  # fmt: skip
    columns: dict[str, Column] = {
        "valve": (np.round(asked, 3), "bar", "input"),
        "place": (logged(rng, 1e3 * x[:, 0], 0.008, ends=(-200, 200), bits=13), "mm", "output"),
        "speed": (logged(rng, x[:, 1], 0.02, lag=2, ends=(-2, 2), bits=13), "m/s", "output"),
        "chamber": (logged(rng, x[:, 2], 0.015, ends=(-2, 2), bits=12), "bar", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("transport_delay", "coulomb_friction"), (),
                {"delay_s": late, "force_N": rub}, cuts=(700, 1400), true=true)  # fmt: skip


PAIRS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "hammer_mill": (526, crusher), "slide_hose": (527, slide),
}  # fmt: skip
