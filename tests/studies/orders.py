"""Count how often each criterion finds the order of systems whose order is known.

    python tests/studies/orders.py [--runs 100] [--case NAME ...] [--out FOLDER]

Writes orders.txt (the table) and orders.json: of the runs, how many found the true order, and how many took more. Every
run is a recording of its own (seed 0, 1, …): the fourth-order example in closed loop (p = 10), random systems of order
2 … 6 with two inputs, two outputs and 10 % noise power in open loop (p = 12), and the turbine in closed loop (p = 20).
results/ beside this file holds 100 runs of five cases.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.identify.order import CRITERIA
from aeolid.identify.varx import identify_varx
from aeolid.models.recursion import run_states
from aeolid.plants.hawt import Excitation, simulate_closed_loop
from aeolid.plants.lti import simulate_fourth_order
from aeolid.record import Channel, Record

BOTH = ("pitch", "generator_torque")


def random_record(samples: int, seed: int) -> Record:
    """Simulate a random system of order 2 + seed mod 5, |poles| ≤ 0.8 … 0.95, predictor within 0.95."""
    random, n = np.random.default_rng(1000 + seed), 2 + seed % 5
    A, B, C = (random.standard_normal(shape) for shape in ((n, n), (n, 2), (2, n)))
    A *= random.uniform(0.8, 0.95) / abs(np.linalg.eigvals(A)).max()
    K = 0.3 * random.standard_normal((n, 2))
    while abs(np.linalg.eigvals(A - K @ C)).max() >= 0.95:
        K *= 0.8
    u, e = random.standard_normal((samples, 2)), random.standard_normal((samples, 2))
    answers = [C @ np.linalg.matrix_power(A, k) @ B for k in range(100)]
    e *= 0.3 * np.sqrt(sum(float((a**2).sum()) for a in answers) / 2)
    x = run_states(A, u @ B.T + e @ K.T, np.zeros(n))[:-1]
    names = (("u1", "input"), ("u2", "input"), ("y1", "output"), ("y2", "output"))
    channels = tuple(Channel(name, "", role) for name, role in names)
    values = np.hstack([u, x @ C.T + e])
    return Record(np.arange(samples, dtype=float), values, channels, 1.0, f"random system, seed {seed}", "")


def turbine(samples: int, noise: float) -> Callable[[int], Record]:
    """Return what simulates the turbine with measurement noise."""
    return lambda seed: simulate_closed_loop(samples, seed, excitation=Excitation(noise=noise))


CASES: dict[str, tuple[Callable[[int], int], Callable[[int], Record], dict[str, Any]]] = {
    "example N 200": (lambda _: 4, lambda s: simulate_fourth_order(200, s, feedback=0.25), {"past": 10}),
    "example N 500": (lambda _: 4, lambda s: simulate_fourth_order(500, s, feedback=0.25), {"past": 10}),
    "example N 3000": (lambda _: 4, lambda s: simulate_fourth_order(3000, s, feedback=0.25), {"past": 10}),
    "random N 250": (lambda s: 2 + s % 5, lambda s: random_record(250, s), {"past": 12}),
    "random N 1000": (lambda s: 2 + s % 5, lambda s: random_record(1000, s), {"past": 12}),
    "random N 3000": (lambda s: 2 + s % 5, lambda s: random_record(3000, s), {"past": 12}),
    "turbine 0 % N 5000": (lambda _: 7, turbine(5000, 0.0), {"past": 20, "feedthrough": BOTH}),
    "turbine 1 % N 5000": (lambda _: 7, turbine(5000, 0.01), {"past": 20, "feedthrough": BOTH}),
    "turbine 10 % N 5000": (lambda _: 7, turbine(5000, 0.1), {"past": 20, "feedthrough": BOTH[:1]}),
}


def run_case(name: str, runs: int) -> dict[str, Any]:
    """Count hits and excesses of each criterion in one case."""
    order_of, simulate, options = CASES[name]
    hits: Counter[str] = Counter()
    above: Counter[str] = Counter()
    asked: Counter[str] = Counter()
    for seed in range(runs):
        answers = identify_varx([simulate(seed)], uncertainty="none", **options).order_choice.answers
        for criterion, order in answers.items():
            hits[criterion] += order == order_of(seed)
            above[criterion] += order > order_of(seed)
            asked[criterion] += 1
    return {
        "case": name, "runs": runs,
        **{c: {"hit": hits[c], "above": above[c], "of": asked[c]} for c in CRITERIA},
    }  # fmt: skip


def line(row: dict[str, Any]) -> str:
    """Return one line of the table."""
    cells = [f"{row[c]['hit']:4d} +{row[c]['above']:3d}" if row[c]["of"] else "       – " for c in CRITERIA]
    return f"{row['case']:22}" + "  ".join(cells)


def main(arguments: list[str] | None = None) -> int:
    """Run the cases and write what they say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--case", action="append", choices=list(CASES))
    parser.add_argument("--out", type=Path, default=Path("build/orders"))
    options = parser.parse_args(arguments)
    rows = []
    for name in options.case or CASES:
        rows.append(run_case(name, options.runs))
        print(line(rows[-1]), file=sys.stderr, flush=True)
    head = f"{'':22}" + "  ".join(f"{c:>9}" for c in CRITERIA)
    text = "\n".join([f"true order of {options.runs} runs, + how many took more", head, *map(line, rows)]) + "\n"
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "orders.txt").write_text(text)
    (options.out / "orders.json").write_text(json.dumps(rows, indent=1))
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
