"""Tell the harmonics of the rotor and other steady sines from modes.

A periodic force makes lines in the outputs' spectra. A model of the recording has a pair of poles on the unit circle
for each: no structure swings there. Where the rotor's azimuth or speed is recorded, lines on its multiples are known by
their frequency (`mark_harmonics`). Where nothing is driven by recorded inputs, any pole whose damping may be none is
held against the spectrum: the share of the power in a narrow band about it that is one sine of constant amplitude and
phase. Of a mode that noise drives amplitude and phase wander within its decay time; what is left of a line is noise.

A rotor whose speed varies smears its lines until many modes lie on one. What is a harmonic then moves with the rotor's
angle: of the power about k times the speed the share is asked for that is one sine of k times the angle. Blades that
cut turbulence make peaks about 3P, 6P, 9P with no such sine; they are as wide as the speed varies, so that a pole that
is much sharper is a mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.mode_names import named
from aeolid.identify.rotor import Rotation, rotation
from aeolid.models.blade_sets import with_multiblade
from aeolid.models.modes import NORMAL, Mode, is_widened, mark_harmonics, with_whirl
from aeolid.models.prediction import complete_stretches
from aeolid.models.rotor_angle import rotor_angle
from aeolid.record import Record

Array = NDArray[np.float64]
BAND = 6.0  # lines of the recording's resolution on either side: a sine seen through a Hann window has two
STEADY = 0.8  # of the power in the band, that one sine must explain where the 95 % band of the damping holds none
# where only a band of 4 deviations does, for a regression gives lines in coloured noise a damping: of modes that noise
# drives, with 4, 6, 8 decay times in the recording (2, 2.4, 2.8 deviations) 6, 2 and 0 % show so steady a sine
STEADIER, WIDER = 0.9, 4.0
LONGEST = 200_000  # samples that are looked at
LOCKED = 0.5  # of the power about a multiple of the speed, which a sine of the rotor's angle explains of a harmonic
SHARPER = 1 / 3  # of the speed's relative deviation: a line it smears has a damping of about the deviation itself


def marked(modes: Sequence[Mode], records: Sequence[Record], output_only: bool) -> tuple[Mode, ...]:
    """Return the modes with names, rotor harmonics marked, and where outputs alone are recorded steady sines as well.

    records: of one experiment set, the first of which tells how the rotor turns; fixed-frame channels that modes show
    in are made of the blades.
    """
    records = [with_multiblade(r, dict.fromkeys(n for m in modes for n in m.shares)) for r in records]
    turning, length = rotation(records[0]), max(len(r) * r.sample_time_s for r in records)
    if turning is not None:
        modes = mark_harmonics(modes, turning.frequency_hz, turning.deviation_hz, length)
        modes = [m if m.rotor_order is None or is_driven(m, records[0], turning) else replace(m, rotor_order=None)
                 for m in modes]  # fmt: skip
    if output_only:
        modes = [replace(m, tone=m.rotor_order is None and is_tone(m, records)) for m in modes]
    rotor_hz = None if turning is None else turning.frequency_hz
    return named(with_whirl(modes, rotor_hz), rotor_hz)


def is_driven(mode: Mode, record: Record, turning: Rotation) -> bool:
    """Tell whether a mode on a multiple of the rotor's speed is what the rotor drives, by its angle and its width."""
    order, uneven = mode.rotor_order or 0, turning.deviation_hz / turning.frequency_hz
    sharp = mode.damping_std is not None and mode.damping + NORMAL * mode.damping_std < SHARPER * uneven
    angle = rotor_angle(record)
    if (is_widened(order) and not sharp) or angle is None or not mode.shares:
        return True
    output = max(mode.shares, key=lambda name: mode.shares[name])
    share = locked_share(record.column(output), order * angle, order * turning.deviation_hz * record.sample_time_s)
    return share >= LOCKED


def locked_share(y: Array, angle: Array, deviation: float) -> float:
    """Return the share of the power of y (N,) about the mean rate of an angle (N,) in rad that its sine explains.

    deviation: of that rate, cycles a sample. The power is that within two of them, and within BAND lines, seen through
    a Hann window; missing samples are left out.
    """
    good = np.flatnonzero(np.isfinite(y) & np.isfinite(angle))[:LONGEST]
    count = int(good[-1] - good[0] + 1) if len(good) > 2 else 0
    if count < 2 * BAND:
        return 1.0
    window: Array = np.zeros(count)
    window[good - good[0]] = np.hanning(count)[good - good[0]]
    kept = slice(good[0], good[-1] + 1)
    turned, values = np.nan_to_num(angle[kept]), np.nan_to_num(y[kept])
    seen: Array = window * (values - np.average(values, weights=window))
    rate = abs(np.unwrap(turned[good - good[0]])[[0, -1]] @ [-1, 1]) / (2 * np.pi * count)
    near = abs(np.fft.rfftfreq(count) - rate) <= max(BAND / count, 2 * deviation)
    before, after = (
        float((abs(np.fft.rfft(v)[near]) ** 2).sum()) for v in (seen, _without_angle(seen, window, turned))
    )
    return 1.0 - after / before if before > 0 else 0.0


def is_tone(mode: Mode, records: Sequence[Record]) -> bool:
    """Tell whether a mode may have no damping and is a steady sine in an output that it moves.

    Of those that it moves at least half as much as the one it moves most: a mode beside a line adds noise to it in some
    (1.67 Hz to 9P at 1.8 Hz in a shaft, 77 % one sine; in the tower's top 99.6 %), and a mode's wandering is in all.
    """
    if mode.is_real or mode.damping_std is None or not mode.shares:
        return False
    most = max(mode.shares.values())
    for output in (name for name, share in mode.shares.items() if share >= most / 2):
        y, step = _longest_stretch(records, output)
        length = len(y) * step
        if not mode.vanishes(length, deviations=WIDER) or mode.frequency_hz * length < 2 * BAND:
            continue
        share = steady_share(y, mode.frequency_hz * step, WIDER * (mode.frequency_std_hz or 0.0) * step)
        if share >= (STEADY if mode.vanishes(length) else STEADIER):
            return True
    return False


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
    angle: Array = 2 * np.pi * frequency * np.arange(len(seen), dtype=np.float64)
    return _without_angle(seen, window, angle)


def _without_angle(seen: Array, window: Array, angle: Array) -> Array:
    """Return what is left of seen (N,) without its best sine of an angle (N,), both through the window."""
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
