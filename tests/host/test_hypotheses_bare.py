"""Every hypothesis can be written into the declared model, from which the corrected one is made.

Hypotheses are attached to a model that has more than the declared one: unmeasured forces, what accelerometers feel of
an equation as an intermediate of its own, coordinates of modes. What an edit takes from there is missing in the other.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from small_cases import write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.data.exogenous import with_exogenous
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations

MODEL = """[model]
name = "a mast of two axes"
[parameters]
k = { value = 20.0, unit = "1/s^2", min = 10.0, max = 40.0, free = true }
c = { value = 0.4, unit = "1/s", min = 0.1, max = 2.0, free = true }
[[input]]
name = "push"
unit = "m/s^2"
[[state]]
name = "xf"
derivative = "vf"
unit = "m"
[[state]]
name = "vf"
derivative = "push - k*xf - c*vf"
unit = "m/s"
[[state]]
name = "xs"
derivative = "vs"
unit = "m"
[[state]]
name = "vs"
derivative = "0.3*push - 1.1*k*xs - c*vs"
unit = "m/s"
[[output]]
name = "top_fore_aft"
equation = "push - k*xf - c*vf"
unit = "m/s^2"
[[output]]
name = "top_side_side"
equation = "0.3*push - 1.1*k*xs - c*vs"
unit = "m/s^2"
"""


def missing(model: Equations) -> set[str]:
    """Return the names that a model's equations use and nothing in it declares."""
    known = {p.name for p in model.parameters} | {s.name for s in model.states} | {a.name for a in model.auxiliaries}
    known |= {m.name for m in model.memories} | set(model.symbols) | set(ex.CONSTANTS) | {"t"}
    trees = [*(s.derivative for s in model.states), *(o.equation for o in model.outputs)]
    trees += [a.equation for a in model.auxiliaries]
    return {n for tree in trees for n in ex.names_in(tree)} - known


def test_each_hypothesis_fits_the_declared_model(tmp_path: Path) -> None:
    """A skewed accelerometer was named rightly, and the diagnosis ended with a traceback when it wrote the model."""
    random, step, samples = np.random.default_rng(2), 0.05, 1500
    push = np.repeat(random.uniform(-1, 1, samples // 10), 10)
    x, rows = np.zeros(4), np.zeros((samples, 3))
    for i, u in enumerate(push):
        for _ in range(10):
            felt = np.array([u - 20 * x[0] - 0.4 * x[1], 0.3 * u - 22 * x[2] - 0.4 * x[3]])
            x = x + step / 10 * np.array([x[1], felt[0], x[3], felt[1]])
        rows[i] = u, *felt
    rows[:, 1:] += 0.02 * random.standard_normal((samples, 2))
    channels = [("push", "m/s^2", "input"), ("top_fore_aft", "m/s^2", "output"), ("top_side_side", "m/s^2", "output")]
    prepared = prepare(load_case(write_case(tmp_path, MODEL, step, channels, rows)))
    bare = with_exogenous(prepared.declared, prepared.exogenous)
    assert missing(bare) == set() and len(prepared.hypotheses) > 20
    faults = {a.key: missing(a.edit(bare)) for a in prepared.hypotheses}
    assert {key: names for key, names in faults.items() if names} == {}
    assert any(key.startswith("sensor_cross_axis") for key in faults)
