"""Diagnose rigs whose model is a law without states, each with one effect or none, noise coloured in four ways.

    python tests/studies/static_laws.py [--only NAME …] [--seed 20] [--out FOLDER]

Dampers and springs recorded as displacement and force, a brake recorded as speed and torque, play between two angles, a
bearing between two positions, a shaft from torque to acceleration; motions and sizes are drawn, nothing is made by the
library's own forms. Where nothing is missing a declared value may be off, which is to be said. Prints a table, writes
static_laws.json; exit code 1 where a rig without an effect has a name.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

Array = NDArray[np.float64]
Channel = tuple[str, str, str]
ROWS = 4000
COLOURS: tuple[tuple[complex, ...], ...] = (
    (0.95,), (0.9, 0.7 + 0.5j, 0.7 - 0.5j), (0.98 * np.exp(0.4j), 0.98 * np.exp(-0.4j), 0.8), (0.97, 0.9, 0.5),
)  # poles of the noise  # fmt: skip


@dataclass(frozen=True, eq=False)
class Rig:
    """Hold a recording, its model (parameters as TOML, output's equation), and what is missing: ids, values."""

    step: float
    channels: tuple[Channel, ...]
    rows: Array
    parameters: str
    equation: str
    ids: tuple[str, ...]
    values: dict[str, float]


def noise(rng: np.random.Generator, size: float, colour: int) -> Array:
    """Return noise of a colour, `size` its standard deviation."""
    y = lfilter([1.0], np.poly(COLOURS[colour]).real, rng.standard_normal(ROWS))
    return np.asarray(size * y / y.std())


def motion(rng: np.random.Generator, step: float, low: float, high: float, size: float) -> tuple[Array, Array]:
    """Return a random motion between two frequencies, and its velocity."""
    hz = np.fft.rfftfreq(ROWS, step)
    X = (rng.standard_normal(len(hz)) + 1j * rng.standard_normal(len(hz))) * ((hz > low) & (hz < high))
    x, v = np.fft.irfft(X, ROWS), np.fft.irfft(2j * np.pi * hz * X, ROWS)
    return size * x / x.std(), size * v / x.std()


def damper(rng: np.random.Generator, size: float, colour: int, *, dry: float = 0.0, wet: float = 0.0) -> Rig:
    """Return a spring recorded as displacement and force, beside it dry or viscous friction."""
    x, v = motion(rng, 0.01, 0.1, 3.0, 0.02)
    seen = x + (2e-5 * rng.standard_normal(ROWS) if colour % 2 else 0.0)
    force = 800 * x + wet * v + dry * np.sign(v) + noise(rng, size, colour)
    missing = ("coulomb_friction",) if dry else ("viscous_friction_change",) if wet else ()
    values = {"force_N": dry} if dry else {"damping_change": wet} if wet else {}
    return Rig(
        0.01, (("stretch", "m", "input"), ("pull", "N", "output")), np.column_stack([seen, force]),
        "k = { value = 700, min = 0, max = 1e5, free = true }", "k*stretch", missing, values,
    )  # fmt: skip


def brake(rng: np.random.Generator, size: float, colour: int, *, dry: float = 0.0) -> Rig:
    """Return a reaction torque over a speed: no position is recorded."""
    _, v = motion(rng, 0.02, 0.05, 2.0, 12.0)
    torque = -0.04 * v - dry * np.sign(v) + noise(rng, size, colour)
    return Rig(
        0.02, (("shaft_speed", "deg/s", "input"), ("reaction", "N m", "output")), np.column_stack([v, torque]),
        "c = { value = -0.05, min = -10, max = 10, free = true }", "c*shaft_speed",
        ("coulomb_friction",) if dry else (), {"torque_N_m": dry} if dry else {},
    )  # fmt: skip


def stop(rng: np.random.Generator, size: float, colour: int, *, stiff: float = 0.0) -> Rig:
    """Return a spring around 20 mm that meets a stop at 23.5 mm."""
    x, v = motion(rng, 0.005, 0.1, 5.0, 3.0)
    force = 2 * x + stiff * np.maximum(x - 3.5, 0) + noise(rng, size, colour)
    channels = (("travel", "mm", "input"), ("rate", "mm/s", "input"), ("load", "N", "output"))
    return Rig(
        0.005, channels, np.column_stack([x + 20, v, force]),
        "k = { value = 1.5, min = 0.1, max = 100, free = true }\nrest = { value = 19, min = 0, max = 40, free = true }",
        "k*(travel - rest)", ("end_stop",) if stiff else (),
        {"stop_stiffness": stiff, "high_stop": 23.5} if stiff else {},
    )  # fmt: skip


def linkage(rng: np.random.Generator, size: float, colour: int, *, width: float = 0.0) -> Rig:
    """Return two recorded angles with play between them."""
    x, _ = motion(rng, 0.02, 0.05, 1.0, 4.0)
    held, moved = float(x[0]), np.empty(ROWS)
    for i, q in enumerate(x.tolist()):
        held = min(max(held, q - width / 2), q + width / 2)
        moved[i] = held
    return Rig(
        0.02, (("lever", "deg", "input"), ("flap", "deg", "output")),
        np.column_stack([x, 0.5 * moved + noise(rng, size, colour)]),
        "ratio = { value = 0.45, min = 0.1, max = 2, free = true }", "ratio*lever", ("backlash",) if width else (),
        {"width": width} if width else {},
    )  # fmt: skip


def bearing(rng: np.random.Generator, size: float, colour: int, *, force: float = 0.0) -> Rig:
    """Return a load over the difference of two positions, with a loop that yields over 4 mm."""
    (a, va), (b, vb) = motion(rng, 0.01, 0.1, 2.0, 10.0), motion(rng, 0.01, 0.1, 2.0, 6.0)
    z, loop = 0.0, np.empty(ROWS)
    for i, v in enumerate((va - vb).tolist()):
        loop[i] = z
        for _ in range(10):
            z += 0.001 * (v - 0.5 * abs(v) * z - 0.5 * v * abs(z)) / 4.0
    channels = (("upper_position", "mm", "input"), ("lower_position", "mm", "input"), ("load", "kN", "output"))
    return Rig(
        0.01, channels, np.column_stack([a, b, 0.8 * (a - b) + force * loop + noise(rng, size, colour)]),
        "k = { value = 1, min = -50, max = 50, free = true }", "k*(upper_position - lower_position)",
        ("bouc_wen_hysteresis",) if force else (), {"force_kN": force, "yield_length": 4.0} if force else {},
    )  # fmt: skip


def shaft(
    rng: np.random.Generator, size: float, colour: int, *, modes: Sequence[tuple[float, float, float]] = ()
) -> Rig:
    """Return a torque and the acceleration it makes, of an inertia and of modes (Hz, damping, share)."""
    u = 5 * lfilter([1.0], [1.0, -0.6], rng.standard_normal(ROWS))
    y = u + 8 * noise(rng, size, colour)
    for hz, damping, share in modes:
        w, x = 2 * np.pi * hz, np.zeros(3)
        E = expm(0.004 * np.array([[0, 1, 0], [-w * w, -2 * damping * w, 1], [0, 0, 0]]))
        for i, push in enumerate(u.tolist()):
            x[2] = push
            y[i] += share * (push - w * w * x[0] - 2 * damping * w * x[1])
            x = E @ x
    values = {f"frequency{'' if k == 0 else f'_{k + 1}'}_hz": m[0] for k, m in enumerate(modes)}
    return Rig(
        0.004, (("torque", "N m", "input"), ("acceleration", "rad/s^2", "output")), np.column_stack([u, y / 8]),
        "J = { value = 6, min = 0.1, max = 100, free = true }", "torque/J", ("structural_mode",) if modes else (),
        values,
    )  # fmt: skip


RIGS: dict[str, tuple[Callable[..., Rig], float, int, dict[str, Any]]] = {
    "dry_damper_strong": (damper, 3.0, 0, {"dry": 12.0}), "dry_damper_weak": (damper, 4.0, 1, {"dry": 5.0}),
    "viscous_strong": (damper, 3.0, 0, {"wet": 60.0}), "viscous_weak": (damper, 4.0, 1, {"wet": 30.0}),
    "spring_null_a": (damper, 3.0, 2, {}), "spring_null_b": (damper, 4.0, 3, {}),
    "brake_strong": (brake, 0.2, 0, {"dry": 0.5}), "brake_weak": (brake, 0.3, 1, {"dry": 0.25}),
    "brake_null_a": (brake, 0.2, 2, {}), "brake_null_b": (brake, 0.3, 3, {}),
    "stop_strong": (stop, 0.4, 0, {"stiff": 20.0}), "stop_weak": (stop, 0.8, 1, {"stiff": 4.0}),
    "stop_null_a": (stop, 0.4, 2, {}), "stop_null_b": (stop, 0.8, 3, {}),
    "play_strong": (linkage, 0.1, 0, {"width": 1.5}), "play_weak": (linkage, 0.2, 1, {"width": 0.6}),
    "play_null_a": (linkage, 0.1, 2, {}), "play_null_b": (linkage, 0.2, 3, {}),
    "loop_strong": (bearing, 1.0, 0, {"force": 6.0}), "loop_weak": (bearing, 1.5, 1, {"force": 2.0}),
    "loop_null_a": (bearing, 1.0, 2, {}), "loop_null_b": (bearing, 1.5, 3, {}),
    "modes_two": (shaft, 0.05, 0, {"modes": ((11.0, 0.02, 0.6), (27.0, 0.03, 0.25))}),
    "modes_uneven": (shaft, 0.2, 1, {"modes": ((6.3, 0.05, 0.3), (40.0, 0.01, 0.2))}),
    "modes_null_a": (shaft, 0.05, 2, {}), "modes_null_b": (shaft, 0.2, 3, {}),
}  # fmt: skip


def write(rig: Rig, folder: Path) -> None:
    """Write the rig as a case."""
    folder.mkdir(parents=True, exist_ok=True)
    inputs = "".join(f'[[input]]\nname = "{n}"\nunit = "{u}"\n' for n, u, role in rig.channels if role == "input")
    name, unit, _ = rig.channels[-1]
    law = f'[[output]]\nname = "{name}"\nunit = "{unit}"\nequation = "{rig.equation}"\n'
    (folder / "model.toml").write_text(f'[model]\nname = "a static law"\n[parameters]\n{rig.parameters}\n{inputs}{law}')
    (folder / "case.toml").write_text(
        '[recordings]\nfiles = ["recording.csv"]\nroles = "roles.toml"\n[baseline]\nkind = "equations"\n'
        'file = "model.toml"\n'
    )
    roles = "".join(f'[[channel]]\nname = "{n}"\nunit = "{u}"\nrole = "{r}"\n' for n, u, r in rig.channels)
    (folder / "roles.toml").write_text(f'[recording]\ntime = "time_s"\n{roles}')
    rows = np.column_stack([rig.step * np.arange(ROWS), rig.rows])
    heads = ",".join(["time_s", *(n for n, _, _ in rig.channels)])
    np.savetxt(folder / "recording.csv", rows, delimiter=",", fmt="%.9g", comments="", header=heads)


def judge(rig: Rig, said: dict[str, Any]) -> dict[str, Any]:
    """Hold a diagnosis against what is missing: the ids told, and by how much each value is off at most."""
    ids = [e["id"] for e in said["effects"] if e["id"] != "parameter_error"]
    right = next((e for e in said["effects"] if e["id"] in rig.ids), None)
    told = {} if right is None else {k: p["value"] for k, p in right["parameters"].items()}
    if "frequency_2_hz" in told:  # which mode is told first is no matter
        low, high = sorted((told["frequency_hz"], told["frequency_2_hz"]))
        told |= {"frequency_hz": low, "frequency_2_hz": high}
    off = [abs(told[k] / v - 1) if k in told else float("inf") for k, v in rig.values.items()] if right else []
    return {
        "verdict": said["verdict"], "ids": ids, "missing": list(rig.ids), "first": ids[:1] == list(rig.ids),
        "alone": ids == list(rig.ids), "off": max(off, default=None),
    }  # fmt: skip


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", default=list(RIGS), choices=list(RIGS), metavar="NAME")
    parser.add_argument("--seed", type=int, default=20, help="of motions and noise")
    parser.add_argument("--out", type=Path, default=Path("static_laws"))
    options = parser.parse_args()
    found = {}
    for number, (name, (make, size, colour, missing)) in enumerate(RIGS.items()):
        if name not in options.only:
            continue
        rig = make(np.random.default_rng((options.seed, number)), size, colour, **missing)
        case, out = options.out / name, options.out / f"{name}_told"
        write(rig, case)
        command = [sys.executable, "-m", "aeolid.cli.main", "diagnose", str(case), "--out", str(out), "--sham", "0"]
        subprocess.run([*command, "--no-report", "--force"], check=True, capture_output=True)
        row = found[name] = judge(rig, json.loads((out / "diagnosis.json").read_text()))
        off = "" if row["off"] is None else f"{row['off']:.1%} off"
        mark = "ok" if row["alone"] else "with others" if row["first"] else "WRONG"
        print(f"{name:18} {mark:12} {row['verdict']:12} {' '.join(row['ids'])} {off}", flush=True)
    (options.out / "static_laws.json").write_text(json.dumps(found, indent=1) + "\n")
    return int(any(row["ids"] and not row["missing"] for row in found.values()))


if __name__ == "__main__":
    sys.exit(main())
