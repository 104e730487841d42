"""Let listen and monitor hear hostile traffic of all kinds beside an honest node; memory must stay bounded.

    python tests/soak/hostile_bus.py [SECONDS] [--rate 8000] [--folder FOLDER]

One device sends the same frames to both commands as slcan text over TCP on the loopback: an honest node, and all
attacks of tests/host/hostile_nodes.py between its frames. At the end both are asked to stop, and the recording of the
honest node is held against what it sent. Ends with 1 when a sample is missing or wrong, or memory went beyond LIMIT.
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
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
LIMIT = 700 << 20  # bytes of either process: 230 MB that modules take, 192 MB of nodes, files and modes
ADDRESS_SPACE = 6 << 30
HEX = np.frombuffer(b"0123456789ABCDEF", np.uint8)


def to_text(frames: object) -> bytes:
    """Write classic frames of eight bytes as lines of slcan."""
    n = len(frames)  # type: ignore[arg-type]
    out = np.empty((n, 27), np.uint8)
    out[:, 0], out[:, 9], out[:, 26] = ord("T"), ord("8"), 13
    ids = frames.id.astype(">u4").view(np.uint8).reshape(n, 4)  # type: ignore[attr-defined]
    out[:, 1:9:2], out[:, 2:9:2] = HEX[ids >> 4], HEX[ids & 15]
    data = frames.data[:, :8]  # type: ignore[attr-defined]
    out[:, 10:26:2], out[:, 11:26:2] = HEX[data >> 4], HEX[data & 15]
    return out.tobytes()


class Device:
    """Send the same text to every command that is connected, at the pace of a bus."""

    def __init__(self, listeners: int) -> None:
        """Open one port for each command."""
        self.servers = [socket.create_server(("127.0.0.1", 0)) for _ in range(listeners)]
        self.ports = [server.getsockname()[1] for server in self.servers]
        self.sent = 0
        self.samples = 0  # of the honest node

    def run(self, seconds: float, rate: float) -> None:
        """Wait for all, then send for so long; ends the honest stream on purpose."""
        import hostile_nodes as hostile

        from aeolid.can.wire import HEALTH, SAMPLE, STOPPED

        peers = [server.accept()[0] for server in self.servers]
        time.sleep(2.0)  # python-can throws away what comes while it opens an adapter
        began, size = time.monotonic(), max(int(rate // 50), 40)
        for frames in hostile.batches(hostile.interleaved(), size):
            text = to_text(frames)
            for peer in peers:
                peer.sendall(text)
            self.sent += len(frames)
            mine = frames.id == 0x1CFF4000 + (SAMPLE << 8) + hostile.HONEST
            self.samples += int(np.count_nonzero(mine & (frames.data[:, 0] == hostile.CHANNELS - 1)))
            if time.monotonic() - began >= seconds:
                break
            time.sleep(max(0.0, self.sent / rate - (time.monotonic() - began)))
        bye = to_text(hostile.encode([(hostile.HONEST, HEALTH, 0, STOPPED, self.samples)] * 3))
        for peer in peers:
            peer.sendall(bye)
        time.sleep(3.0)


def resident(pid: int) -> int:
    """Return the bytes of a process that are in memory."""
    with open(f"/proc/{pid}/statm") as handle:
        return int(handle.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def start(folder: Path, name: str, port: int) -> subprocess.Popen[bytes]:
    """Start listen or monitor with all its files."""
    import resource

    words = [str(Path(sys.executable).with_name("aeolid")), name, "--bus", f"slcan:socket://127.0.0.1:{port}"]
    words += ["--no-reconnect", "--bit-rate", "1000000", "--record", f"{name}.csv", "--json", f"{name}.json"]
    words += ["--log", "bus.blf", "--markov", "markov.npz"] if name == "listen" else ["--no-browser", "--port", "0"]
    limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))  # noqa: E731
    output = open(folder / f"{name}.out", "wb")  # noqa: SIM115 (the child's)
    return subprocess.Popen(words, cwd=folder, stdout=output, stderr=output, preexec_fn=limit)


def check(folder: Path, name: str, sent: int) -> str:
    """Hold the recording of the honest node against what it sent; returns what is wrong."""
    import hostile_nodes as hostile

    found = list(folder.glob(f"{name}-node{hostile.HONEST}*.csv"))
    if len(found) != 1:
        return f"{len(found)} recordings of the honest node"
    table = np.loadtxt(found[0], delimiter=",", skiprows=1)
    index = np.round(table[:, 0] / 0.1).astype(int)
    true = (index % 4096)[:, None] + np.arange(hostile.CHANNELS) / 8
    if len(table) != sent or (np.diff(index) != 1).any():
        return f"{len(table)} samples of {sent}"
    return "" if np.array_equal(table[:, 1:], true) else "wrong values"


def main() -> int:
    """Run and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", nargs="?", type=float, default=300.0)
    parser.add_argument("--rate", type=float, default=8000.0)
    parser.add_argument("--folder", type=Path)
    args = parser.parse_args()
    folder = args.folder or Path(tempfile.mkdtemp())
    names = ("listen", "monitor")
    device = Device(len(names))
    sending = threading.Thread(target=device.run, args=(args.seconds, args.rate), daemon=True)
    sending.start()
    children = {name: start(folder, name, port) for name, port in zip(names, device.ports, strict=True)}
    history: dict[str, list[int]] = {name: [] for name in names}
    while sending.is_alive():
        time.sleep(1.0)
        for name, child in children.items():
            if child.poll() is not None:
                print(f"{name} ended: {(folder / f'{name}.out').read_text()[-2000:]}")
                return 1
            history[name].append(resident(child.pid))
        if len(history["listen"]) % 30 == 0:
            told = ", ".join(f"{name} {sizes[-1] / 2**20:.0f} MB" for name, sizes in history.items())
            print(f"{len(history['listen'])} s: {device.sent} frames, {told}", flush=True)
    for child in children.values():
        child.send_signal(signal.SIGTERM)
    failed = False
    for name, child in children.items():
        code = child.wait()
        facts = json.loads((folder / f"{name}.json").read_text())
        sizes = np.array(history[name]) / 2**20
        wrong = check(folder, name, device.samples)
        failed |= bool(wrong) or sizes.max() * 2**20 > LIMIT
        half = len(sizes) // 2
        print(
            f"{name}: code {code}, {facts['frames']} of {device.sent + 3} frames, memory at most {sizes.max():.0f} MB"
            f" ({sizes[:half].max():.0f} MB in the first half), accounted"
            f" {facts['limits']['memory_bytes_most'] / 2**20:.1f} MB, {len(list(folder.iterdir()))} files;"
            f" honest node {wrong or f'{device.samples} samples, all there'}"
        )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
