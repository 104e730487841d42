"""Draw the modes of a fleet: over dates, about their means, and of all turbines beside each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.fleet.onset import LIGHT
from aeolid.fleet.plan import EPOCH
from aeolid.report import charts
from aeolid.report.markup import Html

Facts = dict[str, Any]
Key = str  # what a mode is in every turbine: its name, else its number in the turbine
_PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", charts.INK)
_MARKERS = "osD^vPX"
_MOST_PARK = 8  # modes in the picture of the park
_SAME = 0.1  # relative distance from a mode's median in the park up to which another turbine's is the same


@dataclass(frozen=True)
class Colours:
    """Hold colour and marker of each mode, the same on every turbine."""

    places: Mapping[Key, int]

    def of(self, key: Key) -> tuple[str, str]:
        """Return colour and marker."""
        place = self.places.get(key, len(self.places))
        return _PALETTE[place % len(_PALETTE)], _MARKERS[place % len(_MARKERS)]


@dataclass(frozen=True)
class Clock:
    """Hold where the periods of a turbine stand on the axis, and what it is called."""

    times: NDArray[Any]
    label: str


def clock_of(periods: Sequence[Facts]) -> Clock:
    """Return dates where the recordings have such, else seconds as days, else the number of the period."""
    starts = [float(p["start_s"]) for p in periods]
    if len(set(starts)) < 2:
        return Clock(np.arange(float(len(periods))), "period")
    if min(starts) >= EPOCH:
        dates = [datetime.fromtimestamp(s, UTC).replace(tzinfo=None) for s in starts]
        return Clock(np.array(dates, dtype="datetime64[s]"), "date (UTC)")
    return Clock((np.array(starts) - starts[0]) / 86400.0, f"days since {periods[0]['period']}")


def key_of(mode: Facts) -> Key:
    """Return what a mode is called: its name, its harmonic, else the number of its track."""
    if mode.get("name"):
        return str(mode["name"])
    return f"{mode['rotor_order']}P" if mode.get("rotor_order") else f"mode {mode['track']}"


def keys_of(periods: Sequence[Facts]) -> dict[tuple[str, int], Key]:
    """Return for each track of each turbine what it is called in most periods; one name a turbine once."""
    found: dict[tuple[str, int], Counter[Key]] = {}
    for period in periods:
        for mode in period["modes"]:
            if abs(mode["damping"]) < 1:
                found.setdefault((period["turbine"], mode["track"]), Counter())[key_of(mode)] += 1
    keys: dict[tuple[str, int], Key] = {}
    taken: set[tuple[str, Key]] = set()
    for (turbine, track), counted in sorted(found.items(), key=lambda item: -sum(item[1].values())):
        key = counted.most_common(1)[0][0]
        keys[turbine, track] = f"mode {track}" if (turbine, key) in taken else key
        taken.add((turbine, keys[turbine, track]))
    return keys


def colours_of(periods: Sequence[Facts]) -> Colours:
    """Give each mode a colour, those that most turbines have first."""
    counted = Counter(keys_of(periods).values())
    named = sorted(counted, key=lambda k: (k.startswith("mode "), -counted[k], k))
    return Colours({key: place for place, key in enumerate(named)})


def label_of(track: Facts, periods: Sequence[Facts]) -> Key:
    """Return what a track is called."""
    return keys_of(periods).get((track["turbine"], track["track"]), f"mode {track['track']}")


def newest(tracks: Sequence[Facts], periods: Sequence[Facts]) -> tuple[dict[tuple[str, Key], Facts], list[Key]]:
    """Return the lightly damped modes of each turbine by what they are called, and those that turbines share.

    Modes without a name are one where their frequencies are near: a track's number says nothing of another turbine.
    """
    keys = keys_of(periods)
    light = [t for t in tracks if abs(t["damping"]["last"]) < LIGHT and not t["rotor_order"]]
    last: dict[tuple[str, Key], Facts] = {}
    loose: list[list[Facts]] = []
    for track in sorted(light, key=lambda t: float(t["frequency_hz"]["last"])):
        key = keys.get((track["turbine"], track["track"]), "mode")
        if not key.startswith("mode"):
            last[track["turbine"], key] = track
            continue
        frequency = float(track["frequency_hz"]["last"])
        near = loose[-1] if loose else []
        middle = float(np.median([t["frequency_hz"]["last"] for t in near])) if near else 0.0
        if near and frequency < middle * (1 + _SAME) and all(t["turbine"] != track["turbine"] for t in near):
            near.append(track)
        else:
            loose.append([track])
    for group in loose:
        called = f"near {np.median([t['frequency_hz']['last'] for t in group]):.3g} Hz"
        last |= {(t["turbine"], called): t for t in group}
    count = Counter(key for _, key in last)
    shared = [key for key, n in count.most_common() if n > 1][:_MOST_PARK]
    return last, shared


def _points(periods: Sequence[Facts], key: str, std: str) -> dict[int, list[tuple[int, float, float]]]:
    """Return by track the period's place, value and deviation of each mode that oscillates."""
    tracks: dict[int, list[tuple[int, float, float]]] = {}
    for place, period in enumerate(periods):
        for mode in period["modes"]:
            if abs(mode["damping"]) < 1:
                tracks.setdefault(mode["track"], []).append((place, mode[key], mode[std] or 0.0))
    return tracks


def draw_modes(periods: Sequence[Facts], clock: Clock, colours: Colours) -> Html:
    """Draw frequency and damping of each mode over the periods of a turbine, with bands."""
    keys, turbine = keys_of(periods), periods[0]["turbine"]
    columns = (("frequency_hz", "frequency_std_hz", 1.0, "frequency (Hz)"),
               ("damping", "damping_std", 100.0, "damping (%)"))  # fmt: skip
    with charts.sketch(charts.WIDE, 1, 2) as drawing:
        for axes, (value, std, unit, text) in zip(drawing.axes[0], columns, strict=True):
            for track, points in sorted(_points(periods, value, std).items()):
                places, y, s = (np.array(c) for c in zip(*points, strict=True))
                key = keys[turbine, track]
                _line(axes, clock.times[places], unit * y, unit * 2 * s, colours.of(key), key)
            axes.set_ylabel(text)
            _label(axes, clock)
        if drawing.axes[0, 0].get_legend_handles_labels()[1]:
            drawing.axes[0, 0].legend(fontsize=8, ncols=2)
    return drawing.svg


def _line(axes: Any, t: Any, y: Any, band: Any, style: tuple[str, str], label: str) -> None:
    colour, marker = style
    axes.plot(t, y, color=colour, marker=marker, markersize=3, label=label)
    if len(t) > 1:
        axes.fill_between(t, y - band, y + band, color=colour, alpha=0.2, linewidth=0)
    else:
        axes.errorbar(t, y, band, color=colour, capsize=3)


def _label(axes: Any, clock: Clock) -> None:
    axes.set_xlabel(clock.label)
    if clock.times.dtype.kind == "M":
        from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

        locator: Any = AutoDateLocator(minticks=2, maxticks=7)  # type: ignore[no-untyped-call]
        axes.xaxis.set_major_locator(locator)
        axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]


def draw_changes(periods: Sequence[Facts], clock: Clock, colours: Colours) -> Html | None:
    """Draw how far the frequency of each lasting, lightly damped mode is from its mean: 3 % is nothing in Hz."""
    keys, turbine = keys_of(periods), periods[0]["turbine"]
    light = [p | {"modes": [m for m in p["modes"] if abs(m["damping"]) < LIGHT]} for p in periods]
    tracks = _points(light, "frequency_hz", "frequency_std_hz")
    lasting = {track: points for track, points in tracks.items() if 2 * len(points) > len(periods) > 2}
    if not lasting:
        return None
    with charts.sketch(charts.WIDE) as drawing:
        axes = drawing.axes[0, 0]
        for track, points in sorted(lasting.items()):
            places, y, s = (np.array(c) for c in zip(*points, strict=True))
            mean, key = float(y.mean()), keys[turbine, track]
            label = f"{key}, {mean:.4g} Hz"
            _line(axes, clock.times[places], 100 * (y / mean - 1), 200 * s / mean, colours.of(key), label)
        axes.set_ylabel("frequency, from its mean (%)")
        _label(axes, clock)
        axes.legend(fontsize=8, ncols=3)
    return drawing.svg


def draw_park(
    last: Mapping[tuple[str, Key], Facts], turbines: Sequence[str], names: Sequence[Key], colours: Colours
) -> Html:
    """Draw each shared mode of each turbine against the median of the park, in percent."""
    wide = min(charts.WIDE[0], max(5.0, 1.5 + 0.35 * len(turbines)) if len(turbines) < 8 else charts.WIDE[0])
    with charts.sketch((wide, 3.2)) as drawing:
        axes = drawing.axes[0, 0]
        for offset, name in zip(np.linspace(-0.25, 0.25, max(len(names), 2)), names, strict=False):
            own = [(i, last[t, name]["frequency_hz"]) for i, t in enumerate(turbines) if (t, name) in last]
            middle = float(np.median([f["last"] for _, f in own]))
            colour, marker = colours.of(name)
            spread = [200 * float(f.get("last_std") or 0.0) / middle for _, f in own]
            x, y = [i + offset for i, _ in own], [100 * (f["last"] / middle - 1) for _, f in own]
            style: Facts = {"color": colour, "marker": marker, "linestyle": "none", "markersize": 4, "capsize": 2}
            axes.errorbar(x, y, spread, label=f"{name}, {middle:.4g} Hz", **style)
        axes.axhline(0, color=charts.GREY, linewidth=0.8)
        upright = len(turbines) > 8 or max(map(len, turbines)) > 8
        axes.set_xticks(
            range(len(turbines)), turbines, rotation=60 if upright else 0, ha="right" if upright else "center"
        )
        axes.set_ylabel("frequency, from the park's median (%)")
        axes.legend(fontsize=8, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return drawing.svg
