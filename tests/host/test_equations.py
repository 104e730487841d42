"""Model files: the example of the contract loads, every slip is named, and writing a model keeps its meaning."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aeolid.cli.main import main
from aeolid.errors import DataError
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, simulate
from aeolid.record import Channel, Record

TANKS = """
[model]
name = "two tanks"
time = "continuous"
[parameters]
k1 = { value = 0.06, min = 0.0, max = 1.0, unit = "1/s", free = true }     # free: may be re-fitted
k4 = 0.05
[[state]]
name = "h1"
derivative = "-k1*sqrt(h1) + k4*u"
initial = { value = 3.0, free = true }
unit = "cm"
[[state]]
name = "h2"
derivative = "k1*(sqrt(h1) - sqrt(h2))"
initial = 3.0
unit = "cm"
[[output]]
name = "y"
equation = "h2"
unit = "V"
"""
RICH = """
[model]
name = "every kind of entry"
time = "continuous"
[parameters]
tau = { value = 0.3, min = 0.0, unit = "s", free = true, prior_std = 0.1 }
dead = { value = 0.25, max = 5.0, unit = "s" }
w = 3.0
[[input]]
name = "pitch demand"
symbol = "u_1"
unit = "deg"
[[input]]
name = "push"
[[auxiliary]]
name = "force"
equation = "u_1 - w*tanh(v/0.1)"
[[auxiliary]]
name = "total"
equation = "force + max(push, -1.0)**3"
[[state]]
name = "q"
derivative = "v"
initial = { value = 0.2 }
unit = "m"
[[state]]
name = "v"
derivative = "total - w**2*q - 0.4*v"
unit = "m/s"
[[output]]
name = "position"
equation = "q + 0.01*push"
unit = "m"
[[output]]
name = "load"
equation = "total"
[[input_filter]]
input = "pitch demand"
kind = "actuator_lag"
tau_s = "tau"
[[input_filter]]
input = "push"
kind = "transport_delay"
delay_s = "dead"
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "model.toml"
    path.write_text(text, encoding="utf-8")
    return path


def record_of(model: Equations, samples: int, step: float, seed: int = 1) -> Record:
    u = np.random.default_rng(seed).standard_normal((samples, len(model.inputs)))
    channels = tuple(Channel(s.name, s.unit, "input") for s in model.inputs)
    return Record(step * np.arange(samples), 1.0 + 0.2 * u, channels, step, "test", "")


def test_the_contracts_example_loads(tmp_path: Path) -> None:
    model = equations_file.load(write(tmp_path, TANKS))
    assert model.name == "two tanks" and model.sample_time_s == 0
    k1, k4 = model.parameters
    assert (k1.value, k1.minimum, k1.maximum, k1.unit, k1.free) == (0.06, 0.0, 1.0, "1/s", True)
    assert (k4.value, k4.free, k4.minimum) == (0.05, False, -np.inf)
    assert [s.name for s in model.states] == ["h1", "h2"] and model.states[0].initial_free
    assert not model.states[1].initial_free and model.states[1].initial == 3.0
    assert [s.name for s in model.inputs] == ["u"] and [o.name for o in model.outputs] == ["y"]
    assert np.all(np.isfinite(model.simulate(record_of(model, 200, 1.0))))


@pytest.mark.parametrize("text", [TANKS, RICH], ids=["tanks", "every entry"])
def test_writing_and_reading_gives_the_same_simulation(tmp_path: Path, text: str) -> None:
    model = equations_file.load(write(tmp_path, text))
    again = equations_file.load(write(tmp_path, equations_file.to_toml(model)))
    record = record_of(model, 120, 0.05)
    np.testing.assert_array_equal(again.simulate(record), model.simulate(record))
    assert again.parameters == model.parameters and again.inputs == model.inputs and again.filters == model.filters
    assert [s.initial_free for s in again.states] == [s.initial_free for s in model.states]
    assert equations_file.to_toml(again) == equations_file.to_toml(model)


def test_pruning_keeps_what_is_used(tmp_path: Path) -> None:
    extra = '[[auxiliary]]\nname = "idle"\nequation = "force*2"\n[[state]]\nname = "q"'
    model = equations_file.load(write(tmp_path, RICH.replace('[[state]]\nname = "q"', extra, 1)))
    assert [a.name for a in model.auxiliaries] == ["force", "total", "idle"]
    assert [a.name for a in model.pruned().auxiliaries] == ["force", "total"]
    record = record_of(model, 50, 0.05)
    np.testing.assert_array_equal(model.pruned().simulate(record), model.simulate(record))


def swap(old: str, new: str, text: str = TANKS) -> str:
    assert text.count(old) >= 1
    return text.replace(old, new, 1)


MALFORMED = {
    "no toml": ("[model", ["not valid TOML"]),
    "empty": ("", ["[[output]]"]),
    "unknown table": (TANKS + "\n[modle]\n", ["'modle'"]),
    "unknown key of the model": (swap('time = "con', 'times = 1\ntime = "con'), ["[model]", "'times'"]),
    "unknown key of a parameter": (swap("min = 0.0", "minimum = 0.0"), ["k1", "'minimum'"]),
    "unknown key of a state": (swap('unit = "cm"', 'units = "cm"'), ["[[state]] 1", "'units'"]),
    "unknown key of an initial value": (swap("free = true }\nunit", "fre = true }\nunit"), ["h1 initial", "'fre'"]),
    "unknown key of an output": (swap('unit = "V"', 'units = "V"'), ["[[output]] 1", "'units'"]),
    "no value": (swap("value = 0.06, ", ""), ["k1", "value is missing"]),
    "value below min": (swap("0.06", "-0.06"), ["k1", "-0.06", "min 0"]),
    "value above max": (swap("0.06", "1.06"), ["k1", "1.06", "max 1"]),
    "min above max": (swap("min = 0.0, max = 1.0", "min = 1.0, max = 0.0"), ["k1", "min 1"]),
    "value no number": (swap("value = 0.06", 'value = "x"'), ["k1", "'x'"]),
    "value not finite": (swap("value = 0.06", "value = nan"), ["k1", "nan"]),
    "value truth": (swap("k4 = 0.05", "k4 = true"), ["k4", "True"]),
    "min no number": (swap("min = 0.0", 'min = "0"'), ["k1 min", "'0'"]),
    "prior of zero": (swap("free = true }  ", "free = true, prior_std = 0 }  "), ["k1", "prior_std"]),
    "free no truth": (swap("free = true }  ", 'free = "yes" }  '), ["k1", "true or false"]),
    "initial free no truth": (swap("free = true }\nunit", 'free = "yes" }\nunit'), ["h1", "true or false"]),
    "parameters no table": (swap("[parameters]", "parameters = 3\n[x]"), []),
    "model no table": (swap("[model]", "model = 3\n[x]"), []),
    "state no list": (swap("[[state]]", "[state]"), []),
    "output a text": ('output = "y"\n', ["output"]),
    "input a number": ("input = 3\n" + TANKS, ["input"]),
    "auxiliary a number": ("auxiliary = 3\n" + TANKS, ["auxiliary"]),
    "filter a number": ("input_filter = 3\n" + TANKS, ["input_filter"]),
    "unit a number": (swap('unit = "cm"', "unit = 3"), ["unit"]),
    "two states of one name": (swap('name = "h2"', 'name = "h1"'), ["'h1'", "twice"]),
    "state called like a parameter": (swap('name = "h2"', 'name = "k4"'), ["'k4'", "twice"]),
    "two outputs of one name": (TANKS + '[[output]]\nname = "y"\nequation = "h1"\n', ["'y'", "twice"]),
    "input called like a parameter": (TANKS + '[[input]]\nname = "k4"\n', ["'k4'", "twice"]),
    "name with a blank": (swap('name = "h1"', 'name = "h 1"'), ["'h 1'"]),
    "name of a function": (swap('name = "h1"', 'name = "sqrt"'), ["'sqrt'"]),
    "name of a constant": (swap('name = "h1"', 'name = "pi"'), ["'pi'"]),
    "name of a keyword": (swap('name = "h1"', 'name = "lambda"'), ["'lambda'"]),
    "name missing": (swap('name = "h1"\n', ""), ["[[state]] 1"]),
    "derivative missing": (swap('derivative = "-k1*sqrt(h1) + k4*u"\n', ""), ["h1", "derivative is missing"]),
    "derivative a number": (swap('"-k1*sqrt(h1) + k4*u"', "3"), ["h1", "3"]),
    "unknown function": (swap("-k1*sqrt", "-k1*root"), ["line 10", "'root'"]),
    "hat": (swap("k4*u", "k4*u^2"), ["line 10", "**"]),
    "bad initial": (swap("initial = 3.0", 'initial = "full"'), ["h2", "'full'"]),
    "initial not finite": (swap("initial = 3.0", "initial = inf"), ["h2", "inf"]),
    "no output": (TANKS[: TANKS.index("[[output]]")], ["[[output]]"]),
    "output without equation": (swap('equation = "h2"\n', ""), ["[[output]] 1", "equation"]),
    "unknown time base": (swap('"continuous"', '"sampled"'), ["'sampled'", "discrete"]),
    "discrete without sample time": (swap('"continuous"', '"discrete"'), ["sample_time_s", "None"]),
    "discrete with zero sample time": (swap('"continuous"', '"discrete"\nsample_time_s = 0'), ["sample_time_s"]),
    "filter of an unknown input": (swap('input = "push"', 'input = "pull"', RICH), ["input_filter", "'pull'"]),
    "filter of unknown kind": (swap('"transport_delay"', '"echo"', RICH), ["input_filter", "kind"]),
    "filter with unknown parameter": (swap('tau_s = "tau"', 'tau_s = "taw"', RICH), ["'taw'"]),
    "filter without parameter": (swap('tau_s = "tau"\n', "", RICH), ["tau_s is missing"]),
    "filter with a number": (swap('tau_s = "tau"', "tau_s = 0.3", RICH), ["tau_s is missing"]),
    "auxiliary before its source": (
        swap('"u_1 - w*tanh(v/0.1)"', '"u_1 - w*tanh(total/0.1)"', RICH), ["force", "'total'", "before"],
    ),
    "auxiliary of itself": (swap('"force + max', '"total + max', RICH), ["total", "before"]),
    "auxiliary without equation": (swap('equation = "u_1 - w*tanh(v/0.1)"\n', "", RICH), ["force", "equation"]),
    "derivative in discrete time": (
        swap('"continuous"', '"discrete"\nsample_time_s = 1.0'), ["h1", "next"],
    ),
    "next in continuous time": (swap("derivative", "next"), ["h1", "derivative"]),
    "both next and derivative": (swap("derivative", 'next = "h1"\nderivative'), ["h1", "next"]),
}  # fmt: skip


@pytest.mark.parametrize("case", MALFORMED)
def test_every_slip_is_one_sentence_with_the_file(
    tmp_path: Path, case: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text, words = MALFORMED[case]
    path = write(tmp_path, text)
    with pytest.raises(DataError) as caught:
        equations_file.load(path)
    message = str(caught.value)
    assert "\n" not in message and message.startswith(str(path)), message
    for word in words:
        assert word in message, message


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none\.toml: no such file"):
        equations_file.load(tmp_path / "none.toml")


def test_the_command_line_says_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = write(tmp_path, swap("-k1*sqrt", "-k1*root"))
    (tmp_path / "roles.toml").write_text(
        '[recording]\nsample_time_s = 1.0\n[[channel]]\nname = "u"\nunit = "V"\nrole = "input"\n'
    )
    (tmp_path / "u.csv").write_text("u\n1\n1\n2\n")
    arguments = ["simulate", model, tmp_path / "u.csv", "--roles", tmp_path / "roles.toml", "--out", tmp_path / "o.csv"]
    assert main([str(a) for a in arguments]) == 3
    error = capsys.readouterr().err
    assert "model.toml line 10" in error and "Traceback" not in error and len(error.strip().splitlines()) == 1


def test_a_diverging_run_names_the_sample(tmp_path: Path) -> None:
    model = equations_file.load(write(tmp_path, swap("-k1*sqrt(h1)", "h1**3")))
    with pytest.raises(DataError, match=r"sample [0-9]+"):
        simulate(compile_equations(model), np.ones((50, 1)), model.theta, model.x0, 1.0)


def test_a_missing_input_sample_is_named(tmp_path: Path) -> None:
    model = equations_file.load(write(tmp_path, TANKS))
    record = record_of(model, 50, 1.0)
    record.values[17, 0] = np.nan
    with pytest.raises(DataError, match="u is missing at sample 18"):
        model.simulate(record)
