"""Towers, blades and platforms of wind turbines, loads of which the models or recordings lack.

Every plant is a function of a random generator that returns its case; with `complete` nothing is hidden, which is a
null in fourth_author_nulls.py. A size is the deviation of what the effect changes over that of the output.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, pi, sin, sqrt, tanh

import numpy as np
from fourth_author_parts import LOOP, WT, declared, gust, logged
from second_author_parts import Case, Tones, equations, flips, known, plateaus, smooth
from textbook_plants import Array
from third_author_parts import looked_up, rk, told


def turned(rng: np.random.Generator, rows: int, step: float, mean: float, rms: float) -> Array:
    """Return the angle of a rotor at the rows, its speed until the next and the time of the row (N, 3)."""
    speed = mean + smooth(rng, rows, 12 / step, rms)
    angle = rng.uniform(0, 6) + np.r_[0, np.cumsum(speed)[:-1]] * step
    return np.column_stack([angle, speed, np.arange(rows) * step])


def lines(rng: np.random.Generator) -> Case:
    """A tower of 850 kW that the blades' shadow and an unequal blade shake (Hansen 2015, Aerodynamics of Turbines).

    Hidden: the shadow's dip in the fore-aft force, three times a turn, and the force of the static moment on
    side-side, once a turn. Size: 19 % of the fore-aft and 20 % of the side-side acceleration. Gusts that nobody
    records push both ways.
    """
    name, rows, step, fine = "tower_two_lines", 3200, 0.05, 6
    push, twist = Tones.drawn(rng, 0.01, 1.6, 40, 7.0, 62), Tones.drawn(rng, 0.01, 1.2, 30, 42, 260)
    thrust, torque = looked_up(push, rows, step, fine), looked_up(twist, rows, step, fine)
    rotor = turned(rng, rows, step, 2.55, 0.11)
    seen = np.c_[rotor, gust(rng, rows, 12, 700.0), gust(rng, rows, 12, 220.0)]
    dip, q, even, odd = 1900.0, 0.42, 95.0, -60.0

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        a = u[0] + u[1] * (t - u[2])
        c = cos(3 * a)
        shadow = dip * ((1 + q * q) * c + 2 * q) / (1 + 2 * q * c + q * q) ** 2
        side = u[1] ** 2 * (even * cos(a) + odd * sin(a))
        return (x[1], (1e3 * thrust(t) + shadow + u[3] - 9200 * x[1] - 1.12e6 * x[0]) / 6.1e4,
                x[3], (33.0 * torque(t) + side + u[4] - 4100 * x[3] - 1.12e6 * x[2]) / 6.1e4)  # fmt: skip

    x, _ = rk(slope, [0.055, 0, 0.008, 0], rows, step, told(seen), fine)
    t = np.arange(rows) * step
    acc = np.array([slope(a, b, c) for a, b, c in zip(t, x.tolist(), seen.tolist(), strict=True)])[:, [1, 3]]
    true = {"mt": 6.1e4, "kt": 1.12e6, "cf": 9200.0, "cs": 4100.0, "gt": 33.0}
    fore, side = "(1000*thrust - cf*vf - kt*xf)/mt", "(gt*torque - cs*vs - kt*xs)/mt"
    text = equations("tower", declared(rng, true, mt="kg", kt="N/m", cf="N s/m", cs="N s/m"), {
        "xf": ("vf", 0.055, "m"), "vf": (fore, 0, "m/s"), "xs": ("vs", 0.008, "m"), "vs": (side, 0, "m/s")},
        {"tower_top_fa_acc": (fore, "m/s2"), "tower_top_ss_acc": (side, "m/s2")})  # fmt: skip
    columns = {"thrust": (np.asarray(push(t)), "kN", "input"), "torque": (np.asarray(twist(t)), "kN m", "input"),
               "azimuth": (np.degrees(rotor[:, 0]) % 360, "deg", "azimuth")}  # fmt: skip
    for k, key in enumerate(("tower_top_fa_acc", "tower_top_ss_acc")):
        columns[key] = (logged(rng, acc[:, k], 0.02, ends=(-2, 2), bits=14, corner=0.45), "m/s2", "output")
    return Case(name, step, columns, text, ("tower_shadow", "mass_imbalance"), (),
                {"force_N_cos": dip, "static_moment_cos": even}, machine=WT,
                context="blades = 3\nrated_speed_rad_s = 2.7\n", true=true)  # fmt: skip


def yawed(rng: np.random.Generator) -> Case:
    """Two blades that flap and stiffen as they turn, in a rotor askew to the wind (Eggleston and Stoddard 1987).

    Hidden: a swing once a turn of either blade's load with a part left and right (skewed wake) and one up and down,
    which is as wind shear. Size: 8 % of either moment. The load acts behind the blade's own motion, so no value is
    asked for.
    """
    name, rows, step, fine = "blade_askew", 2600, 0.05, 6
    air = Tones.drawn(rng, 0.005, 0.9, 40, 1.2, 11)
    wind, rotor = looked_up(air, rows, step, fine), turned(rng, rows, step, 4.3, 0.22)
    u = np.c_[plateaus(rng, rows, 90, 0.5, 5.0), rotor, gust(rng, rows, 6, 0.8), gust(rng, rows, 6, 0.8)]
    w0, lateral, vertical = 2 * pi * 1.55, 1.5, 1.1

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        a, found = u[1] + u[2] * (t - u[3]), []
        for k in (0, 1):
            b = a + pi * k
            load = 14.5 * wind(t) - 6.2 * u[0] + lateral * sin(b) + vertical * cos(b) + u[4 + k]
            m, dm = x[2 * k], x[2 * k + 1]
            found += [dm, w0**2 * load - 0.56 * w0 * dm - (w0**2 + 1.45 * u[2] ** 2) * m]
        return found

    x, _ = rk(slope, [110, 0, 110, 0], rows, step, told(u), fine)
    true = {"f0": 1.55, "ze": 0.28, "ks": 1.45, "gv": 14.5, "gp": 6.2}
    states, outputs = {}, {}
    for k in (1, 2):
        pull = "(2*pi*f0)**2*(gv*wind - gp*pitch)"
        states[f"m{k}"] = (f"d{k}", 110.0, "kN m")
        rest = f"2*ze*2*pi*f0*d{k} - ((2*pi*f0)**2 + ks*rotor_speed**2)*m{k}"
        states[f"d{k}"] = (f"{pull} - {rest}", 0.0, "kN m/s")
        outputs[f"blade{k}_flap_moment"] = (f"m{k}", "kN m")
    text = equations("flapping blades", declared(rng, true, f0="Hz", gv="kN s", gp="kN m/deg"), states, outputs)
    columns = {"wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
               "pitch": (u[:, 0], "deg", "input"), "rotor_speed": (rotor[:, 1], "rad/s", "disturbance"),
               "azimuth": (rotor[:, 0] % (2 * pi), "rad", "azimuth")}  # fmt: skip
    for k in (1, 2):
        read = logged(rng, x[:, 2 * k - 2], 0.02, lag=4, ends=(-50, 350), bits=13, jitter=0.02)
        columns[f"blade{k}_flap_moment"] = (read, "kN m", "output")
    return Case(name, step, columns, text, ("yaw_misalignment",), (), beside=("wind_shear",), machine=WT,
                context="blades = 2\nrated_speed_rad_s = 4.4\n", lost=9, true=true)  # fmt: skip


def monopile(rng: np.random.Generator) -> Case:
    """A tower on a monopile in a sea whose height is recorded (Jonkman and Musial 2010, OC3, NREL/TP-5000-48191).

    Hidden: the waves' force, by height and by its slope (Morison). Size: 13 % of the displacement, 8 % of the
    acceleration. Any force of a recorded disturbance is the same statement, so missing_disturbance may stand in.
    """
    name, rows, step, fine = "monopile_sea", 2400, 0.1, 6
    push, sea = Tones.drawn(rng, 0.005, 0.6, 40, 55, 430), Tones.drawn(rng, 0.085, 0.24, 30, 0.42, 0.0)
    thrust, height = looked_up(push, rows, step, fine), looked_up(sea, rows, step, fine)
    table = np.gradient(np.asarray(sea(np.arange(2 * fine * rows + 3) * step / fine / 2)), step / fine / 2).tolist()
    w, mass, by_height, by_slope = 2 * pi * 0.277, 4.2e5, 9e3, 1.3e4

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        wave = by_height * height(t) + by_slope * table[int(t * fine * 2 / step + 0.5)]
        return x[1], (1e3 * thrust(t) + wave + u[0] - mass * (w**2 * x[0] + 0.09 * w * x[1])) / mass

    blown = gust(rng, rows, 15, 6e3)
    x, _ = rk(slope, [0.3, 0], rows, step, told(blown), fine)
    t = np.arange(rows) * step
    acc = np.array([slope(a, b, [c])[1] for a, b, c in zip(t, x.tolist(), blown, strict=True)])
    true = {"mt": 420.0, "kt": 420.0 * w**2, "ct": 420.0 * 0.09 * w}
    motion = "(thrust - kt*xf - ct*vf)/mt"
    text = equations("monopile tower", declared(rng, true, mt="t", kt="kN/m", ct="kN s/m"), {
        "xf": ("vf", 0.3, "m"), "vf": (motion, 0, "m/s")},
        {"tower_top_fa": ("100*xf", "cm"), "tower_top_fa_acc": (motion, "m/s2")})  # fmt: skip
    columns = {"thrust": (np.asarray(push(t)), "kN", "input"),
               "wave_elevation": (np.round(sea(t), 2), "m", "disturbance"),
               "tower_top_fa": (logged(rng, 100 * x[:, 0], 0.03, corner=0.4), "cm", "output"),
               "tower_top_fa_acc": (logged(rng, acc, 0.02, ends=(-5, 5), bits=14, corner=0.4),
                                    "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("wave_load",), ("missing_disturbance",), machine=WT,
                context="blades = 3\noffshore = true\n", true=true)  # fmt: skip


def sampled(rng: np.random.Generator) -> Case:
    """A rotor of 5 MW whose blades cut through turbulence (Burton et al. 2011, Wind Energy Handbook, section 5.7).

    Hidden: thrust and torque at three times the rotor's angle, with sizes that wander and a mean of nothing. Size:
    12 % of the tower's acceleration, 1 % of the speed. A loop holds the speed by the pitch.
    """
    name, rows, step, fine = "gusts_sampled", 2800, 0.1, 5
    air = Tones.drawn(rng, 0.004, 0.4, 40, 1.0, 16)
    wind, total, shake = looked_up(air, rows, step, fine), [13.0], flips(rng, rows, 14, 0.35)
    wander, blown = [smooth(rng, rows, 60, 1.0) for _ in (0, 1)], gust(rng, rows, 25, 4.0)
    size, angle = 7.5, [0.4]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = x[0] - 1.267
        total[0] += 1.6 * step * error
        return total[0] + 14 * error + shake[k], wander[0][k], wander[1][k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        load = u[1] * cos(3 * x[3]) + u[2] * sin(3 * x[3])
        thrust = 58 * (wind(t) - 16) - 64 * (u[0] - 13) + size * load + u[3]
        torque = 640 * (wind(t) - 16) - 730 * (u[0] - 13) - 5200 * (x[0] - 1.267) + 3 * size * load
        return torque / 4.37e4, x[2], (thrust - 74 * x[2] - 1690 * x[1]) / 400, x[0]

    x, u = rk(slope, [1.267, 0, 0, angle[0]], rows, step, command, fine)
    t = np.arange(rows) * step
    acc = np.array([slope(a, b, c)[2] for a, b, c in zip(t, x.tolist(), u.tolist(), strict=True)])
    true = {"J": 43.7, "kv": 640.0, "kb": 730.0, "kw": 5200.0, "mt": 400.0, "kt": 1690.0, "ct": 74.0, "tb": 64.0}
    tower = "(58*(wind - 16) - tb*(pitch - 13) - ct*vf - kt*xf)/mt"
    text = equations("turbine above rated", declared(rng, true, mt="t", kt="kN/m", ct="kN s/m"), {
        "om": ("(kv*(wind - 16) - kb*(pitch - 13) - kw*(om - 1.267))/(1000*J)", 1.267, "rad/s"),
        "xf": ("vf", 0, "m"), "vf": (tower, 0, "m/s")},
        {"gen_speed": ("97*om*30/pi", "rpm"), "tower_fa_acc": (tower, "m/s2")})  # fmt: skip
    columns = {"pitch": (u[:, 0], "deg", "input"), "wind": (np.round(air(t), 2), "m/s", "disturbance"),
               "azimuth": (np.degrees(x[:, 3]) % 360, "deg", "azimuth"),
               "gen_speed": (logged(rng, 97 * 30 / pi * x[:, 0], 0.01, ends=(0, 1600)), "rpm", "output"),
               "tower_fa_acc": (logged(rng, acc, 0.03, ends=(-2, 2), bits=13), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("rotational_sampling",), (), machine=WT,
                context="blades = 3\nrated_speed_rad_s = 1.267\n" + LOOP, true=true)  # fmt: skip


def bearing(rng: np.random.Generator) -> Case:
    """A pitch bearing under its blade's bending (Stammler et al. 2018, Wind Energy Science 3).

    Its friction swings with the blade's azimuth, as the bending moment does, by 20 % to either side; the model's
    friction stays the same, which no entry has. Size: 27 % of the pitch rate at the recorded current; the loop
    leaves 2 % of it and 8 % of the current. The drive follows cyclic pitch in a loop.
    """
    name, rows, step = "bearing_azimuth", 3000, 0.02
    rotor = turned(rng, rows, step, 1.3, 0.05)
    wanted = 6 + 1.6 * np.sin(rotor[:, 0] + 1.1) + smooth(rng, rows, 90, 0.6)
    shake, load, rate = flips(rng, rows, 9, 1.5), gust(rng, rows, 50, 0.15), [0.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        rate[0] = 6.0 * (wanted[k] - x[0])
        return 9.0 * (rate[0] - x[1]) + shake[k], rotor[k, 0], load[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        rub = 6.5 * (1 + 0.2 * cos(u[1])) * tanh(x[1] / 0.05)
        return x[1], (u[0] - 0.9 * x[1] - rub - u[2]) / 0.38

    x, u = rk(slope, [float(wanted[0]), 0], rows, step, command, 16)
    true = {"Jp": 0.38, "bp": 0.9, "fp": 6.5}
    text = equations("pitch bearing", declared(rng, true, fp="A"), {
        "beta": ("rate", float(wanted[0]), "deg"), "rate": ("(motor - bp*rate - fp*tanh(rate/0.05))/Jp", 0, "deg/s")},
        {"pitch_angle": ("beta", "deg"), "pitch_rate": ("rate", "deg/s")})  # fmt: skip
    columns = {"motor": (u[:, 0], "A", "input"), "azimuth": (np.degrees(rotor[:, 0]) % 360, "deg", "azimuth"),
               "pitch_angle": (logged(rng, x[:, 0], 0.004, ends=(-10, 100), bits=16), "deg", "output"),
               "pitch_rate": (logged(rng, x[:, 1], 0.02, ends=(-20, 20), bits=14), "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, machine=WT, context="blades = 3\n" + LOOP, true=true)


def damped(rng: np.random.Generator) -> Case:
    """A tower with a tuned mass damper (Den Hartog 1956, Mechanical Vibrations, chapter 3); complete.

    Wind that nobody records pushes with 5 % of the thrust; three recordings, a filter against aliases.
    """
    name, rows, step, fine = "null_tmd", 2700, 0.1, 6
    push = Tones.drawn(rng, 0.01, 1.2, 44, 40, 350)
    thrust, blown = looked_up(push, rows, step, fine), gust(rng, rows, 10, 2.0)
    m1, m2 = 310.0, 9.5
    k1, k2 = m1 * (2 * pi * 0.34) ** 2, m2 * (2 * pi * 0.33) ** 2
    true = {"m1": m1, "k1": k1, "c1": 26.0, "m2": m2, "k2": k2, "c2": 2 * 0.09 * sqrt(k2 * m2)}

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        link = k2 * (x[2] - x[0]) + true["c2"] * (x[3] - x[1])
        return x[1], (thrust(t) + u[0] + link - 26.0 * x[1] - k1 * x[0]) / m1, x[3], -link / m2

    x, _ = rk(slope, [0.25, 0, 0.25, 0], rows, step, told(blown), fine)
    t = np.arange(rows) * step
    acc = np.array([slope(a, b, [c])[1] for a, b, c in zip(t, x.tolist(), blown, strict=True)])
    link = "(k2*(x2 - x1) + c2*(v2 - v1))"
    motion = f"(thrust + {link} - c1*v1 - k1*x1)/m1"
    text = equations("tower with damper", declared(rng, true, 0.08, m1="t", m2="t", k1="kN/m", k2="kN/m"), {
        "x1": ("v1", 0.25, "m"), "v1": (motion, 0, "m/s"), "x2": ("v2", 0.25, "m"), "v2": (f"-{link}/m2", 0, "m/s")},
        {"tower_acc": (motion, "m/s2"), "damper_stroke": ("100*(x2 - x1)", "cm")})  # fmt: skip
    columns = {"thrust": (np.asarray(push(t)), "kN", "input"),
               "tower_acc": (logged(rng, acc, 0.02, lag=3, ends=(-2, 2), bits=14, corner=0.4), "m/s2", "output"),
               "damper_stroke": (logged(rng, 100 * (x[:, 2] - x[:, 0]), 0.015, ends=(-150, 150), bits=13, corner=0.4),
                                 "cm", "output")}  # fmt: skip
    return Case(name, step, columns, text, machine=WT, context="blades = 3\n", cuts=(900, 1800), true=true)


def platform(rng: np.random.Generator) -> Case:
    """Pitch of a floating platform on a catenary mooring (Jonkman 2010, NREL/TP-500-47535); complete.

    Drag and the mooring's cubic stiffness are in the model. A broad sea and wind push that nobody records.
    """
    name, rows, step = "null_platform", 1500, 1.0
    u = np.c_[plateaus(rng, rows, 70, 250, 800) + flips(rng, rows, 14, 60), gust(rng, rows, 2.5, 1.5)]
    true = {"Ip": 1.2e4, "cl": 230.0, "cq": 1.2e4, "kp": 690.0, "k3": 9000.0}

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        back = 230 * x[1] + 1.2e4 * x[1] * abs(x[1]) + 690 * x[0] + 9000 * x[0] ** 3
        return x[1], (0.09 * u[0] + u[1] - back) / 1.2e4

    x, _ = rk(slope, [0.06, 0], rows, step, told(u), 4)
    values = declared(rng, true, 0.08, Ip="1e6 kg m2", kp="MN m/rad", k3="MN m/rad3") | {"hub": known(90.0, "m")}
    text = equations("platform pitch", values, {
        "th": ("om", 0.06, "rad"),
        "om": ("(hub*thrust/1000 - cl*om - cq*om*abs(om) - kp*th - k3*th**3)/Ip", 0, "rad/s")},
        {"tilt": ("th*180/pi", "deg"), "tilt_rate": ("om*180/pi", "deg/s")})  # fmt: skip
    clean = {"tilt": np.degrees(x[:, 0]), "tilt_rate": np.degrees(x[:, 1])}
    columns = {"thrust": (u[:, 0], "kN", "input"),
               "tilt": (logged(rng, clean["tilt"], 0.02, ends=(-30, 30), bits=12, jitter=0.02), "deg", "output"),
               "tilt_rate": (logged(rng, clean["tilt_rate"], 0.03, lag=5, jitter=0.02), "deg/s", "output")}  # fmt: skip
    return Case(name, step, columns, text, machine="floating platform", lost=14, true=true)


TOWERS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "tower_two_lines": (201, lines), "blade_askew": (202, yawed), "monopile_sea": (206, monopile),
    "gusts_sampled": (207, sampled), "bearing_azimuth": (227, bearing),
}  # fmt: skip
