"""Use scheduled models from the command line: identify, simulate, validate, and what is refused."""

import csv
import json

import numpy as np
import pytest

from aeolid.cli.main import main
from aeolid.identify.lpv import identify_lpv
from aeolid.models.load import load_model
from aeolid.plants.lpv import benchmark, benchmark_signals, bilinear_input, bilinear_system, simulate_open


def write(path, record):
    with open(path, "w", newline="") as handle:
        table = csv.writer(handle)
        table.writerow(["time_s", *(c.name for c in record.channels)])
        for t, row in zip(record.time_s, record.values, strict=True):
            table.writerow([t, *("" if np.isnan(v) else repr(float(v)) for v in row)])


def write_roles(path, record, **other):
    entries = [
        f'[[channel]]\nname = "{c.name}"\nunit = ""\nrole = "{other.get(c.name, c.role)}"\n' for c in record.channels
    ]
    path.write_text('[recording]\ntime = "time_s"\n' + "".join(entries))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("lpv")
    random, model = np.random.default_rng(0), benchmark()
    for i in range(3):
        record, _ = simulate_open(model, *benchmark_signals(500, random), random, 40)
        write(where / f"rec{i}.csv", record)
    write_roles(where / "roles.toml", record)
    write_roles(where / "unscheduled.toml", record, mu2="ignore", mu3="ignore", mu4="ignore")
    code = run(where, "identify", "rec0.csv", "rec1.csv", "--method", "lpv-kernel", "--past", 4, "--out", "model.json",
               "--json", where / "facts.json", "--report", where / "report.html")  # fmt: skip
    assert code == 0
    return where


def run(where, command, *arguments, roles="roles.toml"):
    """Run a command; the folder's tables and models are named without it."""
    words = [where / w if str(w).endswith((".csv", ".json")) and "/" not in str(w) else w for w in arguments]
    return main([command, *map(str, words), "--roles", str(where / roles)])


def test_the_facts_are_those_of_the_contract(folder):
    facts = json.loads((folder / "facts.json").read_text())
    assert facts["order"] == 4 and "held-out" in facts["order_reason"] and facts["method"] == "lpv-kernel"
    assert len(facts["eigenvalues"]) == 4 and len(facts["singular_values"]) == 12
    assert facts["modes"] and all({"frequency_hz", "damping", "frequency_std_hz"} <= set(m) for m in facts["modes"])
    assert facts["kernel"]["rows"] == facts["kernel"]["of"] == facts["windows"] == 992
    points = facts["operating_points"]
    assert [p["where"] for p in points[:3]] == ["mean of the scheduling", "least mu2", "largest mu2"] and len(
        points
    ) == 7
    assert points[0]["eigenvalues"] == facts["eigenvalues"] and points[2]["scheduling"]["mu2"] > 0.6
    assert min(facts["fit"]["free_run"]["vaf"].values()) > 95
    assert (folder / "report.html").stat().st_size > 20_000


def test_the_model_file_is_that_of_the_contract(folder):
    model = json.loads((folder / "model.json").read_text())
    assert model["kind"] == "state_space" and model["scheduling"]["first_is_one"] is True
    assert model["scheduling"]["channels"] == ["mu2", "mu3", "mu4"]
    assert np.shape(model["A"]) == (4, 4, 4) and np.shape(model["B"]) == (4, 4, 2) and np.shape(model["K"]) == (4, 4, 3)
    assert np.shape(model["C"]) == (3, 4) and np.shape(model["D"]) == (3, 2)


def test_simulate_runs_the_equations_of_the_file(folder, capsys):
    """The free run is the recursion of eq. (1)–(2) with the numbers of the file, written out here."""
    assert run(folder, "simulate", "model.json", "rec2.csv", "--initial", "zero", "--out", "sim.csv") == 0
    assert "VAF" in capsys.readouterr().out
    model = json.loads((folder / "model.json").read_text())
    rows = np.genfromtxt(folder / "rec2.csv", delimiter=",", names=True)
    A, B, C, D = (np.array(model[k]) for k in "ABCD")
    x, expected = np.zeros(4), []
    for row in rows:
        mu, u = np.array([1.0, row["mu2"], row["mu3"], row["mu4"]]), np.array([row["u1"], row["u2"]])
        expected.append(C @ x + D @ u)
        x = sum(m * (a @ x + b @ u) for m, a, b in zip(mu, A, B, strict=True))
    found = np.genfromtxt(folder / "sim.csv", delimiter=",", skip_header=1)[:, 1:]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_simulate_needs_every_sample_of_the_scheduling(folder, capsys):
    text = (folder / "rec2.csv").read_text().splitlines()
    cells = text[5].split(",")
    cells[3] = ""
    text[5] = ",".join(cells)
    (folder / "holed.csv").write_text("\n".join(text) + "\n")
    assert run(folder, "simulate", "model.json", "holed.csv", "--out", "s.csv") == 3
    assert "'mu2' is missing at sample 5" in " ".join(capsys.readouterr().err.split())
    assert run(folder, "validate", "model.json", "holed.csv") == 0


def test_validate_scores_and_fails_above(folder, capsys):
    assert run(folder, "validate", "model.json", "rec2.csv", "--json", folder / "v.json") == 0
    facts = json.loads((folder / "v.json").read_text())
    assert set(facts["k_step"]) == {"5", "10", "50"} and min(facts["one_step"]["vaf"].values()) > 95
    assert facts["residuals"]["verdict"] in ("pass", "immaterial", "fail")
    assert run(folder, "validate", "model.json", "rec2.csv", "--fail-above", "0.05") == 1
    capsys.readouterr()
    assert run(folder, "validate", "model.json", "rec2.csv", roles="unscheduled.toml") == 3
    assert "the model's channel 'mu2' is missing" in " ".join(capsys.readouterr().err.split())


def test_the_primal_finds_what_the_library_finds(folder):
    options = ("--method", "lpv", "--past", 3, "--order", 4, "--varying", "A,B")
    assert run(folder, "identify", "rec0.csv", "rec1.csv", *options, "--out", "p.json") == 0
    from aeolid.formats import read_record
    from aeolid.record import Roles

    records = [read_record(folder / f"rec{i}.csv", Roles.load(folder / "roles.toml")) for i in (0, 1)]
    result = identify_lpv(records, past=3, order=4, varying="A,B")
    loaded = load_model(folder / "p.json").state_space
    np.testing.assert_allclose(loaded.A, result.model.A, rtol=1e-12)
    assert not loaded.K[1:].any()


def test_a_bilinear_model_is_scheduled_by_its_input(tmp_path):
    random, model = np.random.default_rng(1), bilinear_system()
    u = bilinear_input(500, random)
    record, _ = simulate_open(model, u, u, random, 100)
    write(tmp_path / "rec.csv", record)
    write_roles(tmp_path / "roles.toml", record)
    options = ("--method", "lpv", "--past", 4, "--scheduling", "u1", "--varying", "A,K")
    assert run(tmp_path, "identify", "rec.csv", *options, "--out", "model.json") == 0
    assert run(tmp_path, "simulate", "model.json", "rec.csv", "--out", "sim.csv", "--json", tmp_path / "s.json") == 0
    assert json.loads((tmp_path / "s.json").read_text())["free_run"]["vaf"]["y1"] > 98


@pytest.mark.parametrize(
    "arguments, code, words",
    [
        (["--method", "lpv", "--past", 5], 4, "q = 6820 columns; record more than 6825 samples"),
        (["--method", "lpv-kernel", "--memory", "0.001"], 4, "992 rows by 992 windows needs|rows by"),
        (["--method", "lpv", "--kernel-rows", 50], 2, "belongs to method lpv-kernel"),
        (["--method", "lpv-kernel", "--kernel-selection", "best"], 2, "'best' is none of greedy, first"),
        (["--method", "lpv", "--scheduling", "wind"], 2, "scheduling 'wind': no such channel"),
        (["--method", "lpv", "--varying", "A,X"], 2, "varying 'X' is none of A, B, C, D, K"),
        (["--method", "lpv", "--stable"], 2, "--stable is for time-invariant models"),
        (["--method", "lpv", "--passes", 3], 2, "belong to --method varmax"),
        (["--kernel-rows", 50], 2, "--kernel-rows belongs to --method lpv and lpv-kernel"),
        (["--scheduling", "mu2"], 2, "--scheduling belongs to --method lpv"),
        (["--memory", "1"], 2, "--memory belongs to --method lpv"),
        (["--method", "lpv", "--memory", "0"], 2, "a memory of 0 GB"),
        (["--method", "lpv", "--order", 99], 2, "order 99 is not within 1 … 9"),
    ],
)
def test_wrong_usage_is_named(folder, capsys, arguments, code, words):
    base = [] if "--past" in arguments else ["--past", 3]
    assert run(folder, "identify", "rec0.csv", "rec1.csv", *base, "--out", "x.json", *arguments) == code
    message = " ".join(capsys.readouterr().err.split())
    assert any(w in message for w in words.split("|")), message
    assert "Traceback" not in message and not (folder / "x.json").exists()


def test_recordings_without_a_scheduling_channel_are_refused(folder, capsys):
    code = run(
        folder, "identify", "rec0.csv", "--method", "lpv", "--past", 3, "--out", "x.json", roles="unscheduled.toml"
    )
    assert code == 3 and "no channel has the role 'scheduling'" in " ".join(capsys.readouterr().err.split())
