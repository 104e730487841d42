"""Ask which effect explains a linear model's misfit best once the model's own constants may be a little off (S5)."""

from __future__ import annotations

from collections.abc import Sequence

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.slight import is_slight
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Row
from aeolid.diagnose.selection.exchange import Alternative
from aeolid.diagnose.selection.rivals import tells_apart
from aeolid.diagnose.selection.several import corrects, grown, is_slight_beside, what_is_left

_OTHERS, _CONSTANTS, _TRIED = 2, 2, 2  # effects asked beside the first; constants beside each; rows tried for each


def settled_beside_constants(
    prepared: Prepared, chain: list[Candidate], singles: Sequence[Candidate], seed: int
) -> tuple[list[Candidate], tuple[Alternative, ...]]:
    """Return the sets, smallest first, of the effect that leads when constants are settled beside each; and others.

    Equations have free values of their own; a linear model's gain, frequencies and dampings stand still while effects
    are compared, and the richest form takes up what is wrong with them: a spring that hardens had 91 nats and stops
    118; beside a frequency 1.5 % off 133 and 129. Asked are effects at the place of the first one that reach half of
    its score alone, and such constants alone, which are it where the data do not tell the leader from them. The others
    that the data do not tell from the leader are returned with it.
    """
    first = chain[0] if chain else None
    if first is None or prepared.linear is None or prepared.surrogate is not None or is_slight(first):
        return chain, ()
    others = _others(first, singles)
    if not others or any(not is_slight_beside(c) for c in chain[1:]):
        return chain, ()
    ladders = [_ladder(prepared, [c], seed) for c in others]
    ladders.insert(0, _ladder(prepared, chain, seed))
    best = max(ladders, key=lambda steps: steps[-1].score)
    if best[-1].score <= ladders[0][-1].score + in_force().evidence.tied_nats:
        best = ladders[0]
    plain = next((steps for steps in ladders if is_slight(steps[0])), None)
    if plain is not None and (plain is best or not tells_apart(best[-1], plain[-1])):
        return plain, ()
    rest = [steps for steps in ladders if steps is not best]
    effect = best[0].attachments[0]
    alternatives = [
        Alternative(effect.key, steps[-1], steps[0].attachments[0])
        for steps in rest if steps is not plain and not tells_apart(best[-1], steps[-1])
    ]  # fmt: skip
    if best is ladders[0] and len(best) == 1:
        return chain, ()  # nothing was settled: singles are compared as singles
    return best, tuple(alternatives)


def _others(first: Candidate, singles: Sequence[Candidate]) -> list[Candidate]:
    """Return other effects at the place of the first one that alone reach half of its score, best first."""
    share, place = in_force().selection.nearly_share, first.attachments[0].location["entry"]
    found = [
        c for c in singles
        if c is not first and c.plausible and c.complete and not c.unlisted and len(c.attachments) == 1
        and (is_slight(c) or c.attachments[0].location["entry"] == place)
        and c.attachments[0].entry != first.attachments[0].entry and c.score > share * first.score
    ]  # fmt: skip
    found.sort(key=lambda c: -c.score)
    constants = [c for c in found if is_slight(c)][:1]
    return [c for c in found if not is_slight(c)][:_OTHERS] + constants


def _ladder(prepared: Prepared, sets: list[Candidate], seed: int) -> list[Candidate]:
    """Return sets with the model's constants added one after the other, while each corrects and is off by little."""
    steps = list(sets)
    while len(steps) <= _CONSTANTS and not prepared.deadline.skips(f"constants beside {steps[0].key}"):
        larger = grown(prepared, steps[-1], _constants(prepared, steps[-1], seed), corrects)
        if larger is None or not is_slight_beside(larger):
            break
        steps.append(larger)
    return steps


def _constants(prepared: Prepared, chosen: Candidate, seed: int) -> list[Row]:
    """Return the constants of the model whose score beside a set is above half of what chance reaches."""
    bank, share = what_is_left(prepared, chosen, seed), in_force().selection.half_limit_share
    rows = [r for r in bank.rows if r.attachment.entry == "parameter_error" and r.testable]
    taken = {a.key for a in chosen.attachments}
    return [r for r in rows if r.attachment.key not in taken and r.z > share * bank.limit(r)][:_TRIED]
