"""Let a full bus of hostile devices meet `listen` and `monitor` for a while, an honest node among them.

    python tests/studies/hostile_bus.py [--minutes 30] [--rate 8000] [--share 0.1] [--out FOLDER]

All attacks of tests/host/hostile_nodes.py, interleaved, each under numbers of its own, go to both commands as text of
an slcan adapter, at the rate of a full bus of 1 Mbit/s or as fast as the slower one takes them; clients that say
nothing hold the monitor's page. Every ten seconds a line tells frames sent, resident memory and processor of both. In
the end the bus breaks off: both must end, and of the honest node both recordings must have every sample, bit for bit.
Exit code 1 where one has not. Rows are kept as hostile_bus.json.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "host"))

import hostile_nodes as hostile  # noqa: E402

BATCH = 2000  # frames sent at a time
IDLE = 40  # connections that say nothing, opened with every line of the table


def spelled(frames: hostile.Frames) -> bytes:
    """Spell classic frames with 29 bits as an slcan adapter does."""
    texts = frames.data.tobytes().hex().upper()
    return b"".join(b"T%08X8%s\r" % (i, texts[16 * k : 16 * k + 16].encode()) for k, i in enumerate(frames.id.tolist()))


class Adapter:
    """An slcan adapter on TCP for one listener."""

    def __init__(self) -> None:
        """Open a port of the loopback."""
        self.server = socket.create_server(("127.0.0.1", 0))
        self.bus = f"slcan:socket://127.0.0.1:{self.server.getsockname()[1]}"

    def plug(self) -> None:
        """Wait for the listener and for its command to open the channel."""
        self.peer, _ = self.server.accept()
        told = b""
        while b"O\r" not in told:
            told += self.peer.recv(64)

    def unplug(self) -> None:
        """Break off: what was sent still arrives, and nobody connects again."""
        self.server.close()
        self.peer.shutdown(socket.SHUT_WR)
        while self.peer.recv(4096):
            pass
        self.peer.close()


def usage(pid: int) -> tuple[float, float]:
    """Return resident MB at the most so far and processor seconds of a process."""
    with suppress(OSError, StopIteration):
        status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
        peak = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM"))
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return peak / 1024, (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return float("nan"), float("nan")


def start(folder: Path, command: str, bus: str, *more: str) -> subprocess.Popen[str]:
    """Start `aeolid listen` or `monitor` with its recording in a folder."""
    words = [sys.executable, "-m", "aeolid.cli.main", command, "--bus", bus, "--record", str(folder / f"{command}.csv")]
    with (folder / f"{command}.txt").open("w") as log:
        return subprocess.Popen(
            [*words, *more], stdout=subprocess.PIPE if command == "monitor" else log, stderr=log, text=True,
            stdin=subprocess.DEVNULL,
        )  # fmt: skip


def complete(path: Path, samples: int) -> bool:
    """Tell whether a recording has every sample of the honest node, bit for bit."""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    index = np.round(table[:, 0] / 0.1).astype(int)
    expected = np.arange(samples)[:, None] % 4096 + np.arange(hostile.CHANNELS) / 8
    return np.array_equal(index, np.arange(samples)) and np.array_equal(table[:, 1:], expected)


def traffic(share: float) -> Iterator[tuple[list[hostile.Row], int]]:
    """Return batches of frames with the number of the honest node's samples that are sent by their ends."""
    rows, samples = hostile.interleaved(share), -1  # the description comes first
    while True:
        batch: list[hostile.Row] = []
        while len(batch) < BATCH:
            for part in islice(rows, 2):  # the honest node's, and those of all others
                batch += part
            samples += 1
        yield batch, samples


def besieged(page: str, held: list[socket.socket]) -> None:
    """Open connections to the page that say nothing; the oldest are let go."""
    host, _, port = page.partition("//")[2].rstrip("/").partition(":")
    for _ in range(IDLE):
        with suppress(OSError):
            held.append(socket.create_connection((host, int(port)), timeout=3600))
    for peer in held[: -10 * IDLE]:
        peer.close()
    del held[: -10 * IDLE]


def run(folder: Path, minutes: float, rate: float, share: float) -> dict[str, Any]:
    """Run both commands against the traffic; returns what was measured."""
    adapters = {"listen": Adapter(), "monitor": Adapter()}
    processes = {
        "listen": start(folder, "listen", adapters["listen"].bus, "--no-reconnect"),
        "monitor": start(folder, "monitor", adapters["monitor"].bus, "--port", "0", "--no-browser"),
    }
    output = processes["monitor"].stdout
    assert output is not None
    page = next(word for word in output.readline().split() if word.startswith("http"))
    for adapter in adapters.values():
        adapter.plug()
    begun, said, sent, samples = time.monotonic(), 0.0, 0, 0
    held: list[socket.socket] = []
    lines: list[dict[str, Any]] = []
    for batch, samples in traffic(share):
        text = spelled(hostile.encode(batch))
        for adapter in adapters.values():
            adapter.peer.sendall(text)
        sent += len(batch)
        since = time.monotonic() - begun
        if since - said >= 10:
            said = since
            besieged(page, held)
            facts = {n: usage(p.pid) for n, p in processes.items()}
            lines.append({"s": since, "frames": sent, "samples": samples} | facts)
            told = "  ".join(f"{n} {mb:.0f} MB {cpu:.0f} s" for n, (mb, cpu) in facts.items())
            print(f"{since:6.0f} s  {sent / since:6.0f} frames/s  {told}", flush=True)
        if since > 60 * minutes:
            break
        time.sleep(max(0.0, sent / rate - since))
    used = {n: usage(p.pid) for n, p in processes.items()}
    for adapter in adapters.values():
        adapter.unplug()
    processes["monitor"].send_signal(signal.SIGTERM)  # the page stays until it is told
    codes = {n: p.wait(timeout=3600) for n, p in processes.items()}
    whole = {n: complete(folder / f"{n}-node{hostile.HONEST}.csv", samples) for n in processes}
    for peer in chain(held):
        peer.close()
    return {
        "seconds": time.monotonic() - begun, "frames": sent, "honest_samples": samples, "exit_codes": codes,
        "peak_mb_and_processor_s": used, "honest_complete": whole, "lines": lines,
        "bytes_written": sum(f.stat().st_size for f in folder.iterdir() if f.is_file()),
        "files": len(list(folder.iterdir())),
    }  # fmt: skip


def main() -> int:
    """Run the study and print what it found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=30.0, help="how long")
    parser.add_argument("--rate", type=float, default=hostile.BUS_RATE, help="frames a second at the most")
    parser.add_argument("--share", type=float, default=0.1, help="of the frames, the honest node's")
    parser.add_argument("--out", type=Path, help="folder of the recordings; default a temporary one")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.out or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        found = run(folder, options.minutes, options.rate, options.share)
        (folder / "hostile_bus.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    del found["lines"]
    print(json.dumps(found, indent=1))
    return 0 if all(found["honest_complete"].values()) else 1


if __name__ == "__main__":
    sys.exit(main())
