"""Choose which fitted values of equations are told: those of one-step predictions, or those of the free run.

Predictions are the sharper where the equations are right, the free run the sounder where they are nearly right. Where
the two exclude each other (Hausman 1978) and a first fit's run is clearly better with the run's values on the data left
out, the run's are told; where it is not, predictions' with half of the distance to the run's as their deviation. So it
is half of what two parts of the data differ by, where that is more than three deviations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.moved import Moved
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.validation.run_values import (
    extended_run,
    fitted_run,
    run_moved,
    running,
    runs_clearly_better,
)
from aeolid.models.equations import Equations

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Told:
    """Hold the values that are told, and those of the other fit that contradict them.

    fit: the fit of all data with these values; held (np,): the values of a first fit, which did not have what was left
    out; apart: names of values that differ between parts.
    """

    values: tuple[Moved, ...]
    by_run: bool
    others: tuple[Moved, ...]
    apart: tuple[str, ...]
    fit: Fit
    held: Array


def told_values(
    prepared: Prepared, most: tuple[Predictor, Fit], whole: tuple[Predictor, Fit],
    known: tuple[tuple[Moved, ...], tuple[str, ...]],
) -> Told:  # fmt: skip
    """Return the values to tell; most, whole: fits of predictions without and with what is left out; known: theirs."""
    values, apart = known
    plain = Told(values, False, (), apart, whole[1], most[1].point.theta)
    split, declared = prepared.split, prepared.declared
    first = fitted_run(prepared.predictor, prepared.fit, declared)
    run = None if first is None else extended_run(first, whole[0].segments, whole[1].point.x0)
    if first is None or run is None:
        return plain
    found, uneven = widened(declared, run_moved(declared, *run), _parts(prepared, first, run))
    against = {m.parameter.name: m for m in found}
    off = [m.parameter.name for m in values if m.parameter.name in against and _excluded(m, against[m.parameter.name])]
    if not off:
        return plain
    without = extended_run(first, (*split.fit, *split.select), most[1].point.x0)
    if without is None or not _is_borne_out(prepared, most, without[1]):
        return replace(plain, values=_between(values, against, off), others=tuple(against[n] for n in off))
    held = most[1].point.theta.copy()
    held[list(run[1].free.theta)] = without[1].point.theta[list(run[1].free.theta)]
    theta = whole[1].point.theta.copy()
    theta[list(run[1].free.theta)] = run[1].point.theta[list(run[1].free.theta)]
    fit = replace(whole[1], point=replace(whole[1].point, theta=theta))
    others = tuple(m for m in values if m.parameter.name in off)
    return Told(found, True, others, uneven, fit, held)


def _between(values: Sequence[Moved], against: dict[str, Moved], off: Sequence[str]) -> tuple[Moved, ...]:
    """Return values with a deviation of half the distance, at least, to what contradicts them."""
    return tuple(
        replace(m, std=max(m.std, 0.5 * abs(m.value - against[m.parameter.name].value)))
        if m.parameter.name in off and np.isfinite(against[m.parameter.name].std) else m
        for m in values
    )  # fmt: skip


def _excluded(one: Moved, other: Moved) -> bool:
    """Tell whether two estimates exclude each other, or the first has run to the end of its range alone."""
    spread = float(np.hypot(one.std, other.std))
    apart = np.isfinite(spread) and abs(one.value - other.value) > in_force().evidence.moved_deviations * spread
    return bool(apart or (one.at_end and not other.at_end))


def _parts(
    prepared: Prepared, first: tuple[Predictor, Fit], run: tuple[Predictor, Fit]
) -> tuple[list[Moved], list[Moved]] | None:
    """Return the values of a run on the first part and on the rest, None where that does not run."""
    (predictor, fit), count = run, len(first[0].segments)
    start = replace(fit, point=replace(fit.point, x0=fit.point.x0[count:]))
    rest = fitted_run(predictor.on(predictor.segments[count:]), start)
    return None if rest is None else (run_moved(prepared.declared, *first), run_moved(prepared.declared, *rest))


def _is_borne_out(prepared: Prepared, most: tuple[Predictor, Fit], run: Fit) -> bool:
    """Tell whether the values of a first run are better on the part left out than those of predictions."""
    predictor, fit = most
    theta = fit.point.theta.copy()
    theta[list(run.free.theta)] = run.point.theta[list(run.free.theta)]
    before, after = (free_errors(prepared, predictor, fit, t) for t in (fit.point.theta, theta))
    return runs_clearly_better(before, after, predictor.scales.spread)


def widened(
    declared: Equations, whole: Sequence[Moved], parts: tuple[Sequence[Moved], Sequence[Moved]] | None
) -> tuple[tuple[Moved, ...], tuple[str, ...]]:
    """Return the values in the model's order, and which of them differ between two parts by more than they may.

    The deviation of such a value is half of the difference at least.
    """
    rules = in_force().evidence
    order = [p.name for p in declared.parameters]
    known, apart = {m.parameter.name: m for m in whole}, []
    first, rest = ({m.parameter.name: m for m in part} for part in (parts or (whole, whole)))
    for name, m in known.items():
        if name not in first or name not in rest:
            continue
        between = abs(first[name].value - rest[name].value)
        spread = float(np.hypot(first[name].std, rest[name].std))
        if np.isfinite(spread) and between > rules.moved_deviations * spread:
            apart.append(name)
            known[name] = replace(m, std=max(m.std, 0.5 * between))
    return tuple(known[n] for n in order if n in known), tuple(n for n in order if n in apart)


def run_errors(prepared: Prepared, predictor: Predictor, fit: Fit, point: Point) -> Array:
    """Return the errors (N, l) on the part left out at a point, starts fitted to its first rows; NaN if it diverges."""
    segments: Sequence[Segment] = prepared.split.sealed
    alone = predictor.with_order(0)
    rows = sum(len(s.y) - s.burn for s in segments)
    if alone.noise_of(alone.innovations(point)) is None:
        return np.full((rows, len(predictor.scales.spread)), np.nan)
    held = alone.at(point, Free((), (), (), fit.free.x0))
    _, other, settled = alone.score_elsewhere(held, segments)
    return np.vstack([e[s.burn :] for e, s in zip(other.innovations(settled), segments, strict=True)])


def free_errors(prepared: Prepared, predictor: Predictor, fit: Fit, theta: Array) -> Array:
    """Return the errors (N, l) of a free run with some values on the part left out; NaN where it diverges.

    Starts are fitted to all of it: a stage without a spring keeps whatever speed its first ten rows seemed to have, and
    ran 38 mm off where the same values with a fitted start leave 2 mm.
    """
    segments: Sequence[Segment] = prepared.split.sealed
    alone, point, starts = predictor.with_order(0), running(fit.point, theta), Free((), (), (), fit.free.x0)
    if alone.noise_of(alone.innovations(point)) is None:
        return np.full((sum(len(s.y) - s.burn for s in segments), len(predictor.scales.spread)), np.nan)
    _, other, settled = alone.score_elsewhere(alone.at(point, starts), segments)
    found = other.climb(settled, starts) if starts.x0 else None
    errors = other.innovations(settled if found is None else found[1])
    return np.vstack([e[s.burn :] for e, s in zip(errors, segments, strict=True)])


def rms(errors: Array) -> Array:
    """Return the root mean square of errors (N, l), (l,); NaN where it is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        found: Array = np.sqrt(np.nanmean(errors**2, axis=0)) if np.isfinite(errors).any() else errors[0]
    return np.where(np.isfinite(found), found, np.nan)
