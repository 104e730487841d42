"""What is said in the end, and what is worth a word beside it."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import rule


@dataclass(frozen=True)
class ConclusionRules:
    """Hold the numbers of this section; each says what it means."""

    nameless_nats: float = rule(
        4.0, "nats", 'score from which a form without a name still forbids "the structure is right"'
    )
    known_share: float = rule(
        0.05,
        "share",
        "part of itself by which a model's constants may be off, however surely, before they are called wrong: half of "
        "that of a mode's frequency, which goes with the root of a stiffness",
        "measured: 11 of 33 models whose constants are 1 to 3 % off, or one of them more, were told off by 0.6 to 8 % "
        "though nothing else was missing",
    )
    far_factor: float = rule(
        2.0,
        "times",
        "what a declared value is off by, one deviation aside, before the sentence says what may stand behind it",
        "measured: wrong values alone were off by 0.6 to 1.5 times in 11 cases; by 2.5 and 3 in two that lacked more",
    )
    word_nats: float = rule(
        20.0,
        "nats",
        "what is worth a word beside the verdict: the score of a mode that no input drives, the gain on the "
        "training data of what the sealed data do not bear out",
    )
    law_better_share: float = rule(
        0.9,
        "share",
        "part of a law's mean absolute error that may be left, in every fold: a tenth is visible in any plot",
    )
    law_right_share: float = rule(
        0.25, "share", "mean absolute error, of an output's spread, above which the law itself is not right"
    )
    recovered_share: float = rule(
        0.3, "share", "part of what the data would allow below which the name is not the main thing missing"
    )
    recovered_by_parameter: float = rule(
        0.8,
        "share",
        'part of what the data would allow where only values are wrong: "the structure is right" is a claim about '
        "all that is left",
    )
    ceiling_nats: float = rule(10.0, "nats", "gain of a model-free correction below which nothing is worth describing")
    ceiling_rate: float = rule(
        0.02,
        "nats a sample and output",
        "gain of a model-free correction below which nothing is worth describing: one-step errors 2 % smaller",
    )
    colour_share: float = rule(
        0.5,
        "share",
        "part of a model-free correction that goes by past innovations, above which it is the colour of the noise",
    )
    reading_share: float = rule(
        0.5,
        "share",
        "part of a model-free gain that one channel's lateness within a row must have to be the answer",
    )
    outlived_rate: float = rule(
        1.0,
        "nats a sample",
        "by how much worse than the fit data all others are foretold before the structure cannot be right",
        "measured: at most 0.5 on 20 recordings of two other authors that lack nothing, 3 to 7 where something changes "
        "behind the fit data",
    )
    indistinct_correlation: float = rule(
        0.99, "correlation", "correlation of two estimates above which the data hardly tell them apart"
    )
