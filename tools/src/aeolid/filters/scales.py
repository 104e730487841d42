"""Find the offsets and scales that fit channels, and those that hide a channel from a recursive filter.

The filters take x = (value − offset) / scale and start from zero with the weight ρ of paper 000 section II-E: a channel
whose deviation is s scales is seen once N s² is well above ρ. `port/discon/scale_watch.h` judges by the same numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FACTOR = 30.0  # by which scale and deviation may differ: then ρ = 0.1 weighs as much as 90 samples
OFF_MOST = 10.0  # scales between offset and mean: a tenth of the range outside which the wrapper refuses samples
LEAST = 20  # samples that are judged
START_S = 60.0  # of a run, in which a simulator or turbine may not have settled


@dataclass(eq=False)
class ChannelSums:
    """Hold count, mean, sum of squared differences from it and bounds of each channel, (channels,) each."""

    count: Array
    mean: Array
    square: Array
    least: Array
    most: Array

    @classmethod
    def empty(cls, channels: int) -> ChannelSums:
        """Return those of no sample."""
        zero = np.zeros(channels)
        return cls(zero, zero, zero, np.full(channels, np.inf), np.full(channels, -np.inf))

    def add(self, values: Array) -> None:
        """Take samples (N, channels), missing ones NaN (Chan, Golub & LeVeque 1983, eq. 2.1)."""
        there = np.isfinite(values)
        count = there.sum(axis=0).astype(float)
        if not count.any():
            return
        known = np.maximum(count, 1.0)
        mean = np.where(there, values, 0.0).sum(axis=0) / known
        square = (np.where(there, values - mean, 0.0) ** 2).sum(axis=0)
        total, step = np.maximum(self.count + count, 1.0), mean - self.mean
        self.mean = self.mean + step * count / total
        self.square = self.square + square + step**2 * self.count * count / total
        self.count = self.count + count
        self.least = np.minimum(self.least, np.where(there, values, np.inf).min(axis=0))
        self.most = np.maximum(self.most, np.where(there, values, -np.inf).max(axis=0))

    @property
    def deviation(self) -> Array:
        """Return the standard deviations (channels,)."""
        result: Array = np.sqrt(self.square / np.maximum(self.count, 1.0))
        return result


@dataclass(eq=False)
class RunSums:
    """Hold the sums of one run: those of its first `start` rows apart from those after."""

    channels: int
    start: int
    rows: int = 0
    first: ChannelSums = field(init=False)
    rest: ChannelSums = field(init=False)

    def __post_init__(self) -> None:
        self.first, self.rest = ChannelSums.empty(self.channels), ChannelSums.empty(self.channels)

    def add(self, values: Array) -> None:
        """Take rows (N, channels)."""
        cut = max(min(self.start - self.rows, len(values)), 0)
        self.first.add(values[:cut])
        self.rest.add(values[cut:])
        self.rows += len(values)

    @property
    def judged(self) -> ChannelSums:
        """Return the sums of what followed the start, of the start where that is not enough."""
        return self.rest if self.rows - self.start >= LEAST else self.first


def fitting(mean: float, deviation: float) -> tuple[str, str]:
    """Return offset and scale as text: the mean to a tenth of the deviation's decade, the deviation to two digits."""
    places = 1 - math.floor(math.log10(deviation))
    return f"{round(mean, places) + 0.0:.9g}", f"{float(f'{deviation:.2g}'):.9g}"


def find_problems(
    names: tuple[str, ...], units: tuple[str, ...], offset: Array, scale: Array, sums: ChannelSums
) -> tuple[str, ...]:
    """Say of each channel that a filter with this offset and scale hardly sees what is wrong and what would fit.

    names, units, offset, scale (channels,): as the filter has them; sums of as many channels.
    """
    found = (
        _find_problem(names[i], units[i], float(offset[i]), float(scale[i]), sums, i)
        for i in range(len(names))
        if sums.count[i] >= LEAST
    )
    return tuple(text for text in found if text)


def _find_problem(name: str, unit: str, offset: float, scale: float, sums: ChannelSums, i: int) -> str:
    mean, deviation = float(sums.mean[i]), float(sums.deviation[i])
    unit = f" {unit}" if unit else ""
    if sums.least[i] == sums.most[i]:
        return (
            f"{name} is constant at {sums.least[i]:.7g}{unit}: nothing can be learnt of it; excite it, or take it out "
            "of the controller's filter; here give it the role ignore, and identify without --markov"
        )
    shift, spread = (mean - offset) / scale, deviation / scale
    if 1 / FACTOR <= spread <= FACTOR and abs(shift) <= OFF_MOST:
        return ""
    if spread < 1 / FACTOR:
        effect = "the filter hardly sees it"
    else:
        effect = "it drowns the others in the filter" if spread > FACTOR else "near the end of the range or beyond"
    fits = "offset {} scale {}".format(*fitting(mean, deviation))
    return (
        f"{name}: its mean lies {shift:.3g} scales from its offset and its deviation is {spread:.2g} scales (offset "
        f"{offset:g}, scale {scale:g}{unit}): {effect}; {fits} would fit"
    )
