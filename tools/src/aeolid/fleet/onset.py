"""Say since when a mode moves, by how much and how certain that is."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.fleet.plan import DAY, EPOCH

Facts = dict[str, Any]
Array = NDArray[np.float64]
LIKELY = 3.84  # rise of χ² within which the onset lies in 95 %
STEPS = 8  # places of an onset between two periods
NOTABLE = 4.0  # deviations a change must have to be named: a page of a hundred modes has none by chance
SHARE = 0.8  # of a turbine's periods a mode must be found in
LIGHT = 0.2  # damping above which a pole is not followed by name: such poles wander with the order


def find_onset(times: Sequence[float], values: Sequence[float], deviations: Sequence[float | None]) -> Facts | None:
    """Fit values that stay until a time and then go along a line; weights 1/σ².

    Returns since, the time it starts, since_low and since_high (95 %), the level before, the change until the last
    value with its deviation (for that onset, enlarged by the scatter where that is more than the σ say), and
    `from_start`: a line all along is as good. None with fewer than five values, no spread of times or an unknown σ.
    Cost: n fits.
    """
    t, y = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    known = [s for s in deviations if s is not None and np.isfinite(s) and s > 0]
    if len(t) < 5 or np.ptp(t) == 0 or len(known) < len(t):
        return None
    weight = 1 / np.asarray(known) ** 2
    places = np.unique(t)[:-1]
    starts = np.interp(np.arange((len(places) - 1) * STEPS + 1) / STEPS, np.arange(len(places)), places)
    fits = [_hinge(t, y, weight, start) for start in starts]
    loss = np.array([fit[0] for fit in fits])
    best = int(np.argmin(loss))
    scale = max(1.0, loss[best] / (len(t) - 3))
    near = np.flatnonzero(loss <= loss[best] + LIKELY * scale)
    from_start = bool(loss[0] <= loss[best] + LIKELY * scale)
    place = 0 if from_start else best
    _, slope, spread, before = fits[place]
    length = float(t.max() - starts[place])
    std = float(np.sqrt(max(1.0, loss[place] / (len(t) - 2)) * spread)) * length
    return {
        "since": float(starts[place]), "since_low": float(starts[near[0]]), "since_high": float(starts[near[-1]]),
        "before": before, "change": slope * length, "change_std": std, "from_start": from_start,
    }  # fmt: skip


def _hinge(t: Array, y: Array, weight: Array, start: float) -> tuple[float, float, float, float]:
    """Return χ², slope, the slope's variance and the level a of a + b max(t − start, 0)."""
    ramp = np.maximum(t - start, 0.0)
    total = float(weight.sum())
    mean, middle = float(weight @ ramp) / total, float(weight @ y) / total
    spread = float(weight @ (ramp - mean) ** 2)
    slope = float(weight @ ((ramp - mean) * (y - middle))) / spread
    rest = y - middle - slope * (ramp - mean)
    return float(weight @ rest**2), slope, 1 / spread, middle - slope * mean


def notable(track: Facts, periods: int) -> bool:
    """Tell whether the change of a track's frequency is to be named; periods: of its turbine."""
    onset, damping = track["frequency_hz"].get("onset"), track["damping"]
    if onset is None or not onset["change_std"] > 0:
        return False
    light = max(abs(damping["first"]), abs(damping["last"])) < LIGHT
    return bool(light and track["periods"] >= SHARE * periods and abs(onset["change"]) > NOTABLE * onset["change_std"])


def say_change(track: Facts) -> str:
    """Return one sentence on the frequency of a track that moved."""
    onset = track["frequency_hz"]["onset"]
    before = onset["before"]
    percent, spread = 100 * onset["change"] / before, 100 * onset["change_std"] / before
    when = "all along" if onset["from_start"] else f"since {_when(onset['since'], track)}"
    bounds = (onset["since_low"], onset["since_high"])
    if not onset["from_start"] and bounds[0] < bounds[1]:
        when += f" (95 %: {_when(bounds[0], track)} to {_when(bounds[1], track)})"
    verb = "falls" if onset["change"] < 0 else "rises"
    size = f"{abs(percent):.2f} ± {spread:.2f} %"
    name = track.get("name") or f"mode {track['track']}"
    return f"{track['turbine']}, {name}: {verb} from {before:.4g} Hz by {size} {when}, {track['periods']} periods"


def _when(time: float, track: Facts) -> str:
    if track["per"] != "day":
        return f"period {time + 1:.0f}"
    seconds = time * DAY
    if seconds < EPOCH:
        return f"day {time:.1f}"
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d")
