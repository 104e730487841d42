"""Equations as a simulation in C and as a mock-up unit compute what the free run computes, filter by filter."""

from __future__ import annotations

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from exported_c import COMPILERS, in_c
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from numpy.typing import NDArray

import aeolid as ae
from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.models.equations import Equations, InputFilter, Parameter
from aeolid.models.equations_file import from_toml, to_toml
from aeolid.models.exchange.c_simulation import as_identifier, c_simulation
from aeolid.models.exchange.fmu import open_fmu, run_fmu
from aeolid.models.exchange.fmu_write import write_fmu
from aeolid.models.exchange.linear_equations import linear_equations
from aeolid.models.integrate import compile_equations, simulate
from aeolid.models.load import LinearModel
from aeolid.models.state_space import StateSpace
from aeolid.models.state_space import from_json as linear_from_json
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.text_files import parse_toml

Array = NDArray[np.float64]
STEP, FINE = 0.02, 20  # s; parts in which a sample is looked at exactly
MODEL = """
[model]
name = "rig"
[parameters]
M = { value = 2.0, unit = "kg", min = 0.1, max = 10.0 }
k = { value = 50.0, unit = "N/m" }
c = { value = 1.5, unit = "N s/m" }
[[input]]
name = "force"
unit = "N"
[[input]]
name = "the push"
symbol = "g"
unit = "N"
[[state]]
name = "x"
unit = "m"
derivative = "v"
initial = 0.1
[[state]]
name = "v"
unit = "m/s"
derivative = "(total - c*v*abs(v) - k*x - 3000*x**3 - 0.1*sign(v)*min(1, abs(v), 3))/M"
[[auxiliary]]
name = "total"
equation = "force + g*exp(-x**2/pi)"
[[memory]]
name = "m"
unit = "m"
settled = "x"
next = "m + (x - m)*min(step_s/0.2, 1)"
[[memory]]
name = "n"
unit = "m"
settled = "m"
next = "max(min(n, x + 0.01), x - 0.01)"
[[output]]
name = "position"
unit = "m"
equation = "x"
[[output]]
name = "filtered"
unit = "m"
equation = "m + n + 0.1*abs(n)**1.5 - n**3"
[[output]]
name = "acceleration"
unit = "m/s**2"
equation = "(total - k*x)/M"
"""
FILTERS: dict[str, tuple[float, ...]] = {
    "actuator_lag": (0.12,), "transport_delay": (0.073,), "actuator_second_order": (0.05, 0.6),
    "rate_limit": (20.0, 1.0), "input_saturation": (-1.0, 1.5, 0.7), "deadband": (0.8, 1.0), "dead_zone": (0.5, 1.0),
    "backlash": (0.6, 1.0), "input_quantisation": (0.5, 1.0), "input_mid_rise": (0.5, 1.0),
    "input_floor": (0.5, 1.0), "input_truncation": (0.5, 1.0), "input_scale": (1.3, 0.5), "lead_lag": (0.2, 0.8),
    "indicial": (0.3, 0.5),
}  # fmt: skip
LASTING = {"actuator_lag", "transport_delay", "actuator_second_order", "rate_limit", "lead_lag", "indicial"}


def model(*kinds: str) -> Equations:
    """Return the rig with filters in front of its first input."""
    plain = from_toml(parse_toml(MODEL, "rig"), MODEL, "rig")
    parameters, filters = list(plain.parameters), []
    for number, kind in enumerate(kinds):
        names = tuple(f"p{number}_{j}" for j in range(len(FILTERS[kind])))
        parameters += [Parameter(n, v) for n, v in zip(names, FILTERS[kind], strict=True)]
        filters.append(InputFilter("force", kind, names))
    return replace(plain, parameters=tuple(parameters), filters=tuple(filters))


def pushes(samples: int, inputs: int = 2) -> Array:
    drawn = 2 * np.random.default_rng(4).standard_normal((samples // 8 + 1, inputs))
    return np.ascontiguousarray(np.repeat(drawn, 8, axis=0)[:samples])


def free(equations: Equations, u: Array, step: float) -> Array:
    return simulate(compile_equations(equations), u, equations.theta, equations.x0, step)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_without_a_filter_the_free_run_is_the_same_to_rounding(compiler: str, tmp_path: Path) -> None:
    """LLVM and a C compiler take the products in one order; the functions of the library are the same."""
    u = pushes(600)
    found, expected = in_c(model(), tmp_path, u, STEP, compiler=compiler), free(model(), u, STEP)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("kind", FILTERS)
def test_each_filter_is_that_of_the_free_run(kind: str, tmp_path: Path) -> None:
    """In short samples, where what is taken as a mean over a tenth of one is an instant.

    What lasts changes within a sample; there the free run has the slope of four quarters, so that an acceleration, seen
    a tenth of a sample late, differs by that tenth: 1e-3 of its range with samples of 1 ms. States by their squares.
    """
    u, lasting = np.repeat(pushes(160), FINE, axis=0), kind in LASTING
    found, expected = (f for f in (in_c(model(kind), tmp_path, u, STEP / FINE), free(model(kind), u, STEP / FINE)))
    error, size = np.abs(found - expected).max(axis=0), np.abs(expected).max(axis=0)
    assert np.all(error[:2] < (1e-6 if lasting else 1e-11) * size[:2]), error / size
    assert error[2] < (5e-3 if lasting else 1e-11) * size[2], error / size


def test_a_chain_of_filters_in_long_samples_is_near_the_exact_one(tmp_path: Path) -> None:
    """Held inputs in samples of 20 ms against samples of 1 ms, in C and in the free run."""
    chain, held = model("transport_delay", "backlash", "actuator_lag"), pushes(400)
    exact = free(chain, np.repeat(held, FINE, axis=0), STEP / FINE)[::FINE, 0]
    found, rough = in_c(chain, tmp_path, held, STEP)[:, 0], free(chain, held, STEP)[:, 0]
    assert np.abs(found - exact).max() < 0.005 * np.abs(exact).max()
    assert np.abs(rough - exact).max() < 0.02 * np.abs(exact).max()


def test_a_long_step_is_cut_into_samples(tmp_path: Path) -> None:
    u = np.repeat(pushes(80), 4, axis=0)
    long = in_c(model("actuator_lag"), tmp_path / "long", u, STEP, cut=4)
    short = in_c(model("actuator_lag"), tmp_path / "short", u, STEP)[::4]
    np.testing.assert_allclose(long, short, rtol=0, atol=1e-12)


def test_what_runs_away_is_told(tmp_path: Path) -> None:
    wild = MODEL.replace("- 3000*x**3", "+ 3000*x**3")
    found = in_c(from_toml(parse_toml(wild, "wild"), wild, "wild"), tmp_path, pushes(600), STEP)
    assert np.isnan(found[-1]).all()


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unit")
    (folder / "model.toml").write_text(to_toml(model("actuator_lag", "transport_delay")))
    command = ["convert", str(folder / "model.toml"), str(folder / "rig.fmu"), "--sample-time", str(STEP)]
    assert main(command) == 0
    return folder / "rig.fmu"


def test_the_unit_is_one_by_the_standard(unit: Path) -> None:
    assert validate_fmu(str(unit)) == []
    described = fmpy.read_model_description(str(unit))
    found = {v.name: (v.causality, v.unit) for v in described.modelVariables}
    assert found["the push"] == ("input", "N") and found["position"] == ("output", "m")
    assert found["M"] == ("parameter", "kg") and found["start of x"] == ("parameter", "m")
    with zipfile.ZipFile(unit) as archive:
        assert {"sources/rig.h", "sources/rig_fmu.c"} <= set(archive.namelist())


def test_the_unit_computes_what_the_free_run_does(unit: Path) -> None:
    """Through our own reader of units, which runs it in its box."""
    u, whole = np.repeat(pushes(120), FINE, axis=0), model("actuator_lag", "transport_delay")
    names = ["position", "filtered"]
    found = run_fmu(open_fmu(unit), {"force": u[:, 0], "the push": u[:, 1]}, names, STEP / FINE)
    expected = free(replace(whole), u, STEP / FINE)[:, 0]
    assert np.abs(found[:, 0] - expected).max() < 1e-3 * np.abs(expected).max()  # memories are renewed by the step


@pytest.fixture
def slave(unit: Path, tmp_path: Path) -> FMU2Slave:
    described = fmpy.read_model_description(str(unit))
    fmpy.extract(str(unit), unzipdir=str(tmp_path / "unzipped"))
    found = FMU2Slave(
        guid=described.guid, unzipDirectory=str(tmp_path / "unzipped"),
        modelIdentifier=described.coSimulation.modelIdentifier, instanceName="rig",
    )  # fmt: skip
    found.instantiate()
    found.setupExperiment(startTime=0.0)
    found.enterInitializationMode()
    found.exitInitializationMode()
    return found


def test_a_kept_state_goes_on_as_if_nothing_had_happened(slave: FMU2Slave) -> None:
    """Dead times, lags and memories included; also through bytes."""

    def run(count: int) -> list[list[float]]:
        rows = []
        for k in range(count):
            slave.setReal([0, 1], [np.sin(0.3 * k), 1.0])
            slave.doStep(0.0, STEP)
            rows.append(slave.getReal([2, 3, 4, 5, 6]))
        return rows

    run(20)
    kept = slave.getFMUState()
    data = slave.serializeFMUState(kept)
    first = run(30)
    slave.setFMUState(kept)
    assert run(30) == first
    slave.setFMUState(slave.deserializeFMUState(data))
    assert run(30) == first


def test_only_inputs_starts_and_parameters_can_be_set(slave: FMU2Slave) -> None:
    for reference in (2, 5, 99):
        with pytest.raises(fmpy.fmi1.FMICallException):
            slave.setReal([reference], [1.0])
    slave.setReal([7], [0.25])
    assert slave.getReal([5, 7]) == [0.25, 0.25]


def test_the_same_model_gives_the_same_sources(tmp_path: Path) -> None:
    contents = []
    for name in ("one", "two"):
        write_fmu(tmp_path / f"{name}.fmu", model(), STEP, name="rig", source="model.toml")
        with zipfile.ZipFile(tmp_path / f"{name}.fmu") as archive:
            contents.append({n: archive.read(n) for n in archive.namelist() if not n.startswith("binaries")})
    assert contents[0] == contents[1]


def test_without_a_compiler_the_unit_has_its_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aeolid.models.exchange.fmu_write._compiler", lambda: None)
    notes = write_fmu(tmp_path / "rig.fmu", model(), STEP, name="rig", source="model.toml")
    assert any("no C compiler" in n for n in notes)
    with zipfile.ZipFile(tmp_path / "rig.fmu") as archive:
        assert [n for n in archive.namelist() if n.startswith("binaries")] == []


def linear() -> StateSpace:
    found = fourth_order()
    found = replace(found, x0=np.array([0.1, -0.2, 0.3, 0.0]))
    return linear_from_json(json.loads(json.dumps(found.to_json())), "model.json")


def test_a_linear_model_is_its_recursion(tmp_path: Path) -> None:
    """With operating points, against the linear model's own free run."""
    offset = replace(
        linear(),
        inputs=tuple(replace(s, offset=0.5) for s in linear().inputs),
        outputs=tuple(replace(s, offset=-3.0) for s in linear().outputs),
    )
    record = simulate_fourth_order(300, 1)
    expected = LinearModel(offset, "model").simulate(record)
    u = np.ascontiguousarray(record.columns([s.name for s in offset.inputs]))
    found = in_c(linear_equations(offset, "model.json"), tmp_path, u, record.sample_time_s)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("kind", sorted(LASTING - {"rate_limit"}))
def test_states_of_a_model_in_discrete_time_follow_a_filter_within_the_sample(kind: str, tmp_path: Path) -> None:
    """In C as in the free run, which has the mean and the ramp of four quarters: outputs that see no input."""
    plain = linear_equations(linear(), "model.json")
    step = plain.sample_time_s
    values = {"transport_delay": (1.4 * step,), "actuator_second_order": (0.8 * step, 0.6), "actuator_lag": (step,)}
    own = [Parameter(f"p{j}", v) for j, v in enumerate(values.get(kind, FILTERS[kind]))]
    filters = (InputFilter(plain.inputs[0].name, kind, tuple(p.name for p in own)),)
    behind = replace(plain, parameters=(*plain.parameters, *own), filters=filters)
    u = pushes(200, len(plain.inputs))
    found, expected = in_c(behind, tmp_path, u, step), free(behind, u, step)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    assert np.abs(free(plain, u, step) - expected).max() > 0.01 * np.abs(expected).max()


def test_a_model_in_discrete_time_takes_whole_samples_only(tmp_path: Path) -> None:
    equations = linear_equations(linear(), "model.json")
    step = equations.sample_time_s
    for cut, whole in ((1, True), (3, True), (0.5, False)):
        found = in_c(equations, tmp_path / f"{cut}", np.zeros((6, len(equations.inputs))), step, cut=cut)
        assert np.isfinite(found).all() == whole
    with pytest.raises(UsageError, match="takes no other"):
        c_simulation(equations, 0.37 * equations.sample_time_s, name="rig")


def delayed(delay_s: float) -> Equations:
    found = model("transport_delay")
    return replace(found, parameters=(*found.parameters[:-1], Parameter("p0_0", delay_s)))


def test_what_cannot_be_simulated_is_refused() -> None:
    with pytest.raises(UsageError, match="--sample-time"):
        c_simulation(model(), 0.0, name="rig")
    with pytest.raises(UsageError, match="cannot begin names in C"):
        c_simulation(model(), STEP, name='rig"; evil')
    with pytest.raises(UsageError, match=r"acts 0\.1 s early"):
        c_simulation(delayed(-0.1), STEP, name="rig")
    with pytest.raises(UsageError, match="longer --sample-time"):
        c_simulation(delayed(1e5), STEP, name="rig")
    unborn = replace(model(), states=(replace(model().states[0], initial=float("nan")), *model().states[1:]))
    with pytest.raises(DataError, match="no finite number"):
        c_simulation(unborn, STEP, name="rig")


def test_names_of_somebody_else_end_no_comment_and_no_element(tmp_path: Path) -> None:
    """Channels and units may hold anything that is printed; C has them in comments, the description as attributes."""
    evil = 'x*/ int evil; /*"<&>'
    plain = model()
    odd = replace(plain, outputs=(replace(plain.outputs[0], name=evil, unit=evil), *plain.outputs[1:]))
    assert np.isfinite(in_c(odd, tmp_path / "c", pushes(20), STEP)).all()
    write_fmu(tmp_path / "odd.fmu", odd, STEP, name="rig", source=evil)
    assert evil in open_fmu(tmp_path / "odd.fmu").units
    assert as_identifier("7 µ-x") == "model_7___x"


def test_the_command_says_what_it_writes_and_leaves_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    held = replace(
        model(), filters=(InputFilter("force", "intersample_zoh", ("late",)),),
        parameters=(*model().parameters, Parameter("late", 0.005)),
    )  # fmt: skip
    (tmp_path / "model.toml").write_text(to_toml(held))
    assert main(["convert", str(tmp_path), str(tmp_path / "rig.h"), "--sample-time", "0.02"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "2 states, 4 parameters, a sample every 0.02 s" in told and "is no part of the plant" in told
    for words, text in (
        ([str(tmp_path / "rig.json")], "equations are written as .h"),
        ([str(tmp_path / "rig.fmu")], "--sample-time"),
        ([str(tmp_path / "rig.fmu"), "--sample-time", "0.02", "--precision", "f32"], "belong to C"),
        ([str(tmp_path / "rig.fmu"), "--sample-time", "0.02", "--input", "force"], "a simulation has all"),
    ):
        assert main(["convert", str(tmp_path / "model.toml"), *words]) == 2
        assert text in " ".join(capsys.readouterr().err.split())


def test_python_writes_the_same_unit(unit: Path, tmp_path: Path) -> None:
    equations = ae.Equations.load(unit.with_name("model.toml"))
    assert equations.to_fmu(tmp_path / "rig.fmu", sample_time=STEP) == ()
    with zipfile.ZipFile(tmp_path / "rig.fmu") as mine, zipfile.ZipFile(unit) as theirs:
        assert mine.read("modelDescription.xml") == theirs.read("modelDescription.xml")
