"""Compress one recording into a summary that merges with others exactly, whatever scaling each was taken in.

Since a factor holds the column of ones of the rows [1, v], a change of offset and scale is a right multiplication of
the factor by a triangular matrix that changes every column by a scale and row 0 by an offset: no sample is needed
again. So a recording can be compressed by its own mean and deviation, before those of the fleet are known.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid import output
from aeolid.errors import DataError
from aeolid.fleet.plan import EPOCH
from aeolid.identify.rotor import rotor_frequency
from aeolid.identify.split import cut
from aeolid.identify.windows import CONSTANT, Scaling, WindowFactor, factorise
from aeolid.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Summary:
    """Hold what a recording, or many together, say about a model.

    count, mean, square (m,): number of valid samples, their mean and sum of squared deviations of each channel, inputs
    first; offset, scale (m,): what the factors were scaled by; fitted, held_out: factors (q + 1, q + 1) of the windows
    with targets in the fit part of each recording (`identify.split`) and in the rest; windows, skipped of each (2,);
    start_s the first time; rotor: samples times mean rotor speed in Hz, and the samples it is known for.
    """

    inputs: int
    past: int
    count: Array
    mean: Array
    square: Array
    offset: Array
    scale: Array
    fitted: Array
    held_out: Array
    windows: tuple[int, int]
    skipped: tuple[int, int]
    start_s: float
    sample_time_s: float
    rotor: tuple[float, float]
    recordings: int = 1

    @property
    def rotor_hz(self) -> float | None:
        """Return the mean rotor speed in Hz, None where no azimuth was recorded."""
        return self.rotor[0] / self.rotor[1] if self.rotor[1] > 0 else None

    def deviation(self) -> Array:
        """Return the standard deviation (m,) of each channel, 0 where it has no sample or stands still."""
        spread: Array = np.sqrt(self.square / np.maximum(self.count, 1.0))
        return np.where(spread > CONSTANT * abs(self.mean), spread, 0.0)

    def own_scaling(self) -> tuple[Array, Array]:
        """Return offset and scale by the summary's own mean and deviation; a channel at rest keeps its unit."""
        spread = self.deviation()
        return self.mean, np.where(spread > 0, spread, 1.0)

    def rescaled(self, offset: Array, scale: Array) -> Summary:
        """Return the summary with its factors in another scaling."""
        ratio = np.tile(self.scale / scale, self.past + 1)
        shift = np.tile((self.offset - offset) / scale, self.past + 1)
        changed = [_changed(full, ratio, shift) for full in (self.fitted, self.held_out)]
        return replace(self, offset=offset, scale=scale, fitted=changed[0], held_out=changed[1])

    def merged(self, other: Summary) -> Summary:
        """Return the summary of both sets of recordings, in the scaling of both together."""
        total = self.count + other.count
        safe = np.maximum(total, 1.0)
        step = other.mean - self.mean
        mean = np.where(self.count == 0, other.mean, self.mean + step * other.count / safe)
        square = self.square + other.square + step**2 * self.count * other.count / safe
        both = replace(
            self, count=total, mean=mean, square=square, start_s=min(self.start_s, other.start_s),
            rotor=(self.rotor[0] + other.rotor[0], self.rotor[1] + other.rotor[1]),
            recordings=self.recordings + other.recordings,
        )  # fmt: skip
        a, b = self.rescaled(*both.own_scaling()), other.rescaled(*both.own_scaling())
        fitted, held_out = a.factor("fitted").merge(b.factor("fitted")), a.factor("rest").merge(b.factor("rest"))
        return replace(
            both, offset=a.offset, scale=a.scale, fitted=fitted.full, held_out=held_out.full,
            windows=(fitted.windows, held_out.windows), skipped=(fitted.skipped, held_out.skipped),
        )  # fmt: skip

    def factor(self, part: str = "whole") -> WindowFactor:
        """Return the factor of a part: fitted, rest, or whole, which is the merge of both."""
        if part == "whole":
            return self.factor("fitted").merge(self.factor("rest"))
        i = 0 if part == "fitted" else 1
        full = (self.fitted, self.held_out)[i]
        return WindowFactor(
            full, self.past, self.inputs, len(self.mean) - self.inputs, self.windows[i], self.skipped[i]
        )


def summarise(record: Record, past: int) -> Summary:
    """Compress a recording; raises DataError on an infinite sample and where no window of p + 1 samples is complete."""
    names = record.names("input", "output")
    inputs = record.names("input")
    ordered = inputs + tuple(n for n in names if n not in inputs)
    values = np.asarray(record.columns(ordered), dtype=np.float64)  # means of binary32 samples go astray
    if np.isinf(values).any():
        row, column = np.argwhere(np.isinf(values))[0]
        raise DataError(
            f"{record.source}: channel {ordered[column]!r} is infinite at sample {row + 1}; mark it missing"
        )
    good = np.isfinite(values)
    count = good.sum(axis=0).astype(np.float64)
    mean = np.where(good, values, 0.0).sum(axis=0) / np.maximum(count, 1.0)
    square = (np.where(good, values - mean, 0.0) ** 2).sum(axis=0)
    turning = rotor_frequency(record)
    rotor = (0.0, 0.0) if turning is None else (turning * len(record), float(len(record)))
    empty = np.zeros((0, 0))
    own = Summary(
        len(inputs), past, count, mean, square, mean, mean, empty, empty, (0, 0), (0, 0),
        began_at(record), record.sample_time_s, rotor,
    )  # fmt: skip
    offset, scale = own.own_scaling()
    scaling = Scaling(inputs, ordered[len(inputs) :], offset, scale)
    parts = [factorise(part, scaling, past) for part in cut([record], scaling, past)]
    if sum(part.windows for part in parts) == 0:
        raise DataError(
            f"{record.source}: none of {len(record)} samples ends {past + 1} complete ones in a row; "
            "record longer, close gaps or use a shorter past window"
        )
    return replace(
        own, offset=offset, scale=scale, fitted=parts[0].full, held_out=parts[1].full,
        windows=(parts[0].windows, parts[1].windows), skipped=(parts[0].skipped, parts[1].skipped),
    )  # fmt: skip


def merge_all(summaries: Iterable[Summary]) -> Summary:
    """Merge any number of summaries pairwise, a tree of depth log N; at most log N of them are in memory.

    The result depends on the order of the summaries by rounding only. Raises ValueError on none.
    """
    waiting: list[tuple[int, Summary]] = []  # (height in the tree, summary): one of each height
    for summary in summaries:
        height, merged = 0, summary
        while waiting and waiting[-1][0] == height:
            merged = waiting.pop()[1].merged(merged)
            height += 1
        waiting.append((height, merged))
    if not waiting:
        raise ValueError("no summary to merge")
    total = waiting.pop()[1]
    while waiting:
        total = waiting.pop()[1].merged(total)
    return total


def save(summary: Summary, path: Path) -> None:
    """Write a summary; the file appears whole or not at all, whoever else writes the same one."""
    content: dict[str, Any] = {key: np.asarray(value) for key, value in summary.__dict__.items()}
    with output.replacing(path, durable=False, own=True) as handle:
        np.savez(handle, **content)


def load(path: Path) -> Summary:
    """Read a summary; raises OSError, ValueError, KeyError or EOFError on a file that is not one."""
    with np.load(path) as data:
        found = {key: data[key] for key in data.files}
    for key in ("inputs", "past", "recordings"):
        found[key] = int(found[key])
    for key in ("start_s", "sample_time_s"):
        found[key] = float(found[key])
    for key in ("windows", "skipped", "rotor"):
        found[key] = tuple(found[key].tolist())
    return Summary(**found)


def _changed(full: Array, ratio: Array, shift: Array) -> Array:
    """Return the factor of rows [1, v ratio + shift] from that of rows [1, v]; only row 0 reaches column 0."""
    out = full.copy()
    out[:, 1:] *= ratio
    out[0, 1:] += full[0, 0] * shift
    return out


def began_at(record: Record) -> float:
    """Return when a recording begins: seconds since 1970 where the file says a date, else its own first time."""
    first = float(record.time_s[0])
    if record.begins is None or abs(first) >= EPOCH:
        return first
    stamp = datetime.fromisoformat(record.begins)
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp() + first
