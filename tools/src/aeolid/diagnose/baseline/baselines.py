"""Bring every kind of baseline and its recordings to what the later steps work on (S1)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aeolid.diagnose.baseline.alongside import alongside, with_run
from aeolid.diagnose.baseline.sampled import sample_fmu
from aeolid.diagnose.baseline.simulated import Surrogate, check_run, is_simple, surrogate, with_values
from aeolid.diagnose.data.case import MOST_STATES, Case
from aeolid.diagnose.data.exogenous import with_time
from aeolid.diagnose.data.held import discretise
from aeolid.diagnose.data.rotor_frame import blade_sets, to_fixed_frame, worth_rate
from aeolid.diagnose.data.shaft_angle import with_shaft_angles
from aeolid.diagnose.deadline import Deadline
from aeolid.diagnose.structure.baseline import equations_of
from aeolid.errors import DataError
from aeolid.identify.decimate import decimate
from aeolid.models.equations import Auxiliary, Equations
from aeolid.models.exchange.fmu import Fmu
from aeolid.models.state_space import StateSpace
from aeolid.record import Record

_NEAR = 4  # factor up to which the past of a surrogate still spans two periods of the fastest content


@dataclass(frozen=True, eq=False)
class Baseline:
    """Hold a baseline as equations, noise states of a linear one included, and the recordings that go with it.

    linear: the model behind the equations where it is one; surrogate: what a simulator's run knows of it; inputs: how
    many of the equations' inputs act on the plant (the others are what a simulation said); run: a simulation that
    effects can be tried on, at the recordings' rate, None where it was predicted along with the recording.
    """

    equations: Equations
    linear: StateSpace | None
    surrogate: Surrogate | None
    records: tuple[Record, ...]
    inputs: int
    run: Record | None = None

    def bare(self, auxiliaries: tuple[Auxiliary, ...]) -> Equations:
        """Return the equations that a corrected model is built on: no noise states, these intermediates."""
        if self.linear is None:
            return self.equations
        form = None if self.surrogate is None else self.surrogate.form
        return replace(equations_of(self.linear, shaped_noise=False, modal=form), auxiliaries=auxiliaries)


def baseline_of(case: Case, deadline: Deadline | None = None) -> Baseline:
    """Return the baseline of a case; raises DataError or NotIdentifiable with the reason where there is none.

    deadline: when the fit of a simulator's run ends where it stands, never by default.
    """
    if isinstance(case.baseline, Record):
        return _of_run(case, case.baseline, deadline)
    if isinstance(case.baseline, Fmu):
        return _of_run(replace(case, same_inputs=False), sample_fmu(case.baseline, case.records[0]), deadline)
    records = tuple(with_time(r) for r in case.records)
    if isinstance(case.baseline, Equations):
        turned = with_shaft_angles(records, case.baseline)
        return Baseline(case.baseline, None, None, turned, len(case.baseline.inputs))
    linear = discretise(case.baseline, case.records[0].sample_time_s)
    if linear.order > MOST_STATES:
        raise DataError(
            f"{case.baseline_file}: {linear.order} states; reduce the model to at most {MOST_STATES} for a diagnosis"
        )
    equations = equations_of(linear, shaped_noise=True)
    return Baseline(equations, linear, None, with_shaft_angles(records, equations), len(linear.inputs))


def _rate(run: Record) -> int:
    """Return by how much to decimate a run: not at all where a small model describes it at its own rate.

    Behind an anti-alias filter what was held is no more, and the past knows of the future: an oscillator on a run
    without sensor noise came out ten times too stiff, a lag of 0.1 s as 0.08 s. Lower rates are for what a surrogate's
    states cannot all hold.
    """
    factor = worth_rate(run)
    return 1 if 1 < factor <= _NEAR and is_simple(run) else factor


def _of_run(case: Case, run: Record, deadline: Deadline | None) -> Baseline:
    """Identify the simulator's run; recording and run go to the fixed frame and the same lower rate."""
    check_run(run, case.records)
    sets = blade_sets(run, case.context)  # none of a unit that does not turn the rotor
    factor = _rate(to_fixed_frame(run, sets))
    turned = [to_fixed_frame(r, sets) for r in case.records]
    if case.same_inputs:
        turned = [with_run(r, to_fixed_frame(run, sets)) for r in turned]
    records = tuple(with_time(decimate(r, factor, centred=True)) for r in turned)
    slow = decimate(to_fixed_frame(run, sets), factor, centred=True)
    found = surrogate(slow, deadline=deadline)
    form = with_values(found.form, dict(zip(found.form.values, found.mean.tolist(), strict=True)))
    linear = replace(form.model, K=found.fit.point.K[: form.model.order] if found.fit.point.K is not None else None)
    found = replace(found, form=replace(form, model=linear))
    levels = np.concatenate([r.columns([s.name for s in linear.inputs]) for r in records])
    if not np.all(np.isfinite(levels).any(axis=0)):
        raise DataError(f"{case.records[0].source}: an input of the simulation is never recorded")
    equations = equations_of(linear, shaped_noise=True, modal=found.form)
    equations = alongside(equations, found.form) if case.same_inputs else equations
    control = None if case.same_inputs else slow
    return Baseline(equations, linear, found, records, len(linear.inputs), control)
