"""Machines that move in a loop or under wind: a pendulum, a ship, a drone, a bridge crane, a belt, a satellite.

Every plant is a function of a random generator that returns its case; with `complete` nothing is hidden, which is a
null in fourth_author_nulls.py. A size is the deviation of what the effect changes over that of the output.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, sin, tanh

import numpy as np
from fourth_author_parts import LOOP, declared, gust, hiss, logged
from second_author_parts import Case, Tones, equations, flips, known, plateaus
from third_author_parts import looked_up, rk, told


def pendulum(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A rod that a cart balances, voltages to 10 V (Quanser IP02; Åström and Murray 2008, Feedback Systems, ch. 2).

    Hidden: 0.7 N of dry friction on the rail. Size: without it the loop moves the rod by 19 % and the cart by 9 %
    otherwise. The model of the null has it. Encoders are heard by the loop and a shaking rod nobody records.
    """
    name, rows, step = "null_pendulum" if complete else "cart_rail", 2400, 0.01
    wanted, shake, air = plateaus(rng, rows, 220, -0.15, 0.15), flips(rng, rows, 8, 0.9), gust(rng, rows, 20, 0.02)
    gain, last = (-28.3, -24.8, -83.2, -14.9), [0.0, 0.0, 0.0, 0.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        seen = [round(x[0] / 2.3e-5) * 2.3e-5, round(x[2] / 1.534e-3) * 1.534e-3]
        for j in (0, 1):  # speeds by a filtered difference
            last[2 + j] += 0.4 * ((seen[j] - last[j]) / step - last[2 + j])
            last[j] = seen[j]
        asked = -sum(a * b for a, b in zip(gain, (seen[0] - wanted[k], last[2], seen[1], last[3]), strict=True))
        return max(min(asked + shake[k], 10), -10), air[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        s, c = sin(x[2]), cos(x[2])
        push = 1.73 * u[0] - 5.4 * x[1] - 0.7 * tanh(x[1] / 2e-3)
        acc = (push + 0.23 * 0.33 * x[3] ** 2 * s - 0.23 * 9.81 * s * c) / (0.94 + 0.23 * s * s)
        return x[1], acc, x[3], (9.81 * s - acc * c) / 0.33 - 0.05 * x[3] + u[1]

    x, u = rk(slope, [0, 0, 0.01, 0], rows, step, command, 16)
    true = {"mc": 0.94, "bv": 5.4, "le": 0.33} | ({"fr": 0.7} if complete else {})
    dry = " - fr*tanh(v/0.002)" if complete else ""
    push = f"(kf*amp - bv*v{dry} + mp*le*om**2*sin(th) - mp*9.81*sin(th)*cos(th))/(mc + mp*sin(th)**2)"
    values = declared(rng, true, 0.08 if complete else 0.1, mc="kg", bv="N s/m", le="m")
    text = equations("pendulum on a cart", values | {"kf": known(1.73, "N/V"), "mp": known(0.23, "kg")}, {
        "p": ("v", 0, "m"), "v": (push, 0, "m/s"), "th": ("om", 0.01, "rad"),
        "om": (f"(9.81*sin(th) - {push}*cos(th))/le - 0.05*om", 0, "rad/s")},
        {"cart": ("1000*p", "mm"), "rod": ("th*180/pi", "deg")})  # fmt: skip
    columns = {"amp": (u[:, 0], "V", "input"),
               "cart": (logged(rng, 1e3 * x[:, 0], 0.0, ends=(-376.8, 376.8), bits=15), "mm", "output"),
               "rod": (logged(rng, np.degrees(x[:, 2]), 0.0, ends=(-180, 180), bits=12), "deg", "output")}  # fmt: skip
    coarse = ("sensor_quantisation",)
    if complete:
        return Case(name, step, columns, text, context=LOOP, beside=coarse, verdicts=("named",), cuts=(1200,),
                    true=true)  # fmt: skip
    return Case(name, step, columns, text, ("coulomb_friction",), ("stiction",), {"force_N": 0.7}, context=LOOP,
                beside=coarse, true=true)  # fmt: skip


def ship(rng: np.random.Generator) -> Case:
    """A coaster on its autopilot (Nomoto et al. 1957; Fossen 2011, Handbook of Marine Craft, section 7.2).

    Hidden: the steering gear turns the rudder by 4 degrees a second at most. Size: 22 % of the yaw rate at the
    recorded rudder, 16 % between the loops with and without it. Waves that nobody records yaw the ship.
    """
    name, rows, step, rate = "rudder_gear", 1900, 1.0, 4.0
    wanted, shake = plateaus(rng, rows, 110, -14, 14), flips(rng, rows, 14, 4.0)
    sea, heard = gust(rng, rows, 3, 0.006), hiss(rng, rows, 0.05)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        asked = 1.4 * (wanted[k] - x[0] - heard[k]) - 12 * x[1] + shake[k]
        return max(min(asked, 35), -35), sea[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (0.11 * x[2] - x[1] - 0.35 * x[1] ** 3) / 26 + u[1], max(min(20 * (u[0] - x[2]), rate), -rate)

    x, u = rk(slope, [0, 0, 0], rows, step, command, 16)
    true = {"Kn": 0.11, "Tn": 26.0, "al": 0.35}
    text = equations("steering", declared(rng, true, Kn="1/s", Tn="s"), {
        "psi": ("r", 0, "deg"), "r": ("(Kn*rudder - r - al*r**3)/Tn", 0, "deg/s")},
        {"heading": ("psi", "deg"), "yaw_rate": ("r", "deg/s")})  # fmt: skip
    columns = {"rudder": (u[:, 0], "deg", "input"),
               "heading": (logged(rng, x[:, 0] + heard, 0.0, ends=(-180, 180), bits=14), "deg", "output"),
               "yaw_rate": (logged(rng, x[:, 1], 0.02, lag=3, ends=(-5, 5), bits=13), "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("rate_limit",), (), {"rate_per_s": rate}, context=LOOP, lost=8, true=true)


def drone(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Height of a drone in its loop (Mahony, Kumar and Corke 2012, IEEE Robotics and Automation Magazine 19).

    Hidden: motors and their controllers follow the throttle as a second order of 24 rad/s, damping 0.65; the
    model's thrust is immediate. Size: 62 % of the acceleration, 3 % of the height. The null's motors lag 60 ms,
    which its model has. Gusts act.
    """
    name, rows, step = "null_drone" if complete else "drone_motors", 2200, 0.02
    wanted, shake = plateaus(rng, rows, 160, 1.2, 3.0), flips(rng, rows, 9, 2.2)
    air, heard = gust(rng, rows, 25, 0.12), hiss(rng, rows, 0.004)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        return 1.18 * (9.81 + max(min(2.2 * error, 1.2), -1.2) - 2.4 * x[1]) / 0.24 + shake[k], air[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        if complete:
            return x[1], (0.24 * x[2] - 0.35 * x[1]) / 1.18 - 9.81 + u[1], (u[0] - x[2]) / 0.06, 0.0
        return (x[1], (0.24 * x[2] - 0.35 * x[1]) / 1.18 - 9.81 + u[1],
                x[3], 24.0**2 * (u[0] - x[2]) - 2 * 0.65 * 24 * x[3])  # fmt: skip

    hover = 1.18 * 9.81 / 0.24
    x, u = rk(slope, [2.0, 0, hover, 0], rows, step, command, 6)
    acc = np.array([slope(0, a, b)[1] for a, b in zip(x.tolist(), u.tolist(), strict=True)]) + 9.81
    true = {"md": 1.18, "cd": 0.35} | ({"tm": 0.06} if complete else {})
    push = f"(kT*{'thr' if complete else 'throttle'} - cd*v)/md"
    states = {"z": ("v", 2.0, "m"), "v": (f"{push} - 9.81", 0.0, "m/s")}
    if complete:
        states["thr"] = ("(throttle - thr)/tm", hover, "%")
    values = declared(rng, true, 0.08 if complete else 0.1, md="kg", cd="N s/m", tm="s") | {"kT": known(0.24, "N/%")}
    text = equations("drone", values, states, {"height": ("z", "m"), "acc": (push, "m/s2")})
    columns = {"throttle": (u[:, 0], "%", "input"),
               "height": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 8), bits=14), "m", "output"),
               "acc": (logged(rng, acc, 0.05, lag=3 if complete else 0, ends=(-40, 40), bits=16),
                       "m/s2", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, context=LOOP, lost=15, true=true)
    return Case(name, step, columns, text, ("actuator_second_order",), (), {"omega_rad_s": 24.0}, context=LOOP,
                true=true)  # fmt: skip


def crane(rng: np.random.Generator) -> Case:
    """A container bridge whose crab and load feel the wind (Sakawa and Shindo 1982, Automatica 18).

    The fault: the wind's force comes in with the opposite sign. Size: 26 % of the crab's speed, 48 % of the sway.
    Everything else is as modelled.
    """
    name, rows, step, fine = "crane_wind", 1500, 0.2, 5
    u = np.c_[plateaus(rng, rows, 40, -9, 9), gust(rng, rows, 5, 0.15)]
    storm = Tones.drawn(rng, 0.004, 0.5, 36, 0.5, 0.9)
    wind = looked_up(storm, rows, step, fine)

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        w = wind(t)
        acc = (u[0] + 0.3 * w - 4.2 * x[0] + 7.5 * 9.81 * x[1] + u[1]) / 11
        return acc, x[2], (-9.81 * x[1] - acc + w / 7.5) / 12.5 - 0.05 * x[2]

    x, _ = rk(slope, [0, 0, 0], rows, step, told(u), fine)
    true = {"mb": 11.0, "bb": 4.2, "lr": 12.5, "br": 0.05}
    acc = "(drive + 0.3*wind - bb*v + 7.5*9.81*th)/mb"
    text = equations("container bridge", declared(rng, true, mb="t", bb="kN s/m", lr="m"), {
        "v": (acc, 0, "m/s"), "th": ("om", 0, "rad"),
        "om": (f"(-9.81*th - {acc} + wind/7.5)/lr - br*om", 0, "rad/s")},
        {"crab_speed": ("v", "m/s"), "sway": ("th*180/pi", "deg")})  # fmt: skip
    columns = {"drive": (u[:, 0], "kN", "input"),
               "wind": (-np.asarray(storm(np.arange(rows) * step)), "kN", "disturbance"),
               "crab_speed": (logged(rng, x[:, 0], 0.015, ends=(-8, 8), bits=13, corner=0.45), "m/s", "output"),
               "sway": (logged(rng, np.degrees(x[:, 1]), 0.02, lag=4, corner=0.45, jitter=0.01),
                        "deg", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_sign",), (), headings=True, true=true)


def belt(rng: np.random.Generator) -> Case:
    """A carriage on a toothed belt behind its drive (Hace, Jezernik and Šabanović 2007, IEEE Trans. Ind. Electron. 54).

    Hidden: 6 N of dry friction on the carriage and a bus cycle of 5 ms before the current acts. Size: without
    friction the loop turns the motor by 18 % otherwise, without the dead time by 14 %. The speed loop hears the
    motor's encoder.
    """
    name, rows, step, rub = "belt_axis", 3000, 0.002, 6.0
    wanted, shake = plateaus(rng, rows, 260, 0.0, 0.3), flips(rng, rows, 7, 1.2)
    past, heard = [0.0] * 4, hiss(rng, rows, 0.0015)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        speed = max(min(18 * (wanted[k] - x[0]), 0.7), -0.7)
        past.append(max(min(4.5 * (speed - x[1] - heard[k]) + shake[k], 9), -9))
        return past[-1], past[-3], past[-4], k * step

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        amp = u[2] if t - u[3] < 0.5 * step - 1e-9 else u[1]
        pull = 9.0e4 * (x[0] - x[2]) + 70 * (x[1] - x[3])
        return x[1], (21 * amp - pull - 4 * x[1]) / 1.7, x[3], (pull - 9 * x[3] - rub * tanh(x[3] / 1e-3)) / 3.1

    first = float(wanted[0])
    x, u = rk(slope, [first, 0, first, 0], rows, step, command, 16)
    true = {"mm": 1.7, "mc": 3.1, "kb": 9.0, "cb": 70.0, "bm": 4.0, "bc": 9.0}
    pull = "(10000*kb*(xm - xc) + cb*(vm - vc))"
    values = declared(rng, true, mm="kg", mc="kg", kb="N/(0.1 mm)") | {"kf": known(21.0, "N/A")}
    text = equations("belt axis", values, {
        "xm": ("vm", first, "m"), "vm": (f"(kf*current - {pull} - bm*vm)/mm", 0, "m/s"),
        "xc": ("vc", first, "m"), "vc": (f"({pull} - bc*vc)/mc", 0, "m/s")},
        {"motor_speed": ("vm", "m/s"), "carriage": ("1000*xc", "mm")})  # fmt: skip
    columns = {"current": (u[:, 0], "A", "input"),
               "motor_speed": (logged(rng, x[:, 1] + heard, 0.0, ends=(-2, 2), bits=15), "m/s", "output"),
               "carriage": (logged(rng, 1e3 * x[:, 2], 4e-4, ends=(-100, 500), bits=16), "mm", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("coulomb_friction", "transport_delay"), ("stiction",),
                {"force_N": rub, "delay_s": 2.5 * step}, context=LOOP, true=true)  # fmt: skip


def satellite(rng: np.random.Generator) -> Case:
    """One axis of a satellite under its reaction wheel (Sidi 1997, Spacecraft Dynamics and Control, chapter 7).

    The fault: the gyroscope drifts by 5e-6 degrees a second each second, a star tracker does not. Size: 5 % of the
    gyroscope. The loop hears both; the pull of the sun and of gravity wanders and nobody records it.
    """
    name, rows, step, drift = "gyro_drifts", 2200, 1.0, 5e-6
    wanted, shake = plateaus(rng, rows, 150, -6, 6), flips(rng, rows, 17, 1.2)
    pull, stars, hum = gust(rng, rows, 300, 0.05), hiss(rng, rows, 0.01), hiss(rng, rows, 0.002)
    zero = drift * np.arange(rows) * step

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        gyro, error = x[1] + hum[k] + zero[k], wanted[k] - x[0] - stars[k]
        return max(min(2.2 * error - 60 * gyro, 12), -12) + shake[k], pull[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return x[1], (u[0] + u[1]) / 14 * 0.0573 - 2e-4 * x[1]

    x, u = rk(slope, [0, 0], rows, step, command, 4)
    true = {"Is": 14.0, "zs": 2e-4}
    text = equations("satellite axis", declared(rng, true, Is="kg m2"), {
        "th": ("om", 0, "deg"), "om": ("wheel/1000/Is*180/pi - zs*om", 0, "deg/s")},
        {"star_tracker": ("th", "deg"), "gyro": ("om", "deg/s")})  # fmt: skip
    columns = {"wheel": (u[:, 0], "mN m", "input"),
               "star_tracker": (logged(rng, x[:, 0] + stars, 0.0, ends=(-20, 20), bits=15), "deg", "output"),
               "gyro": (logged(rng, x[:, 1] + hum + zero, 0.0, ends=(-1, 1), bits=14), "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("sensor_drift",), (), {"rate_per_s": drift}, context=LOOP, true=true)


MACHINES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "cart_rail": (209, pendulum), "rudder_gear": (210, ship), "drone_motors": (211, drone),
    "crane_wind": (212, crane), "belt_axis": (213, belt), "gyro_drifts": (214, satellite),
}  # fmt: skip
