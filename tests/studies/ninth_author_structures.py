"""A fork on a shaker, a gear stage, a bolted beam, a buoy that is let go and a frame, of which a piece is left out.

As ninth_author_geared.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np
from ninth_author_parts import Makers, daq, integrate, model_text, near, off, rates, rows_of, stairs, stands, wander
from second_author_parts import Case, Column, Tones, known, state_space
from textbook_plants import Array


def fork(rng: np.random.Generator) -> Case:
    """A motorcycle's fork with its wheel on a shaker, 16 s at 250 Hz (Cossalter 2006, Motorcycle Dynamics, chapter 5).

    Hidden: the damper gives 2.9 times as much in rebound as in compression, which no entry has; the model's is alike
    both ways.
    """
    rows, step = 4000, 0.004
    t = np.arange(16 * rows + 40) * step / 16
    slow, quick = Tones.drawn(rng, 0.4, 3.0, 24, 9.0, 0.0), Tones.drawn(rng, 3.5, 16.0, 24, 1.6, 0.0)
    road = 1e-3 * (np.asarray(slow(t)) + np.asarray(quick(t)))
    table, rub = road.tolist(), wander(rng, rows, 6, 6.0)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = x[1] - x[3]
        force = 9800 * (x[0] - x[2]) + (1450 if v > 0 else 500) * v + u[0]
        tyre = 118000 * (table[int(t * 16 / step + 0.5)] - x[2])
        return x[1], -force / 92, x[3], (force + tyre - 160 * x[3]) / 17

    x, u = integrate(slope, [0] * 4, rows, step, lambda k, _: (rub[k],), 8)
    acc = rates(slope, step, x, u)[:, [1, 3]]
    true = {"ks": 9.8, "cs": 0.9, "kt": 118.0, "ct": 0.16}
    values = stands({"mb": 92.0, "mw": 17.0}, mb="kg", mw="kg") | near(rng, true, 0.04, ks="kN/m", kt="kN/m")
    text = model_text("fork", values, {"leg": "1000*(ks*(xb - xw) + cs*(vb - vw))"}, {
        "xb": ("vb", 0.0, "m"), "vb": ("-leg/mb", 0.0, "m/s"), "xw": ("vw", 0.0, "m"),
        "vw": ("(leg + 1000*kt*(road/1000 - xw) - 1000*ct*vw)/mw", 0.0, "m/s")},
        {"travel": ("1000*(xb - xw)", "mm"), "body_acc": ("-leg/mb", "m/s^2"),
         "wheel_acc": ("(leg + 1000*kt*(road/1000 - xw) - 1000*ct*vw)/mw", "m/s^2")})  # fmt: skip
    columns: dict[str, Column] = {
        "road": (np.round(1000 * road[: 16 * rows : 16], 3), "mm", "disturbance"),
        "travel": (daq(rng, 1000 * (x[:, 0] - x[:, 2]), (-100, 100), 13, noise=0.03), "mm", "output"),
        "body_acc": (daq(rng, acc[:, 0], (-50, 50), 13, noise=0.03), "m/s^2", "output"),
        "wheel_acc": (daq(rng, acc[:, 1], (-200, 200), 13, noise=0.1), "m/s^2", "output")}  # fmt: skip
    return Case("fork_rebound", step, columns, text, outside=True, true=true)


def gears(rng: np.random.Generator) -> Case:
    """A drive and its load behind a gear stage and a coupling, 5 s at 1 kHz, two encoders (Nordin and Gutman 2002).

    Hidden: between the teeth are 2 mrad to either side in which the coupling's spring does not act.
    """
    rows, step, gap = 5000, 0.001, 0.002
    torque = 0.8 * stairs(rng, rows, 40, 160, (-1, -0.35, 0.3, 1)) + 0.25 * stairs(rng, rows, 6, 30, (-1, 1))
    u = np.c_[np.round(torque, 3), wander(rng, rows, 12, 0.02)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        twist = x[2] - min(max(x[2], -gap), gap)
        pull = 62 * twist + 0.04 * (x[0] - x[1])
        return (u[0] - pull - 0.012 * x[0]) / 2.4e-3, (pull - 0.035 * x[1] + u[1]) / 6.5e-3, x[0] - x[1]

    x, _ = integrate(slope, [0, 0, 0], rows, step, lambda k, _: u[k].tolist(), 8)
    true = {"kc": 62.0, "dc": 0.04, "bm": 12.0, "bl": 35.0}
    values = {"jm": known(off(rng, 2.4, 0.02), "g m2"), "jl": known(off(rng, 6.5, 0.02), "g m2")}
    values |= near(rng, true, 0.04, kc="N m/rad", dc="N m s", bm="mN m s", bl="mN m s")
    pull = "(kc*twist + dc*(wm - wl))"
    text = model_text("gear stage", values, {"pull": pull}, {
        "wm": ("1000*(torque - pull - bm/1000*wm)/jm", 0.0, "rad/s"),
        "wl": ("1000*(pull - bl/1000*wl)/jl", 0.0, "rad/s"), "twist": ("wm - wl", 0.0, "rad")},
        {"motor_speed": ("wm*30/pi", "rpm"), "load_speed": ("wl*30/pi", "rpm")})  # fmt: skip
    columns: dict[str, Column] = {
        "torque": (u[:, 0], "N m", "input"),
        "motor_speed": (daq(rng, x[:, 0] * 30 / pi, (-1000, 1000), 14, noise=0.5), "rpm", "output"),
        "load_speed": (daq(rng, x[:, 1] * 30 / pi, (-1000, 1000), 14, noise=0.5), "rpm", "output")}  # fmt: skip
    return Case("gear_teeth", step, columns, text, ("clearance",), ("backlash",), {"half_gap": gap}, true=true)


def beam(rng: np.random.Generator) -> Case:
    """A bolted cantilever on a shaker, 9 s at 2048 Hz, its first two modes linear (Segalman 2006, J. Appl. Mech. 73).

    Hidden: the lap joint holds with a fifth of the first mode's stiffness until it slips at 0.08 mm.
    """
    rows, step, w, z = 18000, 1 / 2048, 2 * pi * np.array([23.0, 118.0]), np.array([0.006, 0.005])
    force = np.convolve(rng.standard_normal(rows + 60), np.hanning(9), "same")[:rows]
    force *= (9.0 + 7.0 * np.sin(2 * pi * np.arange(rows) * step / 4.5)) / np.std(force)
    gain, seen, held, slip = np.array([0.9, 0.6]), np.array([[1.0, 1.0], [0.4, -0.7]]), [0.0], 8e-5
    table = np.round(force, 3).tolist()

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        kept = 0.2 * w[0] ** 2 * (x[0] - min(max(held[0], x[0] - slip), x[0] + slip))
        return (x[2], x[3], gain[0] * u[0] - w[0] ** 2 * x[0] - 2 * z[0] * w[0] * x[2] - kept,
                gain[1] * u[0] - w[1] ** 2 * x[1] - 2 * z[1] * w[1] * x[3])  # fmt: skip

    def guard(x: list[float]) -> None:
        held[0] = min(max(held[0], x[0] - slip), x[0] + slip)

    kept: list[float] = []

    def command(k: int, _: Sequence[float]) -> Sequence[float]:
        kept.append(held[0])
        return (table[k],)

    x, _ = integrate(slope, [0] * 4, rows, step, command, 4, guard)
    q = np.array([gain[i] * np.array(table) - w[i] ** 2 * x[:, i] - 2 * z[i] * w[i] * x[:, 2 + i] for i in (0, 1)])
    q[0] -= 0.2 * w[0] ** 2 * (x[:, 0] - np.array(kept))
    return _beam_case(rng, np.array(table), q.T @ seen.T, w, z, gain, seen)


def _beam_case(rng: np.random.Generator, force: Array, acc: Array, w: Array, z: Array, gain: Array,
               seen: Array) -> Case:  # fmt: skip
    """Return the case of the beam, whose model has gains up to 4 % and frequencies up to 0.4 % off."""
    w = np.array([off(rng, v, 0.004) for v in w])
    g = np.array([off(rng, v, 0.04) for v in gain])[:, None]
    low = np.hstack([-np.diag(w**2), -np.diag(2 * z * w)])
    a = np.vstack([np.hstack([np.zeros((2, 2)), np.eye(2)]), low])
    model = state_space(0, {"force": "N"}, {"tip_acc": "m/s^2", "middle_acc": "m/s^2"},
                        (a, np.vstack([np.zeros((2, 1)), g]), seen @ low, seen @ g))  # fmt: skip
    columns: dict[str, Column] = {
        "force": (force, "N", "input"),
        "tip_acc": (daq(rng, acc[:, 0], (-400, 400), 16, noise=0.05), "m/s^2", "output"),
        "middle_acc": (daq(rng, acc[:, 1], (-400, 400), 16, noise=0.05), "m/s^2", "output")}  # fmt: skip
    return Case("bolted_beam", 1 / 2048, columns, model, ("play_hysteresis",), ("bouc_wen_hysteresis",))


def buoy(rng: np.random.Generator) -> Case:
    """A model buoy in a basin that a line lifts and lets go, three short recordings at 10 Hz, the line's force read.

    Hidden: the damping plate drags with the square of the speed, 16 N s2/m2.
    """
    lengths, step, drag = (260, 260, 300), 0.1, 16.0
    states: list[Array] = []
    line: list[Array] = []
    for long, pull in zip(lengths, (78.0, 52.0, 95.0), strict=True):
        t = np.arange(long) * step
        own: Array = np.round(np.where(t < 7.0, pull * np.clip((t - 1) / 4, 0, 1), 0.0), 1).astype(np.float64)
        ripple = wander(rng, long, 5, 0.5)

        def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
            return x[1], (u[0] + u[1] - 640 * x[0] - 7 * x[1] - drag * x[1] * abs(x[1])) / 42

        states.append(integrate(slope, [0, 0], long, step, rows_of(np.c_[own, ripple]), 8)[0])
        line.append(own)
    x, force = np.vstack(states), np.concatenate(line)
    true = {"kb": 640.0, "cb": 7.0}
    values = {"mb": known(off(rng, 42.0, 0.01), "kg")} | near(rng, true, 0.04, kb="N/m", cb="N s/m")
    text = model_text("buoy", values, {}, {
        "heave": ("speed", 0.0, "m"), "speed": ("(line - kb*heave - cb*speed)/mb", 0.0, "m/s")},
        {"heave_probe": ("1000*heave", "mm")})  # fmt: skip
    columns: dict[str, Column] = {
        "line": (force, "N", "input"),
        "heave_probe": (daq(rng, 1000 * x[:, 0], (-250, 250), 12, noise=0.3), "mm", "output")}  # fmt: skip
    return Case("buoy_let_go", step, columns, text, ("quadratic_damping",), (), {"c2": drag},
                cuts=tuple(int(k) for k in np.cumsum(lengths)[:-1]), true=true)  # fmt: skip


STRUCTURE_MAKERS: Makers = {
    "fork_rebound": (961, fork), "gear_teeth": (962, gears), "bolted_beam": (963, beam), "buoy_let_go": (964, buoy),
}  # fmt: skip
