"""Heat, yeast, paper and electricity: what their models or recordings lack.

As fourth_author_processes.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi

import numpy as np
from fourth_author_parts import LOOP, declared, gust, hiss, logged
from fourth_author_processes import basin, canal, glucose, mixer, room
from second_author_parts import Case, Tones, equations, flips, plateaus
from third_author_parts import looked_up, rk, told


def exchanger(rng: np.random.Generator) -> Case:
    """Two streams in a plate heat exchanger, one lump each (Roetzel and Xuan 1999, Dynamic Behaviour).

    The fault: the thermometers of the two outlets are under each other's name. Size: 119 % of either outlet. The
    hot inlet is recorded; fouling that wanders is not.
    """
    name, rows, step, fine = "outlets_swapped", 1200, 2.0, 6
    inlet = Tones.drawn(rng, 5e-4, 0.02, 20, 3.0, 70)
    hot = looked_up(inlet, rows, step, fine)
    u = np.c_[plateaus(rng, rows, 30, 0.35, 0.9), plateaus(rng, rows, 24, 0.4, 1.1), gust(rng, rows, 20, 0.4)]

    def slope(t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        over = 1.9 * ((hot(t) + x[0]) / 2 - (14 + x[1]) / 2) + u[2]
        return (4.18 * u[0] * (hot(t) - x[0]) - over) / 34, (over - 4.18 * u[1] * (x[1] - 14)) / 41

    x, _ = rk(slope, [48, 34], rows, step, told(u), fine)
    true = {"UA": 1.9, "Ch": 34.0, "Cc": 41.0}
    over = "UA*((inlet + th)/2 - (14 + tc)/2)"
    text = equations("plate exchanger", declared(rng, true, UA="kW/K", Ch="kJ/K", Cc="kJ/K"), {
        "th": (f"(4.18*hot_flow*(inlet - th) - {over})/Ch", 48, "degC"),
        "tc": (f"({over} - 4.18*cold_flow*(tc - 14))/Cc", 34, "degC")},
        {"hot_outlet": ("th", "degC"), "cold_outlet": ("tc", "degC")})  # fmt: skip
    columns = {"hot_flow": (u[:, 0], "kg/s", "input"), "cold_flow": (u[:, 1], "kg/s", "input"),
               "inlet": (np.round(inlet(np.arange(rows) * step), 2), "degC", "disturbance"),
               "hot_outlet": (logged(rng, x[:, 1], 0.02, ends=(0, 100), bits=12), "degC", "output"),
               "cold_outlet": (logged(rng, x[:, 0], 0.02, ends=(0, 100), bits=12), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("data_channel_swap",), (), true=true)


def dryer(rng: np.random.Generator) -> Case:
    """A drying cylinder of a paper machine in its loop (Karlsson 2000, Papermaking Part 2: Drying).

    Hidden: the positioner adds 0.25 of what the demand was over its mean in the last 150 s. Size: 42 % of the
    temperature at the recorded steam. The web's moisture takes heat and is recorded, draughts are not.
    """
    name, rows, step, more, tau = "dryer_trim", 2200, 5.0, 0.25, 150.0
    wet, wanted = plateaus(rng, rows, 55, 18, 34), plateaus(rng, rows, 160, 108, 118)
    shake, heard, blown = flips(rng, rows, 15, 4.0), hiss(rng, rows, 0.15), gust(rng, rows, 25, 0.6)
    total = [52.0]

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = wanted[k] - x[0] - heard[k]
        total[0] += 0.012 * step * error
        return max(min(total[0] + 1.1 * error + shake[k], 100), 0), wet[k], blown[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        acting = u[0] + more * x[1]
        return (3.4 * acting - 1.15 * (x[0] - 40) - 2.6 * u[1] - 20 - u[2]) / 190, (u[0] - 52 - x[1]) / tau

    x, u = rk(slope, [112, 0], rows, step, command, 4)
    true = {"gs": 3.4, "Cd": 190.0, "ud": 1.15, "qw": 2.6, "q0": 20.0}
    text = equations("drying cylinder", declared(rng, true, gs="kW/%", Cd="kJ/K", ud="kW/K", qw="kW/%", q0="kW"), {
        "T": ("(gs*steam - ud*(T - 40) - qw*moisture - q0)/Cd", 112, "degC")}, {"shell": ("T", "degC")})  # fmt: skip
    columns = {"steam": (u[:, 0], "%", "input"), "moisture": (wet, "%", "disturbance"),
               "shell": (logged(rng, x[:, 0] + heard, 0.0, ends=(0, 200), bits=13), "degC", "output")}  # fmt: skip
    return Case(name, step, columns, text, ("controller_state",), (), context=LOOP, true=true)


def yeast(rng: np.random.Generator) -> Case:
    """A fermenter that is fed and drawn from (Bailey and Ollis 1986, Biochemical Engineering; Andrews 1968).

    Much sugar slows the yeast, which no entry has; the model grows after Monod. Size: 18 % of the sugar, 2 % of the
    biomass. The growth wanders with what nobody records.
    """
    name, rows, step = "yeast_inhibited", 1300, 600.0
    u = np.c_[plateaus(rng, rows, 45, 0.06, 0.20), plateaus(rng, rows, 60, 8, 24), gust(rng, rows, 20, 0.003)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        s = max(x[1], 0.0)
        grown = (0.42 * s / (0.9 + s + s * s / 14) + u[2]) * x[0]
        return (grown - u[0] * x[0]) / 3600, (u[0] * (u[1] - x[1]) - grown / 0.48) / 3600

    x, _ = rk(slope, [7.0, 0.6], rows, step, told(u), 8)
    true = {"mu": 0.42, "Ks": 0.9, "Yx": 0.48}
    grown = "mu*max(S,0)/(Ks + max(S,0))*X"
    text = equations("fermenter", declared(rng, true, mu="1/h", Ks="g/l"), {
        "X": (f"({grown} - dilution*X)/3600", 7.0, "g/l"),
        "S": (f"(dilution*(feed - S) - {grown}/Yx)/3600", 0.6, "g/l")},
        {"biomass": ("X", "g/l"), "sugar": ("S", "g/l")})  # fmt: skip
    columns = {"dilution": (u[:, 0], "1/h", "input"), "feed": (u[:, 1], "g/l", "input"),
               "biomass": (logged(rng, x[:, 0], 0.02, lag=3), "g/l", "output"),
               "sugar": (logged(rng, x[:, 1], 0.02, ends=(0, 32), bits=13), "g/l", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, lost=9, true=true)


def transformer(rng: np.random.Generator) -> Case:
    """A transformer of 230 V at its knee (Chapman 2011, Electric Machinery Fundamentals, chapter 2), with a load.

    Beyond 0.95 V s the core takes much more current, which no entry has; the model's inductance is constant. Size:
    18 % of the primary current. The mains swell and dip, the load's current is recorded.
    """
    name, rows, step, fine = "transformer_knee", 3000, 4e-4, 6
    swell, share = Tones.drawn(rng, 0.8, 9, 16, 18, 305), Tones.drawn(rng, 0.5, 20, 20, 1.2e-3, 4e-3)
    t = np.arange(2 * fine * rows + 3) * step / fine / 2
    mains = np.asarray(swell(t)) * np.sin(2 * pi * 50 * t)
    taken = mains * np.asarray(share(t))
    v, second = mains.tolist(), taken.tolist()

    def core(x: float) -> float:
        return x / 1.6 + 0.3 * (x / 0.95) ** 9

    def slope(t: float, x: Sequence[float], _: Sequence[float]) -> Sequence[float]:
        k = int(t * fine * 2 / step + 0.5)
        return (v[k] - 2.4 * (core(x[0]) + second[k]),)

    first = -float(swell(0.0)) / (2 * pi * 50)
    x, _ = rk(slope, [first], rows, step, lambda k, x: (0,), fine)
    u, load = mains[:: 2 * fine][:rows], taken[:: 2 * fine][:rows]
    current = np.array([core(a) for a in x[:, 0]]) + load
    true = {"R1": 2.4, "Lm": 1.6, "tr": 0.105}
    text = equations("transformer", declared(rng, true, R1="ohm", Lm="H"), {
        "flux": ("mains - R1*(flux/Lm + load)", first, "V s")},
        {"primary": ("flux/Lm + load", "A"), "secondary": ("tr*(mains - R1*(flux/Lm + load))", "V")})  # fmt: skip
    columns = {"mains": (u, "V", "input"), "load": (load, "A", "disturbance"),
               "primary": (logged(rng, current, 0.01, ends=(-10, 10), bits=12, corner=0.45), "A", "output"),
               "secondary": (logged(rng, 0.105 * (u - 2.4 * current), 0.01, ends=(-60, 60), bits=12, corner=0.45),
                             "V", "output")}  # fmt: skip
    return Case(name, step, columns, text, outside=True, time="time [ms]", time_scale=1e3, true=true)


def web(rng: np.random.Generator, *, complete: bool = False) -> Case:
    """Tension of a paper web in two spans (Shelton 1986; Brandenburg 1976, draws in thousandths of the speed).

    Hidden: the second section's drive follows its draw with 0.16 s, and its load cell reads 7 % too little. Size:
    15 % of the second tension, and 34 N of its mean. The paper's stiffness wanders, which nobody records. The null
    has neither.
    """
    name, rows, step, lag = "null_web" if complete else "web_draws", 2500, 0.05, 0.16
    u = np.c_[4.5 + plateaus(rng, rows, 220, -0.9, 0.9),
              0.9 + flips(rng, rows, 11, 0.12) + plateaus(rng, rows, 60, -0.2, 0.2),
              0.5 + flips(rng, rows, 9, 0.12) + plateaus(rng, rows, 45, -0.2, 0.2)]  # fmt: skip
    seen = np.c_[u, gust(rng, rows, 30, 6.0)]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        draw = u[2] if complete else x[2]
        return (u[0] / 2.6 * (260 * u[1] + 120 - x[0] + u[3]), u[0] / 3.4 * (260 * draw + x[0] - x[1]),
                (u[2] - x[2]) / lag)  # fmt: skip

    x, _ = rk(slope, [354, 484, 0.5], rows, step, told(seen), 6)
    true = {"EA": 260.0, "T0": 120.0, "La": 2.6, "Lb": 3.4}
    text = equations("paper web", declared(rng, true, 0.08 if complete else 0.1, EA="kN", T0="N", La="m", Lb="m"), {
        "ta": ("speed/La*(EA*draw_a + T0 - ta)", 354, "N"), "tb": ("speed/Lb*(EA*draw_b + ta - tb)", 484, "N")},
        {"tension_a": ("ta", "N"), "tension_b": ("tb", "N")})  # fmt: skip
    factor = 1.0 if complete else 0.93
    columns = {"speed": (u[:, 0], "m/s", "input"), "draw_a": (u[:, 1], "1/1000", "input"),
               "draw_b": (u[:, 2], "1/1000", "input"),
               "tension_a": (logged(rng, x[:, 0], 0.015, ends=(0, 1000), bits=12), "N", "output"),
               "tension_b": (logged(rng, factor * x[:, 1], 0.015, lag=4, ends=(0, 1000), bits=12),
                             "N", "output")}  # fmt: skip
    if complete:
        return Case(name, step, columns, text, cuts=(1100,), lost=10, true=true)
    return Case(name, step, columns, text, ("actuator_lag", "sensor_scale"), (), {"tau_s": lag, "factor": factor},
                lost=6, true=true)  # fmt: skip


def boost(rng: np.random.Generator) -> Case:
    """A boost converter with its direct-current link (Erickson and Maksimović 2001, chapter 8), averaged; complete.

    Two loops hear choke and link with noise; the load is recorded, small loads besides are not.
    """
    name, rows, step, total = "null_boost", 2600, 5e-5, [12.0]
    load, shake, more = plateaus(rng, rows, 70, 2, 9), flips(rng, rows, 6, 1.2), gust(rng, rows, 15, 0.06)
    hum, ripple = hiss(rng, rows, 0.06), hiss(rng, rows, 0.05)

    def command(k: int, x: Sequence[float]) -> Sequence[float]:
        error = 96 - x[1] - ripple[k]
        total[0] += 0.12 * error
        asked = 50 + 1.3 * (total[0] + 1.6 * error - x[0] - hum[k]) + shake[k]
        return max(min(asked, 90), 5), load[k], more[k]

    def slope(_: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        off = 1 - u[0] / 100
        return (48 - off * x[1] - 0.12 * x[0]) / 2.2e-4, (off * x[0] - u[1] - u[2] - x[1] / 400) / 6.8e-4

    x, u = rk(slope, [12, 96], rows, step, command, 6)
    true = {"Lc": 0.22, "Cd": 0.68, "Rc": 0.12, "Vs": 48.0}
    text = equations("boost converter", declared(rng, true, 0.08, Lc="mH", Cd="mF", Rc="ohm", Vs="V"), {
        "il": ("1000*(Vs - (1 - duty/100)*vd - Rc*il)/Lc", 12, "A"),
        "vd": ("1000*((1 - duty/100)*il - load - vd/400)/Cd", 96, "V")},
        {"choke": ("il", "A"), "link": ("vd", "V")})  # fmt: skip
    columns = {"duty": (u[:, 0], "%", "input"), "load": (load, "A", "disturbance"),
               "choke": (logged(rng, x[:, 0] + hum, 0.0, ends=(-50, 50), bits=12), "A", "output"),
               "link": (logged(rng, x[:, 1] + ripple, 0.0, ends=(0, 150), bits=12), "V", "output")}  # fmt: skip
    return Case(name, step, columns, text, context=LOOP, time="time [ms]", time_scale=1e3, true=true)


PROCESSES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "radiator_steps": (219, room), "canal_gate": (220, canal), "mixer_hose": (221, mixer), "basin_floor": (222, basin),
    "blood_sport": (223, glucose), "outlets_swapped": (224, exchanger), "dryer_trim": (225, dryer),
    "web_draws": (226, web), "yeast_inhibited": (229, yeast), "transformer_knee": (230, transformer),
}  # fmt: skip
