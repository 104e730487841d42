"""Collect what a node says about itself; nothing of it is believed before its hash fits."""

from __future__ import annotations

import zlib
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
PARTS_MAX = 4096  # kept; a description has 902 at most
TRIES = 4  # choices of parts that are tried: those that came once or more often, twice or more often …
MODEL_SETS = {0: "varx", 1: "varmax"}
MAKERS = {0: "", 1: "fast-rls", 2: "lattice", 3: "rls"}  # upper byte of the model set; 0: rls for VARX, els for VARMAX
_NAME_PARTS, _UNIT_PARTS = 8, 4


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
    """Gather the parts of one node's description from messages that may be lost, doubled, garbled or forged."""

    def __init__(self) -> None:
        self.version: int | None = None
        self.problem: str | None = None
        self._hash: int | None = None
        self._parts: dict[tuple[int, int], dict[int, int]] = {}  # (item, index) -> value -> how often it came

    def add(self, parts: Iterable[tuple[int, int, int]]) -> Description | None:
        """Take (item, index, value) triples; returns the description once it is whole and its hash fits."""
        for item, index, value in parts:
            if item == WIRE:
                self._take_head(index, value)
            elif self._fits(item, index):
                if len(self._parts) >= PARTS_MAX:
                    self._parts.clear()
                came = self._parts.setdefault((item, index), {})
                if value in came or len(came) < RIVALS:
                    came[value] = came.get(value, 0) + 1
        if self._hash is None or self.version not in WIRE_VERSIONS:
            return None
        return self._try()

    def _take_head(self, version: int, value: int) -> None:
        if (version, value) != (self.version, self._hash):
            # another configuration; parts that came before their head are kept for this one only if none was known
            if self.version is not None:
                self._parts.clear()
            self.version, self._hash, self.problem = version, value, None
        if version not in WIRE_VERSIONS:
            known = " and ".join(map(str, WIRE_VERSIONS))
            self.problem = f"speaks wire version {version}; this tool reads versions {known}"

    @staticmethod
    def _fits(item: int, index: int) -> bool:
        channel, part = index & 0xFF, index >> 8
        if item in (NAME, UNIT):
            return channel < CHANNELS_MAX and part < (_NAME_PARTS if item == NAME else _UNIT_PARTS)
        return index < CHANNELS_MAX if item in (OFFSET, SCALE) else SHAPE <= item <= FEEDTHROUGH

    def _try(self) -> Description | None:
        """Look for a choice of parts that the hash was made of: all, or those that came more often than garbled ones.

        The hash is the proof, the choice is only a guess at what may have been garbled.
        """
        most = max((max(came.values()) for came in self._parts.values()), default=0)
        for least in range(1, min(most, TRIES) + 1):
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
            if len(single) == FEEDTHROUGH:
                words = np.array([(item | index << 16, parts[item, index]) for item, index in sorted(parts)], "<u4")
                if zlib.crc32(words.tobytes()) == self._hash:
                    return self._build(single, parts)
        return None

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
        return None if self.problem else result


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
