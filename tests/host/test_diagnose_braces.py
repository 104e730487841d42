"""Braces in a channel's name or unit are text in every sentence of a diagnosis, no field of a format."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from test_run_wiring import CHANNELS, CONTEXT, turbine

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.data.case import make_case
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.wiring import faults_of
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Output
from aeolid.models.model_file import Signal
from aeolid.record import Channel, Record

HOSTILE = "v{1}{unit"


def test_every_effect_of_the_catalogue_tells_of_such_a_channel() -> None:
    rng = np.random.default_rng(1)
    v = np.convolve(rng.standard_normal(1019), np.ones(20) / 5, "valid")
    values = np.column_stack([v, 3 * v + 0.5 * np.sign(v) + 0.05 * rng.standard_normal(len(v)), np.cumsum(v) * 0.05])
    channels = (
        Channel(HOSTILE, "m/s", "input"), Channel("force}", "N", "output"),
        Channel("oil{0}", "degC", "disturbance"),
    )  # fmt: skip
    record = Record(0.05 * np.arange(len(v)), values, channels, 0.05, "monday", "")
    law = Output("force}", "N", ex.parse("3.0*v", "law"))
    model = Equations("law", 0.0, (), (), (law,), (Signal(HOSTILE, "m/s"),), ("v",))
    case = make_case([record], model, title="law", source="law", sha256="")
    told = {a.key: a.statement({s.label: 1.5 for s in a.slots if s.label}) for a in prepare(case).hypotheses}
    assert f"motion:{HOSTILE}" in told[f"coulomb_friction motion:{HOSTILE}"]
    assert any("oil{0}" in text for text in told.values())


def test_every_fault_of_a_recording_tells_of_such_a_channel() -> None:
    def renamed(record: Record) -> Record:
        return replace(record, channels=tuple(replace(c, name=f"{c.name[:-1]}{{{c.name[-1]}}}") for c in CHANNELS))

    recording, run = renamed(turbine(2)), renamed(turbine(1))
    units = {c.name: c.unit for c in recording.channels}
    recording = replace(recording, values=recording.values * np.array([57.29578, *(1.0,) * 7]))
    found = faults_of(pair_of([recording], [run], CONTEXT), units)
    told = [h.words.format(**dict(zip(h.names, h.grid[0], strict=True))) for h in found]
    assert any("pitc{h}" in text for text in told) and any("tower_f{a} and tower_s{s}" in text for text in told)
    assert any("spee{d} is stamped" in text for text in told)
