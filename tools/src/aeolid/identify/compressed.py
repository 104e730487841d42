"""Hold the windows of recordings as triangular factors: of the part that chooses the order, and of everything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.missing import Completed, Trial
from aeolid.identify.order import held_out_stretches
from aeolid.identify.split import cut
from aeolid.identify.windows import Scaling, WindowFactor, factorise, require_windows
from aeolid.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Windows:
    """Hold the windows of an experiment set.

    records: with innovation channels where the scaling names some; fitted: factor of the part that chooses the order;
    whole: factor of everything; solution: which Ξ is taken where the data are singular (see `solution`); trial: the
    recordings for choices on held-out samples, None where no cell was missing.
    """

    records: Sequence[Record]
    scaling: Scaling
    fitted: WindowFactor
    whole: WindowFactor
    solution: str = "smallest"
    trial: Trial | None = None

    @property
    def input_scale(self) -> Array:
        """Return the standard deviations of the inputs, (r,), in their units."""
        return self.scaling.scale[: len(self.scaling.inputs)]

    @property
    def output_scale(self) -> Array:
        """Return the standard deviations of the outputs, (l,), in their units."""
        first = len(self.scaling.inputs)
        return self.scaling.scale[first : first + len(self.scaling.outputs)]

    def held_out(self, *, everything: bool = False) -> list[Array]:
        """Return the stretches that choose the order, or all; see `held_out_stretches`."""
        records, past = self.records, self.whole.past
        measured = () if self.trial is None else self.trial.measured
        if self.trial is not None and self.trial.sets and not everything:
            records = _with_outputs_of(records, self.trial.sets[0], self.scaling)
        return held_out_stretches(records, self.scaling, past, everything=everything, measured=measured)


def _with_outputs_of(records: Sequence[Record], others: Sequence[Record], scaling: Scaling) -> list[Record]:
    """Return recordings with the inputs and outputs of others; innovations stay."""
    names, found = scaling.without_innovations().names, []
    for record, other in zip(records, others, strict=True):
        values = record.values.copy()
        place = {c.name: i for i, c in enumerate(record.channels)}
        values[:, [place[n] for n in names]] = other.columns(names)
        found.append(replace(record, values=values))
    return found


def compress(records: Sequence[Record], scaling: Scaling, past: int, completed: Completed | None = None) -> Windows:
    """Return the factor of the part that chooses the order from what is held out, and the factor of everything.

    completed: with the recordings of further draws of missing cells, over which the factors are averaged, and those for
    choices. Innovations are those of the recordings, whatever was drawn.
    Raises NotIdentifiable where there are fewer complete windows than unknowns. Cost: 2 N q² operations, q = (p + 1) m.
    """
    require_windows(records, past, scaling.channels)
    known = Completed(records) if completed is None else completed
    sets, trial = (records, *known.others), known.trial
    if trial is None or not trial.sets or scaling.innovations:
        both = [cut(s, scaling, past) for s in sets]
        fitted, rest = (known.average([factorise(s, scaling, past) for s in each]) for each in zip(*both, strict=True))
        whole = fitted.merge(rest)
    else:
        fitted = known.average([factorise(cut(s, scaling, past)[0], scaling, past) for s in trial.sets])
        whole = known.average([factorise(s, scaling, past) for s in sets])
    require_windows(records, past, scaling.channels, whole.windows)
    return Windows(records, scaling, fitted, whole, trial=trial)
