"""Say how sure an effect's values are beside constants of the model that are not known to the last digit (S6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.moved import Moved, moved_in
from aeolid.diagnose.candidates.plausible import values_of
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Prior
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.nuisance import is_nuisance
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
    if prepared.linear is not None or candidate.fit.point.K is not None:
        return candidate
    found = _joint(prepared.declared, candidate.predictor, candidate.fit)
    if found is None:
        return candidate
    fit, deviations = found
    model = candidate.predictor.compiled.model
    wider = {a.key: values_of(a, fit, model, deviations) for a in candidate.attachments}
    values = {
        key: {label: (v, max(std, wider[key].get(label, (v, std))[1])) for label, (v, std) in told.items()}
        for key, told in candidate.values.items()
    }
    return replace(candidate, values=values)


def declared_beside_constants(stage: Prepared) -> tuple[Moved, ...]:
    """Return the declared values that a stage's fit has free, the surest move first, with deviations of the same kind.

    A damping of the tower stands beside that of the air, which is eight times as large: with the latter 1.5 % off the
    former was told to be 13 % too large, by three deviations, on two recordings that hide nothing.
    """
    model, fit = stage.extended, stage.fit
    found = (
        None if stage.linear is not None or fit.point.K is not None else _joint(stage.declared, stage.predictor, fit)
    )
    moved = moved_in(stage.declared, model, fit)
    if found is None:
        return tuple(moved)
    places = {model.parameters[i].name: k for k, i in enumerate(found[0].free.theta)}
    wider = [replace(m, std=max(m.std, float(found[1][places[m.parameter.name]]))) for m in moved]
    return tuple(sorted(wider, key=lambda m: -m.deviations))


def _joint(declared: Equations, predictor: Predictor, before: Fit) -> tuple[Fit, Array] | None:
    """Return the fit with the held constants free beside all else, and the deviations (k,) of what is free.

    None where the model holds none, or where the step is not finite.
    """
    names = {p.name for p in declared.parameters if not p.free and p.value and not is_nuisance(p.name)}
    parameters = enumerate(predictor.compiled.model.parameters)
    held = [i for i, p in parameters if p.name in names and i not in before.free.theta]
    if not held:
        return None
    share, known = in_force().candidates.constant_share, predictor.scales.prior
    root = np.zeros((len(held), len(before.point.theta)))
    root[range(len(held)), held] = 1.0 / (share * np.abs(before.point.theta[held]))
    informed = predictor.informed(Prior(known.mean, np.vstack([known.root, root])))
    fit = informed.at(before.point, replace(before.free, theta=(*before.free.theta, *held)))
    fit = replace(fit, jumps=before.jumps)
    step = fit.newton_step()
    return (fit, np.hypot(fit.std, step)) if np.all(np.isfinite(step)) else None
