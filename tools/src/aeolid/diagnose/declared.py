"""Say which declared values the recording contradicts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from aeolid.diagnose.candidate import Candidate, finite
from aeolid.diagnose.catalogue import entry
from aeolid.diagnose.catalogue.base import location
from aeolid.diagnose.pipeline import Study
from aeolid.diagnose.predictor import Fit
from aeolid.diagnose.prepare import NUISANCE, Prepared
from aeolid.models.equations import Equations, Parameter

SURE = 3.0  # standard deviations a declared value must have moved; data that do not determine it accuse nobody
_SPEAKS = 4.0  # nats of score from which an effect that was not proven still forbids "the structure is right"


@dataclass(frozen=True)
class Moved:
    """Hold one declared value that was re-fitted, and by how many of its standard deviations it moved."""

    parameter: Parameter
    value: float
    std: float

    @property
    def at_end(self) -> bool:
        """Tell whether the data drive the value to the end of its declared range: then the structure is not right."""
        p = self.parameter
        near = 1e-6 * (p.maximum - p.minimum)
        return bool(np.isfinite(near)) and min(self.value - p.minimum, p.maximum - self.value) <= near

    @property
    def deviations(self) -> float:
        """Return by how many standard deviations the value moved."""
        return abs(self.value - self.parameter.value) / max(self.std, 1e-300)


def moved(study: Study) -> list[Moved]:
    """Return the re-fitted declared values, the surest move first; at least one."""
    return _moved(study.prepared, study.prepared.extended, study.prepared.fit)


def _moved(prepared: Prepared, model: Equations, fit: Fit) -> list[Moved]:
    """Return the declared values as a fit in some model has them, the surest move first."""
    declared = {p.name: p for p in prepared.declared.parameters if not p.name.startswith(NUISANCE)}
    names = [model.parameters[i].name for i in fit.free.theta]
    found = [
        Moved(declared[name], float(fit.point.theta[i]), float(std))
        for name, i, std in zip(names, fit.free.theta, fit.std, strict=False)
        if name in declared
    ]
    return sorted(found, key=lambda m: -m.deviations)


def contradicted(study: Study) -> bool:
    """Tell whether declared values moved surely, and none of them to the end of its range."""
    values = moved(study)
    return values[0].deviations > SURE and not any(m.at_end for m in values if m.deviations > SURE)


def also_speaking(study: Study) -> list[Candidate]:
    """Return effects over the threshold that fit better though they were not proven, best first.

    Only those that make the declared values right again: values that move may be stand-ins for an effect (a drag of
    10 nats bent two stiffnesses and a friction; beside it, all were as declared). Where a stiffness stays 50 deviations
    off beside the effect, it is wrong whatever else there is.
    """
    loud = {r.attachment.key for r in study.bank.loud}
    found = [
        c for c in study.candidates
        if c.plausible and not c.unlisted and c.key in loud and c.fit_gain > 0 and c.score > _SPEAKS
        and c.attachments[0].entry != "parameter_error" and explains_away(study.prepared, c)
    ]  # fmt: skip
    return sorted(found, key=lambda c: -c.score)


def explains_away(prepared: Prepared, candidate: Candidate) -> bool:
    """Tell whether beside the effect no declared value is surely another than declared. Costs one prediction."""
    fit = candidate.predictor.at(candidate.fit.point, candidate.fit.free)
    return all(m.deviations <= SURE for m in _moved(prepared, candidate.predictor.compiled.model, fit))


def parameter_effect(study: Study) -> dict[str, Any]:
    """Return the effect "declared values are wrong" with what they were fitted to."""
    values = moved(study)
    sure = [m for m in values if m.deviations > SURE][:3]
    words = ", ".join(
        f"{m.parameter.name} {m.value:.4g} instead of {m.parameter.value:.4g} {m.parameter.unit}".strip() for m in sure
    )
    kind = entry("parameter_error")
    return {
        "id": kind.id, "family": kind.family,
        "statement": f"the structure is right, declared values are not: {words}",
        "location": location(f"parameter:{values[0].parameter.name}"),
        "equation": kind.equation,
        "parameters": {
            m.parameter.name: {"value": m.value, "std": finite(m.std), "unit": m.parameter.unit} for m in values
        },
        "rivals": [], "weight": 1.0,
    }  # fmt: skip
