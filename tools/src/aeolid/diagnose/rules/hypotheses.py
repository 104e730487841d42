"""Where a hypothesis of the catalogue, or a form without a name, may attach."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import rule


@dataclass(frozen=True)
class HypothesesRules:
    """Hold the numbers of this section; each says what it means."""

    side_over_fore_aft: float = rule(
        1.5,
        "times",
        "side-side over fore-aft motion up to which an imbalance is of the air's forces: near once a turn the modes "
        "of one tower may swell one more than the other",
    )
    crossing_share: float = rule(
        0.05, "share", "samples that must lie on either side of zero for a dead zone to mean anything"
    )
    deadband_levels: int = rule(
        4, "count", "sizes besides zero that an input must take for a width to show: two give a gain and a width"
    )
    rounded_spacing: float = rule(
        0.05,
        "share",
        "spacing of a converter that rounds, of the spread: a finer one is far below what any model predicts",
    )
    truncated_spacing: float = rule(
        1e-3,
        "share",
        "spacing of a converter that truncates, of the spread: half of it is a bias, which adds up over a recording",
    )
    rectified_least: float = rule(
        0.02, "share", "how far below zero an absolute value may read at the least, of the range"
    )
    rectified_most: float = rule(
        0.1, "share", "how far below zero an absolute value may read at the most, of the range"
    )
    rectified_touches: float = rule(
        0.05, "share", "lowest value, of the range, up to which an absolute value touches zero"
    )
    rail_distance: float = rule(0.01, "share", "distance, of the recorded range, up to which data reach a rail")
    unit_correlation: float = rule(
        0.5,
        "correlation",
        "correlation with a free run, or against it, from which a factor of units, or a sign, is asked: a fitted "
        "baseline may hide it so well that no score is left",
    )
    unit_tolerance: float = rule(0.1, "share", "a gauge's own tolerance on top of a ratio of units")
    wave_rotor_distance: float = rule(
        0.07, "share", "relative distance to the rotor's speed within which a band may be the rotor's"
    )
    ramp_rows: float = rule(
        0.1,
        "rows",
        "delay of the fastest recorded steps from which a limit of the rate is believed; less is the sampling's",
        "measured: a motor without a limit, told as one of 0.07 rows beside wrong values; limits that were there "
        "1.5 rows and more, once 0.17",
    )
    shaft_pace_share: float = rule(
        0.1,
        "share",
        "of a shaft's speed in the median, by which the rate of a recorded angle may differ to be its angle",
    )
    least_arc_rad: float = rule(
        2.0, "rad", "arc that a shaft must turn for weight on it to be more than a spring and a constant force"
    )
    curve_knots_apart: float = rule(
        0.02,
        "share",
        "distance of two knots of a curve, of the signal's span, below which the signal has but a few values",
    )
    narrow_damping: float = rule(
        0.1,
        "damping ratio",
        "damping up to which a band of noise rings",
        "measured: the colour of noise has 0.35 and more, eddies have 0.02",
    )
    habit_rows: float = rule(0.25, "rows", "lateness below which it is a habit of loggers, and no fault")
    filter_rows: float = rule(
        0.6,
        "rows",
        "lateness of one output below which a logger's filter against aliases explains it: of second order with its "
        "corner at 0.4 of the sampling rate it is 0.56 rows late",
        "measured: ten lags told of 0.29 to 0.45 rows, of a tower's acceleration, none right; right from 0.74 rows on",
    )
    least_band: float = rule(
        1.2, "times", "ratio of the ends of a band of frequencies below which no mode is looked for in it"
    )
    same_frequency: float = rule(
        0.01,
        "share",
        "relative distance of the frequency within which a mode is one that the model has, or only damped otherwise",
    )
    same_damping: float = rule(
        0.1, "share", "relative distance of the damping within which a mode is one that the model has"
    )
    range_end: float = rule(
        0.999, "share", "part of a range's end from which a fitted mode, or a value of a law, stands at it"
    )
    excited_share: float = rule(1e-4, "share", "power of an input, of its largest, above which a frequency is excited")
    mode_variance_share: float = rule(
        1e-3, "share", "part of an output's variance that a mode must move: less is a correction of others"
    )
    nyquist_share: float = rule(
        0.8,
        "share",
        "part of the Nyquist frequency up to which an order of the rotor, or a mode, is looked at: nearer to it a "
        "mode may be the image of a faster one",
    )
    fading_ratio: float = rule(
        0.3,
        "share",
        "size of an output's response at a tenth of the frequency above which it is steady: that of a speed falls "
        "to a tenth",
    )
    signal_values: int = rule(
        20,
        "count",
        "different values from which a channel is a signal: fewer are a test signal's levels, a counter's or those "
        "of a switch, which is always at an end",
    )
    force_reach: float = rule(
        0.1, "share", "part of an output's direction that must lie outside the reach of forces to count"
    )
