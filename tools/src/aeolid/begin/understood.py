"""Say what a case was understood as: files, rates, holes, channels with units and holds, and what looks odd."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aeolid.diagnose.data.intersample import traits_of
from aeolid.formats.meanings import meaning_of
from aeolid.formats.table import Array
from aeolid.record import Record
from aeolid.wording import counted

_BARS = "▁▂▃▄▅▆▇█"
_WIDTH = 24  # characters of a line drawn in a table
_ACTING = ("input", "disturbance", "scheduling", "excitation")
_HOLDS = {"held": "held (it repeats)", "rough": "held (rough to Nyquist)", "smooth": "by likelihood (smooth)"}
_LEVELS: dict[str, dict[str, tuple[float, float]]] = {  # kind, unit: sizes that are usual
    "pitch": {"deg": (0.0, 120.0), "rad": (0.0, 2.2)},
    "generator_speed": {"rpm": (3.0, 2500.0), "rad/s": (0.3, 250.0)},
    "rotor_speed": {"rpm": (1.0, 400.0), "rad/s": (0.1, 42.0)},
    "wind": {"m/s": (0.5, 60.0)},
}
_APART = 20.0  # times, from which the levels of a channel in recording and run are doubted
_LIKE = 3.0  # times, up to which the levels of two channels are alike
_FEW = 100  # samples, below which a recording is doubted: a window and a few modes have as many unknowns
_STEADY = 2.0  # deviations that a mean must be from zero to be called a level


@dataclass(frozen=True)
class Row:
    """Hold one channel of one file: what it is called and is, how it is held, missing cells, sizes, a small picture."""

    name: str
    unit: str
    role: str
    hold: str
    missing: int
    low: float
    mean: float
    high: float
    shape: str

    def to_json(self) -> dict[str, Any]:
        """Return the row as JSON facts."""
        numbers = {
            k: v if np.isfinite(v) else None for k, v in (("min", self.low), ("mean", self.mean), ("max", self.high))
        }
        own = {"name": self.name, "unit": self.unit, "role": self.role, "hold": self.hold, "missing": self.missing}
        return own | numbers


@dataclass(frozen=True)
class Holes:
    """Say what is missing from a recording: rows without any value, stretches of them, the longest and where it is."""

    rows: int
    stretches: int
    longest_s: float
    at_s: float

    def text(self) -> str:
        """Return a clause."""
        if not self.rows:
            return "no holes"
        many = f"{self.stretches} hole{'s' if self.stretches > 1 else ''}, {counted(self.rows, 'sample')}"
        return f"{many}, the longest {self.longest_s:.4g} s from {self.at_s:.6g} s on"


def rows_of(record: Record) -> tuple[Row, ...]:
    """Describe the channels of a recording."""
    acting = [c.name for c in record.channels if c.role in _ACTING]
    holds = {t.name: t.hold if t.kind == "declared" else _HOLDS[t.kind] for t in traits_of([record], acting)}
    rows = []
    for i, c in enumerate(record.channels):
        values = record.values[:, i]
        known = values[np.isfinite(values)]
        low, mean, high = (known.min(), known.mean(), known.max()) if len(known) else (np.nan,) * 3
        missing = len(values) - len(known)
        hold = holds.get(c.name) or ""
        rows.append(Row(c.name, c.unit, c.role, hold, missing, float(low), float(mean), float(high), sparkline(values)))
    return tuple(rows)


def sparkline(values: Array, width: int = _WIDTH) -> str:
    """Draw a signal with blocks: the mean of each stretch between its least and greatest; a hole is a blank.

    >>> sparkline(np.array([0.0, 1.0, np.nan, 2.0, 3.0]), 5)
    '▁▃ ▆█'
    """
    parts = np.array_split(values, min(width, len(values)))
    means = np.array([p[np.isfinite(p)].mean() if np.isfinite(p).any() else np.nan for p in parts])
    known = means[np.isfinite(means)]
    if not len(known):
        return " " * len(means)
    span = float(np.ptp(known)) or 1.0
    level = (means - known.min()) / span * (len(_BARS) - 1)
    return "".join(" " if np.isnan(x) else _BARS[int(x + 0.5)] for x in level)


def holes_of(record: Record) -> Holes:
    """Find the rows in which every channel is missing."""
    empty = np.isnan(record.values).all(axis=1)
    edges = np.diff(np.concatenate([[0], empty.astype(int), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    if not len(starts):
        return Holes(0, 0, 0.0, 0.0)
    k = int(np.argmax(ends - starts))
    step = record.sample_time_s
    return Holes(int(empty.sum()), len(starts), float((ends[k] - starts[k]) * step), float(record.time_s[starts[k]]))


def doubts(records: Sequence[Record], run: Record | None, context: Mapping[str, Any]) -> tuple[str, ...]:
    """Say what looks odd, a sentence each; none of it is refused."""
    found = []
    for record in records:
        if len(record) < _FEW:
            found.append(
                f"{record.source}: {len(record)} samples are few for a model or a diagnosis, which take hundreds, over"
                " several periods of the slowest motion; was the recording cut off, or the sample time read wrong?"
            )
        rows = rows_of(record)
        for row in rows:
            found += [f"{record.source}: {text}" for text in _odd(row, rows)]
    if run is not None:
        found += _levels(records[0], run)
    if context.get("machine") == "wind turbine" and "rated_speed_rad_s" not in context:
        found.append("[context] has no rated_speed_rad_s: harmonics of the rotor cannot be told from modes")
    return tuple(found)


def _odd(row: Row, rows: Sequence[Row]) -> list[str]:
    """Return what is odd about a channel, the others of its recording beside it."""
    found = []
    if row.low == row.high and row.role != "excitation":
        why = "; what an input does that rests is not to be seen: move it, or give it the role ignore"
        found.append(f"{row.name} never changes{why if row.role == 'input' else ''}")
    if not _usual(row, row):
        likely = [r.name for r in rows if r is not row and _usual_of(r) and _usual(row, r) and _usual(r, row)]
        exchanged = f", or is it exchanged with {likely[0]}" if len(likely) == 1 else ""
        found.append(
            f"{row.name} from {row.low:.4g} to {row.high:.4g} {row.unit} is unusual; is the unit right{exchanged}?"
        )
    return found


def _usual_of(row: Row) -> tuple[float, float] | None:
    """Return the sizes that are usual of what a channel is called, in its unit."""
    meaning = meaning_of(row.name)
    return _LEVELS.get("" if meaning is None else meaning.kind, {}).get(row.unit)


def _usual(row: Row, place: Row) -> bool:
    """Tell whether the values of a channel would be usual of another, in that one's unit."""
    usual = _usual_of(place)
    size = max(abs(row.low), abs(row.high))
    level = abs(row.mean) if row.low * row.high > 0 else None
    return not usual or not (size > usual[1] or (level is not None and level < usual[0]))


def _levels(record: Record, run: Record) -> list[str]:
    """Compare the levels of the channels that both have."""
    found = []
    there, here = {r.name: r for r in rows_of(run)}, rows_of(record)
    for row in here:
        other = there.get(row.name)
        if other is None or row.role == "azimuth":
            continue
        a, b = _level(record, row.name), _level(run, row.name)
        if a and b and not 1 / _APART < a / b < _APART:
            found.append(
                f"{row.name} is {a:.4g} {row.unit} in {record.source} and {b:.4g} {other.unit} in {run.source}:"
                f" is a unit wrong{_exchanged(row, [r for r in here if r.name in there], record, run)}?"
            )
    return found


def _exchanged(row: Row, shared: Sequence[Row], record: Record, run: Record) -> str:
    """Ask whether a channel is exchanged with the only one of its unit whose level in the run is its own."""
    likely = [
        other.name for other in shared
        if other.name != row.name and other.unit == row.unit
        and _alike(_level(record, row.name), _level(run, other.name))
        and _alike(_level(record, other.name), _level(run, row.name))
    ]  # fmt: skip
    return f", or is it exchanged with {likely[0]}" if len(likely) == 1 else ""


def _alike(a: float | None, b: float | None) -> bool:
    return bool(a and b and 1 / _LIKE < a / b < _LIKE)


def _level(record: Record, name: str) -> float | None:
    values = record.column(name)
    mean, spread = abs(float(np.nanmean(values))), float(np.nanstd(values))
    return mean if mean > _STEADY * spread else spread
