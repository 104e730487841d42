"""Build the extended model, its scales and the fitted baseline predictor (S1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.baselines import Baseline, baseline_of
from aeolid.diagnose.baseline.frame import Frame, carry_fit, carry_point, carry_prior, scales_of
from aeolid.diagnose.baseline.integration import well_integrated
from aeolid.diagnose.baseline.recorded_wind import (
    SIZES,
    recorded_wind,
    smoothed_readings,
    smoothed_wind,
    with_smoothed_wind,
)
from aeolid.diagnose.baseline.ridges import values_to_hold, with_held
from aeolid.diagnose.baseline.simulated import Surrogate
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.exogenous import Exogenous, exogenous_channels, with_exogenous
from aeolid.diagnose.data.intersample import Sampling, declared_sampling, with_sampling
from aeolid.diagnose.data.range_ends import blurred_ends, rails
from aeolid.diagnose.data.resample import factor_for
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.data.split import Split, split_sparsely
from aeolid.diagnose.deadline import Deadline, unlimited
from aeolid.diagnose.hypotheses.catalogue import ENTRIES
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, told_apart
from aeolid.diagnose.predictor.awake import awakened, with_forces_awake
from aeolid.diagnose.predictor.explore import explore, fit_best, fit_quietly, noise_ladder
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point, Scales
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.predictor.riccati import steady_gain
from aeolid.diagnose.structure.anatomy import Motion, motions_of_equations, motions_of_state_space
from aeolid.diagnose.structure.baseline import mass_of, noisy_states, offset_sizes, shape_forces
from aeolid.diagnose.structure.between import motions_between
from aeolid.diagnose.structure.bodies import bodies_of_state_space
from aeolid.diagnose.structure.forces import FORCE
from aeolid.diagnose.structure.magnitudes import visible_sizes
from aeolid.diagnose.structure.signals import motions_of_signals
from aeolid.diagnose.structure.sums import written_out
from aeolid.errors import NotIdentifiable
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations
from aeolid.models.integrate import Compiled, compile_equations, numeric_jacobian
from aeolid.models.state_space import StateSpace
from aeolid.record import Record

Array = NDArray[np.float64]
_LEAST = 0.01  # of the size at which a state shows: states that rest are taken to move as much


@dataclass(frozen=True, eq=False)
class Prepared:
    """Hold the stage for all later steps: the model, its predictor, data and baseline fit.

    hypotheses: all that the catalogue offers for this model; attachments: those of them that are in the model, at their
    nulls or as fitted. records: the recordings as the model takes them, at its rate and with every channel it may use.
    sampling: how the inputs go on between their samples. fastest: the baseline's fastest rate, 1/s, 0 where unknown.
    """

    declared: Equations
    linear: StateSpace | None
    frame: Frame
    predictor: Predictor
    split: Split
    hypotheses: tuple[Attachment, ...]
    attachments: tuple[Attachment, ...]
    exogenous: tuple[Exogenous, ...]
    motions: tuple[Motion, ...]
    free: Free
    fit: Fit
    settle_s: float
    decimation: int
    run: Record | None
    site: Site
    records: tuple[Record, ...] = ()
    sampling: Sampling = field(default_factory=Sampling)
    fastest: float = 0.0

    @property
    def extended(self) -> Equations:
        """Return the model with the effects in question."""
        return self.predictor.compiled.model

    @property
    def deadline(self) -> Deadline:
        """Return the deadline that all fits on this stage keep to."""
        return self.frame.deadline

    @property
    def surrogate(self) -> Surrogate | None:
        """Return what a simulator's run as the baseline knows."""
        return self.frame.surrogate

    def only(self, attachments: Sequence[Attachment]) -> Prepared:
        """Return the same stage with just these effects in the model; data, prior and baseline fit are the same."""
        predictor, free, _ = self.frame.extend(attachments, self.predictor.segments)
        model = predictor.compiled.model
        prior = carry_prior(self.predictor.scales.prior, self.extended, model)
        predictor = predictor.with_order(self.predictor.var_order or 0).informed(prior)
        fit = carry_fit(self.fit, self.extended, model)
        return replace(self, predictor=predictor, attachments=tuple(attachments), free=free, fit=fit)

    def carried(self, point: Point, source: Equations) -> Point:
        """Return a point of another model on this stage's; what is held here has its own value again."""
        own = carry_point(point, source, self.extended)
        theta, free = self.fit.point.theta.copy(), list(self.free.theta)
        theta[free] = own.theta[free]
        return replace(own, theta=theta)


def prepare(
    case: Case, most: int | None = None, deadline: Deadline | None = None, sampling: Sampling | None = None
) -> Prepared:
    """Bring the baseline into predictor form, fit what is free, ask every catalogue entry where it could attach.

    most: samples that one prediction spans at most, where it is not for this function to choose. deadline: when all
    fits on this stage end where they stand, never by default. sampling: how inputs go on between their samples, as the
    roles file declares by default.
    """
    base = baseline_of(case, deadline := deadline or unlimited())
    records, step = with_smoothed_wind(base.records, base.equations), base.records[0].sample_time_s
    sampling = sampling or declared_sampling(records, _acting(base))
    declared, linear = with_sampling(base.equations, sampling, step), base.linear
    compiled = compile_equations(declared)
    outputs, exogenous = [o.name for o in declared.outputs], exogenous_channels(records, declared)
    given = (*exogenous, *smoothed_wind(records))
    names = [s.name for s in declared.inputs] + [c.name for c in given]
    settle, fastest = _time_scales(compiled, np.vstack([r.columns(names) for r in records]), step)
    factor = _factor(fastest, declared, records, most) if linear is None else 1
    r, d = base.inputs, len(declared.inputs)
    split, factor = split_sparsely(records, names[:r], outputs, settle, factor, names[r:], case.around)
    u, y = (np.vstack([getattr(s, part) for s in split.fit]) for part in ("u", "y"))
    spreads = _spread(y, outputs, case)
    offsets = {} if linear is None else offset_sizes(u[:, : len(linear.inputs)], spreads)
    known = spreads, offsets
    split, (rough, scales) = well_integrated(split, lambda parts: _rough(compiled, parts, known, linear, settle))
    if isinstance(case.baseline, Equations) and (held := values_to_hold(*rough, case.baseline)):
        return prepare(replace(case, baseline=with_held(case.baseline, held)), most, deadline, sampling)
    sizes, rates, moves, away = _sizes(rough, scales)
    typical = sizes, rates, spreads, moves
    motions, bodies, working, forces = _anatomy(declared, linear, typical, (split, settle), (exogenous, records[0]))
    declared = with_sampling(base.bare(working.auxiliaries), sampling, step)
    site = Site(
        working, linear, motions, step, step * factor, u[:, :r], y, tuple(names[:r]), tuple(outputs),
        working.symbols[:r], exogenous, u[:, d : d + len(exogenous)], case.context, _rails(records, outputs), bodies,
        smoothed_readings(records, u[:, d + len(exogenous) :]), records[0].channels,
    )  # fmt: skip
    attachments = told_apart([a for e in (*ENTRIES, unlisted.ENTRY) for a in e.attach(site)])
    frame = Frame(
        with_exogenous(working, given), rough[1], sizes, spreads, away, forces, offsets | SIZES, base.surrogate,
        recorded_wind(working, given), deadline,
    )  # fmt: skip
    predictor, free, start = frame.extend((), split.fit)
    starts = [p for p in (start, frame.as_run(predictor.compiled.model, start.x0)) if p is not None]
    predictor, fit = _fit_baseline(predictor, free, starts, case)
    return Prepared(
        declared, linear, frame, predictor, split, attachments, (), exogenous, motions, free, fit, settle, factor,
        base.run, site, tuple(records), sampling, fastest,
    )  # fmt: skip


def _factor(fastest: float, model: Equations, records: Sequence[Record], most: int | None) -> int:
    """Return how many samples one prediction spans, at most `most`; fastest: rate of the model, 1/s.

    One where an output follows an input at once: that answer is no slower than the rows, and all of them tell of it.
    """
    if any(ex.names_in(written_out(o.equation, model)) & set(model.symbols) for o in model.outputs):
        return 1
    found = factor_for(fastest, records[0].sample_time_s, sum(len(r) for r in records))
    return min(found, most or found)


def _acting(base: Baseline) -> list[str]:
    """Return the inputs that may be read otherwise than held: none of a model that was fitted to a simulator's run."""
    return [s.name for s in base.equations.inputs[: base.inputs]] if base.surrogate is None else []


def _rails(records: Sequence[Record], outputs: Sequence[str]) -> tuple[dict[str, float], ...]:
    """Return the ends of the range at which each output's values pile up, over all recordings."""
    columns = (np.concatenate([r.column(name) for r in records]) for name in outputs)
    finite = (c[np.isfinite(c)] for c in columns)
    return tuple(rails(c) or blurred_ends(c) if len(c) else {} for c in finite)


def _with_signals(
    motions: tuple[Motion, ...], working: Equations, exogenous: Sequence[Exogenous], split: Split, record: Record
) -> tuple[tuple[Motion, ...], Equations]:
    """Return the motions with those of recorded coordinates, and the model that has the signals they need."""
    units = {c.name: c.unit for c in record.channels}
    followed, extended = motions_of_signals(working, exogenous, split.fit, units)
    return motions + followed, extended


def _anatomy(
    declared: Equations,
    linear: StateSpace | None,
    typical: tuple[Array, ...],
    parts: tuple[Split, float],
    recorded: tuple[Sequence[Exogenous], Record],
) -> tuple[tuple[Motion, ...], tuple[Motion, ...], Equations, dict[str, float]]:
    """Return the motions, a linear model's bodies, the working model, the sizes of its unmeasured forces.

    Added to the model are unmeasured forces and what recorded coordinates need, or the modes' coordinates and the
    bodies' velocities. parts: the split and the settling time in s; recorded: further channels, and a recording.
    """
    (sizes, rates, spreads, moves), (split, settle) = typical, parts
    if linear is not None:
        found, working = motions_of_state_space(linear, declared, sizes, spreads)
        driven, working = bodies_of_state_space(linear, working, sizes, np.vstack([s.y for s in split.fit]))
        return tuple(found), tuple(driven), working, {}
    own = dict(zip([s.name for s in declared.states], rates.tolist(), strict=True))
    span = max(sum(len(s.y) * s.step for s in split.fit), 10 * settle)
    working, added = shape_forces(declared, span, split.fit[0].step)
    forces = {f: own[f.removeprefix(FORCE)] * _mass(declared, f) for f in added}
    bodies = motions_of_equations(declared, sizes, rates)
    motions = (*bodies, *motions_between(declared, bodies, sizes, rates, moves))
    motions, working = _with_signals(motions, working, recorded[0], split, recorded[1])
    return motions, (), working, forces


def _fit_baseline(predictor: Predictor, free: Free, starts: list[Point], case: Case) -> tuple[Predictor, Fit]:
    predictor = predictor.with_order(predictor.choose_var_order(starts[0]))
    fit = fit_best(predictor, [*starts, *explore(predictor, starts[0], free)], free)
    if fit is not None:
        predictor = predictor.with_order(predictor.choose_var_order(fit.point))
        fits = [fit_quietly(predictor, p, free) for p in (fit.point, *with_forces_awake(predictor, fit.point))]
        fit = max((f for f in fits if f is not None), key=lambda f: f.log_posterior, default=None)
    if fit is None:
        raise NotIdentifiable(
            f"{case.baseline_file}: the baseline diverges on {case.records[0].source}; check units and signs"
        )
    return predictor, awakened(predictor, fit, free)


def _time_scales(compiled: Compiled, u: Array, step: float) -> tuple[float, float]:
    """Return three times the slowest decaying time constant (60 samples when unknown) and the fastest rate (1/s)."""
    model = compiled.model
    middle = np.nanmedian(u, axis=0) if u.shape[1] else np.zeros(0)
    J = numeric_jacobian(compiled, model.x0, np.nan_to_num(middle), model.theta)
    if not len(J) or not np.all(np.isfinite(J)):
        return 60 * step, 0.0
    poles = np.linalg.eigvals(J)
    poles = (
        np.log(np.where(np.abs(poles) > 1e-12, poles, 1e-12).astype(complex)) / step if model.sample_time_s else poles
    )
    decaying = -poles.real[-poles.real > 0.01 / (len(u) * step)]
    return (float(3.0 / decaying.min()) if len(decaying) else 60 * step), float(np.max(np.abs(poles)))


def _spread(y: Array, outputs: list[str], case: Case) -> Array:
    spreads = np.nanstd(y, axis=0)
    for name, s in zip(outputs, spreads, strict=True):
        if not np.isfinite(s) or s == 0:
            raise NotIdentifiable(
                f"{case.records[0].source}: output {name} never changes (or is never measured) in the fitting part;"
                " check the sensor or leave the channel out"
            )
    result: Array = spreads
    return result


def _rough(
    compiled: Compiled, segments: tuple[Segment, ...], known: tuple[Array, dict[str, float]], linear: StateSpace | None,
    settle_s: float,
) -> tuple[tuple[Predictor, Point], Scales]:  # fmt: skip
    """Find a stabilising noise gain to start from: the given K, or the best of Riccati gains over a noise ladder."""
    model, (spreads, offsets) = compiled.model, known
    n, m = len(model.states), len(model.outputs)
    u = np.nanmedian(np.vstack([s.u for s in segments]), axis=0)
    visible = visible_sizes(compiled, u, spreads, segments[0].step, settle_s)
    scales = scales_of(model, visible, spreads, offsets)
    predictor = Predictor(compiled, segments, scales, 0 if linear is not None else 1)
    x0 = tuple(model.x0.copy() for _ in segments)
    if linear is not None:
        gains = [np.zeros((linear.order, m))] + ([linear.K] if linear.K is not None else [])
        gains += riccati_gains(linear, spreads)
        rest = np.zeros((n - linear.order, m))  # the shaped disturbances start without a gain
        candidates = [Point(model.theta, np.zeros(n + m), np.vstack([K, rest]), x0) for K in gains]
    else:
        noise = np.concatenate([np.zeros(n), np.ones(m)])
        candidates = noise_ladder(Point(model.theta, noise, None, x0), noisy_states(model))
    values = [predictor.objective(c) for c in candidates]
    if min(values) >= 1e299:
        raise NotIdentifiable(
            f"the baseline diverges on {segments[0].source} with every noise level; check units and signs"
        )
    return (predictor, candidates[int(np.argmin(values))]), scales


def riccati_gains(linear: StateSpace, spreads: Array) -> list[Array]:
    """Return Kalman gains (n, l) for disturbances that enter like the inputs, over a ladder of noise ratios."""
    weight = linear.B @ linear.B.T
    shown = np.diag(linear.C @ weight @ linear.C.T + linear.D @ linear.D.T)
    weight = weight / max(float(np.max(shown / spreads**2)), 1e-300) + 1e-12 * np.eye(linear.order)
    R = np.diag(spreads**2)
    return [steady_gain(linear.A, linear.C, ratio * weight, R) for ratio in 10.0 ** np.arange(-6, 5)]


def _sizes(rough: tuple[Predictor, Point], scales: Scales) -> tuple[Array, Array, Array, Array]:
    """Return typical magnitudes of the states (n,), of their derivatives (n,), and how states move together (n, n).

    Last how far from their start they usually are (n,), 0 within twice their size. A pendulum that is let go
    swings about its rest: linearised a size beyond where it was let go, a spring that hardens had a gain with which
    errors grew near the rest, and the right effect lost 300 nats on the sealed data.
    """
    predictor, point = rough
    runs = [predictor.run(point, i)[2] for i in range(len(predictor.segments))]
    n = len(predictor.compiled.model.states)
    X = np.vstack([x[s.burn :, :n] for x, s in zip(runs, predictor.segments, strict=True)])
    floor = _LEAST * scales.x0  # a state that nothing moves in a free run still has the size at which it would show
    change = np.vstack([np.diff(x[s.burn :, :n], axis=0) for x, s in zip(runs, predictor.segments, strict=True)])
    step = predictor.segments[0].step
    rates = np.maximum(np.std(change, axis=0) / step, floor / step)
    sizes, usual = np.maximum(np.std(X, axis=0), floor), np.mean(X, axis=0) - predictor.compiled.model.x0[:n]
    away = np.where(np.abs(usual) > 2 * sizes, usual, 0.0)
    return sizes, rates, np.atleast_2d(np.cov(X, rowvar=False, ddof=0)), away


def _mass(model: Equations, force: str) -> float:
    state = next(s for s in model.states if s.name == force.removeprefix(FORCE))
    mass = mass_of(state.derivative, model)
    return abs(mass.value) if mass else 1.0
