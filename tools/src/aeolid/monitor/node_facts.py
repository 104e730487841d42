"""Tell what is known of one node: numbers for charts, and the words that page and terminal share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from aeolid.can.clock import ClockKeeper
from aeolid.filters.settings import HEALTH
from aeolid.monitor.innovations import LAGS, LEVEL
from aeolid.monitor.track import Track, oscillating, round_to
from aeolid.monitor.wording import clock_facts, drift_text, harmonics_text, range_95
from aeolid.wording import plus_minus

if TYPE_CHECKING:
    from aeolid.can import Node
    from aeolid.identify.live import LiveMode

FIT_S = 2.0  # how often drift is worked out anew
QUIET_S = 10.0  # without a message before a node counts as silent, and …
QUIET_STEPS = 20.0  # … so many times the distance of its samples: who sends seldom is not silent in between


class NodeView:
    """Remember of a node what its counters do not say: when snapshots came, and its drift as it was last fitted."""

    def __init__(self) -> None:
        self._snapshots = (0, 0.0)  # so many, the newest then
        self._every: float | None = None  # usual time between two, s
        self._drift = (-FIT_S, "")
        self._heard: tuple[int, float] | None = None  # messages, and when they last became more

    def look(self, node: Node, clocks: ClockKeeper, now: float) -> dict[str, Any]:
        """Return the counters of a node; the reception must not change meanwhile. now: of the monotonic clock, s."""
        facts: dict[str, Any] = {
            "node": node.number, "problem": node.problem or "", "described": node.now is not None,
            "flags": node.flags, "health": {str(k): v for k, v in HEALTH.items()}, "counters": node.counters,
            "messages": node.messages, "contested": node.contested, "refused": node.refused,
        }  # fmt: skip
        facts["silent_s"] = silent = self._silence(node, now)
        talks = "silent" if silent > _patience(node) else "running"
        facts["state"] = (
            "problem" if node.problem else "waiting" if node.now is None else "ended" if node.stopped else talks
        )
        if node.now is None:
            return facts
        d, samples, snapshots = node.now.description, node.now.samples, node.now.snapshots
        lost = samples.lost(d.sample_every)
        return facts | {
            "method": d.method, "model_set": d.model_set.upper(), "past": d.past, "sample_time_s": d.sample_time_s,
            "forgetting": round_to(d.forgetting, 9), "regularisation": round_to(d.regularisation, 9),
            "regressors": d.regressors,
            "inputs": d.names[: d.inputs], "outputs": d.names[d.inputs : d.inputs + d.outputs], "units": d.units,
            "block": _block_names(d), "hash": f"{d.configuration_hash:08x}",
            "samples": samples.arrived // d.channels, "lost": lost,
            "lost_share": lost / max(lost + samples.arrived, 1),
            "snapshots": {
                "complete": snapshots.completed, "incomplete": snapshots.incomplete + snapshots.damaged,
                "repaired": snapshots.repaired, "age_s": self._age(snapshots.completed, now), "every_s": self._every,
                "sample": None if snapshots.complete is None else snapshots.complete.sample_index,
            },
            "clock": self._clock(node.number, clocks, now),
        }  # fmt: skip

    def _silence(self, node: Node, now: float) -> float:
        """Return for how long nothing has come of a node, s."""
        if self._heard is None or node.messages != self._heard[0]:
            self._heard = node.messages, now
        return now - self._heard[1]

    def _age(self, completed: int, now: float) -> float | None:
        before, at = self._snapshots
        if completed != before:
            if before:
                self._every = (now - at) / max(completed - before, 1)
            self._snapshots = before, at = completed, now
        return now - at if completed else None

    def _clock(self, number: int, clocks: ClockKeeper, now: float) -> str:
        at, text = self._drift
        if now - at >= FIT_S:
            runs = clocks.runs(number)
            fit = runs[-1].fit() if runs else None
            text = "" if fit is None or fit.drift_ppm is None else drift_text(clock_facts(fit))
            self._drift = now, text
        return text


def _patience(node: Node) -> float:
    """Return after how many seconds without a message a node counts as silent."""
    d = None if node.now is None else node.now.description
    return max(QUIET_S, 0.0 if d is None else QUIET_STEPS * d.sample_time_s * max(d.sample_every, 1))


def node_facts(
    part: dict[str, Any], track: Track | None, why: str, modes: tuple[LiveMode, ...], more: dict[str, Any]
) -> dict[str, Any]:
    """Add modes and tests to the counters of a node. why: it has no modes, empty where it has; more: facts of them."""
    facts = part | {"modes_waiting": why, "modes": [_mode(m) for m in oscillating(modes)]}
    facts["harmonics"] = harmonics_text(modes)
    facts |= {"left_out": more.get("left_out", 0), "order": more.get("order"), "time_s": more.get("time_s")}
    facts["modes_note"] = more.get("no_deviations_because") or ""
    facts["runs"] = 1 if track is None else track.run + 1
    facts["innovations"] = _tests(part, track)
    return facts


def _mode(m: LiveMode) -> dict[str, Any]:
    mode = m.mode
    percent = None if mode.damping_std is None else 100 * mode.damping_std
    return {
        "mode": m.number, "frequency_hz": _finite(mode.frequency_hz),
        "frequency_std_hz": _finite(mode.frequency_std_hz), "damping": _finite(mode.damping),
        "damping_std": _finite(mode.damping_std),
        "frequency": plus_minus(mode.frequency_hz, mode.frequency_std_hz),
        "frequency_95": range_95(mode.frequency_hz, mode.frequency_std_hz),
        "damping_percent": plus_minus(100 * mode.damping, percent),
        "damping_95": range_95(100 * mode.damping, percent),
        "mostly_in": max(mode.shares, key=lambda name: mode.shares[name]), "name": mode.name,
    }  # fmt: skip


def _tests(part: dict[str, Any], track: Track | None) -> dict[str, Any]:
    """Return the newest test of the innovations of each output."""
    facts: dict[str, Any] = {
        "waiting": "waiting for samples" if track is None else track.waiting,
        "caution": "" if track is None else track.caution, "rows": [], "blocks": 0, "lags": LAGS, "level": LEVEL,
        "bound": None, "low": None, "high": None,
    }  # fmt: skip
    if track is None or track.block is None:
        return facts
    b, units = track.block, part["units"][len(part["inputs"]) :]
    outside = np.sum(track.blocks, axis=0)
    now = b.outside()
    facts["rows"] = [
        {
            "output": name, "unit": unit, "deviation": f"{b.deviation[i]:.3g}", "whiteness": _short(b.whiteness[i]),
            "ratio": _short(b.ratio[i]), "outside": outside[:, i].tolist(), "now": now[:, i].tolist(),
        }
        for i, (name, unit) in enumerate(zip(part["outputs"], units, strict=False))
    ]  # fmt: skip
    high = None if not np.isfinite(b.high) else round_to(b.high, 4)
    return facts | {"blocks": len(track.blocks), "bound": round_to(b.bound, 4), "low": round_to(b.low, 4), "high": high}


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def _short(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "–"


def _block_names(d: Any) -> list[str]:
    outputs = [*d.names[d.inputs : d.inputs + d.outputs]]
    innovations = [f"e of {name}" for name in outputs] if d.model_set == "varmax" else []
    return [*d.names[: d.inputs], *outputs, *innovations]
