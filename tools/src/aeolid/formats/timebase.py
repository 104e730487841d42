"""Check a recording's clock and put its samples on a uniform grid."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from aeolid.errors import DataError, UnevenClock
from aeolid.formats.table import Array, Table

log = logging.getLogger("aeolid.formats")

STEP_TOLERANCE = 0.1  # a step may differ from a multiple of the sample time by this share of it: jitter, rounding
CLOCK_TOLERANCE = 1e-3  # the mean sample time may differ by this share from the one the roles file declares
_MOST_FILL = 1.0  # no more samples are filled in than there are recorded ones


@dataclass(frozen=True, eq=False)
class Grid:
    """Hold the uniform clock: start_s, sample_time_s, and for each row of the table its sample index (N,)."""

    start_s: float
    sample_time_s: float
    index: np.ndarray[tuple[int], np.dtype[np.int64]]

    @property
    def samples(self) -> int:
        """Return the number of samples on the grid, missing ones included."""
        return int(self.index[-1]) + 1 if len(self.index) else 0

    def times(self) -> Array:
        """Return the time of every sample on the grid."""
        times: Array = self.start_s + self.sample_time_s * np.arange(self.samples, dtype=np.float64)
        return times

    def place(self, values: Array) -> Array:
        """Put the rows (N, k) on the grid; samples that are missing become NaN."""
        if self.samples == len(values):
            return values
        out = np.full((self.samples, *values.shape[1:]), np.nan)
        out[self.index] = values
        return out


def uniform_grid(table: Table, time: Array | None, declared: float | None) -> Grid:
    """Find the uniform grid behind a time column (N,) or a declared sample time in seconds.

    Steps within 10 % of a whole multiple of the sample time are taken as that multiple (clock jitter and times
    printed with few digits); multiples above one are missing samples. Anything else is refused by sample number.
    """
    source, rows = table.source, table.samples
    if time is None:
        if declared is None:
            raise DataError(f"{source}: no time column and no sample_time_s in the roles file; give one of them")
        return Grid(0.0, declared, np.arange(rows))
    if rows == 1 and declared is None:
        raise DataError(f"{source}: one sample only, so no sample time follows; set sample_time_s in the roles file")
    require_running_clock(table, time)
    if rows == 1:
        assert declared is not None  # refused above
        return Grid(float(time[0]), declared, np.arange(1))
    steps = np.diff(time)
    step = declared or float(np.median(steps))
    if declared is not None:
        _require_near(source, float(np.median(steps)), declared)
    counts = _count_steps(table, time, steps, step)
    total = int(counts.sum())
    mean = float(time[-1] - time[0]) / total
    if declared is not None and abs(mean - declared) > _clock_tolerance(time, total, declared):
        raise DataError(
            f"{source}: the time column runs at {mean:.9g} s a sample, the roles file says {declared:.9g} s;"
            f" correct sample_time_s or leave it out"
        )
    _tell_missing(table, counts, total - (rows - 1))
    return Grid(float(time[0]), declared or float(f"{mean:.9g}"), np.concatenate([[0], np.cumsum(counts)]))


def _require_near(source: str, step: float, declared: float) -> None:
    """Refuse a declared sample time that most steps are a multiple or a part of: holes would be all over the place."""
    ratio = step / declared
    if ratio >= 1.5 or ratio <= 1 / 1.5:
        times, larger = (ratio, "small") if ratio > 1 else (1 / ratio, "large")
        minutes = abs(times / 60 - 1) < 0.01 and larger == "large"  # step * 60 is what was declared
        hint = '; if it counts minutes, set time_unit = "min"' if minutes else ""
        raise DataError(
            f"{source}: the time column steps by {step:.6g} s, the roles file says sample_time_s = {declared:.6g}:"
            f" {times:.4g} times too {larger}; correct sample_time_s or leave it out{hint}"
        )


def _clock_tolerance(time: Array, total: int, declared: float) -> float:
    """Allow the declared tolerance, and on short records one step's tolerance spread over all of them."""
    return declared * max(CLOCK_TOLERANCE, STEP_TOLERANCE / total)


def require_running_clock(
    table: Table, time: Array, rows: np.ndarray[tuple[int], np.dtype[np.int64]] | None = None, channel: str = ""
) -> None:
    """Refuse a clock (n,) in which a time is missing, repeats or goes backwards.

    rows (n,): the rows of the table that it is of, all where None; channel: whose samples alone are looked at.
    """
    of = f" in channel {channel!r}" if channel else ""
    at = np.arange(len(time)) if rows is None else rows
    bad = np.flatnonzero(~np.isfinite(time))
    if len(bad):
        raise DataError(
            f"{table.source}: time is missing at {table.place(int(at[bad[0]]))}{of} ({len(bad)} in all);"
            f" fill it in, or remove the time column and set sample_time_s"
        )
    stuck = np.flatnonzero(np.diff(time) <= 0)
    if len(stuck):
        k = int(stuck[0])
        what = "repeats" if time[k + 1] == time[k] else "goes backwards"
        dated = any(begin and not begin.endswith("Z") for begin in table.begins.values())
        zone = ", or write dates with their zone where summer time ends" if dated and what == "goes backwards" else ""
        raise DataError(
            f"{table.source}: time {what} at {table.place(int(at[k + 1]))}{of}: {time[k]:.10g} s, then"
            f" {time[k + 1]:.10g} s ({len(stuck)} such in all); remove the double rows or split the recording"
            f" there{zone}"
        )


def _count_steps(table: Table, time: Array, steps: Array, step: float) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    ratio = steps / step
    counts = np.rint(ratio)
    wrong = np.flatnonzero((counts < 1) | (np.abs(ratio - counts) > STEP_TOLERANCE))
    if len(wrong):
        k = int(wrong[0])
        raise UnevenClock(
            f"{table.source}: time is not uniform at {table.place(k + 1)}: a step of {steps[k]:.6g} s where the sample"
            f" time is {step:.6g} s ({len(wrong)} such in all); resample the recording to one clock, or let"
            " --resample do it"
        )
    if counts.sum() - len(counts) > _MOST_FILL * (len(counts) + 1):
        k = int(np.argmax(counts))
        raise DataError(
            f"{table.source}: more samples are missing than recorded; the longest gap, {steps[k]:.6g} s, ends at"
            f" {table.place(k + 1)}; split the recording there and give both parts"
        )
    return counts.astype(np.int64)


def _tell_missing(table: Table, counts: np.ndarray[tuple[int], np.dtype[np.int64]], missing: int) -> None:
    if missing:
        first = int(np.argmax(counts > 1))
        gaps = int(np.count_nonzero(counts > 1))
        log.warning(
            "%s: %d missing samples in %d gap(s), the first before %s, are kept as NaN",
            table.source, missing, gaps, table.place(first + 1),
        )  # fmt: skip
