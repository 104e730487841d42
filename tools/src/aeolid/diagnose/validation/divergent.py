"""Run the corrected model free over the recordings: one that diverges is never handed over without a word."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aeolid.models.divergence import Divergence, divergence_of
from aeolid.models.equations import TIME, Equations
from aeolid.models.integrate import compile_equations, free_run
from aeolid.models.prediction import complete_stretches
from aeolid.record import Record

_SHORTEST = 10  # samples with all inputs; in fewer nothing has time to diverge


@dataclass(frozen=True)
class Diverging:
    """Hold how the corrected model's free run diverges, and on which recording."""

    source: str
    divergence: Divergence

    def text(self) -> str:
        """Return one sentence that says what happens and what the model is good for."""
        what = self.divergence.text().rstrip(".")
        return (
            f"The corrected model diverges in a free run on {self.source}: {what}. Its predictions one step ahead stand"
            " as they were tested; do not simulate with it."
        )

    def to_json(self) -> dict[str, Any]:
        """Return the facts for machines."""
        return {"recording": self.source} | self.divergence.to_json() | {"text": self.text()}


def diverging(model: Equations, records: Sequence[Record]) -> Diverging | None:
    """Return how a model's free run diverges on the longest stretch of a recording; None where none does.

    records: with all channels that the model's inputs are, at its rate. Cost: one free run of each.
    """
    compiled = compile_equations(model)
    for record in records:
        known = {TIME, *(c.name for c in record.channels)}
        if any(s.name not in known for s in model.inputs):
            continue  # nothing to run it on
        u = model.inputs_of(record)
        runs = complete_stretches(np.column_stack([u, record.time_s]), _SHORTEST)
        if not runs:
            continue
        start, stop = max(runs, key=lambda r: r[1] - r[0])
        part = record.slice(start, stop)
        y = free_run(compiled, u[start:stop], model.theta, model.x0, part.sample_time_s)
        found = divergence_of(y, part, model.outputs)
        if found is not None:
            return Diverging(record.source, found)
    return None
