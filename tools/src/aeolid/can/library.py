"""Import python-can for a command that receives: without asammdf, which it loads for its reader of MDF4."""

from __future__ import annotations

import sys


def import_without_mdf4() -> None:
    """Import python-can without asammdf; nothing happens where either is there already.

    asammdf brings pandas along, a third of the time in which a listener starts. Its own writer of MDF4 imports asammdf
    itself, and logs are read in a confined process, so that python-can's reader of MDF4 is not missed. For commands
    only: a program that uses aeolid as a library may want that reader.
    """
    if "can" in sys.modules or "asammdf" in sys.modules:
        return
    sys.modules["asammdf"] = None  # type: ignore[assignment]
    try:
        import can  # noqa: F401
    finally:
        del sys.modules["asammdf"]
