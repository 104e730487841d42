"""Hold the modes of a model that is periodic in the rotor's angle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.api import markup
from aeolid.api.session import public
from aeolid.api.table import Table
from aeolid.report.floquet_text import summary

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.models.floquet import Floquet, FloquetMode


class FloquetModes:
    """Hold the modes of a periodic model at one rotor speed, with the participation of their harmonics.

    Attributes
    ----------
    result : aeolid.models.floquet.Floquet
        All numbers: modes, harmonics, growth over a revolution, comparison with the matrix of a revolution.
    source : str
        The model.
    """

    def __init__(self, result: Floquet, source: str = "") -> None:
        """Hold a result.

        Parameters
        ----------
        result : aeolid.models.floquet.Floquet
            What was found.
        source : str
            The model.
        """
        self.result, self.source = result, source

    @property
    def modes(self) -> Table[FloquetMode]:
        """Return the modes by frequency."""
        return Table("Floquet modes", self.result.modes, _row)

    @property
    def stable(self) -> bool:
        """Tell whether every motion decays over a revolution."""
        return self.result.stable

    def summary(self) -> str:
        """Return the table as text: frequency, damping, and the harmonics with their participation in each output."""
        return summary(self.to_json())

    def to_frame(self) -> pd.DataFrame:
        """Return one row for each harmonic of each mode in each output as a pandas.DataFrame."""
        import pandas as pd

        rows = [
            {"mode": i, **_row(mode), "harmonic": h.order, "seen_at_hz": h.frequency_hz, "output": name,
             "participation": share}
            for i, mode in enumerate(self.result.modes, 1)
            for h in mode.harmonics for name, share in h.participation.items()
        ]  # fmt: skip
        return pd.DataFrame(rows)

    def to_json(self) -> dict[str, Any]:
        """Return the facts as plain JSON, as `aeolid floquet --json` writes them."""
        return self.result.to_json()

    @public
    def plot(self, axes: Any = None) -> Any:
        """Draw at which frequencies each mode is seen, the participation of each harmonic by the size of its dot.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from aeolid.api.axes import one
        from aeolid.report.floquet import draw

        place = one(axes, size=(8.0, 4.5))
        draw(self.to_json(), place)
        return place

    @public
    def report(self, path: str | Path) -> None:
        """Write a self-contained page with the picture and the tables.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.

        Raises
        ------
        UsageError
            Where the file cannot be written.
        """
        from aeolid.report.floquet import render_floquet

        render_floquet(self.to_json(), path, f"Periodic modes of {self.source or 'a model'}")

    def __repr__(self) -> str:
        speed = f"{60 * abs(self.result.rotor_hz):.4g} rpm"
        kind = "stable" if self.stable else "not stable"
        return f"<FloquetModes: {markup.count(len(self.result.modes), 'mode')} at {speed}, {kind}>"

    def _repr_html_(self) -> str:
        lines = [f"Note: {note}" for note in self.result.notes]
        return markup.shown(repr(self)[1:-1], self.modes._repr_html_(), lines=lines)


def _row(mode: FloquetMode) -> dict[str, Any]:
    return {
        "frequency_hz": mode.frequency_hz, "frequency_std_hz": mode.frequency_std_hz, "damping": mode.damping,
        "damping_std": mode.damping_std, "multiplier": abs(mode.multiplier),
    }  # fmt: skip
