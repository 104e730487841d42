"""Lower the sample rate behind a symmetric anti-alias filter: of a simulation, never of a loop to be identified.

It reads later samples, which brings noise that a controller feeds back before its cause: `models.rate` for those.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable, UsageError
from aeolid.models.angles import radians_a_unit
from aeolid.record import Record
from aeolid.wording import counted

Array = NDArray[np.float64]
TAPS_PER_STEP = 20  # on either side of the centre: 0.1 dB up to 92 % and 60 dB beyond 109 % of the new Nyquist


def decimate(record: Record, factor: int, *, centred: bool = False) -> Record:
    """Return every factor-th sample after a symmetric (zero-phase) low-pass filter; factor 1 returns the recording.

    With `centred`, inputs and disturbances are read in the middle of the longer sample over which a model holds them,
    (factor − 1)/2 samples later: what was held over the short samples then acts at the same time. Read at its
    beginning, the model seems to lag by as much less than it does, a quarter of the new sample at factor 2.

    All channels pass the same filter, so the dynamics between them stay; the angle of a role `azimuth` is filtered on
    the circle. Samples whose filter window reaches over an end or a gap are dropped at the ends and missing inside.
    """
    from scipy.signal import firwin  # a second to load

    if factor == 1:
        return record
    if factor < 1:
        raise UsageError(f"decimation factor {factor} is not a whole number of at least 1")
    half = TAPS_PER_STEP * factor
    if len(record) < 4 * half:
        raise NotIdentifiable(
            f"{record.source}: {counted(len(record), 'sample')}; decimation by {factor} needs at least {4 * half}"
        )
    taps = firwin(2 * half + 1, 1.0 / factor, window=("kaiser", 6.0))
    columns = []
    between = firwin(2 * half + factor % 2, 1.0 / factor, window=("kaiser", 6.0))  # its middle as far off as asked
    for i, channel in enumerate(record.channels):
        values = record.values[:, i]
        if centred and channel.role in ("input", "disturbance"):
            columns.append(_filter(values[factor // 2 :], between, factor))
            continue
        columns.append(_filter_angle(values, taps, factor, channel.unit) if channel.role == "azimuth" else
                       _filter(values, taps, factor))  # fmt: skip
    rows = min(len(c) for c in columns)
    time = record.time_s[half : len(record) - half : factor][:rows]
    values = np.column_stack([c[:rows] for c in columns])
    return replace(record, time_s=time, values=values, sample_time_s=record.sample_time_s * factor)


def _filter(values: Array, taps: Array, factor: int) -> Array:
    """Filter and pick every factor-th sample whose window lies inside the recording; NaN spreads over its window."""
    return np.convolve(values, taps, mode="valid")[::factor]


def _filter_angle(values: Array, taps: Array, factor: int, unit: str) -> Array:
    per_unit = radians_a_unit(unit, values)
    phase = values * per_unit
    angle = np.arctan2(_filter(np.sin(phase), taps, factor), _filter(np.cos(phase), taps, factor))
    wrapped: Array = np.mod(angle, 2 * np.pi) / per_unit
    return wrapped
