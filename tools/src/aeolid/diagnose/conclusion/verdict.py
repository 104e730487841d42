"""Draw the verdict from a study and write it as the diagnosis (S7, S8)."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.simulated_share import is_static
from aeolid.diagnose.candidates.slight import is_slight, parts_that_matter
from aeolid.diagnose.conclusion.declared import (
    also_speaking,
    are_slight,
    habit_ahead,
    mostly_a_reading,
    on_values,
    parameter_effect,
)
from aeolid.diagnose.conclusion.excluded import not_excluded
from aeolid.diagnose.conclusion.next_experiment import next_experiment, weighed
from aeolid.diagnose.conclusion.sealed import recovered_fraction, sealed_part
from aeolid.diagnose.conclusion.sentence import is_contradicted, is_outlived, sentence, speaks_in_turn, untested
from aeolid.diagnose.conclusion.where import where_of
from aeolid.diagnose.deadline import Deadline
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.localise.detect import PAST_INNOVATIONS
from aeolid.diagnose.pipeline import Study
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.selection.exchange import said_instead
from aeolid.diagnose.selection.rivals import is_other, leaves_open, outdone_by, weights_of
from aeolid.diagnose.stats.blocks import block_interval
from aeolid.diagnose.stats.numbers import finite
from aeolid.diagnose.validation.proof import Proof, beyond, is_material
from aeolid.diagnose.validation.rotation import is_silent

Array = NDArray[np.float64]


def diagnose(study: Study) -> dict[str, Any]:
    """Return diagnosis.json: verdict, effects, where, sealed proof, false-alarm figures, what is not excluded."""
    verdict, effects, proof = _decide(study)
    said = sentence(verdict, effects, study, proof)
    if study.deadline.cut_search:
        verdict, said = _cut_short(verdict, said, study.deadline)
    return {
        "schema": 1,
        "title": study.case.title,
        "verdict": verdict,
        "statement": said,
        "effects": effects,
        "beside": _beside(study) if proof is not None and proof is study.proof else None,
        "location": effects[0]["location"] if effects else where_of(study, verdict),
        "sealed": sealed_part(study, proof),
        "rotation": None if study.rotation is None else study.rotation.to_json() | {"decides": _is_turned(study)},
        "false_alarm": {
            "sham_runs": study.sham[0],
            "false_names": study.sham[1],
            "threshold": finite(study.bank.threshold),
        },
        "not_excluded": not_excluded(study, {e["id"] for e in effects}),
        "next_experiment": next_experiment(study, verdict, effects, proof),
        "data_notes": [f.to_json() for f in study.findings if f.left_out],
    }


def _cut_short(verdict: str, said: str, late: Deadline) -> tuple[str, str]:
    """Return verdict and statement of a search that the time limit ended: that nothing is missing was not tried."""
    if verdict in ("no_mismatch", "immaterial"):
        return "not_testable", f"the time limit of {late.limit_s:g} s ended the search before it found anything"
    if verdict == "unnamed":
        tried = f"the time limit of {late.limit_s:g} s ended the search before all of the catalogue was tried on it"
        return verdict, f"Something is missing, and {tried}; nothing that was tried explains it"
    return verdict, f"{said.rstrip('.')} (the time limit of {late.limit_s:g} s ended the search: not all was tried)"


def _beside(study: Study) -> dict[str, Any] | None:
    """Describe the form without a name: what stands beside what was named, or alone where nothing has one."""
    whole = study.completed or study.winner
    form = None if whole is None else next((a for a in whole.attachments if a.entry == unlisted.ID), None)
    if whole is None or form is None:
        return None
    facts = _effect(study, whole, form, [])
    return {k: facts[k] for k in ("statement", "location", "equation", "parameters")}


def shown_proof(study: Study) -> Proof | None:
    """Return the proof that belongs to the verdict: of the named effects, or of the re-fitted declared values."""
    return _decide(study)[2]


def _decide(study: Study) -> tuple[str, list[dict[str, Any]], Proof | None]:
    """Return verdict, effects, and the sealed proof of just these effects (None where nothing is claimed).

    A fault whose samples were left out is the answer where nothing has a name behind it.
    """
    fault = [f for f in study.findings if f.severity == "fault"]
    if any(not f.left_out for f in fault):
        return "data_fault", [], None
    found = _decide_on_rest(study)
    if found[0] == "unnamed" and study.adequate:
        found = _without_what_nobody_sees(study)
    return ("data_fault", [], None) if fault and not found[1] else found


def _without_what_nobody_sees(study: Study) -> tuple[str, list[dict[str, Any]], Proof | None]:
    """Return the answer where what is missing shows nowhere: what declared values are worth saying, or nothing.

    No form without a name stands for these then: with them the model is as right as any need be.
    """
    values = _on_values(study)
    if values is not None and values[0] == "unnamed":
        values = None if are_slight(study) else (*_declared(study), study.declared_proof)
    return values or ("immaterial", [], None)


def _decide_on_rest(study: Study) -> tuple[str, list[dict[str, Any]], Proof | None]:
    """Return the same of what was not left out."""
    rules = in_force().conclusion
    evidence = in_force().evidence
    if study.winner is not None and study.proof is not None and study.proof.interval[0] > evidence.proven_nats:
        if not _shows(study, study.proof) or is_slight(study.second or study.winner) or habit_ahead(study) is not None:
            return _on_values(study) or ("immaterial", [], None)
        if study.winner.unlisted:
            return "unnamed", [], study.proof
        kinds = {a.entry for a in study.winner.attachments}
        needed = rules.recovered_by_parameter if kinds == {"parameter_error"} else rules.recovered_share
        outdone = outdone_by(study.candidates, study.second or study.winner)
        if recovered_fraction(study, study.proof) >= needed and outdone is None:
            return *_named(study, study.winner), study.proof
        return "unnamed", [], None
    if study.winner is not None and _is_turned(study) and outdone_by(study.candidates, study.winner) is None:
        if study.proof is not None and study.proof.worse:  # over the settling time: the sealed part is not silent
            return "unnamed", [], None
        chosen = study.second or study.winner
        if study.proof is not None and (
            not _shows(study, study.proof) or is_slight(chosen) or habit_ahead(study) is not None
        ):
            return _on_values(study) or ("immaterial", [], None)
        return ("unnamed", [], study.proof) if study.winner.unlisted else (*_named(study, study.winner), study.proof)
    if mostly_a_reading(study) is not None:
        return _on_values(study) or ("immaterial", [], None)
    if _can_be_foretold(study) or is_outlived(study):
        return "unnamed", [], None
    if (found := _on_values(study)) is not None:
        return found
    if is_contradicted(study):
        return "unnamed", [], None
    if speaks_in_turn(study) and study.proof is not None and _shows(study, study.proof):
        return *_in_turn(study), None
    if untested(study):
        return "not_testable", [], None
    return "no_mismatch", [], None


def _can_be_foretold(study: Study) -> bool:
    """Tell whether a model-free correction gains on selection and sealed data, surely and by what is worth a word.

    Not where most of it goes by past innovations: that is the noise's colour (gusts on a drone, 71 sealed nats, and a
    geared motor behind a measurement chain, 20, neither of which lacks anything).
    """
    top, rules = study.ceiling, in_force().conclusion
    if dict(top.groups).get(PAST_INNOVATIONS, 0.0) > rules.colour_share:
        return False
    if min(top.select.sum(), top.sealed.sum()) <= rules.ceiling_nats:
        return False
    if min(block_interval(part, study.seed)[0] for part in (top.select, top.sealed)) <= 0:
        return False
    return bool(top.sealed.mean() > rules.ceiling_rate * len(study.prepared.extended.outputs))


def _in_turn(study: Study) -> tuple[str, list[dict[str, Any]]]:
    """Name what several folds came to, where most came to one of a few; nothing where each came to its own."""
    assert study.rotation is not None
    counts = Counter(f.choice.key for f in study.rotation.folds if f.choice is not None)
    several = {key: n for key, n in counts.most_common() if n > 1}
    known = {c.key: c for c in study.candidates if c.plausible and not c.unlisted}
    most = in_force().validation.agreeing_share * len(study.rotation.folds)
    if len(several) < 2 or not several.keys() <= known.keys() or sum(several.values()) < most:
        return "unnamed", []
    parts = [(known[key].attachments[0], known[key], n / sum(several.values())) for key, n in several.items()]
    effects = []
    for place, (attachment, candidate, weight) in enumerate(parts):
        rivals = [_rival(a, w) for a, _, w in parts[1:]] if place == 0 else []
        effects.append(_effect(study, candidate, attachment, rivals, weight))
    return "ambiguous", effects


def _shows(study: Study, proof: Proof) -> bool:
    """Tell whether what is proven shows in a prediction, of the sealed part or of another.

    Beyond what a linear model's constant does alone, where that explains much of it.
    """
    if study.constants is not None:
        return is_material(beyond(proof, study.constants.proof), is_static(study.prepared))
    return is_material(proof, is_static(study.prepared)) or study.shows_elsewhere


def _on_values(study: Study) -> tuple[str, list[dict[str, Any]], Proof | None] | None:
    """Return what the declared values alone are worth saying; None where better ones do not surely and visibly help."""
    proof = study.declared_proof
    if proof is None or proof.interval[0] <= in_force().evidence.proven_nats:
        return None
    said = on_values(study) if is_material(proof, is_static(study.prepared)) else None
    if said == "parameter":
        return *_declared(study), proof
    return None if said is None else (said, [], None)


def _is_turned(study: Study) -> bool:
    """Tell whether rotation decides: the sealed part is silent, all parts in turn bear out what is named."""
    if study.proof is None or study.rotation is None:
        return False
    return is_silent(study.proof.interval) and study.rotation.proves


def _declared(study: Study) -> tuple[str, list[dict[str, Any]]]:
    """Accuse declared values; beside them the best effect that speaks, where one does, and then neither weighs more.

    The fit speaks for the effect and the sealed data for the values: no odds are to be had from that.
    """
    effect, others = parameter_effect(study), also_speaking(study)[:1]
    if not others:
        return "parameter", [effect]
    other = _effect(study, others[0], others[0].attachments[0], [], 0.5)
    return "ambiguous", [effect | {"weight": 0.5, "rivals": [_rival(others[0].attachments[0], 0.5)]}, other]


def _rival(attachment: Attachment, weight: float) -> dict[str, Any]:
    return {"id": attachment.entry, "entry": attachment.location["entry"], "weight": weight}


def _named(study: Study, winner: Candidate) -> tuple[str, list[dict[str, Any]]]:
    if study.second is not None:
        return _several(study, study.second)
    rivals = weighed(study, winner)
    listed = [_rival(c.attachments[0], w) for c, w in rivals]
    shown = study.completed or winner
    effects = [_effect(study, shown, winner.attachments[0], listed, 1 - sum(w for _, w in rivals))]
    said = [(c, w) for c, w in rivals if leaves_open(winner, c, w)]
    if any(is_other(c, winner) for c, _ in said):
        effects += [_effect(study, c, c.attachments[0], [], w) for c, w in said]
        return "ambiguous", effects
    return entry(winner.attachments[0].entry).verdict, effects


def _several(study: Study, chosen: Candidate) -> tuple[str, list[dict[str, Any]]]:
    """Name a set of effects; where another may stand in the place of one, both are said and nothing is decided.

    Constants that are off by no more than usual beside an effect are told with it, and have no name.
    """
    named = parts_that_matter(chosen)
    ids = {a.key: a.entry for a in named}
    instead = said_instead(study.alternatives, named)
    weights = weights_of([chosen, *(a.candidate for a in instead)])
    others = list(zip(instead, weights[1:], strict=True))
    effects, shown = [], study.completed or chosen
    for attachment in named:
        rivals = [_rival(a.attachment, w) for a, w in others if a.replaces == attachment.key]
        effects.append(_effect(study, shown, attachment, rivals, weights[0]))
    if any(a.attachment.entry != ids[a.replaces] for a in instead):
        return "ambiguous", effects + [_effect(study, a.candidate, a.attachment, [], w) for a, w in others]
    kinds = {entry(e["id"]).verdict for e in effects}
    return "multiple" if len(effects) > 1 and kinds != {"parameter"} else entry(effects[0]["id"]).verdict, effects


def _effect(
    study: Study, candidate: Candidate, attachment: Attachment, rivals: list[dict[str, Any]], weight: float = 1.0
) -> dict[str, Any]:
    kind = entry(attachment.entry)
    values = candidate.values[attachment.key]
    units = {s.label: s.unit for s in attachment.slots if s.label}
    location = dict(attachment.location)
    if "frequency_hz" in values:
        f, std = values["frequency_hz"]
        half = max(0.1 * f, 2 * min(std, f))
        location["frequency_hz"] = [max(f - half, 0.0), f + half]
    if "time_s" in values:
        t, std = values["time_s"]
        location["time_s"] = [t - 2 * std, t + 2 * std] if np.isfinite(std) else [t, t]
    return {
        "id": attachment.entry,
        "family": kind.family,
        "statement": candidate.says(attachment),
        "location": location,
        "equation": attachment.equation or kind.equation,
        "parameters": {k: {"value": finite(v), "std": finite(s), "unit": units[k]} for k, (v, s) in values.items()},
        "rivals": rivals,
        "weight": weight,
        "sealed_gain_share": None if study.proof is None else recovered_fraction(study, study.proof),
    }
