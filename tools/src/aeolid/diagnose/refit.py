"""Fit the best hypotheses fully and judge them on data not used for the fit (S5)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from aeolid.diagnose.baseline import noisy_states
from aeolid.diagnose.candidate import Candidate
from aeolid.diagnose.catalogue import entry
from aeolid.diagnose.catalogue.base import Attachment
from aeolid.diagnose.explore import TRIED, core, explore, fit_briefly, fit_fully
from aeolid.diagnose.frame import carry_point
from aeolid.diagnose.plausible import objection, undetermined, undriven, values_of, without_the_mute
from aeolid.diagnose.point import Free, Point
from aeolid.diagnose.predictor import Fit, Predictor
from aeolid.diagnose.prepare import Prepared, riccati_gains
from aeolid.diagnose.scores import Bank, Row, overlap, shifted
from aeolid.models.integrate import output_jacobian
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
MAX_FINALISTS = 6
_STEPPED = 6  # further effects that are tried from finite steps once anything is found
_TURNING = {
    "actuator_lag", "actuator_second_order", "transport_delay", "data_time_offset", "sensor_lag",
    "sensor_second_order", "sensor_scale", "sensor_sign", "data_channel_swap",
}  # effects that turn what the gain was fitted to, in phase, sign, size or place  # fmt: skip
_BENDING = {"blade_flap", "blade_edge"}  # where they pass a load on later (stepped), not where a mode is driven
_LOUD = 0.3  # process noise, in sizes of its state, that a sample brings: it stands in for what is missing
_QUIET = 0.1
_LOST = 0.1  # nats a sample and output below the baseline, from which a start does not come back
_HELD = 20  # Gauss–Newton iterations with the noise held
_TRIED_ON_RUN = 2  # starts of each group: a run's model is near already, and each fit moves some 180 parameters
_AGAIN = 40  # Gauss–Newton iterations of a fit from a better baseline
ALIKE = 0.9  # cos² from which two hypotheses must both be fitted: the score cannot tell them apart


def finalists(bank: Bank) -> list[Row]:
    """Choose what to fit: the best of each family over the threshold, look-alikes, and those without a score to go by.

    Families first: the score at the null ranks poorly where much is missing (of an OpenFAST run without its tower two
    bent springs, a drag and a shadow stood before the tower's own mode).
    """
    over = [r for r in bank.rows if r.z > bank.threshold]
    chosen = [r for r in bank.rows if r.attachment.always_fit]
    most = len(chosen) + MAX_FINALISTS
    families: set[str] = set()
    for row in over:
        family = entry(row.attachment.entry).family
        if family not in families and len(chosen) < most:
            families.add(family)
            chosen.append(row)
    for row in over:
        for peer in [row] + [r for r in bank.rows if overlap(row, r) > ALIKE]:
            if peer not in chosen and len(chosen) < most:
                chosen.append(peer)
    stepped = [r for r in bank.rows if r.attachment.stepped and r.testable and r not in chosen] if over else []
    stepped.sort(
        key=lambda r: entry(r.attachment.entry).family != "input_lag"
    )  # inputs are what free parameters absorb
    return chosen + stepped[:_STEPPED]


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


def begin(prepared: Prepared, base: Fit, rows: Sequence[Row]) -> Begun | None:
    """Fit effects briefly together with the baseline, from several starts; None where every start diverges.

    The effects' values start from the score's estimate and from the entry's own starts, the rest from the fitted
    and from the declared baseline (a baseline fitted under the wrong structure may sit far from the truth).
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
    found.sort(key=lambda pair: pair[0])
    begun = Begun(prepared, base, free, attachments, tuple(found))
    return _without_the_lost(begun) if found else None


def _without_the_lost(begun: Begun) -> Begun:
    """Leave out, on a simulator's run, starts that a brief fit leaves far below the bare baseline.

    Only where another start got above it. From a run's own gains a fit of 180 parameters takes 40 iterations to come
    back from 20,000 nats below, and came out below the other in 10 of 12 cases. Not with other baselines: gains chosen
    anew for a wrong sign or unit look worse at first than all else.
    """
    if begun.prepared.surrogate is None or begun.gain <= 0:
        return begun
    limit = begun.found[0][0] + begun.gain + _LOST * len(begun.base.residual)
    return replace(begun, found=tuple(f for f in begun.found if f[0] < limit))


def finish(begun: Begun, baseline_select: Array) -> Candidate | None:
    """Fit to the end what was begun, and judge the best of it."""
    prepared, free, predictor = begun.prepared, begun.free, begun.prepared.predictor
    fits = [fit_fully(predictor, point, free) for _, point in begun.found]
    fit = max((f for f in fits if f is not None), key=lambda f: f.log_posterior, default=None)
    if fit is None:
        return None
    order = predictor.choose_var_order(fit.point)
    if order > (predictor.var_order or 0):  # a smaller noise model would count against the effect (20 nats, two tanks)
        predictor = predictor.with_order(order)
        fit = predictor.fit(fit.point, free)
    return None if fit is None else judge(prepared, predictor, begun.base, fit, begun.attachments, baseline_select)


def refit(prepared: Prepared, base: Fit, rows: Sequence[Row], baseline_select: Array) -> Candidate | None:
    """Fit baseline and effects together from several starts; None where every start diverges."""
    begun = begin(prepared, base, rows)
    return None if begun is None else finish(begun, baseline_select)


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
    fits = [predictor.fit(s, free, iterations=_AGAIN) for s in starts]
    fit = max((f for f in fits if f is not None), key=lambda f: f.log_posterior, default=None)
    if fit is None or fit.log_posterior <= candidate.fit.log_posterior:
        return candidate
    return judge(stage, predictor, stage.fit, fit, candidate.attachments, baseline_select)


def turns(attachment: Attachment) -> bool:
    """Tell whether an effect turns the phase, sign, size or place of what a free gain was fitted to."""
    return attachment.entry in _TURNING or (attachment.entry in _BENDING and attachment.stepped)


def starts_of(prepared: Prepared, base: Fit, rows: Sequence[Row]) -> list[list[Point]]:
    """Return groups of points to start from, the effects' values in them; each group gets fits of its own.

    Where an effect turns the phase, sign or size of a channel, or its place, one group has gains chosen anew for the
    outputs as the effect leaves them: a free gain that was fitted to such a channel believes the model nothing and ends
    where the predictor just forgets; no small step leads from there, and it looks better at first than all that do (a
    unit of 57.3 ended at 10.4, 2200 nats short; a drive of 8 rad/s stayed at the start it was given; of two swapped
    channels, z 48, no start held).
    """
    options = list(itertools.product(*(_starts(r) for r in rows)))
    groups: list[list[Point]] = []
    for group in _origins(prepared, base, [r.attachment for r in rows]):
        starts: list[Point] = []
        for origin, option in itertools.product(group, options):
            start = _with_values(prepared, origin, option)
            starts.append(_with_gains(start, rows, prepared))
            if start.K is not None and any(r.gain_estimate for r in rows):
                starts.append(start)  # the score's one step in the gain may leave the stable region
        groups.append(starts)
    linear = prepared.linear
    if linear is None or base.point.K is None or prepared.surrogate is not None:
        return groups
    if any(turns(r.attachment) for r in rows):
        declared = replace(base.point, theta=prepared.extended.theta)
        turned = [_with_values(prepared, declared, option) for option in options]
        anew = [s for start in turned for s in with_gains_anew(prepared, linear, start)]
        groups += [anew] if anew else []
    return groups


def _with_values(prepared: Prepared, origin: Point, option: Sequence[dict[str, float]]) -> Point:
    merged = {k: v for o in option for k, v in o.items()}
    return shifted(origin, prepared.extended, _clip(merged, prepared.predictor, prepared))


def with_gains_anew(prepared: Prepared, linear: StateSpace, start: Point) -> list[Point]:
    """Return the start with Kalman gains for its own outputs, over a ladder of noise ratios; nothing where none move.

    An output that a filter delays moves with none of the states at once: it counts as it is without the effect. Nothing
    for a model that is not stable: how far its outputs move is not known.
    """
    if np.max(np.abs(np.linalg.eigvals(linear.A)), initial=0.0) >= 1 - 1e-9:
        return []
    at_rest = np.zeros(len(prepared.extended.inputs))
    C = output_jacobian(prepared.predictor.compiled, start.x0[0], at_rest, start.theta)[:, : linear.order]
    seen = np.all(np.isfinite(C), axis=1) & np.any(C != 0, axis=1)
    turned = replace(linear, C=np.where(seen[:, None], C, linear.C))
    covariance = solve_discrete_lyapunov(linear.A, linear.B @ linear.B.T)
    spreads = np.sqrt(np.diag(turned.C @ covariance @ turned.C.T + linear.D @ linear.D.T))
    if not np.all(spreads > 0):
        return []
    assert start.K is not None
    rest = np.zeros((len(start.K) - linear.order, len(spreads)))
    return [replace(start, K=np.vstack([K, rest])) for K in riccati_gains(turned, spreads)]


def _origins(prepared: Prepared, base: Fit, attachments: Sequence[Attachment]) -> list[list[Point]]:
    """Return groups of points where the baseline's own values start from.

    As fitted and as declared, once more without the process noise that took the effect's place (two overflowing tanks
    gained 68 nats under it, 205 from a quiet start); or as on a simulator's own run.
    """
    declared = replace(base.point, theta=prepared.extended.theta)
    if prepared.linear is None or base.point.K is None:
        loud = [i for i in noisy_states(prepared.declared) if base.point.noise[i] > _LOUD]
        noise = base.point.noise.copy()
        noise[loud] = _QUIET
        return [[base.point, declared], *([[replace(declared, noise=noise)]] if loud else [])]
    run = prepared.frame.as_run(prepared.extended, base.point.x0)
    if run is None:
        return [[base.point]]
    found = [prepared.extended.index(s.name) for a in attachments for s in a.slots]
    theta = run.theta.copy()
    theta[found] = base.point.theta[found]
    return [[base.point], [replace(run, theta=theta)]]


def judge(
    prepared: Prepared, predictor: Predictor, base: Fit, fit: Fit, attachments: tuple[Attachment, ...],
    baseline_select: Array,
) -> Candidate:  # fmt: skip
    """Score a fitted candidate on the selection data and check that its values are physical."""
    select = predictor.score_elsewhere(fit, prepared.split.select)[0]
    difference = np.where(np.isfinite(select), select, -1e6) - baseline_select
    model, gain = prepared.extended, fit.log_posterior - base.log_posterior
    parameters = len(fit.jacobian.T) - len(base.jacobian.T)
    fit = without_the_mute(attachments, fit, model)
    values = {a.key: values_of(a, fit, model) for a in attachments}
    reason, alone = objection(attachments, fit, model, gain, parameters), undriven(attachments, fit, model)
    light = replace(fit, jacobian=np.zeros((0, fit.jacobian.shape[1])))  # 20 to 60 MB of a run's; a view would keep it
    return Candidate(
        attachments, light, predictor, gain, float(difference.sum()), parameters, difference, values,
        not (reason or alone), reason or alone, undriven=bool(alone and not reason),
        undetermined=undetermined(attachments, fit, model),
    )  # fmt: skip


def _starts(row: Row) -> list[dict[str, float]]:
    """Return values to start from: the score's estimate, the entry's own, and the null (a step off a bound)."""
    slots = {s.name: s for s in row.attachment.slots}
    guess = dict(row.grid) | {n: v for n, v in row.estimate.items() if n in slots}
    options = [guess | dict(start) for start in row.attachment.starts]
    null = {n: s.null + (s.size if s.low == s.null else 0.0) for n, s in slots.items() if s.local}
    options.append(dict(row.grid) | null)
    for name, slot in slots.items():
        if slot.local and slot.low == slot.null and options[0].get(name, slot.null) <= slot.null:
            options[0][name] = slot.size
    return [o | dict(row.attachment.fixed) for o in options]


def _clip(values: dict[str, float], predictor: Predictor, prepared: Prepared) -> dict[str, float]:
    model, scales = prepared.extended, predictor.scales
    return {k: float(np.clip(v, scales.low[model.index(k)], scales.high[model.index(k)])) for k, v in values.items()}


def _with_gains(point: Point, rows: Sequence[Row], prepared: Prepared) -> Point:
    states = [s.name for s in prepared.extended.states]
    K, noise = None if point.K is None else point.K.copy(), point.noise.copy()
    for row in rows:
        for (state, output), value in row.gain_estimate.items():
            if K is not None:
                K[states.index(state), output] = value
            else:
                noise[states.index(state)] = np.sqrt(max(value, 1e-6))
    return replace(point, K=K, noise=noise)


def as_rows(found: Candidate) -> list[Row]:
    """Present fitted effects as rows whose start values are the fitted ones."""
    model, rows = found.predictor.compiled.model, []
    for attachment in found.attachments:
        values = {s.name: float(found.fit.point.theta[model.index(s.name)]) for s in attachment.slots}
        single = replace(attachment, starts=({},), always_fit=False)
        rows.append(Row(single, 0.0, 0.0, 0, 1.0, {}, values, {}, {}, None, True))
    return rows
