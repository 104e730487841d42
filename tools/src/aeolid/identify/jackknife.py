"""Find standard deviations of the poles by leaving out one stretch of the recordings at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.outcome import nearest
from aeolid.identify.windows import WindowFactor

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def merged(factors: Sequence[WindowFactor]) -> WindowFactor:
    """Return the factor of all windows together."""
    whole = factors[0]
    for factor in factors[1:]:
        whole = whole.merge(factor)
    return whole


def leave_one_out(factors: Sequence[WindowFactor]) -> list[WindowFactor]:
    """Return for each group the factor of all the others, with 3 merges a group."""
    before, after = [factors[0]], [factors[-1]]
    for factor in factors[1:-1]:
        before.append(before[-1].merge(factor))
    for factor in factors[-2:0:-1]:
        after.append(after[-1].merge(factor))
    after = after[::-1]  # after[i]: groups i + 1 …
    middle = [b.merge(a) for b, a in zip(before[:-1], after[1:], strict=True)]
    return [after[0], *middle, before[-1]]


def jackknife(
    factors: Sequence[WindowFactor], poles: ComplexArray, estimate: Callable[[WindowFactor], ComplexArray]
) -> Array:
    """Return the covariance (n, 2, 2) of real and imaginary part of each pole (delete-a-group jackknife).

    factors: of G stretches of equal length; estimate: poles (n,) from a factor. (G − 1)/G Σ (z_i − z̄)(z_i − z̄)ᵀ, z_i
    the pole of the estimate without stretch i that lies nearest, by optimal assignment. It assumes stretches much
    longer than the loop's memory, and nothing of the noise. NaN where an estimate failed.
    """
    n, found = len(poles), []
    for factor in leave_one_out(factors):
        try:
            others = estimate(factor)
        except (np.linalg.LinAlgError, NotIdentifiable):
            return np.full((n, 2, 2), np.nan)
        found.append(others[nearest(poles, others)])
    z = np.array(found)  # (G, n)
    parts = np.stack([z.real, z.imag], axis=-1)
    parts -= parts.mean(axis=0)
    count = len(factors)
    out: Array = np.einsum("gni,gnj->nij", parts, parts) * (count - 1) / count
    return out
