"""Run models free on recordings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aeolid.api import markup
from aeolid.api.models import AnyModel, as_record, core_of
from aeolid.api.session import public
from aeolid.api.table import Table

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.identify.free_run import FreeRun
    from aeolid.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """Hold a free run of a model on a recording.

    Attributes
    ----------
    time_s : ndarray, shape (N,)
        Time in seconds.
    values : ndarray, shape (N, l)
        Outputs of the model in their units.
    recorded : ndarray, shape (N, l), or None
        What was measured, where the recording has all outputs.
    outputs, units : tuple of str
        Names of the outputs and their units.
    divergence : str or None
        How the run leaves the recorded range, where it does.
    """

    time_s: Array
    values: Array
    recorded: Array | None
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    divergence: str | None
    run: FreeRun

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what was done to the samples first, such as fill values that were taken for missing."""
        return self.run.notes

    @property
    def fit(self) -> Table[dict[str, Any]]:
        """Return VAF in percent and NRMSE of each output, empty where the outputs are not recorded."""
        score = self.run.score
        rows = [] if score is None else [
            {"output": n, "vaf_percent": score.vaf[n], "nrmse": score.nrmse[n]} for n in self.outputs
        ]  # fmt: skip
        return Table("outputs", rows, dict)

    @public
    def to_frame(self) -> pd.DataFrame:
        """Return the outputs as a pandas.DataFrame, its index the time in seconds."""
        import pandas as pd

        return pd.DataFrame(self.values, index=pd.Index(self.time_s, name="time_s"), columns=list(self.outputs))

    @public
    def plot(self, axes: Any = None) -> Any:
        """Draw each output and what was recorded of it.

        Parameters
        ----------
        axes : array of matplotlib.axes.Axes, optional
            One for each output; default those of a new figure.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, shape (l,)
        """
        from aeolid.api import axes as places

        found = places.grid(axes, len(self.outputs), 1, size=(7.0, 2.0), sharex=True)[:, 0]
        for i, (place, name, unit) in enumerate(zip(found, self.outputs, self.units, strict=True)):
            if self.recorded is not None:
                place.plot(self.time_s, self.recorded[:, i], linewidth=0.9, color="0.55", label="recorded")
            place.plot(self.time_s, self.values[:, i], linewidth=1.1, label="model")
            place.set_ylabel(places.label(f"{name} ({unit or '1'})"))
        found[0].legend(loc="upper right")
        found[-1].set_xlabel("time (s)")
        return found

    @public
    def save(self, path: str | Path) -> None:
        """Write the outputs as a table (.csv, .csv.gz or .parquet); what is not finite is left empty.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.
        """
        from aeolid.formats import write_table

        told = np.where(np.isfinite(self.values), self.values, np.nan)
        columns = {"time_s": self.time_s} | {n: told[:, i] for i, n in enumerate(self.outputs)}
        write_table(Path(path), columns, {"time_s": "s"} | dict(zip(self.outputs, self.units, strict=True)))

    def __repr__(self) -> str:
        size = f"<Simulation: {markup.count(len(self.time_s), 'sample')}, {markup.count(len(self.outputs), 'output')}"
        score = self.run.score
        fit = "" if score is None else f", {markup.fit_of('free-run', score.worst_vaf)}"
        return size + ("" if self.divergence is None else ", DIVERGES") + fit + ">"

    def _repr_html_(self) -> str:
        lines = [*self.notes, *([] if self.divergence is None else [f"WARNING: {self.divergence}"])]
        return markup.shown(repr(self)[1:-1], self.fit._repr_html_(), lines=lines)


@public
def simulate(model: AnyModel, record: Record, *, initial: str = "estimate") -> Simulation:
    """Run a model free on the inputs of a recording.

    Parameters
    ----------
    model : LinearModel, ScheduledModel, Equations, or name of a model file
        The model; a recording with a shorter sample time is brought to that of the model.
    record : Record
        The recording; it needs every input at every sample, and one that reads a fill value (−9999) is missing.
    initial : {"estimate", "model", "zero"}
        First state: estimated where the outputs are recorded too (of equations those that the file leaves free), that
        of the model, or zero.

    Returns
    -------
    Simulation

    Raises
    ------
    DataError
        Where an input is missing, incomplete or in another unit than the model has it in.
    UsageError
        Where an argument has another type or value.
    """
    from aeolid.identify.free_run import run_free

    core = core_of(model)
    run = run_free(core, as_record(record), initial)
    wild = None if run.divergence is None else run.divergence.text()
    names, units = tuple(s.name for s in core.outputs), tuple(s.unit for s in core.outputs)
    return Simulation(run.record.time_s, run.y, run.recorded, names, units, wild, run)
