"""Fill single missing cells by what all other cells say, as often as shows how little they say.

Expectation maximisation with draws: the autoregression of inputs and outputs (chain.py) is fitted to filled
recordings, its smoother fills the cells anew, until it settles; where cells are missing by a regular pattern, one whose
outputs have few states (parsimonious_chain.py), which windows too short for the noise bias a little. Cells are
drawn from their distribution and not put at its mean, which would tell the fit that they follow the model exactly; the
windows of all draws are averaged. By how much Ξ scatters from draw to draw, over the scatter that complete recordings
would leave, is the part γ of the information that is missing (Louis 1982); the averaged windows count (1 − γ) times,
so that deviations, the order and every criterion know. A channel missing for longer than the past window stays
missing: nothing but the model would speak there, and windows that touch it are left out.

What is chosen on held-out samples (window, feedthrough, order) must not be judged on drawn cells: they follow the
autoregression, the part held out included, and models that imitate it would win. For these choices recordings are
completed a second time (`Trial`): the fit part by an autoregression of its own, the rest by that one's predictions from
the samples before, never from those after; only outputs that were measured are errors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.errors import NotIdentifiable
from aeolid.identify.chain import FLOOR, Chain, fill, fit_chain, largest_order, predict_cells
from aeolid.identify.order import worth_a_state
from aeolid.identify.parsimonious_chain import fit_few_states
from aeolid.identify.short_factors import product_factor
from aeolid.identify.split import border
from aeolid.identify.windows import Scaling, WindowFactor, factorise, find_scaling
from aeolid.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
WORTH = 0.05  # of the windows: where fewer hold a missing cell, filling gains less than its own error
PASSES, FEW_PASSES = 20, 8  # where a model is taken, and where its states are chosen
REGULAR = 0.05  # of the power of the missing cells' pattern that is one line of its spectrum
STATES = (1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 26, 32, 40)  # of the models that are tried
RISEN = 3  # numbers of states tried beyond the best
SETTLED = 1e-3  # of the innovations' power: what the last pass changed
SAMPLES = 40_000  # draws times samples: their own scatter is then small beside what is missing
MOST_DRAWS, FEWEST_DRAWS = 10, 3
LEAST_KNOWN = 0.5  # part of the cells of every channel outside long gaps that must be there
ROWS = 4  # windows of the autoregression a regressor of it, at least


@dataclass(frozen=True, eq=False)
class Trial:
    """Hold recordings completed so that what is held out of them judges models of the rest.

    sets: once a draw of the fit part's cells; what is held out is completed in the same way in each. measured: the
    recordings as they were, in which an output that is not a number was not measured and is no error. states: of the
    model that cells were drawn from, where that has few: a model of more describes how its draws err.
    """

    sets: tuple[Sequence[Record], ...]
    measured: Sequence[Record]
    states: int | None

    def each(self, change: Callable[[Sequence[Record]], Sequence[Record]]) -> Trial:
        """Return the trial with every set of recordings changed alike."""
        return Trial(tuple(change(s) for s in self.sets), change(self.measured), self.states)


@dataclass(frozen=True, eq=False)
class Completed:
    """Hold recordings with their single missing cells drawn: `records` once, `others` again.

    information: 1 − γ, within 0 … 1; note: one sentence; cells: how many were drawn; trial: for choices on held-out
    samples, None where no cell was drawn.
    """

    records: Sequence[Record]
    others: tuple[Sequence[Record], ...] = ()
    information: float = 1.0
    note: str = ""
    cells: int = 0
    trial: Trial | None = None

    def each(self, change: Callable[[Sequence[Record]], Sequence[Record]]) -> Completed:
        """Return the same with every set of recordings changed alike."""
        trial = None if self.trial is None else self.trial.each(change)
        return replace(self, records=change(self.records), others=tuple(map(change, self.others)), trial=trial)

    def average(self, factors: Sequence[WindowFactor]) -> WindowFactor:
        """Return the factor of one draw's windows, averaged over all, counted as the information they hold."""
        if len(factors) == 1 and self.information == 1.0:
            return factors[0]
        total, count = reduce(WindowFactor.merge, factors), len(factors)
        weight = self.information / count
        windows = round(total.windows * weight)
        return replace(total, full=total.full * np.sqrt(weight), windows=windows, skipped=factors[0].skipped)


@dataclass(frozen=True, eq=False)
class Cells:
    """Hold recordings with, for each, which cells (N, m) are missing and which of those lie in long gaps."""

    records: Sequence[Record]
    scaling: Scaling
    bad: list[Flags]
    gaps: list[Flags]

    def before(self, at: Sequence[int]) -> Cells:
        """Return the samples before `at` of each recording."""
        records = [r.slice(0, k) for r, k in zip(self.records, at, strict=True)]
        bad, gaps = ([f[:k] for f, k in zip(each, at, strict=True)] for each in (self.bad, self.gaps))
        return Cells(records, self.scaling, bad, gaps)

    def scaled(self, records: Sequence[Record]) -> list[Array]:
        """Return the cells of recordings in scaled units, each (N, m)."""
        return [self.scaling.apply(r.columns(self.scaling.names)) for r in records]

    @property
    def regular(self) -> bool:
        """Tell whether cells of a channel are missing by a pattern that repeats: a line in its spectrum."""
        for missing, gap in zip(self.bad, self.gaps, strict=True):
            flags = (missing & ~gap).astype(np.float64)
            about = flags - flags.mean(axis=0)
            lines = (abs(np.fft.rfft(about, axis=0)) ** 2).max(axis=0, initial=0.0)
            if (lines > REGULAR * len(flags) * (about**2).sum(axis=0)).any():
                return True
        return False

    def largest_order(self, past: int) -> int:
        """Return the largest order, up to p, of an autoregression that recordings of these lengths tell."""
        return max(1, largest_order([len(r) for r in self.records], self.scaling.channels, past, ROWS))


def complete(records: Sequence[Record], past: int) -> Completed:
    """Return the recordings with single missing cells drawn where they cost more than 5 % of the windows.

    past: p ≥ 1 samples. Raises NotIdentifiable where a channel lacks more than half its cells outside gaps longer than
    p. Cost: 3 … 10 fits of all windows a pass, some 40 passes at most, twice; nothing where no cell is missing.
    """
    names = records[0].names("input") + records[0].names("output")
    bad = [~np.isfinite(r.columns(names)) for r in records]
    if not any(b.any() for b in bad):
        return Completed(records)
    gaps = [_long(b, past) for b in bad]
    if _spoilt(bad, gaps, past) <= WORTH:
        return Completed(records)
    _require_known(records, names, bad, gaps)
    return _settle(Cells(records, find_scaling(records), bad, gaps), past)


def _settle(cells: Cells, past: int) -> Completed:
    draws = int(np.clip(-(-SAMPLES // sum(map(len, cells.records))), FEWEST_DRAWS, MOST_DRAWS))
    at = [border(z, past) for z in cells.scaled(_interpolated(cells))]
    states, chain = _first(cells, at, past, draws)
    sets, _ = _passes(cells, [_interpolated(cells)], states, past, PASSES, draws)
    information = _information([factorise(s, cells.scaling, past) for s in sets])
    count = sum(int((b & ~g).sum()) for b, g in zip(cells.bad, cells.gaps, strict=True))
    note = (
        f"{count} missing cells ({count / sum(b.size for b in cells.bad):.1%}) were drawn from what the others say, "
        f"{draws} times: {information:.0%} of the information of a complete recording is left"
    )
    trial = None if chain is None else Trial(_trial(cells, chain, draws, at), cells.records, states)
    return Completed(sets[0], tuple(sets[1:]), information, note, count, trial)


def _first(cells: Cells, at: Sequence[int], past: int, draws: int) -> tuple[int | None, Chain | None]:
    """Return the states of the model of what lies before `at`, the fewest that tell the rest as the best do, and it.

    Only measured cells are told. No states are those of an autoregression of p lags, where cells are missing without a
    pattern; no model, where nothing lies on either side.
    """
    heads, losses, chains = cells.before(at), [], []
    held_out = sum(int((~b[k:]).sum()) for b, k in zip(cells.bad, at, strict=True)) // cells.scaling.channels
    if not held_out or not sum(at):
        return None, None
    sets = [_interpolated(heads)]
    if not cells.regular:
        return None, _passes(heads, sets, None, past, PASSES, draws)[1]
    for states in STATES:
        sets, chain = _passes(heads, sets, states, past, FEW_PASSES, FEWEST_DRAWS)
        chains.append(chain)
        losses.append(_loss(cells, at, sets[0], chain))
        if len(losses) - 1 - int(np.argmin(losses)) >= RISEN:
            break
    i = next(i for i, loss in enumerate(losses) if loss <= min(losses) + worth_a_state(held_out))
    return STATES[i], chains[i]


def _loss(cells: Cells, at: Sequence[int], heads: Sequence[Record], chain: Chain) -> float:
    """Return the mean log error power of the measured cells behind `at`, over the channels, each told by those before.

    heads: what lies before, with cells drawn.
    """
    power, count = np.zeros((2, cells.scaling.channels))
    for z, missing, k in zip(_continued(cells, at, heads, chain), cells.bad, at, strict=True):
        e = np.where(missing[k:], 0.0, chain.innovations(z)[k : len(z)])
        power, count = power + (e**2).sum(axis=0), count + (~missing[k:]).sum(axis=0)
    with np.errstate(all="ignore"):
        return float(np.mean(np.log(np.maximum(power / np.maximum(count, 1), FLOOR))))


def _continued(cells: Cells, at: Sequence[int], heads: Sequence[Record], chain: Chain) -> list[Array]:
    """Return the scaled cells of whole recordings, those missing behind `at` as predicted from the samples before."""
    out = []
    for z, head, missing, k in zip(cells.scaled(cells.records), cells.scaled(heads), cells.bad, at, strict=True):
        z[:k] = head
        out.append(predict_cells(chain, np.nan_to_num(z, nan=0.0), missing, k, len(cells.scaling.inputs)))
    return out


def _passes(
    cells: Cells, sets: list[list[Record]], states: int | None, past: int, most: int, draws: int
) -> tuple[list[list[Record]], Chain]:  # fmt: skip
    """Fit the model of so many states and draw `draws` times anew, until that changes little, `most` times at most."""
    before: Chain | None = None
    window = cells.largest_order(past)
    for _ in range(most):
        factor = _averaged([(factorise if states is None else product_factor)(s, cells.scaling, window) for s in sets])
        samples = [np.nan_to_num(z, nan=0.0) for z in cells.scaled(sets[0])]
        chain = fit_chain(factor) if states is None else fit_few_states(factor, states, samples)
        sets = _draw(cells, chain, draws)
        if before is not None and _change(before, chain, factor) < SETTLED:
            break
        before = chain
    return sets, chain


def _trial(cells: Cells, chain: Chain, draws: int, at: Sequence[int]) -> tuple[list[Record], ...]:
    """Return the recordings completed for choices, `draws` times.

    at: the first sample held out of each; chain: of those before.
    """
    drawn = _draw(cells.before(at), chain, draws)
    whole, sets = _continued(cells, at, drawn[0], chain), []
    for heads in drawn:
        parts = zip(cells.scaled(heads), whole, cells.gaps, cells.records, strict=True)
        filled = ((r, np.vstack([head, np.where(gap, np.nan, z)[len(head) :]])) for head, z, gap, r in parts)
        sets.append([_with(r, cells.scaling, z) for r, z in filled])
    return tuple(sets)


def _draw(cells: Cells, chain: Chain, draws: int) -> list[list[Record]]:
    """Return all recordings `draws` times; the random numbers are the same in every pass, so that passes settle."""
    random = np.random.default_rng(0)
    sets: list[list[Record]] = [[] for _ in range(draws)]
    for record, z, missing, gap in zip(cells.records, cells.scaled(cells.records), cells.bad, cells.gaps, strict=True):
        sought = missing & ~(gap & missing.all(axis=1, keepdims=True))  # where all is missing, z stays at its mean
        noise = [random.standard_normal(int(sought.sum())) for _ in range(draws)]
        for part, drawn in zip(sets, fill(chain, np.where(missing, 0.0, z), sought, noise), strict=True):
            part.append(_with(record, cells.scaling, np.where(gap, np.nan, drawn)))
    return sets


def _with(record: Record, scaling: Scaling, z: Array) -> Record:
    values = record.values.copy()
    columns = [next(i for i, c in enumerate(record.channels) if c.name == n) for n in scaling.names]
    values[:, columns] = z * scaling.scale + scaling.offset
    return replace(record, values=values)


def _interpolated(cells: Cells) -> list[Record]:
    """Return the recordings with straight lines over their single missing cells: where the passes start."""
    out = []
    for record, z, gap in zip(cells.records, cells.scaled(cells.records), cells.gaps, strict=True):
        time = np.arange(len(z))
        for j in range(z.shape[1]):
            good = np.isfinite(z[:, j])
            z[:, j] = np.interp(time, time[good], z[good, j]) if good.any() else 0.0
        out.append(_with(record, cells.scaling, np.where(gap, np.nan, z)))
    return out


def _averaged(factors: list[WindowFactor]) -> WindowFactor:
    return Completed((), information=1.0).average(factors)


def _change(before: Chain, after: Chain, factor: WindowFactor) -> float:
    """Return the power that the two predictions differ by, over that of the innovations, the largest of a channel."""
    q, m = factor.past, factor.channels
    step = (after.a[1 : q + 1] - before.a[1 : q + 1])[::-1].transpose(1, 0, 2).reshape(m, q * m)
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
