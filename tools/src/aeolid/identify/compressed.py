"""Hold the windows of recordings as triangular factors: of the part that chooses the order, and of everything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.missing import Completed
from aeolid.identify.order import FIT_PART
from aeolid.identify.windows import Scaling, WindowFactor, factorise, require_windows
from aeolid.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Windows:
    """Hold the windows of an experiment set.

    records: with innovation channels where the scaling names some; fitted: factor of the part that chooses the order;
    whole: factor of everything; solution: which Ξ is taken where the data are singular (see `solution`).
    """

    records: Sequence[Record]
    scaling: Scaling
    fitted: WindowFactor
    whole: WindowFactor
    solution: str = "smallest"

    @property
    def input_scale(self) -> Array:
        """Return the standard deviations of the inputs, (r,), in their units."""
        return self.scaling.scale[: len(self.scaling.inputs)]

    @property
    def output_scale(self) -> Array:
        """Return the standard deviations of the outputs, (l,), in their units."""
        first = len(self.scaling.inputs)
        return self.scaling.scale[first : first + len(self.scaling.outputs)]


def compress(records: Sequence[Record], scaling: Scaling, past: int, completed: Completed | None = None) -> Windows:
    """Return the factor of the part that chooses the order from what is held out, and the factor of everything.

    completed: with the recordings of further draws of missing cells, over which the factors are averaged.

    Raises NotIdentifiable where there are fewer complete windows than unknowns. Cost: 2 N q² operations, q = (p + 1) m.
    """
    require_windows(records, past, scaling.channels)
    known = Completed(records) if completed is None else completed
    sets = (records, *known.others)
    fitted = known.average([factorise(s, scaling, past, last=FIT_PART) for s in sets])
    whole = fitted.merge(known.average([factorise(s, scaling, past, first=FIT_PART) for s in sets]))
    require_windows(records, past, scaling.channels, whole.windows)
    return Windows(records, scaling, fitted, whole)
