"""Fit the line of Theil and Sen: the median of all slopes, and its distribution-free interval.

As `scipy.stats.theilslopes`, whose package a listener would load for this alone, a third of its time to start.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Line(NamedTuple):
    """Hold slope, intercept and the ends of the slope's interval."""

    slope: float
    intercept: float
    low: float
    high: float


def fit_line(x: Array, y: Array, confidence: float) -> Line:
    """Return the line through points (n,), n ≥ 2, of which no two share their x; confidence: of the interval, 0 to 1.

    The intercept is median(y) − slope median(x). The interval takes the slopes of rank (N ∓ z σ)/2 of all N, σ² being
    the variance of Kendall's S with ties of y (Sen 1968, equation 2.6). Cost: n² / 2 slopes.
    """
    first, second = np.triu_indices(len(x), 1)
    slopes = np.sort((y[second] - y[first]) / (x[second] - x[first]))
    slope = float(np.median(slopes))
    n, ties = len(x), np.unique(y, return_counts=True)[1]
    variance = (n * (n - 1) * (2 * n + 5) - float(np.sum(ties * (ties - 1) * (2 * ties + 5)))) / 18
    reach = NormalDist().inv_cdf(0.5 + confidence / 2) * variance**0.5
    low = max(round((len(slopes) - reach) / 2) - 1, 0)
    high = min(round((len(slopes) + reach) / 2), len(slopes) - 1)
    return Line(slope, float(np.median(y)) - slope * float(np.median(x)), float(slopes[low]), float(slopes[high]))
