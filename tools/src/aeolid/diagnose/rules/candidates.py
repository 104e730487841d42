"""Which hypotheses are fitted, how long, and which fitted values can be an effect."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import LEVEL, rule


@dataclass(frozen=True)
class CandidatesRules:
    """Hold the numbers of this section; each says what it means."""

    run_gain_ratio: float = rule(
        2.0, "times", "gain a sample on the recording that an effect must have, over that on the simulator's own run"
    )
    material_share: float = rule(0.02, "share", "part of itself that a declared value must be off to be called wrong")
    mute_ranges: float = rule(
        10.0, "ranges", "deviation of a value, in its ranges, that says that the data do not know it"
    )
    undetermined_range: float = rule(
        0.3,
        "share",
        "deviation of a shape, of its range (an even spread over all of it has 0.29), above which it may be anywhere",
    )
    ramp_share: float = rule(
        1e-3, "share", "part of a change's squares that comes before it: the ramp that stands for the step"
    )
    form_share: float = rule(0.01, "share", "part of an effect's size by which real machines differ from its equation")
    constant_share: float = rule(
        0.02,
        "share",
        "deviation of a constant that the model does not set free: constants of machines are 1 to 3 % off",
    )
    driven_deviations: float = rule(
        4.5,
        "deviations",
        "deviations of what drives a mode: the 10 nats by which a name must be ahead of another",
        "measured: eddies beside a sensor's filter that was missing were driven by 3.4",
    )
    alone_level: float = rule(
        0.01, "chance", "chance of a score that high, of one entry for itself, up to which it is fitted", LEVEL
    )
    far_share: float = rule(
        0.1,
        "share",
        "part of the leader's gain below which a hypothesis is out of the race, if it is far behind, too",
        "measured: brief fits of a simulator's run reached at least a quarter of what full fits gain",
    )
    far_nats: float = rule(
        200.0, "nats", "distance behind the leader, or below the baseline, from which a hypothesis is out of the race"
    )
    ridge_nats: float = rule(0.25, "nats", "fits this close are the same, with values that the data leave open")
    jump_span: float = rule(
        0.15,
        "share",
        "of a value on which the answer depends in jumps, how far around a fit it is looked for, and its square once "
        "more: 24 values over the range lie 19 % apart",
    )
    rugged_share: float = rule(
        0.3,
        "share",
        "part of the best brief fit's gain from which an effect with many optima is begun from the simulation, too",
        "measured: a gear's play had 0.68 to 1.0 of it, one step ahead",
    )
    jump_values: int = rule(129, "count", "values looked at over each of these spans")
    alike_cos2: float = rule(
        0.9, "cos²", "overlap from which two hypotheses must both be fitted: the score cannot tell them apart"
    )
    latest_samples: float = rule(
        0.95,
        "samples",
        "what a command may be late by (0.88 was told as 0.92): a longer lag is fitted best by more",
    )
    late_share: float = rule(
        0.9,
        "share",
        "part of a filter's gain that a lateness alone must have where the filter is as slow as it may be",
        "measured: 0.94 and 0.98 of two chains of converters beside a play and a range",
    )
    offset_beyond_samples: float = rule(
        1.5, "samples", "an offset that is likelier there than within one sample is no habit of a logger"
    )
    offset_moved_samples: float = rule(
        0.1, "samples", "distance by which an offset beside an effect is another than that of the baseline alone"
    )
    line_share: float = rule(
        0.5,
        "share",
        "part of an input's power in one line, above which a mode there is not told from a bend of that input's answer",
    )
    feedback_left_share: float = rule(
        0.25,
        "share",
        "part of what innovations tell of inputs: where less is left under another reading, it was no feedback",
    )
    loud_sizes: float = rule(
        0.3, "sizes", "process noise that a sample brings above which it stands in for what is missing"
    )
    loud_force_sizes: float = rule(
        10.0,
        "sizes",
        "amplitude of a force with a memory, in sizes of what it acts against, above which it stands in for what is "
        "missing",
        "measured: at 0.39 and 0.62 a thermocouple's lag gained 0.3 nats, 180 from a quiet start",
    )
