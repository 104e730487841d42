"""Compare ways to bootstrap an identified model: deviations of its modes over the asymptotic ones.

    python tests/studies/bootstraps.py [--runs 40] [--draws 40] [--out FOLDER]

Writes bootstraps.txt; results/ beside this file holds 40 runs. The fourth-order example in open loop and under
u = r − y/4, varx with p = 15, f = 10, order 4. The asymptotic deviations hold there (coverage.py), so that a ratio
other than one is a fault of the bootstrap. Ways: `multiplier`, the one of `identify.bootstrap`; `weights`, blocks of 15
windows weighted by exponential deviates (Bayesian bootstrap) and everything fitted again; `residual`, innovations of
the model drawn with replacement, sent through the model with the recorded inputs as they are, and all fitted again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.optimize import linear_sum_assignment

from aeolid.identify.bootstrap import collect_scores, run_bootstrap
from aeolid.identify.markov import estimate_markov, regressor_columns
from aeolid.identify.subspace import ScaledModel, find_states, system_matrices
from aeolid.identify.uncertainty import matrix_spread, pole_covariance
from aeolid.identify.windows import WindowFactor, factorise, find_scaling, triangularise
from aeolid.models.recursion import run_states
from aeolid.plants.lti import simulate_fourth_order

PAST, FUTURE, ORDER, INPUTS, OUTPUTS = 15, 10, 4, 2, 2
THROUGH = (False, False)
SETTINGS = ((0.25, 1500), (0.25, 600), (0.0, 1500))
WAYS = ("multiplier", "weights", "residual")


def fitted(factor: WindowFactor) -> ScaledModel:
    """Identify from a factor."""
    theta = estimate_markov(factor, THROUGH, "none").theta
    return system_matrices(factor, find_states(factor, theta, FUTURE).state_map(ORDER), THROUGH)


def factor_of(z: Any, weights: Any = 1.0) -> WindowFactor:
    """Return the factor of scaled samples (N, m), each window with its weight."""
    windows = sliding_window_view(z, (PAST + 1, z.shape[1])).reshape(len(z) - PAST, -1)
    rows = np.hstack([np.ones((len(windows), 1)), windows]) * np.sqrt(np.broadcast_to(weights, len(windows)))[:, None]
    return WindowFactor(triangularise(rows), PAST, INPUTS, OUTPUTS, len(windows), 0)


def weighted(z: Any, random: np.random.Generator) -> ScaledModel:
    """Fit again with a weight for each block of windows."""
    block = np.arange(len(z) - PAST) // PAST
    return fitted(factor_of(z, random.exponential(size=block[-1] + 1)[block]))


def resampled(z: Any, model: ScaledModel, random: np.random.Generator) -> ScaledModel:
    """Fit again to what the model makes of drawn innovations and the recorded inputs."""
    u, y = z[:, :INPUTS], z[:, INPUTS:]
    x = run_states(model.A - model.K @ model.C, u @ model.B.T + y @ model.K.T, np.zeros(ORDER))[:-1]
    e = (y - x @ model.C.T)[2 * PAST :]
    e = (e - e.mean(axis=0)) * np.sqrt(len(z) / (len(z) - PAST * z.shape[1]))
    drawn = e[random.integers(0, len(e), len(z))]
    x = run_states(model.A, u @ model.B.T + drawn @ model.K.T, np.zeros(ORDER))[:-1]
    return fitted(factor_of(np.hstack([u, x @ model.C.T + drawn])))


def deviations(poles: Any, draws: list[Any]) -> Any:
    """Return the deviation of each pole in the z-plane, (n,), drawn poles matched to it."""
    rows = [d[linear_sum_assignment(abs(poles[:, None] - d[None]))[1]] for d in draws]
    return np.std(rows, axis=0, ddof=1)  # of complex numbers: the root of both variances together


def runs_of(feedback: float, samples: int, runs: int, count: int) -> Iterator[dict[str, Any]]:
    """Yield run by run the mean ratio to the asymptotic deviations."""
    for run in range(runs):
        random = np.random.default_rng(run)
        record = simulate_fourth_order(samples, run, feedback=feedback, noise_variance=0.49)
        scaling = find_scaling([record])
        factor, z = factorise([record], scaling, PAST), scaling.apply(record.columns(scaling.names))
        markov = estimate_markov(factor, THROUGH, "none")
        basis = find_states(factor, markov.theta, FUTURE)
        model = system_matrices(factor, basis.state_map(ORDER), THROUGH)
        poles = np.linalg.eigvals(model.A).astype(complex)
        spread = pole_covariance(model.A, matrix_spread(factor, basis, model, markov, THROUGH))
        said = np.sqrt(spread.trace(axis1=1, axis2=2))
        scores = collect_scores([record], scaling, factor, markov.theta, regressor_columns(factor, THROUGH))
        at = np.exp(1j * np.array([0.5]))
        draws = {
            "multiplier": list(run_bootstrap(factor, markov, model, scores, THROUGH, FUTURE, at, count, run).poles),
            "weights": [np.linalg.eigvals(weighted(z, random).A) for _ in range(count)],
            "residual": [np.linalg.eigvals(resampled(z, model, random).A) for _ in range(count)],
        }
        yield {way: float(np.mean(deviations(poles, draws[way]) / said)) for way in WAYS}


def study(runs: int, count: int) -> str:
    """Run all settings with a progress bar on standard error; returns the table."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    lines = [f"deviation of the poles over the asymptotic one, mean of {runs} runs ± its error, {count} draws each"]
    for feedback, samples in SETTINGS:
        name = f"{'closed' if feedback else 'open'} loop, N = {samples}"
        found = list(track(runs_of(feedback, samples, runs, count), name, total=runs, console=console))
        cells = []
        for way in WAYS:
            values = np.array([f[way] for f in found])
            cells.append(f"{way} {values.mean():.3f} ± {values.std(ddof=1) / np.sqrt(runs):.3f}")
        lines.append(f"{name:<24} {'   '.join(cells)}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description="Compare ways to bootstrap an identified model.")
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--out", type=Path, default=Path("build/studies"), help="folder of the file")
    options = parser.parse_args(arguments)
    text = study(options.runs, options.draws)
    options.out.mkdir(parents=True, exist_ok=True)
    print(text)
    (options.out / "bootstraps.txt").write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
