"""Say how late what a filter passes on comes, and what is too little for a recording to be of the machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from aeolid.diagnose.rules import in_force

LATE = ("data_time_offset", "transport_delay", "actuator_lag")  # what the instants of rows may be, too
FILTERED = ("sensor_lag", "sensor_second_order")  # what a logger's own filter against aliases may be


def lateness(values: Mapping[str, float]) -> float:
    """Return the delay in s, at low frequencies, of a lag, a dead time, an offset of clocks or a second-order filter.

    values: by label, of one hypothesis: tau_s, delay_s, offset_s (of either sign) or omega_rad_s with damping.
    Without any of them it is infinite: nothing is known of it.
    """
    for label in ("tau_s", "delay_s", "offset_s"):
        if label in values:
            return abs(values[label])
    return 2 * values.get("damping", 1.0) / values["omega_rad_s"] if "omega_rad_s" in values else math.inf


def most_of_a_reading(entry: str) -> float:
    """Return the rows up to which the way of taking samples makes a channel late; entry: of what is said of it."""
    rules = in_force().hypotheses
    return rules.filter_rows if entry in FILTERED else rules.habit_rows


def later_than_a_reading(step: float, entry: str = "") -> Callable[[Mapping[str, float]], str]:
    """Return what objects to a filter of one channel that is later by less than a quarter of a row of `step` s.

    A row has one time, its channels have their own: a converter takes them one after the other, a counter averages, a
    simulation's equations are solved in steps. With little noise thousandths of a row are told with certainty (an
    engine's speed, half of its own steps ahead of its angle: 0.018 rows, named as a filter); they are no physics.
    Of an output 0.6 rows are none: before its converter every good logger has a filter against aliases.
    """

    def credible(values: Mapping[str, float]) -> str:
        rows = lateness(values) / step
        if rows >= most_of_a_reading(entry):
            return ""
        return f"a delay of {rows:.2g} samples, less than what the sampling alone can cause"

    return credible
