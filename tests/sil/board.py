"""Build images for emulated boards, run them, and stand at the other end of their UART."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import threading
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PORT = ROOT / "port" / "mps2"
BOARDS = ("an386", "an500")  # Cortex-M4F, Cortex-M7
CORTEX_M4F = ("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mthumb", "-mfloat-abi=hard")
NO_INTERRUPTS = "void mps2_systick(void) {}\nvoid mps2_uart0(void) {}\n"
SAMPLE_TIME_US = 100_000
# Every instruction takes 64 ns and time spent asleep is skipped: the true sample rate, in seconds instead of minutes.
COUNTED = ("-icount", "shift=6,sleep=off")
BUFFER_BYTES = 32768  # some 1,200 frames: 2 s of a busy reader's absence, an eighth of what comes while nobody reads
PATIENCE_S = 3600.0  # what waits in vain is ended; a busy machine is not


def run(*command: object) -> subprocess.CompletedProcess[str]:
    """Run a tool and return what it said."""
    return subprocess.run([str(c) for c in command], capture_output=True, text=True, timeout=PATIENCE_S, check=False)


def build(board: str, folder: Path) -> Path:
    """Configure and build into `folder`; returns the image."""
    options = [f"-DMPS2_BOARD={board}", f"-DAEOLID_PYTHON_COMMAND={sys.executable}"]
    options += ["-DCMAKE_COMPILE_WARNING_AS_ERROR=ON", "--toolchain", "toolchain.cmake", "-G", "Ninja"]
    for command in (["cmake", "-S", PORT, "-B", folder, *options], ["cmake", "--build", folder, "-j", "1"]):
        done = run(*command)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder / "turbine_node"


def link(image: Path, program: str, folder: Path, *flags: str) -> subprocess.CompletedProcess[str]:
    """Link a program with the port and the library that were built with `image`, for the M4F, as no CMake user does."""
    (folder / "program.c").write_text(program)
    compiler = ["arm-none-eabi-gcc", *CORTEX_M4F, "-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", *flags]
    options = ["-nostartfiles", "-Wl,--gc-sections", f"-T{PORT / 'mps2.ld'}", f"-I{ROOT / 'include'}", f"-I{PORT}"]
    libraries = [image.parent / "libaeolid_port_mps2.a", image.parent / "aeolid/libaeolid.a", "-lm"]
    return run(*compiler, *options, folder / "program.c", *libraries, "-o", folder / "program.elf")


class Board:
    """Own an emulated board whose UART is one end of a socket."""

    def __init__(self, board: str, image: Path, uart: socket.socket, *arguments: object, extra: tuple[str, ...] = ()):
        """Start it; uart: a listening or connected socket, which the emulator takes over."""
        server = ",server=on" if uart.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN) else ""
        words = ["qemu-system-arm", "-M", f"mps2-{board}", "-display", "none", "-monitor", "none", *extra]
        words += ["-chardev", f"socket,id=uart,fd={uart.fileno()}{server}", "-serial", "chardev:uart"]
        told = "".join(f",arg={a}" for a in ("turbine_node", *arguments))
        words += ["-semihosting-config", "enable=on,target=native" + told, "-kernel", str(image)]
        self.half_way = threading.Event()
        self.said: list[str] = []
        self.process = subprocess.Popen(
            words, pass_fds=[uart.fileno()], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        uart.close()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.said.append(line.strip())
            if line.strip() == "half":
                self.half_way.set()
        self.half_way.set()

    def finish(self) -> tuple[int, dict[str, Any]]:
        """Wait for the end; returns exit code and the facts the image wrote."""
        code = self.process.wait(PATIENCE_S)
        self._reader.join()
        facts = [line[5:] for line in self.said if line.startswith("node {")]
        return code, json.loads(facts[0]) if facts else {}

    def close(self) -> None:
        """Make sure that nothing stays behind."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self._reader.join()
        assert self.process.stderr is not None
        self.process.stderr.close()


def bounded_pair(size: int) -> tuple[socket.socket, socket.socket]:
    """Return two connected sockets between which the kernel holds bytes of the order of `size`, and no more.

    TCP on the loopback joins what an emulator sends byte by byte; between Unix sockets each byte counts as a packet of
    some 800, so that a reader who is late by milliseconds loses frames.
    """
    with socket.socket() as server, closing(socket.socket()) as client:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size)  # before listening: inherited
        client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, size)
        server.bind(("127.0.0.1", 0))
        server.listen(1)
        client.connect(server.getsockname())
        end, _ = server.accept()
        return socket.socket(fileno=client.detach()), end


class DeafHost:
    """Pass a UART on to a listener, but for the time from `deaf_after` bytes until the node is half-way."""

    def __init__(self, deaf_after: int) -> None:
        self.uart, self._end = bounded_pair(BUFFER_BYTES)
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address = f"slcan:socket://127.0.0.1:{self._server.getsockname()[1]}"
        self._deaf_after = deaf_after
        self.node: Board | None = None
        self.lines = 0  # that have come out of the UART
        self._thread = threading.Thread(target=self._pass, daemon=True)
        self._thread.start()

    def _pass(self) -> None:
        listener, _ = self._server.accept()
        passed = 0
        with listener, self._end, self._server:
            self._end.sendall(listener.recv(64))  # the listener opens the channel, and says no more
            while data := self._end.recv(65536):
                self.lines += data.count(b"\r")
                with suppress(OSError):  # the listener leaves at the first closing frame
                    listener.sendall(data)
                before, passed = passed, passed + len(data)
                if before < self._deaf_after <= passed:
                    assert self.node is not None
                    self.node.half_way.wait(PATIENCE_S)

    def finish(self) -> int:
        """Wait until the UART is closed; returns the lines that came out of it."""
        self._thread.join(PATIENCE_S)
        return self.lines
