"""Compare the spectra of both sides' outputs: a mode that the runs lack altogether stands out of them.

Without its first bending mode a simulated tower hardly moves at that frequency, and without its torsion a drive train
turns as one body: the power of the recording exceeds the run's by more than one order of magnitude about the mode's
frequency. Other wind, a drive that lags or a stiffness that is a fifth off changes powers by a factor of four at most.
Bands at the first multiples of the rotor's frequency are left out, where an imbalance or sampled turbulence stands out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.hypotheses.parts.modes import KINDS
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.machine import is_turbine
from aeolid.diagnose.run_prior.modal import Absent, Modal
from aeolid.diagnose.run_prior.pair import Pair, Side
from aeolid.models.modes import Mode
from aeolid.models.multiblade import fixed_frame

Array = NDArray[np.float64]
_TURNS = 12.0  # revolutions of a segment
_LOWEST, _RATIO = 0.4, 1.15  # of the bands, the first in multiples of the rotor's frequency
_NYQUIST = 0.8  # part of the Nyquist frequency up to which bands reach
_LINES, _LINE = 3, 0.05  # multiples of the rotor's frequency that are left out, and how far about them
_KINDS = ("tower_fore_aft", "tower_side_side", "drivetrain_torsion")
_NEAR = 1.3  # ratio of a mode's frequency to the band's within which it is that mode


@dataclass(frozen=True, eq=False)
class Risen:
    """Hold logarithms of power ratios, recording over run, by band and output: of all data, and of two parts."""

    hz: Array
    whole: Array
    chosen: Array
    sealed: Array


def lone_mode(pair: Pair, modal: Modal, context: Mapping[str, Any], fit: float) -> Absent | None:
    """Return the mode of tower or drive train that stands out of the run's spectra, None where none does.

    modal: of both sides, for its frequency and damping; fit: part of each recording that is not sealed.
    """
    turn = context.get("rated_speed_rad_s")
    if not turn or not is_turbine(context):
        return None
    risen = risen_of(pair, float(turn) / (2 * np.pi), fit)
    if risen is None:
        return None
    found = [(float(risen.whole[:, j].max()), j, kind) for j, kind in _kinds(pair)]
    if not found:
        return None
    _, j, kind = max(found)
    band = int(risen.whole[:, j].argmax())
    if not _is_plain(risen, band, j):
        return None
    mode = _nearest(modal.recorded, pair.shown[j], float(risen.hz[band]))
    if mode is None:
        return None
    std = mode.frequency_std_hz or np.inf
    return Absent(mode.frequency_hz, std, mode.damping, mode.damping_std or np.inf, pair.shown[j], kind,
                  (pair.shown[j],))  # fmt: skip


def once_of(pair: Pair, context: Mapping[str, Any]) -> dict[str, float]:
    """Return by output the logarithm of the power once a revolution, recording over run; nothing without a rotor."""
    turn = context.get("rated_speed_rad_s")
    if not turn or not is_turbine(context):
        return {}
    hz = float(turn) / (2 * np.pi)
    length = round(_TURNS / (hz * pair.step))
    f = np.fft.rfftfreq(length, pair.step)
    near = np.abs(f - hz) < max(_LINE, 1.5 / _TURNS) * hz
    powers = [_powers(pair, sides, length, (0.0, 1.0)) for sides in (pair.recordings, pair.runs)]
    if powers[0] is None or powers[1] is None or not near.any():
        return {}
    grown = np.log(powers[0][near].sum(axis=0) + 1e-300) - np.log(powers[1][near].sum(axis=0) + 1e-300)
    return {n: float(v) for n, v in zip(pair.shown, grown, strict=True)}


def _kinds(pair: Pair) -> list[tuple[int, str]]:
    """Return places of outputs that show a mode of tower or drive train, with its entry."""
    kinds = [k for k in KINDS if k.entry in _KINDS]
    found = []
    for j, name in enumerate(pair.shown):
        entry = next((k.entry for k in kinds if re.search(k.pattern, name.lower())), None)
        if entry is not None:
            found.append((j, entry))
    return found


def _is_plain(risen: Risen, band: int, j: int) -> bool:
    """Tell whether one band of an output rises by enough, out of the others, in both parts of the recordings."""
    rules = in_force().run_prior
    rise = risen.whole[band, j]
    out = rise - float(np.median(risen.whole[:, j]))
    both = min(risen.chosen[band, j], risen.sealed[band, j])
    return bool(min(rise, out) > rules.lone_log and both > rules.lone_log / 2)


def _nearest(modes: Sequence[Mode], output: str, hz: float) -> Mode | None:
    """Return the recordings' mode that is nearest to a frequency and shown most by an output, None where none is."""
    near = [
        m for m in modes
        if m.rotor_order is None and 0 < m.damping < in_force().run_modes.partner_damping
        and 1 / _NEAR < m.frequency_hz / hz < _NEAR
    ]  # fmt: skip

    def away(m: Mode) -> float:
        return abs(float(np.log(m.frequency_hz / hz))) + 1 - m.shares[output] / max(m.shares.values())

    return min(near, key=away, default=None)


def risen_of(pair: Pair, hz: float, fit: float) -> Risen | None:
    """Return power ratios of all outputs in bands; None where a side is too short for one of its parts."""
    length = round(_TURNS / (hz * pair.step))
    f = np.fft.rfftfreq(length, pair.step)
    lines = hz * np.arange(1, _LINES + 1)
    free = np.all(np.abs(f[:, None] - lines) > np.maximum(_LINE * lines, 1.5 * hz / _TURNS), axis=1)
    edges = [_LOWEST * hz]
    while edges[-1] * _RATIO < _NYQUIST / (2 * pair.step):
        edges.append(max(edges[-1] * _RATIO, edges[-1] + 2 * hz / _TURNS))
    bands = [inside for a, b in pairwise(edges) if (inside := free & (f >= a) & (f < b)).any()]
    powers = [
        _powers(pair, sides, length, part)
        for sides, part in (
            (pair.runs, (0.0, 1.0)), (pair.recordings, (0.0, 1.0)), (pair.recordings, (0.0, fit)),
            (pair.recordings, (fit, 1.0)),
        )
    ]  # fmt: skip
    if not bands or any(p is None for p in powers):
        return None
    logs = [np.log([p[at].mean(axis=0) + 1e-300 for at in bands]) for p in powers if p is not None]
    return Risen(np.array([f[at].mean() for at in bands]), *(x - logs[0] for x in logs[1:]))


def _powers(pair: Pair, sides: Sequence[Side], length: int, part: tuple[float, float]) -> Array | None:
    """Return spectra (f, l) over Hann windows that overlap by half, of a part of each side; None of none."""
    window, total, count = np.hanning(length)[:, None], np.zeros((length // 2 + 1, len(pair.shown))), 0
    for side in sides:
        y = fixed_frame(side.y, side.azimuth, pair.blades)
        y = y[round(part[0] * len(y)) : round(part[1] * len(y))]
        for a in range(0, len(y) - length + 1, length // 2):
            x = y[a : a + length]
            if not np.isfinite(x).all():
                continue
            total += np.abs(np.fft.rfft(window * (x - x.mean(axis=0)), axis=0)) ** 2
            count += 1
    return total / count if count else None
