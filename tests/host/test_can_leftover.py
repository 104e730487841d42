"""A reception that is killed leaves its raw log unfinished; the next one says how it is completed."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aeolid.can.leftover import is_left
from aeolid.can.logs import open_log
from aeolid.can.raw_log import open_raw_log
from aeolid.can.wire import Frames, join_frames
from aeolid.cli.main import main

pytestmark = pytest.mark.usefixtures("forking_throughout")

STREAM = Path(__file__).resolve().parents[1] / "vectors/wire_v1/stream.log"
KILLED = """if True:
    import os, signal, sys
    from pathlib import Path
    from aeolid.can.logs import open_log
    from aeolid.can.raw_log import open_raw_log
    source, log = open_log("stream.log"), open_raw_log(Path(sys.argv[1]))
    while source.ended is None:
        frames = source.read(0.0)
        for k in range(0, len(frames), 400):
            log.write(frames.take(slice(k, k + 400)))
            log.flush()
    os.kill(os.getpid(), signal.SIGKILL)"""


def frames_of(path: Path) -> Frames:
    source, parts = open_log(str(path)), []
    while source.ended is None:
        parts.append(source.read(0.0))
    return join_frames(parts)


@pytest.fixture(params=["bus.parquet", "bus.mf4"])
def log(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the name of a log whose reception was killed, in the current folder."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(STREAM, "stream.log")
    done = subprocess.run([sys.executable, "-P", "-c", KILLED, request.param], check=False, timeout=3600)
    assert done.returncode == -signal.SIGKILL and not Path(request.param).exists()
    return Path(request.param)


def listen(source: str, log: Path) -> int:
    return main(["listen", "--bus", source, "--log", str(log), "--no-modes"])


def test_the_command_that_is_told_completes_the_log(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The next reception touches nothing and says the command; after it the log is whole and alone."""
    before = Path("bus.part.arrows").read_bytes()
    assert listen("stream.log", log) == 2
    command = f"aeolid listen --bus bus.part.arrows --log {log} --no-modes"
    assert command in capsys.readouterr().err
    assert Path("bus.part.arrows").read_bytes() == before
    assert main(command.split()[1:]) == 0
    assert {p.name for p in Path().iterdir()} == {str(log), "stream.log"}
    found, sent = frames_of(log), frames_of(Path("stream.log"))
    assert np.array_equal(found.id, sent.id) and np.array_equal(found.data, sent.data)
    assert listen("stream.log", log) == 2, "what came over a bus is never replaced"


def test_an_attempt_that_is_killed_is_made_again(log: Path) -> None:
    """What it had left itself is no obstacle; a torn end costs what was torn, and the spool is kept then."""
    Path("bus.again.part.arrows").write_bytes(b"half a head")
    spool = Path("bus.part.arrows")
    spool.write_bytes(spool.read_bytes()[:-1000])
    assert listen(str(spool), log) == 3
    assert len(frames_of(log)) == 1200, "three of four parts"
    assert spool.is_file() and not Path("bus.again.part.arrows").exists()


def test_a_log_that_is_there_is_completed_under_a_number(log: Path) -> None:
    log.write_bytes(b"as a kill within the end leaves it")
    assert listen("bus.part.arrows", log) == 2
    assert listen("bus.part.arrows", log.with_name(f"bus-2{log.suffix}")) == 0
    assert log.read_bytes() == b"as a kill within the end leaves it" and not Path("bus.part.arrows").exists()


def test_samples_are_read_beside_it_under_the_same_name(log: Path) -> None:
    assert main(["listen", "--bus", "bus.part.arrows", "--record", "bus.csv", "--no-modes"]) == 0
    assert Path("bus.csv").is_file() and Path("bus.part.arrows").is_file()


def test_a_reception_under_way_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(STREAM, "stream.log")
    running = open_raw_log(Path("bus.parquet"))
    running.write(frames_of(Path("stream.log")))
    running.flush()
    assert not is_left(Path("bus.part.arrows"))
    assert listen("bus.part.arrows", Path("bus.parquet")) == 2
    assert "still writes it" in capsys.readouterr().err
    running.close()
    assert len(frames_of(Path("bus.parquet"))) == running.frames and not Path("bus.part.arrows").exists()
