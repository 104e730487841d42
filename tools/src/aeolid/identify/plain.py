"""Identify recordings as they are: nothing mended before, no loop refused; for comparisons of predictors."""

from __future__ import annotations

from collections.abc import Sequence

from aeolid.identify.result import Identification
from aeolid.identify.varx import identify_varx
from aeolid.record import Record


def identify_plainly(
    records: Sequence[Record], *, past: int, order: int | None = None, stable: bool = False,
    uncertainty: str = "asymptotic",
) -> Identification:  # fmt: skip
    """Return the model of `identify_varx` without spikes taken out, cells drawn or offsets taken off.

    A loop that nothing moves from outside is taken as well: two predictors of one loop can be held against each other
    where neither shows the plant. past, order, stable, uncertainty and what is raised: as there.
    """
    return identify_varx(
        records, past=past, order=order, stable=stable, uncertainty=uncertainty, missing="leave-out", detrend="none",
        robust="never", solution="smallest", unexcited="take",
    )  # fmt: skip
