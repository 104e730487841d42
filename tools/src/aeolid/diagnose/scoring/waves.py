"""Scan for what swings with time or repeats along a signal, at a frequency nobody gave (S6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.hypotheses.generic.places import Follows, Place
from aeolid.diagnose.hypotheses.generic.shapes import ripple, swing
from aeolid.diagnose.hypotheses.parts.base import Attachment, Slot
from aeolid.diagnose.predictor.noise import filter_var
from aeolid.diagnose.predictor.point import Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force

Array = NDArray[np.float64]
_FINER = 2  # lines a bin
_FIRST = 4  # bins left out at the lowest end, where starts and offsets are fitted
_LEAST = 1e-9  # of the power where most is heard: less is rounding
_LAST = 0.95  # of the highest frequency; above it is little but how the sampling was modelled
_LONGEST = 2**22  # samples of the grid
_FIRST_REPEAT, _MOST_REPEATS = 3, 200  # times something may repeat along a signal; less is a curve
TURNS = np.arange(1.0, 25.0)  # times that something may repeat in a turn of a shaft: poles, slots, a joint's two
_ENOUGH = 2**14  # samples to know what noise gives along a signal
_STEP = 1e-3  # of a place's natural size


@dataclass(frozen=True)
class _Peak:
    """Hold the highest of some lines: which, in rad a unit, and how many times what noise gives there it is."""

    number: float
    height: float


def waves(prepared: Prepared, found: Sequence[Place], most: int) -> list[Attachment]:
    """Offer the clearest swings and ripples that noise shows once in 100 recordings; prepared: the bare baseline.

    What a force of any course would gain is, sample by sample, the residual seen through the response of the
    innovations to a pulse of it. A line in that over time is a force that swings, in that times a signal a coefficient
    that does, in that over a signal a force that repeats along it. A line's height over what white residuals
    give is exponential where there is none. Cost: one filter pass a place, one transform a line.
    """
    t, scores = _scores(prepared, found)
    pairs = [(place, over, score) for place, score in zip(found, scores, strict=True) for over in place.follows]
    clock, offered = _Clock.of(prepared, t), _Offers()
    if clock is not None:
        for place, over, score in [*pairs, *((p, None, c) for p, c in zip(found, scores, strict=True))]:
            peak = _in_time(score, over, clock)
            offered.add(peak, swing(place, over, clock.name, clock.middle, peak.number, clock.span))
        offered.close(int(clock.grid[-1]))
    for place, over, score in pairs:
        if not place.is_input and (reach := _reach(over)) > 0:
            peak = _along(score, over, _repeats(reach))
            offered.add(peak, ripple(place, over, peak.number, reach))
    offered.close(_FINER * _MOST_REPEATS)
    for place, score in zip(found, scores, strict=True):
        for angle in place.angles:
            peak = _along(score, angle, TURNS)
            offered.add(peak, ripple(place, angle, peak.number, _reach(angle)))
    offered.close(len(TURNS))
    return [a for _, a in sorted(offered.clear, key=lambda pair: -pair[0])][:most]


@dataclass
class _Offers:
    """Gather the highest line of each search of one kind, and keep what noise shows once in 100 recordings."""

    open: list[tuple[float, Attachment]] = field(default_factory=list)
    clear: list[tuple[float, Attachment]] = field(default_factory=list)

    def add(self, peak: _Peak, form: Attachment) -> None:
        """Take a search's highest line, and the form it would be."""
        self.open.append((peak.height, form))

    def close(self, lines: int) -> None:
        """End one kind; lines: how many each of its searches had to choose from."""
        limit = np.log(max(len(self.open) * lines, 1) / in_force().scoring.line_level)
        self.clear += [pair for pair in self.open if pair[0] > limit]
        self.open = []


@dataclass(frozen=True)
class _Clock:
    """Hold what the model calls time, the middle, length and sample time of the fit part in s, its samples' places."""

    name: str
    middle: float
    span: float
    step: float
    grid: NDArray[np.int_]

    @classmethod
    def of(cls, prepared: Prepared, t: Array) -> _Clock | None:
        """Return it; None where recordings' times do not follow on each other, or no channel is time."""
        time = next((c for c in prepared.exogenous if c.role == "time"), None)
        step = prepared.predictor.segments[0].step
        grid = np.rint((t - t[0]) / step).astype(int)
        if time is None or len(grid) < 2 or not np.all(np.diff(grid) > 0) or grid[-1] >= _LONGEST:
            return None
        span = float(t[-1] - t[0])
        return cls(time.symbol, float(t[0]) + span / 2, span, step, grid)


def _in_time(score: _Score, over: Follows | None, clock: _Clock) -> _Peak:
    """Return the highest line of a score, times a signal if there is one, over time; none is of no height."""
    grid, weight = np.zeros(clock.grid[-1] + 1), np.zeros(clock.grid[-1] + 1)
    weight[clock.grid] = 1.0 if over is None else np.nan_to_num(over.values - over.mean)
    grid[clock.grid] = score.values
    length = 2 ** int(np.ceil(np.log2(2 * len(grid))))
    power = np.abs(np.fft.rfft(grid * weight, length)) ** 2
    shared = np.fft.irfft(np.abs(np.fft.rfft(weight, length)) ** 2, length)  # what pairs of samples have in common
    heights = _heights(power, np.fft.rfft(score.correlation(length) * shared).real)
    first, last = _FIRST * length // len(grid), int(_LAST * len(heights))
    k = first + int(np.argmax(heights[first:last])) if last > first else 0
    return _Peak(2 * np.pi * k / (length * clock.step), float(heights[k]) if k else 0.0)


def _reach(over: Follows) -> float:
    low, high = np.nanquantile(over.values, [0.005, 0.995])
    return float(high - low)


def _repeats(reach: float) -> Array:
    """Return how often something may repeat along a signal that reaches so far, in rad a unit of it."""
    numbers: Array = 2 * np.pi / reach * np.arange(_FIRST_REPEAT, _MOST_REPEATS, 1 / _FINER)
    return numbers


def _along(score: _Score, over: Follows, numbers: Array) -> _Peak:
    """Return the highest line of a score along a signal; numbers: the lines, in rad a unit of it."""
    values = np.nan_to_num(over.values - over.mean)
    some = min(len(values), _ENOUGH)
    length = 2 ** int(np.ceil(np.log2(2 * some)))
    response = np.fft.fft(score.correlation(length)).real
    power, expected = np.empty(len(numbers)), np.empty(len(numbers))
    for i, k in enumerate(numbers):
        wave = np.exp(1j * k * values)
        power[i] = np.abs(score.values @ wave) ** 2
        expected[i] = response @ np.abs(np.fft.fft(wave[:some], length)) ** 2 / length * len(wave) / some
    heights = _heights(power, expected)
    i = int(np.argmax(heights))
    return _Peak(float(numbers[i]), float(heights[i]))


def _heights(power: Array, expected: Array) -> Array:
    """Return a periodogram over what white residuals give, which is exponential where there is no line."""
    heard = expected > _LEAST * max(float(np.max(expected)), 0.0)
    result: Array = np.where(heard, power / np.where(heard, expected, 1.0), 0.0)
    return result


@dataclass(frozen=True, eq=False)
class _Score:
    """Hold the score of a force at each sample (N,), and the response (L,) of each innovation to a pulse of it."""

    values: Array
    pulse: Array

    def correlation(self, length: int) -> Array:
        """Return what scores have in common that lie 0, 1 … −1 samples apart (length,), of white residuals."""
        size = 2 ** int(np.ceil(np.log2(2 * len(self.pulse))))
        own = np.fft.irfft(np.sum(np.abs(np.fft.rfft(self.pulse, size, axis=0)) ** 2, axis=1), size)
        most = min(len(self.pulse), length // 2)
        result = np.zeros(length)
        result[:most] = own[:most]
        result[length - most + 1 :] = own[size - most + 1 :]
        return result


def _scores(prepared: Prepared, found: Sequence[Place]) -> tuple[Array, list[_Score]]:
    """Return the times (N,) of the fit part, and for each place the score of a force there at each of them."""
    pushes = []
    for place in found:
        slot = Slot(f"push_{place.tag}", None, "", 0.0, -np.inf, np.inf, place.size)
        pushes.append(place.attach("push", slot.name, (slot,), slot.name, equation="", statement=lambda _: ""))
    stage = prepared.only(pushes)
    predictor, fit, model = stage.predictor, stage.fit, stage.extended
    outputs = predictor.segments[0].y.shape[1]
    kept = [len(s.y) - s.burn for s in predictor.segments]
    residual = np.split(prepared.fit.residual.reshape(-1, outputs), np.cumsum(kept)[:-1])
    t = np.concatenate([s.start_s + s.step * np.arange(s.burn, len(s.y)) for s in predictor.segments])
    gain = predictor.gain(fit.point)
    still = _innovations(predictor, fit.point, gain)
    scores = []
    for place in found:
        theta = fit.point.theta.copy()
        theta[model.index(f"push_{place.tag}")] = _STEP * place.size
        moved = _innovations(predictor, replace(fit.point, theta=theta), gain)
        response = filter_var(np.nan_to_num(moved - still) / (_STEP * place.size), fit.noise.var) @ fit.noise.factor
        pulse = np.diff(response, axis=0, prepend=np.zeros((1, outputs)))
        scores.append(_Score(np.concatenate([_seen(r, pulse) for r in residual]), pulse))
    return t, scores


def _innovations(predictor: Predictor, point: Point, gain: Array) -> Array:
    """Return those of the first stretch, from its start on."""
    s = predictor.segments[0]
    u, count = predictor.ready(point, 0)
    return predictor.compiled.innovations(u, s.y, point.theta, gain, point.x0[0], s.fine_step, count, s.stride)


def _seen(residual: Array, pulse: Array) -> Array:
    """Return what a pulse at each time would gain: the residual after it against the pulse's response."""
    short = pulse[: len(residual)]
    both = [fftconvolve(residual[:, j], short[::-1, j])[len(short) - 1 :] for j in range(residual.shape[1])]
    result: Array = np.sum(both, axis=0)[: len(residual)]
    return result
