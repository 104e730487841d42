"""The corpus of simulated pairs: its design, making that stops and goes on, and judging, without a simulator."""

import gzip
import json
from pathlib import Path

import pytest
from study_modules import load_study

from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.hypotheses.catalogue import entry

study = load_study("openfast_corpus")
design, making, answers, judging = study.design, study.making, study.scoring.answers, study.scoring.judging
COLUMNS = ("time_s", *making.CHANNELS, "blade_angle_1")


def fake_run(run, folder, scratch):
    """Write a run of 3,000 rows in which every value says its row."""
    rows = [f"{0.05 * k:.2f}," + ",".join([str(k)] * (len(COLUMNS) - 1)) for k in range(3_000)]
    with gzip.open(folder / "run.csv.gz", "wt", compresslevel=1) as f:
        f.write("\n".join([",".join(COLUMNS), *rows]) + "\n")
    return ""


def test_the_design_is_balanced_and_names_what_the_catalogue_has():
    pairs, runs = design.all_pairs(), design.all_runs()
    assert len({p.name for p in pairs}) == len(pairs) and {r.name for r in design.runs_in_order()} == set(runs)
    assert len({tuple(r.command()) for r in runs.values()}) == len(runs), "two runs of one seed"
    nulls = [p for p in pairs if p.effect == "null"]
    assert 2 * len(nulls) >= 60 and {p.wind for p in nulls} == set(design.WINDS)
    for pair in pairs:
        assert pair.recording != pair.simulation
        assert runs[pair.recording].wind == runs[pair.simulation].wind == pair.wind
        assert {entry(i).family for i in pair.ids} <= set(pair.families)
        assert all(entry(i) for i in pair.accepted)
    single = {p.effect for p in pairs if "_and_mode" not in p.effect and "_and_inflow" not in p.effect} - {"null"}
    for effect in single:
        assert {p.size for p in pairs if p.effect == effect} == set(design.SIZES), effect
        assert {p.part for p in pairs if p.effect == effect} == set(design.PARTS), effect
    assert abs(sum(p.part == "held" for p in nulls) - len(nulls) / 2) < 3
    first = pairs[:40]
    assert sum(p.effect == "null" for p in first) == 10 and len({p.effect for p in first}) > 25


def test_making_stops_and_goes_on_and_leaves_nothing_half_made(tmp_path, monkeypatch):
    few = [*design.all_pairs()[:5], design.all_pairs()[9]]
    names = dict.fromkeys(n for p in few for n in (p.simulation, p.recording))
    monkeypatch.setattr(making, "all_pairs", lambda: few)
    monkeypatch.setattr(making, "runs_in_order", lambda part=None: [design.all_runs()[n] for n in names])
    said, made = [], []

    def fails_at_the_third(run, folder, scratch):
        made.append(run.name)
        return "no wind\n" if len(made) == 3 else fake_run(run, folder, scratch)

    assert making.make(tmp_path, fails_at_the_third, 2, 0.0, said.append) is False and made == []
    assert making.make(tmp_path, fails_at_the_third, 2, None, said.append) is False
    missing = made[2]
    assert len(made) == len(names) and not (tmp_path / "runs" / missing).exists()
    assert (tmp_path / "failed" / f"{missing}.txt").read_text() == "no wind\n"
    whole = {p.name for p in few if missing not in (p.recording, p.simulation)}
    assert {c.name.rpartition("-")[0] for part in design.PARTS for c in (tmp_path / part).glob("*/")} == whole

    (tmp_path / "scratch" / "making-left").mkdir()  # of a process that was killed
    (tmp_path / "scratch" / "making-left.truth.json").touch()
    before = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.csv.gz")}
    assert making.make(tmp_path, fails_at_the_third, 1, None, said.append) is True
    assert made[len(names) :] == [missing] and not (tmp_path / "scratch").exists()
    assert not list((tmp_path / "failed").iterdir()) and "12 of 12 cases" in said[-1]
    assert before.items() <= {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.csv.gz")}.items()
    assert making.make(tmp_path, fails_at_the_third, 1, None, said.append) is True and len(made) == len(names) + 1

    with making.alone(tmp_path), pytest.raises(SystemExit, match="another process"):
        making.make(tmp_path, fake_run, 1, None, said.append)
    _cases_are_as_the_product_reads_them(tmp_path, few)


def _cases_are_as_the_product_reads_them(folder, pairs):
    pair = next(p for p in pairs if p.seconds < 150)
    for outputs, count in (("all", 6), ("two", 2)):
        folder_of_case = folder / pair.part / f"{pair.name}-{outputs}"
        record = load_case(folder_of_case).records[0]
        assert len(record.names("output")) == count and len(record.time_s) == round(pair.seconds / 0.05)
        assert sorted(p.name for p in folder_of_case.iterdir()) == [
            "case.toml", "recording.csv.gz", "roles.toml", "simulation.csv.gz"
        ]  # fmt: skip
        assert pair.effect not in (folder_of_case / "case.toml").read_text()
        truth = json.loads(answers.truth_file(folder_of_case).read_text())
        assert truth["ids"] == list(pair.ids) and truth["outputs"] == outputs


def effect(name, *, entry_="input:pitch_demand", rivals=0, **values):
    """Return an effect as diagnosis.json has it."""
    told = {k: {"value": v, "std": s, "unit": u} for k, (v, s, u) in values.items()}
    return {"id": name, "family": entry(name).family, "location": {"entry": entry_}, "parameters": told,
            "rivals": [{}] * rivals}  # fmt: skip


def answer(verdict, *effects, failed=0):
    """Return an answer as the study keeps it."""
    said = None if failed else {"verdict": verdict, "effects": list(effects), "run": {"nats_lost": 70.0}}
    return {"exit": failed, "diagnosis": said, "seconds": 3.0, "processor_s": 2.0, "memory_mb": 300.0}


def truth(effect_name, size="large"):
    pair = next(p for p in design.all_pairs() if p.effect == effect_name and p.size == size)
    return making.truth_of(pair, "all")


JUDGED = [
    ("lag", answer("named", effect("actuator_lag")), "name"),
    ("lag", answer("named", effect("actuator_second_order")), "name"),
    ("lag", answer("named", effect("actuator_lag", entry_="input:torque_demand")), "sure"),
    ("lag", answer("ambiguous", effect("backlash", rivals=1), effect("actuator_lag")), "open"),
    ("lag", answer("ambiguous", effect("backlash", rivals=1), effect("deadband")), "wrong"),
    ("lag", answer("named", effect("transport_delay")), "family"),
    ("lag", answer("unnamed"), "unnamed"),
    ("lag", answer("no_mismatch"), "nothing"),
    ("lag", answer("", failed=4), "failed"),
    ("lag", answer("data_fault"), "sure"),
    ("mode_tower", answer("named", effect("tower_fore_aft", entry_="tower", frequency_hz=(0.34, 0.01, "Hz"))), "name"),
    ("mode_tower", answer("named", effect("drivetrain_torsion", frequency_hz=(0.33, 0.01, "Hz"))), "family"),
    ("mode_tower", answer("named", effect("drivetrain_torsion", frequency_hz=(5.0, 0.03, "Hz"))), "sure"),
    ("mode_tower", answer("named", effect("tower_fore_aft", frequency_hz=(0.6, 0.03, "Hz"))), "sure"),
    ("tilt", answer("named", effect("aero_imbalance", entry_="rotor")), "family"),
    ("density_and_mode_shaft", answer("named", effect("air_density")), "part"),
    ("density_and_mode_shaft", answer("multiple", effect("air_density"), effect("drivetrain_torsion")), "name"),
    ("density_and_mode_shaft", answer("named", effect("backlash")), "sure"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "said", "outcome"), JUDGED)
def test_answers_are_judged_by_name_place_and_what_is_left_open(name, said, outcome):
    assert judging.judge("case", truth(name), said)["outcome"] == outcome


def test_a_null_with_a_name_is_a_false_name():
    null = truth("null", "null")
    assert judging.judge("c", null, answer("no_mismatch"))["outcome"] == "nothing"
    assert judging.judge("c", null, answer("unnamed"))["outcome"] == "unnamed"
    rows = [judging.judge("c", null, answer(v, effect("backlash"))) for v in ("named", "ambiguous")]
    assert [r["outcome"] for r in rows] == ["sure", "wrong"]
    text = judging.table(rows, "1", "tuning")
    kind = {"u": "uniform", "f": "full field"}[null["wind"][0]]
    assert f"| {kind}, all outputs | 2 | 0 | 0 | 2 | 1 | 0 | 70 |" in text and "c: sure, named: backlash" in text


def test_values_are_held_against_the_truth_in_its_unit():
    true = truth("backlash")["values"]["width"]["value"]
    told = effect("backlash", width=(1.1 * true, 0.04 * true, "deg"))
    beside = effect("sensor_scale", entry_="output:generator_speed")
    row = judging.judge("c", truth("backlash"), answer("multiple", told, beside))
    (value,) = row["values"]
    assert value["error"] == pytest.approx(0.1) and value["off"] == pytest.approx(2.5) and not value["inside"]
    assert row["outcome"] == "name" and row["beside"] == ["sensor_scale"]
    in_radians = effect("backlash", width=(true, 0.01, "rad"))
    assert judging.judge("c", truth("backlash"), answer("named", in_radians))["values"] == []
    after = judging.judge("c", truth("backlash"), answer("named", effect("backlash", width=(true, 0.01, "deg"))))
    null = judging.judge("n", truth("null", "null"), answer("no_mismatch"))
    named = judging.judge("n", truth("null", "null"), answer("named", effect("backlash")))
    text = judging.compared([row, named], [after, null])
    assert "| backlash | 1 | 1 → 1 | 1 → 1 | 0 → 0 | 0 → 0 | 0/1 → 1/1 |" in text
    assert "| **nulls** | 1 | 0 → 1 | 0 → 1 | 1 → 0 | 1 → 0 | 0/0 → 0/0 |" in text


def test_scoring_goes_on_where_it_stopped_and_asks_a_new_version_again(tmp_path, capsys, monkeypatch):
    part = tmp_path / "tuning"
    for k in range(3):
        (part / f"c{k}").mkdir(parents=True)
        answers.truth_file(part / f"c{k}").write_text(json.dumps(truth("lag")))
    asked = []

    def stops_at_the_third(case: Path):
        asked.append(case.name)
        if len(asked) == 3:
            raise KeyboardInterrupt
        return answer("named", effect("actuator_lag"))

    with pytest.raises(KeyboardInterrupt):
        answers.answered(tmp_path, "tuning", "1-a", stops_at_the_third, print)
    assert len(answers.answered(tmp_path, "tuning", "1-a", stops_at_the_third, print)) == 3
    assert asked == ["c0", "c1", "c2", "c2"]
    answers.answered(tmp_path, "tuning", "1-b", stops_at_the_third, print)
    assert asked[4:] == ["c0", "c1", "c2"]
    monkeypatch.setattr(answers, "version_of", lambda python: "1-a")
    assert study.main(["score", str(tmp_path), "--part", "tuning", "--json", str(tmp_path / "a.json")]) == 0
    assert study.main(["score", str(tmp_path), "--part", "tuning", "--before", str(tmp_path / "a.json")]) == 0
    said = capsys.readouterr().out
    assert "| lag large | 3 | 3 |" in said and "| lag | 3 | 3 → 3 |" in said


def test_without_a_simulator_or_a_case_the_command_says_so(tmp_path, capsys):
    assert study.main(["make", str(tmp_path), "--simulator", str(tmp_path / "none")]) == 2
    assert study.main(["score", str(tmp_path), "--part", "held"]) == 2
    said = capsys.readouterr().err
    assert "--simulator" in said and "no case with its truth" in said
