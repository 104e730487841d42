"""Free values that only a proportion of is determined: one is held as declared, and the rest has deviations again."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.baseline.ridges import ridge_findings
from aeolid.diagnose.data.case import Case
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, simulate
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, ROWS = 0.2, 600
CAR = """
[model]
name = "car"
time = "continuous"
[parameters]
M = { value = 1480.0, min = 800.0, max = 3000.0, unit = "kg", free = true }
F = { value = 60.0, min = 20.0, max = 200.0, unit = "N", free = true }
c0 = { value = 195.0, min = 20.0, max = 900.0, unit = "N", free = true }
c1 = { value = 9.0, min = 1.0, max = 80.0, unit = "N s/m", free = true }
idle = { value = 2.0, min = 1.0, max = 3.0, free = true }
[[state]]
name = "v"
derivative = "(F*throttle - c0 - c1*v LOAD)/M"
initial = 15.0
unit = "m/s"
[[output]]
name = "speed"
equation = "v + 0*idle"
unit = "m/s"
"""


def stage(load: str, text: str = CAR) -> tuple[Case, Prepared]:
    """Return a car's case and stage; load: what else acts on its mass, N."""
    text = text.replace("LOAD", load)
    model = equations_file.from_toml(tomllib.loads(text), text, "car.toml")
    rng = np.random.default_rng(2)
    u = np.repeat(rng.uniform(5, 60, ROWS // 40), 40)[:, None]
    truth = np.array([1450.0, 61.0, 190.0, 8.5, 2.0])
    y = simulate(compile_equations(model), u, truth, model.x0, STEP) + 0.05 * rng.standard_normal((ROWS, 1))
    channels = (Channel("throttle", "%", "input"), Channel("speed", "m/s", "output"))
    record = Record(STEP * np.arange(ROWS), np.column_stack([u, y]), channels, STEP, "a.csv", "")
    case = Case("car", (record,), "equations", model, "car.toml", "", {}, Path())
    return case, prepare(case)


def free_in(model: Equations) -> list[str]:
    return [p.name for p in model.parameters if p.free]


def test_of_values_that_only_a_proportion_of_is_determined_one_is_held() -> None:
    """The mass, whose range is the narrowest; what nothing depends on is left alone, and the user is told."""
    case, found = stage("")
    assert free_in(found.declared) == ["F", "c0", "c1", "idle"]
    values = {p.name: found.fit.point.theta[i] for i, p in enumerate(found.extended.parameters)}
    assert values["M"] == 1480.0
    for name, true in (("F", 61.0), ("c1", 8.5)):
        place = found.fit.free.theta.index(found.extended.index(name))
        assert abs(values[name] - true * 1480 / 1450) < 4 * found.fit.std[place] < 0.2 * true
    (note,) = ridge_findings(case.baseline, found.declared)
    assert (note.channel, note.severity) == ("M", "info") and "held at its declared 1480 kg" in note.finding
    assert "F, c0, c1" in note.finding


@pytest.mark.parametrize("load", ["- 500", "- 0.4*M", "- 3*throttle"])
def test_a_known_force_that_another_value_makes_up_for_tells_no_scale(load: str) -> None:
    """The proportions are others, and as many values are left open."""
    case, found = stage(load)
    assert free_in(found.declared) == ["F", "c0", "c1", "idle"]
    assert len(ridge_findings(case.baseline, found.declared)) == 1


@pytest.mark.parametrize(
    ("load", "text"), [("- 0.5*v*v", CAR), ("", CAR.replace("3000.0,", "3000.0, prior_std = 9.0,"))]
)
def test_a_known_drag_or_a_data_sheet_tells_the_scale(load: str, text: str) -> None:
    """Nothing is held where one term has a size that no free value makes up for, or one value is known."""
    case, found = stage(load, text)
    assert "M" in free_in(found.declared)
    assert ridge_findings(case.baseline, found.declared) == ()
