"""Drives, loudspeakers, converters and filters whose models or recordings lack a piece of their physics.

As third_author_machines.py: dry friction, a rope, loads, a diode, clocks that differ, a tachometer that drifts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import pi, sqrt, tanh

import numpy as np
from second_author_parts import Case, Tones, converted, equations, flips, free, known, plateaus, smooth
from textbook_plants import noisy
from third_author_parts import looked_up, off, rk, told, white


def emps(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A positioning axis in a loop (Janot et al. 2019, EMPS benchmark).

    Its dry friction is 23 N one way and 17 N the other. The model has an offset, which takes the difference, and no dry
    friction. The null's has both.
    """
    name, rows, step = "null_emps" if complete else "emps_dry", 2400, 0.004
    wanted = np.convolve(plateaus(rng, rows + 80, 140, 0.02, 0.22), np.ones(80) / 80, mode="valid")[:rows]
    wanted = np.convolve(np.r_[np.full(39, wanted[0]), wanted, np.full(40, wanted[-1])], np.ones(80) / 80, mode="valid")
    shake = flips(rng, rows, 9, 0.25)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return (max(min(90 * (14 * (wanted[k] - round(x[0] / 1e-5) * 1e-5) - x[1]), 10), -10) + shake[k],)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (35.15 * u[0] - 204.0 * x[1] - 20.0 * tanh(x[1] / 5e-4) - 3.0) / 95.1

    x, u = rk(slope, [wanted[0], 0], rows, step, command, 10)
    true = {"M": 95.1, "Fv": 204.0, "offset": 3.0} | ({"Fc": 20.0} if complete else {})
    dry = " - Fc*tanh(v/0.0005)" if complete else ""
    text = equations("linear axis", off(rng, true, M="kg", Fv="N s/m", offset="N"), {
        "q": ("v", wanted[0], "m"), "v": (f"(35.15*voltage - Fv*v{dry} - offset)/M", 0, "m/s")},
        {"position": ("1000*q", "mm")})  # fmt: skip
    place = 1e3 * x[:, 0]
    read = np.round(white(rng, place, 0.004) / 0.01) * 0.01
    columns = {"voltage": (u[:, 0], "V", "input"), "position": (read, "mm", "output")}
    loop = "closed_loop = true\n"
    if complete:
        return Case(name, step, columns, text, context=loop, cuts=(800, 1600), beside=("sensor_quantisation",),
                    verdicts=("named",), clean={"position": place}, true=true)  # fmt: skip
    return Case(name, step, columns, text, ("coulomb_friction",), ("stiction",), {"force_N": 20.0}, context=loop,
                beside=("sensor_quantisation",))  # fmt: skip


def lift(rng: np.random.Generator) -> Case:
    """A lift with an elastic rope in its speed loop (Strakosch 2010, The Vertical Transportation Handbook).

    The model is one mass; the frequency asked for is that of both masses on the rope.
    """
    name, rows, step = "lift_rope", 1990, 0.02
    ma, mb, k, c = 1500.0, 1100.0, 4.2e5, 900.0
    wanted = np.convolve(plateaus(rng, rows + 60, 180, -1.2, 1.2), np.ones(61) / 61, mode="valid")
    shake, total = flips(rng, rows, 6, 0.5), [0.9]

    def command(n: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[n] - x[0]
        total[0] += 4 * step * error
        return (6 * error + total[0] + shake[n],)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        rope = k * x[2] + c * (x[0] - x[1])
        return (1000 * u[0] - 900 - 130 * x[0] - rope) / ma, rope / mb, x[0] - x[1]

    x, u = rk(slope, [0, 0, 0], rows, step, command, 10)
    acc = np.array([slope(0, a, b)[1] for a, b in zip(x.tolist(), u.tolist(), strict=True)])
    true = {"mtot": ma + mb, "bl": 130.0, "Wl": 900.0}
    drive = "(1000*drive - Wl - bl*speed)/mtot"
    text = equations("lift", off(rng, true, mtot="kg", Wl="N"), {"speed": (drive, 0, "m/s")},
                     {"sheave_speed": ("speed", "m/s"), "car_acc": (drive, "m/s2")})  # fmt: skip
    columns = {"drive": (u[:, 0], "kN", "input"), "sheave_speed": (white(rng, x[:, 0], 0.002), "m/s", "output"),
               "car_acc": (white(rng, acc, 0.01), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("structural_mode",), (),
                {"frequency_hz": sqrt(k * (1 / ma + 1 / mb)) / (2 * pi)}, context="closed_loop = true\n")  # fmt: skip


def hoist(rng: np.random.Generator) -> Case:
    """A hoist in its speed loop that takes a load of 700 kg at 33 s.

    Weight and mass step together, which no entry has; the model has one mass throughout.
    """
    name, rows, step = "hoist_load", 1650, 0.04
    wanted, shake, total = plateaus(rng, rows, 90, -0.35, 0.45), flips(rng, rows, 8, 8.0), [60.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0]
        total[0] += 350 * step * error
        return (260 * error + total[0] + shake[k],)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        mass = 350 + (700 if t >= 33 else 0)
        return ((105 * u[0] - mass * 9.81 - 2600 * x[0]) / (mass + 2400), 1.4 * (u[0] / 6.0 - x[1]))

    x, u = rk(slope, [0, 33.0 / 6 * 1.0], rows, step, command, 8)
    true = {"mh": 350.0, "kf": 105.0, "bh": 2600.0}
    text = equations("hoist", off(rng, true, mh="kg", kf="N/(N m)", bh="N s/m"), {
        "lift": ("(kf*motor - mh*9.81 - bh*lift)/(mh + 2400)", 0, "m/s")},
        {"rope_speed": ("60*lift", "m/min")})  # fmt: skip
    columns = {"motor": (u[:, 0], "N m", "input"), "rope_speed": (white(rng, 60 * x[:, 0], 0.1), "m/min", "output")}
    return Case(name, step, columns, text, outside=True, context="closed_loop = true\n")


def wiener_hammerstein(rng: np.random.Generator) -> Case:
    """Two filters with a diode between them (Ljung and Schoukens 2009, Wiener-Hammerstein benchmark).

    The model is linear. The bend lies between the filters, where no entry acts; an input that saturates comes near.
    """
    name, rows, step = "wh_diode", 3600, 2e-4
    u = smooth(rng, rows, 4, 0.9)

    def bend(z: float) -> float:
        return z if z < 0.35 else 0.35 + 0.2 * tanh((z - 0.35) / 0.2)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (u[0] - x[0]) / 9e-4, x[2], 2200.0**2 * (1.3 * bend(x[0]) - x[1]) - 2 * 0.55 * 2200 * x[2]

    x, _ = rk(slope, [0, 0, 0], rows, step, told(u), 10)
    true = {"tf": 9e-4, "wn": 2200.0, "zn": 0.55, "gn": 1.3}
    text = equations("filter chain", off(rng, true, tf="s", wn="rad/s"), {
        "p": ("(gen - p)/tf", 0, "V"), "q": ("r", 0, "V"), "r": ("wn*wn*(gn*p - q) - 2*zn*wn*r", 0, "V/s")},
        {"out_mV": ("1000*q", "mV")})  # fmt: skip
    read = converted(white(rng, 1e3 * x[:, 1], 1.0), -4e3, 4e3, 15)
    columns = {"gen": (u, "V", "input"), "out_mV": (read, "mV", "output")}
    return Case(name, step, columns, text, (), ("input_saturation",), outside=True, time="time [ms]", time_scale=1e3)


def speaker(rng: np.random.Generator) -> Case:
    """A loudspeaker whose suspension stiffens (Klippel 2006, J. Audio Eng. Soc. 54), with a laser in mm.

    The model's suspension is linear and divides forces by a mass in grams, so that a force added there is in mN and the
    coefficient that is asked for in mN/m^3.
    """
    name, rows, step, fine = "speaker_spider", 2900, 4e-4, 10
    volt = Tones.drawn(rng, 18, 300, 30, 7.0, 0.0)
    v = looked_up(volt, rows, step, fine)
    true = {"Re": 4.2, "Le": 0.62, "Bl": 6.1, "Mm": 14.0, "Rm": 1.3, "Km": 1.9}
    cubic = 3.6e7

    def slope(t: float, x: Sequence[float], _: Sequence[float]) -> Sequence[float]:
        return (x[1], (6.1 * x[2] - 1.3 * x[1] - 1900 * x[0] - cubic * x[0] ** 3) / 0.014,
                (v(t) - 4.2 * x[2] - 6.1 * x[1]) / 0.62e-3)  # fmt: skip

    x, _ = rk(slope, [0, 0, 0], rows, step, lambda k, x: (0,), fine)
    text = equations("loudspeaker", off(rng, true, Re="ohm", Le="mH", Bl="N/A", Mm="g", Km="N/mm"), {
        "cone": ("vel", 0, "m"), "vel": ("1000*(Bl*coil - Rm*vel - 1000*Km*cone)/Mm", 0, "m/s"),
        "coil": ("1000*(volt - Re*coil - Bl*vel)/Le", 0, "A")},
        {"excursion": ("1000*cone", "mm"), "current": ("coil", "A")})  # fmt: skip
    clean = {"excursion": 1e3 * x[:, 0], "current": x[:, 2]}
    columns = {"volt": (np.asarray(volt(np.arange(rows) * step)), "V", "input"),
               "excursion": (noisy(rng, clean["excursion"], 0.008), "mm", "output"),
               "current": (noisy(rng, clean["current"], 0.01), "A", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("cubic_stiffness",), (), {"k3": 1e3 * cubic})


def slip(rng: np.random.Generator) -> Case:
    """An induction motor on a converter slips under its load (Leonhard 2001, Control of Electrical Drives, chapter 10).

    The load is recorded, but the model turns with the field whatever it is.
    """
    name, rows, step, fine = "motor_slip", 640, 0.25, 8
    u, torque = plateaus(rng, rows, 25, 22, 50), Tones.drawn(rng, 0.01, 0.8, 24, 14, 55)
    load = looked_up(torque, rows, step, fine)
    x, _ = rk(lambda t, x, u: ((29.9 * u[0] - 0.8 * load(t) - x[0]) / 0.9,), [900], rows, step, told(u), fine)
    true = {"poles": 29.9, "tm": 0.9}
    text = equations("induction motor", off(rng, true, poles="rpm/Hz", tm="s") | {"slip0": free(45, 0, 200, "rpm")},
                     {"n": ("(poles*frequency - slip0 - n)/tm", 900, "rpm")}, {"rev": ("n", "rpm")})  # fmt: skip
    columns = {"frequency": (u, "Hz", "input"),
               "load": (np.asarray(torque(np.arange(rows) * step)), "N m", "disturbance"),
               "rev": (np.round(white(rng, x[:, 0], 0.7)), "rpm", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("missing_disturbance",), (), {"gain": -0.8 / 0.9},
                beside=("sensor_quantisation",))  # fmt: skip


def motor(rng: np.random.Generator, kind: str) -> Case:
    """A motor with a brake on two loggers, or with a tachometer whose zero leaves in the second half.

    The loggers' clocks are 0.06 s apart, so that the motor seems to know its inputs before. A drift that begins
    half-way is no entry's; one over the whole recording comes near.
    """
    name, rows, step, late = {"clock": "two_loggers", "drift": "tacho_drifts"}[kind], 1330, 0.02, 3
    u = np.c_[flips(rng, rows, 11, 3) + plateaus(rng, rows, 60, 4, 16), plateaus(rng, rows, 25, 0, 0.6)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (0.11 * x[1] - 2.2e-3 * x[0] - 0.9 * u[1]) / 0.004, (u[0] - 0.8 * x[1] - 0.11 * x[0]) / 0.02

    x, _ = rk(slope, [60, 2], rows, step, told(u), 12)
    true = {"Jm": 0.004, "kt": 0.11, "bm": 2.2e-3, "Ra": 0.8, "kb": 0.9}
    text = equations("motor with brake", off(rng, true, Jm="kg m2", Ra="ohm") | {"La": known(0.02, "H")}, {
        "w": ("(kt*i - bm*w - kb*brake)/Jm", 60, "rad/s"), "i": ("(arm - Ra*i - kt*w)/La", 2, "A")},
        {"tacho": ("w*30/pi/1000", "V"), "current": ("i", "A")})  # fmt: skip
    clean = {"tacho": x[:, 0] * 30 / pi / 1000, "current": x[:, 1]}
    told_u = u
    if kind == "clock":
        told_u = np.vstack([np.repeat(u[:1], late, axis=0), u[:-late]])
    else:
        clean["tacho"] = clean["tacho"] + 0.25 * np.clip((np.arange(rows) - 700) / 630, 0, None)
    columns = {"arm": (told_u[:, 0], "V", "input"), "brake": (told_u[:, 1], "A", "input"),
               "tacho": (noisy(rng, clean["tacho"], 0.01), "V", "output"),
               "current": (noisy(rng, clean["current"], 0.01), "A", "output")}  # fmt: skip
    if kind == "clock":
        return Case(name, step, columns, text, ("data_time_offset",), (), {"offset_s": -late * step})
    return Case(name, step, columns, text, (), ("sensor_drift",), outside=True)


def buck(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A half bridge with choke and capacitor (Erickson and Maksimović 2001, Fundamentals of Power Electronics).

    Its dead time costs 0.7 V against the current, which no entry has; dry friction is the very same term, though it
    belongs to a motion. The null's bridge has no dead time.
    """
    name, rows, step = "null_buck" if complete else "buck_deadtime", 2750, 2e-5
    drop = 0.0 if complete else 0.7
    load, shake, total = plateaus(rng, rows, 60, -6, 6), flips(rng, rows, 5, 1.5), [50.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = 12 - x[1]
        total[0] += 900 * step * error
        return total[0] + 1.0 * error + shake[k] - 0.4 * (x[0] - load[k]), load[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (0.24 * u[0] - x[1] - 0.09 * x[0] - drop * tanh(x[0] / 0.03)) / 2.2e-4, (x[0] - u[1]) / 4.7e-4

    x, u = rk(slope, [0, 12], rows, step, command, 10)
    true = {"Lf": 0.22, "Cf": 0.47, "Rf": 0.09, "Vin": 24.0}
    text = equations("half bridge", off(rng, true, Lf="mH", Cf="mF", Rf="ohm", Vin="V"), {
        "il": ("1000*(Vin*duty/100 - vc - Rf*il)/Lf", 0, "A"), "vc": ("1000*(il - load)/Cf", 12, "V")},
        {"choke": ("il", "A"), "bus": ("vc", "V")})  # fmt: skip
    clean = {"choke": x[:, 0], "bus": x[:, 1]}
    columns = {"duty": (u[:, 0], "%", "input"), "load": (load, "A", "disturbance"),
               "choke": (converted(white(rng, x[:, 0], 0.03), -20, 20, 12), "A", "output"),
               "bus": (converted(white(rng, x[:, 1], 0.01), 0, 30, 12), "V", "output")}  # fmt: skip
    context = "closed_loop = true\n"
    if complete:
        return Case(name, step, columns, text, context=context, time="time [us]", time_scale=1e6, clean=clean,
                    true=true)  # fmt: skip
    return Case(name, step, columns, text, (), ("coulomb_friction",), outside=True, context=context,
                beside=("sensor_quantisation",), time="time [us]", time_scale=1e6)  # fmt: skip


ELECTRIC: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "wh_diode": (102, wiener_hammerstein), "emps_dry": (104, emps), "speaker_spider": (105, speaker),
    "lift_rope": (120, lift), "motor_slip": (121, slip), "two_loggers": (126, partial(motor, kind="clock")),
    "tacho_drifts": (127, partial(motor, kind="drift")), "hoist_load": (131, hoist), "buck_deadtime": (132, buck),
}  # fmt: skip
