"""Weigh candidates against each other: who is not told apart from the winner, and who outdoes it (S7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.candidate import Candidate
from aeolid.diagnose.catalogue import entry

Array = NDArray[np.float64]
_EVEN = 2.0  # |Vuong z| below which two models are not told apart …
_TIED = 1.0  # … and nats over all data
_OUTDONE = 10.0  # nats by which a refused explanation must lead to take the name from the best allowed one


def rivals_of(candidates: Sequence[Candidate], winner: Candidate) -> list[Candidate]:
    """List the candidates that the data do not tell from the winner: |Vuong z| below 2 on fit and selection data."""
    result = []
    for other in candidates:
        if other is winner or other.unlisted or not other.plausible or other.fit_gain <= 0 or other.select_gain <= 0:
            continue
        difference = _difference(winner, other)
        # equal models differ by rounding, always to one side
        if _vuong(difference) < _EVEN or abs(difference.sum()) < _TIED:
            result.append(other)
    return result


def outdone_by(candidates: Sequence[Candidate], named: Candidate) -> Candidate | None:
    """Return who explains far more than what would be named, with a value at its range's end or a form without a name.

    Then what is missing resembles that one more than anything that has a name here: naming the second best would be
    forced (a sensor 4 ms late, less than the least lag that is believed, was called a bending mode). |Vuong z| above 2
    and 10 nats are asked for; None where nobody is. One of the same family takes nothing: stick and slip fits a stage
    better than dry friction alone, with a force at its range's end; what is missing is friction all the same.
    """
    families = {entry(a.entry).family for a in named.attachments}
    ahead = [
        c for c in candidates
        if c.complete and (c.at_end or (c.unlisted and c.plausible))
        and c.score > named.score + _OUTDONE and c.select_gain > named.select_gain
        and _vuong(_difference(c, named)) > _EVEN
        and not families & {entry(a.entry).family for a in c.attachments}
    ]  # fmt: skip
    return max(ahead, key=lambda c: c.score, default=None)


def weights_of(candidates: Sequence[Candidate]) -> list[float]:
    """Return weights that sum to one, by the odds of the candidates' scores."""
    scores = np.array([c.score for c in candidates])
    odds = np.exp(np.clip(scores - scores.max(), -50, 0))
    return [float(w) for w in odds / odds.sum()]


def _difference(a: Candidate, b: Candidate) -> Array:
    """Return what each sample of fit and selection data gains by a over b."""
    return np.concatenate([a.fit.per_sample - b.fit.per_sample, a.select_difference - b.select_difference])


def _vuong(difference: Array) -> float:
    """Return the sum over its own deviation, from blocks of N^(1/2) samples (Vuong 1989)."""
    length = max(1, int(np.sqrt(len(difference))))
    blocks = np.add.reduceat(difference, np.arange(0, len(difference), length))
    return float(blocks.sum() / max(np.sqrt(len(blocks)) * np.std(blocks), 1e-12))
