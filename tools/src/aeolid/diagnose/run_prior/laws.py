"""Hold laws between slow means against each other: what wind, angle and speed hold at rest, in run and recording.

A predictor leaves its constant free and windows of a revolution forget, so that what only moves a level is not seen by
them. Here means over 10 s of a channel are a polynomial of those of others in the run; the recording's distance from it
counts where the run has been, so that another mean wind is no finding. Deviations allow for what neighbouring means
have in common.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.rotor_frame import blade_sets
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.search import FIT
from aeolid.models.angles import radians_a_unit
from aeolid.models.multiblade import fixed_frame
from aeolid.record import Record

Array = NDArray[np.float64]
SPAN = 10.0  # s of a mean
SPEEDS = ("m/s", "km/h", "kn", "mph", "ft/s")  # units of a wind
_RIDGE = 1e-3  # of the run's means


@dataclass(frozen=True)
class Shift:
    """Hold by how much a channel's level lies off the run's law, over all data and over the sealed part.

    law: `wind`, `thrust`, `thrust without wind`, `tilt`, `yaw`; channel: its name; level: of the run; value, deviation:
    in the channel's unit; sealed, sealed_deviation: of the sealed part alone; chosen: of the rest.
    """

    law: str
    channel: str
    level: float
    value: float
    deviation: float
    chosen: float
    sealed: float
    sealed_deviation: float

    @property
    def share(self) -> float:
        """Return the shift in parts of the level."""
        return self.value / self.level

    @property
    def z(self) -> float:
        """Return the shift in deviations, of all data."""
        return self.value / self.deviation

    @property
    def nats(self) -> float:
        """Return what the shift of the rest gains on the sealed part."""
        d = self.sealed_deviation
        return 0.5 * float((self.sealed / d) ** 2 - ((self.sealed - self.chosen) / d) ** 2)

    @property
    def is_sure(self) -> bool:
        """Tell whether both parts bear the shift out."""
        rules = in_force().run_prior
        sure = abs(self.z) > rules.law_sure_deviations and self.sealed * self.value > 0
        return sure and abs(self.sealed) > in_force().evidence.moved_deviations * self.sealed_deviation


def shifts_of(records: Sequence[Record], runs: Sequence[Record], context: Mapping[str, Any]) -> dict[str, Shift]:
    """Return by law how far the recordings lie off the runs', for the laws that channels and region allow."""
    first = records[0]
    wind = wind_of(first, runs[0])
    sets = blade_sets(first, context)
    names = tuple(n for n in first.names("output") if all(n not in blades for _, blades in sets))
    held = (*first.names("input"), *(n for n in names if _has_level(runs, n)))
    laws: list[tuple[str, str, int | None, tuple[str, ...]]] = []
    if wind:
        laws.append(("wind", wind, None, held))
    if sets:
        known = (*held, wind) if wind else held
        stem = sets[0][0]
        if wind:
            laws.append(("thrust", stem, 0, known))
        laws += [("thrust without wind", stem, 0, held), ("tilt", stem, 1, known), ("yaw", stem, 2, known)]
    found = {}
    for law, channel, part, by in laws:
        blades = sets[0][1] if part is not None else (channel,)
        means = [[_means(r, by, blades, part) for r in group] for group in (records, runs)]
        shift = _shift(law, channel, means[0], np.vstack(means[1]))
        if shift is not None:
            found[law] = shift
    return found


def wind_of(record: Record, run: Record) -> str:
    """Return the recorded wind that is no input already and that the run has too, or ""."""
    has = {c.name for c in run.channels}
    for c in record.of("scheduling", "disturbance"):
        if c.unit in SPEEDS and c.name in has and np.nanstd(record.column(c.name)) > 0:
            return c.name
    return ""


def _has_level(runs: Sequence[Record], name: str) -> bool:
    y = np.concatenate([r.column(name) for r in runs])
    return bool(abs(np.nanmean(y)) > in_force().run_prior.level_deviations * np.nanstd(y))


def _means(record: Record, by: Sequence[str], target: Sequence[str], part: int | None) -> Array:
    """Return means (n, k + 1) over SPAN of the channels that say the state, and last of the target; whole ones only."""
    y = record.columns(target)
    if part is not None:
        name = record.names("azimuth")[0]
        angle = record.column(name)
        angle = angle * radians_a_unit(record.unit(name), angle)
        y = fixed_frame(y, angle, (tuple(range(len(target))),))[:, part : part + 1]
    values = np.hstack([record.columns(by), y])
    span = max(1, round(SPAN / record.sample_time_s))
    n = len(values) // span
    means: Array = values[: n * span].reshape(n, span, -1).mean(axis=1)
    return means[np.all(np.isfinite(means), axis=1)]


def _shift(law: str, channel: str, recorded: Sequence[Array], run: Array) -> Shift | None:
    rules = in_force().run_prior
    x = run[:, :-1]
    centre, spread = x.mean(axis=0), x.std(axis=0)
    moves = spread > 1e-9 * (1 + np.abs(centre))
    if len(run) < rules.law_means or not moves.any():
        return None
    centre, spread = centre[moves], spread[moves]
    F = _features((x[:, moves] - centre) / spread)
    H = F.T @ F + _RIDGE * len(F) * np.diag([0.0] + [1.0] * (F.shape[1] - 1))
    theta = np.linalg.solve(H, F.T @ run[:, -1])
    rest = run[:, -1] - F @ theta
    noise = rest.var() * len(F) / max(len(F) - F.shape[1], 1) * _in_common(rest)
    parts: tuple[list[Array], list[Array]] = ([], [])
    for means in recorded:
        z = (means[:, :-1][:, moves] - centre) / spread
        off = np.column_stack([means[:, -1] - _features(z) @ theta, _features(z)])
        cut = round(FIT * len(off))
        good = np.all(np.abs(z) < rules.law_within_deviations, axis=1)
        parts[0].append(off[:cut][good[:cut]])
        parts[1].append(off[cut:][good[cut:]])
    chosen, sealed = (np.vstack(p) for p in parts)
    both = np.vstack([chosen, sealed])
    least = max(rules.law_means, rules.law_shared * sum(map(len, recorded)))
    if len(both) < least or len(sealed) < 4:
        return None

    def of(off: Array) -> tuple[float, float]:
        f = off[:, 1:].mean(axis=0)
        own = max(both[:, 0].var(), 1e-300) * _in_common(both[:, 0]) / len(off)
        return float(off[:, 0].mean()), float(np.sqrt(own + noise * f @ np.linalg.solve(H, f)))

    (value, deviation), (late, late_deviation) = of(both), of(sealed)
    level = float(run[:, -1].mean())
    return Shift(law, channel, level, value, deviation, of(chosen)[0], late, late_deviation)


def _features(z: Array) -> Array:
    pairs = combinations_with_replacement(range(z.shape[1]), 2)
    return np.column_stack([np.ones(len(z)), z, *(z[:, i] * z[:, j] for i, j in pairs)])


def _in_common(rest: Array) -> float:
    """Return by how much the variance of a mean exceeds that of independent values: means of four in a row tell."""
    n = len(rest) // 4
    if n < 4 or rest.var() <= 0:
        return 2.0
    fours = rest[: 4 * n].reshape(n, 4).mean(axis=1)
    return float(np.clip(4 * fours.var(ddof=1) / rest.var(), 1.0, 4.0))
