"""Choose between two readings of the inputs that are close, each beside another effect (S5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.settle_sampling import Beside
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.deadline import Deadline
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.selection.better_baseline import taken_up


def read_with(
    case: Case, prepared: Prepared, pairs: Sequence[Beside], winner: Candidate, deadline: Deadline
) -> tuple[Beside, Candidate]:
    """Return the likelier of the two best pairs of an effect and a reading, and whom the look behind it starts from.

    Where they are close both are fitted to the end: a brief fit may stop short by more than they differ. Read as it
    moves a drive that rings was a dead time of 0.12 s half a row later, 71 nats by twelve steps, and as held, 44, was
    what it is; fitted to the end these were 64 and 176.
    """
    best, close = pairs[0], in_force().selection.further_share * winner.fit_gain
    if any(p.sampling is not None and p.sampling.offset_s < 0 for p in pairs[:2]):
        return best, winner  # a row early beside a clock of two rows is as likely as a clock of three
    if len(pairs) < 2 or pairs[1].value < best.value - close or deadline.skips("the second of two close readings"):
        return best, winner
    fitted: list[tuple[float, Beside, Candidate]] = []
    for pair in pairs[:2]:
        read = pair.sampling
        stage = prepared if read is None else prepare(case, prepared.decimation, deadline, replace(read, free=False))
        own = pair.candidate if read is None else taken_up(stage, pair.candidate)
        if own is not None:
            price = 0.0 if read is None else read.gain - (pair.value - pair.candidate.fit.log_posterior)
            fitted.append((own.fit.log_posterior - price, pair, own))
    _, chosen, leader = max(fitted, key=lambda f: f[0], default=(0.0, best, winner))
    return chosen, leader
