"""When a recording and a simulator's run differ, and which effect is named for it."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import RUN_DECISIONS, rule


@dataclass(frozen=True)
class RunPriorRules:
    """Hold the numbers of this section; each says what it means."""

    lost_nats: float = rule(
        30.0, "nats", "evidence lost from which something separates recording and run", RUN_DECISIONS
    )
    lost_nats_an_output: float = rule(
        10.0, "nats", "evidence lost, for each output, from which something separates recording and run", RUN_DECISIONS
    )
    unsteady_ratio: float = rule(
        1.5,
        "times",
        "evidence lost, over what halves of one side lose under each other, from which something separates the sides",
        RUN_DECISIONS,
    )
    excluded_nats: float = rule(60.0, "nats", "fall of the evidence from which an effect is excluded", RUN_DECISIONS)
    named_nats: float = rule(
        30.0, "nats", "gain on the training data that an effect must have to be named", RUN_DECISIONS
    )
    held_weight: float = rule(
        0.1,
        "weight",
        "weight of the run, with the effect, from which it explains: what remains is no more than nulls show",
        RUN_DECISIONS,
    )
    explained_share: float = rule(
        0.5,
        "share",
        "part of what was lost that an effect may gain instead: what acts between samples leaves a rest in blocks",
        RUN_DECISIONS,
    )
    moved_mode_share: float = rule(
        0.25,
        "share",
        "part of what was lost that a mode which moved may gain instead: what else it does is not told by poles",
        RUN_DECISIONS,
    )
    least_share: float = rule(
        0.1,
        "share",
        "part of what was lost below which the pair is as different as before, whatever the run's weight does",
        RUN_DECISIONS,
    )
    further_share: float = rule(
        0.05, "share", "part of the first effect's gain that a further one must have", RUN_DECISIONS
    )
    rival_share: float = rule(
        0.97, "share", "part of the best gain from which another kind is not told from it", RUN_DECISIONS
    )
    rival_nats: float = rule(
        8.0, "nats", "distance to the best gain within which another kind is not told from it", RUN_DECISIONS
    )
    fault_share: float = rule(
        0.2, "share", "part of what was lost that the best fault of units, names or zeros must explain", RUN_DECISIONS
    )
    floor_ratio: float = rule(
        1.5,
        "times",
        "floor of a recorded output's spectrum, over the run's, from which it is a sensor's noise",
        RUN_DECISIONS,
    )
    unit_slack: float = rule(
        1.5, "times", "how far deviation and level may be from a ratio of units, other wind being blown", RUN_DECISIONS
    )
    sibling_ratio: float = rule(
        4.0,
        "times",
        "squared misfit among the blades of a set, over the least, up to which one is not excluded",
        RUN_DECISIONS,
    )
    richer_nats: float = rule(10.0, "nats", "gain a form must have over a simpler one that it holds", RUN_DECISIONS)
    refined_share: float = rule(
        0.15, "share", "part of the best gain from which a hypothesis is refined", RUN_DECISIONS
    )
    refined_nats: float = rule(3.0, "nats", "least gain of a hypothesis that is refined", RUN_DECISIONS)
    own_load_times: float = rule(
        3.0,
        "times",
        "how often the gain of a load that turns with the rotor must exceed what the runs' own gains there",
        "measured: 27 to 69 nats in 9 of 13 nulls in uniform wind, which gained 0.9 to 2.2 times as much",
    )
    group_nats: float = rule(
        15.0,
        "nats",
        "gain from which a group of outputs tells something alone, or answers on the test data are others",
        RUN_DECISIONS,
    )
    sure_group_nats: float = rule(
        60.0, "nats", "gain that one of the groups must have; a missing mode itself was worth 43 in one", RUN_DECISIONS
    )
    agreeing_ratio: float = rule(
        1.15,
        "times",
        "ratio of the values up to which groups of outputs agree; windows of one output move a lag by some 5 %",
        RUN_DECISIONS,
    )
    agreeing_groups: int = rule(
        2, "count", "groups of outputs that must tell the same beside a missing mode", RUN_DECISIONS
    )
    disc_uneven_log: float = rule(
        1.5,
        "log",
        "growth of the power of a rotor disc's moments about the blades' order, from which the flow is uneven",
        RUN_DECISIONS,
    )
    disc_lines_log: float = rule(
        1.2,
        "log",
        "growth of the power of all outputs about the blades' order, where no blade is recorded, from which the "
        "flow is uneven",
        RUN_DECISIONS,
    )
    disc_parts_log: float = rule(0.8, "log", "growth of that power in every part of the recording", RUN_DECISIONS)
    disc_spread_log: float = rule(
        0.4,
        "log",
        "deviation of that growth between runs of one machine in other wind",
        "measured: -0.7 to 0.5 in 18 pairs",
    )
    worse_share: float = rule(
        0.5, "share", "part of the largest growth of errors from which an output is named beside it", RUN_DECISIONS
    )
    line_log: float = rule(
        1.0,
        "log",
        "growth of the power once a revolution of one load beyond that of another from which it tells the imbalance",
        "measured: tower sideways 4.0 beyond the blades with a heavy blade, 5 below them with a turned one",
    )
    region_distance: float = rule(
        1.0,
        "deviations",
        "distance of means, in the deviation within a run, up to which two runs are one region",
        RUN_DECISIONS,
    )
    level_deviations: float = rule(
        2.0,
        "deviations",
        "distance of an output's mean from 0 from which it has a level: an acceleration has none",
        RUN_DECISIONS,
    )
    law_within_deviations: float = rule(
        2.5,
        "deviations",
        "distance from the run's means up to which a mean of the recording is compared",
        RUN_DECISIONS,
    )
    law_shared: float = rule(0.4, "share", "part of the recording's means that must be so near", RUN_DECISIONS)
    law_means: int = rule(20, "count", "means of the run, and of both, at the least", RUN_DECISIONS)
    law_sure_deviations: float = rule(
        4.5,
        "deviations",
        "deviations by which a level must have shifted",
        "measured: 0.0 to 2.8 in 29 nulls with up to five laws each",
    )
    wind_shift: float = rule(0.01, "share", "least shift of a wind at a given state, of its level", RUN_DECISIONS)
    thrust_shift: float = rule(0.03, "share", "least shift of a thrust, of its level", RUN_DECISIONS)
    cyclic_shift: float = rule(
        0.08,
        "share",
        "least shift of a tilt or yaw moment, of its level",
        "measured: a missing edge mode moves tilt by 0.05",
    )
    wake_shift: float = rule(
        0.3,
        "share",
        "shift of a tilt moment, of its level, from which the wind's profile differs and no wake",
        "measured: 0.10 to 0.12 where the wake's dynamics are missing on three turbines, 0.94 with twice the shear",
    )
    bent_ratio: float = rule(
        2.0,
        "times",
        "growth of the errors of a collective flap moment from which the blade itself moves otherwise",
        RUN_DECISIONS,
    )
    out_of_plane_share: float = rule(
        0.25,
        "share",
        "part by which errors out of the rotor's plane may have grown where a mode in that plane is missing",
        "measured: 0.02 to 0.22 for shafts, edgewise and sideways modes of three turbines, 0.33 and more for actuators",
    )
    thrust_ratio_slack: float = rule(
        0.15, "times", "what the ratio of the shifts of thrust and wind may be off", RUN_DECISIONS
    )
    slowest_turning: float = rule(
        0.4, "share", "least mean speed, of the rated one, that a turbine at work can have", RUN_DECISIONS
    )
    fastest_turning: float = rule(
        1.3, "times", "largest mean speed, of the rated one, that a turbine at work can have", RUN_DECISIONS
    )
    mass_factor: float = rule(
        1.25,
        "times",
        "factor of a tower's motion, or its inverse, up to which it may be another mass as well as a sensor's",
        "measured: 0.954 with a nacelle heavier by 8 %",
    )
    lone_log: float = rule(
        3.5,
        "log",
        "growth of an output's power in one band from which a mode stands out",
        "measured: at most 1.5 in 12 nulls; 3.9 to 12 where a mode of tower or drive train is missing; 3.3 where a "
        "blade's is, which answers tell",
    )
    lone_out_log: float = rule(
        2.5,
        "log",
        "such a growth over that of the other bands: above its first mode a tower that lacks it is quieter everywhere",
        "measured: 2.9 on a floating turbine, 4 to 11 elsewhere where a mode is missing",
    )
    rigid_log: float = rule(
        7.0,
        "log",
        "such a growth from which the run lacks the mode whatever else explains errors: 33 times the amplitude, at "
        "some frequencies and not at others, is no wind, drive or sensor",
        "measured: 12.2 and 22 where a simulated tower is rigid; 1.5 at most in 12 nulls",
    )
    local_log: float = rule(
        0.7,
        "log",
        "growth of an output's power at a mode, over that beside it, from which a mode that the runs lack is said",
        "measured: 1.0 to 3.7 where a mode is missing, 0.45 at most in nulls and other effects",
    )
    local_deviations: float = rule(
        4.0, "deviations", "the same, in deviations of such a growth between spectra of one machine", RUN_DECISIONS
    )
    displaced_log: float = rule(
        1.5,
        "log",
        "growth of an output's power at the recording's mode, and fall at the run's, from which one mode is said to "
        "be at two frequencies",
        "measured: 2.5 and 1.8 on a monopile without the tower's first bending mode; modes of one machine are at one "
        "frequency, so that no null comes to this",
    )
    displaced_ratio: float = rule(
        1.1, "times", "ratio of two frequencies from which they are not one mode's of one machine", RUN_DECISIONS
    )
    flexible_ratio: float = rule(
        1.2,
        "times",
        "ratio of the run's frequency of a tower to the recording's from which bending is left out rather than a "
        "stiffness wrong, which would be by 44 %",
    )
    passing_ratio: float = rule(
        2.0,
        "times",
        "growth at a multiple of the blades' passing, over that at the other multiples, from which it is a mode's",
        RUN_DECISIONS,
    )
    shadow_growth: float = rule(
        1.5,
        "times",
        "growth of the steady line as blades pass, where it grows most, from which a shadow is looked for",
        "measured: 3.1 to 4.5 where the runs lack it, 1.0 beside a lag, a rate limit and sampled turbulence",
    )
    answer_segments: int = rule(
        6, "count", "segments of four revolutions that a part must have for its answers to be compared", RUN_DECISIONS
    )
    answer_gaps: float = rule(
        0.05, "share", "missing samples of a side above which its answers are not compared", RUN_DECISIONS
    )
    habit_samples: float = rule(
        1.3,
        "samples",
        "lateness up to which it is a habit of loggers: half a row of a command that is held, half of a filter against "
        "aliases, a third between clocks",
    )
    late_angle: float = rule(
        0.04,
        "rad",
        "angle of the rotor by which it answers its pitch angle late, from which lift or a blade is late",
        "measured: at most 0.03 in 30 nulls of 600 s and of 300 s",
    )
    late_deviations: float = rule(4.0, "deviations", "deviations by which a rotor must answer late", RUN_DECISIONS)
    bending_angle: float = rule(
        0.15, "rad", "angle by which it answers late from which a blade bends; below, lift builds up", RUN_DECISIONS
    )
    late_bending_fall: float = rule(
        0.5,
        "log",
        "fall of the power of wind's loads between or above a blade's bending modes where it bends",
        "measured: 0.59 to 3.9 on three turbines; 0.46 behind a delay of 0.15 s",
    )
    lift_angle: float = rule(
        0.02,
        "rad",
        "angle by which the rotor answers late from which lift builds up, where quick answers are stronger",
        "measured: 0.046 on the slender blades of 15 MW; theory (Jones 1938) has 0.05 to 0.15",
    )
    lift_deviations: float = rule(
        2.0, "deviations", "deviations that lateness and strength of quick answers must have, each", RUN_DECISIONS
    )
    strong_deviations: float = rule(
        3.0,
        "deviations",
        "deviations by which all answers must be stronger for a wake with its own time",
        "measured: at most 2 in 34 nulls",
    )
    quick_gain: float = rule(
        0.25, "log", "gain of quick answers to the pitch angle from which the flow answers its rate", RUN_DECISIONS
    )
    quick_deviations: float = rule(
        2.5, "deviations", "deviations by which quick answers must be stronger, where slow ones are late", RUN_DECISIONS
    )
    strong_apart: float = rule(
        0.6, "share", "part of that gain up to which the outputs may differ in it: a wake acts on all", RUN_DECISIONS
    )
    bending_swell: float = rule(
        0.7, "log", "growth of the power of wind's loads about a blade's second bending mode", RUN_DECISIONS
    )
    bending_fall: float = rule(
        1.0, "log", "fall of the power of wind's loads above a blade's second bending mode", RUN_DECISIONS
    )
    rest_spread: float = rule(
        0.1, "log", "deviation of the shape of wind's spectrum between runs of one machine", "measured: 30 nulls"
    )
