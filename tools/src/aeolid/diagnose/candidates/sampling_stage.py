"""Try how inputs go on between their samples on one stage, and say what is beyond a habit of the recording (S1)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.diagnose.baseline.frame import carry_free, carry_point
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.sampling_choice import MIDDLE, TINY
from aeolid.diagnose.data.intersample import ROOM, SLOWEST, Sampling, filters_of, with_sampling
from aeolid.diagnose.predictor.evaluation import HUGE
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.predictor.sensitivity import Variant, columns, theta_variant
from aeolid.diagnose.rules import in_force
from aeolid.models.integrate import Compiled
from aeolid.models.intersample import FILTER, FILTERED, HOLDS, OFFSET

Array = NDArray[np.float64]
QUICK, THOROUGH, _TOLERANCE = 4, 12, 0.1  # iterations of a trial and of the best one, nats at which they stop
_EARLIER = (2, 3, 4)  # samples


@dataclass(frozen=True, eq=False)
class Stage:
    """Hold what trials start from: model with the offset in it, predictor, point, free set, and the value to beat.

    place, delay: of the offset and of the filter's delay among the parameters. promised: nats that the score of an
    earlier and of a later offset promises; sampling: as the stage reads inputs.
    """

    predictor: Predictor
    point: Point
    free: Free
    place: int
    delay: int
    value: float
    promised: tuple[float, float]
    sampling: Sampling

    @property
    def step(self) -> float:
        """Return the sample time of the inputs in s."""
        return self.predictor.segments[0].fine_step

    def tried(self, sampling: Sampling, iterations: int = QUICK) -> Sampling:
        """Return a sampling as a brief fit has it, with what it gains."""
        return self.fitted(sampling, iterations)[0]

    def fitted(self, sampling: Sampling, iterations: int) -> tuple[Sampling, Predictor, Point]:
        """Return a sampling as a fit of so many iterations has it, with what it gains; the predictor, and its point."""
        predictor, theta = read_by(self.predictor, sampling), self.point.theta.copy()
        theta[[self.place, self.delay]] = sampling.offset_s, sampling.filter_s
        own = (self.place, *((self.delay,) if sampling.is_filtered else ())) if sampling.free else ()
        start, free = replace(self.point, theta=theta), replace(self.free, theta=(*self.free.theta, *own))
        found = predictor.climb(start, free, iterations, _TOLERANCE)
        if found is None:
            return replace(sampling, gain=-np.inf), predictor, start
        value, point = found
        offset, delay = (float(point.theta[i]) for i in (self.place, self.delay))
        return replace(sampling, offset_s=offset, filter_s=delay, gain=self.value - value), predictor, point


def read_by(predictor: Predictor, sampling: Sampling) -> Predictor:
    """Return a predictor whose model has an offset, its inputs read otherwise; the machine code stays."""
    old = predictor.compiled
    kept = old.model.filters[len(sampling.holds) :]
    compiled = Compiled(replace(old.model, filters=(*filters_of(sampling), *kept)), old.code)
    vars(compiled)["wide"] = old.wide
    return Predictor(compiled, predictor.segments, predictor.scales, predictor.var_order, predictor.deadline)


def stage_of(prepared: Prepared, winner: Candidate | None) -> Stage | None:
    """Return what trials start from: the baseline's fit, or that of a candidate; None where it predicts nothing there.

    A value that ran to none may leave a gain that is unstable without it (a sensor's lag of 0 s).
    """
    source, fit = (prepared.predictor, prepared.fit) if winner is None else (winner.predictor, winner.fit)
    effects = prepared.attachments if winner is None else winner.attachments
    step, now = source.segments[0].fine_step, prepared.sampling
    holds, delay_s = tuple((n, FILTERED) for n, _ in now.holds), now.filter_s or MIDDLE * step
    seen = replace(now, holds=holds, filter_s=delay_s, free=True)
    working = with_sampling(prepared.frame.working, seen, step)
    frame = replace(prepared.frame, working=working, compiled={})
    predictor = read_by(frame.extend(effects, source.segments)[0].with_order(source.var_order or 0), now)
    old, model = source.compiled.model, predictor.compiled.model
    place, delay, point = model.index(OFFSET), model.index(FILTER), carry_point(fit.point, old, model)
    free = carry_free(fit.free, old, model)
    free = replace(free, theta=tuple(i for i in free.theta if i not in (place, delay)))
    value = predictor.objective(point)
    if value >= HUGE:
        return None
    promised = _promised(predictor, predictor.at(point, free), place)
    return Stage(predictor, point, free, place, delay, value, promised, now)


def _promised(predictor: Predictor, at: Fit, place: int) -> tuple[float, float]:
    """Return the nats that moving the offset down and up promises beyond what all that is free could do."""
    h, base = TINY * predictor.segments[0].fine_step, at.residual
    moves = [theta_variant(at.point, {place: -h}), theta_variant(at.point, {place: h}), Variant(at.point, 1.0)]
    found = columns(predictor, at.point, at.noise, base, moves)
    down, up = (found[:, k] - found[:, 2] / moves[k].h for k in (0, 1))
    result = []
    for column, sign in ((down, -1.0), (up, 1.0)):
        own = column - at.jacobian @ lstsq(at.jacobian, column, rcond=1e-10)
        slope = sign * float(own @ base)
        result.append(0.5 * slope**2 / max(float(own @ own), 1e-300) if slope > 0 else 0.0)
    return result[0], result[1]


def goes_on(stage: Stage, best: Sampling) -> bool:
    """Tell whether it is likelier still beyond the one sample that a habit may be, or a late command's lag is.

    A late one at the very end of its range is (a heater 1.05 samples late: the way of its warmth to the sensor), and
    so is a filter as slow as it may be.
    """
    shift = best.late_s / stage.step
    if abs(shift) >= 1.0 and best.free and shift > ROOM - TINY:
        return True
    if is_slowest(stage, best) or _is_earlier(stage, best):
        return True
    if abs(shift) < 1.0:
        return False
    other = best.late_s - best.offset_s
    places = (in_force().candidates.offset_beyond_samples, 0.75)
    trials = [replace(best, offset_s=k * np.sign(shift) * stage.step - other, free=False) for k in places]
    beyond, within = (stage.tried(t, THOROUGH).gain for t in trials)
    physics = shift > 0 and not best.free and within > best.gain
    return beyond > best.gain or physics


def _is_earlier(stage: Stage, best: Sampling) -> bool:
    """Tell whether inputs that seem a sample early are likelier to be earlier still, and outputs as they are.

    Of two loggers, whose clocks are three rows apart, one row early with a filter of all outputs was taken for a habit.
    """
    if best.offset_s > -(1.0 - TINY) * stage.step:
        return False
    holds = tuple((n, HOLDS[0] if h == FILTERED else h) for n, h in best.holds)
    trials = [replace(best, holds=holds, offset_s=-k * stage.step, free=False) for k in _EARLIER]
    gains = [stage.tried(t, THOROUGH).gain for t in trials]
    return max(gains) > best.gain


def is_slowest(stage: Stage, best: Sampling) -> bool:
    """Tell whether the outputs' filter is as slow as it may be."""
    return best.is_filtered and best.filter_s > (1.0 - TINY) * SLOWEST * stage.step
