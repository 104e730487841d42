"""Screen all hypotheses of a pair, refine the best, and hold each gain against what the run itself would gain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.evidence import Evidence, covariance_at, evidence, lost_by, prior_of, shrinkage_of
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, Values
from aeolid.diagnose.run_prior.pair import NOTHING, Change, Pair
from aeolid.errors import NotIdentifiable

Array = NDArray[np.float64]
FIT = 0.7  # of each recording in which hypotheses are chosen and fitted; the rest is sealed
_KEPT = 8  # hypotheses that are refined
_WIDE = 0.35  # of two and more values, the first step of their search


@dataclass(frozen=True, eq=False)
class Scored:
    """Hold what a hypothesis gains: nats of surplus, its values, the weight of the run with it, and the raw gain."""

    hypothesis: Hypothesis
    values: Values
    nats: float
    raw: float
    weight: float

    @property
    def change(self) -> Change:
        """Return what it does to the data."""
        return self.hypothesis.change(self.values)


class Search:
    """Evaluate hypotheses on one part of a pair, behind what was found before.

    found: the change that stands already. Evaluations of one pair share the run's moments.
    """

    def __init__(self, pair: Pair, found: Change = NOTHING, last: float = FIT) -> None:
        """Form the moments of run and recordings and the evidence without a hypothesis."""
        self.pair, self.found, self.last = pair, found, last
        whole = pair.of_runs(found)
        channels = pair.held + len(pair.shown)
        self.ridge = shrinkage_of(whole, pair.past, channels)
        self.prior = prior_of(whole, self.ridge)
        self.recorded = pair.of_recordings(found, 0.0, last)
        self.base: Evidence = evidence(self.prior, self.recorded)
        self._half = prior_of(pair.of_runs(found, 0.0, 0.5), self.ridge)
        self._other = evidence(self._half, pair.of_runs(found, 0.5, 1.0))
        self._share = self.recorded.count / max(pair.of_runs(found, 0.5, 1.0).count, 1)
        self.evaluations = 0
        self.tried: dict[str, tuple[Hypothesis, tuple[tuple[Values, float], ...]]] = {}

    @property
    def lost(self) -> float:
        """Return the nats that the recordings lose when the run counts fully, or more than that."""
        return lost_by(self.prior, self.recorded, self.base)

    def unsteady(self) -> float:
        """Return the most nats that one half of the runs, or of the recordings, loses when the other counts fully.

        Halves of one side differ by nothing but the wind; nats go with the number of windows, here the recordings' at
        most. A side whose halves are too short for the windows tells nothing.
        """
        pair, last, most = self.pair, self.last, 0.0
        for of, edges in ((pair.of_runs, (0.0, 0.5, 1.0)), (pair.of_recordings, (0.0, 0.5 * last, last))):
            try:
                early, late = (of(NOTHING, a, b) for a, b in pairwise(edges))
            except NotIdentifiable:
                continue
            for known, new in ((early, late), (late, early)):
                prior = prior_of(known, self.ridge)
                lost = lost_by(prior, new, evidence(prior, new, self.base.weight))
                most = max(most, lost * min(1.0, self.recorded.count / new.count))
        return most

    def covariance_at(self, weight: float) -> Array:
        """Return the covariance (l, l) of the innovations when the run has a weight."""
        return covariance_at(self.prior, self.recorded, weight)

    def gain(self, h: Hypothesis, values: Values) -> tuple[float, float]:
        """Return the gain in nats over the evidence without it, and the weight of the run."""
        self.evaluations += 1
        own = h.change(values)
        change = own.after(self.found)
        prior = self.prior if own.is_of_recordings else prior_of(self.pair.of_runs(change), self.ridge)
        recorded = self.recorded
        if own.inputs or own.extra is not None:
            recorded = self.pair.of_recordings(change, 0.0, self.last)
        found = evidence(prior, recorded, self.base.weight)
        return found.nats - self.base.nats, found.weight

    def evidence_of(self, change: Change) -> float:
        """Return the log evidence when a change of the runs alone stands behind what was found."""
        self.evaluations += 1
        prior = prior_of(self.pair.of_runs(change.after(self.found)), self.ridge)
        return evidence(prior, self.recorded, self.base.weight).nats

    def control(self, h: Hypothesis, values: Values) -> float:
        """Return what the same change gains on the run alone: its second half under its first, both changed.

        A change that brings information back which blocks have lost gains there, too; it is no effect. Nor is a load
        that turns with the rotor and that the runs have themselves, unless the recordings' is far larger: how much of
        it there is goes with the wind.
        """
        change = h.change(values)
        if change.extra is not None and any(s.turned is None for s in self.pair.runs):
            return np.inf
        if not change.inputs and change.extra is None:
            return 0.0
        behind = change.after(replace(self.found, inputs={}, extra=None))  # what stands is done to the runs' outputs
        prior = prior_of(self.pair.of_runs_changed(replace(behind, extra=None), 0.0, 0.5), self.ridge)
        changed = evidence(prior, self.pair.of_runs_changed(behind, 0.5, 1.0), self._other.weight)
        times = 1.0 if change.extra is None else in_force().run_prior.own_load_times
        return max(0.0, times * self._share * (changed.nats - self._other.nats))

    def screen(self, hypotheses: Sequence[Hypothesis], tick: Callable[[str], None] = lambda _: None) -> list[Scored]:
        """Return the best grid value of every hypothesis, best first."""
        found = []
        for h in hypotheses:
            tick(h.key)
            gains = [(*self.gain(h, v), v) for v in h.grid]
            self.tried[h.key] = h, tuple((v, raw) for raw, _, v in gains)
            raw, weight, values = max(gains, key=lambda g: g[0])
            found.append(Scored(h, values, raw, raw, weight))
        return sorted(found, key=lambda s: -s.nats)

    def refine(self, screened: Sequence[Scored], tick: Callable[[str], None] = lambda _: None) -> list[Scored]:
        """Return the best hypotheses with values that maximise the evidence, and their surplus over the control."""
        rules = in_force().run_prior
        top = max((s.nats for s in screened), default=0.0)
        chosen = [s for s in screened if s.nats > max(rules.refined_nats, rules.refined_share * top)][:_KEPT]
        found = []
        for s in chosen:
            tick(s.hypothesis.key)
            best = self._maximised(s)
            found.append(replace(best, nats=best.raw - self.control(best.hypothesis, best.values)))
        return sorted(found, key=lambda s: -s.nats)

    def _maximised(self, s: Scored) -> Scored:
        h = s.hypothesis
        if not h.names:
            return s
        low, high = np.array(h.low), np.array(h.high)
        to = (np.log, np.exp) if h.scaled else (np.asarray, np.asarray)
        best = s

        def loss(x: Array) -> float:
            nonlocal best
            values = tuple(float(v) for v in np.clip(to[1](np.atleast_1d(x)), low, high))
            raw, weight = self.gain(h, values)
            if raw > best.raw:
                best = Scored(h, values, raw, raw, weight)
            return -raw

        start = to[0](np.array(s.values))
        if len(start) == 1:
            around = self._around(h, s.values[0])
            fine = 0.01 if h.scaled else 0.01 * self.pair.block_s
            ends = tuple(to[0](np.array(around)))
            minimize_scalar(loss, bounds=ends, method="bounded", options={"xatol": fine, "maxiter": 12})
        else:
            steps = h.steps or (_WIDE,) * len(start)
            simplex = np.vstack([start, start + np.diag(steps)])
            minimize(loss, start, method="Nelder-Mead",
                     options={"initial_simplex": simplex, "xatol": 0.02, "fatol": 0.3, "maxfev": 40})  # fmt: skip
        return best

    def _around(self, h: Hypothesis, value: float) -> tuple[float, float]:
        """Return the neighbours of a grid value, or the ends of the range."""
        grid = sorted(v[0] for v in h.grid)
        k = grid.index(value)
        below = grid[k - 1] if k else max(h.low[0], value / 4 if h.scaled else h.low[0])
        above = grid[k + 1] if k + 1 < len(grid) else min(h.high[0], value * 4 if h.scaled else h.high[0])
        return float(below), float(above)
