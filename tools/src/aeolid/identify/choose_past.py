"""Choose the past window: long enough for the held-out one-step error, and for poles that a longer window confirms.

The held-out error alone takes windows that are too short where modes are slow for the sample rate: what the truncated
predictor loses is little of the error and much of the poles. Poles alone do not say when a longer window is but noise.
So the shortest window whose held-out error is within what chance explains of the least is taken first, and then made
longer by √2 until the poles agree with those of twice the window (see `truncation`). All come from one factor.

Where prediction-error steps follow and can be paid for, the window is but that of their start. What a short one leaves
out of the error they take away; what a long one adds by its many coefficients they leave where the error hardly tells
it, in gains far below the largest. There the shortest window is taken that `truncation` lets pass: LOWERED of the error
power.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.durations import read_duration
from aeolid.errors import NotIdentifiable, UsageError
from aeolid.identify.contrast import MOST, steps_to_pay
from aeolid.identify.missing import Completed, Trial
from aeolid.identify.short_factors import product_factor, shorter
from aeolid.identify.split import cut
from aeolid.identify.truncation import LOWERED, WindowCheck, WindowFit, compare_windows, fit_window, held_out_power
from aeolid.identify.windows import Scaling, WindowFactor, triangularise, window_rows
from aeolid.record import Record
from aeolid.wording import counted

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
SHORTEST, LONGEST = 10, 400
WIDEST = 640  # coefficients of the longest window tried: the work grows with their cube
PARTS = 4  # windows that a recording must be as long as, for one of that length to be tried on it
CARRIED = 0.5  # of all samples: recordings long enough for the longest window hold as many, the others add none to it
A_COEFFICIENT = 4  # windows a coefficient of the longest window tried, 3 of 10 of them held out
STEP = 2**0.5  # between windows tried
NEAR = 0.2  # of |log z|: poles of models of two windows that are nearer are taken for one
GROWS = 0.05  # of |log z|: what grows by more is no mode of a machine that ran
LONGEST_JUDGED = 20_000  # held-out windows of a recording with missing cells; more change nothing
CHUNK = 4096  # windows that are laid out at a time


@dataclass(frozen=True, eq=False)
class Ladder:
    """Hold the factors of the longest window: of the part that is fitted, of the held-out part, of everything."""

    fitted: WindowFactor
    held_out: WindowFactor
    whole: WindowFactor
    sample_time_s: float

    @property
    def longest(self) -> int:
        """Return the longest window in samples."""
        return self.whole.past

    def at(self, past: int) -> tuple[tuple[WindowFactor, WindowFactor], WindowFactor]:
        """Return the factors of a window, halves and whole."""
        return (shorter(self.fitted, past), shorter(self.held_out, past)), shorter(self.whole, past)


@dataclass(frozen=True)
class PastChoice:
    """Hold the chosen window in samples, one sentence that says why, and whether a longer one confirms its poles.

    others: the models of other windows that it was held against.
    """

    past: int
    reason: str
    check: WindowCheck
    others: tuple[WindowFit, ...] = ()


def read_past(text: str, sample_time_s: float) -> int | None:
    """Return the samples of a window given as samples ("30") or as seconds ("12s"); None for "auto".

    sample_time_s: of the samples that are identified, s. Raises UsageError on anything else.
    """
    if text == "auto":
        return None
    seconds = read_duration(text, bare=False)
    if seconds is not None:
        if not sample_time_s > 0:
            raise UsageError(f"--past {text}: the rate is lowered by no factor of at least 1; correct --decimate")
        return max(round(seconds / sample_time_s), 1)
    try:
        return int(text)
    except ValueError:
        raise UsageError(f"--past {text!r} is neither a number of samples, nor seconds such as 12s, nor auto") from None


def longest_past(records: Sequence[Record], channels: int) -> int:
    """Return the longest window that the data and the work allow, samples; at least 1.

    Recordings that are too short for a window add nothing to it and forbid it to no other: those that are PARTS times
    as long must hold half of all samples, and enough for its coefficients.
    """
    lengths = sorted(map(len, records), reverse=True)
    carried = np.cumsum(lengths)
    longest = 1
    for length, samples in zip(lengths, carried, strict=True):
        if samples >= CARRIED * carried[-1]:
            width = min(int(samples) // A_COEFFICIENT, WIDEST)
            longest = max(longest, min(width // channels - 1, LONGEST, length // PARTS))
    return longest


def climb(records: Sequence[Record], scaling: Scaling, longest: int, trial: Trial | None = None) -> Ladder:
    """Return the factors of all windows up to `longest` samples.

    trial: of the recordings whose missing cells were filled: of them come the factors that are fitted and held out,
    these of windows with a measured target. Cost: 2 N m q operations, of held-out windows with a trial 2 N q².
    """
    heads, tails = cut(records if trial is None else trial.sets[0], scaling, longest)
    fitted = product_factor(heads, scaling, longest)
    if trial is None:
        held_out = product_factor(tails, scaling, longest)
        whole = fitted.merge(held_out)
    else:
        held_out = _measured_factor(tails, trial.measured, scaling, longest)
        whole = product_factor(records, scaling, longest)
    return Ladder(fitted, held_out, whole, records[0].sample_time_s)


def ladder_of(known: Completed, scaling: Scaling, longest: int) -> Ladder:
    """Return the factors of all windows up to `longest` samples, of fewer where gaps leave too few complete ones.

    Raises NotIdentifiable where there is no complete window on either side of the cut, of no length.
    """
    while True:
        ladder = climb(known.records, scaling, longest, known.trial)
        enough = ladder.fitted.windows >= 2 * (longest + 1) * scaling.channels and ladder.held_out.windows > 0
        if enough or longest == 1:
            break
        longest = max(longest // 2, 1)  # missing samples left fewer windows than lengths promise
    if ladder.fitted.windows == 0 or ladder.held_out.windows == 0:
        raise NotIdentifiable(
            f"{known.records[0].source}: no two samples in a row hold every channel: {_said_missing(known.records)}; "
            "give a channel that is missing for long the role 'ignore', or record without gaps"
        )
    return ladder


def _said_missing(records: Sequence[Record]) -> str:
    """Return which channel lacks most samples, and where it has any."""
    names = records[0].names("input", "output")
    known = [np.isfinite(r.columns(names)) for r in records]
    count = np.sum([k.sum(axis=0) for k in known], axis=0)
    j, i = int(np.argmin(count)), int(np.argmax([len(k) for k in known]))
    at = np.flatnonzero(known[i][:, j])
    total = sum(map(len, known))
    where = ""
    if len(at):
        first, last = (records[i].time_s[k] for k in (at[0], at[-1]))
        where = f", those of {records[i].source} from {first:g} s to {last:g} s"
    return f"{names[j]!r} has {count[j]} of {total} samples{where}"


def _measured_factor(
    tails: Sequence[Record], measured: Sequence[Record], scaling: Scaling, past: int
) -> WindowFactor:  # fmt: skip
    """Return the factor of the windows (of LONGEST_JUDGED a recording at most) whose target was measured.

    tails: held-out parts with filled cells; measured: the recordings as they were. A target is measured where all
    outputs were; where no sample has all of them, where one was.
    """
    known = [
        np.isfinite(m.slice(len(m) - len(t), len(m)).columns(scaling.outputs))
        for t, m in zip(tails, measured, strict=True)
    ]
    together = any(bool(k[past:].all(axis=1).any()) for k in known)
    width = (past + 1) * scaling.channels + 1
    full, count = np.zeros((width, width)), 0
    for tail, there in zip(tails, known, strict=True):
        target: Flags = np.asarray(there.all(axis=1) if together else there.any(axis=1))
        at, stop = past, past + LONGEST_JUDGED
        for rows in window_rows(tail.slice(0, stop), scaling, past, CHUNK):
            good = target[at : at + len(rows)] & np.isfinite(rows).all(axis=1)
            at, used = at + len(rows), rows[good]
            full = triangularise(np.vstack([full, np.hstack([np.ones((len(used), 1)), used])]))
            count += len(used)
    return WindowFactor(full, past, len(scaling.inputs), len(scaling.outputs), count, 0)


def choose_past(
    ladder: Ladder, through: tuple[bool, ...], regularization: str | float, followed: bool = False
) -> PastChoice:
    """Choose the window of a ladder; through: for each input whether it has feedthrough.

    followed: whether prediction-error steps from the model follow, where they can be paid for.
    """
    tried, losses = _losses(ladder, through, regularization)
    chance = _chance(ladder)
    fits: dict[tuple[int, int | None], WindowFit] = {}
    past, within = _shortest(tried, losses, chance), "chance of the least"
    start = _shortest(tried, losses, max(chance, LOWERED))
    if followed and start < past and _can_follow(ladder, start, through, regularization, fits):
        past, within = start, f"{LOWERED:.0%} of the least, and prediction-error steps follow, which have no window"
    first = past
    while True:
        check = check_window(ladder, past, through, regularization, fits)
        if check.holds is not False or past >= ladder.longest:
            break
        past = min(_next(past), ladder.longest)
    step = ladder.sample_time_s
    reason = f"past window {counted(past, 'sample')} ({past * step:.4g} s): "
    reason += f"the shortest whose held-out one-step error is within {within}"
    if past > first:
        reason = (
            f"past window {past} samples ({past * step:.4g} s): {first} would be enough for prediction, but the poles "
            f"need {past}"
        )
    if check.holds is None or past == ladder.longest:
        reason += f"; {ladder.longest} is the most that the data allow"
    return PastChoice(past, reason, check, others_of(fits, past))


def window_within_chance(ladder: Ladder, through: tuple[bool, ...], regularization: str | float) -> int:
    """Return the shortest window whose held-out one-step error is within what chance explains of the least."""
    return _shortest(*_losses(ladder, through, regularization), _chance(ladder))


def _losses(ladder: Ladder, through: tuple[bool, ...], regularization: str | float) -> tuple[list[int], Array]:
    tried = _windows(ladder.longest)
    return tried, np.array([held_out_power(ladder.at(p)[0], through, regularization) for p in tried])


def _chance(ladder: Ladder) -> float:
    return float(2.0 / np.sqrt(max(ladder.held_out.windows, 1)) * 0.1)


def _shortest(tried: list[int], losses: Array, allowed: float) -> int:
    """Return the shortest window whose loss is within `allowed` of the least."""
    return tried[int(np.flatnonzero(losses <= losses.min() + allowed)[0])]


def others_of(fits: dict[tuple[int, int | None], WindowFit], past: int) -> tuple[WindowFit, ...]:
    """Return the fits of other windows than one."""
    return tuple(found for (window, _), found in fits.items() if window != past)


def _can_follow(
    ladder: Ladder, past: int, through: tuple[bool, ...], regularization: str | float,
    fits: dict[tuple[int, int | None], WindowFit],
) -> bool:  # fmt: skip
    """Say whether as many steps as may be needed can be paid for a model of the order of this window; adds its fit."""
    halves, whole = ladder.at(past)
    fits[past, None] = fit_window(whole, halves, through, regularization, None)
    size = (fits[past, None].order, whole.inputs, whole.outputs, sum(through))
    return steps_to_pay(size, whole.windows + past) == MOST


def check_window(
    ladder: Ladder, past: int, through: tuple[bool, ...], regularization: str | float,
    fits: dict[tuple[int, int | None], WindowFit] | None = None,
) -> WindowCheck:  # fmt: skip
    """Compare the poles of a window with those of twice and four times its length, as far as the ladder goes.

    fits: those that are known, by window and order; added to. Missing is only what both longer windows show
    (`_witnessed`). Where the ladder ends below half as much again, a shorter window is compared, and holds is None
    where the poles still move.
    """
    fits = {} if fits is None else fits

    def fit(p: int, order: int | None) -> WindowFit:
        if (p, order) not in fits:
            halves, whole = ladder.at(p)
            fits[p, order] = fit_window(whole, halves, through, regularization, order)
        return fits[p, order]

    twice, step = min(2 * past, ladder.longest), ladder.sample_time_s
    if twice < 1.5 * past:
        return _by_shorter(fit, past, step)
    short, windows = fit(past, None), sorted({twice, min(4 * past, ladder.longest)})
    thirds = windows if len(windows) > 1 else [twice, round((past + twice) / 2)]
    for longer in windows:
        own = fit(longer, None)
        sure = _witnessed(own, [fit(w, None) for w in thirds if w != longer])
        check = compare_windows(short, [fit(longer, short.order), own, sure], step)
        if not check.holds:
            break
    return check


def _witnessed(found: WindowFit, others: Sequence[WindowFit]) -> WindowFit:
    """Return a fit with the poles that do not grow by more than GROWS of their size and that all others show as well.

    What one window alone shows is noise that its model describes, and a mode that grows is none of a machine that ran.
    """
    own, *seen = (_without_growing(f) for f in (found, *others))
    return _taken(own, np.array([all(shows(o, p) for o in seen) for p in own.poles], dtype=bool))


def _without_growing(found: WindowFit) -> WindowFit:
    size = np.where(found.poles == 0, 1e-300, found.poles)
    return _taken(found, np.log(abs(size)) <= GROWS * abs(np.log(size)))


def _taken(found: WindowFit, which: NDArray[np.bool_]) -> WindowFit:
    return replace(found, poles=found.poles[which], covariance=found.covariance[which])


def shows(found: WindowFit, pole: complex) -> bool:
    """Say whether a model has a pole within NEAR of the size of log z of another."""
    own = np.log(complex(pole) or 1e-300)
    return bool((abs(np.log(found.poles[found.poles != 0]) - own) <= NEAR * abs(own)).any())


def _by_shorter(fit: Callable[[int, int | None], WindowFit], past: int, sample_time_s: float) -> WindowCheck:
    """Judge a window that cannot be made longer by one of two thirds of it: poles that agree with it have settled."""
    less = max(round(past / 1.5), 1)
    own = fit(past, None)
    found = compare_windows(fit(less, own.order), [own], sample_time_s) if less < past else None
    if found is not None and found.holds:
        return WindowCheck(True, past, less, None, found.apart, "")
    frequency = None if found is None else found.frequency_hz
    near = "" if frequency is None else f" near {frequency:.3g} Hz"
    return WindowCheck(
        None, past, less, frequency, 0.0 if found is None else found.apart,
        f"whether the past window of {counted(past, 'sample')} ({past * sample_time_s:.4g} s) is long enough "
        "cannot be said: the "
        f"data allow none much longer, and poles{near} still move with it: standard deviations may be too small",
    )  # fmt: skip


def _windows(longest: int) -> list[int]:
    tried = [min(SHORTEST, longest)]
    while tried[-1] * STEP < longest:
        tried.append(_next(tried[-1]))
    return tried


def _next(past: int) -> int:
    """Return the window that is tried after one."""
    return max(round(past * STEP), past + 1)
