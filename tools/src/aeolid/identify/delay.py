"""Estimate how many whole samples an input acts late, from recordings in open or closed loop.

In the predictor y_k = Σ Ξᵘ_j u_{k−j} + Σ Ξʸ_j y_{k−j} + e_k a dead time of d samples is d leading Ξᵘ that are zero,
whatever loop made u: the predictor is that of the plant. A regression with enough lags of each input says how many
leading lags can go without the errors noticing, and whether the next ones cannot: a response that begins gently, or an
input of little effect, has small leading coefficients too and is no dead time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import chdtrc

from aeolid.errors import UsageError
from aeolid.identify.windows import Scaling, find_scaling, triangularise
from aeolid.record import Record

Array = NDArray[np.float64]
AUTO = "auto"
LEAST = 3  # samples of dead time from which it is worth states of its own; less costs the window as little
BEYOND = 30  # samples beyond the past window that are searched
MOST = 100  # samples that are searched at most
LONGEST = 10_000  # samples a delay asked for may have
TAIL = 10  # lags of an input behind the longest delay searched
# lags of the outputs, whatever the window: with fewer than needed errors are coloured, and fewer lags are let go
PAST = 20
ROWS = 10_000  # windows used at most: enough for a lag of 1 % of an output, and a fraction of the cost of a fit
PER_COLUMN = 3  # windows needed for each regressor
PER_LAG = 15  # samples needed for each lag of the outputs and for each of them
LEVEL = 1e-4  # chance at which lags that are zero all the same rule out their delay
A_LAG = 8.0  # of Wald's statistic per lag and output that going without it is worth: of zero lags 0.5 % add more
STEEP = 9.3  # power of the lags let go that what they weigh must outgrow, 8 times for a quarter more; tⁿ has 2 n + 1
EXACT = 1e-10  # of an output's power: errors below it are rounding


def read_delays(texts: Sequence[str] | None) -> Mapping[str, int] | str | None:
    """Return what --delay asks for: None, "auto" or samples for each input; raises UsageError on anything else."""
    if not texts or list(texts) == ["none"]:
        return None
    if list(texts) == [AUTO]:
        return AUTO
    found: dict[str, int] = {}
    for text in texts:
        name, _, samples = text.rpartition("=")
        if not name or not samples.strip().isdecimal():
            raise UsageError(f"--delay {text!r} is none of auto, none or NAME=SAMPLES such as pitch=15")
        if name in found:
            raise UsageError(f"--delay names {name!r} twice")
        found[name] = int(samples)
    return found


def find_delays(
    records: Sequence[Record], past: int, feedthrough: Sequence[str], asked: Mapping[str, int] | str | None
) -> dict[str, int]:
    """Return the samples by which each input acts late, inputs without delay left out.

    asked: None for none, "auto" for an estimate, or what is known, in samples of these recordings. past: p;
    feedthrough: inputs that act within the sample, behind a delay within its last one. Raises UsageError on an unknown
    input or a delay out of range. Cost: 2 min(N, 10 000) q² + r q³, q = r min(p + 40, 110) + 20 l.
    """
    if asked is None:
        return {}
    inputs = records[0].names("input")
    if isinstance(asked, str):
        if asked != AUTO:
            raise UsageError(f"delays {asked!r} are neither 'auto' nor samples for each input")
        return estimate_delays(records, past, tuple(name in feedthrough for name in inputs))
    for name, samples in asked.items():
        if name not in inputs:
            raise UsageError(f"delay of {name!r}: no such input; the inputs are {', '.join(inputs)}")
        if not 0 <= samples <= LONGEST:
            raise UsageError(f"delay of {name!r}: {samples} samples are not within 0 … {LONGEST}")
    return {name: samples for name, samples in asked.items() if samples}


def estimate_delays(records: Sequence[Record], past: int, feedthrough: Sequence[bool]) -> dict[str, int]:
    """Return the dead time of each input in samples, where the recordings show one of at least LEAST.

    Inputs one after the other: what was found for one holds for the next. A delay can be what leaves the errors as they
    are but for chance where the lags within it are left out (Wald, LEVEL), and raises them steeply (STEEP) where a
    quarter more are. Of several, the one of most lags left out, each worth A_LAG, less what they weigh. Too few windows
    for the regression: none.
    """
    scaling = find_scaling(records)
    if not scaling.inputs:
        return {}
    r, outputs, samples = len(scaling.inputs), len(scaling.outputs), min(sum(map(len, records)), ROWS)
    y_lags = min(PAST, max(samples // (PER_LAG * outputs), 1))
    room = (samples - PER_COLUMN * (r + outputs * (y_lags + 1))) / (1 + PER_COLUMN * r) - TAIL
    longest = min(past + BEYOND, MOST, int(room))
    if longest < LEAST + 1:
        return {}
    rows = _rows(records, scaling, longest + TAIL, y_lags)
    lags = longest + TAIL + 1
    if rows is None or len(rows) < PER_COLUMN * rows.shape[1]:
        return {}
    R = triangularise(rows - rows.mean(axis=0))
    kept = np.ones(R.shape[1], dtype=bool)
    for i, through in enumerate(feedthrough):
        kept[i * lags] = through  # lag 0: in a loop the controller's own, unless said otherwise
    found = {}
    for i, name in enumerate(scaling.inputs):
        first = i * lags + (not feedthrough[i])
        delay = _leading_zeros(R, kept, range(first, first + longest), outputs, len(rows))
        if delay >= LEAST:
            found[name] = delay
            kept[first : first + delay] = False
    return found


def _rows(records: Sequence[Record], scaling: Scaling, u_lags: int, y_lags: int) -> Array | None:
    """Return rows of [lags 0 … u_lags of each input, lags 1 … y_lags of each output, y_k], None where none is complete.

    Inputs one after the other, the youngest lag first.
    """
    lead, r, parts, count = max(u_lags, y_lags), len(scaling.inputs), [], 0
    for record in records:
        take = min(len(record), ROWS - count + lead)
        if take <= lead:
            continue
        z = scaling.apply(record.columns(scaling.names)[:take])
        windows = sliding_window_view(z, lead + 1, axis=0)[:, :, ::-1]  # (rows, channels, lags), youngest first
        u, y = windows[:, :r, : u_lags + 1], windows[:, r:, 1 : y_lags + 1]
        rows = np.hstack([u.reshape(len(u), -1), y.reshape(len(y), -1), windows[:, r:, 0]])
        good = rows[np.isfinite(rows).all(axis=1)]
        parts.append(good)
        count += len(good)
    return np.concatenate(parts) if count else None


def _leading_zeros(R: Array, kept: NDArray[np.bool_], lags: range, outputs: int, windows: int) -> int:
    """Return the dead time of one input from the factor R of all columns; lags: its leading ones, youngest first."""
    regressors = np.flatnonzero(kept[:-outputs])
    mine = [c for c in lags if kept[c]]
    others = [int(c) for c in regressors if c not in set(mine)]
    order: list[int] = [*others, *reversed(mine)]  # those to leave out last, the youngest at the end
    S = triangularise(np.hstack([R[:, order], R[:, -outputs:]]))
    size = len(order)
    freedom = max(windows - size, 1)
    error = S[size:, size:]
    weight = np.linalg.inv(error.T @ error + windows * EXACT * np.eye(outputs)) * freedom
    rest = S[:size, size:]
    added = np.einsum("ki,ij,kj->k", rest, weight, rest)[::-1][: len(mine)]  # by the youngest lag first
    weighs = np.cumsum(added)
    return _delay_of(weighs, outputs)


def _delay_of(weighs: Array, outputs: int) -> int:
    """Return the dead time that Wald's statistics (lags,) of leaving out the first 1, 2, … lags tell; 0 for none.

    One chance in twenty that single zero lags weigh much is no reason to find none: every delay is tried, and may be
    found shorter than it is, longer where the response begins within the noise.
    """
    delays = np.arange(LEAST, len(weighs) + 1)
    beyond = delays - (-delays // 4)
    delays, beyond = delays[beyond <= len(weighs)], beyond[beyond <= len(weighs)]
    within = weighs[delays - 1]
    silent = chdtrc(outputs * delays, within) > LEVEL
    least = np.maximum(within, outputs * delays) * (beyond / delays) ** STEEP
    fits = silent & (weighs[beyond - 1] > least)
    if not fits.any():
        return 0
    return int(delays[np.argmax(np.where(fits, A_LAG * outputs * delays - within, -np.inf))])
