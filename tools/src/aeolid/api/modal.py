"""Find the modes of recordings by their outputs alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.api import facts as told
from aeolid.api import markup
from aeolid.api.models import as_records
from aeolid.api.session import public
from aeolid.api.table import Table

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.identify.modal import Modal
    from aeolid.models.modes import Mode
    from aeolid.record import Record


class ModalAnalysis:
    """Hold the modes of recordings of outputs alone, and the stabilisation diagram behind them.

    Attributes
    ----------
    result : aeolid.identify.modal.Modal
        All numbers: modes, clusters, poles of all orders and windows, criteria.
    source : str
        The recordings.
    """

    def __init__(self, result: Modal, source: str = "") -> None:
        """Hold a result.

        Parameters
        ----------
        result : aeolid.identify.modal.Modal
            What was found.
        source : str
            The recordings.
        """
        self.result, self.source = result, source

    @property
    def modes(self) -> Table[Mode]:
        """Return the modes by frequency, without harmonics and steady sines."""
        return told.modes_table(self.result.listed)

    @property
    def harmonics(self) -> Table[Mode]:
        """Return the harmonics of the rotor and other steady sines."""
        listed = self.result.listed
        return told.modes_table([m for m in self.result.modes if m not in listed])

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what was done to the samples first, such as fill values that were taken for missing."""
        return self.result.notes

    def summary(self) -> str:
        """Return a few lines of text."""
        return self.result.summary()

    def to_frame(self) -> pd.DataFrame:
        """Return the modes as a pandas.DataFrame."""
        return self.modes.to_frame()

    def to_json(self) -> dict[str, Any]:
        """Return the facts as plain JSON, as `aeolid modes --json` writes them."""
        return self.result.to_json()

    @public
    def plot(self, axes: Any = None) -> Any:
        """Draw the stabilisation diagram: poles over frequency and order, modes with 95 % bands.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from aeolid.api.pictures import draw_stabilisation

        return draw_stabilisation(self.to_json(), axes)

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
        """Write a self-contained page with the diagram, the modes and their shapes.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.

        Raises
        ------
        UsageError
            Where the file cannot be written.
        """
        from aeolid.report.stabilisation import render_modal

        render_modal(self.to_json(), path, f"Modes of {self.source}")

    def __repr__(self) -> str:
        return f"<ModalAnalysis: {markup.count(len(self.modes), 'mode')}, {len(self.harmonics)} harmonics>"

    def _repr_html_(self) -> str:
        return markup.shown(repr(self)[1:-1], self.modes._repr_html_(), lines=[f"Note: {n}" for n in self.notes])


@public
def modes(
    records: Record | Sequence[Record],
    *,
    outputs: Sequence[str] | str | None = None,
    past: int | str = "auto",
    largest_order: int | None = None,
    decimate: int = 1,
    reference: str | None = None,
    blades: Sequence[str] | str | None = None,
) -> ModalAnalysis:
    """Find the modes of recordings by their outputs alone (operational modal analysis).

    The same as `aeolid modes`: poles over orders and windows from one factor, clustered, harmonics told apart.

    Parameters
    ----------
    records : Record or sequence of Record
        One recording, or several of one experiment set.
    outputs : sequence of str, or str, optional
        Channels to use, default those of the role output; inputs are left out.
    past : int or str
        Past window p: samples, seconds ("12s"), or "auto"; longer ones are tried besides.
    largest_order : int, optional
        Up to which order poles are found; by default the data decide.
    decimate : int
        Factor by which the sample rate is lowered first.
    reference : str, optional
        Output that shapes are scaled to; default the one that moves most in each mode.
    blades : sequence of str, or str, optional
        Sets of blade channels that go to the fixed frame first (collective, cosine and sine part), each as
        "RootMyb1..3" or as names in the order of the blades, "A,B,C"; "auto" finds those called alike but for 1, 2, 3
        at the end, "none" leaves all. Default those that the roles file gives by `blade`.

    Returns
    -------
    ModalAnalysis

    Raises
    ------
    UsageError
        On settings that cannot be, or an unknown channel.
    DataError
        Where the recordings are inconsistent.
    NotIdentifiable
        Where there are too few samples.
    """
    from aeolid.identify.choose_past import read_past
    from aeolid.identify.modal import find_modal
    from aeolid.identify.request_checks import check_whole

    found = as_records(records)
    check_whole({"decimate": decimate})
    window = read_past(str(past), found[0].sample_time_s * decimate)
    result = find_modal(
        found, outputs=outputs, past=window, largest=largest_order, decimation=decimate, reference=reference,
        blades=blades,
    )  # fmt: skip
    return ModalAnalysis(result, ", ".join(record.source for record in found))
