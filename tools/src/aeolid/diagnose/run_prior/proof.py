"""Hold an explanation against the sealed part of the recordings, and find how sure its values are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.run_prior.evidence import evidence_at, posterior, prior_of
from aeolid.diagnose.run_prior.explain import Explanation, Found
from aeolid.diagnose.run_prior.grams import total
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, Values
from aeolid.diagnose.run_prior.operators import turning_step
from aeolid.diagnose.run_prior.pair import NOTHING, Change, Pair
from aeolid.diagnose.run_prior.resonances import HIDDEN
from aeolid.diagnose.run_prior.search import FIT

Array = NDArray[np.float64]
TRUST = 0.3  # weight of the run on the sealed part
_BLOCKS = 6  # of the sealed part, each foretold from all before it
_FOLDS = 5  # of the whole recording, for the spread of a value
_Z90 = 1.6449
_MODEL = 0.03  # of a value: what windows of other lengths and other ridges moved lags and delays by (1 to 6 %)
_OF_FREQUENCY = 0.005  # of a frequency
_TURN = 0.1  # of a sample's change at a turn: what a width may be off (a rig of 0.30: 0.27 to 0.33, as turns are taken)
_INTERPOLATION = 0.15  # of a sample: what a time may be off where the signal between samples is unknown


@dataclass(frozen=True, eq=False)
class RunProof:
    """Hold the sealed part's verdict: nats gained, its 90 % interval, one-step errors and series before and after."""

    gain: float
    interval: tuple[float, float]
    before: dict[str, float]
    after: dict[str, float]
    ceiling: float
    series: dict[str, dict[str, object]]


def prove(pair: Pair, explanation: Explanation, ridge: Array) -> RunProof:
    """Foretell the sealed part block by block with and without the effects; nothing is chosen or fitted on it.

    Both trust the run as one of the same machine in other wind is to be trusted (nulls ask for weights of 0.3 to 1),
    within that as the data of the fit do with the effects: a predictor that leaves the run behind as soon as it errs
    has nothing to gain. Where the effect is a mode that the
    runs lack, after weighs the run as the data of the fit ask for. ceiling: what that weight gains.
    """
    edges = np.linspace(FIT, 1.0, _BLOCKS + 1)
    own = any(f.mode is not None or (f.standing is not None and f.standing.own) for f in explanation.found)
    apart = [f.standing for f in explanation.found if f.standing is not None and not f.standing.own]
    trust = float(np.clip(explanation.after, TRUST, 1.0)) if np.isfinite(explanation.after) else TRUST
    bare = _foretold(pair, NOTHING, ridge, edges, trust)
    freed = _foretold(pair, NOTHING, ridge, edges, explanation.weight)
    only = all(f.scored is None for f in explanation.found) and bool(explanation.found)  # the model is the recordings'
    full = freed if own or only else _foretold(pair, explanation.change, ridge, edges, trust)
    gains = np.zeros(_BLOCKS) if only and not own else full.nats - bare.nats
    spread = _Z90 * float(np.sqrt(len(gains)) * gains.std(ddof=1))
    spread = float(np.hypot(spread, np.sqrt(sum((s.nats - s.interval[0]) ** 2 for s in apart))))
    gain = float(gains.sum()) + sum(s.nats for s in apart)
    ceiling = max(gain, float(np.sum(freed.nats - bare.nats)))
    series = {} if not explanation.found else _series(pair, bare, full, explanation.change)
    return RunProof(gain, (gain - spread, gain + spread), bare.errors(pair), full.errors(pair), ceiling, series)


@dataclass(frozen=True, eq=False)
class _Foretold:
    """Hold by block of the sealed part the nats; squared errors and spread of each output; coefficients by region."""

    nats: Array
    square: Array
    spread: Array
    theta: tuple[Array, ...]

    def errors(self, pair: Pair) -> dict[str, float]:
        """Return one-step errors in standard deviations of each output."""
        ratio = np.sqrt(self.square / self.spread)
        return {n: float(v) for n, v in zip(pair.shown, ratio, strict=True)}


def _foretold(pair: Pair, change: Change, ridge: Array, edges: Array, weight: float) -> _Foretold:
    prior = prior_of(pair.of_runs(change), ridge)
    known = pair.of_recordings(change, 0.0, float(edges[0]))
    parts = [pair.of_recordings(change, float(a), float(b)) for a, b in pairwise(edges)]
    theta = posterior(prior, known, weight)
    sealed = total(parts)
    square, spread = np.zeros(len(pair.shown)), np.zeros(len(pair.shown))
    for p, g, t in zip(prior, sealed.regions, theta, strict=True):
        square += np.diag(g.YY - 2 * t.T @ g.ZY + t.T @ g.Z @ t)
        spread += np.diag(g.YY) - g.ZY[p.size] ** 2 / g.count
    nats = []
    for part in parts:
        nats.append(evidence_at(prior, known + part, weight) - evidence_at(prior, known, weight))
        known = known + part
    return _Foretold(np.array(nats), np.maximum(square, 0.0), np.maximum(spread, 1e-300), theta)


def _series(pair: Pair, bare: _Foretold, full: _Foretold, change: Change) -> dict[str, dict[str, object]]:
    """Return measured outputs and one-step predictions before and after over the sealed part of the last recording."""
    found: dict[str, dict[str, object]] = {}
    last = pair.recordings[-1]
    time_s, measured, before = pair.predicted(last, NOTHING, bare.theta[last.region], FIT)
    after = pair.predicted(last, change, full.theta[last.region], FIT)[2]
    for j, name in enumerate(pair.shown):
        columns = {"measured": measured, "before": before, "after": after}
        found[name] = {"time_s": time_s.tolist()} | {k: v[:, j].tolist() for k, v in columns.items()}
    return found


def values_of(pair: Pair, ridge: Array, found: Found, others: Change) -> tuple[Values, Values]:
    """Return the values of an effect on all data and their standard deviations.

    The value is where the evidence of all data peaks; its deviation is that of the jackknife over five parts, the
    curvature's where that is larger, 3 % for the model, and for the signal between samples 0.15 samples of a time or a
    tenth of a sample's change at the turns of a width.
    """
    if found.scored is None:
        return (), ()
    values, h = list(found.scored.values), found.scored.hypothesis
    deviations = []
    for place in range(len(h.names)):
        centre, spread = _along(pair, found, others, ridge, tuple(values), place)
        values[place] = float(np.clip(centre, h.low[place], h.high[place]))
        between = _between_samples(pair, h, place)
        model = _OF_FREQUENCY if h.names[place] == "frequency_hz" else _MODEL
        deviations.append(float(np.sqrt(spread**2 + (model * values[place]) ** 2 + between**2)))
    return tuple(values), tuple(deviations)


def _between_samples(pair: Pair, h: Hypothesis, place: int) -> float:
    """Return how far off a value may be because the signal between samples is unknown."""
    if h.units[place] == "s":
        return _INTERPOLATION * pair.step
    if h.names[place] != "width":
        return 0.0
    i = pair.inputs.index(h.place.partition(":")[2])
    return _TURN * float(np.mean([turning_step(s.u[:, i]) for s in pair.recordings]))


def _along(pair: Pair, found: Found, others: Change, ridge: Array, values: Values, place: int) -> tuple[float, float]:
    """Return the peak of the evidence along one value, and its deviation, from five points around it."""
    assert found.scored is not None
    h, weight = found.scored.hypothesis, found.scored.weight
    share = 0.015 if h.names[place] == "frequency_hz" else 0.06
    width = max(share * abs(values[place]), 0.2 * pair.step if h.units[place] == "s" else 0.0)
    points = values[place] + width * np.arange(-2.0, 3.0)
    points = np.clip(points, h.low[place], h.high[place])
    edges = np.linspace(0.0, 1.0, _FOLDS + 1)
    table = np.empty((_FOLDS + 1, len(points)))
    for j, point in enumerate(points):
        change = h.change((*values[:place], float(point), *values[place + 1 :])).after(others)
        prior = prior_of(pair.of_runs(change), ridge)
        parts = [pair.of_recordings(change, float(a), float(b)) for a, b in pairwise(edges)]
        whole = total(parts)
        table[0, j] = evidence_at(prior, whole, weight)
        for i in range(_FOLDS):
            rest = total([p for k, p in enumerate(parts) if k != i])
            table[i + 1, j] = evidence_at(prior, rest, weight)
    peaks = np.array([_peak(points, row)[0] for row in table])
    curvature = _peak(points, table[0])[1]
    jackknife = float(np.sqrt((_FOLDS - 1) / _FOLDS * np.sum((peaks[1:] - peaks[1:].mean()) ** 2)))
    return float(peaks[0]), max(jackknife, curvature)


def _peak(x: Array, y: Array) -> tuple[float, float]:
    """Return where a parabola through the points peaks, within them, and the deviation its curvature tells."""
    middle = int(np.argmax(y))
    centre, width = x[middle], max(float(np.ptp(x)), 1e-300)
    a, b, _ = np.polyfit((x - centre) / width, y, 2)
    if a >= 0:
        return float(centre), 0.0
    return float(np.clip(centre - 0.5 * b / a * width, x.min(), x.max())), float(width / np.sqrt(-2 * a))


def shown_values(found: Found, values: Sequence[float], deviations: Sequence[float]) -> dict[str, tuple[float, float]]:
    """Return the told values with their deviations by name, of an operator or of a mode."""
    if found.standing is not None:
        return {}
    if found.mode is not None:
        m = found.mode
        return {"frequency_hz": (m.frequency_hz, _of_mode(m.frequency_hz, m.frequency_std_hz, _OF_FREQUENCY)),
                "damping": (m.damping, _of_mode(m.damping, m.damping_std, 0.1))}  # fmt: skip
    assert found.scored is not None
    names = found.scored.hypothesis.names
    return {n: (v, s) for n, v, s in zip(names, values, deviations, strict=True) if n not in HIDDEN}


def _of_mode(value: float, std: float, model: float) -> float:
    return float(np.hypot(std, model * value))
