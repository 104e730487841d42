"""Find the files that a case names: inside its folder, unless whoever runs the diagnosis says otherwise."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath, PureWindowsPath

from aeolid.display import token
from aeolid.errors import DataError
from aeolid.formats.recording import files_of
from aeolid.output import note_input

OPTION = "--allow-outside"


def resolve(folder: Path, name: str, where: str, *, allow_outside: bool = False) -> Path:
    """Return the path of a file that `where` names relative to a case's folder; no output may replace it from then on.

    Absolute names, names with .. and links that lead out of the folder are refused before anything is opened, unless
    allow_outside; so are those of the files that are read with it, as the parts of a data set. Raises DataError.
    """
    if not name or "\0" in name:
        raise DataError(f"{where}: {token(name)!r} is no name of a file")
    path = folder / name
    if not allow_outside:
        absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).drive or name.startswith("\\")
        if absolute or ".." in PurePosixPath(name.replace("\\", "/")).parts:
            raise DataError(
                f"{where}: {token(name, 120)!r} lies outside the case's folder; copy the file into it, or allow it with"
                f" {OPTION}"
            )
        _require_within(folder, path, name, where)
    for companion in files_of(path):
        if not allow_outside:
            _require_within(folder, companion, companion.name, where)
        note_input(companion)
    return path


def _require_within(folder: Path, path: Path, name: str, where: str) -> None:
    """Refuse a path that leads out of a folder by a link."""
    if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
        raise DataError(
            f"{where}: {token(name, 120)!r} is a link that leads out of the case's folder; copy the file there, or"
            f" allow it with {OPTION}"
        )
