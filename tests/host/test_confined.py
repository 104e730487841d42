"""What runs confined can reach nothing, and however it ends the caller gets a sentence."""

from __future__ import annotations

import errno
import io
import os
import platform
import re
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aeolid.confined import Failure, Limits, barrier, call, start
from aeolid.confined.channel import pack, unpack
from aeolid.errors import DataError
from aeolid.inputs import open_regular, read_bounded, regular_size

DENIED = (errno.EPERM, errno.ENOSYS)
SMALL = Limits(memory=256 << 20, cpu_s=2, patience_s=3000.0, result=4 << 20)


def test_arguments_and_arrays_go_there_and_back(tmp_path: Path, monkeypatch, capfd: pytest.CaptureFixture[str]) -> None:
    """Whatever lies in the current folder, the child neither sees it nor prints."""
    for name in ("numpy.py", "json.py", "aeolid.py", "sitecustomize.py", "struct.py"):
        (tmp_path / name).write_text(f"open({str(tmp_path / 'mark')!r}, 'w')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    sent = {
        "a": np.arange(6.0).reshape(2, 3),
        "b": np.array([], np.uint8),
        "c": np.array(True),
        "d": np.arange(3)[::-1],
    }
    facts, arrays = call("aeolid.confined.probe:echo", {"text": "pitch °"}, SMALL, sent)
    assert facts["text"] == "pitch °" and facts["folder"] == "/"
    assert not any(Path(p).resolve() == tmp_path for p in facts["path"]) and "" not in facts["path"]
    for name, values in sent.items():
        np.testing.assert_array_equal(arrays[name], values)
        assert arrays[name].dtype == values.dtype and arrays[name].shape == values.shape
    assert not (tmp_path / "mark").exists()
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(platform.machine() not in ("x86_64", "aarch64"), reason="no barrier for this processor")
def test_it_writes_nothing_starts_nothing_and_inherits_nothing(tmp_path: Path) -> None:
    pipes = [os.pipe() for _ in range(5)]
    for pipe in pipes:
        os.set_inheritable(pipe[0], True)
    asked = {"path": str(tmp_path / "mark"), "program": "/bin/touch"}
    facts, _ = call("aeolid.confined.probe:reach", asked, SMALL)
    assert set(facts["met"].values()) <= {"PermissionError", "ZeroDivisionError"}, facts["met"]
    assert list(tmp_path.iterdir()) == []
    assert len(facts["open"]) <= 7, "three to nowhere, the request, the answer, the folder that is listed"
    for pipe in pipes:
        os.close(pipe[0]), os.close(pipe[1])
    allowed = Limits(SMALL.memory, SMALL.cpu_s, file_size=1 << 20)
    assert call("aeolid.confined.probe:reach", asked, allowed)[0]["met"]["write"] == "done"
    assert (tmp_path / "mark").exists()


@pytest.mark.skipif(platform.machine() not in ("x86_64", "aarch64"), reason="no barrier for this processor")
def test_no_family_of_calls_reaches_other_processes_or_the_attributes_of_files(tmp_path: Path) -> None:
    """Whoever runs it: an administrator could do all of these. What it does to itself goes on working."""
    (tmp_path / "a").write_text("x")
    os.utime(tmp_path / "a", (1e9, 1e9))
    before = os.stat(tmp_path / "a")
    with subprocess.Popen(["sleep", "3600"]) as other:
        try:
            asked = {"path": str(tmp_path / "a"), "process": other.pid}
            facts, _ = call("aeolid.confined.probe:reach_beyond", asked, SMALL)
            assert other.poll() is None
        finally:
            other.kill()
    done = {(f, n): e for f, calls in facts["met"].items() for n, e in calls.items() if e not in DENIED}
    assert len(facts["met"]) == 8 and done == {}
    after = os.stat(tmp_path / "a")
    for name in ("st_mode", "st_uid", "st_gid", "st_atime", "st_mtime"):
        assert getattr(after, name) == getattr(before, name), name
    assert facts["own"]["kill"] == facts["own"]["limits"] == 0 and facts["own"]["affinity"] != errno.EPERM
    assert facts["asked"] is False


HEADERS = {"x86_64": "x86_64-linux-gnu/asm/unistd_64.h", "aarch64": "asm-generic/unistd.h"}


@pytest.mark.parametrize("machine", HEADERS)
def test_the_numbers_of_calls_are_those_of_the_kernel(machine: str) -> None:
    header = Path("/usr/include") / HEADERS[machine]
    if not header.exists():
        pytest.skip(f"{header}: not installed")
    known = dict(re.findall(r"#define __NR(?:3264)?_(\w+) (\d+)", header.read_text()))
    column, _ = barrier._ARCHES[machine]
    listed = barrier._ALWAYS | barrier._SOCKETS | barrier._CHANGES
    assert not [n for n, at in listed.items() if n in known and at[column] != int(known[n])]
    assert all(max(at) < barrier._NEWER for at in listed.values())
    named = {"kill": 0, "tkill": 1, "tgkill": 2}
    assert all(barrier._TO_ITSELF[i][column] == int(known[n]) for n, i in named.items())
    limits = {"prlimit64": barrier._PRLIMIT, "fcntl": barrier._FCNTL, "ioctl": barrier._IOCTL}
    assert all(at[column] == int(known[n]) for n, at in limits.items())


ENDINGS = {
    "spin": "2 s of processor time", "grow": "256 MiB of memory", "crash": "crashed, SIGSEGV",
    "abort": "crashed, SIGABRT",
    "exit": "without an answer", "flood": "more than the 4 MiB", "raise": "raise", "sleep": "to an end in 1 s",
}  # fmt: skip


@pytest.mark.parametrize("way", ENDINGS)
def test_every_bad_end_has_its_words_and_what_came_before_is_kept(way: str) -> None:
    replies = []
    with start("aeolid.confined.probe:fail", {"way": way}, SMALL) as running, pytest.raises(Failure) as caught:
        for reply in running:
            replies.append(reply)
            if way == "sleep":  # from here on; how long a start takes is the machine's
                running._limits = replace(SMALL, patience_s=1.0)
    assert ENDINGS[way] in str(caught.value)
    assert replies[0] == ({"before": way}, {})


def test_errors_of_the_package_pass_through_and_other_packages_are_not_run() -> None:
    refusal = pytest.raises(DataError, match=r"^a\.mat: refused$")
    with start("aeolid.confined.probe:fail", {"way": "refuse"}, SMALL) as running, refusal:
        list(running)
    with pytest.raises(Failure, match="no module of this package"):
        call("os:system", {"command": "true"}, SMALL)


STARTS = """
from aeolid.confined import Limits, start
with start("aeolid.confined.probe:fail", {"way": "sleep"}, Limits(256 << 20, 600, 3000.0, 4 << 20)) as running:
    replies = iter(running)
    next(replies)
    print(running._process.pid, flush=True)
    next(replies)
"""


@pytest.mark.skipif(platform.system() != "Linux", reason="a signal at the end of the parent is Linux's")
@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_it_ends_with_the_process_that_started_it(end: signal.Signals) -> None:
    with subprocess.Popen([sys.executable, "-c", STARTS], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        confined = Path(f"/proc/{int(process.stdout.readline())}/stat")
        assert _runs(confined)
        process.send_signal(end)
    for _ in range(300):  # not later than it is asked for; the signal is under way when the parent has ended
        if not _runs(confined):
            return
        time.sleep(0.1)
    os.kill(int(confined.parent.name), signal.SIGKILL)
    pytest.fail("the confined process goes on")


def _runs(stat: Path) -> bool:
    """Tell whether a process is there and no mere entry that nobody has collected."""
    try:
        return stat.read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_a_function_can_ask() -> None:
    found = []
    with start("aeolid.confined.probe:double", {}, SMALL) as running:
        for facts, _ in running:
            if "asks" in facts:
                running.answer({"number": 3 + len(found)})
            else:
                found.append(facts["double"])
    assert found == [6, 8]


NONSENSE = [
    b"\xff" * 8, b"\x02" + bytes(7) + b"[]", b"\x04" + bytes(7) + b"\xff{}}",
    *(len(t).to_bytes(8, "little") + t for t in (
        b'{"facts":{},"arrays":[["a","<f8",[99999999999999999]]]}', b'{"facts":{},"arrays":[["a","|O8",[1]]]}',
        b'{"facts":{},"arrays":[["a","<f8",[-1]]]}', b'{"facts":{},"arrays":[["a","<f8"]]}',
        b'{"facts":{},"arrays":[["a","<f8",[1,1,1,1]]]}', b"[" * 100_000, b'{"facts":{},"arrays":[["a","<V9",[1]]]}',
        b'{"facts":{},"arrays":[[1,"<f8",[1]]]}', b'{"facts":[],"arrays":[]}',
        b'{"facts":{},"arrays":[["a","<c8",[1]]]}',
    )),
]  # fmt: skip


@pytest.mark.parametrize("content", NONSENSE, ids=range(len(NONSENSE)))
def test_what_a_taken_over_process_sends_is_refused_before_it_is_stored(content: bytes) -> None:
    stream = io.BytesIO(content)
    with pytest.raises((ValueError, OverflowError, TypeError)):
        unpack(lambda buffer: None if stream.readinto(buffer) == len(buffer) else pytest.fail("read on"), 1 << 20)


def test_only_numbers_are_sent() -> None:
    with pytest.raises(ValueError, match="no number"):
        pack({}, {"a": np.array([{}], object)})


@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "socket", "none", "link to a pipe"])
def test_only_regular_files_are_opened(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rec.csv"
    if kind == "folder":
        path.mkdir()
    elif kind == "device":
        path = Path("/dev/zero")
    elif kind == "socket":
        monkeypatch.chdir(tmp_path)
        socket.socket(socket.AF_UNIX).bind("rec.csv")
    elif kind == "link to a pipe":
        os.mkfifo(tmp_path / "pipe")
        path.symlink_to(tmp_path / "pipe")
    elif kind == "pipe":
        os.mkfifo(path)
    word = "no such file" if kind == "none" else kind.split()[-1]
    for attempt in (regular_size, open_regular):
        with pytest.raises(DataError, match=rf"^{path}: .*{word}"):
            attempt(path)


def test_a_file_exchanged_for_a_pipe_does_not_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    os.mkfifo(tmp_path / "rec.csv")
    monkeypatch.setattr("aeolid.inputs.regular_size", lambda path: 1)
    with pytest.raises(DataError, match="a pipe"):
        open_regular(tmp_path / "rec.csv")


def test_reading_is_bounded(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes(b"x" * 100)
    assert read_bounded(tmp_path / "a.toml", 100) == b"x" * 100
    with pytest.raises(DataError, match="longer than 99 bytes"):
        read_bounded(tmp_path / "a.toml", 99)
    with pytest.raises(DataError, match="not a name"):
        open_regular("a\0b")
