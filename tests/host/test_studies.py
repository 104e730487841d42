"""Run the studies in their shortest form: the commands work and say what they should."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from study_modules import load_study


@pytest.mark.slow
def test_paper000_writes_table_figure_and_facts(tmp_path, capsys):
    """Two realisations with 1 % noise: VARMAX p = 10 finds what VARX p = 30 finds, and the files are there."""
    study = load_study("paper000")
    assert study.main(["--runs", "2", "--noise", "0.01", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said == (tmp_path / "paper000.txt").read_text() and "positive-real condition held in" in said
    assert (tmp_path / "paper000.png").stat().st_size > 20_000
    level = json.loads((tmp_path / "paper000.json").read_text())["levels"][0]
    rows = {(row["method"], row["past"], row["future"]): row for row in level["rows"]}
    assert list(rows) == list(study.METHODS)
    for row in rows.values():
        assert row["fall_7_8"] > 3 or row["past"] == 50
        assert row["mean"]["pole integrator"] < 0.008  # some three deviations of two runs
        assert max(row["mean"]["pole tower 1"], row["mean"]["pole tower 2"], row["mean"]["pole drive train"]) < 0.005
    ours, rival = rows[study.OURS], rows[study.RIVALS[0]]
    assert ours["mean"]["VAF ẋfa"] > rival["mean"]["VAF ẋfa"] - 0.02 and ours["innovation_rank"] == [3, 3]
    assert len(level["comparisons"]) == 2 and set(level["comparisons"][0]["measures"]) == set(ours["mean"])


def test_paper000_without_measurement_noise_has_innovations_of_rank_two():
    study = load_study("paper000")
    level = study.study(1, 10_000, [0.0])[0]["levels"][0]
    ours = level["rows"][study.METHODS.index(study.OURS)]
    assert ours["innovation_rank"] == [2, 3] and ours["rank"][0] < ours["rank"][1] and ours["condition"] > 1e13


def test_eighth_value_is_the_error_of_the_parameters(tmp_path, capsys):
    """It falls with the length as N^{-1/2} (a factor 2.8 here), with the true innovations too; drawn errors make it."""
    study = load_study("eighth_value")
    file = tmp_path / "facts.json"
    assert study.main(["--lengths", "2500", "20000", "--runs", "2", "--json", str(file)]) == 0
    assert "drawn" in capsys.readouterr().out
    short, long = json.loads(file.read_text())["rows"]
    assert short["true e"][0] < 2 * long["true e"][0]  # the seventh stays
    assert 1.5 < short["true e"][1] / long["true e"][1] < 6
    assert 0.4 < short["drawn"][1] / short["true e"][1] < 2.5


def answer(verdict: str, *effects: tuple[str, str, dict[str, float]]) -> dict[str, object]:
    return {
        "verdict": verdict,
        "effects": [
            {"id": i, "location": {"entry": where}, "parameters": {k: {"value": v} for k, v in values.items()}}
            for i, where, values in effects
        ],
    }


def test_known_cases_are_judged_by_verdict_name_place_and_value():
    study = load_study("known")
    truth = {
        "verdict": ["named", "multiple"], "ids": ["coulomb_friction"], "also_accepted": ["stiction"],
        "location": {"entry": "state:v"}, "parameters": {"force_N": {"value": 20.0, "tolerance": 0.1}},
    }  # fmt: skip
    nothing = {"verdict": ["no_mismatch"], "ids": []}
    friction = ("coulomb_friction", "state:v", {"force_N": 21.0})
    for said, right in (
        (answer("named", friction), True),
        (answer("multiple", friction, ("sensor_lag", "output:y", {})), True),
        (answer("named", ("stiction", "state:v", {"force_N": 19.0})), True),
        (answer("ambiguous", friction), False),
        (answer("named", ("backlash", "input:u", {})), False),
        (answer("named", ("coulomb_friction", "state:w", {"force_N": 21.0})), False),
        (answer("named", ("coulomb_friction", "state:v", {"force_N": 23.0})), False),
        (answer("named", ("coulomb_friction", "state:v", {})), False),
        (answer("no_mismatch"), False),
    ):
        assert study.is_right(study.judge(truth, said)) is right, said
    assert study.is_right(study.judge(nothing, answer("no_mismatch")))
    assert not study.is_right(study.judge(nothing, answer("named", friction)))


def test_known_cases_that_are_absent_are_said(tmp_path, capsys):
    study = load_study("known")
    assert study.main(["--cases", str(tmp_path / "none"), "--out", str(tmp_path)]) == 2
    assert str(tmp_path / "none") in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.nightly  # a study's smoke test that costs a whole fit
def test_told_values_are_held_against_the_truth(tmp_path, capsys):
    """One effect fitted as itself; the table counts bands that hold the truth, and a crash as nothing fitted."""
    study = load_study("told_values")
    number = next(n for n, i in enumerate(study.valued()) if (i.what, i.plant) == ("drive lags", "heater"))
    row = study.one(number, 0, 1500)
    assert row["key"] == "actuator_lag input:power" and abs(row["told"] - row["true"]) < 4 * row["std"]
    away = row | {"told": row["true"] + 3 * row["std"], "seed": 1}
    nothing = {k: row[k] for k in ("effect", "plant", "label", "number")} | {"seed": 2, "key": None, "why": "crash: 1"}
    said = study.table([row | {"told": row["true"]}, away, nothing])
    assert "1 of 2 in their 90 % band" in said and "+0, +3 | 2 of 3 |" in said
    out = tmp_path / "rows.jsonl"
    out.write_text(json.dumps(row) + "\n")
    with pytest.raises(SystemExit, match="no effect or plant is called nonsense"):
        study.main(["--only", "nonsense", "--out", str(out)])


def test_answers_of_two_trees_are_held_against_each_other(tmp_path, capsys):
    """Another verdict, name, value or sealed gain is a line; rounding, pictures and words about it are none."""
    study = load_study("same_answers")

    def write(side: str, case: str, tau: float, gain: float, **more: object) -> None:
        said = answer("named", ("lag", "input:u", {"tau_s": tau})) | {"sealed": {"log_likelihood_gain": gain}} | more
        (tmp_path / side / case).mkdir(parents=True)
        (tmp_path / side / case / "diagnosis.json").write_text(json.dumps(said))

    ask = [str(tmp_path / "a"), str(tmp_path / "b")]
    assert study.main(ask) == 2
    write("a", "one", 0.3, 14.0, statement="so")
    write("b", "one", 0.3 * (1 + 1e-12), 14.0, statement="thus")
    assert study.main(ask) == 0
    capsys.readouterr()
    for case, tau, gain, more in (
        ("two", 0.31, 14.0, {}),
        ("three", 0.3, 13.0, {}),
        ("four", 0.3, 14.0, {"effects": []}),
    ):
        write("a", case, 0.3, 14.0)
        write("b", case, tau, gain, **more)
    write("b", "five", 0.3, 14.0)
    (tmp_path / "a" / "six").mkdir()
    (tmp_path / "b" / "six").mkdir()
    (tmp_path / "a" / "six" / "result.json").write_text(json.dumps({"diagnosis": answer("named")}))
    (tmp_path / "b" / "six" / "result.json").write_text(json.dumps({"diagnosis": None, "outcome": "crash"}))
    assert study.main(ask) == 1
    said = capsys.readouterr().out
    assert "two: effects[0].parameters.tau_s.value: 0.3 → 0.31" in said
    assert "three: sealed.log_likelihood_gain: 14.0 → 13.0" in said and "four: effects: [" in said
    assert "five: only after" in said and 'six: verdict: "named" → "none: crash"' in said
    assert "1 of 6 answers are the same to 1e-09" in said


def test_noise_like_a_residual_has_its_colour_and_follows_no_input():
    """Spread and correlation of neighbours stay; what the residual had of an input goes: four deviations of 400."""
    study, rng = load_study("real_nulls"), np.random.default_rng(3)
    u = np.repeat(rng.standard_normal(400), 10)
    errors = lfilter([1.0], [1.0, -0.8], rng.standard_normal(4000)) + u
    drawn = study.like(errors, rng)
    assert drawn.std() == pytest.approx(errors.std(), rel=0.1)
    assert np.corrcoef(drawn[1:], drawn[:-1])[0, 1] == pytest.approx(
        np.corrcoef(errors[1:], errors[:-1])[0, 1], abs=0.05
    )
    assert abs(np.corrcoef(drawn, u)[0, 1]) < 4 * np.sqrt(10 / 4000) < abs(np.corrcoef(errors, u)[0, 1])


def test_nulls_of_a_case_are_judged_by_their_names():
    study = load_study("real_nulls")
    assert study.nulls_of("real_car_steering", study.KINDS, 2) == [("recorded", 1), ("simulated", 1), ("simulated", 2)]
    assert ("linear", 1) in study.nulls_of("real_robot_arm", study.KINDS, 1)
    said = answer("named", ("sensor_bias", "output:y", {})) | {
        "sealed": {"log_likelihood_gain": 7, "interval": [3, 12]}
    }
    row = study.row_of("a", "recorded", 1, said)
    assert row["effects"] == ["sensor_bias at output:y"]
    assert study.line_of(row) == "| a | recorded 1 | named | sensor_bias at output:y | 7 [3, 12] |"


def test_textbook_cases_are_written_as_the_diagnosis_reads_them(tmp_path):
    """One plant with and without its effect: the same seed makes the same bytes, and a null of it has no ids."""
    from aeolid.diagnose.data.case import load_case

    study = load_study("textbook")
    for folder in ("one", "two"):
        assert study.main(["--seed", "3", "--only", "crack", "--write-only", "--out", str(tmp_path / folder)]) == 0
    cases = sorted((tmp_path / "one" / "cases").iterdir())
    assert [c.name for c in cases] == ["crack", "crack_null"]
    for case in cases:
        loaded = load_case(case)
        assert loaded.records[0].values.shape == (3000, 2) and np.all(np.isfinite(loaded.records[0].values))
        for file in case.iterdir():
            assert file.read_bytes() == (tmp_path / "two" / "cases" / case.name / file.name).read_bytes()
    truths = [json.loads((c / "truth.json").read_text()) for c in cases]
    assert [t["ids"] for t in truths] == [["stiffness_change"], []]


def test_second_author_cases_are_written_as_the_diagnosis_reads_them(tmp_path):
    """A law without states, minutes in the heading of time, lost rows: each is read, and the same seed repeats it."""
    from aeolid.diagnose.data.case import load_case

    study = load_study("second_author")
    words = ["--only", "damper_friction", "furnace", "null_cstr", "--write-only", "--out"]
    for folder in ("one", "two"):
        assert study.main([*words, str(tmp_path / folder)]) == 0
    cases = sorted((tmp_path / "one" / "seed_0" / "cases").iterdir())
    assert [c.name for c in cases] == ["damper_friction", "furnace_rad", "null_cstr"]
    rows = {"damper_friction": 1200, "furnace_rad": 400, "null_cstr": 494}
    for case in cases:
        load_case(case)
        assert len((case / "run1.csv").read_text().splitlines()) == rows[case.name] + 1
        for file in case.iterdir():
            assert file.read_bytes() == (tmp_path / "two" / "seed_0" / "cases" / case.name / file.name).read_bytes()


def test_second_author_grades_names_values_and_nothing():
    """Right, one of several, without a name, nothing, a false name and a value far off."""
    study = load_study("second_author")
    hidden = study.Case("a", 1.0, {}, "", ("rate_limit",), ("actuator_lag",), {"rate_per_s": 2.0})
    complete = study.Case("b", 1.0, {}, "")
    outside = study.Case("c", 1.0, {}, "", outside=True)
    limit, far = ("rate_limit", "input:u", {"rate_per_s": 2.1}), ("rate_limit", "input:u", {"rate_per_s": 2.3})
    lag, bias = ("actuator_lag", "input:u", {"tau_s": 1.0}), ("sensor_bias", "output:y", {})
    told = [(hidden, "named", limit), (hidden, "named", lag), (hidden, "named", far), (hidden, "ambiguous", limit, lag),
            (hidden, "multiple", limit, bias), (hidden, "unnamed"), (hidden, "no_mismatch"),
            (complete, "immaterial"), (complete, "unnamed"), (complete, "data_fault"), (complete, "not_testable"),
            (outside, "unnamed"), (outside, "named", bias), (outside, "crash")]  # fmt: skip
    grades = [study.grade(case, answer(verdict, *effects)) for case, verdict, *effects in told]
    assert grades == ["right", "right", "wrong", "open", "wrong", "unnamed", "nothing",
                      "right", "unnamed", "wrong", "nothing", "right", "wrong", "wrong"]  # fmt: skip
    rows = [study.row_of(hidden, answer("named", far)), study.row_of(outside, answer("unnamed"))]
    said = study.table(rows)
    assert "| a | rate_limit | named | rate_limit | rate_per_s 2.3 (2) ✗ | wrong |" in said
    assert said.endswith("Of 2: 1 right, 0 open, 0 unnamed, 0 nothing, 1 wrong.")


def test_third_author_cases_are_written_as_the_diagnosis_reads_them(tmp_path):
    """A discrete model, hours in the heading of time, cuts, a gap, lost rows, a stuck gauge: each is read."""
    from aeolid.diagnose.data.case import load_case

    study = load_study("third_author")
    words = ["pi_constant", "null_ntc", "oil_thermostat", "null_ph", "mains_stuck"]
    assert study.main(["--only", *words, "--write-only", "--out", str(tmp_path)]) == 0
    rows = {"pi_constant": (1900,), "null_ntc": (310, 310), "oil_thermostat": (1640,), "null_ph": (918,),
            "mains_stuck": (1160,)}  # fmt: skip
    cases = {path.name: path for path in (tmp_path / "seed_0" / "cases").iterdir()}
    assert set(cases) == set(rows)
    for name, counts in rows.items():
        load_case(cases[name])
        files = sorted(cases[name].glob("run*.csv"))
        assert tuple(len(file.read_text().splitlines()) - 1 for file in files) == counts


@pytest.mark.parametrize("name", ["null_pi", "null_ntc", "null_brake", "null_cell"])
def test_third_author_nulls_are_complete(tmp_path, name):
    """At the true values the model that is given is the machine: noise and wrong values err a hundred times more."""
    from aeolid.diagnose.data.case import load_case

    study = load_study("third_author")
    stream, make = study.THIRD[name]
    case = replace(make(np.random.default_rng(stream)), cuts=(), lost=0, gap=None)
    load_study("second_author").write(case, tmp_path / name)
    loaded = load_case(tmp_path / name)
    model, record = loaded.baseline, loaded.records[0]
    assert set(case.true) <= {p.name for p in model.parameters}
    right = replace(model, parameters=tuple(replace(p, value=case.true.get(p.name, p.value)) for p in model.parameters))
    told, declared = right.simulate(record), model.simulate(record)
    for k, output in enumerate(model.outputs):
        clean = case.clean[output.name]
        noise = np.std(record.column(output.name) - clean)
        assert np.std(told[:, k] - clean) < 0.01 * min(noise, np.std(declared[:, k] - clean))


@pytest.mark.parametrize(
    ("author", "words", "of_several", "recordings"),
    [
        ("fourth_author", ["rubber_cold", "monopile_sea", "null_boost", "null_drone", "web_draws"], "rubber_cold", 6),
        ("fifth_author", ["air_spring", "pond_weir", "null_pole", "skid_bolt", "null_surge_tank"], "air_spring", 3),
        ("sixth_author", ["spindle_tap", "power_meter", "belt_mill", "steam_mixer", "null_lift"], "spindle_tap", 5),
        (
            "seventh_author",
            ["washer_load", "ferry_roll", "tug_gyro", "slide_hose", "null_receiver"],
            "null_receiver",
            3,
        ),
    ],
)
def test_later_authors_cases_are_written_as_the_diagnosis_reads_them(tmp_path, author, words, of_several, recordings):
    """Several recordings, lost rows, milliseconds, linear models, two effects: each is read, as another seed is."""
    from aeolid.diagnose.data.case import load_case

    study = load_study(author)
    for seed in ("0", "5"):
        assert study.main(["--only", *words, "--write-only", "--seed", seed, "--out", str(tmp_path)]) == 0
    cases = sorted(tmp_path.glob("seed_*/cases/*"))
    assert len(cases) == 2 * len(words)
    for case in cases:
        loaded = load_case(case)
        read = [record.columns([o.name for o in loaded.baseline.outputs]) for record in loaded.records]
        assert all(np.isfinite(y).mean() > 0.98 for y in read)
    assert len(list((tmp_path / "seed_0" / "cases" / of_several).glob("run*.csv"))) == recordings


def test_of_two_effects_with_one_value_name_the_one_that_is_asked_for_is_graded():
    """A tower's shadow and an imbalance both have the cosine part of a force."""
    study = load_study("second_author")
    case = study.Case("a", 1.0, {}, "", ("tower_shadow", "mass_imbalance"), (), {"force_N_cos": 1900.0})
    shadow = ("tower_shadow", "state:vf", {"force_N_cos": 1915.0})
    imbalance = ("mass_imbalance", "state:vs", {"force_N_cos": 674.0})
    for effects in ((shadow, imbalance), (imbalance, shadow)):
        assert study.grade(case, answer("multiple", *effects)) == "right"


def test_geared_axes_without_play_are_the_rigid_axis():
    """Behind teeth without a gap, 900 rad/s stiff, the load goes as the model's one body: to 1 % of its spread."""
    study = load_study("geared_axes")
    u = np.repeat([0.0, 0.4, -0.3, 0.1, 0.5], 60)
    plant = {"J": 0.03, "k": 8.0, "d": 0.5}
    y = study.turned(u, share=0.5, width=0.0, film=50.0, contact=900.0, loss=0.5, **plant)
    fine = np.repeat(u, 50)
    q = w = 0.0
    rigid = []
    for k, command in enumerate(fine):
        if k % 50 == 0:
            rigid.append((q, w))
        w += study.STEP / 50 * (8.0 * (command - q) - 0.52 * w) / 0.03
        q += study.STEP / 50 * w
    assert np.all(np.abs(y - rigid).max(axis=0) < 0.01 * np.std(y, axis=0))
    loose = study.turned(u, share=0.5, width=0.05, film=50.0, contact=900.0, loss=0.5, **plant)
    assert np.all(np.abs(loose - rigid).max(axis=0) > 0.05 * np.std(y, axis=0))
