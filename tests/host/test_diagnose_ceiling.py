"""What a model-free correction finds in innovations: nothing that a controller has put into the input itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from small_cases import write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.localise.detect import ceiling
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.stats.blocks import block_interval

Array = NDArray[np.float64]
STEP, LOSS, HEAT = 1.0, 0.05, 0.2
CHANNELS = (("power", "W", "input"), ("warmth", "K", "output"))
_MODEL = """[model]
name = "a heated block"
[parameters]
loss = { value = 0.05, unit = "1/s", min = 0.005, max = 0.5, free = true }
heat = { value = 0.2, unit = "K/s/W", min = 0.02, max = 2.0, free = true }
[[input]]
name = "power"
unit = "W"
[[state]]
name = "T"
unit = "K"
derivative = "heat*power - loss*T"
[[output]]
name = "warmth"
unit = "K"
equation = "T"
"""


def held(seed: int, bend: float = 0.0, rows: int = 3000) -> Array:
    """Return power and warmth: the power answers each reading at once; bend: what the heater makes of its square."""
    rng = np.random.default_rng(seed)
    keep = np.exp(-LOSS * STEP)
    aims = np.repeat(rng.uniform(-3.0, 3.0, rows // 50 + 1), 50)
    T, found = 0.0, np.empty((rows, 2))
    for k in range(rows):
        seen = T + 0.1 * rng.standard_normal()
        power = 2.0 * (aims[k] - seen)
        found[k] = power, seen
        T = keep * T + HEAT * (1 - keep) / LOSS * (power + bend * power**2) + 0.05 * rng.standard_normal()
    return found


@pytest.mark.diagnosis
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_controller_that_answers_at_once_foretells_nothing(seed: int, tmp_path: Path) -> None:
    """The model lacks nothing: 54 to 90 nats had been found in such a loop, and the verdict was `unnamed`."""
    case = load_case(write_case(tmp_path, _MODEL, STEP, CHANNELS, held(seed)))
    prepared = prepare(case)
    found = ceiling(prepared, prepared.split.sealed)
    assert block_interval(found.sealed, 0)[0] <= 0, found.sealed.sum()
    said = diagnose(study(case, sham=0, seed=0, progress=lambda text, share: None))
    assert said["verdict"] == "no_mismatch"


def test_what_the_input_does_later_is_still_found(tmp_path: Path) -> None:
    """A heater that follows the square of its power in part: a curve of the input, one sample later."""
    prepared = prepare(load_case(write_case(tmp_path, _MODEL, STEP, CHANNELS, held(1, bend=0.06))))
    found = ceiling(prepared, prepared.split.sealed)
    assert block_interval(found.sealed, 0)[0] > 10
    assert any("an input" in name or "a state" in name for name, _ in found.groups[:2])


def test_the_unit_of_an_input_changes_nothing(tmp_path: Path) -> None:
    """The same power in watts and in nanowatts: values above a million had been cut off."""
    data = held(1, bend=0.06)
    small = _MODEL.replace('unit = "W"', 'unit = "nW"').replace("heat*power", "heat*power*1e-9")
    gained = []
    for name, model, factor in (("watt", _MODEL, 1.0), ("nanowatt", small, 1e9)):
        (tmp_path / name).mkdir()
        channels = (("power", "nW" if factor > 1 else "W", "input"), CHANNELS[1])
        prepared = prepare(load_case(write_case(tmp_path / name, model, STEP, channels, data * (factor, 1.0))))
        gained.append(float(ceiling(prepared.only(()), prepared.split.sealed).sealed.sum()))
    assert gained[1] == pytest.approx(gained[0], rel=0.02)  # fits end a hundredth of a nat apart
