"""Factors of all windows up to a length, from lagged products: cheap enough to look for options before a fit.

Successive windows overlap, so that the products of blocks i and j of the windows are those of blocks i − 1 and j − 1
but for the samples at both ends of a stretch. One row of blocks takes 2 N m q operations, the rest none of the length
of the recording, where the factor by QR takes 2 N q². The price is that squares are formed: directions below 1e-8 of
the largest are rounding. Where the factor shows such, it is taken by QR instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.linalg import LinAlgError, cholesky
from numpy.typing import NDArray

from aeolid.identify.windows import Scaling, WindowFactor, factorise, triangularise
from aeolid.models.prediction import complete_stretches
from aeolid.record import Record

Array = NDArray[np.float64]
TRUSTED = 1e-6  # of the largest diagonal entry of a factor by products: entries below it are not far above rounding
CHUNK = 8192  # windows that are laid out at a time


def product_factor(
    records: Sequence[Record], scaling: Scaling, past: int, *, first: float = 0.0, last: float = 1.0
) -> WindowFactor:
    """Return what `factorise` returns, from lagged products; by QR where the windows are nearly singular.

    first, last: part of each recording, 0 … 1, in which the targets lie. past: p ≥ 1 samples.
    """
    m = scaling.channels
    width = (past + 1) * m
    gram, total, count = np.zeros((width, width)), np.zeros(width), 0
    for record in records:
        place = {c.name: i for i, c in enumerate(record.channels)}
        start, stop = (max(round(part * len(record)), past) for part in (first, last))
        z = scaling.apply(record.values[start - past : stop, [place[n] for n in scaling.names]])
        for a, b in complete_stretches(z, past + 1):
            gram += _products(np.ascontiguousarray(z[a:b]), past)
            total += _sums(z[a:b], past)
            count += b - a - past
    mean = total / max(count, 1)
    try:
        R = cholesky(gram - np.outer(total, mean)).T
        diagonal = abs(np.diag(R))
        if not diagonal.min() > TRUSTED * diagonal.max():
            raise LinAlgError
    except LinAlgError:
        return factorise(records, scaling, past, first=first, last=last)
    full = np.zeros((width + 1, width + 1))
    full[0, 0], full[0, 1:], full[1:, 1:] = np.sqrt(count), np.sqrt(count) * mean, R
    return WindowFactor(full, past, len(scaling.inputs), len(scaling.outputs), count, 0, len(scaling.innovations))


def shorter(factor: WindowFactor, past: int) -> WindowFactor:
    """Return the factor of the last p + 1 samples of the same windows, p at most that of the factor."""
    drop = (factor.past - past) * factor.channels
    keep = [0, *range(1 + drop, len(factor.full))]
    return replace(factor, full=triangularise(factor.full[:, keep]), past=past)


def _products(z: Array, past: int) -> Array:
    """Return Σ v vᵀ over the windows of one complete stretch z (n, m)."""
    n, m = z.shape
    count, width = n - past, (past + 1) * m
    out, top = np.zeros((width, width)), np.zeros((m, width))
    windows = as_strided(z, (count, width), (z.strides[0], z.strides[1]), writeable=False)
    for low in range(0, count, CHUNK):
        top += z[low : min(low + CHUNK, count)].T @ windows[low : low + CHUNK]
    out[:m] = top
    flat = z.ravel()
    for i in range(past):
        span = width - (i + 1) * m
        gone, come = flat[i * m : i * m + span], flat[(count + i) * m : (count + i) * m + span]
        top = top[:, :span] - np.outer(z[i], gone) + np.outer(z[count + i], come)
        out[(i + 1) * m : (i + 2) * m, (i + 1) * m :] = top
    return np.triu(out) + np.triu(out, 1).T


def _sums(z: Array, past: int) -> Array:
    """Return Σ v over the windows of one complete stretch."""
    running = np.vstack([np.zeros(z.shape[1]), np.cumsum(z, axis=0)])
    count = len(z) - past
    out: Array = (running[count : count + past + 1] - running[: past + 1]).ravel()
    return out
