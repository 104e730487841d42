"""Say a verdict in one sentence, and why finding nothing may mean nothing (S8)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.slight import is_slight, parts_that_matter, slight_parts
from aeolid.diagnose.conclusion.declared import (
    contradicted,
    form_speaking,
    habit_ahead,
    mostly_a_reading,
    off_by_little,
)
from aeolid.diagnose.conclusion.next_experiment import weighed
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.pipeline import Study
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.selection.exchange import said_instead
from aeolid.diagnose.selection.rivals import stands_for
from aeolid.diagnose.selection.several import KIN
from aeolid.diagnose.validation.proof import Proof
from aeolid.diagnose.validation.rotation import is_silent
from aeolid.record import Record

_RIGHT = "the structure is right, but "


def sentence(verdict: str, effects: list[dict[str, Any]], study: Study, proof: Proof | None) -> str:
    """Write the verdict as one sentence for the top of the page."""
    if verdict in ("named", "multiple", "parameter") or (verdict == "data_fault" and effects):
        said = _one_after_another(effects) + _or_values(study, effects, proof)
        return said + _little(study, proof) + _beyond(study, proof)
    if verdict == "ambiguous" and study.second is not None and proof is study.proof:
        return _sentence_of_sets(effects, study, study.second) + _little(study, proof) + _beyond(study, proof)
    if verdict == "ambiguous":
        return " — or: ".join(str(e["statement"]) for e in effects) + _beyond(study, proof)
    if verdict == "data_fault":
        return "; ".join(f"{f.channel}: {f.finding}" for f in study.findings if f.severity == "fault")
    if verdict == "immaterial":
        return _immaterial(study)
    if verdict == "not_testable":
        return untested(study)
    if verdict == "unnamed":
        return _unnamed(study)
    begin = _significant(study) or "Nothing is missing that this recording could show"
    return f"{begin}{_late(study)}{_coloured(study)}{_not_borne_out(study)}{_slow(study)}."


def _unnamed(study: Study) -> str:
    """Say that something is missing, and what comes nearest."""
    share = study.ceiling.groups[0][0] if study.ceiling.groups else "the past"
    nearest = f"what the model leaves unexplained can be foretold, most of all from {share}"
    if (form := form_speaking(study)) is not None:
        nearest = f"what comes nearest is {form.says(form.attachments[0])}{_or_sensor(study, form)}"
    elif study.winner is not None and study.rotation is not None:
        found = study.winner.says(study.winner.attachments[0])
        if against := study.rotation.against:
            told = "; ".join(f"{f.name}, {f.gain:.0f} nats" for f in against)
            return (
                f"Something is missing: {found} gains on most parts of the data, each left out in turn, but not on all"
                f" ({told}): what happens there the others do not show."
            )
        if is_contradicted(study):
            return (
                f"Something is missing: {found} gains {study.rotation.gain:.0f} nats on the parts of the data that were"
                " left out in turn, but as estimated on all data but the sealed ones it foretells these worse than the"
                " model does."
            )
        if study.rotation.proves and study.proof is not None and study.proof.worse:
            return (
                f"Something is missing: {found} gains {study.rotation.gain:.0f} nats on the parts of the data that were"
                " left out in turn, but over the settling time it foretells the sealed ones worse than the model does."
            )
        if speaks_in_turn(study):
            return (
                "Something is missing: chosen anew without each part of the data, effects gain"
                f" {study.rotation.gain:.0f} nats on the parts left out, but not the same one everywhere; what was"
                f" fitted speaks most for this: {found} ({study.winner.fit_gain:.0f} nats)."
            )
    if is_outlived(study):
        nearest = (
            "fitted to the first part of the data, the model foretells each of the others worse by at least"
            f" {study.foretold_worse:.1f} nats a sample, so that something in it changes, or is reached only there"
        )
    return f"Something is missing that no catalogue entry explains; {nearest}."


def _immaterial(study: Study) -> str:
    """Say what is there and matters to nobody: an effect that shows nowhere, constants that are a little off."""
    evidence, proof, refitted = in_force().evidence, study.proof, study.declared_proof
    is_proven = study.winner is not None and proof is not None and proof.interval[0] > evidence.proven_nats
    by_values = refitted is not None and refitted.interval[0] > evidence.proven_nats and contradicted(study)
    slight = study.winner is not None and is_slight(study.second or study.winner)
    if not by_values and (late := mostly_a_reading(study)) is not None:
        said = late.says(late.attachments[0])
        return f"A difference is there beyond doubt, which the way of taking samples can be: {said}."
    if by_values or (study.winner is None and contradicted(study)):
        text = f"The structure is right, and {off_by_little(study)}"
        return f"{text}; too small to show in any prediction{_nearest(study)}." if is_proven else f"{text}."
    if (late := habit_ahead(study)) is not None:
        said = late.says(late.attachments[0])
        return f"A difference is there beyond doubt, which the way of taking samples can be: {said}."
    if study.constants is not None and not slight:
        alone = study.constants.candidate
        said = f"{alone.says(alone.attachments[0])}; what is left beside that shows in no prediction"
        return f"A difference is there beyond doubt, but small: {said}{_nearest(study, ', and is most like this')}."
    if slight:
        return f"A difference is there beyond doubt, but small{_nearest(study)}."
    least = in_force().validation.unseen_spread_share
    seen = f": the model errs by no more than {least:.0%} of any output's spread" if study.adequate else ""
    nearest = _nearest(study, ", and is most like this") if seen else _nearest(study)
    return f"A difference is there beyond doubt, but too small to show in any prediction{seen}{nearest}."


def _significant(study: Study) -> str:
    """Say which score is significant where no fit of it was accepted: that nothing is missing is then not known.

    The verdict stays: one or two in a hundred recordings that lack nothing have such a score.
    """
    if study.winner is not None or not study.bank.loud:
        return ""
    row = study.bank.loud[0]
    score, limit = (row.z, study.bank.threshold) if row.z > study.bank.threshold else (row.fair, study.bank.fair)
    return (
        f"No effect was confirmed, and whether something is missing is open: the score of {row.attachment.key},"
        f" {score:.1f}, is above the {limit:.1f} that chance exceeds in one of a hundred recordings, but nothing that"
        " was fitted explains data that were not"
    )


def _beyond(study: Study, proof: Proof | None) -> str:
    """Say which form without a name the corrected model has beside what was named; empty where it has none."""
    if study.completed is None or proof is not study.proof:
        return ""
    form = next(a for a in study.completed.attachments if a.entry == unlisted.ID)
    listed = "" if form.key.startswith(KIN) else ", a form that no catalogue entry has"
    return f"; beyond that {study.completed.says(form)}{listed}"


def _nearest(study: Study, introduced: str = "") -> str:
    """Say what comes nearest to a difference that is too small for a name."""
    return "" if study.winner is None else f"{introduced}: {study.winner.says(study.winner.attachments[0])}"


def _or_sensor(study: Study, form: Candidate) -> str:
    """Say which sensor's factor would explain as much as the form without a name; empty where none does."""
    said = [c.says(c.attachments[0]) for c in study.candidates if c.plausible and stands_for(c, form)]
    return "; it may as well be that " + ", or that ".join(said) if said else ""


def _one_after_another(effects: Sequence[Mapping[str, Any]]) -> str:
    """Say effects one after another; beside one that the model lacks its structure is not right."""
    only_values = all(e["id"] == "parameter_error" for e in effects)
    said = [str(e["statement"]) for e in effects]
    return "; and ".join(said if only_values else [text.removeprefix(_RIGHT) for text in said])


def _or_values(study: Study, effects: Sequence[Mapping[str, Any]], proof: Proof | None) -> str:
    """Say which other declared values may be the wrong one in place of the one told; empty where none may.

    Of a product of constants only that the product is wrong is known.
    """
    alone = study.winner if study.second is None and proof is study.proof else None
    if alone is None or [e["id"] for e in effects] != ["parameter_error"]:
        return ""
    least = (1 - sum(w for _, w in weighed(study, alone))) / in_force().selection.rarer_odds
    others = [c for c, w in weighed(study, alone) if c.attachments[0].entry == "parameter_error" and w >= least]
    said = [c.says(c.attachments[0]).removeprefix(_RIGHT) for c in others]
    return f", or {', or '.join(said)}: the recording does not tell which" if said else ""


def _little(study: Study, proof: Proof | None) -> str:
    """Say which constants are off by no more than usual beside what was named; empty where none are."""
    chosen = study.second
    if chosen is None or proof is not study.proof or is_slight(chosen):
        return ""
    said = [chosen.says(a).removeprefix(_RIGHT) for a in slight_parts(chosen)]
    return f"; beside that, by no more than is usual, {' and '.join(said)}" if said else ""


def speaks_in_turn(study: Study) -> bool:
    """Tell whether folds say that something is there where the sealed part is silent, and do not come to one name."""
    turned, proof = study.rotation, study.proof
    return turned is not None and proof is not None and turned.speaks and is_silent(proof.interval)


def is_outlived(study: Study) -> bool:
    """Tell whether what was fitted to one part of the data foretells all others so badly that the structure is wrong.

    A hoist that took up a load behind the fit data, 6.4 nats a sample worse, was "the structure is right".
    """
    return study.foretold_worse > in_force().conclusion.outlived_rate


def is_contradicted(study: Study) -> bool:
    """Tell whether parts in turn bear out one effect and another refutes it: that is not nothing.

    All together, and the sealed part refutes it (a sensor's end of range, 1287 nats in five parts, had its limit in a
    wrong place, which lost 132); or most by themselves, and one refutes it (a stop, 70 nats in four of five parts, was
    touched at the other end in the fifth alone, where 700 were lost).
    """
    turned, proof = study.rotation, study.proof
    if turned is None or proof is None:
        return False
    return bool(turned.against) or (turned.proves and proof.interval[1] <= 0)


def _sentence_of_sets(effects: Sequence[Mapping[str, Any]], study: Study, chosen: Candidate) -> str:
    """Say each effect of a set, followed by what may stand in its place."""
    named = parts_that_matter(chosen)
    instead = said_instead(study.alternatives, named)
    parts = []
    for attachment, effect in zip(named, effects, strict=False):
        others = zip(instead, effects[len(named) :], strict=True)
        said = [str(e["statement"]) for a, e in others if a.replaces == attachment.key]
        parts.append(" — or: ".join([str(effect["statement"]), *said]))
    return "; and ".join(parts)


def _late(study: Study) -> str:
    """Say that inputs act late by part of a sample, which a drive may as well do; empty where they do not."""
    late_s = study.prepared.sampling.late_s
    if late_s <= 0:
        return ""
    share = late_s / study.case.records[0].sample_time_s
    return (
        f"; its inputs act {late_s:.3g} s ({share:.2f} samples) late, as a logger, a filter of the outputs or a drive"
        " faster than the sampling has it"
    )


def _not_borne_out(study: Study) -> str:
    """Say what the fit data speak for and the sealed data neither bear out nor refute; empty where there is nothing.

    A drive that saturates may do so twenty times in the fit data (187 nats) and three times in the sealed ones (10).
    """
    found, proof = study.winner, study.proof
    if found is None or proof is None or found.fit_gain < in_force().conclusion.word_nats or proof.gain <= 0:
        return ""
    return (
        f"; but what was fitted speaks, by {found.fit_gain:.0f} nats, for this: {found.says(found.attachments[0])}."
        " The sealed part does not bear it out, nor does it refute it: record longer, or have it happen more often"
    )


def _coloured(study: Study) -> str:
    """Say where the noise has a band that the model does not have; empty where it has none."""
    rules = in_force().conclusion
    found = [c for c in study.candidates if c.undriven and c.score > rules.word_nats and c.select_gain > 0]
    if not found:
        return ""
    band = max(found, key=lambda c: c.score)
    (attachment,) = band.attachments
    frequency = band.values[attachment.key]["frequency_hz"][0]
    where = " and ".join(attachment.location["outputs"])
    return (
        f"; but {where} has a band of noise around {frequency:.3g} Hz that the model lacks and no input drives:"
        " a force that nobody measured, or the sensor's own"
    )


def inputs_rest(records: Sequence[Record], inputs: Sequence[str]) -> bool:
    """Tell whether there are recorded inputs and none of them ever changes; samples that are missing say nothing."""
    series = [r.column(n) for r in records for n in inputs if n in r.names("input")]
    return bool(series) and not any(np.any(np.diff(u[np.isfinite(u)])) for u in series)


def untested(study: Study) -> str:
    """Say why finding nothing means nothing here; empty where it means something."""
    if not any(r.testable for r in study.bank.rows):
        return "The recording does not excite the model enough to test any of the effects."
    prepared, records = study.prepared, study.case.records
    if inputs_rest(records, [s.name for s in prepared.declared.inputs]):
        return "No input of the recording moves: what the inputs do cannot be tested; record with excitation."
    length = _length(study)
    if prepared.fastest * length < 1 and _slower(study):
        return (
            f"The recording of {length:.4g} s is shorter than every time constant of the model, of which the shortest"
            f" is {1 / prepared.fastest:.4g} s: record longer."
        )
    return ""


def _length(study: Study) -> float:
    return sum(len(r) * r.sample_time_s for r in study.case.records)


def _slower(study: Study) -> float:
    """Return the model's slowest time constant in s where the recording is shorter; 0 where it is not.

    Not of identified models, which hold slow poles that mean nothing.
    """
    prepared = study.prepared
    if prepared.linear is not None or prepared.fastest <= 0:
        return 0.0
    slowest = prepared.settle_s / 3
    return slowest if slowest > _length(study) else 0.0


def _slow(study: Study) -> str:
    """Say that what is as slow as the slowest part of the model cannot be told; empty where the recording is longer."""
    if not (slowest := _slower(study)):
        return ""
    return (
        f"; the recording of {_length(study):.4g} s is shorter than the model's slowest time constant of"
        f" {slowest:.4g} s: of what is as slow it tells little"
    )
