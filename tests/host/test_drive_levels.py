"""A drive that takes its command in levels is told by how it chooses them: nearest, beside zero, below, cut off."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from small_cases import write_case

from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.pipeline import study

Array = NDArray[np.float64]
pytestmark = pytest.mark.diagnosis
STEP, ROWS, SPACING = 0.05, 900, 0.5
MODEL = """[model]
name = "a heated plate"
[parameters]
k = { value = 1.9, unit = "K/V", free = true }
tau = { value = 1.1, unit = "s", free = true }
[[state]]
name = "T"
unit = "K"
derivative = "(k*volts - T)/tau"
[[output]]
name = "warmth"
unit = "K"
equation = "T"
"""
FORMS: dict[str, Callable[[Array], Array]] = {
    "": lambda u: SPACING * np.rint(u / SPACING),
    ", between": lambda u: SPACING * (np.floor(u / SPACING) + 0.5),
    ", down": lambda u: SPACING * np.floor(u / SPACING),
    ", towards zero": lambda u: SPACING * np.trunc(u / SPACING),
}


@pytest.mark.parametrize("form", FORMS)
def test_each_way_of_choosing_a_level_has_its_name_and_spacing(tmp_path: Path, form: str) -> None:
    """An exact first-order plant behind held commands of many values; 0.02 K of sensor noise, gain and time 5 % off."""
    rng = np.random.default_rng(7)
    command = np.repeat(1.2 * rng.standard_normal(ROWS // 6), 6)
    decay, state, warmth = np.exp(-STEP / 1.0), 0.0, np.zeros(ROWS)
    for k, acts in enumerate(FORMS[form](command)):
        warmth[k] = state
        state = decay * state + (1 - decay) * 2.0 * acts
    warmth += 0.02 * rng.standard_normal(ROWS)
    table = np.column_stack([command, warmth])
    channels = (("volts", "V", "input"), ("warmth", "K", "output"))
    case = write_case(tmp_path, MODEL, STEP, channels, table)
    found = diagnose(study(load_case(case), sham=0, seed=1, progress=lambda *_: None))
    assert found["verdict"] in ("named", "ambiguous"), found["statement"]
    told = found["effects"][0]
    assert told["id"] == "input_quantisation"
    assert told["parameters"]["spacing"]["value"] == pytest.approx(SPACING, rel=0.01)
    words = {"": "", ", between": "none at zero", ", down": "below the command", ", towards zero": "nearer to zero"}
    assert words[form] in found["statement"]
