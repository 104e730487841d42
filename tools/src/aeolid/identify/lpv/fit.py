"""Measure how well a scheduled model fits recordings: one step, k steps and free run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.fit import LONGEST, SHORTEST, Fit, score
from aeolid.models.lpv import LpvStateSpace, with_one
from aeolid.models.lpv_prediction import estimate_initial_state, lpv_stretches, predict
from aeolid.record import Record

Array = NDArray[np.float64]


def measure_lpv_fit(model: LpvStateSpace, records: Sequence[Record], steps: Sequence[int] = ()) -> tuple[Fit, Array]:
    """Predict and simulate the recordings; returns the fit, and u (N, r) of the samples its innovations belong to.

    steps: horizons k > 1. Each complete stretch starts from its own estimated state; at most 200 000 samples of each
    recording are used. Raises NotIdentifiable where no complete stretch is left.
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
        raise NotIdentifiable(f"{records[0].source}: no {SHORTEST} samples in a row without a missing value")
    u, y, free, one, *later = (np.concatenate(column) for column in zip(*parts, strict=True))
    names = [s.name for s in model.outputs]
    scores = [score(names, y, estimate) for estimate in later]
    fit = Fit(len(y), score(names, y, one), score(names, y, free), dict(zip(steps, scores, strict=True)), y - one)
    return fit, u
