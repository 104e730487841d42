"""A fixed sample of damaged files of every format; `tests/fuzz/readers.py` reads thousands in the nightly run.

Confined readers take ten times as long for a file as our own: fewer of theirs.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fuzz_modules import mutations, readers

from aeolid.errors import DataError

CONFINED = {"mat", "parquet", "mf4", "log", "asc", "trc", "blf", "mf4 of frames", "parquet of frames"}


@pytest.mark.parametrize("name", readers.READERS)
def test_damaged_files_are_read_or_refused(name: str) -> None:
    outcomes, faults = readers.run(name, 12 if name in CONFINED else 40)
    assert not faults, next(iter(faults.values()))
    assert outcomes.total() == (12 if name in CONFINED else 40)


def test_a_number_is_always_the_same_file_and_most_files_are_damaged() -> None:
    for name in ("csv", "npz", "roles.toml"):
        files = [readers.damaged(name, k) for k in range(30)]
        assert files == [readers.damaged(name, k) for k in range(30)]
        assert len(set(files)) > 20


def crash(path: Path) -> None:
    """End as readers must not: by the content of the file."""
    import ctypes
    import os

    kind = path.read_bytes()[:1]
    if kind == b"c":
        ctypes.string_at(0)
    if kind == b"e":
        os._exit(3)
    if kind == b"m":
        np.ones(1 << 29)
    if kind == b"t":
        raise KeyError("a")
    if kind == b"l":
        raise DataError("two\nlines")
    if kind == b"r":
        raise DataError("a.bin: refused")
    if kind == b"x":
        raise DataError("a.bin: its reader crashed, SIGSEGV")


def test_the_harness_can_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    """A crash, an exit, too much memory, a traceback and two lines are faults, and the rest goes on."""
    kinds = b"ocemtlrx"
    reader = readers.Reader("a.bin", lambda: b"o", lambda content, random: content, crash)
    monkeypatch.setitem(readers.READERS, "bin", reader)
    monkeypatch.setattr(readers, "damaged", lambda name, number: kinds[number : number + 1])
    outcomes, faults = readers.run("bin", len(kinds))
    assert outcomes == {"ok": 1, "fault": 5, "refused": 1, "contained": 1}
    assert "SIGSEGV" in faults[1] and "code 3" in faults[2] and "MemoryError" in faults[3]
    assert "KeyError" in faults[4] and "one sentence" in faults[5]


def test_every_way_of_damage_leaves_bytes() -> None:
    random = np.random.default_rng(5)
    for mutate in (mutations.damage, mutations.text):
        for size in (0, 1, 2, 30):
            assert all(isinstance(mutate(bytes(size), random), bytes) for _ in range(40))
