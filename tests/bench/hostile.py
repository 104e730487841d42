"""Measure what a frame of each hostile device costs beside one of an honest node: processor time and memory.

    python tests/bench/hostile.py [--frames 40000] [--batch 400] [--modes] [--suffix .csv] [ATTACK…]

Each device has a process of its own, with at most 6 GB of address space. A full bus of 1 Mbit/s brings about 8,000
classic frames a second, so one core carries it below 125 µs a frame.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
LIMIT = 6 << 30  # bytes of address space


def frames_of(name: str, count: int, batch: int) -> Iterator[object]:
    """Yield the batches of an attack, dated."""
    import hostile_nodes as hostile

    from aeolid.can.wire import join_frames

    if name == "FD frames":
        fd = hostile.fd_frames()
        source = (join_frames([next(fd) for _ in range(max(batch // 14, 1))]) for _ in itertools.count())
    else:
        kinds = {**hostile.ATTACKS, "honest": hostile.honest, "mixed": hostile.mixed}
        source = hostile.batches(kinds[name](), batch)
    sent = 0
    for frames in source:
        yield hostile.dated(frames, sent)
        sent += len(frames)
        if sent >= count:
            return


class Given:
    """A source that delivers prepared batches, then ends."""

    name, is_log, status, interruptions = "given", False, "", 0
    ended: str | None = None

    def __init__(self, batches: list[object]) -> None:
        self._batches = iter(batches)

    def read(self, timeout: float) -> object:
        """Return the next batch."""
        from aeolid.can.wire import no_frames

        frames = next(self._batches, None)
        if frames is None:
            self.ended = "unplugged"
            return no_frames()
        return frames

    def close(self) -> None:
        """Do nothing."""


def receive(batches: list[object], modes: bool, suffix: str) -> tuple[Any, float, list[int], str]:
    """Receive batches as `listen` does; returns the reception, seconds of processor, sizes of files, how it ended."""
    import aeolid.can.reception as module
    from aeolid.can.reception import Reception
    from aeolid.can.runs import RunRecorder
    from aeolid.cli.listen_modes import ModeFollower

    with tempfile.TemporaryDirectory() as folder:
        recorder = RunRecorder(Path(folder) / f"r{suffix}", innovations=Path(folder))
        reception = Reception(Given(batches), recorder, bit_rate=1e6, data_bit_rate=2e6)  # type: ignore[arg-type]
        follower = ModeFollower(None, None, every_s=1.0, patient=False) if modes else None
        if follower is not None:
            reception.watch = follower.look
        reception.gather_s = 0.0  # as the batches are
        module.time = SimpleNamespace(monotonic=lambda: reception.frames / 8000.0)  # type: ignore[assignment]
        began = time.process_time()
        reason = reception.run(lambda: False, None, False)
        if follower is not None:
            follower.finish()
        for number in recorder.runs:
            recorder.name(number, f"-node{number}")
        spent = time.process_time() - began
        files = [e.stat().st_size for e in os.scandir(folder)]
    return reception, spent, files, reason


def measure(name: str, count: int, batch: int, modes: bool, suffix: str) -> dict[str, object]:
    """Receive one attack; returns microseconds of processor a frame, bytes and files."""
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT, LIMIT))
    import scipy.stats  # noqa: F401 (of the clock; loaded once, and no frame's cost)

    receive(list(frames_of("honest", 2000, batch)), modes, suffix)  # modules are loaded, machine code is made
    batches = list(frames_of(name, count, batch))
    frames = sum(len(b) for b in batches)  # type: ignore[arg-type]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    reception, spent, files, reason = receive(batches, modes, suffix)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    held = getattr(reception, "memory", None)
    return {
        "attack": name, "frames": frames, "us": 1e6 * spent / max(reception.frames, 1),
        "grown_mb": (peak - before) / 1024,
        "peak_mb": peak / 1024, "files": len(files), "file_mb": sum(files) / 1e6, "ended": reception.fault or reason,
        "held_mb": None if held is None else held.peak / 1e6,
    }  # fmt: skip


def main() -> int:
    """Measure and print a table."""
    import hostile_nodes as hostile

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=40_000)
    parser.add_argument("--batch", type=int, default=400)
    parser.add_argument("--modes", action="store_true")
    parser.add_argument("--suffix", default=".csv")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    parser.add_argument("attacks", nargs="*")
    args = parser.parse_args()
    if args.one:
        print(json.dumps(measure(args.one, args.frames, args.batch, args.modes, args.suffix)))
        return 0
    names = args.attacks or ["honest", *hostile.ATTACKS, "FD frames", "mixed"]
    print(f"{'attack':20}{'µs/frame':>10}{'ratio':>8}{'grown MB':>10}{'held MB':>9}{'files':>7}{'file MB':>9}  ended")
    usual = None
    options = ["--frames", str(args.frames), "--batch", str(args.batch), "--suffix", args.suffix] + [
        "--modes"
    ] * args.modes
    for name in names:
        done = subprocess.run(
            [sys.executable, __file__, *options, "--one", name], capture_output=True, text=True, timeout=1200
        )
        if done.returncode:
            print(f"{name:20} failed: {(done.stderr.strip().splitlines() or [str(done.returncode)])[-1]}")
            continue
        told = json.loads(done.stdout)
        usual = usual or told["us"]
        held = "" if told["held_mb"] is None else f"{told['held_mb']:.1f}"
        print(
            f"{name:20}{told['us']:10.1f}{told['us'] / usual:8.1f}{told['grown_mb']:10.1f}{held:>9}{told['files']:7d}"
            f"{told['file_mb']:9.1f}  {told['ended']}", flush=True,
        )  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
