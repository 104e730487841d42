"""Firmware in an emulator → its UART → listener: a Cortex-M filters and streams what a PC makes of its samples."""

from __future__ import annotations

import json
import re
import shutil
import socket
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from board import BOARDS, COUNTED, NO_INTERRUPTS, PATIENCE_S, PORT, SAMPLE_TIME_US, Board, DeafHost, build, link, run
from harness import Process, listen

from aeolid.filters import filter_record
from aeolid.formats import read_record
from aeolid.record import Record, Roles

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "firmware"))
from turbine_recording import PAST, make_recording

pytestmark = pytest.mark.slow  # its fixtures are

Start = Callable[..., Process]
HEAP = {"malloc", "calloc", "realloc", "free", "_malloc_r", "_free_r", "_calloc_r", "_realloc_r", "_sbrk", "_sbrk_r"}


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Build the node for both boards as the port's own CMake project does, warnings as errors."""
    for tool in ("arm-none-eabi-gcc", "qemu-system-arm", "cmake", "ninja"):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")
    if run("arm-none-eabi-gcc", "-fsyntax-only", "-include", "string.h", "-x", "c", "/dev/null").returncode != 0:
        pytest.skip("the C library for arm-none-eabi-gcc (newlib) is not installed")
    folders = {board: tmp_path_factory.mktemp(board) for board in BOARDS}
    with ThreadPoolExecutor() as pool:
        return dict(zip(folders, pool.map(build, folders, folders.values()), strict=True))


@pytest.fixture
def boot(images: dict[str, Path]) -> Iterator[Callable[..., Board]]:
    """Start boards that never outlive the test."""
    started: list[Board] = []

    def begin(board: str, uart: socket.socket, *arguments: object, extra: tuple[str, ...] = ()) -> Board:
        started.append(Board(board, images[board], uart, *arguments, extra=extra))
        return started[-1]

    yield begin
    for board in started:
        board.close()


@pytest.fixture(scope="module")
def recording() -> Record:
    """Return what the image holds as constants."""
    return make_recording()


def received_by(folder: Path) -> Record:
    """Read what a listener recorded."""
    return read_record(folder / "r.csv", Roles.load(folder / "r.roles.toml"))


def assert_theta_of(record: Record, markov: Path) -> None:
    """Compare the streamed theta with that of the same filter on this PC, bit for bit."""
    streamed = np.load(markov)["theta_scaled"].astype(np.float32)
    replayed = filter_record(record, past=PAST, precision="f32").theta_scaled.astype(np.float32)
    assert streamed.view(np.uint32).tolist() == replayed.view(np.uint32).tolist()


# ---- what it streams ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Streamed:
    """Hold what a listener got from a board that ran to its end."""

    folder: Path
    facts: dict[str, Any]  # the listener's
    told: dict[str, Any]  # the node's
    seconds: float


# As fast as the UART's ring drains; at the true sample rate.
PACES = {"an386": (0, ()), "an500": (SAMPLE_TIME_US, COUNTED)}


@pytest.fixture(scope="module")
def streamed(images: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Streamed]:
    """Return what runs a board once, when the first test asks for it: an M4F by day, an M7 by night."""
    return cache(lambda board: stream(board, images[board], tmp_path_factory.mktemp("streamed"), *PACES[board]))


def stream(board: str, image: Path, folder: Path, period_us: int, extra: tuple[str, ...]) -> Streamed:
    """Run one board with a listener to the end of its stream."""
    begun = time.monotonic()
    server = socket.create_server(("127.0.0.1", 0))
    address = f"slcan:socket://127.0.0.1:{server.getsockname()[1]}"
    node = Board(board, image, server, period_us, extra=extra)
    try:
        options = ("--until-end", "--record", folder / "r.csv", "--markov", folder / "m.npz")
        ended, facts = listen(address, folder, *options)
        ended.assert_clean()
        code, told = node.finish()
    finally:
        node.close()
    assert code == 0, node.said
    return Streamed(folder, facts, told, time.monotonic() - begun)


@pytest.mark.parametrize("board", BOARDS)
def test_firmware_streams_what_a_pc_computes(
    board: str, streamed: Callable[[str], Streamed], recording: Record
) -> None:
    """Each sample arrives as it is in flash; theta is, bit for bit, that of the filter on the received samples."""
    result, samples = streamed(board), len(recording)
    facts, told, received = result.facts, result.told, received_by(result.folder)
    np.testing.assert_array_equal(received.values, recording.matrix("input", "output"))
    assert [(c.name, c.unit, c.role) for c in received.channels] == [
        (c.name, c.unit, c.role) for c in recording.channels if c.role != "excitation"
    ]
    assert_theta_of(received, result.folder / "m.npz")
    assert int(np.load(result.folder / "m.npz")["sample_index"]) == samples - 1
    assert (told["samples"], told["updates"], told["dropped"], told["refused"]) == (samples, samples - PAST, 0, 0)
    assert told["snapshots"] == facts["nodes"][0]["snapshots"]["complete"]
    assert facts["frames"] <= told["sent"]  # the first of the closing frames ends the listener
    assert (facts["damaged"], facts["garbled_lines"], facts["foreign"]) == (0, 0, 0)
    if board == "an500":  # where the emulator skips time it may sleep twice as long as asked, never shorter
        assert told["elapsed_us"] >= (samples - 1) * SAMPLE_TIME_US - 1
    else:  # the board's clock is that of the PC here
        assert 0 < told["elapsed_us"] <= 1e6 * result.seconds


def test_poles_from_the_stream_are_those_of_the_replay(
    streamed: Callable[[str], Streamed], start: Start, tmp_path: Path
) -> None:
    """`identify` finds the same poles with the Markov parameters of the firmware as with those of `aeolid filter`.

    theta is the same bit for bit in scaled units. Undoing the scales is where the two differ: the description carries
    them as binary32, `filter` has them in double precision, 2^-24 apart at most; 1e-5 leaves a factor 100 for what the
    identification makes of that.
    """
    folder, replayed = streamed("an386").folder, tmp_path / "f.npz"
    settings = (folder / "r.csv", "--roles", folder / "r.roles.toml", "--past", PAST)
    start("filter", *settings, "--method", "rls", "--precision", "f32", "--out", replayed).finish().assert_clean()
    runs = [
        start("identify", *settings, "--order", 7, "--markov", markov, "--out", tmp_path / name)
        for markov, name in ((folder / "m.npz", "streamed.json"), (replayed, "replayed.json"))
    ]
    for process in runs:
        process.finish().assert_clean()
    poles = [
        np.sort_complex(np.linalg.eigvals(np.array(json.loads((tmp_path / name).read_text())["A"])))
        for name in ("streamed.json", "replayed.json")
    ]
    assert len(poles[0]) == 7
    np.testing.assert_allclose(poles[0], poles[1], rtol=0, atol=1e-5)


# ---- what goes wrong ----------------------------------------------------------------------------------------------


def test_a_deaf_host_costs_frames_and_not_the_control_task(
    boot: Callable[..., Board], recording: Record, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nobody reads the UART for a while: each sample is filtered when it is due, and the losses are told.

    SysTick comes so fast that there is hardly time left for the main loop: it is interrupted within its frames.
    """
    period_us = 3000
    host = DeafHost(deaf_after=60_000)
    node = host.node = boot("an386", host.uart, period_us, extra=COUNTED)
    options = ("--until-end", "--record", tmp_path / "r.csv", "--markov", tmp_path / "m.npz")
    ended, facts = listen(host.address, tmp_path, *options)
    ended.assert_clean()
    code, told = node.finish()
    assert code == 0, node.said
    samples = len(recording)
    assert (told["samples"], told["updates"]) == (samples, samples - PAST)
    # what keeps the control task out is one frame of the main loop: under a quarter of the period, in ticks of 40 ns
    assert told["latest"] < period_us * 25 // 4
    assert 2 * told["stack_used"] <= told["stack"]  # main loop, UART and control task on top of each other
    assert told["dropped"] > 0 and told["refused"] > 0
    health = facts["nodes"][0]["health"]
    assert 0 < health["Dropped"] <= told["dropped"] and 0 < health["Refused"] <= told["refused"]
    received = received_by(tmp_path)
    there = np.isfinite(received.values)
    first = round(received.time_s[0] / 0.1)
    truth = recording.matrix("input", "output")[first : first + len(received)]
    np.testing.assert_array_equal(received.values[there], truth[there])
    assert 0 < np.count_nonzero(~there) <= told["dropped"]
    assert (facts["damaged"], facts["garbled_lines"]) == (0, 0)
    assert host.finish() == told["sent"] + 1  # what the port took has left, after the acknowledgement of O
    assert_theta_of(recording, tmp_path / "m.npz")
    with capsys.disabled():
        print(
            f"\nturbine_node an386, main loop interrupted within its frames: stack {told['stack_used']} B, control task"
            f" at most {told['latest'] * 5 // 8} instructions late"
        )


def test_the_uart_obeys_open_and_close_and_nothing_else(boot: Callable[..., Board], recording: Record) -> None:
    """Settings are acknowledged, questions answered, frames and garbage refused; nothing is sent while closed."""
    uart, host = socket.socketpair()
    host.settimeout(PATIENCE_S)
    node = boot("an386", uart, 0)
    frame = b"T1CFF410180000000000000000\r"
    asked = b"C\rS6\rV\rN\r" + frame + b"t1230\rOO\r" + b"x" * 300 + b"\r" + b"O" * 300 + b"\r\rV\r"
    host.sendall(asked)
    expected = b"\r\rV1013\rNAEOL\r\a\a\a\a\aV1013\r"
    answer = b""
    while len(answer) < len(expected):
        answer += host.recv(4096)
    assert answer == expected
    host.sendall(b"O\r")
    stream = b""
    while stream.count(b"\r") < 100:
        stream += host.recv(4096)
    assert stream.startswith(b"\rT1CFF4201800000") and b"\a" not in stream  # first the wire version
    host.sendall(b"C\r")
    while data := host.recv(4096):
        stream += data
    host.close()
    assert stream.endswith(b"\r\r")  # the acknowledgement is the last that was sent
    assert all(re.fullmatch(rb"T[0-9A-F]{25}", line) for line in stream.split(b"\r")[1:-2])
    code, told = node.finish()
    assert code == 0 and told["samples"] == len(recording)  # as on a bus that nobody reads any more


@pytest.mark.parametrize("argument", ["", "fast", "671001", "99999999999", "-1"])
def test_a_wrong_argument_ends_the_image_with_a_sentence(argument: str, boot: Callable[..., Board]) -> None:
    """Exit code 2 and what is needed."""
    uart, host = socket.socketpair()
    node = boot("an386", uart, *([argument] if argument else []))
    code, _ = node.finish()
    host.close()
    assert code == 2 and any("0 to 671000 microseconds" in line for line in node.said)


# ---- the image ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("board", BOARDS)
def test_the_image_has_no_heap(board: str, images: dict[str, Path]) -> None:
    """No symbol of a heap."""
    named = {line.split()[-1] for line in run("arm-none-eabi-nm", images[board]).stdout.splitlines()}
    assert "aeo_rls_update" in named and not named & HEAP


def test_a_program_that_calls_malloc_does_not_link(images: dict[str, Path], tmp_path: Path) -> None:
    """Not even with the library's stub of sbrk, for want of `end`; the same program without the call does link."""
    for call, links in (("", True), ("kept = malloc(8);", False)):
        program = f"#include <stdlib.h>\nvoid *volatile kept;\n{NO_INTERRUPTS}int main(void) {{ {call} return 0; }}\n"
        done = link(images["an386"], program, tmp_path, "--specs=nosys.specs")
        assert (done.returncode == 0) == links, done.stderr
    assert "undefined reference to `end'" in done.stderr


def test_the_wiring_in_the_header_links(images: dict[str, Path], tmp_path: Path) -> None:
    """The example of mps2_port.h, word for word, is a whole program once the controller's own parts are there."""
    comment = (PORT / "mps2_port.h").read_text().split(" * WIRING\n")[1].split(" */")[0]
    wiring = [line[6:] for line in comment.splitlines() if line.startswith(" *     ")]
    assert 15 < len([line for line in wiring if line.strip("{} ")]) < 20
    own = """
#include <aeolid/rls.h>
#include <aeolid/stream.h>
#include "mps2_board.h"
#include "mps2_port.h"
enum { INPUTS = 2, OUTPUTS = 3, N = 50 };
static const aeo_stream_config_t settings;
static aeo_rls_t filter;
static int identification_init(void) { return 1; }
static void read_sensors(aeo_real_t *u, aeo_real_t *y) { u[0] = u[1] = y[0] = y[1] = y[2] = 0.0f; }
static void control_task(const aeo_real_t *u, const aeo_real_t *y, uint64_t us) { (void)u; (void)y; (void)us; }
"""
    done = link(images["an386"], own + "\n".join(wiring) + "\n", tmp_path)
    assert done.returncode == 0, done.stderr


def test_the_clock_counts_microseconds(images: dict[str, Path], tmp_path: Path) -> None:
    """Read all the time, it advances by 100,000 in ten periods of SysTick of 10 ms, give or take two readings."""
    program = """
#include "mps2_board.h"
#include "mps2_port.h"
static volatile uint32_t ticks;
void mps2_systick(void) { ticks++; }
void mps2_uart0(void) {}
int main(void)
{
    static mps2_port_t uart;
    aeo_port_t port;
    uint32_t first = 0, last = 0;
    mps2_port_init(&uart, &port, 921600);
    mps2_start_systick(10000);
    while (ticks < 1) first = port.time_us(&uart);
    while (ticks < 11) last = port.time_us(&uart);
    mps2_write("node {\\"elapsed_us\\": ");
    mps2_write_decimal(last - first);
    mps2_write("}\\n");
    return 0;
}
"""
    done = link(images["an386"], program, tmp_path)
    assert done.returncode == 0, done.stderr
    uart, host = socket.socketpair()
    node = Board("an386", tmp_path / "program.elf", uart, extra=COUNTED)
    code, told = node.finish()
    host.close()
    assert code == 0 and abs(told["elapsed_us"] - 100_000) <= 10  # a reading takes about 40 instructions of 64 ns


def test_a_stack_that_is_too_small_is_a_fault(images: dict[str, Path], tmp_path: Path) -> None:
    """It grows into its guard and not into variables: exit code 99."""
    body = "volatile int deep[200]; for (int i = 199; i >= 0; i--) deep[i] = 0; return deep[0];"
    program = f'#include "mps2_board.h"\n{NO_INTERRUPTS}int main(void) {{ {body} }}\n'
    for stack, expected in ((1024, 0), (512, 99)):
        assert link(images["an386"], program, tmp_path, f"-Wl,--defsym=MPS2_STACK={stack}").returncode == 0
        uart, host = socket.socketpair()
        node = Board("an386", tmp_path / "program.elf", uart)
        code, _ = node.finish()
        host.close()
        assert code == expected, node.said


@pytest.mark.parametrize("board", BOARDS)
def test_size_and_stack_are_reported(
    board: str, images: dict[str, Path], streamed: Callable[[str], Streamed], recording: Record, capsys: Any
) -> None:
    """Print what an image takes; the stack has twice what was used of it."""
    constants = 4 * recording.matrix("input", "output").size
    text, data, bss = map(int, run("arm-none-eabi-size", images[board]).stdout.splitlines()[1].split()[:3])
    told = streamed(board).told
    assert 0 < 2 * told["stack_used"] <= told["stack"]
    with capsys.disabled():
        print(
            f"\nturbine_node {board}: text {text - constants} B and {constants} B of recording, data {data} B,"
            f" bss {bss} B, of which stack {told['stack']} B, {told['stack_used']} B used"
        )
