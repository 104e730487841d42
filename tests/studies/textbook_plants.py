"""Textbook systems with and without a piece of their physics: equations, values, excitation, the model given away.

Every plant is a function of a random generator that returns its cases: the machine with the effect, most of them the
machine without it, too. Sources stand beside each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
Slope = Callable[[Array, Array], Sequence[float]]


@dataclass(frozen=True)
class Case:
    """Hold a recording, the model that is given with it, what that lacks, what may stand in for it, and its values."""

    name: str
    step: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    columns: Mapping[str, Array]
    model: str
    hidden: tuple[str, ...] = ()
    accepted: tuple[str, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    parts: int = 1  # recordings that it is cut into, a pause behind each
    verdicts: tuple[str, ...] = ()  # accepted, where others than named, multiple or those of a null are


def march(slope: Slope, x: Sequence[float], u: Array, step: float, fine: int = 20, *, held: bool = True) -> Array:
    """Integrate x' = slope(x, u) from row to row by `fine` Runge–Kutta steps; u (N, r) is held or goes straight."""
    state, rows, h = np.array(x, dtype=float), [np.array(x, dtype=float)], step / fine

    def f(x: Array, at: Array) -> Array:
        return np.array(slope(x, at))

    for now, after in pairwise(u):
        for k in range(fine):
            a, b, c = (now if held else now + (after - now) * (k + part) / fine for part in (0.0, 0.5, 1.0))
            k1 = f(state, a)
            k2 = f(state + 0.5 * h * k1, b)
            k3 = f(state + 0.5 * h * k2, b)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(state + h * k3, c))
        rows.append(state)
    return np.array(rows)


def levels(rng: np.random.Generator, rows: int, dwell: int, low: float, high: float) -> Array:
    """Return steps to random levels (N, 1)."""
    return np.repeat(rng.uniform(low, high, rows // dwell + 1), dwell)[:rows, None]


def binary(rng: np.random.Generator, rows: int, dwell: int, size: float) -> Array:
    """Return steps between two levels (N, 1)."""
    return size * np.repeat(rng.choice([-1.0, 1.0], rows // dwell + 1), dwell)[:rows, None]


def wander(rng: np.random.Generator, rows: int, lag: float, rms: float) -> Array:
    """Return noise behind a lag of so many rows (N, 1)."""
    a = np.exp(-1 / lag)
    y = lfilter([1 - a], [1, -a], rng.standard_normal(rows + 500))[500:]
    return np.asarray(rms * y / y.std())[:, None]


def multisine(rng: np.random.Generator, rows: int, low: float, high: float, rms: float) -> Array:
    """Return sines of random phase between two shares of the sampling rate (N, 1)."""
    k = np.arange(int(np.ceil(low * rows)), int(high * rows) + 1)
    y = np.cos(2 * np.pi * np.outer(np.arange(rows), k) / rows + rng.uniform(0, 2 * np.pi, len(k))).sum(axis=1)
    return np.asarray(rms * y / y.std())[:, None]


def noisy(rng: np.random.Generator, y: Array, share: float) -> Array:
    """Return a signal with white noise of a share of its deviation."""
    return np.asarray(y + share * y.std() * rng.standard_normal(len(y)))


def model(name: str, values: Mapping[str, float], states: Mapping[str, tuple[str, float]], outputs: Mapping[str, str],
          off: float = 1.15) -> str:  # fmt: skip
    """Return the text of a model; its values are free and start `off` times the true ones, those of a name in capitals
    are known."""
    lines = [f'[model]\nname = "{name}"\ntime = "continuous"\n[parameters]\n']
    for key, v in values.items():
        free = not key.isupper()
        start, low, high = (off * v, 0.2 * v, 5 * v) if free else (v, v - abs(v) / 1e6, v + abs(v) / 1e6)
        low, high = min(low, high), max(low, high)
        lines.append(f"{key} = {{ value = {start}, min = {low}, max = {high}, free = {str(free).lower()} }}\n")
    for key, (slope, first) in states.items():
        lines.append(f'[[state]]\nname = "{key}"\nderivative = "{slope}"\n')
        lines.append(f"initial = {{ value = {first}, free = true }}\n")
    lines += [f'[[output]]\nname = "{key}"\nequation = "{form}"\n' for key, form in outputs.items()]
    return "".join(lines)


def bouc_wen(rng: np.random.Generator) -> list[Case]:
    """Noël and Schoukens 2016, Hysteretic benchmark with a dynamic nonlinearity: m 2, c 10, k, alpha 5e4, beta 1e3."""
    step, u = 1 / 750, multisine(rng, 3000, 5 / 750, 0.2, 50.0)

    def slope(x: Array, u: Array) -> Sequence[float]:
        q, v, z = x
        return v, (u[0] - 10 * v - 5e4 * q - z) / 2, 5e4 * v - 1e3 * (0.8 * abs(v) * z - 1.1 * v * abs(z))

    y = noisy(rng, march(slope, [0, 0, 0], u, step, held=False)[:, 0], 0.003)
    text = model("oscillator", {"M": 2, "c": 12, "k": 7e4}, {"x": ("v", 0), "v": ("(force - c*v - k*x)/M", 0)},
                 {"y": "x"})  # fmt: skip
    return [Case("bouc_wen", step, ("force",), ("y",), {"force": u[:, 0], "y": y}, text, ("bouc_wen_hysteresis",),
                 ("play_hysteresis",))]  # fmt: skip


def pendulum(rng: np.random.Generator) -> list[Case]:
    """Drag of a pendulum that is pushed."""
    u, found = wander(rng, 2400, 30, 1.2), []
    for drag in (0.35, 0.0):
        x = march(lambda x, u, d=drag: (x[1], -12 * np.sin(x[0]) - 0.15 * x[1] - d * x[1] * abs(x[1]) + 3 * u[0]),
                  [0, 0], u, 0.02)  # fmt: skip
        text = model("pendulum", {"w": 12, "c": 0.15, "b": 3}, {"q": ("v", 0), "v": ("-w*sin(q) - c*v + b*torque", 0)},
                     {"angle": "q"})  # fmt: skip
        columns = {"torque": u[:, 0], "angle": noisy(rng, x[:, 0], 0.01)}
        hidden = ("quadratic_damping",) if drag else ()
        found.append(Case(f"pendulum{'' if drag else '_null'}", 0.02, ("torque",), ("angle",), columns, text, hidden))
    return found


def quarter_car(rng: np.random.Generator) -> list[Case]:
    """Bump stops of a wheel suspension (Savaresi et al. 2010, Semi-Active Suspension Control Design, chapter 3)."""
    u, found = wander(rng, 3000, 16, 0.012) + wander(rng, 3000, 200, 0.03), []
    for stop in (1.2e5, 0.0):

        def slope(x: Array, u: Array, stop: float = stop) -> Sequence[float]:
            body, vb, wheel, vw = x
            d = body - wheel
            f = 16e3 * d + 1e3 * (vb - vw) + stop * (max(d - 0.045, 0) + min(d + 0.045, 0))
            return vb, -f / 280, vw, (f - 1.6e5 * (wheel - u[0])) / 35

        x = march(slope, [0, 0, 0, 0], u, 0.005, held=False)
        acc = np.array([slope(row, at)[1] for row, at in zip(x, u, strict=True)])
        text = model("quarter car", {"MS": 280, "MU": 35, "ks": 16e3, "cs": 1e3, "kt": 1.6e5},
                     {"zs": ("vs", 0), "vs": ("-(ks*(zs - zu) + cs*(vs - vu))/MS", 0), "zu": ("vu", 0),
                      "vu": ("(ks*(zs - zu) + cs*(vs - vu) - kt*(zu - road))/MU", 0)},
                     {"travel": "zs - zu", "acc": "-(ks*(zs - zu) + cs*(vs - vu))/MS"})  # fmt: skip
        columns = {"road": u[:, 0], "travel": noisy(rng, x[:, 0] - x[:, 2], 0.01), "acc": noisy(rng, acc, 0.03)}
        found.append(Case(f"quarter_car{'' if stop else '_null'}", 0.005, ("road",), ("travel", "acc"), columns, text,
                          ("end_stop",) if stop else (), (), {"high_stop": 0.045} if stop else {}))  # fmt: skip
    return found


def two_bodies(rng: np.random.Generator) -> list[Case]:
    """A thermocouple that follows with 25 s (Doebelin 2004, Measurement Systems, chapter 8)."""
    u = np.hstack([levels(rng, 1500, 40, 0, 60), 20 + wander(rng, 1500, 150, 2.0)])
    bodies = march(lambda x, u: ((u[0] - 1.4 * (x[0] - x[1]) - 0.5 * (x[0] - u[1])) / 90,
                                 (1.4 * (x[0] - x[1]) - 0.3 * (x[1] - u[1])) / 160), [20, 20], u, 2.0)  # fmt: skip
    late = march(lambda x, u: ((u[0] - x[0]) / 25,), [20], bodies[:, 1:], 2.0, held=False)[:, 0]
    text = model("two bodies", {"g": 1.4, "ha": 0.5, "hb": 0.3, "ca": 90, "cb": 160},
                 {"a": ("(power - g*(a - b) - ha*(a - ambient))/ca", 20),
                  "b": ("(g*(a - b) - hb*(b - ambient))/cb", 20)},
                 {"t_a": "a", "t_b": "b"}, 1.1)  # fmt: skip
    found = []
    for name, second, hidden in (("two_bodies", late, ("sensor_lag",)), ("two_bodies_null", bodies[:, 1], ())):
        read = [x + 0.05 * rng.standard_normal(len(x)) for x in (bodies[:, 0], second)]
        columns = {"power": u[:, 0], "ambient": u[:, 1], "t_a": read[0], "t_b": read[1]}
        found.append(Case(name, 2.0, ("power", "ambient"), ("t_a", "t_b"), columns, text, hidden, (),
                          {"tau_s": 25} if hidden else {}))  # fmt: skip
    return found


def aircraft(rng: np.random.Generator) -> list[Case]:
    """Short period of an aircraft (Etkin and Reid 1996, chapter 4): an elevator of limited rate, one with a lag."""
    u = levels(rng, 2000, 50, -0.12, 0.12) + wander(rng, 2000, 5, 0.02)
    limited = u.copy()
    for k in range(1, len(u)):
        limited[k] = limited[k - 1] + np.clip(u[k] - limited[k - 1], -0.35 * 0.02, 0.35 * 0.02)
    lagging = march(lambda x, u: ((u[0] - x[0]) / 0.08,), [u[0, 0]], u, 0.02)
    text = model("short period", {"za": 1.1, "ma": 5, "mq": 1.6, "md": 8, "ZD": 0.1},
                 {"alpha": ("-za*alpha + q - ZD*elevator", 0), "q": ("-ma*alpha - mq*q - md*elevator", 0)},
                 {"aoa": "alpha", "rate": "q"}, 1.1)  # fmt: skip
    found = []
    kinds: tuple[tuple[str, Array, tuple[str, ...], dict[str, float]], ...] = (
        ("aircraft", limited, ("rate_limit",), {"rate_per_s": 0.35}),
        ("aircraft_lag", lagging, ("actuator_lag",), {"tau_s": 0.08}), ("aircraft_null", u, (), {}),
    )  # fmt: skip
    for name, acting, hidden, values in kinds:
        x = march(lambda x, u: (-1.1 * x[0] + x[1] - 0.1 * u[0], -5 * x[0] - 1.6 * x[1] - 8 * u[0]), [0, 0], acting,
                  0.02, held=name != "aircraft_lag")  # fmt: skip
        columns = {"elevator": u[:, 0], "aoa": noisy(rng, x[:, 0], 0.02), "rate": noisy(rng, x[:, 1], 0.02)}
        found.append(Case(name, 0.02, ("elevator",), ("aoa", "rate"), columns, text, hidden, (), values))
    return found


def building(rng: np.random.Generator) -> list[Case]:
    """Two storeys in an earthquake, the model has one (Chopra 2012, Dynamics of Structures, chapter 13)."""
    t = 0.02 * np.arange(2500)
    u = wander(rng, 2500, 2.5, 1.0) * np.exp(-(((t - 20) / 15) ** 2))[:, None]

    def slope(x: Array, u: Array) -> Sequence[float]:
        a, va, b, vb = x
        first, second = 400 * a + 1.5 * va, 500 * (b - a) + 1.2 * (vb - va)
        return va, second - first - u[0], vb, -second / 0.8 - u[0]

    x = march(slope, [0, 0, 0, 0], u, 0.02, held=False)
    text = model("one storey", {"k": 130, "c": 0.6, "p": 1.2}, {"x": ("v", 0), "v": ("-k*x - c*v - p*ground", 0)},
                 {"drift": "x"})  # fmt: skip
    columns = {"ground": u[:, 0], "drift": noisy(rng, x[:, 2], 0.01)}
    return [Case("building", 0.02, ("ground",), ("drift",), columns, text, ("structural_mode",))]


def table(rng: np.random.Generator) -> list[Case]:
    """A table with Stribeck friction and an encoder (Armstrong-Hélouvry et al. 1994)."""
    u, found = wander(rng, 3000, 15, 1.2), []
    for dry, excess in ((0.35, 0.3), (0.0, 0.0)):

        def slope(x: Array, u: Array, dry: float = dry, excess: float = excess) -> Sequence[float]:
            size = dry + excess * np.exp(-((x[1] / 0.05) ** 2))
            return x[1], (2 * u[0] - 0.8 * x[1] - size * np.tanh(x[1] / 0.002)) / 0.5

        x = march(slope, [0, 0], u, 0.01, 100)
        read = np.round((x[:, 0] + 2e-4 * rng.standard_normal(len(x))) / 5e-4) * 5e-4
        text = model("table", {"M": 0.5, "kt": 2, "b": 0.8}, {"x": ("v", 0), "v": ("(kt*current - b*v)/M", 0)},
                     {"position": "x"})  # fmt: skip
        columns = {"current": u[:, 0], "position": read}
        found.append(Case(f"table{'' if dry else '_null'}", 0.01, ("current",), ("position",), columns, text,
                          ("coulomb_friction",) if dry else (), ("stiction",)))  # fmt: skip
    return found


def tank(rng: np.random.Generator) -> list[Case]:
    """A tank behind a valve with a dead zone, one with play (Choudhury et al. 2005, Control Eng. Practice 13)."""
    u = levels(rng, 2500, 60, -1, 1)
    play = np.zeros_like(u)
    for k in range(1, len(u)):
        play[k] = min(max(play[k - 1], u[k] - 0.15), u[k] + 0.15)
    kinds: tuple[tuple[str, Array, tuple[str, ...], dict[str, float]], ...] = (
        ("tank", np.sign(u) * np.maximum(abs(u) - 0.3, 0), ("deadband",), {"width": 0.3}),
        ("tank_play", play, ("backlash",), {"width": 0.3}), ("tank_null", u, (), {}),
    )  # fmt: skip
    found = []
    for name, acting, hidden, values in kinds:
        x = march(lambda x, u: ((0.8 * u[0] + 0.9 - 0.35 * np.sqrt(max(x[0], 0))) / 12,), [6.6], acting, 1.0)
        text = model("tank", {"kv": 0.8, "q0": 0.9, "ko": 0.35},
                     {"h": ("(kv*valve + q0 - ko*sqrt(max(h, 0.01)))/12", 6)}, {"level": "h"}, 1.1)  # fmt: skip
        columns = {"valve": u[:, 0], "level": x[:, 0] + 0.02 * rng.standard_normal(len(x))}
        found.append(Case(name, 1.0, ("valve",), ("level",), columns, text, hidden, (), values))
    return found


def ship(rng: np.random.Generator) -> list[Case]:
    """Roll of a ship with bilge-keel drag and a softening righting arm (Nayfeh and Mook 1979, chapter 4)."""
    t = 0.1 * np.arange(3000)
    u = wander(rng, 3000, 8, 0.25) + 0.12 * np.sin(2 * np.pi * 0.13 * t)[:, None]
    found = []
    for drag, cubic in ((0.6, -0.2), (0.0, 0.0)):
        x = march(lambda x, u, d=drag, k=cubic: (x[1], -0.7 * x[0] - k * x[0] ** 3 - 0.05 * x[1] - d * x[1] * abs(x[1])
                                                 + 0.5 * u[0]), [0, 0], u, 0.1)  # fmt: skip
        text = model("roll", {"k": 0.7, "c": 0.05, "b": 0.5}, {"phi": ("p", 0), "p": ("-k*phi - c*p + b*moment", 0)},
                     {"roll": "phi"})  # fmt: skip
        columns = {"moment": u[:, 0], "roll": noisy(rng, x[:, 0], 0.01)}
        hidden = ("quadratic_damping", "cubic_stiffness") if drag else ()
        found.append(Case(f"ship{'' if drag else '_null'}", 0.1, ("moment",), ("roll",), columns, text, hidden))
    return found


def loop(rng: np.random.Generator) -> list[Case]:
    """A process under PI control: a dead time of 3 s, a pump that saturates (Åström and Hägglund 2006)."""
    found = []
    for name, late in (("loop_delay", 6), ("loop_null", 0)):
        wanted, push = levels(rng, 3000, 100, -1, 1)[:, 0], wander(rng, 3000, 40, 0.15)[:, 0]
        y, total, u, read = 0.0, 0.0, np.zeros(3000), np.zeros(3000)
        for k in range(3000):
            read[k] = y + 0.01 * rng.standard_normal()
            total += 0.015 * (wanted[k] - read[k])
            u[k] = 0.7 * (wanted[k] - read[k]) + total
            y += (1 - np.exp(-0.5 / 12)) * (1.8 * (u[k - late] if k >= late else 0.0) + push[k] - y)
        text = model("process", {"t": 12, "k": 1.8}, {"x": ("(k*valve - x)/t", 0)}, {"temp": "x"})
        hidden = ("transport_delay",) if late else ()
        found.append(Case(name, 0.5, ("valve",), ("temp",), {"valve": u, "temp": read}, text, hidden,
                          ("data_time_offset",), {"delay_s": 3} if late else {}))  # fmt: skip
    wanted, u, read, y, total = levels(rng, 2500, 80, 0.5, 3)[:, 0], np.zeros(2500), np.zeros(2500), 1.0, 0.0
    for k in range(2500):
        read[k] = y + 0.01 * rng.standard_normal()
        total = float(np.clip(total + 0.01 * (wanted[k] - read[k]), -2, 2))
        u[k] = 1.5 * (wanted[k] - read[k]) + total + 0.5
        y += 0.1 * (min(max(u[k], -0.2), 1.1) - 0.25 * y - 0.1)
    text = model("pump", {"kp": 1, "ko": 0.25, "q0": 0.1}, {"h": ("(kp*drive - ko*h - q0)/2", 1)}, {"level": "h"})
    found.append(
        Case("loop_pump", 0.2, ("drive",), ("level",), {"drive": u, "level": read}, text, ("input_saturation",))
    )
    return found


def accelerometer(rng: np.random.Generator) -> list[Case]:
    """A micromachined spring that is stiffer to one side (Kaajakari 2009, Practical MEMS, chapter 4)."""
    w, u = 2 * np.pi * 600, multisine(rng, 3000, 0.002, 0.15, 0.3)
    x = march(lambda x, u: (x[1], -w * w * (x[0] + 0.35 * x[0] ** 2 - 0.25 * u[0]) - 0.1 * w * x[1]), [0, 0], u, 1e-4,
              held=False)  # fmt: skip
    text = model("accelerometer", {"w": w, "z": 0.05, "g": 0.25},
                 {"x": ("v", 0), "v": ("-w*w*x - 2*z*w*v + g*w*w*acc", 0)}, {"signal": "x"}, 1.05)  # fmt: skip
    columns = {"acc": u[:, 0], "signal": noisy(rng, x[:, 0], 0.005)}
    return [Case("accelerometer", 1e-4, ("acc",), ("signal",), columns, text, ("quadratic_stiffness",))]


def twin_rotor(rng: np.random.Generator) -> list[Case]:
    """A helicopter rig whose main rotor turns it, too (Ahmad et al. 2000, J. Dyn. Sys. Meas. Control 122)."""
    u = np.hstack([binary(rng, 2400, 30, 1), binary(rng, 2400, 44, 1)])
    text = model("twin rotor", {"a": 2.2, "b": 0.5, "g1": 1.3, "c": 0.4, "d": 0.6, "g2": 0.9},
                 {"p": ("vp", 0), "vp": ("-a*p - b*vp + g1*main", 0), "y": ("vy", 0),
                  "vy": ("-c*y - d*vy + g2*tail", 0)}, {"pitch": "p", "yaw": "y"}, 1.1)  # fmt: skip
    found = []
    for across in (0.25, 0.0):
        x = march(lambda x, u, k=across: (x[1], -2.2 * x[0] - 0.5 * x[1] + 1.3 * u[0], x[3],
                                          -0.4 * x[2] - 0.6 * x[3] + 0.9 * u[1] + k * u[0]),
                  [0, 0, 0, 0], u, 0.05)  # fmt: skip
        read = [noisy(rng, x[:, k], 0.02) for k in (0, 2)]
        columns = {"main": u[:, 0], "tail": u[:, 1], "pitch": read[0], "yaw": read[1]}
        found.append(Case(f"twin_rotor{'' if across else '_null'}", 0.05, ("main", "tail"), ("pitch", "yaw"), columns,
                          text, ("missing_coupling",) if across else ()))  # fmt: skip
    return found


def joint(rng: np.random.Generator) -> list[Case]:
    """A joint with a gap between motor and load (Nordin and Gutman 2002, Automatica 38)."""
    u = wander(rng, 3000, 40, 2.0)

    def slope(x: Array, u: Array) -> Sequence[float]:
        a, va, b, vb = x
        d = a - b
        torque = 60 * (d - np.clip(d, -0.03, 0.03)) + 0.25 * (va - vb) * (abs(d) > 0.03)
        return va, (u[0] - 0.05 * va - torque) / 0.02, vb, (torque - 0.3 * vb - 2 * b) / 0.05

    x = march(slope, [0, 0, 0, 0], u, 0.005, 50)
    text = model("joint", {"JA": 0.02, "JB": 0.05, "k": 60, "c": 0.25, "ba": 0.05, "bb": 0.3, "kb": 2},
                 {"a": ("va", 0), "va": ("(torque - ba*va - k*(a - b) - c*(va - vb))/JA", 0), "b": ("vb", 0),
                  "vb": ("(k*(a - b) + c*(va - vb) - bb*vb - kb*b)/JB", 0)},
                 {"motor": "a", "load": "b"}, 0.9)  # fmt: skip
    columns = {"torque": u[:, 0], "motor": noisy(rng, x[:, 0], 0.003), "load": noisy(rng, x[:, 2], 0.003)}
    return [Case("joint", 0.005, ("torque",), ("motor", "load"), columns, text, ("clearance",), ("backlash",),
                 {"half_gap": 0.03})]  # fmt: skip


def wing(rng: np.random.Generator) -> list[Case]:
    """A wing section that plunges and pitches on a hardening spring (Lee, Price, Wong 1999, Prog. Aerosp. Sci. 35)."""
    u, found = wander(rng, 3000, 6, 1.0), []
    for cubic in (900.0, 0.0):

        def slope(x: Array, u: Array, cubic: float = cubic) -> Sequence[float]:
            h, vh, a, va = x
            f, m = u[0] - 60 * h - 0.8 * vh - 12 * a, -90 * a - cubic * a**3 - 0.6 * va + 3 * h + 0.5 * u[0]
            return vh, (f - 0.2 * m) / 0.96, va, (m - 0.2 * f) / 0.96

        x = march(slope, [0, 0, 0, 0], u, 0.02)
        lift, twist = "(flap - kh*h - ch*vh - l*a)", "(-ka*a - ca*va + m*h + e*flap)"
        text = model("wing", {"kh": 60, "ch": 0.8, "l": 12, "ka": 90, "ca": 0.6, "m": 3, "e": 0.5},
                     {"h": ("vh", 0), "vh": (f"({lift} - 0.2*{twist})/0.96", 0), "a": ("va", 0),
                      "va": (f"({twist} - 0.2*{lift})/0.96", 0)}, {"plunge": "h", "pitch": "a"}, 1.1)  # fmt: skip
        columns = {"flap": u[:, 0], "plunge": noisy(rng, x[:, 0], 0.01), "pitch": noisy(rng, x[:, 2], 0.01)}
        found.append(Case(f"wing{'' if cubic else '_null'}", 0.02, ("flap",), ("plunge", "pitch"), columns, text,
                          ("cubic_stiffness",) if cubic else ()))  # fmt: skip
    return found


def crack(rng: np.random.Generator) -> list[Case]:
    """A beam that loses a tenth of its stiffness on the way (Worden et al. 2007, Proc. R. Soc. A 463)."""
    u, found = wander(rng, 3000, 4, 1.0), []
    for loss in (0.1, 0.0):
        time = 0.01 * np.arange(3000)[:, None]
        x = march(lambda x, u, loss=loss: (x[1], 2 * u[0] - 400 * (1 - loss * (u[1] > 13.0)) * x[0] - 1.2 * x[1]),
                  [0, 0], np.hstack([u, time]), 0.01)  # fmt: skip
        text = model("beam", {"k": 400, "c": 1.2, "g": 2}, {"x": ("v", 0), "v": ("g*force - k*x - c*v", 0)},
                     {"bend": "x"}, 1.1)  # fmt: skip
        columns = {"force": u[:, 0], "bend": noisy(rng, x[:, 0], 0.02)}
        found.append(Case(f"crack{'' if loss else '_null'}", 0.01, ("force",), ("bend",), columns, text,
                          ("stiffness_change",) if loss else (), (), {"time_s": 13.0} if loss else {}))  # fmt: skip
    return found


def tachometer(rng: np.random.Generator) -> list[Case]:
    """A motor whose counter has no sign, and one whose sensor clips."""
    u = wander(rng, 2500, 25, 1.0)
    w = march(lambda x, u: ((2 * u[0] - 0.6 * x[0]) / 0.5,), [0], u, 0.02)[:, 0]
    text = model("motor", {"J": 0.5, "kt": 2, "b": 0.6}, {"w": ("(kt*current - b*w)/J", 0)}, {"speed": "w"})
    most = float(np.quantile(abs(w), 0.9))
    kinds = (
        ("tachometer", abs(w), ("sensor_rectified",)),
        ("tachometer_range", np.clip(w, -most, most), ("sensor_saturation",)), ("tachometer_null", w, ()),
    )  # fmt: skip
    return [
        Case(name, 0.02, ("current",), ("speed",),
             {"current": u[:, 0], "speed": y + 0.01 * w.std() * rng.standard_normal(len(w))}, text, hidden)
        for name, y, hidden in kinds
    ]  # fmt: skip


PLANTS: tuple[Callable[[np.random.Generator], list[Case]], ...] = (
    bouc_wen, pendulum, quarter_car, two_bodies, aircraft, building, table, tank, ship, loop, accelerometer, twin_rotor,
    joint, wing, crack, tachometer,
)  # fmt: skip
