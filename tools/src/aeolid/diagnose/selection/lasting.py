"""Ask whether what was fitted lasts: whether it foretells the data that follow as well as its own."""

from __future__ import annotations

import numpy as np

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import select_density
from aeolid.diagnose.candidates.reestimate import estimated_on_all
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.stats.blocks import block_interval


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
    worse = float(own.per_sample.mean()) - density
    return bool(block_interval(worse, seed)[0] > in_force().selection.lasting_rate * len(density))


def explains_more(prepared: Prepared, winner: Candidate, other: Prepared, second: Candidate) -> bool:
    """Tell whether a second effect, found with the data divided otherwise, explains all but the sealed ones better.

    Both are fitted to the fit and selection data of their own division, which differ by gaps: compared are nats a
    sample, less half the logarithm of the samples for each value, and the difference over all of them must tell them
    apart.
    """
    found = [estimated_on_all(p, c).fit for p, c in ((prepared, winner), (other, second))]
    rows = [len(f.per_sample) for f in found]
    values = [len(f.free.theta) + len(f.free.noise) + len(f.free.gain) for f in found]
    first, later = (
        float(f.per_sample.mean()) - 0.5 * v * np.log(n) / n for f, v, n in zip(found, values, rows, strict=True)
    )
    return bool((later - first) * min(rows) > in_force().selection.told_apart_nats)
