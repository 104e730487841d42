"""State how large a recording may be, and refuse what is larger before memory is taken for it.

One place for every format. A file is a claim: a few bytes of it can announce, or unpack into, more than any machine
holds. What a file unpacks into, samples and text alike, is bounded by its own size, and by this machine's memory.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

from aeolid.confined import Limits
from aeolid.errors import DataError

MIB = 1 << 20
# Recordings of machines pack 2 to 20 times, channels that stand still much better: 16 million numbers are free, beyond
# them 32 bytes for each byte of the file.
FLOOR, FACTOR = 128 * MIB, 32
MOST_CHANNELS = 1 << 16
MOST_NAME = 1 << 12  # characters of one heading
MOST_LINE = 1 << 20  # bytes of one line of text
LIBRARIES = 384 * MIB  # of memory that a confined reader takes before it opens a file
# Processor seconds of a confined reader, to begin with and for a MiB of the file. Imports take up to 3 s, blocks of
# samples 0.1 s a MiB; the frames of logs become one Python object each, a MiB of packed BLF holds 200,000 of them
# (3 s). Small computers and emulated ones take some ten times as long.
_SAMPLES_S, _FRAMES_S = (45, 8), (20, 30)


def memory_limit() -> int:
    """Return how many bytes one table may take: half the machine's memory."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2
    except (ValueError, OSError, AttributeError):
        return 4 << 30


def content_limit(path: str | Path) -> int:
    """Return how many bytes a file may unpack into: FLOOR and FACTOR times its size, at most `memory_limit`."""
    return min(memory_limit(), FLOOR + FACTOR * os.stat(path).st_size)


def reading_limits(path: str | Path) -> Limits:
    """Return what a confined reader of a table may use.

    Memory: LIBRARIES and twice what the file may unpack into (it is read, then handed over), at most half the
    machine's; processor time: 45 s, and 8 s for each MiB of the file.
    """
    return _limits(path, *_SAMPLES_S)


def log_limits(path: str | Path) -> Limits:
    """Return what a confined reader of a CAN log may use: as for a table, but 20 s, and 30 s for each MiB."""
    return _limits(path, *_FRAMES_S)


def _limits(path: str | Path, begin_s: float, per_mib_s: float) -> Limits:
    size, content = os.stat(path).st_size, content_limit(path)
    memory = LIBRARIES + min(2 * content, memory_limit())
    cpu_s = math.ceil(begin_s + per_mib_s * size / MIB)
    return Limits(memory, cpu_s, 60.0 + 10 * cpu_s, content + 32 * MIB, mapped=2048 * MIB + 2 * size)


def guard_size(source: str | Path, needed: int, most: int | None = None) -> None:
    """Refuse a table of `needed` bytes when it does not fit; the sentence says what to do.

    most: what the file may unpack into, where it is known already; None asks `content_limit`.
    """
    if needed > memory_limit():
        raise DataError(
            f"{source}: the wanted channels take {needed / 2**30:.1f} GiB, this machine can hold"
            f" {memory_limit() / 2**30:.1f} GiB; split the recording into several files and give them together"
        )
    bound = content_limit(source) if most is None else most
    if needed > bound:
        raise DataError(
            f"{source}: it unpacks into {needed / MIB:.0f} MiB, a file of its size may into {bound / MIB:.0f} MiB"
            f" ({FLOOR // MIB} MiB and {FACTOR} times its size); split the recording or save it uncompressed"
        )


def guard_names(source: str | Path, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the headings of a file; refuses more of them, or longer ones, than a recording has."""
    if len(names) > MOST_CHANNELS:
        raise DataError(f"{source}: {len(names)} channels, at most {MOST_CHANNELS} are read; export the ones needed")
    long = next((name for name in names if len(name) > MOST_NAME), None)
    if long is not None:
        raise DataError(
            f"{source}: a heading of {len(long)} characters begins with {long[:40]!r}, at most {MOST_NAME} are read;"
            " check the delimiter"
        )
    return names
