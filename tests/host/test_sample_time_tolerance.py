"""A recording is at a model's sample time within one tolerance, whatever kind of file the model is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aeolid.errors import DataError
from aeolid.identify.fit import measure_fit
from aeolid.identify.free_run import run_free
from aeolid.models import equations_file
from aeolid.models.load import LinearModel
from aeolid.models.model_file import Signal
from aeolid.models.rate import SAME
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record

STEP = 0.1
TOML = """[model]
name = "a lag"
time = "discrete"
sample_time_s = 0.1
[[input]]
name = "u"
unit = "1"
[[state]]
name = "x"
unit = "1"
next = "0.9*x + u"
[[output]]
name = "y"
unit = "1"
equation = "x"
"""


def linear() -> LinearModel:
    return LinearModel(
        StateSpace(
            A=np.array([[0.9]]), B=np.ones((1, 1)), C=np.ones((1, 1)), D=np.zeros((1, 1)), K=np.zeros((1, 1)),
            x0=np.zeros(1), innovation_covariance=np.eye(1), sample_time_s=STEP, inputs=(Signal("u", "1"),),
            outputs=(Signal("y", "1"),), states=(Signal("x", "1"),),
        )
    )  # fmt: skip


def recording(step: float) -> Record:
    values = np.random.default_rng(0).standard_normal((200, 2))
    return Record(
        step * np.arange(200), values, (Channel("u", "1", "input"), Channel("y", "1", "output")), step, "r.csv", ""
    )


@pytest.mark.parametrize("off", [-0.9, -0.01, 0.01, 0.9])  # of the tolerance
def test_both_kinds_take_a_recording_within_the_tolerance(off: float, tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(TOML, encoding="utf-8")
    known = recording(STEP * (1 + off * SAME))
    ran = [run_free(m, known, "zero").y for m in (equations_file.load(tmp_path / "model.toml"), linear())]
    np.testing.assert_allclose(ran[0], ran[1], rtol=1e-12, atol=1e-12)
    measure_fit(linear().state_space, [known])


@pytest.mark.parametrize("off", [-1.1, 1.1])
def test_both_kinds_refuse_one_beyond_it(off: float, tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(TOML, encoding="utf-8")
    known = recording(STEP * (1 + off * SAME))
    for model in (equations_file.load(tmp_path / "model.toml"), linear()):
        with pytest.raises(DataError, match="sample time"):
            run_free(model, known, "zero")
        with pytest.raises(DataError, match="sample time"):
            model.simulate(known)
    with pytest.raises(DataError, match="sample time"):
        measure_fit(linear().state_space, [known])
