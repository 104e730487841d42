"""Say since when a mode moves, by how much and how certain that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.fleet.plan import DAY, EPOCH
from aeolid.wording import counted, plus_minus

Facts = dict[str, Any]
Array = NDArray[np.float64]
LIKELY = 3.84  # rise of χ² within which the onset lies in 95 %
STEPS = 8  # places of an onset between two periods
LEAST = 5  # values, each with its deviation, without which there is no onset
NOTABLE = 4.0  # deviations a change must have to be named: one mode in 16,000 has that by chance, for one onset
DOUBTED = 2.0  # times as much as told modes may scatter where too few periods can show it
SHOWN = 12  # degrees of freedom that show it: twice the scatter passes for what is told in 0.4 % of the modes
SHARE = 0.8  # of a turbine's periods a mode must be found in
LIGHT = 0.2  # damping above which a pole is not followed by name: such poles wander with the order


def find_onset(times: Sequence[float], values: Sequence[float], deviations: Sequence[float | None]) -> Facts | None:
    """Fit values that stay until a time and then go along a line; weights 1/σ².

    Returns since, the time it starts, since_low and since_high (95 %), the level before, the change until the last
    value with its deviation (for that onset, enlarged by the scatter where that is more than the σ say), and
    `from_start`: a line all along is as good; periods: values with a known σ, the others are left out; needed: so many
    deviations a change must have to be more than chance. None with fewer than five or no spread of times. Cost: n fits.
    """
    t, y, sigma = with_deviation(times, values, deviations)
    if len(t) < LEAST or np.ptp(t) == 0:
        return None
    weight = 1 / sigma**2
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
    scatter = float(loss[place] / (len(t) - 3))
    std = float(np.sqrt(max(1.0, scatter) * spread)) * length
    needed = _needed(scatter, len(t) - 3, len(starts))
    return {
        "since": float(starts[place]), "since_low": float(starts[near[0]]), "since_high": float(starts[near[-1]]),
        "before": before, "change": slope * length, "change_std": std, "from_start": from_start,
        "periods": len(t), "needed": needed,
    }  # fmt: skip


def with_deviation(
    times: Sequence[float], values: Sequence[float], deviations: Sequence[float | None]
) -> tuple[Array, Array, Array]:
    """Return times, values and deviations where the deviation is a number above 0."""
    sigma = np.array([np.nan if s is None else s for s in deviations], dtype=float)
    known = np.isfinite(sigma) & (sigma > 0)
    return np.asarray(times, dtype=float)[known], np.asarray(values, dtype=float)[known], sigma[known]


def _needed(scatter: float, freedom: int, tried: int) -> float:
    """Return the deviations needed, where those told may be too small and the onset is the best of many.

    Where the scatter enlarges them: Student's t of so many degrees of freedom at the level that NOTABLE has of a
    Gaussian, shared among the onsets tried (Bonferroni's bound). With few degrees of freedom that is out of reach, and
    a scatter as told shows nothing: then DOUBTED times NOTABLE, which holds for modes that scatter by so much.
    """
    if scatter <= 1 and freedom >= SHOWN:
        return NOTABLE
    from scipy.stats import norm, t  # half a second to load

    return min(DOUBTED * NOTABLE, max(NOTABLE, float(t.isf(norm.sf(NOTABLE) / tried, freedom))))


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
    if not _testable(track, periods):
        return False
    onset = track["frequency_hz"]["onset"]
    return bool(abs(onset["change"]) > onset["needed"] * onset["change_std"])


def _testable(track: Facts, periods: int) -> bool:
    """Tell whether a track is one whose change would be named."""
    onset, damping = track["frequency_hz"].get("onset"), track["damping"]
    if onset is None or not onset["change_std"] > 0:
        return False
    light = max(abs(damping["first"]), abs(damping["last"])) < LIGHT
    return bool(light and track["periods"] >= SHARE * periods)


def untested(tracks: Sequence[Facts], count: Mapping[str, int]) -> list[str]:
    """Say of which turbines no mode could be tested, and why; count: periods of each turbine."""
    told = []
    for turbine, periods in sorted(count.items()):
        own = [t for t in tracks if t["turbine"] == turbine]
        if any(_testable(t, periods) for t in own):
            continue
        most = max((t["periods"] for t in own), default=0)
        why = f"{counted(periods, 'period')}, {LEAST} are needed"
        if periods >= LEAST:
            why = f"no lightly damped mode has a deviation in {LEAST} and is there in most of {periods} periods"
            why += f" (the one found most is in {most})"
        told.append(f"{turbine}: not tested: {why}")
    return told


def conclusions(facts: Facts) -> list[str]:
    """Say which modes moved, that none did, and what could not be tested."""
    left = list(facts.get("untested", []))
    said = list(facts.get("moved", []))
    if not said and len(left) < facts.get("turbines", 1):
        said.append("no mode moved by more than chance")
    return said + left


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
    size = f"{plus_minus(abs(percent), spread)} %"
    name = track.get("name") or f"mode {track['track']}"
    return (
        f"{track['turbine']}, {name}: {verb} from {before:.4g} Hz by {size} {when}, "
        f"{counted(track['periods'], 'period')}"
    )


def _when(time: float, track: Facts) -> str:
    if track["per"] != "day":
        return f"period {time + 1:.0f}"
    seconds = time * DAY
    if seconds < EPOCH:
        return f"day {time:.1f}"
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d")
