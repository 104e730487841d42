"""Compare the spectra of both sides' outputs: a mode that the runs lack stands out of them, altogether or locally.

Without its first bending mode a simulated tower hardly moves at that frequency, and without its torsion a drive train
turns as one body: the power of the recording exceeds the run's by more than one order of magnitude about the mode's
frequency. Other wind, a drive that lags or a stiffness that is a fifth off changes powers by a factor of four at most.
Bands at the first multiples of the rotor's frequency are left out, where an imbalance or sampled turbulence stands out.

A further mode of many, a tower's second one, adds little to an output's power and to its errors one row ahead, but the
ratio of powers is larger at its frequency than on either side of it, where wind that differs goes on.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts.modes import KINDS
from aeolid.diagnose.rules import in_force
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
_PERIODS = 70.0  # of a mode in a segment, where its surroundings are looked at: its band has three bins
_HALF, _BROAD = 0.02, 1.5  # half of that band: of the frequency, or in half-widths of the resonance, the larger
_GAP, _SHOULDER = 1.5, 3.0  # in halves of the band: where its surroundings begin and end, a tenth of it farther
_Z90 = 1.6449
_INDEPENDENT = 0.7  # of the bins and segments that overlap by half behind a Hann window
_NEAR = 1.3  # ratio of a mode's frequency to the band's within which it is that mode


@dataclass(frozen=True, eq=False)
class Risen:
    """Hold logarithms of power ratios, recording over run, by band and output: of all data, and of two parts.

    power: the logarithm of the recordings' own power.
    """

    hz: Array
    power: Array
    whole: Array
    chosen: Array
    sealed: Array


def lone_mode(
    pair: Pair, modal: Modal, context: Mapping[str, Any], fit: float, least: float = 0.0
) -> Absent | None:  # fmt: skip
    """Return the mode of tower or drive train that stands out of the run's spectra, None where none does.

    modal: of both sides, for its frequency and damping; fit: part of each recording that is not sealed; least: growth
    of the power's logarithm that is asked for. Where the run's output hardly moves at all, the band that grows most
    says little of the mode, and the one of most power among those that stand out does.
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
    if not _is_plain(risen, band, j) or risen.whole[band, j] < least:
        return None
    loudest = max((b for b in range(len(risen.hz)) if _is_plain(risen, b, j)), key=lambda b: float(risen.power[b, j]))
    near = (_nearest(modal.recorded, pair.shown[j], float(risen.hz[b])) for b in (band, loudest))
    mode = next((m for m in near if m is not None), None)
    if mode is None:
        return None
    std = mode.frequency_std_hz or np.inf
    return Absent(mode.frequency_hz, std, mode.damping, mode.damping_std or np.inf, pair.shown[j], kind,
                  (pair.shown[j],))  # fmt: skip


@dataclass(frozen=True)
class Local:
    """Hold by how much the logarithm of a power ratio is larger at a mode than beside it, and its deviation.

    whole, chosen, sealed: of all data and of two parts; deviation: of the first and of the last.
    """

    whole: float
    chosen: float
    sealed: float
    deviation: float
    sealed_deviation: float

    @property
    def proof(self) -> tuple[float, tuple[float, float]]:
        """Return the nats by which the sealed part speaks for the mode, with their 90 % interval."""
        z = max(self.sealed, 0.0) / self.sealed_deviation
        nats, spread = 0.5 * z**2, _Z90 * z
        return nats, (nats - spread, nats + spread)

    @property
    def is_plain(self) -> bool:
        """Tell whether the mode stands out of what is beside it, in both parts."""
        rules = in_force().run_prior
        least = max(rules.local_log, rules.local_deviations * self.deviation)
        return self.whole > least and min(self.chosen, self.sealed) > rules.local_log / 2


def local_of(pair: Pair, mode: Absent, turn: float | None, fit: float) -> Local | None:
    """Return how a mode that the runs lack stands out beside its own frequency, in an output that shows it; or None.

    turn: frequency of the rotor in Hz: blades that pass make lines at multiples of their number, and where one of
    these is the mode's, it must stand out further than the others do.
    """
    own = [r for n in mode.outputs if (r := local_rise(pair, n, mode.frequency_hz, mode.damping, fit)) is not None]
    best = max((r for r in own if r.is_plain), key=lambda r: r.whole, default=None)
    if best is None:
        return None
    passing = (turn or 0.0) * max((len(b) for b in pair.blades), default=pair.passing)
    order = round(mode.frequency_hz / passing) if passing else 0
    if order < 1 or abs(mode.frequency_hz - order * passing) > in_force().run_modes.passing_distance * passing * order:
        return best
    lines = [
        r.whole for k in range(1, order + 2) if k != order
        for n in mode.outputs if (r := local_rise(pair, n, k * passing, 0.0, fit)) is not None
    ]  # fmt: skip
    return best if best.whole > in_force().run_prior.passing_ratio * max(lines, default=0.0) else None


def local_rise(pair: Pair, output: str, hz: float, damping: float, fit: float) -> Local | None:
    """Return how far an output's power ratio, recording over run, at a frequency is above that beside it.

    The ratio beside it is a line over the logarithm of the frequency. None where the band or its surroundings leave
    what the samples show, or a part of the recordings is shorter than a segment.
    """
    j = pair.shown.index(output)
    shortest = min(len(s) for s in (*pair.recordings, *pair.runs))
    length = min(round(_PERIODS / (hz * pair.step)), round((1 - fit) * shortest))
    f = np.fft.rfftfreq(length, pair.step)
    half = max(_BROAD * damping * hz, _HALF * hz, 1.5 / (length * pair.step))
    away = np.abs(f - hz)
    inner, outer = away <= half, (away > _GAP * half) & (away < _SHOULDER * half + 0.1 * hz) & (f > 0)
    low, high = np.any(outer & (f < hz)), np.any(outer & (f > hz))
    if not (inner.any() and low and high) or hz + _SHOULDER * half > _NYQUIST / (2 * pair.step):
        return None
    run, recorded = _spectra(pair, pair.runs, length, (0.0, 1.0)), []
    for part in ((0.0, 1.0), (0.0, fit), (fit, 1.0)):
        recorded.append(_spectra(pair, pair.recordings, length, part))
    if not run[1] or not all(n for _, n in recorded):
        return None
    beside = np.column_stack([np.ones(outer.sum()), np.log(f[outer] / hz)])
    normal = np.linalg.solve(beside.T @ beside, beside.T)[0]
    rises = []
    for power, _ in recorded:
        ratio = np.log(power[outer, j] + 1e-300) - np.log(run[0][outer, j] + 1e-300)
        at = np.log(power[inner, j].mean() + 1e-300) - np.log(run[0][inner, j].mean() + 1e-300)
        rises.append(float(at - normal @ ratio))
    free = _INDEPENDENT**2 * inner.sum()
    deviations = [float(np.sqrt(1 / (free * n) + 1 / (free * run[1]))) for _, n in (recorded[0], recorded[2])]
    return Local(rises[0], rises[1], rises[2], *deviations)


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
    return bool(rise > rules.lone_log and out > rules.lone_out_log and both > rules.lone_log / 2)


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
    return Risen(np.array([f[at].mean() for at in bands]), logs[1], *(x - logs[0] for x in logs[1:]))


def _powers(pair: Pair, sides: Sequence[Side], length: int, part: tuple[float, float]) -> Array | None:
    """Return spectra (f, l) over Hann windows that overlap by half, of a part of each side; None of none."""
    power, count = _spectra(pair, sides, length, part)
    return power if count else None


def _spectra(pair: Pair, sides: Sequence[Side], length: int, part: tuple[float, float]) -> tuple[Array, int]:
    """Return the same, and of how many windows it is the mean."""
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
    return total / max(count, 1), count
