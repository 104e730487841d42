"""Keep some room on the disk, so that a file can be ended in good order when the disk is full."""

from __future__ import annotations

import errno
import io
import os
import tempfile
from pathlib import Path
from typing import Any, ClassVar

from aeolid.output import create

SPARE = 4 << 20  # bytes: the last part of a Parquet file and its footer, a container of BLF, some seconds of text
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)


class _Shared:
    """Reserve room in a folder, once for all files that are written there: hundreds of nodes need no more."""

    _known: ClassVar[dict[Path, _Shared]] = {}

    def __init__(self, folder: Path) -> None:
        self._folder, self._users = folder, 0
        self._spare: int | None = None
        self._gone = False  # it was needed: every file of the folder may use what is there now

    @classmethod
    def of(cls, folder: Path) -> _Shared:
        """Return the room of a folder, reserved with its first user."""
        key = folder.resolve()
        shared = cls._known.setdefault(key, cls(key))
        shared._users += 1
        if shared._users == 1:
            shared._spare, shared._gone = _keep(folder), False
        return shared

    def give_back(self) -> bool:
        """Give the room back because the disk is full; False where there was none."""
        if self._spare is not None:
            os.close(self._spare)
            self._spare, self._gone = None, True
        return self._gone

    def leave(self) -> None:
        """Note that one file less needs it."""
        self._users -= 1
        if self._users == 0:
            self._known.pop(self._folder, None)
            if self._spare is not None:
                os.close(self._spare)
                self._spare = None


def _keep(folder: Path) -> int | None:
    """Reserve room; None where the file system cannot (then a full disk ends the file where it stands)."""
    try:
        spare, name = tempfile.mkstemp(dir=folder)
    except OSError:
        return None
    try:
        os.unlink(name)
        os.posix_fallocate(spare, 0, SPARE)
        return spare
    except OSError:
        os.close(spare)
        return None


class SpareFile(io.FileIO):
    """Write a file unbuffered; the first write that finds no room is repeated in the room kept, and sets `full`."""

    def __init__(self, path: Path) -> None:
        """Create the file, and beside it a nameless one that holds the room. Raises OSError."""
        super().__init__(path, "w+", opener=lambda name, _: create(Path(name)))
        self.full = False
        self._shared = _Shared.of(path.parent)

    @property
    def _spare(self) -> int | None:
        """Return the handle of the room kept, None once it was given back."""
        return self._shared._spare

    def write(self, data: Any) -> int:
        """Write some or all of the data; returns how much. Raises OSError when even the kept room is used up."""
        try:
            return self._write(data)
        except OSError as error:
            if error.errno not in _NO_ROOM or not self._shared.give_back():
                raise
            self.full = True
            return self._write(data)

    def _write(self, data: Any) -> int:
        return super().write(data)

    def close(self) -> None:
        """Close the file and give the room back with the last one of its folder."""
        if not self.closed:
            self._shared.leave()
        super().close()
