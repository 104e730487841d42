"""Kill a reception at random moments and see that what had arrived is on the disk, in every format.

    python tests/soak/kill.py [MOMENTS] [FORMAT…]

FORMAT: csv, csv.gz, parquet, mf4 (recordings), blf, log, parquet-log, mf4-log (raw logs). A child receives an honest
node and says after each look how many samples it has been given; it is killed (SIGKILL) at a moment drawn at random,
and what it leaves must hold all of them, bit for bit: NAME.part.csv with its roles file, the log itself, or its
.part.arrows.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
FORMATS = ("csv", "csv.gz", "parquet", "mf4", "blf", "log", "parquet-log", "mf4-log")
BATCH = 60


def receive_for_ever(kind: str, folder: Path) -> None:
    """Receive an honest node, batch by batch, and tell after each how many samples it has sent."""
    import hostile_nodes as hostile

    import aeolid.can.reception as module
    from aeolid.can.raw_log import open_raw_log
    from aeolid.can.runs import RunRecorder
    from aeolid.can.wire import SAMPLE

    module.LOOK_S = 0.0  # each batch is a second
    is_log = kind in ("blf", "log", "parquet-log", "mf4-log")
    log = open_raw_log(folder / f"bus.{kind.removesuffix('-log')}") if is_log else None
    recorder = RunRecorder(None if is_log else folder / f"r.{kind}")

    class Source:
        name, is_log, status, interruptions, ended = "given", True, "", 0, None

    reception = module.Reception(Source(), recorder, log, bit_rate=1e6, data_bit_rate=1e6)  # type: ignore[arg-type]
    samples = 0
    for frames in hostile.batches(hostile.honest(), BATCH):
        last = (frames.id >> 8 & 0xF == SAMPLE) & (frames.data[:, 0] == hostile.CHANNELS - 1)
        samples += int(np.count_nonzero(last))
        reception._take(hostile.dated(frames, 0))
        print(samples, flush=True)


def recover(kind: str, folder: Path) -> np.ndarray:
    """Return the rows of what was left (samples, channels), as a user would read them."""
    from aeolid.can.assembly import Assembly
    from aeolid.can.logs import open_log
    from aeolid.formats import read_record
    from aeolid.record import Roles

    if kind in FORMATS[:4]:
        (part,) = folder.glob("r.node200.run1.part.csv")
        record = read_record(part, Roles.load(folder / "r.node200.run1.roles.toml"))
        return record.values
    name = f"bus.{kind}" if kind in ("blf", "log") else "bus.part.arrows"
    source, assembly = open_log(str(folder / name)), Assembly()
    while source.ended is None:
        assembly.feed(source.read(0.0))
    assembly.close()
    now = assembly.nodes[200].now
    assert now is not None
    (table,) = now.samples.tables(1)
    return table.values


def kill_once(kind: str, folder: Path, generator: random.Random) -> str:
    """Kill one reception; returns what is wrong with what it left, empty where nothing is."""
    import hostile_nodes as hostile

    words = [sys.executable, __file__, "--child", kind, str(folder)]
    child = subprocess.Popen(words, stdout=subprocess.PIPE)
    assert child.stdout is not None
    told = 0
    for _ in range(generator.randint(2, 40)):
        told = int(child.stdout.readline())
    if generator.random() < 0.5:  # within the work of a batch, not only behind it
        child.stdout.readline(generator.randint(0, 1))
    child.send_signal(signal.SIGKILL)
    child.wait()
    child.stdout.close()
    values = recover(kind, folder)
    true = (np.arange(len(values)) % 4096)[:, None] + np.arange(hostile.CHANNELS) / 8
    whole = values[: max(told, 1)]
    if len(values) < told or not np.array_equal(whole, true[: len(whole)]):
        return f"{kind}: {len(values)} samples of {told} are left, or some are wrong"
    return ""


def main() -> int:
    """Kill and count."""
    if sys.argv[1:2] == ["--child"]:
        receive_for_ever(sys.argv[2], Path(sys.argv[3]))
        return 0
    moments = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    generator, failed = random.Random(7), 0
    for kind in sys.argv[2:] or FORMATS:
        bad = []
        for _ in range(moments):
            with tempfile.TemporaryDirectory() as folder:
                wrong = kill_once(kind, Path(folder), generator)
            bad += [wrong] if wrong else []
        failed += len(bad)
        print(
            f"{kind}: {moments - len(bad)} of {moments} whole" + "".join(f"\n  {text}" for text in bad[:3]), flush=True
        )
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
