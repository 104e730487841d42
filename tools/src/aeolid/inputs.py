"""Open the files that a user or a case names: regular files alone, so that none of them can block or never end."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

from aeolid.errors import DataError

_KINDS = {
    stat.S_IFDIR: "a folder; name the file in it", stat.S_IFIFO: "a pipe; write what comes from it to a file first",
    stat.S_IFCHR: "a device; name a file", stat.S_IFBLK: "a device; name a file",
    stat.S_IFSOCK: "a socket; name a file",
}  # fmt: skip


def regular_size(path: str | Path) -> int:
    """Return the size of a regular file in bytes, without opening it.

    Links are followed. Raises DataError where there is no such file, or a folder, pipe, device or socket in its place.
    """
    try:
        return _size(path, os.stat(path))
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: {_reason(error)}") from None


def open_regular(path: str | Path) -> BinaryIO:
    """Open a regular file for reading, as bytes.

    Raises DataError as `regular_size` does, also when the file is exchanged for a pipe between the look and the
    opening: it is opened so that a pipe does not wait, and looked at once more.
    """
    regular_size(path)
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: {_reason(error)}") from None
    try:
        _size(path, os.fstat(descriptor))
        os.set_blocking(descriptor, True)
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def read_bounded(path: str | Path, most: int) -> bytes:
    """Return the content of a regular file; raises DataError where it is longer than `most` bytes."""
    with open_regular(path) as handle:
        content = handle.read(most + 1)
    if len(content) > most:
        raise DataError(f"{path}: longer than {most} bytes; a file of this kind never is")
    return content


def _size(path: str | Path, status: os.stat_result) -> int:
    kind = stat.S_IFMT(status.st_mode)
    if kind != stat.S_IFREG:
        raise DataError(f"{path}: {_KINDS.get(kind, 'no regular file')}")
    return status.st_size


def _reason(error: Exception) -> str:
    if isinstance(error, FileNotFoundError):
        return "no such file"
    return getattr(error, "strerror", None) or "not a name that a file can have"
