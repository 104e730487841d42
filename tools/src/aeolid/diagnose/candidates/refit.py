"""Fit the best hypotheses fully and judge them on data not used for the fit (S5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.frame import carry_point
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate, at_bound
from aeolid.diagnose.candidates.lines import at_a_line
from aeolid.diagnose.candidates.moved import moved_in
from aeolid.diagnose.candidates.plausible import objection, undetermined, undriven, values_of, without_the_mute
from aeolid.diagnose.candidates.seen_values import (
    at_round_values,
    between_jumps,
    from_another_value,
    with_jump_deviations,
    with_limits_at_rest,
    with_values_held,
    without_values,
)
from aeolid.diagnose.candidates.simulation_starts import simulation_starts
from aeolid.diagnose.candidates.starts import starts_of
from aeolid.diagnose.data.exogenous import computed_inputs
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.predictor.explore import TRIED, core, explore, fit_briefly, fit_fully, fit_quietly
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Bank, Row, overlap

Array = NDArray[np.float64]
MAX_FINALISTS = 6
_FAMILIES = 10  # of which one is fitted, where so many speak
_STEPPED = 6  # further effects that are tried from finite steps once anything is found
_ZONES, _LOOPS, _SENSORS, _FRICTIONS = (
    2,
    1,
    2,
    2,
)  # dead zones, hysteretic forces, lags of sensors, dry frictions beside
_HELD = 20  # Gauss–Newton iterations with the noise held
_TRIED_ON_RUN = 2  # starts of each group: a run's model is near already, and each fit moves some 180 parameters
_AGAIN = 40  # Gauss–Newton iterations of a fit from a better baseline


def finalists(bank: Bank) -> list[Row]:
    """Choose what to fit: the best of each family over the threshold, look-alikes, and those without a score to go by.

    Families first: the score at the null ranks poorly where much is missing (of an OpenFAST run without its tower two
    bent springs, a drag and a shadow stood before the tower's own mode; a sensor that clips, worth 1,488 nats, was the
    seventh family of seven).
    """
    rules = in_force().candidates
    over = bank.loud
    chosen = [r for r in bank.rows if r.attachment.always_fit or r.attachment.shown]
    most = len(chosen) + MAX_FINALISTS
    families: set[str] = set()
    for row in over:
        family = entry(row.attachment.entry).family
        if family not in families and len(families) < _FAMILIES:
            families.add(family)
            chosen.append(row)
    for row in over:
        for peer in [row] + [r for r in bank.rows if overlap(row, r) > rules.alike_cos2]:
            if peer not in chosen and len(chosen) < most:
                chosen.append(peer)
    stepped = [r for r in bank.rows if r.attachment.stepped and r.testable and r not in chosen] if over else []
    stepped.sort(
        key=lambda r: entry(r.attachment.entry).family != "input_lag"
    )  # inputs are what free parameters absorb
    groups = (
        (zones_of(bank), _ZONES), (loops_of(bank), _LOOPS), (sensors_of(bank), _SENSORS),
        (frictions_of(bank), _FRICTIONS),
    )  # fmt: skip
    apart = [([r for r in rows if r in stepped], count) for rows, count in groups]
    others = [r for r in stepped if not any(r in rows for rows, _ in apart)]
    return chosen + others[:_STEPPED] + [r for rows, count in apart for r in rows[:count]]


def zones_of(bank: Bank) -> list[Row]:
    """List the dead zones: a narrow one takes a constant from large commands, which free values absorb."""
    return [r for r in bank.rows if r.attachment.stepped and entry(r.attachment.entry).family == "input_nonlinearity"]


def frictions_of(bank: Bank) -> list[Row]:
    """List the dry friction of a linear model's bodies: its noise takes it for a force with memory."""
    return [r for r in bank.rows if r.attachment.stepped and entry(r.attachment.entry).family == "friction"]


def loops_of(bank: Bank) -> list[Row]:
    """List the hysteretic forces tried from finite steps: of a slim loop free springs and dampers absorb the slope."""
    return [r for r in bank.rows if r.attachment.stepped and entry(r.attachment.entry).family == "hysteresis"]


def sensors_of(bank: Bank) -> list[Row]:
    """List the lags of sensors tried from finite steps: seven lags, delays and clocks of two inputs left none room."""
    return [r for r in bank.rows if r.attachment.stepped and r.attachment.entry == "sensor_lag"]


def free_with(base: Free, attachments: Sequence[Attachment], prepared: Prepared) -> Free:
    """Return the free set with the parameters, noise gains and start states of some attachments added."""
    model = prepared.extended
    states = [s.name for s in model.states]
    theta, noise, gain, x0 = list(base.theta), list(base.noise), list(base.gain), list(base.x0)
    for a in attachments:
        theta += [model.index(s.name) for s in a.slots if s.name not in a.fixed]
        if a.gain_states and not base.gain:
            noise.append(states.index(a.gain_states[-1]))
        for g in a.gain_states:
            gain += [(states.index(g), j) for j in range(len(model.outputs))] if base.gain else []
            x0.append(states.index(g))
        x0 += [states.index(s) for s in a.start_states]
    return Free(
        tuple(dict.fromkeys(theta)), tuple(dict.fromkeys(noise)), tuple(dict.fromkeys(gain)), tuple(dict.fromkeys(x0))
    )


@dataclass(frozen=True, eq=False)
class Begun:
    """Hold effects after brief fits: the stage, what is free, and where each group of starts led, best first."""

    prepared: Prepared
    base: Fit
    free: Free
    attachments: tuple[Attachment, ...]
    found: tuple[tuple[float, Point], ...]

    @property
    def gain(self) -> float:
        """Return how many nats the best brief fit is above the baseline."""
        return self.prepared.predictor.objective(self.base.point) - self.found[0][0]


def begin(prepared: Prepared, base: Fit, rows: Sequence[Row], simulated: bool = False) -> Begun | None:
    """Fit effects briefly together with the baseline, from several starts; None where every start diverges.

    The effects' values start from the score's estimate and from the entry's own starts, the rest from the fitted
    and from the declared baseline (a baseline fitted under the wrong structure may sit far from the truth). What the
    recording itself shows stays as it is seen at first: a sensor's end at -6.09, where 86 values lie, went to -5.95
    before the rest of the model had followed, 75 nats short. simulated: once more from where the simulation leads.
    """
    predictor, model = prepared.predictor, prepared.extended
    attachments = tuple(r.attachment for r in rows)
    free = free_with(base.free, attachments, prepared)
    found: list[tuple[float, Point]] = []
    for starts in starts_of(prepared, base, rows):
        if any(a.always_fit for a in attachments):  # the measurement itself changes: search anew
            effects = [model.index(s.name) for a in attachments for s in a.slots]
            starts += explore(predictor, starts[0], free, effects)
        if base.point.K is None and np.any(starts[0].noise < base.point.noise):
            starts = _with_noise_held(predictor, starts, free)
        tried = TRIED if prepared.surrogate is None else _TRIED_ON_RUN
        best = fit_briefly(predictor, starts, free, tried)
        found += [best] if best is not None else []
        if any(a.shown for a in attachments):
            found += with_values_held(predictor, starts, without_values(free, attachments, model), tried)
    far = fit_briefly(predictor, simulation_starts(prepared, base, rows, free), free, 1) if simulated else None
    found += [far] if far is not None else []
    found.sort(key=lambda pair: pair[0])
    return Begun(prepared, base, free, attachments, tuple(found)) if found else None


def finish(begun: Begun, baseline_select: Array, ahead: float = 0.0) -> Candidate | None:
    """Fit to the end what was begun, and judge the best of it; ahead: as in `judge`."""
    prepared, free, predictor = begun.prepared, begun.free, begun.prepared.predictor
    fits = [fit_fully(predictor, point, free) for _, point in begun.found]
    fit = best_of([f for f in fits if f is not None], begun.attachments, prepared, begun.base.point.theta)
    if fit is None:
        return None
    if prepared.surrogate is None:
        fit = from_another_value(predictor, fit, free, begun.attachments)
        fit = between_jumps(predictor, fit, free, begun.attachments)
        fit = at_round_values(predictor, fit, free, begun.attachments)
        fit = with_limits_at_rest(predictor, fit, free, begun.attachments)
    order = predictor.choose_var_order(fit.point)
    if order > (predictor.var_order or 0):  # a smaller noise model would count against the effect (20 nats, two tanks)
        predictor, fit = with_more_noise(predictor, order, fit, free)
    return judge(prepared, predictor, begun.base, fit, begun.attachments, baseline_select, ahead)


def with_more_noise(predictor: Predictor, order: int, fit: Fit, free: Free) -> tuple[Predictor, Fit]:
    """Fit with a noise model of higher order; returns that, or the best without it where it is not worth it."""
    larger = predictor.with_order(order)
    more = fit_quietly(larger, fit.point, free)
    if more is None:
        return predictor, fit
    chosen, found = with_least_noise(predictor, larger, more, free)
    return (chosen, found) if chosen is larger or found.log_posterior > fit.log_posterior else (predictor, fit)


def with_least_noise(least: Predictor, predictor: Predictor, fit: Fit, free: Free) -> tuple[Predictor, Fit]:
    """Fit on without the order by which a noise model is above `least`; returns the better, for what parameters cost.

    What a fit that stopped short leaves over looks like coloured noise. With that in the model it goes on, and where it
    ends may need no such noise: a mass that was 10 % off gained 74.1 nats with nine values more for the noise, 64.9
    without, where they cost 38, and a sensor's factor of 63.0 nats had the name.
    """
    if (predictor.var_order or 0) <= (least.var_order or 0):
        return predictor, fit
    back = fit_quietly(least, fit.point, free)
    if back is None:
        return predictor, fit
    cost = 0.5 * float(np.log(len(fit.per_sample))) * (len(fit.jacobian.T) - len(back.jacobian.T))
    return (predictor, fit) if fit.log_posterior - cost > back.log_posterior else (least, back)


def best_of(fits: Sequence[Fit], attachments: Sequence[Attachment], prepared: Prepared, before: Array) -> Fit | None:
    """Return the most likely fit; of those within a nat of it the one with the fewest values at the end of their range.

    Where the data leave a ridge, rounding chose: of a tank whose level nobody measured, brims of 10.5 and 4.1 V (its
    spill then thrice what was spilt, the most that can be) were 0.002 nats apart. Of fits on one ridge the effects'
    values that moved least from `before` (np,) are taken.
    """
    rules = in_force().candidates
    evidence = in_force().evidence
    slots = [s for a in attachments for s in a.slots]
    places = [prepared.extended.index(s.name) for s in slots]
    width = np.array([s.high - s.low for s in slots])
    most = max((f.log_posterior for f in fits), default=0.0)
    near = [f for f in fits if f.log_posterior > most - evidence.tied_nats]
    ends = [sum(at_bound(float(f.point.theta[i]), s) for i, s in zip(places, slots, strict=True)) for f in near]
    inside = [f for f, e in zip(near, ends, strict=True) if e == min(ends)]
    most = max((f.log_posterior for f in inside), default=0.0)
    ridge = [f for f in inside if f.log_posterior > most - rules.ridge_nats]
    moved = [float(np.sum(((f.point.theta - before)[places] / width) ** 2)) for f in ridge]
    return min(zip(moved, range(len(ridge)), ridge, strict=True), default=(0.0, 0, None))[2]


def refit(
    prepared: Prepared, base: Fit, rows: Sequence[Row], baseline_select: Array, ahead: float = 0.0,
    simulated: bool = False,
) -> Candidate | None:  # fmt: skip
    """Fit baseline and effects together from several starts; None where every start diverges.

    ahead: as in `judge`; simulated: as in `begin`.
    """
    begun = begin(prepared, base, rows, simulated)
    return None if begun is None else finish(begun, baseline_select, ahead)


def left_behind(begun: Begun, reason: str, baseline_select: Array) -> Candidate:
    """Return the candidate that a brief fit makes, refused for a reason."""
    predictor = begun.prepared.predictor
    fit = predictor.at(begun.found[0][1], begun.free)
    found = judge(begun.prepared, predictor, begun.base, fit, begun.attachments, baseline_select)
    return replace(found, plausible=False, complete=False, reason=f"not fitted to the end: {reason}")


def _with_noise_held(predictor: Predictor, starts: Sequence[Point], free: Free) -> list[Point]:
    """Fit what physics there is before the noise may move: else it grows back to what it was at once."""
    physics = replace(core(predictor, free), noise=())
    likely = sorted(starts, key=predictor.objective)[:TRIED]
    fits = [predictor.fit(s, physics, iterations=_HELD) for s in likely]
    return [f.point for f in fits if f is not None] or list(starts)


def renewed(prepared: Prepared, candidate: Candidate, baseline_select: Array) -> Candidate:
    """Fit a candidate once more, its effect put into another fit of the baseline, and on from where it stands.

    Returns the best, itself where nothing gains: the baseline's noise may lead into another optimum (13 nats short).
    Where the better baseline has a smaller noise model, it is judged anew in any case.
    """
    if not candidate.complete:
        return candidate
    stage, old = prepared.only(candidate.attachments), candidate.predictor.compiled.model
    start, model = stage.fit.point, stage.extended
    theta, noise = start.theta.copy(), start.noise.copy()
    for a in candidate.attachments:
        for s in a.slots:
            theta[model.index(s.name)] = candidate.fit.point.theta[old.index(s.name)]
    own, before = [s.name for s in model.states], [s.name for s in old.states]
    for state in (g for a in candidate.attachments for g in a.gain_states):
        noise[own.index(state)] = candidate.fit.point.noise[before.index(state)]
    predictor = stage.predictor.with_order(candidate.predictor.var_order or 0)
    free = free_with(stage.fit.free, candidate.attachments, stage)
    starts = replace(start, theta=theta, noise=noise), carry_point(candidate.fit.point, old, model)
    fits = [fit_quietly(predictor, s, free, iterations=_AGAIN) for s in starts]
    fit = max((f for f in fits if f is not None), key=lambda f: f.log_posterior, default=None)
    own_order = (predictor.var_order or 0) <= (stage.predictor.var_order or 0)
    if fit is None or (own_order and fit.log_posterior <= candidate.fit.log_posterior):
        return candidate
    predictor, fit = with_least_noise(stage.predictor, predictor, fit, free)
    return judge(stage, predictor, stage.fit, fit, candidate.attachments, baseline_select)


def judge(
    prepared: Prepared, predictor: Predictor, base: Fit, fit: Fit, attachments: tuple[Attachment, ...],
    baseline_select: Array, ahead: float = 0.0,
) -> Candidate:  # fmt: skip
    """Score a fitted candidate on the selection data and check that its values are physical.

    ahead: nats by which `base` explains more than the model without these effects, where it is a fit of others.
    """
    select = predictor.score_elsewhere(fit, prepared.split.select)[0]
    difference = np.where(np.isfinite(select), select, -1e6) - baseline_select
    model, gain = prepared.extended, fit.log_posterior - base.log_posterior
    parameters = len(fit.jacobian.T) - len(base.jacobian.T)
    fit = with_jump_deviations(predictor, without_the_mute(attachments, fit, model), attachments)
    values = {a.key: values_of(a, fit, model) for a in attachments}
    reason, alone = objection(attachments, fit, model, ahead + gain, parameters), undriven(attachments, fit, model)
    reason = reason or at_a_line(values, predictor.segments, computed_inputs(model, prepared.exogenous))
    own = {s.name for a in attachments for s in a.slots}
    moved = tuple(m for m in moved_in(prepared.declared, model, fit) if m.parameter.name not in own)
    return Candidate(
        attachments, without_slopes(fit), predictor, gain, float(difference.sum()), parameters, fit.per_sample,
        difference, values,
        not (reason or alone), reason or alone, undriven=bool(alone and not reason),
        undetermined=undetermined(attachments, fit, model), moved=moved,
    )  # fmt: skip


def without_slopes(fit: Fit) -> Fit:
    """Return a fit without its sensitivities: 20 to 60 MB of a simulator's run, and a view would keep them."""
    return replace(fit, jacobian=np.zeros((0, fit.jacobian.shape[1])))


def as_rows(found: Candidate) -> list[Row]:
    """Present fitted effects as rows whose start values are the fitted ones."""
    model, rows = found.predictor.compiled.model, []
    for attachment in found.attachments:
        values = {s.name: float(found.fit.point.theta[model.index(s.name)]) for s in attachment.slots}
        single = replace(attachment, starts=({},), always_fit=False)
        rows.append(Row(single, 0.0, 0.0, 0, 1.0, {}, values, {}, {}, None, True))
    return rows
