"""Compare the modes of the runs with those of the recordings: what swings in one and not in the other."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts.modes import KINDS
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.pair import Pair, Side
from aeolid.errors import NotIdentifiable
from aeolid.identify.plain import identify_plainly
from aeolid.models.modes import Mode, mark_harmonics
from aeolid.models.multiblade import fixed_frame
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
_STATES = {2: 20}  # by number of outputs; more have more
_MOST_STATES = 40
_BLOCKS = 40  # of a window


@dataclass(frozen=True)
class Absent:
    """Hold a mode that the recordings have and the runs lack, the output that shows it most, its turbine kind or "".

    outputs: those that show it at least half as much.
    """

    frequency_hz: float
    frequency_std_hz: float
    damping: float
    damping_std: float
    output: str
    kind: str = ""
    outputs: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Modal:
    """Hold the modes of both sides, what the runs lack, sharpest first, and both frequency responses for the page."""

    recorded: tuple[Mode, ...]
    simulated: tuple[Mode, ...]
    absent: tuple[Absent, ...]
    responses: tuple[dict[str, Any], ...] = ()


def compare_modes(pair: Pair, context: Mapping[str, Any]) -> Modal:
    """Identify both sides at the rate of the blocks and match their modes; none where either cannot be identified."""
    stride, past = _coarse(pair)
    sides = (pair.recordings, pair.runs)
    records = [_slowed(pair, s, stride) for s in sides]
    order = min(_STATES.get(len(pair.shown), _MOST_STATES), past * len(pair.shown))
    try:
        found = [identify_plainly(r, past=past, order=order, stable=True) for r in records]
    except NotIdentifiable:
        return Modal((), (), ())
    turns = [_turn(s, pair.step, context) for s in sides]
    recorded, simulated = (
        tuple(mark_harmonics(f.modes, hz) if hz else f.modes) for f, hz in zip(found, turns, strict=True)
    )
    highest = in_force().hypotheses.nyquist_share * 0.5 / (pair.step * stride)
    absent = _absent(recorded, simulated, highest, is_turbine(context), turns[0])
    bands = [f.band.to_json(pair.inputs, pair.shown) for f in found if f.band is not None]
    return Modal(recorded, simulated, absent, tuple(bands) if len(bands) == len(sides) else ())


def model_of_runs(pair: Pair) -> tuple[StateSpace, list[Record]] | None:
    """Return the runs' model at the rate of the pair's blocks, and the blocks; None where none can be identified."""
    records = _slowed(pair, pair.runs, pair.stride)
    try:
        order = _STATES.get(len(pair.shown), _MOST_STATES)
        found = identify_plainly(records, past=pair.past, order=order, stable=True, uncertainty="none").model
    except NotIdentifiable:
        return None
    return (found, records) if found.K is not None else None


def _absent(
    recorded: Sequence[Mode], simulated: Sequence[Mode], highest: float, turbine: bool, turn: float | None
) -> tuple[Absent, ...]:  # fmt: skip
    run_modes = in_force().run_modes
    partners = [m for m in simulated if m.damping < run_modes.partner_damping]
    alone: list[Mode] = []
    both: list[Mode] = []
    for m in recorded:
        if m.rotor_order is None and m.frequency_hz < highest and m.damping < run_modes.partner_damping:
            (both if any(_is_same(p, m) for p in partners) else alone).append(m)
    own = [m for m in both if m.damping < run_modes.sharp_damping and not _is_multiple(m.frequency_hz, turn)]
    present = {_kind(m) for m in own} if turbine else set()
    found = []
    for m in alone:
        f, std = m.frequency_hz, m.frequency_std_hz
        if std is None or not 0 < m.damping < run_modes.sharp_damping or std > run_modes.sharp_spread * f:
            continue
        kind = _kind(m) if turbine else ""
        output = max(m.shares, key=lambda name: m.shares[name])
        found.append(
            Absent(f, std, m.damping, m.damping_std or np.inf, output, "" if kind in present else kind, _shown(m))
        )  # fmt: skip
    return tuple(sorted(found, key=lambda a: a.damping))


def _is_multiple(frequency_hz: float, turn: float | None) -> bool:
    """Tell whether a frequency is so near a multiple of the rotor's that blades which pass may be all there is."""
    order = round(frequency_hz / turn) if turn else 0
    near = in_force().run_modes.passing_distance * frequency_hz
    return order >= 1 and turn is not None and abs(frequency_hz - order * turn) < near


def _shown(m: Mode) -> tuple[str, ...]:
    run_modes = in_force().run_modes
    most = max(m.shares.values())
    return tuple(name for name, share in m.shares.items() if share >= run_modes.shown_share * most)


def _kind(m: Mode) -> str:
    """Return which mode of a turbine this is, by the output that shows it most and its frequency, or ""."""
    name = max(m.shares, key=lambda n: m.shares[n]).lower()
    kinds = [k.entry for k in KINDS if re.search(k.pattern, name) and k.band_hz[0] <= m.frequency_hz <= k.band_hz[1]]
    return kinds[0] if kinds else ""


def _is_same(a: Mode, b: Mode) -> bool:
    return abs(a.frequency_hz - b.frequency_hz) <= in_force().run_modes.same_distance * b.frequency_hz and _alike(a, b)


def _alike(a: Mode, b: Mode) -> bool:
    """Tell whether two modes move the outputs in like proportions: fore-aft and side-side are near in frequency."""
    x, y = (np.array([m.shares[n] for n in a.shares]) for m in (a, b))
    return bool(x @ y > in_force().run_modes.same_cosine * np.linalg.norm(x) * np.linalg.norm(y))


def _slowed(pair: Pair, sides: Sequence[Side], stride: int) -> list[Record]:
    """Return means over blocks of inputs and of outputs in the fixed frame, of several regions about each one's own."""
    roles = [("input", n) for n in pair.inputs] + [("output", n) for n in pair.shown]
    channels = tuple(Channel(n, "", role) for role, n in roles)
    step, records = pair.step * stride, []
    for side in sides:
        y = fixed_frame(side.y, side.azimuth, pair.blades)
        n = len(y) // stride
        values = np.hstack([side.u, y])[: n * stride].reshape(n, stride, -1).mean(axis=1)
        if len(pair.offset) > 1:
            values -= values.mean(axis=0)
        values[side.missing[: n * stride].reshape(n, stride).any(axis=1)] = np.nan
        records.append(Record(np.arange(n, dtype=np.float64) * step, values, channels, step, side.source, ""))
    return records


def _turn(sides: Sequence[Side], step: float, context: Mapping[str, Any]) -> float | None:
    """Return the rotor's mean frequency in Hz, of angle or speed where they are recorded, else the rated one."""
    angles = [side.turned for side in sides if side.turned is not None]
    rated = context.get("rated_speed_rad_s")
    return _turning(angles, step) if angles else (float(rated) / (2 * np.pi) if rated else None)


def _coarse(pair: Pair) -> tuple[int, int]:
    """Return samples a block and blocks a window for modes: shorter blocks make modes of noise."""
    window = pair.past * pair.stride
    stride = max(pair.stride, round(window / _BLOCKS))
    return stride, math.ceil(window / stride)


def _turning(angles: Sequence[Array], step: float) -> float:
    """Return the mean rotor frequency in Hz from angles in rad."""
    turned = sum(float(np.unwrap(a)[-1] - np.unwrap(a)[0]) for a in angles)
    return abs(turned) / (2 * np.pi * step * sum(len(a) - 1 for a in angles))
