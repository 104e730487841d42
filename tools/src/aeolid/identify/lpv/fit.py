"""Measure how well a scheduled model fits recordings: one step, k steps and free run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.fit import LONGEST, NONE, SHORTEST, Fit, count_complete, score, score_one_step
from aeolid.identify.residuals import run_residual_tests
from aeolid.models.lpv import LpvStateSpace, with_one
from aeolid.models.lpv_prediction import estimate_initial_state, lpv_stretches, predict
from aeolid.record import Record

Array = NDArray[np.float64]


def measure_lpv_fit(model: LpvStateSpace, records: Sequence[Record], steps: Sequence[int] = ()) -> tuple[Fit, Array]:
    """Predict and simulate the recordings; returns the fit, and u (N, r) of the samples its innovations belong to.

    steps: horizons k > 1. Each stretch starts from its own estimated state, and runs through short gaps of the
    outputs; at most 200 000 samples of each recording are used. Raises NotIdentifiable where no stretch is left.
    """
    parts: list[tuple[Array, ...]] = []
    for record in records:
        head = record.slice(0, LONGEST) if len(record) > LONGEST else record
        for u, y, s in lpv_stretches(model, head, SHORTEST):
            with np.errstate(all="ignore"):  # an unstable model may overflow: its score is then not finite
                x0 = estimate_initial_state(model, u - model.u_offset, y - model.y_offset, with_one(s))
                ahead = [predict(model, u, y, s, k, x0) for k in (1, *steps)]
                parts.append((u, y, model.simulate(u, s, x0), *ahead))
    if not parts:
        raise NotIdentifiable(f"{records[0].source}: {NONE}")
    u, y, free, one, *later = (np.concatenate(column) for column in zip(*parts, strict=True))
    names = [s.name for s in model.outputs]
    scores = [score(names, y, estimate) for estimate in later]
    lengths = tuple(len(part[0]) for part in parts)
    ahead_by = dict(zip(steps, scores, strict=True))
    first = score_one_step(names, y, one, model.order, lengths)
    fit = Fit(count_complete(y), first, score(names, y, free), ahead_by, y - one, lengths=lengths)
    return fit, u


def is_white(model: LpvStateSpace, fit: Fit, u: Array) -> bool:
    """Say whether the innovations of a fit follow neither their own past nor that of the inputs u (N, r).

    Where the stretches are too short for a test, nothing speaks against it.
    """
    outputs, inputs = (tuple(s.name for s in signals) for signals in (model.outputs, model.inputs))
    found = run_residual_tests(fit.innovations, u, outputs, inputs, lengths=fit.lengths, order=model.order)
    return found.verdict != "fail"
