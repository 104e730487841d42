"""Ask of whitened innovations in which stretch of time, region of a channel or order of the rotor more is left (S3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.special import ndtri

from aeolid.diagnose.rules import in_force

Array = NDArray[np.float64]
_BLOCKS, _PARTS = 8, 4  # blocks of one stretch of time: its spread is that of their sums; pieces of each at the most
_STRETCHES = 24  # stretches at the most
_DRAWS = 999
_SHIFTS = 4000  # shifts looked at, at the most
_BINS = 6
ORDERS = range(1, 7)
_NEAR, _FAR, _NEIGHBOURS = 0.25, 0.45, 5  # where the neighbours of an order lie, and how many on each side at most
_LEAST_TURNS = 20  # of the rotor in all: fewer do not part an order from what is a quarter beside it
_PIECES = 24  # of the recording whose phases are compared


@dataclass(frozen=True)
class Cell:
    """Hold one cell of a map: which one, of which output, what it shows, how far beyond chance.

    place: of the stretch, bin or order; value: mean in standard deviations, or power against the rest's, or amplitude;
    z over limit is beyond what chance gives anywhere in the map; of a line it is −log10 of its p value.
    """

    output: int
    place: int
    kind: str
    value: float
    z: float
    limit: float
    phase_deg: float | None = None

    @property
    def significant(self) -> bool:
        """Tell whether the cell is beyond what chance gives."""
        return self.z > self.limit

    @property
    def excess(self) -> float:
        """Return z in units of its limit."""
        return self.z / self.limit if self.limit > 0 else 0.0


def stretches_of(lengths: Sequence[int]) -> list[tuple[int, int]]:
    """Cut segments of these lengths into stretches of about the same length: first row and the one behind the last.

    None of a stretch crosses from one segment to the next; some 24 in all, one at least for each segment of 48 samples.
    """
    rules = in_force().localise
    total = sum(lengths)
    aim = min(_STRETCHES, total // rules.stretch_samples)
    found, start = [], 0
    for length in lengths:
        count = max(1, round(aim * length / max(total, 1)))
        if length >= rules.stretch_samples:
            parts = min(count, length // rules.stretch_samples)
            edges = np.linspace(start, start + length, parts + 1).astype(int).tolist()
            found += list(pairwise(edges))
        start += length
    return found if len(found) > 1 else []


def time_cells(white: Array, stretches: Sequence[tuple[int, int]], seed: int) -> list[Cell]:
    """Test mean and power of whitened innovations (N, l) in each stretch of time against the rest of the recording.

    Mean: its difference to the whole over its own spread, that of 8 blocks' sums, which a burst widens; never less
    than the median of all stretches' nor than white noise's. The limit is Šidák's for as many normal variables. Power:
    differences to the whole against those that short pieces give in random order, each taken about its own stretch, so
    that a step does not raise its own limit; the largest of all decides (Westfall & Young 1993). Their spread grows
    with the memory that the power has in the median stretch, not by a burst in one. Half the level each.
    """
    if not stretches:
        return []
    pieces = _BLOCKS * min(_PARTS, min(b - a for a, b in stretches) // (2 * _BLOCKS))
    parts = [p for a, b in stretches for p in np.array_split(np.arange(a, b), pieces)]
    count = np.array([len(p) for p in parts], dtype=float).reshape(len(stretches), pieces)
    rows, starts = np.concatenate(parts), np.cumsum([0, *(len(p) for p in parts)])[:-1]
    sums, powers = (
        np.add.reduceat(v[rows], starts, axis=0).reshape(*count.shape, -1) for v in (white, white**2)
    )  # (stretches, pieces, l)
    shift, z_mean = _shifts(sums, count)
    ratio, z_power, limit = _powers(powers, count, seed)
    sidak = -float(ndtri(0.5 * (1 - (1 - in_force().localise.false_alarm_level / 2) ** (1 / z_mean.size))))
    return [
        cell
        for c in range(len(stretches))
        for j in range(white.shape[1])
        for cell in (
            Cell(j, c, "mean", float(shift[c, j]), float(abs(z_mean[c, j])), sidak),
            Cell(j, c, "power", float(ratio[c, j]), float(abs(z_power[c, j])), limit),
        )
    ]


def _about(sums: Array, count: Array) -> tuple[Array, Array]:
    """Return each stretch's mean (stretches, l), and what each piece's sum differs from it."""
    mean = sums.sum(axis=1) / count.sum(axis=1)[:, None]
    return mean, sums - count[:, :, None] * mean[:, None]


def _in_blocks(about: Array) -> Array:
    """Return the variance of the sums of 8 blocks of pieces (stretches, l), each about its stretch."""
    blocks = about.reshape(len(about), _BLOCKS, -1, about.shape[2]).sum(axis=2)
    variance: Array = np.sum(blocks**2, axis=1) * _BLOCKS / (_BLOCKS - 1)
    return variance


def _shifts(sums: Array, count: Array) -> tuple[Array, Array]:
    """Return each stretch's mean less the whole one, and its z."""
    size = count.sum(axis=1)[:, None]
    mean, about = _about(sums, count)
    own = _in_blocks(about) / size
    variance = np.maximum(np.maximum(own, np.median(own, axis=0)), 1.0)
    shift = mean - sums.sum(axis=(0, 1)) / size.sum()
    return shift, shift / np.sqrt(variance * (1 / size - 1 / size.sum()))


def _powers(sums: Array, count: Array, seed: int) -> tuple[Array, Array, float]:
    """Return each stretch's power over the whole one, its z, and the limit of the largest |z|."""
    stretches, pieces, outputs = sums.shape
    size = count.sum(axis=1)[:, None]
    whole = np.maximum(sums.sum(axis=(0, 1)) / size.sum(), 1e-300)
    mean, about = _about(sums, count)
    excess = size * (mean - whole)
    about *= np.sqrt(pieces / (pieces - 1))
    alone = np.maximum(np.sum(about**2, axis=1), 1e-300)  # what the blocks' variance is without memory
    memory = np.sqrt(np.maximum(np.median(_in_blocks(about) / alone, axis=0), 1.0))
    even = about / np.sqrt(count)[:, :, None]  # pieces of a short segment are shorter
    order = np.random.default_rng(seed).permuted(np.tile(np.arange(stretches * pieces), (_DRAWS, 1)), axis=1)
    z, largest = np.empty_like(excess), np.zeros(_DRAWS)
    for j in range(outputs):
        drawn = even[:, :, j].ravel()[order].reshape(_DRAWS, stretches, pieces).sum(axis=2) / np.sqrt(pieces)
        spread = max(float(drawn.std()), 1e-300)
        largest = np.maximum(largest, np.max(np.abs(drawn), axis=1) / spread)
        z[:, j] = excess[:, j] / (np.sqrt(size[:, 0]) * spread * memory[j])
    return mean / whole, z, float(np.quantile(largest, 1 - in_force().localise.false_alarm_level / 2))


def bins_of(values: Array) -> tuple[Array, NDArray[np.int64]] | None:
    """Return edges and bin of each sample: six with as many samples each, fewer where values repeat; None below 3."""
    rules = in_force().localise
    edges = np.unique(np.quantile(values, np.linspace(0, 1, _BINS + 1), method="inverted_cdf"))
    if len(edges) <= rules.fewest_bins:
        return None
    label = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    if np.min(np.bincount(label, minlength=len(edges) - 1)) < rules.bin_samples:
        return None
    return edges, label.astype(np.int64)


def region_cells(white: Array, labels: Sequence[NDArray[np.int64]]) -> list[list[Cell]]:
    """Test mean and power of whitened innovations (N, l) in every bin of each channel against the other samples.

    labels: the bin of each sample, an array (N,) for each channel. The null are the same innovations moved in time
    against the channels, round the end, by all lengths (4000 at most): they keep their colour, bursts and tails, the
    channels theirs, and only what belongs together is taken apart. So a channel that was in each bin once only says
    nothing that the time would not. The largest z of all decides. Cost O(bins · l · N log N).
    """
    if not labels:
        return []
    shifts = np.arange(0, len(white), max(1, -(-len(white) // _SHIFTS)))
    maps, largest = [], np.zeros(len(shifts))
    for label in labels:
        found = []
        for (j, place, kind), value, moved in _moved(white, label):
            z = np.abs(moved) / max(float(np.std(moved)), 1e-300)
            largest = np.maximum(largest, z[shifts])
            found.append((j, place, kind, value, float(z[0])))
        maps.append(found)
    limit = float(np.quantile(largest, 1 - in_force().localise.false_alarm_level))
    return [[Cell(*facts, limit) for facts in found] for found in maps]


def _moved(white: Array, label: NDArray[np.int64]) -> Iterator[tuple[tuple[int, int, str], float, Array]]:
    """Yield which cell, its value, and its statistic at every shift of the innovations (N,), the first unmoved."""
    length = len(white)
    centred = white - white.mean(axis=0)
    squares = centred**2
    inside = [rfft((label == k).astype(float)) for k in range(int(label.max()) + 1)]
    for j in range(white.shape[1]):
        first, second = rfft(centred[:, j]), rfft(squares[:, j])
        whole = max(float(squares[:, j].mean()), 1e-300)
        for k, mark in enumerate(inside):
            count = float(mark[0].real)
            sums, power = (irfft(np.conj(mark) * f, n=length) for f in (first, second))
            mean = sums / np.sqrt(np.maximum(power, 1e-3 * count * whole))  # by the bin's own power there
            yield (j, k, "mean"), float(sums[0] / count / np.sqrt(whole)), mean
            yield (j, k, "power"), float(power[0] / count / whole), power - count * whole


def azimuth_cells(white: Sequence[Array], angle: Sequence[Array]) -> list[Cell]:
    """Test the amplitude of innovations at 1 … 6 times the rotor's angle: segments (N, l), angles (N,) in rad.

    A line stands out of its neighbours and keeps its phase; both are asked, the larger p value counts. Power at the
    order against the mean of m orders 0.25 to 0.45 beside it: F(2, 2 m) in noise of any colour that is level there.
    Its amplitudes in up to 24 pieces of the recording against their scatter: F(2, 2 S − 2), Victor and Mast (1991),
    which a resonance at that frequency does not pass. Value: amplitude in standard deviations. Šidák over all cells.
    """
    rules = in_force().localise
    hypotheses = in_force().hypotheses
    turns = [np.unwrap(a) for a in angle]
    total = sum(abs(float(t[-1] - t[0])) for t in turns if len(t)) / (2 * np.pi)
    rate = max((float(np.median(np.abs(np.diff(t)))) for t in turns if len(t) > 1), default=0.0)
    orders = [k for k in ORDERS if k * rate < hypotheses.nyquist_share * np.pi]
    pieces = [p for w, t in zip(white, turns, strict=True) for p in _pieces(w, t, total)]
    if total < _LEAST_TURNS or not orders or len(pieces) < rules.fewest_pieces:
        return []
    rows = sum(len(w) for w in white)
    limit = float(-np.log10(1 - (1 - rules.false_alarm_level) ** (1 / (len(orders) * white[0].shape[1]))))
    beside = np.linspace(_NEAR, _FAR, _NEIGHBOURS)
    found = []
    for k in orders:
        around = [_locked(white, turns, k + s * d) for d in beside for s in (-1, 1)]
        level_there = np.mean([np.abs(a) ** 2 for a in around], axis=0)
        own = _locked(white, turns, k)
        stands = _tail(np.abs(own) ** 2 / np.maximum(level_there, 1e-300), len(around))
        keeps = _phase_kept(np.array([_locked([w], [t], k) for w, t in pieces]))
        p = np.maximum(stands, keeps)
        for j, a in enumerate(own):
            z = float(-np.log10(max(p[j], 1e-300)))
            found.append(Cell(j, k, "line", float(2 * abs(a) / rows), z, limit, float(np.degrees(np.angle(a)))))
    return found


def _locked(white: Sequence[Array], turns: Sequence[Array], order: float) -> NDArray[np.complex128]:
    """Return Σ r exp(i k ψ) of each output (l,): the phase is that of cos(k ψ − phase)."""
    total = np.sum([np.exp(1j * order * t) @ w for w, t in zip(white, turns, strict=True)], axis=0)
    return np.asarray(total, dtype=np.complex128)


def _pieces(white: Array, turns: Array, total: float) -> list[tuple[Array, Array]]:
    """Cut a segment into pieces of whole turns as far as samples allow, two turns at least, 24 in all segments."""
    if len(turns) < 2:
        return []
    gone = np.abs(turns - turns[0]) / (2 * np.pi)
    each = max(2, int(np.ceil(total / _PIECES)))
    edges = np.searchsorted(np.maximum.accumulate(gone), np.arange(0, gone[-1], each))
    return [(white[a:b], turns[a:b]) for a, b in pairwise(edges.tolist()) if b - a > 2]


def _phase_kept(amplitudes: NDArray[np.complex128]) -> Array:
    """Return the chance (l,) of the mean of complex amplitudes (S, l) where phases are random."""
    count = len(amplitudes)
    mean = amplitudes.mean(axis=0)
    scatter = np.sum(np.abs(amplitudes - mean) ** 2, axis=0)
    return _tail(count * (count - 1) * np.abs(mean) ** 2 / np.maximum(scatter, 1e-300), count - 1)


def _tail(ratio: Array, pairs: int) -> Array:
    """Return the chance that F(2, 2 m) exceeds a ratio: (1 + F/m)^(−m)."""
    result: Array = (1 + ratio / pairs) ** (-float(pairs))
    return result
