"""The receiving side alone: losses of every kind, forged and random input, restarts, wraps, logs."""

from __future__ import annotations

from pathlib import Path

import can
import numpy as np
import pytest
from can_frames import COUNT, L, P, R, bits, describe, latest, receive, row, samples, snapshot, stopped
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.can import Assembly, build_records, open_source, read_log, wire
from aeolid.can.description import CHANNELS_MAX
from aeolid.can.limits import EARLY_MAX, NODES_MAX
from aeolid.can.repair import group_members, repair_sets, restore
from aeolid.can.slcan import parse
from aeolid.can.snapshots import physical
from aeolid.errors import DataError, UsageError
from aeolid.formats import read_record
from aeolid.record import Roles

pytestmark = pytest.mark.usefixtures("forking_throughout")

THETA = np.random.default_rng(3).standard_normal(COUNT)


@pytest.mark.parametrize("batch", [1, 7, 10**9])
def test_whole_stream_in_any_batches(batch: int) -> None:
    """The cut into batches changes nothing."""
    rows = [*describe(), *samples(0, 50), *snapshot(THETA), *samples(50, 30), stopped(79)]
    assembly = receive(rows, batch)
    ((record, lost),) = build_records(assembly.nodes[1], "test")
    assert lost == 0 and record.values.shape == (80, 5)
    np.testing.assert_array_equal(record.values[:, 2], np.arange(80) + 2 / 8)
    np.testing.assert_allclose(record.time_s, 0.1 * np.arange(80), atol=1e-12)
    assert record.names("input") == ("a", "b") and record.names("output") == ("y1", "y2", "y3")
    now = latest(assembly)
    assert now.complete and now.sample_index == 77 and now.repaired == 0
    assert now.theta_scaled.ravel().tolist() == THETA.astype(np.float32).tolist()
    assert assembly.all_stopped()


def test_scaling_is_undone_as_the_regressor_did_it() -> None:
    """y = theta z in scaled units is the same statement as Y = Theta Z in the channels' units."""
    assembly = receive([*describe(), *snapshot(THETA)])
    description = latest(assembly).description
    scaled = THETA.reshape(L, -1)
    generator = np.random.default_rng(1)
    block = generator.standard_normal((P, R + L))  # channel units, deviations from the offsets
    scale = np.array((1, 10, np.float32(0.1), 2, 5), float)
    y_scaled = scaled @ (block / scale).ravel()
    np.testing.assert_allclose(physical(scaled, description) @ block.ravel(), y_scaled * scale[R:], rtol=1e-12)


def test_any_single_frame_may_be_lost() -> None:
    """Each frame lost in turn: the snapshot stays whole and true (description frames: it comes later)."""
    head, body = describe(), snapshot(THETA)
    for k in range(len(body)):
        assembly = receive([*head, *samples(70, 8), *body[:k], *body[k + 1 :]])
        now = latest(assembly)
        assert now.complete and now.sample_index == 77, k
        assert now.theta_scaled.ravel().tolist() == THETA.astype(np.float32).tolist()
    for k in range(len(head)):
        broken = [*head[:k], *head[k + 1 :]]
        assert receive([*broken, *body]).nodes[1].now is None
        later = receive([*broken, *samples(0, 3), *body, *head, *samples(3, 2)])
        assert latest(later).complete
        assert len(build_records(later.nodes[1], "test")[0][0]) == 5  # what came before the description is not lost


@settings(max_examples=200, deadline=None)
@given(lost=st.lists(st.integers(0, 200), max_size=60), seed=st.integers(0, 2**32 - 1))
def test_no_loss_ever_makes_a_false_parameter(lost: list[int], seed: int) -> None:
    """Whatever is lost or doubled, a parameter is the true one or missing, and complete means all of them."""
    body = snapshot(THETA)
    kept = [frame for k, frame in enumerate(body) if k not in lost]
    np.random.default_rng(seed).shuffle(kept[1:])  # type: ignore[arg-type]
    assembly = receive([*describe(), *kept, *kept[:5]])
    now = assembly.nodes[1].now
    assert now is not None
    if now.snapshots.latest is None:
        return
    found, true = now.snapshots.latest.theta_scaled.ravel(), THETA.astype(np.float32)
    there = np.isfinite(found)
    assert (found[there] == true[there]).all()
    assert set(np.flatnonzero(~there)) == set(now.snapshots.latest.missing)
    assert not now.snapshots.latest.complete or there.all()


def test_wrong_bits_and_digits_are_refused() -> None:
    """Each wrong bit of data, kind and base, and each character that is no digit: no message, one more in the count."""
    identifier, _, data = samples(9, 1)[0]
    for bit in range(64):
        wrong = bytes(byte ^ (1 << bit % 8 if at == bit // 8 else 0) for at, byte in enumerate(data))
        decoded = wire.decode(wire.pack_frames([(identifier, True, wrong)]))
        assert (len(decoded), decoded.damaged) == (0, 1)
    for bit in range(8, 29):
        decoded = wire.decode(wire.pack_frames([(identifier ^ 1 << bit, True, data)]))
        assert len(decoded) == 0 and decoded.damaged + decoded.foreign == 1
    line = b"T%08X8%s" % (identifier, data.hex().upper().encode())
    assert len(parse(line + b"\r")[0]) == 1
    for at in range(len(line)):
        frames, _ = parse(line[:at] + b"G" + line[at + 1 :] + b"\r" + line + b"\r")
        assert (len(frames), frames.garbled) == (1, 1)


def test_wrong_parameter_that_passes_its_check_is_caught_by_the_crc() -> None:
    """A forged parameter makes the snapshot damaged, not complete."""
    body = snapshot(THETA, repairs=0)
    at = next(k for k, (_, _, data) in enumerate(body) if k and data[1] == 9)
    body[at] = row(1, wire.PARAMETER, 1, 9, bits(123.0))
    now = receive([*describe(), *body]).nodes[1].now
    assert now is not None and (now.snapshots.completed, now.snapshots.damaged) == (0, 1)
    assert now.snapshots.latest is not None and not now.snapshots.latest.complete


def test_incomplete_snapshot_names_what_is_missing() -> None:
    """Without repair frames the missing indices are told, and the next snapshot brings them."""
    body = snapshot(THETA, repairs=0)
    kept = [f for f in body if not (f[0] & 0xFF00 == 0x4500 and f[2][1] in (3, 40))]
    assembly = receive([*describe(), *kept])
    now = latest(assembly)
    assert not now.complete and now.missing == (3, 40)
    assert np.isnan(now.theta_scaled.ravel()[[3, 40]]).all() and np.isnan(now.theta.ravel()[[3, 40]]).all()
    again = receive([*describe(), *kept, *snapshot(THETA + 1, number=2)])
    assert latest(again).complete


def test_samples_wrap_restart_and_fall_silent() -> None:
    """16 bits of index: they wrap unseen; a restart begins a second run; health dates a long silence."""
    ((record, lost),) = build_records(receive([*describe(), *samples(65000, 1000)]).nodes[1], "t")
    assert lost == 0 and len(record) == 1000
    restarted = receive([*describe(), *samples(3000, 50), *describe(), *samples(0, 40)])
    runs = build_records(restarted.nodes[1], "t")
    assert [len(r) for r, _ in runs] == [50, 40] and runs[1][0].time_s[0] == 0
    told = [row(1, wire.HEALTH, 0, 0, 70_049)]
    silent = receive([*describe(), *samples(100, 5000), row(1, wire.HEALTH, 0, 0, 5099), *samples(70_000, 50), *told])
    ((record, lost),) = build_records(silent.nodes[1], "t")
    assert len(record) == 70_050 - 100 and lost == (70_000 - 5100) * 5
    np.testing.assert_array_equal(record.values[-1], 70_049 + np.arange(5) / 8)


def test_every_kth_sample_makes_a_slower_recording() -> None:
    """sample_every = 4: rows are 0.4 s apart and none is missing."""
    ((record, lost),) = build_records(receive([*describe(every=4), *samples(0, 30, every=4)]).nodes[1], "t")
    assert (len(record), lost, record.sample_time_s) == (30, 0, 0.4)
    np.testing.assert_allclose(np.diff(record.time_s), 0.4)


def test_new_configuration_starts_anew() -> None:
    """A node restarted with another past window: both runs are kept apart, early frames wait for the description."""
    first = [*describe(), *samples(0, 20), *snapshot(THETA)]
    second = [*describe(past=2), *samples(0, 10), *snapshot(THETA[: L * 2 * (R + L)], number=1)]
    for batch in (3, 10**9):
        node = receive([*first, *second], batch).nodes[1]
        assert [len(r) for r, _ in build_records(node, "t")] == [20, 10]
        assert [c.snapshots.completed for c in node.configurations()] == [1, 1]
        assert node.now is not None and node.now.description.past == 2


def test_unknown_wire_version_is_said_and_not_guessed() -> None:
    """Nothing of another version is decoded; a node of the known version beside it is."""
    assembly = receive([*describe(version=3), *samples(0, 5), *snapshot(THETA), *describe(2), *samples(0, 5, node=2)])
    assert assembly.nodes[1].problem == "speaks wire version 3; this tool reads versions 1 and 2"
    assert assembly.nodes[1].now is None and build_records(assembly.nodes[1], "t") == []
    assert len(build_records(assembly.nodes[2], "t")[0][0]) == 5


@pytest.mark.parametrize(
    ("forged", "words"),
    [
        ({"parameters": 59}, "parameters for 3 outputs"),
        ({"parameters": 63}, "regressors where"),
        ({"parameters": 2**32 - 1}, "4294967295 parameters"),
        ({"shape": 255 | 255 << 8 | 255 << 16 | 1 << 24}, "765 channels"),
        ({"shape": R}, "0 outputs"),
        ({"scales": (1.0, float("nan"), 1.0, 1.0, 1.0)}, "scale"),
        ({"scales": (1.0, 0.0, 1.0, 1.0, 1.0)}, "scale"),
        ({"sample_time": float("inf")}, "sample time"),
    ],
)
def test_forged_descriptions_are_refused(forged: dict[str, object], words: str) -> None:
    """A description that cannot be is told, and costs no memory."""
    assembly = receive([*describe(**forged), *samples(0, 5)])  # type: ignore[arg-type]
    assert assembly.nodes[1].now is None and words in (assembly.nodes[1].problem or "")


def test_floods_are_bounded() -> None:
    """Every node number, endless early frames, endless repair numbers: memory stays within its limits."""
    flood = [row(node, wire.SAMPLE, 0, k, 0) for node in range(254) for k in range(3)]
    assert len(receive(flood).nodes) == NODES_MAX
    one = wire.pack_frames([row(1, wire.SAMPLE, 0, k & 0xFFFF, 0) for k in range(1000)])
    assembly = Assembly()
    for _ in range(EARLY_MAX // 1000 + 50):
        assembly.feed(one)
    assert assembly.nodes[1].early_lost == 50_000
    assert sum(len(m) for m in assembly.nodes[1]._early) == EARLY_MAX


def test_forged_indices_do_not_blow_up_the_table() -> None:
    """Samples that jump to and fro make runs or gaps, not gigabytes."""
    generator = np.random.default_rng(0)
    jumps = [row(1, wire.SAMPLE, 0, int(k), 0) for k in generator.integers(0, 65536, 3000)]
    steps = [row(1, wire.SAMPLE, 0, 900 * k & 0xFFFF, 0) for k in range(60_000)]
    build_records(receive([*describe(), *jumps]).nodes[1], "t")
    assert sum(len(r) for r, _ in build_records(receive([*describe(), *steps]).nodes[1], "t")) < 10_000_000


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 2047), st.binary(min_size=8, max_size=8)), max_size=80), st.booleans())
def test_random_frames_never_crash(rows: list[tuple[int, bytes]], described: bool) -> None:
    """Random bytes under our identifiers, with right checks, on a described or unknown node."""
    frames = []
    for offset, data in rows:
        kind, node = offset >> 8, offset & 0xFF
        value = int.from_bytes(data[4:], "little")
        frames.append(row(node % 3, kind, data[0], int.from_bytes(data[1:3], "little"), value))
    assembly = receive([*(describe(0) if described else []), *frames], 17)
    for node in assembly.nodes.values():
        build_records(node, "t")


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=400))
def test_random_text_never_crashes(text: bytes) -> None:
    """Any bytes on a serial line."""
    frames, rest = parse(text)
    assert len(rest) <= 512
    receive([])
    Assembly().feed(frames)


@settings(max_examples=100, deadline=None)
@given(cut=st.lists(st.integers(1, 60), max_size=40), noise=st.binary(max_size=30))
def test_text_in_any_pieces(cut: list[int], noise: bytes) -> None:
    """Frames come out the same wherever the reads cut the text; a garbled line costs itself alone."""
    rows = samples(0, 4)
    text = b"".join(b"T%08X8%s\r" % (i, d.hex().upper().encode()) for i, _, d in rows)
    text = text[: 27 * 7] + noise.replace(b"\r", b"").replace(b"\a", b"") + b"\r" + text[27 * 7 :]
    got: list[int] = []
    rest = b""
    position = 0
    for length in [*cut, len(text)]:
        frames, rest = parse(rest + text[position : position + length])
        got += frames.id.tolist()
        position += length
    assert got == [i for i, _, _ in rows]


def test_all_frame_letters_are_read() -> None:
    """11-bit, short, CAN FD with and without fast data phase; remote frames are left out, a wrong line is counted."""
    text = b"t1232AABB\rT1CFF4201201FF\rd12391122334455667788AABBCCDD\rB1CFF42019112233445566778811223344\r"
    text += b"r1238\rq\rz\r\r"
    frames, rest = parse(text)
    assert rest == b"" and frames.garbled == 1
    assert frames.id.tolist() == [0x123, 0x1CFF4201, 0x123, 0x1CFF4201] and frames.length.tolist() == [2, 2, 12, 12]
    assert frames.flags.tolist() == [0, wire.EXTENDED, wire.FD, wire.EXTENDED | wire.FD | wire.FAST]
    assert bytes(frames.data[2, :13]) == bytes.fromhex("1122334455667788AABBCCDD00")


@pytest.mark.parametrize("suffix", [".blf", ".asc", ".log", ".mf4"])
def test_can_logs_are_recordings(suffix: str, tmp_path: Path) -> None:
    """A log written by python-can is read as a recording through the roles file."""
    path = tmp_path / f"bus{suffix}"
    with can.Logger(str(path)) as logger:
        for k, (identifier, _, data) in enumerate([*describe(), *samples(0, 40), *snapshot(THETA)]):
            logger(can.Message(timestamp=1e-3 * k, arbitration_id=identifier, data=data, is_extended_id=True))
    columns, units = read_log(path)
    assert list(columns) == ["time_s", "a", "b", "y1", "y2", "y3"] and units["time_s"] == "s"
    np.testing.assert_array_equal(columns["b"], np.arange(40) + 1 / 8)
    (tmp_path / "roles.toml").write_text(
        '[[channel]]\nname = "pitch"\ncolumn = "a"\nunit = ""\nrole = "input"\n'
        '[[channel]]\nname = "y2"\nunit = ""\nrole = "output"\n'
    )
    record = read_record(path, Roles.load(tmp_path / "roles.toml"))
    assert record.values.shape == (40, 2) and record.sample_time_s == pytest.approx(0.1)


def test_bad_logs_and_buses_are_told(tmp_path: Path) -> None:
    """Empty, foreign and damaged logs, unknown interfaces: the class of error that carries the exit code."""
    empty, foreign, broken = tmp_path / "empty.blf", tmp_path / "foreign.asc", tmp_path / "broken.blf"
    empty.write_bytes(b"")
    with can.Logger(str(foreign)) as logger:
        logger(can.Message(timestamp=1.0, arbitration_id=0x123, data=b"abc"))
    broken.write_bytes(b"LOGG" + bytes(500))
    for path in (empty, foreign, broken, tmp_path / "missing.log"):
        with pytest.raises(DataError, match=path.name):
            read_log(path)
    for text in ("can0", "nosuch:can0", "virtual:x?y"):
        with pytest.raises(UsageError):
            open_source(text)


def test_stock_interfaces_are_read_too() -> None:
    """Any python-can interface serves: here the virtual one."""
    source = open_source("virtual:aeolid-test?receive_own_messages=false")
    sender = can.Bus(interface="virtual", channel="aeolid-test")
    for identifier, _, data in [*describe(), *samples(0, 20)]:
        sender.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=True))
    assembly = Assembly()
    while assembly.frames < len(describe()) + 100:
        frames = source.read(1.0)
        assert len(frames)
        assembly.feed(frames)
    source.close()
    sender.shutdown()
    assert len(build_records(assembly.nodes[1], "t")[0][0]) == 20


def test_channel_limit_is_that_of_the_library() -> None:
    """Host and C agree on the number of channels."""
    header = (Path(__file__).resolve().parents[2] / "include/aeolid/stream.h").read_text()
    assert f"#define AEO_STREAM_CHANNELS_MAX {CHANNELS_MAX}\n" in header


def test_undetermined_parameters_stay_missing() -> None:
    """Fewer repair frames than losses: what they do not determine is not invented."""
    generator = np.random.default_rng(2)
    truth = generator.integers(0, 2**32, 200, dtype=np.uint64).astype(np.uint32)
    member = group_members(200)[0]
    for repairs in range(30):
        have = np.ones(200, bool)
        have[generator.choice(200, 20, replace=False)] = False
        sets = {k: repair_sets(np.array([k]), 200)[0] for k in range(repairs)}
        combined = {k: int(np.bitwise_xor.reduce(truth[member][s])) for k, s in sets.items()}
        values = np.where(have, truth, np.uint32(0))[:, None]
        restore(values, have, {k: np.array([v], np.uint32) for k, v in combined.items()})
        assert (values[have, 0] == truth[have]).all()
        assert have.all() or repairs < 26
