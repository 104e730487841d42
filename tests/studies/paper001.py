"""Repeat the simulation studies of paper 001 section 7: Tables 1 and 2, Figures 1, 2 and 3.

    python tests/studies/paper001.py [--runs 100] [--only table1 table2 blade bilinear] [--out FOLDER]

Writes paper001.txt (the tables), paper001.png (the figures) and paper001.json; results/ beside this file holds 100
runs. Every VAF is that of a free run on fresh noise-free data, as the paper takes it, and cut at zero.

Readings of what the paper leaves open. Table 2: white inputs, no innovation noise in the states, ρ uniform in 0 … 0.65
(from 0.53 on A1 + ρ A2 is unstable, yet the sequence decays; with ρ to 1 the truncated predictor explains nothing) and
"SNR = 40" as the ratio of variances, 16 dB: with these VAF(y, y⁽ᵖ⁾) comes out as printed, 54/34.5/15.7 at p = 3 and
70.8/67.5/56.8 at p = 5. With 40 dB every entry would be above 95. Figs. 1 and 2: both states measured, white excitation
of variance one added to the periodic regulator's input (weights one), process noise of variance 0.1. Fig. 3: B does
not depend on the scheduling, output noise at 15 dB.

Where ours differ from the printed ones. Table 2 with noise: the scheduling is taken about its mean and scaled, so that
penalty and smallest solution spare products of many factors. At p = 5, N = 1000 and without regularisation six runs
gave 88, 86, 83 % with it and 68, 64, 57 % with the scheduling as recorded (printed 17, 19, 21; the authors' toolbox 45,
42, 38 on data like these); with Tikhonov 99.8 and 99.7 (printed 95): the rest there is the cross-validation, which
scores the filter that is applied. Exact data at p = 5: 99.98 for 100.0, the smallest solution is not unique there.
Fig. 1: the best number of rows is 60 here and 100 there.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.identify.lpv import LpvIdentification, identify_lpv
from aeolid.identify.lpv.structure import Structure
from aeolid.models.lpv import LpvStateSpace, apply_at, run_scheduled, with_one
from aeolid.models.prediction import vaf
from aeolid.plants.lpv import (
    benchmark,
    benchmark_signals,
    bilinear_input,
    bilinear_system,
    blade_scheduling,
    flapping_blade,
    simulate_blade_in_loop,
    simulate_open,
)
from aeolid.record import Record

PRINTED_1 = {2: [40, 80, 120, 160, 200], 3: [168, 336, 504, 672, 840], 4: [680, 1360, 2040, 2720, 3400],
             5: [2728, 5456, 8184, 10912, 13640]}  # fmt: skip
# (p, N, noise): without and with regularisation, three outputs each
PRINTED_2 = {
    (3, 500, True): ([93.2, 93.5, 93.8], [96.8, 96.7, 96.8]),
    (3, 500, False): ([100.0, 100.0, 100.0], [99.9, 100.0, 100.0]),
    (3, 1000, True): ([98.0, 98.0, 98.0], [98.4, 98.4, 98.5]),
    (3, 1000, False): ([100.0, 100.0, 100.0], [99.9, 99.9, 99.9]),
    (5, 500, True): ([66.5, 67.2, 67.6], [90.5, 90.6, 90.8]),
    (5, 500, False): ([99.4, 99.4, 99.4], [99.2, 99.3, 99.3]),
    (5, 1000, True): ([17.2, 19.1, 21.0], [94.8, 95.0, 95.1]),
    (5, 1000, False): ([100.0, 100.0, 100.0], [100.0, 100.0, 100.0]),
}
PRINTED_TRUNCATED = {3: [54.0, 34.5, 15.7], 5: [70.8, 67.5, 56.8]}
RATIO = 40.0
REGULARIZATION = {"plain": "none", "Tikhonov": "gcv"}
ROWS = {"first": (20, 40, 60, 80, 100, 150, 200, 300, None), "greedy": (20, 60, 100, 150, 200)}  # None: all
BLADE_SAMPLES, BLADE_PAST, SHOWN_ROWS = 2000, 10, 100
BILINEAR_SAMPLES, BILINEAR_PAST = 500, tuple(range(2, 10))
PARTS = ("table1", "table2", "blade", "bilinear")
Track = Callable[[Iterator[Any], str, int], Iterator[Any]]


def free_run(result: LpvIdentification, fresh: Record, y: Any) -> Any:
    """Return the VAF (l,) of the identified model on fresh data, started at rest, cut at zero."""
    model = result.model
    u, s = (fresh.columns([c.name for c in group]) for group in (model.inputs, model.scheduling))
    with np.errstate(all="ignore"):
        found = vaf(y, model.simulate(u, s, np.zeros(model.order)))
    return np.maximum(np.nan_to_num(found, nan=0.0, neginf=0.0), 0.0)


def truncated(model: LpvStateSpace, u: Any, scheduling: Any, past: int) -> Any:
    """Return y⁽ᵖ⁾ of eq. (9) for a model without noise: the answer to the last p inputs alone, (N − p, l)."""
    mu = with_one(scheduling)
    forced = apply_at(model.B, mu, u)
    states = [run_scheduled(model.A, mu[k - past : k], forced[k - past : k], np.zeros(model.order))[-1]
              for k in range(past, len(u))]  # fmt: skip
    return np.array(states) @ model.C[0].T


def table_1() -> dict[str, list[int]]:
    """Count the rows of Z for m = 4 and r = l = 1 … 5."""
    structures = [Structure(frozenset("ABK"), 4, c, c, (False,) * c, False) for c in range(1, 6)]
    return {str(p): [s.regressors(p) for s in structures] for p in PRINTED_1}


def benchmark_runs(runs: int) -> Iterator[dict[tuple[Any, ...], Any]]:
    """Yield the VAF of each setting of Table 2, and those of the truncated predictor, run by run."""
    model = benchmark()
    for run in range(runs):
        found: dict[tuple[Any, ...], Any] = {}
        random = np.random.default_rng([1, run])
        fresh, y = simulate_open(model, *benchmark_signals(1000, random), random)
        u, s = fresh.matrix("input"), fresh.matrix("scheduling")
        for past in PRINTED_TRUNCATED:
            found["truncated", past] = vaf(y[past:], truncated(model, u, s, past))
        for samples in (500, 1000):
            signals = benchmark_signals(samples, random)
            for noise in (True, False):
                record, _ = simulate_open(model, *signals, random, RATIO if noise else np.inf)
                for past in PRINTED_TRUNCATED:
                    for name, rule in REGULARIZATION.items():
                        result = identify_lpv(
                            [record],
                            past=past,
                            method="lpv-kernel",
                            order=4,
                            regularization=rule,
                            offsets=False,
                            refined=False,
                        )
                        found[past, samples, noise, name] = free_run(result, fresh, y)
        yield found


def blade_runs(runs: int) -> Iterator[dict[str, Any]]:
    """Yield what each number of rows makes of the blade in closed loop: VAF and the eigenvalues of both matrices."""
    model = flapping_blade()
    for run in range(runs):
        record = simulate_blade_in_loop(BLADE_SAMPLES, 1000 + run)
        random = np.random.default_rng([2, run])
        fresh, y = simulate_open(model, random.standard_normal((1000, 1)), blade_scheduling(1000), random)
        found: dict[str, Any] = {}
        for name, rule in REGULARIZATION.items():
            for selection, rows in ((s, count) for s, counts in ROWS.items() for count in counts):
                begun = time.process_time()
                result = identify_lpv(
                    [record], past=BLADE_PAST, method="lpv-kernel", order=2, varying="A,K", regularization=rule,
                    kernel_rows=rows, kernel_selection=selection, offsets=False, refined=False,
                )  # fmt: skip
                poles = [np.sort_complex(np.linalg.eigvals(a)) for a in result.model.A]
                found[f"{name} {selection} {rows or 'all'}"] = {
                    "vaf": free_run(result, fresh, y),
                    "poles": np.concatenate(poles),
                    "rank": result.estimate.rank,
                    "cpu_s": time.process_time() - begun,
                }
        yield found


def bilinear_runs(runs: int) -> Iterator[dict[tuple[Any, ...], float]]:
    """Yield the VAF of the truncated predictor and of the models of each past window, without noise and at 15 dB."""
    model = bilinear_system()
    for run in range(runs):
        random = np.random.default_rng([3, run])
        u, v = (bilinear_input(BILINEAR_SAMPLES, random) for _ in range(2))
        fresh, y = simulate_open(model, v, v, random)
        found: dict[tuple[Any, ...], float] = {}
        for past in (1, *BILINEAR_PAST):
            found["truncated", past] = float(vaf(y[past:], truncated(model, v, v, past))[0])
        for noise, ratio in ((False, np.inf), (True, 10**1.5)):
            record, _ = simulate_open(model, u, u, random, ratio)
            for past in BILINEAR_PAST:
                for name, rule in REGULARIZATION.items():
                    result = identify_lpv(
                        [record], past=past, method="lpv-kernel", order=2, scheduling=("u1",), varying="A,K",
                        regularization=rule, offsets=False, refined=False,
                    )  # fmt: skip
                    found[past, noise, name] = float(free_run(result, fresh, y)[0])
        yield found


def mean_of(outcomes: list[Any], key: Any) -> list[float]:
    """Return the mean over runs of one entry, as a list."""
    return np.mean([np.atleast_1d(o[key]) for o in outcomes], axis=0).tolist()


def summarise_benchmark(outcomes: list[Any]) -> list[dict[str, Any]]:
    """Return a row for each setting of Table 2: our mean and standard deviation beside the printed mean."""
    rows = []
    for (past, samples, noise), printed in PRINTED_2.items():
        for name, theirs in zip(REGULARIZATION, printed, strict=True):
            values = np.array([o[past, samples, noise, name] for o in outcomes])
            rows.append(
                {"past": past, "samples": samples, "noise": noise, "regularization": name, "printed": theirs,
                 "mean": values.mean(0).tolist(), "std": values.std(0).tolist(), "least": values.min(0).tolist()}
            )  # fmt: skip
    return rows


def summarise_blade(outcomes: list[Any]) -> list[dict[str, Any]]:
    """Return a row for each number of rows, selection and regularisation."""
    true = np.concatenate([np.sort_complex(np.linalg.eigvals(a)) for a in flapping_blade().A])
    rows = []
    for key in outcomes[0]:
        name, selection, count = key.split()
        values = np.array([o[key]["vaf"] for o in outcomes]).min(axis=1)  # the worse of the two outputs
        poles = np.array([o[key]["poles"] for o in outcomes])
        rows.append(
            {"regularization": name, "selection": selection, "rows": count, "vaf": float(values.mean()),
             "vaf_least": float(values.min()), "pole_error": abs(poles - true).mean(0).tolist(),
             "pole_bias": abs(poles.mean(0) - true).tolist(),
             "rank": float(np.mean([o[key]["rank"] for o in outcomes])),
             "cpu_s": float(np.median([o[key]["cpu_s"] for o in outcomes]))}
        )  # fmt: skip
    return rows


def summarise_bilinear(outcomes: list[Any]) -> list[dict[str, Any]]:
    """Return a row for each past window: truncated predictor, and mean and least VAF of each setting."""
    rows = []
    for past in (1, *BILINEAR_PAST):
        row: dict[str, Any] = {"past": past, "truncated": mean_of(outcomes, ("truncated", past))[0]}
        for noise in (False, True):
            for name in REGULARIZATION:
                if past in BILINEAR_PAST:
                    values = np.array([o[past, noise, name] for o in outcomes])
                    row[f"{'15 dB' if noise else 'exact'} {name}"] = [float(values.mean()), float(values.min())]
        rows.append(row)
    return rows


def text_of(facts: dict[str, Any]) -> str:
    """Return the study as text."""
    lines = [f"paper 001: {facts['runs']} runs"]
    if "table1" in facts:
        lines += ["", "Table 1: rows of Z for m = 4, r = l = 1 … 5 (printed in brackets)"]
        for p, found in facts["table1"].items():
            lines.append(f"p = {p}:  " + "  ".join(f"{a} ({b})" for a, b in zip(found, PRINTED_1[int(p)], strict=True)))
    if "table2" in facts:
        lines += ["", "Table 2: mean VAF of the three outputs on fresh data ± deviation of a run, printed in brackets"]
        for row in facts["table2"]:
            head = f"p = {row['past']} N = {row['samples']:<5}{'SNR 40' if row['noise'] else 'exact':<7}"
            lines.append(f"{head}{row['regularization']:<9} " + _beside(row["mean"], row["printed"], row["std"]))
        for past, found in facts["truncated"].items():
            lines.append(f"VAF(y, y(p)), p = {past}: " + _beside(found, PRINTED_TRUNCATED[int(past)], None))
    if "blade" in facts:
        lines += ["", "Figs. 1 and 2: flapping blade in closed loop, N = 2000, p = 10, VAF of the worse output",
                  f"{'':<9} {'rows':<12} {'rank':>5} {'VAF':>7} {'least':>7}  "
                  "error of eig A1, eig A2 (bias)              CPU s"]  # fmt: skip
        for row in facts["blade"]:
            error, bias = row["pole_error"], row["pole_bias"]
            poles = f"{error[0]:.4f} ({bias[0]:.4f})  {error[2]:.4f} {error[3]:.4f} ({bias[2]:.4f} {bias[3]:.4f})"
            lines.append(
                f"{row['regularization']:<9} {row['selection'] + ' ' + row['rows']:<12} {row['rank']:5.0f} "
                f"{row['vaf']:7.3f} {row['vaf_least']:7.2f}  {poles}  {row['cpu_s']:.2f}"
            )
    if "bilinear" in facts:
        lines += ["", "Fig. 3: bilinear system, N = 500, mean VAF [least] on fresh data"]
        for row in facts["bilinear"]:
            cells = [f"{k}: {v[0]:6.2f} [{v[1]:5.1f}]" for k, v in row.items() if isinstance(v, list)]
            lines.append(f"p = {row['past']}  VAF(y, y(p)) {row['truncated']:5.1f}   " + "   ".join(cells))
    return "\n".join(lines)


def _beside(found: list[float], printed: list[float], spread: list[float] | None) -> str:
    parts = []
    for i, (ours, theirs) in enumerate(zip(found, printed, strict=True)):
        deviation = "" if spread is None else f" ± {spread[i]:4.1f}"
        parts.append(f"{ours:6.2f}{deviation} ({theirs:.1f})")
    return "  ".join(parts)


def draw(path: Path, facts: dict[str, Any], outcomes: dict[str, list[Any]]) -> None:
    """Draw Figs. 1, 2 and 3 of the paper."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 3, figsize=(16, 9))
    if "blade" in outcomes:
        _draw_blade(axes[0], facts["blade"], outcomes["blade"])
    if "bilinear" in outcomes:
        _draw_bilinear(axes[1], outcomes["bilinear"])
    figure.tight_layout()
    figure.savefig(path, dpi=75)
    plt.close(figure)


def _draw_blade(axes: Any, rows: list[dict[str, Any]], outcomes: list[Any]) -> None:
    for name, style in (("Tikhonov", "-"), ("plain", "--")):
        for selection, colour in (("first", "k"), ("greedy", "tab:blue")):
            mine = [
                r for r in rows if r["regularization"] == name and r["selection"] == selection and r["rows"] != "all"
            ]
            axes[0].plot([int(r["rows"]) for r in mine], [r["vaf"] for r in mine], style, color=colour,
                         label=f"{selection} rows, {name}")  # fmt: skip
    axes[0].set(xlabel="rows of the kernel, M", ylabel="VAF (%)", title="Fig. 1: VAF against the number of rows")
    axes[0].legend()
    for axis, part, matrix in ((axes[1], slice(0, 2), 0), (axes[2], slice(2, 4), 1)):
        poles = np.array([o[f"plain first {SHOWN_ROWS}"]["poles"][part] for o in outcomes]).ravel()
        true = np.linalg.eigvals(flapping_blade().A[matrix])
        axis.plot(poles.real, poles.imag, ".", color="0.4")
        axis.plot(true.real, true.imag, "k+", markersize=16, markeredgewidth=2)
        axis.set(xlabel="real", ylabel="imaginary", title=f"Fig. 2: eigenvalues of A{matrix + 1}, M = {SHOWN_ROWS}")


def _draw_bilinear(axes: Any, outcomes: list[Any]) -> None:
    pasts = (1, *BILINEAR_PAST)
    _band(axes[0], pasts, np.array([[o["truncated", p] for p in pasts] for o in outcomes]), "k", "")
    axes[0].set(title="Fig. 3, top: VAF(y, y⁽ᵖ⁾)")
    for axis, noise in ((axes[1], False), (axes[2], True)):
        for name, colour in (("plain", "k"), ("Tikhonov", "tab:blue")):
            values = np.array([[o[p, noise, name] for p in BILINEAR_PAST] for o in outcomes])
            _band(axis, BILINEAR_PAST, values, colour, name)
        axis.set(title=f"Fig. 3, {'bottom: 15 dB' if noise else 'middle: no noise'}")
        axis.legend()
    for axis in axes:
        axis.set(xlabel="past window p", ylabel="VAF (%)", ylim=(-2, 102))


def _band(axis: Any, x: Any, values: Any, colour: str, label: str) -> None:
    axis.fill_between(x, values.min(0), values.max(0), color=colour, alpha=0.2, linewidth=0)
    axis.plot(x, values.mean(0), color=colour, label=label)


def study(runs: int, only: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, list[Any]]]:
    """Run the parts asked for with a progress bar on standard error; returns the facts and every outcome."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    facts: dict[str, Any] = {"runs": runs}
    outcomes: dict[str, list[Any]] = {}
    for part, steps in (("table2", benchmark_runs), ("blade", blade_runs), ("bilinear", bilinear_runs)):
        if part in only:
            outcomes[part] = list(track(steps(runs), part, total=runs, console=console))
    if "table1" in only:
        facts["table1"] = table_1()
    if "table2" in only:
        facts["table2"] = summarise_benchmark(outcomes["table2"])
        facts["truncated"] = {str(p): mean_of(outcomes["table2"], ("truncated", p)) for p in PRINTED_TRUNCATED}
    if "blade" in only:
        facts["blade"] = summarise_blade(outcomes["blade"])
    if "bilinear" in only:
        facts["bilinear"] = summarise_bilinear(outcomes["bilinear"])
    return facts, outcomes


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description="Repeat the simulation studies of paper 001.")
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--out", type=Path, default=Path("build/studies"), help="folder of the three files")
    options = parser.parse_args(arguments)
    facts, outcomes = study(options.runs, tuple(options.only))
    options.out.mkdir(parents=True, exist_ok=True)
    text = text_of(facts)
    print(text)
    (options.out / "paper001.txt").write_text(text + "\n", encoding="utf-8")
    (options.out / "paper001.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    draw(options.out / "paper001.png", facts, outcomes)
    return 0


if __name__ == "__main__":
    sys.exit(main())
