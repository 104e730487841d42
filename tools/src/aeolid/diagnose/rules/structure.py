"""What recorded signals and identified models are read as."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import rule


@dataclass(frozen=True)
class StructureRules:
    """Hold the numbers of this section; each says what it means."""

    velocity_correlation: float = rule(
        0.8, "correlation", "correlation from which a recorded velocity is that of a recorded position"
    )
    unit_factor_distance: float = rule(
        0.05,
        "share",
        "distance from one up to which a recorded velocity is in the unit of its position's: noise on the position "
        "takes a few percent",
    )
    derivative_noise: float = rule(
        0.01,
        "share",
        "noise that a derivative may have, of the velocity's spread; whitened, its high frequencies count most",
    )
    turned_deviations: float = rule(
        4.0, "deviations", "deviations of the noise by which a position must come back to have turned"
    )
    turned_share: float = rule(
        1e-3, "share", "part of the position's deviation by which it must come back to have turned"
    )
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
    least_modulus: float = rule(
        0.2,
        "modulus",
        "eigenvalue of an identified model above which it is a mode or a store, and not the memory of a sample",
    )
