"""Run a fleet: files to factors, factors to periods, periods to models, models to drift."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import aeolid
from aeolid.errors import DataError, UsageError
from aeolid.fleet.onset import find_onset, notable, say_change, untested
from aeolid.fleet.plan import DAY, Plan
from aeolid.fleet.tasks import (
    FileDone,
    Period,
    compress_file,
    merge_period,
    model_period,
    order_of,
    prepare_cache,
    reason_of,
)
from aeolid.fleet.tracking import drift, in_common_scales, track
from aeolid.fleet.workers import Pool
from aeolid.formats.timebase import CLOCK_TOLERANCE
from aeolid.wording import counted

Facts = dict[str, Any]
Notice = Callable[[str, int, int], None]  # stage, pieces done, pieces in all


@dataclass
class Skipped:
    """Collect what was left out: what it is (recording, period or turbine), its name and why."""

    rows: list[Facts] = field(default_factory=list)

    def add(self, kind: str, name: str, reason: str) -> None:
        """Note one thing left out; a reason that starts with its name is cut there."""
        self.rows.append({"kind": kind, "name": name, "reason": reason.removeprefix(f"{name}: ")})


def run_fleet(paths: Sequence[Path], plan: Plan, out: Path, pool: Pool, notice: Notice | None = None) -> Facts:
    """Return the facts of a fleet: periods with their modes, drift of each track, what was skipped and why.

    out: folder whose `cache` keeps every finished factor; a run finds there what an earlier one did, under other
    groupings, orders or feedthrough too. Values do not depend on the order of the files or on what was reused. Raises
    UsageError where `out` cannot be written to, DataError where nothing is usable. Memory: log N factors a worker.
    """
    tell = notice or (lambda stage, done, of: None)
    cache = str(out / "cache")
    try:
        prepare_cache(Path(cache))
    except OSError as error:
        raise UsageError(f"{out}: cannot be written ({error.strerror})") from None
    skipped = Skipped()
    done = _compress(paths, plan, cache, pool, tell, skipped)
    periods = _group(done, plan, skipped)
    periods = _merge(periods, cache, pool, tell, skipped)
    periods, reasons = _with_order(periods, plan, cache, pool, tell, skipped)
    found = _model(periods, plan, cache, pool, tell, skipped)
    if not found:
        raise DataError(_nothing(len(paths), skipped))
    _mark_tracks(found)
    reused, tracks = sum(f.reused for f in done), _tracks(found)
    count = Counter(p["turbine"] for p in found)
    for own in tracks:
        own["moved"] = notable(own, count[own["turbine"]])
    return {
        "version": aeolid.__version__, "settings": plan.to_json(), "recordings": len(paths), "usable": len(done),
        "reused": reused, "turbines": len({p["turbine"] for p in found}), "order_reasons": reasons,
        "periods": found, "tracks": tracks, "skipped": skipped.rows,
        "moved": [say_change(t) for t in tracks if t["moved"]], "untested": untested(tracks, count),
        "notes": _notes(done, plan),
    }  # fmt: skip


def _compress(
    paths: Sequence[Path], plan: Plan, cache: str, pool: Pool, tell: Notice, skipped: Skipped
) -> list[FileDone]:
    """Compress every file; those without a factor, with another sample time or a content met before are skipped."""
    names = sorted(str(p) for p in paths)
    results: dict[int, FileDone] = {}
    tell("recordings", 0, len(names))
    for index, result in pool.run(compress_file, names, plan, cache):
        lost = isinstance(result, BaseException)
        results[index] = FileDone(names[index], f"the worker was lost: {reason_of(result)}") if lost else result
        tell("recordings", len(results), len(names))
    usable = []
    met: dict[str, str] = {}
    usual = _usual_step([r.sample_time_s for r in results.values() if r.reason is None])
    for result in (results[i] for i in range(len(names))):
        reason, step = result.reason, result.sample_time_s
        if reason is None and abs(step - usual) > CLOCK_TOLERANCE * usual:
            reason = f"{result.path}: sample time {step:.6g} s, most have {usual:.6g} s; resample it"
        elif reason is None and result.sha256 in met:
            reason = f"{result.path}: the same content as {met[result.sha256]}"
        if reason is None:
            met[result.sha256] = result.path
            usable.append(result)
        else:
            skipped.add("recording", result.path, reason)
    return usable


def _usual_step(steps: Sequence[float]) -> float:
    """Return the sample time, s, that most recordings have but for the jitter of their clocks; 0 of none."""
    if not steps:
        return 0.0
    found = np.sort(steps)
    low, high = (np.searchsorted(found, found * (1 + share)) for share in (-CLOCK_TOLERANCE, CLOCK_TOLERANCE))
    most = found[high - low == np.max(high - low)]
    return float(most[len(most) // 2])


def _notes(files: Sequence[FileDone], plan: Plan) -> list[str]:
    """Say which turbines are put together from several folders of one name, which may be turbines of their own."""
    if plan.group is not None:
        return []
    folders: dict[str, set[str]] = {}
    for done in files:
        folders.setdefault(plan.place(Path(done.path))[0], set()).add(os.path.dirname(os.path.abspath(done.path)))
    return [
        f"turbine {turbine} is made of {len(found)} folders of that name, {min(found)} to {max(found)}; where they are "
        "turbines of their own, --group with (?P<turbine>…) tells them apart"
        for turbine, found in sorted(folders.items())
        if len(found) > 1
    ]


def _group(files: Sequence[FileDone], plan: Plan, skipped: Skipped) -> list[Period]:
    """Sort factors into turbines and periods, in the order of turbine and time."""
    members: dict[tuple[str, str], list[tuple[str, float]]] = {}
    for done in files:
        try:
            turbine, label, start = plan.place(Path(done.path))
        except DataError as error:
            skipped.add("recording", done.path, str(error))
            continue
        start = done.start_s if start is None else start
        members.setdefault((turbine, plan.period_of(start) if label is None else label), []).append(
            (done.factor, start)
        )
    periods = [
        Period(
            turbine,
            label,
            min(start for _, start in found),
            tuple(sorted(factor for factor, _ in found)),
            middle_s=sum(sorted(start for _, start in found)) / len(found),
        )
        for (turbine, label), found in members.items()
    ]
    return sorted(periods, key=lambda p: (p.turbine, p.start_s, _counted(p.label)))


def _counted(label: str) -> tuple[Any, ...]:
    """Return what orders labels as people count: week 2 before week 10."""
    parts = re.split(r"([0-9]+)", label)
    return (*(int(part) if i % 2 else part for i, part in enumerate(parts)), label)


def _merge(periods: list[Period], cache: str, pool: Pool, tell: Notice, skipped: Skipped) -> list[Period]:
    results = _all(pool, merge_period, periods, (cache,), "periods", tell)
    for period, reason in zip(periods, results, strict=True):
        if reason is not None:
            skipped.add("period", f"{period.turbine}, {period.label}", reason)
    return [p for p, reason in zip(periods, results, strict=True) if reason is None]


def _with_order(
    periods: list[Period], plan: Plan, cache: str, pool: Pool, tell: Notice, skipped: Skipped
) -> tuple[list[Period], dict[str, str]]:
    """Give every period its order: the one asked for, or one for each turbine."""
    if plan.order is not None:
        return [replace(p, order=plan.order) for p in periods], {}
    turbines = list(dict.fromkeys(p.turbine for p in periods))
    groups = [[p for p in periods if p.turbine == turbine] for turbine in turbines]
    results = _all(pool, order_of, groups, (plan, cache), "orders", tell)
    chosen, reasons = [], {}
    for turbine, group, result in zip(turbines, groups, results, strict=True):
        if isinstance(result, str):
            skipped.add("turbine", turbine, result)
            continue
        chosen += [replace(p, order=result[0]) for p in group]
        reasons[turbine] = result[1]
    return chosen, reasons


def _model(periods: list[Period], plan: Plan, cache: str, pool: Pool, tell: Notice, skipped: Skipped) -> list[Facts]:
    found = []
    results = _all(pool, model_period, periods, (plan, cache), "models", tell)
    for period, result in zip(periods, results, strict=True):
        if isinstance(result, str):
            skipped.add("period", f"{period.turbine}, {period.label}", result)
        else:
            when = {"start_s": period.start_s, "middle_s": period.middle_s}
            found.append({"turbine": period.turbine, "period": period.label} | when | result)
    return found


def _all(
    pool: Pool, function: Callable[..., Any], items: Sequence[Any], shared: tuple[Any, ...], stage: str, tell: Notice
) -> list[Any]:
    """Return the results in the order of the items; a lost piece gives its reason."""
    results: list[Any] = [None] * len(items)
    for done, (index, result) in enumerate(pool.run(function, items, *shared), 1):
        lost = isinstance(result, BaseException)
        results[index] = f"the worker was lost: {reason_of(result)}" if lost else result
        tell(stage, done, len(items))
    return results


def _mark_tracks(periods: list[Facts]) -> None:
    """Write the number of its track into every mode, and its shape in scales that a turbine's periods share."""
    for turbine in dict.fromkeys(p["turbine"] for p in periods):
        own = [p for p in periods if p["turbine"] == turbine]
        in_common_scales(own)
        numbers = track([(p["sample_time_s"], p["modes"]) for p in own])
        for period, given in zip(own, numbers, strict=True):
            for mode, number in zip(period["modes"], given, strict=True):
                mode["track"] = number


def _dated(periods: list[Facts]) -> set[str]:
    """Return the turbines whose periods each have a time of their own: the clocks of others say nothing of them."""
    times: dict[str, list[float]] = {}
    for period in periods:
        times.setdefault(period["turbine"], []).append(period["middle_s"])
    return {turbine for turbine, found in times.items() if len(found) == len(set(found)) > 1}


def _tracks(periods: list[Facts]) -> list[Facts]:
    """Return for each track its periods, values at both ends and the drift a day (a period where no clock says)."""
    clocks = _dated(periods)
    series: dict[tuple[str, int], list[tuple[float, Facts]]] = {}
    place: Counter[str] = Counter()
    for period in periods:
        time = period["middle_s"] / DAY if period["turbine"] in clocks else float(place[period["turbine"]])
        place[period["turbine"]] += 1
        for mode in period["modes"]:
            series.setdefault((period["turbine"], mode["track"]), []).append((time, mode))
    tracks = []
    for (turbine, number), points in sorted(series.items()):
        times, modes = [t for t, _ in points], [m for _, m in points]
        facts: Facts = {
            "turbine": turbine,
            "track": number,
            "periods": len(points),
            "per": "day" if turbine in clocks else "period",
            "name": Counter(str(m.get("name") or "") for m in modes).most_common(1)[0][0],
            "until_s": max(p["middle_s"] for p in periods if p["turbine"] == turbine),
        }
        for key, std in (("frequency_hz", "frequency_std_hz"), ("damping", "damping_std")):
            facts[key] = {"first": modes[0][key], "last": modes[-1][key], "last_std": modes[-1][std]}
            series_of = [m[key] for m in modes], [m[std] for m in modes]
            facts[key]["drift"] = drift(times, *series_of)
            facts[key]["onset"] = find_onset(times, *series_of)
        facts["rotor_order"] = Counter(m["rotor_order"] for m in modes).most_common(1)[0][0]
        tracks.append(facts)
    return tracks


def _nothing(count: int, skipped: Skipped) -> str:
    first = skipped.rows[0]["reason"] if skipped.rows else "no period"
    return (
        f"nothing usable in {counted(count, 'recording')}, {counted(len(skipped.rows), 'reason')}; the first: {first}"
    )
