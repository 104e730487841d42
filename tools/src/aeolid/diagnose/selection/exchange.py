"""Ask of each effect of a set whether another one in its place explains as much, or more (S5, S7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from aeolid.diagnose.baseline.frame import carry_point, put_back
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import is_accepted, select_density
from aeolid.diagnose.candidates.refit import as_rows, refit
from aeolid.diagnose.candidates.slight import is_worth_a_name_beside
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.selection.rivals import are_kin, explanation, tells_apart

_TRIED = 2  # others tried in the place of each effect


@dataclass(frozen=True, eq=False)
class Alternative:
    """Hold a set in which one effect stands in another's place, and the key of the one it replaces."""

    replaces: str
    candidate: Candidate
    attachment: Attachment


def exchanged(
    prepared: Prepared, chosen: Candidate, singles: Sequence[Candidate]
) -> tuple[Candidate, tuple[Alternative, ...]]:
    """Return the best set, and the others that the data do not tell from it.

    The first effect of a set was chosen while the others were missing: a second-order filter beside an unknown
    integrator was a lag, a dead time beside a gust a drive that rings. One effect of the set at a time gives way to
    those of its family at its place that were fitted alone. Cost: a fit for each, on a simulator's run none.
    """
    evidence = in_force().evidence
    if len(chosen.attachments) < 2 or prepared.surrogate is not None:
        return chosen, ()
    tried: dict[str, Alternative] = {}
    best = chosen
    for place, attachment in enumerate(chosen.attachments):
        for single in _others(attachment, best, singles)[:_TRIED]:
            if prepared.deadline.skips(f"{single.key} in the place of {attachment.key}"):
                break
            found = _with(prepared, best, attachment, single)
            if found is None or not is_accepted(found):
                continue
            if place > 0 and not is_worth_a_name_beside(found, single.attachments[0]):  # the first stood alone once
                continue
            if found.score > best.score + evidence.tied_nats:
                tried[attachment.key] = Alternative(single.attachments[0].key, best, attachment)
                best, attachment = found, single.attachments[0]
            else:
                tried[single.key] = Alternative(attachment.key, found, single.attachments[0])
    kept = [a for a in tried.values() if _differs_by_one(best, a) and not tells_apart(best, a.candidate)]
    return best, tuple(kept)


def said_instead(alternatives: Sequence[Alternative], named: Sequence[Attachment]) -> list[Alternative]:
    """Return what stands in the place of one of these effects and says something else; one of each, in their order."""
    own = {a.key: explanation(a) for a in named}
    found: dict[tuple[str, tuple[str, str, str]], Alternative] = {}
    for other in sorted(alternatives, key=lambda a: -a.candidate.score):
        if other.replaces in own and explanation(other.attachment) != own[other.replaces]:
            found.setdefault((other.replaces, explanation(other.attachment)), other)
    kept = set(map(id, found.values()))
    return [a for a in alternatives if id(a) in kept]


def _differs_by_one(best: Candidate, other: Alternative) -> bool:
    """Tell whether a set tried is the best one but for the effect it replaces: the best may have moved on since."""
    keys, own = ({a.key for a in c.attachments} for c in (best, other.candidate))
    return keys - own == {other.replaces} and own - keys == {other.attachment.key}


def _others(attachment: Attachment, chosen: Candidate, singles: Sequence[Candidate]) -> list[Candidate]:
    """Return single effects of an effect's family at its place, best first."""
    taken = {a.key for a in chosen.attachments}
    found = [
        c for c in singles
        if len(c.attachments) == 1 and not c.unlisted and c.complete and c.fit_gain > 0
        and c.key not in taken and are_kin(c.attachments[0], attachment)
    ]  # fmt: skip
    return sorted(found, key=lambda c: -c.score)


def _with(prepared: Prepared, chosen: Candidate, gone: Attachment, single: Candidate) -> Candidate | None:
    """Fit the set with one effect in another's place; gains over the bare baseline."""
    kept = tuple(single.attachments[0] if a.key == gone.key else a for a in chosen.attachments)
    stage = prepared.only(kept)
    carried = carry_point(chosen.fit.point, chosen.predictor.compiled.model, stage.extended)
    point = put_back(carried, stage.extended, gone, kept)
    (new,) = as_rows(single)
    rows = [new if r.attachment.key == gone.key else r for r in as_rows(chosen)]
    base = replace(chosen.fit, point=point, free=stage.free, jumps=())
    found = refit(stage, base, rows, select_density(prepared), ahead=chosen.fit_gain)
    if found is None:
        return None
    return found.beyond(chosen)
