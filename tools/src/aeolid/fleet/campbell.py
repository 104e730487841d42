"""Follow the modes of a turbine over recordings at different winds: the Campbell diagram by outputs alone.

Each recording is analysed by itself (`identify.modal`), blades in the fixed frame. From one recording to the next, in
the order of the wind or else of the rotor's speed, modes are one where the continuous-time pole s and the shape agree:
|Δs|/|s| + (1 − MAC)/2 is least in sum (`tracking`). A whirling mode is held against others in the frame of the blades,
s ∓ iΩ, where it moves little with the rotor's speed; one of the other sense is never the same.

Multiples of the rotor's speed are no modes: those of one recording are told by its rotor (`identify.harmonics`), and
what stays on one line of the blades' passing in most recordings is that line.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError, UsageError
from aeolid.fleet.tracking import FARTHEST, LEAST_MAC, follow, mac
from aeolid.formats.meanings import meaning_of
from aeolid.identify.choose_past import read_past
from aeolid.identify.modal import Modal, find_modal
from aeolid.identify.rotor import Rotation, rotation
from aeolid.models.blade_sets import in_fixed_frame
from aeolid.models.fill_values import told_with, without_fill_values
from aeolid.models.modes import Mode, continuous_poles, is_widened
from aeolid.record import Record
from aeolid.wording import plus_minus

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
ORDERS = (1, 3, 6, 9)  # lines of the rotor that are drawn
HIGHEST = 12  # P; up to there the rate is kept: tower, drive train and first blade modes lie below
ON_A_LINE = 0.025  # relative distance to a line of the blades' passing, within which a mode may be that line
DAMPED = 0.3  # beyond which a swing is no mode to follow
LEAST_RUNS = 2
_CELL = 17  # letters, at least, of a column of the table


@dataclass(frozen=True, eq=False)
class Run:
    """Hold what one recording tells: its modal analysis, how its rotor turns, its mean wind in m/s where recorded."""

    source: str
    modal: Modal
    turning: Rotation
    wind_m_s: float | None

    def to_json(self) -> dict[str, Any]:
        """Return the facts of the recording."""
        d = self.modal.diagram
        return {
            **self.modal.sources[0], "wind_m_s": self.wind_m_s, "rotor_hz": self.turning.frequency_hz,
            "rotor_deviation_hz": self.turning.deviation_hz, "outputs": list(d.outputs),
            "sample_time_s": d.sample_time_s, "past": d.past, "order": d.order,
            "harmonics": [m.to_json() for m in self.modal.modes if m not in self.modal.listed],
            "notes": list(self.modal.notes),
        }  # fmt: skip


@dataclass(frozen=True)
class Track:
    """Hold one mode over the recordings: its name, and its values in each, None where it was not found there."""

    name: str
    modes: tuple[Mode | None, ...]

    @property
    def found(self) -> tuple[Mode, ...]:
        """Return the values that there are."""
        return tuple(m for m in self.modes if m is not None)

    def to_json(self) -> dict[str, Any]:
        """Return the track as JSON facts."""
        return {"name": self.name, "modes": [None if m is None else m.to_json() for m in self.modes]}


@dataclass(frozen=True, eq=False)
class Campbell:
    """Hold the modes of several recordings, followed.

    runs: in the order of the wind, or of the rotor's speed; tracks: modes of two recordings or more, by frequency;
    single: those of one; lines: what stays on a multiple of the rotor's speed, and is no mode.
    """

    runs: tuple[Run, ...]
    tracks: tuple[Track, ...]
    single: tuple[Track, ...]
    lines: tuple[Track, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the facts for machines."""
        return {
            "runs": [r.to_json() for r in self.runs], "orders": list(ORDERS),
            "tracks": [t.to_json() for t in self.tracks], "single": [t.to_json() for t in self.single],
            "lines": [t.to_json() for t in self.lines],
        }  # fmt: skip

    def summary(self) -> str:
        """Return the table as text: a column a recording, frequency in Hz with one deviation, damping below."""
        heads = [_head(r) for r in self.runs]
        width = max([len(t.name) for t in self.tracks] + [4])
        rows = [("", heads), ("1P", [_of_rotor(r) for r in self.runs])]
        for track in self.tracks:
            rows += [(track.name, list(map(_hertz, track.modes))), ("", list(map(_damping, track.modes)))]
        wide = max(_CELL, *(len(cell) for _, cells in rows for cell in cells))
        lines = [f"  {name:{width}s}  " + "  ".join(f"{cell:>{wide}s}" for cell in cells) for name, cells in rows]
        if not self.tracks:
            lines.append("  no mode was found in two recordings; record longer, or lower the rate (--decimate)")
        for what, some in (("found in one recording only", self.single), ("on a line of the rotor", self.lines)):
            if some:
                told = (f"{t.name or 'unnamed'} near {np.mean([m.frequency_hz for m in t.found]):.4g} Hz" for t in some)
                lines.append(f"{what}: {'; '.join(told)}")
        return "\n".join([*lines, *(note for r in self.runs for note in r.modal.notes)])


def _head(run: Run) -> str:
    return f"{60 * run.turning.frequency_hz:.4g} rpm" if run.wind_m_s is None else f"{run.wind_m_s:.3g} m/s"


def _of_rotor(run: Run) -> str:
    return plus_minus(run.turning.frequency_hz, run.turning.deviation_hz)


def _hertz(mode: Mode | None) -> str:
    if mode is None:
        return "–"
    return plus_minus(mode.frequency_hz, mode.frequency_std_hz)


def _damping(mode: Mode | None) -> str:
    if mode is None:
        return ""
    return f"{plus_minus(100 * mode.damping, None if mode.damping_std is None else 100 * mode.damping_std)} %"


def find_campbell(
    records: Sequence[Record], *, outputs: Sequence[str] | str | None = None,
    blades: Sequence[str] | str | None = None, past: int | str | None = None, largest: int | None = None,
    decimation: int | None = None,
) -> Campbell:  # fmt: skip
    """Find the modes of each recording by its outputs alone and follow them.

    records: one a wind speed. outputs: names, default all of the role; blades: sets, as in `blade_sets.find_sets`;
    past: window in samples or as `read_past` takes it, seconds being other samples in each recording; largest: order of
    the diagrams, both by default by the data; decimation: factor by which the rate
    is lowered, default so that HIGHEST times the fastest rotor's speed stays below Nyquist. Raises UsageError on fewer
    than two recordings, DataError where a rotor's speed is not recorded, else as `find_modal`. Cost: that of
    `find_modal` for each recording.
    """
    if len(records) < LEAST_RUNS:
        raise UsageError("a Campbell diagram takes two recordings or more, at different winds; aeolid modes takes one")
    known = [without_fill_values([r]) for r in records]
    records = [record for (record,), _ in known]
    turning = [_turning(r) for r in records]
    factor, runs = decimation_of(records) if decimation is None else decimation, []
    for record, turns, (_, notes) in zip(records, turning, known, strict=True):
        with told_with(notes):
            still = in_fixed_frame([record], blades)
            window = None if past is None else read_past(str(past), record.sample_time_s * factor)
            modal = find_modal(still, outputs=outputs, past=window, largest=largest, decimation=factor)
        runs.append(Run(record.source, replace(modal, notes=notes), turns, _wind(record)))
    return followed(runs)


def decimation_of(records: Sequence[Record]) -> int:
    """Return the factor by which rates can be lowered so that HIGHEST times the fastest rotor stays below Nyquist."""
    fastest = max((_turning(r).frequency_hz for r in records), default=1.0)
    return max(int(1 / (2 * HIGHEST * fastest * max((r.sample_time_s for r in records), default=1.0))), 1)


def _turning(record: Record) -> Rotation:
    found = rotation(record)
    if found is None:
        raise DataError(
            f"{record.source}: the rotor stands, or neither its azimuth nor its speed is recorded; a Campbell diagram "
            "is over its speed: give a channel the role azimuth, or call one rotor_speed"
        )
    return found


def _wind(record: Record) -> float | None:
    for channel in record.channels:
        meaning = meaning_of(channel.name)
        if meaning is not None and meaning.kind == "wind" and channel.unit == "m/s":
            return float(np.nanmean(record.column(channel.name)))
    return None


@dataclass(frozen=True, eq=False)
class _Place:
    """Hold where a mode is: pole as seen from the tower, pole on the blades and sense, shape in common scales."""

    fixed: complex
    blade: complex
    sense: int
    shape: ComplexArray
    known: tuple[str, ...]


def followed(runs: Sequence[Run]) -> Campbell:
    """Follow the modes of analysed recordings; they come out in the order of the wind, or of the rotor's speed."""
    windy = all(r.wind_m_s is not None for r in runs)
    order = sorted(runs, key=lambda r: (r.wind_m_s or 0.0) if windy else r.turning.frequency_hz)
    scale = _scales(order)
    told = [[m for m in r.modal.listed if not m.is_real and m.damping < DAMPED and m.shape is not None] for r in order]
    numbers = follow([[_place(m, r, scale) for m in ms] for r, ms in zip(order, told, strict=True)], _distance)
    tracks = [Track("", (None,) * len(order)) for _ in range(max((n for ns in numbers for n in ns), default=-1) + 1)]
    for k, (given, modes) in enumerate(zip(numbers, told, strict=True)):
        for n, mode in zip(given, modes, strict=True):
            tracks[n] = Track("", (*tracks[n].modes[:k], mode, *tracks[n].modes[k + 1 :]))
    lines = [t for t in tracks if _stays_on_a_line(t, order)]
    several = [t for t in tracks if t not in lines and len(t.found) >= LEAST_RUNS]
    single = [Track(_word(t), t.modes) for t in tracks if t not in lines and t not in several]
    return Campbell(
        tuple(order), tuple(_named(several)), tuple(sorted(single, key=_middle)),
        tuple(Track(_line_of(t, order), t.modes) for t in sorted(lines, key=_middle)),
    )  # fmt: skip


def _scales(runs: Sequence[Run]) -> dict[str, float]:
    """Return the deviation of each output in the recording where it is quietest: shapes are compared in these.

    The speed of a rotor below rated wind follows the wind; in its deviation a drive train's swing would be nothing.
    """
    found: dict[str, float] = {}
    for run in runs:
        scaling = run.modal.diagram.scaling
        for name, size in zip(scaling.outputs, scaling.scale, strict=False):
            found[name] = min(float(size), found.get(name, np.inf))
    return found


def _place(mode: Mode, run: Run, scale: dict[str, float]) -> _Place:
    assert mode.shape is not None
    s = complex(continuous_poles(np.array([mode.eigenvalue]), run.modal.diagram.sample_time_s)[0])
    sense = {"forward": 1, "backward": -1}.get("" if mode.whirl is None else mode.whirl.direction, 0)
    names = tuple(mode.shape.values)
    shape = np.array([mode.shape.values[n] / scale.get(n, 1.0) for n in names])
    return _Place(s, s - 2j * np.pi * sense * run.turning.frequency_hz, sense, shape, names)


def _distance(now: _Place, before: _Place) -> float | None:
    """Return |Δs|/|s| + (1 − MAC)/2 of two places, None where they cannot be one mode."""
    if now.sense * before.sense < 0:
        return None
    on_blades = now.sense == before.sense != 0
    gap = abs(now.blade - before.blade) if on_blades else abs(now.fixed - before.fixed)
    apart = gap / max(abs(now.fixed), abs(before.fixed), 1e-12)
    both = [n for n in now.known if n in before.known]
    a, b = (p.shape[[p.known.index(n) for n in both]] for p in (now, before))
    alike = mac(a, b)
    return apart + (1 - alike) / 2 if apart <= FARTHEST and alike >= LEAST_MAC else None


def _stays_on_a_line(track: Track, runs: Sequence[Run]) -> bool:
    """Tell whether a mode keeps to one line of the blades' passing in more than half of where it is found."""
    near = Counter(
        order for m, r in zip(track.modes, runs, strict=True) if m is not None
        for order in [round(m.frequency_hz / r.turning.frequency_hz)]
        if is_widened(order) and abs(m.frequency_hz / (order * r.turning.frequency_hz) - 1) < ON_A_LINE
    )  # fmt: skip
    return bool(near) and near.most_common(1)[0][1] > len(track.found) / 2


def _line_of(track: Track, runs: Sequence[Run]) -> str:
    orders = [round(m.frequency_hz / r.turning.frequency_hz) for m, r in zip(track.modes, runs, strict=True) if m]
    return f"{round(float(np.median(orders)))}P"


def _middle(track: Track) -> float:
    return float(np.mean([m.frequency_hz for m in track.found]))


def _word(track: Track) -> str:
    """Return what most of a track's modes are called, the slowest of a kind or not."""
    words = Counter(m.name.removeprefix("2nd ") for m in track.found if m.name)
    return words.most_common(1)[0][0] if words else ""


def _named(tracks: Sequence[Track]) -> list[Track]:
    """Return the tracks by frequency with names: the slowest of a kind, and the second where there are two."""
    ordered = sorted(tracks, key=_middle)
    words = [_word(t) for t in ordered]
    count, met = Counter(words), Counter[str]()
    out = []
    for track, word in zip(ordered, words, strict=True):
        met[word] += 1
        name = word if met[word] == 1 else f"2nd {word}" if count[word] == 2 else ""
        out.append(Track(name, track.modes))
    return out
