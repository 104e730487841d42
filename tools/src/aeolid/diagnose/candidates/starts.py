"""Say where the fits of effects start: values, gains and noise of the baseline and of the effects (S5)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from aeolid.diagnose.baseline.prepare import Prepared, riccati_gains
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Point, shifted
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Row
from aeolid.diagnose.structure.baseline import noisy_states
from aeolid.diagnose.structure.forces import FORCE
from aeolid.models.integrate import output_jacobian
from aeolid.models.state_space import StateSpace

_QUIET, _SILENT = 0.1, 0.01  # what is left of it, and of forces with a memory


def turns(attachment: Attachment) -> bool:
    """Tell whether an effect turns the phase, sign, size or place of what a free gain was fitted to."""
    kind = entry(attachment.entry)
    return kind.turns or (kind.bends and attachment.stepped)


def starts_of(prepared: Prepared, base: Fit, rows: Sequence[Row]) -> list[list[Point]]:
    """Return groups of points to start from, the effects' values in them; each group gets fits of its own.

    Of a linear model one group has gains chosen anew for the outputs as the effect leaves them. A free gain that was
    fitted without it takes the effect for noise: no small step leads from there, and it looks better at first than all
    that do (a unit of 57.3 ended at 10.4, 2200 nats short; a drive of 8 rad/s stayed at the start it was given; of two
    swapped channels, z 48, no start held). A drag, 45 nats for 224, acted on a state that such a gain corrected by 19
    times the error and a disturbance took back, and diverged on the selection data.
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
    declared = replace(base.point, theta=prepared.extended.theta)
    turned = [_with_values(prepared, declared, option) for option in options]
    anew = [s for start in turned for s in with_gains_anew(prepared, linear, start)]
    return [*groups, anew] if anew else groups


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
    gained 68 nats under it, 205 from a quiet start), white or with a memory; or as on a simulator's own run.
    """
    rules = in_force().candidates
    declared = replace(base.point, theta=prepared.extended.theta)
    if prepared.linear is None or base.point.K is None:
        noise = base.point.noise.copy()
        loud = [i for i in noisy_states(prepared.declared) if noise[i] > rules.loud_sizes]
        forces = [i for i, s in enumerate(prepared.extended.states) if s.name.startswith(FORCE)]
        most = rules.loud_sizes if any(turns(a) for a in attachments) else rules.loud_force_sizes
        if not loud and not np.any(noise[forces] > most):
            return [[base.point, declared]]
        noise[loud], noise[forces] = _QUIET, np.minimum(noise[forces], _SILENT)
        return [[base.point, declared], [replace(declared, noise=noise)]]
    run = prepared.frame.as_run(prepared.extended, base.point.x0)
    if run is None:
        return [[base.point]]
    found = [prepared.extended.index(s.name) for a in attachments for s in a.slots]
    theta = run.theta.copy()
    theta[found] = base.point.theta[found]
    return [[base.point], [replace(run, theta=theta)]]


def _starts(row: Row) -> list[dict[str, float]]:
    """Return values to start from: the score's estimate, the entry's own, and the null (a step off a bound)."""
    slots = {s.name: s for s in row.attachment.slots}
    guess = dict(row.grid) | {n: v for n, v in row.estimate.items() if n in slots}
    options = [guess | dict(start) for start in row.attachment.starts]
    options += [dict(grid) | {n: v for n, v in found.items() if n in slots} for grid, found in row.others]
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
