"""Free values of equations are found with deviations that hold them, and held against a part of the data left out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

import aeolid as ae
from aeolid.cli.main import main
from aeolid.diagnose.data.case import make_case
from aeolid.diagnose.estimate import Estimate, estimate
from aeolid.errors import UsageError
from aeolid.models.equations import Equations
from aeolid.models.equations_file import from_toml, load
from aeolid.models.integrate import compile_equations, simulate
from aeolid.record import Channel, Record
from aeolid.text_files import parse_toml
from aeolid.wording import plus_minus

STEP, TRUE = 0.05, {"M": 2.0, "k": 80.0, "c": 3.0}  # s; kg, N/m, N s/m
SEEDS = 8
MODEL = """
[model]
name = "mass on a spring"
[parameters]
M = { value = 2.6, min = 0.5, max = 10.0, unit = "kg", free = true }
k = { value = 60.0, min = 5.0, max = 500.0, unit = "N/m", free = true }
c = { value = 6.0, min = 0.0, max = 50.0, unit = "N s/m", free = true }
[[input]]
name = "force"
unit = "N"
[[state]]
name = "x"
unit = "m"
derivative = "v"
[[state]]
name = "v"
unit = "m/s"
derivative = "(force - c*v - k*x)/M"
[[output]]
name = "position"
unit = "m"
equation = "x"
"""


def structure(text: str = MODEL) -> Equations:
    return from_toml(parse_toml(text, "model.toml"), text, "model.toml")


def with_values(model: Equations, **values: float) -> Equations:
    return replace(model, parameters=tuple(replace(p, value=values.get(p.name, p.value)) for p in model.parameters))


def recording(seed: int, samples: int = 1500, sensor: float = 0.002, **values: float) -> Record:
    """Return a free run with the true values; `sensor`: white noise of the position, m."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-8.0, 8.0], samples // 6 + 1), 6)[:samples, None]
    model = with_values(structure(), **(TRUE | values))
    y = simulate(compile_equations(model), u, model.theta, model.x0, STEP)
    y = y + sensor * rng.standard_normal(y.shape)
    channels = (Channel("force", "N", "input"), Channel("position", "m", "output"))
    return Record(STEP * np.arange(samples), np.hstack([u, y]), channels, STEP, f"seed {seed}", "")


def found(*records: Record, text: str = MODEL) -> Estimate:
    return estimate(make_case(records, structure(text), title="rig", source="model.toml", sha256=""))


@pytest.fixture(scope="module")
def drawn() -> list[Estimate]:
    return [found(recording(seed)) for seed in range(SEEDS)]


def test_intervals_hold_the_truth(drawn: list[Estimate]) -> None:
    """95 % intervals of 24 values: more than 5 miss once in a thousand times."""
    missed = [abs(m.value - TRUE[m.parameter.name]) > 1.96 * m.std for e in drawn for m in e.values]
    assert len(missed) == 3 * SEEDS
    assert sum(missed) <= binom.ppf(0.999, len(missed), 0.05)
    assert all(m.std < 0.05 * m.value for e in drawn for m in e.values)  # and they say something


def test_the_part_left_out_is_foretold_better(drawn: list[Estimate]) -> None:
    for e in drawn:
        (check,) = e.checks
        assert "from" in e.held_out and check.output == "position"
        assert 0.002 * 0.9 < check.fitted_ahead < 0.002 * 1.3  # of a sensor that errs by 2 mm
        assert check.fitted_free < 0.5 * check.declared_free
        assert check.fitted_ahead < check.declared_ahead
        assert e.apart == () and e.alike == ()


def test_the_model_has_the_values_and_runs(drawn: list[Estimate]) -> None:
    told = {p.name: p.value for p in drawn[0].model.parameters}
    assert told == {m.parameter.name: m.value for m in drawn[0].values}
    assert [p.free for p in drawn[0].model.parameters] == [True] * 3


def test_a_value_that_changed_between_recordings_is_said(drawn: list[Estimate]) -> None:
    """Ten percent: fifty deviations of either part."""
    e = found(recording(1, k=80.0), recording(2, k=80.0), recording(3, k=88.0))
    stiffness = next(m for m in e.values if m.parameter.name == "k")
    assert "k" in e.apart
    assert stiffness.std > 5 * next(m.std for m in drawn[0].values if m.parameter.name == "k")


def test_what_the_data_cannot_tell_apart_is_said() -> None:
    """Only the sum of two dampings acts."""
    text = MODEL.replace("c*v", "(c + d)*v").replace(
        "[[input]]", 'd = { value = 1.0, min = 0.0, max = 50.0, unit = "N s/m", free = true }\n[[input]]', 1
    )
    e = found(recording(1), text=text)
    assert [pair[:2] for pair in e.alike] == [("c", "d")] and e.alike[0][2] < -0.99


def test_what_cannot_be_fitted_is_refused() -> None:
    with pytest.raises(UsageError, match="no parameter has free = true"):
        found(recording(1), text=MODEL.replace("free = true", "free = false"))
    linear = ae.identify(ae.Record.of_core(recording(1)), past=10).state_space
    with pytest.raises(UsageError, match="equations"):
        estimate(make_case([recording(1)], linear, title="rig", source="model.json", sha256=""))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place, record = tmp_path_factory.mktemp("structure"), recording(1)
    rows = np.column_stack([record.time_s, record.values])
    np.savetxt(place / "monday.csv", rows, delimiter=",", header="time_s,force,position", comments="", fmt="%.9g")
    (place / "roles.toml").write_text(
        '[recording]\ntime = "time_s"\n[[channel]]\nname = "force"\nunit = "N"\nrole = "input"\n'
        '[[channel]]\nname = "position"\nunit = "m"\nrole = "output"\n'
    )
    (place / "model.toml").write_text(MODEL)
    return place


def command(folder: Path, *more: str, out: str = "fitted.toml") -> list[str]:
    base = ["identify", str(folder / "monday.csv"), "--roles", str(folder / "roles.toml"), "--structure"]
    return [*base, str(folder / "model.toml"), "--out", str(folder / out), *more]


def test_the_command_tells_and_writes_what_python_finds(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(command(folder, "--json", str(folder / "facts.json"))) == 0
    told, facts = capsys.readouterr().out, json.loads((folder / "facts.json").read_text())
    fitted = ae.Equations.load(folder / "model.toml").fit(
        ae.read(folder / "monday.csv", roles=folder / "roles.toml"), progress=False
    )
    written = load(folder / "fitted.toml")
    for p in facts["parameters"]:
        assert plus_minus(p["value"], p["std"]) in told
        assert written.parameters[written.index(p["name"])].value == p["value"] == fitted[p["name"]].value
    assert "in a free run" in told and facts["checks"][0]["fitted_free"] == next(iter(fitted.checks)).fitted_free
    assert list(fitted.to_frame()["parameter"]) == ["M", "k", "c"] and "fitted values" in fitted.to_text()
    assert fitted.model.simulate(ae.read(folder / "monday.csv", roles=folder / "roles.toml")) is not None
    assert "M" in fitted._repr_html_() and repr(fitted).startswith("<EquationsFit")


@pytest.mark.parametrize(
    ("more", "out", "words"),
    [
        (["--past", "20"], "other.toml", "of the other options only"),
        (["--report", "page.html"], "other.toml", "of the other options only"),
        ([], "model.json", "equations are written as .toml"),
    ],
)
def test_what_does_not_go_together_is_one_sentence(
    folder: Path, more: list[str], out: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command(folder, *more, out=out)) == 2
    assert words in " ".join(capsys.readouterr().err.split())
