"""Rotors, generators and their loops, of which models lack the wake, the air, a loss or a schedule.

As fourth_author_towers.py. Gusts that the recorded wind does not hold act on the larger rotors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi

import numpy as np
from fourth_author_parts import LOOP, WT, declared, gust, hiss, logged
from second_author_parts import Case, Tones, equations, flips, plateaus
from third_author_parts import looked_up, rk, told


def wake(rng: np.random.Generator) -> Case:
    """A rotor of 2 MW above rated wind whose wake follows the pitch late (Snel and Schepers 1995, ECN-C-94-107).

    Hidden: torque and moment overshoot by a quarter of the settled change and relax over 9 s. Size: 21 % of the
    speed and 20 % of the moment at the recorded pitch. The loop hears the speed with noise; the lidar's wind lacks
    small gusts.
    """
    name, rows, step, fine = "wake_overshoot", 2600, 0.4, 4
    air = Tones.drawn(rng, 0.002, 0.12, 40, 1.3, 15)
    wind, total = looked_up(air, rows, step, fine), [12.0]
    shake, heard, blown = flips(rng, rows, 12, 0.7), hiss(rng, rows, 0.004), gust(rng, rows, 4, 0.12)
    more, tau = 0.25, 9.0

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 1.75
        total[0] += 0.9 * step * error
        return total[0] + 9 * error + shake[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v, felt = wind(t) + u[1] - 15, u[0] - 12 + more * (u[0] - x[1])
        return (118 * v - 105 * felt - 760 * (x[0] - 1.75)) / 6100, (u[0] - x[1]) / tau

    x, u = rk(slope, [1.75, 12.0], rows, step, command, fine)
    v = np.asarray(air(np.arange(rows) * step))
    moment = 9.6 + 0.55 * (v + blown - 15) - 0.78 * (u[:, 0] - 12 + more * (u[:, 0] - x[:, 1]))
    true = {"J": 6.1, "kv": 118.0, "kb": 105.0, "kw": 760.0, "m0": 9.6, "mv": 0.55, "mb": 0.78}
    text = equations("rotor above rated", declared(rng, true, J="1e6 kg m2", m0="MN m"), {
        "om": ("(kv*(wind - 15) - kb*(pitch - 12) - kw*(om - 1.75))/(1000*J)", 1.75, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"),
         "tower_base_moment": ("m0 + mv*(wind - 15) - mb*(pitch - 12)", "MN m")})  # fmt: skip
    speed = (x[:, 0] + heard) * 30 / pi
    columns = {"pitch": (u[:, 0], "deg", "input"), "wind": (np.round(v, 2), "m/s", "disturbance"),
               "rotor_speed": (logged(rng, speed, 0.0, ends=(0, 30), bits=14), "rpm", "output"),
               "tower_base_moment": (logged(rng, moment, 0.03, lag=3), "MN m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("dynamic_inflow",), (), machine=WT, context="blades = 3\n" + LOOP,
                true=true)  # fmt: skip


def thin(rng: np.random.Generator) -> Case:
    """A rotor of 1.5 MW on a tower of known mass, high in the mountains (Burton et al. 2011, chapter 3).

    Hidden: air 5 % thinner than the model's 1.225 kg/m3. Size: 21 % of the speed, 7 % of deflection and moment. The
    torque follows the speed squared, so that the loop is closed; the thrust tells thin air from a worn rotor.
    """
    name, rows, step, fine = "thin_air", 2000, 0.2, 4
    air, k = Tones.drawn(rng, 0.003, 0.35, 40, 1.1, 8.5), 140.0
    wind, angle, shake = looked_up(air, rows, step, fine), plateaus(rng, rows, 45, 0.0, 3.5), flips(rng, rows, 9, 12.0)
    area, blown = pi * 35**2, gust(rng, rows, 4, 0.1)

    def command(n: int, x: Sequence[float]) -> Sequence[float]:
        return 125.0 * x[0] ** 2 + shake[n], angle[n], blown[n]

    def slope(t: float, x: Sequence[float], u: Sequence[float], rho: float = 1.225 * 0.95) -> Sequence[float]:
        v = wind(t) + u[2]
        tip = 35 * x[0] / v
        power = 0.5 * rho * area * (0.46 - 0.012 * (tip - 8) ** 2 - 0.02 * u[1]) * v**3
        thrust = 0.5 * rho * area * (0.78 + 0.03 * (tip - 8) - 0.05 * u[1]) * v**2
        return (power / x[0] / 1e3 - u[0]) / 3200, x[2], (thrust / 1e3 - 18 * x[2] - k * 4.4 * x[1]) / 140

    x, u = rk(slope, [1.85, 0.23, 0], rows, step, command, fine)
    t = np.arange(rows) * step
    true = {"J": 3.2, "ct": 18.0, "hm": 65.0}
    tip, half = "(35*om/wind - 8)", "0.5*1.225*pi*35**2"
    thrust = f"{half}*(0.78 + 0.03*{tip} - 0.05*pitch)*wind**2/1000"
    power = f"{half}*(0.46 - 0.012*{tip}**2 - 0.02*pitch)*wind**3/1000"
    text = equations("rotor on tower", declared(rng, true, J="1e6 kg m2", ct="kN s/m", hm="m"), {
        "om": (f"({power}/om - torque)/(1000*J)", 1.85, "rad/s"),
        "xf": ("vf", 0.23, "m"), "vf": (f"({thrust} - ct*vf - 616*xf)/140", 0, "m/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "tower_top_fa": ("100*xf", "cm"),
         "tower_base_moment": ("hm*616*xf", "kN m")})  # fmt: skip
    columns = {"torque": (u[:, 0], "kN m", "input"), "pitch": (u[:, 1], "deg", "input"),
               "wind": (np.round(air(t), 2), "m/s", "disturbance"),
               "rotor_speed": (logged(rng, x[:, 0] * 30 / pi, 0.01, ends=(0, 40), bits=14, corner=0.4), "rpm",
                               "output"),
               "tower_top_fa": (logged(rng, 100 * x[:, 1], 0.03, corner=0.4), "cm", "output"),
               "tower_base_moment": (logged(rng, 65 * 616 * x[:, 1], 0.02, lag=5, corner=0.4),
                                     "kN m", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("air_density",), (), {"density_change": -0.05}, machine=WT,
                context="blades = 3\n" + LOOP, true=true)  # fmt: skip


def warm(rng: np.random.Generator) -> Case:
    """A direct drive of 100 kW whose converter runs hot (Polinder et al. 2006, IEEE Trans. Energy Conv. 21).

    Hidden: 4 % of the power that the model promises are not there. Size: 4 % of the power. A meter that reads too
    little is the same number, so sensor_scale may stand in.
    """
    name, rows, step, fine = "warm_converter", 1700, 0.25, 4
    air = Tones.drawn(rng, 0.004, 0.3, 40, 1.0, 8.0)
    wind, shake, blown = looked_up(air, rows, step, fine), flips(rng, rows, 8, 0.5), gust(rng, rows, 3, 0.15)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return 0.31 * x[0] ** 2 + shake[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = wind(t) + u[1]
        rotor = 0.5 * 1.225 * pi * 10.5**2 * (0.42 - 0.009 * (10.5 * x[0] / v - 7) ** 2) * v**3 / x[0]
        return ((rotor / 1e3 - 0.12 * x[0] - u[0]) / 32,)

    x, u = rk(slope, [5.2], rows, step, command, fine)
    true = {"J": 32.0, "cm": 0.42, "bf": 0.12}
    rotor = "0.5*1.225*pi*10.5**2*(cm - 0.009*(10.5*om/wind - 7)**2)*wind**3/om/1000"
    text = equations("direct drive", declared(rng, true, J="1000 kg m2", bf="kN m s"), {
        "om": (f"({rotor} - bf*om - torque)/J", 5.2, "rad/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "power": ("0.955*torque*om", "kW")})  # fmt: skip
    power = 0.955 * 0.96 * u[:, 0] * x[:, 0]
    columns = {"torque": (u[:, 0], "kN m", "input"),
               "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
               "rotor_speed": (logged(rng, x[:, 0] * 30 / pi, 0.01, ends=(0, 90), bits=14), "rpm", "output"),
               "power": (logged(rng, power, 0.02, lag=4, ends=(0, 150), bits=13, jitter=0.02),
                         "kW", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("efficiency_loss",), ("sensor_scale",), {"loss": 0.04}, machine=WT,
                context="blades = 3\n" + LOOP, lost=11, true=true)  # fmt: skip


def scheduled(rng: np.random.Generator) -> Case:
    """A rotor of 5 MW whose pitch acts the more the larger it is (Jonkman et al. 2009, NREL/TP-500-38060).

    Hidden: the slope of torque over pitch grows by 4 % a degree around 13 degrees; the model's is constant. Size:
    13 % of the speed at the recorded pitch. A switch between two constant gains is a coarse form of it and may
    stand in. The loop hears noise.
    """
    name, rows, step, fine = "pitch_schedule", 2400, 0.25, 4
    air = Tones.drawn(rng, 0.0015, 0.15, 40, 1.7, 16)
    wind, total = looked_up(air, rows, step, fine), [13.0]
    shake, heard, blown = flips(rng, rows, 16, 0.8), hiss(rng, rows, 0.003), gust(rng, rows, 5, 0.15)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] + heard[k] - 1.267
        total[0] += 2.2 * step * error
        return total[0] + 16 * error + shake[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        b = u[0] - 13
        return ((650 * (wind(t) + u[1] - 16) - 720 * b * (1 + 0.02 * b) - 5100 * (x[0] - 1.267)) / 4.37e4,)

    x, u = rk(slope, [1.267], rows, step, command, fine)
    true = {"J": 43.7, "kv": 650.0, "kb": 720.0, "kw": 5100.0}
    text = equations("rotor", declared(rng, true, J="1e6 kg m2"), {
        "om": ("(kv*(wind - 16) - kb*(pitch - 13) - kw*(om - 1.267))/(1000*J)", 1.267, "rad/s")},
        {"gen_speed": ("97*om*30/pi", "rpm")})  # fmt: skip
    columns = {"pitch": (u[:, 0], "deg", "input"),
               "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
               "gen_speed": (logged(rng, 97 * 30 / pi * (x[:, 0] + heard), 0.0, ends=(0, 2000), bits=15), "rpm",
                             "output")}  # fmt: skip
    return Case(name, step, columns, text, ("aero_nonlinearity",), ("operating_region_switch",), machine=WT,
                context="blades = 3\n" + LOOP, true=true)  # fmt: skip


def drivetrain(rng: np.random.Generator) -> Case:
    """Two masses, a shaft and a brake of a 750 kW turbine (Oyague 2009, NREL/TP-500-41160, GRC); complete.

    Small gusts that the recorded wind lacks act; the torque follows the speed, the brake is set now and then.
    """
    name, rows, step, fine = "null_drivetrain", 2400, 0.05, 12
    air = Tones.drawn(rng, 0.004, 0.5, 40, 1.0, 9.5)
    wind, shake, blown = looked_up(air, rows, step, fine), flips(rng, rows, 7, 6.0), gust(rng, rows, 10, 0.12)
    brake = np.where(plateaus(rng, rows, 80, 0, 1) > 0.75, 45.0, 0.0)
    true = {"Jr": 560.0, "Jg": 380.0, "ks": 2.6e4, "cs": 110.0, "cm": 0.44}

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return 34 * x[1] ** 2 + shake[k], brake[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = wind(t) + u[2]
        rotor = 0.5 * 1.225 * pi * 24**2 * (0.44 - 0.01 * (24 * x[0] / v - 7) ** 2) * v**3 / x[0] / 1e3
        shaft = 2.6e4 * x[2] + 110 * (x[0] - x[1])
        return (rotor - shaft) / 560, (shaft - u[0] - u[1]) / 380, x[0] - x[1]

    x, u = rk(slope, [2.3, 2.3, 0.008], rows, step, command, fine)
    rotor = "0.5*1.225*pi*24**2*(cm - 0.01*(24*wr/wind - 7)**2)*wind**3/wr/1000"
    text = equations("drive train", declared(rng, true, 0.08, Jr="1000 kg m2", Jg="1000 kg m2", ks="kN m/rad"), {
        "wr": (f"({rotor} - ks*tw - cs*(wr - wg))/Jr", 2.3, "rad/s"),
        "wg": ("(ks*tw + cs*(wr - wg) - torque - brake)/Jg", 2.3, "rad/s"), "tw": ("wr - wg", 0.008, "rad")},
        {"rotor_speed": ("wr*30/pi", "rpm"), "gen_speed": ("81.5*wg*30/pi", "rpm")})  # fmt: skip
    columns = {"torque": (u[:, 0], "kN m", "input"), "brake": (u[:, 1], "kN m", "input"),
               "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
               "rotor_speed": (logged(rng, x[:, 0] * 30 / pi, 0.015, ends=(0, 40), bits=14, corner=0.45), "rpm",
                               "output"),
               "gen_speed": (logged(rng, 81.5 * 30 / pi * x[:, 1], 0.008, lag=3, corner=0.45),
                             "rpm", "output")}  # fmt: skip
    return Case(name, step, columns, text, machine=WT, context="blades = 3\n" + LOOP, cuts=(1300,), true=true)


def cooled(rng: np.random.Generator) -> Case:
    """Windings and water jacket of a generator (Boglietti et al. 2009, IEEE Trans. Ind. Electron. 56); complete.

    Draughts that nobody records cool the housing; two recordings with lost rows, a converter of 12 bits.
    """
    name, rows, step, fine = "null_cooling", 1500, 10.0, 4
    air = Tones.drawn(rng, 2e-5, 1e-3, 16, 3, 14)
    out = looked_up(air, rows, step, fine)
    u = np.c_[plateaus(rng, rows, 45, 8, 70), plateaus(rng, rows, 70, 25, 90), gust(rng, rows, 12, 0.25)]
    true = {"Cw": 410.0, "Cj": 260.0, "gw": 0.95, "gf": 0.021, "ua": 0.12}

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        taken, warm = 0.95 * (x[0] - x[1]), 0.021 * u[1] * (x[1] - out(t))
        return (u[0] - taken) / 410, (taken - warm - 0.12 * (x[1] - out(t)) + u[2]) / 260

    x, _ = rk(slope, [80, 40], rows, step, told(u), fine)
    text = equations("generator cooling", declared(rng, true, 0.08, Cw="kJ/K", Cj="kJ/K", gw="kW/K", ua="kW/K"), {
        "tw": ("(loss - gw*(tw - tj))/Cw", 80, "degC"),
        "tj": ("(gw*(tw - tj) - (gf*pump + ua)*(tj - ambient))/Cj", 40, "degC")},
        {"winding": ("tw", "degC"), "jacket": ("tj", "degC")})  # fmt: skip
    columns = {"loss": (u[:, 0], "kW", "input"), "pump": (u[:, 1], "l/min", "input"),
               "ambient": (np.round(air(np.arange(rows) * step), 1), "degC", "disturbance"),
               "winding": (logged(rng, x[:, 0], 0.01, ends=(-20, 180), bits=12), "degC", "output"),
               "jacket": (logged(rng, x[:, 1], 0.012, lag=5, ends=(-20, 120), bits=12), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, cuts=(720,), lost=16, true=true)


ROTORS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "wake_overshoot": (203, wake), "thin_air": (204, thin), "warm_converter": (205, warm),
    "pitch_schedule": (208, scheduled),
}  # fmt: skip
