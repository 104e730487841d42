"""Count how often 95 % intervals of modes and frequency responses hold the truth.

    python tests/studies/coverage.py [--runs 200] [--only fourth-open fourth-closed fourth-gusts turbine blade …]
                                     [--bootstrap-runs 100] [--out FOLDER]

Writes coverage.txt (the table), coverage.png (modes; responses over frequency) and coverage.json; results/ beside this
file holds 200 runs. Intervals of modes are ± 1.96 deviations; of frequency responses the 95 % ellipse in the complex
plane, and ± 1.96 deviations of gain (from zero where the phase is unknown) and of phase, at every frequency of the
model's own grid and every pair; of the phase where it is known, in brackets where besides the true gain exceeds two
deviations (a gain near zero looks large enough by chance now and then, and its phase is anywhere). z is (estimate −
truth)/deviation: its mean shows bias, its own deviation wrong scale.
200 runs leave 1.5 points on a coverage of 95 %.

Linear systems, each by varx and varmax with asymptotic and bootstrap deviations, order given: the fourth-order example
in open loop and under u = r − y/4 (N = 3000); the same loop in gusts, where reference and noise are 1.7 times as large
for 150 samples and 0.3 times for the next 150; the turbine in its closed loop with 1 % measurement noise (N = 4000).
Scheduled ones at the mean and both extremes of the scheduling: the flapping blade in closed loop (N = 1000), with the
penalty of cross-validation and without, and a second-order system in open loop (N = 500).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.identify.bands import on_circle
from aeolid.identify.lpv import identify_lpv
from aeolid.identify.result import Identification
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.modes import Mode, modes_of
from aeolid.models.state_space import StateSpace
from aeolid.plants.hawt import Excitation, build_turbine, simulate_closed_loop
from aeolid.plants.lpv import flapping_blade, record_of, run_in_loop, scheduled_system, simulate_blade_in_loop
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.record import Record

NORMAL, ELLIPSE = 1.959964, 5.991465  # 95 %: of a normal deviate; of the squared distance in two dimensions
UNCERTAINTIES = ("asymptotic", "bootstrap")
BOTH = ("pitch", "generator_torque")
BINS = 12  # frequencies of the table in the facts and of the drawing: parts of the logarithm


@dataclass(frozen=True)
class Linear:
    """Hold a time-invariant system under study and how it is identified."""

    true: Callable[[], StateSpace]
    simulate: Callable[[int], Record]
    methods: dict[str, Callable[..., Identification]]


@dataclass(frozen=True)
class Scheduled:
    """Hold a scheduled system under study and how it is identified."""

    true: Callable[[], LpvStateSpace]
    simulate: Callable[[int], Record]
    options: dict[str, dict[str, Any]]


def fourth(feedback: float, simulate: Callable[[int], Record] | None = None) -> Linear:
    """Return the fourth-order example."""
    return Linear(
        fourth_order,
        simulate or (lambda seed: simulate_fourth_order(3000, seed, feedback=feedback, noise_variance=0.49)),
        {
            "varx": lambda r, **more: identify_varx([r], past=15, future=10, order=4, **more),
            "varmax": lambda r, **more: identify_varmax([r], past=5, order=4, **more),
        },
    )


def simulate_gusts(seed: int, samples: int = 3000) -> Record:
    """Simulate the fourth-order loop where excitation and noise rise and fall together."""
    m, random = fourth_order(), np.random.default_rng(seed)
    assert m.K is not None
    size = np.where(np.arange(samples) // 150 % 2 == 0, 1.7, 0.3)[:, None]
    r, e = size * random.standard_normal((samples, 2)), 0.7 * size * random.standard_normal((samples, 2))
    values, x = np.empty((samples, 4)), np.zeros(4)
    for k in range(samples):
        y = m.C @ x + e[k]
        u = r[k] - 0.25 * y
        values[k] = *u, *y
        x = m.A @ x + m.B @ u + m.K @ e[k]
    return replace(simulate_fourth_order(samples, 0), values=values, source=f"gusts, seed {seed}")


def turbine() -> Linear:
    """Return the turbine in its closed loop."""
    return Linear(
        lambda: build_turbine().model(),
        lambda seed: simulate_closed_loop(4000, seed, excitation=Excitation(noise=0.01)),
        {
            "varx": lambda r, **more: identify_varx([r], past=20, order=7, feedthrough=BOTH, **more),
            "varmax": lambda r, **more: identify_varmax([r], past=10, order=7, feedthrough=BOTH, **more),
        },
    )


def second_order() -> LpvStateSpace:
    """Return a second-order system with one scheduling channel that moves its modes."""
    A = [np.array([[0.6, 0.5], [-0.5, 0.6]]), np.array([[0.1, 0.15], [0.0, -0.1]])]
    B = [np.array([[1.0, -0.4], [0.5, 0.8]]), np.array([[0.3, 0.0], [-0.2, 0.2]])]
    return scheduled_system(A, B, np.array([[1.0, 0.3], [-0.5, 1.0]]))


def simulate_second_order(seed: int, samples: int = 500) -> Record:
    """Simulate it in open loop, white inputs and scheduling, process and measurement noise."""
    random, model = np.random.default_rng(seed), second_order()
    scheduling = random.uniform(-1, 1, (samples, 1))
    u = random.standard_normal((samples, 2))
    w, v = 0.2 * random.standard_normal((samples, 2)), 0.3 * random.standard_normal((samples, 2))
    u, y = run_in_loop(model, scheduling, u, np.zeros((samples, 2, 2)), w, v)
    return record_of(model, u, scheduling, y, f"second order, seed {seed}")


SYSTEMS: dict[str, Linear | Scheduled] = {
    "fourth-open": fourth(0.0),
    "fourth-closed": fourth(0.25),
    "fourth-gusts": fourth(0.25, simulate_gusts),
    "turbine": turbine(),
    "blade": Scheduled(
        flapping_blade,
        lambda seed: simulate_blade_in_loop(1000, seed),
        {
            "lpv": {"past": 4, "order": 2, "varying": "A,K"},
            "lpv, no penalty": {"past": 4, "order": 2, "varying": "A,K", "regularization": "none"},
        },
    ),
    "second-order": Scheduled(second_order, simulate_second_order, {"lpv": {"past": 4, "order": 2}}),
}


def oscillating(model: StateSpace) -> list[Mode]:
    """Return the modes that oscillate: a real pole has no damping to speak of."""
    return [m for m in modes_of(model) if m.eigenvalue.imag > 1e-9]


def scores(true: Sequence[Mode], found: Sequence[Mode]) -> list[list[float]]:
    """Return z of frequency and damping of each true mode, infinite where the nearest found one has no deviation."""
    rows = []
    for mode in true:
        near = min(found, key=lambda m: abs(m.eigenvalue - mode.eigenvalue))
        pairs = (
            (near.frequency_hz - mode.frequency_hz, near.frequency_std_hz),
            (near.damping - mode.damping, near.damping_std),
        )
        rows.append([error / std if std else np.inf for error, std in pairs])
    return rows


def band_hits(result: Identification, true: StateSpace) -> dict[str, Any]:
    """Return for each frequency and pair whether ellipse, gain and phase hold the truth, NaN for an unknown phase."""
    band = result.band
    assert band is not None
    z = on_circle(band.frequency_hz, true.sample_time_s)
    states = np.linalg.solve(z[:, None, None] * np.eye(true.order) - true.A, true.B[None].astype(complex))
    G = true.C @ states + true.D
    error = G - band.response
    parts = np.stack([error.real, error.imag], axis=-1)
    distance = np.einsum("...i,...ij,...j", parts, np.linalg.pinv(band.covariance), parts)
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.angle(G / band.response)
    known = np.isfinite(band.phase_std)
    path = abs(G).max(axis=0) > 1e-6 * abs(G).max()  # a pair without any path has no phase to hold
    phase = np.where(known & path, abs(turn) < NORMAL * band.phase_std, np.nan)
    clear = abs(G) > 2 * np.sqrt(band.covariance.trace(axis1=-2, axis2=-1) / 2)  # what chance alone makes known is not
    off = abs(G) - abs(band.response)  # where the phase is unknown the gain may be zero
    gain = (off < NORMAL * band.gain_std) & (~known | (-off < NORMAL * band.gain_std))
    ellipse = distance < ELLIPSE
    hits = {"ellipse": ellipse * 1.0, "gain": gain * 1.0, "phase": phase, "clear": np.where(clear, phase, np.nan)}
    return {"frequency_hz": band.frequency_hz} | hits


def linear_runs(system: Linear, runs: int, bootstrap_runs: int) -> Iterator[dict[str, Any]]:
    """Yield run by run what every method with every uncertainty says of modes and responses."""
    true = system.true()
    modes = oscillating(true)
    for run in range(runs):
        record, found = system.simulate(1000 + run), {}
        for method, identify in system.methods.items():
            for uncertainty in UNCERTAINTIES:
                result = identify(record, uncertainty=uncertainty, bootstrap_runs=bootstrap_runs, bootstrap_seed=run)
                found[f"{method}, {uncertainty}"] = {"modes": scores(modes, result.modes)} | band_hits(result, true)
        yield found


def scheduled_runs(system: Scheduled, runs: int) -> Iterator[dict[str, Any]]:
    """Yield run by run what the frozen points say of their modes."""
    true = system.true()
    for run in range(runs):
        record, found = system.simulate(1000 + run), {}
        for method, options in system.options.items():
            rows = []
            for point in identify_lpv([record], **options).points:
                frozen = true.frozen(list(point.scheduling.values()))
                rows += scores(oscillating(frozen), point.modes)
            found[method] = {"modes": rows}
        yield found


def names_of(system: Linear | Scheduled) -> list[str]:
    """Name the rows of the modes."""
    if isinstance(system, Linear):
        return [f"{m.frequency_hz:.3f} Hz, {m.damping:.2%}" for m in oscillating(system.true())]
    return ["mean", "least", "largest"]


def summarise(system: str, name: str, outcomes: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the coverages of one way of identifying."""
    z = np.array([o[name]["modes"] for o in outcomes])  # (runs, modes, 2)
    finite = np.where(np.isfinite(z), z, np.nan)
    row: dict[str, Any] = {
        "system": system, "method": name, "runs": len(z), "modes": names_of(SYSTEMS[system]),
        "coverage": (abs(z) < NORMAL).mean(axis=0).tolist(), "z_mean": np.nanmean(finite, axis=0).tolist(),
        "z_std": np.nanstd(finite, axis=0).tolist(), "without": int((~np.isfinite(z)).any(axis=(1, 2)).sum()),
    }  # fmt: skip
    if "ellipse" in outcomes[0][name]:
        row["band"] = {k: _mean([o[name][k] for o in outcomes]) for k in ("ellipse", "gain", "phase", "clear")}
        row["band"]["ellipse_by_pair"] = np.mean([o[name]["ellipse"].mean(axis=0) for o in outcomes], axis=0).tolist()
        row["band"]["over_frequency"] = _over_frequency([o[name] for o in outcomes])
    return row


def _mean(parts: list[Any]) -> float:
    return float(np.nanmean(np.concatenate([p.ravel() for p in parts])))


def _over_frequency(found: list[dict[str, Any]]) -> dict[str, list[float]]:
    """Return the coverage of the ellipse in parts of the logarithm of the frequency."""
    low, high = (
        np.log([f["frequency_hz"][0] for f in found]).min(),
        np.log([f["frequency_hz"][-1] for f in found]).max(),
    )
    edges = np.linspace(low, high, BINS + 1)
    place = np.concatenate([np.clip(np.digitize(np.log(f["frequency_hz"]), edges) - 1, 0, BINS - 1) for f in found])
    hits = np.concatenate([f["ellipse"].mean(axis=(1, 2)) for f in found])
    values = [float(hits[place == b].mean()) for b in range(BINS)]
    return {"frequency_hz": np.exp((edges[1:] + edges[:-1]) / 2).tolist(), "ellipse": values}


def text_of(facts: dict[str, Any]) -> str:
    """Return the study as text."""
    lines = [
        f"coverage of 95 % intervals in percent, {facts['runs']} runs, {facts['bootstrap_runs']} bootstrap runs",
        "of each mode frequency and damping, (mean, deviation) of z; responses over all frequencies and pairs, phase "
        "also",
        "where the true gain is above two deviations: elsewhere it is known by chance, and then seldom right",
    ]
    for row in facts["rows"]:
        lines.append(f"\n{row['system']:<14} {row['method']}")
        for i, mode in enumerate(row["modes"]):
            cells = [
                f"{100 * row['coverage'][i][j]:5.1f} ({row['z_mean'][i][j]:+.2f}, {row['z_std'][i][j]:.2f})"
                for j in range(2)
            ]
            lines.append(f"    {mode:<16} frequency {cells[0]}   damping {cells[1]}")
        if "band" in row:
            b = row["band"]
            pairs = "; ".join(" ".join(f"{100 * v:.1f}" for v in line) for line in b["ellipse_by_pair"])
            lines.append(
                f"    response         ellipse {100 * b['ellipse']:.1f}   gain {100 * b['gain']:.1f}   "
                f"phase {100 * b['phase']:.1f} ({100 * b['clear']:.1f})   ellipse by output; input: {pairs}"
            )
        if row["without"]:
            lines.append(f"    {row['without']} runs with a mode that was not found oscillating (counted as missed)")
    return "\n".join(lines)


def draw(path: Path, facts: dict[str, Any]) -> None:
    """Draw coverages of modes, and of the bands over frequency."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(13, 5.5))
    for i, row in enumerate(facts["rows"]):
        values = 100 * np.array(row["coverage"])
        for j, style in enumerate(("o", "s")):
            axes[0].plot(np.full(len(values), i - 0.12 + 0.24 * j), values[:, j], style, color=("C0", "C1")[j],
                         label=("frequency", "damping")[j] if i == 0 else None)  # fmt: skip
        if "band" in row:
            over = row["band"]["over_frequency"]
            frequency = np.array(over["frequency_hz"])
            style = {
                "color": f"C{list(SYSTEMS).index(row['system'])}",
                "linestyle": "--" if "bootstrap" in row["method"] else "-",
                "linewidth": 2.2 if "varmax" in row["method"] else 1,
                "label": f"{row['system']}, {row['method']}",
            }
            axes[1].semilogx(frequency / frequency[-1], 100 * np.array(over["ellipse"]), **style)
    axes[0].set_xticks(range(len(facts["rows"])), [f"{r['system']}\n{r['method']}" for r in facts["rows"]], rotation=90)
    axes[1].set(xlabel="frequency over the highest", title="95 % ellipses of the frequency response", ylim=(50, 100))
    axes[0].set(title="95 % intervals of the modes", ylabel="coverage (%)", ylim=(80, 100))
    for axis in axes:
        axis.axhspan(92, 98, color="0.9")
        axis.axhline(95, color="0.5", linewidth=1)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(fontsize=7, loc="lower right", ncols=2)
    figure.tight_layout()
    figure.savefig(path, dpi=75)
    plt.close(figure)


def study(runs: int, only: Sequence[str], bootstrap_runs: int) -> dict[str, Any]:
    """Run the systems asked for with a progress bar on standard error; returns the facts."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    rows = []
    for name in only:
        system = SYSTEMS[name]
        steps = (
            linear_runs(system, runs, bootstrap_runs) if isinstance(system, Linear) else scheduled_runs(system, runs)
        )
        outcomes = list(track(steps, name, total=runs, console=console))
        rows += [summarise(name, key, outcomes) for key in outcomes[0]]
    return {"runs": runs, "bootstrap_runs": bootstrap_runs, "rows": rows}


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description="Count how often 95 % intervals hold the truth.")
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--bootstrap-runs", type=int, default=100)
    parser.add_argument("--only", nargs="+", choices=list(SYSTEMS), default=list(SYSTEMS))
    parser.add_argument("--out", type=Path, default=Path("build/studies"), help="folder of the three files")
    options = parser.parse_args(arguments)
    facts = study(options.runs, options.only, options.bootstrap_runs)
    options.out.mkdir(parents=True, exist_ok=True)
    text = text_of(facts)
    print(text)
    (options.out / "coverage.txt").write_text(text + "\n", encoding="utf-8")
    (options.out / "coverage.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    draw(options.out / "coverage.png", facts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
