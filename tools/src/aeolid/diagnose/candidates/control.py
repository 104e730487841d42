"""Try an effect on the simulation itself: what improves the model of a run that lacks nothing is no finding.

A linear model of finite order leaves something over on any run (rotor harmonics, aerodynamics that bend); an effect
that takes it up there would take it up in the recording as well.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.frame import carry_free, carry_point
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.data.exogenous import with_time
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.point import Prior
from aeolid.diagnose.rules import in_force
from aeolid.record import Record

Array = NDArray[np.float64]
_ITERATIONS = 8


def survives_control(prepared: Prepared, candidate: Candidate) -> bool:
    """Tell whether an effect gains clearly more on the recording than on the simulation; True without a simulation.

    The effect starts on the run from its values on the recording, and from none of it; both are fitted with all that
    the run's own model has free. Cost: two fits.
    """
    known, run = prepared.surrogate, prepared.run
    if known is None or run is None:
        return True
    predictor, base = known.predictor, known.fit
    source, target = predictor.compiled.model, candidate.predictor.compiled.model
    blank = Prior(target.theta, np.zeros((0, len(target.parameters))))
    trial = candidate.predictor.on([run_segment(prepared, run)]).informed(blank)
    plain = carry_point(base.point, source, target)
    effects = [target.index(s.name) for a in candidate.attachments for s in a.slots]
    theta = plain.theta.copy()
    theta[effects] = candidate.fit.point.theta[effects]
    own = carry_free(base.free, source, target)
    moved = [i for i in effects if i in candidate.fit.free.theta]
    free = replace(own, theta=tuple(dict.fromkeys([*own.theta, *moved])))
    fits = [trial.fit(start, free, _ITERATIONS) for start in (replace(plain, theta=theta), plain)]
    control = max((f.log_likelihood - base.log_likelihood for f in fits if f is not None), default=0.0)
    rates = candidate.fit_gain / len(candidate.fit_density), control / len(base.per_sample)
    return rates[0] > in_force().candidates.run_gain_ratio * max(rates[1], 0.0)


def run_segment(prepared: Prepared, run: Record) -> Segment:
    """Return the simulation as one stretch with the channels of the extended model; what it does not hold is zero."""
    record = with_time(run)
    known = {c.name for c in record.channels}
    model = prepared.extended
    columns = [record.column(s.name) if s.name in known else np.zeros(len(record)) for s in model.inputs]
    y = record.columns([o.name for o in model.outputs])
    u = np.ascontiguousarray(np.column_stack(columns))
    return Segment(u, np.ascontiguousarray(y), record.sample_time_s, record.source, 0.0, 0)
