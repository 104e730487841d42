"""Make bounded test signals sample by sample: maximum-length and filtered binary sequences, multisines.

prbs and the multisine with Schroeder's phases are those of the wrapper for Bladed-style controllers
(`port/discon/excitation.h`), whose equations stand there; the same numbers make the same signal there and here. The
filtered binary sequence is the sign of white Gaussian noise through a band-pass (Ljung, System Identification, 1999,
section 13.3): all its power is its amplitude squared, most of it within the band.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

Array = NDArray[np.float64]
TAPS = {5: 0x14, 6: 0x30, 7: 0x60, 8: 0xB8, 9: 0x110, 10: 0x240, 11: 0x500, 12: 0xE08, 13: 0x1C80, 14: 0x3802,
        15: 0x6000}  # fmt: skip  # bit i − 1 for stage i (Golomb, Shift register sequences, 1967)
WORD = 0xFFFFFFFF
PEAK_POINTS = 65536  # instants at which the wrapper looks for the peak of a multisine
FINE = 16  # instants a period of the highest line at which the peak of a long sum is looked for
DRAWS = 20  # sets of random phases, of which the one with the lowest crest is taken
FILTER_ORDER = 4
CHUNK = 1_000_000  # cosines at a time: 8 MB


def register_bits(order: int, seed: int) -> NDArray[np.bool_]:
    """Return one period (2^order − 1,) of the maximum-length sequence; seed: 0 … 2³² − 1, picks where it begins."""
    period = (1 << order) - 1
    state, taps = 1 + seed % period, TAPS[order]
    out = np.empty(period, dtype=bool)
    for i in range(period):
        out[i] = state & 1
        state = ((state << 1) | ((state & taps).bit_count() & 1)) & period
    return out


def seed_after(order: int, seed: int, bits: int) -> int:
    """Return the seed with which the register begins so many bits later."""
    period = (1 << order) - 1
    state, taps = 1 + seed % period, TAPS[order]
    for _ in range(bits % period):
        state = ((state << 1) | ((state & taps).bit_count() & 1)) & period
    return state - 1


def scattered(word: int) -> float:
    """Spread 32 bits over 0 … 1: the finaliser of MurmurHash3, as the wrapper."""
    word &= WORD
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35), (16, 1)):
        word = (word ^ (word >> shift)) * factor & WORD
    return word / 4294967296.0


@dataclass(frozen=True, eq=False)
class Lines:
    """Hold a sum of cosines of equal size: frequency_hz (L,), phase (L,) in rad, peak: the most of |sum|."""

    frequency_hz: Array
    phase: Array
    peak: float

    def at(self, time_s: Array) -> Array:
        """Return the sum over its peak at instants (N,), −1 … 1."""
        out = np.empty(len(time_s))
        step = max(1, CHUNK // len(self.frequency_hz))
        for first in range(0, len(out), step):
            part = time_s[first : first + step]
            out[first : first + step] = np.cos(2 * np.pi * np.outer(part, self.frequency_hz) + self.phase).sum(axis=1)
        return np.clip(out / self.peak, -1.0, 1.0)

    def steepest(self) -> float:
        """Return the largest slope of the sum over its peak, a second."""
        return float(_long_peak(self.frequency_hz, self.phase, slope=True)) / self.peak


def schroeder_lines(frequency_hz: Array, seed: int, span_s: float) -> Lines:
    """Return even lines with phases after Schroeder (1970), eq. (11), turned in time by the seed, as the wrapper.

    frequency_hz (L,) from low to high; span_s: how long the signal will last.
    """
    count, low, high = len(frequency_hz), float(frequency_hz[0]), float(frequency_hz[-1])
    i = np.arange(count)
    phase = -np.pi * i * (i + 1.0) / count + 2 * np.pi * frequency_hz * scattered(seed) / low
    if count > 64:  # more than the wrapper takes
        return Lines(frequency_hz, phase, _long_peak(frequency_hz, phase))
    span, fine = span_s + 1.0 / low, 1.0 / (16.0 * high)
    step = span / PEAK_POINTS if span / fine > PEAK_POINTS else fine
    unscaled = Lines(frequency_hz, phase, float(count))
    instants: Array = np.arange(int(span / step) + 1, dtype=np.float64) * step
    peak = float(abs(unscaled.at(instants)).max()) * count
    return Lines(frequency_hz, phase, max(peak, 1.0))


def random_lines(frequency_hz: Array, seed: int) -> Lines:
    """Return even lines with random phases: of DRAWS sets the one with the lowest crest."""
    rng = np.random.default_rng(seed)
    drawn = [rng.uniform(-np.pi, np.pi, len(frequency_hz)) for _ in range(DRAWS)]
    peak, phase = min(((_long_peak(frequency_hz, p), i) for i, p in enumerate(drawn)), key=lambda pair: pair[0])
    return Lines(frequency_hz, drawn[phase], peak)


def _long_peak(frequency_hz: Array, phase: Array, *, slope: bool = False) -> float:
    """Return the most of |Σ cos(2πft + φ)|, or of its slope a second, over a period of the grid the lines lie on.

    Between the instants it may be passed by 1 − cos(π/16) = 2 %, which is added.
    """
    spacing = float(frequency_hz[1] - frequency_hz[0]) if len(frequency_hz) > 1 else float(frequency_hz[0])
    offset = round(float(frequency_hz[0]) / spacing)
    shift = float(frequency_hz[0]) - offset * spacing  # the grid begins at this frequency: turns the sum, keeps |.|
    top = offset + len(frequency_hz)
    points = 1 << int(np.ceil(np.log2(2 * FINE * top)))
    weight = 2 * np.pi * frequency_hz * 1j if slope else np.ones(len(frequency_hz))
    turned = np.zeros(points, dtype=complex)
    turned[offset : offset + len(frequency_hz)] = weight * np.exp(1j * phase)
    analytic = np.fft.ifft(turned) * points
    if abs(shift) < 1e-9 * spacing:
        most = float(abs(analytic.real).max())
    else:
        most = float(abs(analytic).max())  # whatever the turn
    return most / math.cos(math.pi / FINE)


def filtered_signs(low_hz: float, high_hz: float, step_s: float, count: int, seed: int) -> Array:
    """Return ±1 (count,): the sign of white Gaussian noise through a Butterworth band-pass (a low-pass at low 0)."""
    nyquist = 0.5 / step_s
    high = min(high_hz / nyquist, 0.98)
    low = low_hz / nyquist
    sections = butter(FILTER_ORDER, high, output="sos") if low <= 0 else butter(
        FILTER_ORDER, [low, high], btype="bandpass", output="sos")  # fmt: skip
    lead = min(int(10 / (step_s * max(low_hz, high_hz / 10))), 100_000)  # the filter's own start is left out
    noise = np.random.default_rng(seed).standard_normal(lead + count)
    return np.where(np.asarray(sosfilt(sections, noise))[lead:] >= 0, 1.0, -1.0)


def rate_limited(target: Array, most: float, start: float = 0.0) -> Array:
    """Return what follows target (N,) by at most `most` a sample, from `start` before the first."""
    if not np.isfinite(most):
        return target
    jumps = np.diff(target, prepend=start)
    if float(abs(jumps).max(initial=0.0)) <= most:
        return target
    out, value = np.empty(len(target)), start
    for k, wanted in enumerate(target.tolist()):
        value = min(max(wanted, value - most), value + most)
        out[k] = value
    return out
