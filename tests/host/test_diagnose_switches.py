"""Reversed signs and swapped channels: seen from what they do at once, and named through every kind of model."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from small_cases import write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.candidates.switches import paying
from aeolid.diagnose.conclude import conclude
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.scoring.scores import score_bank

Array = NDArray[np.float64]
STEP, SAMPLES = 1.0, 1500
# so closely coupled that both swing alike: a free run of the model does not tell them apart by correlation
A, B = np.array([[0.90, 0.09], [0.06, 0.93]]), np.array([[0.3, 0.0], [0.0, 0.05]])
CHANNELS = (("heat", "kW", "input"), ("spray", "kW", "input"), ("core", "K", "output"), ("skin", "K", "output"))
EQUATIONS = """[model]
name = "two bodies"
time = "discrete"
sample_time_s = 1.0
[parameters]
a = { value = 0.90, unit = "1", min = 0.5, max = 0.99, free = true }
b = { value = 0.3, unit = "K/kW", min = 0.03, max = 3.0, free = true }
[[input]]
name = "heat"
unit = "kW"
[[input]]
name = "spray"
unit = "kW"
[[state]]
name = "T1"
unit = "K"
next = "a*T1 + 0.09*T2 + b*heat"
[[state]]
name = "T2"
unit = "K"
next = "0.06*T1 + 0.93*T2 + 0.05*spray"
[[output]]
name = "core"
unit = "K"
equation = "T1"
[[output]]
name = "skin"
unit = "K"
equation = "T2"
"""


def bodies() -> Array:
    """Simulate heat, spray, core, skin (N, 4): two bodies that warm each other, process and sensor noise."""
    rng = np.random.default_rng(6)
    u = np.column_stack([np.repeat(rng.uniform(-10, 10, SAMPLES // n), n) for n in (10, 25)])
    x, rows = np.zeros(2), np.empty((SAMPLES, 2))
    for i in range(SAMPLES):
        rows[i] = x
        x = A @ x + B @ u[i] + 0.05 * rng.standard_normal(2)
    return np.column_stack([u, rows + 0.05 * rng.standard_normal((SAMPLES, 2))])


def linear_model() -> str:
    inputs = [{"name": n, "unit": u, "offset": 0.0} for n, u, role in CHANNELS if role == "input"]
    outputs = [{"name": n, "unit": u, "offset": 0.0} for n, u, role in CHANNELS if role == "output"]
    facts = {
        "kind": "state_space", "sample_time_s": STEP, "inputs": inputs, "outputs": outputs,
        "states": [{"name": "T1", "unit": "K"}, {"name": "T2", "unit": "K"}],
        "A": A.tolist(), "B": B.tolist(), "C": np.eye(2).tolist(), "D": np.zeros((2, 2)).tolist(), "K": None,
        "x0": [0.0, 0.0], "innovation_covariance": None, "scheduling": None,
    }  # fmt: skip
    return json.dumps(facts)


MODELS = {"state_space": linear_model(), "equations": EQUATIONS}
FAULTS = {
    "": lambda rows: rows,
    "data_channel_swap outputs:core and skin": lambda rows: rows[:, [0, 1, 3, 2]],
    "data_channel_swap inputs:heat and spray": lambda rows: rows[:, [1, 0, 2, 3]],
    "sensor_sign output:skin": lambda rows: rows * (1.0, 1.0, 1.0, -1.0),
}


@pytest.mark.parametrize("kind", MODELS)
@pytest.mark.parametrize("key", FAULTS)
def test_only_a_switch_that_is_there_pays_at_once(key: str, kind: str, tmp_path: Path) -> None:
    case = load_case(write_case(tmp_path, MODELS[kind], STEP, CHANNELS, FAULTS[key](bodies()), kind=kind))
    prepared = prepare(case)
    bank = score_bank(prepared, prepared.hypotheses, 0)
    offered = [r.attachment.key for r in bank.rows if r.attachment.is_switch]
    assert len(offered) >= 5 or kind == "equations"
    found = [r.attachment.key for r in paying(prepared, bank)]
    assert (key in found) if key else found == []


@pytest.mark.diagnosis
@pytest.mark.parametrize("key", [k for k in FAULTS if k.startswith("data")])
def test_swapped_channels_are_a_fault_of_the_data(key: str, tmp_path: Path) -> None:
    rows = FAULTS[key](bodies())
    case = load_case(write_case(tmp_path, MODELS["state_space"], STEP, CHANNELS, rows, kind="state_space"))
    diagnosis, _ = conclude(case, tmp_path / "out", sham=0, seed=0, progress=lambda text, share: None)
    assert diagnosis["verdict"] == "data_fault"
    assert [e["id"] for e in diagnosis["effects"]] == ["data_channel_swap"]
    names = key.split(":")[1]
    assert diagnosis["statement"].startswith(f"the channels {names} are swapped")
    nats = re.search(r"\((\d+) nats\)", diagnosis["statement"])
    assert nats is not None and int(nats[1]) > 100 and diagnosis["location"]["entry"].endswith(names)
