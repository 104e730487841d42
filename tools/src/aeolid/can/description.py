"""Collect what a node says about itself; nothing of it is believed before its hash fits."""

from __future__ import annotations

import struct
import zlib
from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.can.wire import FD_VALUES, WIRE_VERSIONS
from aeolid.formats.headings import harmless_name

Array = NDArray[np.float64]
WIRE, SHAPE, PARAMETERS, SAMPLE_TIME, FORGETTING, REGULARISATION, FEEDTHROUGH, OFFSET, SCALE, NAME, UNIT = range(11)
CHANNELS_MAX = 64
RIVALS = 4  # different values of one part that are kept
WORK_FREE, WORK_SHARE = 4000, 16  # parts gone through in search of a choice: so many, and more for each message
TRIES = 4  # choices of parts that are tried: those that came once or more often, twice or more often …
MODEL_SETS = {0: "varx", 1: "varmax"}
MAKERS = {0: "", 1: "fast-rls", 2: "lattice", 3: "rls"}  # upper byte of the model set; 0: rls for VARX, els for VARMAX
_NAME_PARTS, _UNIT_PARTS = 8, 4
_WORDS = struct.Struct("<II")


@dataclass(frozen=True, eq=False)
class Description:
    """Hold a node's configuration; channels are inputs, then outputs, then scheduling.

    offset, scale (channels,) in the channels' units: the filter works on (value - offset) / scale. parameters is
    outputs x regressors; feedthrough lists inputs with a current-sample parameter. values_a_frame: 1, on CAN FD 14.
    """

    wire_version: int
    configuration_hash: int
    model_set: str
    inputs: int
    outputs: int
    scheduling: int
    past: int
    parameters: int
    sample_every: int
    sample_time_s: float
    forgetting: float
    regularisation: float
    feedthrough: tuple[int, ...]
    offset: Array
    scale: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    method: str = "rls"
    values_a_frame: int = 1

    @property
    def channels(self) -> int:
        """Return inputs + outputs + scheduling."""
        return self.inputs + self.outputs + self.scheduling

    @property
    def regressors(self) -> int:
        """Return the parameters of one output."""
        return self.parameters // self.outputs

    def same_as(self, other: Description) -> bool:
        """Compare by hash: equal configurations have equal hashes."""
        return self.configuration_hash == other.configuration_hash


class DescriptionCollector:
    """Gather the parts of one node's description from messages that may be lost, doubled, garbled or forged.

    At most 6 · 4 single parts and 64 · 14 of channels are kept, with 4 values each. A choice among several values costs
    as much as there are parts, so it is looked for only as often as messages pay for it.
    """

    def __init__(self) -> None:
        self.version: int | None = None
        self.problem: str | None = None
        self._hash: int | None = None
        self._force = np.zeros((0, 2), np.int64)  # key and value of each part of the newest description, in order
        self._clear()

    def forget(self) -> None:
        """Leave out the parts gathered so far: they may be of another configuration than those to come."""
        self._clear()

    def contradicts(
        self, item: NDArray[np.uint8], index: NDArray[np.uint16], value: NDArray[np.uint32]
    ) -> NDArray[np.bool_]:
        """Tell of parts (n,) which ones the newest description does not have."""
        key = item.astype(np.int64) << 16 | index.astype(np.int64)
        if not len(self._force):
            return np.zeros(len(key), bool)
        at = np.minimum(np.searchsorted(self._force[:, 0], key), len(self._force) - 1)
        same = (self._force[at, 0] == key) & (self._force[at, 1] == value.astype(np.int64))
        other = np.flatnonzero(~same)
        other = other[[self._fits(int(item[k]), int(index[k])) for k in other]] if len(other) else other
        result = np.zeros(len(key), bool)
        result[other] = True
        return result

    def _clear(self) -> None:
        self._parts: dict[tuple[int, int], dict[int, int]] = {}  # (item, index) -> value -> how often it came
        self._order: list[int] = []  # keys index | item << 16, in order
        self._packed = bytearray()  # what the hash is made of, in that order, of parts with one value
        self._rivals = False  # a part came with several values, or a single one with several indices
        self._singles = 0
        self._messages = self._work = 0

    @property
    def nbytes(self) -> int:
        """Return about how many bytes are held."""
        return 600 * len(self._parts)

    def add(self, parts: Iterable[tuple[int, int, int]]) -> Description | None:
        """Take (item, index, value) triples; returns the description once it is whole and its hash fits."""
        changed = False
        for item, index, value in parts:
            if item == WIRE:
                changed |= self._take_head(index, value)
            elif self._fits(item, index):
                self._messages += 1
                changed |= self._take_part(item, index, value)
        if self._hash is None or self.version not in WIRE_VERSIONS:
            return None
        return self._try(changed)

    def _take_part(self, item: int, index: int, value: int) -> bool:
        """Take one part; returns whether it is new."""
        came = self._parts.get((item, index))
        if came is not None:
            fresh = value not in came
            if fresh and len(came) >= RIVALS:
                _forget_one(came)
            if not fresh or len(came) < RIVALS:
                came[value] = came.get(value, 0) + 1
                self._rivals |= fresh
            return False
        if item <= FEEDTHROUGH:
            known = self._known(item)
            if known >= RIVALS and not self._forget_index(item):
                return False
            self._rivals |= known > 0
            self._singles += known == 0
        self._parts[item, index] = {value: 1}
        key = item << 16 | index
        at = bisect_left(self._order, key)
        self._order.insert(at, key)
        self._packed[8 * at : 8 * at] = _WORDS.pack(item | index << 16, value)
        return True

    def _forget_index(self, item: int) -> bool:
        """Leave out an index with which an item came only once: the true one comes with every repetition."""
        first, end = (bisect_left(self._order, i << 16) for i in (item, item + 1))
        for at in range(first, end):
            place = item, self._order[at] & 0xFFFF
            if sum(self._parts[place].values()) == 1:
                del self._parts[place], self._order[at]
                del self._packed[8 * at : 8 * at + 8]
                return True
        return False

    def _known(self, item: int) -> int:
        """Count the indices with which an item came."""
        return bisect_left(self._order, item + 1 << 16) - bisect_left(self._order, item << 16)

    def _take_head(self, version: int, value: int) -> bool:
        """Take a head; returns whether it is another one."""
        fresh = (version, value) != (self.version, self._hash)
        if fresh:
            # another configuration; parts that came before their head are kept for this one only if none was known
            if self.version is not None:
                self._clear()
            self.version, self._hash, self.problem = version, value, None
        if version not in WIRE_VERSIONS:
            known = " and ".join(map(str, WIRE_VERSIONS))
            self.problem = f"speaks wire version {version}; this tool reads versions {known}"
        return fresh

    @staticmethod
    def _fits(item: int, index: int) -> bool:
        channel, part = index & 0xFF, index >> 8
        if item in (NAME, UNIT):
            return channel < CHANNELS_MAX and part < (_NAME_PARTS if item == NAME else _UNIT_PARTS)
        return index < CHANNELS_MAX if item in (OFFSET, SCALE) else SHAPE <= item <= FEEDTHROUGH

    def _try(self, changed: bool) -> Description | None:
        """Look for a choice of parts that the hash was made of: all, or those that came more often than garbled ones.

        The hash is the proof, the choice is only a guess at what may have been garbled.
        """
        if self._singles < FEEDTHROUGH:
            return None
        if not self._rivals and changed and zlib.crc32(self._packed) == self._hash:
            return self._build(*self._choose(1))
        for least in range(1 if self._rivals else 2, TRIES + 1):
            if self._work + len(self._parts) > WORK_FREE + WORK_SHARE * self._messages:
                return None
            self._work += len(self._parts)
            if least > 1 and not any(max(came.values()) >= least for came in self._parts.values()):
                return None
            single, parts = self._choose(least)
            if len(single) == FEEDTHROUGH:
                words = np.array([(item | index << 16, parts[item, index]) for item, index in sorted(parts)], "<u4")
                if zlib.crc32(words.tobytes()) == self._hash:
                    return self._build(single, parts)
        return None

    def _choose(self, least: int) -> tuple[dict[int, tuple[int, int]], dict[tuple[int, int], int]]:
        """Return parts that came so often: single ones by item with their index, and all by item and index."""
        parts = {
            key: max(came, key=lambda value: came[value])
            for key, came in self._parts.items()
            if max(came.values()) >= least
        }
        single: dict[int, tuple[int, int]] = {}
        for item, index in sorted(parts, key=lambda key: max(self._parts[key].values())):
            if item <= FEEDTHROUGH:  # one index each: the one that came most often
                parts.pop((item, single[item][0]), None) if item in single else None
                single[item] = (index, parts[item, index])
        return single, parts

    def _build(self, single: dict[int, tuple[int, int]], parts: dict[tuple[int, int], int]) -> Description | None:
        def number(bits: int) -> float:
            return float(np.array([bits], np.uint32).view(np.float32)[0])

        shape = single[SHAPE][1]
        model_set, method = _model_set(single[SHAPE][0])
        r, l, s = shape & 0xFF, shape >> 8 & 0xFF, shape >> 16 & 0xFF  # noqa: E741
        m = r + l + s
        units = [_text(parts, UNIT, i, _UNIT_PARTS) for i in range(m)]
        offset, scale = (np.array([number(parts.get((item, i), 0)) for i in range(m)]) for item in (OFFSET, SCALE))
        result = Description(
            self.version or 0, self._hash or 0, model_set,
            r, l, s, single[PARAMETERS][0], single[PARAMETERS][1], single[SAMPLE_TIME][0],
            _short(number(single[SAMPLE_TIME][1])), _short(number(single[FORGETTING][1])),
            _short(number(single[REGULARISATION][1])),
            tuple(j for j in range(32) if single[FEEDTHROUGH][1] >> j & 1), offset, scale,
            _names([_text(parts, NAME, i, _NAME_PARTS) for i in range(m)], units, r, l),
            tuple(units), method, max(1, shape >> 24),
        )  # fmt: skip
        self.problem = _find_problem(result)
        if not self.problem:
            self._force = np.array(sorted((item << 16 | index, parts[item, index]) for item, index in parts), np.int64)
        self._clear()
        return None if self.problem else result


def _forget_one(came: dict[int, int]) -> None:
    """Leave out a value that came only once, if there is one: the true one comes with every repetition."""
    once = next((value for value, times in came.items() if times == 1), None)
    if once is not None:
        del came[once]


def _text(parts: dict[tuple[int, int], int], item: int, channel: int, count: int) -> str:
    """Put the parts of a name or unit together."""
    keys = [(item, channel | part << 8) for part in range(count)]
    words = [parts[key] for key in keys if key in parts]
    raw = np.array(words, "<u4").tobytes().split(b"\0")[0]
    return "".join(c if c.isprintable() else "?" for c in raw.decode("utf-8", "replace"))


def _model_set(number: int) -> tuple[str, str]:
    """Return the model set and the filter that a description names; an unknown one under its number."""
    known, maker = MODEL_SETS.get(number & 0xFF), MAKERS.get(number >> 8)
    if known is None or maker is None:
        return f"model set {number}", ""
    return known, maker or ("els" if known == "varmax" else "rls")


def _short(value: float) -> float:
    """Return the shortest decimal that rounds to the same binary32: 0.1 and not 0.10000000149."""
    return float(str(np.float32(value)))


def _names(given: list[str], units: list[str], r: int, outputs: int) -> tuple[str, ...]:
    """Fill in missing names, make double ones distinct, and change those that no file of ours could hold."""
    names = ["time_s"]  # the recording's clock has this heading
    for i, (name, unit) in enumerate(zip(given, units, strict=True)):
        kind = f"u{i + 1}" if i < r else f"y{i - r + 1}" if i < r + outputs else f"s{i - r - outputs + 1}"
        name = harmless_name(name, unit) or kind
        while name in names:
            name = f"{name}_{kind}"
        names.append(name)
    return tuple(names[1:])


def _find_problem(d: Description) -> str | None:
    """Say what in a description cannot be; a forged one may hold anything."""
    if d.outputs < 1 or d.channels > CHANNELS_MAX:
        return f"describes {d.outputs} outputs and {d.channels} channels; 1 output and at most {CHANNELS_MAX} are read"
    if d.values_a_frame not in ((1, FD_VALUES) if d.wire_version > 1 else (1,)):
        return f"describes {d.values_a_frame} values a frame; 1 and on CAN FD {FD_VALUES} are read"
    if not (np.isfinite(d.offset).all() and np.isfinite(d.scale).all() and (d.scale > 0).all()):
        return "describes an offset or scale that is no number or not above 0"
    if not 0 < d.forgetting <= 1:
        return f"describes a forgetting factor of {d.forgetting:g}; one above 0 and at most 1 is read"
    if not 0 <= d.regularisation < np.inf:
        return f"describes a regularisation of {d.regularisation:g}; a number not below 0 is read"
    if not 1e-6 <= d.sample_time_s <= 1e4:
        return f"describes a sample time of {d.sample_time_s} s"
    if not 1 <= d.parameters <= 65536 or d.parameters % d.outputs:
        return f"describes {d.parameters} parameters for {d.outputs} outputs"
    block = {"varx": d.inputs + d.outputs, "varmax": d.inputs + 2 * d.outputs}.get(d.model_set)
    if block is None:
        return f"describes {d.model_set}, which this tool does not know"
    if d.regressors != d.past * block + len(d.feedthrough) or any(j >= d.inputs for j in d.feedthrough):
        return f"describes {d.regressors} regressors where past window and channels make {d.past * block}"
    return None
