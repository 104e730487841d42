"""Hide rotor, aerodynamic, power, wave and coupling physics from a turbine model and ask the diagnosis for it.

    python tests/studies/rigs/turbine.py [--seeds 2] [--first-seed 1] [--samples 6000] [--sham 0] [--only NAME …]
                                         [--json FILE]

A 5 MW turbine above rated (rotor inertia, tower fore-aft and side-side) under a gain-scheduled pitch loop with a
filtered speed, injected pitch and torque steps, turbulent wind that is not recorded. Every blade sees its own wind.
It is integrated here by the classical Runge–Kutta rule at 20 points a sample, with forms that the catalogue does not
use: a point mass on the rotor, a pitched blade with its tilting moment, the potential flow around the tower, a power
law over the rotor's height, two-stage dynamic wake (Øye), two-term Wagner response, a JONSWAP sea. The model given to
the diagnosis is the same turbine without the one effect, as equations or linearised.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy.linalg import expm

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import diagnosis

STEP_S, FINE = 0.1, 20
V0, PITCH0, SPEED0 = 18.0, 14.9, 1.267
J, M, HUB, ARM, RADIUS = 4.87e7, 4.4e5, 90.0, 42.0, 63.0  # kg m², kg, hub height, arm of a blade's load, m
TORQUE0 = 4.18e6  # N m
Q_V, Q_B, Q_W = 1.0e6, -1.1e6, -3.0e6  # torque slopes: N m by m/s, deg, rad/s
T0, T_V, T_B, T_W = 3.7e5, 9.0e4, -6.0e4, 2.0e5  # thrust and its slopes: N
C_FA, K_FA, C_SS, K_SS = 8.8e3, 1.78e6, 1.6e4, 1.74e6  # N s/m, N/m
ROLL = 1.5 / HUB  # side force of a generator torque: N by N m
KNEE_S = 0.2  # of the speed filter


class Effect(NamedTuple):
    """Hold what the rig has beyond the model, all zero: nothing."""

    mass: float = 0.0  # kg m
    pitch_offset: float = 0.0  # deg, of blade 1
    weight: float = 0.0  # N m, of the rotor's unbalanced static moment
    shear: float = 0.0  # power-law exponent
    skew: float = 0.0  # deg of yaw misalignment
    shadow: float = 0.0  # tower radius in m
    sampling: float = 0.0  # m/s of wind at three times the rotor speed, its phase wandering over 8 s
    wake: float = 0.0  # excess of the frozen-wake load
    wake_s: float = 1.0  # slow time constant
    wagner: float = 0.0  # share of the load that lags
    wagner_s: float = 0.65
    bend: float = 0.0  # 1/(m/s): growth of the pitch gain with wind
    region: float = 0.0  # change of the pitch gain above V0
    cp: float = 0.0  # relative change of the aerodynamic torque
    density: float = 0.0  # relative change of air density
    loss: float = 0.0  # of the power
    sea_m: float = 0.0  # significant wave height
    sea_s: float = 9.0  # peak period
    sea_force: float = 1.0  # factor on the force of the sea
    hidden: float = 0.0  # gain of an integrator inside the pitch drive, 1/s
    hidden_s: float = 20.0  # its leak
    lag: float = 0.0  # s, of the pitch drive
    wind: float = 1.0  # m/s standard deviation
    wind_s: float = 8.0  # its memory
    noise: float = 1.0  # factor on sensor noise and side wind
    coarse: float = 1.0  # factor on the injected pitch steps
    dwell: float = 10.0  # samples between pitch steps
    gusts: float = 0.0  # m/s, of a measured wind from a mast upstream: acts in full


NOTHING = Effect()
(
    MASS, PITCH_OFFSET, WEIGHT, SHEAR, SKEW, SHADOW, SAMPLING, WAKE, WAKE_S,
    WAGNER, WAGNER_S, BEND, REGION, CP, DENSITY, LOSS, SEA_M, SEA_S,
    SEA_FORCE, HIDDEN, HIDDEN_S, LAG, WIND, WIND_S, NOISE, COARSE, DWELL,
    GUSTS,
) = range(28)  # fmt: skip


@njit
def _blade_winds(e: np.ndarray, v: float, psi: float, out: np.ndarray) -> None:
    """Return the wind (3,) each blade meets."""
    for b in range(3):
        angle = psi + 2 * math.pi / 3 * b
        up, side = math.cos(angle), math.sin(angle)
        w = v
        if e[SHEAR]:
            w += V0 * ((1 + ARM / HUB * up) ** e[SHEAR] - 1)
        if e[SKEW]:  # the advancing blade, and the skewed wake at an induction of 0.1
            turn = e[SKEW] * math.pi / 180
            w += -V0 * V0 * math.sin(turn) * 0.3 / (SPEED0 * ARM) * up
            w += 0.1 * V0 * 15 * math.pi / 32 * math.tan(0.53 * turn) * ARM / RADIUS * side * 4
        if e[SHADOW] and up < 0:
            y, x = ARM * side, 5.0
            w += V0 * e[SHADOW] ** 2 * (y * y - x * x) / (x * x + y * y) ** 2
        out[b] = w


@njit
def _loads(e: np.ndarray, s: np.ndarray, pitch: float, v: float, w: np.ndarray) -> tuple:
    """Return aerodynamic torque, thrust, tilting moment, in-plane force and the flap moment of blade 1."""
    _blade_winds(e, v - s[3], s[1], w)
    acting = pitch - PITCH0
    if e[WAKE]:
        acting = (1 + e[WAKE]) * acting - e[WAKE] * s[7]
    if e[WAGNER]:
        acting = (1 - e[WAGNER]) * acting + e[WAGNER] * (2 * s[6] + s[7]) / 3
    gain = math.exp(e[BEND] * (v - V0)) * (1 + (e[REGION] if v > V0 else 0.0))
    torque = thrust = tilt = plane = flap = 0.0
    for b in range(3):
        angle = s[1] + 2 * math.pi / 3 * b
        d = gain * acting + (e[PITCH_OFFSET] if b == 0 else 0.0)
        push = (T0 + T_V * (w[b] - V0) + T_B * d + T_W * (s[0] - SPEED0)) / 3
        turn = (TORQUE0 + Q_V * (w[b] - V0) + Q_B * d + Q_W * (s[0] - SPEED0)) / 3
        push, turn = push * (1 + e[DENSITY]), turn * (1 + e[DENSITY]) * (1 + e[CP])
        torque, thrust = torque + turn, thrust + push
        tilt += push * ARM * math.cos(angle)
        plane += turn / ARM * math.sin(angle)
        if b == 0:
            flap = push * ARM
    return torque, thrust, tilt, plane, flap


@njit
def _flow(e: np.ndarray, s: np.ndarray, pitch: float, generator: float, v: float, side: float, sea: float,
          d: np.ndarray, w: np.ndarray) -> float:  # fmt: skip
    """Write ds/dt: speed, azimuth, fore-aft, side-side, three hidden states; returns the flap moment."""
    acting = s[8] if e[LAG] else pitch
    if e[HIDDEN]:
        acting += s[6]
    torque, thrust, tilt, plane, flap = _loads(e, s, acting, v, w)
    swing = math.sin(s[1] + 0.7)
    d[0] = (torque - generator + (9.81 * e[MASS] + e[WEIGHT]) * swing) / J
    d[1] = s[0]
    push = thrust - T0 + sea + (1.5 / HUB * tilt if e[PITCH_OFFSET] else 0.0)
    d[2], d[3] = s[3], (push - C_FA * s[3] - K_FA * s[2]) / M
    pull = ROLL * (generator - TORQUE0) + side + 0.2 * sea + e[MASS] * s[0] ** 2 * swing
    pull += plane if e[PITCH_OFFSET] else 0.0
    d[4], d[5] = s[5], (pull - C_SS * s[5] - K_SS * s[4]) / M
    d[6] = d[7] = d[8] = 0.0
    if e[HIDDEN]:
        d[6] = e[HIDDEN] * (pitch - PITCH0) - s[6] / e[HIDDEN_S]
    elif e[WAKE]:  # Øye: k = 0.6, the second stage a quarter as slow
        d[6] = (pitch - PITCH0 - s[6]) / e[WAKE_S]
        d[7] = (0.6 * (pitch - PITCH0) + 0.4 * s[6] - s[7]) / (0.26 * e[WAKE_S])
    elif e[WAGNER]:
        d[6] = (pitch - PITCH0 - s[6]) / (e[WAGNER_S] / 6.6)
        d[7] = (pitch - PITCH0 - s[7]) / e[WAGNER_S]
    if e[LAG]:
        d[8] = (pitch - s[8]) / e[LAG]
    return flap


@njit
def _advance(e: np.ndarray, s: np.ndarray, u: tuple, winds: np.ndarray, sides: np.ndarray, seas: np.ndarray,
             k: np.ndarray, w: np.ndarray, phase: np.ndarray) -> None:  # fmt: skip
    """Advance s by one sample in 20 Runge–Kutta steps; commands held, disturbances held over each step."""
    h = STEP_S / FINE
    for j in range(FINE):
        v = winds[j] + e[SAMPLING] * (phase[j, 0] * math.cos(3 * s[1]) + phase[j, 1] * math.sin(3 * s[1]))
        _flow(e, s, u[0], u[1], v, sides[j], seas[j], k[0], w)
        _flow(e, s + 0.5 * h * k[0], u[0], u[1], v, sides[j], seas[j], k[1], w)
        _flow(e, s + 0.5 * h * k[1], u[0], u[1], v, sides[j], seas[j], k[2], w)
        _flow(e, s + h * k[2], u[0], u[1], v, sides[j], seas[j], k[3], w)
        s += h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])


@njit
def _run(e: np.ndarray, samples: int, wind: np.ndarray, side: np.ndarray, sea: np.ndarray, phase: np.ndarray,
         test: np.ndarray, noise: np.ndarray) -> np.ndarray:  # fmt: skip
    """Close the loop; rows: pitch deg, torque kN m, speed, fore-aft, side-side, power kW, flap kN m, azimuth deg."""
    s, k, w = np.zeros(9), np.zeros((4, 9)), np.zeros(3)
    s[0], s[8] = SPEED0, PITCH0
    rows = np.empty((samples, 8))
    filtered, integral = SPEED0, PITCH0
    for i in range(samples):
        seen = s[0] + noise[i, 0]
        filtered += (1 - math.exp(-STEP_S / KNEE_S)) * (seen - filtered)
        schedule = 3.365 / (1 + integral / 6.3)  # one at the operating point
        integral += STEP_S * 13.3 * schedule * (filtered - SPEED0)
        pitch = integral + 31.0 * schedule * (filtered - SPEED0) + test[i, 0]
        generator = TORQUE0 + test[i, 1]
        j = i * FINE
        v = wind[j] + e[SAMPLING] * (phase[j, 0] * math.cos(3 * s[1]) + phase[j, 1] * math.sin(3 * s[1]))
        flap = _flow(e, s, pitch, generator, v, side[j], sea[j], k[0], w)
        rows[i, 0], rows[i, 1], rows[i, 2] = pitch, generator / 1e3, seen
        rows[i, 3], rows[i, 4] = k[0, 3] + noise[i, 1], k[0, 5] + noise[i, 2]
        rows[i, 5] = 0.944 * (1 - e[LOSS]) * generator * s[0] / 1e3 + noise[i, 3]
        rows[i, 6] = flap / 1e3 + noise[i, 4]
        rows[i, 7] = s[1] * 180 / math.pi % 360
        _advance(e, s, (pitch, generator), wind[j:], side[j:], sea[j:], k, w, phase[j:])
    return rows


def _memory(rng: np.random.Generator, n: int, memory_s: float, step: float) -> np.ndarray:
    """Return n samples of an Ornstein–Uhlenbeck process of spread 1."""
    from scipy.signal import lfilter

    keep = math.exp(-step / memory_s)
    kicks = rng.standard_normal(n)
    kicks[1:] *= math.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], kicks))


def sea_force(e: Effect, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return elevation in m and force in N (n,) of a JONSWAP sea, peak factor 3.3: inertia force, 120 components."""
    t = np.arange(n) * STEP_S / FINE
    if not e.sea_m:
        return np.zeros(n), np.zeros(n)
    f = np.linspace(0.04, 0.35, 120)
    peak = 1 / e.sea_s

    def reach(frequency: np.ndarray | float) -> np.ndarray:
        """Return the mean over a depth of 20 m of what is left of the waves' motion (deep water, k = w²/g)."""
        depth = np.asarray((2 * math.pi * np.asarray(frequency)) ** 2 / 9.81 * 20.0)
        return np.asarray((1 - np.exp(-depth)) / depth)

    shape = f**-5 * np.exp(-1.25 * (peak / f) ** 4)
    shape *= 3.3 ** np.exp(-((f - peak) ** 2) / (2 * np.where(f > peak, 0.09, 0.07) ** 2 * peak**2))
    a = np.sqrt(shape / shape.sum()) * e.sea_m / 4 * math.sqrt(2)
    turn = rng.uniform(0, 2 * math.pi, 120)
    eta, force = np.zeros(n), np.zeros(n)
    for amplitude, frequency, phase in zip(a, f, turn, strict=True):
        angle = 2 * math.pi * frequency * t + phase
        eta += amplitude * np.cos(angle)
        force += (
            -6e4 * e.sea_force * amplitude * (frequency / peak) ** 2 * reach(frequency) / reach(peak) * np.sin(angle)
        )
    return eta, force


def simulate(e: Effect, samples: int, seed: int) -> dict[str, np.ndarray]:
    """Run the turbine; returns every channel a trial may record."""
    rng = np.random.default_rng(seed)
    n, h = samples * FINE, STEP_S / FINE
    wind = V0 + e.wind * _memory(rng, n, e.wind_s, h)
    side = 2e3 * e.noise * _memory(rng, n, 3.0, h)
    mast = _memory(rng, samples, 3.0, STEP_S)
    gust = np.repeat(e.gusts * mast, FINE)
    phase = np.column_stack([_memory(rng, n, 8.0, h), _memory(rng, n, 8.0, h)])
    eta, sea = sea_force(e, n, rng)
    dwell = round(e.dwell)
    test = np.column_stack(
        [
            0.5 * e.coarse * np.repeat(rng.choice([-1.0, 1.0], samples // dwell + 1), dwell)[:samples],
            8e4 * np.repeat(rng.choice([-1.0, 1.0], samples // 7 + 1), 7)[:samples],
        ]
    )
    noise = rng.standard_normal((samples, 6)) * e.noise * np.array([1e-3, 1e-2, 5e-3, 10.0, 50.0, 0.3])
    rows = _run(np.array(e), samples, wind + gust, side, sea, phase, test, noise)
    names = ("pitch", "torque", "rotor_speed", "tower_fore_aft", "tower_side_side", "power", "flap_moment_1", "azimuth")
    columns = dict(zip(names, rows.T, strict=True))
    nacelle = (wind + gust)[::FINE] + noise[:, 5]
    return columns | {
        "wind": nacelle,
        "mast": (e.gusts or 1.0) * mast,
        "wave": eta[::FINE],
        "time_s": STEP_S * np.arange(samples),
    }


@dataclass(frozen=True)
class Trial:
    """Hold what the rig has and the model lacks, what is recorded, and what a right answer looks like.

    truth: acceptable ids (empty: nothing may be named); quantity: label, value, relative tolerance; roles: channels
    recorded beyond pitch, torque and the outputs; held: the aerodynamic slopes of the model are not free.
    """

    name: str
    kind: str
    effect: Effect = NOTHING
    truth: tuple[str, ...] = ()
    quantity: tuple[str, float, float] | None = None
    outputs: tuple[str, ...] = ("rotor_speed", "tower_fore_aft", "tower_side_side")
    roles: tuple[tuple[str, str], ...] = (("azimuth", "azimuth"),)
    held: bool = False
    unconnected: bool = False  # the model takes the torque for constant
    offshore: bool = False
    outside: bool = False


UNITS = {"pitch": "deg", "torque": "kN m", "rotor_speed": "rad/s", "tower_fore_aft": "m/s^2", "wind": "m/s",
         "tower_side_side": "m/s^2", "power": "kW", "flap_moment_1": "kN m", "azimuth": "deg", "mast": "m/s",
         "wave": "m"}  # fmt: skip
_PARAMETERS = (
    ("J", J, "kg m^2", False), ("M", M, "kg", False), ("Q0", TORQUE0, "N m", False), ("T0", T0, "N", False),
    ("Q_V", Q_V, "N s", False), ("Q_B", Q_B, "N m/deg", True), ("Q_W", Q_W, "N m s", True),
    ("T_V", T_V, "N s/m", False), ("T_B", T_B, "N/deg", True), ("T_W", T_W, "N s", False),
    ("c_fa", C_FA, "N s/m", False), ("k_fa", K_FA, "N/m", True), ("c_ss", C_SS, "N s/m", True),
    ("k_ss", K_SS, "N/m", True), ("wind_rate", 0.125, "1/s", False), ("roll", ROLL, "1/m", False),
)  # fmt: skip
_THRUST = "T_V*(wind_speed - v_fa) + T_B*(pitch - 14.9) + T_W*(omega - 1.267)"
_STATES = (
    ("omega", "rad/s", SPEED0,
     "(Q0 + Q_V*(wind_speed - v_fa) + Q_B*(pitch - 14.9) + Q_W*(omega - 1.267) - 1000*torque)/J"),
    ("x_fa", "m", 0.0, "v_fa"), ("v_fa", "m/s", 0.0, f"({_THRUST} - c_fa*v_fa - k_fa*x_fa)/M"),
    ("x_ss", "m", 0.0, "v_ss"), ("v_ss", "m/s", 0.0, "(roll*(1000*torque - Q0) - c_ss*v_ss - k_ss*x_ss)/M"),
    ("wind_speed", "m/s", 0.0, "-wind_rate*wind_speed"),
)  # fmt: skip
_OUTPUTS = {
    "rotor_speed": "omega", "tower_fore_aft": _STATES[2][3], "tower_side_side": _STATES[4][3],
    "power": "0.944*torque*omega", "flap_moment_1": f"0.014*(T0 + {_THRUST})",
}  # fmt: skip


def equations_text(trial: Trial) -> str:
    """Return the turbine without any effect as model.toml; wind_speed is the deviation from the mean wind."""
    lines = ['[model]\nname = "turbine above rated"\n[parameters]']
    for name, value, unit, free in _PARAMETERS:
        bounds = f", min = {min(0.3 * value, 3 * value)!r}, max = {max(0.3 * value, 3 * value)!r}, free = true"
        is_slope = name in ("Q_B", "Q_W", "T_B")
        shown = bounds if free and not (trial.held and is_slope) else ""
        lines.append(f'{name} = {{ value = {value!r}, unit = "{unit}"{shown} }}')

    def wired(text: str) -> str:
        return text.replace("1000*torque", "Q0").replace("*torque", "*4180") if trial.unconnected else text

    for name, unit, initial, derivative in _STATES:
        lines.append(f'[[state]]\nname = "{name}"\nunit = "{unit}"\nderivative = "{wired(derivative)}"')
        lines.append(f"initial = {{ value = {initial!r}, free = true }}")
    for name in trial.outputs:
        lines.append(f'[[output]]\nname = "{name}"\nunit = "{UNITS[name]}"\nequation = "{wired(_OUTPUTS[name])}"')
    return "\n".join(lines) + "\n"


def linear_model(trial: Trial) -> dict[str, Any]:
    """Return the turbine without any effect as a discrete state-space model, inputs held over a sample."""
    A = np.array(
        [
            [Q_W / J, 0, -Q_V / J, 0, 0, Q_V / J],
            [0, 0, 1, 0, 0, 0],
            [T_W / M, -K_FA / M, -(C_FA + T_V) / M, 0, 0, T_V / M],
            [0, 0, 0, 0, 1, 0],
            [0, 0, 0, -K_SS / M, -C_SS / M, 0],
            [0, 0, 0, 0, 0, -0.125],
        ]
    )
    B = np.array([[Q_B / J, -1e3 / J], [0, 0], [T_B / M, 0], [0, 0], [0, 1e3 * ROLL / M], [0, 0]])
    C = {"rotor_speed": np.eye(6)[0], "tower_fore_aft": A[2], "tower_side_side": A[4],
         "power": 0.944 * TORQUE0 / 1e3 * np.eye(6)[0],
         "flap_moment_1": 0.014 * np.array([T_W, 0, -T_V, 0, 0, T_V])}  # fmt: skip
    D = {"rotor_speed": np.zeros(2), "tower_fore_aft": B[2], "tower_side_side": B[4],
         "power": np.array([0, 0.944 * SPEED0]), "flap_moment_1": np.array([0.014 * T_B, 0])}  # fmt: skip
    inputs = [{"name": "pitch", "unit": "deg", "offset": PITCH0}, {"name": "torque", "unit": "kN m", "offset": 4180.0}]
    kept = 1 if trial.unconnected else 2
    held = expm(np.block([[A, B], [np.zeros((2, 8))]]) * STEP_S)
    offset = {"rotor_speed": SPEED0, "power": 0.944 * TORQUE0 / 1e3 * SPEED0, "flap_moment_1": 0.014 * T0}
    return {
        "kind": "state_space", "sample_time_s": STEP_S, "inputs": inputs[:kept],
        "outputs": [{"name": n, "unit": UNITS[n], "offset": offset.get(n, 0.0)} for n in trial.outputs],
        "states": [{"name": n, "unit": u} for n, u, _, _ in _STATES], "A": held[:6, :6].tolist(),
        "B": held[:6, 6 : 6 + kept].tolist(), "C": [C[n].tolist() for n in trial.outputs],
        "D": [D[n][:kept].tolist() for n in trial.outputs], "K": None, "x0": [0.0] * 6,
        "innovation_covariance": None, "scheduling": None,
    }  # fmt: skip


def write_case(folder: Path, trial: Trial, samples: int, seed: int) -> Path:
    """Write case.toml, roles.toml, recording.csv and the baseline; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    columns = simulate(trial.effect, samples, seed)
    channels = [("pitch", "input"), ("torque", "input"), *((n, "output") for n in trial.outputs), *trial.roles]
    table = np.column_stack([columns["time_s"], *(columns[n] for n, _ in channels)])
    lines = [",".join(["time_s", *(n for n, _ in channels)]), *(",".join(f"{x:.9g}" for x in row) for row in table)]
    (folder / "recording.csv").write_text("\n".join(lines) + "\n")
    roles = [f'[[channel]]\nname = "{n}"\nunit = "{UNITS[n]}"\nrole = "{r}"\n' for n, r in channels]
    (folder / "roles.toml").write_text('[recording]\ntime = "time_s"\n' + "".join(roles))
    file = "model.toml" if trial.kind == "equations" else "model.json"
    text = equations_text(trial) if trial.kind == "equations" else json.dumps(linear_model(trial))
    (folder / file).write_text(text)
    (folder / "case.toml").write_text(
        f'[case]\ntitle = "rig"\n[recordings]\nfiles = ["recording.csv"]\nroles = "roles.toml"\n'
        f'[baseline]\nkind = "{trial.kind}"\nfile = "{file}"\n'
        f'[context]\nmachine = "wind turbine"\nblades = 3\nrated_speed_rad_s = 1.267\n'
        + ("offshore = true\n" if trial.offshore else "")
    )
    return folder


_FLAP = ("rotor_speed", "tower_fore_aft", "flap_moment_1")
_POWER = ("rotor_speed", "tower_fore_aft", "power")
_WIND = (("azimuth", "azimuth"), ("wind", "scheduling"))
_CALM = {
    "wind": 0.5,
    "coarse": 2.0,
    "dwell": 25.0,
}  # for effects on the pitch's path: less wind, larger and longer steps


def trials() -> list[Trial]:
    """List what is hidden, once in an equations baseline and once in a linear one where it applies."""
    found = []
    for kind in ("equations", "state_space"):
        own = kind == "equations"
        slow = ("dynamic_inflow",)
        found += [
            Trial("mass imbalance", kind, Effect(mass=3e3), ("mass_imbalance",)),
            Trial("pitched blade", kind, Effect(pitch_offset=0.6), ("aero_imbalance",)),
            Trial("unbalanced weight", kind, Effect(weight=8e4), ("gravity_1p",)),
            Trial("shear", kind, Effect(shear=0.25), ("wind_shear",), outputs=_FLAP),
            Trial("yaw", kind, Effect(skew=15.0), ("yaw_misalignment",), outputs=_FLAP),
            Trial("tower shadow", kind, Effect(shadow=3.0), ("tower_shadow",)),
            Trial("sampled turbulence", kind, Effect(sampling=0.3), ("rotational_sampling",)),
            Trial("dynamic wake", kind, Effect(wake=0.5, wake_s=9.0, **_CALM), slow, held=True),
            Trial("lagging circulation", kind, Effect(wagner=0.5, **_CALM), ("unsteady_aero",)),
            Trial("gain grows with wind", kind, Effect(bend=0.08, coarse=2.0), ("aero_nonlinearity",), roles=_WIND),
            Trial("gain drops above", kind, Effect(region=-0.5, coarse=2.0), ("operating_region_switch",), roles=_WIND),
            Trial("power loss", kind, Effect(loss=0.05), ("efficiency_loss",), outputs=_POWER),
            Trial("sea", kind, Effect(sea_m=2.0), ("wave_load",), offshore=True),
            Trial("sea, recorded", kind, Effect(sea_m=2.0), ("wave_load",), offshore=True,
                  roles=(("azimuth", "azimuth"), ("wave", "disturbance"))),
            Trial("torque not connected", kind, Effect(), ("missing_coupling",), unconnected=True),
            Trial("gusts ignored", kind, Effect(gusts=0.7), ("missing_disturbance",),
                  roles=(("azimuth", "azimuth"), ("mast", "disturbance"))),
            Trial("integrator inside", kind, Effect(hidden=0.1, hidden_s=15.0, **_CALM), ("controller_state",)),
        ]  # fmt: skip
        if own:
            found += [
                Trial("less torque", kind, Effect(cp=-0.12, coarse=2.0), ("cp_change",), ("cp_change", -0.12, 0.2),
                      held=True),
                Trial("thin air", kind, Effect(density=-0.12, coarse=2.0), ("air_density",),
                      ("density_change", -0.12, 0.2), held=True),
            ]  # fmt: skip
        found += [
            Trial("null", kind),
            Trial("null, no azimuth", kind, roles=()),
            Trial("null, rough", kind, Effect(wind=1.6, wind_s=3.0), roles=_WIND),
            Trial("null, flap", kind, outputs=_FLAP),
            Trial("null, power", kind, outputs=_POWER, roles=_WIND),
            Trial("null, offshore", kind, Effect(wind_s=2.0, sea_m=2.0, sea_force=0.0), offshore=True,
                  roles=(("wave", "disturbance"), ("mast", "disturbance"))),
        ]  # fmt: skip
    return found


def diagnose_one(trial: Trial, folder: Path, samples: int, seed: int, sham: int) -> dict[str, Any]:
    """Write a case, diagnose it, judge the answer."""
    from aeolid.diagnose.data.case import load_case
    from aeolid.diagnose.pipeline import study

    begun = time.perf_counter()
    case = load_case(write_case(folder, trial, samples, seed))
    result = study(case, sham=sham, seed=1, progress=lambda text, share: None)
    seconds = round(time.perf_counter() - begun, 1)
    return diagnosis.answer(trial, result) | {"seed": seed, "seconds": seconds}


def main(arguments: list[str] | None = None) -> int:
    """Run the study; exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2, help="recordings a trial")
    parser.add_argument("--first-seed", type=int, default=1, help="number of the first recording; 1 was seen in tuning")
    parser.add_argument("--samples", type=int, default=6000, help="length of each, at 10 Hz")
    parser.add_argument("--sham", type=int, default=0, help="null runs of the procedure in each diagnosis")
    parser.add_argument("--only", nargs="*", help="names (or parts of names) of trials")
    parser.add_argument("--json", help="write the rows to this file")
    options = parser.parse_args(arguments)
    listed = list(enumerate(trials()))
    chosen = [(i, t) for i, t in listed if not options.only or any(o in f"{t.name} {t.kind}" for o in options.only)]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.first_seed, options.first_seed + options.seeds):
            for number, trial in chosen:
                place = Path(folder) / f"{number}_{seed}"
                rows.append(diagnose_one(trial, place, options.samples, 100 * seed + number, options.sham))
                print(diagnosis.table(rows[-1:]).splitlines()[1], file=sys.stderr, flush=True)
                if options.json:
                    Path(options.json).write_text(json.dumps(rows, indent=1) + "\n")
    print(diagnosis.table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
