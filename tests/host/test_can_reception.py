"""Reception from a bus: errors, interruptions and back-off, strange clocks, other versions, several nodes at once."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import can
import numpy as np
import pytest

from aeolid.can import source
from aeolid.can.logs import open_log
from aeolid.can.reception import Reception, time_on_bus
from aeolid.can.reconnect import PAUSE_FIRST_S, PAUSE_MAX_S, ReconnectingSource
from aeolid.can.runs import RunRecorder
from aeolid.can.source import BusSource, open_source
from aeolid.can.wire import (
    BASE,
    DESCRIPTION,
    ERROR,
    EXTENDED,
    FAST,
    FD,
    Frames,
    encode,
    join_frames,
    no_frames,
    pack_frames,
)
from aeolid.cli import receiving
from aeolid.cli.main import main
from aeolid.errors import DataError

STREAM = Path(__file__).resolve().parents[1] / "vectors/wire_v1/stream.log"


def stored() -> Frames:
    """Return the stored stream."""
    source, parts = open_log(str(STREAM)), []
    while source.ended is None:
        parts.append(source.read(0.0))
    return join_frames(parts)


def renumber(frames: Frames, node: int) -> Frames:
    """Let another node send frames: the number is covered by no check of wire version 1."""
    ids = frames.id - (frames.id & np.uint32(0xFF)) + np.uint32(node)
    return Frames(ids, frames.flags, frames.length, frames.data, frames.time_s)


class Given:
    """A source that delivers batches, then ends."""

    name, is_log, status, interruptions = "given", False, "", 0
    ended: str | None = None

    def __init__(self, batches: list[Frames]) -> None:
        self._batches = list(batches)

    def read(self, timeout: float) -> Frames:
        """Return the next batch."""
        if not self._batches:
            self.ended = "unplugged"
            return no_frames()
        return self._batches.pop(0)

    def close(self) -> None:
        """Do nothing."""


def receive(batches: list[Frames], target: Path | None = None) -> Reception:
    """Receive batches to their end."""
    reception = Reception(Given(batches), RunRecorder(target), bit_rate=5e5, data_bit_rate=2e6)
    reception.run(lambda: False, None, False)
    for number in reception.recorder.runs:
        reception.recorder.name(number, f"-node{number}")
    return reception


def test_several_nodes_at_once_are_recorded_apart(tmp_path: Path) -> None:
    """Three nodes, frame by frame between each other, one of them late: three files, each true."""
    frames = stored()
    nodes = [renumber(frames, 3), renumber(frames, 9), renumber(frames, 200)]
    mixed = [n.take(np.arange(k, min(k + 7, len(n)))) for k in range(0, len(frames), 7) for n in nodes[:2]]
    late = [nodes[2].take(np.arange(k, min(k + 7, len(frames)))) for k in range(0, len(frames), 7)]
    order = [
        batch for k, batch in enumerate(mixed) for batch in ([batch, late.pop(0)] if k > 100 and late else [batch])
    ]
    reception = receive([*order, *late], tmp_path / "r.csv")
    assert sorted(reception.recorder.runs) == [3, 9, 200]
    whole = receive([renumber(frames, 3)], tmp_path / "whole.csv").recorder.runs[3][0].sha256
    for number, runs in reception.recorder.runs.items():
        assert [run.sha256 for run in runs] == [whole], number


def test_error_frames_of_a_bus_cost_nothing(tmp_path: Path) -> None:
    """Half of what comes are error frames: counted, and every sample is there: they make no frame doubtful."""
    frames, batches = stored(), []
    errors = pack_frames([(0, False, b"")] * 100, flags=[ERROR] * 100, times_s=[1.0] * 100)
    for k in range(0, len(frames), 100):
        batches += [frames.take(np.arange(k, min(k + 100, len(frames)))), errors]
    reception = receive(batches, tmp_path / "r.csv")
    assert reception.errors == 50 * len(batches) and reception.frames == len(frames)
    assert (reception.assembly.garbled, reception.assembly.damaged, reception.assembly.foreign) == (0, 0, 0)
    (run,) = reception.recorder.runs[7]
    assert (run.rows, run.lost) == (160, 0)


def test_another_wire_version_is_said_once_and_nothing_is_guessed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A node that speaks version 9: one sentence with both versions, code 3, no file."""
    frames = stored()
    own = frames.id != BASE + (DESCRIPTION << 8) + 7
    identifier, data = encode(7, DESCRIPTION, 0, 9, 12345)
    log = tmp_path / "later.log"
    with can.CanutilsLogWriter(log) as writer:
        writer(can.Message(arbitration_id=identifier, data=data, timestamp=1.0))
        for i, d in zip(frames.id[own].tolist(), frames.data[own], strict=True):
            writer(can.Message(arbitration_id=i, data=d.tobytes(), timestamp=1.0))
    assert main(["listen", "--bus", str(log), "--record", str(tmp_path / "r.csv")]) == 3
    told = capsys.readouterr()
    assert "version 9" in told.err and told.err.count("aeolid: ") == 1 and not list(tmp_path.glob("*.csv"))


class Flaky:
    """A bus that breaks off after some batches."""

    overrun = 2

    def __init__(self, batches: int) -> None:
        self.ended: str | None = None
        self.closed = False
        self._left = batches

    def read(self, timeout: float) -> Frames:
        """Return a frame, or break off."""
        if self._left == 0:
            self.ended = "ENETDOWN"
            return no_frames()
        self._left -= 1
        return pack_frames([(1, True, bytes(8))])

    def close(self) -> None:
        """Note that it was closed."""
        self.closed = True


def test_pauses_between_attempts_grow_and_start_small_after_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Refused, down, up again: the pauses double up to 15 s, and begin anew only once frames have come."""
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(time, "sleep", lambda s: now.__setitem__(0, now[0] + s))
    attempts: list[float] = []
    answers: list[Flaky | None] = [Flaky(1), *[None] * 6, Flaky(0), Flaky(0), Flaky(3), None, Flaky(100)]

    def connect() -> Flaky:
        attempts.append(now[0])
        answer = answers.pop(0)
        if answer is None:
            raise DataError("bus: refused")
        return answer

    source, told, frames = ReconnectingSource("bus", connect), [], 0
    while answers:
        frames += len(source.read(0.1))
        told.append(source.status)
        now[0] += 1e-3
    frames += sum(len(source.read(0.1)) for _ in range(5))
    gaps = np.diff(attempts[:10])
    expected = [min(PAUSE_FIRST_S * 2**k, PAUSE_MAX_S) for k in range(9)]
    np.testing.assert_allclose(gaps, expected, atol=0.15)
    assert attempts[10] - attempts[9] == pytest.approx(PAUSE_FIRST_S, abs=0.15)
    assert frames == 1 + 3 + 6 and source.interruptions == 4 and source.ended is None and source.status == ""
    assert source.overrun == 5 * Flaky.overrun
    assert source.away_s == pytest.approx(attempts[11] - 3 * 1e-3, rel=0.05)
    assert any("refused" in text and "next attempt in" in text for text in told)


def test_the_first_connection_must_work() -> None:
    """A wrong name is told at once instead of being tried for ever."""

    def connect() -> Flaky:
        raise DataError("bus: no such device")

    with pytest.raises(DataError, match="no such device"):
        ReconnectingSource("bus", connect)


@pytest.mark.parametrize("stamp", [12.5, 0.0, None])
def test_adapters_with_clocks_of_their_own_are_dated(stamp: float | None) -> None:
    """Stamps since the adapter's start, none at all, or the host's own: frames are dated by the host's clock."""
    begun = time.time()
    stamps = [begun + 1e-3 * k if stamp is None else stamp + (1e-3 * k if stamp else 0) for k in range(5)]
    messages = [can.Message(arbitration_id=k, data=bytes(8), timestamp=t) for k, t in enumerate(stamps)]
    bus = SimpleNamespace(recv=lambda timeout: messages.pop(0) if messages else None, shutdown=lambda: None)
    frames = BusSource("bus", bus).read(0.0)
    assert abs(frames.time_s - begun).max() < 5.0
    np.testing.assert_allclose(np.diff(frames.time_s), 0.0 if stamp == 0.0 else 1e-3, atol=1e-6)


def test_frames_before_a_failure_are_delivered() -> None:
    """An interface that fails in the middle of a batch: what came before is not lost."""
    left = [can.Message(arbitration_id=k, data=bytes(8), timestamp=1.79e9) for k in range(3)]

    def recv(timeout: float) -> can.Message:
        if not left:
            raise can.CanOperationError("Network is down")
        return left.pop(0)

    source = BusSource("bus", SimpleNamespace(recv=recv, shutdown=lambda: None))
    assert source.read(0.1).id.tolist() == [0, 1, 2] and source.ended == "Network is down"


def test_time_on_the_bus_is_the_worst_case_of_the_standard() -> None:
    """Classic frames: the longest have 135 (11-bit) and 160 bits (29-bit) with eight bytes, 55 and 80 with none."""
    for flags, length, bits in ((0, 8, 135), (EXTENDED, 8, 160), (0, 0, 55), (EXTENDED, 0, 80)):
        frame = Frames(
            np.zeros(1, np.uint32), np.full(1, flags, np.uint8), np.full(1, length, np.uint8),
            np.zeros((1, 8), np.uint8), np.zeros(1),
        )  # fmt: skip
        assert time_on_bus(frame, 5e5, 2e6) == pytest.approx(bits / 5e5)
    long = pack_frames([(1, True, bytes(64))], flags=[EXTENDED | FD | FAST])
    slow = pack_frames([(1, True, bytes(64))], flags=[EXTENDED | FD])
    assert 600 / 2e6 < time_on_bus(long, 5e5, 2e6) < time_on_bus(slow, 5e5, 2e6) < 900 / 5e5


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--record", "x.txt"], ".mf4"),
        (["--log", "x.pcap"], ".blf"),
        (["--log", "nowhere/x.blf"], "does not exist"),
        (["--record", "same.parquet", "--log", "same.parquet"], "named twice"),
        (["--log", "BUS"], "named twice"),
        (["--record", "."], "suffix"),
        (["--seconds", "0"], "above 0"),
        (["--bit-rate", "0"], "above 0"),
        (["--data-bit-rate", "-5"], "above 0"),
    ],
)
def test_wrong_options_are_told_before_anything_is_written(
    options: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each wrong request: code 2, one sentence, no file touched."""
    monkeypatch.chdir(tmp_path)
    bus = tmp_path / "bus.log"
    bus.write_bytes(STREAM.read_bytes())
    assert main(["listen", "--bus", str(bus), *(str(bus) if o == "BUS" else o for o in options)]) == 2
    assert words in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["bus.log"] and bus.read_bytes() == STREAM.read_bytes()


def test_watchers_hear_of_the_end_before_files_are_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a page waits for at the end and what bus and files take happen at the same time."""
    told: list[str] = []

    @contextmanager
    def shown(*_: object) -> Iterator[Callable[[], None]]:
        yield lambda: told.append("over")
        told.append("view closed")

    close_all = receiving._close_all
    monkeypatch.setattr("aeolid.cli.listen_view.shown", shown)
    monkeypatch.setattr(receiving, "_close_all", lambda *a: (told.append("bus and files closed"), close_all(*a)))
    assert main(["listen", "--bus", str(STREAM), "--record", str(tmp_path / "r.csv"), "--no-modes"]) == 0
    assert told == ["over", "bus and files closed", "view closed"]


def test_a_node_may_begin_to_serve_its_port_after_its_listener(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both started in one line of a tutorial: whichever is first, they meet; a port that nobody serves is told."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
    text, said = f"slcan:socket://127.0.0.1:{port}", []

    def serve() -> None:
        while not said:
            time.sleep(0.01)
        with socket.create_server(("127.0.0.1", port)) as server:
            server.accept()[0].close()

    node = threading.Thread(target=serve, daemon=True)
    node.start()
    open_source(text, notice=said.append).close()
    node.join(60)
    assert len(said) == 1 and "nobody serves" in said[0]
    monkeypatch.setattr(source, "PATIENCE_S", 0.3)
    with pytest.raises(DataError, match="cannot be opened"):
        open_source(text)


def test_a_bus_that_breaks_off_before_the_first_frame_is_told_as_such(capsys: pytest.CaptureFixture[str]) -> None:
    """Not as a node that is silent: the remedy is another one."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        peer = threading.Thread(target=lambda: server.accept()[0].close(), daemon=True)
        peer.start()
        bus = f"slcan:socket://127.0.0.1:{server.getsockname()[1]}"
        assert main(["listen", "--bus", bus, "--no-reconnect", "--no-modes"]) == 3
        peer.join(60)
    said = " ".join(capsys.readouterr().err.split())
    assert "the bus broke off before the first frame" in said and "is a node sending" not in said


@pytest.mark.parametrize("kind", [signal.SIGTERM, signal.SIGHUP])
def test_a_node_that_waits_ends_with_its_command(kind: signal.Signals) -> None:
    """Ended while it waits for a listener, the command leaves no process behind that holds the port."""
    command = [sys.executable, "-m", "aeolid.cli.main", "node", "--turbine", "--samples", "5000", "--wait"]
    # who runs the tests beyond a hang-up has the signal ignored, and what it starts, too
    anew = f"import os, signal, sys; signal.signal({int(kind)}, signal.SIG_DFL); os.execv(sys.argv[1], sys.argv[1:])"
    command = [sys.executable, "-c", anew, *command]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        port = int(process.stdout.readline().rpartition(":")[2])
        process.send_signal(kind)
        process.wait(3600)
    with pytest.raises(OSError), socket.create_connection(("127.0.0.1", port), timeout=3600):
        pass


def test_a_page_that_cannot_be_served_leaves_no_files(tmp_path: Path) -> None:
    """The port is taken: nothing has come, and the same command may be given again under the same names."""
    log, poles = tmp_path / "bus.log", tmp_path / "poles.csv"
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        words = ["--no-browser", "--port", str(taken.getsockname()[1]), "--log", str(log), "--poles", str(poles)]
        assert main(["monitor", "--bus", "virtual:nobody", *words, "--for", "1"]) == 2
    assert list(tmp_path.iterdir()) == []
