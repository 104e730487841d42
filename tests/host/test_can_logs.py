"""Raw logs in five formats: what is written is read back, replays alike, and says so when it was cut or damaged."""

from __future__ import annotations

import errno
import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
import pytest

from aeolid.can.assembly import Assembly
from aeolid.can.logs import open_log
from aeolid.can.messages import ERROR, GARBLED, PASSIVE, REMOTE, pack_messages, unpack_messages
from aeolid.can.raw_log import RAW_SUFFIXES, open_raw_log
from aeolid.can.recorder import read_log
from aeolid.can.slcan import parse_all
from aeolid.can.wire import EXTENDED, FAST, FD, Frames, join_frames
from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.formats import read_record
from aeolid.formats.spare import SpareFile
from aeolid.record import Roles

STREAM = Path(__file__).resolve().parents[1] / "vectors/wire_v1/stream.log"
pytestmark = pytest.mark.usefixtures("forking_throughout")  # true children: test_confined.py, test_hostile_files.py
SUFFIXES = pytest.mark.parametrize("suffix", RAW_SUFFIXES)
STAMP_S = 2e-6  # text keeps microseconds, and binary64 seconds since 1970 a quarter of one


def traffic(count: int, fd: bool, seed: int = 1) -> Frames:
    """Draw frames of every kind: 11 and 29 bits, all lengths, remote and error frames."""
    generator = np.random.default_rng(seed)
    width = 64 if fd else 8
    length = generator.choice([0, 1, 5, 8, 8, *([12, 20, 48, 64] if fd else [])], count).astype(np.uint8)
    flags = generator.choice([0, EXTENDED], count).astype(np.uint8)
    if fd:
        long = generator.choice([FD, FD | FAST, FD | PASSIVE, FD | FAST | PASSIVE], count)
        flags |= np.where(length > 8, long, 0).astype(np.uint8)
    odd = generator.random(count)
    flags[odd < 0.02] = ERROR
    flags[(odd >= 0.02) & (odd < 0.04)] = REMOTE | EXTENDED
    flags[(odd >= 0.04) & (odd < 0.05)] = GARBLED
    length[odd < 0.05] = 0
    top = np.where(flags & EXTENDED, 1 << 29, 1 << 11)
    ids = np.where(flags & (ERROR | GARBLED), 0, generator.integers(0, top)).astype(np.uint32)
    data = generator.integers(0, 256, (count, width), dtype=np.uint8)
    data[np.arange(width)[None] >= length[:, None]] = 0
    return Frames(ids, flags, length, data, 1.79e9 + 1e-4 * np.arange(count))


def write(path: Path, frames: Frames, batch: int = 777) -> Path:
    """Write a log in batches."""
    log = open_raw_log(path)
    for k in range(0, len(frames), batch):
        log.write(frames.take(np.arange(k, min(k + batch, len(frames)))))
    log.close()
    assert log.frames == len(frames) and not log.full
    return path


def read(path: Path) -> tuple[Frames, str]:
    """Read a log to its end; returns the frames and how it ended."""
    source, parts = open_log(str(path)), []
    while source.ended is None:
        parts.append(source.read(0.0))
    source.close()
    return join_frames(parts), source.ended


def assert_equal(found: Frames, true: Frames) -> None:
    """Compare frames bit for bit, and time stamps as far as text keeps them."""
    for name in ("id", "flags", "length", "data"):
        np.testing.assert_array_equal(getattr(found, name), getattr(true, name), err_msg=name)
    np.testing.assert_allclose(found.time_s - found.time_s[0], true.time_s - true.time_s[0], atol=STAMP_S, rtol=0)


@SUFFIXES
@pytest.mark.parametrize("fd", [False, True], ids=["classic", "fd"])
def test_frames_come_back_bit_for_bit(suffix: str, fd: bool, tmp_path: Path) -> None:
    """Every kind of frame, in order, with its time; more than one part of the formats that are written in parts."""
    frames = traffic(70_000 if suffix in (".parquet", ".mf4") else 9000, fd)
    found, ended = read(write(tmp_path / f"bus{suffix}", frames))
    assert ended == "end of file"
    assert_equal(found, frames)
    assert abs(found.time_s[0] - frames.time_s[0]) < 1e-3  # ASC keeps milliseconds of the start


@SUFFIXES
def test_python_can_and_the_tool_read_each_other(suffix: str, tmp_path: Path) -> None:
    """What the tool writes is what python-can reads, and the other way round."""
    if suffix == ".parquet":
        pytest.skip("python-can has no Parquet")
    frames = traffic(500, fd=True)
    with can.LogReader(write(tmp_path / f"ours{suffix}", frames)) as reader:
        assert_equal(pack_messages(list(reader)), frames)
    with can.Logger(tmp_path / f"theirs{suffix}") as logger:
        for message in unpack_messages(frames):
            logger(message)
    assert_equal(read(tmp_path / f"theirs{suffix}")[0], frames)


@SUFFIXES
def test_a_replay_finds_what_the_stream_held(suffix: str, tmp_path: Path) -> None:
    """The same theta, samples and counts from each format as from the frames themselves; every command reads it."""
    log = tmp_path / f"bus{suffix}"

    def listen(bus: Path, tag: str, *more: object) -> dict[str, object]:
        target, facts = tmp_path / f"{tag}.csv", tmp_path / f"{tag}.json"
        words = ["listen", "--bus", bus, "--record", target, "--markov", tmp_path / f"{tag}.npz", "--json", facts]
        assert main([str(w) for w in (*words, *more)]) == 0
        told: dict[str, object] = json.loads(facts.read_text())
        return told

    first, again = listen(STREAM, "first", "--log", log), listen(log, "again")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "first.csv").read_bytes()
    theta = np.load(tmp_path / "again.npz")["theta_scaled"].astype("<f4")
    assert theta.tobytes() == STREAM.with_name("theta.bin").read_bytes()
    for key in ("frames", "foreign", "damaged", "garbled_lines"):
        assert again[key] == first[key]
    record = read_record(log, Roles.load(tmp_path / "first.roles.toml"))
    truth = read_record(tmp_path / "first.csv", Roles.load(tmp_path / "first.roles.toml"))
    np.testing.assert_array_equal(record.values, truth.values)
    np.testing.assert_array_equal(record.time_s, truth.time_s)


@SUFFIXES
def test_a_log_that_was_cut_says_so(suffix: str, tmp_path: Path) -> None:
    """Cut anywhere: code 3 and one sentence; what came before is delivered where the format allows it."""
    frames = traffic(3000, fd=False)
    whole = write(tmp_path / f"bus{suffix}", frames).read_bytes()
    count = 6 if suffix == ".mf4" else 25  # its reader takes a tenth of a second to refuse
    cuts = [len(whole) - 1, len(whole) - 9, *np.random.default_rng(2).integers(1, len(whole), count).tolist()]
    for size in cuts:
        path = tmp_path / f"cut{suffix}"
        path.write_bytes(whole[:size])
        try:
            found, ended = read(path)
        except DataError as error:
            assert path.name in str(error)
            assert suffix in (".parquet", ".mf4") or size < 400  # these two keep their directory at the end
            continue
        between_lines = suffix == ".log" and whole[size - 1 : size] == b"\n"  # text without an end mark: whole as it is
        assert ended.startswith("damaged: ") != between_lines, (size, ended)
        sound = min(len(found), len(frames)) - 1  # the last one may be cut
        assert (found.id[:sound] == frames.id[:sound]).all()


@pytest.mark.nightly  # by day test_fuzz_readers.py damages logs of every format
@SUFFIXES
def test_damaged_bytes_never_crash(suffix: str, tmp_path: Path) -> None:
    """Wrong bytes within a log: it is read, or refused as damaged; the sentence names the file."""
    whole = write(tmp_path / f"bus{suffix}", traffic(800, fd=True)).read_bytes()
    generator = np.random.default_rng(3)
    for _ in range(10 if suffix == ".mf4" else 40):
        wrong = bytearray(whole)
        for at in generator.integers(0, len(wrong), generator.integers(1, 6)):
            wrong[at] = generator.integers(0, 256)
        path = tmp_path / f"wrong{suffix}"
        path.write_bytes(wrong)
        try:
            _, ended = read(path)
        except DataError as error:
            assert path.name in str(error)
            continue
        assert ended == "end of file" or ended.startswith("damaged: ")


def _unclosed_blf(path: Path) -> str:
    """Leave a log as a killed recorder does: containers, but the header of an empty file."""
    with open(path, "wb") as handle:
        writer = can.BLFWriter(handle)
        for message in unpack_messages(traffic(9000, fd=False)):
            writer.on_message_received(message)
        handle.flush()
    return "never closed"


def _short_data(path: Path) -> str:
    write(path, traffic(50, fd=False))
    lines = path.read_text().splitlines(keepends=True)
    del lines[-1]
    path.write_text("".join(lines))
    return "End TriggerBlock"


def _no_line_end(path: Path) -> str:
    path.write_bytes(STREAM.read_bytes()[:-1])
    return "last line is not ended"


def _no_number(path: Path) -> str:
    lines = STREAM.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:100], "(1.0) can0 what\n", *lines[100:]]))
    return "damaged"


@pytest.mark.parametrize(
    ("name", "spoil"),
    [("a.blf", _unclosed_blf), ("b.asc", _short_data), ("c.log", _no_line_end), ("d.log", _no_number)],
)
def test_each_kind_of_damage_has_its_sentence(
    name: str, spoil: Callable[[Path], str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A killed recorder, a missing end, a cut last line, a line that is none: told, code 3, and the rest is kept."""
    words = spoil(tmp_path / name)
    found, ended = read(tmp_path / name)
    assert len(found) > 40 and words in ended
    with pytest.raises(DataError, match="damaged"):
        read_log(tmp_path / name)  # as a recording it is refused, with the remedy
    if name.endswith(".log"):
        target = tmp_path / "kept.csv"
        assert main(["listen", "--bus", str(tmp_path / name), "--record", str(target)]) == 3
        assert "what came before is kept" in capsys.readouterr().err and target.exists()


def test_files_that_are_no_logs_are_told(tmp_path: Path) -> None:
    """A table as Parquet, an empty file, a missing one, another layout, text under a binary suffix."""
    import pyarrow as pa
    from pyarrow import parquet

    parquet.write_table(pa.table({"time_s": [0.0, 0.1]}), tmp_path / "table.parquet")
    later = pa.schema(
        [("timestamp", pa.int64()), ("id", pa.uint32()), ("flags", pa.uint8()), ("data", pa.binary())],
        metadata={b"aeolid_can_frames": b"2"},
    )
    parquet.write_table(later.empty_table(), tmp_path / "later.parquet")
    (tmp_path / "empty.asc").write_bytes(b"")
    for name in ("text.blf", "text.mf4", "text.parquet"):
        (tmp_path / name).write_text("no log at all\n" * 20)
    wanted = {
        "table.parquet": "no raw CAN frames",
        "later.parquet": "version 2",
        "empty.asc": "empty",
        "none.log": "no such",
    }
    for name, words in {**wanted, "text.blf": "not a CAN log", "text.mf4": "not a", "text.parquet": "not a"}.items():
        with pytest.raises(DataError, match=words) as caught:
            read(tmp_path / name)
        assert name in str(caught.value)
    with pytest.raises(UsageError, match="suffix"):
        open_raw_log(tmp_path / "x.pcap")
    with pytest.raises(UsageError, match="cannot be written"):
        open_raw_log(tmp_path / "nowhere" / "x.blf")


@SUFFIXES
def test_texts_that_were_no_frame_keep_their_place_in_the_log(suffix: str, tmp_path: Path) -> None:
    """Garbled lines are marked where they stood; the replay doubts what the reception doubted."""
    text = b"".join(b"T%08X8%016X\r" % (0x1CFF4207, k) for k in range(100))
    spoilt = text[: 27 * 40] + b"what is this\r" + text[27 * 40 : -9] + b"\r"
    frames, rest = parse_all(spoilt)
    assert rest == b"" and np.flatnonzero(frames.flags & GARBLED).tolist() == [40, 100]
    stamped = replace(frames, time_s=1.79e9 + 1e-3 * np.arange(len(frames)))
    found, _ = read(write(tmp_path / f"bus{suffix}", stamped))
    assert_equal(found, stamped)
    live, replay = Assembly(), Assembly()
    for k in range(0, len(stamped), 30):
        live.feed(stamped.take(np.arange(k, min(k + 30, len(stamped)))))
    replay.feed(found)
    assert (live.garbled, live.foreign) == (replay.garbled, replay.foreign) == (2, 0)


@SUFFIXES
def test_a_full_disk_leaves_a_whole_log(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk is full in the middle: the log says so, is completed in the room kept for it, and reads back whole."""
    import shutil

    room = [200_000]

    class Disk:
        free = 0

    real = SpareFile._write

    def limited(self: SpareFile, data: object) -> int:
        size = len(memoryview(data))  # type: ignore[arg-type]
        if size > room[0] and self._spare is not None:  # giving the kept room back is what makes room
            raise OSError(errno.ENOSPC, "No space left on device")
        room[0] -= size
        return real(self, data)

    monkeypatch.setattr(SpareFile, "_write", limited)
    if suffix == ".mf4":
        monkeypatch.setattr(shutil, "disk_usage", lambda path: Disk)
    frames = traffic(200_000, fd=False)
    log = open_raw_log(tmp_path / f"bus{suffix}")
    taken = 0
    while not log.full:
        log.write(frames.take(np.arange(taken, taken + 1000)))
        taken += 1000
    log.close()
    found, ended = read(log.path)
    assert ended == "end of file" and taken < len(frames)
    assert_equal(found, frames.take(np.arange(taken)))


@pytest.mark.parametrize("suffix", [".trc", ".log.gz", ".asc.gz"])
def test_a_text_that_was_cut_says_so_packed_or_not(suffix: str, tmp_path: Path) -> None:
    """Cut within a line, before it was packed or without packing: the end of the log is no end of file."""
    plain = tmp_path / f"plain{suffix.removesuffix('.gz')}"
    with can.Logger(plain) as logger:
        for message in unpack_messages(traffic(300, fd=False)):
            logger.on_message_received(message)
    whole = plain.read_bytes()
    for text, ends in ((whole, "end of file"), (whole[: len(whole) // 2], ""), (whole[: 2 * len(whole) // 3 - 5], "")):
        if not ends and text.endswith(b"\n"):
            text = text[:-3]
        path = tmp_path / f"bus{suffix}"
        path.write_bytes(gzip.compress(text) if suffix.endswith(".gz") else text)
        assert read(path)[1].startswith(ends or "damaged: "), (suffix, len(text))
