"""Estimate frequency responses from spectra, without a model: what a parametric estimate is to be held against.

H₁ = S_yu S_uu⁻¹ of all inputs together, from cross-spectra that a Hann window and an average over neighbouring
frequencies smooth (Ljung 1999, section 6.4; Bendat and Piersol 2010, chapter 7). The average is a tenth wide to either
side, so that it resolves as a logarithmic axis does, and at the lowest frequencies as wide as it must be for its number
of independent values. In a closed loop it leans towards the inverse of the controller, as no model here does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import detrend
from scipy.signal.windows import hann

from aeolid.record import Record

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
POINTS = 150  # frequencies at most
_WIDTH = 1.1  # of an average, as a factor to either side
_LEAST = 8  # independent values in an average, beside one for each input
_CORRELATED = 35 / 18  # neighbours of a Hann window's spectrum count so much less than independent ones
_SHORTEST = 64  # samples of a stretch without gaps that is looked at
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
    told apart. Time grows as N log N of the samples.
    """
    inputs, outputs = records[0].names("input"), records[0].names("output")
    if not inputs:
        return None
    step = records[0].sample_time_s
    transforms = [_transform(part, step) for r in records for part in _stretches(r, [*inputs, *outputs])]
    if not transforms:
        return None
    found = [
        row for f in _frequencies(transforms, len(inputs), step) if (row := _at(transforms, f, len(inputs))) is not None
    ]
    if not found:
        return None
    at, response, std, coherence, averages = (np.array(column) for column in zip(*found, strict=True))
    return SpectralEstimate(at, response, std, coherence, averages, tuple(inputs), tuple(outputs))


def _stretches(record: Record, names: Sequence[str]) -> list[Array]:
    """Return the stretches (n, channels) of a recording in which nothing is missing, long enough to be looked at."""
    values = np.column_stack([record.column(name) for name in names])
    whole = np.concatenate([[False], np.all(np.isfinite(values), axis=1), [False]])
    edges = np.flatnonzero(np.diff(whole.astype(np.int8)))
    return [values[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= _SHORTEST]


def _transform(values: Array, step: float) -> tuple[Array, Complex]:
    """Return frequencies (k,) and the windowed transform (k, channels) of a stretch, its straight line taken off."""
    count = len(values)
    window = hann(count, sym=False)
    scale = np.sqrt(step / np.sum(window**2))
    transformed: Complex = np.fft.rfft(detrend(values, axis=0) * window[:, None], axis=0) * scale
    return np.asarray(np.fft.rfftfreq(count, step), dtype=np.float64), transformed


def _frequencies(transforms: Sequence[tuple[Array, Complex]], inputs: int, step: float) -> Array:
    """Return the centres of the averages, from the lowest that has independent values enough."""
    values_per_hz = sum(1 / f[1] for f, _ in transforms) / _CORRELATED
    lowest = (_LEAST + inputs) / values_per_hz / 2 + max(f[1] for f, _ in transforms)
    highest = _HIGHEST * 0.5 / step
    return np.geomspace(lowest, highest, POINTS) if lowest < 0.5 * highest else np.zeros(0)


def _at(
    transforms: Sequence[tuple[Array, Complex]], frequency: float, inputs: int
) -> tuple[float, Complex, Array, Array, float] | None:
    """Return frequency, response, deviation, coherence and averages about one frequency; None where inputs are one."""
    values_per_hz = sum(1 / f[1] for f, _ in transforms) / _CORRELATED
    half = max(frequency * (_WIDTH - 1), (_LEAST + inputs) / values_per_hz / 2)
    rows = np.concatenate([z[(np.abs(f - frequency) <= half) & (f > 0)] for f, z in transforms])
    averages = len(rows) / _CORRELATED
    if averages < inputs + 2:
        return None
    spectra = rows.T @ rows.conj() / len(rows)
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
    return frequency, response, std, np.clip(coherence, 0.0, 1.0), averages
