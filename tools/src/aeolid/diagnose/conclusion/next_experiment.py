"""Say which recording to make next: what parts two names, what shows smaller effects, what describes the unnamed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.slight import parts_that_matter
from aeolid.diagnose.conclusion.declared import form_speaking
from aeolid.diagnose.conclusion.where import where_of
from aeolid.diagnose.experiments.closer import describe_closer, look_closer
from aeolid.diagnose.experiments.experiment import advise, describe, menu_of, stretch_of
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.pipeline import Study
from aeolid.diagnose.selection.rivals import is_other, leaves_open, one_of_each, rivals_of, weights_of
from aeolid.diagnose.validation.proof import Proof


def next_experiment(
    study: Study, verdict: str, effects: Sequence[Mapping[str, Any]], proof: Proof | None
) -> dict[str, Any] | None:
    """Return what to record next, for how long, and which names that parts; None where nothing is open."""
    inputs = study.case.records[0].of("input")
    pair = undecided(study) if verdict == "ambiguous" and proof is study.proof else None
    if pair is not None:
        ids, candidates = pair
        first = ids[0]
        hints = dict(entry(first).confused_with) | {k: v for k, v in entry(ids[1]).confused_with if k == first}
        hint = hints.get(ids[1]) or hints.get(first) or "look at the highest frequencies that are recorded"
        names = ids if ids[0] != ids[1] else [c.key for c in candidates]
        return describe(advise(study.prepared, inputs, candidates, study.seed), names, hint, bool(inputs))
    if verdict in ("no_mismatch", "immaterial") or (verdict == "not_testable" and _moves(study)):
        return describe_closer(look_closer(study.prepared, inputs, study.bank, study.seed), bool(inputs))
    if verdict in ("unnamed", "not_testable", "ambiguous"):
        where = effects[0]["location"] if effects else where_of(study, verdict)
        sealed = study.prepared.split.sealed[0]
        minutes = float(np.ceil(2 * len(sealed.y) * sealed.step / 60))
        text = _again(study, verdict, " and ".join(c.name for c in inputs), (where or {}).get("frequency_hz"))
        return {"text": text, "minutes": minutes, "separates": []}
    return None


def _again(study: Study, verdict: str, moved: str, band: Sequence[float] | None) -> str:
    """Say how to record once more. moved: names of the inputs, empty where there are none; band: in Hz."""
    form = form_speaking(study) if verdict == "unnamed" else None
    if form is not None and form.attachments[-1].gain_states:
        begin = f"Record with {moved} held still: a" if moved else "Record again: a"
        return (
            f"{begin} force that nobody recorded goes on in its band. Then switch off what may make it, one after the"
            " other, or record what it may follow"
        )
    text = "Record again from a start farther from rest"
    if moved:
        within = (
            f" that excite {band[0]:.3g} to {band[1]:.3g} Hz" if band else " from the slowest to the fastest motion"
        )
        text = f"Record again with steps added to {moved}{within}, twice as large as what moves there now"
    region = ", and once more in another operating region: what is left over must follow one of them"
    return text + (region if verdict == "unnamed" else "")


def _moves(study: Study) -> bool:
    """Tell whether some input moves, so that a test signal has a size to go by."""
    return bool(menu_of(study.prepared, study.case.records[0].of("input"), stretch_of(study.prepared)))


def undecided(study: Study) -> tuple[tuple[str, str], tuple[Candidate, Candidate]] | None:
    """Return two names of a proven effect that the data do not tell apart, and the candidates that bear them."""
    if study.second is not None:
        ids = {a.key: a.entry for a in parts_that_matter(study.second)}
        other = next(a for a in study.alternatives if a.replaces in ids and a.attachment.entry != ids[a.replaces])
        return (ids[other.replaces], other.attachment.entry), (study.second, other.candidate)
    if study.winner is None:
        return None
    winner = study.winner
    said = (c for c, w in weighed(study, winner) if leaves_open(winner, c, w))
    rival = next((c for c in said if is_other(c, winner)), None)
    return None if rival is None else ((winner.attachments[0].entry, rival.attachments[0].entry), (winner, rival))


def weighed(study: Study, winner: Candidate) -> list[tuple[Candidate, float]]:
    """Return who is not told apart from the winner and says something else, each with its weight."""
    rivals = one_of_each([winner, *rivals_of(study.candidates, winner)])[1:]
    return list(zip(rivals, weights_of([winner, *rivals])[1:], strict=True))
