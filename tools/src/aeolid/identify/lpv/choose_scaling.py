"""Choose how the scheduling is centred and scaled, by what the subspace model does on the part it has not seen."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aeolid.errors import UsageError
from aeolid.identify.lpv.data import SCALINGS

AUTO = "auto"
GAIN = 0.02  # of the log error power, by which another scaling must beat the default


def check_scaling(rule: str) -> None:
    """Refuse a scaling of the scheduling that does not exist; raises UsageError that names the option."""
    if rule not in (AUTO, *SCALINGS):
        raise UsageError(f"scheduling scaling {rule!r} is none of {', '.join((AUTO, *SCALINGS))}")


def choose_scaling(loss_of: Callable[[str], float]) -> tuple[str, str]:
    """Return the scaling with the lowest loss on what was held out, and why in a sentence.

    loss_of: mean log error power of a scaling's model, infinite where there is none. The first of SCALINGS, the
    default, stays unless another is lower by GAIN: a scaling changes what the penalty spares, not the class of models,
    and smaller differences are chance.

    >>> choose_scaling({"range": -2.0, "none": -2.5, "centre": -2.1, "standard": -2.0}.get)[0]
    'none'
    >>> choose_scaling(lambda rule: float("inf"))[0]
    'range'
    """
    losses = {rule: loss_of(rule) for rule in SCALINGS}
    default = SCALINGS[0]
    best = min(losses, key=lambda rule: losses[rule])
    chosen = best if losses[best] < losses[default] - GAIN else default
    if not np.isfinite(losses[best]):
        return default, f"scheduling scaled by {default}: no scaling gives a model that predicts"
    told = ", ".join(f"{rule} {loss:.3f}" for rule, loss in losses.items())
    return chosen, f"scheduling scaled by {chosen}: log error power {told}"
