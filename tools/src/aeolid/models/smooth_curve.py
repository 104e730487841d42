"""The smooth curve through a recording: a spline of degree 7, its means over samples and its values as they begin.

A basis whose knots are all the samples makes the curve, an offset later, one weighted sum of neighbouring
coefficients for all samples at once: eight for values and nine for means, since the integral of a basis over a
sample is the basis of one degree more (de Boor 1978, chapter X). The spline itself has no knots at the three
samples next to either end ("not a knot"); with knots there, across which nothing changes, it is the same curve.
That is twenty times faster than asking the spline at every instant, and takes no differences of integrals that have
grown long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DEGREE = 7
_OWN = 11  # coefficients at either end that the spline with fewer knots lacks: those that its outermost piece lasts for
_KEPT = 20_000  # samples of the longest recording whose curve is kept: 64 of these are 20 MB


@dataclass(frozen=True)
class SmoothCurve:
    """Hold the curve through samples (N,), N > 15, one a unit of time; constant before and after them.

    coefficients (N + 7,): of the basis that begins at the knots −7 … N − 1. first and last (9,): the curve's integral
    within the first and the last interval, powers of the time from its middle, the highest first.
    """

    samples: Array
    coefficients: Array
    first: Array
    last: Array

    def values(self, shift: float) -> Array:
        """Return the values (N,) at k + shift, k = 0 … N − 1."""
        count = len(self.samples)
        whole, fraction = self._split(shift)
        begin, end = _clipped(-whole, count), _clipped(count - 1 - whole, count)  # of those within the recording
        return self._composed(DEGREE, whole, fraction, begin, end)

    def means(self, shift: float) -> Array:
        """Return the means (N,) over k + shift … k + shift + 1."""
        count = len(self.samples)
        whole, fraction = self._split(shift)
        end = count - 1 - whole - (fraction > 0)  # an interval that reaches beyond the end is no part of it
        found = self._composed(DEGREE + 1, whole, fraction, _clipped(-whole, count), _clipped(end, count))
        over, under = -whole - 1, count - 2 - whole  # the intervals in which recording begins and ends
        if fraction > 0 and 0 <= over < count:
            part = np.polyval(self.first, [fraction - 0.5, -0.5])
            found[over] = (1 - fraction) * self.samples[0] + part[0] - part[1]
        if fraction > 0 and 0 <= under < count:
            part = np.polyval(self.last, [0.5, fraction - 0.5])
            found[under] = fraction * self.samples[-1] + part[0] - part[1]
        return found

    def _split(self, shift: float) -> tuple[int, float]:
        """Return the whole samples and the rest of a shift, which beyond the recording need not be exact.

        Of a shift that is no number the rest is none either, and so is what is composed of it.
        """
        if math.isnan(shift):
            return 0, shift
        bounded = min(max(shift, -2.0 * len(self.samples)), 2.0 * len(self.samples))
        whole = math.floor(bounded)
        return whole, bounded - whole

    def _composed(self, degree: int, whole: int, fraction: float, begin: int, end: int) -> Array:
        """Return constants before sample `begin` and from `end` on, between them sums of degree + 1 coefficients."""
        found = np.full(len(self.samples), self.samples[0] + 0.0 * fraction)
        found[end:] = self.samples[-1] + 0.0 * fraction
        if begin < end:
            part = self.coefficients[begin + whole : end + whole + degree]
            found[begin:end] = np.correlate(part, fraction ** np.arange(degree, -1.0, -1.0) @ _basis(degree))
        return found


def _clipped(index: int, count: int) -> int:
    return min(max(index, 0), count)


@lru_cache
def _basis(degree: int) -> Array:
    """Return the powers (degree + 1, degree + 1), highest first, of the basis's pieces, its last piece first.

    Σ (−1)^j C(d + 1, j) (x − j)₊^d / d! (Schoenberg 1946), in whole numbers: the terms are far larger than the sum.
    """
    signed: list[int] = [(-1) ** j * math.comb(degree + 1, j) for j in range(degree + 1)]

    def power(k: int, m: int) -> int:
        terms: list[int] = [signed[j] * (m - j) ** (degree - k) for j in range(m + 1)]
        return math.comb(degree, k) * sum(terms)

    down = range(degree, -1, -1)
    return np.array([[power(k, m) for m in down] for k in down], dtype=float) / math.factorial(degree)


def smooth_curve(samples: Array) -> SmoothCurve:
    """Return the curve through samples (N,); that of a short recording is kept, as fits ask for it again and again."""
    samples = np.ascontiguousarray(samples)
    return _kept(samples.tobytes()) if len(samples) <= _KEPT else _through(samples)


@lru_cache(maxsize=64)
def _kept(samples: bytes) -> SmoothCurve:
    return _through(np.frombuffer(samples))


def _through(samples: Array) -> SmoothCurve:
    """Lay the curve: the spline's own coefficients, and those at the ends by its powers about a point near."""
    from scipy.interpolate import make_interp_spline  # half a second to load

    count = len(samples)
    spline = make_interp_spline(np.arange(count, dtype=float), samples, k=DEGREE)
    begins = np.r_[-DEGREE : _OWN - DEGREE, count - 1 - _OWN : count - 1]  # the first knots of the basis
    middles = np.clip(begins + DEGREE // 2 + (begins > 0), 0, count - 2) + 0.5
    powers = np.stack([spline(middles, nu=k) / math.factorial(k) for k in range(DEGREE + 1)])  # (8, 22)
    ends = np.sum(powers * _blossom(begins[:, None] + np.arange(1.0, DEGREE + 1) - middles[:, None]), axis=0)
    inner = spline.c[DEGREE + 1 : count - DEGREE - 1]  # of the basis that begins at the knots 4 … N − 13
    coefficients = np.concatenate([ends[:_OWN], inner, ends[_OWN:], [0.0]])
    return SmoothCurve(samples, coefficients, np.polyint(powers[::-1, 0]), np.polyint(powers[::-1, -1]))


def _blossom(knots: Array) -> Array:
    """Return the weights (8, k) of the powers of x in a coefficient whose inner knots are those (k, 7).

    The coefficient is the polar form of the piece at its knots: of x^j, the elementary symmetric polynomial of degree j
    over its number of terms (Ramshaw 1989).
    """
    symmetric = np.zeros((DEGREE + 1, len(knots)))
    symmetric[0] = 1.0
    for column in knots.T:
        symmetric[1:] += column * symmetric[:-1].copy()
    terms = np.array([math.comb(DEGREE, j) for j in range(DEGREE + 1)])
    return np.asarray(symmetric / terms[:, None])
