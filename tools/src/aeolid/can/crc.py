"""Compute the checks of the wire over many frames at once: CRC-8 of a classic frame, CRC-32 of all else (frame.h)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Words = NDArray[np.uint32]
_POLYNOMIAL_8, _POLYNOMIAL_32 = 0x2F, 0xEDB88320  # the second reflected
_BYTE, _ONES = np.uint32(0xFF), np.uint32(0xFFFFFFFF)


def _table_8() -> Bytes:
    rows = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc << 1 ^ (_POLYNOMIAL_8 if crc & 0x80 else 0)) & 0xFF
        rows.append(crc)
    return np.array(rows, np.uint8)


def _step(state: int) -> int:
    """Pass 32 zero bits through the register."""
    for _ in range(32):
        state = state >> 1 ^ (_POLYNOMIAL_32 if state & 1 else 0)
    return state


def _step_back(state: int) -> int:
    """Undo `_step`: the bit shifted out tells from the top bit whether the polynomial was added."""
    for _ in range(32):
        state = ((state ^ _POLYNOMIAL_32) << 1 | 1) if state >> 31 else state << 1
    return state


def _tables_32(back: bool) -> tuple[Words, Words, Words, Words]:
    step = _step_back if back else _step
    tables = [np.array([step(byte << shift) for byte in range(256)], np.uint32) for shift in (0, 8, 16, 24)]
    return tables[0], tables[1], tables[2], tables[3]


TABLE_8 = _table_8()
_FORTH, _BACK = _tables_32(False), _tables_32(True)


def _through(tables: tuple[Words, Words, Words, Words], state: Words) -> Words:
    """Apply a linear map of 32 bits, given by its values on each byte."""
    a, b, c, d = tables
    low = a[state & _BYTE] ^ b[state >> np.uint32(8) & _BYTE]
    result: Words = low ^ c[state >> np.uint32(16) & _BYTE] ^ d[state >> np.uint32(24)]
    return result


def check_8(start: Bytes, data: Bytes) -> Bytes:
    """Return the CRC-8 of classic frames: data (n, 8) without byte 3; start (n,): the register before."""
    crc = start
    for i in (0, 1, 2, 4, 5, 6, 7):
        crc = TABLE_8[crc ^ data[:, i]]
    result: Bytes = crc ^ np.uint8(0xFF)
    return result


def start_8(identifier: int) -> int:
    """Return the register of the CRC-8 after identifier without node and length 8."""
    crc = 0xFF
    for byte in (*identifier.to_bytes(4, "little"), 8):
        crc = int(TABLE_8[crc ^ byte])
    return crc


def crc_32(words: Words) -> Words:
    """Return the CRC-32 over the words of each row of (n, k), least significant byte first: zlib.crc32 of each row."""
    state = np.full(len(words), _ONES)
    for i in range(words.shape[1]):
        state = _through(_FORTH, state ^ words[:, i])
    return ~state


def solve_second(crc: Words, first: int, rest: Words) -> Words:
    """Return the words x (n,) for which the CRC-32 over `first`, x and the words of `rest` (n, k) is `crc` (n,).

    There is exactly one: each word maps the register one to one.
    """
    state = ~crc
    for i in range(rest.shape[1] - 1, -1, -1):
        state = _through(_BACK, state) ^ rest[:, i]
    begun = _through(_FORTH, np.array([first], np.uint32) ^ _ONES)
    result: Words = _through(_BACK, state) ^ begun
    return result
