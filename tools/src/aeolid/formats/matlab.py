"""Read MATLAB files up to version 7.

The reader of scipy can crash the process on a damaged file, so it runs in a process of its own and hands the arrays
over as a NumPy archive; about half a second more for a file.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from aeolid.children import python_command
from aeolid.errors import DataError
from aeolid.formats.binary import from_arrays, unreadable
from aeolid.formats.table import Choose, Table, guard_size

_CONVERT = "import sys; from aeolid.formats.matlab import convert; convert(sys.argv[1], sys.argv[2])"
_PATIENCE_S = 600


def read_mat(path: Path, choose: Choose) -> Table:
    """Read a MATLAB file up to version 7: vectors, matrices, or one structure that holds them."""
    with open(path, "rb") as handle:
        if handle.read(10) == b"MATLAB 7.3":
            raise DataError(f"{path}: MATLAB version 7.3; save it with save(..., '-v7')")
    guard_size(path, 4 * path.stat().st_size)
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "arrays.npz"
        command = python_command("-c", _CONVERT, str(path), str(target))
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE_S, check=False)
        except subprocess.TimeoutExpired:
            raise unreadable(path, "MATLAB", ValueError("reading it did not come to an end")) from None
        if done.returncode != 0:
            cause = done.stderr.strip().splitlines()[-1:] if done.returncode == 3 else []
            raise unreadable(path, "MATLAB", ValueError(cause[0] if cause else "damaged"))
        with np.load(target, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    return from_arrays(path, arrays, choose)


def convert(source: str, target: str) -> None:
    """Write the numeric arrays of a MATLAB file as a NumPy archive; ends the process with code 3 and the cause."""
    from scipy.io import loadmat

    try:
        content = loadmat(source, squeeze_me=False, struct_as_record=True)
    except Exception as error:  # the reader raises whatever its parser meets in a damaged file
        print(str(error) or type(error).__name__, file=sys.stderr)
        raise SystemExit(3) from None
    arrays: dict[str, object] = {}
    for name, value in content.items():
        if name.startswith("__") or not isinstance(value, np.ndarray):
            continue
        if value.dtype.names and value.size == 1:
            arrays |= {field: value.reshape(-1)[0][field] for field in value.dtype.names}
        else:
            arrays[name] = value
    numeric = {k: v for k, v in arrays.items() if isinstance(v, np.ndarray) and v.dtype.kind in "biufc"}
    np.savez(target, **numeric)  # type: ignore[arg-type]
