"""What is said of channels and of a simulator's run before hypotheses are asked."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import rule


@dataclass(frozen=True)
class BaselineRules:
    """Hold the numbers of this section; each says what it means."""

    fault_rate: float = rule(
        0.015,
        "nats a sample and output",
        "gain of a sign, unit or swap: a wrong sign turns what most of a recording shows; 0.02 to 0.4 are usual",
        "measured: faults of a turbine's tower in a loop have 0.017 to 0.051; at 0.01 none of 220 recordings without a "
        "fault is said to have one, since the model must fit better with it put right",
    )
    fault_explained_share: float = rule(
        0.7,
        "share",
        "part of what free weights of inputs gain beyond chance over the wiring as declared that a fault must gain",
    )
    fault_sign_share: float = rule(
        0.15, "share", "part of a sign's gain that must be left over no response at all; a quarter is expected"
    )
    fault_beside_ratio: float = rule(
        1.6, "times", "a factor of units is taken only where one so much larger or smaller gains less"
    )
    level_ratio: float = rule(
        3.0, "times", "by which a unit with another zero must lower the errors of simulations, all outputs together"
    )
    level_error: float = rule(
        0.3, "deviations of the output", "error of a simulation above which a unit with another zero is not told"
    )
    ridge_part: float = rule(
        0.05,
        "share",
        "part of a direction of unit length that moves nothing, from which a free value belongs to it and may be held",
    )
    wind_known_share: float = rule(
        0.9,
        "share",
        "part of what a wind does not foretell of itself that other channels know, from which it is computed from them",
    )
    late_rows: int = rule(2, "rows", "by which one output of several must be late or early for it to be said")
    present_share: float = rule(0.9, "share", "part of a channel that must be there for it to be asked")
    run_samples: int = rule(400, "samples", "least length of a simulator's run, as of a recording")
    wiring_rows: int = rule(200, "rows", "rows of a recording without which its wiring is not asked")
