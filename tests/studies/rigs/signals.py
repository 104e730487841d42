"""Hide faults of drives, sensors and loggers from a model and ask the diagnosis for them.

    python tests/studies/rigs/signals.py [--seeds 1] [--first-seed 1] [--samples 2000] [--sham 0] [--only NAME …]
                                         [--json FILE]

The rig is a stage of two axes, two masses on springs with a third spring between them: two drives (V), two speed
sensors, a sampled speed loop with an injected test signal, unmeasured random forces. It is integrated here at 40 points
a sample, apart from the catalogue. Odd seeds have the effect in the catalogue's own form, even seeds in another: two
lags in a row, a servo that is rate limited, rounded knees, slack with a soft stop, uneven levels, noise behind a
clipping sensor, truncation, a drift that levels off, a sensor turned about its axis.
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
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import expm

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import diagnosis

Array = NDArray[np.float64]
STEP_S, FINE = 0.02, 40
MASS, DAMPING, SPRINGS, BETWEEN, GAIN = 2.0, 3.0, (80.0, 140.0), 40.0, 4.0  # kg, N s/m, N/m, N/m, N/V
NAMES = ("x_drive", "y_drive", "x_speed", "y_speed")
KINDS = ("none", "lag", "order2", "delay", "rate", "clip", "zone", "hold", "play", "levels")  # of the x drive

_EQUATIONS = (
    f"""[model]
name = "two-axis stage"
[parameters]
M = {{ value = {MASS}, unit = "kg" }}
c = {{ value = {DAMPING}, min = 0.0, max = 50.0, unit = "N s/m", free = true }}
kx = {{ value = {SPRINGS[0]}, min = 5.0, max = 600.0, unit = "N/m", free = true }}
ky = {{ value = {SPRINGS[1]}, min = 5.0, max = 600.0, unit = "N/m", free = true }}
kb = {{ value = {BETWEEN}, min = 0.0, max = 400.0, unit = "N/m", free = true }}
g = {{ value = {GAIN}, unit = "N/V" }}
"""
    + "".join(
        f'[[state]]\nname = "{n}"\nderivative = "{f}"\nunit = "{u}"\n'
        for n, f, u in (
            ("qx", "vx", "m"),
            ("vx", "(g*x_drive - c*vx - kx*qx - kb*(qx - qy))/M", "m/s"),
            ("qy", "vy", "m"),
            ("vy", "(g*y_drive - c*vy - ky*qy - kb*(qy - qx))/M", "m/s"),
        )
    )
    + "".join(f'[[output]]\nname = "{a}_speed"\nequation = "v{a}"\nunit = "m/s"\n' for a in "xy")
)
_ROLES = '[recording]\ntime = "time_s"\n' + "".join(
    f'[[channel]]\nname = "{n}"\nunit = "{u}"\nrole = "{r}"\n'
    for n, u, r in zip(NAMES, ("V", "V", "m/s", "m/s"), ("input", "input", "output", "output"), strict=True)
)  # fmt: skip


@dataclass(frozen=True)
class Fault:
    """Hold one trial: the drive's fault (kind, two values), or a sensor's; what a right answer is.

    truth: acceptable ids (empty: nothing may be named); quantity: label, value, where the odd seeds' form is exact.
    """

    name: str
    baseline: str
    truth: tuple[str, ...] = ()
    quantity: tuple[str, float] | None = None
    drive: tuple[str, float, float] = ("none", 0.0, 0.0)
    sensor: tuple[str, float, float] = ("none", 0.0, 0.0)
    offset_s: float = 0.0
    noise: tuple[float, float, float] = (0.6, 0.4, 0.01)  # force N, its memory s, sensor noise in m/s


@njit
def _act(kind: int, a: float, b: float, soft: bool, s: Array, ring: Array, at: int, command: float, dt: float) -> float:
    """Return what the x drive does with a command; s is its state, ring its last 4096 commands."""
    if kind == 1:  # lag of a seconds; the other form: two lags in a row
        s[0] += dt * (command - s[0]) / (0.85 * a if soft else a)
        s[1] += dt * (s[0] - s[1]) / (0.15 * a)
        return s[1] if soft else s[0]
    if kind == 2:  # a rad/s, damping b; the other form: a late command
        if soft:
            command = ring[(at - int(0.05 / a / dt)) % 4096]
        s[1] += dt * (a * a * (command - s[0]) - 2 * b * a * s[1])
        s[0] += dt * s[1]
        return s[0]
    if kind == 3:
        late = ring[(at - round(a / dt)) % 4096]
        return 0.5 * (late + ring[(at - round(a / dt) - 12) % 4096]) if soft else late
    if kind == 4:  # a V/s; the other form: a servo of 10 ms that is rate limited
        gap = command - s[0]
        move = min(max(gap / 0.01, -a), a) * dt if soft else min(max(gap, -a * dt), a * dt)
        s[0] += move
        return s[0]
    if kind == 5:
        return command / (1.0 + abs(command / a) ** 12) ** (1.0 / 12.0) if soft else min(max(command, -a), a)
    if kind == 6:
        beyond = max(abs(command) - a, 0.0)
        if soft:  # rounded over a tenth of the width
            beyond = 0.5 * (abs(command) - a + math.sqrt((abs(command) - a) ** 2 + (0.1 * a) ** 2))
        return math.copysign(beyond, command)
    if kind == 7:
        if abs(command - s[0]) > a * (1.0 + (0.05 * math.sin(0.01 * at) if soft else 0.0)):
            s[0] = command
        return s[0]
    if kind == 8:  # full width a; the other form: a soft stop at either wall
        over = max(command - s[0] - 0.5 * a, 0.0) + min(command - s[0] + 0.5 * a, 0.0)
        s[0] += over * (min(dt / 0.004, 1.0) if soft else 1.0)
        return s[0]
    if kind == 9:
        level = math.floor(command / a + 0.5)
        return level * a + (0.05 * a * math.sin(5.0 * level) if soft else 0.0)
    return command


@njit
def _run(u_test: Array, push: Array, jitter: Array, kind: int, a: float, b: float, soft: bool) -> tuple[Array, Array]:
    """Integrate the loop; returns commands (N, 2) and true speeds at every fine step (N FINE, 2)."""
    N, dt = len(u_test), STEP_S / FINE
    commands, speeds = np.empty((N, 2)), np.empty((N * FINE, 2))
    q, v, s, ring = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(4096)
    for i in range(N):
        for j in range(2):
            commands[i, j] = u_test[i, j] - 1.0 * (v[j] + jitter[i, j])
        for part in range(FINE):
            k = i * FINE + part
            speeds[k] = v
            ring[k % 4096] = commands[i, 0]
            acting = _act(kind, a, b, soft, s, ring, k, commands[i, 0], dt), commands[i, 1]
            for j in range(2):
                q[j] += 0.5 * dt * v[j]  # drift, kick, drift: second order
            gap = q[0] - q[1]
            for j in range(2):
                spring = SPRINGS[j] * q[j] + BETWEEN * (gap if j == 0 else -gap)
                force = GAIN * acting[j] + push[k, j] - DAMPING * v[j] - spring
                v[j] += dt * force / MASS
            for j in range(2):
                q[j] += 0.5 * dt * v[j]
    return commands, speeds


def _memory(kicks: Array, keep: float) -> Array:
    """Return first-order noise of unit size."""
    from scipy.signal import lfilter

    result: Array = lfilter([math.sqrt(1 - keep**2)], [1, -keep], kicks, axis=0)
    return result


def _sense(fault: Fault, fine: Array, jitter: Array, soft: bool) -> Array:
    """Return what the loggers hold of both speeds (N, 2): filtered, sampled, noisy, then clipped, rounded …"""
    from scipy import signal

    kind, a, b = fault.sensor
    fine, dt = fine.copy(), STEP_S / FINE
    if kind == "lag":
        taus = (0.85 * a, 0.15 * a) if soft else (a,)
        for tau in taus:
            keep = math.exp(-dt / tau)
            fine[:, 0] = signal.lfilter([1 - keep], [1, -keep], fine[:, 0])
    if kind == "order2":
        top, bottom, _ = signal.cont2discrete(([a * a], [1, 2 * b * a, a * a]), dt, method="bilinear")
        fine[:, 0] = signal.lfilter(top.ravel(), bottom, np.roll(fine[:, 0], 2) if soft else fine[:, 0])
    shift = round(fault.offset_s / dt)
    rows = np.clip(np.arange(0, len(fine), FINE) + shift, 0, len(fine) - 1)
    seen = fine[rows]
    clean, seen = seen.copy(), seen + jitter
    times = STEP_S * np.arange(len(seen))
    x = seen[:, 0]
    seen[:, 0] = {
        "clip": lambda: np.clip(clean[:, 0], -a, a) + 0.1 * jitter[:, 0] if soft else np.clip(x, -a, a),
        "levels": lambda: a * (np.floor(x / a) if soft else np.rint(x / a)),
        "scale": lambda: a * x + (0.1 * np.std(x) if soft else 0.0),
        "bias": lambda: x + a,
        "drift": lambda: x + a * (times[-1] * (1 - np.exp(-2 * times / times[-1])) if soft else times),
    }.get(kind, lambda: x)()
    if kind == "skew":
        turned = np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]]) if soft else [[1, a], [0, 1]]
        seen = seen @ np.transpose(turned)
    if kind == "swap":
        seen = seen[:, ::-1]
    return seen


def record(fault: Fault, samples: int, seed: int) -> Array:
    """Return the recorded table (N, 5): time, both commands, both speeds."""
    rng = np.random.default_rng(seed)
    force, memory, noise = fault.noise
    levels = [np.repeat(rng.uniform(-3, 3, samples // n + 1), n)[:samples] for n in (9, 13)]
    wander = _memory(rng.standard_normal((samples, 2)), 0.8)
    push = force * _memory(rng.standard_normal((samples * FINE, 2)), math.exp(-STEP_S / FINE / memory))
    jitter = noise * rng.standard_normal((samples, 2))
    kind, a, b = fault.drive
    soft = seed % 2 == 0
    commands, fine = _run(np.column_stack(levels) + wander, push, jitter, KINDS.index(kind), a, b, soft)
    if fault.sensor[0] == "input sign":
        commands[:, 1] *= -1
    if fault.sensor[0] == "input scale":
        commands[:, 1] *= fault.sensor[1]
    return np.column_stack([STEP_S * np.arange(samples), commands, _sense(fault, fine, jitter, soft)])


def linear_model() -> Any:
    """Return the stage without any fault as a discrete state-space model, inputs held over a sample."""
    from aeolid.models.model_file import Signal
    from aeolid.models.state_space import StateSpace

    stiff = np.array([[SPRINGS[0] + BETWEEN, -BETWEEN], [-BETWEEN, SPRINGS[1] + BETWEEN]])
    flow = np.zeros((6, 6))
    flow[:2, 2:4] = np.eye(2)
    flow[2:4, :2], flow[2:4, 2:4], flow[2:4, 4:] = -stiff / MASS, -DAMPING / MASS * np.eye(2), GAIN / MASS * np.eye(2)
    held = expm(flow * STEP_S)
    return StateSpace(
        A=held[:4, :4], B=held[:4, 4:], C=np.eye(4)[2:], D=np.zeros((2, 2)), K=None, x0=np.zeros(4),
        innovation_covariance=None, sample_time_s=STEP_S, inputs=tuple(Signal(n, "V") for n in NAMES[:2]),
        outputs=tuple(Signal(n, "m/s") for n in NAMES[2:]), states=tuple(Signal(n) for n in ("qx", "qy", "vx", "vy")),
    )  # fmt: skip


def write_case(folder: Path, fault: Fault, samples: int, seed: int) -> Path:
    """Write case.toml, roles.toml, recording.csv and the baseline; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    table = record(fault, samples, seed)
    lines = [",".join(("time_s", *NAMES)), *(",".join(f"{x:.9g}" for x in row) for row in table)]
    (folder / "recording.csv").write_text("\n".join(lines) + "\n")
    (folder / "roles.toml").write_text(_ROLES)
    file = "model.toml" if fault.baseline == "equations" else "model.json"
    text = _EQUATIONS if fault.baseline == "equations" else json.dumps(linear_model().to_json())
    (folder / file).write_text(text)
    (folder / "case.toml").write_text(
        f'[case]\ntitle = "stage"\n[recordings]\nfiles = ["recording.csv"]\nroles = "roles.toml"\n'
        f'[baseline]\nkind = "{fault.baseline}"\nfile = "{file}"\n[context]\nmachine = "rig"\n'
    )
    return folder


def trials() -> list[Fault]:
    """List what is hidden, for both kinds of baseline; sizes are such that a second look is needed to see them."""
    found = []
    for kind in ("equations", "state_space"):

        def add(name: str, truth: tuple[str, ...], quantity: tuple[str, float] | None = None,
                kind: str = kind, **more: Any) -> None:  # fmt: skip
            found.append(Fault(name, kind, truth, quantity, **more))

        add("drive lag", ("actuator_lag",), ("tau_s", 0.08), drive=("lag", 0.08, 0.0))
        for w, zeta in ((12.0, 0.9), (8.0, 0.7), (5.0, 0.5)):
            add(f"drive {w:g} rad/s", ("actuator_second_order",), ("omega_rad_s", w), drive=("order2", w, zeta))
        add("drive delay", ("transport_delay",), ("delay_s", 0.05), drive=("delay", 0.05, 0.0))
        add("outputs late", ("data_time_offset",), ("offset_s", 0.03), offset_s=-0.03)
        add("outputs early", ("data_time_offset",), ("offset_s", -0.05), offset_s=0.05)
        add("drive rate", ("rate_limit",), ("rate_per_s", 30.0), drive=("rate", 30.0, 0.0))
        add("drive clips", ("input_saturation",), ("high", 2.2), drive=("clip", 2.2, 0.0))
        add("dead zone", ("deadband",), ("width", 0.5), drive=("zone", 0.5, 0.0))
        add("dead band", ("deadband",), ("width", 0.9), drive=("hold", 0.9, 0.0))
        add("drive play", ("backlash",), ("width", 0.8), drive=("play", 0.8, 0.0))
        add("drive levels", ("input_quantisation",), ("spacing", 1.0), drive=("levels", 1.0, 0.0))
        add("sensor lag", ("sensor_lag",), ("tau_s", 0.04), sensor=("lag", 0.04, 0.0))
        add("sensor filter", ("sensor_second_order",), ("omega_rad_s", 30.0), sensor=("order2", 30.0, 0.7))
        add("sensor clips", ("sensor_saturation",), ("high", 0.35), sensor=("clip", 0.35, 0.0))
        add("sensor levels", ("sensor_quantisation",), ("spacing", 0.15), sensor=("levels", 0.15, 0.0),
            noise=(0.2, 0.4, 0.002))  # fmt: skip
        add("sensor scale", ("sensor_scale",), ("factor", 1.15), sensor=("scale", 1.15, 0.0))
        add("sensor unit", ("sensor_scale",), ("factor", 57.29578), sensor=("scale", 57.29578, 0.0))
        add("input unit", ("sensor_scale",), ("factor", 1 / 57.29578), sensor=("input scale", 57.29578, 0.0))
        add("sensor sign", ("sensor_sign",), sensor=("scale", -1.0, 0.0))
        add("input sign", ("sensor_sign",), sensor=("input sign", 0.0, 0.0))
        add("sensor skew", ("sensor_cross_axis",), ("share", 0.12), sensor=("skew", 0.12, 0.0))
        add("channels swapped", ("data_fault",), sensor=("swap", 0.0, 0.0))
        testable = kind == "equations"  # a linear model has free offsets
        add("sensor bias", ("sensor_bias",) if testable else (), ("bias", 0.1), sensor=("bias", 0.1, 0.0))
        add("sensor drift", ("sensor_drift",) if testable else (), ("rate_per_s", 0.01), sensor=("drift", 0.01, 0.0))
        for force, memory, noise in ((0.6, 0.4, 0.01), (2.0, 0.1, 0.01), (0.2, 3.0, 0.05), (1.0, 1.0, 0.002)):
            add(f"null, {force:g} N over {memory:g} s, {noise:g} m/s", (), noise=(force, memory, noise))
    return found


def judge(fault: Fault, found: dict[str, Any]) -> dict[str, Any]:
    """Compare a diagnosis with the truth, as tests/studies/diagnosis.py does; a data fault counts as its name."""
    named = [e["id"] for e in found["effects"]] or (["data_fault"] if found["verdict"] == "data_fault" else [])
    if fault.truth:
        outcome = "right" if set(named) & set(fault.truth) else "wrong" if named else "missed"
        if outcome == "right" and found["verdict"] == "multiple":
            outcome = "right, and one too many"
    else:
        outcome = "wrong" if named else "safe"
    error = None
    if fault.quantity is not None:
        label, value = fault.quantity
        told = [e["parameters"][label]["value"] for e in found["effects"]
                if e["id"] in fault.truth and label in e["parameters"]]  # fmt: skip
        error = told[0] / value - 1 if told else None
    return {
        "trial": fault.name, "baseline": fault.baseline, "verdict": found["verdict"], "ids": named, "outcome": outcome,
        "parameter_error": error, "recovered": found["sealed"]["recovered_fraction"],
        "where": (found["location"] or {}).get("entry"), "kind": "hidden" if fault.truth else "null",
    }  # fmt: skip


def diagnose_one(fault: Fault, folder: Path, samples: int, seed: int, sham: int) -> dict[str, Any]:
    """Write a case, diagnose it, judge the answer."""
    from aeolid.diagnose.conclusion.verdict import diagnose
    from aeolid.diagnose.data.case import load_case
    from aeolid.diagnose.pipeline import study

    begun = time.perf_counter()
    case = load_case(write_case(folder, fault, samples, seed))
    result = study(case, sham=sham, seed=1, progress=lambda text, share: None)
    seconds = round(time.perf_counter() - begun, 1)
    row = judge(fault, diagnose(result))
    missed = fault.truth and "right" not in row["outcome"]
    row["nats"] = diagnosis.nats_of_truth(result, fault.truth) if missed else None
    return row | {"seed": seed, "seconds": seconds}


def main(arguments: list[str] | None = None) -> int:
    """Run the study; exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=1, help="recordings a trial")
    parser.add_argument("--first-seed", type=int, default=1, help="number of the first; odd: the catalogue's own form")
    parser.add_argument("--samples", type=int, default=2000, help="length of each, at 50 Hz")
    parser.add_argument("--sham", type=int, default=0, help="null runs of the procedure in each diagnosis")
    parser.add_argument("--only", nargs="*", help="names (or parts of names) of trials, baseline last")
    parser.add_argument("--json", help="write the rows to this file")
    options = parser.parse_args(arguments)
    chosen = [f for f in trials() if not options.only or any(o in f"{f.name} {f.baseline}" for o in options.only)]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for number, fault in enumerate(chosen):
            for seed in range(options.first_seed, options.first_seed + options.seeds):
                place = Path(folder) / f"{number}_{seed}"
                rows.append(diagnose_one(fault, place, options.samples, 200 + 2 * number + 1000 * seed + seed % 2,
                                         options.sham))  # fmt: skip
                print(diagnosis.table(rows[-1:]).splitlines()[1], flush=True)
                if options.json:
                    Path(options.json).write_text(json.dumps(rows, indent=1) + "\n")
    print(diagnosis.table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
