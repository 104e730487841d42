"""Run a model free on a recording, and say how well its outputs are met where they are recorded too."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.identify.fit import Score, score
from aeolid.models.divergence import Divergence
from aeolid.models.load import LinearModel, Model, diverged, matched
from aeolid.models.lpv_prediction import LpvModel
from aeolid.models.rate import at_rate_of, rate_of
from aeolid.record import Record

Array = NDArray[np.float64]
STARTS = ("estimate", "model", "zero")


@dataclass(frozen=True, eq=False)
class FreeRun:
    """Hold a free run: the recording at the model's rate, the outputs (N, l) and what was recorded of them.

    recorded (N, l) and score are None where an output is not among the channels; divergence where nothing diverges.
    """

    record: Record
    y: Array
    recorded: Array | None
    score: Score | None
    divergence: Divergence | None


def run_free(model: Model, record: Record, initial: str = "estimate") -> FreeRun:
    """Run a model free on the recorded inputs.

    initial: first state of a state-space model: "estimate" from the recording, "model" (x0 of the file) or "zero".
    Raises UsageError on another start or a
    model of outputs alone, DataError where a channel is missing, in another unit or incomplete.
    """
    if initial not in STARTS:
        raise UsageError(f"--initial {initial!r} is none of {', '.join(STARTS)}")
    if isinstance(model, LinearModel | LpvModel):
        model = replace(model, initial=initial)
    if isinstance(model, LinearModel) and not model.inputs and model.state_space.K is not None:
        raise UsageError(
            "the model has no input: identified from outputs alone it tells modes and predicts from the past (aeolid "
            "validate), and has nothing to run on"
        )
    record = at_rate_of(rate_of(model), record)
    matched(record, model.inputs)
    y = model.simulate(record)
    names = [s.name for s in model.outputs]
    recorded = matched(record, model.outputs) if set(names) <= {c.name for c in record.channels} else None
    fit = None if recorded is None else score(names, recorded, y)
    return FreeRun(record, y, recorded, fit, diverged(model, record, y))
