"""Repeat the simulation study of paper 000 section III: the wind turbine in closed loop, identified by VARX PBSIDopt.

    python tests/studies/paper000.py [--runs 10] [--samples 10000] [--noise 0.0] [--json FILE]

Prints, beside the figures of the authors' own toolbox on its own realisations of the same study, the fall of the
singular values after the seventh and the distance of the seven poles from the true ones, for each past window. The
paper prints curves only; its claim for VARX is that a window of 30 gives what a window of 10 does not.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from aeolid.identify.varx import identify_varx
from aeolid.plants.hawt import Excitation, build_turbine, simulate_closed_loop

GROUPS = {"integrator": 1.0, "tower 1": 0.9522 + 0.2726j, "tower 2": 0.9605 + 0.2752j, "drive train": 0.4905 + 0.8656j}
INPUTS = ("pitch", "generator_torque")
WINDOWS = ((10, 10), (20, 10), (30, 10), (30, 30), (50, 10))
# the toolbox: S7/S8 and S8/S9 (medians of ten runs), mean distance of the poles in the order of GROUPS
TOOLBOX = {
    (10, 10): (8.3, 1.6, 0.0020, 0.0011, 0.0004, 0.0010),
    (20, 10): (10.5, 2.2, 0.0019, 0.0013, 0.0004, 0.0010),
    (30, 10): (9.3, 2.5, 0.0019, 0.0013, 0.0003, 0.0010),
    (30, 30): (7.3, 3.2, 0.0019, 0.0013, 0.0004, 0.0010),
    (50, 10): (9.4, 3.0, 0.0018, 0.0014, 0.0003, 0.0010),
}


def pole_distances(found: Any, true: Any) -> Any:
    """Return the distance of each true pole to its estimate, by optimal assignment."""
    distance = abs(np.asarray(found)[:, None] - np.asarray(true)[None])
    rows, columns = linear_sum_assignment(distance)
    out = np.empty(len(true))
    out[columns] = distance[rows, columns]
    return out


def study(runs: int, samples: int, noise: float) -> dict[str, Any]:
    """Identify `runs` realisations with every window; returns the table as facts."""
    true = np.linalg.eigvals(build_turbine().A)
    place = [int(np.argmin(abs(true - z))) for z in GROUPS.values()]
    records = [simulate_closed_loop(samples, seed, excitation=Excitation(noise=noise)) for seed in range(runs)]
    rows = []
    for past, future in WINDOWS:
        errors, falls, tails, vafs, orders = [], [], [], [], []
        for record in records:
            result = identify_varx([record], past=past, future=future, order=7, feedthrough=INPUTS)
            s = result.singular_values
            errors.append(pole_distances(result.eigenvalues, true)[place])
            falls.append(s[6] / s[7])
            tails.append(s[7] / s[8])
            vafs.append(list(result.fit.one_step.vaf.values()))
            orders.append(identify_varx([record], past=past, future=future, feedthrough=INPUTS).order)
        rows.append({
            "past": past, "future": future, "fall_7_8": float(np.median(falls)), "fall_8_9": float(np.median(tails)),
            "pole_distance": dict(zip(GROUPS, np.mean(errors, axis=0).tolist(), strict=True)),
            "one_step_vaf": np.mean(vafs, axis=0).tolist(), "orders_chosen": orders,
        })  # fmt: skip
    return {"runs": runs, "samples": samples, "noise": noise, "rows": rows}


def table(facts: dict[str, Any]) -> str:
    """Return the study as text, the toolbox in brackets."""
    lines = [
        f"paper 000, section III: {facts['runs']} runs, N = {facts['samples']}, measurement noise {facts['noise']:.0%}",
        "here (authors' toolbox)",
        f"{'p':>3} {'f':>3}  {'S7/S8':>12}  {'S8/S9':>11}  " + "  ".join(f"{g:>15}" for g in GROUPS) + "  order chosen",
    ]
    for row in facts["rows"]:
        theirs = TOOLBOX[row["past"], row["future"]]
        ours = [f"{d:.4f} ({t:.4f})" for d, t in zip(row["pole_distance"].values(), theirs[2:], strict=True)]
        chosen = ", ".join(f"{n}x{row['orders_chosen'].count(n)}" for n in sorted(set(row["orders_chosen"])))
        falls = f"{row['fall_7_8']:5.1f} ({theirs[0]:.1f})", f"{row['fall_8_9']:5.1f} ({theirs[1]:.1f})"
        lines.append(
            f"{row['past']:3d} {row['future']:3d}  {falls[0]:>12}  {falls[1]:>11}  "
            + "  ".join(f"{o:>15}" for o in ours) + f"  {chosen}"
        )  # fmt: skip
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description="Repeat the simulation study of paper 000 with VARX.")
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--noise", type=float, default=0.0, help="measurement noise, fraction of each output's spread")
    parser.add_argument("--json", help="write the facts to this file")
    options = parser.parse_args(arguments)
    facts = study(options.runs, options.samples, options.noise)
    print(table(facts))
    if options.json:
        with open(options.json, "w", encoding="utf-8") as handle:
            json.dump(facts, handle, indent=1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
