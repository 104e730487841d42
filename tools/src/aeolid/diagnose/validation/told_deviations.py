"""Give values the deviations they are told with, once all is chosen: what model and recording leave unsaid (S6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.selection.exchange import Alternative
from aeolid.diagnose.selection.rivals import rivals_of
from aeolid.diagnose.validation.sealed import Held
from aeolid.diagnose.validation.unsure_constants import beside_unsure_constants
from aeolid.diagnose.validation.unsure_reading import beside_unsure_reading


def with_told_deviations(
    prepared: Prepared, held: Held, candidates: Sequence[Candidate], others: Sequence[Alternative]
) -> tuple[Held, tuple[Candidate, ...], tuple[Alternative, ...]]:
    """Return what is held, the candidates and the alternatives as they are told.

    That is with deviations that hold constants of the model and how the recording was taken, which are not known for
    certain; nothing is chosen by deviations any more. The candidate that was held against the sealed data has the
    values it has there; alternatives are of the largest set alone.
    """
    others = tuple(others) if held.several is not None and held.is_largest else ()
    single = held.single
    if single is None:
        return held, tuple(candidates), others
    if not prepared.deadline.skips("how sure values are beside the model's constants"):
        rivals = {c.key: _told(prepared, c) for c in rivals_of(candidates, single)}
        candidates = [rivals.get(c.key, c) for c in candidates]
        others = tuple(replace(a, candidate=_told(prepared, a.candidate)) for a in others)
        completed = None if held.completed is None else _told(prepared, held.completed)
        held = replace(held, sets=tuple(_told(prepared, c) for c in held.sets), completed=completed)
    last = held.single
    return held, tuple(last if last is not None and c.key == last.key else c for c in candidates), others


def _told(prepared: Prepared, candidate: Candidate) -> Candidate:
    return beside_unsure_reading(prepared, beside_unsure_constants(prepared, candidate))
