"""Hold equations whose free values were fitted to recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aeolid.api import markup
from aeolid.api.table import Table

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.api.equations import Equations
    from aeolid.api.from_diagnose import Check, Estimate, Moved


class EquationsFit:
    """Hold fitted values with their deviations, the model that has them, and how it meets a part left out.

    Attributes
    ----------
    result : aeolid.diagnose.estimate.Estimate
        All numbers: values, pairs that the data hardly tell apart, errors on the part left out.
    model : Equations
        The equations with these values.
    """

    def __init__(self, result: Estimate, model: Equations) -> None:
        """Hold a fit.

        Parameters
        ----------
        result : aeolid.diagnose.estimate.Estimate
            What was found.
        model : Equations
            The equations with these values.
        """
        self.result, self.model = result, model

    @property
    def values(self) -> Table[Moved]:
        """Return the fitted values: value, standard deviation, unit, what was declared."""
        return Table("values", self.result.values, _value_row)

    @property
    def checks(self) -> Table[Check]:
        """Return the errors on the part left out, by output: one row ahead and run free, fitted and declared."""
        return Table("checks", self.result.checks, lambda c: dict(vars(c)))

    def __getitem__(self, name: str) -> Moved:
        """Return the fitted value of a parameter; raises KeyError."""
        return {m.parameter.name: m for m in self.result.values}[name]

    def to_frame(self) -> pd.DataFrame:
        """Return the values as a pandas.DataFrame."""
        return self.values.to_frame()

    def to_text(self) -> str:
        """Return values and checks as `aeolid identify --structure` prints them."""
        return self.result.summary()

    def to_json(self) -> dict[str, Any]:
        """Return the facts as plain JSON."""
        return self.result.to_json()

    def __repr__(self) -> str:
        count = markup.count(len(self.result.values), "value")
        return f"<EquationsFit: {count}, validated on {markup.title(self.result.held_out)}>"

    def _repr_html_(self) -> str:
        return markup.shown(repr(self)[1:-1], self.values._repr_html_(), self.checks._repr_html_())


def _value_row(m: Moved) -> dict[str, Any]:
    p = m.parameter
    return {"parameter": p.name, "value": m.value, "std": m.std, "unit": p.unit, "declared": p.value}
