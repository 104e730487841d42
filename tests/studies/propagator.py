"""Follow moving poles sample by sample: the propagator fed by each filter, against a refit by SVD.

    python tests/studies/propagator.py [--runs 100] [--snr 25] [--out FOLDER]

Writes propagator.txt (the table), propagator.png (mean track and one standard deviation) and propagator.json. The plant
is the third-order one of the recursive companion of paper 000, in closed loop, λ = 0.98, p = 5, SNR 25 dB: its poles
drift from sample 665 on, or one of them jumps there. Its controller is not printed; u = r − 0.25 y here. Every 10th
sample a snapshot of the C filter's parameters reaches the host, as it would over a bus; between snapshots the host has
samples only. "rows" takes S as a selection of rows; "published" besides leaves the states of earlier snapshots as they
were. The rival refits every 10th sample: least squares over all windows weighted by λ, SVD, state-space matrices. Poles
are matched to the true ones by optimal assignment, so that where two cross (near sample 1700) both methods show the
same small bias. results/ beside this file holds 100 runs.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from aeolid.filters import replay_filter
from aeolid.identify.markov import estimate_markov
from aeolid.identify.propagator import Propagator
from aeolid.identify.subspace import find_states, system_matrices
from aeolid.identify.windows import WindowFactor, triangularise
from aeolid.plants.moving_poles import CHANGE, poles_at, simulate_moving_poles
from aeolid.record import Record

PAST, ORDER, FORGETTING, EVERY, FIRST = 5, 3, 0.98, 10, 200
LENGTH = {"drift": 2670, "jump": 1400}
PARTS = {
    "drift": {"before": (400, CHANGE), "moving": (CHANGE + 100, 2670)},
    "jump": {"before": (400, CHANGE), "next 100": (CHANGE, CHANGE + 100), "after": (CHANGE + 200, 1400)},
}
PUBLISHED = {"memory": 0, "selection": "rows"}
FOLLOWERS: dict[str, tuple[str, dict[str, Any]]] = {
    "rls": ("rls", {}), "fast-rls": ("fast-rls", {}), "lattice": ("lattice", {}),
    "rls, rows": ("rls", {"selection": "rows"}), "rls, published": ("rls", PUBLISHED),
}  # fmt: skip
METHODS = (*FOLLOWERS, "SVD refit")
SHOWN = ("rls", "rls, published", "SVD refit")


def snapshots(record: Record, method: str) -> dict[int, Any]:
    """Return {sample: Ξ after it} of a C filter: the recording is replayed up to each of them."""
    u, y, found = record.matrix("input"), record.matrix("output"), {}
    for k in range(FIRST, len(record), EVERY):
        result = replay_filter(
            u[:k], y[:k], past=PAST, method=method, forgetting=FORGETTING, offset=np.zeros(4), scale=np.ones(4),
            regularisation=0.01,
        )  # fmt: skip
        found[k] = result.theta
    return found


def follow(record: Record, found: dict[int, Any], options: dict[str, Any]) -> Any:
    """Return the poles (snapshots, n) of the propagator, taken when each snapshot has arrived."""
    u, y, tracks = record.matrix("input"), record.matrix("output"), []
    tracker = Propagator(inputs=2, outputs=2, past=PAST, order=ORDER, forgetting=FORGETTING, **options)
    for k in range(len(record)):
        if k in found:
            tracker.update_markov(found[k])
            tracks.append(tracker.poles)
        tracker.update(u[k], y[k])
    return np.array(tracks)


def refit(record: Record) -> Any:
    """Return the poles (snapshots, n) of PBSIDopt on windows weighted by λ, by a new SVD each time."""
    z = record.values
    width, tracks = (PAST + 1) * 4 + 1, []
    full, weight, done = np.zeros((width, width)), 0.0, PAST
    for k in range(FIRST, len(record), EVERY):
        rows = np.array([np.concatenate([[1.0], z[i - PAST : i + 1].ravel()]) for i in range(done, k)])
        fade = FORGETTING ** (np.arange(k - done)[::-1] / 2)
        full = triangularise(np.vstack([full * FORGETTING ** ((k - done) / 2), rows * fade[:, None]]))
        weight, done = weight * FORGETTING ** (k - done) + float((fade**2).sum()), k
        factor = WindowFactor(full, PAST, 2, 2, round(weight), 0)
        estimate = estimate_markov(factor, (False, False), "none")
        T = find_states(factor, estimate.theta, PAST).state_map(ORDER)
        tracks.append(np.linalg.eigvals(system_matrices(factor, T, (False, False)).A))
    return np.array(tracks)


def matched(found: Any, true: Any) -> Any:
    """Return the poles (snapshots, n) in the order of the true ones (snapshots, n); NaN where there are none yet."""
    out = np.full(found.shape, np.nan + 0j)
    for i, (row, real) in enumerate(zip(found, true, strict=True)):
        if np.isfinite(row).all():
            rows, columns = linear_sum_assignment(abs(real[:, None] - row[None]))
            out[i, rows] = row[columns]
    return out


def run_change(change: str, runs: int, snr: float) -> dict[str, Any]:
    """Return the tracks (runs, snapshots, n) of every method; a progress bar goes to standard error."""
    from rich.console import Console
    from rich.progress import track

    samples = np.arange(FIRST, LENGTH[change], EVERY)
    true = np.array([poles_at(k - 1, change) for k in samples])
    tracks: dict[str, list[Any]] = {name: [] for name in METHODS}
    for seed in track(range(runs), change, console=Console(stderr=True)):
        record = simulate_moving_poles(LENGTH[change], seed, change, snr_db=snr)
        streams = {name: snapshots(record, name) for name in {source for source, _ in FOLLOWERS.values()}}
        for name, (source, options) in FOLLOWERS.items():
            tracks[name].append(matched(follow(record, streams[source], options), true))
        tracks["SVD refit"].append(matched(refit(record), true))
    return {"samples": samples, "true": true, "tracks": {name: np.array(v) for name, v in tracks.items()}}


def summarise(change: str, result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return for each part and method the bias of each pole, its standard error, and the scatter of one snapshot."""
    rows = []
    for part, (start, stop) in PARTS[change].items():
        inside = (result["samples"] >= start) & (result["samples"] < stop)
        for name, tracks in result["tracks"].items():
            error = (tracks[:, inside] - result["true"][inside]).real  # (runs, snapshots, n)
            means = np.nanmean(error, axis=1)
            rows.append({
                "change": change, "part": part, "method": name, "bias": means.mean(axis=0).tolist(),
                "standard_error": (means.std(axis=0, ddof=1) / np.sqrt(len(means))).tolist(),
                "scatter": np.sqrt(np.nanmean((error - np.nanmean(error, axis=0)) ** 2, axis=(0, 1))).tolist(),
            })  # fmt: skip
    return rows


def table(runs: int, snr: float, rows: list[dict[str, Any]]) -> str:
    """Return the study as text."""
    lines = [
        f"moving poles, {runs} runs, SNR {snr:g} dB, p = {PAST}, λ = {FORGETTING}: bias ± its standard error (scatter)"
    ]
    lines.append(f"{'':<32}" + "".join(f"{'pole from ' + p:>24}" for p in ("0.8", "0.3", "0.5")))
    for row in rows:
        cells = zip(row["bias"], row["standard_error"], row["scatter"], strict=True)
        text = "".join(f"{b:+10.4f} ± {e:.4f} ({s:.3f})" for b, e, s in cells)
        lines.append(f"{row['change']:<6} {row['part']:<9} {row['method']:<15}{text}")
    return "\n".join(lines)


def draw(path: Path, results: dict[str, dict[str, Any]]) -> None:
    """Draw the mean track of each pole with one standard deviation; dashed: true."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(len(results), len(SHOWN), figsize=(16, 4.2 * len(results)), squeeze=False)
    for row, (change, result) in zip(axes, results.items(), strict=True):
        for axis, name in zip(row, SHOWN, strict=True):
            tracks, k = result["tracks"][name].real, result["samples"]
            mean, spread = np.nanmean(tracks[:, 1:], axis=0), np.nanstd(tracks[:, 1:], axis=0)
            for i in range(ORDER):
                axis.fill_between(k[1:], mean[:, i] - spread[:, i], mean[:, i] + spread[:, i], alpha=0.25)
                axis.plot(k[1:], mean[:, i], linewidth=1.2)
                axis.plot(k, result["true"][:, i], "k--", linewidth=1)
            title = f"{change}: " + ("propagator on " + name if name != METHODS[-1] else name)
            axis.set(xlabel="sample", ylabel="pole", ylim=(-0.4, 1.0), title=title)
    figure.tight_layout()
    figure.savefig(path, dpi=75)
    plt.close(figure)


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description="Follow moving poles by the propagator and by a refit.")
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--snr", type=float, default=25.0, help="signal-to-noise ratio in dB")
    parser.add_argument("--out", type=Path, default=Path("build/studies"), help="folder of the three files")
    options = parser.parse_args(arguments)
    results = {change: run_change(change, options.runs, options.snr) for change in LENGTH}
    rows = [row for change, result in results.items() for row in summarise(change, result)]
    options.out.mkdir(parents=True, exist_ok=True)
    text = table(options.runs, options.snr, rows)
    print(text)
    (options.out / "propagator.txt").write_text(text + "\n", encoding="utf-8")
    facts = {"runs": options.runs, "snr_db": options.snr, "rows": rows}
    (options.out / "propagator.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    draw(options.out / "propagator.png", results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
