"""Read of the channels that a roles file names those that a recording has: sensors that roam between recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from aeolid.errors import DataError
from aeolid.formats.headings import bare_heading, split_heading
from aeolid.formats.recording import read_chosen, read_record
from aeolid.record import Record, Roles


def read_setups(paths: Sequence[str | Path], roles: Roles) -> list[Record]:
    """Read recordings each with the channels of the roles file that it has, as `read_record`.

    Raises DataError on a channel that is in none of them, and on a recording that has none of the channels. Cost: two
    passes over each file.
    """
    known = [_present(path, roles) for path in paths]
    met = {name for names in known for name in names}
    missing = [c for c in roles.channels if c.name not in met and c.role != "ignore"]
    if missing:
        raise DataError(
            f"{roles.source}: channel {missing[0].name!r}: none of the {len(paths)} recordings has a column "
            f"{missing[0].heading!r}; correct the name, or give `column` its heading"
        )
    records = []
    for path, names in zip(paths, known, strict=True):
        channels = tuple(c for c in roles.channels if c.name in names)
        if not any(c.role == "output" for c in channels):
            raise DataError(f"{path}: none of the outputs that {roles.source} names is in it")
        record = read_record(path, replace(roles, channels=channels))
        records.append(replace(record, geometry=roles.geometry))
    return records


def _present(path: str | Path, roles: Roles) -> set[str]:
    """Return the names of the channels whose headings a file has."""
    found: set[str] = set()

    def choose(names: tuple[str, ...], clock: str | None) -> tuple[str, ...]:
        have = {n for heading in names for n in (heading, bare_heading(heading), split_heading(heading)[0])}
        found.update(c.name for c in roles.channels if c.role != "ignore" and c.heading in have)
        return names[:1]

    read_chosen(path, choose)
    return found
