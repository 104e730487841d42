"""Find the values of an effect on all data, together, and how sure they are."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, pairwise, product

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.diagnose.run_prior.evidence import evidence_at, prior_of
from aeolid.diagnose.run_prior.explain import Found
from aeolid.diagnose.run_prior.grams import total
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, Values
from aeolid.diagnose.run_prior.operators import turning_step
from aeolid.diagnose.run_prior.pair import Change, Pair
from aeolid.diagnose.run_prior.resonances import HIDDEN

Array = NDArray[np.float64]
_FOLDS = 5  # of the whole recording, for the spread of a value
_MODEL = 0.03  # of a value: what windows of other lengths and other ridges moved lags and delays by (1 to 6 %)
_OF_FILTER = 0.05  # of a lag's or a drive's values: 17 of three turbines were told 4 % too quick (root mean square)
_OF_FREQUENCY = 0.005  # of a frequency
_FILTERED = ("tau_s", "omega_rad_s", "damping")
_TURN = 0.1  # of a sample's change at a turn: what a width may be off (a rig of 0.30: 0.27 to 0.33, as turns are taken)
_INTERPOLATION = 0.15  # of a sample: what a time may be off where the signal between samples is unknown
_STEP, _STEP_HZ, _STEP_S = 0.06, 0.015, 0.2  # between points: shares of a value, of a frequency; of a sample
_ROUNDS = 4  # of points, each about the peak of the one before where that lies at their end
_FLAT = 1e-9  # curvature of the evidence, of the largest, that tells nothing


def values_of(pair: Pair, ridge: Array, found: Found, others: Change) -> tuple[Values, Values]:
    """Return the values of an effect on all data and their standard deviations.

    The values are where the evidence of all data peaks in all of them together; a deviation is that of the jackknife
    over five parts, the curvature's where that is larger, 3 % for the model, and for the signal between samples 0.15
    samples of a time or a tenth of a sample's change at the turns of a width. What two values share (frequency and
    damping of a drive, of which the data tell the delay alone) is in the deviation of both.
    """
    if found.scored is None:
        return (), ()
    h = found.scored.hypothesis
    if not h.names:
        return (), ()
    values, spread = _peak(pair, found, others, ridge)
    deviations = []
    for place, name in enumerate(h.names):
        between = _between_samples(pair, h, place)
        filtered = name in _FILTERED and "frequency_hz" not in h.names  # a mode's damping is no filter's
        model = _OF_FREQUENCY if name == "frequency_hz" else _OF_FILTER if filtered else _MODEL
        deviations.append(float(np.sqrt(spread[place] ** 2 + (model * values[place]) ** 2 + between**2)))
    return tuple(float(v) for v in values), tuple(deviations)


def _between_samples(pair: Pair, h: Hypothesis, place: int) -> float:
    """Return how far off a value may be because the signal between samples is unknown."""
    if h.units[place] == "s":
        return _INTERPOLATION * pair.step
    if h.names[place] != "width":
        return 0.0
    i = pair.inputs.index(h.place.partition(":")[2])
    return _TURN * float(np.mean([turning_step(s.u[:, i]) for s in pair.recordings]))


def _peak(pair: Pair, found: Found, others: Change, ridge: Array) -> tuple[Array, Array]:
    """Return where the evidence peaks (k,), and the deviations (k,), by quadratics through points around the peak."""
    assert found.scored is not None
    h = found.scored.hypothesis
    low, high = np.array(h.low), np.array(h.high)
    centre = np.array(found.scored.values, dtype=float)
    grid = _design(len(centre))
    for _ in range(_ROUNDS):
        steps = np.array([_step(pair, h, place, centre[place]) for place in range(len(centre))])
        points = np.clip(centre + grid * steps, low, high)
        table = _evidences(pair, found, others, ridge, points)
        x = (points - centre) / steps
        peak, spread = quadratic_peak(x, table[0])
        at = np.clip(centre + peak * steps, low, high)
        if np.all(np.abs(peak) < 2) or np.array_equal(at, centre):
            break
        centre = at
    folds = np.array([quadratic_peak(x, row)[0] for row in table[1:]])
    jackknife = np.sqrt((_FOLDS - 1) / _FOLDS * np.sum((folds - folds.mean(axis=0)) ** 2, axis=0))
    return at, np.maximum(jackknife, spread) * steps


def _step(pair: Pair, h: Hypothesis, place: int, value: float) -> float:
    share = _STEP_HZ if h.names[place] == "frequency_hz" else _STEP
    return max(share * abs(value), _STEP_S * pair.step if h.units[place] == "s" else 0.0, 1e-12)


def _design(values: int) -> Array:
    """Return points in steps (m, values): the middle, one and two to each side of every value, the corners of pairs."""
    points = [np.zeros(values)]
    for place in range(values):
        points += [way * np.eye(values)[place] for way in (-2.0, -1.0, 1.0, 2.0)]
    for pair in combinations(range(values), 2):
        for ways in product((-1.0, 1.0), repeat=2):
            corner = np.zeros(values)
            corner[list(pair)] = ways
            points.append(corner)
    return np.array(points)


def _evidences(pair: Pair, found: Found, others: Change, ridge: Array, points: Array) -> Array:
    """Return the evidence (1 + folds, m) at points (m, k): of all data, and without each of their parts."""
    assert found.scored is not None
    h, weight = found.scored.hypothesis, found.scored.weight
    edges = np.linspace(0.0, 1.0, _FOLDS + 1)
    table = np.empty((_FOLDS + 1, len(points)))
    for j, point in enumerate(points):
        change = h.change(tuple(float(v) for v in point)).after(others)
        prior = prior_of(pair.of_runs(change), ridge)
        parts = [pair.of_recordings(change, float(a), float(b)) for a, b in pairwise(edges)]
        table[0, j] = evidence_at(prior, total(parts), weight)
        for i in range(_FOLDS):
            rest = total([p for k, p in enumerate(parts) if k != i])
            table[i + 1, j] = evidence_at(prior, rest, weight)
    return table


def quadratic_peak(x: Array, y: Array) -> tuple[Array, Array]:
    """Return where a quadratic through points x (m, k) with evidence y (m,) peaks, and its deviations (k,), in steps.

    Along directions in which the evidence does not fall the peak stays at the middle, and tells no deviation.
    """
    k = x.shape[1]
    pairs = [(i, j) for i in range(k) for j in range(i, k)]
    columns = np.column_stack([np.ones(len(x)), x, *(x[:, i] * x[:, j] for i, j in pairs)])
    found = lstsq(columns, y)
    slope, H = found[1 : k + 1], np.zeros((k, k))
    for (i, j), c in zip(pairs, found[k + 1 :], strict=True):
        H[i, j] += c
        H[j, i] += c
    sizes, ways = np.linalg.eigh(-H)
    falls = sizes > _FLAT * max(float(np.abs(sizes).max()), 1e-300)
    ways, sizes = ways[:, falls], sizes[falls]
    peak = ways @ ((ways.T @ slope) / sizes)
    return np.clip(peak, -3.0, 3.0), np.sqrt((ways**2 / sizes).sum(axis=1))


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
