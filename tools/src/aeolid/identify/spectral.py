"""Estimate frequency responses from spectra, without a model: what a parametric estimate is to be held against.

H₁ = S_yu S_uu⁻¹ of all inputs together, from cross-spectra that a Hann window and an average over neighbouring
frequencies smooth (Ljung 1999, section 6.4; Bendat and Piersol 2010, chapter 7). The average is a tenth wide to either
side, so that it resolves as a logarithmic axis does, and at the lowest frequencies as wide as it must be for its number
of independent values. In a closed loop it leans towards the inverse of the controller, as no model here does.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.record import Record

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
POINTS = 150  # frequencies at most
_WIDTH = 1.1  # of an average, as a factor to either side
_LEAST = 8  # independent values in an average, beside one for each input
_CORRELATED = 35 / 18  # neighbours of a Hann window's spectrum count so much less than independent ones
_SHORTEST, _LONGEST = 64, 1 << 18  # samples of a stretch without gaps that is looked at as one
_SHARE = 8  # of the longest: shorter stretches tell nothing of slow motion and would blur it
_HIGHEST = 0.95  # of the Nyquist frequency
_SINGULAR = 1e-10  # of the largest eigenvalue of S_uu in units of each input: below, inputs cannot be told apart


@dataclass(frozen=True, eq=False)
class SpectralEstimate:
    """Hold an estimate at F frequencies: response (F, l, r) complex, its deviation and the coherence.

    std (F, l, r): of the gain, and over the gain of the phase in radians. coherence (F, l): the share of each output's
    power that all inputs together explain, 0 to 1. averages (F,): independent values in each average.
    """

    frequency_hz: Array
    response: Complex
    std: Array
    coherence: Array
    averages: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the estimate as JSON facts: frequencies, coherence of each output, gain and phase of each pair."""
        return {
            "frequency_hz": self.frequency_hz.tolist(),
            "averages": self.averages.tolist(),
            "coherence": {name: self.coherence[:, i].tolist() for i, name in enumerate(self.outputs)},
            "pairs": [
                {
                    "input": source,
                    "output": target,
                    "gain": np.abs(self.response[:, i, j]).tolist(),
                    "phase_deg": np.degrees(np.angle(self.response[:, i, j])).tolist(),
                    "gain_std": self.std[:, i, j].tolist(),
                }
                for i, target in enumerate(self.outputs)
                for j, source in enumerate(self.inputs)
            ],
        }


def estimate_spectra(records: Sequence[Record]) -> SpectralEstimate | None:
    """Estimate the frequency response of recordings of one experiment set from their spectra.

    None without an input, where no stretch without gaps is long enough, and where at no frequency the inputs can be
    told apart. Time grows as N log N of the samples, memory beside the recordings does not grow with them.
    """
    inputs, outputs = records[0].names("input"), records[0].names("output")
    step, parts = records[0].sample_time_s, [(r, *span) for r in records for span in _spans(r, [*inputs, *outputs])]
    longest = max((end - begin for _, begin, end in parts), default=0)
    parts = [part for part in parts if part[2] - part[1] >= longest / _SHARE]
    if not inputs or not parts:
        return None
    centres, halves = _averages([end - begin for _, begin, end in parts], len(inputs), step)
    sums = np.zeros((len(centres), len(inputs) + len(outputs), len(inputs) + len(outputs)), dtype=np.complex128)
    counts = np.zeros(len(centres))
    for record, begin, end in parts:
        transformed = _transform(record.columns([*inputs, *outputs])[begin:end], step)
        edges = np.stack([centres - halves, centres + halves]) * step * (end - begin)  # in lines of the spectrum
        first, last = np.maximum(np.ceil(edges[0]), 1).astype(int), np.floor(edges[1]).astype(int) + 1
        for k, (low, high) in enumerate(zip(first, last, strict=True)):
            rows = transformed[low:high]
            sums[k] += rows.T @ rows.conj()
            counts[k] += len(rows)
    found = [(f, *told) for f, s, n in zip(centres, sums, counts, strict=True) if (told := _solve(s, n, len(inputs)))]
    if not found:
        return None
    at, response, std, coherence, averages = (np.array(column) for column in zip(*found, strict=True))
    return SpectralEstimate(at, response, std, coherence, averages, tuple(inputs), tuple(outputs))


def _spans(record: Record, names: Sequence[str]) -> list[tuple[int, int]]:
    """Return where the stretches begin and end in which nothing is missing, neither too short nor too long."""
    finite = np.all(np.isfinite(record.columns(names)), axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], finite, [False]]).astype(np.int8)))
    found = []
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        pieces = np.linspace(begin, end, 1 + -(-(end - begin) // _LONGEST)).astype(int).tolist()
        found += [(a, b) for a, b in itertools.pairwise(pieces) if b - a >= _SHORTEST]
    return found


def _averages(lengths: Sequence[int], inputs: int, step: float) -> tuple[Array, Array]:
    """Return the centres of the averages and half their widths, from the lowest with independent values enough."""
    values_per_hz = sum(lengths) * step / _CORRELATED
    least = (_LEAST + inputs) / values_per_hz / 2
    lowest, highest = least + 1 / (min(lengths) * step), _HIGHEST * 0.5 / step
    centres = np.geomspace(lowest, highest, POINTS) if lowest < 0.5 * highest else np.zeros(0)
    return centres, np.maximum(centres * (_WIDTH - 1), least)


def _transform(values: Array, step: float) -> Complex:
    """Return the windowed transform (k, channels) of a stretch, its straight line taken off."""
    count = len(values)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(count) / count)
    time = np.arange(count) - 0.5 * (count - 1)
    level = values - values.mean(axis=0)
    level -= np.outer(time, time @ level / (time @ time))
    transformed: Complex = np.fft.rfft(level * window[:, None], axis=0) * np.sqrt(step / np.sum(window**2))
    return transformed


def _solve(sums: Complex, count: float, inputs: int) -> tuple[Complex, Array, Array, float] | None:
    """Return response, deviation, coherence and averages of summed spectra; None where inputs cannot be told apart."""
    averages = count / _CORRELATED
    if averages < inputs + 2:
        return None
    spectra = sums / count
    uu, yu, yy = spectra[:inputs, :inputs], spectra[inputs:, :inputs], np.diag(spectra)[inputs:].real
    size = np.sqrt(np.diag(uu).real)
    if not np.all(size > 0) or np.linalg.eigvalsh(uu / np.outer(size, size))[0] < _SINGULAR:
        return None
    inverse = np.linalg.inv(uu / np.outer(size, size)) / np.outer(size, size)
    response = yu @ inverse
    explained = np.einsum("ij,ij->i", response, yu.conj()).real
    rest = np.maximum(yy - explained, 0.0) * averages / (averages - inputs)
    std = np.sqrt(np.outer(rest, np.diag(inverse).real) / (2 * averages))
    coherence = np.where(yy > 0, explained / np.where(yy > 0, yy, 1.0), 0.0)
    return response, std, np.clip(coherence, 0.0, 1.0), averages
