"""Check fleet runs as a user starts them: what comes out, what is reused, what a bad file does."""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pyarrow.parquet as parquet
import pytest

from aeolid.cli.main import main
from aeolid.fleet import tasks, workers
from aeolid.fleet.plan import Plan, find_recordings
from aeolid.fleet.run import Skipped, _group, _mark_tracks, _tracks, run_fleet
from aeolid.fleet.tables import SCHEMA, mode_rows, write_models
from aeolid.fleet.tasks import FileDone
from aeolid.formats import write_table
from aeolid.models.recursion import run_states
from aeolid.plants.lti import simulate_fourth_order
from aeolid.publish.rows import rows_of_fleet
from aeolid.record import Roles
from aeolid.report.fleet import render_fleet
from aeolid.report.fleet_charts import clock_of, colours_of, keys_of, newest

ROLES = '[recording]\ntime = "time_s"\n' + "".join(
    f'[[channel]]\nname = "{name}"\nunit = ""\nrole = "{role}"\n'
    for name, role in (("u1", "input"), ("u2", "input"), ("y1", "output"), ("y2", "output"))
)
DAY = 86400.0
pytestmark = pytest.mark.usefixtures("forking_throughout")


def write(path, seed, start, step=0.1, jitter=0.0):
    path.parent.mkdir(parents=True, exist_ok=True)
    record = simulate_fourth_order(600, seed, feedback=0.25)
    columns = {name: record.column(name) for name in ("u1", "u2", "y1", "y2")}
    late = jitter * np.random.default_rng(seed).uniform(-1, 1, 600)
    write_table(path, {"time_s": start + step * np.arange(600) + late, **columns})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two turbines, three days, two recordings each; the seeds are all different."""
    where = tmp_path_factory.mktemp("fleet")
    for turbine in range(2):
        for k in range(6):
            write(where / "data" / f"T{turbine}" / f"r{k}.parquet", 10 * turbine + k, 19000 * DAY + k // 2 * DAY)
    (where / "roles.toml").write_text(ROLES)
    return where


@pytest.fixture
def plan(folder):
    return Plan(Roles.load(folder / "roles.toml"), 8, 4, (), None, DAY)


def run(folder, plan, out, pool=None, paths=None):
    given = find_recordings([str(folder / "data")], out) if paths is None else paths
    return run_fleet(given, plan, out, pool or workers.Inline())


@pytest.fixture(scope="module")
def fresh(folder, tmp_path_factory):
    plan = Plan(Roles.load(folder / "roles.toml"), 8, 4, (), None, DAY)
    return run(folder, plan, tmp_path_factory.mktemp("out"))


def values(facts):
    """Return all that must not depend on how the run went."""
    return json.dumps({key: value for key, value in facts.items() if key not in ("reused",)}, sort_keys=True)


def test_periods_and_tracks_are_those_of_the_plant(fresh):
    assert (fresh["usable"], fresh["turbines"], len(fresh["periods"]), fresh["skipped"]) == (12, 2, 6, [])
    assert [p["period"] for p in fresh["periods"][:3]] == ["2022-01-08", "2022-01-09", "2022-01-10"]
    rows = mode_rows(fresh["periods"])
    true = {0: 0.125, 1: 0.375}  # poles 0.67 (1 ± i) and 0.67 (−1 ± i): a quarter and three quarters of the half turn
    for row in rows:
        assert row["pole_imag"] > 0 and row["recordings"] == 2 and row["windows"] == 2 * (600 - 8)
        s = np.log(0.67 * np.sqrt(2)) + 2j * np.pi * true[row["track"]]
        assert abs(row["frequency_hz"] - abs(s) / (2 * np.pi * 0.1)) < 5 * row["frequency_std_hz"]
        assert abs(row["damping"] + s.real / abs(s)) < 5 * row["damping_std"]
    assert len(fresh["tracks"]) == 4 and all(t["periods"] == 3 and t["per"] == "day" for t in fresh["tracks"])


def test_the_order_of_files_does_not_matter(folder, plan, fresh, tmp_path):
    paths = find_recordings([str(folder / "data")], tmp_path)[::-1]
    assert values(run(folder, plan, tmp_path, paths=paths)) == values(fresh)


def test_threads_give_the_same_values(folder, plan, fresh, tmp_path):
    with workers.open_pool(2, threads=True) as pool:
        assert values(run(folder, plan, tmp_path, pool)) == values(fresh)


class Stopping(workers.Inline):
    """Stop after some pieces, as a user does with Ctrl-C."""

    def run(self, function, items, *shared):
        for index, result in super().run(function, items, *shared):
            if index == 5:
                raise KeyboardInterrupt
            yield index, result


class Losing(workers.Inline):
    """Lose the first of every kind of piece, as a worker that runs out of memory does."""

    def run(self, function, items, *shared):
        for index, result in super().run(function, items, *shared):
            yield index, MemoryError("killed") if index == 0 else result


def test_a_lost_worker_costs_its_piece_alone(folder, plan, tmp_path):
    facts = run(folder, plan, tmp_path, Losing())
    assert [row["kind"] for row in facts["skipped"]] == ["recording", "period", "period"]
    assert all("the worker was lost" in row["reason"] and "killed" in row["reason"] for row in facts["skipped"])
    assert len(facts["periods"]) == 4 and facts["usable"] == 11
    assert facts["skipped"][0]["name"].endswith(os.path.join("T0", "r0.parquet"))


def test_an_interrupted_run_loses_nothing_and_ends_as_a_fresh_one(folder, plan, fresh, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run(folder, plan, tmp_path, Stopping())
    kept = sorted((tmp_path / "cache" / "factors").glob("*.npz"))
    assert len(kept) == 6
    kept[0].write_bytes(kept[0].read_bytes()[:500])  # a disk that filled up: found out and done again
    again = run(folder, plan, tmp_path)
    assert again["reused"] == 5
    assert values(again) == values(fresh)


def test_a_killed_run_is_taken_up(folder, plan, fresh, tmp_path):
    """SIGKILL while workers write: what is finished is used, what is half written is not, and is cleared in time."""
    words = ["fleet", str(folder / "data"), "--roles", str(folder / "roles.toml"), "--past", "8", "--order", "4"]
    words += ["--out", str(tmp_path), "--workers", "1"]
    process = subprocess.Popen([sys.executable, "-m", "aeolid.cli.main", *words], stdout=subprocess.DEVNULL)
    factors = tmp_path / "cache" / "factors"
    while process.poll() is None and len(list(factors.glob("*.npz"))) < 3:
        time.sleep(0.002)
    process.kill()
    process.wait()
    kept = len(list(factors.glob("*.npz")))
    assert kept >= 3
    half, old = factors / "abc.npz.1.2.part", factors / "abd.npz.1.2.part"
    for path in (half, old):
        path.write_bytes(b"PK")
    os.utime(old, (0, 0))
    again = run(folder, plan, tmp_path)
    assert again["reused"] == kept and values(again) == values(fresh)
    assert half.exists() and not old.exists()


def test_the_model_of_a_period_is_a_file_that_commands_take(folder, tmp_path, capsys):
    assert command(folder, tmp_path, str(folder / "data"), "--order", "4", "--workers", "1", "--models") == 0
    assert "models to its folder models" in " ".join(capsys.readouterr().out.split())
    files = sorted(p.relative_to(tmp_path / "models").as_posix() for p in (tmp_path / "models").rglob("*.json"))
    assert files == [f"T{t}/2022-01-{d:02d}.json" for t in (0, 1) for d in (8, 9, 10)]
    recording = str(folder / "data" / "T0" / "r0.parquet")
    where = ["--roles", str(folder / "roles.toml"), "--fail-above", "1.0"]
    assert main(["validate", str(tmp_path / "models" / "T0" / "2022-01-08.json"), recording, *where]) == 0


def test_a_mode_that_falls_is_named_with_size_and_time(tmp_path, capsys):
    """One of two modes falls by 3 % from the sixth of twelve days on: that one, that much, since then."""
    roles, days = tmp_path / "roles.toml", 12
    roles.write_text(ROLES)
    for day in range(days):
        fall = 1 - 0.03 * max(day - 5, 0) / (days - 6)
        poles = np.exp(0.1 * 2j * np.pi * np.array([0.5 * fall, 1.5]) * (1j * 0.02 + np.sqrt(1 - 0.02**2)))
        A = np.zeros((4, 4))
        for i, z in enumerate(poles):
            A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[z.real, -z.imag], [z.imag, z.real]]
        rng = np.random.default_rng(day)
        u, w = rng.standard_normal((6000, 2)), 0.1 * rng.standard_normal((6000, 4))
        x = run_states(A, u @ np.array([[0.3, 0, 0.1, 0], [0.1, 0, 0.3, 0]]) + w, np.zeros(4))[:-1]
        y = x[:, [0, 2]] + 0.2 * x[:, [2, 0]] + 0.05 * rng.standard_normal((6000, 2))
        time_s = 19000 * DAY + day * DAY + 0.1 * np.arange(6000)
        columns = {"time_s": time_s, "u1": u[:, 0], "u2": u[:, 1], "y1": y[:, 0], "y2": y[:, 1]}
        path = tmp_path / "data" / "T0" / f"{day}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_table(path, columns)
    words = ["--roles", str(roles), "--past", "20", "--order", "4", "--out", str(tmp_path / "out"), "--workers", "1"]
    assert main(["fleet", str(tmp_path / "data"), *words]) == 0
    facts = json.loads((tmp_path / "out" / "fleet.json").read_text())
    (told,) = facts["moved"]
    capsys.readouterr()
    assert main(["fleet", str(tmp_path / "data"), *words, "--fail-on-change"]) == 1  # the factors are those of before
    changes = {r.tags["mode"]: r for r in rows_of_fleet(facts) if r.measurement == "fleet_change"}
    assert changes["0"].values["moved"] == 1 and sum(r.values["moved"] for r in changes.values()) == 1
    assert changes["0"].values["change_hz"] == pytest.approx(-0.015, abs=0.003)
    assert changes["0"].time_s == facts["periods"][-1]["middle_s"]
    assert (
        told in " ".join(capsys.readouterr().out.split())
        and "mode 0: falls from 0." in told
        and "since 2022-01-1" in told
    )
    (track,) = [t for t in facts["tracks"] if abs(t["frequency_hz"]["first"] - 0.5) < 0.05]
    onset, first = track["frequency_hz"]["onset"], 19000.0
    assert abs(onset["change"] / 0.5 + 0.03) < 3 * onset["change_std"] / 0.5 < 0.01
    assert onset["since_low"] <= first + 5 <= onset["since_high"] and onset["since_high"] - onset["since_low"] <= 4
    assert told in (tmp_path / "out" / "report.html").read_text()


def test_a_second_run_does_only_what_is_new(folder, plan, tmp_path, monkeypatch):
    out = tmp_path / "out"
    for k in range(3):
        write(tmp_path / "data" / "T0" / f"r{k}.parquet", 40 + k, 0.0)
    run(tmp_path, plan, out)
    read, original = [], tasks.read_record
    monkeypatch.setattr(tasks, "read_record", lambda path, roles: read.append(path) or original(path, roles))
    write(tmp_path / "data" / "T0" / "r3.parquet", 43, 0.0)
    facts = run(tmp_path, plan, out)
    assert [os.path.basename(p) for p in read] == ["r3.parquet"]
    assert (facts["reused"], facts["periods"][0]["recordings"]) == (3, 4)
    write(tmp_path / "data" / "T0" / "r0.parquet", 50, 0.0)  # the same name, another content
    run(tmp_path, plan, out)
    assert [os.path.basename(p) for p in read] == ["r3.parquet", "r0.parquet"]
    run(tmp_path, Plan(plan.roles, 9, 4, (), None, DAY), out)  # another past window is another factor
    assert len(read) == 6


def command(folder, out, *more):
    return main(["fleet", *more, "--roles", str(folder / "roles.toml"), "--past", "8", "--out", str(out)])


def test_bad_files_are_named_and_the_rest_goes_on(folder, tmp_path, capsys):
    data = tmp_path / "data" / "T0"
    write(data / "good0.parquet", 1, 0.0)
    write(data / "good1.parquet", 2, 600.0)
    write(data / "slow.parquet", 3, 0.0, step=0.2)
    (data / "copy.parquet").write_bytes((data / "good0.parquet").read_bytes())
    (data / "broken.parquet").write_bytes(b"PAR1 nothing")
    (data / "other.csv").write_text("time_s,u1\n0,1\n1,2\n")
    assert command(folder, tmp_path / "out", str(tmp_path / "data"), "--order", "4", "--workers", "1") == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "2 of 6 recordings used" in text and "4 left out" in text
    facts = json.loads((tmp_path / "out" / "fleet.json").read_text())
    reasons = {os.path.basename(row["name"]): row["reason"] for row in facts["skipped"]}
    assert set(reasons) == {"slow.parquet", "good0.parquet", "broken.parquet", "other.csv"}
    assert "sample time 0.2 s, most have 0.1 s" in reasons["slow.parquet"]
    assert "the same content as" in reasons["good0.parquet"]
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Left out" in page and "broken.parquet" in page and "<svg" in page


def test_clocks_that_jitter_have_one_sample_time(folder, plan, tmp_path):
    """Steps may jitter by a tenth: the mean step of 600 then differs by parts in 10⁵ from file to file."""
    for k in range(6):
        write(tmp_path / "data" / "T0" / f"r{k}.parquet", k, 19000 * DAY + 600 * k, jitter=0.004)
    write(tmp_path / "data" / "T0" / "r6.parquet", 6, 19000 * DAY, step=0.1005)
    facts = run(tmp_path, plan, tmp_path / "out")
    assert facts["usable"] == 6 and [row["name"][-10:] for row in facts["skipped"]] == ["r6.parquet"]
    assert len({p["sample_time_s"] for p in facts["periods"]}) == 1


def test_folders_of_one_name_are_one_turbine_and_said_to_be(folder, tmp_path, capsys):
    for k, place in enumerate(("north/T1", "south/T1", "south/T2")):
        write(tmp_path / "data" / place / "a.parquet", k, 19000 * DAY)
    words = ["--order", "4", "--workers", "1"]
    assert command(folder, tmp_path / "out", str(tmp_path / "data"), *words) == 0
    said = "".join(capsys.readouterr().out.split())
    assert "turbineT1ismadeof2foldersofthatname" in said and "turbineT2" not in said
    assert "turbine T1 is made of 2 folders" in (tmp_path / "out" / "report.html").read_text()
    group = ["--group", r"(?P<turbine>\w+/T\d)/"]
    assert command(folder, tmp_path / "two", str(tmp_path / "data"), *words, *group, "--models") == 0
    facts = json.loads((tmp_path / "two" / "fleet.json").read_text())
    assert facts["turbines"] == 3 and facts["notes"] == []
    assert len(list((tmp_path / "two" / "models").rglob("*.json"))) == 3


def test_periods_stand_at_the_middle_of_their_recordings(plan):
    """Starts of a day and of the next: the period begins with the first, drift is measured at their mean."""
    done = [tasks.FileDone(f"T0/{k}.csv", None, f"{k}", f"f{k}", 19000 * DAY + s) for k, s in enumerate((600, 0, 5400))]
    (period,) = _group([*done, tasks.FileDone("T1/x.csv", None, "x", "fx", 0.0)], plan, Skipped())[:1]
    assert (period.start_s, period.middle_s) == (19000 * DAY, 19000 * DAY + 2000)
    assert period.factors == ("f0", "f1", "f2") and period.label == "2022-01-08"


def test_the_page_tells_the_change_of_each_mode(tmp_path):
    """A mode that falls by 10 mHz a day for two days while its damping rises by half a point: as the table says."""
    periods = []
    for k in range(3):
        mode = {"frequency_hz": 0.5 - 0.01 * k, "frequency_std_hz": 0.001, "damping": 0.02 + 0.005 * k,
                "damping_std": 0.002, "track": 0, "rotor_order": None}  # fmt: skip
        when = {"start_s": (19000 + k) * DAY, "middle_s": (19000 + k) * DAY + 300.0, "period": f"day {k}"}
        periods.append({"turbine": "T7", "modes": [mode]} | when)
    (track,) = tracks = _tracks(periods)
    assert (track["frequency_hz"]["first"], track["frequency_hz"]["last"]) == (0.5, 0.48) and track["per"] == "day"
    assert track["frequency_hz"]["drift"]["slope"] == pytest.approx(-0.01)
    facts = {"periods": periods, "tracks": tracks, "recordings": 3, "usable": 3, "skipped": [], "order_reasons": {},
             "settings": {"past": 8}, "reused": 0}  # fmt: skip
    render_fleet(facts, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    for words in ("−20.0 ± 1.4", "1.00 ± 0.28", "0.4800", "3.000", "Turbine T7"):  # mHz, points, Hz, %
        assert words in page, words


def park(turbines=3, days=4):
    """Return the facts of a park whose modes have names, and other numbers of tracks in each turbine."""
    periods = []
    for t in range(turbines):
        for k in range(days):
            modes = [
                {"frequency_hz": f * (1 + 0.01 * t), "frequency_std_hz": 0.001, "damping": 0.02, "damping_std": 0.002,
                 "track": track if t % 2 else 3 - track, "rotor_order": None, "name": name, "outputs": {"y": 1.0}}
                for track, (f, name) in enumerate(((0.3, "tower fore-aft"), (1.7, "drive train"), (2.5, "")), 1)
            ]  # fmt: skip
            when = {"start_s": (19000 + k) * DAY, "middle_s": (19000 + k) * DAY + 300.0, "period": f"day {k}"}
            periods.append({"turbine": f"T{t}", "modes": modes} | when)
    return {"periods": periods, "tracks": _tracks(periods), "recordings": 12, "usable": 12, "skipped": [],
            "order_reasons": {}, "settings": {"past": 8}, "reused": 0}  # fmt: skip


def test_the_page_has_dates_names_and_the_whole_park(tmp_path):
    facts = park()
    render_fleet(facts, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    for words in ("The park", "date (UTC)", "2022-Jan", "tower fore-aft", "drive train", "near 2.5"):
        assert words in page, words
    last, shared = newest(facts["tracks"], facts["periods"])
    assert len(shared) == 3 and all(len([t for t, n in last if n == name]) == 3 for name in shared)


def test_a_mode_has_one_colour_on_all_turbines():
    facts = park()
    keys, colours = keys_of(facts["periods"]), colours_of(facts["periods"])
    assert {keys["T0", 2], keys["T1", 1]} == {"tower fore-aft"}  # whatever number the track has
    assert len({colours.of(k) for k in ("tower fore-aft", "drive train")}) == 2
    assert clock_of([{"start_s": 0.0, "period": "0 s"}, {"start_s": 43200.0, "period": "x"}]).times.tolist() == [0, 0.5]


def test_a_window_in_seconds(folder, fresh, tmp_path):
    asked = ["fleet", str(folder / "data" / "T0"), "--roles", str(folder / "roles.toml"), "--order", "4"]
    asked += ["--workers", "1"]
    assert main([*asked, "--past", "0.8s", "--out", str(tmp_path / "out")]) == 0
    assert json.loads((tmp_path / "out" / "fleet.json").read_text())["settings"]["past"] == 8
    assert main([*asked, "--past", "auto", "--out", str(tmp_path / "no")]) == 2


def test_each_turbine_is_held_against_a_case(folder, fresh, tmp_path, capsys):
    """The table has every turbine; here none can be diagnosed, for the model of the case is not there."""
    (template := tmp_path / "template").mkdir()
    (template / "case.toml").write_text('[baseline]\nkind = "state_space"\nfile = "model.json"\n')
    out = tmp_path / "out"
    asked = ("--order", "4", "--diagnose", str(template), "--workers", "1")
    assert command(folder, out, str(folder / "data"), *asked) == 0
    rows = json.loads((out / "diagnoses" / "cases.json").read_text())["cases"]
    assert [r["case"] for r in rows] == ["T0", "T1"] and all("model.json: no such file" in r["fault"] for r in rows)
    assert (out / "cases" / "T1" / "case.toml").read_text().count(".parquet") == 6
    assert "2 cases: 2 not read" in capsys.readouterr().out


def test_no_model_of_a_period_takes_the_place_of_another(tmp_path):
    """Turbines and periods that differ in what no file name holds, and a name that would leave the folder."""
    names = [("a/b", "1"), ("a_b", "1"), ("a:b", "1"), ("..", "1"), (".", ".")]
    write_models(tmp_path / "in", [{"turbine": t, "period": p, "model": {"of": k}} for k, (t, p) in enumerate(names)])
    found = sorted(json.loads(p.read_text())["of"] for p in (tmp_path / "in").rglob("*.json"))
    assert found == [0, 1, 2, 3, 4] and [p.name for p in tmp_path.iterdir()] == ["in"]


def test_nothing_usable_ends_with_code_3(folder, tmp_path, capsys):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "a.csv").write_text("time_s,u1\n0,1\n1,2\n")
    assert command(folder, tmp_path / "out", str(tmp_path / "data"), "--workers", "1") == 3
    assert "nothing usable in 1 recording," in capsys.readouterr().err
    assert command(folder, tmp_path / "out", str(tmp_path / "none")) == 3
    assert "no recording there" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options, words",
    [
        (["--workers", "0"], "--workers"), (["--order", "two"], "--order 'two'"), (["--window", "soon"], "--window"),
        (["--group", "x"], "names nothing"), (["--scheduler", "nowhere", "--workers", "2"], "--workers"),
    ],
)  # fmt: skip
def test_bad_options_end_with_code_2(folder, tmp_path, capsys, options, words):
    assert command(folder, tmp_path / "out", str(folder / "data"), *options) == 2
    assert words in capsys.readouterr().err


# By day test_fleet_workers.py runs the command on processes; threads have the same values.
@pytest.mark.parametrize("processes", ["1", pytest.param("2", marks=pytest.mark.nightly)])
def test_the_table_is_written_as_documented(folder, fresh, tmp_path, processes):
    out = tmp_path / "out"
    assert command(folder, out, str(folder / "data" / "*" / "*"), "--order", "4", "--workers", processes) == 0
    table = parquet.read_table(out / "modes.parquet")
    assert table.column_names == list(SCHEMA)
    assert all(field.metadata[b"description"] for field in table.schema)
    assert table.to_pylist() == mode_rows(fresh["periods"])


def test_one_order_a_turbine_is_chosen(folder, plan, tmp_path):
    facts = run(folder, Plan(plan.roles, 8, None, (), None, DAY), tmp_path)
    assert set(facts["order_reasons"]) == {"T0", "T1"}
    for turbine in ("T0", "T1"):
        assert len({p["order"] for p in facts["periods"] if p["turbine"] == turbine}) == 1


def test_a_change_that_cannot_be_tested_is_no_pass(folder, fresh, tmp_path, capsys):
    """Three periods: the summary and the page say so, and --fail-on-change ends with 4, its files written."""
    words = ["--roles", str(folder / "roles.toml"), "--past", "8", "--order", "4", "--out", str(tmp_path / "out")]
    command = ["fleet", str(folder / "data"), *words, "--workers", "1"]
    assert main(command) == 0
    told = capsys.readouterr().out
    assert "T0: not tested: 3 periods, 5 are needed" in told and "by more than chance" not in told
    page = (tmp_path / "out" / "report.html").read_text()
    assert "not tested: 3 periods" in page and "No mode moved" not in page
    (tmp_path / "out" / "fleet.json").unlink()
    assert main([*command, "--fail-on-change"]) == 4
    assert "T0: not tested" in capsys.readouterr().err and (tmp_path / "out" / "fleet.json").is_file()


def period_facts(turbine, number, middle_s, frequency_hz):
    pole = np.exp(0.1 * 2j * np.pi * frequency_hz * (1 + 0.02j))
    mode = {"eigenvalue": [pole.real, pole.imag], "shape": [[1, 0]], "frequency_hz": frequency_hz, "damping": 0.02,
            "frequency_std_hz": 1e-4, "damping_std": 1e-3, "name": "tower", "rotor_order": None}  # fmt: skip
    return {"turbine": turbine, "period": str(number), "start_s": middle_s, "middle_s": middle_s,
            "sample_time_s": 0.1, "output_scale": [1.0], "modes": [mode]}  # fmt: skip


def test_the_clock_of_one_turbine_says_nothing_of_another():
    """Undated periods of one turbine are counted, whatever the clock of the other begins with."""
    for start in (0.0, 12.5):
        periods = [period_facts("A", k, 0.0, 0.33 * (1 - 0.005 * k)) for k in range(10)]
        periods += [period_facts("B", k, start, 0.33) for k in range(10)]
        periods += [period_facts("C", k, 1.7e9 + DAY * k, 0.33) for k in range(10)]
        _mark_tracks(periods)
        found = {t["turbine"]: t for t in _tracks(periods)}
        assert [found[name]["per"] for name in "ABC"] == ["period", "period", "day"]
        assert found["A"]["frequency_hz"]["onset"]["change"] == pytest.approx(-0.33 * 0.045)


def test_numbered_periods_are_in_the_order_of_their_numbers(plan):
    group = replace(plan, group=r"(?P<turbine>T\d)/(?P<period>week\d+)", window_s=None)
    done = [FileDone(f"park/T1/week{k}.csv", None, f"h{k}", f"f{k}", 0.0, 0.1, 100) for k in range(1, 13)]
    assert [p.label for p in _group(done, group, Skipped())] == [f"week{k}" for k in range(1, 13)]
