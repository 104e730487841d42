"""Check what was asked for, once for all methods: recordings, windows, order, feedthrough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.errors import UsageError
from aeolid.identify.order import CRITERIA
from aeolid.identify.result import Settings
from aeolid.identify.streamed import StreamedMarkov
from aeolid.record import Record

CONTRASTS = ("none", "apart", "always")


def require_some(records: Sequence[Record]) -> None:
    """Refuse an empty experiment set."""
    if not records:
        raise UsageError("at least one recording is needed")


def check_windows(records: Sequence[Record], past: int, future: int | None, order: int | None) -> int:
    """Return the future window, default the past one; raises UsageError on windows or an order that cannot be."""
    require_some(records)
    if past < 1:
        raise UsageError(f"past window {past} is not at least 1")
    chosen = past if future is None else future
    if not 1 <= chosen <= past:
        raise UsageError(f"future window {chosen} is not within 1 … past window {past}")
    largest = chosen * len(records[0].names("output"))
    if order is not None and not 1 <= order <= max(largest, 1):
        raise UsageError(f"order {order} is not within 1 … {largest} (future window times outputs)")
    return chosen


def check_feedthrough(records: Sequence[Record], feedthrough: Sequence[str], role: str = "input") -> tuple[str, ...]:
    """Return the channels with feedthrough; raises UsageError on one that does not have the role."""
    have = records[0].names(role)
    unknown = [n for n in feedthrough if n not in have]
    if unknown:
        raise UsageError(f"feedthrough of {unknown[0]!r}: no such {role}; the {role}s are {', '.join(have)}")
    return tuple(feedthrough)


def make_settings(
    method: str, records: Sequence[Record], past: int, future: int | None, order: int | None,
    feedthrough: Sequence[str], regularization: str | float, markov: StreamedMarkov | None, decimation: int,
    stable: bool,
) -> Settings:  # fmt: skip
    """Check what was asked for; raises UsageError that names the option, DataError where `markov` does not fit."""
    chosen = check_windows(records, past, future, order)
    through = check_feedthrough(records, feedthrough)
    if markov is not None:
        markov.require_match(records, method, past, feedthrough, decimation)
    source = None if markov is None else markov.source
    return Settings(method, past, chosen, order, through, regularization, decimation, stable, source)


def with_choices(
    settings: Settings, refined: bool, order_criterion: str, contrast: str = "none", reference: str | None = None
) -> Settings:
    """Return the settings with the way to the order and to the final numbers; raises UsageError on what cannot be."""
    if order_criterion not in CRITERIA:
        raise UsageError(f"order criterion {order_criterion!r} is none of {', '.join(CRITERIA)}")
    if contrast not in CONTRASTS:
        raise UsageError(f"contrast {contrast!r} is none of {', '.join(CONTRASTS)}")
    if refined and settings.uncertainty == "bootstrap":
        raise UsageError("a bootstrap repeats the subspace estimate, not its refinement; leave one of them out")
    return replace(settings, refined=refined, order_criterion=order_criterion, contrast=contrast, reference=reference)
