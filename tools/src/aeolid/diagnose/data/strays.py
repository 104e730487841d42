"""Recognise samples that are no measurement: codes for "no value", dropouts, single values far off (S0)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.rules import in_force
from aeolid.models.fill_values import far_off, fill_values_in

Array = NDArray[np.float64]


def codes_of(values: Array) -> NDArray[np.bool_]:
    """Tell which samples hold a usual code for "no value" far outside everything else."""
    return fill_values_in(values, in_force().data.stray_spreads)


def strays_of(values: Array) -> NDArray[np.bool_]:
    """Tell which single samples lie far outside everything else.

    None where these are more than one in a thousand; of a short recording one may be.
    """
    away, coded = far_off(values, in_force().data.stray_spreads), codes_of(values)
    if int(away.sum()) > max(1.0, in_force().data.stray_share * len(values)):
        return np.zeros(len(values), dtype=bool)
    beside = np.concatenate([[False], away, [False]])
    found: NDArray[np.bool_] = away & ~coded & ~beside[:-2] & ~beside[2:]
    return found


def dropouts_of(values: Array) -> NDArray[np.bool_]:
    """Tell which samples are what a logger writes where none arrived: one value, often, far from its neighbours.

    None where that value is not by far the most frequent, or where the signal mostly passes through it.
    """
    rules = in_force().data
    none = np.zeros(len(values), dtype=bool)
    found, often = np.unique(values[np.isfinite(values)], return_counts=True)
    if len(found) < 2 or often.max() < rules.dropped_fewest:
        return none
    next_most = np.sort(often)[-2]
    at = _in_short_runs(values == found[np.argmax(often)], rules.dropped_longest)
    if int(at.sum()) < rules.dropped_times * next_most or float(at.mean()) > rules.missing_share:
        return none
    rest = np.flatnonzero(np.isfinite(values) & ~at)
    if len(rest) < 3:
        return none
    usual = float(np.median(np.abs(values[rest][1:-1] - 0.5 * (values[rest][:-2] + values[rest][2:]))))
    leaps = np.abs(values[at] - np.interp(np.flatnonzero(at), rest, values[rest])) > rules.dropped_leap * usual
    return at if 2 * int(leaps.sum()) > len(leaps) and int(leaps.sum()) >= rules.dropped_fewest else none


def _in_short_runs(at: NDArray[np.bool_], longest: int) -> NDArray[np.bool_]:
    """Return the samples of `at` that stand in runs of at most so many: what lasts is a stuck sensor or a rest."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(int)))
    found = at.copy()
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if stop - start > longest:
            found[start:stop] = False
    return found


def without_codes(values: Array) -> Array:
    """Return the samples, codes for "no value" missing."""
    found: Array = np.where(codes_of(values), np.nan, values)
    return found
