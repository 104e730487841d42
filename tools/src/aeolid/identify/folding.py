"""Say what lies beyond the Nyquist frequency of a decimated recording, and which modes are folded down from there.

Outputs are read at the longer samples without a filter (see `models.rate`), so that a mode at f beyond the new Nyquist
frequency appears at |f − k/T|, T the longer sample, with its own rate of decay. The recording at its own rate shows
where the outputs have peaks beyond the new Nyquist frequency; the mode nearest to the image of such a peak may be that
image and says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.models.modes import Mode
from aeolid.models.prediction import complete_stretches
from aeolid.record import Record

Array = NDArray[np.float64]
PERIODS = 256  # longer samples of a spectrum's segment: it tells frequencies apart by 1/128 of the new Nyquist's
LONGEST = 500_000  # samples of a recording whose spectrum is taken
PROMINENCE = 6.0  # dB of a peak over its surroundings; 8 averaged segments scatter by 1.5 dB
SHARE = 0.1  # of the power at the image: less cannot make a mode that is told beside what is there
NEAR = 0.04  # of the new Nyquist frequency: as near to the image as an estimate comes
MATERIAL = 0.05  # of an output's power beyond the new Nyquist frequency; less is lost in the noise
EDGE = 0.97  # of the Nyquist frequency: a pole beyond it is near the negative real axis, where modes cannot be told


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Hold the power densities (bins, l) of the outputs at the recording's rate over frequency (bins,) in Hz."""

    frequency: Array
    density: Array
    outputs: tuple[str, ...]

    @classmethod
    def of(cls, record: Record, factor: int) -> Spectrum | None:
        """Return those of the longest complete stretch; None where it holds fewer than 4 segments' worth of samples."""
        from scipy.signal import welch  # a second to load

        names = record.names("output")
        y = record.columns(names)
        start, stop = max(complete_stretches(y, 1), key=lambda s: s[1] - s[0], default=(0, 0))
        y = y[start : min(stop, start + LONGEST)]
        segment = min(PERIODS * factor, len(y) // 4)
        if segment < 16 * factor:
            return None
        frequency, density = welch(y, 1.0 / record.sample_time_s, nperseg=segment, axis=0)
        return cls(frequency, density, names)

    def beyond(self, nyquist_hz: float) -> dict[str, float]:
        """Return the part of each output's power beyond a frequency."""
        total, high = self.density.sum(axis=0), self.density[self.frequency > nyquist_hz].sum(axis=0)
        parts = high / np.where(total > 0, total, 1.0)
        return {name: float(p) for name, p in zip(self.outputs, parts, strict=True)}

    def peaks(self, nyquist_hz: float) -> list[float]:
        """Return where modes beyond a frequency show: prominent peaks of any output, each frequency once, Hz."""
        from scipy.signal import find_peaks

        found: list[float] = []
        for j in range(len(self.outputs)):
            level = 10 * np.log10(np.maximum(self.density[:, j], self.density[:, j].max() * 1e-12))
            places, _ = find_peaks(level, prominence=PROMINENCE, width=2)
            for place in places[np.argsort(-level[places])]:
                f = float(self.frequency[place])
                if f > nyquist_hz and all(abs(f - g) > 4 * self.frequency[1] for g in found):
                    found.append(f)
        return found

    def matters(self, f: float, image: float) -> bool:
        """Say whether some output holds at f at least a tenth of the power it has at the image."""
        return bool(np.any(self._power(f) > SHARE * self._power(image)))

    def _power(self, f: float) -> Array:
        out: Array = self.density[abs(self.frequency - f) <= 2 * self.frequency[1]].mean(axis=0)
        return out


def image_of(frequency_hz: float, sample_time_s: float) -> float:
    """Return the frequency below 1/(2 T) at which samples every T show a frequency, Hz."""
    return abs(frequency_hz - round(frequency_hz * sample_time_s) / sample_time_s)


def tell_of_folding(
    modes: Sequence[Mode], notes: Sequence[str], raw: Sequence[Record], factor: int
) -> tuple[tuple[Mode, ...], tuple[str, ...]]:
    """Return the modes from recordings decimated by `factor` with images marked, and the notes with what folds.

    raw: the recordings before. Poles within 3 % of the new Nyquist frequency are no modes that could be told and leave
    the list. A factor of 1 returns both as they are.
    """
    if factor == 1:
        return tuple(modes), tuple(notes)
    step = raw[0].sample_time_s * factor
    spectrum = Spectrum.of(max(raw, key=len), factor)
    kept = [m for m in modes if abs(np.angle(m.eigenvalue)) <= EDGE * np.pi]
    said, nyquist = list(notes), 0.5 / step
    if len(kept) < len(modes):
        said.append(
            f"{len(modes) - len(kept)} pole(s) at the Nyquist frequency of the longer sample, {nyquist:g} Hz, "
            "are not listed as modes: use a smaller factor where modes are sought there"
        )
    if spectrum is not None:
        kept = _marked(kept, spectrum, step)
        loud = {n: p for n, p in spectrum.beyond(nyquist).items() if p > MATERIAL}
        if loud:
            parts = ", ".join(f"{p:.0%} of {n}" for n, p in loud.items())
            said.append(
                f"beyond the Nyquist frequency of the longer sample, {nyquist:g} Hz, lies {parts}: it folds down into "
                "noise or images of modes, and modes there are not told; use a smaller factor for those"
            )
    return tuple(kept), tuple(said)


def _marked(modes: Sequence[Mode], spectrum: Spectrum, step: float) -> list[Mode]:
    """Mark, for each peak beyond the Nyquist frequency, the oscillating mode nearest to its image."""
    marked = list(modes)
    turned = np.array([np.angle(m.eigenvalue) / (2 * np.pi * step) if m.eigenvalue.imag > 0 else np.inf for m in modes])
    for f in spectrum.peaks(0.5 / step):
        image = image_of(f, step)
        if not len(turned) or not spectrum.matters(f, image):
            continue
        best = int(np.argmin(abs(turned - image)))
        decay = -float(np.log(max(abs(modes[best].eigenvalue), 1e-12))) / (2 * np.pi * step)
        near = abs(turned[best] - image) < max(decay, NEAR * 0.5 / step)
        if near and marked[best].folded_from_hz is None:
            marked[best] = replace(marked[best], folded_from_hz=f)
    return marked
