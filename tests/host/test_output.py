"""Outputs appear whole or not at all, never through a link, and replace only what the same command wrote."""

from __future__ import annotations

import os
import resource
import shutil
import stat
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aeolid import output
from aeolid.cli.main import main
from aeolid.errors import UsageError
from aeolid.output import ledger
from aeolid.plants.examples import write_examples

pytestmark = pytest.mark.usefixtures("forking_throughout")

USAGE = 2
IDENTIFY = ["identify", "monday.csv", "--roles", "roles.toml", "--past", "5", "--order", "2", "--uncertainty", "none"]
SIMULATE = ["simulate", "my_case/model.json", "monday.csv", "--roles", "roles.toml"]
FILTER = ["filter", "monday.csv", "--roles", "roles.toml", "--method", "rls", "--past", "5"]
STREAM = Path(__file__).resolve().parents[1] / "vectors/wire_v1/stream.log"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    write_examples(folder, samples=600)
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    place = tmp_path / "here"
    shutil.copytree(made, place)
    monkeypatch.chdir(place)
    return place


WRITERS = {
    "identify --out": [*IDENTIFY, "--out", "X.json"],
    "identify --report": [*IDENTIFY, "--out", "other.json", "--report", "X.html"],
    "identify --json": [*IDENTIFY, "--out", "other.json", "--json", "X.json"],
    "simulate --out csv": [*SIMULATE, "--out", "X.csv"],
    "simulate --out csv.gz": [*SIMULATE, "--out", "X.csv.gz"],
    "simulate --out parquet": [*SIMULATE, "--out", "X.parquet"],
    "validate --json": ["validate", *SIMULATE[1:], "--json", "X.json"],
    "convert json": ["convert", "my_case/model.json", "X.json"],
    "convert mat": ["convert", "my_case/model.json", "X.mat"],
    "convert C": ["convert", "my_case/model.json", "X.h"],
    "filter --out": [*FILTER, "--out", "X.npz"],
    "catalogue --json": ["catalogue", "--json", "X.json"],
    "node --dump": ["node", "--turbine", "--samples", "20", "--past", "5", "--speed", "max", "--dump", "X.f32"],
    "listen --record": ["listen", "--bus", str(STREAM), "--record", "X.csv"],
    "listen --log": ["listen", "--bus", str(STREAM), "--log", "X.log"],
    "listen --markov": ["listen", "--bus", str(STREAM), "--markov", "X.npz"],
    "listen --poles": ["listen", "--bus", str(STREAM), "--poles", "X.csv"],
    "listen --json": ["listen", "--bus", str(STREAM), "--json", "X.json"],
}
OUT = {name: next(w for w in words if w.startswith("X.")) for name, words in WRITERS.items()}


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_of_somebody_else_is_kept(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file of the user's, and a link to one, stand as they are; the sentence names it; and nothing else is made."""
    before = sorted(p.name for p in folder.iterdir())
    target = folder / OUT[name]
    target.write_text("years of work")
    assert main(WRITERS[name]) == USAGE
    said = capsys.readouterr().err
    assert target.name in said and "--force" in said and "Traceback" not in said
    assert target.read_text() == "years of work"
    precious = folder.parent / "precious"
    precious.write_text("years of work")
    for place in (precious, folder.parent / "nowhere"):  # a link that leads nowhere would make a file there
        target.unlink()
        target.symlink_to(place)
        assert main([*WRITERS[name], "--force"]) == USAGE
        assert "link" in capsys.readouterr().err and target.is_symlink()
    assert precious.read_text() == "years of work" and not (folder.parent / "nowhere").exists()
    target.unlink()
    assert sorted(p.name for p in folder.iterdir()) == before


RERUN = ["simulate --out csv", "simulate --out parquet", "convert mat", "filter --out",
         "node --dump", "listen --record", "listen --log", "listen --poles", "listen --markov"]  # fmt: skip


@pytest.mark.parametrize("name", RERUN)
def test_the_same_command_may_write_again(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Until somebody changes the file; then --force says that it may go."""
    assert main(WRITERS[name]) == 0 and main(WRITERS[name]) == 0, capsys.readouterr().err
    target = folder / OUT[name]
    with target.open("ab") as handle:
        handle.write(b"\n# my remark")
    assert main(WRITERS[name]) == USAGE
    assert "was changed since" in capsys.readouterr().err and target.read_bytes().endswith(b"# my remark")
    assert main([*WRITERS[name], "--force"]) == 0
    assert not target.read_bytes().endswith(b"# my remark")


def test_an_empty_file_may_go(folder: Path) -> None:
    """As mktemp makes it for a script; it holds nothing."""
    (folder / "m.json").touch()
    assert main(["convert", "my_case/model.json", "m.json"]) == 0 and (folder / "m.json").stat().st_size


def test_another_command_does_not_replace_what_one_wrote(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", "my_case/model.json", "m.json"]) == 0
    for words in (["catalogue", "--json", "m.json"], [*IDENTIFY, "--out", "m.json"]):
        assert main(words) == USAGE
        assert "m.json: was written by aeolid convert OUT" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("kind", ["itself", "spelt otherwise", "hard link"])
def test_an_input_is_no_output(kind: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Not even where the same command wrote it."""
    assert main(["convert", "my_case/model.json", "m.json"]) == 0
    os.link("m.json", "n.json")
    before = Path("m.json").read_bytes()
    target = {"itself": "m.json", "spelt otherwise": "../here/./m.json", "hard link": "n.json"}[kind]
    assert main(["convert", "m.json", target]) == USAGE
    assert "an input of this command" in " ".join(capsys.readouterr().err.split())
    assert Path("m.json").read_bytes() == before and Path("n.json").samefile("m.json")


def test_examples_keep_what_was_edited(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["example", "new", "--samples", "200"]) == 0
    assert main(["example", "new", "--samples", "200"]) == 0
    edited = folder / "new" / "my_case" / "case.toml"
    edited.write_text(edited.read_text() + "# mine\n")
    table = (folder / "new" / "monday.csv").read_bytes()
    assert main(["example", "new", "--samples", "300"]) == USAGE
    assert "case.toml: was changed" in " ".join(capsys.readouterr().err.split())
    assert (folder / "new" / "monday.csv").read_bytes() == table and edited.read_text().endswith("# mine\n")


FOLDERS: dict[str, list[str]] = {
    "diagnose": ["diagnose", "my_case", "--out", "D"],
    "fleet": [
        "fleet",
        "monday.csv",
        "--roles",
        "roles.toml",
        "--past",
        "5",
        "--workers",
        "1",
        "--models",
        "--out",
        "D",
    ],
    "example": ["example", "D", "--samples", "200"],
    "challenge make": ["challenge", "make", "D", "--cases", "1"],
}
BELOW = {"diagnose": "model", "fleet": "models", "example": "my_case"}
NAMED = {"diagnose": "report.html", "fleet": "fleet.json", "example": "stage/model.toml"}


@pytest.mark.parametrize("name", FOLDERS)
def test_folders_are_tried_before_the_work(
    name: str, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Links, files in the way and files of others are told at once, and nothing is written anywhere."""

    def no_work(*_: object, **__: object) -> None:
        raise AssertionError("the work has begun")

    monkeypatch.setattr("aeolid.diagnose.conclude.conclude", no_work)
    monkeypatch.setattr("aeolid.fleet.run.run_fleet", no_work)
    monkeypatch.setattr("aeolid.plants.examples.turbine_table", no_work)
    elsewhere = folder.parent / "elsewhere"
    elsewhere.mkdir()
    place = folder / "D"

    def refused(word: str) -> None:
        assert main(FOLDERS[name]) == USAGE
        assert word in " ".join(capsys.readouterr().err.split())
        assert list(elsewhere.iterdir()) == []

    place.symlink_to(elsewhere)
    refused("link")
    place.unlink()
    place.write_text("a file")
    refused("is a file")
    place.unlink()
    if name in BELOW:
        place.mkdir()
        (place / BELOW[name]).symlink_to(elsewhere)
        refused("link")
        (place / BELOW[name]).unlink()
        (place / NAMED[name]).parent.mkdir(exist_ok=True)
        (place / NAMED[name]).write_text("mine")
        refused("--force")
        assert (place / NAMED[name]).read_text() == "mine"


def test_what_is_cleared_was_made_by_the_same_command(folder: Path) -> None:
    """The results of a challenge and the demonstration are written anew each time, so the folder must be theirs."""
    place = folder / "results"
    for _ in range(2):
        output.declare("challenge run", force=False, folders={"--out": place}, claimed=True)
        (place / "case-0001").mkdir(exist_ok=True)
    output.finished()
    for command in ("demo", "challenge run"):
        with pytest.raises(UsageError, match="did not make it"):
            other = place if command == "demo" else folder
            output.declare(command, force=False, folders={"--out": other}, claimed=True)
        output.finished()


def test_a_link_planted_in_a_case_is_not_followed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The folder of a case is somebody else's: what lies between it and the output is no link."""
    elsewhere = folder.parent / "elsewhere"
    elsewhere.mkdir()
    (folder / "my_case" / "results").symlink_to(elsewhere)
    assert main(["diagnose", "my_case", "--out", "my_case/results/today"]) == USAGE
    assert "my_case/results: is a link" in " ".join(capsys.readouterr().err.split())
    assert list(elsewhere.iterdir()) == []


def test_links_above_the_output_are_the_users_own(folder: Path) -> None:
    real = folder.parent / "disk"
    real.mkdir()
    (folder / "results").symlink_to(real)
    assert main(["convert", "my_case/model.json", "results/m.json"]) == 0 and (real / "m.json").is_file()


FULL = ["identify --out", "simulate --out csv", "simulate --out parquet", "convert mat", "filter --out",
        "catalogue --json"]  # fmt: skip


@pytest.mark.parametrize("name", FULL)
def test_a_full_disk_leaves_the_old_file_whole(
    name: str, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Writing stops at a limit of the file's size, as at a full disk; one sentence, code 2, nothing half made."""
    assert main(WRITERS[name]) == 0
    target = folder / OUT[name]
    before, names = target.read_bytes(), sorted(os.listdir(folder))
    at = output.writing.replacing

    def small(path: object, **how: bool) -> object:
        if Path(str(path)).name == target.name:
            resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) // 2, hard))
        return at(path, **how)  # type: ignore[arg-type]

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    for module in ("aeolid.output.replacing", "aeolid.output.writing.replacing", "aeolid.cli.filter.replacing"):
        monkeypatch.setattr(module, small)
    try:
        assert main(WRITERS[name]) == USAGE
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    said = capsys.readouterr().err
    assert f"{target.name}: cannot be written" in said and "Traceback" not in said
    assert target.read_bytes() == before and sorted(os.listdir(folder)) == names


def test_modes_are_those_of_the_umask_or_of_the_file_before(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        output.write_text(tmp_path / "new", "x")
        (tmp_path / "own").write_text("y")
        (tmp_path / "own").chmod(0o600)
        output.write_text(tmp_path / "own", "x")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640
    assert stat.S_IMODE((tmp_path / "own").stat().st_mode) == 0o600


def test_whoever_reads_meanwhile_sees_a_whole_file(tmp_path: Path) -> None:
    """The old content or the new one, never part of either."""
    path = tmp_path / "f"
    output.write_text(path, "a" * 100_000)
    seen, done = set(), threading.Event()

    def read() -> None:
        while not done.is_set():
            seen.add(path.read_text())

    reader = threading.Thread(target=read)
    reader.start()
    for k in range(60):
        output.write_text(path, "ab"[k % 2] * 100_000, durable=False)
    done.set()
    reader.join()
    assert seen <= {"a" * 100_000, "b" * 100_000}
    assert os.listdir(tmp_path) == ["f"]


@pytest.mark.parametrize("fault", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError("no")])
def test_what_fails_half_way_leaves_nothing(fault: BaseException, tmp_path: Path) -> None:
    (tmp_path / "f").write_text("old")
    with (
        pytest.raises(UsageError if isinstance(fault, OSError) else type(fault)),
        output.replacing(tmp_path / "f") as h,
    ):
        h.write(b"half")
        raise fault
    assert (tmp_path / "f").read_text() == "old" and os.listdir(tmp_path) == ["f"]


def spoil_link(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.parent / "elsewhere")


SPOILT: dict[str, tuple[Callable[[Path], object], bool]] = {
    "missing": (lambda p: p.unlink(), True),
    "cut off": (lambda p: p.write_bytes(p.read_bytes()[:-9]), True),
    "no text": (lambda p: p.write_bytes(b"\xff\0\n" * 100), True),
    "no objects": (lambda p: p.write_text('[]\n1\n{"file": 1}\n' + "[" * 5000), True),
    "huge": (lambda p: p.write_bytes(p.read_bytes() + b"\n" * (ledger.MOST + 1)), True),
    "a link": (spoil_link, True),
}


@pytest.mark.parametrize("kind", SPOILT)
def test_a_spoilt_ledger_speaks_for_nothing(kind: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Then nothing is known to be ours, and --force is needed; the ledger never leads anywhere else."""
    command = ["convert", "my_case/model.json", "m.json"]
    assert main(command) == 0
    SPOILT[kind][0](folder / ledger.NAME)
    assert main(command) == USAGE
    assert "aeolid did not write it" in " ".join(capsys.readouterr().err.split())
    assert not (folder / "elsewhere").exists()


def test_the_ledger_stays_short(tmp_path: Path) -> None:
    lines = [ledger.Entry(f"f{k % 3}", "test --out", f"{k:064d}") for k in range(900)]
    (tmp_path / ledger.NAME).write_bytes(b"".join(e.line() for e in lines))
    ledger.add(tmp_path, ledger.Entry("f0", "test --out", f"{900:064d}"))
    assert (tmp_path / ledger.NAME).stat().st_size < 1000
    assert sorted(int(e.sha256) for e in ledger.entries(tmp_path)) == [898, 899, 900]


def test_a_device_that_takes_everything_is_written_to(folder: Path) -> None:
    assert main(["convert", "my_case/model.json", "m.json", "--json", "/dev/null"]) == 0
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_receptions_from_a_bus_are_numbered(tmp_path: Path) -> None:
    """What came over a bus does not come again: all files of a reception get the first number that is free."""
    wanted = [tmp_path / "r.csv", tmp_path / "m.npz", None]
    assert output.free_number(wanted) == 1
    (tmp_path / "r.csv").touch()
    assert output.free_number(wanted) == 1
    (tmp_path / "r.csv").unlink()
    for k, taken in enumerate(["m.npz", "r-2-run1.csv", "r-3.node1.run1.part.csv", "r-4.roles.toml"], 2):
        (tmp_path / taken).write_text("a")
        assert output.free_number(wanted) == k
        assert output.numbered(tmp_path / "r.csv", k) == tmp_path / f"r-{k}.csv"
    (tmp_path / "r-5-other.csv").write_text("")  # nothing a reception would write
    assert output.free_number(wanted) == 5
    assert np.all([output.numbered(tmp_path / "a.csv.gz", 2).name == "a-2.csv.gz"])
