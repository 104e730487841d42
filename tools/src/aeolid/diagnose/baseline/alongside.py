"""Predict a recording from a simulation that was given the same inputs, sample by sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aeolid.diagnose.structure.baseline import linear_row
from aeolid.diagnose.structure.modal import ModalForm
from aeolid.errors import DataError
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Output, State
from aeolid.models.model_file import Signal
from aeolid.record import Channel, Record

PREFIX = "simulated_"  # of the channels that hold the simulation's outputs, and of the states of its copy


def with_run(record: Record, run: Record) -> Record:
    """Return the recording with the simulation's outputs as further channels; the two must share their time."""
    if len(record) != len(run) or abs(record.time_s[0] - run.time_s[0]) > 0.5 * record.sample_time_s:
        raise DataError(
            f"{run.source}: {len(run)} samples from {run.time_s[0]:g} s, the recording has {len(record)} from "
            f"{record.time_s[0]:g} s; same_inputs = true needs both at the same times"
        )
    outputs = run.of("output")
    values = np.hstack([record.values, run.columns([c.name for c in outputs])])
    channels = tuple(Channel(PREFIX + c.name, c.unit, "ignore") for c in outputs)
    return replace(record, values=values, channels=(*record.channels, *channels))


def alongside(model: Equations, form: ModalForm) -> Equations:
    """Return y = y_simulated + (what the model makes of the inputs) − (what it makes of them without any effect).

    The simulation's own answer, nonlinear and with its wind, stands for what the model gets right; the linear model
    only tells what an effect changes. The second, unchanged copy has its own states and takes the recorded inputs.
    """
    linear = form.model
    states = [f"{PREFIX}x{i + 1}" for i in range(linear.order)]
    raw = [f"recorded{i + 1}" for i in range(len(linear.inputs))]
    simulated = [f"{PREFIX}{j + 1}" for j in range(len(linear.outputs))]
    drives = [f"({n} - {s.offset!r})" for n, s in zip(raw, linear.inputs, strict=True)]
    copies = tuple(
        State(name, "", linear_row((linear.A[i], "A", states), (linear.B[i], "B", drives), i, form.names), 0.0)
        for i, name in enumerate(states)
    )
    outputs = []
    for j, output in enumerate(model.outputs):
        read = linear_row((linear.C[j], "C", states), (linear.D[j], "D", drives), j, form.names)
        plain = ex.combine("+", read, ex.parse(repr(linear.outputs[j].offset), "offset"))
        known = ex.combine("-", ex.parse(simulated[j], "simulated"), plain)
        outputs.append(Output(output.name, output.unit, ex.combine("+", output.equation, known)))
    channels = [Signal(s.name, s.unit) for s in linear.inputs]
    channels += [Signal(PREFIX + s.name, s.unit) for s in linear.outputs]
    return replace(
        model, states=(*model.states, *copies), outputs=tuple(outputs),
        inputs=(*model.inputs, *channels), symbols=(*model.symbols, *raw, *simulated),
    )  # fmt: skip
