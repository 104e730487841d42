"""Follow the modes of a turbine over recordings at different winds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.api import markup
from aeolid.api.models import as_records
from aeolid.api.session import public

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.fleet.campbell import Campbell
    from aeolid.record import Record


class CampbellDiagram:
    """Hold the modes of several recordings, followed from one to the next.

    Attributes
    ----------
    result : aeolid.fleet.campbell.Campbell
        All numbers: recordings in the order of the wind, tracks, what was found once, what is a line of the rotor.
    """

    def __init__(self, result: Campbell) -> None:
        """Hold a result.

        Parameters
        ----------
        result : aeolid.fleet.campbell.Campbell
            What was found.
        """
        self.result = result

    def summary(self) -> str:
        """Return the table as text, a column a recording."""
        return self.result.summary()

    def to_json(self) -> dict[str, Any]:
        """Return the facts as plain JSON, as `aeolid campbell --json` writes them."""
        return self.result.to_json()

    def to_frame(self) -> pd.DataFrame:
        """Return one row for each mode of each recording as a pandas.DataFrame."""
        import pandas as pd

        rows = [
            {
                "name": track.name, "track": i, "source": run.source, "wind_m_s": run.wind_m_s,
                "rotor_hz": run.turning.frequency_hz, "frequency_hz": mode.frequency_hz,
                "frequency_std_hz": mode.frequency_std_hz, "damping": mode.damping, "damping_std": mode.damping_std,
                "whirl": "" if mode.whirl is None else mode.whirl.direction,
                "blade_frequency_hz": None if mode.whirl is None else mode.whirl.blade_hz,
            }
            for i, track in enumerate(self.result.tracks)
            for run, mode in zip(self.result.runs, track.modes, strict=True) if mode is not None
        ]  # fmt: skip
        return pd.DataFrame(rows)

    @public
    def plot(self, axes: Any = None) -> Any:
        """Draw the diagram over the rotor's speed, and over the wind where every recording has it.

        Parameters
        ----------
        axes : matplotlib.axes.Axes or array of two, optional
            Where to draw; one alone shows the rotor's speed. Default a new figure.

        Returns
        -------
        matplotlib.axes.Axes or numpy.ndarray
        """
        from aeolid.report.campbell_chart import draw, has_wind

        facts = self.to_json()
        if axes is None:
            import matplotlib.pyplot as plt

            wide = 2 if has_wind(facts) else 1
            axes = plt.subplots(1, wide, figsize=(10.6, 5.2), layout="constrained", sharey=True)[1]
        draw(facts, axes)
        return axes

    @public
    def report(self, path: str | Path) -> None:
        """Write a self-contained page with the diagram and its table.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.

        Raises
        ------
        UsageError
            Where the file cannot be written.
        """
        from aeolid.report.campbell import render_campbell

        render_campbell(self.to_json(), path, f"Campbell diagram of {len(self.result.runs)} recordings")

    def __repr__(self) -> str:
        tracks, runs = self.result.tracks, self.result.runs
        return f"<CampbellDiagram: {markup.count(len(tracks), 'mode')} over {len(runs)} recordings>"


@public
def campbell(
    records: Sequence[Record],
    *,
    outputs: Sequence[str] | str | None = None,
    blades: Sequence[str] | str | None = None,
    past: int | str = "auto",
    largest_order: int | None = None,
    decimate: int | None = None,
) -> CampbellDiagram:
    """Find the modes of recordings at different winds by their outputs alone, and follow them: a Campbell diagram.

    The same as `aeolid campbell`. Modes of two recordings are one where frequency, damping and shape agree; whirling
    ones are compared in the frame of the blades.

    Parameters
    ----------
    records : sequence of Record
        Two or more, one a wind speed, each with the rotor's azimuth or speed.
    outputs : sequence of str, or str, optional
        Channels to use, default those of the role output; inputs are left out.
    blades : sequence of str, or str, optional
        Sets of blade channels that go to the fixed frame first, each as "RootMyb1..3" or as names in the order of the
        blades, "A,B,C"; "auto" finds those called alike but for 1, 2, 3 at the end, "none" leaves all. Default those
        that the roles file gives by `blade`.
    past : int or str
        Past window p: samples, seconds ("12s"), or "auto"; longer ones are tried besides.
    largest_order : int, optional
        Up to which order poles are found; by default the data decide.
    decimate : int, optional
        Factor by which the sample rate is lowered first; by default as far as twelve times the fastest rotor's speed
        stays below half of it.

    Returns
    -------
    CampbellDiagram

    Raises
    ------
    UsageError
        On fewer than two recordings, settings that cannot be, or an unknown channel.
    DataError
        Where a recording has neither azimuth nor speed of the rotor, or is inconsistent.
    NotIdentifiable
        Where there are too few samples.
    """
    from aeolid.fleet.campbell import find_campbell

    found = as_records(records)
    return CampbellDiagram(
        find_campbell(found, outputs=outputs, blades=blades, past=past, largest=largest_order, decimation=decimate)
    )
