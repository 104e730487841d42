"""Ask whether what was fitted lasts: whether it foretells the data that follow as well as its own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import select_density
from aeolid.diagnose.candidates.reestimate import estimated_on_all
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.stats.blocks import block_interval

Array = NDArray[np.float64]


def does_not_last(prepared: Prepared, winner: Candidate | None, seed: int) -> bool:
    """Tell whether the selection data are foretold clearly worse than what was fitted, with what was found in it.

    Something changes behind the fit data then, or these say too little of the values. A rope that was paid out behind
    them and a sensor's drift of which they show half were `no_mismatch`; with fit data on both sides of the selection
    data they are named. A simulator's run is not fitted to these data. Cost: none, the density is known.
    """
    stage = prepared.only(())
    if stage.surrogate is not None or stage.deadline.skips("whether the baseline lasts"):
        return False
    density = select_density(stage)
    own = stage.fit if winner is None else winner.fit
    if winner is not None:
        density = density + winner.select_difference
    return _least_lost(own.per_sample, density, seed) > in_force().selection.lasting_rate


def worsening(prepared: Prepared, unsealed: Prepared, seed: int) -> float:
    """Return by how many nats a sample, at least, both other parts are foretold worse than the fit data, bare.

    0 where what selection data add to the fit mends that of the sealed data: the fit data said too little of the values
    then (a drive's friction, 2.2 nats a sample). unsealed: the baseline fitted to all but the sealed data. Not asked of
    a simulator's run, which is not fitted. Cost: two evaluations.
    """
    stage, rules = prepared.only(()), in_force().selection
    if stage.surrogate is not None:
        return 0.0
    sealed = [stage_.predictor.score_elsewhere(stage_.fit, prepared.split.sealed)[0] for stage_ in (stage, unsealed)]
    if _least_lost(unsealed.fit.per_sample, sealed[1], seed) <= rules.lasting_rate:
        return 0.0
    return min(_least_lost(stage.fit.per_sample, other, seed) for other in (select_density(stage), sealed[0]))


def _least_lost(own: Array, other: Array, seed: int) -> float:
    """Return by how many nats a sample, at the lower end of the interval, other data are foretold worse than own."""
    return block_interval(float(own.mean()) - other, seed)[0] / len(other)


def explains_more(prepared: Prepared, winner: Candidate, other: Prepared, second: Candidate) -> bool:
    """Tell whether a second effect, found with the data divided otherwise, explains all but the sealed ones better.

    Both are fitted to the fit and selection data of their own division, which differ by gaps: compared are nats a
    sample, less half the logarithm of the samples for each value, and the difference over all of them must tell them
    apart.
    """
    found = [_nats(p, c) for p, c in ((prepared, winner), (other, second))]
    rows = [len(nats) for nats in found]
    values = [len(c.fit.free.theta) + len(c.fit.free.noise) + len(c.fit.free.gain) for c in (winner, second)]
    first, later = (float(f.mean()) - 0.5 * v * np.log(n) / n for f, v, n in zip(found, values, rows, strict=True))
    return bool((later - first) * min(rows) > in_force().selection.told_apart_nats)


def _nats(prepared: Prepared, candidate: Candidate) -> Array:
    """Return the log-density of all samples but the sealed ones, fitted to them where its values allow that."""
    found = estimated_on_all(prepared, candidate)
    if found is not candidate:
        return found.fit.per_sample
    density: Array = select_density(prepared.only(())) + candidate.select_difference
    return np.concatenate([candidate.fit.per_sample, density])
