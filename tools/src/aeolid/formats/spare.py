"""Keep some room on the disk, so that a file can be ended in good order when the disk is full."""

from __future__ import annotations

import errno
import io
import os
import tempfile
from pathlib import Path
from typing import Any

from aeolid.output import create

SPARE = 4 << 20  # bytes: the last part of a Parquet file and its footer, a container of BLF, some seconds of text
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)


class SpareFile(io.FileIO):
    """Write a file unbuffered; the first write that finds no room is repeated in the room kept, and sets `full`."""

    def __init__(self, path: Path) -> None:
        """Create the file, and beside it a nameless one that holds the room. Raises OSError."""
        super().__init__(path, "w+", opener=lambda name, _: create(Path(name)))
        self.full = False
        self._spare = self._keep(path.parent)

    @staticmethod
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

    def write(self, data: Any) -> int:
        """Write some or all of the data; returns how much. Raises OSError when even the kept room is used up."""
        try:
            return self._write(data)
        except OSError as error:
            if error.errno not in _NO_ROOM or self._spare is None:
                raise
            self.full = True
            self._release()
            return self._write(data)

    def _write(self, data: Any) -> int:
        return super().write(data)

    def _release(self) -> None:
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None

    def close(self) -> None:
        """Close the file and give the room back."""
        self._release()
        super().close()
