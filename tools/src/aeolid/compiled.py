"""Offer numba's compiler, steered by nothing in the current folder and with a cache that only the user can write.

numba reads `.numba_config.yaml` from the current folder when it is imported, and unpickles what it finds in its cache
folder: a recording's folder must have a say in neither. Every module that compiles takes numba from here.
"""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import sys
import tempfile
import warnings
from pathlib import Path

_CACHE = "NUMBA_CACHE_DIR"


def private_folder(path: Path) -> bool:
    """Make a folder with mode 0700 where there is none; tell whether nobody but the user (or root) can write there.

    True where the folder and all above it belong to the user or root and no other may write to them; a folder that
    all may write to is good enough on the way where it is sticky, as /tmp is. A folder that others may read is closed.
    """
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        own = os.lstat(path)
        if not stat.S_ISDIR(own.st_mode) or own.st_uid != os.geteuid() or own.st_mode & 0o022:
            return False
        if own.st_mode & 0o077:
            path.chmod(0o700)
        return all(_is_guarded(os.stat(above)) for above in path.resolve().parents)
    except OSError:
        return False


def _is_guarded(folder: os.stat_result) -> bool:
    closed = not folder.st_mode & 0o022 or bool(folder.st_mode & stat.S_ISVTX)
    return closed and folder.st_uid in (0, os.geteuid())


def cache_folder() -> Path:
    """Return the folder for compiled code: NUMBA_CACHE_DIR, else aeolid/numba of the user's cache, if private.

    Where neither is, one for this process alone, removed at its end: code is then compiled again in each.
    """
    chosen, base = os.environ.get(_CACHE), os.environ.get("XDG_CACHE_HOME", "")
    home = Path(base) if os.path.isabs(base) else Path(os.path.expanduser("~")) / ".cache"
    for path in [*([Path(chosen)] if chosen else []), home / "aeolid" / "numba"]:
        if path.is_absolute() and private_folder(path):
            return path
    own = Path(tempfile.mkdtemp(prefix="aeolid-numba-"))
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return own


def _import_numba() -> None:
    """Import numba with a cache of our choice and without its YAML reader, which it takes as not installed."""
    os.environ[_CACHE] = str(cache_folder())
    missing = object()
    reader = sys.modules.get("yaml", missing)
    sys.modules["yaml"] = None  # type: ignore[assignment]  # an import of it now fails
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "A Numba config file")  # it says so on every command
            import numba
    finally:
        if reader is missing:
            del sys.modules["yaml"]
        else:
            sys.modules["yaml"] = reader  # type: ignore[assignment]
    vars(numba.config)["CACHE_DIR"] = os.environ[_CACHE]  # also where another package had imported it before


_import_numba()
from numba import njit, types  # noqa: E402  # not before the above
from numba.extending import intrinsic  # noqa: E402

__all__ = ["cache_folder", "intrinsic", "njit", "private_folder", "types"]
