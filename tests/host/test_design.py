"""`aeolid design` and `aeolid.design`: files, facts, the same numbers from both, and what is refused."""

from __future__ import annotations

import inspect
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import aeolid as ae
from aeolid.cli.design import design as command
from aeolid.cli.main import main
from aeolid.excitation.candidates import Wanted, candidates, within_reach
from aeolid.excitation.quantities import Bound
from aeolid.excitation.signals import make_signals
from aeolid.models.modes import Mode
from aeolid.models.state_space import StateSpace
from aeolid.plants.examples import turbine_model, write_examples

SHORT = ["--bound", "pitch=1deg", "--duration", "4", "--past", "3", "--goal", "0.45"]
WORDS = ["--bound", "pitch=1deg", "--rate", "pitch=5deg/s", "--duration", "300"]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the model that the first example of the manual identifies."""
    folder = tmp_path_factory.mktemp("design")
    write_examples(folder, samples=2000)
    target = folder / "model.json"
    record = ae.read(folder / "monday.csv", roles=folder / "roles.toml")
    ae.identify(record, past=20, order=6).save(target)
    return target


def test_the_command_writes_signal_facts_and_settings(model, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["design", str(model), *WORDS, "--out", "e.csv", "--json", "e.json", "--wrapper", "w.cfg", "--demand",
             "pitch=0..90deg", "--start", "60"]  # fmt: skip
    assert main(words) == 0
    said, facts = capsys.readouterr().out, json.loads(Path("e.json").read_text())
    table = np.loadtxt("e.csv", delimiter=",", skiprows=1)
    assert Path("e.csv").read_text().splitlines()[0] == "time_s,pitch" and table.shape == (3000, 2)
    assert abs(table[:, 1]).max() <= 1 and (abs(np.diff(table[:, 1], prepend=0)) <= 0.5).all()
    assert np.allclose(table[:, 0], 0.1 * np.arange(3000), atol=1e-12)
    assert facts["kind"] in ("prbs", "multisine") and facts["wrapper_plays"] and Path("w.cfg").read_text() in said
    assert facts["identification"] == {"past": 20, "order": 6} and "identify --past 20 --order 6" in said
    tower = next(m for m in facts["modes"] if m["name"] == "tower fore-aft")
    assert tower["reached"] and 0 < tower["least_damping_std"] < tower["noise_damping_std"]
    assert "inputs without a bound are taken as held still: torque" in facts["notes"]
    ranks = [(not c["firm"], c["relative_deviation"]) for c in facts["candidates"]]
    assert ranks == sorted(ranks)


def test_python_and_the_command_give_the_same(model, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert (
        main(["design", str(model), *WORDS, "--goal", "tower fore-aft", "--seed", "3", "--out", "e.csv", "--json", "-"])
        == 0
    )
    facts = json.loads(capsys.readouterr().out)
    found = ae.design(ae.load_model(model), bound={"pitch": 1.0}, rate={"pitch": "5deg/s"}, duration=300,
                      goal="tower fore-aft", seed=3)  # fmt: skip
    table = np.loadtxt("e.csv", delimiter=",", skiprows=1)
    assert np.array_equal(found.values[:, 0], table[:, 1]) and found.inputs == ("pitch",)
    assert {k: v for k, v in found.to_json().items() if k != "model"} == {
        k: v for k, v in facts.items() if k not in ("model", "out", "wrapper")
    }
    found.save("f.csv")
    assert Path("f.csv").read_bytes() == Path("e.csv").read_bytes()
    assert found.to_frame().shape == (3000, 1) and len(found.modes.to_frame()) == len(found.modes)
    assert "relative deviation" in repr(found) and "<table" in found._repr_html_() and found.duration_s == 300
    assert found.candidates[0].score == found.relative_deviation and len(found.channels) == 3
    assert found.summary() and found.notes and found.time_s[-1] == pytest.approx(299.9)
    with pytest.raises(ae.UsageError, match="wrapper"):
        found.wrapper()


def test_modes_of_the_loop_take_the_controller(model):
    """A weak integral of the speed into the pitch: a file of its own, in other units."""
    m = ae.load_model(model).state_space
    speed = m.outputs[0]
    held = StateSpace(
        np.array([[0.99]]), np.array([[0.01]]), np.array([[0.02]]), np.zeros((1, 1)), None, np.zeros(1), None, 0.1,
        (replace(speed, unit="rad/s", offset=0.0),), (replace(m.inputs[0], unit="rad", offset=0.0),), (),
    )  # fmt: skip
    controller = ae.LinearModel(held)
    found = ae.design(model, bound={"pitch": "1deg"}, duration=300, signal="prbs", controller=controller)
    assert found.result.closed_loop and found.to_json()["closed_loop"]


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--duration", "300"], 2, "no input has a bound"),
        (["--bound", "pitch=1deg"], 2, "either --duration or --deviation"),
        (["--bound", "pitch", "--duration", "300"], 2, "is not NAME=VALUE"),
        ([*WORDS, "--deviation", "much"], 2, "--deviation 'much'"),
        ([*WORDS, "--band", "1"], 2, "--band '1'"),
        ([*WORDS, "--start", "5"], 2, "--wrapper FILE"),
        ([*WORDS, "--wrapper", "w.cfg"], 2, "--demand pitch=LOW..HIGH"),
        ([*WORDS, "--goal", "9"], 2, "no mode within a fifth"),
        ([*WORDS, "--controller", "none.json"], 3, "none.json"),
        (["--bound", "pitch=1deg", "--duration", "10"], 4, "past window of 20"),
        ([*SHORT, "--signal", "multisine"], 2, "no two lines"),
        ([*WORDS, "--sample-time", "2"], 2, "--sample-time 2: a value every 2 s reaches up to 0.225 Hz, not to tower"),
        ([*WORDS, "--goal", "drive train", "--sample-time", "0.5"], 2, "0.9 Hz, not to drive train"),
    ],
)
def test_wrong_commands_end_with_a_sentence_and_no_file(model, tmp_path, monkeypatch, capsys, words, code, said):
    monkeypatch.chdir(tmp_path)
    assert main(["design", str(model), *words, "--out", "e.csv"]) == code
    assert said in " ".join(capsys.readouterr().err.split()) and list(tmp_path.iterdir()) == []


def test_settings_are_those_of_the_command():
    own = set(inspect.signature(ae.design).parameters) - {"model"}
    assert own == set(inspect.signature(command).parameters) - {
        "model_file", "out", "wrapper", "start", "json_target", "force",  # Excitation.save, .wrapper
    }  # fmt: skip


def test_arguments_of_other_types_are_refused(model):
    with pytest.raises(ae.UsageError, match="bound is a list"):
        ae.design(model, bound=["pitch"], duration=300)
    for wrong in ({"duration": [300]}, {"duration": 300, "seed": True}, {"duration": 300, "past": "20"}):
        with pytest.raises(ae.UsageError, match=r"a (whole )?number"):
            ae.design(model, bound={"pitch": 1}, **wrong)


def test_models_without_noise_or_of_another_kind_are_refused(tmp_path):
    with pytest.raises(ae.UsageError, match="has no noise"):
        ae.design(ae.LinearModel(turbine_model()), bound={"pitch": 1}, duration=300)
    with pytest.raises(ae.UsageError, match="a linear model is needed, found int"):
        ae.design(7, bound={"pitch": 1}, duration=300)
    write_examples(tmp_path, samples=200)
    with pytest.raises(ae.UsageError, match="a linear model is needed, found Equations"):
        ae.design(tmp_path / "stage" / "model.toml", bound={"drive": 1}, duration=300)


def test_a_signal_nobody_asked_for_is_left_out(model, tmp_path, monkeypatch, capsys):
    """Four seconds hold no multisine: another signal is taken, and no option is blamed that was not given."""
    monkeypatch.chdir(tmp_path)
    assert main(["design", str(model), *SHORT, "--out", "e.csv"]) == 0
    assert "--band" not in capsys.readouterr().err


@pytest.mark.parametrize("signal", [None, "multisine", "filtered"])
@pytest.mark.parametrize("step", [0.1, 0.2, 0.5, 1.0, 1.5, 4.0])
def test_no_signal_is_designed_for_what_its_values_do_not_reach(step, signal):
    """Whatever the time between values: bands below 0.45 of their rate, and goals in them, or a way out is told."""
    slow, fast = (mode_at(f) for f in (0.4463, 1.677))
    setup, wanted, rows = SimpleNamespace(step_s=step, bounds=(Bound("pitch", "deg", 1.0),)), Wanted(signal), 6000
    within = tuple(m for m in (slow, fast) if m.frequency_hz < 0.45 / step)
    if not within:
        with pytest.raises(ae.UsageError, match=f"--sample-time {step:g}: .* give less than 0.268 s"):
            within_reach((slow, fast), step, wanted)
        return
    goals, note = within_reach((slow, fast), step, wanted)
    assert goals == within and ("nothing is designed for drive train 1.677 Hz" in note) == (len(within) < 2)
    shapes = candidates(setup, goals, wanted, rows)
    assert shapes and all(s.low_hz < s.high_hz <= 0.45 / step for s in shapes if s.kind != "prbs")
    for shape in shapes:
        assert abs(make_signals(shape, setup.bounds, rows, step, 1).values).max() <= 1.0


def mode_at(hertz):
    return Mode(hertz, 0.01, 0j, None, None, {}, name="drive train" if hertz > 1 else "tower fore-aft")


def test_a_signal_that_is_asked_for_itself_is_made_at_any_rate(model):
    """What it tells of modes beyond the reach of its values is foretold, not refused."""
    goals = (mode_at(0.4463), mode_at(1.677))
    for wanted in (Wanted("prbs"), Wanted(clock_s=4.0), Wanted(band_hz=(0.05, 0.2))):
        assert within_reach(goals, 2.0, wanted) == (goals, "")
    found = ae.design(ae.load_model(model), bound={"pitch": "5deg"}, duration=600, sample_time=2.0, signal="prbs")
    assert found.result.signals.shape.clock_rows == 1


def test_python_takes_times_as_the_command_does(model):
    loaded = ae.load_model(model)
    one, other = (
        ae.design(loaded, bound={name: 1.0}, duration=length, signal="multisine", sample_time=step)
        for name in loaded.inputs[:1] for length, step in ((60.0, None), ("1min", f"{1000 * loaded.sample_time_s:g}ms"))
    )  # fmt: skip
    np.testing.assert_array_equal(one.result.signals.values, other.result.signals.values)
    for argument in ("duration", "clock", "sample_time"):
        with pytest.raises(ae.UsageError, match=f"{argument} = 'soon' is no length of time"):
            ae.design(loaded, bound={loaded.inputs[0]: 1.0}, **({"duration": 60} | {argument: "soon"}))
