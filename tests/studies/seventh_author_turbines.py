"""Wind turbines, of which a soft tower, a late pitch or the end of an accelerometer's range are left out.

As seventh_author_rotors.py. With `complete` nothing is hidden, which is a null in seventh_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi

import numpy as np
from second_author_parts import Case, Column, Tones, equations, flips, plateaus, state_space
from sixth_author_parts import LOOP, WT, declared, fixed, gust, hiss, logged, skewed, slopes
from third_author_parts import looked_up, rk, told


def soft(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A rotor of 2 MW above rated wind on its tower of 78 m (Burton et al. 2011, Wind Energy Handbook, section 5.8).

    Hidden: the tower gives fore and aft at 0.34 Hz, by which the moment at its foot and the wind that the rotor meets
    swing; the model has it stiff. The pitch loop hears the speed with noise; lidar wind, small gusts are not recorded.
    The null's model has the tower, in two recordings.
    """
    name, rows, step, fine, w = "null_tall_tower" if complete else "tall_tower", 2000, 0.1, 5, 2 * pi * 0.34
    air, total = Tones.drawn(rng, 0.003, 0.12, 40, 1.2, 15), [10.0]
    wind, heard, blown = looked_up(air, rows, step, fine), hiss(rng, rows, 0.003), gust(rng, rows, 9, 0.04)
    shake, turned = flips(rng, rows, 60, 0.25), plateaus(rng, rows, 120, 950, 1150)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 1.8
        total[0] += 0.9 * step * error
        return total[0] + 7 * error + shake[k], turned[k], blown[k]

    def loads(t: float, x: Sequence[float], u: Sequence[float]) -> tuple[float, float]:
        v = wind(t) + u[2] - x[2] - 15
        return 190 + 24 * v - 21 * (u[0] - 10), 1050 + 160 * v - 125 * (u[0] - 10) - 700 * (x[0] - 1.8)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        thrust, torque = loads(t, x, u)
        return (torque - u[1]) / 3200, x[2], (thrust - 12 * x[2]) / 240 - w * w * x[1]

    x, u = rk(slope, [1.8, 190 / (240 * w * w), 0], rows, step, command, fine)
    moment = 0.078 * (240 * w * w * x[:, 1] + 12 * x[:, 2])
    true = {"J": 3.2, "kv": 160.0, "kb": 125.0, "kw": 700.0, "tv": 24.0, "tb": 21.0}
    true |= {"ft": 0.34, "ct": 12.0} if complete else {}
    units = {"kv": "kN s", "kb": "kN m/deg", "kw": "kN m s", "tv": "kN s/m", "tb": "kN/deg", "ft": "Hz", "ct": "kN s/m"}
    values = {"J": fixed(rng, 3.2, "1e6 kg m2", 0.02)} | declared(
        rng, {k: v for k, v in true.items() if k != "J"}, 0.07, **units)  # fmt: skip
    v = "(wind - vt - 15)" if complete else "(wind - 15)"
    states = {"om": (f"(1050 + kv*{v} - kb*(pitch - 10) - kw*(om - 1.8) - torque)/(1000*J)", 1.8, "rad/s")}
    thrust, foot = f"(190 + tv*{v} - tb*(pitch - 10))", "(240*(2*pi*ft)**2*xt + ct*vt)"
    if complete:
        states |= {"xt": ("vt", 190 / (240 * w * w), "m"), "vt": (f"({thrust} - {foot})/240", 0, "m/s")}
    text = equations("rotor and tower", values, states, {
        "rotor_speed": ("om*30/pi", "rpm"),
        "tower_base_fa_moment": (f"0.078*{foot if complete else thrust}", "MN m")})  # fmt: skip
    columns: dict[str, Column] = {
        "pitch": (np.round(u[:, 0], 3), "deg", "input"), "torque": (np.round(u[:, 1], 1), "kN m", "input"),
        "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
        "rotor_speed": (logged(rng, (x[:, 0] + heard) * 30 / pi, 0.0, ends=(0, 40), bits=15), "rpm", "output"),
        "tower_base_fa_moment": (logged(rng, moment, 0.02, lag=3, ends=(0, 40)), "MN m", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, machine=WT, context="blades = 3\n" + LOOP, cuts=(1000,), true=true)
    return Case(name, step, columns, text, ("tower_fore_aft",), ("structural_mode",), {"frequency_hz": 0.34},
                machine=WT, context="blades = 3\n" + LOOP, true=true)  # fmt: skip


def late(rng: np.random.Generator) -> Case:
    """A rotor of 3 MW above rated wind whose pitch goes over a field bus (Bianchi et al. 2007, chapter 4).

    Hidden: the demand reaches the drives 0.3 s late; their lag of 0.25 s is in the model. The loop hears the speed with
    noise, a service computer shakes the pitch. Wind of a lidar, small gusts are not recorded; two short recordings.
    """
    name, rows, step, dead = "pitch_bus", 1600, 0.1, 0.3
    air, total, behind = Tones.drawn(rng, 0.003, 0.2, 40, 1.0, 16), [12.0], round(dead / step)
    wind, heard, blown = looked_up(air, rows, step, 5), hiss(rng, rows, 0.003), gust(rng, rows, 8, 0.08)
    shake, asked = flips(rng, rows, 13, 0.9), [12.0] * behind

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 1.5
        total[0] += 0.8 * step * error
        asked.append(total[0] + 6 * error + shake[k])
        return asked[-1], asked[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        rotor = 310 * (wind(t) + u[2] - 16) - 290 * (x[1] - 12) - 1900 * (x[0] - 1.5)
        return rotor / 5600, (u[1] - x[1]) / 0.25

    x, u = rk(slope, [1.5, 12.0], rows, step, command, 5)
    assert len(asked) == rows + behind
    blade = 3.1 + 0.27 * (air(np.arange(rows) * step) + blown - 16) - 0.36 * (x[:, 1] - 12)
    true = {"J": 5.6, "kv": 310.0, "kb": 290.0, "kw": 1900.0, "m0": 3.1, "mv": 0.27, "mb": 0.36, "tp": 0.25}
    units = {"kv": "kN s", "kb": "kN m/deg", "kw": "kN m s", "m0": "MN m", "mv": "MN s", "mb": "MN m/deg"}
    values = {"J": fixed(rng, 5.6, "1e6 kg m2", 0.02), "tp": fixed(rng, 0.25, "s")} | declared(
        rng, {k: true[k] for k in ("kv", "kb", "kw", "m0", "mv", "mb")}, 0.06, **units)  # fmt: skip
    text = equations("rotor and pitch", values, {
        "om": ("(kv*(wind - 16) - kb*(th - 12) - kw*(om - 1.5))/(1000*J)", 1.5, "rad/s"),
        "th": ("(pitch - th)/tp", 12, "deg")},
        {"rotor_speed": ("om*30/pi", "rpm"),
         "blade_flap_moment": ("m0 + mv*(wind - 16) - mb*(th - 12)", "MN m")})  # fmt: skip
    columns: dict[str, Column] = {
        "pitch": (np.round(u[:, 0], 3), "deg", "input"),
        "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
        "rotor_speed": (logged(rng, (x[:, 0] + heard) * 30 / pi, 0.0, ends=(0, 30), bits=15), "rpm", "output"),
        "blade_flap_moment": (logged(rng, blade, 0.02, lag=3, ends=(0, 8), bits=13), "MN m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("transport_delay",), (), {"delay_s": dead}, machine=WT,
                context="blades = 3\n" + LOOP, cuts=(800,), true=true)  # fmt: skip


def clipped(rng: np.random.Generator) -> Case:
    """The first bending mode of a tower of 3 MW, its model linear (Hansen 2015, Aerodynamics of Wind Turbines, ch. 11).

    The fault: the nacelle's accelerometer ends at 0.2 m/s2 either way. A satellite receiver reads the place of the
    tower's top; the thrust comes from strain gauges, gusts on the tower are not recorded. The gain is up to 4 % off.
    """
    name, rows, step, fine, w, end = "nacelle_range", 1500, 0.1, 6, 2 * pi * 0.31, 0.2
    push = Tones.drawn(rng, 0.02, 0.8, 44, 24.0, 0.0)
    thrust, wind = looked_up(push, rows, step, fine), gust(rng, rows, 6, 1.0)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (thrust(t) + u[0]) / 310 - w * w * x[0] - 0.12 * w * x[1]

    x, _ = rk(slope, [0, 0], rows, step, told(wind), fine)
    acc = slopes(slope, step, x, wind[:, None])[:, 1]
    gain = skewed(rng, 1, 0.04) / 310
    a, b = np.array([[0, 1], [-w * w, -0.12 * w]]), np.array([[0], [gain]])
    c, d = np.vstack([a[1], [1000, 0]]), np.array([[gain], [0]])
    model = state_space(0, {"thrust": "kN"}, {"tower_top_fa_acc": "m/s2", "tower_top_fa": "mm"}, (a, b, c, d))
    columns: dict[str, Column] = {
        "thrust": (np.round(push(np.arange(rows) * step), 2), "kN", "input"),
        "tower_top_fa_acc": (logged(rng, acc, 0.02, ends=(-end, end), bits=12), "m/s2", "output"),
        "tower_top_fa": (logged(rng, 1e3 * x[:, 0], 0.03, lag=4, ends=(-1000, 1000), bits=13), "mm",
                         "output")}  # fmt: skip
    return Case(name, step, columns, model, ("sensor_saturation",), (), {"high": end, "low": -end}, machine=WT,
                context="blades = 3\n", cuts=(500, 1000))  # fmt: skip


TURBINES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "tall_tower": (520, soft), "pitch_bus": (521, late), "nacelle_range": (522, clipped),
}  # fmt: skip
