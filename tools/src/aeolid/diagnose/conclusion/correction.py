"""Put what was found into the model: the corrected model, as it is written to a file (S6)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.baseline.recorded_wind import SHARE
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.conclusion.verdict import shown_proof
from aeolid.diagnose.data.exogenous import with_exogenous, without_unused
from aeolid.diagnose.pipeline import Study
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.validation.divergent import Diverging, diverging
from aeolid.diagnose.validation.free_run import FreeRun, fitted_to_run_free
from aeolid.models.equations import Equations


@dataclass(frozen=True, eq=False)
class Correction:
    """Hold the corrected model; free_run: what its values were fitted to, None where they predict one step ahead.

    diverging: how it leaves the recordings when it runs free, None where it does not.
    """

    model: Equations
    free_run: FreeRun | None
    diverging: Diverging | None


def correct(study: Study) -> Correction:
    """Return the baseline with what the verdict claims; of equations with the values that run free best.

    Where the declared values were re-fitted, or nothing is claimed, no effect is added.
    """
    shown = shown_proof(study)
    chosen = None if shown is None or shown is study.declared_proof else study.whole
    predictor, fit = (
        (study.unsealed.predictor, study.unsealed.fit) if chosen is None else (chosen.predictor, chosen.fit)
    )
    free = None if study.prepared.linear is not None else fitted_to_run_free(predictor, fit, study.prepared.split)
    model = corrected_model(study.unsealed, fit if free is None else free.fit, chosen)
    model = model if free is None else replace(model, name=f"{model.name} to run free")
    wild = diverging(model, study.prepared.records)
    return Correction(model if wild is None else replace(model, name=f"{model.name}, DIVERGES"), free, wild)


def corrected_model(prepared: Prepared, fit: Fit, candidate: Candidate | None) -> Equations:
    """Return the baseline with fitted values, plus the named effects and nothing of the others.

    Effects are attached anew to the declared model so that the file shows only what was named; a switched effect
    stays on. Start values of the states are those of the fitted record.
    """
    model = with_exogenous(prepared.declared, prepared.exogenous)
    attachments = candidate.attachments if candidate is not None else ()
    for a in sorted(attachments, key=lambda a: a.entry != "parameter_error"):
        model = a.edit(model)
    fitted = prepared.extended if candidate is None else candidate.predictor.compiled.model
    values = dict(zip([p.name for p in fitted.parameters], fit.point.theta.tolist(), strict=True))
    for a in attachments:
        values.update(a.fixed)
    names = [s.name for s in fitted.states]
    start = dict(zip(names, fit.point.x0[0][: len(names)].tolist(), strict=True))  # memories start settled
    wind = prepared.frame.wind
    if wind is not None and values[SHARE]:  # the state was what an anemometer did not tell; the file's is all of it
        start[wind.name] = next(s.initial for s in prepared.declared.states if s.name == wind.name)
    switches = {k for a in attachments for k in a.fixed}
    parameters = tuple(
        replace(p, value=float(np.clip(values[p.name], p.minimum, p.maximum)), free=p.free or p.name not in switches)
        if p.free or any(p.name == s.name for a in attachments for s in a.slots)
        else p
        for p in model.parameters
    )
    states = tuple(replace(s, initial=start[s.name]) for s in model.states)
    model = replace(model, name=f"{model.name} (corrected)", parameters=parameters, states=states).pruned()
    return without_unused(model, prepared.exogenous)
