"""Compare the modes of the runs with those of the recordings: what swings in one and not in the other."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.catalogue.modes import KINDS
from aeolid.diagnose.run_prior.machine import is_turbine
from aeolid.diagnose.run_prior.pair import Pair, Side, fixed_frame
from aeolid.errors import NotIdentifiable
from aeolid.identify.plain import identify_plainly
from aeolid.models.modes import Mode, mark_harmonics
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
SHARP_DAMPING, SHARP_SPREAD = 0.1, 0.01  # most damping and relative deviation of a mode that is compared
LOOSE_DAMPING = 0.3  # of a partner
SAME = 0.06  # relative distance within which modes are one
ALIKE = 0.6  # cosine between the outputs' shares of modes that are one
_STATES = {2: 20}  # by number of outputs; more have more
_MOST_STATES = 40
_BLOCKS = 40  # of a window
_HIGHEST = 0.4  # of the blocks' rate: nearer to half of it a mode may be the image of a faster one


@dataclass(frozen=True)
class Absent:
    """Hold a mode that the recordings have and the runs lack, the output that shows it most, its turbine kind or ""."""

    frequency_hz: float
    frequency_std_hz: float
    damping: float
    damping_std: float
    output: str
    kind: str = ""


@dataclass(frozen=True, eq=False)
class Modal:
    """Hold the modes of both sides and what the runs lack, sharpest first."""

    recorded: tuple[Mode, ...]
    simulated: tuple[Mode, ...]
    absent: tuple[Absent, ...]


def compare_modes(pair: Pair, context: Mapping[str, Any]) -> Modal:
    """Identify both sides at the rate of the blocks and match their modes; none where either cannot be identified."""
    turn = context.get("rated_speed_rad_s")
    try:
        recorded, simulated = (_modes(pair, sides, turn) for sides in (pair.recordings, pair.runs))
    except NotIdentifiable:
        return Modal((), (), ())
    highest = _HIGHEST / (pair.step * _coarse(pair)[0])
    return Modal(recorded, simulated, _absent(recorded, simulated, highest, is_turbine(context)))


def _absent(
    recorded: Sequence[Mode], simulated: Sequence[Mode], highest: float, turbine: bool
) -> tuple[Absent, ...]:  # fmt: skip
    partners = [m for m in simulated if m.damping < LOOSE_DAMPING]
    alone: list[Mode] = []
    both: list[Mode] = []
    for m in recorded:
        if m.rotor_order is None and m.frequency_hz < highest and m.damping < LOOSE_DAMPING:
            (both if any(_is_same(p, m) for p in partners) else alone).append(m)
    present = {_kind(m) for m in both if m.damping < SHARP_DAMPING} if turbine else set()
    found = []
    for m in alone:
        f, std = m.frequency_hz, m.frequency_std_hz
        if std is None or not 0 < m.damping < SHARP_DAMPING or std > SHARP_SPREAD * f:
            continue
        kind = _kind(m) if turbine else ""
        output = max(m.shares, key=lambda name: m.shares[name])
        found.append(
            Absent(f, std, m.damping, m.damping_std or np.inf, output, "" if kind in present else kind)
        )  # fmt: skip
    return tuple(sorted(found, key=lambda a: a.damping))


def _kind(m: Mode) -> str:
    """Return which mode of a turbine this is, by the output that shows it most and its frequency, or ""."""
    name = max(m.shares, key=lambda n: m.shares[n]).lower()
    kinds = [k.entry for k in KINDS if re.search(k.pattern, name) and k.band_hz[0] <= m.frequency_hz <= k.band_hz[1]]
    return kinds[0] if kinds else ""


def _is_same(a: Mode, b: Mode) -> bool:
    return abs(a.frequency_hz - b.frequency_hz) <= SAME * b.frequency_hz and _alike(a, b)


def _alike(a: Mode, b: Mode) -> bool:
    """Tell whether two modes move the outputs in like proportions: fore-aft and side-side are near in frequency."""
    x, y = (np.array([m.shares[n] for n in a.shares]) for m in (a, b))
    return bool(x @ y > ALIKE * np.linalg.norm(x) * np.linalg.norm(y))


def _modes(pair: Pair, sides: Sequence[Side], turn: float | None) -> tuple[Mode, ...]:
    roles = [("input", n) for n in pair.inputs] + [("output", n) for n in pair.shown]
    channels = tuple(Channel(n, "", role) for role, n in roles)
    stride, past = _coarse(pair)
    step, records = pair.step * stride, []
    for side in sides:
        y = fixed_frame(side.y, side.azimuth, pair.blades)
        n = len(y) // stride
        values = np.hstack([side.u, y])[: n * stride].reshape(n, stride, -1).mean(axis=1)
        values[side.missing[: n * stride].reshape(n, stride).any(axis=1)] = np.nan
        records.append(Record(np.arange(n, dtype=np.float64) * step, values, channels, step, side.source, ""))
    order = min(_STATES.get(len(pair.shown), _MOST_STATES), past * len(pair.shown))
    found = identify_plainly(records, past=past, order=order, stable=True).modes
    rates = [side.azimuth for side in sides if side.azimuth is not None]
    hz = _turning(rates, pair.step) if rates else (turn / (2 * np.pi) if turn else None)
    return tuple(mark_harmonics(found, hz)) if hz else tuple(found)


def _coarse(pair: Pair) -> tuple[int, int]:
    """Return samples a block and blocks a window for modes: shorter blocks make modes of noise."""
    window = pair.past * pair.stride
    stride = max(pair.stride, round(window / _BLOCKS))
    return stride, math.ceil(window / stride)


def _turning(angles: Sequence[Array], step: float) -> float:
    """Return the mean rotor frequency in Hz from angles in rad."""
    turned = sum(float(np.unwrap(a)[-1] - np.unwrap(a)[0]) for a in angles)
    return abs(turned) / (2 * np.pi * step * sum(len(a) - 1 for a in angles))
