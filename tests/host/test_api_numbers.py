"""From Python and from the command line the same settings give the same numbers, threads and errors."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from api_cases import UNITS, write_folder

import aeolid as ae
from aeolid.api.session import in_python
from aeolid.cli.main import main
from aeolid.models.state_space import StateSpace
from aeolid.plants.examples import write_examples


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("days")
    write_folder(place)
    write_examples(place / "turbine", samples=1200)
    return place


SETTINGS: dict[str, tuple[list[str], dict[str, Any]]] = {
    "varx": (["--past", "12", "--order", "3"], {"past": 12, "order": 3}),
    "seconds": (["--past", "1.2s", "--regularize", "0.001", "--delay", "pitch=1"],
                {"past": "1.2s", "regularize": 0.001, "delay": {"pitch": 1}}),
    "varmax": (["--method", "varmax", "--past", "6", "--order", "2", "--passes", "2", "--feedthrough", "none"],
               {"method": "varmax", "past": 6, "order": 2, "passes": 2, "feedthrough": "none"}),
    "fir": (["--method", "fir", "--past", "20", "--order", "2", "--decimate", "2"],
            {"method": "fir", "past": 20, "order": 2, "decimate": 2}),
    "left to the data": ([], {}),
}  # fmt: skip


@pytest.mark.parametrize("case", SETTINGS)
def test_models_are_the_same(folder: Path, tmp_path: Path, case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    options, settings = SETTINGS[case]
    monkeypatch.chdir(folder)
    out = tmp_path / "model.json"
    assert main(["identify", "monday.outb", "--roles", "roles.toml", "--out", str(out), *options]) == 0
    model = ae.identify(ae.read("monday.outb", roles="roles.toml"), **settings)
    model.save(tmp_path / "saved.json")
    assert json.loads(out.read_text()) == json.loads((tmp_path / "saved.json").read_text())


def test_a_scheduled_model_is_the_same_and_goes_round(tmp_path: Path) -> None:
    """Tables, operating points and the model at one of them; the numbers are those of the command."""
    rng = np.random.default_rng(4)
    u, s = rng.standard_normal(900), np.repeat(rng.uniform(0, 1, 18), 50)
    y, x = np.empty(900), 0.0
    for k in range(900):
        y[k] = x + 0.01 * rng.standard_normal()
        x = (0.3 + 0.5 * s[k]) * x + u[k]
    rec = ae.Record.from_arrays({"u": u, "y": y, "wind": s}, inputs=["u"], outputs=["y"], roles={"wind": "scheduling"},
                                units={"wind": "m/s"}, sample_time=0.5)  # fmt: skip
    m = ae.identify(rec, method="lpv", past=4, order=1, refine=False)
    assert isinstance(m, ae.ScheduledModel) and m.scheduling == ("wind",)
    assert abs(m.at({"wind": 1.0}).eigenvalues[0] - 0.8) < 0.05 > abs(m.at({"wind": 0.0}).eigenvalues[0] - 0.3)
    m.save(tmp_path / "m.json")
    again = ae.load_model(tmp_path / "m.json")
    assert isinstance(again, ae.ScheduledModel) and repr(again) == repr(m)
    assert again.modes.to_frame().equals(m.modes.to_frame()) and len(again.points) >= 3
    assert np.array_equal(again.simulate(rec).values, m.simulate(rec).values)
    assert m.mean.order == 1 and m.to_control().nstates == 1
    with pytest.raises(ae.UsageError, match="a value of each of wind is needed"):
        m.at({"gust": 1.0})


def test_a_model_goes_round(folder: Path, tmp_path: Path) -> None:
    turbine = folder / "turbine"
    rec = ae.read(turbine / "monday.csv", roles=turbine / "roles.toml")
    m = ae.identify(rec, past=20, order=7)
    assert isinstance(m, ae.LinearModel)
    for name in ("m.json", "m.mat"):
        m.save(tmp_path / name)
        again = ae.load_model(tmp_path / name)
        assert isinstance(again, ae.LinearModel) and np.array_equal(again.state_space.A, m.state_space.A)
        assert again.inputs == m.inputs and np.array_equal(again.simulate(rec).values, m.simulate(rec).values)
    again = ae.load_model(tmp_path / "m.json")
    assert repr(again) == repr(m) and again.to_frame().equals(m.to_frame()) and again.to_json() == m.to_json()
    with pytest.raises(ae.UsageError, match=r"m.xls: a model is written as .json or .mat"):
        m.save(tmp_path / "m.xls")


def test_validation_and_simulation_are_the_same(folder: Path, tmp_path: Path) -> None:
    turbine = folder / "turbine"
    model, tuesday, roles = (str(turbine / n) for n in ("my_case/model.json", "tuesday.csv", "roles.toml"))
    assert (
        main(["validate", model, tuesday, "--roles", roles, "--steps", "2,7", "--json", str(tmp_path / "v.json")]) == 0
    )
    rec = ae.read(tuesday, roles=roles)
    v = ae.validate(model, rec, steps=[7, 2])
    facts = json.loads((tmp_path / "v.json").read_text())
    own = json.loads(json.dumps(v.to_json()))
    assert {key: facts[key] for key in own} == own and v.verdict is None  # no noise model
    for initial in ("estimate", "zero"):
        out = tmp_path / f"{initial}.csv"
        assert main(["simulate", model, tuesday, "--roles", roles, "--out", str(out), "--initial", initial]) == 0
        ae.load_model(model).simulate(rec, initial=initial).save(tmp_path / "own.csv")  # type: ignore[call-arg]
        assert out.read_bytes() == (tmp_path / "own.csv").read_bytes()


def test_a_fleet_is_the_same(folder: Path, tmp_path: Path) -> None:
    turbine = folder / "turbine"
    days, roles = [str(turbine / f"{day}.csv") for day in ("monday", "tuesday")], str(turbine / "roles.toml")
    command = ["fleet", *days, "--roles", roles, "--past", "10", "--order", "7", "--workers", "1"]
    assert main([*command, "--out", str(tmp_path / "told")]) == 0
    found = ae.fleet(days, roles, past=10, order=7, out=tmp_path / "own")
    facts = json.loads((tmp_path / "told" / "fleet.json").read_text())
    assert facts == json.loads(json.dumps(found.to_json())) and len(found.to_frame()) == len(found.modes) > 0
    assert found.report() == tmp_path / "own" / "report.html" and found.plot_modes().has_data()
    assert repr(found).startswith("<Fleet: 1 turbine, ")


THREADS = """
import os, threading, scipy.linalg
from threadpoolctl import threadpool_info, threadpool_limits
import aeolid as ae
from aeolid.api.session import one_thread, public

def blas():
    return {lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"}

@public
def inner(fail=False):
    if fail:
        raise ae.DataError("broken")
    return blas()

@public
def outer():
    return inner() | blas()

free = blas()
assert outer() == {1} and blas() == free
try:
    inner(True)
except ae.DataError:
    assert blas() == free
entered, leave = threading.Event(), threading.Event()

def other():
    with one_thread():
        entered.set()
        leave.wait(1200)

worker = threading.Thread(target=other)
with one_thread():
    worker.start()
    entered.wait(1200)
assert blas() == {1}, "the other one is still at work"
leave.set()
worker.join()
assert blas() == free and outer() == {1} and blas() == free
with threadpool_limits(2, user_api="blas"):
    assert outer() == {2}, "the caller's own limit holds"
os.environ["OPENBLAS_NUM_THREADS"] = "2"
assert outer() == free, "what is set there holds, as on the command line"
"""


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one processor: linear algebra has one thread anyway")
def test_linear_algebra_runs_on_one_thread() -> None:
    """Within a call, nested, side by side and after an error; outside it is as it was."""
    environment = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    done = subprocess.run([sys.executable, "-c", THREADS], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "another method's": ({"passes": 2}, "passes and forget belong to method varmax"),
    "an unknown method": ({"method": "n4sid"}, "method 'n4sid' is unknown; this release has varx, varmax"),
    "a filter": ({"method": "rls"}, "rls is a filter: aeolid filter method rls"),
    "no order": ({"order": "many"}, "order 'many' is neither a whole number nor auto"),
    "no window": ({"past": "long"}, "past 'long' is neither a number of samples, nor seconds such as 12s, nor auto"),
    "no channel": ({"feedthrough": ["yaw"], "past": 5}, "feedthrough of 'yaw': no such input; the inputs are pitch"),
    "two ways": ({"order": 3, "order_criterion": "aic"}, "order_criterion decides where order is auto, not 3"),
    "no bar": ({"progress": 3}, "progress is a int; True, False, None or a function"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_settings_are_told_in_the_words_of_python(folder: Path, case: str) -> None:
    settings, words = WRONG[case]
    rec = ae.read(folder / "monday.outb", roles=folder / "roles.toml")
    with pytest.raises(ae.UsageError) as told:
        ae.identify(rec, **settings)
    assert words in str(told.value) and "--" not in str(told.value)


def test_wrong_types_and_units_are_refused_with_a_remedy(folder: Path) -> None:
    rec = ae.read(folder / "monday.outb", roles=folder / "roles.toml")
    model = ae.identify(rec, past=8, order=1)
    shifted = ae.Record.from_pandas(rec.to_pandas(), inputs=["pitch"], outputs=["rotor_speed"], units={"pitch": "rad"})
    gone = rec.to_pandas()
    gone.iloc[7, 0] = np.nan
    holed = ae.Record.from_pandas(gone, inputs=["pitch"], outputs=["rotor_speed"], units=UNITS)
    anything: Any = ae
    for call, error, words in (
        (lambda: anything.identify(gone), ae.UsageError, "records is a DataFrame; .* Record.from_pandas"),
        (lambda: anything.identify([]), ae.UsageError, "records is empty; at least one"),
        (lambda: anything.identify([rec, "x"]), ae.UsageError, r"records\[1\] is a str; a Record is needed"),
        (lambda: anything.validate(3, rec), ae.UsageError, "model is a int; a model is needed"),
        (lambda: anything.validate(model, rec, steps="5"), ae.UsageError, "steps = '5' is not a list of whole numbers"),
        (lambda: anything.validate(model, rec, steps=[0]), ae.UsageError, "steps 0: every horizon must be within 1"),
        (lambda: anything.simulate(model, rec, initial="x"), ae.UsageError, "initial 'x' is none of estimate"),
        (lambda: model.simulate(shifted), ae.DataError, "'pitch' is in 'rad', the model has it in 'deg'; multiply"),
        (lambda: model.simulate(holed), ae.DataError, "input 'pitch' is missing at sample 8; a free run needs"),
        (lambda: anything.diagnose(rec, 3), ae.UsageError, "model is a int; a model is needed"),
        (lambda: anything.diagnose(rec, folder / "no.toml"), ae.DataError, "no.toml: no such file"),
        (lambda: anything.diagnose(rec, model, sham=-1), ae.UsageError, "sham = -1 is not a whole number"),
        (lambda: anything.diagnose(rec, model, time_limit=0), ae.UsageError, r"time_limit = 0.* is no time"),
        (lambda: anything.diagnose(rec, model, context={"blades": 0}), ae.DataError, "blades = 0 is not a"),
        (lambda: ae.Equations.load(folder / "no.toml"), ae.DataError, "no.toml: no such file"),
        (lambda: model.plot_bode(inputs=["yaw"]), ae.UsageError, "'yaw' is no input of the model; it has pitch"),
    ):  # fmt: skip
        with pytest.raises(error, match=words):
            call()


def test_python_control_is_optional(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = ae.load_model(folder / "turbine" / "my_case" / "model.json")
    assert isinstance(model, ae.LinearModel) and isinstance(model.state_space, StateSpace)
    assert model.to_control().nstates == model.order
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(ae.UsageError, match=r"python-control is not installed; install it with: pip install"):
        model.to_control()


def test_options_become_parameters() -> None:
    assert in_python("--order-criterion is not for --no-offsets") == "order_criterion is not for offsets=False"
    assert in_python("a -- b, x--y, 3 --past (--past)") == "a -- b, x--y, 3 past (past)"


def test_progress_is_shown_where_it_is_asked_for(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from aeolid.api.progress import bar, shown

    rec = ae.read(folder / "monday.outb", roles=folder / "roles.toml")
    told: list[tuple[str, float]] = []
    ae.identify(rec, past=8, order=1, progress=lambda text, share: told.append((text, share)))
    assert [text.split()[0] for text, _ in told] == ["looking", "identifying"]
    ae.identify(rec, past=8, order=1)  # no terminal and no notebook here
    ae.identify(rec, past=8, order=1, progress=False)
    assert capsys.readouterr() == ("", "")
    with shown(True) as show:
        show("fitting <b>", 0.5)
    assert capsys.readouterr().err == "0 s: fitting <b>, 50 %\n"
    assert bar("a <b>", None, 2.0) == '<progress max="1"></progress> a &lt;b&gt;, 2 s'
    assert 'value="0.250"' in bar("a", 0.25, 2.0)
