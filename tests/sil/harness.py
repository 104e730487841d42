"""Run nodes and listeners as processes, with a relay between them that may damage what passes."""

from __future__ import annotations

import json
import os
import random
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

COMMAND = [sys.executable, "-m", "aeolid.cli.main"]
PATIENCE_S = 3600.0  # what waits in vain is ended; a busy machine is not
Damage = Callable[[bytes], list[bytes]]


@dataclass
class Finished:
    """Hold how a process ended."""

    code: int
    out: str
    err: str

    def assert_clean(self, code: int = 0) -> None:
        """Check the exit code, that no traceback was shown, and that a failure is told in one sentence."""
        assert self.code == code, (self.code, self.out, self.err)
        assert "Traceback" not in self.err + self.out, self.err
        if code:
            told = [line for line in self.err.splitlines() if line.startswith("aeolid: ")]
            assert len(told) == 1, self.err


def _heed_signals() -> None:
    """Undo what a shell or a service does to the tests it starts: their children would ignore signals for ever."""
    for kind in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(kind, signal.SIG_DFL)


class Process:
    """Own one aeolid process; killed when the test is over."""

    def __init__(self, *arguments: object) -> None:
        words = [*COMMAND, *map(str, arguments)]
        self.process = subprocess.Popen(
            words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True,
            preexec_fn=_heed_signals,
        )  # fmt: skip

    def first_line(self) -> str:
        """Read the first line of standard output."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline().strip()
        assert line, self.finish()
        return line

    def finish(self) -> Finished:
        """Wait for the end."""
        out, err = self.process.communicate(timeout=PATIENCE_S)
        return Finished(self.process.returncode, out, err)

    def child(self) -> int:
        """Return the process id of the compiled node."""
        pid = self.process.pid
        return int(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0])

    def signal(self, number: int) -> None:
        """Send a signal."""
        os.kill(self.process.pid, number)

    def close(self) -> None:
        """Make sure that nothing stays behind."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
        self.process.communicate()


class Relay:
    """Pass one listener's connection on to one or several nodes; each line from a node goes through `damage`.

    Lines of several nodes are merged whole, as frames on one bus. cut_after: lines after which the bus breaks off.
    """

    def __init__(self, addresses: Sequence[str], damage: Damage | None = None, cut_after: int | None = None) -> None:
        self._damage = damage or (lambda line: [line])
        self._cut_after = cut_after
        self._targets = [("127.0.0.1", int(a.rsplit(":", 1)[1])) for a in addresses]
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address = f"slcan:socket://127.0.0.1:{self._server.getsockname()[1]}"
        self.passed = 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        listener, _ = self._server.accept()
        nodes = [socket.create_connection(t) for t in self._targets]
        rest = dict.fromkeys(nodes, b"")
        try:
            while nodes:
                for ready in select.select([listener, *nodes], [], [], 1.0)[0]:
                    data = ready.recv(65536)
                    if ready is listener:
                        if not data:
                            return
                        for node in nodes:
                            node.sendall(data)
                        continue
                    if not data:
                        nodes.remove(ready)
                        continue
                    *lines, rest[ready] = (rest[ready] + data).split(b"\r")
                    if not self._pass(listener, lines):
                        return
        except OSError:
            pass
        finally:
            for s in (listener, self._server, *rest):
                s.close()

    def _pass(self, listener: socket.socket, lines: list[bytes]) -> bool:
        """Send damaged lines on; False when the bus is to break off now."""
        text = b""
        for line in lines:
            for piece in self._damage(line):
                text += piece + b"\r"
            self.passed += 1
            if self._cut_after is not None and self.passed >= self._cut_after:
                listener.sendall(text[:-10])  # in the middle of a frame
                return False
        listener.sendall(text)
        return True


def drop(share: float, seed: int) -> Damage:
    """Lose this share of the frames at random."""
    generator = random.Random(seed)
    return lambda line: [] if line.startswith(b"T") and generator.random() < share else [line]


def garble(share: float, seed: int) -> Damage:
    """Before, after or instead of this share of the frames put garbage, cut frames and frames with wrong digits."""
    generator = random.Random(seed)

    def damage(line: bytes) -> list[bytes]:
        if not line.startswith(b"T") or generator.random() >= share:
            return [line]
        noise = bytes(generator.randrange(256) for _ in range(generator.randrange(1, 60))).replace(b"\r", b"")
        at = generator.randrange(len(line))
        wrong = line[:at] + generator.choice(b"0123456789ABCDEF").to_bytes(1, "big") + line[at + 1 :]
        return generator.choice(
            [[noise, line], [line[: generator.randrange(26)]], [noise + line], [wrong], [line, noise]]
        )

    return damage


def listen(address: str, folder: Path, *options: object) -> tuple[Finished, dict[str, object]]:
    """Run a listener to its end; returns how it ended and what it reported."""
    report = folder / "listen.json"
    process = Process("listen", "--bus", address, "--json", report, *options)
    try:
        finished = process.finish()
    finally:
        process.close()
    return finished, json.loads(report.read_text()) if report.exists() else {}


def wait_for(condition: Callable[[], bool], seconds: float = PATIENCE_S) -> None:
    """Wait until a condition holds; the test fails when it never does."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def is_alive(pid: int) -> bool:
    """Tell whether a process runs (a zombie does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
