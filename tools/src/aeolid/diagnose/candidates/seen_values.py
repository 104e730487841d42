"""Fit effects whose values have no slope at first: held where they are seen, tried where else they may lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.predictor.explore import fit_briefly, fit_fully, fit_quietly
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point, shifted
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import Equations


def without_values(free: Free, attachments: Sequence[Attachment], model: Equations) -> Free:
    """Return the free set without the values of some effects."""
    own = {model.index(s.name) for a in attachments for s in a.slots}
    return replace(free, theta=tuple(i for i in free.theta if i not in own))


def with_values_held(
    predictor: Predictor, starts: Sequence[Point], held: Free, tried: int
) -> list[tuple[float, Point]]:
    """Fit to the end what is free while the effects' values stay where they are seen."""
    best = fit_briefly(predictor, starts, held, tried)
    fit = None if best is None else fit_fully(predictor, best[1], held)
    return [] if fit is None else [(predictor.objective(fit.point), fit.point)]


def from_another_value(predictor: Predictor, fit: Fit, free: Free, attachments: Sequence[Attachment]) -> Fit:
    """Return the fit that begins where one value of an effect, another of its starts, is likelier at once.

    A value that acts on few rows has no slope elsewhere: beside the lower limit of a drive the upper one stood beyond
    all commands, and the sealed data, which reach it, refuted both (20 nats short, -199 nats there).
    """
    model, best, least = predictor.compiled.model, fit.point, predictor.objective(fit.point)
    for a in attachments:
        for slot in a.slots:
            values = {float(d[slot.name]) for d in (*a.grid, *a.starts) if slot.name in d}
            if slot.local or slot.name in a.fixed:
                continue
            moved = [shifted(fit.point, model, {slot.name: v}) for v in sorted(values)]
            tried = min(((predictor.objective(q), k) for k, q in enumerate(moved)), default=(np.inf, 0))
            if tried[0] < least - in_force().evidence.tied_nats:
                least, best = tried[0], moved[tried[1]]
    if best is fit.point:
        return fit
    again = fit_quietly(predictor, best, free)
    return fit if again is None or again.log_posterior <= fit.log_posterior else again


def with_limits_at_rest(predictor: Predictor, fit: Fit, free: Free, attachments: Sequence[Attachment]) -> Fit:
    """Return the fit with every limit where it never acts that the data do not need.

    A limit beyond what the fitted data reach has no slope and stays where it began, at the edge of them; other data go
    further. Of a cart's two stops one was touched by the fitted part; the other stood 9 % short of where it is, and the
    block that touched that one lost 947 nats, where four gained 300 to 430.
    """
    model, point = predictor.compiled.model, fit.point
    idle = {s.name: s.idle for a in attachments for s in a.slots if s.idle is not None and s.name not in a.fixed}
    for name, value in idle.items():
        moved = shifted(point, model, {name: value})
        if predictor.objective(moved) <= predictor.objective(point) + in_force().evidence.tied_nats:
            point = moved
    return fit if point is fit.point else predictor.at(point, free)
