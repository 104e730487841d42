"""Look for further effects beside what comes near the first one, where none stands beside that (S5)."""

from __future__ import annotations

from collections.abc import Sequence

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import is_accepted
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Bank
from aeolid.diagnose.selection.several import further_effects


def further_beside_any(
    prepared: Prepared, winner: Candidate, singles: Sequence[Candidate], seed: int
) -> tuple[list[Candidate], Bank]:
    """Return the sets, smallest first, and what the bank says with the largest in the model, as `further_effects` does.

    One of two effects that are missing is told from its rivals while the other one bends all of them: a ferry's
    sensor that lags, 257 nats, took up its drag, and nothing stood beside it; beside a lag of its thrust, 238, the
    drag did, and both had 279. Asked is the best effect at another place that falls short by no more than the share
    that a further one must add, where the winner stands alone; its set must be ahead by what is clear. Cost: one bank,
    and fits where that speaks. Not on a simulator's run.
    """
    chain, bank = further_effects(prepared, winner, singles, seed)
    if len(chain) > 1 or prepared.surrogate is not None or prepared.deadline.skips("effects beside a rival"):
        return chain, bank
    place, short = winner.attachments[0].location["entry"], in_force().selection.further_share * winner.score
    others = [
        c for c in singles
        if c.score > winner.score - short and len(c.attachments) == 1 and not c.unlisted and c.complete
        and c.attachments[0].location["entry"] != place and is_accepted(c)
    ]  # fmt: skip
    if not others:
        return chain, bank
    beside, said = further_effects(prepared, max(others, key=lambda c: c.score), singles, seed)
    ahead = beside[-1].score - winner.score > in_force().evidence.clear_nats
    return (beside, said) if len(beside) > 1 and ahead else (chain, bank)
