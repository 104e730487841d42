"""Say how sure an effect's values are beside constants of the model that are not known to the last digit (S6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import NUISANCE, Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.plausible import values_of
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Prior
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import Equations

Array = NDArray[np.float64]


def beside_unsure_constants(prepared: Prepared, candidate: Candidate) -> Candidate:
    """Return a candidate whose values' deviations hold what constants of the equations leave open.

    A constant that the model does not set free is taken to be within `constant_share` of the truth, as constants are.
    The value stays, for it belongs to the model with its constants; its deviation has two parts, that of the joint fit
    of constants and effects, one Gauss-Newton step from where the fit stands, and how far that step moves the value.
    The candidate itself for models in state space, whose constants have hypotheses of their own, where no constant is
    held, or where the step is not finite. Cost: one set of sensitivities.
    """
    held = _held(prepared.declared, candidate)
    if prepared.linear is not None or candidate.fit.point.K is not None or not held:
        return candidate
    fit, deviations = _joint(candidate, held)
    if not np.all(np.isfinite(deviations)):
        return candidate
    model = candidate.predictor.compiled.model
    wider = {a.key: values_of(a, fit, model, deviations) for a in candidate.attachments}
    values = {
        key: {label: (v, max(std, wider[key].get(label, (v, std))[1])) for label, (v, std) in told.items()}
        for key, told in candidate.values.items()
    }
    return replace(candidate, values=values)


def _held(declared: Equations, candidate: Candidate) -> tuple[int, ...]:
    """Return the places of the declared constants that were not free and have a size."""
    names = {p.name for p in declared.parameters if not p.free and p.value and not p.name.startswith(NUISANCE)}
    parameters = candidate.predictor.compiled.model.parameters
    return tuple(
        i for i, p in enumerate(parameters) if p.name in names and i not in candidate.fit.free.theta
    )  # fmt: skip


def _joint(candidate: Candidate, held: tuple[int, ...]) -> tuple[Fit, Array]:
    """Return the fit with these constants free beside all else, and the deviations (k,) of what is free."""
    predictor, before = candidate.predictor, candidate.fit
    share, known = in_force().candidates.constant_share, predictor.scales.prior
    root = np.zeros((len(held), len(before.point.theta)))
    root[range(len(held)), list(held)] = 1.0 / (share * np.abs(before.point.theta[list(held)]))
    informed = predictor.informed(Prior(known.mean, np.vstack([known.root, root])))
    free = replace(before.free, theta=(*before.free.theta, *held))
    fit = informed.at(before.point, free)
    return fit, np.hypot(fit.std, fit.newton_step())
