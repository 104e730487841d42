"""What changes while the machine runs: a coefficient that steps at some time, or drifts over the recording."""

from __future__ import annotations

from dataclasses import dataclass, replace

from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import force_on, say, time_channel
from aeolid.diagnose.structure.anatomy import Motion

_WIDTH = 0.02  # of the span: a step is a ramp this short, so that its time has a slope to follow
_TIMES = (0.5, 0.65, 0.35, 0.8, 0.2, 0.9, 0.1)  # of the span
_NEAREST = 0.08  # of the span, from either end: what changes there is how a recording starts (a mode that swings on)


@dataclass(frozen=True)
class Coefficient:
    """Say what changes: entry, name of the reported change, its unit, largest value, what it multiplies, in words.

    term: in the model's language; words: of the coefficient; factor: the term as reports have it.
    """

    entry: str
    label: str
    unit: str
    most: float
    term: str
    words: str
    factor: str


def changes(site: Site, motion: Motion, number: int, what: Coefficient) -> list[Attachment]:
    """Return a step in time and a steady drift of a coefficient of one motion; none where time starts anew."""
    found = time_channel(site)
    if found is None:
        return []
    channel, first, last = found
    span, tag = last - first, f"{what.entry}_{number + 1}"
    step, at, drift = f"{tag}_step", f"{tag}_time_s", f"{tag}_drift"
    half = 0.5 * _WIDTH * span
    size = Slot(step, what.label, what.unit, 0.0, -what.most, what.most, 1e-4 * what.most)
    change = step, site.row_step
    low, high = first + _NEAREST * span, last - _NEAREST * span
    when = Slot(at, "time_s", "s", first + span / 2, low, high, 0.1 * span, local=False, change=change)
    stepped = force_on(
        motion, number, what.entry, (size, when),
        f"-{step}*0.5*(1 + tanh(({channel.symbol} - {at})/{half!r}))*{what.term}",
        grid=tuple({at: first + share * span} for share in _TIMES),
        equation=f"F = -{what.label}*{what.factor} from time_s on, at {motion.location}",
        statement=say(
            f"the {{what}} at {{at}} changes by {{{what.label}:.3g}} {{unit}} at {{time_s:.4g}} s; the model has it"
            " constant",
            what=what.words, at=motion.location, unit=what.unit,
        ),
    )  # fmt: skip
    drifting = force_on(
        motion, number, what.entry,
        (replace(size, name=drift, label=f"{what.label}_over_fit"),),
        f"-{drift}*(({channel.symbol} - {first!r})/{span!r})*{what.term}", kind="_drift",
        equation=f"F = -{what.label}_over_fit*((t - {first:.6g} s)/{span:.6g} s)*{what.factor}, at {motion.location}",
        statement=say(
            f"the {{what}} at {{at}} drifts: by {{{what.label}_over_fit:.3g}} {{unit}} in {span:.4g} s; the model has"
            " it constant", what=what.words, at=motion.location, unit=what.unit,
        ),
    )  # fmt: skip
    return [stepped, drifting]
