"""What two stores exchange: it is read off their equations, nothing is lost on the way, and it may change its form."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from study_modules import load_study

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.hypotheses.generic.places import places
from aeolid.diagnose.hypotheses.parts.base import Slot
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.structure.passing import passings
from aeolid.diagnose.validation.beyond import reader
from aeolid.models import equations_file
from aeolid.models import expressions as ex
from aeolid.models.integrate import compile_equations

mechanics = load_study("rigs/mechanics")


def written(folder: Path, upper: str, lower: str) -> Path:
    file = folder / "model.toml"
    file.write_text(f"""\
[model]
name = "two stores"
time = "continuous"
[parameters]
h = {{ value = 0.5, unit = "1/s" }}
k = {{ value = 0.2, unit = "1/s" }}
C = {{ value = 4.0, unit = "1" }}
[[input]]
name = "heat"
unit = "K/s"
[[state]]
name = "T1"
unit = "K"
derivative = "{upper}"
[[state]]
name = "T2"
unit = "K"
derivative = "{lower}"
[[output]]
name = "first"
unit = "K"
equation = "T1"
[[output]]
name = "second"
unit = "K"
equation = "T2"
""")
    return file


@pytest.mark.parametrize(
    ("upper", "lower", "expected"),
    [
        ("heat - h*T1", "h*T1 - k*T2", ("T1", "T2", "T1", 1.0)),
        ("heat - h*(T1 - T2)", "k*(T1 - T2) - h*T2", ("T1", "T2", "T1 - T2", 0.4)),
        ("heat - h*(T1 - T2)", "-k*(T2 - T1)", ("T1", "T2", "T1 - T2", 0.4)),
        ("heat + h*(T2 - T1)", "h*(T1 - T2)/C", ("T1", "T2", "T1 - T2", 0.25)),
        ("(heat - h*T1*T1)/C", "(h*T1*T1 - k*T2)/C", ("T1", "T2", "T1 * T1", 1.0)),
        ("h*sqrt(max(T2, 0)) - k*T1", "-h*sqrt(max(T2, 0))", ("T2", "T1", "sqrt(max(T2, 0))", 1.0)),
        ("heat - h*T1", "heat - h*T1", None),  # both lose it: nothing passes
        ("heat - h*T1", "heat - k*T2", None),
        ("heat - h*T1", "h*T1*T1 - k*T2", None),
        ("h - h*T1", "k*T2 - h", None),  # constants move nothing
    ],
)
def test_what_passes_is_read_off_the_equations(
    upper: str, lower: str, expected: tuple[str, str, str, float] | None, tmp_path: Path
) -> None:
    model = equations_file.load(written(tmp_path, upper, lower))
    found = passings(model, ["T1", "T2"])
    if expected is None:
        assert found == []
        return
    (passing,) = found
    values = {p.name: np.array(p.value) for p in model.parameters}
    share = float(ex.values_of(passing.share, values))
    assert (passing.giver, passing.taker, ex.to_text(passing.driver)) == expected[:3]
    assert share == pytest.approx(expected[3])


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    """Prepare the two tanks without anything hidden."""
    trial = mechanics.Trial("null", "tanks")
    return prepare(load_case(mechanics.write_case(tmp_path_factory.mktemp("tanks") / "case", trial, 1000, 3)))


def test_what_leaves_one_tank_reaches_the_other(stage: Prepared) -> None:
    """Whatever is added to the flow, the water in both tanks together is that of the model without it."""
    (place,) = (p for p in places(stage.site, reader(stage.only(()))) if p.label == "state:upper-lower")
    assert place.location["entry"] == "state:upper-lower"
    assert place.size > 0
    slot = Slot("more", None, "", 0.0, -1.0, 1.0, 1e-3)
    plain = stage.only(()).extended
    changed = place.acts(plain, (slot,), "more*inflow", "more")
    x, u = np.linspace(0.4, 0.9, len(plain.states)), np.full(len(plain.symbols), 2.0)
    theta = changed.theta.copy()
    theta[changed.index("more")] = 0.01
    moved = compile_equations(changed).slope(x, u, theta) - compile_equations(plain).slope(x, u, plain.theta)
    names = [s.name for s in plain.states]
    assert moved[names.index("upper")] == pytest.approx(-0.02)
    assert moved[names.index("lower")] == pytest.approx(0.02)
    assert np.count_nonzero(moved) == 2


@pytest.mark.parametrize(("thick", "verdict"), [(0.02, "unnamed"), (0.0, "no_mismatch")])
def test_a_flow_that_an_input_narrows_is_described(thick: float, verdict: str, tmp_path: Path) -> None:
    """On one tank alone it was a tank that leaks or a wrong value: what one loses there the other does not get."""
    trial = mechanics.Trial("layer", "tanks", {"thick": thick} if thick else {}, outside=True)
    case = load_case(mechanics.write_case(tmp_path / "case", trial, 1500, 6))
    found = diagnose(study(case, sham=0, seed=1, progress=lambda *_: None))
    assert found["verdict"] == verdict, found["statement"]
    if thick:
        assert found["location"]["entry"] == "state:upper-lower"
        said = (
            "passes from upper to lower is less than the model says, by (8.[5-9]|9|9.[0-9]) % where inflow is largest"
        )
        assert re.search(said, found["statement"])  # 0.02 of 4.5
        assert found["sealed"]["interval"][0] > 0
