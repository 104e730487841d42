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

_SMALLEST = 1e-300  # value of which there are round numbers, and the inverse of the largest
_DISTANCES = 40  # at which a value is looked at to either side, from a millionth of its range to all of it


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


def between_jumps(predictor: Predictor, fit: Fit, free: Free, attachments: Sequence[Attachment]) -> Fit:
    """Return the fit from the likeliest of many values near those on which the model's answer depends in jumps.

    A valve that sticks moves when its command has left it by a band. A band that is a little off moves it a sample
    earlier or later, from another place, and every later move with it: the likelihood is rugged and no slope tells
    more than the place of the last jump. With a band of 2 % (1200 samples) a fit from the best of 24 values ended at
    1.86 %, 166 nats short. Cost: 2 × 129 filter passes a value, and a fit where one is likelier.
    """
    rules, model = in_force().candidates, predictor.compiled.model
    for slot in (s for a in attachments for s in a.slots if s.jumps and s.name not in a.fixed):
        for span in (rules.jump_span, rules.jump_span**2):
            value, least = float(fit.point.theta[model.index(slot.name)]), predictor.objective(fit.point)
            near = value * (1 + span * np.linspace(-1, 1, rules.jump_values))
            moved = [shifted(fit.point, model, {slot.name: float(v)}) for v in near if slot.low < v < slot.high]
            reached = [(predictor.objective(q), k) for k, q in enumerate(moved)]
            best, k = min(reached, default=(np.inf, 0))
            if best < least - in_force().evidence.tied_nats:
                again = fit_quietly(predictor, moved[k], free)
                fit = again if again is not None and again.log_posterior > fit.log_posterior else fit
    return fit


def at_round_values(predictor: Predictor, fit: Fit, free: Free, attachments: Sequence[Attachment]) -> Fit:
    """Return the fit at the roundest of such values that fits no worse: levels and bands are chosen by people.

    Between two jumps only its product with a gain is seen, so that a value moves until the gain stands where it was
    declared. With levels of 0.5 V and a gain 5 % off the training data said 0.507; 0.5 fits them as well, and the
    validation data, where other commands lie next to a jump, 23 nats better. Cost: three fits a value at the most.
    """
    rules, model, tied = in_force().candidates, predictor.compiled.model, in_force().evidence.tied_nats
    for slot in (s for a in attachments for s in a.slots if s.jumps and s.name not in a.fixed):
        index = model.index(slot.name)
        value = float(fit.point.theta[index])
        held = replace(free, theta=tuple(i for i in free.theta if i != index))
        for near in rounded(value):
            if abs(near - value) > rules.jump_span * abs(value) or not slot.low < near < slot.high:
                continue
            again = fit_quietly(predictor, shifted(fit.point, model, {slot.name: near}), held)
            if again is not None and again.log_posterior > fit.log_posterior - tied:
                fit = predictor.at(again.point, free)
                break
    return fit


def rounded(value: float) -> list[float]:
    """Return the nearest numbers of one digit, of one and a half and of two, roundest first.

    None for zero, and where a tenth of a digit or ten times the value is no number any more.

    >>> rounded(0.507), rounded(-14.0), rounded(0.0)
    ([0.5, 0.51], [-10.0, -15.0, -14.0], [])
    """
    if not _SMALLEST < abs(value) < 1 / _SMALLEST:
        return []
    digit = int(np.floor(np.log10(abs(value))))
    steps = [10.0**digit, 5 * 10.0 ** (digit - 1), 10.0 ** (digit - 1)]
    return list(dict.fromkeys(round(round(value / s) * s, 2 - digit) for s in steps))


def with_jump_deviations(predictor: Predictor, fit: Fit, attachments: Sequence[Attachment]) -> Fit:
    """Return the fit with deviations of values on which the answer depends in jumps.

    Half of the farther of the two distances from which on the fit is two nats worse, all else as it is: of a value with
    a slope this is its deviation. Infinite where nothing within its range is worse. Cost: 2 × 40 filter passes a value.
    """
    model, found = predictor.compiled.model, []
    least = predictor.objective(fit.point) + in_force().evidence.two_deviations_nats
    for slot in (s for a in attachments for s in a.slots if s.jumps and s.name not in a.fixed):
        index = model.index(slot.name)
        value, reach = float(fit.point.theta[index]), 0.0
        for way in (-1.0, 1.0):
            ends = (value + way * d for d in np.geomspace(1e-6, 1.0, _DISTANCES) * (slot.high - slot.low))
            inside = (end for end in ends if slot.low <= end <= slot.high)
            worse = (e for e in inside if predictor.objective(shifted(fit.point, model, {slot.name: e})) > least)
            reach = max(reach, abs(next(worse, np.inf) - value))
        if index in fit.free.theta:
            found.append((index, 0.5 * reach))
    return replace(fit, jumps=tuple(found)) if found else fit


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
