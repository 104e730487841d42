"""Ask whether the baseline of the fit data lasts: whether it foretells the data that follow as well as its own."""

from __future__ import annotations

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.race import select_density
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.stats.blocks import block_interval


def does_not_last(prepared: Prepared, seed: int) -> bool:
    """Tell whether the selection data are foretold clearly worse than what the baseline was fitted to.

    Something changes behind the fit data then, or these say too little of the values. A rope that was paid out behind
    them and a sensor's drift of which they show half were `no_mismatch`; with fit data on both sides of the selection
    data they are named. A simulator's run is not fitted to these data. Cost: none, the density is known.
    """
    stage = prepared.only(())
    if stage.surrogate is not None or stage.deadline.skips("whether the baseline lasts"):
        return False
    density = select_density(stage)
    worse = float(stage.fit.per_sample.mean()) - density
    return bool(block_interval(worse, seed)[0] > in_force().selection.lasting_rate * len(density))
