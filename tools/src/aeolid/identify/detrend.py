"""Take slow motion off recordings: an offset, a line, or everything below a frequency, of inputs and outputs alike.

What is taken off spans a space that a shift in time leaves alone (1; 1, t; 1, t, cos ωt, sin ωt of all low ω), so that
the result is that of these functions standing in every regression as terms of their own, one set a recording: the
transfer from inputs to outputs and the feedback are untouched, and no noise model gains a zero near z = 1 as it would
from a recursive high-pass. What is left is put back about the mean of the whole set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.record import Record

Array = NDArray[np.float64]
KINDS = ("none", "offset", "linear", "high-pass")
LOWEST = 0.25  # of the frequency whose period is the past window: slower motion is no mode that the window can tell


def check_detrend(kind: str) -> None:
    """Refuse a kind that does not exist."""
    if kind not in KINDS:
        raise UsageError(f"detrend {kind!r} is none of {', '.join(KINDS)}")


def detrend(records: Sequence[Record], kind: str, past_samples: int) -> list[Record]:
    """Return the recordings without slow motion in inputs and outputs, missing samples still missing.

    kind: "none"; "offset": the mean of each recording; "linear": its straight line; "high-pass": line and all below
    1/(4 past_samples) of the sample rate. past_samples ≥ 1: past window in samples of these recordings. One recording
    with "offset" is returned as it is: its regressions have a free constant. Raises UsageError on another kind. Cost:
    N log N a channel.
    """
    check_detrend(kind)
    if kind == "none" or (kind == "offset" and len(records) == 1):
        return list(records)
    columns = [i for i, c in enumerate(records[0].channels) if c.role in ("input", "output")]
    names = [records[0].channels[i].name for i in columns]
    everything = np.vstack([r.columns(names) for r in records])
    good = np.isfinite(everything)
    middle = np.where(good, everything, 0.0).sum(axis=0) / np.maximum(good.sum(axis=0), 1)
    out = []
    for record in records:
        values = record.values.copy()
        for name, mean in zip(names, middle, strict=True):
            place = next(i for i, c in enumerate(record.channels) if c.name == name)
            values[:, place] = mean + _without_trend(values[:, place], kind, past_samples)
        out.append(replace(record, values=values))
    return out


def _without_trend(values: Array, kind: str, past_samples: int) -> Array:
    """Return one channel (N,) about zero; missing samples stay missing."""
    good = np.isfinite(values)
    if good.sum() < 3:
        return np.asarray(values - (values[good].mean() if good.any() else 0.0))
    t = np.linspace(-1.0, 1.0, len(values))
    if kind == "offset":
        return np.asarray(values - values[good].mean())
    if kind == "linear":
        slope, level = np.polyfit(t[good], values[good], 1)
        return np.asarray(values - level - slope * t)
    filled = np.interp(t, t[good], values[good])
    high, line = _above(filled, past_samples), _above(t, past_samples)
    power = float(line @ line)
    rest = high - (line * (line @ high / power) if power > 0 else 0.0)
    return np.where(good, rest, np.nan)


def _above(values: Array, past_samples: int) -> Array:
    """Return what is left of (N,) above LOWEST/past_samples of the sample rate."""
    spectrum = np.fft.rfft(values)
    spectrum[: 1 + int(LOWEST * len(values) / past_samples)] = 0.0
    return np.asarray(np.fft.irfft(spectrum, len(values)))
