"""Read modes that a simulator's model lacks from the recording itself, with as many states as that needs (S6)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.base import Attachment, Slot
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.rules import in_force
from aeolid.errors import AeolidError
from aeolid.identify.plain import identify_plainly
from aeolid.models.equations import Equations
from aeolid.models.modes import Mode
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
Known = dict[str, tuple[float, float]]  # name in the model → value, deviation
_PERIODS = (1.0, 1.5)  # of the mode, that the past windows span
_PAST = 40  # samples that a period counts at least: the window of a simulator's run


def recorded_modes(prepared: Prepared, attachments: Sequence[Attachment], fit: Fit, model: Equations) -> Known:
    """Return frequency and damping of fitted modes as PBSID finds them in fit and selection data, where a fit is off.

    A simulator's run is held by few states; all that these leave over of a recording weighs on the damping of a mode
    fitted beside them (an OpenFAST tower's was 0.035 to 0.042; PBSID with the 31 to 45 states that held-out data ask
    for says 0.054 to 0.081, whatever window and stretch; it is 0.084). What the fit says is the sharper where its
    structure is right, what PBSID says holds either way: the difference decides (Hausman 1978), at 1 %. Windows of 1
    and 1.5 periods; the deviation holds their difference. Empty where they agree, and where not both windows show one
    mode within 15 % of the fitted frequency that moves this output most. Cost: two identifications a mode.
    """
    known: Known = {}
    for attachment in attachments if prepared.surrogate is not None else ():
        pair = _pair(attachment)
        if pair is None or entry(attachment.entry).family != "structural_mode":  # bands of noise have both values too
            continue
        near = float(fit.point.theta[model.index(pair[0].name)])
        outputs = attachment.location["outputs"]
        modes = [_mode(prepared, outputs, pair[1], near, past) for past in _windows(prepared, near)]
        found = [m for m in modes if m is not None]
        if len(found) == len(_PERIODS) and _is_off(fit, model, own := _together(pair, found)):
            known |= own
    return known


def _is_off(fit: Fit, model: Equations, known: Known) -> bool:
    """Tell whether fitted values are off by more than chance lets them where the fit's structure is right.

    The deviation of the difference from a fit that is as sharp as can be is the root of the difference of the squares.
    """
    rules = in_force().candidates
    squares = 0.0
    for name, (value, std) in known.items():
        index = model.index(name)
        if index not in fit.free.theta:
            return False
        own = float(fit.std[fit.free.theta.index(index)])
        room = max(std**2 - own**2, (rules.mode_difference_share * std) ** 2)
        squares += (float(fit.point.theta[index]) - value) ** 2 / room
    return squares > rules.mode_off_chi2


def _pair(attachment: Attachment) -> tuple[Slot, Slot] | None:
    """Return the places of a mode's frequency and damping; None for what is no mode with both."""
    slots = {s.label: s for s in attachment.slots}
    return (slots["frequency_hz"], slots["damping"]) if {"frequency_hz", "damping"} <= set(slots) else None


def _windows(prepared: Prepared, frequency_hz: float) -> list[int]:
    """Return the past windows in samples; none where the recording is too short for them."""
    step, rows = prepared.split.fit[0].step, sum(len(s.y) for s in (*prepared.split.fit, *prepared.split.select))
    period = max(_PAST, 1.0 / (frequency_hz * step))
    windows = [round(periods * period) for periods in _PERIODS]
    return windows if rows >= in_force().candidates.mode_windows * windows[-1] else []


def _mode(prepared: Prepared, outputs: Sequence[str], damping: Slot, near: float, past: int) -> Mode | None:
    """Return the mode nearest to a frequency (Hz) that shows most in one of these outputs; None where there is none."""
    rules = in_force().candidates
    segments = [s for s in (*prepared.split.fit, *prepared.split.select) if len(s.y) > 2 * past]
    try:
        modes = identify_plainly(_records(prepared, segments), past=past).modes
    except AeolidError:
        return None
    own = [
        m for m in modes
        if abs(m.frequency_hz - near) < rules.mode_distance * near and damping.low < m.damping < damping.high
        and max(m.shares, key=m.shares.__getitem__) in outputs and m.damping_std is not None
    ]  # fmt: skip
    return min(own, key=lambda m: abs(m.frequency_hz - near), default=None)


def _records(prepared: Prepared, segments: Sequence[Segment]) -> list[Record]:
    """Return stretches of the recording as recordings: what acts on the plant, and its outputs."""
    assert prepared.linear is not None
    inputs, outputs = prepared.linear.inputs, prepared.linear.outputs
    channels = (
        *(Channel(s.name, s.unit, "input") for s in inputs),
        *(Channel(s.name, s.unit, "output") for s in outputs),
    )
    return [_record(s, channels, len(inputs)) for s in segments]


def _record(segment: Segment, channels: tuple[Channel, ...], inputs: int) -> Record:
    time: Array = segment.start_s + segment.step * np.arange(len(segment.y), dtype=np.float64)
    values = np.column_stack([segment.u[:, :inputs], segment.y])
    return Record(time, values, channels, segment.step, segment.source, "")


def _together(pair: tuple[Slot, Slot], modes: Sequence[Mode]) -> Known:
    """Return the mean over the windows, and a deviation that holds what each leaves open and their difference."""
    found = [
        [(m.frequency_hz, m.frequency_std_hz or 0.0) for m in modes],
        [(m.damping, m.damping_std or 0.0) for m in modes],
    ]
    known: Known = {}
    for slot, row in zip(pair, found, strict=True):
        values, stds = np.array(row).T
        known[slot.name] = float(values.mean()), float(np.sqrt(np.mean(stds**2) + values.var()))
    return known
