"""Hostile and broken devices: what is held and written stays within stated limits, and an honest node loses nothing."""

from __future__ import annotations

import random
import sys
from collections.abc import Iterator
from pathlib import Path

import hostile_nodes as hostile
import numpy as np
import pytest

import aeolid.can.runs as runs_module
from aeolid.can import limits, wire
from aeolid.can.assembly import Assembly
from aeolid.can.compact import merge_tail
from aeolid.can.counts import Counts
from aeolid.can.garbling import Garbling
from aeolid.can.judging import VALUE, Part, join_parts
from aeolid.can.logs import open_log
from aeolid.can.messages import MARKER, pack_messages
from aeolid.can.node import Configuration
from aeolid.can.raw_log import RAW_SUFFIXES, open_raw_log
from aeolid.can.reception import Reception
from aeolid.can.runs import RunRecorder
from aeolid.can.wire import ERROR, EXTENDED, GARBLED, REMOTE, Frames, join_frames, no_frames, pack_frames
from aeolid.cli import listen_rules
from aeolid.cli.main import main
from aeolid.formats.spool import TextSpool, read_spool, whole_lines

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "soak"))
COUNT, BATCH = 2500, 250


class Given:
    """A source that delivers batches, then ends."""

    name, is_log, status, interruptions = "given", True, "", 0
    ended: str | None = None

    def __init__(self, batches: Iterator[Frames]) -> None:
        self._batches = batches

    def read(self, timeout: float) -> Frames:
        """Return the next batch."""
        frames = next(self._batches, None)
        if frames is None:
            self.ended = "end of file"
            return no_frames()
        return frames


def first(rows: Iterator[list[hostile.Row]], count: int, batch: int = BATCH) -> Iterator[Frames]:
    """Yield the first frames of an attack in batches."""
    sent = 0
    for frames in hostile.batches(rows, batch):
        yield hostile.dated(frames, sent)
        sent += len(frames)
        if sent >= count:
            return


def receive(batches: Iterator[Frames], target: Path | None, monkeypatch: pytest.MonkeyPatch) -> Reception:
    """Receive to the end, looked after at each batch."""
    monkeypatch.setattr("aeolid.can.reception.LOOK_S", 0.0)
    innovations = None if target is None else target.parent
    reception = Reception(Given(batches), RunRecorder(target, innovations=innovations), bit_rate=1e6, data_bit_rate=1e6)
    reception.run(lambda: False, None, False)
    for number in reception.recorder.runs:
        reception.recorder.name(number, f"-node{number}")
    return reception


@pytest.mark.parametrize("attack", hostile.ATTACKS)
def test_each_attack_stays_within_the_limits(attack: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes held, files, rows without a value: none grows with what a device claims."""
    reception = receive(first(hostile.ATTACKS[attack](), COUNT), tmp_path / "r.csv", monkeypatch)
    assert reception.fault is None
    assert reception.memory.peak <= 64 << 20 <= limits.TOTAL_BYTES
    assert all(node.nbytes <= limits.NODE_BYTES for node in reception.assembly.nodes.values())
    files = list(tmp_path.glob("*.csv"))
    assert not list(tmp_path.glob("*.part*")) and len(files) <= (253 if attack == "all numbers" else 70)
    assert sum(file.stat().st_size for file in files) < 2_000_000
    for runs in reception.recorder.runs.values():
        assert all(run.rows - run.found <= limits.FILL_FREE + run.found for run in runs)
        assert all(run.found >= limits.RUN_LEAST for run in runs[:-1])


def test_an_honest_node_among_all_attacks_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every sample and every snapshot of it is there, bit for bit, and memory stays small."""
    reception = receive(first(hostile.interleaved(0.2), 6000), tmp_path / "r.csv", monkeypatch)
    assert reception.memory.peak < 40_000_000
    table = np.loadtxt(tmp_path / f"r-node{hostile.HONEST}.csv", delimiter=",", skiprows=1)
    index = np.round(table[:, 0] / 0.1).astype(int)
    assert index.tolist() == list(range(len(index))) and len(index) > 100
    np.testing.assert_array_equal(table[:, 1:], index[:, None] + np.arange(hostile.CHANNELS) / 8)
    node = reception.assembly.nodes[hostile.HONEST]
    assert node.now is not None and node.now.snapshots.completed == (len(index) - 1) // 100
    assert (node.contested, node.refused, node.left_out) == ("", "", 0)


def test_frames_one_by_one_cost_no_objects() -> None:
    """Nodes that never describe themselves, a frame a batch: some forty bytes a message, whatever their number."""
    assembly = Assembly()
    frames = next(hostile.batches(hostile.undescribed(), 6000))
    for k in range(len(frames)):
        assembly.feed(frames.take(slice(k, k + 1)))  # type: ignore[arg-type]
    assert assembly.nbytes < 6000 * 60 + 32 * 32 * limits.PART_BYTES
    parts: list[Part] = []
    for k in range(20_000):
        one = np.full(1, k % 256)
        parts.append(Part(one, one.astype(np.uint8), one.astype(np.uint32), one, one.astype(np.uint8)))
        merge_tail(parts, join_parts)
    assert len(parts) <= 2 * limits.LOOSE and sum(map(len, parts)) == 20_000


def test_too_much_of_all_nodes_is_given_up_largest_first() -> None:
    """Beyond the total, those that hold most give up what waits; a small one keeps all."""
    assembly = Assembly()
    big = [(node, wire.SAMPLE, 0, k, k) for node in (1, 2) for k in range(3000)]
    assembly.feed(hostile.encode([*big, *((3, wire.SAMPLE, 0, k, k) for k in range(50))]))
    held = assembly.nbytes
    assert assembly.keep_within(total=held // 2) <= held // 2
    lost = [assembly.nodes[number].early_lost for number in (1, 2, 3)]
    assert sorted(lost) == [0, 0, 3000] or sorted(lost) == [0, 3000, 3000]
    assert lost[2] == 0


def test_a_node_that_describes_itself_for_ever_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """64 configurations, then a sentence, and nothing more is taken."""
    rows = (hostile.description(1, past=65535, r=0, l=1, salt=0.001 * k) for k in range(100))
    reception = receive(first(iter([*rows]), 1400), None, monkeypatch)
    node = reception.assembly.nodes[1]
    assert "anew more than 64 times" in node.refused and node.refused_out > 200
    assert len(node.previous) <= limits.PREVIOUS_KEPT + 8 and node.nbytes < 2_000_000


def test_forged_innovations_fill_no_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Innovations ahead of the samples: the file holds no more rows than the recording."""
    reception = receive(first(hostile.forged_innovations(), 6000), tmp_path / "r.csv", monkeypatch)
    (run,) = reception.recorder.runs[1]
    assert 0 < run._inside <= run.rows
    assert np.isfinite(run.innovations(np.ones(1))[:150]).all()


@pytest.mark.parametrize("attack", ["to and fro, 40", "bursts and leaps", "leaps"])
def test_runs_are_limited(attack: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A node begins so many runs; what comes after is counted, and costs no file."""
    monkeypatch.setattr(runs_module, "RUNS_MAX", 3)
    reception = receive(first(hostile.ATTACKS[attack](), 4 * COUNT), tmp_path / "r.csv", monkeypatch)
    assert len(list(tmp_path.glob("*.csv"))) <= 3
    refused, short = reception.recorder.refused.get(1, [0, 0]), reception.recorder.short.get(1, [0, 0])
    assert refused[0] + short[0] > 3


@pytest.mark.parametrize(
    ("offset", "seal"), [(0, True), (5, True), (17, True), (400, True), (16, False), (30_000, False)]
)
def test_two_nodes_with_one_number_are_told_and_never_mixed(
    offset: int, seal: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In step or far apart, sealed or not: code 3 and a sentence, and no run holds rows of both."""
    log = open_raw_log(tmp_path / "bus.log")
    for frames in first(hostile.twins(offset, seal), 5000):
        log.write(frames)
    log.close()
    assert main(["listen", "--bus", str(log.path), "--record", str(tmp_path / "r.csv"), "--no-modes"]) == 3
    assert "two nodes seem to bear the number 1" in capsys.readouterr().err
    for file in tmp_path.glob("r*.csv"):
        values = np.genfromtxt(file, delimiter=",", skip_header=1).reshape(-1, 3)[:, 1]
        assert len({*values[np.isfinite(values)].tolist()}) <= 1, file


def test_a_quick_restart_is_no_twin(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A node restarted after 10 samples, and again after 3000: no word of two nodes, and both runs are there."""
    log, rows = open_raw_log(tmp_path / "bus.log"), []
    for count, value in ((10, 1.0), (3000, 2.0), (500, 3.0)):
        rows += hostile.description(1, r=1, l=1)
        rows += [r for k in range(count) for r in [*hostile.sample(1, k, [value, k]), (1, wire.HEALTH, 0, 0, k)]]
    log.write(hostile.dated(hostile.encode([*rows, *[(1, wire.HEALTH, 0, wire.STOPPED, 500)] * 2]), 0))
    log.close()
    assert main(["listen", "--bus", str(log.path), "--record", str(tmp_path / "r.csv"), "--no-modes"]) == 0
    assert "two nodes" not in capsys.readouterr().out
    assert [len(f.read_text().splitlines()) for f in sorted(tmp_path.glob("r-run*.csv"))] == [2991, 501]


def test_a_restart_among_strays_is_followed() -> None:
    """Random indices between its samples: the new count is found, the strays come to nothing."""
    generator, counts, found = np.random.default_rng(1), Counts(1, 1000), 0
    for k in [*range(30_000, 30_300), *range(300)]:
        for index in (k, (k + int(generator.integers(100, 65_000))) % 65_536):
            one = np.array([index], np.int64)
            part = Part(one, np.zeros(1, np.uint8), np.zeros(1, np.uint32), one, np.full(1, VALUE, np.uint8))
            for owner, mine in counts.sort(part):
                owner.parts.append(mine)
                found += len(mine)
    assert len(counts.believed) == 2 and counts.contested == 0
    assert (counts.believed[1].first, counts.believed[1].last) == (0, 299)


@pytest.mark.parametrize("suffix", RAW_SUFFIXES)
def test_no_true_frame_is_taken_for_garbled_text(suffix: str, tmp_path: Path) -> None:
    """A remote frame of the highest identifier comes back as what it is, and the mark as the mark; ASC, BLF, …"""
    flags = [REMOTE | EXTENDED, GARBLED, REMOTE | EXTENDED, ERROR, REMOTE | EXTENDED]
    ids = [MARKER, 0, MARKER - 1, 0, MARKER]
    rows = [(i, True, b"") for i in ids]
    frames = pack_frames(rows, flags=flags, times_s=[1.79e9 + 1e-3 * k for k in range(len(rows))])
    log = open_raw_log(tmp_path / f"bus{suffix}")
    log.write(frames)
    log.close()
    source, parts = open_log(str(log.path)), []
    while source.ended is None:
        parts.append(source.read(0.0))
    found = join_frames(parts)
    assert found.flags.tolist() == flags and found.id.tolist() == ids


def test_the_mark_of_older_logs_is_still_read() -> None:
    """On the first channel the frame means what it meant; on another bus's channel it is a frame."""
    from can import Message

    def flag(channel: object) -> int:
        message = Message(arbitration_id=MARKER, is_extended_id=True, is_remote_frame=True, channel=channel)  # type: ignore[arg-type]
        return int(pack_messages([message]).flags[0])

    assert flag(0) == flag("vcan0") == flag(None) == GARBLED
    assert flag("can0") == flag(3) == REMOTE | EXTENDED


def test_the_end_of_memory_ends_as_a_full_disk_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was received until then is in the file; the reason is one sentence."""
    true, calls = Assembly.feed, []

    def feed(self: Assembly, frames: Frames) -> None:
        calls.append(1)
        if len(calls) > 8:
            raise MemoryError
        true(self, frames)

    monkeypatch.setattr(Assembly, "feed", feed)
    reception = receive(first(hostile.honest(), 5000), tmp_path / "r.csv", monkeypatch)
    assert reception.fault is not None and "no memory is left" in reception.fault
    (run,) = reception.recorder.runs[hostile.HONEST]
    table = np.loadtxt(tmp_path / f"r-node{hostile.HONEST}.csv", delimiter=",", skiprows=1)
    assert len(table) == run.rows > 200


def test_modes_of_long_windows_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A filter of 16,000 regressors is recorded and its modes are not followed; one of 150 is."""
    assembly = Assembly()
    for node, past in ((1, 8000), (2, 65_535 // 2), (3, 50)):
        assembly.feed(hostile.encode(hostile.description(node, r=1, l=1, past=past)))
    problems = []
    for number in (1, 2, 3):
        now = assembly.nodes[number].now
        assert isinstance(now, Configuration)
        problems.append(listen_rules.find_problem(now))
    assert "16000 regressors" in problems[0] and problems[1] and not problems[2]


def test_quiet_stretches_are_added_at_the_end() -> None:
    """Merging only what is new gives the stretches that merging everything gives."""
    generator, garbling, places = np.random.default_rng(3), Garbling(), []
    for k in range(200):
        new = 5000 * k + generator.integers(-9000, 5000, 3)
        places.append(new)
        garbling.add(np.sort(new))
    whole = Garbling()
    whole.add(np.sort(np.concatenate(places)))
    probe = generator.integers(-9000, 1_100_000, 4000)
    np.testing.assert_array_equal(garbling.is_quiet(probe, probe + 3), whole.is_quiet(probe, probe + 3))


def test_rows_that_may_change_are_on_the_disk_and_never_torn(tmp_path: Path) -> None:
    """Whatever is shown, taken back and made final: the file is what it should be, and a cut line is left out."""
    generator, final = np.random.default_rng(2), np.zeros((0, 3))
    path = tmp_path / "r.part.csv"
    spool = TextSpool(path, b"t,a,b\n")
    for _ in range(60):
        rows = generator.integers(0, 1000, (int(generator.integers(0, 300)), 3)) / 7
        rows[generator.random(rows.shape) < 0.1] = np.nan
        at = int(generator.integers(0, len(rows) + 1))
        spool.append(rows[:at])
        final = np.vstack([final, rows[:at]])
        spool.show(rows[at:])
        read = np.vstack([np.zeros((0, 3)), *read_spool(path, ("t", "a", "b"))])
        np.testing.assert_array_equal(read, np.vstack([final, rows[at:]]))
    spool.close()
    np.testing.assert_array_equal(np.vstack([np.zeros((0, 3)), *read_spool(path, ("t", "a", "b"))]), final)
    text = path.read_bytes()
    for cut in (len(text) - 1, len(text) - 5, len(text)):
        path.write_bytes(text[:cut])
        with whole_lines(path) as handle:
            assert handle.read() == text[: text[:cut].rfind(b"\n") + 1]


@pytest.mark.parametrize("kind", ["csv", "mf4", "blf"])
def test_a_killed_reception_leaves_what_had_arrived(kind: str, tmp_path: Path) -> None:
    """SIGKILL at a drawn moment: all samples that a look had seen are there (tests/soak/kill.py: a hundred moments)."""
    import kill

    assert kill.kill_once(kind, tmp_path, random.Random(len(kind))) == ""
