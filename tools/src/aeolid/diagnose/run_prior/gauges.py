"""Tell a gauge of one blade whose zero is off or drifts, from how the blades' mean loads stand among each other.

Zeros of strain gauges at blade roots move with temperature and with every remounting. In the fixed frame the zero of
one blade turns once a revolution, as a blade that is pitched otherwise does; but that one shakes tower and shaft, too.
Settled before anything else is looked for, since a zero is no part of a machine's dynamics.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.beside import without
from aeolid.diagnose.run_prior.hypotheses import all_hypotheses
from aeolid.diagnose.run_prior.pair import Change, Pair, Side
from aeolid.diagnose.run_prior.search import Search
from aeolid.diagnose.run_prior.standing import Standing, proof_of_shift
from aeolid.record import Record

Array = NDArray[np.float64]
_TURNS = 8.0  # revolutions of a stretch, whose mean over the turn is hardly the turn's
_LEAST = 6  # stretches of a side
_ONE = 1.5  # a blade's zero over its load less the mean of three, of which it is one


@dataclass(frozen=True)
class Gauge:
    """Hold the zero of one blade's gauge: value in the channel's unit at the start, rate a second, deviations.

    sealed: the same zero in the sealed part, with its deviation, and what the part before foretells; mean: the load
    that the runs have.
    """

    channel: str
    bias: float
    bias_std: float
    rate: float
    rate_std: float
    sealed: tuple[float, float, float]
    mean: float

    @property
    def drifts(self) -> bool:
        """Tell whether the zero moves."""
        return self.rate != 0.0

    def corrected(self, record: Record) -> Record:
        """Return a recording with the zero put right."""
        values = record.values.copy()
        at = [c.name for c in record.channels].index(self.channel)
        values[:, at] -= self.bias + self.rate * (record.time_s - record.time_s[0])
        return replace(record, values=values)

    def standing(self, unit: str) -> Standing:
        """Return what the diagnosis tells of it."""
        z, std, foretold = self.sealed
        nats = 0.5 * (z**2 - (z - foretold) ** 2) / std**2
        entry, name, value = ("sensor_drift", "rate_per_s", (self.rate, self.rate_std)) if self.drifts else (
            "sensor_bias", "bias", (self.bias, self.bias_std))  # fmt: skip
        per = f"{unit}/s" if self.drifts else unit
        verb = "drifts by" if self.drifts else "is off by"
        words = (
            f"the zero of {self.channel} {verb} {value[0]:+.3g} {per} against those of the other blades, while tower"
            " and shaft turn as in the simulation: its gauge, and not the blade, is another"
        )
        return Standing(
            (entry,), {entry: f"output:{self.channel}"}, {entry: {name: value}}, {entry: words},
            *proof_of_shift(z / std, nats), beside=True, units={name: per}, fault=True,
        )  # fmt: skip


def gauge_of(pair: Pair, context: Mapping[str, Any], fit: float) -> Gauge | None:
    """Return the gauge of one blade whose zero is off, None where no blade's mean load is another alone.

    Nor where a factor on the blade's load explains more, or where tower and shaft have a load once a revolution that
    the simulation lacks or are not recorded: a blade that is pitched otherwise has another mean load, too. Cost: of
    means; where a blade stands out, the moments of three searches.
    """
    turn = context.get("rated_speed_rad_s")
    if not turn or not pair.blades:
        return None
    length = 2 * np.pi * _TURNS / float(turn)
    found = [g for places in pair.blades if (g := _odd(pair, places, length, fit)) is not None]
    if not found or _turns(pair):
        return None
    gauge = max(found, key=lambda g: abs(g.sealed[0]) / g.sealed[1])
    return None if _is_scaled(pair, gauge) else gauge


def _odd(pair: Pair, places: tuple[int, ...], length: float, fit: float) -> Gauge | None:
    """Return the one blade of a set that stands apart in the recordings and not in the runs."""
    rules = in_force().run_prior
    recorded = [_stretches(s, places, length) for s in pair.recordings]
    means, times = (np.concatenate(x) for x in zip(*recorded, strict=True))
    runs = np.concatenate([_stretches(s, places, length)[0] for s in pair.runs])
    late = [t > fit * len(s) * s.step for (_, t), s in zip(recorded, pair.recordings, strict=True)]
    sealed = np.concatenate(late)
    if len(places) != 3 or min(len(means), len(runs)) < _LEAST or not 1 < sealed.sum() < len(times) - 1:
        return None
    usual = runs - runs.mean(axis=1, keepdims=True)
    apart = _ONE * (means - means.mean(axis=1, keepdims=True) - usual.mean(axis=0))
    mean = apart.mean(axis=0)
    k = int(np.abs(mean).argmax())
    if np.ptp(np.delete(mean, k)) > rules.explained_share * abs(mean[k]):
        return None  # two blades stand apart
    own = _ONE * float(usual[:, k].std(ddof=1)) / np.sqrt(len(runs))
    gauge = _zero_of(times, apart[:, k], sealed, own)
    size = abs(gauge.rate) * float(np.ptp(times)) if gauge.drifts else abs(gauge.bias)
    sure = abs(mean[k]) > rules.law_sure_deviations * gauge.bias_std
    large = size > rules.thrust_shift * abs(float(runs.mean()))
    return replace(gauge, channel=pair.outputs[places[k]], mean=float(runs[:, k].mean())) if sure and large else None


def _zero_of(times: Array, apart: Array, sealed: NDArray[np.bool_], own: float) -> Gauge:
    """Return the zero that a blade's means stand apart by; own: deviation of the same in the runs."""
    line, rate_std, left = _line(times, apart)
    span = float(np.ptp(times))
    rate_std = float(np.hypot(rate_std, 2 * own / span))
    sure = abs(line[1]) > in_force().run_prior.law_sure_deviations * rate_std
    drifts = sure and abs(line[1]) * span > 2 * abs(line[0])  # a zero that is off from the start may move a little
    early = _line(times[~sealed], apart[~sealed])[0] @ [1.0, times[sealed].mean()] if drifts else apart[~sealed].mean()
    std, late_std = (float(np.hypot(left / np.sqrt(n), own)) for n in (len(times), sealed.sum()))
    late = float(apart[sealed].mean()), late_std, float(early)
    bias, rate = (line[0], line[1]) if drifts else (apart.mean(), 0.0)
    return Gauge("", float(bias), std, float(rate), rate_std, late, 0.0)


def _line(times: Array, values: Array) -> tuple[Array, float, float]:
    """Return start and slope of a line, the slope's deviation, and the deviation of what is left."""
    rows = np.column_stack([np.ones(len(times)), times])
    normal = np.linalg.inv(rows.T @ rows)
    line = normal @ rows.T @ values
    left = float(np.sqrt(np.sum((values - rows @ line) ** 2) / max(len(times) - 2, 1)))
    return line, left * float(np.sqrt(normal[1, 1])), left


def _stretches(side: Side, places: Sequence[int], length: float) -> tuple[Array, Array]:
    """Return means (n, 3) of the blades' outputs in stretches without a missing sample, and their middle times in s."""
    count = max(round(length / side.step), 1)
    n = len(side) // count
    y = np.where(side.missing[:, None], np.nan, side.y[:, list(places)])[: n * count].reshape(n, count, len(places))
    whole = np.isfinite(y).all(axis=(1, 2))
    means: Array = y[whole].mean(axis=1)
    times: Array = np.asarray((np.arange(n) + 0.5) * (count * side.step), np.float64)
    return means, times[whole]


def _is_scaled(pair: Pair, gauge: Gauge) -> bool:
    """Tell whether a factor on the run's load of that blade gains more than the zero, both with the mean they explain.

    A factor moves the loads that go round with the rotor, too, a zero none of them.
    """
    if gauge.drifts or not gauge.mean:
        return False
    j, factor = pair.outputs.index(gauge.channel), 1.0 + gauge.bias / gauge.mean
    search = Search(pair)
    zero, scaled = (
        search.evidence_of(Change(outputs={j: by})) for by in (lambda x, _: x + gauge.bias, lambda x, _: x * factor)
    )
    return scaled > zero


def _turns(pair: Pair) -> bool:
    """Tell whether outputs beside the blades have a load once a revolution that the runs lack, or cannot show it."""
    single = len(pair.shown) - 3 * len(pair.blades)
    if single < 2 or any(s.azimuth is None for s in (*pair.recordings, *pair.runs)):
        return True
    rest = without(pair, set(pair.shown[single:]))
    assert rest is not None
    search = Search(rest)
    load = next((h for h in all_hypotheses(rest, {}) if h.entry == "mass_imbalance"), None)
    return load is None or search.gain(load, ())[0] > 0.0
