"""Say whether a mode is no more than what is seen at the one frequency at which an input moves (S5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.rules import in_force

Array = NDArray[np.float64]
_BINS = 2.5  # frequency bins either side of a line: the main lobe of a Hann window, and half a bin
_FEWEST = 64  # rows of which a spectrum says anything


def at_a_line(
    values: Mapping[str, Mapping[str, tuple[float, float]]], segments: Sequence[Segment], computed: Sequence[int] = ()
) -> str:  # fmt: skip
    """Say which mode lies where an input has most of its power in one line; empty where none does.

    All that is known there is a gain and a phase at one frequency, which a bend has as well: a transformer's core
    that saturates was a mode of 50.02 Hz of the primary current, which the mains drive with 50. Cost: a transform of
    each input, where a mode is among the effects. computed: columns that nobody recorded, which drive nothing (the
    angle of a shaft wanders, and lay at each slow swing).
    """
    longest = max(segments, key=lambda s: len(s.u))
    for key, told in values.items():
        if "frequency_hz" in told and len(longest.u) >= _FEWEST:
            line = max(_shares(longest, told["frequency_hz"][0], computed), default=0.0)
            if line > in_force().candidates.line_share:
                return f"{key}: an input has {line:.0%} of its power at this frequency, where a bend looks the same"
    return ""


def _shares(segment: Segment, hz: float, computed: Sequence[int]) -> list[float]:
    """Return which share of its power each input has in the bins about a frequency."""
    recorded = np.delete(segment.u, list(computed), axis=1)
    u = recorded - recorded.mean(axis=0)
    power = np.square(np.abs(np.fft.rfft(u * np.hanning(len(u))[:, None], axis=0)))
    near = np.abs(np.fft.rfftfreq(len(u), segment.fine_step) - hz) * len(u) * segment.fine_step <= _BINS
    whole = power.sum(axis=0)
    return [float(p[near].sum() / w) for p, w in zip(power.T, whole, strict=True) if w > 0]
