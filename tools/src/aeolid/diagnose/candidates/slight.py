"""Say which effects of a set are a linear model's constants, off by no more than a model's constants usually are."""

from __future__ import annotations

from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.rules import in_force


def slight_parts(candidate: Candidate) -> tuple[Attachment, ...]:
    """Return what of a set is a constant of a linear model that is off by that little; a mass beside others only."""
    known = in_force().conclusion.known_share
    most = {"gain_change": known, "damping_change": known, "frequency_change": known / 2}
    if len(candidate.attachments) > 1:  # alone it may be ice; beside a gain it is one more constant
        most["mass_ratio"] = known
    constants = ("parameter_error", "added_mass")
    return tuple(
        a for a in candidate.attachments
        if a.entry in constants and all(abs(v) <= most.get(n, -1.0) for n, (v, _) in candidate.values[a.key].items())
    )  # fmt: skip


def is_slight(candidate: Candidate) -> bool:
    """Tell whether a set is nothing but constants that are off by that little."""
    return len(slight_parts(candidate)) == len(candidate.attachments)


def parts_that_matter(candidate: Candidate) -> tuple[Attachment, ...]:
    """Return what of a set is more than such a constant; all of it where nothing is."""
    little = slight_parts(candidate)
    return tuple(a for a in candidate.attachments if a not in little) or candidate.attachments
