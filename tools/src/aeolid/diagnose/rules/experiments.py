"""When another recording is worth proposing."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import rule


@dataclass(frozen=True)
class ExperimentsRules:
    """Hold the numbers of this section; each says what it means."""

    finer_ratio: float = rule(
        1.25, "times", "median ratio by which detectable sizes must shrink: less is not worth another recording"
    )
    most_finer_ratio: float = rule(
        8.0, "times", "a size smaller by more counts for no more, and so much counts what could not be tested at all"
    )
    decided_nats: float = rule(6.0, "nats", "evidence an experiment must bring: odds of 400 to 1")
    most_minutes: float = rule(240.0, "minutes", "what nobody would record for the sake of a name")
