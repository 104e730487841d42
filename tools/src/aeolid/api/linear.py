"""Hold linear models: identified, read, or a scheduled one frozen at an operating point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aeolid.api import facts as told
from aeolid.api import markup
from aeolid.api.session import in_python, public
from aeolid.api.table import Table
from aeolid.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.api.simulation import Simulation
    from aeolid.api.validation import Validation
    from aeolid.identify.ort import OrtIdentification
    from aeolid.identify.result import Identification
    from aeolid.models.load import LinearModel as CoreLinear
    from aeolid.models.modes import Mode
    from aeolid.models.state_space import StateSpace
    from aeolid.record import Record

Array = NDArray[np.float64]


class LinearModel:
    """Hold x⁺ = A x + B u + K e, y = C x + D u + e and what is known of it.

    Attributes
    ----------
    state_space : aeolid.models.state_space.StateSpace
        The matrices A, B, C, D, K, x0, the covariance of the innovations, channels and sample time.
    result : aeolid.identify.result.Identification, aeolid.identify.ort.OrtIdentification or None
        All numbers of the identification; None of a model that was read.
    facts : mapping or None
        The same as plain JSON; a model.json holds it too.
    source : str
        Where the model came from.
    """

    def __init__(
        self, state_space: StateSpace, *, result: Identification | OrtIdentification | None = None,
        facts: Mapping[str, Any] | None = None, intersample: str | None = None, source: str = "",
    ) -> None:  # fmt: skip
        """Hold a model.

        Parameters
        ----------
        state_space : aeolid.models.state_space.StateSpace
            The matrices.
        result : aeolid.identify.result.Identification or aeolid.identify.ort.OrtIdentification, optional
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
    def core(self) -> CoreLinear:
        """Return the model that runs on recordings."""
        from aeolid.models.load import LinearModel as CoreLinear

        return CoreLinear(self.state_space)

    @property
    def order(self) -> int:
        """Return the number of states."""
        return self.state_space.order

    @property
    def sample_time_s(self) -> float:
        """Return the sample time in seconds, 0 for continuous time."""
        return self.state_space.sample_time_s

    @property
    def inputs(self) -> tuple[str, ...]:
        """Return the names of the inputs."""
        return tuple(s.name for s in self.state_space.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Return the names of the outputs."""
        return tuple(s.name for s in self.state_space.outputs)

    @property
    def modes(self) -> Table[Mode]:
        """Return the modes by frequency, with standard deviations where they are known."""
        from aeolid.models.modes import modes_of

        found = told.stated_modes(self.facts) if self.result is None else self.result.modes
        return told.modes_table(modes_of(self.state_space) if found is None else found)

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Return the poles (n,), largest magnitude first; in the z-plane where the model has a sample time."""
        from aeolid.identify.outcome import poles_of

        return poles_of(self.state_space.A)

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
        from aeolid.identify.mode_names import mode_lines

        return (
            "\n".join([repr(self), *mode_lines(self.modes, self.state_space.sample_time_s)])
            if self.result is None
            else self.result.summary()
        )

    def to_frame(self) -> pd.DataFrame:
        """Return the modes as a pandas.DataFrame."""
        return self.modes.to_frame()

    @public
    def to_control(self, *, innovations: bool = False) -> Any:
        """Return the model as a control.StateSpace, whose signals are deviations from their `offset` here.

        Parameters
        ----------
        innovations : bool
            Whether the innovations are further inputs, e_<output>, that enter by K and the unit matrix.

        Returns
        -------
        control.StateSpace

        Raises
        ------
        UsageError
            Where python-control is not installed, or the model has no K to show.
        """
        from aeolid.models.exchange.python_control import to_control

        return to_control(self.state_space, innovations=innovations)

    @public
    def to_continuous(self, *, hold: str = "zoh") -> LinearModel:
        """Return the model in continuous time, which at the samples answers its inputs as this one does.

        Parameters
        ----------
        hold : {"zoh", "foh"}
            How inputs go on between samples: held, or straight from one to the next.

        Returns
        -------
        LinearModel
            Without a Kalman gain, which belongs to the samples.

        Raises
        ------
        UsageError
            Where a pole has no counterpart: one at 0 or on the negative real axis.
        """
        from aeolid.models.continuous import to_continuous

        return LinearModel(to_continuous(self.state_space, hold), source=self.source)

    @public
    def to_sample_time(self, sample_time_s: float, *, hold: str = "zoh") -> LinearModel:
        """Return the model with another sample time, by way of continuous time.

        Parameters
        ----------
        sample_time_s : float
            The new sample time in seconds, above 0.
        hold : {"zoh", "foh"}
            How inputs go on between samples: held, or straight from one to the next.

        Returns
        -------
        LinearModel
            Without a Kalman gain unless the sample time is the model's own.

        Raises
        ------
        UsageError
            On a time that is none, or where a pole has no counterpart in continuous time.
        """
        from aeolid.models.continuous import to_sample_time

        return LinearModel(to_sample_time(self.state_space, sample_time_s, hold), source=self.source)

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
        """Write the model: .json (what every command reads), or .mat (MATLAB).

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

        if Path(path).suffix == ".mat":
            from aeolid.models.exchange.matlab import write_mat

            write_mat(path, self.state_space)
            return
        if Path(path).suffix != ".json":
            raise UsageError(f"{path}: a model is written as .json or .mat")
        output.write_json(path, self.to_json())

    @public
    def to_fmu(self, path: str | Path) -> tuple[str, ...]:
        """Write a functional mock-up unit: FMI 2.0, co-simulation, with sources and a library for this machine.

        Parameters
        ----------
        path : str or pathlib.Path
            The file, .fmu; another of this name is replaced.

        Returns
        -------
        tuple of str
            What the unit leaves out, a sentence each.

        Raises
        ------
        UsageError
            Where the suffix is not .fmu, the model is one of continuous time, or where the file cannot be written.
        """
        from aeolid.api.mock_up import written_unit
        from aeolid.models.exchange.linear_equations import linear_equations

        return written_unit(Path(path), linear_equations(self.state_space, "the model"), 0.0, "model.json")

    def to_json(self) -> dict[str, Any]:
        """Return the content of model.json."""
        if self.result is not None:
            return self.result.model_json()
        more = {"intersample": self._intersample, "identification": self.facts}
        return self.state_space.to_json() | {key: value for key, value in more.items() if value is not None}

    @public
    def plot_bode(self, axes: Any = None, *, inputs: Sequence[str] | None = None,
                  outputs: Sequence[str] | None = None) -> Any:  # fmt: skip
        """Draw gain and phase of the frequency response, with 95 % bands where they are known.

        Parameters
        ----------
        axes : array of matplotlib.axes.Axes, shape (2 outputs, inputs), optional
            Where to draw: for each output a row of gains and one of phases; default a new figure.
        inputs : sequence of str, optional
            From which inputs; default all.
        outputs : sequence of str, optional
            To which outputs; default all.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, shape (2 outputs, inputs)
        """
        from aeolid.api.pictures import draw_bode

        return draw_bode(self, axes, inputs, outputs)

    @public
    def plot_poles(self, axes: Any = None) -> Any:
        """Draw the poles: in the z-plane with the unit circle, or in the s-plane in continuous time.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from aeolid.api.pictures import draw_poles

        return draw_poles([(self.eigenvalues, "poles")], self.sample_time_s, axes)

    def __repr__(self) -> str:
        parts = [markup.count(n, what) for n, what in (
            (self.order, "state"), (len(self.inputs), "input"), (len(self.outputs), "output"), (len(self.modes), "mode")
        )]  # fmt: skip
        fit = told.one_step_fit(self.fit)
        return f"<LinearModel: {', '.join(parts)}{'' if fit is None else f', one-step fit {fit:.0f} %'}>"

    def _repr_html_(self) -> str:
        fit = self.fit
        tables = [self.modes._repr_html_(), *([fit._repr_html_()] if len(fit) else [])]
        return markup.shown(repr(self)[1:-1], *tables, lines=[f"Note: {note}" for note in self.notes])
