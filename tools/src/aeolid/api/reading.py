"""Read recordings from files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from aeolid.api.record import Record
from aeolid.api.session import public
from aeolid.errors import DataError, UsageError
from aeolid.record import ROLES, Channel, Roles, check_resample, check_spelling


@public
def read(
    path: str | Path, roles: str | Path | Roles | Mapping[str, Any], *, resample: float | str | None = None
) -> Record:
    """Read a recording: CSV, Parquet, MAT, NPZ, MDF4, OpenFAST's .out and .outb, or a CAN log.

    Parameters
    ----------
    path : str or pathlib.Path
        The file.
    roles : str, pathlib.Path, aeolid.record.Roles or mapping
        What the channels are: a roles file (TOML), or channel to role or to (role, unit), for example
        {"pitch": ("input", "deg"), "rotor_speed": ("output", "rpm")}; other columns are not read.
    resample : float or str, optional
        Brings channels of several rates, or uneven ones, to one sample time in seconds, or "auto": the slowest.

    Returns
    -------
    Record

    Raises
    ------
    DataError
        Where the file is missing, unreadable or inconsistent; the text names file, channel and sample.
    UsageError
        Where `path` or `roles` has another type.
    """
    from aeolid.formats import read_record

    if not isinstance(path, str | Path):
        raise UsageError(f"path is a {type(path).__name__}; a str or pathlib.Path is needed, one file a recording")
    wanted = _roles(roles)
    if resample is not None:
        check_resample(resample, f"resample = {resample!r}")
        wanted = replace(wanted, resample=resample)
    return Record.of_core(read_record(path, wanted))


def _roles(given: Any) -> Roles:
    if isinstance(given, Roles):
        return given
    if isinstance(given, str | Path):
        return Roles.load(given)
    if not isinstance(given, Mapping):
        raise UsageError(f"roles is a {type(given).__name__}; the name of a roles file or a mapping is needed")
    channels = []
    for name, entry in given.items():
        pair = (entry,) if isinstance(entry, str) else entry
        if not isinstance(pair, tuple | list) or not 1 <= len(pair) <= 2 or not all(isinstance(t, str) for t in pair):
            raise UsageError(f'roles: {name!r} has {entry!r}; a role, or role and unit, is needed: ("input", "deg")')
        role, unit = (*pair, "")[:2]
        if role not in ROLES:
            raise DataError(f"roles: {name!r} has the role {role!r}, which is none of {', '.join(ROLES)}")
        check_spelling(unit, str(name), "roles")
        channels.append(Channel(str(name), str(unit), role))
    if not channels:
        raise UsageError("roles names no channel; name at least one input and one output")
    return Roles(tuple(channels), None, None, "roles")
