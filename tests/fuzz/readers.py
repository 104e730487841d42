"""Damage files of every format a command reads, and look how each reader ends: it reads, it refuses, or it is at fault.

    python tests/fuzz/readers.py --count 2000          every reader, 2,000 damaged files each; a table
    python tests/fuzz/readers.py --only csv --at 417   one damaged file again, with the traceback; --keep FILE saves it

At fault is every exception but those of this package, a crash, a hang of more than 20 s of processor time, and memory
beyond 1 GiB. Crashes and hangs within a confined reader end as refusals, and are counted. The same number gives the
same file wherever the libraries that write the sound ones are the same.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import json
import logging
import os
import resource
import select
import signal
import sys
import tempfile
import time
import traceback
import zlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import forked
import mutations
import numpy as np
import seeds

SECONDS, WAIT_S, MEMORY = 20, 300, 1 << 30
OUTCOMES = ("ok", "refused", "contained", "fault")


@dataclass(frozen=True)
class Reader:
    """Say what is damaged, how, and which function of the package reads it. name: of the file, with its suffix."""

    name: str
    seed: Callable[[], bytes]
    mutate: mutations.Mutate
    read: Callable[[Path], Any]


def read_samples(path: Path) -> None:
    """Read a recording as a command does, with roles; then all of its channels."""
    from aeolid.errors import AeolidError
    from aeolid.formats import read_record, read_table
    from aeolid.record import Channel, Roles

    channels = (Channel("pitch", "deg", "input"), Channel("speed", "rpm", "output"))
    try:
        read_record(path, Roles(channels, None, "Time" if ".out" in path.name else "time_s", "roles.toml"))
    except AeolidError:
        if path.stat().st_size % 4 == 0:  # both for every reader, at half the time
            raise
    read_table(path)


def read_bus(path: Path) -> None:
    """Replay a CAN log into a recording."""
    from aeolid.can.recorder import read_log

    read_log(path)


def read_markov(path: Path) -> None:
    """Take Markov parameters for an identification."""
    from aeolid.identify.streamed import StreamedMarkov
    from aeolid.record import Channel, Record

    channels = (Channel("pitch", "deg", "input"), Channel("rate", "rpm", "output"))
    values = np.column_stack([seeds.PITCH, seeds.SPEED])
    record = Record(seeds.TIME, values, channels, 0.1, "a.csv", "0" * 64)
    streamed = StreamedMarkov.load(path)
    streamed.require_match([record], "varx", 4, ["pitch"], 1)
    streamed.innovation_of([record])


def read_roles(path: Path) -> None:
    """Read a recording with a roles file."""
    from aeolid.formats import read_record
    from aeolid.record import Roles

    read_record(_beside(path, "a.csv", seeds.table(".csv")), Roles.load(path))


def read_case(path: Path) -> None:
    """Load a case, or one of the files that it names."""
    from aeolid.diagnose.data.case import load_case

    _beside(path, "a.csv", seeds.table(".csv"))
    for name, text in {"roles.toml": seeds.ROLES, "model.toml": seeds.EQUATIONS, "case.toml": seeds.CASE}.items():
        if path.name != name:
            _beside(path, name, text.encode())
    load_case(path.parent)


def read_model(path: Path) -> None:
    """Load a model and run it on a recording."""
    from aeolid.formats import read_record
    from aeolid.models.load import load_model
    from aeolid.record import Roles

    table = _beside(path, "a.csv", seeds.table(".csv"))
    load_model(path).simulate(read_record(table, Roles.load(_beside(path, "roles.toml", seeds.ROLES.encode()))))


def _beside(path: Path, name: str, content: bytes) -> Path:
    target = path.with_name(name)
    if not target.exists():
        target.write_bytes(content)
    return target


def _toml() -> mutations.Mutate:
    import tomllib

    return mutations.typed(tomllib.loads, mutations.to_toml)


def _table(suffix: str, mutate: mutations.Mutate) -> Reader:
    return Reader(f"a{suffix}", lambda: seeds.table(suffix), mutate, read_samples)


def _log(suffix: str, mutate: mutations.Mutate) -> Reader:
    return Reader(f"bus{suffix}", lambda: seeds.log(suffix), mutate, read_bus)


READERS = {
    "csv": _table(".csv", mutations.text),
    "csv.gz": _table(".csv.gz", mutations.packed_text),
    "out": _table(".out", mutations.text),
    "outb": _table(".outb", mutations.damage),
    "npz": _table(".npz", mutations.archive),
    "mat": _table(".mat", mutations.matlab),
    "parquet": _table(".parquet", mutations.damage),
    "mf4": _table(".mf4", mutations.damage),
    "log": _log(".log", mutations.text),
    "asc": _log(".asc", mutations.text),
    "trc": _log(".trc", mutations.text),
    "blf": _log(".blf", mutations.blf),
    "mf4 of frames": _log(".mf4", mutations.damage),
    "parquet of frames": _log(".parquet", mutations.damage),
    "markov.npz": Reader("markov.npz", seeds.markov, mutations.archive, read_markov),
    "roles.toml": Reader("roles.toml", seeds.ROLES.encode, _toml(), read_roles),
    "case.toml": Reader("case.toml", seeds.CASE.encode, _toml(), read_case),
    "model.toml": Reader("model.toml", seeds.EQUATIONS.encode, _toml(), read_model),
    "model.json": Reader(
        "model.json", json.dumps(seeds.LINEAR).encode, mutations.typed(json.loads, json.dumps), read_model
    ),
}


def damaged(name: str, number: int) -> bytes:
    """Return damaged file `number` of a reader."""
    content = _seed(name)
    return READERS[name].mutate(content, np.random.default_rng([zlib.crc32(name.encode()), number]))


_SEEDS: dict[str, bytes] = {}


def _seed(name: str) -> bytes:
    if name not in _SEEDS:
        _SEEDS[name] = READERS[name].seed()
    return _SEEDS[name]


LIBRARIES = {"mat": "scipy.io", "parquet": "pyarrow.parquet", "parquet of frames": "pyarrow.parquet", "mf4": "asammdf",
             "mf4 of frames": "can", "blf": "can", "asc": "can", "log": "can", "trc": "can"}  # fmt: skip


def one(name: str, number: int, folder: Path) -> tuple[str, str]:
    """Read one damaged file; returns the outcome and what was said."""
    from aeolid.errors import AeolidError

    path = folder / READERS[name].name
    path.write_bytes(damaged(name, number))
    try:
        READERS[name].read(path)
    except AeolidError as error:
        text = str(error)
        if not text or "\n" in text:  # of a long one the command shows 2,000 characters
            return "fault", f"not one sentence: {text[:200]!r}"
        boxed = any(
            mark in text for mark in ("reader crashed", "did not come to an end", "of memory it may", "nonsense")
        )
        return ("contained" if boxed else "refused"), text[:300]
    except Exception:
        return "fault", traceback.format_exc()
    return "ok", ""


def serve(name: str, numbers: range, answer: int) -> None:
    """Read damaged files one after the other, and write what came of each to a pipe."""
    from aeolid.errors import AeolidError

    logging.disable()
    faulthandler.disable()  # a crash is told by its signal
    signal.signal(signal.SIGPROF, signal.SIG_DFL)  # ends the process: a fault
    for user in forked.USERS:
        __import__(user)
        sys.modules[user].start = forked.start  # type: ignore[attr-defined]
    if name in ("mf4", "mf4 of frames"):
        from aeolid.formats.mdf_blocks import forbid_formulas

        forbid_formulas()
    with tempfile.TemporaryDirectory() as folder:
        first = _first(name, Path(folder))  # libraries are loaded
        with contextlib.suppress(AeolidError):
            READERS[name].read(first)
        limit = forked.data_size() + MEMORY
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
        for number in numbers:
            os.write(answer, json.dumps([number]).encode() + b"\n")
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            found = one(name, number, Path(folder))
            signal.setitimer(signal.ITIMER_PROF, 0)
            os.write(answer, json.dumps([number, *found]).encode() + b"\n")


def _first(name: str, folder: Path) -> Path:
    path = folder / READERS[name].name
    path.write_bytes(_seed(name))
    if name in LIBRARIES:
        __import__(LIBRARIES[name])
    return path


def run(name: str, count: int, from_number: int = 0) -> tuple[Counter[str], dict[int, str]]:
    """Read `count` damaged files in a process that is started again when one ends it; returns outcomes and faults."""
    _seed(name)
    outcomes: Counter[str] = Counter()
    faults: dict[int, str] = {}
    at, end = from_number, from_number + count
    while at < end:
        reading, writing = os.pipe()
        pid = os.fork()
        if pid == 0:
            os.close(reading)
            try:
                serve(name, range(at, end), writing)
                os._exit(0)
            except BaseException:
                traceback.print_exc()
            os._exit(1)
        os.close(writing)
        done, why = _listen(reading, outcomes, faults)
        os.close(reading)
        if why:
            os.kill(pid, signal.SIGKILL)
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        if done is None and code == 0:
            break
        if done is None:
            raise RuntimeError(f"{name}: the reader of sound files ended with code {code}")
        if code != 0:
            faults[done] = why or (f"crash: {signal.Signals(-code).name}" if code < 0 else f"exit code {code}")
            outcomes["fault"] += 1
        at = done + 1
    return outcomes, faults


def _listen(pipe: int, outcomes: Counter[str], faults: dict[int, str]) -> tuple[int | None, str]:
    """Take what the process says until it ends; returns the last file it began, and why it is given up."""
    last, rest = None, b""
    while True:
        if not select.select([pipe], [], [], WAIT_S)[0]:
            return last, "hang"
        block = os.read(pipe, 1 << 16)
        if not block:
            return last, ""
        *lines, rest = (rest + block).split(b"\n")
        for line in lines:
            told = json.loads(line)
            last = told[0]
            if len(told) == 3:
                outcomes[told[1]] += 1
                if told[1] == "fault":
                    faults[last] = told[2]


def main() -> int:
    """Run the readers asked for and print a table; the exit code is 1 when one was at fault."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--count", type=int, default=2000, help="damaged files a reader")
    asked.add_argument("--from", dest="first", type=int, default=0, help="number of the first one")
    asked.add_argument("--only", action="append", choices=list(READERS), help="a reader; may be repeated")
    asked.add_argument("--at", type=int, help="read this one file in this process and say what came of it")
    asked.add_argument("--keep", type=Path, help="with --at: save the file")
    given = asked.parse_args()
    names = given.only or list(READERS)
    if given.at is not None:
        if given.keep:
            given.keep.write_bytes(damaged(names[0], given.at))
        with tempfile.TemporaryDirectory() as folder:
            print(*one(names[0], given.at, Path(folder)), sep="\n")
        return 0
    print(f"{'reader':18s} {'files':>6s} " + " ".join(f"{o:>9s}" for o in OUTCOMES) + "  seconds")
    bad = False
    for name in names:
        begun = time.monotonic()
        outcomes, faults = run(name, given.count, given.first)
        row = " ".join(f"{outcomes[o]:9d}" for o in OUTCOMES)
        print(f"{name:18s} {given.count:6d} {row}  {time.monotonic() - begun:.0f}", flush=True)
        for number, text in list(faults.items())[:5]:
            print(f"  --only '{name}' --at {number}: " + text.strip().replace("\n", "\n    "))
        bad |= bool(faults)
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
