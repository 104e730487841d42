"""Say where a baseline leaves something over: in time, by operating point, at the rotor's angle (S3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.localise.cells import Cell, azimuth_cells, bins_of, region_cells, stretches_of, time_cells
from aeolid.diagnose.predictor.noise import touched
from aeolid.diagnose.rules import in_force
from aeolid.models.angles import radians_a_unit
from aeolid.record import Channel

Array = NDArray[np.float64]
Facts = dict[str, Any]
_MOST = 3  # channels whose regions are looked at
_PAST = 10  # samples before, whose mean is the operating point: at the instant itself a wind tells of the very gust


@dataclass(frozen=True, eq=False)
class _Rows:
    """Hold the scored rows of one segment: whitened innovations (n, l), their times, the segment's inputs there."""

    white: Array
    time_s: Array
    inputs: Array
    source: str


def evidence_cells(prepared: Prepared, case: Case, seed: int) -> dict[str, list[Facts]]:
    """Test the whitened innovations of the baseline's fit by time, region and azimuth order; one list for each map.

    Rows with a missing measurement are left out. A map is empty where nothing is recorded that it could be drawn over.
    """
    rows = _scored(prepared)
    outputs = [o.name for o in prepared.extended.outputs]
    names = [s.name for s in prepared.extended.inputs]
    return {
        "time": _in_time(rows, outputs, seed),
        "region": _in_regions(rows, outputs, names, case.records[0].channels, prepared.settle_s),
        "azimuth": _at_orders(rows, outputs, names, case.records[0].channels),
    }


def _scored(prepared: Prepared) -> list[_Rows]:
    fit, segments = prepared.fit, prepared.predictor.segments
    white = fit.residual.reshape(-1, segments[0].y.shape[1])
    found, start = [], 0
    for s in segments:
        stop = start + len(s.y) - s.burn
        known = ~touched(s.y, len(fit.noise.var))[s.burn :]
        found.append(_Rows(white[start:stop][known], _times(s)[known], s.u[:: s.stride][s.burn :][known], s.source))
        start = stop
    return found


def _times(segment: Segment) -> Array:
    return segment.start_s + segment.step * np.arange(segment.burn, len(segment.y), dtype=np.float64)


def _in_time(rows: Sequence[_Rows], outputs: Sequence[str], seed: int) -> list[Facts]:
    stretches = stretches_of([len(r.white) for r in rows])
    time = np.concatenate([r.time_s for r in rows])
    source = [r.source for r in rows for _ in r.time_s]
    return [
        {"output": outputs[c.output], "source": source[stretches[c.place][0]],
         "time_s": [float(time[stretches[c.place][0]]), float(time[stretches[c.place][1] - 1])], **_told(c)}
        for c in time_cells(np.vstack([r.white for r in rows]), stretches, seed)
    ]  # fmt: skip


def _in_regions(
    rows: Sequence[_Rows], outputs: Sequence[str], names: Sequence[str], channels: Sequence[Channel], settle_s: float
) -> list[Facts]:
    found = []
    for name, unit, values in _operating(rows, names, channels, settle_s):
        bins = bins_of(values)
        if bins is not None:
            found.append((name, unit, *bins))
    maps = region_cells(np.vstack([r.white for r in rows]), [label for *_, label in found[:_MOST]])
    return [
        {"output": outputs[c.output], "channel": name, "unit": unit,
         "range": [float(edges[c.place]), float(edges[c.place + 1])], **_told(c)}
        for (name, unit, edges, _), cells in zip(found, maps, strict=False)
        for c in cells
    ]  # fmt: skip


def _operating(
    rows: Sequence[_Rows], names: Sequence[str], channels: Sequence[Channel], settle_s: float
) -> list[tuple[str, str, Array]]:
    """Return name, unit and samples of what says the operating point: scheduling channels, else disturbances.

    Their means over 10 samples before. A model that is not told the wind has to guess each gust: its innovations follow
    the recorded wind of that instant though it lacks nothing (correlation 0.14, two marks; of the mean before 0.00).
    Where neither is recorded, the inputs' means over a settling time, as far as these move.
    """
    rules = in_force().localise
    for role in ("scheduling", "disturbance"):
        found = [c for c in channels if c.role == role and c.name in names]
        if found:
            return [(c.name, c.unit, _mean_before(rows, names.index(c.name), _PAST)) for c in found]
    slow = []
    step = min((float(np.median(np.diff(r.time_s))) for r in rows if len(r.time_s) > 1), default=1.0)
    for c in (c for c in channels if c.role == "input" and c.name in names):
        place = names.index(c.name)
        mean = _mean_before(rows, place, int(settle_s / step))
        if np.var(mean) > rules.slow_share * np.var(np.concatenate([r.inputs[:, place] for r in rows])):
            slow.append((f"mean {c.name}", c.unit, mean))
    return slow


def _mean_before(rows: Sequence[_Rows], place: int, most: int) -> Array:
    """Return the mean of up to `most` samples before each one, a tenth of its segment at the most."""
    parts = []
    for values in (r.inputs[:, place] for r in rows):
        total = np.concatenate([[0.0], np.cumsum(values)])
        stop = np.maximum(np.arange(len(values)), 1)
        first = np.maximum(stop - max(1, min(most, len(values) // 10)), 0)
        parts.append((total[stop] - total[first]) / (stop - first))
    return np.concatenate(parts)


def _at_orders(
    rows: Sequence[_Rows], outputs: Sequence[str], names: Sequence[str], channels: Sequence[Channel]
) -> list[Facts]:
    channel = next((c for c in channels if c.role == "azimuth" and c.name in names), None)
    if channel is None:
        return []
    place = names.index(channel.name)
    scale = radians_a_unit(channel.unit, np.concatenate([r.inputs[:, place] for r in rows]))
    cells = azimuth_cells([r.white for r in rows], [scale * r.inputs[:, place] for r in rows])
    return [
        {"output": outputs[c.output], "order": c.place, "phase_deg": c.phase_deg, **_told(c)} for c in cells
    ]  # fmt: skip


def _told(cell: Cell) -> Facts:
    return {
        "kind": cell.kind, "value": cell.value, "statistic": cell.z, "threshold": cell.limit,
        "significant": cell.significant,
    }  # fmt: skip


def whereabouts(cells: dict[str, list[Facts]]) -> Facts:
    """Return azimuth_order, region, time_s, inputs of diagnosis.json: of each map the strongest marked cell, or none.

    Marked neighbours of one stretch or bin belong to it. Where half of all stretches, or of a channel's bins, are
    marked, it is nowhere in particular. Of several recordings the one that the time is of is said, too.
    """
    order = _strongest(cells.get("azimuth", []))
    found = _neighbours(cells.get("region", []), "channel", "range")
    region = None if found is None else f"{found[0]} {_figure(found[1])} to {_figure(found[2])}{found[3]}"
    when = _neighbours(cells.get("time", []), "source", "time_s")
    path = _strongest(cells.get("path", []))
    recorded = {str(c["source"]) for c in cells.get("time", [])}
    return {
        "azimuth_order": None if order is None else int(order["order"]),
        "region": region,
        "time_s": None if when is None else [when[1], when[2]],
        "inputs": [] if path is None else [path["channel"]],
    } | ({} if when is None or len(recorded) < 2 else {"recording": when[0]})


def _figure(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 999.5 else f"{value:#.3g}".rstrip(".")


def _strongest(cells: Sequence[Facts]) -> Facts | None:
    marked = [c for c in cells if c["significant"]]
    return max(marked, key=lambda c: float(c["statistic"] / c["threshold"]), default=None)


def _neighbours(cells: Sequence[Facts], group: str, ends: str) -> tuple[str, float, float, str] | None:
    """Return where the strongest cell lies, with what is marked beside it: group, from, to, unit."""
    rules = in_force().localise
    best = _strongest(cells)
    if best is None:
        return None
    own = [c for c in cells if c[group] == best[group]]
    places = sorted({tuple(c[ends]) for c in own})
    marked = {tuple(c[ends]) for c in own if c["significant"]}
    among = cells if group == "source" else own
    everywhere = {(c[group], *c[ends]) for c in among}
    if len({(c[group], *c[ends]) for c in among if c["significant"]}) > rules.spread_share * len(everywhere):
        return None
    first = last = places.index(tuple(best[ends]))
    while first > 0 and places[first - 1] in marked:
        first -= 1
    while last + 1 < len(places) and places[last + 1] in marked:
        last += 1
    unit = f" {best['unit']}" if best.get("unit") else ""
    return str(best[group]), float(places[first][0]), float(places[last][1]), unit
