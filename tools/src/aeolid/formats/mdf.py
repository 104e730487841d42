"""Read MDF4 measurement files.

asammdf parses the blocks, in a confined process; it is asked for raw values alone, and what turns them into physical
ones is computed by `aeolid.formats.conversions`, since its own way evaluates a text of the file as code.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aeolid.confined import Failure, start
from aeolid.errors import DataError
from aeolid.formats.bounds import content_limit, guard_names, reading_limits
from aeolid.formats.sent import clocks_of, columns_of, names_of, units_of
from aeolid.formats.table import Array, Choose, Table, unreadable
from aeolid.inputs import open_regular

CLOCK = "time_s"
_FRAMES = b"CAN_DataFrame"


def read_mdf(path: Path, choose: Choose, own_clocks: bool = False) -> Table:
    """Read the chosen channels of an MDF file; their clock becomes the column time_s.

    own_clocks: each keeps its own; otherwise they must share one.
    """
    require_mdf(path)
    asked = {"path": str(path.absolute()), "source": str(path), "most": content_limit(path), "own": own_clocks}
    names: tuple[str, ...] = ()
    wanted: tuple[str, ...] = ()
    measured: list[str] = []
    units: dict[str, str] = {}
    columns: dict[str, Array] = {}
    clocks: dict[str, Array] = {}
    try:
        with start("aeolid.formats.mdf_blocks:send_channels", asked, reading_limits(path)) as running:
            for facts, arrays in running:
                if "asks" in facts:
                    names = guard_names(path, (CLOCK, *names_of(facts)))
                    wanted = choose(names, CLOCK)
                    measured = [name for name in dict.fromkeys(wanted) if name != CLOCK]
                    running.answer({"wanted": measured})
                    continue
                units = {CLOCK: "s"} | units_of(facts)
                if own_clocks:
                    columns, clocks = clocks_of(arrays, measured)
                    columns = {CLOCK: next(iter(clocks.values()), np.zeros(0))} | columns
                    continue
                found = columns_of(arrays, [CLOCK, *measured])
                columns = {name: found[name] for name in dict.fromkeys(wanted)}
    except Failure as error:
        raise unreadable(path, "MDF", error) from None
    return Table(str(path), names, columns, units, CLOCK, clocks=clocks)


def may_hold_frames(path: Path) -> bool:
    """Tell whether the name of the channel of raw CAN frames stands anywhere in an MDF file."""
    with open_regular(path) as handle:
        tail = b""
        while block := handle.read(1 << 20):
            if _FRAMES in tail + block:
                return True
            tail = block[-len(_FRAMES) :]
    return False


def holds_frames(path: Path) -> bool:
    """Tell whether an MDF file logs raw CAN frames instead of measured channels."""
    require_mdf(path)
    if not may_hold_frames(path):
        return False
    try:
        with start("aeolid.formats.mdf_blocks:say_kind", {"path": str(path.absolute())}, reading_limits(path)) as child:
            return any(facts.get("frames") is True for facts, _ in child)
    except (Failure, DataError):
        return False  # a damaged file is named by read_mdf


def require_mdf(path: Path) -> None:
    """Refuse a file that does not begin as version 4 of MDF does."""
    with open_regular(path) as handle:
        head = handle.read(16)
    if head[:8].rstrip() not in (b"MDF", b"UnFinMF"):
        raise unreadable(path, "MDF", ValueError("the file does not start with MDF"))
    if not head[8:].startswith(b"4."):
        version = head[8:].decode("latin-1").strip("\0 ")
        raise DataError(f"{path}: MDF version {version[:8]!r}; save it as version 4")
