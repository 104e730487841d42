"""Ask what the eighth singular value of paper 000's study is, which the printed figure does not show.

    python tests/studies/eighth_value.py [--lengths 2500 10000 40000 160000] [--runs 5] [--noise 0.01] [--json FILE]

The system has seven states. For growing length N the study shows the seventh to ninth singular value of ΓK Z/√N with
p = f = 10, medians over the runs: of VARX, of VARMAX, and of VARMAX with the true innovations (those of the Kalman
predictor of the true turbine) in place of estimated ones. Then it draws errors of Ξ from nothing but the covariance of
least squares, Λ ⊗ (Z Zᵀ)⁻¹, adds them to the Ξ of the longest recording, and shows the singular values again.

An eighth state would keep its value as N grows. What falls as N^{−1/2}, with the true innovations too, and comes out of
the drawn errors, is the error of Ξ alone: the largest singular value of ΔΓK Z. It stands out from those that follow
because the slow motion of inputs and outputs is large and lasts over all f rows, so that an error of the gain at low
frequency adds up in phase.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_are

from aeolid.identify.extended import collect
from aeolid.identify.markov import MarkovEstimate, estimate_markov
from aeolid.identify.subspace import find_states
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.identify.whitening import extend, with_innovations
from aeolid.identify.windows import Scaling, WindowFactor, factorise, find_scaling
from aeolid.models.recursion import run_states
from aeolid.plants.hawt import OUTPUT_STD, PITCH, TORQUE, Excitation, build_turbine, simulate_closed_loop
from aeolid.record import Record

INPUTS, PAST, THROUGH = ("pitch", "generator_torque"), 10, (True, True)
SETTLED = 500  # samples until the Kalman predictor has forgotten its start
DRAWS = 30


def true_innovations(record: Record, noise: float) -> Any:
    """Return y − ŷ (N, 3) of the Kalman predictor of the true turbine under unit wind and this measurement noise."""
    t = build_turbine()
    wind, feed = t.B[:, :3], t.D[:, :3]
    V = feed @ feed.T + np.diag((noise * OUTPUT_STD) ** 2)
    V = V + 1e-9 * np.linalg.eigvalsh(V)[-1] * np.eye(3)  # two wind components reach three outputs
    S = wind @ feed.T
    P = solve_discrete_are(t.A.T, t.C.T, wind @ wind.T, V, s=S)
    K = np.linalg.solve(t.C @ P @ t.C.T + V, (t.A @ P @ t.C.T + S).T).T
    u, y = record.matrix("input"), record.matrix("output")
    B, D = t.B[:, [PITCH, TORQUE]], t.D[:, [PITCH, TORQUE]]
    states = run_states(t.A - K @ t.C, u @ (B - K @ D).T + y @ K.T, np.zeros(7))[:-1]
    return y - states @ t.C.T - u @ D.T


def with_truth(record: Record, scaling: Scaling, noise: float) -> tuple[WindowFactor, MarkovEstimate]:
    """Return the windows with the true innovations in them, and Ξ by least squares."""
    r = len(scaling.inputs)
    e = true_innovations(record, noise)[SETTLED:] / scaling.scale[r : r + 3]
    settled = record.slice(SETTLED, len(record))
    samples = collect([settled], scaling, PAST)
    extended = extend(scaling)
    factor = factorise(with_innovations([settled], samples, extended, e, PAST), extended, PAST)
    return factor, estimate_markov(factor, THROUGH, "gcv")


def values(factor: WindowFactor, theta: Any) -> list[float]:
    """Return the seventh to ninth singular value."""
    return [float(v) for v in find_states(factor, theta, PAST).singular_values[6:9]]


def draw_errors(factor: WindowFactor, estimate: MarkovEstimate, theta: Any, seed: int) -> list[list[float]]:
    """Return the values for Ξ = theta plus errors with the covariance of least squares, DRAWS times."""
    random = np.random.default_rng(seed)
    size, vectors = np.linalg.eigh(estimate.residual_covariance)
    root = vectors * np.sqrt(np.maximum(size, 0.0))
    found = []
    for _ in range(DRAWS):
        error = root @ random.standard_normal((3, estimate.rank)) @ estimate.spread.T
        found.append(values(factor, theta + error))
    return found


def study(lengths: list[int], runs: int, noise: float) -> dict[str, Any]:
    """Return the medians by length and kind."""
    excitation = Excitation(noise=noise)
    long = simulate_closed_loop(max(lengths), 900, excitation=excitation)
    scaling = find_scaling([long])  # one for all, so that one Ξ serves every length
    theta = with_truth(long, scaling, noise)[1].theta
    rows = []
    for length in lengths:
        kinds: dict[str, list[list[float]]] = {"varx": [], "varmax": [], "true e": [], "drawn": []}
        for seed in range(runs):
            record = simulate_closed_loop(length, 500 + seed, excitation=excitation)
            for name, run in (("varx", identify_varx), ("varmax", identify_varmax)):
                result = run([record], past=PAST, order=7, feedthrough=INPUTS)
                kinds[name].append(result.singular_values[6:9].tolist())
            factor, estimate = with_truth(record, scaling, noise)
            kinds["true e"].append(values(factor, estimate.theta))
            kinds["drawn"] += draw_errors(factor, estimate, theta, seed)
        rows.append({"length": length} | {k: np.median(v, axis=0).tolist() for k, v in kinds.items()})
    return {"runs": runs, "noise": noise, "rows": rows}


def table(facts: dict[str, Any]) -> str:
    """Return the study as text."""
    kinds = [k for k in facts["rows"][0] if k != "length"]
    lines = [
        f"singular values 7, 8, 9, p = f = 10, measurement noise {facts['noise']:.0%}, {facts['runs']} runs",
        f"{'N':>8}  " + "".join(f"{k:^26}" for k in kinds),
    ]
    for row in facts["rows"]:
        lines.append(f"{row['length']:>8}  " + "".join("{:8.4f}{:8.4f}{:8.4f}  ".format(*row[k]) for k in kinds))
    lines.append("drawn: errors of Ξ with the covariance of least squares, on the Ξ of the longest recording")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description="Ask what the eighth singular value of paper 000's study is.")
    parser.add_argument("--lengths", type=int, nargs="+", default=[2500, 10_000, 40_000, 160_000])
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--json", help="write the facts to this file")
    options = parser.parse_args(arguments)
    facts = study(options.lengths, options.runs, options.noise)
    print(table(facts))
    if options.json:
        with open(options.json, "w", encoding="utf-8") as handle:
            json.dump(facts, handle, indent=1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
