"""Hold an explanation against the sealed part of the recordings."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.run_prior.evidence import evidence_at, posterior, prior_of
from aeolid.diagnose.run_prior.explain import Explanation
from aeolid.diagnose.run_prior.grams import total
from aeolid.diagnose.run_prior.pair import NOTHING, Change, Pair
from aeolid.diagnose.run_prior.search import FIT

Array = NDArray[np.float64]
TRUST = 0.3  # weight of the run on the sealed part
_BLOCKS = 6  # of the sealed part, each foretold from all before it
_Z90 = 1.6449


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
    has nothing to gain. Where the effect is a mode that the runs lack, after weighs the run as the data of the fit ask
    for; one that adds little to errors one row ahead may be proven by how it stands out of the sealed part's spectra
    beside its own frequency. ceiling: what that weight gains.
    """
    edges = np.linspace(FIT, 1.0, _BLOCKS + 1)
    own = any(f.mode is not None or (f.standing is not None and f.standing.own) for f in explanation.found)
    apart = [f.standing for f in explanation.found if f.standing is not None and not f.standing.own]
    trust = float(np.clip(explanation.after, TRUST, 1.0)) if np.isfinite(explanation.after) else TRUST
    bare = _foretold(pair, NOTHING, ridge, edges, trust)
    freed = _foretold(pair, NOTHING, ridge, edges, explanation.weight)
    only = all(f.scored is None for f in explanation.found) and bool(explanation.found)  # the model is the recordings'
    change = explanation.change
    weight = explanation.weight if own or only else trust
    as_is = change is NOTHING and (own or only)
    full = freed if as_is else _foretold(pair, change, ridge, edges, weight)
    gains = np.zeros(_BLOCKS) if only and not own else full.nats - bare.nats
    spread = _Z90 * float(np.sqrt(len(gains)) * gains.std(ddof=1))
    spread = float(np.hypot(spread, np.sqrt(sum((s.nats - s.interval[0]) ** 2 for s in apart))))
    gain = float(gains.sum()) + sum(s.nats for s in apart)
    interval = (gain - spread, gain + spread)
    for rise in (f.rise for f in explanation.found if f.rise is not None):
        if rise.proof[1][0] > interval[0]:
            gain, interval = rise.proof
    ceiling = max(gain, float(np.sum(freed.nats - bare.nats)))
    series = {} if not explanation.found else _series(pair, bare, full, change)
    return RunProof(gain, interval, bare.errors(pair), full.errors(pair), ceiling, series)


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
    """Return by output what was measured and foretold one step ahead in the sealed part of each recording in turn.

    Keys: time_s, stretch (from 1, in the order of the recordings), measured, before, after.
    """
    found: dict[str, dict[str, object]] = {}
    parts = [pair.predicted(s, NOTHING, bare.theta[s.region], FIT) for s in pair.recordings]
    changed = [pair.predicted(s, change, full.theta[s.region], FIT)[2] for s in pair.recordings]
    time_s, measured, before = (np.concatenate(column) for column in zip(*parts, strict=True))
    after = np.concatenate(changed)
    stretch = np.repeat(np.arange(1, len(parts) + 1), [len(p[0]) for p in parts])
    for j, name in enumerate(pair.shown):
        columns = {"measured": measured, "before": before, "after": after}
        found[name] = {"time_s": time_s.tolist(), "stretch": stretch.tolist()}
        found[name] |= {k: v[:, j].tolist() for k, v in columns.items()}
        if pair.stride > 1:
            found[name]["mean_of_s"] = pair.block_s
    return found
