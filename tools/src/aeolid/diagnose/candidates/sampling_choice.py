"""Say which readings of the inputs the likelihood may choose among: holds, offsets, a filter of the outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.intersample import Sampling, traits_of
from aeolid.diagnose.rules import in_force
from aeolid.models.intersample import FILTERED, HOLDS

TINY = 1e-4  # samples: step of a finite difference
MIDDLE = 0.5  # samples: delay of a filter from which fits start, corner 0.9 of the Nyquist frequency


@dataclass(frozen=True)
class Choice:
    """Say what may be chosen: which inputs may move, any offset or (commands) early ones, whole samples only or not.

    kinds: place and look of each input that may be fed back. late, early: whether held commands may come late, and any
    input early; filtered: whether late ones may be rounded, too.
    """

    moving: tuple[str, ...]
    any_offset: bool
    whole: bool
    kinds: tuple[tuple[int, str], ...] = ()
    late: bool = True
    early: bool = True
    filtered: bool = True

    def trials(self, now: Sampling, step: float) -> list[Sampling]:
        """Return the samplings to fit briefly, those as read now left out."""
        others = [tuple((n, h if n in self.moving else was) for n, was in now.holds) for h in HOLDS[1:]]
        holds = [now.holds, *(others if self.moving else ())]
        early = () if not self.early else (-1.0,) if self.whole else (-1.0, -0.5)
        offsets = (0.0, *early, *((0.5, 1.0) if self.any_offset or self.late else ()))
        found = [replace(now, holds=h, offset_s=o * step, free=self._is_free(o)) for h in holds for o in offsets]
        return [s for s in (*found, *self._filtered(now, step)) if s.holds != now.holds or s.offset_s]

    def _filtered(self, now: Sampling, step: float) -> list[Sampling]:
        """Return held inputs behind a filter of the outputs, where all are held."""
        if not (self.late and self.filtered) or any(h not in (HOLDS[0], FILTERED) for _, h in now.holds):
            return []
        holds = tuple((n, FILTERED) for n, _ in now.holds)
        return [replace(now, holds=holds, offset_s=0.0, filter_s=MIDDLE * step, free=True)]

    def _is_free(self, offset: float) -> bool:
        return self.any_offset or offset > 0 or (offset < 0 and not self.whole)

    def allows(self, sampling: Sampling, step: float) -> bool:
        """Tell whether a fitted offset is still one of these, that of commands beside measured inputs never late.

        An input that is likeliest to be held is a command, whatever it looks like.
        """
        held = [h in (HOLDS[0], FILTERED) for _, h in sampling.holds]
        if all(held):
            most = in_force().candidates.latest_samples * step if self.late else 0.0
            fits = sampling.late_s <= most or abs(sampling.late_s - step) < TINY * step
            return fits and (not self.whole or sampling.offset_s > -TINY * step or not sampling.free)
        return (self.any_offset and not any(held)) or sampling.offset_s <= 0


def choice_of(case: Case, prepared: Prepared) -> Choice:
    """Return what the likelihood may choose among on this recording."""
    traits = traits_of(prepared.records, [n for n, _ in prepared.sampling.holds])
    closed = case.context.get("closed_loop") is True
    measured_only = {c.name for c in prepared.records[0].channels if c.role == "disturbance"}
    moving = tuple(t.name for t in traits if t.hold is None and (not closed or t.name in measured_only))
    measured = all(t.kind == "smooth" or t.hold in HOLDS[1:] for t in traits)
    names = prepared.site.input_names
    answering = () if case.context.get("closed_loop") is False else [t for t in traits if t.name not in measured_only]
    kinds = tuple((names.index(t.name), t.kind) for t in answering)
    return Choice(moving, measured and not closed, closed, kinds)
