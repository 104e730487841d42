"""Hold a refined model against the one it was refined from, on the recordings and in their units; keep the better.

The steps of `refine` are judged by prediction errors about a constant that each model may choose. What a user runs is
the model itself: its constants become an operating point, and a free run sees poles that a prediction hardly does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.fit import Fit, measure_fit
from aeolid.identify.refine import Refinement
from aeolid.identify.subspace import ScaledModel
from aeolid.models.state_space import StateSpace
from aeolid.record import Record

Array = NDArray[np.float64]
WORSE_ONE_STEP = 1.01  # of the error before: the steps lower just this one, a model that raises it has failed
WORSE_FREE_RUN = 1.25  # of the error before: steps trade some of it for prediction, where noise is large
EXACT = 1e-6  # of an output's deviation: errors below it are rounding, whichever is larger


def keep_better(
    done: Refinement | None, before: tuple[ScaledModel, Array], records: Sequence[Record],
    in_units: Callable[[ScaledModel, Array], StateSpace],
) -> Refinement | None:  # fmt: skip
    """Return the refinement, with no step left of it where its model fits the recordings worse.

    before: the model it began from and its outputs at rest (l,), scaled; records: what the fit is taken on; in_units:
    turns a scaled model and its rest into one of the channels' units. The errors held against each other are the means
    over the outputs of rms error over standard deviation, one step ahead and in free run.
    """
    if done is None or not done.steps:
        return done
    pairs = (before, (done.model, done.equilibrium()))
    first, last = (_errors(measure_fit(in_units(*pair), records)) for pair in pairs)
    for name, old, new, worst in zip(
        ("one-step", "free-run"), first, last, (WORSE_ONE_STEP, WORSE_FREE_RUN), strict=True
    ):
        if new <= max(worst * old, EXACT):
            continue
        said = "" if done.held_out_error is None else (
            f", although on the held-out part it went from {done.held_out_error[0]:.4g} to {done.held_out_error[1]:.4g}"
        )  # fmt: skip
        stopped = (
            f"{done.steps} prediction-error steps take the {name} error on the recordings from {old:.4g} to {new:.4g} "
            f"standard deviations{said}; the model before them is kept"
        )
        zero = np.zeros_like(done.constant)
        return replace(done, model=before[0], constant=zero, steps=0, gain=0.0, root=None, stopped=stopped)
    return done


def _errors(fit: Fit) -> tuple[float, float]:
    """Return the geometric means over the outputs of the one-step and of the free-run error, infinite for none."""
    out = []
    for score in (fit.one_step, fit.free_run if fit.driven else fit.one_step):
        errors = np.array(list(score.nrmse.values()))
        good = np.isfinite(errors).all()
        out.append(float(np.exp(np.mean(np.log(np.maximum(errors, 1e-300))))) if good else float("inf"))
    return out[0], out[1]
