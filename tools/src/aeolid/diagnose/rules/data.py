"""What is said of recordings before anything is estimated: faults of channels, standstills, strays, sampling."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import rule


@dataclass(frozen=True)
class DataRules:
    """Hold the numbers of this section; each says what it means."""

    stuck_share: float = rule(
        0.2,
        "share",
        "samples of an output that are stuck, from which that is the answer where nothing else is found behind it",
    )
    rail_share: float = rule(0.005, "share", "samples at an extreme, from which the range ends there")
    rail_run: int = rule(5, "samples", "samples in a row, once at least, at an extreme where the range ends")
    fine_share: float = rule(0.9, "share", "different values from which a channel is finely resolved")
    fine_repeats: int = rule(
        3, "count", "times that the extreme of a finely resolved channel comes, from which the range ends there"
    )
    crowded_chance: float = rule(
        1e-2,
        "probability",
        "that chance alone reaches an extreme as often, below which the range ends there: what follows is a fit, which "
        "has to prove it",
        "measured: none of 1,000 ends of coloured noise with 8 to 14 bits, 726 of 1,000 that are cut ten times each",
    )
    pile_width: float = rule(
        0.005, "share", "width of a pile at the end of the range that noise has blurred, of the range"
    )
    pile_share: float = rule(0.02, "share", "samples in a pile at the end of the range that noise has blurred")
    pile_ratio: float = rule(
        2.6,
        "ratio",
        "samples within some width of an extreme over those next to it, from which a range may end there under noise: "
        "a sine and a parabola have 2.4",
    )
    grid_miss: float = rule(0.01, "share", "part of a step by which rounding of the numbers themselves may miss a grid")
    grid_distinct_share: float = rule(
        0.2, "share", "different values above which the values of a channel are not said to be a spacing apart"
    )
    coarse_spacing_share: float = rule(0.02, "share", "spacing of values, of their spread, from which it is reported")
    held_share: float = rule(
        0.5,
        "share",
        "changes that must bring another value, and keep the usual pace, for a channel to be that of a slower logger",
    )
    missing_share: float = rule(
        0.5, "share", "samples missing, or reading a code for a missing value, above which a channel is faulty"
    )
    bridged_rows: int = rule(
        10,
        "rows",
        "samples in a row up to which a gap in a channel that the model does not use is bridged: sampling is chosen so "
        "that what matters takes longer",
    )
    compared_rows: int = rule(
        50,
        "rows",
        "rows that two series, recorded or simulated, must have in common to be compared, or a fold for a law without "
        "states",
    )
    recognised_correlation: float = rule(
        0.8,
        "correlation",
        "correlation with a free run from which a channel is recognised, and a velocity as that of a recorded position",
    )
    swapped_lead: float = rule(0.3, "correlation", "by how much the correlation of swapped channels must stand out")
    unit_ratio: float = rule(
        3.0, "times", "factor from which a channel is in another unit: no tolerance of a gain is that large"
    )
    known_ratio_distance: float = rule(
        0.03, "share", "relative distance at which a known ratio of units is said, or that there is none"
    )
    folded_below: float = rule(0.01, "share", "how far below zero an absolute value may read, of the range")
    folded_above: float = rule(
        0.03, "share", "how far above zero the lowest value of a folded channel may lie, of the range"
    )
    folded_near: float = rule(0.05, "share", "what counts as near zero for a folded channel, of the range")
    folded_visits: int = rule(3, "count", "times that a folded channel comes near zero, at the least")
    folded_inside: float = rule(0.4, "share", "samples near zero above which a channel rests there rather than turns")
    offset_prior: float = rule(
        0.5,
        "samples",
        "deviation of an offset in time: loggers differ by half a sample as a rule; a dead time beside it is then "
        "the dead time's",
    )
    repeats_share: float = rule(0.5, "share", "samples equal to the one before, from which an input is held")
    rough_from: float = rule(
        0.75, "share", "part of the Nyquist frequency beyond which the power of an input is looked at"
    )
    rough_share: float = rule(
        0.05, "share", "power beyond that frequency above which an input is rough; white noise has five times as much"
    )
    settled_samples: int = rule(
        60, "samples", "length below which a stretch cannot settle a state and still say something"
    )
    fewest_samples: int = rule(
        20,
        "samples",
        "least length of a stretch where recordings have no longer ones, and rows with a measurement without which one "
        "of several recordings is not used: a start and little more, with wide bands",
    )
    remembered_samples: int = rule(
        20_000,
        "samples",
        "inputs before a stretch that what lies before the plant may remember: a valve that sticks keeps its place "
        "until the command has moved far enough; the bound keeps recordings of many stretches quick",
    )
    whole_recordings: int = rule(
        3,
        "count",
        "number of recordings above which parts are whole recordings: one of so many for validation, the others for "
        "training",
    )
    kept_share: float = rule(
        0.8,
        "share",
        "samples in usable stretches, of those at the recordings' own rate, that predictions over several samples must "
        "keep: lost rows cut the recordings, and longer predictions need longer stretches",
    )
    standstill_samples: int = rule(
        20, "samples", "equal samples in a row of a channel that else never repeats: noise does not, to the last digit"
    )
    hung_samples: int = rule(
        10, "samples", "equal samples in a row, at least, that do not come by chance in a channel as fine as it is"
    )
    repeated_chance: float = rule(
        1e-4, "probability", "chance, a recording, that a channel repeats one value for as long by its resolution alone"
    )
    coarse_standstill_samples: int = rule(
        50, "samples", "equal samples in a row of a channel whose values are so coarse that they repeat anyhow"
    )
    coarse_standstill_share: float = rule(
        0.2, "share", "part of the recording that such a channel must repeat one value"
    )
    alive_share: float = rule(
        0.01, "share", "samples equal to their predecessor elsewhere, up to which a channel is never quite still"
    )
    moves_share: float = rule(
        0.05, "share", "what the model must move, of a channel's deviation, for the channel to have to move"
    )
    rests_share: float = rule(
        1e-3, "share", "what the model may move, of a channel's deviation, where the machine stands"
    )
    jump_ratio: float = rule(
        2.5, "times", "step out of a standstill in ordinary steps: no machine that starts to move does that"
    )
    ordinary_quantile: float = rule(0.95, "share", "quantile of a channel's steps that is an ordinary one")
    end_distance: float = rule(0.02, "share", "distance, of the deviation, as good as zero, or as the end of the range")
    steppy_share: float = rule(0.3, "share", "ordinary step, of the deviation, above which a jump shows nothing")
    sustained_samples: int = rule(5, "samples", "samples for which an input must be sustained to move a machine")
    left_often: int = rule(
        3, "count", "times that a machine must have left where it stood for a standstill to be doubted"
    )
    arriving_samples: int = rule(
        5, "samples", "samples before a standstill that are looked at: what comes to rest slows"
    )
    slow_ratio: float = rule(0.25, "share", "steps before a standstill, in ordinary ones, below which a machine slows")
    stray_spreads: float = rule(
        30.0, "spreads", "robust spreads from the median: no signal of a machine goes there for one sample"
    )
    dropped_fewest: int = rule(
        5, "count", "samples of one value, far from their neighbours, from which they are dropouts"
    )
    dropped_longest: int = rule(
        3, "count", "samples in a row up to which they are dropouts and no sensor that is stuck"
    )
    dropped_times: float = rule(3.0, "times", "how often that value must come, over the next most frequent one")
    dropped_leap: float = rule(
        10.0, "times", "distance of a dropout from its neighbours, over that of an ordinary sample from its own"
    )
    stray_share: float = rule(1e-3, "share", "part of the samples so far off from which they are no strays")
