"""Take out of a MATLAB file what a model needs: called in a confined process, as scipy's reader can be crashed."""

from __future__ import annotations

from typing import Any

import numpy as np

from aeolid.confined import Reply
from aeolid.errors import DataError

NUMBERS = ("A", "B", "C", "D", "K", "Ts", "X0", "NoiseVariance", "InputOffset", "OutputOffset")
DELAYS = ("InputDelay", "OutputDelay", "InternalDelay")
TEXTS = ("InputName", "InputUnit", "OutputName", "OutputUnit", "StateName", "StateUnit", "TimeUnit")


def read(path: str) -> Reply:
    """Return texts by name, the matrices as arrays, and the names of what should be a matrix of numbers and is none.

    Raises DataError with what the reader says of a file it cannot take.
    """
    from scipy.io import loadmat

    try:
        content = loadmat(path, squeeze_me=False, struct_as_record=True)
    except MemoryError:
        raise DataError("it unpacks to more than a model may take") from None
    except Exception as error:  # the reader raises whatever its parser meets in a damaged file
        raise DataError(" ".join(str(error).split())[:160] or type(error).__name__) from None
    found = {k: v for k, v in content.items() if not k.startswith("__") and isinstance(v, np.ndarray)}
    structures = [v for v in found.values() if v.dtype.names and v.size == 1]
    if "A" not in found and len(structures) == 1:
        names = structures[0].dtype.names or ()
        found = {name: structures[0].reshape(-1)[0][name] for name in names}
    texts: dict[str, list[str]] = {}
    matrices: dict[str, Any] = {}
    strange: list[str] = []
    for name, value in found.items():
        if name in (*NUMBERS, *DELAYS, "E"):
            if isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and value.ndim == 2:
                matrices[name] = value.astype(float)
            else:
                strange.append(name)
        elif name in TEXTS and isinstance(value, np.ndarray):
            texts[name] = [_text(v) for v in (value.ravel() if value.dtype.kind == "O" else value)]
    return {"texts": texts, "strange": strange}, matrices


def _text(value: Any) -> str:
    """Return the text of a cell or of a row of a character array."""
    return str(np.ravel(value)[0]).strip() if np.size(value) else ""
