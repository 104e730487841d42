"""On a bus with devices of CANopen, J1939 or NMEA 2000 a node sends on no identifier of theirs, a whole day long."""

from __future__ import annotations

import ctypes
import random
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from aeolid.can import identifiers, wire
from aeolid.cli.main import main
from aeolid.errors import UsageError

ROOT = Path(__file__).resolve().parents[2]
INCLUDE = [f"-I{ROOT}/include", f"-I{ROOT}/src"]
DAY, HOUR = 864_000, 36_000  # samples at 10 Hz
E_ARG = -1
NODE_IDS = range(1, 128)
PREDEFINED = [
    0x080,
    0x180,
    0x200,
    0x280,
    0x300,
    0x380,
    0x400,
    0x480,
    0x500,
    0x580,
    0x600,
    0x700,
]  # plus node-ID


class Day(ctypes.Structure):
    """Mirror day_t."""

    _fields_ = [(name, ctypes.c_uint32 * 256) for name in ("id", "flags", "count")] + [
        (name, ctypes.c_uint32) for name in ("kept", "lost")
    ]


def compiler() -> str:
    found = shutil.which("cc") or shutil.which("gcc")
    if found is None:
        pytest.skip("no C compiler")
    return found


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Compile the streamer and what counts its frames."""
    target = tmp_path_factory.mktemp("day") / "day.so"
    names = ("budget", "crc", "frame", "spread", "describe", "stream", "stream_send", "stream_values")
    sources = [ROOT / f"src/{name}.c" for name in names] + [ROOT / "tests/host/stream_day.c"]
    command = [
        compiler(),
        "-std=c99",
        "-O2",
        "-shared",
        "-fPIC",
        *INCLUDE,
        "-o",
        target,
        *sources,
    ]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(target))


def send(library: Any, base: int, node: int, fd: bool, samples: int, forced: bool = False) -> dict[int, int]:
    """Return how many frames of each identifier a node sends."""
    day = Day()
    arguments = [ctypes.c_uint32(int(x)) for x in (base, node, base >= 0x800, forced, fd, samples)]
    assert library.day_run(ctypes.byref(day), *arguments) == 0 and day.lost == 0
    counts: dict[int, int] = {}
    for identifier, flags, count in zip(day.id, day.flags, day.count[: day.kept], strict=False):
        assert flags & wire.EXTENDED == (base >= 0x800)
        counts[identifier] = counts.get(identifier, 0) + count
    return counts


@pytest.mark.parametrize("base", [0x680, 0x1CFF4000])
def test_a_day_of_traffic_meets_nobody(library: Any, base: int) -> None:
    """Ten million frames of a node, none on an identifier that somebody else's device listens to or sends on."""
    counts = send(library, base, 1, False, DAY)
    assert sum(counts.values()) > 10_000_000
    assert counts.keys() <= set(wire.identifiers_of(base))
    assert {user for i in counts for user in identifiers.users_of(i, base >= 0x800)} == set()
    if base >= 0x800:
        group = identifiers.PROPRIETARY_B
        assert all(group.first <= identifiers.group_of(i) <= group.last and i & 0xFF == 1 for i in counts)
    else:
        assert not {code + n for code in PREDEFINED for n in NODE_IDS} & counts.keys()


def test_the_tables_find_what_the_old_base_did(library: Any) -> None:
    """The same day at 0x600, which has to be forced: nine frames in ten are SDO requests. The test can fail."""
    counts = send(library, 0x600, 1, False, HOUR, forced=True)
    met = sum(n for i, n in counts.items() if identifiers.users_of(i, False) == ["CANopen: SDO requests"])
    assert met > 0.9 * sum(counts.values())


@pytest.mark.parametrize("fd", [False, True])
@pytest.mark.parametrize("base", [0x680, 0x1CFF4000, 0x1CFFE000, 0x00FF0000])
def test_every_node_and_kind_stays_within(library: Any, base: int, fd: bool) -> None:
    """Each node number, classic and CAN FD: what is sent is of this node and free."""
    layout = wire.choose_layout(base)
    for node in sorted({0, 1, layout.nodes // 2, layout.nodes - 1}):
        counts = send(library, base, node, fd, 1000)
        assert len(counts) == 8, "begin, end, description, health, and four kinds of values"
        assert {(i - base) & ((1 << layout.shift) - 1) for i in counts} == {node}
        assert not any(identifiers.users_of(i, base >= 0x800) for i in counts)


def packs(library: Any, base: int, forced: bool, node: int = 0) -> bool:
    status = library.day_packs(*(ctypes.c_uint32(int(x)) for x in (base, node, base >= 0x800, forced)))
    assert status in (0, E_ARG)
    return bool(status == 0)


def is_free(base: int) -> bool:
    try:
        identifiers.check_free(base)
    except UsageError:
        return False
    return True


def test_the_library_refuses_what_the_tables_name(library: Any) -> None:
    """All bases of 11 bits and many of 29: free by the tables and taken by the library are the same; forced all go."""
    generator = random.Random(1)
    free = [p << 26 | 0xFF << 16 | s << 13 for p in range(8) for s in range(8)]
    others = [generator.randrange(0, 1 << 16) << 13 for _ in range(60)]
    others += [b ^ 1 << bit for b in free[:2] for bit in range(16, 26)]
    for base in [*range(0, 0x800, 0x40), *free, *others]:
        if base == 0 or base >= 0x800 or base % 0x40 == 0:
            assert packs(library, base, False) == is_free(base), hex(base)
            assert packs(library, base, True), hex(base)
    assert [base for base in range(0, 0x800, 0x40) if packs(library, base, False)] == [0x680]
    for base in (*range(0x681, 0x6C0), 0x1CFF4100, 1 << 29):
        assert not packs(library, base, True), "no room for kinds and nodes"
    assert [packs(library, 0x680, False, n) for n in (3, 4)] == [True, False]
    assert [packs(library, 0x600, True, n) for n in (15, 16)] == [True, False]


@pytest.mark.parametrize(
    ("flags", "compiles"),
    [
        ([], True), (["-DAEO_FRAME_BASE_STANDARD=0x600"], False), (["-DAEO_FRAME_BASE_EXTENDED=0x18FEF100"], False),
        (["-DAEO_FRAME_BASE_STANDARD=0x600", "-DAEO_FRAME_BASE_FORCED"], True),
        (["-DAEO_FRAME_BASE_EXTENDED=0x18FFA000"], True), (["-DOWN=0x680,0"], True), (["-DOWN=0x600,0"], False),
        (["-DOWN=0x1CFF4000,1"], True), (["-DOWN=0x18EF0000,1"], False),
    ],
)  # fmt: skip
def test_the_compiler_refuses_them_too(flags: list[str], compiles: bool) -> None:
    """A base that CANopen or J1939 use is an error of the build, unless forced by name."""
    text = "#include <aeolid/frame.h>\n#define CHECK(base, extended) AEO_FRAME_BASE_IS_FREE(base, extended)\n"
    text += "#define CHECK_PAIR(pair) CHECK(pair)\n#ifdef OWN\ntypedef char own[CHECK_PAIR(OWN) ? 1 : -1];\n#endif\n"
    command = [
        compiler(),
        "-std=c99",
        "-fsyntax-only",
        *INCLUDE,
        *flags,
        "-x",
        "c",
        "-",
    ]
    done = subprocess.run(command, input=text, text=True, capture_output=True, check=False)
    assert (done.returncode == 0) == compiles, done.stderr


@pytest.mark.parametrize(
    ("base", "words"),
    [
        ("0x600", "CANopen: SDO requests"), ("0x700", "CANopen: NMT error control"), ("0x180", "CANopen: TPDO 1"),
        ("0x080", "CANopen: SYNC; CANopen: EMCY"), ("0x18FE0000", "J1939: groups that SAE assigns"),
        ("0x19FE0000", "NMEA 2000: groups that NMEA assigns"), ("0x18EE0000", "NMEA 2000: ISO 11783 acknowledgement"),
    ],
)  # fmt: skip
def test_the_command_says_whose_they_are(capsys: pytest.CaptureFixture[str], base: str, words: str) -> None:
    """A base in use is refused before anything is opened, in a sentence that names the service and the remedy."""
    assert main(["node", "--turbine", "--samples", "1", "--base", base]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert words in told and "--force-base" in told and told.count("aeolid: ") == 1


def test_the_tables_agree_with_the_function_codes() -> None:
    """Every default identifier of every CANopen node-ID, reckoned from its function code, is in the table, once."""
    known = {code + n for code in PREDEFINED for n in NODE_IDS} | {
        0x000,
        0x080,
        0x100,
        0x7E4,
        0x7E5,
    }
    assert all(len(identifiers.users_of(i, False)) == 1 for i in known)
    free = [i for i in range(0x800) if not identifiers.users_of(i, False)]
    between = [0x200, 0x280, 0x300, 0x380, 0x400, 0x480, 0x500, 0x580, 0x600, 0x700]
    assert free == sorted([*between, *range(0x680, 0x6E0)])


def test_the_page_has_the_tables() -> None:
    """The documentation lists the ranges of the code, all and no others."""
    page = (ROOT / "docs/reference/buses.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `0x([0-9A-F]+)` \| `0x([0-9A-F]+)` \| (.+?) \|$", page, re.MULTILINE)
    written = [(int(first, 16), int(last, 16), what) for first, last, what in rows]
    tables = (
        *identifiers.CANOPEN,
        *identifiers.J1939,
        identifiers.PROPRIETARY_B,
        *identifiers.NMEA_2000,
    )
    assert written == [(use.first, use.last, use.what) for use in tables]
