"""Put what is received into words: numbers with their deviations, times, clocks."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aeolid.can.clock import ClockFit
    from aeolid.identify.live import LiveMode

MOST_MODES = 8  # named of one node
WIDE = 1.959964  # standard deviations on either side that hold 95 % of a Gaussian


def clock_facts(fit: ClockFit) -> dict[str, Any]:
    """Return the facts of a clock."""
    return {
        "utc_of_sample_0": datetime.fromtimestamp(fit.start_utc, UTC).isoformat(timespec="microseconds"),
        "real_time": fit.is_real_time,
        "drift_ppm": fit.drift_ppm,
        "drift_half_width_ppm": fit.half_width_ppm,
        "scatter_s": fit.scatter_s,
        "span_s": fit.span_s,
    }


def harmonics_text(modes: Sequence[LiveMode]) -> str:
    """List the harmonics of the rotor and steady sines among modes, empty where there are none."""
    found = [m.mode for m in modes if m.is_harmonic][:MOST_MODES]
    return ", ".join(f"{m.frequency_hz:.4g} Hz" + (f" ({m.name})" if m.name else "") for m in found)


def range_95(value: float, deviation: float | None) -> str:
    """Write the interval that holds 95 %, as sharp as `plus_minus`; empty where the deviation is not known."""
    if deviation is None or not deviation > 0:
        return ""
    digits = min(max(1 - math.floor(math.log10(deviation)), 0), 6)
    return f"{value - WIDE * deviation:.{digits}f} … {value + WIDE * deviation:.{digits}f}"


def times(count: int) -> str:
    """Say how often."""
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def drift_text(clock: dict[str, Any]) -> str:
    """Say in words how the controller's clock runs."""
    drift, half = clock["drift_ppm"], clock["drift_half_width_ppm"]
    if drift is None or half is None:
        return "too short to tell how its clock drifts"
    if not clock["real_time"]:
        pace = 1.0 / max(1.0 + 1e-6 * drift, 1e-9)
        how = f"{pace:.3g} s of the controller in a second" if pace < 1e5 else "faster than can be told"
        return f"not in real time: {how}"
    if half > abs(drift):
        return f"its clock and the host's agree within {_short(abs(drift) + half)} ppm"
    return f"its clock is {'slow' if drift > 0 else 'fast'} by {_short(abs(drift), half)} ± {_short(half)} ppm"


def _short(number: float, error: float | None = None) -> str:
    """Write a number with two digits of its error, or of itself."""
    size = abs(number if error is None else error)
    digits = 1 - math.floor(math.log10(size)) if size > 0 else 0
    return f"{number:.{min(max(digits, 0), 6)}f}"


def duration(seconds: float) -> str:
    """Write a time of whole seconds."""
    whole = int(seconds)
    if whole < 120:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"
