"""Tell the harmonics of the rotor and other steady sines from modes.

A periodic force makes lines in the outputs' spectra. A model of the recording has a pair of poles on the unit circle
for each: no structure swings there. Where the rotor's azimuth or speed is recorded, lines on its multiples are known by
their frequency (`mark_harmonics`). Where nothing is driven by recorded inputs, any pole whose damping may be none is
held against the spectrum: the share of the power in a narrow band about it that is one sine of constant amplitude and
phase. Of a mode that noise drives amplitude and phase wander within its decay time; what is left of a line is noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.mode_names import named
from aeolid.identify.rotor import rotation
from aeolid.models.modes import Mode, mark_harmonics
from aeolid.models.prediction import complete_stretches
from aeolid.record import Record

Array = NDArray[np.float64]
BAND = 6.0  # lines of the recording's resolution on either side: a sine seen through a Hann window has two
STEADY = 0.8  # of the power in the band, that one sine must explain where the 95 % band of the damping holds none
# where only a band of 4 deviations does, for a regression gives lines in coloured noise a damping: of modes that noise
# drives, with 4, 6, 8 decay times in the recording (2, 2.4, 2.8 deviations) 6, 2 and 0 % show so steady a sine
STEADIER, WIDER = 0.9, 4.0
LONGEST = 200_000  # samples that are looked at


def marked(modes: Sequence[Mode], records: Sequence[Record], output_only: bool) -> tuple[Mode, ...]:
    """Return the modes with names, rotor harmonics marked, and where outputs alone are recorded steady sines as well.

    records: of one experiment set, the first of which tells how the rotor turns.
    """
    turning, length = rotation(records[0]), max(len(r) * r.sample_time_s for r in records)
    if turning is not None:
        modes = mark_harmonics(modes, turning.frequency_hz, turning.deviation_hz, length)
    if output_only:
        modes = [replace(m, tone=m.rotor_order is None and is_tone(m, records)) for m in modes]
    return named(modes, None if turning is None else turning.frequency_hz)


def is_tone(mode: Mode, records: Sequence[Record]) -> bool:
    """Tell whether a mode may have no damping and is a steady sine in the output that it moves most."""
    if mode.is_real or mode.damping_std is None or not mode.shares:
        return False
    output = max(mode.shares, key=lambda name: mode.shares[name])
    y, step = _longest_stretch(records, output)
    length = len(y) * step
    if not mode.vanishes(length, deviations=WIDER) or mode.frequency_hz * length < 2 * BAND:
        return False
    share = steady_share(y, mode.frequency_hz * step, WIDER * (mode.frequency_std_hz or 0.0) * step)
    return share >= (STEADY if mode.vanishes(length) else STEADIER)


def steady_share(y: Array, frequency: float, reach: float = 0.0) -> float:
    """Return the share of the power of y (N,) about a frequency that one sine explains, 0 … 1.

    frequency, reach: cycles a sample; the sine is sought within reach, at least a line of the recording's resolution.
    The power is that within BAND lines of the sine, seen through a Hann window.
    """
    count = len(y)
    window = np.hanning(count)
    seen = window * (y - np.average(y, weights=window))
    line = 1.0 / count
    trial = frequency + np.linspace(-1.0, 1.0, 65) * max(reach, line)
    for _ in range(3):  # each time closer: at last to a 1/4000 of where it began
        left = [_without(seen, window, f) for f in trial]
        best = int(np.argmin([float(rest @ rest) for rest in left]))
        trial = trial[best] + np.linspace(-1.0, 1.0, 33) * (trial[1] - trial[0])
    at, rest = float(trial[16]), left[best]
    bins = np.fft.rfftfreq(count)
    near = abs(bins - at) <= BAND * line
    before, after = (float((abs(np.fft.rfft(v)[near]) ** 2).sum()) for v in (seen, rest))
    return 1.0 - after / before if before > 0 else 0.0


def _without(seen: Array, window: Array, frequency: float) -> Array:
    """Return what is left of seen (N,) without its best sine of a frequency, both through the window."""
    angle = 2 * np.pi * frequency * np.arange(len(seen))
    basis = np.column_stack([window * np.cos(angle), window * np.sin(angle)])
    gram = basis.T @ basis
    out: Array = seen - basis @ np.linalg.solve(gram, basis.T @ seen)
    return out


def _longest_stretch(records: Sequence[Record], output: str) -> tuple[Array, float]:
    """Return the longest run of an output without a missing sample, LONGEST samples at most, and the sample time."""
    found, step = np.zeros(0), records[0].sample_time_s
    for record in records:
        y = record.column(output)[:LONGEST]
        for start, stop in complete_stretches(y[:, None], 1):
            if stop - start > len(found):
                found, step = y[start:stop], record.sample_time_s
    return found, step
