"""Say what a fitted set of effects is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.candidates.moved import Moved
from aeolid.diagnose.hypotheses.catalogue import meaning_of
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.hypotheses.parts.base import Attachment, Slot
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Candidate:
    """Hold a fully fitted set of effects: fit (without its sensitivities), gains over the baseline, reported values.

    parameters: what it has free beyond the baseline; undetermined: those of them that are shapes the data leave open.
    undriven: refused for one thing only, no input drives it. moved: declared values beside the effects, re-fitted.
    """

    attachments: tuple[Attachment, ...]
    fit: Fit
    predictor: Predictor
    fit_gain: float
    select_gain: float
    parameters: int
    fit_density: Array  # log-density of each sample of the fit data
    select_difference: Array  # per sample, candidate minus baseline
    values: Mapping[str, Mapping[str, tuple[float, float]]]  # key → label → (value, std)
    plausible: bool
    reason: str
    survived: bool = False  # the control on the simulation itself
    complete: bool = True  # fitted to the end, not left behind
    undriven: bool = False
    undetermined: int = 0
    moved: tuple[Moved, ...] = ()

    @property
    def key(self) -> str:
        """Return a readable name of the set."""
        return " + ".join(a.key for a in self.attachments)

    def says(self, attachment: Attachment) -> str:
        """Return what one of the effects says with its fitted values, and which of these the data leave open."""
        values = self.values[attachment.key]
        said = attachment.statement({label: value for label, (value, _) in values.items()})
        parts = {s.label for s in attachment.slots if s.local} if attachment.entry == unlisted.ID else set()
        shared = parts if len(parts) > 1 else set()  # a cosine may be none beside its sine
        open_ = [label for label, (value, std) in values.items() if label not in shared and not std <= abs(value)]
        names = [f"{label}: {meaning_of(attachment.entry, label)}".removesuffix(": ") for label in open_]
        return f"{said} (these data do not determine {'; '.join(names)})" if open_ else said

    def beyond(self, other: Candidate) -> Candidate:
        """Return what was fitted and counted from another candidate's fit as it counts from the bare baseline."""
        return replace(self, fit_gain=self.fit_gain + other.fit_gain, parameters=self.parameters + other.parameters)

    @property
    def unlisted(self) -> bool:
        """Tell whether an effect is of a form outside the catalogue, which cannot be named."""
        return any(a.entry == unlisted.ID for a in self.attachments)

    @property
    def at_end(self) -> bool:
        """Tell whether a value of an effect ran to the end of its physical range."""
        return any(at_bound(value, slot) for _, slot, value in self._told())

    @property
    def low_ends(self) -> list[tuple[Attachment, str]]:
        """Return the values of effects that ran to the lower end of their range, with their effects."""
        return [
            (a, str(slot.label)) for a, slot, value in self._told()
            if at_bound(value, slot) and value - slot.low < slot.high - value
        ]  # fmt: skip

    def _told(self) -> list[tuple[Attachment, Slot, float]]:
        """Return the fitted values that are reported."""
        model, theta = self.predictor.compiled.model, self.fit.point.theta
        return [
            (a, slot, float(theta[model.index(slot.name)]))
            for a in self.attachments for slot in a.slots
            if slot.label is not None and model.index(slot.name) in self.fit.free.theta
        ]  # fmt: skip

    @property
    def is_plainer(self) -> bool:
        """Tell whether what makes an effect more than a plainer one at its place is none, by two deviations."""
        evidence = in_force().evidence
        for a in self.attachments:
            own = [self.values[a.key].get(s.label, (s.null, 0.0)) for s in a.slots if s.name in a.essential and s.label]
            if own and all(abs(value) < evidence.differs_deviations * std for value, std in own):
                return True
        return False

    @property
    def handicap(self) -> float:
        """Return what its parameters must gain on the fit data to be needed: half the log of the samples each.

        Schwarz 1978, for those that the data determine; the others cost nothing, as they choose among nothing.
        """
        return (self.parameters - self.undetermined) * 0.5 * float(np.log(max(len(self.fit_density), 1)))

    @property
    def score(self) -> float:
        """Return what candidates are ranked by: gain on the fit data less the handicap, plus gain on selection."""
        return self.fit_gain - self.handicap + self.select_gain


def at_bound(value: float, slot: Slot) -> bool:
    """Tell whether a fitted value sits at the end of its range, where it explains nothing or too much.

    A range that begins at none has one end; but a mode's frequency is none nowhere: at the lowest that a recording can
    show (four periods of it) it is a spring or a mass (a bent push was a mode of 0.08 +- 0.07 Hz that saturates).
    """
    width = slot.high - slot.low
    if not np.isfinite(width):
        return False
    begins = slot.low == slot.null and (slot.local or slot.label != "frequency_hz")
    return (value - slot.low < 1e-6 * width and not begins) or slot.high - value < 1e-6 * width
