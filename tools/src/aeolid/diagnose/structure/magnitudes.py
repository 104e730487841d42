"""Find typical magnitudes of a model's states, also of those that no input moves and no initial value tells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from aeolid.models.integrate import Compiled, numeric_jacobian, output_jacobian

Array = NDArray[np.float64]
_MOST_SAMPLES = 2000  # of a response that is followed
_RUNAWAY = 1e3  # times its first value: an unstable response says no more


def visible_sizes(compiled: Compiled, u: Array, spreads: Array, step: float, horizon_s: float) -> Array:
    """Return (n,) how far each state must start from rest so that some output answers by its spread at the peak.

    A wind that is no input and starts at 0 has no size otherwise: its noise was then 1e-10 m/s, the state was as good
    as absent, and other states had to take its place. Where nothing is seen of a state (or the equations have no
    slope at their start) its initial value tells, else 1. u (r,): where the inputs are; cost: horizon_s / step
    products of n × n.
    """
    model = compiled.model
    told = np.array([abs(s.initial) or 1.0 for s in model.states])
    J, C = numeric_jacobian(compiled, model.x0, u, model.theta), output_jacobian(compiled, model.x0, u, model.theta)
    if not len(J) or not np.all(np.isfinite(J)) or not np.all(np.isfinite(C)):
        return told
    with np.errstate(over="ignore", invalid="ignore"):
        A = J if model.sample_time_s else expm(J * step)
    if not np.all(np.isfinite(A)):  # it runs away within a sample
        return told
    shown = C / spreads[:, None]
    peak = np.max(np.abs(shown), axis=0)
    growth = max(float(np.max(np.abs(np.linalg.eigvals(A)))), 1.0 + 1e-9)
    for _ in range(round(min(max(horizon_s / step, 1), _MOST_SAMPLES, np.log(_RUNAWAY) / np.log(growth)))):
        shown = shown @ A
        peak = np.maximum(peak, np.max(np.abs(shown), axis=0))
    seen = peak > 1e-12 * np.max(peak, initial=0.0)
    result: Array = np.where(seen, 1.0 / np.where(seen, peak, 1.0), told)
    return result
