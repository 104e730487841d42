"""Hide known physics from a model and ask the diagnosis what is missing: recall, false names, confusion, errors.

    python tests/studies/diagnosis.py [--seeds 3] [--first-seed 1] [--samples 3000] [--sham 0]
                                      [--only NAME …] [--json FILE]

The rig is a mass on a spring, driven by a voltage under a sampled position loop with an injected test signal, pushed by
an unmeasured random force and measured with noise. It is integrated here at 40 points a sample with forms that the
catalogue does not use: a second-order drive for a lag, a bristle model (LuGre) for dry friction, the geometry of a
stretched wire for a cubic spring, a flexible bracket under the sensor for a mode. The model given to the diagnosis
lacks exactly one of these (or nothing, or something that no catalogue entry describes).
"""

from __future__ import annotations

import argparse
import collections
import json
import math
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import expm

from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

if TYPE_CHECKING:
    from aeolid.diagnose.pipeline import Study

STEP_S, FINE = 0.02, 40
MASS, DAMPING, STIFFNESS, GAIN = 2.0, 1.5, 80.0, 4.0  # kg, N s/m, N/m, N/V: 1 Hz, damping ratio 0.06

_ROLES = '[recording]\ntime = "time_s"\n' + "".join(
    f'[[channel]]\nname = "{n}"\nunit = "{u}"\nrole = "{r}"\n'
    for n, u, r in (("drive", "V", "input"), ("position", "m", "output"), ("speed", "m/s", "output"))
)
_EQUATIONS = """[model]
name = "mass on a spring"
[parameters]
M = {{ value = 2.0, min = 0.5, max = 8.0, unit = "kg", free = true }}
c = {{ value = 1.5, min = 0.0, max = 30.0, unit = "N s/m", free = true }}
k = {{ value = {stiffness!r}, min = 5.0, max = 400.0, unit = "N/m", free = true }}
g = {{ value = {gain!r}, unit = "N/V" }}
[[state]]
name = "q"
derivative = "v"
unit = "m"
[[state]]
name = "v"
derivative = "(g*drive - c*v - k*q)/M"
unit = "m/s"
{outputs}"""
_OUTPUT = {
    "position": '[[output]]\nname = "position"\nequation = "q"\nunit = "m"\n',
    "speed": '[[output]]\nname = "speed"\nequation = "v"\nunit = "m/s"\n',
}


@dataclass(frozen=True)
class Hidden:
    """Hold one trial: what the rig has and the model lacks, and what a right answer looks like.

    truth: acceptable ids (empty: nothing may be named); quantity: label, value and relative tolerance of the reported
    parameter; outside: no catalogue entry describes the effect.
    """

    name: str
    kind: str
    effect: dict[str, float] = field(default_factory=dict)
    truth: tuple[str, ...] = ()
    quantity: tuple[str, float, float] | None = None
    outputs: tuple[str, ...] = ("position", "speed")
    declared_gain: float = GAIN
    declared_stiffness: float = STIFFNESS
    noise: tuple[float, float, float] = (0.5, 0.5, 0.01)  # force N, its memory s, sensor noise over spread
    outside: bool = False


def _drive(rig: dict[str, float], s: dict[str, float], queue: list[float], command: float, dt: float) -> float:
    """Return the voltage that acts: delayed by a ring buffer, then a first- or second-order drive."""
    if "delay" in rig:
        queue.append(command)
        command = queue[max(0, len(queue) - 1 - round(rig["delay"] / dt))]
    if "lag" in rig:
        s["drive"] += dt * (command - s["drive"]) / rig["lag"]
        return s["drive"]
    if "drive_w" in rig:
        w = rig["drive_w"]
        s["drive_rate"] += dt * (w * w * (command - s["drive"]) - 2 * rig["drive_zeta"] * w * s["drive_rate"])
        s["drive"] += dt * s["drive_rate"]
        return s["drive"]
    if "backlash" in rig:
        s["drive"] = min(max(s["drive"], command - rig["backlash"]), command + rig["backlash"])
        return s["drive"]
    return command


def _force(rig: dict[str, float], s: dict[str, float], q: float, v: float, t: float, dt: float) -> float:
    """Return the extra force on the mass in N."""
    force = 0.0
    if "bristle_N" in rig:  # LuGre without Stribeck effect: z' = v − |v| z σ0/Fc, F = σ0 z
        stiff = 2e4
        rate = abs(v) * stiff / rig["bristle_N"] + 1e-9
        s["bristle"] += (v / rate - s["bristle"]) * -math.expm1(-rate * dt)  # exact for a held speed: z' is stiff
        force -= stiff * s["bristle"]
    if "wire_N_per_m" in rig:  # two wires of length 1 m across the motion, slack-free and without pretension
        length = math.hypot(1.0, q)
        force -= 2 * rig["wire_N_per_m"] * (length - 1.0) * q / length
    if "hysteresis_N" in rig:  # Bouc–Wen, n = 1, rounded over 5 cm
        z = s["loop"]
        s["loop"] += dt * (v - 0.5 * abs(v) * z / 0.05 - 0.5 * v * abs(z) / 0.05)
        force -= rig["hysteresis_N"] * s["loop"] / 0.05
    if "swing" in rig:  # the spring's stiffness swings slowly
        force -= rig["swing"] * STIFFNESS * math.sin(2 * math.pi * t / 11.0) * q
    return force


def simulate(rig: dict[str, float], noise: tuple[float, float, float], samples: int, seed: int) -> dict[str, Any]:
    """Run the closed loop; returns columns time_s, drive (V, as commanded), position (m), speed (m/s)."""
    rng = np.random.default_rng(seed)
    dt = STEP_S / FINE
    s: dict[str, float] = collections.defaultdict(float)
    q = v = push = last = bracket = bracket_rate = 0.0
    queue: list[float] = []
    keep = math.exp(-dt / noise[1])
    kicks = noise[0] * math.sqrt(1 - keep**2) * rng.standard_normal(samples * FINE)
    jitter = noise[2] * rng.standard_normal((samples, 2)) * np.array([0.12, 0.8])  # typical spreads of the outputs
    steps = np.repeat(rng.uniform(-0.3, 0.3, samples // 75 + 1), 75)
    excitation = 3.0 * np.repeat(rng.choice([-1.0, 1.0], samples // 5 + 1), 5)
    rows = np.empty((samples, 3))
    for i in range(samples):
        seen = np.array([q + bracket, v]) + jitter[i]
        command = 6.0 * (steps[i] - seen[0]) - 0.5 * (seen[0] - last) / STEP_S + excitation[i]
        last = seen[0]
        rows[i] = command, *seen
        for j in range(FINE):
            push = keep * push + kicks[i * FINE + j]
            q += 0.5 * dt * v  # drift, kick, drift: position and speed belong to one instant, second order
            acting = GAIN * _drive(rig, s, queue, command, dt)
            total = acting + push + _force(rig, s, q, v, i * STEP_S, dt)
            acceleration = (total - DAMPING * v - STIFFNESS * q) / MASS
            if "bracket_hz" in rig:
                w = 2 * math.pi * rig["bracket_hz"]
                bracket_rate += dt * (-acceleration - w * w * bracket - 2 * rig["bracket_zeta"] * w * bracket_rate)
                bracket += dt * bracket_rate
            v += dt * acceleration
            q += 0.5 * dt * v
    if "rectified" in rig:
        rows[:, 2] = abs(rows[:, 2])
    return {"time_s": STEP_S * np.arange(samples), "drive": rows[:, 0], "position": rows[:, 1], "speed": rows[:, 2]}


def linear_model(hidden: Hidden) -> StateSpace:
    """Return the rig without any effect as a discrete state-space model, inputs held over a sample."""
    k, g = hidden.declared_stiffness, hidden.declared_gain
    flow = np.array([[0, 1, 0], [-k / MASS, -DAMPING / MASS, g / MASS], [0, 0, 0]])
    held = expm(flow * STEP_S)
    pick = np.array([["position", "speed"].index(n) for n in hidden.outputs])
    return StateSpace(
        A=held[:2, :2], B=held[:2, 2:], C=np.eye(2)[pick], D=np.zeros((len(pick), 1)), K=None, x0=np.zeros(2),
        innovation_covariance=None, sample_time_s=STEP_S, inputs=(Signal("drive", "V"),),
        outputs=tuple(Signal(n, {"position": "m", "speed": "m/s"}[n]) for n in hidden.outputs),
        states=(Signal("q", "m"), Signal("v", "m/s")),
    )  # fmt: skip


def write_case(folder: Path, hidden: Hidden, samples: int, seed: int) -> Path:
    """Write case.toml, roles.toml, recording.csv and the baseline; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    columns = simulate(hidden.effect, hidden.noise, samples, seed)
    kept = ["time_s", "drive", *hidden.outputs]
    table = np.column_stack([columns[n] for n in kept])
    lines = [",".join(kept), *(",".join(f"{x:.9g}" for x in row) for row in table)]
    (folder / "recording.csv").write_text("\n".join(lines) + "\n")
    head, *channels = _ROLES.split("[[channel]]\n")
    used = [c for c in channels if c.split('"')[1] in kept]
    (folder / "roles.toml").write_text("[[channel]]\n".join([head, *used]))
    if hidden.kind == "equations":
        file = "model.toml"
        outputs = "".join(_OUTPUT[n] for n in hidden.outputs)
        declared = {"stiffness": hidden.declared_stiffness, "gain": hidden.declared_gain}
        (folder / file).write_text(_EQUATIONS.format(outputs=outputs, **declared))
    else:
        file = "model.json"
        (folder / file).write_text(json.dumps(linear_model(hidden).to_json()))
    (folder / "case.toml").write_text(
        f'[case]\ntitle = "rig"\n[recordings]\nfiles = ["recording.csv"]\nroles = "roles.toml"\n'
        f'[baseline]\nkind = "{hidden.kind}"\nfile = "{file}"\n[context]\nmachine = "rig"\n'
    )
    return folder


def trials() -> list[Hidden]:
    """List what is hidden, once in an equations baseline and once in a state-space one where it applies."""
    both = ("equations", "state_space")
    lags = ("actuator_lag", "transport_delay")
    found = []
    for kind in both:
        found += [
            Hidden("lag, first order", kind, {"lag": 0.06}, lags[:1], ("tau_s", 0.06, 0.15)),
            Hidden("lag, second order", kind, {"drive_w": 25.0, "drive_zeta": 0.8}, ("actuator_second_order",),
                   ("omega_rad_s", 25.0, 0.15)),
            Hidden("delay", kind, {"delay": 0.05}, lags[1:], ("delay_s", 0.05, 0.15)),
            # a bristle model slides at its full force for nearly the whole of each stroke
            Hidden("dry friction", kind, {"bristle_N": 1.5}, ("coulomb_friction",),
                   ("force_N" if kind == "equations" else "acceleration", 1.5 if kind == "equations" else 0.75, 0.25)),
            # 2 k (√(1+q²) − 1) q/√(1+q²) = k q³ (1 − 3q²/4 …), strokes of 0.3 m
            Hidden("wire", kind, {"wire_N_per_m": 150.0}, ("cubic_stiffness",),
                   ("k3", 150.0 if kind == "equations" else 75.0, 0.25)),
            Hidden("rectifier", kind, {"rectified": 1.0}, ("sensor_rectified",), None, ("speed",)),
            Hidden("bracket", kind, {"bracket_hz": 8.0, "bracket_zeta": 0.03}, ("structural_mode",),
                   ("frequency_hz", 8.0, 0.05), ("position",)),
            Hidden("wrong gain", kind, {}, ("parameter_error",), None, declared_gain=3.2),
            Hidden("backlash", kind, {"backlash": 1.5}, ("backlash",), ("width", 3.0, 0.15)),
            Hidden("hysteresis", kind, {"hysteresis_N": 6.0}, ("bouc_wen_hysteresis", "play_hysteresis")),
            Hidden("swinging spring", kind, {"swing": 0.15}, outside=True),
        ]  # fmt: skip
        found += [
            Hidden(f"null, {force:g} N over {memory:g} s, sensor {sensor:g}", kind, noise=(force, memory, sensor))
            for force, memory, sensor in ((0.5, 0.5, 0.01), (2.0, 0.1, 0.01), (0.1, 3.0, 0.05), (0.02, 0.5, 0.002))
        ]
        found.append(Hidden("null, position only", kind, outputs=("position",)))
        found.append(Hidden("null, speed only", kind, outputs=("speed",), noise=(1.0, 1.0, 0.03)))
    found.append(Hidden("wrong free stiffness", "equations", {}, ("parameter_error",), declared_stiffness=60.0))
    return found


def nats_of_truth(study: Study, truth: Sequence[str]) -> float | None:
    """Return what the hidden effect gains on the sealed data when it is fitted whatever the bank says.

    Below 5 nats nobody could tell it from nothing on these data (MISMATCH section 6: undecidable). None where the truth
    is no effect that can be fitted.
    """
    from aeolid.diagnose.candidates.race import fit_rows
    from aeolid.diagnose.validation.proof import prove

    rows = [r for r in study.bank.rows if r.attachment.entry in truth]
    bare, prepared = study.prepared.only(()), study.prepared
    gains = [
        prove((bare.predictor, bare.fit), (c.predictor, c.fit), prepared.split.sealed, prepared.settle_s, 1).gain
        for c in fit_rows(prepared, rows)
    ]
    if study.declared_proof is not None and "parameter_error" in truth:
        gains.append(study.declared_proof.gain)
    return max(gains, default=None)


def answer(hidden: Hidden, study: Study) -> dict[str, Any]:
    """Draw the verdict, judge it, and where the effect was not found say whether it could have been."""
    from aeolid.diagnose.conclusion.verdict import diagnose

    found = diagnose(study)
    row = judge(hidden, found) | {"statement": found["statement"], "nats": None}
    if hidden.truth and "right" not in row["outcome"]:
        row["nats"] = nats_of_truth(study, hidden.truth)
    return row


def judge(hidden: Hidden, diagnosis: dict[str, Any]) -> dict[str, Any]:
    """Compare a diagnosis with the truth; outcome is right, missed, wrong (a name that is not so) or safe (no name)."""
    ids = [e["id"] for e in diagnosis["effects"]]
    verdict = diagnosis["verdict"]
    if hidden.truth:
        outcome = "right" if set(ids) & set(hidden.truth) else "wrong" if ids else "missed"
        if outcome == "right" and verdict == "multiple":
            outcome = "right, and one too many"
    else:
        outcome = "wrong" if ids else "safe"
    error = None
    if hidden.quantity is not None and ids:
        label, value, _ = hidden.quantity
        match = [e["parameters"][label]["value"] for e in diagnosis["effects"] if label in e["parameters"]]
        error = None if not match else match[0] / value - 1
    return {
        "trial": hidden.name, "baseline": hidden.kind, "verdict": verdict, "ids": ids, "outcome": outcome,
        "parameter_error": error, "recovered": diagnosis["sealed"]["recovered_fraction"],
        "kind": "hidden" if hidden.truth else "outside" if hidden.outside else "null",
    }  # fmt: skip


def diagnose_one(hidden: Hidden, folder: Path, samples: int, seed: int, sham: int) -> dict[str, Any]:
    """Write a case, diagnose it, judge the answer."""
    from aeolid.diagnose.data.case import load_case
    from aeolid.diagnose.pipeline import study

    begun = time.perf_counter()
    case = load_case(write_case(folder, hidden, samples, seed))
    result = study(case, sham=sham, seed=1, progress=lambda text, share: None)
    seconds = round(time.perf_counter() - begun, 1)
    return answer(hidden, result) | {"seed": seed, "seconds": seconds}


def table(rows: list[dict[str, Any]]) -> str:
    """Return the study as text: every trial, then the totals and the confusion of names."""
    heads = f"{'hidden':34} {'baseline':11} {'seed':>4} {'verdict':12} {'named':38} {'outcome':22} {'error':>7}     s"
    lines = [heads]
    for r in rows:
        error = "" if r["parameter_error"] is None else f"{r['parameter_error']:+.1%}"
        lines.append(
            f"{r['trial']:34} {r['baseline']:11} {r['seed']:4} {r['verdict']:12} {', '.join(r['ids']):38} "
            f"{r['outcome']:22} {error:>7} {r['seconds']:5.1f}"
        )
    for kind, good in (("hidden", ("right", "right, and one too many")), ("null", ("safe",)), ("outside", ("safe",))):
        chosen = [r for r in rows if r["kind"] == kind]
        if chosen:
            count = sum(r["outcome"] in good for r in chosen)
            what = {"hidden": "named or in the set", "null": "without a name", "outside": "without a forced name"}[kind]
            lines.append(f"{kind}: {count} of {len(chosen)} {what}")
    errors = [abs(r["parameter_error"]) for r in rows if r["parameter_error"] is not None and "right" in r["outcome"]]
    if errors:
        lines.append(f"parameter error where named right: median {np.median(errors):.1%}, largest {max(errors):.1%}")
    confusion = collections.Counter((r["trial"], i) for r in rows for i in (r["ids"] or [r["verdict"]])[:1])
    lines.append("first answer: " + "; ".join(f"{t} → {i} ×{n}" for (t, i), n in sorted(confusion.items())))
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the study; exit code 0."""
    from rich.progress import track

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3, help="recordings a trial")
    parser.add_argument("--first-seed", type=int, default=1, help="number of the first recording; 1 was seen in tuning")
    parser.add_argument("--samples", type=int, default=3000, help="length of each, at 50 Hz")
    parser.add_argument("--sham", type=int, default=0, help="null runs of the procedure in each diagnosis")
    parser.add_argument("--only", nargs="*", help="names (or parts of names) of trials")
    parser.add_argument("--json", help="write the rows to this file")
    options = parser.parse_args(arguments)
    chosen = [h for h in trials() if not options.only or any(o in f"{h.name} {h.kind}" for o in options.only)]
    jobs = [(h, seed) for h in chosen for seed in range(options.first_seed, options.first_seed + options.seeds)]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for number, (hidden, seed) in enumerate(track(jobs, "diagnosing", disable=not sys.stderr.isatty())):
            place = Path(folder) / str(number)
            rows.append(diagnose_one(hidden, place, options.samples, 100 * seed + number, options.sham))
            if options.json:
                Path(options.json).write_text(json.dumps(rows, indent=1) + "\n")
    print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
