"""Put what was found into the model: the corrected model, as it is written to a file (S6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aeolid.diagnose.baseline.frame import carry_fit
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.baseline.recorded_wind import SHARE, by_readings
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.conclusion.verdict import shown_proof
from aeolid.diagnose.data.exogenous import with_exogenous, without_unused
from aeolid.diagnose.data.shaft_angle import ROLE as SHAFT_ANGLE
from aeolid.diagnose.data.shaft_angle import by_own_angles
from aeolid.diagnose.hypotheses.parts.base import Attachment, Slot, location
from aeolid.diagnose.hypotheses.parts.wiring import with_reading
from aeolid.diagnose.pipeline import Study
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.validation.divergent import Diverging, diverging
from aeolid.diagnose.validation.free_run import FreeRun, fitted_to_run_free, runs_better, shows_zero
from aeolid.models.equations import Equations, Parameter


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
    free, zeros = _running_free(study, () if chosen is None else chosen.attachments, predictor, fit)
    own = fit if free is None else carry_fit(free.fit, free.model, predictor.compiled.model)  # without the zeros
    model = corrected_model(study.unsealed, own, chosen)
    if free is not None:
        model = _with_zeros(model, zeros, free)
    model = model if free is None else replace(model, name=f"{model.name} to run free")
    wild = diverging(model, study.prepared.records)
    return Correction(model if wild is None else replace(model, name=f"{model.name}, DIVERGES"), free, wild)


def _running_free(
    study: Study, effects: Sequence[Attachment], predictor: Predictor, fit: Fit
) -> tuple[FreeRun | None, tuple[Attachment, ...]]:
    """Return the fit of the free run and the sensors' zeros in it, where the selection data ask for these.

    A sensor's constant offset is no finding by itself, and one step ahead the noise model's slow part takes it up (5 mV
    of an electronic circuit whose free run errs by 0.5 mV beside it); a file that is run free has to have it.
    """
    split, spreads = study.prepared.split, predictor.scales.spread
    if study.prepared.linear is not None:
        return None, ()
    free = fitted_to_run_free(predictor, fit, split)
    taken = {o for a in effects if a.entry == "sensor_bias" for o in a.location["outputs"]}
    outputs = study.prepared.declared.outputs
    zeros = tuple(zero_of(j, o.name, o.unit) for j, o in enumerate(outputs) if o.name not in taken)
    if study.deadline.skips("the sensors' zeros in the corrected model"):
        return free, ()
    frame, own = study.unsealed.frame, {a.key: s.name for a in zeros for s in a.slots}
    larger = frame.extend((*effects, *zeros), predictor.segments)[0].with_order(predictor.var_order or 0)
    start = carry_fit(fit, predictor.compiled.model, larger.compiled.model)
    told = shows_zero(larger, start, list(own.values()))
    places = tuple(larger.compiled.model.index(name) for name in told)
    start = replace(start, free=replace(start.free, theta=(*start.free.theta, *places)))
    shifted = fitted_to_run_free(larger, start, split) if places else None
    if shifted is None or not runs_better(shifted, free, spreads):
        return free, ()
    return shifted, tuple(a for a in zeros if own[a.key] in told)


def zero_of(number: int, output: str, unit: str) -> Attachment:
    """Return the constant that a sensor shows of nothing, as an attachment without a name of the catalogue."""
    name = f"sensor_zero_{number + 1}"
    slot = Slot(name, "zero", unit, 0.0, -np.inf, np.inf, 1.0)
    parameter = Parameter(name, 0.0, unit, free=True)

    def edit(model: Equations) -> Equations:
        return with_reading(model, output, f"reading + {name}", (parameter,))

    return Attachment("zero", f"zero output:{output}", location(f"output:{output}", outputs=(output,)), edit, (slot,))


def _with_zeros(model: Equations, zeros: Sequence[Attachment], free: FreeRun) -> Equations:
    """Return the corrected model with the zeros that its sensors have."""
    values = dict(zip([p.name for p in free.model.parameters], free.fit.point.theta.tolist(), strict=True))
    for a in zeros:
        model = a.edit(model)
    names = {s.name for a in zeros for s in a.slots}
    parameters = tuple(replace(p, value=float(values[p.name])) if p.name in names else p for p in model.parameters)
    return replace(model, parameters=parameters)


def corrected_model(prepared: Prepared, fit: Fit, candidate: Candidate | None) -> Equations:
    """Return the baseline with fitted values, plus the named effects and nothing of the others.

    Effects are attached anew to the declared model so that the file shows only what was named; a switched effect
    stays on. Start values of the states are those of the fitted record.
    """
    model = with_exogenous(prepared.declared, prepared.exogenous)
    attachments = candidate.attachments if candidate is not None else ()
    for a in sorted(attachments, key=lambda a: a.entry != "parameter_error"):
        model = a.edit(model)
    model = by_readings(model, prepared.records, prepared.exogenous)
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
    model = by_own_angles(model, [(c.name, c.symbol) for c in prepared.exogenous if c.role == SHAFT_ANGLE])
    return without_unused(model, prepared.exogenous)
