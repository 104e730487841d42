"""Say what a fleet run is to do: which files, of which turbine and period, with which settings."""

from __future__ import annotations

import glob
import hashlib
import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from aeolid.durations import read_duration
from aeolid.errors import DataError, UsageError
from aeolid.fleet.keep import Keep
from aeolid.formats.recording import SUFFIXES
from aeolid.record import Roles

DAY = 86400.0
FORMAT = 2  # of the cached factors: one more where their content changes
EPOCH = 1e8  # times above this are seconds since 1970, below since some start of their own
_STAMPS = {8: "%Y%m%d", 10: "%Y%m%d%H", 12: "%Y%m%d%H%M", 14: "%Y%m%d%H%M%S"}


@dataclass(frozen=True)
class Plan:
    """Hold the settings of a run; order None means chosen for each turbine, window_s None one period for all."""

    roles: Roles
    past: int
    order: int | None
    feedthrough: tuple[str, ...]
    group: str | None
    window_s: float | None
    keep: tuple[Keep, ...] = ()

    def __post_init__(self) -> None:
        """Check the settings; raises UsageError or DataError naming the one that is wrong."""
        inputs, outputs = ([c.name for c in self.roles.channels if c.role == role] for role in ("input", "output"))
        if not inputs or not outputs:
            raise DataError(f"{self.roles.source}: no channel has the role {'input' if not inputs else 'output'!r}")
        if self.past < 1:
            raise UsageError(f"past window {self.past} is not at least 1")
        if self.order is not None and not 1 <= self.order <= self.past * len(outputs):
            raise UsageError(f"order {self.order} is not within 1 … {self.past * len(outputs)} (past window x outputs)")
        unknown = [name for name in self.feedthrough if name not in inputs]
        if unknown:
            raise UsageError(f"feedthrough of {unknown[0]!r}: no such input; the inputs are {', '.join(inputs)}")
        compile_group(self.group)
        if self.window_s is not None and "period" in _names(self.group):
            raise UsageError("--window and a group named period both say what a period is; leave one out")

    def cache_key(self, sha256: str) -> str:
        """Return the name of a recording's factor: content of the file, and all settings that change the factor."""
        channels = [(c.name, c.unit, c.role, c.heading) for c in self.roles.channels]
        clock = [self.roles.time_unit, self.roles.resample]
        facts = [FORMAT, sha256, self.past, channels, self.roles.sample_time_s, self.roles.time]
        facts += clock if clock != [None, None] else []  # keys of before these were known stay as they were
        facts += [[rule.text() for rule in self.keep]] if self.keep else []
        return hashlib.sha256(json.dumps(facts).encode()).hexdigest()

    def place(self, path: Path) -> tuple[str, str | None, float | None]:
        """Return turbine, period and start that a path says; period and start None where it says none.

        Raises DataError where the path does not match the pattern.
        """
        turbine = Path(os.path.abspath(path)).parent.name or "/"  # whatever folder the command is given in
        if self.group is None:
            return turbine, None, None
        found = re.search(self.group, path.as_posix())
        if found is None:
            raise DataError(f"{path}: does not match --group {self.group!r}")
        parts = found.groupdict()
        start = parts.get("start")
        return parts.get("turbine") or turbine, parts.get("period"), None if start is None else _stamp(start, path)

    def period_of(self, start_s: float) -> str:
        """Return the label of the period a start belongs to: its first second as a date, or as seconds."""
        if self.window_s is None:
            return "all"
        first = int(start_s // self.window_s) * self.window_s
        if abs(first) < EPOCH:
            return f"{first:.15g} s"
        return datetime.fromtimestamp(first, UTC).strftime("%Y-%m-%dT%H:%M:%S").removesuffix("T00:00:00")

    def to_json(self) -> dict[str, Any]:
        """Return the settings as JSON facts."""
        return {
            "roles": self.roles.source, "past": self.past, "order": self.order or "auto",
            "feedthrough": list(self.feedthrough), "group": self.group, "window_s": self.window_s,
            "keep": [rule.text() for rule in self.keep],
        }  # fmt: skip


def names_period(pattern: str | None) -> bool:
    """Say whether a pattern itself says what a period is."""
    compile_group(pattern)
    return "period" in _names(pattern)


def compile_group(pattern: str | None) -> None:
    """Check a pattern: valid, with a group named turbine, period or start; raises UsageError."""
    if pattern is None:
        return
    try:
        re.compile(pattern)
    except re.error as error:
        raise UsageError(f"--group {pattern!r} is no regular expression: {error}") from None
    if not _names(pattern) & {"turbine", "period", "start"}:
        raise UsageError(
            f"--group {pattern!r} names nothing; write (?P<turbine>…), (?P<period>…) or (?P<start>…) around a part"
        )


def parse_window(text: str) -> float:
    """Return the seconds of a length of time such as 1d, 6h, 30min; raises UsageError."""
    seconds = read_duration(text, bare=False) or 0.0
    if seconds < 1:  # periods are named by their first second
        raise UsageError(f"--window {text!r} is no length of time of a second or more; write for example 1d or 30min")
    return seconds


def find_recordings(given: Sequence[str], excluded: Path) -> list[Path]:
    """List the recordings of folders (searched to the bottom), patterns and files, each once, sorted.

    excluded: folder of the results, never searched. Raises DataError where an entry names nothing.
    """
    found: set[Path] = set()
    for entry in given:
        path = Path(entry)
        if path.is_dir():
            files = [p for p in path.rglob("*") if p.is_file() and p.name.lower().endswith(SUFFIXES)]
        elif path.is_file():
            files = [path]
        else:
            files = [Path(name) for name in glob.glob(entry, recursive=True) if Path(name).is_file()]
        files = [p for p in files if excluded.resolve() not in p.resolve().parents]
        if not files:
            raise DataError(f"{entry}: no recording there; known are {', '.join(SUFFIXES)}")
        found.update(files)
    first: dict[Path, Path] = {}
    for path in sorted(found):
        first.setdefault(path.resolve(), path)
    return list(first.values())


def _names(pattern: str | None) -> set[str]:
    return set(re.compile(pattern).groupindex) if pattern is not None else set()


def _stamp(text: str, path: Path) -> float:
    """Return the seconds since 1970 (UTC) of a date such as 20240131, 2024-01-31T10:20 or 20240131_102000."""
    digits = re.sub(r"\D", "", text)
    try:
        return datetime.strptime(digits, _STAMPS[len(digits)]).replace(tzinfo=UTC).timestamp()
    except (KeyError, ValueError):
        raise DataError(f"{path}: start {text!r} is no date; write it as 20240131 or 20240131_102000") from None
