"""Run a model free on a recording, and say how well its outputs are met where they are recorded too."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.identify.fit import Score, score
from aeolid.models.divergence import Divergence
from aeolid.models.equations import Equations
from aeolid.models.equations_names import own_names
from aeolid.models.fill_values import told_with, without_fill_values
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
    start: of equations, the first states that were estimated from the recording, by name; empty where none were.
    notes: what was done to the samples first, plain warnings.
    """

    record: Record
    y: Array
    recorded: Array | None
    score: Score | None
    divergence: Divergence | None
    start: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def run_free(model: Model, record: Record, initial: str = "estimate") -> FreeRun:
    """Run a model free on the recorded inputs.

    initial: first state: "estimate" from the recording (of equations those that the file leaves free), "model" (as the
    file has it) or "zero". Samples that read a fill value count as missing, and a note says so. Raises UsageError on
    another start or a model of outputs alone, DataError where a channel is missing, in another unit or incomplete.
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
    (known,), notes = without_fill_values([record])
    with told_with(notes):
        return replace(_run(model, at_rate_of(rate_of(model), known), initial), notes=notes)


def _run(model: Model, record: Record, initial: str) -> FreeRun:
    """Run a model free on a recording at its rate."""
    matched(record, model.inputs, own_names(model))
    first, model = model, started(model, record, initial)
    y = model.simulate(record)
    names = [s.name for s in model.outputs]
    recorded = matched(record, model.outputs) if set(names) <= {c.name for c in record.channels} else None
    fit = None if recorded is None else score(names, recorded, y)
    start = {} if initial != "estimate" or not isinstance(model, Equations) else _moved(first, model)
    return FreeRun(record, y, recorded, fit, diverged(model, record, y), start)


def started(model: Model, record: Record, initial: str = "estimate") -> Model:
    """Return equations with the first states that a free run on this recording has; other models as they are."""
    if not isinstance(model, Equations) or initial == "model":
        return model
    if initial == "zero":
        return replace(model, states=tuple(replace(s, initial=0.0) for s in model.states))
    from aeolid.models.start import with_estimated_start  # brings the compiled loops along

    return with_estimated_start(model, record)


def _moved(before: Model, after: Equations) -> dict[str, float]:
    """Return the first states that were estimated, by name."""
    old = {} if not isinstance(before, Equations) else {s.name: s.initial for s in before.states}
    return {s.name: s.initial for s in after.states if s.initial != old.get(s.name)}
