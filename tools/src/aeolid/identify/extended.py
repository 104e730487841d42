"""Run extended least squares over recordings: the VARMAX predictor of paper 000 eq. (12)–(14), (24).

The innovations e are regressors and unknown. A pass runs the recursion of section II-E over all samples and feeds the a
posteriori e_k back into the regressor; P is kept as a triangular factor, P = S Sᵀ, updated by n plane rotations as on
the target (the conventional form diverges on the paper's own settings). Two ways turn a given Ξ into innovations: with
the e of the sample before last iteration fixed in the regressor, or with e fed back, which is the predictor (13) itself
and diverges when det H̄ has a zero on or outside the unit circle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit
from aeolid.identify.windows import Scaling
from aeolid.models.prediction import complete_stretches
from aeolid.record import Record

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
HELD = 0.1  # of ρ, that is left of the weight of a direction when it is renewed


@dataclass(frozen=True, eq=False)
class Samples:
    """Hold the scaled samples of an experiment set end to end.

    x (N, r + l): [u, y], missing values zero and never used; starts, stops: the stretches of complete samples that hold
    at least one window; lengths: samples of each recording; inputs r.
    """

    x: Array
    starts: Integers
    stops: Integers
    lengths: tuple[int, ...]
    inputs: int

    @property
    def outputs(self) -> int:
        """Return l."""
        return int(self.x.shape[1]) - self.inputs

    def used(self, past: int) -> NDArray[np.bool_]:
        """Mark the samples (N,) that are the target of a window."""
        marks = np.zeros(len(self.x), dtype=bool)
        for a, b in zip(self.starts, self.stops, strict=True):
            marks[a + past : b] = True
        return marks

    def count_windows(self, lead: int) -> int:
        """Count the samples that have `lead` complete ones before them in their stretch."""
        return int(np.maximum(self.stops - self.starts - lead, 0).sum())

    def split(self, e: Array) -> list[Array]:
        """Part an array along samples into the recordings."""
        return np.split(e, np.cumsum(self.lengths)[:-1])


def collect(records: Sequence[Record], scaling: Scaling, past: int) -> Samples:
    """Scale the inputs and outputs of the recordings and list their complete stretches."""
    parts, starts, stops, offset = [], [], [], 0
    for record in records:
        values = scaling.apply(record.columns(scaling.names))
        for a, b in complete_stretches(values, past + 1):
            starts.append(offset + a)
            stops.append(offset + b)
        offset += len(values)
        parts.append(np.nan_to_num(values, nan=0.0))
    edges = (np.array(starts, dtype=np.int64), np.array(stops, dtype=np.int64))
    return Samples(np.vstack(parts), *edges, tuple(len(r) for r in records), len(scaling.inputs))


def run_pass(
    samples: Samples, past: int, through: Sequence[int], theta: Array, e: Array, forgetting: float, rho: float, *,
    held: bool = False,
) -> None:  # fmt: skip
    """Run one pass of extended least squares; theta (l, n) and e (N, l) are start and result.

    through: indices of inputs whose present value is a regressor; n = p (r + 2 l) + d. The pass minimises
    Σ λ^{N−k} |y_k − Ξ z_k|² + λ^N ρ |Ξ − Ξ₀|², eq. (24) about the solution of the pass before. Before the first e of a
    stretch zeros stand in its place. held: the weight ρ of Ξ₀ does not fade with λ^N (see `_hold`): with forgetting,
    what the data leave open would else have a variance that grows like λ^{−N}, and rounding with it.
    Cost: 5/2 n² + 4 l n operations a sample, with `held` as much again for each n/HELD samples of memory.
    """
    factor = np.eye(theta.shape[1]) / np.sqrt(rho)
    columns = np.array(through, dtype=np.int64)
    start = theta.copy()
    each, weight = held_directions(theta.shape[1], forgetting, rho) if held else (0, 0.0)
    _pass(
        samples.x, samples.starts, samples.stops, past, samples.inputs, columns, theta, e, factor, forgetting, start,
        each, weight,
    )  # fmt: skip


def held_directions(count: int, forgetting: float, rho: float) -> tuple[int, float]:
    """Return how many of n directions are held a sample, and with what weight; 0 without forgetting.

    Each direction comes back after n/each samples with the weight that has faded meanwhile, so that what holds it stays
    between HELD ρ and ρ.

    >>> held_directions(82, 1.0, 0.1)
    (0, 0.0)
    >>> held_directions(82, 0.99, 0.1)[0], held_directions(82, 0.95, 0.1)[0]
    (1, 2)
    """
    if forgetting >= 1:
        return 0, 0.0
    each = min(max(int(np.ceil(count * np.log(forgetting) / np.log(HELD))), 1), count)
    return each, rho * (1.0 - forgetting ** (count / each))


def innovations(
    samples: Samples, past: int, theta: Array, constant: Array, e: Array, *, feed_back: bool, limit: float = 1e3
) -> Array:
    """Return e_k = y_k − c − Ξ z_k (N, l), Ξ (l, p m + r) with every present input, constant c (l,).

    feed_back: put each new e_k into the regressors that follow; else those hold the e given. Outside windows the e
    given stays. A predictor that leaves ±limit (scaled units) diverges: infinite from there on.
    """
    out = e.copy()
    source = out if feed_back else e
    _innovate(samples.x, samples.starts, samples.stops, past, samples.inputs, theta, constant, source, out, limit)
    return out


@njit(fastmath=True, cache=True)
def _dot(a: Array, b: Array) -> float:
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@njit(fastmath=True, cache=True)
def _rotate(row: Array, gain: Array, a: float, c: float, s: float) -> None:
    """Rotate one column of S with the gain: S_j = c (S_j − (s/c) g), g = g + a S_j."""
    for i in range(row.size):
        old = row[i]
        row[i] = c * old - s * gain[i]
        gain[i] += a * old


@njit(cache=True)
def _window(z: Array, x: Array, e: Array, k: int, past: int, inputs: int) -> None:
    """Fill z with the blocks k − p … k − 1 of [u; y; e]."""
    both, outputs = x.shape[1], e.shape[1]
    at = 0
    for t in range(k - past, k):
        for i in range(both):
            z[at + i] = x[t, i]
        at += both
        for i in range(outputs):
            z[at + i] = e[t, i]
        at += outputs


@njit(fastmath=True, cache=True)
def _take(S: Array, z: Array, theta: Array, error: Array, gain: Array, last: int, forgetting: float) -> float:
    """Update S and theta by one regressor z, zero after entry `last`; returns the a posteriori share of the error."""
    outputs, n = theta.shape
    inverse_root = 1.0 / np.sqrt(forgetting)
    alpha = forgetting
    gain[:] = 0.0
    for j in range(last, -1, -1):
        a = _dot(S[j, j:], z[j:])
        grown = alpha + a * a
        c = np.sqrt(alpha / grown) * inverse_root
        _rotate(S[j, j:], gain[j:], a, c, c * a / alpha)
        alpha = grown
    for i in range(outputs):
        share = error[i] / alpha
        for j in range(n):
            theta[i, j] += share * gain[j]
    return forgetting / alpha


@njit(fastmath=True, cache=True)
def _hold(
    S: Array, theta: Array, start: Array, z: Array, error: Array, gain: Array, place: int, weight: float
) -> None:  # fmt: skip
    """Take Ξ e_j = Ξ₀ e_j with a weight, as if it were a sample: what keeps direction j where no data tell it."""
    root = np.sqrt(weight)
    z[:] = 0.0
    z[place] = root
    for i in range(theta.shape[0]):
        error[i] = root * (start[i, place] - theta[i, place])
    _take(S, z, theta, error, gain, place, 1.0)


@njit(fastmath=True, cache=True)
def _pass(
    x: Array, starts: Integers, stops: Integers, past: int, inputs: int, through: Integers, theta: Array, e: Array,
    S: Array, forgetting: float, start: Array, each: int, weight: float,
) -> None:  # fmt: skip
    """Update theta and S sample by sample; row j of S holds column j of the lower triangular factor."""
    outputs, n = theta.shape
    width = n - through.size
    z, gain, error = np.zeros(n), np.zeros(n), np.zeros(outputs)
    place = 0
    for stretch in range(starts.size):
        for k in range(starts[stretch] + past, stops[stretch]):
            _window(z, x, e, k, past, inputs)
            for i in range(through.size):
                z[width + i] = x[k, through[i]]
            for i in range(outputs):
                e[k, i] = error[i] = x[k, inputs + i] - _dot(theta[i], z)
            left = _take(S, z, theta, error, gain, n - 1, forgetting)
            for i in range(outputs):
                e[k, i] *= left
            for _ in range(each):
                _hold(S, theta, start, z, error, gain, place, weight)
                place = (place + 1) % n


@njit(cache=True)
def _innovate(
    x: Array, starts: Integers, stops: Integers, past: int, inputs: int, theta: Array, constant: Array, source: Array,
    out: Array, limit: float,
) -> None:  # fmt: skip
    outputs, n = theta.shape
    z = np.zeros(n)
    for stretch in range(starts.size):
        for k in range(starts[stretch] + past, stops[stretch]):
            _window(z, x, source, k, past, inputs)
            for i in range(inputs):
                z[n - inputs + i] = x[k, i]
            for i in range(outputs):
                value = x[k, inputs + i] - constant[i] - _dot(theta[i], z)
                if not abs(value) <= limit:
                    out[k:] = np.inf
                    return
                out[k, i] = value
