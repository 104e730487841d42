"""Find the modes of several set-ups of sensors, merged by the references that all of them share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.api import facts as told
from aeolid.api import markup
from aeolid.api.models import as_records
from aeolid.api.session import public
from aeolid.api.table import Table
from aeolid.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.identify.setups import MergedModal
    from aeolid.models.modes import Mode
    from aeolid.record import Record


class MergedModes:
    """Hold the modes of several set-ups, merged by their references.

    Attributes
    ----------
    result : aeolid.identify.setups.MergedModal
        All numbers: merged modes, what each set-up shows of them, the analysis of each set-up.
    """

    def __init__(self, result: MergedModal) -> None:
        """Hold a result.

        Parameters
        ----------
        result : aeolid.identify.setups.MergedModal
            What was found.
        """
        self.result = result

    @property
    def modes(self) -> Table[Mode]:
        """Return the merged modes by frequency; shapes hold all sensors."""
        return told.modes_table(self.result.listed)

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what is to be said of them: modes that a set-up lacks, set-ups that disagree, references at a node."""
        return (*(note for m in self.result.modes for note in m.notes), *self.result.notes)

    def summary(self) -> str:
        """Return a few lines of text."""
        return self.result.summary()

    def to_frame(self) -> pd.DataFrame:
        """Return the merged modes as a pandas.DataFrame."""
        return self.modes.to_frame()

    def to_json(self) -> dict[str, Any]:
        """Return the facts as plain JSON, as `aeolid modes --references … --json` writes them."""
        return self.result.to_json()

    @public
    def plot(self, axes: Any = None) -> Any:
        """Draw the stabilisation diagram of each set-up, one below the other.

        Parameters
        ----------
        axes : array of matplotlib.axes.Axes, shape (set-ups,), optional
            Where to draw; default a new figure.

        Returns
        -------
        numpy.ndarray of matplotlib.axes.Axes, shape (set-ups,)
        """
        from aeolid.api.pictures import draw_setups

        return draw_setups(self.to_json(), axes)

    @public
    def plot_shapes(self, axes: Any = None, *, modes: Sequence[int] | None = None) -> Any:
        """Draw the modes on the sensors' geometry: at rest, at the largest phase, half a period later.

        Positions, directions and lines come from the roles file. Views in which nothing can be seen are left out.

        Parameters
        ----------
        axes : array of matplotlib.axes.Axes, shape (views, modes), optional
            Where to draw; default a new figure.
        modes : sequence of int, optional
            Which modes, by their place in `modes`; default all.

        Returns
        -------
        numpy.ndarray of matplotlib.axes.Axes, shape (views, modes)

        Raises
        ------
        UsageError
            Where no sensor has a position and a direction, or there is no such mode.
        """
        from aeolid.api.frames import draw_frames

        return draw_frames(self.to_json(), axes, modes)

    @public
    def report(self, path: str | Path) -> None:
        """Write a self-contained page with the merged modes, their shapes, and the diagram of each set-up.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.

        Raises
        ------
        UsageError
            Where the file cannot be written.
        """
        from aeolid.report.setups import render_setups

        render_setups(self.to_json(), path, f"Modes of {len(self.result.setups)} set-ups")

    def __repr__(self) -> str:
        return f"<MergedModes: {markup.count(len(self.modes), 'mode')} of {len(self.result.setups)} set-ups>"

    def _repr_html_(self) -> str:
        return markup.shown(repr(self)[1:-1], self.modes._repr_html_(), lines=[f"Note: {n}" for n in self.notes])


@public
def merge_setups(
    setups: Sequence[Record | Sequence[Record]],
    references: Sequence[str] | str,
    *,
    outputs: Sequence[str] | str | None = None,
    past: int | str = "auto",
    largest_order: int | None = None,
    decimate: int = 1,
    reference: str | None = None,
    by: str = "poser",
) -> MergedModes:
    """Find the modes of set-ups of sensors by outputs alone, and merge them.

    The same as `aeolid modes SETUP… --references`: each set-up is analysed as by `modes`; modes are matched by
    frequency and by their shapes on the references, which scale the shapes of the others (PoSER: Reynders, Magalhães,
    De Roeck and Cunha 2009), or make one realisation of all set-ups (PreGER: Döhler, Andersen and Mevel 2010).

    Parameters
    ----------
    setups : sequence of Record, or of sequences of Record
        Two or more; each a recording, or several of the same sensors. Sample times may differ.
    references : sequence of str, or str
        Outputs that stay: every set-up has them.
    outputs : sequence of str, or str, optional
        Channels to use besides, default those of the role output; inputs are left out.
    past : int or str
        Past window p of each set-up: samples, seconds ("12s"), or "auto".
    largest_order : int, optional
        Up to which order poles are found; by default the data decide.
    decimate : int
        Factor by which the sample rate is lowered first.
    reference : str, optional
        Output that shapes are scaled to; default the one that moves most in each mode.
    by : str
        "poser" merges mode by mode: modes of a single set-up are kept, and frequency and damping are weighted by what
        each set-up knows of them. "preger" merges the models, restricted to modes of two set-ups or more, to one
        realisation: for modes near each other, whose shapes mix differently in each set-up.

    Returns
    -------
    MergedModes

    Raises
    ------
    UsageError
        On settings that cannot be, a reference that a set-up lacks, or one sensor's name at several places.
    DataError
        Where recordings are inconsistent.
    NotIdentifiable
        Where a set-up has too few samples; by "preger" where no two set-ups show the same mode, or the references do
        not observe one.
    """
    from aeolid.identify.choose_past import read_past
    from aeolid.identify.request_checks import check_whole
    from aeolid.identify.setup_request import find_merged

    if isinstance(setups, str) or not isinstance(setups, Sequence):
        raise UsageError("setups is no sequence of recordings")
    found = [as_records(one) for one in setups]
    check_whole({"decimate": decimate})
    windows = [read_past(str(past), records[0].sample_time_s * decimate) for records in found]
    kept, used = ([n] if isinstance(n, str) else n for n in (references, outputs))
    result = find_merged(
        found, list(kept or []), outputs=None if used is None else list(used), past=windows, largest=largest_order,
        decimation=decimate, reference=reference, by=by,
    )  # fmt: skip
    return MergedModes(result)
