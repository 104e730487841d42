"""Faults of recordings that once gave tight and wrong answers without a word: the option that leaves them in, and none.

    python tests/studies/identify_faults.py [--out FOLDER]

Each fault is put into a recording of a plant that is known: modes at 0.3 and 1.1 Hz, damping 2 %, process and output
noise. `aeolid identify` is asked with the options that switch its safeguard off (where there is one) and with defaults.
Told are the worst error of both modes' frequency and damping in per cent, in deviations told, and whether the answer
says that they do not hold. Writes identify_faults.md.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

Array = NDArray[np.float64]
HZ, ZETA = (0.3, 1.1), 0.02


@dataclass(frozen=True)
class Fault:
    """Hold a fault: its name, the samples [u, y] (N, 2), the sample time, and the options that leave it in."""

    name: str
    values: Array
    step: float
    plain: tuple[str, ...]
    both: tuple[str, ...] = ()


def simulate(samples: int, step: float, seed: int, *, direct: float = 0.0) -> Array:
    """Return [u, y] (N, 2) in open loop; direct: what u adds to y at once."""
    random = np.random.default_rng(seed)
    poles = [np.exp(step * 2 * np.pi * f * complex(-ZETA, np.sqrt(1 - ZETA**2))) for f in HZ]
    A = block_diag(*[[[z.real, z.imag], [-z.imag, z.real]] for z in poles])
    B, C, x = np.array([0.5, 1.0, 1.0, -0.5]), np.array([1.0, 0.3, -0.4, 1.0]), np.zeros(4)
    size = np.sqrt(step * 10)  # so that deviations do not hang on the sample time
    out = np.empty((samples, 2))
    for k in range(samples):
        u, v, w = random.standard_normal(3)
        out[k] = u, C @ x + direct * u + 0.5 * v
        x = A @ x + size * (B * u + 0.1 * w)
    return out


def faults() -> list[Fault]:
    """Return the faults."""
    clean = simulate(3000, 0.1, 1)
    random = np.random.default_rng(7)
    holes = np.where(random.random(clean.shape) < 0.2, np.nan, clean)
    spikes, at = clean.copy(), random.choice(np.arange(50, 2950), 12, replace=False)
    spikes[at, 1] += 30 * clean[:, 1].std() * random.choice([-1.0, 1.0], 12)
    drift = clean + np.linspace(0, 4, len(clean))[:, None] * [0.0, 1.0] * clean.std(axis=0)
    slow = simulate(12000, 0.005, 1)
    late = clean.copy()
    late[15:, 1] = clean[:-15, 1]
    return [
        Fault("none", clean, 0.1, ()),
        Fault("1: u acts at once, y gains 5 u", simulate(3000, 0.1, 2, direct=5.0), 0.1, ("--feedthrough", "none")),
        Fault("2: dt 0.005 s, 12,000 samples", slow, 0.005, ("--past", "20")),
        Fault("6: 20 % of single cells missing", holes, 0.1, ("--missing", "leave-out")),
        Fault("7: 12 spikes of 30 deviations", spikes, 0.1, ("--robust", "never")),
        Fault("7: drift of 4 deviations", drift, 0.1, ("--detrend", "none")),
        Fault("7: the same, --detrend linear", drift, 0.1, (), ("--detrend", "linear")),
        Fault("8: dead time of 15 samples", late[15:], 0.1, ("--delay", "none")),
    ]


def ask(fault: Fault, options: Sequence[str]) -> tuple[int, dict[str, Any] | None]:
    """Return exit code and facts of `aeolid identify` with these options, None where nothing was written."""
    from aeolid.cli.main import main as aeolid

    with tempfile.TemporaryDirectory() as name:
        folder, said = Path(name), io.StringIO()
        lines = ["[recording]", f"sample_time_s = {fault.step!r}"]
        for channel, role in (("u", "input"), ("y", "output")):
            lines += ["[[channel]]", f'name = "{channel}"', 'unit = ""', f'role = "{role}"']
        (folder / "roles.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
        np.savez(folder / "recording.npz", u=fault.values[:, 0], y=fault.values[:, 1])
        files = ["--roles", str(folder / "roles.toml"), "--out", str(folder / "model.json")]
        facts = folder / "facts.json"
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            code = aeolid(
                ["identify", str(folder / "recording.npz"), *files, "--json", str(facts), *fault.both, *options]
            )
        return code, json.loads(facts.read_text(encoding="utf-8")) if facts.exists() else None


def row(fault: Fault, options: Sequence[str]) -> list[str]:
    """Return options, order, worst errors and whether a word was said."""
    code, facts = ask(fault, options)
    asked = " ".join((*fault.both, *options)) or "defaults"
    if facts is None:
        return [f"`{asked}`", "", "", "", f"refused, exit {code}"]
    errors, deviations = [0.0], [0.0]
    for hz in HZ:
        near = min(facts["modes"], key=lambda m: abs(np.log(m["frequency_hz"] / hz)))
        for key, true in (("frequency", hz), ("damping", ZETA)):
            told = near["frequency_hz" if key == "frequency" else "damping"]
            spread = near["frequency_std_hz" if key == "frequency" else "damping_std"]
            errors.append(100 * abs(told / true - 1))
            deviations.append(abs(told - true) / spread if spread else np.inf)
    word = "" if facts.get("bands_hold") is not False else "bands do not hold"
    return [f"`{asked}`", str(facts["order"]), f"{max(errors):.3g} %", f"{max(deviations):.2g}", word]


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description="Faults of recordings, with their safeguard switched off and on.")
    parser.add_argument("--out", type=Path, default=Path("build/studies"))
    asked = parser.parse_args(arguments)
    lines = ["| fault | options | order (true: 4) | worst error | deviations | said |", "|---|---|---|---|---|---|"]
    for fault in faults():
        for options in dict.fromkeys((fault.plain, ())):
            lines.append(f"| {fault.name} | " + " | ".join(row(fault, options)) + " |")
            print(lines[-1], flush=True)
    asked.out.mkdir(parents=True, exist_ok=True)
    (asked.out / "identify_faults.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
