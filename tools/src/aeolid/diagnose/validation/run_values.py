"""Fit the free values of equations to a free run, with deviations that hold where its errors are no white noise.

One-step predictions weigh fast details most: a model that is right but for how friction turns over, or for a lag of a
measured input, then has values that are sure and wrong. The output error weighs what the model is run for. At its
minimum over θ and the starts of the stretches, r (M,) the errors and J (M, k) their sensitivities,
    cov θ = (JᵀJ)⁻¹ (Σ_b g_b g_bᵀ) (JᵀJ)⁻¹ B/(B − 1),      g_b = J_bᵀ r_b,
over B blocks longer than the errors are alike (White 1980; Newey and West 1987): what the model leaves out is in it.
Ljung (1999, section 7.4) has the output error as the predictor without a gain; in open loop its values are consistent
whatever the noise is, under feedback only as far as noise does not reach the inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import pinv
from aeolid.diagnose.candidates.moved import Moved
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.explore import fit_quietly
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.nuisance import is_nuisance
from aeolid.models.equations import Equations

Array = NDArray[np.float64]
_MOST, _FEWEST = 64, 8  # blocks
_LONGER = 3.0  # a block, than errors are alike
_ITERATIONS, _TOLERANCE = 40, 1e-3


def fitted_run(predictor: Predictor, start: Fit, declared: Equations | None = None) -> tuple[Predictor, Fit] | None:
    """Return the fit of the free run to a predictor's data, from a fit and, where given, from the declared values too.

    The better of both; None where neither runs to the end. Cost: at most 40 iterations from each, of as many filter
    passes as there are free values.
    """
    alone, free = predictor.with_order(0), physical(predictor, start.free)
    starts = [start.point.theta]
    if declared is not None:
        model, theta = predictor.compiled.model, start.point.theta.copy()
        for p in declared.parameters:
            if p.free and model.index(p.name) in free.theta:
                theta[model.index(p.name)] = p.value
        starts.append(theta)
    found = [fit_quietly(alone, running(start.point, t), free, _ITERATIONS, _TOLERANCE) for t in starts]
    fits = [f for f in found if f is not None and np.isfinite(f.log_likelihood)]
    return (alone, max(fits, key=lambda f: f.log_posterior)) if fits else None


def extended_run(
    run: tuple[Predictor, Fit], segments: Sequence[Segment], known: Sequence[Array]
) -> tuple[Predictor, Fit] | None:
    """Return a fitted run fitted to further stretches as well, those of the run first; None where it diverges.

    From the values of the first stretches, and for each other the best of three starts: that of its first rows, that of
    a fit of predictions (known, a start (n,) of each stretch), the declared one. A run over a long stretch from the
    wrong start is far off where nothing in the model forgets it, or where the first rows do not show a state.
    """
    alone, fit = run
    count = len(alone.segments)
    early = alone.score_elsewhere(fit, segments[count:])[2].x0
    declared = alone.compiled.model.x0[: len(alone.scales.x0)]
    x0 = list(fit.point.x0)
    for segment, settled, told in zip(segments[count:], early, known[count:], strict=True):
        part = alone.on([segment])
        starts = [settled, told, declared]
        x0.append(starts[int(np.argmin([_power(part, replace(fit.point, x0=(s.copy(),))) for s in starts]))].copy())
    both = alone.on(segments)
    found = fit_quietly(both, replace(fit.point, x0=tuple(x0)), fit.free, _ITERATIONS, _TOLERANCE)
    return None if found is None else (both, found)


def _power(predictor: Predictor, point: Point) -> float:
    """Return the mean square error of a free run, in spreads of the outputs; infinite where it is no number."""
    with np.errstate(over="ignore", invalid="ignore"):
        errors = np.vstack(predictor.innovations(point)) / predictor.scales.spread
        power = float(np.nanmean(errors**2)) if np.isfinite(errors).any() else np.inf
    return power if np.isfinite(power) else np.inf


def physical(predictor: Predictor, free: Free) -> Free:
    """Return what a free run may move: the model's own values, and the starts."""
    parameters = predictor.compiled.model.parameters
    return Free(tuple(i for i in free.theta if not is_nuisance(parameters[i].name)), (), (), free.x0)


def running(point: Point, theta: Array) -> Point:
    """Return the point with no gain, so that no measurement holds the run."""
    noise = np.zeros_like(point.noise)
    if len(noise):
        noise[len(point.x0[0]) :] = 1.0  # sensors alone: the gain is zero
    return replace(point, theta=theta, noise=noise, K=None if len(noise) else point.K)


def run_moved(declared: Equations, predictor: Predictor, fit: Fit) -> list[Moved]:
    """Return the values of a fitted run with the deviations of its own errors, in the order of the free values."""
    names = [predictor.compiled.model.parameters[i].name for i in fit.free.theta]
    known = {p.name: p for p in declared.parameters}
    std = block_std(fit, len(predictor.scales.spread))
    return [
        Moved(known[name], float(fit.point.theta[i]), float(s))
        for name, i, s in zip(names, fit.free.theta, std, strict=False) if name in known
    ]  # fmt: skip


def block_std(fit: Fit, outputs: int) -> Array:
    """Return the deviations (k,) of the free values by the scores of blocks of the errors; inf where nothing tells."""
    J, r = fit.jacobian, fit.residual
    rows = len(r) // outputs
    length = int(np.clip(_LONGER * memory(r.reshape(rows, outputs)), rows / _MOST, max(rows / _FEWEST, 1)))
    ends = np.arange(0, rows, max(length, 1)) * outputs
    scores = np.add.reduceat(J * r[:, None], ends, axis=0)  # (B, k)
    gram = J.T @ J + fit.prior_jacobian.T @ fit.prior_jacobian
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    inverse = pinv(gram / np.outer(size, size), rcond=1e-12, hermitian=True)
    reached = (scores / size) @ inverse
    count = len(ends)
    variance = (reached**2).sum(axis=0) * count / max(count - 1, 1)
    told = np.diag(gram) > 1e-200
    out: Array = np.where(told, np.sqrt(variance) / size, np.inf)
    return out


def memory(errors: Array) -> float:
    """Return the rows over which errors (N, l) are alike: the longest time to a correlation of 1/e of any output."""
    longest = 1
    for column in errors.T:
        left = np.nan_to_num(column - np.nanmean(column))
        width = 2 ** int(np.ceil(np.log2(2 * max(len(left), 1))))
        spectrum = np.abs(np.fft.rfft(left, width)) ** 2
        alike = np.fft.irfft(spectrum, width)[: len(left)]
        below = np.flatnonzero(alike < alike[0] / np.e)
        longest = max(longest, int(below[0]) if len(below) else len(left))
    return float(longest)


def runs_clearly_better(before: Array, after: Array, spreads: Array) -> bool:
    """Tell whether errors (N, l) of a run are smaller than those before: of the sum of squares, one-sided at 5 %."""
    if not np.isfinite(after).any():
        return False
    if not np.isfinite(before).any():
        return True
    gained = np.nansum((before**2 - after**2) / spreads**2, axis=1)
    blocks = np.add.reduceat(gained, np.arange(0, len(gained), max(1, int(np.sqrt(len(gained))))))
    return bool(blocks.sum() > in_force().evidence.five_percent_z * np.sqrt(len(blocks)) * np.std(blocks) > 0)
