"""Leave a whole mode out of a turbine's model, tower, blade or shaft, and ask the diagnosis for it by its name.

    python tests/studies/recall.py --rigs structures [--seeds 5]

A 5 MW turbine above rated in steps of pitch and torque, under a wind that nobody recorded; what bends and twists is
integrated by the classical Runge–Kutta rule at 10 points a sample. On odd seeds the part that the model lacks is damped
in proportion to the square of its speed, where the catalogue's modes are damped in proportion to it. The model
is the same turbine in which one part is rigid: it has the load and not the mode.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from scipy.linalg import expm
from scipy.signal import lfilter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import diagnosis

STEP_S, FINE = 0.1, 10
JR, JG, KS, CS = 4.3e7, 5.7e6, 6.0e8, 2.0e6  # kg m², N m, N m s: the shaft twists at 1.75 Hz
M, C_FA, K_FA, C_SS, K_SS, ROLL = 4.4e5, 2.0e4, 1.78e6, 1.6e4, 1.74e6, 1.5 / 90  # kg, N s/m, N/m, N by N m
SPEED0, PITCH0, Q0, T0 = 1.267, 14.9, 4.18e6, 3.7e5
Q_V, Q_B, Q_W, T_V, T_B, T_W = 1.0e6, -1.1e6, -3.0e6, 9.0e4, -6.0e4, 2.0e5  # N m and N by m/s, deg, rad/s
FLAP, EDGE = (0.7, 0.15, 0.014), (1.08, 0.02, 0.008)  # Hz, damping ratio, kN m of moment by N and by N m of load
WIND_RATE = 0.125  # 1/s
HERTZ = {
    "fore": math.sqrt(K_FA / M) / (2 * math.pi), "side": math.sqrt(K_SS / M) / (2 * math.pi), "flap": FLAP[0],
    "edge": EDGE[0], "shaft": math.sqrt(KS * (1 / JR + 1 / JG)) / (2 * math.pi),
}  # fmt: skip
NAMES = {"fore": "tower_fore_aft", "side": "tower_side_side", "flap": "blade_flap", "edge": "blade_edge",
         "shaft": "drivetrain_torsion"}  # fmt: skip
SHOWN = {"fore": ("tower_fore_aft", "m/s^2", 5e-3), "side": ("tower_side_side", "m/s^2", 5e-3),
         "flap": ("flap_moment_1", "kN m", 20.0), "edge": ("edge_moment_1", "kN m", 20.0),
         "shaft": ("generator_speed", "rad/s", 1e-3)}  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """Hold which parts the turbine has, and which of them its model takes for rigid; "" none."""

    name: str
    kind: str
    parts: tuple[str, ...]
    rigid: str = ""
    truth: tuple[str, ...] = ()
    quantity: tuple[str, float, float] | None = None
    outside: bool = False


@njit
def _damped(v: float, usual: float, squared: bool) -> float:
    return v * abs(v) / usual if squared else v


@njit
def _flow(s: np.ndarray, u: np.ndarray, w: np.ndarray, has: np.ndarray, squared: np.ndarray, d: np.ndarray) -> None:
    """Write ds/dt of speed, generator, twist, fore-aft 2, side-side 2, flap 2, edge 2."""
    rel = w[0] - (s[4] if has[0] else 0.0)
    torque = Q0 + Q_V * rel + Q_B * (u[0] - PITCH0) + Q_W * (s[0] - SPEED0)
    thrust = T_V * rel + T_B * (u[0] - PITCH0) + T_W * (s[0] - SPEED0)

    if has[4]:
        slip = s[0] - s[1]
        shaft = KS * s[2] + CS * _damped(slip, 0.004, squared[4])
        d[0], d[1], d[2] = (torque - shaft) / JR, (shaft - 1e3 * u[1]) / JG, slip
    else:
        d[0] = d[1] = (torque - 1e3 * u[1]) / (JR + JG)
        d[2] = 0.0
    d[3], d[4] = s[4], (thrust - C_FA * _damped(s[4], 0.05, squared[0]) - K_FA * s[3]) / M
    d[5], d[6] = s[6], (ROLL * (1e3 * u[1] - Q0) + w[1] - C_SS * _damped(s[6], 0.01, squared[1]) - K_SS * s[5]) / M
    for k, (hertz, ratio, gain) in enumerate((FLAP, EDGE)):
        a, load = 2 * math.pi * hertz, gain * (T0 + thrust if k == 0 else torque)
        usual = 400.0 if k == 0 else 900.0
        d[7 + 2 * k] = s[8 + 2 * k]
        d[8 + 2 * k] = a * a * (load - s[7 + 2 * k]) - 2 * ratio * a * _damped(s[8 + 2 * k], usual, squared[2 + k])


@njit
def _run(u: np.ndarray, w: np.ndarray, has: np.ndarray, squared: np.ndarray) -> np.ndarray:
    """Return generator speed, both tower accelerations and both moments at every sample (N, 5)."""
    s, k, rows, h = np.zeros(11), np.zeros((4, 11)), np.empty((len(u), 5)), STEP_S / FINE
    s[0] = s[1] = SPEED0
    s[2], s[7], s[9] = Q0 / KS, FLAP[2] * T0, EDGE[2] * Q0
    for i in range(len(u)):
        _flow(s, u[i], w[i * FINE], has, squared, k[0])
        rows[i, 0], rows[i, 1], rows[i, 2] = s[1], k[0, 4], k[0, 6]
        rows[i, 3], rows[i, 4] = s[7], s[9]
        for j in range(i * FINE, (i + 1) * FINE):
            _flow(s, u[i], w[j], has, squared, k[0])
            _flow(s + 0.5 * h * k[0], u[i], w[j], has, squared, k[1])
            _flow(s + 0.5 * h * k[1], u[i], w[j], has, squared, k[2])
            _flow(s + h * k[2], u[i], w[j], has, squared, k[3])
            s += h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
    return rows


def simulate(trial: Trial, samples: int, seed: int) -> dict[str, np.ndarray]:
    """Run the turbine; on odd seeds the rigid part is damped by the square of its speed."""
    rng, n, h = np.random.default_rng(seed), samples * FINE, STEP_S / FINE

    def wander(memory_s: float) -> np.ndarray:
        keep = math.exp(-h / memory_s)
        kicks = rng.standard_normal(n) * math.sqrt(1 - keep**2)
        return np.asarray(lfilter([1.0], [1.0, -keep], kicks))

    w = np.column_stack([0.8 * wander(1 / WIND_RATE), 2e3 * wander(3.0)])
    pitch = PITCH0 + 0.5 * np.repeat(rng.choice([-1.0, 1.0], samples // 10 + 1), 10)[:samples]
    torque = (Q0 + 8e4 * np.repeat(rng.choice([-1.0, 1.0], samples // 7 + 1), 7)[:samples]) / 1e3
    has = np.array([p in trial.parts for p in NAMES])
    squared = np.array([p == trial.rigid and seed % 2 == 1 for p in NAMES])
    rows = _run(np.column_stack([pitch, torque]), w, has, squared)
    order = ("shaft", "fore", "side", "flap", "edge")
    columns = {"time_s": STEP_S * np.arange(samples), "pitch": pitch, "torque": torque}
    for part, column in zip(order, rows.T, strict=True):
        name, _, noise = SHOWN[part]
        columns[name] = column + noise * rng.standard_normal(samples)
    return columns


def equations_of(trial: Trial) -> tuple[dict[str, tuple[str, str, float]], dict[str, str]]:
    """Return states (unit, derivative, start) and outputs of the model, in which one part is rigid."""
    parts = [p for p in trial.parts if p != trial.rigid]
    rel = "(wind_speed - v_fa)" if "fore" in parts else "wind_speed"
    torque = f"(Q0 + Q_V*{rel} + Q_B*(pitch - 14.9) + Q_W*(omega - 1.267))"
    thrust = f"(T_V*{rel} + T_B*(pitch - 14.9) + T_W*(omega - 1.267))"
    states: dict[str, tuple[str, str, float]] = {}
    if "shaft" in parts:
        shaft = "(K_s*twist + C_s*(omega - omega_g))"
        states["omega"] = ("rad/s", f"({torque} - {shaft})/Jr", SPEED0)
        states["omega_g"] = ("rad/s", f"({shaft} - 1000*torque)/Jg", SPEED0)
        states["twist"] = ("rad", "omega - omega_g", Q0 / KS)
    else:
        states["omega"] = ("rad/s", f"({torque} - 1000*torque)/(Jr + Jg)", SPEED0)
    shown = {"shaft": "omega_g" if "shaft" in parts else "omega"}
    motions = {"fore": ("fa", f"({thrust} - c_fa*v_fa - k_fa*x_fa)/M"),
               "side": ("ss", "(roll*(1000*torque - Q0) - c_ss*v_ss - k_ss*x_ss)/M")}  # fmt: skip
    for part, (tag, rate) in motions.items():
        if part in parts:
            states |= {f"x_{tag}": ("m", f"v_{tag}", 0.0), f"v_{tag}": ("m/s", rate, 0.0)}
        shown[part] = rate if part in parts else "0*omega"
    loads = {"flap": (FLAP, f"(T0 + {thrust})", T0), "edge": (EDGE, torque, Q0)}
    for part, ((hertz, ratio, gain), load, mean) in loads.items():
        if part in parts:
            a, q, v = 2 * math.pi * hertz, f"q_{part}", f"r_{part}"
            states[q] = ("kN m", v, gain * mean)
            states[v] = ("kN m/s", f"{a * a!r}*({gain!r}*{load} - {q}) - {2 * ratio * a!r}*{v}", 0.0)
        shown[part] = f"q_{part}" if part in parts else f"{gain!r}*{load}"
    states["wind_speed"] = ("m/s", "-wind_rate*wind_speed", 0.0)
    return states, {SHOWN[p][0]: shown[p] for p in dict.fromkeys(("shaft", *trial.parts))}


_VALUES: Mapping[str, tuple[float, str, bool]] = {
    "Jr": (JR, "kg m^2", False), "Jg": (JG, "kg m^2", False), "K_s": (KS, "N m", False), "C_s": (CS, "N m s", False),
    "M": (M, "kg", False), "Q0": (Q0, "N m", False), "T0": (T0, "N", False), "Q_V": (Q_V, "N s", False),
    "Q_B": (Q_B, "N m/deg", True), "Q_W": (Q_W, "N m s", True), "T_V": (T_V, "N s/m", False),
    "T_B": (T_B, "N/deg", True), "T_W": (T_W, "N s", False), "c_fa": (C_FA, "N s/m", True),
    "k_fa": (K_FA, "N/m", True), "c_ss": (C_SS, "N s/m", True), "k_ss": (K_SS, "N/m", True),
    "roll": (ROLL, "1/m", False), "wind_rate": (WIND_RATE, "1/s", False),
}  # fmt: skip


def equations_text(trial: Trial) -> str:
    """Return the model as model.toml."""
    states, outputs = equations_of(trial)
    everything = " ".join([*(s[1] for s in states.values()), *outputs.values()])
    units = {name: unit for name, unit, _ in SHOWN.values()}
    lines = ['[model]\nname = "turbine above rated, one part rigid"\n[parameters]']
    for name, (value, unit, free) in _VALUES.items():
        if name in everything:
            ends = sorted((0.3 * value, 3 * value))
            bounds = f", min = {ends[0]!r}, max = {ends[1]!r}, free = true" if free else ""
            lines.append(f'{name} = {{ value = {value!r}, unit = "{unit}"{bounds} }}')
    for name, (unit, rate, start) in states.items():
        lines.append(f'[[state]]\nname = "{name}"\nunit = "{unit}"\nderivative = "{rate}"')
        lines.append(f"initial = {{ value = {start!r}, free = true }}")
    lines += [f'[[output]]\nname = "{n}"\nunit = "{units[n]}"\nequation = "{e}"' for n, e in outputs.items()]
    return "\n".join(lines) + "\n"


def linear_model(trial: Trial) -> dict[str, Any]:
    """Return the same about its working point, discrete, inputs held over a sample: the equations are linear."""
    states, outputs = equations_of(trial)
    values = {name: value for name, (value, _, _) in _VALUES.items()}
    start = {name: s[2] for name, s in states.items()} | {"pitch": PITCH0, "torque": Q0 / 1e3}
    names = [*states, "pitch", "torque"]
    code = [compile(t, "model", "eval") for t in (*(s[1] for s in states.values()), *outputs.values())]

    def at(point: Mapping[str, float]) -> np.ndarray:
        return np.array([eval(c, {}, {**values, **point}) for c in code])  # own text

    middle = at(start)
    slopes = np.column_stack([at({**start, name: start[name] + 1.0}) - middle for name in names])
    n, m = len(states), len(names) - len(states)
    held = expm(np.vstack([slopes[:n], np.zeros((m, n + m))]) * STEP_S)
    units = {name: unit for name, unit, _ in SHOWN.values()}
    offsets = dict(zip(outputs, middle[n:].tolist(), strict=True))
    return {
        "kind": "state_space", "sample_time_s": STEP_S,
        "inputs": [{"name": "pitch", "unit": "deg", "offset": PITCH0},
                   {"name": "torque", "unit": "kN m", "offset": Q0 / 1e3}],
        "outputs": [{"name": o, "unit": units[o], "offset": v} for o, v in offsets.items()],
        "states": [{"name": name, "unit": s[0]} for name, s in states.items()], "A": held[:n, :n].tolist(),
        "B": held[:n, n:].tolist(), "C": slopes[n:, :n].tolist(), "D": slopes[n:, n:].tolist(), "K": None,
        "x0": [0.0] * n, "innovation_covariance": None, "scheduling": None,
    }  # fmt: skip


def write_case(folder: Path, trial: Trial, samples: int, seed: int) -> Path:
    """Write case.toml, roles.toml, recording.csv and the baseline; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    columns, (_, outputs) = simulate(trial, samples, seed), equations_of(trial)
    units = {name: unit for name, unit, _ in SHOWN.values()} | {"pitch": "deg", "torque": "kN m"}
    channels = [("pitch", "input"), ("torque", "input"), *((o, "output") for o in outputs)]
    table = np.column_stack([columns[n] for n in ("time_s", *(c for c, _ in channels))])
    header = ",".join(["time_s", *(c for c, _ in channels)])
    np.savetxt(folder / "recording.csv", table, "%.9g", ",", header=header, comments="")
    roles = "".join(f'[[channel]]\nname = "{n}"\nunit = "{units[n]}"\nrole = "{r}"\n' for n, r in channels)
    (folder / "roles.toml").write_text('[recording]\ntime = "time_s"\n' + roles)
    own = trial.kind == "equations"
    file = "model.toml" if own else "model.json"
    (folder / file).write_text(equations_text(trial) if own else json.dumps(linear_model(trial)))
    (folder / "case.toml").write_text(
        f'[case]\ntitle = "rig"\n[recordings]\nfiles = ["recording.csv"]\nroles = "roles.toml"\n'
        f'[baseline]\nkind = "{trial.kind}"\nfile = "{file}"\n[context]\nmachine = "wind turbine"\nblades = 3\n'
    )
    return folder


def trials() -> list[Trial]:
    """List each part that may be rigid, beside one that is not, in equations and in a linear model; and nulls."""
    found = []
    for kind in ("equations", "state_space"):
        for rigid, beside in (
            ("fore", "side"),
            ("side", "fore"),
            ("flap", "fore"),
            ("edge", "side"),
            ("shaft", "fore"),
        ):
            told = ("frequency_hz", HERTZ[rigid], 0.1)
            found.append(Trial(f"rigid {rigid}", kind, (rigid, beside), rigid, (NAMES[rigid],), told))
        found.append(Trial("null, towers", kind, ("fore", "side")))
        found.append(Trial("null, blades", kind, ("flap", "edge")))
        found.append(Trial("null, shaft", kind, ("shaft", "fore")))
    return found


def diagnose_one(trial: Trial, folder: Path, samples: int, seed: int, sham: int) -> dict[str, Any]:
    """Write a case, diagnose it, judge the answer."""
    from aeolid.diagnose.data.case import load_case
    from aeolid.diagnose.pipeline import study

    begun = time.perf_counter()
    case = load_case(write_case(folder, trial, samples, seed))
    result = study(case, sham=sham, seed=1, progress=lambda text, share: None)
    return diagnosis.answer(trial, result) | {"seed": seed, "seconds": round(time.perf_counter() - begun, 1)}
