"""Unpack what of a functional mock-up unit is needed to run it here, within stated bounds."""

from __future__ import annotations

import stat
import zipfile
from pathlib import Path, PurePosixPath
from typing import IO

from aeolid.errors import DataError
from aeolid.inputs import open_regular

MOST_BYTES = 256 << 20  # unpacked: description, one platform's libraries and resources
MOST_FILES = 2_000
_MOST_ENTRIES = 20_000  # of the archive's directory, other platforms and sources included
_DESCRIPTION = "modelDescription.xml"
_MOST_DESCRIPTION = 16 << 20  # of 30,000 variables
_LIBRARIES = ("binaries/linux64/", "binaries/x86_64-linux/")
_BLOCK = 1 << 20


def unpack(path: Path, folder: Path) -> None:
    """Write description, Linux libraries and resources of a unit below an empty folder.

    Raises DataError where the file is no unit, has no library for Linux on 64 bits, names a file outside of itself,
    or unpacks to more than MOST_BYTES in MOST_FILES files; nothing beyond these is written.
    """
    try:
        with open_regular(path) as handle, zipfile.ZipFile(handle) as archive:
            wanted = _wanted(path, archive)
            left = MOST_BYTES
            for info in wanted:
                target = folder.joinpath(*PurePosixPath(info.filename).parts)
                target.parent.mkdir(parents=True, exist_ok=True)
                with archive.open(info) as source, open(target, "xb") as file:
                    left = _copy(path, source, file, left)
    except (zipfile.BadZipFile, zipfile.LargeZipFile, RuntimeError, EOFError, ValueError) as error:
        raise DataError(f"{path}: not a functional mock-up unit ({error})") from None
    except OSError as error:
        raise DataError(f"{path}: cannot be unpacked ({error.strerror or error})") from None


def _wanted(path: Path, archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """Return the entries to unpack, names and declared sizes checked."""
    entries = archive.infolist()
    if len(entries) > _MOST_ENTRIES:
        raise DataError(f"{path}: {len(entries)} entries, more than the {_MOST_ENTRIES} that a unit may have")
    names = [e.filename for e in entries]
    if _DESCRIPTION not in names:
        raise DataError(f"{path}: not a functional mock-up unit (it holds no {_DESCRIPTION})")
    if not any(n.startswith(_LIBRARIES) and n.endswith(".so") for n in names):
        built = sorted({n.split("/")[1] for n in names if n.startswith("binaries/") and n.count("/") > 1})
        told = ", ".join(b[:40] for b in built[:5]) or (
            "no platform, C sources only" if _has_sources(names) else "none"
        )
        raise DataError(f"{path}: built for {told}; a Linux 64-bit binary is needed")
    needed = (*_LIBRARIES, "resources/")
    wanted = [e for e in entries if e.filename == _DESCRIPTION or e.filename.startswith(needed)]
    wanted = [e for e in wanted if not e.is_dir()]
    for e in wanted:
        _check_entry(path, e)
    if len({e.filename for e in wanted}) < len(wanted):
        raise DataError(f"{path}: two entries have one name; the unit is damaged or crafted")
    size = sum(e.file_size for e in wanted)
    if len(wanted) > MOST_FILES or size > MOST_BYTES:
        raise DataError(
            f"{path}: unpacks to {size / 2**20:.0f} MiB in {len(wanted)} files, more than the {MOST_BYTES >> 20} MiB in"
            f" {MOST_FILES} files that a unit may have"
        )
    return wanted


def _check_entry(path: Path, entry: zipfile.ZipInfo) -> None:
    name, kind = PurePosixPath(entry.filename), stat.S_IFMT(entry.external_attr >> 16)
    strange = name.is_absolute() or ".." in name.parts or "\\" in entry.filename or "\0" in entry.filename
    if strange or kind not in (0, stat.S_IFREG):
        raise DataError(f"{path}: an entry is a link, or names a file outside of the unit; it is not unpacked")
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise DataError(f"{path}: an entry is neither stored nor deflated, which the standard asks for")
    if entry.filename == _DESCRIPTION and entry.file_size > _MOST_DESCRIPTION:
        raise DataError(
            f"{path}: {_DESCRIPTION} has {entry.file_size} bytes, more than the {_MOST_DESCRIPTION} allowed"
        )


def _copy(path: Path, source: IO[bytes], file: IO[bytes], left: int) -> int:
    """Copy at most `left` bytes, whatever the directory declared; returns how many are left."""
    while block := source.read(_BLOCK):
        left -= len(block)
        if left < 0:
            raise DataError(f"{path}: unpacks to more than {MOST_BYTES >> 20} MiB, and to more than it says")
        file.write(block)
    return left


def _has_sources(names: list[str]) -> bool:
    return any(n.startswith("sources/") and n.endswith(".c") for n in names)
