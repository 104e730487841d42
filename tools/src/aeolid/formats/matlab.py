"""Read MATLAB files up to version 7.

The reader of scipy can crash the process on a damaged file, and fill the memory on a crafted one, so it runs confined;
about half a second more for a file.
"""

from __future__ import annotations

import importlib.util
from collections import Counter
from collections.abc import Generator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.confined import Failure, Reply, start
from aeolid.errors import DataError
from aeolid.formats.arrays import table_of_arrays
from aeolid.formats.bounds import MOST_CHANNELS, reading_limits
from aeolid.formats.extras import read_hdf5
from aeolid.formats.sent import NONSENSE, shapes_of
from aeolid.formats.table import Choose, Table, unreadable
from aeolid.inputs import open_regular


def read_mat(path: Path, choose: Choose) -> Table:
    """Read a MATLAB file up to version 7: vectors, matrices, or one structure that holds them."""
    with open_regular(path) as handle:
        newer = handle.read(10) == b"MATLAB 7.3"
    if newer:
        if importlib.util.find_spec("h5py") is not None:
            return read_hdf5(path, choose)
        raise DataError(f"{path}: MATLAB version 7.3; save it with save(..., '-v7')")
    asked = {"path": str(path.absolute()), "source": str(path)}
    try:
        with start("aeolid.formats.matlab:send_arrays", asked, reading_limits(path)) as running:
            replies = iter(running)

            def load(names: list[str]) -> dict[str, NDArray[Any]]:
                running.answer({"wanted": names})
                _, arrays = next(replies, ({}, {}))
                if any(arrays[str(i)].shape != shapes[n] if str(i) in arrays else True for i, n in enumerate(names)):
                    raise Failure(NONSENSE)
                return {name: arrays[str(i)] for i, name in enumerate(names)}

            shapes = shapes_of(next(replies, ({}, {}))[0])
            return table_of_arrays(path, shapes, load, choose)
    except Failure as error:
        raise unreadable(path, "MATLAB", error) from None


def send_arrays(path: str, source: str) -> Generator[Reply, dict[str, Any], None]:
    """Say what numeric arrays there are, then send those that are wanted; runs confined."""
    arrays = numeric_arrays(path)
    if len(arrays) > MOST_CHANNELS:
        raise DataError(f"{source}: {len(arrays)} variables; at most {MOST_CHANNELS} are read")
    wanted = (yield {"asks": "wanted", "shapes": {name: a.shape for name, a in arrays.items()}}, {})["wanted"]
    for name in wanted:
        if arrays[name].dtype.kind == "c":
            raise DataError(f"{source}: channel {name!r} is complex; give real samples, one channel a signal")
    yield {}, {str(i): arrays[name] for i, name in enumerate(wanted)}


def numeric_arrays(path: str) -> dict[str, NDArray[Any]]:
    """Return the numeric variables of a MATLAB file and the fields of its structures. Raises what scipy raises.

    A field has its bare name where nothing else has that, otherwise that of its structure before it: meas.u, sim.u.
    """
    from scipy.io import loadmat

    found: list[tuple[str, str, Any]] = []  # name of the structure, or nothing; name; array
    for name, value in loadmat(path, squeeze_me=False, struct_as_record=True).items():
        if name.startswith("__") or not isinstance(value, np.ndarray):
            continue
        if value.dtype.names and value.size == 1:
            found += [(name, field, value.reshape(-1)[0][field]) for field in value.dtype.names]
        else:
            found.append(("", name, value))
    found = [entry for entry in found if isinstance(entry[2], np.ndarray) and entry[2].dtype.kind in "biufc"]
    bare = Counter(name for _, name, _ in found)
    return {f"{of}.{name}" if of and bare[name] > 1 else name: array for of, name, array in found}
