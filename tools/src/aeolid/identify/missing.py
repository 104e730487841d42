"""Fill single missing cells by what all other cells say, as often as shows how little they say.

Expectation maximisation with draws: the autoregression of inputs and outputs (chain.py) is fitted to filled
recordings, its smoother fills the cells anew, until it settles. Cells are drawn from their distribution and not put at
its mean, which would tell the fit that they follow the model exactly; the windows of all draws are averaged. By how
much Ξ scatters from draw to draw, over the scatter that complete recordings would leave, is the part γ of the
information that is missing (Louis 1982); the averaged windows count (1 − γ) times, so that deviations, the order and
every criterion know. A channel missing for longer than the past window stays missing: nothing but the model would
speak there, and windows that touch it are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.errors import NotIdentifiable
from aeolid.identify.chain import Chain, fill, fit_chain, largest_order
from aeolid.identify.windows import Scaling, WindowFactor, factorise, find_scaling
from aeolid.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
WORTH = 0.05  # of the windows: where fewer hold a missing cell, filling gains less than its own error
PASSES = 20
SETTLED = 1e-3  # of the innovations' power: what the last pass changed
SAMPLES = 40_000  # draws times samples: their own scatter is then small beside what is missing
MOST_DRAWS, FEWEST_DRAWS = 10, 3
LEAST_KNOWN = 0.5  # part of the cells of every channel outside long gaps that must be there
ROWS = 4  # windows of the autoregression a regressor of it, at least


@dataclass(frozen=True, eq=False)
class Completed:
    """Hold recordings with their single missing cells drawn: `records` once, `others` again.

    information: 1 − γ, within 0 … 1; note: one sentence; cells: how many were drawn.
    """

    records: Sequence[Record]
    others: tuple[Sequence[Record], ...] = ()
    information: float = 1.0
    note: str = ""
    cells: int = 0

    def average(self, factors: Sequence[WindowFactor]) -> WindowFactor:
        """Return the factor of one draw's windows, averaged over all, counted as the information they hold."""
        if len(factors) == 1 and self.information == 1.0:
            return factors[0]
        total, count = reduce(WindowFactor.merge, factors), len(factors)
        weight = self.information / count
        windows = round(total.windows * weight)
        return replace(total, full=total.full * np.sqrt(weight), windows=windows, skipped=factors[0].skipped)


def complete(records: Sequence[Record], past: int) -> Completed:
    """Return the recordings with single missing cells drawn where they cost more than 5 % of the windows.

    past: p ≥ 1 samples. Raises NotIdentifiable where a channel lacks more than half its cells outside gaps longer than
    p. Cost: 3 … 10 fits of all windows a pass, 20 passes at most; nothing where no cell is missing.
    """
    names = records[0].names("input") + records[0].names("output")
    bad = [~np.isfinite(r.columns(names)) for r in records]
    if not any(b.any() for b in bad):
        return Completed(records)
    gaps = [_long(b, past) for b in bad]
    if _spoilt(bad, gaps, past) <= WORTH:
        return Completed(records)
    _require_known(records, names, bad, gaps)
    scaling = find_scaling(records)
    return _settle(records, scaling, bad, gaps, past)


def _settle(records: Sequence[Record], scaling: Scaling, bad: list[Flags], gaps: list[Flags], past: int) -> Completed:
    total = sum(map(len, records))
    draws = int(np.clip(-(-SAMPLES // total), FEWEST_DRAWS, MOST_DRAWS))
    order = max(1, largest_order([len(r) for r in records], scaling.channels, past, ROWS))
    sets: list[list[Record]] = [[_interpolated(r, scaling, g) for r, g in zip(records, gaps, strict=True)]]
    before: Chain | None = None
    for _ in range(PASSES):
        factor = _averaged([factorise(s, scaling, order) for s in sets])
        chain = fit_chain(factor)
        sets = _draw(records, scaling, bad, gaps, chain, draws)
        if before is not None and _change(before, chain, factor) < SETTLED:
            break
        before = chain
    information = _information([factorise(s, scaling, past) for s in sets])
    cells = sum(int((b & ~g).sum()) for b, g in zip(bad, gaps, strict=True))
    share = cells / sum(b.size for b in bad)
    note = (
        f"{cells} missing cells ({share:.1%}) were drawn from what the others say, {draws} times: "
        f"{information:.0%} of the information of a complete recording is left"
    )
    return Completed(sets[0], tuple(sets[1:]), information, note, cells)


def _draw(
    records: Sequence[Record], scaling: Scaling, bad: list[Flags], gaps: list[Flags], chain: Chain, draws: int
) -> list[list[Record]]:
    """Return all recordings `draws` times; the random numbers are the same in every pass, so that passes settle."""
    random = np.random.default_rng(0)
    sets: list[list[Record]] = [[] for _ in range(draws)]
    for record, missing, gap in zip(records, bad, gaps, strict=True):
        sought = missing & ~(gap & missing.all(axis=1, keepdims=True))  # where all is missing, z stays at its mean
        z = scaling.apply(record.columns(scaling.names))
        noise = [random.standard_normal(int(sought.sum())) for _ in range(draws)]
        known = np.where(missing, 0.0, z)
        for part, drawn in zip(sets, fill(chain, known, sought, noise), strict=True):
            part.append(_with(record, scaling, np.where(gap, np.nan, drawn)))
    return sets


def _with(record: Record, scaling: Scaling, z: Array) -> Record:
    values = record.values.copy()
    columns = [next(i for i, c in enumerate(record.channels) if c.name == n) for n in scaling.names]
    values[:, columns] = z * scaling.scale + scaling.offset
    return replace(record, values=values)


def _interpolated(record: Record, scaling: Scaling, gap: Flags) -> Record:
    """Return the recording with straight lines over its single missing cells: where the passes start."""
    z = scaling.apply(record.columns(scaling.names))
    time = np.arange(len(z))
    for j in range(z.shape[1]):
        good = np.isfinite(z[:, j])
        z[:, j] = np.interp(time, time[good], z[good, j]) if good.any() else 0.0
    return _with(record, scaling, np.where(gap, np.nan, z))


def _averaged(factors: list[WindowFactor]) -> WindowFactor:
    return Completed((), information=1.0).average(factors)


def _change(before: Chain, after: Chain, factor: WindowFactor) -> float:
    """Return the power that the two predictions differ by, over that of the innovations, the largest of a channel."""
    q, m = factor.past, after.a.shape[1]
    step = (after.a - before.a)[1:][::-1].transpose(1, 0, 2).reshape(m, q * m)
    moved = ((factor.R[:, : q * m] @ step.T) ** 2).sum(axis=0) / max(factor.windows, 1)
    return float((moved * np.diag(after.W)).max())


def _information(factors: list[WindowFactor]) -> float:
    """Return 1 − γ from the scatter of Ξ over the draws."""
    first = factors[0]
    width, last = first.past * first.channels + first.inputs, first.outputs
    mean = _averaged(factors)
    if mean.windows <= width:
        return 1.0  # the windows are refused for their number
    ways = [lstsq(f.R[:, :width], f.y_now, rcond=1e-10) for f in factors]
    middle = np.mean(ways, axis=0)
    error = mean.y_now - mean.R[:, :width] @ middle
    covariance = error.T @ error / max(mean.windows - width, 1) + 1e-14 * np.eye(last)
    moved = [mean.R[:, :width] @ (way - middle) for way in ways]
    scatter = sum(float(np.trace(np.linalg.solve(covariance, d.T @ d))) for d in moved) / (len(ways) - 1)
    return float(np.clip(1.0 - scatter / (width * last), 0.02, 1.0))


def _long(bad: Flags, past: int) -> Flags:
    """Return the cells (N, m) of a channel's runs of missing samples longer than p."""
    out = np.zeros_like(bad)
    for j in range(bad.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], bad[:, j], [False]]).astype(np.int8)))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            out[start:stop, j] = stop - start > past
    return out


def _spoilt(bad: list[Flags], gaps: list[Flags], past: int) -> float:
    """Return the part of the windows outside long gaps that a single missing cell spoils."""
    lost = there = 0
    for missing, gap in zip(bad, gaps, strict=True):
        clean = _whole(np.asarray(gap.any(axis=1)), past)
        there += int(clean.sum())
        lost += int((clean & ~_whole(np.asarray(missing.any(axis=1)), past)).sum())
    return lost / max(there, 1)


def _whole(bad: Flags, past: int) -> Flags:
    """Return for each window of p + 1 samples whether none of them is bad."""
    count = np.concatenate([[0], np.cumsum(bad)])
    return np.asarray(count[past + 1 :] == count[: -past - 1])


def _require_known(records: Sequence[Record], names: Sequence[str], bad: list[Flags], gaps: list[Flags]) -> None:
    for j, name in enumerate(names):
        outside = sum(int((~g[:, j]).sum()) for g in gaps)
        missing = sum(int((b[:, j] & ~g[:, j]).sum()) for b, g in zip(bad, gaps, strict=True))
        if missing > (1 - LEAST_KNOWN) * outside:
            raise NotIdentifiable(
                f"{records[0].source}: channel {name!r} lacks {missing} of {outside} samples outside long gaps, more "
                f"than {1 - LEAST_KNOWN:.0%}; give it the role 'ignore' or record it at the rate of the others"
            )
