"""Say by how much re-fitted values have moved from what the model declares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.nuisance import is_nuisance
from aeolid.models.equations import Equations, Parameter


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
        return self.distance / max(self.std, 1e-300)

    @property
    def is_wrong(self) -> bool:
        """Tell whether the declared value is surely another, by more than values of models are known."""
        rules = in_force().candidates
        evidence = in_force().evidence
        far = self.distance > rules.material_share * abs(self.parameter.value)
        return self.deviations > evidence.moved_deviations and far

    @property
    def distance(self) -> float:
        """Return by how much the value moved, in its own unit."""
        return abs(self.value - self.parameter.value)


def moved_in(declared: Equations, model: Equations, fit: Fit) -> list[Moved]:
    """Return the declared values as a fit in some model has them, the surest move first; fit: with sensitivities."""
    values = {p.name: p for p in declared.parameters if not is_nuisance(p.name)}
    names = [model.parameters[i].name for i in fit.free.theta]
    found = [
        Moved(values[name], float(fit.point.theta[i]), float(std))
        for name, i, std in zip(names, fit.free.theta, fit.std, strict=False)
        if name in values
    ]
    return sorted(found, key=lambda m: -m.deviations)
