"""Choose rate and window of a pair: windows hold a period of the slowest mode, blocks are as long as that allows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from aeolid.diagnose.data.machine import blades_of
from aeolid.diagnose.data.rotor_frame import blade_sets
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.floors import in_blocks, sensor_noise
from aeolid.diagnose.run_prior.pair import Pair, Side, side_of
from aeolid.diagnose.run_prior.regions import in_regions
from aeolid.errors import NotIdentifiable
from aeolid.identify.plain import identify_plainly
from aeolid.models.modes import Mode
from aeolid.models.multiblade import fixed_frame
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
LONGEST = 90  # blocks of a window: in longer blocks a lag of 0.3 s was 0.34, a delay of 0.25 s 0.237
_COARSE = 40  # blocks of a window in which modes are looked for
_PERIODS = 1.3  # of the slowest mode in a window: one, and what its damping adds
_REVOLUTION = 0.9  # of the rotor at rated speed in a window
_CONTENT, _PER_PERIOD = 0.95, 3.0  # of an output's power below the frequency that has so many blocks a period
_ORDER = 16  # states of the models that the slowest mode is read from
_FEWEST = 600  # blocks of the shortest side


def pair_of(records: Sequence[Record], runs: Sequence[Record], context: Mapping[str, Any]) -> Pair:
    """Return recordings and runs as windows see them; channels are those of the first recording's roles.

    Runs in other conditions (wind speeds) make regions, and each recording belongs to the nearest one.

    Raises NotIdentifiable where a side is too short for the windows.
    """
    first = records[0]
    inputs, outputs = first.names("input"), first.names("output")
    sets = blade_sets(first, context)
    blades = tuple(tuple(outputs.index(n) for n in names) for _, names in sets)
    dropped = {n for _, names in sets for n in names}
    shown = tuple(n for n in outputs if n not in dropped)
    shown += tuple(f"{stem}_{part}" for stem, _ in sets for part in ("collective", "cosine", "sine"))
    known = _disturbances(records, runs)
    recorded, simulated = (
        tuple(side_of(r, inputs, outputs, context, known) for r in group) for group in (records, runs)
    )
    recorded, simulated = in_regions(recorded, simulated)
    step = first.sample_time_s
    bare = Pair(inputs, outputs, shown, recorded, simulated, step, 1, 1, blades, np.zeros((1, 1)), np.ones(1), known,
                passing=blades_of(context))  # fmt: skip
    stride, past = _window(window_s(bare, context), step, min(map(len, (*recorded, *simulated))))
    pair = _scaled(replace(bare, stride=stride, past=past), runs[0].source)
    noise = in_blocks(pair, sensor_noise(pair)) / pair.scale[pair.held :]
    return replace(pair, noise=noise) if np.any(noise > 0) else pair


def _scaled(bare: Pair, source: str) -> Pair:
    """Return the pair with the runs' mean in each region and their deviations about these."""
    regions = [[s for s in bare.runs if s.region == k] for k in range(1 + max(s.region for s in bare.runs))]
    blocks = [np.vstack([bare.blocks(s, s.u, s.y) for s in sides]) for sides in regions]
    offset = np.stack([z.mean(axis=0) for z in blocks])
    scale = np.vstack([z - mean for z, mean in zip(blocks, offset, strict=True)]).std(axis=0)
    for k, (name, size) in enumerate(zip(_names(bare), scale, strict=True)):
        if not size > 1e-12 * (1 + float(np.abs(offset[:, k]).max())):
            raise NotIdentifiable(f"{source}: {name} never changes in the simulation; leave the channel out")
    return replace(bare, offset=offset, scale=scale)


def _disturbances(records: Sequence[Record], runs: Sequence[Record]) -> tuple[str, ...]:
    """Return the disturbances that both sides have and that change in all of them: wind, waves."""
    sides = (*records, *runs)

    def moves(r: Record, name: str) -> bool:
        values = r.column(name)
        return bool(np.isfinite(values).any() and np.nanmax(values) > np.nanmin(values))

    common = [n for n in records[0].names("disturbance") if all(n in r.names("disturbance") for r in sides)]
    return tuple(n for n in common if all(moves(r, n) for r in sides))


def _names(pair: Pair) -> list[str]:
    return [n for _ in range(pair.stride) for n in pair.inputs] + [*pair.disturbances, *pair.shown]


def slowest_mode(pair: Pair) -> float:
    """Return the frequency in Hz of the slowest lightly damped mode of either side.

    Looked for in windows of 40 blocks with three blocks a period of the outputs' fastest content; never below what
    such a window holds, nor above twice its length's inverse.
    """
    stride = _coarse(pair)
    reach = _PERIODS / (_COARSE * pair.step * stride)
    rates = [
        m.frequency_hz
        for sides in (pair.runs, pair.recordings)
        for m in _modes(pair, sides, stride)
        if m.damping < in_force().run_modes.partner_damping and m.frequency_hz > reach
    ]
    return min([*rates, 2 * reach])


def _modes(pair: Pair, sides: Sequence[Side], stride: int) -> Sequence[Mode]:
    names = [("input", n) for n in pair.inputs] + [("output", n) for n in pair.shown]
    channels = tuple(Channel(n, "", role) for role, n in names)
    slow = []
    for side in sides:
        y = fixed_frame(side.y, side.azimuth, pair.blades)
        n = len(y) // stride
        values = np.hstack([side.u, y])[: n * stride].reshape(n, stride, -1).mean(axis=1)
        slow.append(
            Record(
                np.arange(n, dtype=np.float64) * pair.step * stride,
                values,
                channels,
                pair.step * stride,
                side.source,
                "",
            )
        )
    past = min(_COARSE, min(map(len, slow)) // 20)
    return identify_plainly(slow, past=past, order=min(_ORDER, past), stable=True).modes


def _coarse(pair: Pair) -> int:
    """Return samples a block so that three blocks remain a period of the outputs' fastest content."""
    fastest = 0.0
    for side in pair.runs:
        y = fixed_frame(side.y, side.azimuth, pair.blades)
        f, power = welch(y, 1 / pair.step, nperseg=min(2048, len(y)), axis=0)
        share = np.cumsum(power[1:], axis=0)
        for j in np.flatnonzero(share[-1] > 0):
            fastest = max(fastest, float(f[1:][np.searchsorted(share[:, j], _CONTENT * share[-1, j])]))
    most = min(len(s) for s in (*pair.runs, *pair.recordings)) // _FEWEST
    return max(1, min(int(1 / (pair.step * _PER_PERIOD * fastest)) if fastest > 0 else 1, most))


def window_s(pair: Pair, context: Mapping[str, Any]) -> float:
    """Return the length of the windows in s: of a turbine most of a revolution, else what holds the slowest mode.

    Towers are built to swing between once and three times a revolution (soft–stiff), so that a revolution holds a
    period of theirs whatever the machine's size.
    """
    speed = context.get("rated_speed_rad_s")
    if speed and context.get("blades"):
        return _REVOLUTION * 2 * np.pi / float(speed)
    return _PERIODS / slowest_mode(pair)


def _window(length: float, step: float, shortest: int) -> tuple[int, int]:
    """Return samples a block and blocks a window."""
    stride = max(1, round(length / (LONGEST * step)))
    stride = max(1, min(stride, shortest // _FEWEST))
    past = int(np.clip(np.ceil(length / (stride * step)), 8, round(1.25 * LONGEST)))
    return stride, past
