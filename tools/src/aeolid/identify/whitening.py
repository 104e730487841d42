"""Find the innovations of a VARMAX predictor: extended least squares, then residual whitening where that helps.

Residual whitening (reference [9] of paper 000) repeats: Ξ by least squares on windows of [u; y; e], new e from Ξ. A
step is taken when the predictor (13), with its own e fed back, leaves a mean log error power lower by more than n/N,
which n parameters without meaning would gain, than Ξ leaves with the e before in the regressor; else it is halved. A
predictor that diverges has infinite power. Where extended least squares has converged no step passes, and its own e and
Ξ stay: on the turbine those predict better than an e fed back through H̄, whose zeros lie near the unit circle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.identify.extended import Samples, innovations, run_pass
from aeolid.identify.markov import MarkovEstimate, estimate_markov
from aeolid.identify.ridge import EXACT
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.windows import Scaling, WindowFactor, factorise, require_windows
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
RHO = 0.1  # regularisation of a pass in scaled units, as on the target
ITERATIONS = 30
HALVINGS = 3
LONGEST_START = 4  # past windows of the VARX predictor that starts where the positive-real condition fails


@dataclass(frozen=True, eq=False)
class Whitening:
    """Hold the innovations found and how.

    records: the recordings with channels of e (NaN where it is not known); e (N, l): the same in scaled units, zero
    there; theta (l, p m + r): Ξ of the last pass where e is that of the pass; start: past window of the VARX predictor
    at the beginning, 0 for a streamed Ξ; power: mean log error power of the outputs at the start, after the passes and
    after each accepted iteration; stopped: why the iteration ended.
    """

    records: tuple[Record, ...]
    e: Array
    theta: Array | None
    start: int
    forgetting: tuple[float, ...]
    power: tuple[float, ...]
    stopped: str
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return how the innovations were found as JSON facts."""
        return {
            "start": f"varx, past window {self.start}" if self.start else "streamed",
            "forgetting": list(self.forgetting),
            "log_error_power": [p if np.isfinite(p) else None for p in self.power],
            "iterations": max(len(self.power) - 2, 0),
            "stopped": self.stopped,
        }


@dataclass(frozen=True, eq=False)
class _Problem:
    """Hold what stays the same while e changes."""

    records: Sequence[Record]
    samples: Samples
    scaling: Scaling
    past: int
    through: tuple[bool, ...]
    regularization: str | float
    windows: int

    @property
    def gain(self) -> float:
        """Return by how much a step must lower the mean log error power."""
        return (self.past * self.scaling.channels + sum(self.through)) / max(self.windows, 1)

    def fill(self, e: Array) -> tuple[Record, ...]:
        """Return the recordings with channels of e (N, l)."""
        return with_innovations(self.records, self.samples, self.scaling, e, self.past)

    def solve(self, e: Array) -> tuple[Array, Array]:
        """Return Ξ (l, p m + r) and the constant (l,) by least squares with e in the regressor."""
        factor = factorise(self.fill(e), self.scaling, self.past)
        theta = estimate_markov(factor, self.through, self.regularization).theta
        return theta, constant_of(factor, theta)

    def leave(self, e: Array) -> float:
        """Return the mean log power of what least squares leaves with e in the regressor."""
        theta, constant = self.solve(e)
        left = innovations(self.samples, self.past, theta, constant, e, feed_back=False, limit=np.inf)
        return log_power(self.samples, left, self.past)

    def follow(self, theta: Array, constant: Array, e: Array) -> tuple[Array, float]:
        """Return the innovations of a predictor run over the samples, and their mean log power."""
        new = innovations(self.samples, self.past, theta, constant, e, feed_back=True)
        return new, log_power(self.samples, new, self.past)


def extend(scaling: Scaling) -> Scaling:
    """Return the scaling of VARMAX windows: e under names of its own, scaled like y."""
    r = len(scaling.inputs)
    names = tuple(f"innovation of {name}" for name in scaling.outputs)
    zero = np.zeros(len(names))
    return replace(
        scaling, innovations=names, offset=np.concatenate([scaling.offset, zero]),
        scale=np.concatenate([scaling.scale, scaling.scale[r:]]),
    )  # fmt: skip


def with_innovations(
    records: Sequence[Record], samples: Samples, scaling: Scaling, e: Array, past: int
) -> tuple[Record, ...]:
    """Return the recordings with channels of e (N, l), scaled units, in the outputs' units; NaN where not known."""
    scale = scaling.scale[-len(scaling.innovations) :]
    known = np.where(samples.used(past)[:, None], e * scale, np.nan)
    filled = []
    for record, part in zip(records, samples.split(known), strict=True):
        names = zip(scaling.innovations, scaling.outputs, strict=True)
        channels = tuple(Channel(name, record.unit(output), "ignore") for name, output in names)
        filled.append(replace(record, values=np.hstack([record.values, part]), channels=record.channels + channels))
    return tuple(filled)


def constant_of(factor: WindowFactor, theta: Array) -> Array:
    """Return the constant (l,) of the regression y = c + Ξ z: what the mean window leaves."""
    width = theta.shape[1]
    out: Array = factor.mean[width : width + factor.outputs] - theta @ factor.mean[:width]
    return out


def log_power(samples: Samples, e: Array, past: int) -> float:
    """Return the mean over the outputs of the log power of e (N, l); infinite where it is not finite."""
    with np.errstate(all="ignore"):
        power = (e[samples.used(past)] ** 2).mean(axis=0)
        value = float(np.mean(np.log(np.maximum(power, 1e-30))))
    return value if np.isfinite(value) else np.inf


def whiten(
    records: Sequence[Record], samples: Samples, scaling: Scaling, plain: WindowFactor, start: MarkovEstimate,
    through: tuple[bool, ...], regularization: str | float, passes: int, forgetting: float,
) -> Whitening:  # fmt: skip
    """Find e from VARX by passes of extended least squares and residual whitening.

    scaling: that of VARMAX windows; plain, start: window factor and estimate of VARX with the same past window. Where
    the passes diverge the residuals of VARX take their place, and a note says so. Where VARX leaves rounding only there
    are no innovations to look for, and no pass is run.
    """
    problem = _Problem(records, samples, scaling, plain.past, through, regularization, plain.windows)
    _require(problem)
    first = _varx_residuals(samples, plain, start.theta)
    if log_power(samples, first, plain.past) < np.log(EXACT):  # the outputs have unit power
        passes = 0
    annealed = tuple(1.0 if i == passes else forgetting ** (1.0 / i) for i in range(1, passes + 1))
    theta, e, notes = _run_passes(problem, plain, start.theta, annealed, first)
    power = problem.leave(e)
    powers = [log_power(samples, first, plain.past), power]
    better, more, stopped = _iterate(problem, theta, constant_of(plain, start.theta), e, power)
    sound = bool(annealed) and not notes and not more
    return _result(problem, better, theta if sound else None, plain.past, annealed, [*powers, *more], stopped, notes)


def start_again(
    records: Sequence[Record], samples: Samples, scaling: Scaling, plain: Scaling, found: Whitening, past: int,
    through: tuple[bool, ...], regularization: str | float,
) -> Whitening | None:  # fmt: skip
    """Find e from a longer VARX predictor, which needs no positive-real condition; None where that is no better.

    plain: scaling without innovations; found: what VARX of the same window led to. The longer window is LONGEST_START
    times p, at least 40, at most what leaves 20 samples an unknown; None also where holes leave less than 10 windows an
    unknown. Residuals of a long VARX predictor are near the innovations whatever H̄ is (Durbin's first step); one least
    squares then gives Ξ.
    """
    longer = min(max(LONGEST_START * past, 40), samples.count_windows(0) // (20 * plain.channels))
    # holes may leave few or no windows of that length
    if longer <= past or samples.count_windows(longer) < 10 * longer * plain.channels:
        return None
    factor = factorise(records, plain, longer)
    theta = estimate_markov(factor, through, regularization).theta
    first = _varx_residuals(samples, factor, theta, found.e)
    problem = _Problem(records, samples, scaling, past, through, regularization, factor.windows)
    theta, constant = problem.solve(first)
    e, power = problem.follow(theta, constant, first)
    if not power < found.power[-1] - problem.gain:
        return None
    e, more, stopped = _iterate(problem, theta, constant, e, power)
    note = f"the start from VARX of past window {past} led astray; that of past window {longer} was taken"
    return _result(problem, e, None, longer, (), [log_power(samples, first, past), power, *more], stopped, [note])


def _result(
    problem: _Problem, e: Array, theta: Array | None, start: int, forgetting: tuple[float, ...],
    powers: Sequence[float], stopped: str, notes: Sequence[str],
) -> Whitening:  # fmt: skip
    return Whitening(problem.fill(e), e, theta, start, forgetting, tuple(powers), stopped, tuple(notes))


def _iterate(
    problem: _Problem, theta: Array, constant: Array, e: Array, power: float
) -> tuple[Array, list[float], str]:
    """Repeat least squares and prediction until no step lowers the log error power enough."""
    powers: list[float] = []
    for _ in range(ITERATIONS):
        target, target_constant = problem.solve(e)
        for halving in range(HALVINGS + 1):
            step = 0.5**halving
            tried = theta + step * (target - theta)
            tried_constant = constant + step * (target_constant - constant)
            new, reached = problem.follow(tried, tried_constant, e)
            if reached < power - problem.gain:
                break
        else:
            return e, powers, f"no step lowers the log error power by more than {problem.gain:.2g}"
        theta, constant, e, power = tried, tried_constant, new, reached
        powers.append(power)
    return e, powers, f"{ITERATIONS} iterations"


def follow(
    records: Sequence[Record], samples: Samples, scaling: Scaling, plain: WindowFactor, start: MarkovEstimate,
    theta: Array, markov: StreamedMarkov,
) -> Whitening:  # fmt: skip
    """Find the e that belongs to a streamed Ξ (l, p m + r), scaled units.

    It is what the predictor makes of the samples; where that diverges, the innovations of the filter themselves, and
    where the file has none for a sample, the residual of VARX.
    """
    problem = _Problem(records, samples, scaling, plain.past, (), "none", plain.windows)
    _require(problem)
    first = _varx_residuals(samples, plain, start.theta)
    e, power = problem.follow(theta, np.zeros(len(theta)), first)
    if np.isfinite(power):
        return _result(problem, e, None, 0, (), [power], "Ξ as streamed", ())
    given = markov.innovation_of(records)
    if given is None or given.shape != first.shape:
        raise DataError(
            f"{markov.source}: its predictor does not forget, and the file has no innovations of these "
            f"{len(first)} samples; identify the recording that was filtered, filter longer, or leave --markov out"
        )
    scaled = given / scaling.scale[-first.shape[1] :]
    e = np.where(np.isfinite(scaled), scaled, first)
    note = "the streamed predictor does not forget its start; e is that of the filter"
    return _result(problem, e, None, 0, (), [log_power(samples, e, plain.past)], "Ξ as streamed", (note,))


def _require(problem: _Problem) -> None:
    """Refuse recordings too short for VARMAX windows: p samples whose e is known, each from the p samples before it."""
    past = problem.past
    known = problem.samples.count_windows(2 * past)
    require_windows(problem.records, past, problem.scaling.channels, known, lead=2 * past)


def _varx_residuals(samples: Samples, plain: WindowFactor, theta: Array, before: Array | None = None) -> Array:
    """Return e (N, l) of the VARX predictor Ξ (l, p (r + l) + r).

    before (N, l), default zero: what stands where a stretch has no window yet.
    """
    padded = _with_zero_noise(theta, plain)
    e = np.zeros((len(samples.x), samples.outputs)) if before is None else before
    return innovations(samples, plain.past, padded, constant_of(plain, theta), e, feed_back=False, limit=np.inf)


def _with_zero_noise(theta: Array, plain: WindowFactor) -> Array:
    """Return Ξ of eq. (14) from that of eq. (9): the columns of e are zero."""
    outputs, both = theta.shape[0], plain.channels
    width = plain.past * both
    blocks = theta[:, :width].reshape(outputs, plain.past, both)
    padded = np.concatenate([blocks, np.zeros((outputs, plain.past, outputs))], axis=2)
    return np.hstack([padded.reshape(outputs, -1), theta[:, width:]])


def _run_passes(
    problem: _Problem, plain: WindowFactor, start: Array, forgetting: Sequence[float], first: Array
) -> tuple[Array, Array, list[str]]:
    """Run the passes from VARX; returns Ξ (l, p m + r), e and a note where they diverged."""
    width = plain.past * problem.scaling.channels
    present = [i for i, through in enumerate(problem.through) if through]
    full = _with_zero_noise(start, plain)
    keep = [*range(width), *(width + i for i in present)]
    theta, e = np.ascontiguousarray(full[:, keep]), np.zeros_like(first)
    for factor in forgetting:
        run_pass(problem.samples, plain.past, present, theta, e, factor, RHO, held=factor < 1)
        if not log_power(problem.samples, e, plain.past) < log_power(problem.samples, first, plain.past) + 1.0:
            return full, first, ["the passes of extended least squares diverged; e starts from the residuals of VARX"]
    full[:, keep] = theta
    return full, e if forgetting else first, []
