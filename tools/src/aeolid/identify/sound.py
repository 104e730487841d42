"""Judge an identified model by its poles and its free run on its own recordings, before anybody uses it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.fit import LONGEST, score
from aeolid.identify.validation import free_stretch
from aeolid.models.divergence import FAR, Divergence
from aeolid.models.load import LinearModel, diverged, matched
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.lpv_prediction import LpvModel
from aeolid.models.modes import Mode
from aeolid.models.rate import at_rate_of
from aeolid.models.state_space import StateSpace
from aeolid.record import Record

if TYPE_CHECKING:
    from aeolid.identify.lpv import LpvIdentification
    from aeolid.identify.ort import OrtIdentification
    from aeolid.identify.result import Identification

Result = TypeVar("Result", bound="Identification | LpvIdentification | OrtIdentification")
Array = NDArray[np.float64]
BAND = 3.0  # standard deviations of a pole's size within which the unit circle is not excluded: 0.1 % of integrators
SLOW = 1.0  # |log z| p: growth by e, or a radian, within the past window
STABILISED = ("varx", "varmax", "ort")  # methods with a model whose poles can be moved inside
MOVED = (
    "poles outside the unit circle were moved inside, as --stable does: a free run is lost by them, and {} they cannot "
    "be told from an integrator's (--allow-unstable leaves them); gains below their frequency and deviations do not "
    "hold"
)
WITHIN_BANDS = "within their bands"
WITHIN_WINDOW = "within the past window and by one-step errors"
WORSE = "; the move raises the one-step error power of {} by {:.2g} %"
TOLD_APART = " With every pole inside the unit circle the one-step error power of {} is {:.2g} % higher: it grows."
REMEDY = (
    "lower the order, lengthen the past window (--past) or the sample (--decimate), or ask for --stable; "
    "--allow-unstable writes the model as it is, which is right for a plant that only its controller holds"
)


@dataclass(frozen=True)
class Unsound:
    """Hold why a model is not to be used as it is: the recording, how its run diverges, what its poles say.

    divergence: None where no output leaves the recorded range by far; missed: the NRMSE of outputs whose run is off by
    more than ten standard deviations; lost: whether an output leaves and stays away, or is not finite; outside: whether
    a pole lies outside the unit circle by more than its band, and grows faster than the window would show; integrates:
    whether there are growing poles and none of them is outside, so that they cannot be told from integrators; growing:
    how many poles grow tenfold within the recording; banded: whether the band of each of them reaches the unit circle,
    so that not the past window alone excuses one; reason: what else speaks for growth.
    """

    source: str
    divergence: Divergence | None
    missed: dict[str, float]
    lost: bool
    outside: bool
    integrates: bool
    growing: int = 0
    banded: bool = True
    reason: str = ""

    @property
    def refused(self) -> bool:
        """Say whether the model is to be refused."""
        return self.lost or self.outside

    def text(self) -> str:
        """Return one sentence on what happens."""
        if self.divergence is not None:
            return f"{self.source}: {self.divergence.text()}{self.reason}"
        off = ", ".join(f"{name} by {size:.3g} of its standard deviations" for name, size in self.missed.items())
        return f"{self.source}: the free run on the recording itself misses {off} and is no simulation of it."


def judge(
    model: StateSpace | LpvStateSpace, modes: Sequence[Mode], records: Sequence[Record], past: int
) -> Unsound | None:
    """Return why a model is unsound on the recordings that it was identified from; None where it is sound.

    records are brought to the model's sample time; of each the longest stretch with every input is run, 200 000 samples
    at most. A pole outside the unit circle counts where its mode grows tenfold within the run, by its band where the
    modes have deviations; where they have none, and for scheduled models, the run decides. A pole that neither grows
    nor turns by more than SLOW within the past window (past, samples) is not outside by its band alone, which does not
    hold the error of the window: one-step errors say whether it can be moved inside (`identify_soundly`).
    """
    runs = LpvModel(model) if isinstance(model, LpvStateSpace) else LinearModel(model)
    found = []
    for record in records:
        slow = at_rate_of(model.sample_time_s, record)
        part = free_stretch(runs, slow.slice(0, LONGEST))
        y = runs.simulate(part)
        wild, fit = diverged(runs, part, y), score([s.name for s in model.outputs], matched(part, model.outputs), y)
        missed = {n: fit.nrmse[n] for n in fit.vaf if fit.diverges(n) and np.isfinite(fit.nrmse[n])}
        if wild is not None or missed:
            found.append(_weigh(record.source, wild, missed, modes, model.sample_time_s, len(part), past))
    return max(found, key=lambda f: (f.refused, f.lost), default=None)


def identify_soundly(run: Callable[[bool], Result], records: Sequence[Record], stable: bool, allowed: bool) -> Result:
    """Identify by run(stable) and refuse a model that is unsound on its own recordings unless that is allowed.

    Growing poles that cannot be told from integrators, and lose a free run, are moved inside by run(True), where the
    method can; a warning says so, and in the facts under "moved" why deviations no longer hold. A pole whose band does
    not reach the unit circle, excused by a short past window, is moved only where that costs no more of the one-step
    errors than chance; where it costs more the plant grows, and the model is refused.
    Raises NotIdentifiable with what happens and what to do.
    """
    result = run(stable)
    moved = ""
    found = judge(result.model, result.modes, records, result.settings.past)
    movable = result.settings.to_json()["method"] in STABILISED and not (stable or allowed)
    if found is not None and found.lost and found.integrates and movable:
        inside = run(True)
        name, rise, nats = _rise(result.fit.innovations, inside.fit.innovations, result.model)
        surely = 2 * nats > BAND**2 * found.growing
        if surely and not found.banded:
            require_sound(replace(found, outside=True, reason=TOLD_APART.format(name, 100 * rise)), allowed=False)
        moved = MOVED.format(WITHIN_BANDS if found.banded else WITHIN_WINDOW)
        moved += WORSE.format(name, 100 * rise) if surely else ""
        result = inside
        found = judge(result.model, result.modes, records, result.settings.past)
    said = require_sound(found, allowed=allowed)
    return _with_move(replace(result, notes=(*result.notes, *said)), moved)


def _with_move(result: Result, moved: str) -> Result:
    """Return the result with what a move of its poles asks to be said, if there was one."""
    from aeolid.identify.result import Identification

    if not moved:
        return result
    result = replace(result, notes=(*result.notes, f"WARNING: {moved}"))
    if not isinstance(result, Identification):
        return result
    return replace(result, extra=result.extra | {"moved": moved})


def _rise(before: Array, after: Array, model: StateSpace | LpvStateSpace) -> tuple[str, float, float]:
    """Return the output whose one-step errors (N, l) rise most, by which part of their power, and the nats that costs.

    N/2 Δ log P of one output by itself: the likelihood of all is not defined where fewer noise sources than outputs
    drive them. A move that makes the predictor diverge costs all.
    """
    both = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
    with np.errstate(all="ignore"):
        sizes = [(e[both] ** 2).sum(axis=0) for e in (before, after)]
        rises = np.log(np.maximum(sizes[1], 1e-300) / np.maximum(sizes[0], 1e-300))
    rises = np.where(np.isfinite(rises), rises, np.inf)
    most = int(np.argmax(rises))
    return model.outputs[most].name, float(np.expm1(rises[most])), float(np.count_nonzero(both) / 2 * rises[most])


def require_sound(found: Unsound | None, *, allowed: bool) -> tuple[str, ...]:
    """Return what a model's notes are to say; raises NotIdentifiable on an unsound one unless that is allowed."""
    if found is None:
        return ()
    if not found.refused:
        return (found.text(),) if found.missed else ()
    if not allowed:
        raise NotIdentifiable(f"{found.text()} No model is written: {REMEDY}")
    return (f"UNSTABLE, written as asked for: {found.text()}",)


def _weigh(
    source: str, wild: Divergence | None, missed: dict[str, float], modes: Sequence[Mode], step: float, samples: int,
    past: int,
) -> Unsound:  # fmt: skip
    poles = [(m, abs(m.eigenvalue)) for m in modes]
    growing = [m for m, size in poles if samples * np.log(max(size, 1e-12)) > np.log(FAR)]
    own = [_excess(m, step) for m in growing]
    excess = [0.0 if _is_slow(m, past) else e for m, e in zip(growing, own, strict=True)]
    banded = all(e is not None and e <= BAND for e in own)
    outside = any(e is not None and e > BAND for e in excess)
    integrates = bool(excess) and all(e is not None and e <= BAND for e in excess)
    leaving = () if wild is None else wild.leaving
    lost = any(left.stays or not left.finite for left in leaving)
    return Unsound(source, wild, missed, lost, outside, integrates, len(growing), banded)


def _is_slow(mode: Mode, past: int) -> bool:
    return bool(abs(np.log(mode.eigenvalue)) * past <= SLOW)


def _excess(mode: Mode, step: float) -> float | None:
    """Return by how many standard deviations a pole lies outside the unit circle; None where they are not known.

    Its growth is −ζ ω: the deviation is that of ω, for a pair with that of ζ, taken as independent.
    """
    if mode.frequency_std_hz is None or mode.damping_std is None:
        return None
    size, deviation = 2 * np.pi * mode.frequency_hz, 2 * np.pi * mode.frequency_std_hz
    spread = float(np.hypot(mode.damping * deviation, size * mode.damping_std))
    growth = float(np.log(abs(mode.eigenvalue))) / step
    return growth / spread if spread > 0 else np.inf
