"""What a model keeps for good may leak: a form without a name, where a mode had the name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete
from small_cases import write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.scoring.scores import score_bank

STEP, LEAK = 0.004, 52.8  # s, 1/s
CHANNELS = [("valve", "1", "input"), ("stroke", "m", "output"), ("pressure", "bar", "output")]
CYLINDER = """
[model]
name = "cylinder"
[parameters]
M = { value = 118, unit = "kg", min = 60, max = 240, free = true }
b = { value = 930, unit = "N s/m", min = 100, max = 4000, free = true }
KQ = { value = 21.6, unit = "bar/s", min = 5, max = 80, free = true }
[[state]]
name = "s"
unit = "m"
derivative = "v"
initial = { value = 0, free = true }
[[state]]
name = "v"
unit = "m/s"
derivative = "(150*p - b*v - 20000*s)/M"
initial = { value = 0, free = true }
[[state]]
name = "p"
unit = "bar"
derivative = "1000*KQ*valve - 36000*v"
initial = { value = 0, free = true }
[[output]]
name = "stroke"
unit = "m"
equation = "s"
[[output]]
name = "pressure"
unit = "bar"
equation = "p"
"""


def recorded(folder: Path) -> Path:
    """Write 4 s of a cylinder whose piston lets oil pass in proportion to the pressure."""
    A = np.array([[0.0, 1.0, 0.0], [-20000 / 120, -900 / 120, 150 / 120], [0.0, -36000.0, -LEAK]])
    A, B, *_ = cont2discrete((A, np.array([[0.0], [0.0], [21600.0]]), np.eye(3), np.zeros((3, 1))), STEP)
    rng = np.random.default_rng(5)
    valve = np.repeat(np.clip(rng.normal(0, 0.25, 250), -1, 1), 4)
    states = np.zeros((1000, 3))
    for k in range(999):
        states[k + 1] = A @ states[k] + B[:, 0] * valve[k]
    seen = states[:, [0, 2]]
    seen = seen + 0.01 * seen.std(axis=0) * rng.standard_normal(seen.shape)
    return write_case(folder, CYLINDER, STEP, CHANNELS, np.column_stack([valve, seen]))


def test_a_leak_leads_before_the_mode_that_it_damps(tmp_path: Path) -> None:
    """The cylinder's own resonance, damped by the leak, was named as a mode that the model lacks."""
    prepared = prepare(load_case(recorded(tmp_path)))
    best = score_bank(prepared, prepared.hypotheses, 1).rows[0]
    assert best.attachment.key == f"{unlisted.ID} state:p_linear"
    assert best.attachment.statement({"factor": LEAK}) == "a loss at state:p that grows in proportion to it"
