"""Read and write what every model.json has in the same form: kind, keys, signals and arrays; faults name the key."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.display import has_unseen, token
from aeolid.errors import DataError
from aeolid.record import check_keys
from aeolid.text_files import MOST_LETTERS, is_number, shown

Array = NDArray[np.float64]
_KEYS = (  # of a model; another spelling of one would leave its default in place
    "kind", "sample_time_s", "inputs", "outputs", "states", "A", "B", "C", "D", "K", "x0", "innovation_covariance",
    "scheduling", "state_constant",
)  # fmt: skip
_ROUNDING = 1e-6  # of a covariance's largest entry: files are written with few digits
MOST_STATES = 800  # of a linear model: an eigenvalue problem of a second; its file holds no more


@dataclass(frozen=True)
class Signal:
    """Name a model's input, output or state; `offset` is the operating point the model is a deviation from."""

    name: str
    unit: str = ""
    offset: float = 0.0


def require_keys(data: dict[str, Any], keys: Sequence[str], source: str) -> None:
    """Refuse another kind of model, or one that lacks a key."""
    if data.get("kind") != "state_space":
        raise DataError(f"{source}: kind is {shown(data.get('kind'))}, 'state_space' is needed")
    known = {_plain(key): key for key in (*_KEYS, *keys)}
    for key in data:
        if known.get(_plain(key), key) != key:
            raise DataError(f"{source}: key {shown(key)} is not read; {known[_plain(key)]!r} is")
    for key in keys:
        if key not in data:
            raise DataError(f"{source}: key {key!r} is missing")


def _plain(key: str) -> str:
    return re.sub(r"[\s_-]", "", key).lower()


def read_channels(data: dict[str, Any], source: str) -> tuple[tuple[Signal, ...], tuple[Signal, ...]]:
    """Read the inputs and outputs of a model; refuses a name that stands twice in one of the lists."""
    inputs, outputs = (read_signals(data[key], key, source) for key in ("inputs", "outputs"))
    for key, signals in (("inputs", inputs), ("outputs", outputs)):
        names = [s.name for s in signals]
        double = next((n for n, count in Counter(names).items() if count > 1), None)
        if double is not None:
            raise DataError(f"{source}: {key} names {double!r} twice; rename or leave out one of them")
    return inputs, outputs


def read_covariance(value: Any, count: int, key: str, source: str) -> Array | None:
    """Read a covariance (count, count), None where there is none; refuses what no covariance can be."""
    if value is None:
        return None
    found = read_array(value, (count, count), key, source)
    slack = _ROUNDING * float(abs(found).max(initial=0.0))
    if np.any(abs(found - found.T) > slack):
        raise DataError(f"{source}: {key} is not symmetric, as every covariance is")
    if count and float(np.linalg.eigvalsh(found)[0]) < -slack:
        raise DataError(f"{source}: {key} has a negative eigenvalue; no covariance has one")
    return found


def read_signals(entries: Any, key: str, source: str) -> tuple[Signal, ...]:
    """Read a list of signals, each a name or a table of name, unit and offset."""
    if not isinstance(entries, list):
        raise DataError(f"{source}: {key} is not a list")
    result = []
    for i, entry in enumerate(entries):
        entry = {"name": entry} if isinstance(entry, str) else entry
        check_keys(entry, {"name", "unit", "offset"}, f"{source} {key}[{i}]")
        offset = entry.get("offset", 0.0)
        if not isinstance(entry.get("name"), str):
            raise DataError(f"{source}: {key}[{i}] has no name")
        if not isinstance(entry.get("unit", ""), str):
            raise DataError(f"{source}: {key}[{i}] has unit {shown(entry['unit'])}, a text is needed")
        if max(len(entry["name"]), len(entry.get("unit", ""))) > MOST_LETTERS:
            raise DataError(f"{source}: {key}[{i}] has a name or unit of more than {MOST_LETTERS} characters")
        if not is_number(offset):
            raise DataError(f"{source}: {key}[{i}] has offset {shown(offset)}, a finite number is needed")
        if has_unseen(entry["name"], entry.get("unit", "")):
            raise DataError(
                f"{source}: {key}[{i}]: name {token(entry['name'])!r} or its unit holds a control character"
            )
        result.append(Signal(entry["name"], entry.get("unit", ""), float(offset)))
    return tuple(result)


def read_size(matrix: Any, key: str, source: str) -> int:
    """Return the number of rows of a matrix, which is that of the states; at most MOST_STATES."""
    if not isinstance(matrix, list):
        raise DataError(f"{source}: {key} is not a matrix of numbers")
    if len(matrix) > MOST_STATES:
        raise DataError(f"{source}: {key} has {len(matrix)} rows; models of at most {MOST_STATES} states are read")
    return len(matrix)


def read_time_step(data: dict[str, Any], source: str, *, continuous: bool) -> float:
    """Return sample_time_s; 0 where the model may be one of continuous time."""
    value = data["sample_time_s"]
    if not is_number(value) or not 0 <= value < 1e6 or not (continuous or value):
        wanted = "a time in seconds (0 for continuous time)" if continuous else "a time in seconds above 0"
        raise DataError(f"{source}: sample_time_s = {shown(value)} is not {wanted}")
    return float(value)


def read_states(entries: Any, count: int, source: str) -> tuple[Signal, ...]:
    """Read the names of so many states; x1, x2 … where none are given."""
    names = [f"x{i + 1}" for i in range(count)] if entries is None or entries == [] else entries
    states = read_signals(names, "states", source)
    if len(states) != count:
        raise DataError(f"{source}: {len(states)} states are named, A has {count}")
    return states


def read_array(value: Any, shape: tuple[int, ...], key: str, source: str) -> Array:
    """Read nested lists of finite numbers of this shape."""
    try:
        array = np.array(value, dtype=float)
        plain = all(type(v) in (int, float) for v in np.array(value, dtype=object).ravel())
    except (ValueError, TypeError, OverflowError):
        plain = False
    if not plain:  # neither texts that read like numbers, nor truth values
        what = "a matrix of numbers" + (", or not one for each scheduling entry" if len(shape) > 2 else "")
        raise DataError(f"{source}: {key} is not {what}")
    if array.size == 0 and 0 in shape:
        array = np.zeros(shape)
    if array.shape != shape:
        raise DataError(f"{source}: {key} is {'x'.join(map(str, array.shape))}, needed is {'x'.join(map(str, shape))}")
    if not np.all(np.isfinite(array)):
        raise DataError(f"{source}: {key} holds a value that is not finite")
    return array


def write_signals(signals: Sequence[Signal]) -> list[dict[str, Any]]:
    """Return signals as they stand in the file."""
    return [{"name": s.name, "unit": s.unit} | ({"offset": s.offset} if s.offset else {}) for s in signals]


def write_array(array: Array | None) -> Any:
    """Return an array as nested lists, or None."""
    return None if array is None else array.tolist()
