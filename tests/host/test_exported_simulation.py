"""Exported simulations stay right where a model becomes fast, where time moves it and where dead times are changed."""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from exported_c import COMPILERS, STRICT, equations, in_c, one_state, run_header
from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from aeolid.models.equations import Equations, InputFilter, Parameter
from aeolid.models.exchange.c_simulation import c_simulation
from aeolid.models.exchange.fmu_write import write_fmu
from aeolid.models.exchange.linear_equations import linear_equations
from aeolid.models.input_filters import KINDS
from aeolid.models.integrate import compile_equations, simulate
from aeolid.models.state_space import from_json

Array = NDArray[np.float64]
Flow = Callable[[Array, float, float], list[float]]  # of states, input and time
HELD = np.repeat(np.random.default_rng(1).uniform(0.2, 1.5, 15), 8)[:, None]
BODY = """
[parameters]
k = { value = 9.0 }
[[state]]
name = "q"
derivative = "v"
initial = 0.3
[[state]]
name = "v"
derivative = "force - k*q - 0.3*v"
[[output]]
name = "position"
unit = "m"
equation = "q"
"""
STOP = BODY.replace("- k*q", "- 1e5*max(abs(q) - 0.35, 0)*sign(q)")
LATE = """
[parameters]
delay = { value = 0.1, min = 0, max = 5, unit = "s" }
[[state]]
name = "x"
derivative = "u - x"
[[output]]
name = "y"
equation = "x"
[[input_filter]]
input = "u"
kind = "transport_delay"
delay_s = "delay"
"""


def exact(flow: Flow, start: list[float], u: Array, step: float) -> Array:
    """Return the first state (N,) at the samples, inputs held over each, by an integrator for stiff equations."""
    x, found = np.array(start), [start[0]]
    for k, value in enumerate(u[:-1, 0]):
        run = solve_ivp(
            lambda t, x, value=value, k=k: flow(x, value, k * step + t), (0.0, step), x, "LSODA", rtol=1e-9, atol=1e-12
        )
        x = run.y[:, -1]
        found.append(x[0])
    return np.array(found)


FAST: dict[str, tuple[Equations, Flow, list[float], Array, float]] = {
    "rate by the input": (
        one_state("(1 - x)*u*50"), lambda x, u, t: [(1 - x[0]) * u * 50], [0.0],
        np.abs(np.sin(0.1 * np.arange(120.0)))[:, None], 0.1,
    ),
    "drag from rest": (
        one_state("1.5*u - 1.5*x*abs(x)"), lambda x, u, t: [1.5 * u - 1.5 * x[0] * abs(x[0])], [0.0], HELD, 1.0,
    ),
    "much drag": (one_state("50*u - 50*x*abs(x)"), lambda x, u, t: [50 * u - 50 * x[0] * abs(x[0])], [0.0], HELD, 1.0),
    "friction when it sticks": (
        one_state("u - 0.5*tanh(x/0.001) - 0.3*x", 1.0),
        lambda x, u, t: [u - 0.5 * np.tanh(x[0] / 0.001) - 0.3 * x[0]], [1.0], 3 * (HELD - 0.8), 0.02,
    ),
    "an end stop": (
        equations(STOP), lambda x, u, t: [x[1], u - 1e5 * max(abs(x[0]) - 0.35, 0) * np.sign(x[0]) - 0.3 * x[1]],
        [0.3, 0.0], 3 * (HELD[:44] - 0.8), 0.05,
    ),
    "faster than its 200 steps": (one_state("1e4*(u - x)"), lambda x, u, t: [1e4 * (u - x[0])], [0.0], HELD, 0.1),
}  # fmt: skip


@pytest.mark.parametrize("case", FAST)
def test_what_becomes_fast_follows_its_equation(case: str, tmp_path: Path) -> None:
    """Steps of one time constant at most err by 1 % of what the fast part moves."""
    model, flow, start, u, step = FAST[case]
    found, expected = in_c(model, tmp_path, u, step)[:, 0], exact(flow, start, u, step)
    assert np.abs(found - expected).max() < 0.01 * np.abs(expected).max()


def test_units_of_the_states_make_no_difference(tmp_path: Path) -> None:
    """By powers of two every product rounds alike: the same bits, however small or large a state's numbers are."""
    plain, _, _, u, step = FAST["an end stop"]
    scaled = STOP.replace('derivative = "v"', 'derivative = "v/1048576"')
    scaled = scaled.replace('"force', '"1048576*(force').replace("- 0.3*v", "- 0.3*(v/1048576))")
    found = in_c(equations(scaled), tmp_path / "scaled", u, step)
    assert np.array_equal(found, in_c(plain, tmp_path / "plain", u, step))


@pytest.mark.parametrize("text", [BODY, BODY.replace("k*q", "k*sin(q)").replace("0.3*v", "0.3*v*abs(v)")])
def test_where_nothing_is_fast_steps_are_plain(text: str, tmp_path: Path) -> None:
    """The same bits with the repetition of steps taken out of the header."""

    def plain(header: str) -> str:
        assert header.count("if (rate > limit && ") == 1
        return header.replace("if (rate > limit && ", "if (0 && rate > limit && ")

    model, u = equations(text), 3 * (HELD - 0.8)
    found = in_c(model, tmp_path / "own", u, 0.02)
    assert np.array_equal(found, run_header(model, tmp_path / "plain", u, 0.02, edit=plain)[0])


@pytest.mark.parametrize("derivative", ["(1 - x)*u*1e9", "x**2 + u"])
def test_what_no_step_follows_is_told(derivative: str, tmp_path: Path) -> None:
    """Faster than the shortest step, or to infinity within finite time."""
    assert run_header(one_state(derivative), tmp_path, HELD, 0.1)[1] == -1


def test_time_moves_within_a_step(tmp_path: Path) -> None:
    """The rule is exact for cubics: dx/dt = t² gives t³/3 to rounding; behind memories, in steps of any length."""
    t = 0.25 * np.arange(40)
    model = one_state("time_s**2")
    found = in_c(model, tmp_path / "whole", np.zeros((40, 1)), 0.25)[:, 0]
    np.testing.assert_allclose(found, t**3 / 3, rtol=1e-12)
    cut = in_c(model, tmp_path / "cut", np.zeros((40, 1)), 0.25, cut=0.5)[:, 0]
    np.testing.assert_allclose(cut, (t / 2) ** 3 / 3, rtol=1e-12)


def linear() -> Equations:
    """Return a model in discrete time about an operating point, where it stays."""
    text = {
        "kind": "state_space", "sample_time_s": 0.1, "A": [[0.9]], "B": [[-2.0]], "C": [[1.0]], "D": [[0.0]],
        "inputs": [{"name": "pitch", "unit": "deg", "offset": 8.0}],
        "outputs": [{"name": "speed", "unit": "rpm", "offset": 1170.0}], "states": [{"name": "a"}],
    }  # fmt: skip
    return linear_equations(from_json(text, "model.json"), "model.json")


def behind(kinds: list[str], model: Equations, channel: str) -> Equations:
    """Return the model with filters of these kinds in front of an input."""
    slots = [(k, f"{k}_{slot}") for k in kinds for slot in KINDS[k].slots]
    filters = [InputFilter(channel, k, tuple(name for of, name in slots if of == k)) for k in kinds]
    parameters = (*model.parameters, *(Parameter(name, 0.5) for _, name in slots))
    return replace(model, parameters=parameters, filters=tuple(filters))


MEMORY = '\n[[memory]]\nname = "m"\nsettled = "q"\nnext = "max(min(m, q + 0.1), q - step_s)"\n'
PLAIN = [k for k in KINDS if not k.startswith("intersample")]
MODELS: dict[str, Equations] = {
    "no states": equations('[[output]]\nname = "y"\nequation = "2*u"\n'),
    "no states, in discrete time": equations(
        '[model]\ntime = "discrete"\nsample_time_s = 0.1\n[[output]]\nname = "y"\nequation = "2*u"\n'
    ),
    "no states behind a lag": behind(["actuator_lag"], equations('[[output]]\nname = "y"\nequation = "u"\n'), "u"),
    "nothing but an output": equations('[[output]]\nname = "y"\nequation = "1"\n'),
    "no inputs, no parameters": one_state("-x", 1.0),
    "time": one_state("sin(time_s) - x"),
    "memories": equations(BODY.replace('equation = "q"', 'equation = "m"') + MEMORY),
    "filters": behind(PLAIN, equations(BODY), "force"),
    "discrete time": linear(),
    "ramps in discrete time": behind(["actuator_lag", "transport_delay"], linear(), "pitch"),
}


@pytest.mark.parametrize("kind", MODELS)
def test_headers_and_units_compile_without_a_warning(kind: str, tmp_path: Path) -> None:
    """Used and unused; the unit's source too."""
    write_fmu(tmp_path / "rig.fmu", MODELS[kind], 0.1, name="rig", source="model.toml")
    with zipfile.ZipFile(tmp_path / "rig.fmu") as archive:
        archive.extractall(tmp_path)
    (tmp_path / "sources" / "unused.c").write_text(
        '#include "rig.h"\nint none(void);\nint none(void) {\n    return 0;\n}\n'
    )
    for compiler in COMPILERS:
        for name in ("unused.c", "rig_fmu.c"):
            subprocess.run([compiler, *STRICT, "-c", "-o", "/dev/null", name], check=True, cwd=tmp_path / "sources")
        assert np.isfinite(in_c(MODELS[kind], tmp_path, np.zeros((5, 1)), 0.1, compiler=compiler)).all()


def started(path: Path, folder: Path) -> tuple[FMU2Slave, dict[str, int], dict[str, float]]:
    """Return a unit that is to be stepped, its value references and the starts that it declares."""
    described = fmpy.read_model_description(str(path), validate=True)
    fmpy.extract(str(path), unzipdir=str(folder))
    unit = FMU2Slave(guid=described.guid, unzipDirectory=str(folder), modelIdentifier="rig", instanceName="rig")
    unit.instantiate()
    begin(unit)
    references = {v.name: v.valueReference for v in described.modelVariables}
    return unit, references, {v.name: float(v.start) for v in described.modelVariables if v.start is not None}


def begin(unit: FMU2Slave) -> None:
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()


@pytest.mark.parametrize(
    "kind", ["discrete time", "ramps in discrete time", "filters", "memories", "time", "no states"]
)
def test_every_variable_begins_as_declared(kind: str, tmp_path: Path) -> None:
    """After it was made and after a reset; a start reads as it was set, whatever the states have done since."""
    write_fmu(tmp_path / "rig.fmu", MODELS[kind], 0.1, name="rig", source="model.toml")
    unit, references, starts = started(tmp_path / "rig.fmu", tmp_path / "unit")
    places = [references[name] for name in starts]
    outputs = [references[o.name] for o in MODELS[kind].outputs]
    assert unit.getReal(places) == list(starts.values())
    first = unit.getReal(outputs)
    moved = [value + 0.25 for value in starts.values()]
    unit.setReal(places, moved)
    for k in range(3):
        unit.doStep(0.1 * k, 0.1)
    assert unit.getReal(places) == moved
    unit.reset()
    begin(unit)
    assert unit.getReal(places) == list(starts.values()) and unit.getReal(outputs) == first


def test_an_input_that_nothing_sets_is_at_its_start(tmp_path: Path) -> None:
    """At the operating point a linear model stays there."""
    write_fmu(tmp_path / "rig.fmu", MODELS["discrete time"], 0.1, name="rig", source="model.json")
    unit, references, _ = started(tmp_path / "rig.fmu", tmp_path / "unit")
    for k in range(20):
        unit.doStep(0.1 * k, 0.1)
        assert unit.getReal([references["speed"]]) == [1170.0]


@pytest.mark.parametrize("delay", [0.0, 0.37, 4.0, 5.0])
def test_a_dead_time_may_be_set_to_all_of_its_range(delay: float, tmp_path: Path) -> None:
    """Against the free run of the model that is declared with it, which has the slopes of quarters of a sample."""
    u = np.random.default_rng(0).standard_normal((120, 1))
    found, failed = run_header(equations(LATE), tmp_path, u, 0.1, values={"delay": delay})
    model = equations(LATE.replace("value = 0.1", f"value = {delay}"))
    expected = simulate(compile_equations(model), u, model.theta, model.x0, 0.1)
    assert not failed
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("delay", [-0.1, 5.4, float("nan")])
def test_a_dead_time_without_room_is_refused(delay: float, tmp_path: Path) -> None:
    assert run_header(equations(LATE), tmp_path, np.ones((9, 1)), 0.1, values={"delay": delay})[1] == -2
    write_fmu(tmp_path / "rig.fmu", equations(LATE), 0.1, name="rig", source="model.toml")
    unit, references, _ = started(tmp_path / "rig.fmu", tmp_path / "unit")
    before = unit.serializeFMUState(unit.getFMUState())
    unit.setReal([references["delay"]], [delay])
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.doStep(0.0, 0.1)
    unit.setReal([references["delay"]], [0.1])
    assert unit.serializeFMUState(unit.getFMUState()) == before


def test_a_range_without_room_is_declared_shorter_and_told(tmp_path: Path) -> None:
    """What is declared has room, in steps as short as fill it most: each just over half of the model's own."""
    model = equations(LATE.replace("max = 5", "max = 1e5"))
    (note,) = write_fmu(tmp_path / "rig.fmu", model, 0.1, name="rig", source="model.toml")
    described = fmpy.read_model_description(str(tmp_path / "rig.fmu"))
    (delay,) = [v for v in described.modelVariables if v.name == "delay"]
    longest = float(delay.max)
    assert "parameter delay: a dead time of up to" in note and "100000 s" in note
    assert 2.0 < longest < 100.0 and float(delay.min) == 0.0
    u, step = np.random.default_rng(0).standard_normal((9000, 1)), 0.1
    found = run_header(model, tmp_path / "spare", u, step, cut=0.13, values={"delay": longest})[0]
    roomy = equations(LATE.replace("value = 0.1", f"value = {longest!r}").replace("max = 5", "max = 1e5"))
    np.testing.assert_array_equal(found, run_header(roomy, tmp_path / "roomy", u, step, cut=0.13)[0])
    assert "th[0]" in c_simulation(model, step, name="rig")[0]


@pytest.mark.parametrize("damping", [0.0, 0.02, 0.7, 1.0, 1.5, 4.0])
def test_a_drive_of_any_damping_is_the_free_runs(damping: float, tmp_path: Path) -> None:
    """Outside 0.05 to 0.999 the header had another damping in silence, two lags among them."""
    text = (
        f"[parameters]\ninverse = 0.05\nzeta = {damping}\n"
        '[[state]]\nname = "x"\nderivative = "u - x"\n[[output]]\nname = "y"\nequation = "x"\n'
        '[[input_filter]]\ninput = "u"\nkind = "actuator_second_order"\ninverse_omega_s = "inverse"\ndamping = "zeta"\n'
    )
    rig = equations(text)
    u = np.repeat(np.random.default_rng(5).normal(size=40), 10)[:, None]
    free = simulate(compile_equations(rig), u, rig.theta, rig.x0, 0.02)
    np.testing.assert_allclose(in_c(rig, tmp_path, u, 0.02), free, atol=5e-3)  # a quarter of a sample for course


def test_intermediates_of_memories_are_those_of_the_free_run(tmp_path: Path) -> None:
    """Computed again where a memory has settled or was renewed; one that settles was no number for ever."""
    text = (
        '[[memory]]\nname = "m"\nnext = "m - 0.1*a"\nsettled = "u"\n[[auxiliary]]\nname = "a"\nequation = "m - u"\n'
        '[[memory]]\nname = "n"\nnext = "max(-100, 2*a)"\nsettled = "0"\n'
        '[[output]]\nname = "y"\nequation = "n + m"\n'
    )
    rig = equations(text)
    u = np.random.default_rng(6).normal(size=200)[:, None]
    free = simulate(compile_equations(rig), u, rig.theta, rig.x0, 0.1)
    assert np.all(np.isfinite(free))
    np.testing.assert_allclose(in_c(rig, tmp_path, u, 0.1), free, rtol=1e-12)
