"""Take lengths of time as values of options: 600, 600s, 10min, 1h."""

from __future__ import annotations

import typer

from aeolid.durations import read_duration


def seconds_of(value: str | float) -> float:
    """Return the seconds of an option's value, a number where it is a default; raises BadParameter, a usage error."""
    seconds = float(value) if isinstance(value, int | float) else read_duration(value)
    if seconds is None:
        raise typer.BadParameter(f"{value!r} is no length of time; write seconds, or a unit: 600, 600s, 10min, 1h.")
    return seconds
