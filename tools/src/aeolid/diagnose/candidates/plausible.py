"""Say whether fitted values can be the effect they stand for, and which of them the data know at all (S5)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.candidates.candidate import at_bound
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.base import Z90, Attachment, Slot
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import Equations

Array = NDArray[np.float64]
_MOMENT = 7.7 / Z90  # rows that carry one square of a change: deviation of its moment; 7.7 hold it in 90 %


def values_of(
    attachment: Attachment, fit: Fit, model: Equations, deviations: Array | None = None
) -> dict[str, tuple[float, float]]:
    """Return the reported values that were free, each with its deviation, by label.

    deviations (k,): of what was free, where they are not those of the fit.

    The deviation has two parts: what the data leave open, and a hundredth of the effect for its form. No machine is the
    catalogue's equation to the last digit: a floor that is an outlet above the bottom was told as 0.4044 ± 0.0004 m for
    0.4, levels of a drive as 2.0002 ± 0.0000007 for 2.
    """
    found: dict[str, tuple[float, float]] = {}
    for slot in attachment.slots:
        place = _place(slot, fit, model)
        if slot.label and place is not None:
            told = _value(slot, fit, model), _deviation(slot, place, fit, model, deviations)
            found[slot.label] = _with_form(slot, *slot.reported(*told))
    return found


def _with_form(slot: Slot, value: float, std: float) -> tuple[float, float]:
    """Add what the form leaves open, in proportion to the distance from none; a moment in time has no such size."""
    none = slot.show(slot.null) if slot.local else 0.0
    size = abs(value - none) if math.isfinite(none) else abs(value)
    return value, math.hypot(float(std), 0.0 if slot.label == "time_s" else in_force().candidates.form_share * size)


def objection(attachments: Sequence[Attachment], fit: Fit, model: Equations, gain: float, parameters: int) -> str:
    """Say why the fitted values cannot be these effects; empty where they can. gain: nats, for so many parameters.

    Shapes (the damping of a filter) that the data leave open are no objection wherever they ran: the size is known all
    the same. Sizes that trade with each other, or with what else is free, may each lie within two deviations of none
    though they are clearly there: without them the gain is lost, which the curvature where they are does not say (of
    a play that is taken up on one side alone, one edge is known to 214 nats and the other not at all; how stiff a stop
    is, few impacts tell, and 69 nats that there is one). But a loop of which is not known where it yields has a
    stiffness only, and is a spring. What changes at a time must be seen both ways: else a value is wrong, and nothing
    changes.
    """
    evidence = in_force().evidence
    for a in attachments:
        free = _free_slots([a], fit, model)
        for slot, place in free:
            value = _value(slot, fit, model)
            if slot.label and at_bound(value, slot) and not _is_undetermined(slot, fit, place):
                shown = slot.show(value)
                unit = "" if slot.unit == "1" or not math.isfinite(shown) else f" {slot.unit}"
                at = f"{shown:.3g}{unit}" if math.isfinite(shown) else "infinite"
                return f"{slot.label} of {a.key} ran to the end of its physical range ({at})"
            std = _deviation(slot, place, fit, model)
            if slot.change is not None and _reaches_an_end(value, 2 * std, slot):
                return f"{a.key} may have been so all along: it changed at {value:.3g} s ± {std:.2g} s"
        if reason := a.credible({label: value for label, (value, _) in values_of(a, fit, model).items()}):
            return f"{a.key}: {reason}"
        sizes = [(s, p) for s, p in free if s.label and (s.name in a.essential if a.essential else s.local)]
        trading = not a.essential and gain - parameters > evidence.clear_nats
        if sizes and not trading and not any(_differs(s, p, fit, model, evidence.differs_deviations) for s, p in sizes):
            return f"{sizes[0][0].label} of {a.key} does not differ from none by two standard deviations"
        told = values_of(a, fit, model)
        if any(name in told and told[name][1] > abs(told[name][0]) for name, _ in entry(a.entry).at_least):
            return f"{a.key}: where it yields is not known, so that it is a spring"
    return ""


def undriven(attachments: Sequence[Attachment], fit: Fit, model: Equations) -> str:
    """Say which effect no input drives; empty where each is driven.

    What no input drives cannot be told from the colour of the noise, unless its frequency is known from elsewhere. A
    drive must be clear: it takes up what else the model lacks, too (eddies beside a sensor's filter that was not in the
    model yet were driven by 3.4 deviations, and had a mode's name; of eight such recordings 1.8 in the mean).
    """
    least = in_force().candidates.driven_deviations
    for a in attachments:
        free = [(s, p) for s, p in _free_slots([a], fit, model) if s.name != a.share and not s.label]
        drives = [(s, p) for s, p in free if not a.drives or s.name in a.drives]
        if a.gain_states and not a.noise_driven and not any(_differs(s, p, fit, model, least) for s, p in drives):
            return f"{a.key}: no input drives it, so it cannot be told from the colour of the noise"
    return ""


def undetermined(attachments: Sequence[Attachment], fit: Fit, model: Equations) -> int:
    """Count the shapes that the data leave open."""
    return sum(_is_undetermined(s, fit, place) for s, place in _free_slots(attachments, fit, model))


def without_the_mute(attachments: Sequence[Attachment], fit: Fit, model: Equations) -> Fit:
    """Return the fit with sizes that the data say nothing of at none: where they ran to means nothing."""
    rules = in_force().candidates
    theta = fit.point.theta.copy()
    for slot, place in _free_slots(attachments, fit, model):
        if slot.local and float(fit.std[place]) > rules.mute_ranges * (slot.high - slot.low):
            theta[model.index(slot.name)] = slot.null
    return replace(fit, point=replace(fit.point, theta=theta))


def _free_slots(attachments: Sequence[Attachment], fit: Fit, model: Equations) -> list[tuple[Slot, int]]:
    """Return the slots that were free, each with its place among what was."""
    found = ((s, _place(s, fit, model)) for a in attachments for s in a.slots)
    return [(s, place) for s, place in found if place is not None]


def _place(slot: Slot, fit: Fit, model: Equations) -> int | None:
    """Return the slot's place among what was free; None where it was held."""
    index = model.index(slot.name)
    return fit.free.theta.index(index) if index in fit.free.theta else None


def _value(slot: Slot, fit: Fit, model: Equations) -> float:
    return float(fit.point.theta[model.index(slot.name)])


def _deviation(slot: Slot, place: int, fit: Fit, model: Equations, deviations: Array | None = None) -> float:
    """Return a value's deviation; of a moment of change by how fast the change is borne out after it.

    The likelihood of a moment has no curvature to go by: it falls from its best like a random walk with a drift (Yao
    1987), and the highest of its teeth is sharp (a damping that changed at 36 s, told as 43.3 ± 0.9 s). With a size of
    z deviations, borne out over n rows, 90 % lie within 7.7 n/z² rows (20,000 walks drawn: 7.8).
    """
    std = float((fit.std if deviations is None else deviations)[place])
    if slot.change is None or model.index(slot.change[0]) not in fit.free.theta:
        return std
    name, row_s = slot.change
    size = fit.free.theta.index(model.index(name))
    squares = np.square(fit.jacobian[:, size]).reshape(-1, len(fit.noise.factor)).sum(axis=1)
    rows = len(squares) - int(np.argmax(np.cumsum(squares) > in_force().candidates.ramp_share * squares.sum()))
    z = float(fit.point.theta[model.index(name)]) / float(fit.std[size])
    return min(math.hypot(std, _MOMENT * rows * row_s / max(z * z, 1e-12)), slot.high - slot.low)


def _reaches_an_end(value: float, reach: float, slot: Slot) -> bool:
    return value - reach <= slot.low or value + reach >= slot.high


def _is_undetermined(slot: Slot, fit: Fit, place: int) -> bool:
    return not slot.local and float(fit.std[place]) > in_force().candidates.undetermined_range * (slot.high - slot.low)


def _differs(slot: Slot, place: int, fit: Fit, model: Equations, times: float) -> bool:
    return bool(abs(float(fit.point.theta[model.index(slot.name)]) - slot.null) >= times * float(fit.std[place]))
