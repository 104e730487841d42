"""What recorded signals and identified models are read as."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import rule


@dataclass(frozen=True)
class StructureRules:
    """Hold the numbers of this section; each says what it means."""

    both_ways_share: float = rule(
        0.05, "share", "part of the time that a speed must have either sign for its dry friction to be looked for"
    )
    driven_share: float = rule(
        0.5,
        "share",
        "change of a speed within the first sample after a push, of its largest, from which the push acts on that body",
    )
    one_body_cosine: float = rule(
        0.999, "cosine", "cosine of two outputs' speeds, in typical states, above which they are those of one body"
    )
    one_mode_share: float = rule(
        0.9,
        "share",
        "part of a body's first motion after a push that one mode may have, for its friction to be its own",
    )
