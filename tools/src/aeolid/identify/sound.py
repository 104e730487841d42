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
    "poles outside the unit circle were moved inside, as --stable does: a free run is lost by them, and within their "
    "bands or the past window they cannot be told from an integrator's (--allow-unstable leaves them)"
)
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
    whether there are growing poles and none of them is outside, so that they cannot be told from integrators.
    """

    source: str
    divergence: Divergence | None
    missed: dict[str, float]
    lost: bool
    outside: bool
    integrates: bool

    @property
    def refused(self) -> bool:
        """Say whether the model is to be refused."""
        return self.lost or self.outside

    def text(self) -> str:
        """Return one sentence on what happens."""
        if self.divergence is not None:
            return f"{self.source}: {self.divergence.text()}"
        off = ", ".join(f"{name} by {size:.3g} of its standard deviations" for name, size in self.missed.items())
        return f"{self.source}: the free run on the recording itself misses {off} and is no simulation of it."


def judge(
    model: StateSpace | LpvStateSpace, modes: Sequence[Mode], records: Sequence[Record], past: int
) -> Unsound | None:
    """Return why a model is unsound on the recordings that it was identified from; None where it is sound.

    records are brought to the model's sample time; of each the longest stretch with every input is run, 200 000 samples
    at most. A pole outside the unit circle counts where its mode grows tenfold within the run, by its band where the
    modes have deviations; where they have none, and for scheduled models, the run decides. So it does for a pole that
    neither grows nor turns by more than SLOW within the past window (past, samples): whether it is one of an integrator
    is beyond what the window shows, and its band does not hold the error of the window.
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
    method can, and the notes say so. Raises NotIdentifiable with what happens and what to do.
    """
    result = run(stable)
    moved: tuple[str, ...] = ()
    found = judge(result.model, result.modes, records, result.settings.past)
    movable = result.settings.to_json()["method"] in STABILISED and not (stable or allowed)
    if found is not None and found.lost and found.integrates and movable:
        result, moved = run(True), (MOVED,)
        found = judge(result.model, result.modes, records, result.settings.past)
    said = require_sound(found, allowed=allowed)
    return replace(result, notes=(*result.notes, *moved, *said))


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
    excess = [0.0 if _is_slow(m, past) else _excess(m, step) for m in growing]
    outside = any(e is not None and e > BAND for e in excess)
    integrates = bool(excess) and all(e is not None and e <= BAND for e in excess)
    leaving = () if wild is None else wild.leaving
    lost = any(left.stays or not left.finite for left in leaving)
    return Unsound(source, wild, missed, lost, outside, integrates)


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
