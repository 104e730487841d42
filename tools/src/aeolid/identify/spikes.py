"""Find single wrong cells of outputs, and take them for missing.

A wrong cell stands in its own window as the target and in p others as a regressor: a weight on residuals alone leaves
it in those. Taken for missing it is out of all, and what the other cells say of it stands in its place. A cell z_ki
that is off by ω and affects no other shows in the innovations of q + 1 samples in a pattern that nothing else has:
ω = (Q z)_ki/Q_ii (chain.py), of variance 1/Q_ii, with the cells after it heard too. A gust or a step starts at one
sample and then goes the plant's way: it is a large innovation, of which e_kᵀ W e_k explains more than ω² Q_ii, and
stays. So does everything in inputs: what a recorded input did may be real. Fit and search alternate, each fit without
the cells of the search before, its innovations clipped by Huber's function of their robust deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.identify.chain import Chain, fill, fit_chain, largest_order
from aeolid.identify.windows import Scaling, factorise, find_scaling
from aeolid.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
CHOICES = ("auto", "always", "never")
FAR = {"auto": 8.0, "always": 5.0}  # robust deviations; normal noise passes 8 once in 1e15 cells, 5 once in 2e6
SIZE = 0.02  # of the channel's deviation: smaller ones harm nothing
MOST = 0.02  # of an output's cells; more are no spikes but its noise
PASSES = 6
SUSPECT = 8.0  # medians of the distance from the median of five
LONGEST = 20  # order of the autoregression: what a cell's neighbours say of it is in the nearest ones
ROWS = 8  # windows of the autoregression a regressor of it, at least
MEDIAN = 1.4826  # standard deviation over median magnitude of normal noise


@dataclass(frozen=True, eq=False)
class Cleaned:
    """Hold recordings with wrong cells of outputs marked missing; note: one sentence, empty where there are none."""

    records: Sequence[Record]
    note: str = ""
    cells: int = 0


def check_robust(robust: str) -> None:
    """Refuse a choice that does not exist."""
    if robust not in CHOICES:
        raise UsageError(f"robust {robust!r} is none of {', '.join(CHOICES)}")


def remove_spikes(records: Sequence[Record], past: int, robust: str = "auto") -> Cleaned:
    """Return the recordings with single wrong cells of outputs marked missing.

    past: p ≥ 1 samples; robust: "auto" (default) marks what is 8 robust deviations off, "always" 5, "never" nothing.
    An output of which more than 2 % would be marked keeps all: that is its noise. Raises UsageError on another choice.
    Cost: a fit of an autoregression of order min(p, 20) a pass, less where recordings are short, 6
    passes at most.
    """
    check_robust(robust)
    names = records[0].names("input") + records[0].names("output")
    order = largest_order([len(r) for r in records], len(names), min(past, LONGEST), ROWS)
    if robust == "never" or order < 1:
        return Cleaned(records)
    scaling = find_scaling(records)
    scaled = [scaling.apply(r.columns(scaling.names)) for r in records]
    missing = [~np.isfinite(z) for z in scaled]
    spikes = _search(records, scaling, scaled, missing, order, FAR[robust])
    found = sum(int(s.sum()) for s in spikes)
    if not found:
        return Cleaned(records)
    clean = [_blank(r, scaling, s) for r, s in zip(records, spikes, strict=True)]
    return Cleaned(clean, _say(scaling, spikes), found)


def _search(
    records: Sequence[Record], scaling: Scaling, scaled: list[Array], missing: list[Flags], order: int, far: float
) -> list[Flags]:
    spikes = [_suspects(z, m, len(scaling.inputs)) for z, m in zip(scaled, missing, strict=True)]
    filled = [_lines(z, m | s) for z, m, s in zip(scaled, missing, spikes, strict=True)]
    for _ in range(PASSES):
        chain = fit_chain(factorise(_stored(records, scaling, filled), scaling, order))
        chain = _robust(chain, filled, order)
        new = _wrong(chain, scaled, missing, spikes, order, far, len(scaling.inputs))
        same = all(np.array_equal(a, b) for a, b in zip(new, spikes, strict=True))
        spikes = new
        if same:
            break
        gone = [m | s for m, s in zip(missing, spikes, strict=True)]
        filled = [_mean(chain, z, g) for z, g in zip(scaled, gone, strict=True)]
    return spikes


def _wrong(
    chain: Chain, scaled: list[Array], missing: list[Flags], before: list[Flags], order: int, far: float, inputs: int
) -> list[Flags]:
    """Return the cells that are off; those found before are judged against their neighbours once more."""
    size = np.diag(chain.blocks[0])
    tested = []
    for z, gone, known in zip(scaled, missing, before, strict=True):
        smooth = _mean(chain, z, gone | known)
        omega = chain.pull(smooth) / size + np.where(known, z - smooth, 0.0)
        tested.append((omega, chain.innovations(smooth)[: len(z)], known))
    deviation = np.array(
        [MEDIAN * np.median(abs(np.concatenate([o[:, j] for o, *_ in tested]))) for j in range(len(size))]
    )
    unit = np.std(np.vstack([np.where(g, 0.0, z) for z, g in zip(scaled, missing, strict=True)]), axis=0)
    out = []
    for (omega, e, known), gone in zip(tested, missing, strict=True):
        off = (abs(omega) > far * deviation) & (abs(omega) > SIZE * unit) & ~gone
        pulled = e @ chain.W
        gust = (e * pulled).sum(axis=1, keepdims=True) + known * (2 * pulled + omega * np.diag(chain.W)) * omega
        off &= omega**2 * size > gust
        off[:order] = off[len(off) - order :] = False  # before and after stands no data to tell by
        off[:, :inputs] = False
        out.append(off & _peaks(omega / np.maximum(deviation, 1e-300), known))
    share = np.sum([o.sum(axis=0) for o in out], axis=0) / sum(map(len, scaled))
    return [o & (share <= MOST) for o in out]


def _suspects(z: Array, missing: Flags, inputs: int) -> Flags:
    """Return the cells of outputs far from the median of five: the first fit goes without, the passes judge them."""
    lines = _lines(z, missing)
    wide = np.pad(lines, ((2, 2), (0, 0)), mode="edge")
    apart = abs(lines - np.median([wide[i : i + len(z)] for i in range(5)], axis=0))
    moving = np.where(apart > 0, apart, np.nan)  # the median of five is the cell itself one time in five
    with np.errstate(all="ignore"):
        middle = np.array([np.median(c[np.isfinite(c)]) if np.isfinite(c).any() else np.inf for c in moving.T])
    out: Flags = (apart > SUSPECT * middle) & ~missing
    out[:, :inputs] = False
    return out


def _peaks(score: Array, known: Flags) -> Flags:
    """Return the cells that stand out most among their two neighbours in time and all channels, or are known."""
    size = abs(score)
    around = size.max(axis=1)
    wide = np.pad(around, 2)
    most = np.max([wide[i : i + len(around)] for i in range(5)], axis=0)
    return np.asarray(known | (size >= 0.3 * most[:, None]))


def _robust(chain: Chain, filled: list[Array], order: int) -> Chain:
    """Return the chain with the precision of innovations clipped at 2.5 robust deviations (Huber)."""
    e = np.vstack([chain.innovations(z)[order : len(z)] for z in filled])
    size = np.maximum(MEDIAN * np.median(abs(e), axis=0), 1e-5)
    clipped = np.clip(e, -2.5 * size, 2.5 * size)
    covariance = clipped.T @ clipped / len(e) + 1e-10 * np.eye(e.shape[1])
    W = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    return replace(chain, W=W)


def _mean(chain: Chain, z: Array, gone: Flags) -> Array:
    """Return z with the cells that are gone at what the others say of them."""
    every = gone.all(axis=1, keepdims=True)
    return fill(chain, np.where(gone, 0.0, z), gone & ~every, [np.zeros(int((gone & ~every).sum()))])[0]


def _lines(z: Array, missing: Flags) -> Array:
    time, out = np.arange(len(z)), z.copy()
    for j in range(z.shape[1]):
        good = ~missing[:, j]
        out[:, j] = np.interp(time, time[good], z[good, j]) if good.any() else 0.0
    return out


def _columns(record: Record, scaling: Scaling) -> list[int]:
    return [next(i for i, c in enumerate(record.channels) if c.name == n) for n in scaling.names]


def _stored(records: Sequence[Record], scaling: Scaling, filled: list[Array]) -> list[Record]:
    out = []
    for record, z in zip(records, filled, strict=True):
        values = record.values.copy()
        values[:, _columns(record, scaling)] = z * scaling.scale + scaling.offset
        out.append(replace(record, values=values))
    return out


def _blank(record: Record, scaling: Scaling, spikes: Flags) -> Record:
    values = record.values.copy()
    columns = _columns(record, scaling)
    values[:, columns] = np.where(spikes, np.nan, values[:, columns])
    return replace(record, values=values)


def _say(scaling: Scaling, spikes: list[Flags]) -> str:
    counts = np.sum([s.sum(axis=0) for s in spikes], axis=0)
    each = ", ".join(f"{n} {c}" for n, c in zip(scaling.names, counts, strict=True) if c)
    return (
        f"{int(counts.sum())} single wrong samples (spikes) were taken for missing: {each}; --robust never keeps them"
    )
