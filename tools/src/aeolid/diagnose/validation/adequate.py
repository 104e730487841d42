"""Ask whether the model without any effect predicts as well as any need be."""

from __future__ import annotations

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.simulated_share import is_static
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.validation.proof import Proof, prove, seen_before


def is_adequate_alone(prepared: Prepared, unsealed: Prepared, seed: int) -> bool:
    """Tell whether the fitted model errs, at every horizon and on all data, by no more than any model's constants do.

    What is missing may then be certain, but nobody would see it: geared motors, carts, pendulums with a dry friction of
    a thousandth of their torque err by 0.3 to 1.7 % of the outputs' spread over any time ahead, and one in five was
    `unnamed`; with an effect that matters the error is 10 % and more. Not asked of a simulator's run, which is not
    fitted. Cost: two evaluations, of which the second only where the sealed data are predicted so well.
    """
    if prepared.surrogate is not None:
        return False
    bare, static = (unsealed.predictor, unsealed.fit), is_static(prepared)
    seen = seen_before((*prepared.split.fit, *prepared.split.select), prepared.settle_s)
    parts = (prepared.split.sealed, seen)
    return all(largest_error(prove(bare, bare, part, prepared.settle_s, seed), static) <= _most() for part in parts)


def largest_error(proof: Proof, static: bool) -> float:
    """Return the largest error before the correction of any output, of its spread; of a static law without horizons."""
    errors = list(proof.nrmse_before.values())
    for rows in () if static else proof.profile.values():
        errors += rows["before"]
    return max(errors)


def _most() -> float:
    return in_force().validation.unseen_spread_share
