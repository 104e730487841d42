"""Which modes of a recording and of a simulator's run are compared, and which of them are one."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import RUN_DECISIONS, rule


@dataclass(frozen=True)
class RunModesRules:
    """Hold the numbers of this section; each says what it means."""

    sharp_damping: float = rule(0.1, "damping ratio", "most damping of a mode that is compared", RUN_DECISIONS)
    sharp_spread: float = rule(
        0.01, "share", "most deviation of the frequency, relative, of a mode that is compared", RUN_DECISIONS
    )
    partner_damping: float = rule(
        0.3,
        "damping ratio",
        "most damping of a mode that another one is compared with; more is a transient that a shorter window holds",
        RUN_DECISIONS,
    )
    same_distance: float = rule(0.06, "share", "relative distance within which modes are one", RUN_DECISIONS)
    same_cosine: float = rule(0.6, "cosine", "cosine between the outputs' shares of modes that are one", RUN_DECISIONS)
    passing_distance: float = rule(
        0.03,
        "share",
        "distance from a multiple of the rotor's, of a frequency, within which it is no mode that a kind has already",
        RUN_DECISIONS,
    )
    shown_share: float = rule(
        0.5,
        "share",
        "part of a mode's largest share in an output from which another output shows it, too",
        RUN_DECISIONS,
    )
    named_growth: float = rule(
        1.2, "times", "growth of its output's errors from which a missing mode that has a name is said", RUN_DECISIONS
    )
    whirl_distance: float = rule(
        0.06,
        "share",
        "distance from twice the rotor's speed within which two modes are a pair of edgewise whirl modes",
        RUN_DECISIONS,
    )
    shown_growth: float = rule(
        1.5, "times", "growth of the errors from which a missing mode without a name is said", RUN_DECISIONS
    )
    shown_growth_share: float = rule(
        0.5,
        "share",
        "part of the largest growth that the output of a missing mode must have",
        RUN_DECISIONS,
    )
    movable_damping: float = rule(0.15, "damping ratio", "most damping of a mode that may move", RUN_DECISIONS)
    loose_damping: float = rule(
        0.3, "damping ratio", "damping from which the model of another rate does not hold the mode", RUN_DECISIONS
    )
    movable_spread: float = rule(
        0.03, "share", "most deviation of the frequency, relative, of a mode that may move", RUN_DECISIONS
    )
    movable_growth_share: float = rule(
        0.2,
        "share",
        "part of the largest growth of an output's errors that the output which shows a mode most must have",
        RUN_DECISIONS,
    )
