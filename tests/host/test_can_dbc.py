"""The C packer, aeolid.dbc through cantools, and the bulk decoder of the host say the same, bit for bit."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.can import repair, wire
from aeolid.can.crc import TABLE_8, crc_32, solve_second

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("AEO_Health", "AEO_Description", "AEO_Sample", "AEO_Innovation", "AEO_Begin", "AEO_Parameter", "AEO_Repair",
         "AEO_End", "AEO_Seal")  # fmt: skip
FD_NAMES = {10: "AEO_SampleFD", 11: "AEO_InnovationFD", 13: "AEO_ParameterFD", 14: "AEO_RepairFD"}
FD_LENGTHS = (12, 16, 20, 24, 32, 48, 64)
KINDS = st.integers(0, 8)
WORDS = st.one_of(
    st.sampled_from([0, 1, 0x7F800000, 0xFF800000, 0x7FC00001, 0x80000000, 0x00000001, 0x7F7FFFFF, 0xFFFFFFFF]),
    st.integers(0, 2**32 - 1),
)


class Address(ctypes.Structure):
    _fields_ = [("base", ctypes.c_uint32), ("node", ctypes.c_uint8), ("extended", ctypes.c_uint8)]


class Message(ctypes.Structure):
    _fields_ = [
        ("kind", ctypes.c_int),
        ("tag", ctypes.c_uint8),
        ("index", ctypes.c_uint16),
        ("count", ctypes.c_uint8),
        ("value", ctypes.c_uint32 * 14),
    ]


class Frame(ctypes.Structure):
    _fields_ = [
        ("id", ctypes.c_uint32),
        ("length", ctypes.c_uint8),
        ("flags", ctypes.c_uint8),
        ("data", ctypes.c_uint8 * 64),
    ]


class Spread(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint32) for name in ("count", "stride", "groups", "repairs")]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Compile the packer alone."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    target = tmp_path_factory.mktemp("frame") / "frame.so"
    sources = [ROOT / "src" / name for name in ("crc.c", "frame.c", "spread.c")]
    command = [compiler, "-std=c99", "-O1", "-shared", "-fPIC", f"-I{ROOT}/include", "-o", target, *sources]
    subprocess.run([str(c) for c in command], check=True)
    loaded = ctypes.CDLL(str(target))
    for name in ("aeo_frame_crc32", "aeo_frame_repair_set", "aeo_spread_index"):
        getattr(loaded, name).restype = ctypes.c_uint32
    return loaded


def pack(library: Any, kind: int, tag: int, index: int, values: list[int], node: int = 1) -> Frame:
    """Pack with C."""
    address, frame = Address(wire.BASE, node, 1), Frame()
    message = Message(kind, tag, index, len(values), (ctypes.c_uint32 * 14)(*values))
    assert library.aeo_frame_pack(ctypes.byref(address), ctypes.byref(message), ctypes.byref(frame)) == 0
    return frame


def unpack(library: Any, identifier: int, data: bytes) -> Message:
    """Unpack with C."""
    frame = Frame(identifier, len(data), 7 if len(data) > 8 else 1, (ctypes.c_uint8 * 64)(*data))
    address, message, node = Address(wire.BASE, 0, 1), Message(), ctypes.c_uint8()
    code = library.aeo_frame_unpack(*map(ctypes.byref, (address, frame, message, node)))
    assert code == 0
    return message


def float_of(bits: int) -> np.float32:
    """Reinterpret a pattern."""
    return np.array([bits], np.uint32).view(np.float32)[0]


def expected_signals(kind: int, tag: int, index: int, value: int) -> dict[str, Any]:
    """Say by hand what each message means: the table of frame.h, written a second time."""
    number = float(float_of(value))
    bytes_of = [value >> shift & 0xFF for shift in (0, 8, 16, 24)]
    if kind == wire.HEALTH:
        return {"Item": tag, "Flags": index, wire.health_names()[tag]: value}
    if kind == wire.DESCRIPTION:
        return {"Item": tag} | [
            {"WireVersion": index, "ConfigurationHash": value},
            {"ModelSet": index}
            | dict(zip(("Inputs", "Outputs", "Scheduling", "ValuesPerFrame"), bytes_of, strict=True)),
            {"PastWindow": index, "Parameters": value},
            {"SampleEvery": index, "SampleTime": number},
            {"Forgetting": number},
            {"Regularisation": number},
            {"Feedthrough": value},
            {"OffsetChannel": index, "Offset": number},
            {"ScaleChannel": index, "Scale": number},
            {"NameChannel": index & 0xFF, "NamePart": index >> 8, "NameCharacters": value},
            {"UnitChannel": index & 0xFF, "UnitPart": index >> 8, "UnitCharacters": value},
        ][tag]
    return [
        {"Channel": tag, "Index": index, "Value": number},
        {"Channel": tag, "Index": index, "Value": number},
        {"Snapshot": tag, "Count": index + 1, "SampleIndex": value},
        {"Snapshot": tag, "Index": index, "Value": number},
        {"Snapshot": tag, "Number": index, "Combination": value},
        {"Snapshot": tag, "IndexLow": index, "Crc": value},
        {"Channels": tag & 0x7F, "OfInnovation": tag >> 7, "Index": index, "Crc": value},
    ][kind - 2]


def expected_fd_signals(kind: int, tag: int, index: int, values: list[int]) -> dict[str, Any]:
    """Say the same of CAN FD messages; the values that fill a frame up are zero."""
    channels, repair = kind in (10, 11), kind == 14
    head = {"Channel" if channels else "Snapshot": tag, "Number" if repair else "Index": index, "Count": len(values)}
    filled = values + [0] * (next(n for n in FD_LENGTHS if n >= 8 + 4 * len(values)) // 4 - 2 - len(values))
    if repair:
        return head | {f"Combination{i}": value for i, value in enumerate(filled)}
    return head | {f"Value{i}": float(float_of(value)) for i, value in enumerate(filled)}


def limit_tag(kind: int, tag: int) -> int:
    """Choose a tag that exists for this kind."""
    if kind == wire.HEALTH:
        names = sorted(wire.health_names())
        return names[tag % len(names)]
    return tag % 11 if kind == wire.DESCRIPTION else tag


def same(a: Any, b: Any) -> bool:
    """Compare numbers, NaN with NaN."""
    return a == b or (a != a and b != b)


@settings(max_examples=400, deadline=None)
@given(kind=KINDS, tag=st.integers(0, 255), index=st.integers(0, 65535), value=WORDS)
def test_c_packs_cantools_decodes(library: Any, kind: int, tag: int, index: int, value: int) -> None:
    """Every field that C packs is what the DBC says, for random and extreme values."""
    tag = limit_tag(kind, tag)
    if kind == wire.DESCRIPTION and tag in (4, 5, 6):
        index = 0  # these carry no index
    frame = pack(library, kind, tag, index, [value])
    message = wire.load_dbc().get_message_by_name(NAMES[kind])
    assert message.frame_id == frame.id - 1 and message.is_extended_frame and message.length == frame.length == 8
    decoded = message.decode(bytes(frame.data[:8]), decode_choices=False)
    assert decoded.pop("Check") == frame.data[3]
    expected = expected_signals(kind, tag, index, value)
    assert decoded.keys() == expected.keys()
    assert all(same(decoded[k], expected[k]) for k in expected), (decoded, expected)


@settings(max_examples=400, deadline=None)
@given(kind=KINDS, tag=st.integers(0, 255), index=st.integers(0, 65535), value=WORDS)
def test_cantools_encodes_c_unpacks(library: Any, kind: int, tag: int, index: int, value: int) -> None:
    """What the DBC encodes C reads back; only the check is put in by the C side's own rule."""
    tag = limit_tag(kind, tag)
    if kind == wire.DESCRIPTION and tag in (4, 5, 6):
        index = 0
    if value & 0x7F800000 == 0x7F800000:
        value &= ~0x007FFFFF  # a NaN's payload does not survive a double
    message = wire.load_dbc().get_message_by_name(NAMES[kind])
    signals = expected_signals(kind, tag, index, value) | {"Check": 0}
    data = bytearray(message.encode(signals, scaling=True, padding=False, strict=False))
    data[3] = wire.encode(0, kind, tag, index, value)[1][3]
    found = unpack(library, message.frame_id, bytes(data))
    assert (found.kind, found.tag, found.index, found.count, found.value[0]) == (kind, tag, index, 1, value)


@pytest.mark.parametrize(("base", "nodes"), [(0x600, 16), (0x100, 16), (0x680, 4), (0x740, 4), (0x14FE0000, 254)])
def test_identifiers_may_begin_elsewhere(base: int, nodes: int) -> None:
    """Every kind and node above another base, 11 bits below 0x800; what lies beside is foreign."""
    rows, meant = [], []
    for node in (0, nodes // 2, nodes - 1):
        for kind in range(9):
            identifier, data = wire.encode(node, kind, 1, 2, 3, base)
            rows.append((identifier, base >= 0x800, data))
            meant.append((node, kind))
        for kind in (wire.SAMPLE_FD, wire.PARAMETER_FD):
            identifier, data = wire.encode_fd(node, kind, 1, 2, [3], base)
            rows.append((identifier, base >= 0x800, data))
            meant.append((node, kind))
    decoded = wire.decode(wire.pack_frames(rows), base)
    assert list(zip(decoded.node.tolist(), decoded.kind.tolist(), strict=True)) == meant
    assert (decoded.foreign, decoded.damaged) == (0, 0)
    beside = [(identifier, not extended, data) for identifier, extended, data in rows]
    for others in (beside, [(base - 1, base >= 0x800, bytes(8))]):
        assert wire.decode(wire.pack_frames(others), base).foreign == len(others)
    assert wire.decode(wire.pack_frames(rows)).foreign == len(rows)


def test_bulk_decoder_equals_cantools_bit_for_bit() -> None:
    """The fast path of the host against cantools on 4,000 frames of all kinds, every field."""
    generator = np.random.default_rng(5)
    rows, meant = [], []
    for _ in range(4000):
        kind = int(generator.integers(9))
        tag = limit_tag(kind, int(generator.integers(256)))
        index = 0 if kind == wire.DESCRIPTION and tag in (4, 5, 6) else int(generator.integers(65536))
        node, value = int(generator.integers(254)), int(generator.integers(2**32))
        identifier, data = wire.encode(node, kind, tag, index, value)
        rows.append((identifier, True, data))
        meant.append((node, kind, tag, index, value))
    decoded = wire.decode(wire.pack_frames(rows))
    assert (len(decoded), decoded.foreign, decoded.damaged) == (4000, 0, 0)
    fast = zip(decoded.node, decoded.kind, decoded.tag, decoded.index, decoded.value, strict=True)
    assert [tuple(map(int, row)) for row in fast] == meant
    dbc = wire.load_dbc()
    for (identifier, _, data), (node, kind, tag, index, value) in zip(rows, meant, strict=True):
        signals = dbc.get_message_by_name(NAMES[kind]).decode(data, decode_choices=False)
        assert identifier - node == dbc.get_message_by_name(NAMES[kind]).frame_id
        expected = expected_signals(kind, tag, index, value)
        assert all(same(signals[k], expected[k]) for k in expected)


FD_VALUES = st.lists(WORDS, min_size=1, max_size=14)
FD_KINDS = st.sampled_from(sorted(FD_NAMES))


@settings(max_examples=300, deadline=None)
@given(kind=FD_KINDS, tag=st.integers(0, 255), index=st.integers(0, 65535), values=FD_VALUES)
def test_can_fd_frames_of_c_through_cantools(library: Any, kind: int, tag: int, index: int, values: list[int]) -> None:
    """CAN FD, every field and value, in the shortest frame that holds them."""
    frame = pack(library, kind, tag, index, values)
    message = wire.load_dbc().get_message_by_name(FD_NAMES[kind])
    assert message.is_fd and message.is_extended_frame and message.length == 64
    assert message.frame_id == frame.id - 1 and frame.flags == 7
    assert frame.length == next(n for n in FD_LENGTHS if n >= 8 + 4 * len(values))
    data = bytes(frame.data[: frame.length])
    decoded = message.decode(data, decode_choices=False, allow_truncated=True)
    assert decoded.pop("Check") == zlib.crc32(frame.id.to_bytes(4, "little") + data[:4] + data[8:])
    expected = expected_fd_signals(kind, tag, index, values)
    assert decoded.keys() == expected.keys()
    assert all(same(decoded[k], expected[k]) for k in expected), (decoded, expected)


@settings(max_examples=300, deadline=None)
@given(kind=FD_KINDS, tag=st.integers(0, 255), index=st.integers(0, 65535), values=FD_VALUES)
def test_can_fd_frames_of_cantools_through_c(library: Any, kind: int, tag: int, index: int, values: list[int]) -> None:
    """What the DBC encodes C reads back, bit for bit; the check is put in by the rule of frame.h, with zlib."""
    values = [v & ~0x007FFFFF if kind != 14 and v & 0x7F800000 == 0x7F800000 else v for v in values]
    message = wire.load_dbc().get_message_by_name(FD_NAMES[kind])
    signals = expected_fd_signals(kind, tag, index, values)
    signals |= {s.name: 0 for s in message.signals if s.name not in signals}
    length = next(n for n in FD_LENGTHS if n >= 8 + 4 * len(values))
    data = bytearray(message.encode(signals, scaling=True, padding=False, strict=False))[:length]
    data[4:8] = zlib.crc32(message.frame_id.to_bytes(4, "little") + data[:4] + data[8:]).to_bytes(4, "little")
    found = unpack(library, message.frame_id, bytes(data))
    assert (found.kind, found.tag, found.index, found.count) == (kind, tag, index, len(values))
    assert found.value[: len(values)] == values


@settings(max_examples=300, deadline=None)
@given(
    kind=st.one_of(KINDS, FD_KINDS), tag=st.integers(0, 255), index=st.integers(0, 65535), node=st.integers(0, 253),
    values=FD_VALUES,
)  # fmt: skip
def test_host_reads_what_c_packs(library: Any, kind: int, tag: int, index: int, node: int, values: list[int]) -> None:
    """Classic and CAN FD frames of C through the host's decoder, and its own encoder makes the same bytes."""
    values = values if kind in FD_NAMES else values[:1]
    frame = pack(library, kind, tag, index, values, node)
    data = bytes(frame.data[: frame.length])
    decoded = wire.decode(wire.pack_frames([(frame.id, True, data)]))
    assert decoded.damaged == decoded.foreign == 0
    count = len(values)
    assert decoded.node.tolist() == [node] * count and decoded.kind.tolist() == [kind] * count
    assert decoded.tag.tolist() == [tag] * count and decoded.index.tolist() == [index] * count
    assert decoded.value.tolist() == values and decoded.lane.tolist() == list(range(count))
    if kind in FD_NAMES:
        assert wire.encode_fd(node, kind, tag, index, values) == (frame.id, data)
    else:
        assert wire.encode(node, kind, tag, index, values[0]) == (frame.id, data)


def test_frames_keep_their_order_in_a_batch(library: Any) -> None:
    """Classic and CAN FD frames, foreign and damaged ones among them: places, lanes and counts are right."""
    generator = np.random.default_rng(8)
    rows, meant, damaged, foreign = [], [], [], 0
    for place in range(3000):
        kind = int(generator.choice([*range(9), *FD_NAMES]))
        values = generator.integers(0, 2**32, int(generator.integers(1, 15)) if kind in FD_NAMES else 1).tolist()
        frame = pack(library, kind, 7, place, values)
        data = bytearray(frame.data[: frame.length])
        fate = generator.random()
        if fate < 0.1:
            data[int(generator.integers(len(data)))] ^= 0x10
            damaged.append(1000 + place)
        elif fate < 0.2:
            foreign += 1
            frame.id ^= 0x100000
        else:
            meant += [(place + 1000, kind, lane, value) for lane, value in enumerate(values)]
        rows.append((frame.id, True, bytes(data)))
    decoded = wire.decode(wire.pack_frames(rows), place=1000)
    columns = zip(decoded.place, decoded.kind, decoded.lane, decoded.value, strict=True)
    assert [tuple(map(int, row)) for row in columns] == meant
    assert decoded.damaged_at.tolist() == damaged and decoded.foreign == foreign


def test_the_other_form_of_a_frame_is_foreign(library: Any) -> None:
    """A classic kind in a CAN FD frame, and the other way round, is another system's: neither read nor damaged.

    The frames are those of the library, with the flag of their form turned over; as they were all of them are read.
    """
    rows, flags = [], []
    for kind in (*range(9), *FD_NAMES):
        frame = pack(library, kind, 7, 1, [2])
        rows.append((frame.id, True, bytes(frame.data[: frame.length])))
        flags.append(frame.flags)
    turned = [f ^ wire.FD for f in flags] + [f ^ (wire.FD | wire.FAST) for f in flags]
    for form, foreign in ((flags, 0), (turned, len(turned))):
        decoded = wire.decode(wire.pack_frames(rows * (len(form) // len(rows)), flags=form))
        assert (decoded.foreign, decoded.damaged, len(decoded)) == (foreign, 0, len(form) - foreign)


def test_check_and_crc_are_the_standard_ones(library: Any) -> None:
    """CRC-32 equals zlib's; the CRC-8 table gives the published check value of CRC-8/AUTOSAR, 0xDF."""
    words = np.random.default_rng(1).integers(0, 2**32, 50, dtype=np.uint64).astype("<u4")
    crc = 0xFFFFFFFF
    for word in words.tolist():
        crc = library.aeo_frame_crc32(ctypes.c_uint32(crc), ctypes.c_uint32(word))
    assert crc ^ 0xFFFFFFFF == zlib.crc32(words.tobytes())
    state = 0xFF
    for byte in b"123456789":
        state = int(TABLE_8[state ^ byte])
    assert state ^ 0xFF == 0xDF


def test_crc32_in_bulk_and_backwards() -> None:
    """Rows of words as zlib has them; the second word is found again from the sum and the others."""
    words = np.random.default_rng(2).integers(0, 2**32, (500, 9), dtype=np.uint64).astype(np.uint32)
    words[:, 0] = 0x1234567
    for count in range(2, 10):
        crc = crc_32(words[:, :count])
        assert crc.tolist() == [zlib.crc32(row[:count].astype("<u4").tobytes()) for row in words]
        assert (solve_second(crc, 0x1234567, words[:, 2:count]) == words[:, 1]).all()


@pytest.mark.parametrize("count", [1, 2, 15, 16, 40, 255, 256, 257, 456, 1000, 4097, 65535, 65536])
def test_order_and_repair_sets_are_those_of_c(library: Any, count: int) -> None:
    """Host and node agree on order, groups and the content of repair frames."""
    spread = Spread()
    library.aeo_spread_choose(ctypes.byref(spread), count, 25)
    members = repair.group_members(count)
    assert spread.stride == repair.choose_stride(count) and spread.groups == len(members)
    order = np.empty(count, np.int64)
    for g, member in enumerate(members):
        order[g :: len(members)] = member
    for q in {0, 1, count // 2, count - 1} & set(range(count)):
        assert library.aeo_spread_index(ctypes.byref(spread), q) == order[q]
    for width in (1, 14):
        parameters = (count - 1) * width + 1 + count % width
        theta = np.random.default_rng(count).integers(0, 2**32, parameters, dtype=np.uint64).astype(np.uint32)
        blocks = np.zeros((count, width), np.uint32)
        blocks.ravel()[:parameters] = theta
        theirs = np.zeros(width, np.uint32)
        for number in {0, 1, 2, spread.repairs - 1, 65535}:
            member = members[number % len(members)]
            chosen = repair.repair_sets(np.array([number]), len(member))[0]
            mine = np.bitwise_xor.reduce(blocks[member][chosen], axis=0)
            source, target = (a.ctypes.data_as(ctypes.c_void_p) for a in (theta, theirs))
            library.aeo_spread_repair(ctypes.byref(spread), source, parameters, width, number, target)
            assert mine.tolist() == theirs.tolist()
