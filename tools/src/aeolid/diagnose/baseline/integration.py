"""Let every prediction take as many integration steps as the states need that the baseline passes."""

from __future__ import annotations

from collections.abc import Callable

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.data.split import Split
from aeolid.diagnose.predictor.point import Point, Scales
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.errors import NotIdentifiable
from aeolid.models.integration_steps import MOST_AT_START, substeps_along

Rough = tuple[tuple[Predictor, Point], Scales]
_LEAST = (1, 8, 64)  # steps a sample at least; the further ones where the baseline diverges with those before
_ENOUGH = 2.0  # times too few steps up to which they are not changed: the fastest rate times a step is 1, error 1/120


def well_integrated(split: Split, rough_of: Callable[[tuple[Segment, ...]], Rough]) -> tuple[Split, Rough]:
    """Return the parts with the integration steps that they need, and the rough predictor of them.

    A model that starts at rest with a drag, or on a spring that stiffens, is slow there and fast where it has gone:
    with the steps of its start alone its predictions would be those of another model, or diverge. One number for all
    parts, so that no two of them are integrated differently. rough_of: returns the rough predictor and its scales of
    the parts that are fitted; raises NotIdentifiable where the model diverges. Cost: one run more where nothing is too
    fast.
    """
    for place, least in enumerate(_LEAST):
        tried = split if least == 1 else split.stepped(least)
        try:
            rough = rough_of(tried.fit)
        except NotIdentifiable:
            if place + 1 == len(_LEAST):
                raise
            continue
        needed = _needed(*rough[0])
        if needed <= least:
            return tried, rough
        tried = split.stepped(needed)
        return tried, rough_of(tried.fit)
    raise AssertionError("the last of the tries returns or raises")


def _needed(predictor: Predictor, point: Point) -> int:
    """Return the steps a row of inputs that the states of a run need, 1 where those that it takes are enough."""
    found = 1
    for index, segment in enumerate(predictor.segments):
        u, count = predictor.ready(point, index)
        X = predictor.run(point, index)[2]
        along = substeps_along(predictor.compiled, X, u[:: segment.stride], point.theta, segment.fine_step)
        if along > _ENOUGH * count:
            found = max(found, along)
    return min(found, MOST_AT_START)
