"""Hold what the recordings determine only in proportion to other free values: one of these stays as it was declared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.forensics import Finding
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import Equations, Parameter

Array = NDArray[np.float64]
_NONE = 1e-10  # eigenvalue of the scaled Gram matrix: slopes are forward differences, right to 1e-6
_ASIDE = 0.1  # of a declared value, by which it is moved: a direction that is open at one point only is none
_CHECK = "left open"


def values_to_hold(predictor: Predictor, point: Point, given: Equations) -> tuple[str, ...]:
    """Return the free parameters to hold so that no combination of several is left open; most often none.

    given: the model as declared, whose own free parameters may be held.

    A car whose mass, force and resistance are all free obeys any multiple of them. The fit ran along that line to the
    end of a range, the deviation of each was infinite, and a drag of 68 nats that goes with them counted as nothing.
    Held is the value whose declared range is the narrowest for its size. Looked at away from the declared values, too;
    values that move nothing at all are left alone. Cost: two sets of sensitivities for each value that is held.
    """
    model, held = predictor.compiled.model, []
    own = {p.name for p in given.parameters if p.free}
    open_ = [i for i, p in enumerate(model.parameters) if p.name in own]
    while len(open_) > 1:
        left = _in_a_ridge(predictor, point, open_)
        if not left:
            break
        chosen = min(left, key=lambda i: (_range(model.parameters[i]), i))
        held.append(model.parameters[chosen].name)
        open_.remove(chosen)
    return tuple(held)


def with_held(model: Equations, names: Sequence[str]) -> Equations:
    """Return the equations with some parameters no longer free."""
    kept = tuple(replace(p, free=p.free and p.name not in names) for p in model.parameters)
    return replace(model, parameters=kept)


def ridge_findings(given: object, declared: Equations) -> tuple[Finding, ...]:
    """Return the note on each parameter that is free in the given model and was held."""
    if not isinstance(given, Equations):
        return ()
    free = {p.name for p in declared.parameters if p.free}
    others = ", ".join(sorted(free & {p.name for p in given.parameters}))
    return tuple(
        Finding(
            _CHECK,
            p.name,
            f"the recordings determine {p.name} and other free values ({others}) only in proportion to each other:"
            f" {p.name} is held at its declared {p.value:.6g} {p.unit}".rstrip(),
            "info",
        )
        for p in given.parameters
        if p.free and p.name not in free
    )


def _in_a_ridge(predictor: Predictor, point: Point, places: Sequence[int]) -> list[int]:
    """Return those of some parameters that together have a direction which moves nothing, here and aside."""
    low, high = predictor.scales.low, predictor.scales.high
    aside = point.theta.copy()
    for k, i in enumerate(places):
        aside[i] = np.clip(aside[i] * (1 + _ASIDE * np.cos(1 + 2 * k)), low[i], high[i])
    found = [_open_at(predictor, replace(point, theta=theta), places) for theta in (point.theta, aside)]
    both = found[0] & found[1]
    return sorted(both) if len(both) > 1 else []


def _open_at(predictor: Predictor, point: Point, places: Sequence[int]) -> set[int]:
    if predictor.objective(point) >= 1e299:
        return set()
    states = tuple(range(len(predictor.compiled.model.states)))
    fit = predictor.at(point, Free(tuple(places), (), (), states))
    gram = fit.jacobian.T @ fit.jacobian + fit.prior_jacobian.T @ fit.prior_jacobian
    moving = np.flatnonzero(np.diag(gram) > 0)
    size = np.sqrt(np.diag(gram)[moving])
    values, vectors = np.linalg.eigh(gram[np.ix_(moving, moving)] / np.outer(size, size))
    part = in_force().baseline.ridge_part
    share = np.max(np.abs(vectors[:, values < _NONE]), axis=1, initial=0.0)
    return {places[m] for m, s in zip(moving.tolist(), share, strict=True) if m < len(places) and s > part}


def _range(parameter: Parameter) -> float:
    """Return how wide a parameter's declared range is for its size; infinite where it has none."""
    return (parameter.maximum - parameter.minimum) / max(abs(parameter.value), 1e-300)
