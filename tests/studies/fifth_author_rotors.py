"""Rotors, drive trains and drives of wind turbines, of which models lack a weight, a loss, a switch or a mode.

As fifth_author_towers.py. With `complete` nothing is hidden, which is a null in fifth_author_nulls.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, pi, sin

import numpy as np
from fifth_author_parts import LOOP, WT, declared, frozen, gust, hiss, logged, turning
from second_author_parts import Case, Tones, equations, flips, known, plateaus, smooth
from third_author_parts import looked_up, rk, told


def heavy(rng: np.random.Generator) -> Case:
    """A rotor of 20 kW with ice on one blade, its speed held by the torque (Manwell et al. 2009, chapter 4).

    Hidden: the weight's torque on the shaft, 230 and -190 N m of cosine and sine once a turn. Size: 11 % of the speed.
    The torque answers the speed that it hears; wind from a mast beside, small gusts are not recorded.
    """
    name, rows, step, fine = "ice_on_blade", 2600, 0.05, 6
    air, even, odd = Tones.drawn(rng, 0.01, 0.8, 40, 0.45, 9), 230.0, -190.0
    wind, heard, blown = looked_up(air, rows, step, fine), hiss(rng, rows, 0.02), gust(rng, rows, 6, 0.06)
    shake, wanted = flips(rng, rows, 15, 60.0), plateaus(rng, rows, 200, 10.3, 11.1)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return 1330 + 900 * (x[0] + heard[k] - wanted[k]) + shake[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = wind(t) + u[1]
        tip = 5 * x[0] / v
        rotor = 0.5 * 1.225 * pi * 25 * (0.42 - 0.014 * (tip - 6) ** 2) * v**3 / x[0]
        return (rotor + even * cos(x[1]) + odd * sin(x[1]) - 8.0 * x[0] - u[0]) / 880, x[0]

    x, u = rk(slope, [10.7, 1.1], rows, step, command, fine)
    true = {"J": 880.0, "bf": 8.0}
    rotor = "0.5*1.225*pi*25*(0.42 - 0.014*(5*om/wind - 6)**2)*wind**3/om"
    text = equations("rotor", declared(rng, true, J="kg m2", bf="N m s"), {
        "om": (f"({rotor} - bf*om - torque)/J", 10.7, "rad/s")}, {"rotor_speed": ("om", "rad/s")})  # fmt: skip
    columns = {"torque": (u[:, 0], "N m", "input"),
               "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
               "azimuth": (np.degrees(x[:, 1]) % 360, "deg", "azimuth"),
               "rotor_speed": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 16), bits=14), "rad/s",
                               "output")}  # fmt: skip
    return Case(name, step, columns, text, ("gravity_1p",), (), {"torque_N_m_cos": even, "torque_N_m_sin": odd},
                machine=WT, context="blades = 2\nrated_speed_rad_s = 11.5\n" + LOOP, true=true)  # fmt: skip


def darrieus(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A rotor of 30 kW on an upright axis, its torque after the speed squared (Paraschivoiu 2002, Wind Turbine Design).

    Hidden: soiled blades take 6 % less power than their curve says. Size: 6 % of either output, and 17 % of the power's
    deviation off its mean. The mast's wind comes in steps of 0.05 m/s; the null's curve is right, its logger filters.
    """
    name, rows, step, fine = "null_upright" if complete else "upright_soiled", 2200, 0.25, 4
    air, worn = Tones.drawn(rng, 0.002, 0.3, 40, 1.5, 9.5), 1.0 if complete else 0.94
    wind, shake, blown = looked_up(air, rows, step, fine), flips(rng, rows, 10, 0.8), gust(rng, rows, 4, 0.12)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return 0.33 * x[0] ** 2 + shake[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = wind(t) + u[1]
        tip = 4.5 * x[0] / v
        rotor = worn * 0.5 * 1.225 * 170 * (0.36 - 0.035 * (tip - 2.4) ** 2) * v**3 / x[0]
        return ((rotor / 1e3 - 0.09 * x[0] - u[0]) / 14,)

    x, u = rk(slope, [5.1], rows, step, command, fine)
    true = {"J": 14.0, "ef": 0.93} | ({"bf": 0.09} if complete else {})
    rotor = "0.5*1.225*170*(0.36 - 0.035*(4.5*om/wind - 2.4)**2)*wind**3/om/1000"
    values = {"bf": known(0.09, "kN m s")} | declared(rng, true, 0.08, J="1000 kg m2", bf="kN m s")
    text = equations("upright rotor", values, {
        "om": (f"({rotor} - bf*om - torque)/J", 5.1, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "power": ("ef*torque*om", "kW")})  # fmt: skip
    v = air(np.arange(rows) * step)
    corner = 0.45 if complete else 0.0
    power = logged(rng, 0.93 * u[:, 0] * x[:, 0], 0.015, lag=4, ends=(-20, 120), bits=13)
    columns = {"torque": (u[:, 0], "kN m", "input"), "wind": (np.round(20 * v) / 20, "m/s", "disturbance"),
               "rotor_speed": (logged(rng, x[:, 0] * 30 / pi, 0.01, ends=(0, 100), bits=13, corner=corner), "rpm",
                               "output"), "power": (power, "kW", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, machine=WT, context="blades = 3\n" + LOOP, cuts=(1100,), lost=8,
                    true=true)  # fmt: skip
    return Case(name, step, columns, text, ("cp_change",), (), {"cp_change": -0.06}, machine=WT,
                context="blades = 3\n" + LOOP, true=true)  # fmt: skip


def region(rng: np.random.Generator) -> Case:
    """A rotor of 600 kW on an induction generator with active stall (Burton et al. 2011, section 6.7).

    Hidden: above 11.5 m/s of the controller's slow wind the pitch acts 45 % less on the torque, as the flow has left
    the blades. Size: 15 % of the speed, 16 % of the power. The wind of the mast drives, too; gusts are not recorded.
    """
    name, rows, step, fine, change, edge = "stall_region", 2400, 0.4, 6, -0.45, 11.5
    air, slow = Tones.drawn(rng, 0.006, 0.4, 40, 0.5, 0.0), 11.4 + smooth(rng, rows, 70, 1.1)
    wind, pitch = looked_up(air, rows, step, fine), plateaus(rng, rows, 16, -4.0, 2.0)
    u, middle = np.c_[pitch, slow, gust(rng, rows, 5, 0.8)], float(np.mean(pitch))

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        gain = 6.5 * (1 + change * (u[1] > edge))
        rotor = 150 + 16 * (wind(t) + u[1] - 11.4) + gain * (u[0] - middle) + u[2]
        return ((rotor - 52 * (x[0] - 2.83)) / 96,)

    x, _ = rk(slope, [5.7], rows, step, told(u), fine)
    true = {"J": 96.0, "q0": 150.0, "kv": 16.0, "kb": 6.5, "sl": 52.0}
    units = {"J": "1000 kg m2", "q0": "kN m", "kv": "kN s", "kb": "kN m/deg"}
    values = declared(rng, true, **units) | {"pm": known(round(middle, 6), "deg")}
    text = equations("stalled rotor", values, {
        "om": ("(q0 + kv*(wind - 11.4) + kb*(pitch - pm) - sl*(om - 2.83))/J", 5.7, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "power": ("0.94*sl*(om - 2.83)*om", "kW")})  # fmt: skip
    power = 0.94 * 52 * (x[:, 0] - 2.83) * x[:, 0]
    columns = {"pitch": (pitch, "deg", "input"),
               "wind": (np.round(air(np.arange(rows) * step) + slow, 2), "m/s", "disturbance"),
               "wind_slow": (np.round(slow, 2), "m/s", "scheduling"),
               "rotor_speed": (logged(rng, x[:, 0] * 30 / pi, 0.01, ends=(0, 100), bits=15), "rpm", "output"),
               "power": (logged(rng, power, 0.015, lag=3, ends=(-200, 1500), bits=13), "kW", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("operating_region_switch",), (),
                {"gain_change": change, "threshold": edge}, machine=WT, context="blades = 3\n", lost=9,
                true=true)  # fmt: skip


def twisting(rng: np.random.Generator) -> Case:
    """Rotor and generator of 1.3 MW on an elastic shaft, geared 1:68 (Boukhezzar et al. 2007, Wind Energy 10).

    Hidden: the shaft twists at 1.69 Hz with a damping of 0.02; the model turns as one. Size: 8 % of the generator's
    speed. The torque follows the generator's speed, as heard, and is shaken; wind from a lidar, small gusts are not
    recorded.
    """
    name, rows, step, fine = "shaft_rings", 2800, 0.05, 8
    air, jr, jg = Tones.drawn(rng, 0.004, 0.5, 40, 0.6, 8.5), 1900.0, 260.0
    w, both = 2 * pi * 1.69, 1900 * 260 / 2160
    wind, heard = looked_up(air, rows, step, fine), hiss(rng, rows, 0.002)
    shake, blown = flips(rng, rows, 9, 26.0), gust(rng, rows, 8, 3.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return 122 * (x[1] + heard[k]) ** 2 + shake[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        rotor = 480 + 118 * (wind(t) - 8.5) - 240 * (x[0] - 1.98) + u[1]
        pull = w * w * both * x[2] + 0.04 * w * both * (x[0] - x[1])
        return (rotor - pull) / jr, (pull - u[0]) / jg, x[0] - x[1]

    x, u = rk(slope, [1.98, 1.98, 480 / (w * w * both)], rows, step, command, fine)
    true = {"J": 2.16, "q0": 480.0, "kv": 118.0, "kw": 240.0}
    units = {"J": "1e6 kg m2", "q0": "kN m", "kv": "kN s", "kw": "kN m s"}
    text = equations("stiff shaft", declared(rng, true, **units), {
        "om": ("(q0 + kv*(wind - 8.5) - kw*(om - 1.98) - torque)/(1000*J)", 1.98, "rad/s")},
        {"generator_speed": ("68*om*30/pi", "rpm"), "rotor_speed": ("om*30/pi", "rpm")})  # fmt: skip
    speed = logged(rng, 68 * (x[:, 1] + heard) * 30 / pi, 0.0, ends=(0, 2000), bits=14)
    columns = {"torque": (u[:, 0], "kN m", "input"),
               "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
               "generator_speed": (speed, "rpm", "output"),
               "rotor_speed": (logged(rng, x[:, 0] * 30 / pi, 0.02, ends=(0, 40), bits=13), "rpm",
                               "output")}  # fmt: skip
    return Case(name, step, columns, text, ("drivetrain_torsion",), ("structural_mode",),
                {"frequency_hz": 1.69}, machine=WT, context="blades = 3\ngearbox_ratio = 68\n" + LOOP,
                true=true)  # fmt: skip


def bearing(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """A pitch drive and its blade behind an elastic gear, in its loop (Bossanyi 2003, Wind Energy 6).

    Hidden: stiff grease in the blade's bearing, 5 kN m s; the motor's own friction, the gear and the motor's inertia
    stand. Size: 24 % of either output, loops with and without 4 %. Gusts on the blade nobody records; the null's model
    has the grease, and the drive stands three times.
    """
    name, rows, step, grease = "null_bearing" if complete else "bearing_grease", 3000, 0.01, 5.0
    wanted, shake, blown = plateaus(rng, rows, 130, 0.02, 0.25), flips(rng, rows, 9, 4.0), gust(rng, rows, 25, 0.25)
    heard, total = hiss(rng, rows, 4e-4), [0.0]
    for k in (640, 1540, 2440) if complete else ():
        wanted[k : k + 150], shake[k : k + 150] = wanted[k], 0.0

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        asked = 300 * (max(min(5 * (wanted[k] - x[0]), 0.14), -0.14) - x[1] - heard[k])
        total[0] = max(min(total[0] + 0.8 * step * asked, 20), -20)
        return max(min(asked + total[0] + shake[k], 60), -60), blown[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        pull = 800 * (x[0] - x[2])
        return x[1], (0.9 * u[0] - 20 * x[1] - pull) / 2.5, x[3], (pull - grease * x[3] - 6 * x[2] + u[1]) / 1.2

    first = wanted[0]
    x, u = rk(slope, [first, 0, first, 0], rows, step, command, 8)
    true = {"Jb": 1.2, "ka": 6.0} | ({"bb": grease} if complete else {})
    pull, more = "kg*(am - ab)", " - bb*wb" if complete else ""
    values = {"Jm": known(2.5, "1000 kg m2"), "kt": known(0.9, "kN m/A"), "bm": known(20), "kg": known(800)} | declared(
        rng, true, 0.08, Jb="1000 kg m2", ka="kN m/rad", bb="kN m s")  # fmt: skip
    text = equations("pitch drive", values, {
        "am": ("wm", first, "rad"), "wm": (f"(kt*current - bm*wm - {pull})/Jm", 0, "rad/s"),
        "ab": ("wb", first, "rad"), "wb": (f"({pull}{more} - ka*ab)/Jb", 0, "rad/s")},
        {"motor_speed": ("wm*180/pi", "deg/s"), "blade_angle": ("ab*180/pi", "deg")})  # fmt: skip
    speed = logged(rng, np.degrees(x[:, 1] + heard), 0.0, ends=(-20, 20), bits=14)
    angle = logged(rng, np.degrees(x[:, 2]), 1e-3, ends=(-10, 100), bits=15)
    columns = {
        "current": (u[:, 0], "A", "input"),
        "motor_speed": (speed, "deg/s", "output"),
        "blade_angle": (angle, "deg", "output"),
    }
    right = () if complete else ("viscous_friction_change",)
    return Case(name, step, columns, text, right, (), {} if complete else {"damping_change": grease}, machine=WT,
                context=LOOP, lost=12, true=true)  # fmt: skip


def quasi(rng: np.random.Generator) -> Case:
    """A rotor of 4 MW above rated wind on a tower that the model thinks stiff (Bianchi et al. 2007, chapter 2).

    Hidden: 0.4 of the moment at the foot goes by a mode at 0.29 Hz with a damping of 0.08, and the converter's torque
    follows with 0.3 s, seen in speed and power. Size: 19 % of the moment, 26 % of the power. The pitch loop hears the
    speed; small gusts act.
    """
    name, rows, step, fine, w, tau, share = "tower_and_torque", 2800, 0.1, 5, 2 * pi * 0.29, 0.3, 0.4
    air, total = Tones.drawn(rng, 0.003, 0.2, 40, 1.2, 15), [11.0]
    wind, heard, blown = looked_up(air, rows, step, fine), hiss(rng, rows, 0.002), gust(rng, rows, 8, 0.1)
    shake, turned = flips(rng, rows, 45, 0.4), flips(rng, rows, 21, 150.0)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 1.4
        total[0] += 1.1 * step * error
        return total[0] + 8 * error + shake[k], 2900 + turned[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v, b = wind(t) + u[2] - 15, u[0] - 11
        load, rotor = 2100 * v - 3300 * b, 2900 + 380 * v - 330 * b - 2300 * (x[0] - 1.4)
        return ((rotor - x[3]) / 9600, x[2], w * w * (load - x[1]) - 0.16 * w * x[2], (u[1] - x[3]) / tau)

    x, u = rk(slope, [1.4, 0, 0, 2900], rows, step, command, fine)
    v = air(np.arange(rows) * step)
    moment = 41e3 + (1 - share) * (2100 * (v + blown - 15) - 3300 * (u[:, 0] - 11)) + share * x[:, 1]
    true = {"J": 9.6, "kv": 380.0, "kb": 330.0, "kw": 2300.0, "m0": 41.0, "mv": 2.1, "mb": 3.3}
    units = {"J": "1e6 kg m2", "m0": "MN m", "mv": "MN s", "mb": "MN m/deg"}
    text = equations("rotor on a stiff tower", declared(rng, true, **units), {
        "om": ("(2900 + kv*(wind - 15) - kb*(pitch - 11) - kw*(om - 1.4) - torque)/(1000*J)", 1.4, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "power": ("0.94*torque*om/1000", "MW"),
         "tower_base_fa_moment": ("m0 + mv*(wind - 15) - mb*(pitch - 11)", "MN m")})  # fmt: skip
    power = 0.94 * x[:, 3] * x[:, 0] / 1e3
    columns = {"pitch": (u[:, 0], "deg", "input"), "torque": (u[:, 1], "kN m", "input"),
               "wind": (np.round(v, 2), "m/s", "disturbance"),
               "rotor_speed": (logged(rng, (x[:, 0] + heard) * 30 / pi, 0.0, ends=(0, 30), bits=15), "rpm", "output"),
               "power": (logged(rng, power, 0.02, ends=(0, 8), bits=14), "MW", "output"),
               "tower_base_fa_moment": (logged(rng, moment / 1e3, 0.03, lag=3), "MN m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("tower_fore_aft", "actuator_lag"), ("structural_mode",),
                {"frequency_hz": 0.29, "tau_s": tau}, machine=WT, context="blades = 3\n" + LOOP, true=true)  # fmt: skip


def teeter(rng: np.random.Generator) -> Case:
    """The yaw motion of a turbine with two blades (Stoddard 1978; Eggleston and Stoddard 1987), outside the catalogue.

    Not in the model: the rotor's inertia about the yaw axis swings twice a turn between blades upright and level, 0.33
    of the mean. Size: 18 % of the angle, 28 % of the rate. The drive's moment shakes it against its spring; gusts are
    not recorded.
    """
    name, rows, step, fine = "yaw_two_blades", 2800, 0.05, 8
    rotor, pushed = turning(rng, rows, step, 3.4, 0.15), Tones.drawn(rng, 0.1, 2.2, 40, 9.0, 0.0)
    u, drive, swing = np.c_[rotor, gust(rng, rows, 6, 0.5)], looked_up(pushed, rows, step, fine), 0.33

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        a = 2 * (u[0] + u[1] * (t - u[2]))
        inertia = 42 * (1 - swing * cos(a))
        rate = 42 * swing * 2 * u[1] * sin(a)
        return x[1], (drive(t) + u[3] - 2100 * x[0] - (60 + rate) * x[1]) / inertia

    x, _ = rk(slope, [0.0, 0.0], rows, step, told(u), fine)
    true = {"Jy": 42.0, "ky": 2100.0, "cy": 60.0}
    text = equations("yaw", declared(rng, true, Jy="1000 kg m2", ky="kN m/rad", cy="kN m s"), {
        "psi": ("om", 0, "rad"), "om": ("(yaw_moment - ky*psi - cy*om)/Jy", 0, "rad/s")},
        {"yaw_angle": ("psi*180/pi", "deg"), "yaw_rate": ("om*180/pi", "deg/s")})  # fmt: skip
    rate = frozen(rng, logged(rng, np.degrees(x[:, 1]), 0.02, lag=4, ends=(-40, 40), bits=14), 2, 14)
    columns = {"yaw_moment": (pushed(np.arange(rows) * step), "kN m", "input"),
               "azimuth": (rotor[:, 0] % (2 * pi), "rad", "azimuth"),
               "yaw_angle": (logged(rng, np.degrees(x[:, 0]), 0.015, ends=(-5, 5), bits=14), "deg", "output"),
               "yaw_rate": (rate, "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, machine=WT,
                context="blades = 2\nrated_speed_rad_s = 3.6\n", true=true)  # fmt: skip


ROTORS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "ice_on_blade": (307, heavy), "upright_soiled": (308, darrieus), "stall_region": (309, region),
    "shaft_rings": (310, twisting), "bearing_grease": (311, bearing), "tower_and_torque": (325, quasi),
    "yaw_two_blades": (329, teeter),
}  # fmt: skip
