"""Write a file whole or not at all: a new file beside the target takes its place when all of it is on the disk.

The new file is created with O_EXCL and O_NOFOLLOW under a name nobody can foresee, gets the mode the umask leaves (or
that of the file it replaces), and is removed again whatever goes wrong, so that the old file stays as it was. A link is
never written through: neither one with the target's own name, nor an output folder that is one, nor one below it.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from aeolid.errors import UsageError
from aeolid.output import ledger
from aeolid.output.call import Output, current

_NEW = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC
_LINK = "is a link; name the file or folder itself"
_unfinished: set[Path] = set()


def cannot(path: str | Path, error: OSError) -> UsageError:
    """Build the refusal of a place that cannot be written to."""
    return UsageError(f"{path}: cannot be written ({error.strerror or error})")


def check_file(path: Path, *, own: bool = False) -> os.stat_result | None:
    """Refuse a target that must not or cannot be written; returns what stands there now. Raises UsageError.

    own: the file lies in a cache of the tool's, where what stands there may always be replaced.
    """
    try:
        folder = path.parent.stat()
    except OSError as error:
        if isinstance(error, FileNotFoundError):
            raise UsageError(f"{path}: cannot be written (the folder {path.parent} does not exist)") from None
        raise cannot(path, error) from None
    if not stat.S_ISDIR(folder.st_mode):
        raise UsageError(f"{path}: cannot be written ({path.parent} is no folder)")
    _refuse_links(path.parent)
    try:
        facts = path.lstat()
    except FileNotFoundError:
        if not os.access(path.parent, os.W_OK | os.X_OK):
            raise UsageError(f"{path}: cannot be written (the folder is read-only)") from None
        return None
    except OSError as error:
        raise cannot(path, error) from None
    if stat.S_ISLNK(facts.st_mode):
        raise UsageError(f"{path}: {_LINK}")
    if stat.S_ISDIR(facts.st_mode):
        raise UsageError(f"{path}: is a folder; name a file in it")
    if stat.S_ISCHR(facts.st_mode):
        return facts
    if not stat.S_ISREG(facts.st_mode):
        raise UsageError(f"{path}: is no regular file; name another output")
    call = current()
    try:
        if call is not None and not own:
            call.may_replace(path, facts)
    except OSError as error:
        raise cannot(path, error) from None
    return facts


@contextmanager
def replacing(path: str | Path, *, durable: bool = True, own: bool = False) -> Iterator[BinaryIO]:
    """Open a binary file that takes the name `path` when the block ends well; otherwise nothing has changed.

    durable: wait until the disk has it; own: in a cache of the tool's, of which no account is kept. Raises UsageError
    where the place cannot or must not be written.
    """
    target = Path(path)
    before = check_file(target, own=own)
    if before is not None and stat.S_ISCHR(before.st_mode):
        with _told(target), open(os.open(target, os.O_WRONLY | os.O_NOFOLLOW), "wb") as device:
            yield device
        return
    with _told(target), _opened(target.parent) as folder:
        name = f".{target.name[:60]}.{os.urandom(8).hex()}.part"
        partial = target.with_name(name)
        handle = os.open(name, _NEW, 0o666, dir_fd=folder)
        _unfinished.add(partial)
        try:
            with open(handle, "w+b") as file:
                if before is not None:
                    os.fchmod(file.fileno(), stat.S_IMODE(before.st_mode))
                yield file
                file.flush()
                if durable:
                    os.fsync(file.fileno())
                if not own:
                    _list(target, file)
            os.replace(name, target.name, src_dir_fd=folder, dst_dir_fd=folder)
        except BaseException:
            os.unlink(name, dir_fd=folder)
            raise
        finally:
            _unfinished.discard(partial)
        if durable:
            _sync(folder)


def write_text(path: str | Path, text: str, *, durable: bool = True, own: bool = False) -> None:
    """Write a text as UTF-8, as `replacing` does; half a surrogate pair is written out. Raises UsageError."""
    with replacing(path, durable=durable, own=own) as handle:
        handle.write(text.encode("utf-8", errors="backslashreplace"))


def write_json(path: str | Path, facts: Any, *, durable: bool = True, own: bool = False) -> None:
    """Write facts as JSON, as `replacing` does. Raises UsageError, ValueError on a number that JSON does not have."""
    write_text(path, json.dumps(facts, indent=1, allow_nan=False) + "\n", durable=durable, own=own)


@contextmanager
def private_path(path: str | Path) -> Iterator[Path]:
    """Give a writer that wants a name one in a folder nobody else can enter; the file then takes the name `path`.

    Raises UsageError where the place cannot or must not be written.
    """
    target = Path(path)
    before = check_file(target)
    if before is not None and not stat.S_ISREG(before.st_mode):
        raise UsageError(f"{target}: is no regular file; name another output")
    with _told(target):
        folder = Path(tempfile.mkdtemp(dir=target.parent, prefix=".aeolid."))
        _unfinished.add(folder)
        try:
            inside = folder / target.name
            yield inside
            if inside.exists():  # else the writer itself has said why there is none
                with open(inside, "rb") as source, replacing(target) as handle:
                    shutil.copyfileobj(source, handle, 1 << 20)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            _unfinished.discard(folder)


def adopt(partial: Path, path: Path) -> None:
    """Give a file that this call has written itself its final name. Raises UsageError, then it keeps the old one."""
    check_file(path)
    with _told(path):
        with open(partial, "rb") as handle:
            _list(path, handle)
        os.replace(partial, path)


def create(path: Path) -> int:
    """Create a file that grows for as long as it takes; returns a handle. Raises UsageError, OSError."""
    if check_file(path) is not None:
        os.unlink(path)
    return os.open(path, _NEW, 0o666)


def record_written(path: Path) -> None:
    """Remember that this call wrote a file that grew. Raises UsageError."""
    with _told(path), open(path, "rb") as handle:
        _list(path, handle)


def require_room(path: Path) -> None:
    """Try whether a file can be made beside a target, so that a place that takes none is told before the work.

    Raises UsageError.
    """
    if path.is_char_device():
        return
    with _told(path), _opened(path.parent) as folder:
        name = f".aeolid.{os.urandom(8).hex()}.part"
        os.close(os.open(name, _NEW, 0o666, dir_fd=folder))
        os.unlink(name, dir_fd=folder)


def discard(path: Path) -> None:
    """Remove a file that an earlier run of the same command wrote. Raises UsageError where it is another's."""
    if check_file(path) is not None:
        with _told(path):
            os.unlink(path)


def make_folder(path: Path) -> None:
    """Make a folder and what is missing above it, and try whether it can be written to. Raises UsageError.

    Below an output folder of this call every part is a real folder; above it, links are the user's own.
    """
    with _told(path):
        _refuse_links(path)
        try:
            path.mkdir(parents=True, exist_ok=True)
        except FileExistsError:
            raise UsageError(f"{path}: is a file; name a folder") from None
        with _opened(path) as folder:
            name = f".aeolid.{os.urandom(8).hex()}.part"
            os.close(os.open(name, _NEW, 0o666, dir_fd=folder))
            os.unlink(name, dir_fd=folder)


def remove_unfinished() -> None:
    """Remove files that were being written when the process is ended at once."""
    for partial in list(_unfinished):
        if partial.is_dir():
            shutil.rmtree(partial, ignore_errors=True)
        else:
            partial.unlink(missing_ok=True)


@contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise cannot(path, error) from None


def _refuse_links(folder: Path) -> None:
    """Refuse a link in the part of a path that the user did not lay out: an output folder, below it, or in an input."""
    call, whole = current(), folder.absolute()
    if call is None:
        return
    roots = [o.whole.parent for o in call.outputs if o.folder and whole.is_relative_to(o.whole)]
    roots += [f for f in call.folders if whole.is_relative_to(f)]
    for part in [whole, *whole.parents]:
        if any(part != root and part.is_relative_to(root) for root in roots) and part.is_symlink():
            raise UsageError(f"{part}: {_LINK}")


@contextmanager
def _opened(folder: Path) -> Iterator[int]:
    """Open a folder, and below an output folder each part without following a link."""
    call, whole = current(), folder.absolute()
    root = next((o.whole for o in call.outputs if o.folder and whole.is_relative_to(o.whole)), None) if call else None
    handle = os.open(whole if root is None else root, _FOLDER | (0 if root is None else os.O_NOFOLLOW))
    try:
        for part in () if root is None else whole.relative_to(root).parts:
            below = os.open(part, _FOLDER | os.O_NOFOLLOW, dir_fd=handle)
            os.close(handle)
            handle = below
        yield handle
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise UsageError(f"{folder}: {_LINK}") from None
        raise
    finally:
        os.close(handle)


def _list(target: Path, file: BinaryIO) -> None:
    """Enter a finished file into the ledger, before it takes its name: an entry alone does no harm."""
    call = current()
    if call is None:
        return
    whole = target.absolute()
    output: Output = call.output_of(whole)
    if not output.listed:
        return
    entry = ledger.Entry(str(whole.relative_to(output.home)), call.label(output), ledger.digest(file))
    try:
        ledger.add(output.home, entry)
    except OSError as error:
        raise cannot(output.home / ledger.NAME, error) from None


def _sync(folder: int) -> None:
    try:
        os.fsync(folder)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.EROFS, errno.EBADF):  # file systems without such a thing
            raise
