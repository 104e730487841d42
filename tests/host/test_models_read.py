"""A model of somebody else: what its file says is read or refused, and what cannot be computed is said so."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_cases import swinging

from aeolid.diagnose.data.case import load_case
from aeolid.errors import DataError
from aeolid.identify.residuals import run_residual_tests
from aeolid.identify.validation import validate_model
from aeolid.models import equations_file, lpv, state_space
from aeolid.models.load import LinearModel
from aeolid.models.model_file import Signal
from aeolid.models.prediction import nrmse, vaf
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record
from aeolid.text_files import parse_toml

PLANT = StateSpace(
    np.array([[0.9, 0.1], [-0.1, 0.9]]), np.array([[0.0], [1.0]]), np.eye(2), np.zeros((2, 1)), None, np.zeros(2), None,
    0.1, (Signal("u"),), (Signal("y"), Signal("z")), (Signal("a"), Signal("b")),
)  # fmt: skip


def write(folder: Path, **changed: Any) -> Path:
    content = {k: v for k, v in (PLANT.to_json() | changed).items() if v is not ...}
    (folder / "model.json").write_text(json.dumps(content))
    return folder / "model.json"


def recorded(count: int = 1000) -> Record:
    rng = np.random.default_rng(5)
    u = rng.standard_normal((count, 1))
    values = np.hstack([u, PLANT.simulate(u) + 0.01 * rng.standard_normal((count, 2))])
    channels = (Channel("u", "", "input"), Channel("y", "", "output"), Channel("z", "", "output"))
    return Record(0.1 * np.arange(count), values, channels, 0.1, "a.csv", "")


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"D": ..., "d": [[1.0], [0.0]]}, "key 'd' is not read; 'D' is"),
        ({"K": ..., "k": [[0.1, 0], [0, 0.1]]}, "key 'k' is not read; 'K' is"),
        ({"Innovation Covariance": [[1, 0], [0, 1]]}, "is not read; 'innovation_covariance' is"),
        ({"B": [[0, 0], [1, 1]], "D": [[0, 0], [0, 0]], "inputs": ["u", "u"]}, "inputs names 'u' twice"),
        ({"outputs": ["y", "y"]}, "outputs names 'y' twice"),
        ({"innovation_covariance": [[1.0, 0.5], [0.2, 1.0]]}, "innovation_covariance is not symmetric"),
        ({"innovation_covariance": [[1.0, 2.0], [2.0, 1.0]]}, "innovation_covariance has a negative eigenvalue"),
        ({"innovation_covariance": [[-1.0, 0.0], [0.0, 1.0]]}, "innovation_covariance has a negative eigenvalue"),
    ],
)
@pytest.mark.parametrize("scheduled", [False, True])
def test_a_model_that_contradicts_itself_is_refused(
    tmp_path: Path, changed: dict[str, Any], told: str, scheduled: bool
) -> None:
    own = {"scheduling": {"channels": ["v"], "units": [""], "first_is_one": True}} if scheduled else {}
    if scheduled:
        own |= {key: [matrix.tolist(), (0 * matrix).tolist()] for key, matrix in (("A", PLANT.A), ("C", PLANT.C))}
    path = write(tmp_path, **(own | changed))
    with pytest.raises(DataError, match=told):
        if scheduled:
            lpv.from_json(state_space.read_json(path), str(path))
        else:
            state_space.load(path)


@pytest.mark.parametrize("covariance", [[[1.0, 0.5], [0.5000001, 1.0]], [[1.0, 1.0], [1.0, 1.0]], [[0, 0], [0, 0]]])
def test_a_covariance_may_be_rounded_or_singular(tmp_path: Path, covariance: list[list[float]]) -> None:
    assert state_space.load(write(tmp_path, innovation_covariance=covariance)).innovation_covariance is not None


def test_a_key_that_stands_twice_is_refused(tmp_path: Path) -> None:
    text = write(tmp_path).read_text()
    (tmp_path / "model.json").write_text(text[:-1] + ', "D": [[1.0], [1.0]]}')
    with pytest.raises(DataError, match="the key 'D' stands twice"):
        state_space.load(tmp_path / "model.json")


def test_an_unstable_predictor_is_told_and_leaves_the_free_run(tmp_path: Path) -> None:
    """K twenty times too large: A - K C has eigenvalues beyond 10, and 1000 samples leave the numbers."""
    model = replace(PLANT, K=20 * np.eye(2), innovation_covariance=np.eye(2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = validate_model(LinearModel(model), recorded(), (5,))
    assert found.fit is not None
    assert found.residuals is not None
    assert all(found.fit.one_step.diverges(n) and found.fit.steps[5].diverges(n) for n in ("y", "z"))
    assert found.free_run.vaf["y"] > 99
    assert (found.residuals.verdict, found.residuals.diverging) == ("fail", ("y", "z"))
    assert json.loads(json.dumps(found.to_json(), allow_nan=False))["residuals"]["diverging"] == ["y", "z"]


@pytest.mark.parametrize("grown", [np.inf, 1e200])  # what is not a number was not measured
def test_innovations_beyond_the_numbers_are_not_tested(grown: float) -> None:
    e = np.random.default_rng(1).standard_normal((500, 2))
    e[400:, 1] = grown
    report = run_residual_tests(e, np.random.default_rng(2).standard_normal((500, 1)), ("y", "z"), ("u",))
    assert (report.verdict, report.tests, report.diverging) == ("fail", (), ("z",))


@pytest.mark.parametrize("lost", [np.nan, np.inf])
def test_an_estimate_that_is_lost_has_no_score(lost: float) -> None:
    """A missing sample of y is another matter: it is left out."""
    y = np.random.default_rng(1).standard_normal((50, 2))
    estimate = y.copy()
    estimate[7:, 1] = lost
    y[3, 0] = np.nan
    assert [bool(np.isfinite(v)) for v in vaf(y, estimate)] == [True, False]
    assert [bool(np.isfinite(v)) for v in nrmse(y, estimate)] == [True, False]


EQUATIONS = """[parameters]
"µ" = 2.0
[[input]]
name = "u"
[[state]]
name = "x"
derivative = "-µ*x + u"
[[output]]
name = "position"
equation = "x"
"""


def test_the_micro_sign_is_the_greek_letter_of_formulas(tmp_path: Path) -> None:
    model = equations_file.from_toml(parse_toml(EQUATIONS, "model.toml"), EQUATIONS, "model.toml")
    assert [s.name for s in model.inputs] == ["u"]
    assert [p.name for p in model.parameters] == ["\u03bc"]


@pytest.mark.parametrize(
    ("old", "new"), [('equation = "x"', 'equation = "position"'), ("µ*x + u", "µ*x + u - 0.1*position")]
)
def test_an_output_is_no_input_of_its_own_model(old: str, new: str) -> None:
    text = EQUATIONS.replace(old, new)
    with pytest.raises(DataError, match="'position' is an output; as an input it would be fed with what was recorded"):
        equations_file.from_toml(parse_toml(text, "model.toml"), text, "model.toml")


def test_a_case_refuses_an_input_with_the_role_of_an_output(tmp_path: Path) -> None:
    folder = swinging(tmp_path)
    text = (folder / "model.toml").read_text()
    assert load_case(folder).kind == "equations"
    (folder / "model.toml").write_text(
        text.replace('name = "speed"', 'name = "fast"', 1).replace("push - c*v", "push - c*speed")
    )
    with pytest.raises(DataError, match="input 'speed' has the role 'output' in the roles file"):
        load_case(folder)
