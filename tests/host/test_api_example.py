"""What the README shows of `import aeolid` runs line by line, as printed, and gives what is promised."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from api_cases import write_folder
from doc_pages import ROOT, blocks

matplotlib.use("Agg")
import aeolid as ae
from aeolid.api.diagnosis import Diagnosis
from aeolid.cli.main import main

pytestmark = pytest.mark.diagnosis  # its fixture is one


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    """Run the block of the README in a folder with the files it names; returns its names."""
    (block,) = (b for b in blocks(ROOT / "README.md") if b.language == "python" and "import aeolid as ae" in b.text)
    folder, before = tmp_path_factory.mktemp("example"), os.getcwd()
    write_folder(folder)
    os.chdir(folder)
    try:
        names: dict[str, Any] = {"tuesday": ae.read("tuesday.outb", roles="roles.toml"), "folder": folder}
        for line in block.text.replace("monday.csv", "monday.outb").splitlines():  # this rig's is one of OpenFAST
            exec(compile(line, block.place, "exec"), names)
        yield names
    finally:
        os.chdir(before)
        import matplotlib.pyplot as plt

        plt.close("all")


def test_results_print_as_one_line_and_as_html(shown: dict[str, Any]) -> None:
    m, d, tuesday = shown["m"], shown["d"], shown["tuesday"]
    results = [shown["rec"], m, m.modes, m.fit, m.simulate(tuesday), m.validate(tuesday), d, d.effects, d.scores]
    results += [d.not_excluded, d.corrected_model, d.corrected_model.parameters, *d.effects]
    for result in results:
        text = repr(result)
        assert text.startswith("<") and text.endswith(">") and "\n" not in text and len(text) < 300, text
        if not isinstance(result, ae.Effect):
            assert result._repr_html_().startswith("<") and len(result.to_frame()) > 0, text
    assert repr(m).startswith("<LinearModel: ") and "one-step fit" in repr(m)
    assert repr(shown["rec"]) == "<Record: 600 samples, 0.1 s, 1 input, 1 output, monday.outb>"


def test_the_diagnosis_finds_the_drag(shown: dict[str, Any]) -> None:
    d = shown["d"]
    assert d.verdict in ("named", "ambiguous") and "quadratic_damping" in [e.id for e in d.effects]
    (drag,) = (e for e in d.effects if e.id == "quadratic_damping")
    told = drag.parameters["c2"]
    assert abs(told["value"] - 0.4) < 4 * told["std"]
    assert set(d.to_frame().columns) == {"effect", "parameter", "value", "std", "unit", "weight"}
    assert d.scores.to_frame()["statistic"].iloc[0] > 0 and d.sealed["log_likelihood_gain"] > 0


def test_the_report_is_that_of_the_command(shown: dict[str, Any]) -> None:
    """Same recordings, model and seed: the same diagnosis, but for names and times."""
    folder = shown["folder"]
    case = folder / "case"
    case.mkdir()
    for name in ("monday.outb", "roles.toml", "model.toml"):
        (case / name).write_bytes((folder / name).read_bytes())
    (case / "case.toml").write_text(
        '[case]\ntitle = "diagnosis"\n[recordings]\nfiles = ["monday.outb"]\nroles = "roles.toml"\n'
        '[baseline]\nkind = "equations"\nfile = "model.toml"\n'
    )
    assert main(["diagnose", str(case), "--out", str(folder / "told"), "--no-report"]) == 0
    facts = [json.loads((folder / place / "diagnosis.json").read_text()) for place in ("told", "out")]
    assert facts[0] == facts[1] == json.loads(json.dumps(shown["d"].to_json()))
    models = [(folder / place / "model" / "model.toml").read_text() for place in ("told", "out")]
    assert models[0] == models[1] == shown["d"].corrected_model.to_text()
    series = [(folder / place / "sealed_before_after.csv").read_bytes() for place in ("told", "out")]
    assert series[0] == series[1] and (folder / "out" / "report.html").stat().st_size > 10_000


def test_pictures_are_drawn_on_the_axes_given(shown: dict[str, Any]) -> None:
    import matplotlib.pyplot as plt

    m, d, tuesday = shown["m"], shown["d"], shown["tuesday"]
    places = plt.subplots(2, 2)[1]
    assert m.plot_bode(places[:, 0])[0, 0] is places[0, 0] and m.plot_poles(places[0, 1]) is places[0, 1]
    assert all(place.has_data() for place in places[:, 0])
    for draw, count in (
        (d.plot_before_after, 1), (m.simulate(tuesday).plot, 1), (tuesday.plot, 2),
        (m.validate(tuesday).plot_residuals, 2),
    ):  # fmt: skip
        given = plt.subplots(1, count, squeeze=False)[1]
        assert list(np.ravel(draw(given))) == list(given.ravel()) and given[0, 0].has_data()
        with pytest.raises(ae.UsageError, match=r"axes: .* are needed here, 7 given"):
            draw(plt.subplots(1, 7)[1])
    assert d.plot_scores(most=3).has_data()


def test_sealed_stretches_of_several_recordings_are_drawn_behind_each_other() -> None:
    """The times of recordings may be the same; where they are not, they stay. No line leads from one to the next."""
    own = {"time_s": [5.0, 6.0, 7.0], "measured": [1.0, None, 2.0], "before": [0.0] * 3, "after": [0.0] * 3}
    later = {k: [t + 7 for t in v] if k == "time_s" else v for k, v in own.items()}
    for second, at in ((own, [8.0, 9.0, 10.0]), (later, [12.0, 13.0, 14.0])):
        series = {k: [*v, *second[k]] for k, v in own.items()} | {"stretch": [1, 1, 1, 2, 2, 2], "unit": "m"}
        line = Diagnosis({"verdict": "named"}, {"series": {"y": series}}, {}).plot_before_after()[0].lines[0]
        np.testing.assert_array_equal(line.get_xdata(), [5.0, 6.0, 7.0, np.nan, *at])
        np.testing.assert_array_equal(line.get_ydata(), [1.0, np.nan, 2.0, np.nan, 1.0, np.nan, 2.0])


def test_the_corrected_model_is_worth_it_on_another_day(shown: dict[str, Any]) -> None:
    """The drag is what monday's model lacks, so tuesday is met better with it."""
    before = ae.simulate(ae.Equations.load(shown["folder"] / "model.toml"), shown["tuesday"])
    after = shown["d"].corrected_model.simulate(shown["tuesday"])
    assert after.fit[0]["nrmse"] < 0.7 * before.fit[0]["nrmse"]


def test_a_contradiction_between_recording_and_model_is_a_verdict(tmp_path: Path) -> None:
    """As on the command line: the recording is at fault, in words, and there is no model to go on with."""
    write_folder(tmp_path)
    rec = ae.read(tmp_path / "monday.outb", {"pitch": ("input", "deg"), "rotor_speed": ("output", "rpm")})
    core = ae.Equations.load(tmp_path / "model.toml").to_text().replace('"rpm"', '"rad/s"')
    (tmp_path / "other.toml").write_text(core)
    d = ae.diagnose(rec, baseline=tmp_path / "other.toml", sham=0)
    assert d.verdict == "data_fault" and "rotor_speed" in d.statement and len(d.effects) == 0
    assert d.plot_before_after()[0].texts and repr(d) == "<Diagnosis: data_fault>"
    with pytest.raises(ae.NotIdentifiable, match="no model was fitted"):
        _ = d.corrected_model
