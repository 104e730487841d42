"""Carry facts and arrays through a pipe, as bytes that the receiving end can bound and check before it takes them.

One message: eight bytes, the length of a JSON text; the text, {"facts": …, "arrays": [[name, type, shape], …]}; then
the bytes of the arrays, in that order. Nothing in it can name code.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Reply = tuple[dict[str, Any], dict[str, NDArray[Any]]]
"""What a confined function returns or yields: facts that JSON can hold, and arrays of numbers by name.

Where the facts hold `asks`, the value of the `yield` is the facts that the caller answers with.
"""

_LENGTH = struct.Struct("<Q")
_HEAD_MOST = 16 << 20  # bytes of a message's JSON: names and units of 65,536 channels have room
_MOST_ARRAYS = 1 << 16
_KINDS = "biuf"  # bool, integer, unsigned, floating point


def pack(facts: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> list[bytes | memoryview]:
    """Return the pieces of one message, in order. Raises ValueError on an array that is not of numbers."""
    listed, bodies = [], []
    for name, values in arrays.items():
        array = np.ascontiguousarray(values)
        if array.dtype.kind not in _KINDS or array.dtype.itemsize > 8:
            raise ValueError(f"{name}: {array.dtype} is no number")
        array = array.astype(array.dtype.newbyteorder("<"), copy=False)
        listed.append([name, array.dtype.str, np.shape(values)])
        bodies.append(_bytes(array))
    text = json.dumps({"facts": facts, "arrays": listed}).encode()
    return [_LENGTH.pack(len(text)), text, *bodies]


def unpack(fill: Callable[[memoryview], None], budget: int) -> tuple[dict[str, Any], dict[str, NDArray[Any]], int]:
    """Take one message through `fill`, which fills a buffer whole; returns facts, arrays and the bytes they took.

    Raises ValueError, before anything is allocated for it, on a message that is malformed or beyond `budget` bytes.
    """
    head = bytearray(_LENGTH.size)
    fill(memoryview(head))
    (length,) = _LENGTH.unpack(head)
    if length > min(_HEAD_MOST, budget):
        raise OverflowError("more than was agreed")
    text = bytearray(length)
    fill(memoryview(text))
    content = _parse(bytes(text))
    left = budget - length
    arrays: dict[str, NDArray[Any]] = {}
    for name, kind, shape in content["arrays"]:
        array = _reserve(name, kind, shape, left)
        left -= array.nbytes
        if array.nbytes:
            fill(_bytes(array))
        arrays[name] = array
    return content["facts"], arrays, budget - left


def _parse(text: bytes) -> dict[str, Any]:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError("not JSON") from None
    if not isinstance(content, dict) or not isinstance(content.get("facts"), dict):
        raise ValueError("no facts")
    if not isinstance(content.get("arrays"), list) or len(content["arrays"]) > _MOST_ARRAYS:
        raise ValueError("no list of arrays")
    if not all(isinstance(entry, list) and len(entry) == 3 for entry in content["arrays"]):
        raise ValueError("no list of arrays")
    return content


def _reserve(name: Any, kind: Any, shape: Any, left: int) -> NDArray[Any]:
    """Allocate one array that fits in `left` bytes."""
    if not isinstance(name, str) or not isinstance(kind, str) or len(kind) != 3 or kind[1] not in _KINDS:
        raise ValueError("an array of no numbers")
    if not isinstance(shape, list) or len(shape) > 3 or not all(type(n) is int and n >= 0 for n in shape):
        raise ValueError("an array of no shape")
    dtype = np.dtype(kind)  # two characters after the byte order: no structure, no object
    if dtype.itemsize > 8:
        raise ValueError("an array of no numbers")
    if math.prod(shape) * dtype.itemsize > left:
        raise OverflowError("more than was agreed")
    return np.empty(tuple(shape), dtype)


def _bytes(array: NDArray[Any]) -> memoryview:
    return memoryview(array.reshape(-1).view(np.uint8))  # type: ignore[arg-type] # arrays are buffers
