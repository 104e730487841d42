"""Divide the recordings into fit, select and sealed parts before anything is estimated (S0)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.rules import in_force
from aeolid.errors import NotIdentifiable
from aeolid.record import Record

Array = NDArray[np.float64]
_NEEDED = 150  # samples of a single recording: a fifth of them less a gap of a twentieth leaves the least stretch
_SHARES = (("fit", 0.5), ("select", 0.2), ("sealed", 0.3))
_OPEN = (("fit", 0.7), ("select", 0.3))  # of recordings beside a sealed one
_AROUND = {  # the same with the fit data on both sides of the selection data
    _SHARES: (("fit", 0.25), ("select", 0.2), ("fit", 0.25), ("sealed", 0.3)),
    _OPEN: (("fit", 0.35), ("select", 0.3), ("fit", 0.35)),
}
_Shares = tuple[tuple[str, float], ...]


@dataclass(frozen=True, eq=False)
class Split:
    """Hold the three parts; nothing is fitted to or chosen by sealed data, they can only take a name away."""

    fit: tuple[Segment, ...]
    select: tuple[Segment, ...]
    sealed: tuple[Segment, ...]
    rows: tuple[dict[str, object], ...]

    def stepped(self, least: int) -> Split:
        """Return the same parts with that many integration steps a row of inputs at least."""
        fit, select, sealed = (
            tuple(replace(s, least_steps=least) for s in part) for part in (self.fit, self.select, self.sealed)
        )
        return replace(self, fit=fit, select=select, sealed=sealed)

    @property
    def samples(self) -> int:
        """Return how many rows of the recordings the parts hold."""
        return sum(len(s.u) for part in (self.fit, self.select, self.sealed) for s in part)

    @property
    def sealed_text(self) -> str:
        """Say which data were sealed."""
        return "; ".join(f"{s.source} from {s.start_s:.6g} s to {s.stop_s:.6g} s" for s in self.sealed)


def split_records(
    records: Sequence[Record], inputs: Sequence[str], outputs: Sequence[str], settle_s: float, stride: int = 1,
    extra: Sequence[str] = (), around: bool = False,
) -> Split:  # fmt: skip
    """Seal one of several recordings and cut the others 70 : 30 into fit and select; cut a single one in time.

    Of two the last is sealed; of more the one whose inputs have the middle spread, so that the proof lies inside the
    operating range of the fit.

    `extra` names further channels whose samples follow those of the inputs; they have no say in the plan. around: the
    fit data lie on both sides of the selection data, so that they show what changes before the sealed data begin.
    A single recording is cut 50 : 20 : 30 with gaps of three settling times (`settle_s`, at most 5 % of the length).
    A fit scores every sample (the initial state is a parameter); the other parts settle first.
    Where parts of 60 samples are not to be had, recordings of which three or more are left are divided whole (a machine
    that starts and stops shows neither twice in one of them), and parts of 20 samples do.
    Raises NotIdentifiable where a part would hold less.
    """
    rules = in_force().data
    columns = [*inputs, *extra]
    parts: dict[str, list[Segment]] = {}
    plan: list[tuple[str, Record, int, int]] = []
    for plan, least in _plans(records, inputs, settle_s, around):
        parts = {"fit": [], "select": [], "sealed": []}
        for use, record, start, stop in plan:
            settle = 0.0 if use == "fit" else settle_s
            parts[use] += segments_of(record, (start, stop), columns, outputs, settle, stride, least)
        if all(parts.values()):
            break
    for use, segments in parts.items():
        if not segments:
            raise NotIdentifiable(
                f"{records[0].source}: no stretch of {rules.fewest_samples} samples without missing ones for the {use}"
                f" part{_lacking([p[1:] for p in plan if p[0] == use], columns, outputs)}; {sum(map(len, records))}"
                f" samples in all, at least {_NEEDED} are needed"
            )
    rows = [
        {"file": s.source, "start_s": s.start_s, "stop_s": s.stop_s, "use": use}
        for use, segments in parts.items()
        for s in segments
    ]
    return Split(tuple(parts["fit"]), tuple(parts["select"]), tuple(parts["sealed"]), tuple(rows))


def split_sparsely(
    records: Sequence[Record], inputs: Sequence[str], outputs: Sequence[str], settle_s: float, stride: int,
    extra: Sequence[str] = (), around: bool = False,
) -> tuple[Split, int]:  # fmt: skip
    """Return the split whose predictions span the most samples up to `stride`, and how many that is.

    A stretch without missing samples counts by its predictions; where rows are lost here and there, long ones would
    leave most stretches too short. So strides are halved until the parts keep nearly what they do at the recordings'
    own rate. For the rest see `split_records`.
    """

    def at(tried: int) -> Split:
        return split_records(records, inputs, outputs, settle_s, tried, extra, around)

    if stride == 1:
        return at(1), 1
    finest = at(1)
    while stride > 1:
        try:
            split = at(stride)
        except NotIdentifiable:
            pass
        else:
            if split.samples / finest.samples >= in_force().data.kept_share:
                return split, stride
        stride //= 2
    return finest, 1


def _lacking(rows: Sequence[tuple[Record, int, int]], inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """Say which channel is missing most in a part of the recordings, its rows given as record, first and stop."""
    total = sum(stop - start for _, start, stop in rows)
    lost = {
        name: sum(int(np.isnan(r.column(name)[start:stop]).sum()) for r, start, stop in rows)
        for name in (*inputs, *outputs)
    }
    worst = max(lost, key=lambda name: lost[name])
    if not lost[worst]:
        return ""
    kind = "output" if worst in outputs else "input"
    return f": the {kind} {worst!r} is missing in {lost[worst]} of its {total} rows (leave it out, or record it there)"


def _plans(
    records: Sequence[Record], inputs: Sequence[str], settle_s: float, around: bool
) -> Iterator[tuple[list[tuple[str, Record, int, int]], int]]:
    """Yield how to divide, and the shortest stretch in rows: the usual way first, others where that leaves a use empty.

    A gauge that was stuck for all of the selection data leaves enough on both sides of the middle.
    """
    rules = in_force().data
    yield _plan(records, inputs, settle_s, around), rules.settled_samples
    yield _plan(records, inputs, settle_s, not around), rules.settled_samples
    if len(records) > rules.whole_recordings:
        sealed = _sealed_of(records, inputs)
        others = [r for r in records if r is not sealed]
        every = rules.whole_recordings
        uses = ["select" if place % every == every // 2 else "fit" for place in range(len(others))]
        whole = [(u, r, 0, len(r)) for u, r in zip([*uses, "sealed"], [*others, sealed], strict=True)]
        yield whole, rules.fewest_samples
    yield _plan(records, inputs, settle_s, around), rules.fewest_samples


def segments_of(
    record: Record, rows: tuple[int, int], inputs: Sequence[str], outputs: Sequence[str], settle_s: float,
    stride: int = 1, least: int | None = None,
) -> list[Segment]:  # fmt: skip
    """Return the stretches of samples rows[0] … rows[1] − 1 of which all inputs and some outputs are known.

    Where one of several outputs is missing for as long as a stretch of the usual plan, the recording is cut, too:
    nothing is scored there, and a gain that was made for all outputs need not be stable with the others alone (a
    motor's, beside a load's speed that was stuck for 36 s, ran away: errors of 22,000 nats in the rows where the sensor
    came back).
    least: samples of a stretch; where recordings have no longer ones, the fewest of the rules in force.
    """
    start, stop = rows
    least = in_force().data.fewest_samples if least is None else least
    found = [
        _segment(record, inputs, outputs, start + a, start + b, settle_s, stride)
        for a, b in _stretches(_usable(record, inputs, outputs, stride)[start:stop], least * stride)
    ]
    return [s for s in found if _says_something(s)]


def _says_something(segment: Segment) -> bool:
    """Tell whether enough of a stretch was measured after its start."""
    return int(np.any(np.isfinite(segment.y[segment.burn :]), axis=1).sum()) >= in_force().data.fewest_samples // 2


def _plan(
    records: Sequence[Record], inputs: Sequence[str], settle_s: float, around: bool
) -> list[tuple[str, Record, int, int]]:
    whole, rest = (_AROUND[_SHARES], _AROUND[_OPEN]) if around else (_SHARES, _OPEN)
    if len(records) > 1:
        last = _sealed_of(records, inputs)
        cuts = [c for r in records if r is not last for c in _cut(r, rest, settle_s)]
        return [*cuts, ("sealed", last, 0, len(last))]
    return _cut(records[0], whole, settle_s)


def _sealed_of(records: Sequence[Record], inputs: Sequence[str]) -> Record:
    if len(records) == 2 or not inputs:
        return records[-1]
    known = [[x[np.isfinite(x)] for x in r.columns(inputs).T] for r in records]
    spreads = np.array([[float(np.std(x)) if len(x) else 0.0 for x in own] for own in known])
    size = np.sum(spreads / np.maximum(spreads.max(axis=0), 1e-300), axis=1)
    return records[int(np.argsort(size, kind="stable")[len(records) // 2])]


def _cut(record: Record, shares: _Shares, settle_s: float) -> list[tuple[str, Record, int, int]]:
    length = len(record)
    gap = min(int(3 * settle_s / record.sample_time_s), length // 20)
    plan: list[tuple[str, Record, int, int]] = []
    start, total = 0.0, sum(share for _, share in shares)
    for number, (use, share) in enumerate(shares):
        stop = start + share / total * length
        plan.append((use, record, int(start) + (gap if number else 0), int(stop)))
        start = stop
    return plan


def _usable(record: Record, inputs: Sequence[str], outputs: Sequence[str], stride: int) -> NDArray[np.bool_]:
    """Tell which samples (N,) have all inputs and do not lie where some outputs are missing for long."""
    known = np.isfinite(record.columns(outputs))
    partly = np.any(known, axis=1) & ~np.all(known, axis=1)
    usable: NDArray[np.bool_] = np.all(np.isfinite(record.columns(inputs)), axis=1)
    for a, b in _stretches(partly, in_force().data.settled_samples * stride):
        usable[a:b] = False
    return usable


def _stretches(good: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    """Return where (N,) is true for so many samples or more: begin and end of each stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= least]


def _segment(
    record: Record, inputs: Sequence[str], outputs: Sequence[str], start: int, stop: int, settle_s: float, stride: int
) -> Segment:
    rows = (stop - start) // stride
    piece = record.slice(start, start + rows * stride)
    step = record.sample_time_s * stride
    burn = int(np.clip(settle_s / step, 10, 0.15 * rows)) if settle_s else 0
    return Segment(
        np.ascontiguousarray(piece.columns(inputs)),
        np.ascontiguousarray(piece.columns(outputs)[::stride]),
        step,
        record.source.rsplit("/", 1)[-1],
        float(piece.time_s[0]),
        burn,
        stride,
        _before(record, inputs, start),
    )


def _before(record: Record, inputs: Sequence[str], start: int) -> Array | None:
    """Return the inputs of the rows that end where a stretch starts, none missing; None where there are none."""
    u = record.slice(max(start - in_force().data.remembered_samples, 0), start).columns(inputs)
    lost = np.flatnonzero(~np.all(np.isfinite(u), axis=1))
    u = u[lost[-1] + 1 :] if len(lost) else u
    return np.ascontiguousarray(u) if len(u) else None
