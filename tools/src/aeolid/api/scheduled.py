"""Hold models whose matrices depend on a measured scheduling."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aeolid.api import facts as told
from aeolid.api import markup
from aeolid.api.session import in_python, public
from aeolid.api.table import Table
from aeolid.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.api.floquet import FloquetModes
    from aeolid.api.linear import LinearModel
    from aeolid.api.simulation import Simulation
    from aeolid.api.validation import Validation
    from aeolid.identify.lpv import LpvIdentification
    from aeolid.models.lpv import LpvStateSpace
    from aeolid.models.lpv_prediction import LpvModel
    from aeolid.models.modes import Mode
    from aeolid.record import Record


class ScheduledModel:
    """Hold x⁺ = A(μ) x + B(μ) u + K(μ) e, y = C x + D u + e with a measured scheduling μ (linear parameter-varying).

    Attributes
    ----------
    state_space : aeolid.models.lpv.LpvStateSpace
        The matrices of each part of the scheduling.
    result : aeolid.identify.lpv.LpvIdentification or None
        All numbers of the identification; None of a model that was read.
    facts : mapping or None
        The same as plain JSON.
    source : str
        Where the model came from.
    """

    def __init__(
        self, state_space: LpvStateSpace, *, result: LpvIdentification | None = None,
        facts: Mapping[str, Any] | None = None, intersample: str | None = None, source: str = "",
    ) -> None:  # fmt: skip
        """Hold a model.

        Parameters
        ----------
        state_space : aeolid.models.lpv.LpvStateSpace
            The matrices.
        result : aeolid.identify.lpv.LpvIdentification, optional
            The identification that found them.
        facts : mapping, optional
            What an identification said of itself, from a model.json.
        intersample : str, optional
            How inputs go on within a sample, from a model.json.
        source : str
            Where the model came from.
        """
        self.state_space, self.result, self.source = state_space, result, source
        self._intersample = intersample
        self.facts: Mapping[str, Any] | None = facts if result is None else result.to_json()

    @property
    def core(self) -> LpvModel:
        """Return the model that runs on recordings."""
        from aeolid.models.lpv_prediction import LpvModel

        return LpvModel(self.state_space)

    @property
    def order(self) -> int:
        """Return the number of states."""
        return self.state_space.order

    @property
    def inputs(self) -> tuple[str, ...]:
        """Return the names of the inputs."""
        return tuple(s.name for s in self.state_space.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Return the names of the outputs."""
        return tuple(s.name for s in self.state_space.outputs)

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Return the names of the channels that the matrices depend on."""
        return tuple(s.name for s in self.state_space.scheduling)

    @property
    def modes(self) -> Table[Mode]:
        """Return the modes at the mean of the scheduling; empty of a file that does not say where that is."""
        found = (told.stated_modes(self.facts) or ()) if self.result is None else self.result.modes
        return told.modes_table(found)

    @property
    def points(self) -> Table[dict[str, Any]]:
        """Return the operating points of the recordings, each with its modes: frequency and damping."""
        rows = (self.facts or {}).get("operating_points") or []
        flat = [
            {"where": p["where"], **p["scheduling"], "frequency_hz": m["frequency_hz"], "damping": m["damping"]}
            for p in rows for m in p["modes"]
        ]  # fmt: skip
        return Table("modes at operating points", flat, dict)

    @property
    def fit(self) -> Table[dict[str, Any]]:
        """Return VAF in percent and NRMSE of each output on the recordings it was identified from."""
        return told.fit_table(self.facts, self.outputs)

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what the identification warns of."""
        return tuple(in_python(text) for text in told.texts(self.facts, "notes"))

    def summary(self) -> str:
        """Return a few lines of text."""
        return repr(self) if self.result is None else self.result.summary()

    def to_frame(self) -> pd.DataFrame:
        """Return the modes at the mean of the scheduling as a pandas.DataFrame."""
        return self.modes.to_frame()

    @public
    def at(self, scheduling: Mapping[str, float]) -> LinearModel:
        """Return the linear model at one operating point.

        Parameters
        ----------
        scheduling : mapping of str to float
            Value of each scheduling channel in its unit.

        Returns
        -------
        LinearModel

        Raises
        ------
        UsageError
            Where a channel is missing or unknown.
        """
        from aeolid.api.linear import LinearModel

        if set(scheduling) != set(self.scheduling):
            raise UsageError(f"scheduling: a value of each of {', '.join(self.scheduling)} is needed, and no other")
        values = np.array([float(scheduling[name]) for name in self.scheduling])
        where = ", ".join(f"{name} = {value:g}" for name, value in zip(self.scheduling, values, strict=True))
        return LinearModel(self.state_space.frozen(values), source=f"{self.source} at {where}")

    @public
    def floquet_modes(
        self,
        rotor_speed: str | float | None = None,
        *,
        at: Mapping[str, float] | None = None,
        harmonics: int | None = None,
        multiples: Mapping[str, int] | None = None,
    ) -> FloquetModes:
        """Return the modes of a model that is periodic in the rotor's angle, as `aeolid floquet` does.

        Parameters
        ----------
        rotor_speed : str or float, optional
            "12.1rpm", "0.2Hz", "1.27rad/s", "72.6deg/s", or a number in rpm; default the mean of the recordings.
        at : mapping of str to float, optional
            Values of scheduling channels that are no angle, default their means.
        harmonics : int, optional
            Harmonics to compute with, default as many as the modes need.
        multiples : mapping of str to int, optional
            How often an angle turns in a revolution of the rotor, default once.

        Returns
        -------
        FloquetModes

        Raises
        ------
        UsageError
            Where the scheduling is no angle, the speed is not known or varied too much, or a value cannot be.
        NotIdentifiable
            Where no number of harmonics describes the modes.
        """
        from aeolid.api.floquet import FloquetModes
        from aeolid.models.floquet_request import analyse

        facts = self.to_json().get("identification")
        result = analyse(
            self.state_space, facts, rotor_speed=rotor_speed, at=at, harmonics=harmonics, multiples=multiples,
            source=self.source or "the model",
        )  # fmt: skip
        return FloquetModes(result, self.source)

    @property
    def mean(self) -> LinearModel:
        """Return the linear model at the mean of the scheduling; raises UsageError where that is not known."""
        rows = (self.facts or {}).get("operating_points") or []
        if not rows:
            raise UsageError("the operating points are not known; at(...) freezes the model at one")
        return self.at(rows[0]["scheduling"])

    @public
    def to_control(self, *, innovations: bool = False) -> Any:
        """Return the model at the mean of the scheduling as a control.StateSpace; python-control is optional.

        Parameters
        ----------
        innovations : bool
            Whether the innovations are further inputs.

        Returns
        -------
        control.StateSpace

        Raises
        ------
        UsageError
            Where python-control is not installed, or the mean is not known.
        """
        return self.mean.to_control(innovations=innovations)

    @public
    def plot_bode(self, axes: Any = None, *, inputs: Sequence[str] | None = None,
                  outputs: Sequence[str] | None = None) -> Any:  # fmt: skip
        """Draw gain and phase of the frequency response at the mean of the scheduling.

        Parameters
        ----------
        axes : array of matplotlib.axes.Axes, shape (2 outputs, inputs), optional
            Where to draw; default a new figure.
        inputs : sequence of str, optional
            From which inputs; default all.
        outputs : sequence of str, optional
            To which outputs; default all.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, shape (2 outputs, inputs)
        """
        return self.mean.plot_bode(axes, inputs=inputs, outputs=outputs)

    @public
    def simulate(self, record: Record, *, initial: str = "estimate") -> Simulation:
        """Run the model free on the inputs of a recording, as `aeolid.simulate` does.

        Parameters
        ----------
        record : Record
            The recording.
        initial : {"estimate", "model", "zero"}
            First state.

        Returns
        -------
        Simulation
        """
        from aeolid.api.simulation import simulate

        return simulate(self, record, initial=initial)

    @public
    def validate(self, record: Record, *, steps: Sequence[int] = (5, 10, 50)) -> Validation:
        """Hold the model against a recording, as `aeolid.validate` does.

        Parameters
        ----------
        record : Record
            The recording, best one that the model has not seen.
        steps : sequence of int
            Horizons of the k-step prediction in samples.

        Returns
        -------
        Validation
        """
        from aeolid.api.validation import validate

        return validate(self, record, steps=steps)

    @public
    def save(self, path: str | Path) -> None:
        """Write the model as .json.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.

        Raises
        ------
        UsageError
            On another suffix, or where the file cannot be written.
        """
        from aeolid import output

        if Path(path).suffix != ".json":
            raise UsageError(f"{path}: a scheduled model is written as .json")
        output.write_json(path, self.to_json())

    def to_json(self) -> dict[str, Any]:
        """Return the content of model.json."""
        if self.result is not None:
            return self.result.model_json()
        more = {"intersample": self._intersample, "identification": self.facts}
        return self.state_space.to_json() | {key: value for key, value in more.items() if value is not None}

    @public
    def plot_poles(self, axes: Any = None) -> Any:
        """Draw the poles at each operating point of the recordings.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; default a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        UsageError
            Where the operating points are not known.
        """
        from aeolid.api.pictures import draw_poles

        rows = (self.facts or {}).get("operating_points") or []
        if not rows:
            raise UsageError("the operating points are not known; at(...) freezes the model at one, with plot_poles")
        groups = [(np.array([complex(*z) for z in p["eigenvalues"]]), str(p["where"])) for p in rows]
        return draw_poles(groups, self.state_space.sample_time_s, axes)

    def __repr__(self) -> str:
        parts = [markup.count(self.order, "state"), markup.count(len(self.inputs), "input")]
        parts += [markup.count(len(self.outputs), "output"), f"scheduled by {', '.join(self.scheduling)}"]
        fit = told.one_step_fit(self.fit)
        return f"<ScheduledModel: {', '.join(parts)}{'' if fit is None else f', one-step fit {fit:.0f} %'}>"

    def _repr_html_(self) -> str:
        tables = [table._repr_html_() for table in (self.points, self.fit) if len(table)]
        return markup.shown(repr(self)[1:-1], *tables, lines=[f"Note: {note}" for note in self.notes])
