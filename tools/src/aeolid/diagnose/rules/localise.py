"""When a map says where the model errs, and on which data it is asked at all."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import LEVEL, rule


@dataclass(frozen=True)
class LocaliseRules:
    """Hold the numbers of this section; each says what it means."""

    false_alarm_level: float = rule(
        0.01, "chance", "false-alarm level of each map, and of each question to the equations, as a whole", LEVEL
    )
    stretch_samples: int = rule(48, "samples", "least length of a stretch of time in a map")
    fewest_bins: int = rule(3, "count", "edges of bins up to which no map over a channel is drawn")
    bin_samples: int = rule(5, "samples", "samples in each bin of a map, or of the rotor's angle: fewer make no mean")
    fewest_pieces: int = rule(8, "count", "pieces of the recording whose phases are compared, at the least")
    spectrum_rows: int = rule(64, "rows", "rows of one spectrum at the least")
    material_ratio: float = rule(
        1.1,
        "times",
        "power over the power expected, or its inverse, from which it is worth a mark: with the excitation as "
        "recorded hardly anything is chance",
    )
    slow_share: float = rule(
        0.1, "share", "part of an input's variance that its slow part must hold to be an operating point"
    )
    spread_share: float = rule(
        0.5, "share", "part of all stretches or bins above which what they show is nowhere in particular"
    )
    rows_a_weight: int = rule(10, "rows", "rows for each weight of a controller, without which none is looked for")
    least_lags: int = rule(16, "count", "lags without which no map of paths is drawn")
    tail_ratio: float = rule(
        2.5,
        "times",
        "by what the level is divided for maps of paths: loud stretches that both channels have mark too many",
        "measured: 2.5 % of 1000",
    )
