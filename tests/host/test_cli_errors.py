"""Bad input ends in one sentence and the right exit code, whatever command meets it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aeolid.cli.main import main
from aeolid.plants import hawt

ROLES = """[recording]
time = "time_s"
[[channel]]
name = "pitch"
unit = "deg"
role = "input"
[[channel]]
name = "speed"
unit = "rpm"
role = "output"
"""
DATA, INFORMATION, USAGE = 3, 4, 2


def good_rows(samples: int = 400) -> list[list[str]]:
    record = hawt.simulate_closed_loop(samples, 4, excitation=hawt.Excitation(noise=0.1))
    table = np.column_stack([record.time_s, record.column("pitch"), record.column("generator_speed")])
    return [["time_s", "pitch", "speed"], *([f"{v:.9g}" for v in row] for row in table)]


def text(rows: list[list[str]]) -> bytes:
    return ("\n".join(",".join(row) for row in rows) + "\n").encode()


def with_cell(row: int, column: int, cell: str) -> Callable[[], bytes]:
    def build() -> bytes:
        rows = good_rows()
        rows[row][column] = cell
        return text(rows)

    return build


def with_rows(change: Callable[[list[list[str]]], list[list[str]]]) -> Callable[[], bytes]:
    return lambda: text(change(good_rows()))


def constant(rows: list[list[str]]) -> list[list[str]]:
    return [rows[0], *([r[0], "1.5", r[2]] for r in rows[1:])]


MALFORMED: dict[str, tuple[Callable[[], bytes], set[int], list[str]]] = {
    "text": (with_cell(100, 1, "off"), {DATA}, ["'pitch'", "sample 100", "'off'"]),
    "infinite": (with_cell(100, 2, "inf"), {DATA}, ["'speed'", "sample 100"]),
    "huge": (with_cell(100, 2, "-1e200"), {DATA}, ["'speed'", "reads -1e+200", "sample 100 (line 101)", "correct it"]),
    "almost infinite": (with_cell(100, 2, "1e308"), {DATA}, ["'speed'", "reads 1e+308", "sample 100"]),
    "ragged": (with_rows(lambda r: [*r[:50], r[50][:2], *r[51:]]), {DATA}, ["sample 50", "2 cells"]),
    "missing column": (with_rows(lambda r: [["time_s", "pitch", "sped"], *r[1:]]), {DATA}, ["'speed'", "'sped'"]),
    "wrong unit": (with_rows(lambda r: [["time_s", "pitch [rad]", "speed"], *r[1:]]), {DATA}, ["'rad'", "'deg'"]),
    "zero rows": (with_rows(lambda r: r[:1]), {DATA}, ["no sample"]),
    "3 rows": (with_rows(lambda r: r[:4]), {DATA, INFORMATION}, []),
    "backwards": (with_cell(100, 0, "3"), {DATA}, ["backwards", "sample 100"]),
    "constant": (with_rows(constant), {DATA, INFORMATION}, ["pitch"]),
    "all missing": (with_rows(lambda r: [r[0], *([c[0], "", c[2]] for c in r[1:])]), {DATA}, ["'pitch'", "no value"]),
    "empty": (lambda: b"", {DATA}, ["empty"]),
    "garbage": (lambda: np.random.default_rng(1).bytes(5000), {DATA}, []),
}
COMMANDS = {
    "identify": ["identify", "rec.csv", "--roles", "roles.toml", "--past", "10", "--out", "model.json"],
    "filter": ["filter", "rec.csv", "--roles", "roles.toml", "--method", "rls", "--past", "10", "--out", "m.npz"],
    "node": ["node", "--recording", "rec.csv", "--roles", "roles.toml", "--past", "10", "--speed", "max"],
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "roles.toml").write_text(ROLES)
    return tmp_path


def refusal(capsys: pytest.CaptureFixture[str], arguments: list[str], codes: set[int]) -> str:
    """Run a command that must be refused; returns its one sentence."""
    code = main(arguments)
    said = capsys.readouterr().err.strip()
    assert code in codes, (code, said)
    assert "Traceback" not in said
    last = [line for line in said.splitlines() if line.startswith("aeolid: ")]
    assert len(last) == 1 and said.endswith(last[0]), said
    return last[0]


# a node streams a recording of any length, so three rows are nothing wrong there
PAIRS = [(command, case) for command in COMMANDS for case in MALFORMED if (command, case) != ("node", "3 rows")]


@pytest.mark.parametrize(("command", "case"), PAIRS)
def test_bad_recordings_are_refused(command: str, case: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build, codes, parts = MALFORMED[case]
    (folder / "rec.csv").write_bytes(build())
    said = refusal(capsys, COMMANDS[command], codes)
    for part in ["rec.csv", *parts]:
        assert part in said
    assert sorted(p.name for p in folder.iterdir()) == ["rec.csv", "roles.toml"]  # nothing half made is left


def test_missing_samples_are_legal(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = good_rows(1200)
    for k in (100, 101, 700):
        rows[k][1 + k % 2] = ""
    (folder / "rec.csv").write_bytes(text(rows))
    assert main(COMMANDS["identify"]) == 0, capsys.readouterr().err
    assert main(COMMANDS["filter"]) == 0, capsys.readouterr().err


@pytest.mark.parametrize(
    ("roles", "parts"),
    [
        ("", ["no [[channel]] entry"]),
        ("[[channel]\n", ["TOML"]),
        (ROLES.replace("input", "inputs"), ["'inputs'", "input, output"]),
        (ROLES + 'colour = "red"\n', ["'colour'"]),
        (ROLES.replace('"speed"', '"pitch"'), ["'pitch'", "twice"]),
        (ROLES.replace("[recording]\n", "[recording]\nsample_time_s = -1\n"), ["sample_time_s"]),
    ],
)
def test_bad_roles_are_refused(roles: str, parts: list[str], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "rec.csv").write_bytes(text(good_rows()))
    (folder / "roles.toml").write_text(roles)
    said = refusal(capsys, COMMANDS["identify"], {DATA})
    for part in ["roles.toml", *parts]:
        assert part in said


def test_bad_models_and_targets_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "rec.csv").write_bytes(text(good_rows()))
    for content in ("", "[]", '{"kind": "state_space"}', '{"kind": "lpv"}', "\0\1"):
        (folder / "model.json").write_text(content)
        for command in ("simulate", "validate"):
            target = ["--out", "sim.csv"] if command == "simulate" else []
            said = refusal(capsys, [command, "model.json", "rec.csv", "--roles", "roles.toml", *target], {DATA})
            assert "model.json" in said
    (folder / "model.json").unlink()
    refusal(capsys, [*COMMANDS["identify"][:-1], "no/such/folder/model.json"], {USAGE})


@pytest.mark.parametrize(
    "arguments",
    [
        ["identify"],
        ["identify", "rec.csv", "--roles", "roles.toml", "--past", "ten", "--out", "m.json"],
        ["no-such-command"],
        ["identify", "rec.csv", "--no-such-option"],
        ["listen", "--bus", "nonsense"],
        ["node"],
        ["node", "--turbine", "--past", "0"],
        ["node", "--turbine", "--method", "els", "--past", "200"],
        ["node", "--turbine", "--method", "fast-rls", "--past", "30", "--forget", "0.7"],
        ["node", "--turbine", "--method", "no-such-filter"],
        ["node", "--turbine", "--base", "0x601"],
        ["node", "--turbine", "--base", "0x680", "--node-id", "4"],
        ["node", "--turbine", "--base", "0x600"],
        ["node", "--turbine", "--node-id", "254"],
        ["listen", "--bus", "bus.log", "--base", "0x1CFF4100"],
        ["listen", "--bus", "bus.log", "--base", "first"],
    ],
)
def test_wrong_usage_is_code_2(arguments: list[str], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == USAGE
    assert "Traceback" not in capsys.readouterr().err


def test_the_command_itself_ends_with_the_code(folder: Path) -> None:
    """The same through a process of its own, as a script sees it."""
    command = [sys.executable, "-m", "aeolid.cli.main", "identify", "none.csv", "--roles", "roles.toml"]
    done = subprocess.run([*command, "--past", "10", "--out", "m.json"], capture_output=True, text=True, timeout=3600)
    assert done.returncode == DATA
    assert done.stderr.strip().splitlines()[-1] == "aeolid: none.csv: no such file"
    assert done.stdout == ""
