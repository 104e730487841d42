"""Wind turbines whose models lack a piece of their physics: the shaft, a lag, a rate, a filter, a worn rotor.

Rotor, gearbox and torque law are those of the NREL 5 MW reference turbine (Jonkman et al. 2009, NREL/TP-500-38060),
the power coefficient is a parabola of the tip-speed ratio.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from scipy.signal import cont2discrete, dlsim
from second_author_parts import (
    Case,
    Tones,
    advance,
    coloured,
    equations,
    flips,
    free,
    known,
    march,
    plateaus,
    smooth,
    state_space,
)
from textbook_plants import Array, noisy

RADIUS, GEAR, AIR = 63.0, 97.0, 1.225
ROTOR, GENERATOR = 3.87e7, 534.116 * GEAR**2  # kg m2, both at the rotor's speed
SHAFT, SHAFT_DAMPING = 8.676e8, 4.5e6
LAW = 2.332  # N m over the square of the generator's speed in rad/s
RPM = 30 / np.pi

_CURVE = "(CPM-0.0115*(omega*{radius}/wind-{best})**2)*wind**3/omega - 97*1000*{torque}"
_AREA = np.pi * RADIUS**2  # swept by the rotor, m2

# a turbine above rated wind: rotor speed, tower deflection and its speed over pitch (deg), torque (kN m), wind (m/s)
_TOWER = 2 * np.pi * 0.32
A = np.array([[-0.12, 0, -0.02], [0, 0, 1], [0.6, -(_TOWER**2), -2 * 0.03 * _TOWER - 0.05]])
B = np.array([[-0.05, -2e-3 * 10, 0.02], [0, 0, 0], [-0.28, 0, 0.10]])
C = np.array([[GEAR * 30 / np.pi, 0, 0], A[2]])
D = np.vstack([np.zeros(3), B[2]])


def power_share(ratio: float) -> float:
    """Return the power coefficient at a tip-speed ratio."""
    return 0.482 - 0.0115 * (ratio - 7.55) ** 2


def rotor_torque(speed: float, wind: float, share: float = 1.0) -> float:
    """Return the torque that the wind exerts on the rotor, N m."""
    return 0.5 * AIR * _AREA * share * power_share(speed * RADIUS / wind) * wind**3 / speed


def shaft(rng: np.random.Generator) -> Case:
    """A shaft that twists at 2.22 Hz between rotor and generator; the model turns both as one body.

    Wind drives the rotor, the torque law with a small binary signal brakes the generator.
    """
    rows, step = 3000, 0.05
    wind, dither = Tones.drawn(rng, 0.004, 0.4, 40, 0.9, 8.0), flips(rng, rows, 8, 1.2e3)

    def slope(t: float, x: Array, u: Array) -> Sequence[float]:
        twisting = SHAFT * x[2] + SHAFT_DAMPING * (x[0] - x[1])
        driving = rotor_torque(x[0], wind(t))
        return (driving - twisting) / ROTOR, (twisting - GEAR * u[0]) / GENERATOR, x[0] - x[1]

    x, u = march(slope, [0.95, 0.95, 2e6 / 8.67e8], rows, step, lambda k, x: [LAW * (x[1] * GEAR) ** 2 + dither[k]],
                 rtol=1e-9, atol=1e-11)  # fmt: skip
    values = {"J": free(4.5e7, 2e7, 9e7, "kg m2"), "CPM": free(0.482, 0.3, 0.6), "RHO": known(AIR),
              "R": known(RADIUS, "m")}  # fmt: skip
    curve = _CURVE.format(radius="R", best="7.55", torque="torque")
    text = equations("rotor with torque law", values, {"omega": (f"(0.5*RHO*pi*R**2*{curve})/J", 0.95, "rad/s")},
                     {"rotor_speed": ("omega*30/pi", "rpm"), "generator_speed": ("97*omega*30/pi", "rpm")})  # fmt: skip
    columns = {
        "torque": (u[:, 0] / 1e3, "kN m", "input"), "wind": (wind(np.arange(rows) * step), "m/s", "disturbance"),
        "rotor_speed": (x[:, 0] * RPM + 0.004 * rng.standard_normal(rows), "rpm", "output"),
        "generator_speed": (x[:, 1] * GEAR * RPM + 0.25 * rng.standard_normal(rows), "rpm", "output"),
    }  # fmt: skip
    spring = SHAFT * (1 / ROTOR + 1 / GENERATOR)
    return Case("wt_torsion", step, columns, text, ("drivetrain_torsion",), ("structural_mode",),
                {"frequency_hz": float(np.sqrt(spring) / (2 * np.pi))}, machine="wind turbine",
                context="blades = 3\nclosed_loop = true\ngearbox_ratio = 97\n")  # fmt: skip


def converter_lag(rng: np.random.Generator) -> Case:
    """A converter whose torque follows the demand with 0.3 s, seen in speed and power; the model has it at once."""
    rows, step, lag, inertia = 1200, 0.1, 0.3, ROTOR + GENERATOR
    wind, dither = Tones.drawn(rng, 0.004, 0.3, 40, 0.9, 8.0), flips(rng, rows, 5, 1.5e3)

    def slope(t: float, x: Array, u: Array) -> Sequence[float]:
        return (rotor_torque(x[0], wind(t)) - GEAR * x[1]) / inertia, (u[0] - x[1]) / lag

    x, u = march(slope, [0.95, LAW * (0.95 * GEAR) ** 2], rows, step,
                 lambda k, x: [LAW * (x[0] * GEAR) ** 2 + dither[k]], rtol=1e-9, atol=1e-9)  # fmt: skip
    values = {"J": free(4.2e7, 2e7, 9e7, "kg m2"), "CPM": free(0.47, 0.3, 0.6), "ETA": free(0.95, 0.8, 1.0)}
    curve = _CURVE.format(radius="63", best="7.55", torque="torque_demand")
    text = equations("turbine with power", values, {"omega": (f"(0.5*1.225*pi*63**2*{curve})/J", 0.95, "rad/s")},
                     {"generator_speed": ("97*omega*30/pi", "rpm"),
                      "power": ("ETA*torque_demand*97*omega", "kW")})  # fmt: skip
    columns = {
        "torque_demand": (u[:, 0] / 1e3, "kN m", "input"),
        "wind": (wind(np.arange(rows) * step) + 0.05 * rng.standard_normal(rows), "m/s", "disturbance"),
        "generator_speed": (x[:, 0] * GEAR * RPM + 0.3 * rng.standard_normal(rows), "rpm", "output"),
        "power": (0.944 * x[:, 1] * x[:, 0] * GEAR / 1e3 + 4 * rng.standard_normal(rows), "kW", "output"),
    }  # fmt: skip
    return Case("wt_torque_lag", step, columns, text, ("actuator_lag",), (), {"tau_s": lag}, machine="wind turbine",
                context="closed_loop = true\n")  # fmt: skip


def worn_rotor(rng: np.random.Generator) -> Case:
    """A rotor that takes 8 % less power than its curve says (Burton et al. 2011, Wind Energy Handbook, chapter 3).

    The model has the curve of the new rotor, whose height is declared as known.
    """
    rows, step = 1500, 0.1
    wind = Tones.drawn(rng, 0.003, 0.3, 40, 1.0, 8.5)

    def slope(t: float, x: Array, u: Array) -> Sequence[float]:
        return ((rotor_torque(x[0], wind(t), 0.92) - GEAR * u[0]) / 4.37e7,)

    x, u = march(slope, [1.0], rows, step, lambda _, x: [LAW * (x[0] * GEAR) ** 2], rtol=1e-9, atol=1e-10)
    values = {"J": free(4.4e7, 2e7, 9e7, "kg m2"), "CPM": known(0.482), "LOPT": known(7.55)}
    curve = _CURVE.format(radius="63", best="LOPT", torque="torque")
    text = equations("rotor", values, {"omega": (f"(0.5*1.225*pi*63**2*{curve})/J", 1.0, "rad/s")},
                     {"rotor_speed": ("omega*30/pi", "rpm")})  # fmt: skip
    columns = {
        "torque": (u[:, 0] / 1e3, "kN m", "input"),
        "wind": (wind(np.arange(rows) * step) + 0.05 * rng.standard_normal(rows), "m/s", "disturbance"),
        "rotor_speed": (x[:, 0] * RPM + 0.01 * rng.standard_normal(rows), "rpm", "output"),
    }  # fmt: skip
    return Case("wt_cp", step, columns, text, ("cp_change",), ("parameter_error",), {"cp_change": -0.08},
                machine="wind turbine", context="closed_loop = true\n")  # fmt: skip


def moved(now: float, wanted: float, most: float | None) -> float:
    """Return where a drive is that moves by so much at most; without a limit it is where it is wanted."""
    return wanted if most is None else now + float(np.sign(wanted - now)) * min(abs(wanted - now), most)


def _next(x: Array, step: float, pitch: Callable[[float], float], torque: float, wind: Array) -> Array:
    """Return the state of the linear turbine a row later; the wind goes straight from one row to the next."""
    return advance(lambda t, x: A @ x + B @ np.array([pitch(t), torque, wind[0] + (wind[1] - wind[0]) * t / step]),
                   x, step, rtol=1e-8, atol=1e-10)  # fmt: skip


def above_rated(rng: np.random.Generator, name: str, rows: int, cuts: tuple[int, ...] = (), *,
                rate: float | None = None, filtered: bool = False) -> Case:  # fmt: skip
    """A linear turbine in turbulence above rated wind (Burton et al. 2011, chapter 8), the model discrete and linear.

    What it lacks is a pitch drive of limited rate or the second-order filter of the accelerometer, at 0.55 Hz with
    damping 0.6; its gains of pitch and wind are 3 % off.
    """
    step, bend = 0.05, 2 * np.pi * 0.55
    wind = smooth(rng, rows + 1, 60, 0.9)
    wanted = plateaus(rng, rows, 50, -3.0, 3.0) + smooth(rng, rows, 40, 0.4)
    torque, x, pitch = flips(rng, rows, 20, 0.6), np.zeros(3), 0.0
    states, acting = np.zeros((rows, 3)), np.zeros(rows)
    for k in range(rows):
        states[k], acting[k] = x, pitch

        def at(t: float, now: float = pitch, to: float = wanted[k]) -> float:
            return moved(now, to, None if rate is None else rate * t)

        x, pitch = _next(x, step, at, torque[k], wind[k : k + 2]), at(step)
    y = states @ C.T + np.c_[acting, torque, wind[:rows]] @ D.T
    if filtered:
        a, b = np.array([[0, 1], [-(bend**2), -1.2 * bend]]), np.array([[0], [bend**2]])
        smoothing = cont2discrete((a, b, np.array([[1, 0]]), np.array([[0]])), step, "foh")
        y[:, 1] = dlsim(smoothing, y[:, 1])[1][:, 0]
    discrete = [m.copy() for m in cont2discrete((A, B, C, D), step, "zoh")[:4]]
    discrete[1][:, 0] *= 0.97
    discrete[1][:, 2] *= 1.03
    model = state_space(step, {"pitch": "deg", "torque": "kN m", "wind": "m/s"},
                        {"generator_speed": "rpm", "nacelle_acceleration": "m/s2"}, discrete)  # fmt: skip
    columns = {
        "pitch": (wanted, "deg", "input"), "torque": (torque, "kN m", "input"),
        "wind": (wind[:rows], "m/s", "disturbance"),
        "generator_speed": (coloured(rng, y[:, 0], 0.01, 4), "rpm", "output"),
        "nacelle_acceleration": (noisy(rng, y[:, 1], 0.02), "m/s2", "output"),
    }  # fmt: skip
    right = ("rate_limit",) if rate else ("sensor_second_order",) if filtered else ()
    values = {"rate_per_s": rate} if rate else {"omega_rad_s": bend, "damping": 0.6} if filtered else {}
    return Case(name, step, columns, model, right, (), values, machine="wind turbine", context="blades = 3\n",
                cuts=cuts)  # fmt: skip


TURBINES: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "wt_torsion": (1, shaft), "wt_torque_lag": (2, converter_lag), "wt_cp": (23, worn_rotor),
    "wt_pitch_rate": (11, partial(above_rated, name="wt_pitch_rate", rows=3000, cuts=(1000, 2000), rate=2.0)),
    "wt_accel_filter": (45, partial(above_rated, name="wt_accel_filter", rows=3000, filtered=True)),
}  # fmt: skip
