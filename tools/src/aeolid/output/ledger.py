"""Remember which files a command wrote, so that running it again may replace them and nothing else.

A hidden text file beside the outputs, `.aeolid`, holds one line of JSON for each file written: its name, the command
and option that wrote it, and the SHA-256 of its bytes. A file whose bytes are not those any more is somebody's work.
A ledger that others planted can speak only for files that lie beside it, byte for byte as it says.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

NAME = ".aeolid"
MOST = 1 << 20  # bytes of a ledger that are believed; a longer one is none of ours
TIDY = 1 << 16  # bytes after which only the newest line of each file is kept


@dataclass(frozen=True)
class Entry:
    """Hold one line: file (relative to the ledger's folder), label of the call that wrote it, hash of the bytes."""

    file: str
    label: str
    sha256: str

    def line(self) -> bytes:
        """Return the entry as a line of the ledger."""
        return ("\n" + json.dumps(self.__dict__, sort_keys=True)).encode()  # whatever was cut off before ends here


def digest(handle: BinaryIO) -> str:
    """Return the SHA-256 of a file from its beginning to its end, in hexadecimal."""
    handle.seek(0)
    total = hashlib.sha256()
    while block := handle.read(1 << 20):
        total.update(block)
    return total.hexdigest()


def entries(folder: Path) -> list[Entry]:
    """Return the lines of a folder's ledger, oldest first; none where there is no regular file of that name."""
    try:
        handle = os.open(folder / NAME, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return []
    with open(handle, "rb") as file:
        facts = os.fstat(handle)
        if not stat.S_ISREG(facts.st_mode) or facts.st_size > MOST:
            return []
        return list(_read(file.read(MOST)))


def _read(content: bytes) -> Iterator[Entry]:
    for line in content.splitlines():
        try:
            found = json.loads(line)
            if isinstance(found, dict):
                yield Entry(str(found["file"]), str(found["label"]), str(found["sha256"]))
        except (ValueError, KeyError, RecursionError):
            continue  # a line that was cut off


def add(folder: Path, entry: Entry) -> None:
    """Write a line at the end of a folder's ledger. Raises OSError."""
    known = entries(folder)
    if entry in known:
        return
    path = folder / NAME
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    handle = os.open(path, flags, 0o666)
    try:
        facts = os.fstat(handle)
        if not stat.S_ISREG(facts.st_mode):
            raise FileExistsError(17, f"{NAME} is no regular file", str(path))
        if facts.st_size <= TIDY:
            os.write(handle, entry.line())
            return
    finally:
        os.close(handle)
    newest = {(e.file, e.label): e for e in [*known, entry]}
    partial = path.with_name(f"{NAME}.{os.urandom(8).hex()}.part")
    handle = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
    try:
        with open(handle, "wb") as file:
            file.writelines(e.line() for e in newest.values())
        os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
