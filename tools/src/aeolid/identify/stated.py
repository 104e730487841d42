"""Read what an identification said of itself from the model file that it wrote."""

from __future__ import annotations

import json
from pathlib import Path


def stated_doubt(path: str | Path) -> str | None:
    """Return why the deviations of an identified model do not hold, empty where they do; None where nothing is said.

    path: of any model; only a model.json that `identify` wrote says it. Raises nothing: reading the model does.
    """
    try:
        own = json.loads(Path(path).read_text(encoding="utf-8"))["identification"]
        holds, reason = own["bands_hold"], own["bands_reason"]
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None
    return "" if holds is True else str(reason)


def stated_windows(facts: object) -> float | None:
    """Return how many windows an identified model was estimated from; None where its facts do not say."""
    windows = facts.get("windows") if isinstance(facts, dict) else None
    return float(windows) if isinstance(windows, int | float) and windows > 0 else None
