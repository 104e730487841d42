"""Read .xlsx, .h5 and .tdms by the libraries that know them, where they are installed, in a confined process."""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.confined import Failure, start
from aeolid.errors import DataError
from aeolid.formats.arrays import table_of_arrays
from aeolid.formats.bounds import content_limit, guard_names, reading_limits
from aeolid.formats.sent import NONSENSE, clocks_of, columns_of, names_of, shapes_of, units_of
from aeolid.formats.table import Array, Choose, Table, unreadable

LIBRARIES = {".xlsx": "openpyxl", ".h5": "h5py", ".hdf5": "h5py", ".tdms": "nptdms"}
_KINDS = {"openpyxl": "Excel workbook", "h5py": "HDF5", "nptdms": "TDMS"}
CLOCK = "time_s"
_SAVE = "open the workbook in a spreadsheet and save it"
log = logging.getLogger("aeolid.formats")


def require_library(path: Path, suffix: str) -> None:
    """Refuse a format whose library is not installed. Raises DataError that says how to install it."""
    library = LIBRARIES[suffix]
    if importlib.util.find_spec(library) is None:
        name = {"nptdms": "npTDMS"}.get(library, library)
        raise DataError(
            f"{path}: files {suffix} need {name}, which is not installed: pip install 'aeolid[files]', or export as CSV"
        )


def read_workbook(path: Path, choose: Choose) -> Table:
    """Read the chosen columns of the first sheet that holds a table: a row of headings, perhaps one of units, rows."""
    require_library(path, ".xlsx")
    return _columns(path, choose, "aeolid.formats.workbook:send_columns", "Excel workbook")


def read_tdms(path: Path, choose: Choose, own_clocks: bool = False) -> Table:
    """Read the chosen channels of a TDMS file; own_clocks: each keeps its own, otherwise they must share one."""
    require_library(path, ".tdms")
    return _columns(path, choose, "aeolid.formats.tdms:send_channels", "TDMS", own=own_clocks)


def read_hdf5(path: Path, choose: Choose) -> Table:
    """Read an HDF5 file: its vectors, the columns of its matrices, the fields of its tables."""
    require_library(path, ".h5")
    asked = {"path": str(path.absolute()), "source": str(path), "most": content_limit(path)}
    units: dict[str, str] = {}
    try:
        with start("aeolid.formats.hdf5:send_arrays", asked, reading_limits(path)) as running:
            replies = iter(running)

            def load(names: list[str]) -> dict[str, NDArray[Any]]:
                running.answer({"wanted": names})
                _, arrays = next(replies, ({}, {}))
                if any(arrays[str(i)].shape != shapes[n] if str(i) in arrays else True for i, n in enumerate(names)):
                    raise Failure(NONSENSE)
                return {name: arrays[str(i)] for i, name in enumerate(names)}

            facts = next(replies, ({}, {}))[0]
            shapes, units = shapes_of(facts), units_of(facts)
            found = table_of_arrays(path, shapes, load, choose)
    except Failure as error:
        raise unreadable(path, "HDF5", error) from None
    return Table(found.source, found.names, found.columns, units | found.units)


def _columns(path: Path, choose: Choose, function: str, kind: str, **more: Any) -> Table:
    """Ask a confined reader for its headings, then for the chosen columns."""
    asked = {"path": str(path.absolute()), "source": str(path), "most": content_limit(path)} | more
    names: tuple[str, ...] = ()
    wanted: list[str] = []
    columns: dict[str, Array] = {}
    clocks: dict[str, Array] = {}
    units: dict[str, str] = {}
    begins: dict[str, str] = {}
    clock: str | None = None
    try:
        with start(function, asked, reading_limits(path)) as running:
            for facts, arrays in running:
                if "asks" in facts:
                    names, units = guard_names(path, names_of(facts)), units_of(facts)
                    clock = facts.get("clock") if facts.get("clock") in names else None
                    wanted = list(dict.fromkeys(choose(names, clock)))
                    running.answer({"wanted": wanted})
                    continue
                begins = units_of(facts, "begins")
                if isinstance(unstored := facts.get("unstored"), int) and unstored:
                    log.warning("%s: %d formulas without a stored value are missing samples; %s", path, unstored, _SAVE)
                if more.get("own"):
                    measured = [n for n in wanted if n != CLOCK]
                    columns, clocks = clocks_of(arrays, measured)
                    columns = {CLOCK: next(iter(clocks.values()), np.zeros(0))} | columns
                else:
                    columns = columns_of(arrays, wanted)
    except Failure as error:
        raise unreadable(path, kind, error) from None
    return Table(str(path), names, columns, units, clock, begins=begins, clocks=clocks)


READERS: dict[str, Callable[..., Table]] = {
    ".xlsx": read_workbook, ".h5": read_hdf5, ".hdf5": read_hdf5, ".tdms": read_tdms
}  # fmt: skip
