"""The listener as an operator meets it: floods, buses that come and go, signals, full disks, logs, many nodes."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import flood_traffic
import numpy as np
import pytest
from harness import Process, Relay, garble, listen, wait_for

from aeolid.can.logs import open_log
from aeolid.can.reception import Reception
from aeolid.can.runs import RunRecorder
from aeolid.can.slcan import parse
from aeolid.can.wire import Frames, join_frames
from aeolid.cli.main import main
from aeolid.formats import read_record
from aeolid.record import Roles

Start = Callable[..., Process]
HERE = Path(__file__).resolve().parent
STREAM = flood_traffic.STREAM
LINE = 27  # bytes of a classic frame with a 29-bit identifier


def slcan_text(path: Path = STREAM) -> bytes:
    """Spell the stored stream as slcan lines."""
    source, text = open_log(str(path)), []
    while source.ended is None:
        frames = source.read(0.0)
        text += [
            b"T%08X8%s\r" % (i, d.tobytes().hex().upper().encode()) for i, d in zip(frames.id, frames.data, strict=True)
        ]
    return b"".join(text)


class Adapter:
    """A serial adapter on TCP that can be unplugged: it serves one listener after the other on the same port."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self.address = f"slcan:socket://127.0.0.1:{self.port}"
        self._peer: socket.socket | None = None

    def plug(self, timeout: float = 3600.0) -> None:
        """Serve again, and wait for the listener."""
        if self._server.fileno() < 0:
            self._server = socket.create_server(("127.0.0.1", self.port))
        self._server.settimeout(timeout)
        self._peer, _ = self._server.accept()
        told = b""
        while b"O\r" not in told:  # opens the channel; what was sent before is thrown away
            told += self._peer.recv(64)

    def send(self, text: bytes) -> None:
        """Send text to the listener."""
        assert self._peer is not None
        self._peer.sendall(text)

    def unplug(self) -> None:
        """Close everything: whoever connects is refused. What was sent still arrives."""
        assert self._peer is not None
        self._server.close()
        self._peer.shutdown(socket.SHUT_WR)
        self._peer.settimeout(3600.0)
        while self._peer.recv(4096):
            pass
        self._peer.close()
        self._peer = None

    def close(self) -> None:
        """Let go of all."""
        self._server.close()
        if self._peer is not None:
            self._peer.close()


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    """Provide an adapter that does not outlive the test."""
    made = Adapter()
    yield made
    made.close()


@pytest.fixture(scope="module")
def flood(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compile the sender."""
    target = tmp_path_factory.mktemp("flood") / "flood"
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler is not None
    warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"]
    subprocess.run([compiler, "-std=c99", "-O2", *warnings, str(HERE / "flood.c"), "-o", str(target)], check=True)
    return target


def peak_kb(pid: int) -> int:
    """Return the most memory a process has had; 0 of one that has ended."""
    text = Path(f"/proc/{pid}/status").read_text()
    return next((int(line.split()[1]) for line in text.splitlines() if line.startswith("VmHWM")), 0)


FLOOD, RATE = 300_000, 10_000_000  # lines, and how many a second: more than any listener takes


@pytest.mark.slow
def test_a_flood_loses_nothing(flood: Path, start: Start, tmp_path: Path) -> None:
    """Frames as fast as they are taken, half of them ours: all arrive, each sample true, all of them in the log.

    Memory is compared by what has been logged, not by the time: the second half needs no more than the first. Since
    more waits than a read takes, every read is as large as it gets from the first one on, however busy the machine.
    """
    text = tmp_path / "flood.txt"
    sent, samples = flood_traffic.write(text, FLOOD)
    with subprocess.Popen([str(flood), str(text), str(RATE)], stdout=subprocess.PIPE, text=True) as sender:
        assert sender.stdout is not None
        address = f"slcan:socket://127.0.0.1:{sender.stdout.readline().strip()}"
        facts, target, log = tmp_path / "facts.json", tmp_path / "r.csv", tmp_path / "bus.blf"
        words = ("--record", target, "--log", log, "--json", facts, "--no-reconnect")
        listener = start("listen", "--bus", address, *words)
        seen: list[tuple[int, int]] = []  # bytes in the log, kB at most so far
        while sender.poll() is None:
            time.sleep(0.02)
            seen.append((log.stat().st_size if log.exists() else 0, peak_kb(listener.process.pid)))
        told = sender.stdout.read().split()
    ended = listener.finish()
    ended.assert_clean(3)  # nobody said goodbye
    assert "peer has closed" in ended.err
    result = json.loads(facts.read_text())
    assert int(told[0]) == sent == result["frames"] == result["log"]["frames"]
    assert (result["damaged"], result["garbled_lines"]) == (0, 0)
    (run,) = result["nodes"][0]["runs"]
    assert (run["samples"], run["lost_values"]) == (samples, 0)
    late = [peak for size, peak in seen if size >= log.stat().st_size / 2 and peak > 0]
    assert late[-1] - late[0] < 20_000, seen  # 133 bytes a frame of half a flood; the test below is exact
    record = read_record(target, Roles.load(tmp_path / "r.roles.toml"))
    index, channel = np.indices(record.values.shape)
    np.testing.assert_array_equal(record.values, flood_traffic.value_of(index, channel))
    source, frames = open_log(str(log)), 0
    while source.ended is None:
        frames += len(source.read(0.0))
    assert (frames, source.ended) == (sent, "end of file")


class Endless:
    """A source of samples without end; tells how much memory was in use now and then."""

    name, is_log, status, interruptions = "endless", False, "", 0
    ended: str | None = None

    def __init__(self, samples: int) -> None:
        self.memory: list[int] = []
        self._left = samples
        self._first = 0

    def read(self, timeout: float) -> Frames:
        """Return the next 2000 samples."""
        if self._first >= self._left:
            self.ended = "enough"
        self.memory.append(tracemalloc.get_traced_memory()[0])
        text = flood_traffic.lines(self._first, 2000, self._first)
        frames = parse(text)[0]
        if self._first == 0:
            frames = join_frames([flood_traffic.description(), frames])
        self._first += 2000
        return replace(frames, time_s=1.79e9 + 0.1 * self._first + 0.01 * np.arange(len(frames)))

    def close(self) -> None:
        """Do nothing."""


def test_memory_stays_flat_however_long_a_node_streams(tmp_path: Path) -> None:
    """260,000 samples: what is held at the end is what was held after a half, but for parts of a file."""
    source = Endless(260_000)
    recorder = RunRecorder(tmp_path / "r.parquet")
    tracemalloc.start()
    try:
        reception = Reception(source, recorder, bit_rate=5e5, data_bit_rate=2e6)
        assert reception.run(lambda: False, None, False) == "enough"
    finally:
        tracemalloc.stop()
    early, late = source.memory[40:80], source.memory[-40:]
    part = 65_536 * 6 * 8
    assert max(late) - max(early) < 200_000 + part / 2
    assert max(late) < 12e6 + 2 * part
    (run,) = recorder.runs[flood_traffic.NODE]
    recorder.name(flood_traffic.NODE, "")
    assert (run.rows, run.lost) == (262_000, 0)


def test_a_bus_that_breaks_off_is_opened_again(adapter: Adapter, start: Start, tmp_path: Path) -> None:
    """Unplugged in the middle of a frame, twice: the recording goes on, the gap is NaN, no frame is believed twice."""
    text, facts, target = slcan_text(), tmp_path / "facts.json", tmp_path / "r.csv"
    third = len(text) // LINE // 3 * LINE
    listener = start("listen", "--bus", adapter.address, "--record", target, "--json", facts)
    adapter.plug()
    adapter.send(text[: third + 10])
    adapter.unplug()
    adapter.plug()
    adapter.send(text[third + 10 * LINE : 2 * third + 10])
    adapter.unplug()
    adapter.plug()
    adapter.send(text[2 * third + 10 * LINE :])
    adapter.send(b"\r")  # an acknowledgement: the bus is there, silent
    time.sleep(0.5)
    listener.signal(signal.SIGTERM)
    listener.finish().assert_clean()
    told = json.loads(facts.read_text())
    assert (told["interruptions"], told["ended_by"]) == (2, "stopped")
    (run,) = told["nodes"][0]["runs"]
    assert 0 < run["lost_values"] <= 20
    truth = np.genfromtxt(STREAM.with_name("samples.csv"), delimiter=",", names=True)
    received = read_record(target, Roles.load(tmp_path / "r.roles.toml"))
    for name in received.names("input"):
        there = np.isfinite(received.column(name))
        np.testing.assert_array_equal(received.column(name)[there], truth[name][: len(there)][there])


@pytest.mark.slow
def test_without_reconnection_the_first_break_ends_it(adapter: Adapter, start: Start, tmp_path: Path) -> None:
    """--no-reconnect, and --until-end by itself: code 3 and one sentence."""
    for option in ("--no-reconnect", "--until-end"):
        target = tmp_path / f"r{option}.csv"
        listener = start("listen", "--bus", adapter.address, option, "--record", target)
        adapter.plug()
        adapter.send(slcan_text()[: 600 * LINE])
        adapter.unplug()
        ended = listener.finish()
        ended.assert_clean(3)
        assert "broke off" in ended.err and target.exists()
        adapter._server = socket.create_server(("127.0.0.1", adapter.port))


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["classic", "fd", "garbled"])
def test_what_was_logged_replays_as_it_was_received(mode: str, start: Start, tmp_path: Path) -> None:
    """A node, its bus logged; that log replayed into the next format, through all five: the same bits everywhere."""
    options = ["--fd", "--fd-ratio", 4] if mode == "fd" else []
    node = start(
        "node", "--turbine", "--samples", 400, "--seed", 3, "--past", 5, "--wait", "--speed", "max", "--innovations",
        "--dump", tmp_path / "theta.f32", *options,
    )  # fmt: skip
    address = node.first_line()
    if mode == "garbled":
        address = Relay([address], garble(0.02, 5)).address
    logs = [tmp_path / f"bus.{suffix}" for suffix in ("blf", "mf4", "parquet", "asc", "log")]
    target, markov = tmp_path / "live.csv", tmp_path / "live.npz"
    ended, facts = listen(
        address, tmp_path, "--until-end", "--record", target, "--markov", markov, "--log", logs[0]
    )  # fmt: skip
    ended.assert_clean()
    theta = np.load(markov)
    assert theta["theta_scaled"].astype("<f4").tobytes() == (tmp_path / "theta.f32").read_bytes()
    assert (facts["garbled_lines"] > 5) == (mode == "garbled")  # type: ignore[operator]
    for log, following in zip(logs, [*logs[1:], tmp_path / "again.blf"], strict=True):
        again, told = tmp_path / f"{log.suffix[1:]}.csv", tmp_path / "again.json"
        words = [
            "--bus",
            log,
            "--record",
            again,
            "--markov",
            again.with_suffix(".npz"),
            "--log",
            following,
            "--json",
            told,
        ]
        assert main(["listen", *map(str, words)]) == 0
        assert again.read_bytes() == target.read_bytes()
        replayed = np.load(again.with_suffix(".npz"))
        for key in ("theta_scaled", "theta", "innovation", "sample_index", "settings"):
            np.testing.assert_array_equal(replayed[key], theta[key], err_msg=key)
        counted = json.loads(told.read_text())
        for key in ("frames", "foreign", "damaged", "garbled_lines", "error_frames"):
            assert counted[key] == facts[key], key


@pytest.mark.parametrize(
    ("number", "suffix"),
    [(signal.SIGINT, "csv"), (signal.SIGHUP, "csv.gz"), (signal.SIGTERM, "parquet"), (signal.SIGTERM, "mf4")],
)
def test_a_signal_loses_nothing(
    number: signal.Signals, suffix: str, adapter: Adapter, start: Start, tmp_path: Path
) -> None:
    """Ctrl-C, SIGTERM, a closed terminal, asked twice: every frame that came is in the log and the recording."""
    text, log = slcan_text(), tmp_path / "bus.asc"
    words = ("--record", tmp_path / f"r.{suffix}", "--log", log, "--json", tmp_path / "facts.json")
    listener = start("listen", "--bus", adapter.address, *words)
    adapter.plug()
    adapter.send(text)
    wait_for(lambda: log.exists() and log.read_bytes().count(b"\n") > len(text) // LINE)
    listener.signal(number)
    listener.signal(number)
    listener.finish().assert_clean()
    told = json.loads((tmp_path / "facts.json").read_text())
    assert told["frames"] == told["log"]["frames"] == len(text) // LINE
    received = read_record(tmp_path / f"r.{suffix}", Roles.load(tmp_path / "r.roles.toml"))
    truth = np.genfromtxt(STREAM.with_name("samples.csv"), delimiter=",", names=True)
    for name in received.names("input") + received.names("output"):
        np.testing.assert_array_equal(received.column(name), truth[name])
    assert not list(tmp_path.glob("*.part*")) and {p.name for p in tmp_path.glob(".*")} <= {".aeolid"}


@pytest.mark.parametrize("name", ["r.csv", "r.csv.gz", "r.parquet", "r.mf4", "b.blf", "b.mf4"])
def test_a_full_disk_is_told_and_costs_only_what_comes_after(
    name: str, adapter: Adapter, start: Start, tmp_path: Path
) -> None:
    """On a small disk: code 3, one sentence, and a whole file of what had arrived until then."""
    # MB; what is written from a spool at the end keeps the room of that and three times 4 MB
    size = 6 if name in ("r.csv", "b.blf") else 14
    disk = tmp_path / "disk"
    disk.mkdir()
    if (
        os.geteuid() != 0
        or subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}m", "tmpfs", disk]).returncode != 0
    ):
        pytest.skip("small disks need the right to mount")
    try:
        _fill(disk / name, adapter, start, tmp_path)
    finally:
        subprocess.run(["umount", "-l", disk], check=True)


def _fill(target: Path, adapter: Adapter, start: Start, tmp_path: Path) -> None:
    option = "--record" if target.name.startswith("r") else "--log"
    listener = start("listen", "--bus", adapter.address, "--json", tmp_path / "facts.json", option, target)
    adapter.plug()

    def pour() -> None:
        head = flood_traffic.description()
        adapter.send(flood_traffic.spell(head.id.astype(np.int64), head.data[:, :8]).tobytes())
        with suppress(OSError):
            for first in range(0, 2_000_000, 5000):
                adapter.send(flood_traffic.lines(first, 5000, first))

    thread = threading.Thread(target=pour)
    thread.start()
    ended = listener.finish()
    adapter.close()
    thread.join()
    ended.assert_clean(3)
    assert "no room" in ended.err
    told = json.loads((tmp_path / "facts.json").read_text())
    if option == "--record":
        received = read_record(target, Roles.load(target.with_name("r.roles.toml")))
        index, channel = np.indices(received.values.shape)
        truth = flood_traffic.value_of(index, channel)
        came = np.isfinite(received.values[-1]).cumprod() == 1  # of the sample that was under way, channel by channel
        assert came.any()
        truth[-1, ~came] = np.nan
        np.testing.assert_array_equal(received.values, truth)
        assert len(received) > 5000
    else:
        source, frames = open_log(str(target)), 0
        while source.ended is None:
            frames += len(source.read(0.0))
        assert source.ended == "end of file" and frames == told["log"]["frames"] > 10_000
