"""Which explanation is taken, which ones stay beside it, and when there is more than one effect."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import rule


@dataclass(frozen=True)
class SelectionRules:
    """Hold the numbers of this section; each says what it means."""

    coloured_noise_nats: float = rule(
        20.0,
        "nats",
        "gain on training and validation data beside a narrow band of noise, beyond what its parameters must gain",
    )
    half_limit_share: float = rule(
        0.5, "share", "part of the score's limit from which kin of what leads, and forms that complete it, are fitted"
    )
    lasting_rate: float = rule(
        0.1,
        "nats a sample",
        "by which the validation data must be foretold worse than the training data, at the lower end of the interval, "
        "before the data are divided otherwise",
    )
    vuong_z: float = rule(2.0, "deviations", "Vuong's z below which two models are not told apart")
    told_apart_nats: float = rule(
        2.995732273553991, "nats", "gain that tells two models apart, however evenly it comes: odds of 20 to 1"
    )
    rarer_odds: float = rule(
        10.0, "odds", "how much more often a declared value is wrong than the factor of a calibrated sensor"
    )
    coincidence_odds: float = rule(
        10.0, "odds", "how much rarer it is that one declared value more is wrong, and by just so much that it fits"
    )
    far_off_ratio: float = rule(
        4 / 3, "times", "factor of a sensor, or its inverse, that is more than a calibrated one is off"
    )
    damped_filter: float = rule(0.5, "damping ratio", "damping of filters at the least; Butterworth's have 0.7")
    critical_damping: float = rule(1.0, "damping ratio", "damping from which a filter of second order is two lags")
    outdone_nats: float = rule(
        10.0, "nats", "lead by which a refused explanation takes the name from the best allowed one"
    )
    put_right_share: float = rule(
        0.5,
        "share",
        "part of its distance to which a declared value must fall for another explanation to make it right",
    )
    most_effects: int = rule(3, "count", "effects in one model at the most")
    further_share: float = rule(
        0.1, "share", "part of the gain so far that a further effect must add to be worth a name"
    )
    beyond_doubt_nats: float = rule(
        50.0, "nats", "gain on the training data that a further effect must have where the validation data are silent"
    )
    nearly_share: float = rule(
        0.5, "share", "part of the first effect's gain that one alone must reach to be tried beside it at any score"
    )
