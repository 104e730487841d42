"""Systems of eighth_author.py whose models are complete: whatever is named there is a false name.

Declared values are up to 8 % off, numbers of linear models up to 4 %, frequencies up to 0.4 %. The recordings have what
those of public rigs have: coloured noise, converters of few bits, few rows, several recordings, lost rows, loops that
hear noise, and what drives a plant and nobody records. Three models are linear in discrete time, one is a law without
states, one is of a wind turbine.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sin, sqrt

import numpy as np
from eighth_author_parts import Makers, behind, each, levels, prbs
from second_author_parts import Case, Column, Tones, equations, flips, known, plateaus, smooth, state_space
from seventh_author_parts import sampled
from sixth_author_parts import LOOP, WT, declared, fixed, gust, hiss, logged, modes, skewed, slopes
from third_author_parts import looked_up, rk, told


def four(rng: np.random.Generator) -> Case:
    """Four tanks and two pumps (Johansson 2000, IEEE Trans. Control Syst. Techn. 8), one recording of 1500 rows."""
    name, rows, step = "null_four_tanks", 1500, 2.0
    u = np.c_[levels(rng, rows, 75, (2.6, 2.9, 3.2, 3.5)), np.round(plateaus(rng, rows, 90, 2.5, 3.6), 2)]
    u = np.c_[u, gust(rng, rows, 8, 0.03)]
    out = (0.95, 0.78, 0.71, 0.57)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        a, b, c, d = (n * sqrt(max(h, 0.01) * 2 * 9.81) for n, h in zip(out, x, strict=True))
        left, right = 3.33 * (u[0] + u[2]), 3.35 * u[1]
        return (c - a + 0.62 * left) / 28, (d - b + 0.6 * right) / 32, (0.4 * right - c) / 28, (0.38 * left - d) / 32

    x, _ = rk(slope, [9, 10, 2.2, 3.2], rows, step, told(u), 5)
    true = {"k1": 3.33, "k2": 3.35} | {f"a{n + 1}": a for n, a in enumerate(out)}
    values = {"A1": fixed(rng, 28.0, "cm2", 0.01), "A2": fixed(rng, 32.0, "cm2", 0.01)} | declared(rng, true, 0.06)
    run = {n: f"a{n}*sqrt(19.62*max(h{n}, 0.01))" for n in range(1, 5)}
    text = equations("four tanks", values, {
        "h1": (f"({run[3]} - {run[1]} + 0.62*k1*pump1)/A1", 9, "cm"),
        "h2": (f"({run[4]} - {run[2]} + 0.6*k2*pump2)/A2", 10, "cm"),
        "h3": (f"(0.4*k2*pump2 - {run[3]})/A1", 2.2, "cm"), "h4": (f"(0.38*k1*pump1 - {run[4]})/A2", 3.2, "cm")},
        {f"level{n}": (f"h{n}", "cm") for n in range(1, 5)})  # fmt: skip
    columns: dict[str, Column] = {f"pump{k + 1}": (np.round(u[:, k], 2), "V", "input") for k in (0, 1)}
    columns |= {f"level{k + 1}": (logged(rng, x[:, k], 0.03, ends=(0, 32), bits=13), "cm", "output") for k in range(4)}
    return Case(name, step, columns, text, true=true)


def lab(rng: np.random.Generator) -> Case:
    """Two transistors that heat a pocket board (Park et al. 2020, the temperature control lab), two recordings."""
    name, rows, step = "null_pocket_heater", 720, 5.0
    u = np.c_[levels(rng, rows, 50, (0, 30, 55, 80)), levels(rng, rows, 36, (0, 25, 50)), gust(rng, rows, 10, 0.02)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        lost = [0.013 * (v - 22) + 7.2e-11 * ((v + 273.15) ** 4 - 295.15**4) for v in x[:2]]
        across = 0.025 * (x[0] - x[1])
        return ((0.011 * u[0] + u[2] - lost[0] - across) / 2.0, (0.0075 * u[1] + u[2] - lost[1] + across) / 2.0,
                (x[0] - x[2]) / 18, (x[1] - x[3]) / 18)  # fmt: skip

    x, _ = rk(slope, [22.0] * 4, rows, step, told(u), 6)
    true = {"al": 11.0, "be": 7.5, "ua": 13.0, "us": 25.0, "ts": 18.0}
    values = {"Cp": fixed(rng, 2.0, "J/K", 0.01), "er": known(7.2, "1e-11 W/K4")} | declared(
        rng, true, 0.08, al="mW/%", be="mW/%", ua="mW/K", us="mW/K", ts="s")  # fmt: skip
    lost = {n: f"(ua/1000*(T{n} - 22) + 1e-11*er*((T{n} + 273.15)**4 - 295.15**4))" for n in (1, 2)}
    text = equations("pocket heater", values, {
        "T1": (f"(al/1000*heater1 - {lost[1]} - us/1000*(T1 - T2))/Cp", 22, "degC"),
        "T2": (f"(be/1000*heater2 - {lost[2]} + us/1000*(T1 - T2))/Cp", 22, "degC"),
        "S1": ("(T1 - S1)/ts", 22, "degC"), "S2": ("(T2 - S2)/ts", 22, "degC")},
        {"sensor1": ("S1", "degC"), "sensor2": ("S2", "degC")})  # fmt: skip
    columns: dict[str, Column] = {f"heater{k + 1}": (u[:, k], "%", "input") for k in (0, 1)}
    columns |= {f"sensor{k}": (np.round((x[:, k + 1] + 0.15 * rng.standard_normal(rows)) / 0.32) * 0.32, "degC",
                             "output") for k in (1, 2)}  # fmt: skip
    return Case(name, step, columns, text, beside=("sensor_quantisation",), verdicts=("named",), cuts=(360,), true=true)


def discs(rng: np.random.Generator) -> Case:
    """Three discs on elastic belts (Landau et al. 1995, European J. Control 1, flexible transmission), two loads."""
    name, rows, step, w, z = "null_elastic_belts", 1530, 0.05, 2 * pi * np.array([1.25, 3.1]), np.array([0.03, 0.022])
    turn, rub = np.round(prbs(rng, rows + 2, 4, -1.0, 1.0), 3), gust(rng, rows, 4, 0.012)
    drive, seen = np.array([[24.0], [-37.0]]), np.array([[1.0, 0.8]])

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        given = u[0] + u[1]
        return (x[2], x[3], 24 * given - w[0] ** 2 * x[0] - 2 * z[0] * w[0] * x[2],
                -37 * given - w[1] ** 2 * x[1] - 2 * z[1] * w[1] * x[3])  # fmt: skip

    x, _ = rk(slope, [0] * 4, rows, step, told(np.c_[turn[:rows], rub]), 8)
    y = x[:, :2] @ seen.T
    a, b, c, _ = modes(each(rng, w.tolist(), 0.003), each(rng, z.tolist(), 0.08), drive * skewed(rng, 1, 0.03), seen)
    inner = sampled(a, b, c, step)
    model = state_space(step, {"axis": "V"}, {"position": "V"}, behind(*inner[:3], 2))
    columns: dict[str, Column] = {
        "axis": (turn[2 : rows + 2], "V", "input"),
        "position": (logged(rng, y[:, 0], 0.02, lag=2, ends=(-5, 5), bits=12), "V", "output")}  # fmt: skip
    return Case(name, step, columns, model, cuts=(510, 1020))


def gas(rng: np.random.Generator) -> Case:
    """A small gas furnace whose off-gas is analysed (Box, Jenkins and Reinsel 1994, series J), 296 rows of 9 s.

    The model is linear with three samples of dead time; what drives the plant otherwise is as large as a sixth of it.
    """
    name, rows, step, late = "null_gas_rate", 296, 9.0, 3
    rate = np.round(smooth(rng, rows + late, 6, 1.0) + smooth(rng, rows + late, 2, 0.3), 3)
    air = gust(rng, rows, 5, 0.16)

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return (-1.9 * u[0] + u[1] - x[0]) / 13, (x[0] - x[1]) / 8

    x, _ = rk(slope, [0, 0], rows, step, told(np.c_[rate[:rows], air]), 6)
    slow, quick = each(rng, [13.0, 8.0], 0.04)
    a, b = np.array([[-1 / slow, 0], [1 / quick, -1 / quick]]), np.array([[-1.9 * skewed(rng, 1, 0.04) / slow], [0]])
    inner = sampled(a, b, np.array([[0.0, 1.0]]), step)
    model = state_space(step, {"gas_rate": "ft3/min"}, {"carbon_dioxide": "%"}, behind(*inner[:3], late))
    columns: dict[str, Column] = {"gas_rate": (rate[late : rows + late], "ft3/min", "input"),
                                  "carbon_dioxide": (logged(rng, x[:, 1], 0.03, ends=(-12.8, 12.8), bits=8), "%",
                                                     "output")}  # fmt: skip
    return Case(name, step, columns, model, beside=("sensor_quantisation",), verdicts=("named",))


def lens(rng: np.random.Generator) -> Case:
    """The arm of a CD player in its loops, two coils and two errors (Callafon et al. 1994; De Moor 1997), 2048 rows."""
    name, rows, step = "null_disc_arm", 2048, 5e-4
    w, z = 2 * pi * np.array([38.0, 52.0, 240.0]), np.array([0.12, 0.10, 0.03])
    drive = np.array([[3.2e4, 2e3], [-1.5e3, 2.6e4], [9e4, 1.4e5]])
    seen = np.array([[1.0, 0.05, 0.12], [0.08, 1.0, -0.2]])
    shake = np.c_[prbs(rng, rows, 3, -0.5, 0.5), prbs(rng, rows, 5, -0.5, 0.5)]
    heard, bumps, last = np.c_[hiss(rng, rows, 0.004), hiss(rng, rows, 0.004)], gust(rng, rows, 10, 0.02), [0.0, 0.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        now = seen @ np.asarray(x[:3]) + heard[k]
        rise, last[0], last[1] = now - np.asarray(last), float(now[0]), float(now[1])
        return [*np.round(shake[k] - 0.25 * now - 0.6 * rise, 3).tolist(), bumps[k]]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        q, v = np.asarray(x[:3]), np.asarray(x[3:])
        return [*x[3:], *(drive @ (np.asarray(u[:2]) + u[2]) - w * w * q - 2 * z * w * v).tolist()]

    x, u = rk(slope, [0] * 6, rows, step, command, 6)
    y = x[:, :3] @ seen.T + heard
    wrong = np.array([[skewed(rng, 1, 0.02)], [skewed(rng, 1, 0.02)], [skewed(rng, 1, 0.04)]])
    a, b, c, _ = modes(each(rng, w.tolist(), 0.004), each(rng, z.tolist(), 0.06), drive * wrong, seen)
    ways = {"coil1": "V", "coil2": "V"}, {"track": "um", "focus": "um"}
    columns: dict[str, Column] = {f"coil{k + 1}": (u[:, k], "V", "input") for k in (0, 1)}
    columns |= {n: (logged(rng, y[:, k], 0.0, ends=(-4, 4), bits=12), "um", "output") for k, n in enumerate(ways[1])}
    return Case(name, step, columns, state_space(step, *ways, sampled(a, b, c, step)), context=LOOP)


def rotors(rng: np.random.Generator) -> Case:
    """A beam with two propellers on a pillar, in its loop (Feedback Instruments' twin rotor rig; Christensen 2006)."""
    name, rows, step, total, last = "null_twin_rotor", 1800, 0.05, [0.55, 0.0], [0.0, 0.0]
    wanted = np.c_[plateaus(rng, rows, 130, -0.15, 0.25), plateaus(rng, rows, 150, -0.5, 0.5)]
    shake, air = np.c_[flips(rng, rows, 9, 0.10), flips(rng, rows, 11, 0.12)], gust(rng, rows, 8, 3e-3)
    heard = np.c_[hiss(rng, rows, 1e-3), hiss(rng, rows, 1e-3)]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        found = []
        for n in (0, 1):
            error = wanted[k, n] - x[2 * n] - heard[k, n]
            total[n] += (0.16, 0.10)[n] * step * error
            rise, last[n] = (x[2 * n] + heard[k, n] - last[n]) / step, x[2 * n] + heard[k, n]
            asked = total[n] + (0.5, 0.5)[n] * error - (0.35, 0.6)[n] * rise + shake[k, n]
            found.append(round(max(min(asked, 1.5), -1.5), 3))
        return [*found, air[k]]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        lift, side = 0.42 * x[4] * abs(x[4]), 0.19 * x[5] * abs(x[5])
        return (x[1], (lift + u[2] - 0.13 - 0.32 * sin(x[0]) - 0.035 * x[1]) / 0.075,
                x[3], (side - 0.05 * lift + 0.0065 - 0.055 * x[3] + u[2]) / 0.068,
                (u[0] - x[4]) / 0.42, (u[1] - x[5]) / 0.28)  # fmt: skip

    x, u = rk(slope, [0, 0, 0, 0, 0.556, 0], rows, step, command, 6)
    true = {"kl": 0.42, "gm": 0.32, "bp": 0.035, "ks": 0.19, "by": 0.055, "kr": 0.05, "t1": 0.42, "t2": 0.28}
    values = {"Jp": fixed(rng, 0.075, "kg m2", 0.02), "Jy": fixed(rng, 0.068, "kg m2", 0.02)}
    values |= declared(rng, true, 0.05)
    text = equations("twin rotor", values, {
        "p": ("vp", 0, "rad"), "vp": ("(kl*n1*abs(n1) - 0.13 - gm*sin(p) - bp*vp)/Jp", 0, "rad/s"),
        "y": ("vy", 0, "rad"), "vy": ("(ks*n2*abs(n2) - kr*kl*n1*abs(n1) + 0.0065 - by*vy)/Jy", 0, "rad/s"),
        "n1": ("(main - n1)/t1", 0.556, ""), "n2": ("(tail - n2)/t2", 0, "")},
        {"pitch_angle": ("p*180/pi", "deg"), "yaw_angle": ("y*180/pi", "deg")})  # fmt: skip
    columns: dict[str, Column] = {"main": (u[:, 0], "V", "input"), "tail": (u[:, 1], "V", "input")}
    columns |= {n: (logged(rng, np.degrees(x[:, 2 * k] + heard[:, k]), 0.0, ends=(-180, 180), bits=12), "deg", "output")
                for k, n in enumerate(("pitch_angle", "yaw_angle"))}  # fmt: skip
    return Case(name, step, columns, text, context=LOOP, lost=8, true=true)


def tyre(rng: np.random.Generator) -> Case:
    """A racing tyre on a flat-track machine (Milliken and Milliken 1995, chapter 2), a law without states, 6 sweeps."""
    name, lengths, step = "null_flat_track", (120,) * 6, 0.05
    rows = sum(lengths)
    t = np.arange(rows) * step
    slip = np.round(6.5 * np.sin(2 * pi * t / 6) * (0.55 + 0.45 * np.sin(2 * pi * t / 37)), 2)
    load = np.round(np.repeat([0.7, 1.1, 0.9, 1.6, 1.3, 0.5], 120) * (1 + smooth(rng, rows, 6, 0.01)), 3)
    side = 1.55 * load * (1 - 0.09 * (load - 1)) * np.tanh(0.42 * slip) + 0.012 * load
    true = {"mu": 1.55, "kz": 0.09, "ca": 0.42, "cy": 0.012}
    text = equations("racing tyre", declared(rng, true, 0.08), {}, {
        "side": ("mu*load*(1 - kz*(load - 1))*tanh(ca*slip) + cy*load", "kN")})  # fmt: skip
    columns: dict[str, Column] = {
        "slip": (slip, "deg", "input"),
        "load": (load, "kN", "input"),
        "side": (logged(rng, side, 0.025, lag=3, ends=(-4, 4), bits=12), "kN", "output"),
    }
    return Case(name, step, columns, text, cuts=(120, 240, 360, 480, 600), true=true)


def hydro(rng: np.random.Generator) -> Case:
    """A water turbine of 12 MW on its penstock and an island's grid (Kundur 1994, chapter 9), in its speed loop."""
    name, rows, step, total = "null_penstock", 2000, 0.1, [0.7]
    load, shake = np.round(plateaus(rng, rows, 110, 6.5, 9.5), 2), flips(rng, rows, 20, 0.02)
    heard, flicker = hiss(rng, rows, 3e-4), gust(rng, rows, 10, 0.06)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = 1 - x[1] - heard[k]
        total[0] = min(max(total[0] + 0.18 * step * error, 0.1), 1.1)
        return round(min(max(total[0] + 1.1 * error + shake[k], 0.1), 1.1), 4), load[k], flicker[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        head = (x[0] / x[2]) ** 2
        excess = 12 * x[0] * head - 1.1 - (u[1] + u[2]) - 7 * (x[1] - 1)
        return (1 - head - 0.06 * x[0] * x[0]) / 1.25, excess / (12 * 8.5), (u[0] - x[2]) / 0.35

    x, u = rk(slope, [0.7, 1.0, 0.72], rows, step, command, 8)
    head = (x[:, 0] / x[:, 2]) ** 2
    true = {"tw": 1.25, "kf": 0.06, "pl": 1.1, "dg": 7.0, "ta": 8.5, "ts": 0.35}
    values = {"ta": fixed(rng, 8.5, "s", 0.02)} | declared(
        rng, {k: true[k] for k in ("tw", "kf", "pl", "dg", "ts")}, 0.08, tw="s", pl="MW", dg="MW", ts="s"
    )
    text = equations("penstock and turbine", values, {
        "q": ("(1 - (q/g)**2 - kf*q*q)/tw", 0.7, ""),
        "w": ("(12*q*(q/g)**2 - pl - load - dg*(w - 1))/(12*ta)", 1, ""), "g": ("(gate - g)/ts", 0.72, "")},
        {"frequency": ("50*w", "Hz"), "pressure": ("62*(q/g)**2", "m")})  # fmt: skip
    columns: dict[str, Column] = {
        "gate": (u[:, 0], "", "input"), "load": (load, "MW", "disturbance"),
        "frequency": (logged(rng, 50 * (x[:, 1] + heard), 0.0, ends=(40, 60), bits=14), "Hz", "output"),
        "pressure": (logged(rng, 62 * head, 0.03, lag=2, ends=(0, 128), bits=12), "m", "output")}  # fmt: skip
    return Case(name, step, columns, text, context=LOOP, cuts=(1000,), true=true)


def turbine(rng: np.random.Generator) -> Case:
    """A rotor of 2.5 MW below rated wind, torque after the speed squared (Bianchi et al. 2007), two recordings."""
    name, rows, step, fine, w = "null_part_load", 3000, 0.1, 4, 2 * pi * 0.38
    air, shake = Tones.drawn(rng, 0.004, 0.4, 50, 0.8, 8.5), flips(rng, rows, 40, 25.0)
    wind, heard, blown = looked_up(air, rows, step, fine), hiss(rng, rows, 1.5e-3), gust(rng, rows, 8, 0.06)
    pitch = np.round(plateaus(rng, rows, 200, -0.5, 2.0), 2)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        return round(300 * (x[0] + heard[k]) ** 2 + shake[k], 1), pitch[k], blown[k]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        v = wind(t) + u[2] - x[2]
        torque = 9.6 * v * v * (1 - 0.055 * u[1]) - 4.4 * v * 50 * (x[0] - 1.5) / 10
        return (torque - u[0]) / 4400, x[2], (3.1 * v * v * (1 - 0.05 * u[1]) - 5.0 * x[2]) / 210 - w * w * x[1]

    x, u = rk(slope, [1.5, 224 / (210 * w * w), 0], rows, step, command, fine)
    acc = slopes(slope, step, x, u)[:, 2]
    true = {"kq": 9.6, "kl": 22.0, "kt": 3.1, "bq": 0.055, "bt": 0.05, "ct": 5.0, "ft": 0.38, "J": 4.4, "mt": 210.0}
    values = {"J": fixed(rng, 4.4, "1e6 kg m2", 0.02), "mt": fixed(rng, 210.0, "t", 0.02), "ef": known(0.94)}
    values |= declared(rng, {k: true[k] for k in ("kq", "kl", "kt", "bq", "bt", "ct")}, 0.04)
    values |= declared(rng, {"ft": 0.38}, 0.02, ft="Hz")
    v = "(wind - vf)"
    fore = f"((kt*{v}**2*(1 - bt*pitch) - ct*vf)/mt - (2*pi*ft)**2*xf)"
    text = equations("rotor at part load", values, {
        "om": (f"(kq*{v}**2*(1 - bq*pitch) - kl*{v}*(om - 1.5) - torque)/(1000*J)", 1.5, "rad/s"),
        "xf": ("vf", 224 / (210 * w * w), "m"), "vf": (fore, 0, "m/s")},
        {"rotor_speed": ("om*30/pi", "rpm"), "power": ("ef*torque*om", "kW"),
         "tower_top_fa_acc": (fore, "m/s2")})  # fmt: skip
    columns: dict[str, Column] = {
        "torque": (u[:, 0], "kN m", "input"), "pitch": (pitch, "deg", "input"),
        "wind": (np.round(air(np.arange(rows) * step), 2), "m/s", "disturbance"),
        "rotor_speed": (logged(rng, (x[:, 0] + heard) * 30 / pi, 0.0, ends=(0, 30), bits=14), "rpm", "output"),
        "power": (logged(rng, 0.94 * u[:, 0] * x[:, 0], 0.02, ends=(0, 4000), bits=13), "kW", "output"),
        "tower_top_fa_acc": (logged(rng, acc, 0.04, lag=2, ends=(-2, 2), bits=13), "m/s2", "output")}  # fmt: skip
    return Case(name, step, columns, text, machine=WT, context="blades = 3\n" + LOOP, cuts=(1500,), true=true)


NULLS: Makers = {
    "null_four_tanks": (632, four), "null_pocket_heater": (633, lab), "null_elastic_belts": (634, discs),
    "null_gas_rate": (635, gas), "null_disc_arm": (636, lens), "null_twin_rotor": (637, rotors),
    "null_flat_track": (638, tyre), "null_penstock": (639, hydro), "null_part_load": (640, turbine),
}  # fmt: skip
