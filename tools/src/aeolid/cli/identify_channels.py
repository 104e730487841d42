"""Read what `identify` is asked about single channels: angles, delays, and what the other method says of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.errors import UsageError

if TYPE_CHECKING:
    from aeolid.record import Record

DELAYED = ("varx", "varmax", "fir")


@dataclass(frozen=True)
class Turned:
    """Hold the angles whose cosine and sine took their place, and a sentence for each."""

    angles: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def turn_angles(
    records: list[Record], asked: list[str] | None, scheduled: dict[str, Any], markov: Path | None
) -> tuple[list[Record], Turned]:
    """Return the recordings with angles as cosine and sine; in the options of scheduled models they are renamed.

    A stream of Markov parameters belongs to the channels as they are: with one only what is asked for is split.
    """
    from aeolid.models.angles import renamed, split_angles

    alone = None if asked is None or asked == ["auto"] else asked
    if asked == ["none"] or (alone is None and markov is not None):
        return records, Turned()
    records, angles, notes = split_angles(records, alone, scheduled.get("scheduling", ()))
    if "scheduling" in scheduled:
        scheduled["scheduling"] = renamed(scheduled["scheduling"], angles)
    return records, Turned(angles, notes)


def read_delay(asked: list[str] | None, method: str, markov: Path | None) -> Any:
    """Return what --delay says, auto where nothing is said and the method has delays; None for none."""
    fit = method in DELAYED and markov is None
    if asked is None:
        return "auto" if fit else None
    from aeolid.identify.delay import read_delays

    delays = read_delays(asked)
    if delays is not None and not fit:
        what = "--markov, whose windows know of no delay" if markov is not None else f"--method {method}"
        raise UsageError(f"--delay is for --method varx, varmax and fir on recordings; leave it out with {what}")
    return delays


def of_parts(names: Sequence[str] | None, turned: Turned) -> Sequence[str] | None:
    """Return channels with each angle replaced by its two parts, None for None."""
    from aeolid.models.angles import renamed

    return None if names is None else renamed(names, turned.angles)


def say_rival(method: str, records: list[Record], result: Any) -> tuple[str, ...]:
    """Return what is to be said of varx beside ort, whose work it does better on most recordings; else nothing."""
    if method != "ort":
        return ()
    from aeolid.identify.ort.compare import compare_with_varx

    return (compare_with_varx(records, result),)
