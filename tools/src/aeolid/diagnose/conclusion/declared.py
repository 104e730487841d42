"""Say which declared values the recording contradicts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.moved import Moved, moved_in
from aeolid.diagnose.candidates.race import whispering
from aeolid.diagnose.candidates.simulated_share import is_static
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.base import location
from aeolid.diagnose.hypotheses.parts.lateness import LATE, lateness
from aeolid.diagnose.pipeline import Study
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.selection.rivals import late_ahead, late_by_a_reading, rivals_of
from aeolid.diagnose.stats.numbers import finite
from aeolid.diagnose.validation.proof import Proof, is_adequate, is_material
from aeolid.diagnose.validation.rotation import is_silent
from aeolid.diagnose.validation.unsure_reading import is_within_reading


def moved(study: Study) -> list[Moved]:
    """Return the re-fitted declared values, the surest move first; at least one."""
    return moved_in(study.prepared.declared, study.unsealed.extended, study.unsealed.fit)


def contradicted(study: Study) -> bool:
    """Tell whether declared values moved surely, and none of them to the end of its range."""
    evidence = in_force().evidence
    values = moved(study)
    return values[0].deviations > evidence.moved_deviations and not any(
        m.at_end for m in values if m.deviations > evidence.moved_deviations
    )


def are_slight(study: Study) -> bool:
    """Tell whether every declared value that moved surely is off by no more than a model's constants usually are.

    One that constants beside it can make right, off by as little, is not off: a tower's damping 13 % too large by 3.2
    deviations, where that of the air is eight times as large and known to 2 %.
    """
    evidence, known = in_force().evidence, in_force().conclusion.known_share
    sure = {m.parameter.name for m in moved(study) if m.deviations > evidence.moved_deviations}
    return all(
        m.distance <= known * abs(m.parameter.value) or m.deviations <= evidence.moved_deviations
        for m in study.declared_values if m.parameter.name in sure
    )  # fmt: skip


def off_by_little(study: Study) -> str:
    """Write the declared values that are off by little; where one is so only beside others, that these share it."""
    evidence, known = in_force().evidence, in_force().conclusion.known_share
    far = any(
        m.distance > known * abs(m.parameter.value) for m in moved(study) if m.deviations > evidence.moved_deviations
    )
    if not far:
        return f"declared values are surely off, but by little: {told_values(study)}"
    return f"declared values are surely off: {told_values(study)}, or several by no more than constants usually are"


def habit_ahead(study: Study) -> Candidate | None:
    """Return the part of a row by which a channel is late that explains far more than what would be named.

    Or what would be named itself, or what is not told from it, where that is a lateness that the rows of a simulator's
    run and of a recording have of each other: a run holds what a logger filters (0.6 rows early, 120 sealed nats, were
    a clock; 1.2 rows late a drive of second order). Of a model only what would be named: a pump 0.3 rows late, told as
    a lag, a drive, a dead time and a clock, each with twice its size for its deviation.
    """
    named = study.second or study.winner
    if named is None:
        return None
    row_s = study.prepared.site.row_step
    if study.prepared.surrogate is not None:
        told: list[Candidate] = [named, *(rivals_of(study.candidates, named) if len(named.attachments) == 1 else ())]
        if (reading := next((c for c in told if _is_reading(c, row_s)), None)) is not None:
            return reading
    elif is_within_reading(study.prepared, named):
        return named
    return late_ahead(study.candidates, named, row_s)


def mostly_a_reading(study: Study) -> Candidate | None:
    """Return the part of a row by which one channel is late, where that is most of what anything explains.

    A tower's acceleration behind a filter against aliases, 0.3 rows late: 130 nats, where past inputs, outputs and all
    found besides gain fewer; the complete model was `unnamed`. Not against a simulator's run.
    """
    if not study.candidates or study.prepared.surrogate is not None:
        return None
    late = late_by_a_reading(study.candidates, study.prepared.site.row_step)
    best = max(late, key=lambda c: c.score, default=None)
    if best is None or (study.winner is not None and best.score <= study.winner.score):
        return None
    needed = in_force().conclusion.reading_share * max(float(study.ceiling.select.sum()), 0.0)
    return best if min(best.score, best.select_gain) > max(needed, in_force().evidence.clear_nats) else None


def _is_reading(candidate: Candidate, row_s: float) -> bool:
    """Tell whether all that a candidate says is late by no more than rows of a run and of a recording are."""
    most, own = in_force().run_prior.habit_samples * row_s, candidate.attachments
    told = [{n: v for n, (v, _) in candidate.values[a.key].items()} for a in own if a.entry in LATE]
    return len(told) == len(own) and all(lateness(values) <= most for values in told)


def also_speaking(study: Study) -> list[Candidate]:
    """Return effects that fit better, for what their parameters cost, though they were not proven, best first.

    Only those that make the declared values right again: values that move may be stand-ins for an effect (a drag of
    10 nats bent two stiffnesses and a friction; beside it, all were as declared). Where a stiffness stays 50 deviations
    off beside the effect, it is wrong whatever else there is. That something is there the values tell; which of two
    tells it better is no question of a threshold against chance among all entries. And the leader, where the sealed
    data speak for it, if too softly for a proof, or are silent and the folds come to it: a second heater's warmth, 33
    nats, 5 (−2 to 13) on the sealed ones and 17 in all five folds, which all chose it, stood behind four values that
    were as wrong beside it. No leader where the right values leave no error that matters: dry friction of a damper,
    0.27 N, stood beside a stiffness a third too high, after which 0.8 % of the force's spread was left.
    """
    soft = study.proof is not None and _speaks_softly(study, study.proof)
    leader = study.winner if soft and not _leave_little(study) else None
    heard = {r.attachment.key for r in (*study.bank.loud, *whispering(study.bank))}
    usual = _usual(study)
    found = [
        c for c in study.candidates
        if c.plausible and not c.unlisted and c.key in heard and min(c.fit_gain, c.score) > 0
        and c.attachments[0].entry != "parameter_error" and not is_within_reading(study.prepared, c)
        and (explains_away(c, usual) or (leader is not None and c.key == leader.key))
    ]  # fmt: skip
    return sorted(found, key=lambda c: -c.score)


def _leave_little(study: Study) -> bool:
    """Tell whether better declared values leave no error that matters."""
    return study.declared_proof is not None and is_adequate(study.declared_proof)


def _speaks_softly(study: Study, proof: Proof) -> bool:
    """Tell whether sealed data or folds speak for what leads, too softly for a proof; by folds it must show, too."""
    if proof.interval[0] > 0:
        return True
    turned, least = study.rotation, in_force().evidence.validation_nats
    folds = turned is not None and turned.agrees and turned.gain > least and is_silent(proof.interval)
    return folds and is_material(proof, is_static(study.prepared))


def form_speaking(study: Study) -> Candidate | None:
    """Return the form outside the catalogue that speaks as an effect would: values that moved may be its stand-ins.

    One that leads and that the sealed data neither prove nor refute (heat that is radiated, 65 nats on the fit data, 10
    on the sealed ones, −3 to 21, made a loss four times too large); or one that makes the declared values right again
    (a spring that relaxes, 21 nats on the fit data, 2 on the selection data, made stiffness and damping too large), if
    no entry of the catalogue does so as well: what has a name is told (a level's sensor that reads 2.3 % too much, 20.6
    nats, stood behind a form of 20.4).
    """
    rules = in_force().conclusion
    winner = study.winner
    if winner is not None and winner.unlisted and study.proof is not None and study.proof.gain > 0:
        return winner
    forms = [c for c in study.candidates if c.unlisted and c.plausible and c.complete and c.score > rules.nameless_nats]
    found = [c for c in forms if min(c.fit_gain, c.select_gain) > 0 and explains_away(c)]
    if not found:
        return None
    best = max(found, key=lambda c: c.score)
    named = max((c.score for c in also_speaking(study) if explains_away(c)), default=-np.inf)
    return None if named > best.score - in_force().evidence.tied_nats else best


def on_values(study: Study) -> str | None:
    """Return the verdict where better declared values surely and visibly predict better; None where none moved so.

    Values that are off by little are the answer nobody needs, but for an effect beside which they are right: they may
    be its stand-ins. One that leads and leaves them off is told with them where they are off by more.
    """
    if not contradicted(study):
        return None
    if form_speaking(study) is not None:
        return "unnamed"
    right_again = any(explains_away(c, _usual(study)) for c in also_speaking(study))
    return "immaterial" if are_slight(study) and not right_again else "parameter"


def explains_away(candidate: Candidate, usual: float = 0.0) -> bool:
    """Tell whether beside the effect no declared value is surely another by more than a share of itself.

    usual: that share, by which a model's constants are mostly off; for values that are off by more without the effect.
    Beside a dry friction a damping was right again that was twice as large without it, but a stiffness stayed 2 % off.
    """
    most = in_force().evidence.moved_deviations
    return all(m.deviations <= most or m.distance <= usual * abs(m.parameter.value) for m in candidate.moved)


def _usual(study: Study) -> float:
    """Return by which share of themselves values may stay off beside an effect: none where all are off by little."""
    return 0.0 if are_slight(study) else in_force().conclusion.known_share


def told_values(study: Study) -> str:
    """Write the three declared values that moved most surely: what each is, and what it was declared as."""
    sure = [m for m in moved(study) if m.deviations > in_force().evidence.moved_deviations][:3]
    return ", ".join(
        f"{m.parameter.name} {m.value:.4g} instead of {m.parameter.value:.4g} {m.parameter.unit}".strip() for m in sure
    )


def far_off(values: Sequence[Moved]) -> str:
    """Say of values that are off by a large factor that they may stand for something else; empty where none is.

    A cell's voltage that goes on after the charge has passed made the slope of its rest voltage three times too large,
    and an end stop a spring 2.5 times too stiff.
    """
    evidence, factor = in_force().evidence, in_force().conclusion.far_factor
    sure = [m for m in values if m.deviations > evidence.moved_deviations]
    far = [m for m in sure if _is_beyond(factor, m)]
    if not far:
        return ""
    names = " and ".join(m.parameter.name for m in far[:2])
    return (
        f"; {names} {'are' if len(far) > 1 else 'is'} off by more than a factor of {factor:g}, behind which something"
        " that the model leaves out may stand as well"
    )


def _is_beyond(factor: float, m: Moved) -> bool:
    """Tell whether a value is off by more than a factor, though it be one deviation nearer; in another sign it is."""
    ratio = m.value / m.parameter.value if m.parameter.value else np.inf
    slack = m.std / abs(m.parameter.value) if m.parameter.value else np.inf
    return bool(np.isfinite(ratio) and (ratio - slack > factor or ratio + slack < 1 / factor))


def parameter_effect(study: Study) -> dict[str, Any]:
    """Return the effect "declared values are wrong" with what those were fitted to that moved surely."""
    sure = {m.parameter.name for m in moved(study) if m.deviations > in_force().evidence.moved_deviations}
    values = [m for m in study.declared_values if m.parameter.name in sure] or study.declared_values[:1]
    kind = entry("parameter_error")
    return {
        "id": kind.id, "family": kind.family,
        "statement": f"the structure is right, declared values are not: {told_values(study)}{far_off(moved(study))}",
        "location": location(f"parameter:{values[0].parameter.name}"),
        "equation": kind.equation,
        "parameters": {
            m.parameter.name: {"value": m.value, "std": finite(m.std), "unit": m.parameter.unit} for m in values
        },
        "rivals": [], "weight": 1.0,
    }  # fmt: skip
