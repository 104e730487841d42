"""Tell a machine at rest from a sensor that is stuck: stretches in which an output holds one value (S0)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.held import discretise
from aeolid.diagnose.data.strays import without_codes
from aeolid.diagnose.rules import in_force
from aeolid.errors import DataError
from aeolid.models.equations import Equations
from aeolid.models.exchange.fmu import Fmu
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record
from aeolid.wording import counted

Array = NDArray[np.float64]

Baseline = StateSpace | Equations | Record | Fmu | None


@dataclass(frozen=True)
class Stretch:
    """Hold samples start … stop − 1 of one output of one recording, all equal, and why.

    kind: "rest", the model does not move there either and no input does; "still", the machine may stand although its
    model moves (friction, a dead band, a stop): evidence; "end", the channel's extreme value, which it has at other
    times as well: evidence of a range that ends; "stuck", the sensor.
    """

    record: int
    channel: str
    start: int
    stop: int
    kind: str

    def __len__(self) -> int:
        return self.stop - self.start


def stretches_of(records: Sequence[Record], baseline: Baseline = None) -> tuple[Stretch, ...]:
    """List the stretches of all outputs; those of an output that moves in no recording are not asked about.

    Where values repeat by their resolution alone, only those longer than 50 samples and a fifth of a recording count,
    and shorter ones in which the model stands as well.
    A stuck sensor meets a machine that moves, so the value jumps when it comes back; what was held by friction or in a
    dead band starts from where it stood. Of what is shorter than 20 samples only a stuck sensor is said.
    Cost: one free run of the model a recording that has such a stretch.
    """
    rules = in_force().data
    found: list[Stretch] = []
    names = [c.name for c in records[0].of("output")]
    records = [replace(r, values=np.apply_along_axis(without_codes, 0, r.values)) for r in records]
    spreads = {n: _spread(np.concatenate([r.column(n) for r in records])) for n in names}
    for place, record in enumerate(records):
        runs = {n: _equal(record.column(n)) for n in names if spreads[n] > 0}
        if not any(own for own, _ in runs.values()):
            continue
        model = _free_run(baseline, record)
        least = max(rules.coarse_standstill_samples, rules.coarse_standstill_share * len(record))
        for name, (own, coarse) in runs.items():
            for start, stop in own:
                kind, end = _kind(record, name, (start, stop), spreads, model.get(name))
                known = kind in ("stuck", "ended") or stop - start >= rules.standstill_samples
                if known and (kind == "rest" or not coarse or stop - start > least):
                    found.append(Stretch(place, name, start, end, kind))
    told = [_at_an_end(_moved_elsewhere(s, records), records) for s in _ended(found, records)]
    return tuple(s for s in told if s.kind == "stuck" or len(s) >= rules.standstill_samples)


def _spread(values: Array) -> float:
    good = values[np.isfinite(values)]
    return float(np.std(good)) if len(good) > 1 and np.ptp(good) > 0 else 0.0


def _equal(values: Array) -> tuple[list[tuple[int, int]], bool]:
    """Return where a channel holds one value for long, and whether it repeats values elsewhere too.

    Long are 20 samples, or as many as would not come by chance where each equals the one before as often as elsewhere:
    a level on steps of 12 bits that hung for 12 and 13 samples, by far the worst foretold of all. Rows that were lost
    on the way end no stretch.
    """
    rules = in_force().data
    values = _held_on(values, rules.standstill_samples)
    with np.errstate(invalid="ignore"):
        same = np.diff(values) == 0
    edges = np.flatnonzero(np.concatenate([[True], ~same, [True]]))
    pairs = [(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True) if np.isfinite(values[a])]
    least = min(rules.standstill_samples, _by_chance([b - a for a, b in pairs], len(values)))
    runs = [(a, b) for a, b in pairs if b - a >= least]
    same &= ~np.isin(values[1:], [values[a] for a, _ in runs])  # it may stand there more often, and shorter
    return runs, bool(np.mean(same) > rules.alive_share)


def _held_on(values: Array, longest: int) -> Array:
    """Return a channel (N,) with its last value in gaps of at most so many samples."""
    known = np.isfinite(values)
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    bridged = ~known & (last >= 0)
    for a, b in zip(*np.flatnonzero(np.diff(np.concatenate([[0], ~known, [0]]))).reshape(-1, 2).T, strict=True):
        if b - a > longest:
            bridged[a:b] = False
    return np.where(bridged, values[last], values)


def _by_chance(lengths: Sequence[int], rows: int) -> int:
    """Return the samples in a row that a channel does not repeat by chance, once in ten thousand recordings.

    lengths: of all its stretches of equal samples; the longest of them does not count for how often it repeats.
    """
    rules = in_force().data
    repeats = sum(lengths) - len(lengths) - (max(lengths, default=1) - 1)
    share = (repeats + 1) / max(rows, 2)
    needed = 1 + np.log(rules.repeated_chance / rows) / np.log(share) if share < 1 else np.inf
    return int(np.ceil(max(min(needed, rows), rules.hung_samples)))


def _free_run(baseline: Baseline, record: Record) -> dict[str, Array]:
    """Return the outputs of the baseline that is a model, run free on the recorded inputs; none where it cannot be.

    Inputs hold their last value where they are missing for a moment.
    """
    longest = in_force().data.standstill_samples
    record = replace(record, values=np.apply_along_axis(_held_on, 0, record.values, longest))
    try:
        if isinstance(baseline, Equations):
            y = baseline.simulate(record)
        elif isinstance(baseline, StateSpace):
            model = discretise(baseline, record.sample_time_s)
            y = model.simulate(record.columns([s.name for s in model.inputs]))
        else:
            return {}
    except DataError:
        return {}
    names = [o.name for o in baseline.outputs]
    return {n: v for n, v in zip(names, y.T, strict=True) if np.all(np.isfinite(v))}


def _kind(
    record: Record, name: str, where: tuple[int, int], spreads: dict[str, float], model: Array | None
) -> tuple[str, int]:
    """Return what a stretch is, and where it ends: a rest ends where an input moves, if only in its second half."""
    rules = in_force().data
    start, stop = where
    half = (start + stop) // 2  # a machine that comes to rest does so in the first half
    inputs = record.matrix("input", "disturbance")[half:stop]
    steps = np.diff(np.apply_along_axis(_held_on, 0, inputs, len(inputs)), axis=0)
    moved = np.flatnonzero(np.any(np.isfinite(steps) & (steps != 0), axis=1))  # a row that was lost is no motion
    quiet = half + 1 + int(moved[0]) if len(moved) else stop  # no input moves from `half` to there
    driven = quiet < (half + stop) // 2
    if model is not None:
        range_ = _range(model[half : stop if driven else quiet])
        moves, rests = range_ > rules.moves_share * spreads[name], range_ <= rules.rests_share * spreads[name]
    else:
        others = [record.column(n)[half:stop] for n, s in spreads.items() if n != name and s > 0]
        moves = driven or any(_range(v) > 0 for v in others)
        rests = not moves
    frozen = [n for n in spreads if _range(record.column(n)[start:stop]) == 0]
    if not driven and (rests or len(frozen) == len(spreads) > 1):
        return "rest", quiet
    return ("still" if not moves else _moving(record.column(name), where, spreads[name])), stop


def _moving(values: Array, where: tuple[int, int], spread: float) -> str:
    """Return what a stretch is in which the model moves: "stuck", "still", or "ended" where that is to be seen.

    A machine stands where its position came to rest slowly, where its speed is zero, or at an end of its range.
    """
    rules = in_force().data
    start, stop = where
    outside = [np.abs(np.diff(v[np.isfinite(v)])) for v in (values[:start], values[stop:])]
    steps = np.concatenate(outside)
    ordinary = float(np.quantile(steps[steps > 0], rules.ordinary_quantile)) if np.any(steps > 0) else 0.0
    before, value = outside[0][-rules.arriving_samples :], values[start]
    ends = np.array([0.0, np.nanmin(values), np.nanmax(values)])
    stands = start == 0 or bool(np.any(np.abs(value - ends) < rules.end_distance * spread))
    stands |= len(before) > 0 and float(np.mean(before)) < rules.slow_ratio * float(np.median(steps))
    if ordinary <= rules.steppy_share * spread:
        borders = [abs(values[k] - values[k - 1]) for k in where if 0 < k < len(values)]
        if not stands or any(not b <= rules.jump_ratio * ordinary for b in borders):
            return "stuck"
        return "still" if stop < len(values) else "ended"
    return "stuck" if float(np.mean(steps == 0)) < rules.alive_share else "ended"


def _range(values: Array) -> float:
    good = values[np.isfinite(values)]
    return float(np.ptp(good)) if len(good) else 0.0


def _ended(found: Sequence[Stretch], records: Sequence[Record]) -> tuple[Stretch, ...]:
    """Decide about stretches that no jump ends: a machine may stand again where it stood before."""
    rest = {(s.channel, _value(s, records)) for s in found if s.kind in ("rest", "still")}
    return tuple(
        s if s.kind != "ended" else replace(s, kind="still" if (s.channel, _value(s, records)) in rest else "stuck")
        for s in found
    )


def _moved_elsewhere(stretch: Stretch, records: Sequence[Record]) -> Stretch:
    """Call stuck what stands at inputs that moved it, from where it stands, at most other times.

    What is held by friction or in a dead band is held at less than what it leaves at.
    """
    rules = in_force().data
    sustained = rules.sustained_samples
    if stretch.kind != "still":
        return stretch
    record, value = records[stretch.record], _value(stretch, records)
    answers = []
    for name in (c.name for c in record.of("input")):
        u = record.column(name)[stretch.start : stretch.stop]
        if _range(u) > 0 and len(u) > 2 * sustained:
            levels = np.abs(u[:-sustained] - u[0])
            held = float(np.max(np.min(np.lib.stride_tricks.sliding_window_view(levels, sustained), axis=1)))
            left = [x for r in records for x in _leaving(r.column(name), r.column(stretch.channel), value, float(u[0]))]
            answers.append(len(left) >= rules.left_often and held >= float(np.median(left)) > 0)
    return replace(stretch, kind="stuck") if answers and all(answers) else stretch


def _at_an_end(stretch: Stretch, records: Sequence[Record]) -> Stretch:
    """Call the end of a range what seems stuck at the extreme value, where that comes at other times as well.

    A thermometer that shows no more than 112 °C stood there for 74 samples, 20 and 55; with the 74 left out, the part
    that should have borne out the range had none of it. Not at zero, where a machine rests.
    """
    value = _value(stretch, records)
    if stretch.kind != "stuck" or value == 0:
        return stretch
    columns = [r.column(stretch.channel) for r in records]
    extreme = value in (min(np.nanmin(c) for c in columns), max(np.nanmax(c) for c in columns))
    elsewhere = sum(int(np.sum(c == value)) for c in columns) - len(stretch)
    return replace(stretch, kind="end") if extreme and elsewhere >= in_force().data.fine_repeats else stretch


def _leaving(u: Array, y: Array, value: float, rest: float) -> list[float]:
    """Return by how much an input was off its rest each time that an output left a value it had held."""
    holds = in_force().data.sustained_samples
    stands = np.concatenate([[False], y == value, [False]])
    edges = np.flatnonzero(np.diff(stands.astype(int)))
    ends = [b for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= holds and b + holds <= len(y)]
    return [float(np.median(np.abs(u[b : b + holds] - rest))) for b in ends]


def _value(stretch: Stretch, records: Sequence[Record]) -> float:
    return float(records[stretch.record].column(stretch.channel)[stretch.start])


def words(stretch: Stretch, channel: Channel, record: Record) -> str:
    """Say what a stretch is."""
    value = float(record.column(stretch.channel)[stretch.start])
    rows = f"the same value {value:.6g} {channel.unit}".rstrip() + f" for {counted(len(stretch), 'sample')} in a row"
    at = f"from {record.time_s[stretch.start]:.6g} s"
    return {
        "rest": f"{rows} {at}, and no input drives it: a machine at rest; what follows its coming to rest is left out",
        "still": f"{rows} {at}, where the machine may stand (friction, a dead band, a stop, no drive); it is kept",
        "end": f"{rows} {at}, its extreme, where it is at other times as well: a range that ends, or a stop; kept",
        "stuck": f"{rows} {at}, where it must have moved: a stuck sensor, or held; these samples are left out",
    }[stretch.kind]
