"""Say which effects of a set are no larger than usual: a linear model's constants, and what loggers are late by."""

from __future__ import annotations

from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.rules import in_force


def slight_parts(candidate: Candidate) -> tuple[Attachment, ...]:
    """Return what of a set is a constant of a linear model that is off by that little; a mass beside others only.

    And beside others a common offset of all inputs that is too small for a name: by less than a row.
    """
    beside = len(candidate.attachments) > 1
    known = in_force().conclusion.known_share
    most = {"gain_change": known, "damping_change": known, "frequency_change": known / 2}
    if beside:  # alone it may be ice; beside a gain it is one more constant
        most["mass_ratio"] = known
    constants = ("parameter_error", "added_mass")
    return tuple(
        a for a in candidate.attachments
        if (a.entry in constants and all(abs(v) <= most.get(n, -1.0) for n, (v, _) in candidate.values[a.key].items()))
        or (a.entry == "data_time_offset" and beside and not is_worth_a_name_beside(candidate, a))
    )  # fmt: skip


def is_worth_a_name_beside(candidate: Candidate, part: Attachment) -> bool:
    """Tell whether a part of a set is as large as it must be to have a name beside another effect."""

    def size(name: str) -> float:
        return abs(float(candidate.fit.point.theta[candidate.predictor.compiled.model.index(name)]))

    return all(size(name) >= least for name, least in part.beside.items())


def is_slight(candidate: Candidate) -> bool:
    """Tell whether a set is nothing but such parts."""
    return len(slight_parts(candidate)) == len(candidate.attachments)


def parts_that_matter(candidate: Candidate) -> tuple[Attachment, ...]:
    """Return what of a set is more than that; all of it where nothing is."""
    little = slight_parts(candidate)
    return tuple(a for a in candidate.attachments if a not in little) or candidate.attachments
