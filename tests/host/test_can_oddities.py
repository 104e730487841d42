"""Odd buses, logs and wishes: stamps that are no dates, remote frames, phantom nodes, endless restarts, odd names."""

from __future__ import annotations

import os
import re
import threading
import tracemalloc
import zlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from can_frames import L, R, Row, bits, describe, receive, row, samples

from aeolid.can import Assembly, wire
from aeolid.can import run as run_module
from aeolid.can import runs as runs_module
from aeolid.can.clock import ClockKeeper
from aeolid.can.reception import Reception
from aeolid.can.recorder import read_log
from aeolid.can.runs import Run, RunRecorder, write_roles
from aeolid.can.samples import SampleTable
from aeolid.can.wire import Frames, no_frames, pack_frames
from aeolid.cli import listen_view
from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.record import Channel, Roles

STREAM = Path(__file__).resolve().parents[1] / "vectors/wire_v1/stream.log"
STAMPS = {
    "none": lambda i: "nan",
    "infinite": lambda i: "inf" if i % 7 else "1e300",
    "microseconds": lambda i: f"{1.7e15 + 100 * i:.1f}",
    "nanoseconds": lambda i: f"{1.7e18 + 1e5 * i:.1f}",
    "negative": lambda i: f"{-5 - 0.001 * i:.6f}",
    "backwards": lambda i: f"{1.7e9 - 0.001 * i:.6f}",
    "leap": lambda i: f"{1e-9 * i:.12f}" if i < 900 else "8e9",
}


def stamped(target: Path, law: str) -> Path:
    """Write the stored stream with other time stamps."""
    lines = STREAM.read_text().splitlines()
    told = [re.sub(r"^\([^)]*\)", f"({STAMPS[law](i)})", line) for i, line in enumerate(lines)]
    target.write_text("\n".join(told) + "\n")
    return target


@pytest.mark.usefixtures("forking")
@pytest.mark.parametrize("law", STAMPS)
def test_stamps_that_are_no_dates_cost_no_sample(law: str, tmp_path: Path) -> None:
    """Microseconds or nothing where seconds belong: the samples are those of the log with good stamps."""
    main(["listen", "--bus", str(STREAM), "--record", str(tmp_path / "true.csv")])
    log = stamped(tmp_path / "odd.log", law)
    for suffix in ("parquet", "mf4", "blf", "asc"):
        files = ["--record", str(tmp_path / f"{suffix}.csv"), "--log", str(tmp_path / f"copy.{suffix}")]
        assert main(["listen", "--bus", str(log), *files]) == 0
        assert (tmp_path / f"{suffix}.csv").read_bytes() == (tmp_path / "true.csv").read_bytes()
        assert main(["listen", "--bus", str(tmp_path / f"copy.{suffix}")]) == 0
    assert not list(tmp_path.glob("*.part*"))


def test_an_index_beyond_all_counting_begins_a_new_line() -> None:
    """A pace of nanoseconds and then a leap of centuries: no index of 64 bits holds what should have passed."""
    keeper = ClockKeeper()
    for k, (start, step) in enumerate([(0.0, 1e-10), (8.5e9, 0.1)]):
        rows = [row(1, wire.SAMPLE, 0, 200 * k + i, 0) for i in range(200)]
        keeper.feed(pack_frames(rows, times_s=[start + step * i for i in range(200)]), {1: 0.1})
    assert [pairs.count for pairs in keeper.runs(1)] == [200, 200]


def test_a_remote_frame_is_no_damaged_one() -> None:
    """A request for one of our identifiers announces eight bytes and carries none."""
    frame = pack_frames([(wire.BASE + (wire.SAMPLE << 8) + 1, True, bytes(8))], flags=[wire.EXTENDED | wire.REMOTE])
    messages = wire.decode(frame)
    assert (messages.damaged, messages.foreign, len(messages)) == (0, 1, 0)


def test_garbled_numbers_bar_no_node() -> None:
    """Each of 200 numbers came once, garbled past its check; the node that comes after them is followed."""
    phantoms = [row(number, wire.HEALTH, 0, 0, 0) for number in range(2, 202)]
    assembly = receive([*phantoms, *describe(node=250), *samples(0, 20, node=250), *phantoms])
    assert assembly.nodes[250].now is not None and len(assembly.nodes) == 32


def test_names_beyond_the_basic_plane_and_doubled_ones_stay_readable(tmp_path: Path) -> None:
    """A mathematical theta is two escapes in JSON, which TOML refuses; a name made distinct may be taken too."""
    roles = write_roles(tmp_path / "r.csv", (Channel("𝜃", "°", "input"), Channel('y"\\', "", "output")), 0.1, None)
    assert [c.name for c in Roles.load(roles).channels] == ["𝜃", 'y"\\']
    d = receive(describe(names=("x_y1", "x", "x"))).nodes[1].now
    assert d is not None and len(set(d.description.names)) == 5


class Given:
    """A source that delivers batches, then ends; `look` is called before each."""

    name, is_log, status, interruptions = "given", False, "", 0
    ended: str | None = None

    def __init__(self, batches: list[Frames]) -> None:
        self._batches = list(batches)
        self.handles: list[int] = []

    def read(self, timeout: float) -> Frames:
        """Return the next batch."""
        self.handles.append(len(os.listdir("/proc/self/fd")))
        if not self._batches:
            self.ended = "unplugged"
            return no_frames()
        return self._batches.pop(0)


def restarts(count: int, target: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Reception, Given]:
    """Receive a node that starts anew again and again, looked after at once."""
    monkeypatch.setattr("aeolid.can.reception.LOOK_S", 0.0)
    monkeypatch.setattr(runs_module, "KEEP", 32)
    quiet = [row(1, wire.HEALTH, 1, 0, 0)] * 5000  # no doubt is left about what came before
    source = Given([pack_frames([*describe(), *samples(0, 400), *quiet]) for _ in range(count)])
    reception = Reception(source, RunRecorder(target), bit_rate=5e5, data_bit_rate=2e6)
    reception.run(lambda: False, None, False)
    return reception, source


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="no /proc")
def test_a_node_that_starts_again_and_again_uses_up_no_handles(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each run has a file of its own, and one of them is open."""
    reception, source = restarts(12, tmp_path / f"r{suffix}", monkeypatch)
    runs = reception.recorder.runs[1]
    assert [run.rows for run in runs] == [400] * 12
    assert max(source.handles) <= source.handles[2] + 4
    reception.recorder.name(1, "")
    assert len(list(tmp_path.glob(f"r-run*{suffix}"))) == 12 and not list(tmp_path.glob("*.part*"))


def test_a_run_that_can_get_no_file_ends_in_good_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder goes read-only during the reception: what came before has its file and name."""
    true, opened = run_module.open_growing, []

    def once(path: Path, *rest: object) -> object:
        opened.append(path)
        if len(opened) > 1:
            raise UsageError(f"{path}: cannot be written (read-only)")
        return true(path, *rest)

    monkeypatch.setattr(run_module, "open_growing", once)
    reception, _ = restarts(4, tmp_path / "r.csv", monkeypatch)
    assert reception.fault is not None and "read-only" in reception.fault
    reception.recorder.name(1, "")
    assert len((tmp_path / "r.csv").read_text().splitlines()) == 401


def test_a_configuration_that_is_over_costs_nothing_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once its samples are out, a node is looked at as rarely as one that never changed."""
    assembly = receive([*describe(), *samples(0, 50), *describe(names=("c", "d")), *samples(0, 50)])
    recorder, drained = RunRecorder(None), []
    recorder.poll(assembly, now=True)
    assert assembly.nodes[1].previous
    monkeypatch.setattr(recorder, "_drain", lambda *_: drained.append(1))
    recorder.poll(assembly)
    assert not drained


def test_a_silence_of_months_is_filled_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Missing rows are made as they are written: memory does not grow with the hole."""
    description = SimpleNamespace(sample_every=2, sample_time_s=0.1, inputs=1, outputs=0)
    run = Run(SimpleNamespace(description=description), 0, 0)
    run.append(SampleTable(np.array([0, 2]), np.zeros((2, 1)), 0))
    tracemalloc.start()
    run.append(SampleTable(np.array([2_000_004]), np.zeros((1, 1)), 0))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (run.rows, run.lost, run.last) == (1_000_003, 1_000_000, 2_000_004)
    assert peak < 4_000_000


def test_the_display_waits_for_a_whole_state() -> None:
    """It is drawn in a thread of its own, and must not read what is half changed."""
    reception = Reception(Given([]), RunRecorder(None), bit_rate=5e5, data_bit_rate=2e6)
    view, drawn = listen_view.Progress(reception), []
    view.render()
    thread = threading.Thread(target=lambda: drawn.append(view.render()))
    with reception.lock:
        thread.start()
        thread.join(0.3)
        assert not drawn
    thread.join()
    assert drawn


def test_one_file_that_fails_costs_the_other_nodes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The snapshot of the first node cannot be written: both recordings are complete all the same."""

    def refuse(path: Path, *_: object) -> None:
        raise DataError(f"{path}: cannot be written: disk on fire")

    monkeypatch.setattr("aeolid.can.write_markov", refuse)
    log, lines = tmp_path / "two.log", STREAM.read_text().splitlines()
    node = re.search(r" 1CFF4.(..)#", lines[0])
    assert node is not None
    other = [re.sub(rf"( 1CFF4.){node[1]}#", r"\g<1>77#", line) for line in lines]
    log.write_text("\n".join([*lines, *other]) + "\n")
    wanted = ["--record", str(tmp_path / "r.csv"), "--markov", str(tmp_path / "m.npz")]
    assert main(["listen", "--bus", str(log), *wanted]) == 3
    assert "disk on fire" in capsys.readouterr().err
    assert len(list(tmp_path.glob("r-node*.csv"))) == 2 and not list(tmp_path.glob("*.part*"))


def test_names_of_files_are_told_as_they_are(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Brackets are no colours."""
    assert main(["listen", "--bus", str(STREAM), "--record", str(tmp_path / "x[b].csv")]) == 0
    assert "x[b].csv" in capsys.readouterr().out


def test_the_log_that_is_read_is_never_written_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By whatever way it is named."""
    log, link = tmp_path / "in.log", tmp_path / "link.log"
    log.write_bytes(STREAM.read_bytes())
    link.symlink_to(log)
    assert main(["listen", "--bus", str(log), "--log", str(link)]) == 2
    assert "named twice" in capsys.readouterr().err and log.read_bytes() == STREAM.read_bytes()


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--node-id", "300"], 2, "--node-id 300: above base 0x1CFF4000 nodes are 0 to 253"),
        (["--node-id", "16", "--base", "0x600"], 2, "nodes are 0 to 15"),
        (["--node-id", "99"], 3, "nothing of the node asked for, but of node "),
        (["--base", "0x600"], 3, "none from a node; is the node's --base another?"),
    ],
)
def test_a_wrong_node_or_base_is_told(
    options: list[str], code: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Instead of `not one frame` about a log that is full of them."""
    assert main(["listen", "--bus", str(STREAM), *options]) == code
    assert words in " ".join(capsys.readouterr().err.split())


def test_a_log_of_another_base_names_the_remedy(tmp_path: Path) -> None:
    """A log with identifiers of 11 bits is read as a recording by way of listen."""
    identifier, data = wire.encode(1, wire.SAMPLE, 0, 0, 0, 0x600)
    log = tmp_path / "short.log"
    log.write_text(f"(1.0) can0 {identifier:03X}#{data.hex()}\n")
    with pytest.raises(DataError, match=r"1 frames, none of them a described sample.*--base"):
        read_log(log)


@pytest.mark.parametrize(("place", "words"), [("", "is a folder"), ("missing/theta.bin", "missing does not exist")])
def test_a_node_refuses_at_once_what_it_could_not_dump(
    place: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Not after the last of a day's samples."""
    assert main(["node", "--turbine", "--samples", "20", "--speed", "max", "--dump", str(tmp_path / place)]) == 2
    told = capsys.readouterr()
    assert words in " ".join(told.err.split()) and not told.out


def sealed(kind: int, k: int, value: float) -> list[Row]:
    """Build a sample or the innovations of one, with their seal; all channels tell the value."""
    count, tag = (R + L, R + L) if kind == wire.SAMPLE else (L, L | wire.SEAL_INNOVATION)
    values = [bits(value)] * count
    words = np.array([1 | tag << 8, k, *values], "<u4")
    rows = [row(1, kind, channel, k & 0xFFFF, v) for channel, v in enumerate(values)]
    return [*rows, row(1, wire.SEAL, tag, k & 0xFFFF, zlib.crc32(words.tobytes()))]


@pytest.mark.parametrize("clocks", [True, False])
@pytest.mark.parametrize("boot", [20, 40, 150, 700])
def test_innovations_of_one_boot_stay_out_of_the_next(boot: int, clocks: bool, tmp_path: Path) -> None:
    """A restart: the innovations beside the rows of the newest run are its own; those of before are not among them."""
    rows = describe()
    for first, count in ((10_000.0, boot), (0.0, 1500)):
        for k in range(count):
            rows += sealed(wire.SAMPLE, k, first + k) + sealed(wire.INNOVATION, k, first + k)
        rows += describe()
    assembly, recorder = Assembly(), RunRecorder(None, innovations=tmp_path)
    if clocks:
        recorder.clocks = lambda number: []
    for k in range(0, len(rows), 100):
        assembly.feed(wire.pack_frames(rows[k : k + 100]))
        recorder.poll(assembly, True)
    assembly.close()
    recorder.finish(assembly)
    run = recorder.runs[1][-1]
    told = run.innovations(np.ones(L))[:, 0]
    there = np.isfinite(told)
    assert run.rows == 1500 and np.count_nonzero(there) >= 1450
    assert (told[there] == np.arange(1500)[there]).all()
    assert all(old.ended for old in recorder.runs[1][:-1])
