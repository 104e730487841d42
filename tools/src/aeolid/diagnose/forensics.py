"""Look at the recording itself before believing it: missing, stuck, clipped, coarse or folded channels (S0)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.record import Channel, Record

Array = NDArray[np.float64]
_STUCK_SHARE = 0.2  # of the samples equal to their predecessor in one run: no live sensor does that
_RAIL_SHARE = 0.005


@dataclass(frozen=True)
class Finding:
    """Say what a check found on one channel; severity is info, warning or fault."""

    check: str
    channel: str
    finding: str
    severity: str

    def to_json(self) -> dict[str, str]:
        """Return the row of the report's appendix."""
        return {"check": self.check, "channel": self.channel, "finding": self.finding, "severity": self.severity}


def examine(records: Sequence[Record]) -> tuple[Finding, ...]:
    """Check every channel that takes part; cost O(N) a channel."""
    findings: list[Finding] = []
    for record in records:
        name = record.source.rsplit("/", 1)[-1]
        for channel in record.of("input", "output", "disturbance"):
            findings += _channel(channel, record.column(channel.name), name)
    return tuple(findings)


def _channel(channel: Channel, values: Array, source: str) -> list[Finding]:
    where, found = f"{channel.name} ({source})", []
    missing = int(np.sum(~np.isfinite(values)))
    if missing:
        text = f"{missing} of {len(values)} samples are missing; they are left out"
        found.append(Finding("missing", where, text, "fault" if missing > 0.5 * len(values) else "warning"))
    v = values[np.isfinite(values)]
    if len(v) < 2 or np.ptp(v) == 0:
        severity = "fault" if channel.role == "output" else "warning"
        return [*found, Finding("constant", where, "never changes", severity)]
    if channel.role == "output":
        run = _longest_run(v)
        if run > _STUCK_SHARE * len(v) and run > 50:
            found.append(Finding("stuck", where, f"the same value for {run} samples in a row", "fault"))
        found += _rails(v, where)
        folded = _folded(v)
        if folded:
            found.append(Finding("folded", where, folded, "warning"))
    step = _spacing(v)
    if step is not None and step > 0.02 * float(np.std(v)):
        found.append(
            Finding("spacing", where, f"values are {step:.3g} apart ({step / np.std(v):.0%} of the spread)", "info")
        )
    return found


def _longest_run(v: Array) -> int:
    edges = np.flatnonzero(np.concatenate([[True], np.diff(v) != 0, [True]]))
    return int(np.max(np.diff(edges)))


def _rails(v: Array, where: str) -> list[Finding]:
    found = []
    for side, rail in (("highest", v.max()), ("lowest", v.min())):
        share = float(np.mean(v == rail))
        runs = _longest_run(np.where(v == rail, 0.0, np.arange(1, len(v) + 1)))
        if share > _RAIL_SHARE and runs >= 5:
            found.append(
                Finding("rail", where, f"{share:.1%} of the samples sit at the {side} value {rail:.4g}", "warning")
            )
    return found


def _folded(v: Array) -> str | None:
    """Recognise an absolute value: nothing below zero, yet zero is touched again and again with a sharp turn."""
    low, spread = float(v.min()), float(np.ptp(v))
    if low < -0.01 * spread or low > 0.03 * spread:
        return None
    near = v < 0.05 * spread
    visits = int(np.sum(np.diff(near.astype(int)) == 1))
    inside = float(np.mean(near))
    if visits >= 3 and inside < 0.4:
        return f"never negative, yet reaches zero {visits} times: an absolute value or one-sided sensor would do that"
    return None


def _spacing(v: Array) -> float | None:
    distinct = np.unique(v)
    if len(distinct) > 0.2 * len(v) or len(distinct) < 2:
        return None
    return float(np.min(np.diff(distinct)))
