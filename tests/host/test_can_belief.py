"""What the receiver believes: sealed samples anywhere, all else near nothing garbled or with something that agrees."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
import pytest
from can_frames import COUNT, L, R, Row, bits, describe, latest, receive, row, samples, snapshot, stopped
from hypothesis import example, given, settings
from hypothesis import strategies as st
from stream_rig import Rig
from stream_rig import settings as rig_settings

from aeolid.can import Assembly, build_records, wire
from aeolid.can.garbling import MARGIN, Garbling
from aeolid.can.limits import EARLY_MAX, NODES_MAX
from aeolid.can.raw_log import open_raw_log
from aeolid.can.recorder import read_log
from aeolid.errors import DataError

THETA = np.random.default_rng(3).standard_normal(COUNT)
FOREIGN: Row = (0x123, False, b"abc")


def damaged(node: int = 1) -> Row:
    """Build a frame whose check is wrong."""
    identifier, extended, data = row(node, wire.SAMPLE, 0, 0, 0)
    return identifier, extended, data[:3] + bytes([data[3] ^ 1]) + data[4:]


def forge(rows: list[Row], at: int, value: int) -> list[Row]:
    """Give one frame another value and a right CRC-8, as garbling that slips past it does."""
    identifier, _, data = rows[at]
    kind = identifier - wire.BASE >> 8
    wrong = row(identifier & 0xFF, kind, data[0], int.from_bytes(data[1:3], "little"), value)
    return [*rows[:at], wrong, *rows[at + 1 :]]


def values(assembly: Assembly) -> np.ndarray:
    """Return the one recording of node 1."""
    ((record, _),) = build_records(assembly.nodes[1], "t")
    return record.values


def test_a_sample_whose_seal_does_not_fit_is_rejected_whole() -> None:
    """One wrong value: the whole sample is missing, its neighbours are not, and it is counted."""
    rows = samples(0, 30)
    found = receive([*describe(), *forge(rows, 6 * 10 + 2, bits(99.0))])
    table = values(found)
    assert np.isnan(table[10]).all() and np.isfinite(np.delete(table, 10, 0)).all()
    now = found.nodes[1].now
    assert now is not None and [t.rejected for t in now.samples.tables(1)] == [1]


@pytest.mark.parametrize("lost", [2, 5], ids=["channel", "seal"])
def test_unsealed_samples_are_believed_on_a_quiet_bus_only(lost: int) -> None:
    """A channel or the seal lost: the rest counts, unless something was garbled within 4096 frames before or after."""
    rows = samples(0, 30)
    kept = [*rows[: 60 + lost], *rows[61 + lost :]]
    there = np.isfinite(values(receive([*describe(), *kept]))[10])
    assert there.tolist() == [c != lost for c in range(5)]
    gap = [FOREIGN] * (MARGIN - 200)
    for broken in ([damaged(), *gap, *describe(), *kept], [*describe(), *kept, *gap, damaged()]):
        table = values(receive(broken))
        assert np.isnan(table[10]).all() and np.isfinite(np.delete(table, 10, 0)).all()
    far = [FOREIGN] * (MARGIN + 200)
    table = values(receive([damaged(), *far, *describe(), *kept, *far, damaged()]))
    assert np.isfinite(table[10]).any()


def test_a_stream_without_seals_is_believed_between_garbled_stretches() -> None:
    """Version 1, or seals turned off: what lies near garbling is missing, the rest is there."""
    rows = samples(0, 4000, seal=False)
    table = values(receive([*describe(version=1), *rows[:10_000], damaged(), *rows[10_000:]]))
    doubted = np.isnan(table).all(axis=1)
    near = np.abs(np.arange(4000) - 2000) * 5 <= MARGIN + 10
    assert (doubted <= near).all() and np.count_nonzero(doubted) >= 2 * MARGIN / 5 - 4
    assert np.isfinite(table[~doubted]).all()


def test_garbled_lines_throw_doubt_too() -> None:
    """A line that is no frame counts like a damaged one."""
    rows = samples(0, 30)
    assembly = Assembly()
    assembly.feed(wire.pack_frames([*describe(), *rows[:62], *rows[63:]], garbled=1))
    assembly.close()
    assert np.isnan(values(assembly)[10]).all()


def test_a_stray_of_another_node_is_left_out() -> None:
    """A frame whose node was garbled passes every check: alone in another node's count it is not believed."""
    rows = samples(500, 40)
    for index in (9_000, 505, 512, 530, 300, 900):
        stray = row(1, wire.SAMPLE, 0, index, bits(1e6))
        table = values(receive([*describe(), *rows[:60], stray, *rows[60:]]))
        assert len(table) == 40 and not (table == 1e6).any() and np.isnan(table).all(axis=1).sum() <= 1


def test_one_wrong_full_index_shifts_nothing() -> None:
    """Samples without seals: a single wrong index in health is outvoted; seals need none at all."""
    for seal in (False, True):
        rows = samples(70_000, 60, seal=seal)
        part = len(rows) // 4
        good = [row(1, wire.HEALTH, 0, 0, 70_000 + k) for k in (14, 29, 44)]
        wrong = row(1, wire.HEALTH, 0, 0, 70_014 + (5 << 16))
        told = [good[0], wrong, good[1], good[2]]
        stream = [frame for k in range(4) for frame in [*rows[part * k : part * (k + 1)], told[k]]]
        ((record, _),) = build_records(receive([*describe(), *stream]).nodes[1], "t")
        assert record.time_s[0] == pytest.approx(7000.0)
    ((record, _),) = build_records(receive([*describe(), *samples(200_000, 20)]).nodes[1], "t")
    assert record.time_s[0] == pytest.approx(20_000.0)


def test_undated_samples_are_not_delivered_from_a_garbled_bus() -> None:
    """On CAN FD samples prove themselves but for the upper half of their index."""
    rows = [(*wire.encode_fd(1, wire.SAMPLE_FD, 0, k & 0xFFFF, [bits(k)] * 5), True) for k in range(70_000, 70_040)]
    frames = [(identifier, extended, data) for identifier, data, extended in rows]
    shape = R | L << 8 | 14 << 24
    assert len(values(receive([*describe(shape=shape), *frames]))) == 40
    assert build_records(receive([*describe(shape=shape), *frames, damaged()]).nodes[1], "t") == []
    told = [row(1, wire.HEALTH, 0, 0, 70_000 + k) for k in (19, 39)]
    dated = receive([*describe(shape=shape), *frames[:20], told[0], *frames[20:], told[1], damaged()])
    ((record, _),) = build_records(dated.nodes[1], "t")
    assert len(record) == 40 and record.time_s[0] == pytest.approx(7000.0)


def test_a_garbled_head_of_a_description_costs_nothing() -> None:
    """Another hash or version, past its check: what follows waits until the description in force is heard again."""
    for version, code in ((2, 12345), (7, 12345)):
        head = row(1, wire.DESCRIPTION, 0, version, code)
        body = snapshot(THETA)
        stream = [*describe(), *samples(0, 20), *body[:30], head, *body[30:], *samples(20, 20)]
        assembly = receive([*stream, damaged(), *describe(), *samples(40, 5)])
        assert len(values(assembly)) == 45 and latest(assembly).complete
        assert len(assembly.nodes[1].configurations()) == 1


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
@example(seed=12992941)  # four wrong indices of one item came before the true one
def test_garbled_parts_of_a_description_are_outvoted(seed: int) -> None:
    """Parts with wrong values or indices that passed the CRC-8: after a few repetitions the description is there."""
    generator = np.random.default_rng(seed)
    stream: list[Row] = []
    for _ in range(8):
        rows = describe()
        for at in generator.integers(0, len(rows), 2).tolist():
            data = rows[at][2]
            wrong = row(1, wire.DESCRIPTION, data[0], int(generator.integers(64)), int(generator.integers(2**32)))
            rows[at] = rows[at] if data[0] == 0 else wrong
        stream += rows
    now = receive(stream).nodes[1].now
    assert now is not None and now.description.names[:2] == ("a", "b") and now.description.scale[1] == 10


def test_counters_on_a_garbled_bus_need_neighbours() -> None:
    """A wrong value between right ones is passed over; on a quiet bus the newest is told at once."""

    def told(counts: list[int]) -> list[Row]:
        return [row(1, wire.HEALTH, 1, 3, value) for value in counts]

    assert receive([*describe(), *told([10, 20])]).nodes[1].counters == {"Sent": 20}
    assert receive([damaged(), *describe(), *told([10, 20])]).nodes[1].counters == {}
    wrong = receive([damaged(), *describe(), *told([10, 20, 30, 1 << 30, 40, 50])]).nodes[1]
    assert wrong.counters == {"Sent": 20} and wrong.flags == 3
    wrong = receive([damaged(), *describe(), *told([10, 20, 30, 40, 50, 3, 60, 70, 80])]).nodes[1]
    assert wrong.counters == {"Sent": 70}


def test_a_stream_ends_with_two_goodbyes() -> None:
    """One closing message may be garbled: two equal ones end the stream, or one when nothing more comes."""
    assembly = Assembly()
    assembly.feed(wire.pack_frames([*describe(), *samples(0, 5), stopped(4)]))
    assert not assembly.all_stopped()
    assembly.feed(wire.pack_frames([stopped(3)]))
    assert not assembly.all_stopped()
    assembly.feed(wire.pack_frames([stopped(4)]))
    assert assembly.all_stopped()
    assembly.feed(wire.pack_frames([*samples(5, 2), stopped(6)]))
    assert not assembly.all_stopped()
    assembly.close()
    assert assembly.all_stopped()


def test_a_wrong_begin_dates_no_snapshot() -> None:
    """Sample index and size of a snapshot are under its CRC-32 in version 2."""
    body = snapshot(THETA)
    for wrong in (row(1, wire.BEGIN, 1, COUNT - 1, 78), row(1, wire.BEGIN, 1, COUNT - 1, 77 + 65536)):
        found = receive([*describe(), *samples(70, 8), wrong, *body[1:]])
        assert latest(found).complete and latest(found).sample_index == 77
    alone = receive([*describe(), row(1, wire.BEGIN, 1, COUNT - 1, 78), *body[1:]])
    assert not latest(alone).complete


def test_a_parameter_that_came_twice_with_two_values_is_repaired() -> None:
    """Which of the two is right the repair frames tell."""
    body = snapshot(THETA)
    wrong = row(1, wire.PARAMETER, 1, 9, bits(123.0))
    for at in (2, 30, 61):
        now = latest(receive([*describe(), *samples(70, 8), *body[:at], wrong, *body[at:]]))
        assert now.complete and now.theta_scaled.ravel().tolist() == THETA.astype(np.float32).tolist()


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 0x11FF), st.integers(0, 7), st.sampled_from([0, 1, 8, 8, 8, 12, 13, 16, 32, 64]),
                  st.binary(min_size=64, max_size=64)),
        max_size=60,
    ),
    st.booleans(), st.integers(1, 70),
)  # fmt: skip
def test_any_frames_in_any_batches(rows: list[tuple[int, int, int, bytes]], described: bool, batch: int) -> None:
    """Any identifiers near ours, flags, lengths and bytes: no exception, and nothing of it is delivered."""
    stream = wire.pack_frames(
        [(wire.BASE - 0x80 + i, True, data[:n]) for i, _, n, data in rows], flags=[f for _, f, _, _ in rows]
    )
    assembly = Assembly()
    assembly.feed(wire.pack_frames(describe() if described else []))
    for k in range(0, len(stream), batch):
        assembly.feed(stream.take(slice(k, k + batch)))  # type: ignore[arg-type]
    assembly.close()
    for node in assembly.nodes.values():
        build_records(node, "t")
        assert node.latest_complete() is None and isinstance(node.counters, dict)


@settings(max_examples=60, deadline=None)
@given(data=st.data(), fd=st.integers(0, 1))
def test_true_frames_in_any_order(data: st.DataObject, fd: int) -> None:
    """Lost, doubled and shuffled frames of a real stream: whatever is delivered is true."""
    generator = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    rig = Rig(rig_settings(fd=fd, innovations=1))
    truth = generator.standard_normal((80, 3)).astype(np.float32)
    theta = generator.standard_normal(30).astype(np.float32)
    assert rig.snapshot(0, theta) == 0
    rig.run(1, truth, truth[:, :1])
    rig.finish()
    frames = rig.take()
    order = np.arange(len(frames)) + generator.uniform(0, data.draw(st.sampled_from([1.0, 8.0, 1000.0])), len(frames))
    order = np.argsort(order)[generator.random(len(frames)) > data.draw(st.sampled_from([0.0, 0.1, 0.5]))]
    frames = frames.take(np.repeat(order, generator.integers(1, 3, len(order))))
    assembly = Assembly()
    assembly.feed(frames)
    assembly.close()
    for node in assembly.nodes.values():
        for c in node.configurations():
            for table in c.samples.tables(1):
                row_, channel = np.nonzero(np.isfinite(table.values))
                assert (table.values[row_, channel] == truth[table.index[row_] - 1, channel]).all()
            assert c.snapshots.complete is None or c.snapshots.complete.theta_scaled.ravel().tolist() == theta.tolist()


def test_hostile_streams_are_held_in_bounded_memory() -> None:
    """Endless parts, repair numbers, snapshot numbers, indices and nodes: what is kept stays within its limits."""
    generator = np.random.default_rng(0)
    assembly = Assembly()
    assembly.feed(wire.pack_frames(describe()))
    for _ in range(8):
        rows = [
            row(int(node), int(kind), int(tag), int(index), int(value))
            for node, kind, tag, index, value in zip(
                generator.integers(0, 254, 3000), generator.integers(0, 9, 3000), generator.integers(0, 256, 3000),
                generator.integers(0, 65536, 3000), generator.integers(0, 2**32, 3000), strict=True,
            )
        ]  # fmt: skip
        assembly.feed(wire.pack_frames(rows))
    assert len(assembly.nodes) == NODES_MAX
    node = assembly.nodes[1]
    assert node.now is not None and len(node.now.snapshots._open) <= 5
    assert all(len(g._repairs) <= COUNT + 8 for g in node.now.snapshots._open.values())
    assert node._kept <= EARLY_MAX and len(node.previous) == 0
    assert all(len(n._collector._parts) <= 4096 for n in assembly.nodes.values())
    assert len(node._health._goodbyes) <= 8


def test_quiet_stretches_are_found() -> None:
    """Against the rule written out: nothing garbled within 4096 frames of the span."""
    generator = np.random.default_rng(4)
    for _ in range(50):
        garbling, places = Garbling(), []
        for _ in range(int(generator.integers(0, 6))):
            new = generator.integers(0, 100_000, int(generator.integers(0, 4)))
            garbling.add(np.sort(new))
            places += new.tolist()
        first = generator.integers(0, 100_000, 200)
        last = first + generator.integers(0, 50, 200)
        expected = [not any(f - MARGIN <= p <= e + MARGIN for p in places) for f, e in zip(first, last, strict=True)]
        assert garbling.is_quiet(first, last).tolist() == expected


def test_seals_are_those_of_the_header() -> None:
    """The seal in these tests, written by hand with zlib, is what the streamer sends."""
    rig = Rig(rig_settings(inputs=2, outputs=3, parameters=15, innovations=1))
    sample = np.array([[1, 2, 3, 4, 5]], np.float32)
    rig.run(70_000, sample, sample[:, 2:])
    m = wire.decode(rig.take())
    seals = {int(t): int(v) for t, v in zip(m.tag[m.kind == wire.SEAL], m.value[m.kind == wire.SEAL], strict=True)}
    expected = {}
    for tag, part in ((5, sample[0]), (0x83, sample[0, 2:])):
        words = np.array([1 | tag << 8, 70_000, *part.view(np.uint32)], "<u4")
        expected[tag] = zlib.crc32(words.tobytes())
    assert seals == expected


def renamed(lost: str, again: int = 100) -> list[Row]:
    """Build the frames of a node that is set up anew, of whose new description first the head or all is lost."""
    first, second = describe(names=("pitch", "torque")), describe(names=("torque", "pitch"))
    heard = {"nothing": second, "head": second[1:], "all": []}[lost]
    return [*first, *samples(0, 300), *heard, *samples(0, again), *second, *samples(again, 200)]


@pytest.mark.parametrize("batch", [50, 10**9])
@pytest.mark.parametrize("lost", ["nothing", "head", "all"])
def test_what_follows_a_new_count_waits_for_a_head(lost: str, batch: int) -> None:
    """Samples after a restart get the names of the description that comes next, whatever of it was lost."""
    ((first, _), (second, _)) = build_records(receive(renamed(lost), batch).nodes[1], "t")
    assert (tuple(c.name for c in first.channels)[:2], len(first)) == (("pitch", "torque"), 300)
    assert (tuple(c.name for c in second.channels)[:2], len(second)) == (("torque", "pitch"), 300)


def test_a_new_count_under_the_same_description_costs_nothing() -> None:
    """The head in force, or the end of the bus, gives back what waited; nothing waits after a goodbye."""
    for end in ([], describe()[:1]):
        found = receive([*describe(), *samples(0, 300), *samples(0, 100), *end], 40)
        assert [len(record) for record, _ in build_records(found.nodes[1], "t")] == [300, 100]
        assert found.nodes[1].early_lost == 0
    assembly = Assembly()
    rows = [*describe(), *samples(0, 300), *samples(0, 100), stopped(99), stopped(99)]
    for k in range(0, len(rows), 40):
        assembly.feed(wire.pack_frames(rows[k : k + 40]))
    assert assembly.all_stopped()


def test_a_part_that_contradicts_the_description_in_force_opens_a_rumour() -> None:
    """On a quiet bus what follows waits, without a head and without a new count; near garbled frames it does not."""
    parts = [r for r in describe(names=("torque", "pitch"))[1:] if r not in describe(names=("pitch", "torque"))]
    rows = [*describe(names=("pitch", "torque")), *samples(0, 300), parts[0], *samples(300, 100)]
    assert [len(record) for record, _ in build_records(receive(rows, 40).nodes[1], "t")] == [300]
    near = [damaged(), *rows]
    assert [len(record) for record, _ in build_records(receive(near, 40).nodes[1], "t")] == [400]


def test_a_stray_makes_nothing_wait() -> None:
    """One sample of another index amid a count: what follows is there at once."""
    rows = samples(500, 40)
    stray = row(1, wire.SAMPLE, 0, 9, bits(1e6))
    assembly = Assembly()
    assembly.feed(wire.pack_frames([*describe(), *rows[:60], stray, *rows[60:]]))
    now = assembly.nodes[1].now
    assert now is not None and now.samples.last_index() == 539


@pytest.mark.parametrize("wrong", [{"forgetting": np.nan}, {"forgetting": 0.0}, {"forgetting": 1.5},
                                   {"regularisation": np.inf}, {"regularisation": -1.0}])  # fmt: skip
def test_settings_that_cannot_be_are_refused(wrong: dict[str, float]) -> None:
    """A forgetting factor or regularisation that no filter can have is told as the node's problem."""
    node = receive([*describe(**wrong), *samples(0, 30)]).nodes[1]
    assert node.now is None and node.problem is not None and next(iter(wrong)) in node.problem


@pytest.mark.parametrize(("on", "off"), [(15, 16), (15, 20), (10, 20), (8, 40), (1, 30), (20, 20)])
def test_a_bursty_link_costs_only_what_it_loses(on: int, off: int) -> None:
    """Short bursts between holes: every sealed sample that came through is recorded, in one run."""
    rows, sent = describe(), 0
    for k in range(0, 3000, on + off):
        rows += samples(k, on)
        sent += on
    found = receive(rows, 50)
    records = build_records(found.nodes[1], "t")
    assert sum(int(np.isfinite(record.values).all(axis=1).sum()) for record, _ in records) >= sent - 16
    assert len(records) == 1 or on == 1
    assert not found.nodes[1].contested


def test_a_controller_that_starts_again_and_again_is_no_second_node() -> None:
    """Forty boots of different lengths: each is one count; indices of two nodes leap to and fro."""
    rows: list[Row] = []
    for boot in range(40):
        rows += describe()
        for k in range(0, 20 + 10 * (boot % 3), 10):
            rows += [*samples(k, 10), row(1, wire.HEALTH, 0, 0, k + 9)]
    assert receive(rows, 500).nodes[1].contested == ""
    for ahead in (3, 5000):
        health = [row(1, wire.HEALTH, 0, 0, 10 * k + which * ahead) for k in range(40) for which in (1, 0)]
        assert "go to and fro" in receive([*describe(), *health]).nodes[1].contested


@pytest.mark.parametrize("ahead", [0, 5000])
def test_a_log_with_two_nodes_of_one_number_is_refused(ahead: int, tmp_path: Path) -> None:
    """A log is judged as a reception is: no samples of two controllers in one recording without a word."""
    second: list[Row] = []
    for k in range(ahead, ahead + 400):
        patterns = [bits(-k - channel) for channel in range(R + L)]
        second += [row(1, wire.SAMPLE, channel, k & 0xFFFF, value) for channel, value in enumerate(patterns)]
        words = np.array([1 | R + L << 8, k, *patterns], "<u4")
        second.append(row(1, wire.SEAL, R + L, k & 0xFFFF, zlib.crc32(words.tobytes())))
    mine, rows = samples(0, 400), describe()
    for k in range(400):
        rows += [*mine[6 * k : 6 * k + 6], *second[6 * k : 6 * k + 6]]
    path = tmp_path / "twins.log"
    raw = open_raw_log(path)
    raw.write(wire.pack_frames(rows, times_s=[1.7e9 + 1e-3 * k for k in range(len(rows))]))
    raw.close()
    with pytest.raises(DataError, match="two nodes seem to bear the number 1"):
        read_log(path)
