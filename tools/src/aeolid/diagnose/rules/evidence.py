"""What a gain, a deviation or an interval must be, wherever it is asked: numbers that several rooms share."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import LEVEL, rule


@dataclass(frozen=True)
class EvidenceRules:
    """Hold the numbers of this section; each says what it means."""

    tied_nats: float = rule(
        1.0,
        "nats",
        "log-likelihoods and scores this close are equally good: of fits, of candidates, of the baseline's fit and "
        "the best known one",
    )
    two_deviations_nats: float = rule(
        2.0,
        "nats",
        "what two deviations of one value are worth: a smaller promise is not tried, and a reading of the inputs "
        "may lose as much",
    )
    clear_nats: float = rule(
        20.0,
        "nats",
        "gain on the training data, beyond one nat a parameter or the logarithm of the number of channels' faults that "
        "were asked, that does not come by chance: the validation data then need only not refute it",
        "measured: an effect worth 81 nats gained 7 ± 5 on the validation data",
    )
    validation_nats: float = rule(
        4.0,
        "nats",
        "gain on the validation data that an effect must have, or a further one add: a likelihood ratio of 55",
    )
    proven_nats: float = rule(
        2.0, "nats", "lower end of the gain's interval on the sealed data: odds of seven to one at the worst"
    )
    five_percent_z: float = rule(
        1.64, "deviations", "deviations of its sum by which a gain must exceed none, one-sided", LEVEL
    )
    one_percent_z: float = rule(
        2.33,
        "deviations",
        "deviations of its sum by which a gain must exceed none where more is claimed, one-sided",
        LEVEL,
    )
    moved_deviations: float = rule(
        3.0,
        "deviations",
        "deviations by which a declared value must have moved, two estimates of one differ, or a level have shifted on "
        "the sealed part; data that do not determine it accuse nobody",
    )
    differs_deviations: float = rule(
        2.0, "deviations", "deviations by which the size of an effect must differ from none"
    )
    noise_deviations: float = rule(
        5.0,
        "deviations",
        "deviations of its noise that a reading may be off: so far below zero an absolute value may read, and by so "
        "much a position must come back to have turned",
    )
