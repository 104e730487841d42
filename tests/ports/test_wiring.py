"""The lines shown for each port are short, compile without a warning, run, and stream what was filtered."""

from __future__ import annotations

import shutil
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from wiring import CHANNELS, HERE, MOST_LINES, PARAMETERS, PORTS, ROOT, SHOWN, build, find_block, make_reference

from aeolid.can import Assembly, MarkovSnapshot, open_source

TEXT = SHOWN
SCALES = (3, 2, 15, 0.2, 0.1)  # of the channels in README.md


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return samples and theta of the filter's block alone."""
    return make_reference(TEXT, tmp_path_factory.mktemp("reference"))


def compiler_of(name: str) -> None:
    """Skip where a port's tools are missing."""
    tools = [PORTS[name].compiler[0], *(["qemu-system-arm"] if name == "mps2" else [])]
    for tool in tools:
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")


def check_stream(assembly: Assembly, reference: tuple[NDArray[np.float32], NDArray[np.float32]]) -> MarkovSnapshot:
    """Compare what arrived with the reference, bit for bit; returns the newest complete snapshot."""
    samples, theta = reference
    assert list(assembly.nodes) == [1] and assembly.damaged == assembly.foreign == 0
    node = assembly.nodes[1]
    assert node.now is not None
    assert node.now.description.names == ("pitch", "torque", "generator_speed", "fore_aft", "side_side")
    snapshot = node.latest_complete()
    assert snapshot is not None and snapshot.sample_index is not None and snapshot.sample_index % 100 == 99
    expected = theta[snapshot.sample_index // 100]
    assert np.all(np.abs(expected).max(axis=-1) > 0)  # samples that are all refused teach nothing
    of_channel = np.array(SCALES, np.float32).astype(np.float64)
    ratio = of_channel[2:, None] / np.tile(of_channel, PARAMETERS // 3 // CHANNELS)  # theta acts on scaled channels
    assert np.allclose(snapshot.theta, ratio * expected.reshape(3, -1), rtol=1e-14, atol=0)
    table = node.now.samples.tables(1)[-1]
    first = int(table.index[0])
    there = np.isfinite(table.values)
    np.testing.assert_array_equal(table.values[there], samples[first : first + len(table.values)][there])
    return snapshot


def listen_until(address: str, enough: int) -> Assembly:
    """Receive until a snapshot of sample `enough` or later is complete, or the bus ends."""
    source, assembly = open_source(address), Assembly()
    try:
        while source.ended is None:
            assembly.feed(source.read(1.0))
            latest = assembly.nodes[1].latest_complete() if 1 in assembly.nodes else None
            if latest is not None and latest.sample_index is not None and latest.sample_index >= enough:
                break
    finally:
        source.close()
    assembly.close()
    return assembly


def test_every_block_is_short() -> None:
    markers = {"#include <aeolid/stream.h>": "c", "controller = ": "ini"} | {p.marker: "c" for p in PORTS.values()}
    for marker, language in markers.items():
        lines = [line for line in find_block(TEXT, language, marker).splitlines() if line.strip()]
        assert len(lines) <= MOST_LINES, (marker, len(lines))
        assert max(map(len, lines)) <= 120, marker


@pytest.mark.parametrize("name", ["template", "fdcan"])
def test_bare_metal(name: str, reference: tuple[NDArray[np.float32], NDArray[np.float32]], tmp_path: Path) -> None:
    """Ring, interrupt, mailboxes: the streamer runs on template and FDCAN, and what leaves the controller is whole."""
    program = build(TEXT, name, tmp_path)
    log = tmp_path / "bus.log"
    log.write_bytes(subprocess.run([program], capture_output=True, timeout=3600, check=True).stdout)
    source, assembly = open_source(str(log)), Assembly()
    while source.ended is None:
        assembly.feed(source.read(0.0))
    assembly.close()
    snapshot = check_stream(assembly, reference)
    assert snapshot.sample_index == 199
    node = assembly.nodes[1]
    assert node.now is not None and node.now.samples.lost(1) == 0
    # 25 s at 5 % of 500 kbit/s, 160 bits a frame: the share is kept
    assert 2500 < assembly.frames <= 25 * 25_000 / 160


def test_slcan(reference: tuple[NDArray[np.float32], NDArray[np.float32]], tmp_path: Path) -> None:
    """The program with a listener on TCP; any free port, so that tests can run side by side."""
    program = build(TEXT, "slcan", tmp_path, replaced=("29536", "0"))
    process = subprocess.Popen([program], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assembly = listen_until(process.stdout.readline().strip(), 10**9)
        assert check_stream(assembly, reference).sample_index == 199
        assert process.wait(3600) == 0
    finally:
        process.kill()
        process.wait()


def test_socketcan_without_an_interface(tmp_path: Path) -> None:
    """Built, and where there is no can0 one sentence says so; with one it runs in tests/sil/uml."""
    if Path("/sys/class/net/can0").exists():
        pytest.skip("this machine has a can0: not for tests to send on")
    program = build(TEXT, "socketcan", tmp_path)
    done = subprocess.run([program], capture_output=True, text=True, timeout=3600, check=False)
    assert done.returncode == 1 and len(done.stdout.splitlines()) == 1 and "can0" in done.stdout


@pytest.fixture
def board(tmp_path: Path) -> Iterator[str]:
    """Run the image in an emulator; yields the address of its UART."""
    compiler_of("mps2")
    image = build(TEXT, "mps2", tmp_path)
    uart = socket.create_server(("127.0.0.1", 0))
    words = ["qemu-system-arm", "-M", "mps2-an386", "-display", "none", "-monitor", "none", "-kernel", str(image)]
    words += ["-icount", "shift=6,sleep=off", "-semihosting-config", "enable=on,target=native"]
    words += ["-chardev", f"socket,id=uart,fd={uart.fileno()},server=on", "-serial", "chardev:uart"]
    process = subprocess.Popen(words, pass_fds=[uart.fileno()], stdin=subprocess.DEVNULL)
    address = f"slcan:socket://127.0.0.1:{uart.getsockname()[1]}"
    uart.close()
    yield address
    process.kill()
    process.wait()


def test_mps2(board: str, reference: tuple[NDArray[np.float32], NDArray[np.float32]]) -> None:
    """A Cortex-M4F filters the same samples to the same bits."""
    check_stream(listen_until(board, 299), reference)


def test_controller_wrapper_settings() -> None:
    """The page shows the settings file that the wrapper's own tests run with."""
    shown = find_block(TEXT, "ini", "controller = ")
    assert shown == (ROOT / "port/discon/example.cfg").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", PORTS)
@pytest.mark.parametrize(
    ("right", "wrong", "objection"),
    [
        ("stream_init(&port)", "stream_init()", "too few arguments"),
        ("aeo_port_t port;", "aeo_port_t port; int spare;", "unused"),
        ("#include", "# include <aeolid/nosuch.h>\n#include", "nosuch.h"),
    ],
)
def test_a_broken_block_is_found(name: str, right: str, wrong: str, objection: str, tmp_path: Path) -> None:
    """The gate can fail: a call that no longer fits, a warning, a header that is gone."""
    compiler_of(name)
    shown = find_block(TEXT, "c", PORTS[name].marker)
    assert right in shown
    build(TEXT, name, tmp_path, compile_only=True)
    broken = TEXT.replace(shown, shown.replace(right, wrong, 1))
    with pytest.raises(RuntimeError, match=objection):
        build(broken, name, tmp_path, compile_only=True)


def test_every_port_has_its_block() -> None:
    """A port without wiring, or wiring without a port, is noticed."""
    around = {"common", "j1939"}  # no ports themselves: a claim of an address goes around any
    folders = {p.parent.name for p in (ROOT / "port").glob("*/*.h")} - around
    shown = {"template", "posix", "fdcan", "mps2", "discon"}
    assert folders == shown
    assert {p.name for p in HERE.glob("run_*.c")} == {f"run_{name}.c" for name in PORTS}
