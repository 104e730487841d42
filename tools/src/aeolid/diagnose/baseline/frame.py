"""Build the model that some effects need, and no more: each extra state and equation costs every filter pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline import alongside
from aeolid.diagnose.baseline.recorded_wind import RecordedWind
from aeolid.diagnose.baseline.simulated import Surrogate
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.deadline import Deadline, unlimited
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point, Prior, Scales
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.structure.baseline import noisy_states
from aeolid.models.equations import Equations
from aeolid.models.integrate import Compiled, compile_equations

Array = NDArray[np.float64]
_FORCE_START = 1e-3  # amplitude of an unmeasured force a sample, in the size of what it acts against


@dataclass(frozen=True, eq=False)
class Frame:
    """Hold what an extended model is built from.

    working: the baseline with all channels as inputs and no effect; rough: a stabilising start for its own states;
    sizes (n,), spreads (l,): typical magnitudes of the declared states and of the outputs; away (n,): how far from
    their start these states usually are where it is beyond twice that, else 0; forces: sizes of the
    unmeasured forces by state; offsets: those of a linear model's offsets and of what a recorded wind tells, by
    parameter; wind: what of the model that wind tells of, once the effects are in it.
    """

    working: Equations
    rough: Point
    sizes: Array
    spreads: Array
    away: Array
    forces: dict[str, float]
    offsets: dict[str, float]
    surrogate: Surrogate | None
    wind: RecordedWind | None = None
    deadline: Deadline = field(default_factory=unlimited)
    compiled: dict[tuple[str, ...], Compiled] = field(default_factory=dict)

    def extend(self, attachments: Sequence[Attachment], segments: Sequence[Segment]) -> tuple[Predictor, Free, Point]:
        """Return predictor, the baseline's free set and the rough start with these effects at their nulls.

        A model is compiled once and kept (half a second to some seconds).
        """
        keys = tuple(a.key for a in attachments)
        if keys not in self.compiled:
            model = self.working
            for a in sorted(attachments, key=lambda a: a.entry != "parameter_error"):  # gains scale own terms only
                model = a.edit(model)
            if self.wind is not None:
                model = self.wind.told(model, segments[0].fine_step)
            self.compiled[keys] = compile_equations(model)
        compiled = self.compiled[keys]
        scales, free, start = self._start(compiled.model, attachments)
        predictor = Predictor(compiled, segments, scales, 0, self.deadline)
        return predictor if self.surrogate is None else self.surrogate.inform(predictor), free, start

    def as_run(self, model: Equations, x0: tuple[Array, ...]) -> Point | None:
        """Return the point at which this extended model predicts the simulator's run best, with other starts.

        None without a run. Effects are at their nulls.
        """
        if self.surrogate is None:
            return None
        known = self.surrogate
        return replace(carry_point(known.fit.point, known.predictor.compiled.model, model), x0=x0)

    def _start(self, model: Equations, attachments: Sequence[Attachment]) -> tuple[Scales, Free, Point]:
        names, outputs = [s.name for s in model.states], [o.name for o in model.outputs]
        n, m, extra = len(self.sizes), len(outputs), len(model.states) - len(self.sizes)
        full = np.concatenate([self.sizes, np.full(extra, 1.0)])
        for a in attachments:
            for g in a.gain_states if a.location["outputs"] else ():  # else in the size of what they act on
                full[names.index(g)] = self.spreads[outputs.index(a.location["outputs"][0])]
        for name, size in self.forces.items():
            full[names.index(name)] = size
        scales = scales_of(model, full, self.spreads, self.offsets)
        known = {s.name: s.size for a in attachments for s in a.slots}
        theta = np.array([known.get(p.name, t) for p, t in zip(model.parameters, scales.theta, strict=True)])
        noise = np.concatenate([self.rough.noise[:n], np.zeros(extra), self.rough.noise[n:]])
        noise[[names.index(f) for f in self.forces]] = _FORCE_START
        K = None if self.rough.K is None else np.vstack([self.rough.K, np.zeros((extra, m))])
        blank = np.full(len(model.memories), np.nan)
        x0 = tuple(np.concatenate([x[:n], np.zeros(extra), blank]) for x in self.rough.x0)
        own = [i for i in range(n) if not names[i].startswith(alongside.PREFIX)]
        sensors = range(n + extra + 1, n + extra + m)  # the first sensor's noise sets the scale
        noisy = [i for i in noisy_states(model) if i < n or names[i] in self.forces]
        free = Free(
            tuple(i for i, p in enumerate(model.parameters) if p.free),
            (*noisy, *sensors) if K is None else (),
            () if K is None else tuple((i, j) for i in own for j in range(m)),
            tuple(own),
        )
        away = np.concatenate([self.away, np.zeros(extra)])
        return replace(scales, theta=theta, away=away), free, Point(model.theta, noise, K, x0)


def scales_of(model: Equations, x_size: Array, spreads: Array, known: Mapping[str, float]) -> Scales:
    """Return the typical sizes of a model's quantities: known by parameter, else from declared values and ranges.

    Where nothing says a size it is 1e-6; a declared value may be far smaller, as a capacitance in F is.
    """
    spans = [p.maximum - p.minimum for p in model.parameters]
    theta = np.array(
        [
            known.get(p.name) or max(abs(p.value), 1e-3 * span if np.isfinite(span) else 0.0) or 1e-6
            for p, span in zip(model.parameters, spans, strict=True)
        ]
    )
    informed = [i for i, p in enumerate(model.parameters) if p.prior_std]
    root = np.zeros((len(informed), len(model.parameters)))
    root[range(len(informed)), informed] = [1.0 / (model.parameters[i].prior_std or np.inf) for i in informed]
    low, high = (np.array([getattr(p, end) for p in model.parameters]) for end in ("minimum", "maximum"))
    return Scales(theta, np.outer(x_size, 1.0 / spreads), x_size, low, high, Prior(model.theta, root), spreads)


def carry_point(point: Point, source: Equations, target: Equations) -> Point:
    """Return a point of one extended model as a point of another: by name, effects of the target at their nulls."""
    theta = target.theta
    place = {p.name: i for i, p in enumerate(target.parameters)}
    for p, value in zip(source.parameters, point.theta.tolist(), strict=True):
        if p.name in place:
            theta[place[p.name]] = value
    n, m = len(source.states), len(source.outputs)
    rows = _rows(source, target)
    noise = np.concatenate([_moved(point.noise[:n], rows), point.noise[n : n + m]])
    K = None if point.K is None else np.column_stack([_moved(c, rows) for c in point.K.T])
    blank = np.full(len(target.memories), np.nan)
    return Point(theta, noise, K, tuple(np.concatenate([_moved(x[:n], rows), blank]) for x in point.x0))


def put_back(point: Point, model: Equations, gone: Attachment, kept: Sequence[Attachment]) -> Point:
    """Return a point of the model with the values of an effect that goes at their nulls, unless others have them, too.

    A wrong constant is the model's own parameter and stays in it when the effect goes: carried over, it was right.
    """
    shared = {s.name for a in kept for s in a.slots}
    nulls = {s.name: s.null for s in gone.slots if s.name not in shared}
    theta = point.theta.copy()
    for i, p in enumerate(model.parameters):
        theta[i] = nulls.get(p.name, theta[i])
    return replace(point, theta=theta)


def carry_free(free: Free, source: Equations, target: Equations) -> Free:
    """Return a free set of one extended model as that of another; what the target lacks is left out."""
    place = {p.name: i for i, p in enumerate(target.parameters)}
    states = {s.name: i for i, s in enumerate(target.states)}
    n, count = len(source.states), len(target.states)
    to = [states.get(s.name) for s in source.states]
    noise = [to[i] if i < n else count + i - n for i in free.noise]
    return Free(
        tuple(place[p.name] for p in (source.parameters[i] for i in free.theta) if p.name in place),
        tuple(i for i in noise if i is not None),
        tuple((row, j) for row, j in ((to[i], j) for i, j in free.gain) if row is not None),
        tuple(row for row in (to[i] for i in free.x0) if row is not None),
    )


def carry_prior(prior: Prior, source: Equations, target: Equations) -> Prior:
    """Return a prior of one extended model as that of another; effects have none."""
    place = {p.name: i for i, p in enumerate(target.parameters)}
    mean, root = target.theta, np.zeros((len(prior.root), len(target.parameters)))
    for i, p in enumerate(source.parameters):
        if p.name in place:
            mean[place[p.name]] = prior.mean[i]
            root[:, place[p.name]] = prior.root[:, i]
    return Prior(mean, root)


def carry_fit(fit: Fit, source: Equations, target: Equations) -> Fit:
    """Return a fit of the baseline, no effect free, as that of another extended model: the numbers are the same."""
    point, free = carry_point(fit.point, source, target), carry_free(fit.free, source, target)
    return replace(fit, point=point, free=free, jumps=())


def _rows(source: Equations, target: Equations) -> list[int]:
    names = [s.name for s in source.states]
    return [names.index(s.name) if s.name in names else -1 for s in target.states]


def _moved(values: Array, rows: Sequence[int]) -> Array:
    return np.array([values[i] if i >= 0 else 0.0 for i in rows])
