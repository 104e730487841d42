"""Compare how unevenly the rotor disc is loaded: turbulence that differs over the disc is sampled by turning blades.

Tilt and yaw moments below the rotor's frequency grow against the collective one, and what comes near three times a
revolution (as often as there are blades) grows against what is slow. Ratios of powers, so that more or less wind is no
finding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.pair import Pair, Side
from aeolid.models.multiblade import fixed_frame

Array = NDArray[np.float64]
_SLOW = (0.05, 0.6)  # revolutions: the band of slow loads
_NEAR = 0.07  # of the blades' order: the band about it
_PARTS = 5  # of a recording, each of which must show it


@dataclass(frozen=True)
class Disc:
    """Hold logarithms of power ratios, recording over run: of all data and of each part."""

    value: float
    parts: tuple[float, ...]
    uneven: bool  # of tilt and yaw over collective moments; else of the blades' order over slow loads

    @property
    def is_sure(self) -> bool:
        """Tell whether the recording is loaded more unevenly than the run in every part."""
        rules = in_force().run_prior
        least = rules.disc_uneven_log if self.uneven else rules.disc_lines_log
        return self.value > least and min(self.parts) > rules.disc_parts_log

    @property
    def z(self) -> float:
        """Return the logarithm in deviations between runs of one machine."""
        return self.value / in_force().run_prior.disc_spread_log


def disc_of(pair: Pair, context: Mapping[str, Any]) -> Disc | None:
    """Compare both sides; None where neither blade outputs nor the rotor's speed tell."""
    turn, blades = context.get("rated_speed_rad_s"), context.get("blades")
    if not turn or not blades:
        return None
    hz = float(turn) / (2 * np.pi)
    uneven = bool(pair.blades)
    measure = partial(_unevenness, pair, hz) if uneven else partial(_lines, int(blades), hz)
    run = np.mean([measure(s) for s in pair.runs], axis=0)
    whole = np.mean([measure(s) for s in pair.recordings], axis=0)
    parts = [measure(p) for s in pair.recordings for p in _fifths(s)]
    values = [float(np.min(p - run)) for p in parts]
    value = float(np.min(whole - run))
    return Disc(value, tuple(values), uneven) if np.isfinite([value, *values]).all() else None


def _fifths(side: Side) -> list[Side]:
    edges = np.linspace(0, len(side), _PARTS + 1).astype(int)
    return [
        Side(side.u[a:b], side.y[a:b], None if side.azimuth is None else side.azimuth[a:b], side.missing[a:b],
             side.step, side.source)
        for a, b in pairwise(edges)
    ]  # fmt: skip


def _unevenness(pair: Pair, hz: float, side: Side) -> Array:
    y = fixed_frame(side.y, side.azimuth, pair.blades)
    own = y.shape[1] - 3 * len(pair.blades)
    powers = [_power(y[:, own + 3 * k : own + 3 * k + 3], side.step, _band(_SLOW, hz)) for k in range(len(pair.blades))]
    return np.array([np.log(p[1] + p[2]) - np.log(p[0]) for p in powers])


def _lines(blades: int, hz: float, side: Side) -> Array:
    near = _power(side.y, side.step, _band((blades * (1 - _NEAR), blades * (1 + _NEAR)), hz))
    return np.asarray(np.log(near) - np.log(_power(side.y, side.step, _band(_SLOW, hz))))


def _band(orders: Sequence[float], hz: float) -> tuple[float, float]:
    return orders[0] * hz, orders[1] * hz


def _power(y: Array, step: float, band: tuple[float, float]) -> Array:
    f, power = welch(y, 1 / step, nperseg=min(len(y), round(100 / step)), axis=0)
    inside = (f >= band[0]) & (f <= band[1])
    found: Array = power[inside].sum(axis=0) + 1e-300
    return found
