"""Every end of a command is one sentence and an exit code of the table, whatever goes wrong around it."""

from __future__ import annotations

import errno
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from aeolid.cli import guard
from aeolid.cli.main import main
from aeolid.diagnose.data.case import load_case
from aeolid.errors import AeolidError, DataError, NotIdentifiable, UsageError
from aeolid.plants.examples import write_examples

AEOLID = [sys.executable, "-m", "aeolid.cli.main"]
LINE = re.compile(r"aeolid: [^\n]+\n")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    write_examples(folder, samples=200)
    return folder


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (UsageError("a"), 2, "a"), (DataError("b"), 3, "b"), (NotIdentifiable("c"), 4, "c"),
        (KeyboardInterrupt(), 130, "stopped"), (MemoryError(), 3, "memory"),
        (RecursionError("r"), 70, "RecursionError"),
        (ValueError("secret content"), 70, "report"), (EOFError(), 70, "EOF"),
        (ZeroDivisionError(), 70, "AEOLID_TRACEBACK"),
        (OSError(errno.ENOSPC, "No space left on device", "x.csv"), 2, "x.csv: cannot be written"),
        (OSError(errno.EROFS, "Read-only file system"), 2, "cannot be written"),
        (PermissionError(errno.EACCES, "Permission denied", "x.csv"), 3, "x.csv: Permission denied"),
        (BrokenPipeError(errno.EPIPE, "Broken pipe"), 70, "BrokenPipeError"), (AssertionError("a\nb"), 70, "report"),
    ],
)  # fmt: skip
def test_whatever_is_raised_is_told(
    error: BaseException, code: int, words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Code 1 is the bad news asked for and nothing else; an unexpected error quotes nothing of what it met."""

    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("aeolid.cli.catalogue.emit_json", fail)
    assert main(["catalogue"]) == code
    told = capsys.readouterr().err
    assert LINE.fullmatch(told) and words in told and "secret" not in told
    monkeypatch.setenv(guard.TRACEBACK, "1")
    assert main(["catalogue"]) == code
    assert "Traceback" in capsys.readouterr().err


def test_no_error_of_ours_has_code_1() -> None:
    kinds, waiting = [], [AeolidError]
    while waiting:
        kind = waiting.pop()
        kinds.append(kind)
        waiting += kind.__subclasses__()
    assert {k.exit_code for k in kinds} <= {2, 3, 4}


def heed() -> None:
    """Let a child be interrupted where these tests run in the background, whose children ignore that."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def run(command: list[str], folder: Path, **how: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["sh", "-c", *command], cwd=folder, stderr=subprocess.PIPE, text=True, timeout=3600, **how)  # type: ignore[call-overload,no-any-return]


@pytest.mark.parametrize(
    ("shell", "words"),
    [
        ('exec "$@" >/dev/full', "No space left"),
        ('exec "$@" >&-', "it is closed"),
        ('{ "$@"; echo $? >code; } | true; exit $(cat code)', "Broken pipe"),
    ],
)
def test_a_standard_output_that_is_gone_costs_no_file(shell: str, words: str, made: Path) -> None:
    """What was asked for is written all the same; one sentence, code 2, and no traceback when the process ends."""
    target = made / "m.mat"
    target.unlink(missing_ok=True)
    if "true" in shell:  # the reader is gone before anything is written
        shell = shell.replace("{ ", "{ sleep 0.3; ")
    done = run([shell, "sh", *AEOLID, "convert", "my_case/model.json", "m.mat"], made)
    assert done.returncode == 2 and re.fullmatch(LINE, done.stderr), done.stderr
    assert words in done.stderr and target.stat().st_size > 200


def test_closed_standard_streams_do_no_harm(made: Path) -> None:
    """The next file opened would have been the standard output: its number is kept."""
    done = run(['exec "$@" <&- >&- 2>&-', "sh", *AEOLID, "convert", "my_case/model.json", "n.json"], made)
    assert done.returncode == 2
    shutil.copy(made / "my_case" / "model.json", made / "as_it_is.json")
    assert main(["convert", str(made / "n.json"), str(made / "o.json")]) == 0


SLOW = """
import os, sys, time
import aeolid.cli.catalogue as module
from aeolid import output
from aeolid.cli.main import main
def work(*_):
    with output.replacing("x.json") as handle:
        handle.write(b"half")
        try:
            print("ready", file=sys.stderr, flush=True)
            time.sleep(60)
        finally:
            if len(sys.argv) > 1:
                print("again", file=sys.stderr, flush=True)
                time.sleep(60)
module.emit_json = work
sys.exit(main(["catalogue", "--json", "x.json"]))
"""


@pytest.mark.parametrize(
    ("signals", "code"), [([signal.SIGINT], 130), ([signal.SIGINT] * 2, 130), ([signal.SIGTERM], -signal.SIGTERM)]
)
def test_interrupts_end_in_good_order(signals: list[int], code: int, tmp_path: Path) -> None:
    """The second Ctrl-C comes while the first one is being dealt with; nothing half made is left."""
    command = [sys.executable, "-c", SLOW, *(["stay"] if len(signals) > 1 else [])]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, preexec_fn=heed) as process:
        assert process.stderr is not None
        for number in signals:
            assert process.stderr.readline() in ("ready\n", "again\n")
            process.send_signal(number)
        said = process.stderr.read()
    assert process.returncode == code
    assert said == ("" if code < 0 else "aeolid: stopped\n")
    assert [p.name for p in tmp_path.iterdir()] == []


LOST = """
import ctypes, os, signal, sys, time
import aeolid.cli.catalogue as module
from aeolid.cli.main import main
def work(*_):
    ctypes.CFUNCTYPE(None)(lambda: os.kill(os.getpid(), signal.SIGINT))()
    time.sleep(60)
module.emit_json = work
sys.exit(main(["catalogue"]))
"""


def test_an_interrupt_within_foreign_code_is_not_lost(tmp_path: Path) -> None:
    """A compiler's callback swallows it, with a traceback."""
    done = subprocess.run([sys.executable, "-c", LOST], cwd=tmp_path, stderr=subprocess.PIPE, text=True, timeout=3600,
                          preexec_fn=heed)  # fmt: skip
    assert (done.returncode, done.stderr) == (130, "aeolid: stopped\n")


LOADING = """
import os, signal, sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == sys.argv[1]:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
from aeolid.cli.main import main
sys.exit(main(["--version"]))
"""


@pytest.mark.parametrize("module", ["aeolid.children", "typer", "aeolid.cli.guard", "aeolid.cli.check"])
def test_an_interrupt_while_modules_are_loaded_is_one_sentence(module: str, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", LOADING, module], cwd=tmp_path, capture_output=True, text=True,
                          timeout=3600, preexec_fn=heed)  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "aeolid: stopped\n")


def case_in(made: Path, folder: Path, change: str = "") -> Path:
    """Copy the positioning stage, in its case.toml one text replaced by another: "old=>new"."""
    case = folder / "case"
    shutil.copytree(made / "stage", folder / "source" / "stage")
    shutil.copytree(made / "stage", case)
    text = (case / "case.toml").read_text()
    old, _, new = change.partition("=>")
    assert old in text
    (case / "case.toml").write_text(text.replace(old, new) if old else text)
    return case


OUTSIDE = {
    "absolute recording": '"recording.csv"=>"/etc/hostname.csv"',
    "absolute roles": '"roles.toml"=>"/etc/shadow"',
    "roles above": '"roles.toml"=>"../source/stage/roles.toml"',
    "above and back": '"model.toml"=>"../case/model.toml"',
    "inside and above": '"model.toml"=>"x/../../source/stage/model.toml"',
    "backslashes": r'"model.toml"=>"..\\\\model.toml"',
    "drive": '"model.toml"=>"C:/model.toml"',
    "empty": '"model.toml"=>""',
    "nul": r'"model.toml"=>"model\u0000.toml"',
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_case_names_files_of_its_own(name: str, made: Path, tmp_path: Path) -> None:
    """Anything else is refused before it is opened, whether it is there or not."""
    case = case_in(made, tmp_path, OUTSIDE[name])
    with pytest.raises(DataError, match=r"--allow-outside|no name of a file") as caught:
        load_case(case)
    assert "case.toml [" in str(caught.value)


@pytest.mark.parametrize("linked", ["recording.csv", "roles.toml", "model.toml", "case.toml"])
@pytest.mark.parametrize("way", ["file", "folder"])
def test_links_out_of_a_case_are_refused(linked: str, way: str, made: Path, tmp_path: Path) -> None:
    by_folder = way == "folder" and linked != "case.toml"
    case = case_in(made, tmp_path, f'"{linked}"=>"inner/{linked}"' if by_folder else "")
    (case / linked).unlink()
    place = tmp_path / "source" / "stage"
    (case / ("inner" if by_folder else linked)).symlink_to(place if by_folder else place / linked)
    with pytest.raises(DataError, match=r"leads out of the case's folder.*--allow-outside"):
        load_case(case)
    assert load_case(case, allow_outside=True).title == "Positioning stage"


def test_links_within_a_case_are_followed(made: Path, tmp_path: Path) -> None:
    case = case_in(made, tmp_path)
    (case / "data").mkdir()
    (case / "recording.csv").rename(case / "data" / "today.csv")
    (case / "recording.csv").symlink_to("data/today.csv")
    moved = tmp_path / "linked_case"
    moved.symlink_to(case)  # the folder itself may be reached by a link
    assert load_case(moved).title == "Positioning stage"


def test_no_output_of_a_diagnosis_replaces_its_inputs(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The case's own folder as --out, where the baseline lies where the corrected model goes."""
    case = case_in(made, tmp_path, '"model.toml"=>"model/model.toml"')
    (case / "model").mkdir()
    (case / "model.toml").rename(case / "model" / "model.toml")
    before = (case / "model" / "model.toml").read_bytes()
    assert main(["diagnose", str(case), "--out", str(case)]) == 2
    assert "model.toml: exists" in " ".join(capsys.readouterr().err.split())
    assert (case / "model" / "model.toml").read_bytes() == before


def test_nothing_is_visited_for_the_last_time() -> None:
    """The interpreter's last collection finds next to nothing: it would cost more than many a command."""
    code = """if True:
        import atexit, gc, sys
        atexit.register(lambda: print(len(gc.get_objects()), gc.get_freeze_count()))  # the last of all to be called
        from aeolid.cli.main import main
        main(["--version"])
        main(["--version"])"""
    told = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True, timeout=3600)
    left, frozen = map(int, told.stdout.split()[-2:])
    assert 10 * left < frozen
