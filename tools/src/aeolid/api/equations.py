"""Hold models written as equations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.api import markup
from aeolid.api.session import public
from aeolid.api.table import Table

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.api.fitted import EquationsFit
    from aeolid.api.progress import Progress
    from aeolid.api.simulation import Simulation
    from aeolid.api.validation import Validation
    from aeolid.models.equations import Equations as CoreEquations
    from aeolid.models.equations import Parameter
    from aeolid.record import Record


class Equations:
    """Hold dx/dt = f(x, u, θ) or x⁺ = f(x, u, θ), y = h(x, u, θ).

    Attributes
    ----------
    core : aeolid.models.equations.Equations
        Parameters, states, outputs and equations as checked expressions.
    source : str
        Where the model came from.
    """

    def __init__(self, core: CoreEquations, *, source: str = "") -> None:
        """Hold equations.

        Parameters
        ----------
        core : aeolid.models.equations.Equations
            The model.
        source : str
            Where the model came from.
        """
        self.core, self.source = core, source

    @classmethod
    @public
    def load(cls, path: str | Path) -> Equations:
        """Read model.toml.

        Parameters
        ----------
        path : str or pathlib.Path
            The file.

        Returns
        -------
        Equations

        Raises
        ------
        DataError
            Where the file is missing or wrong; the text names key or line.
        """
        from aeolid.models import equations_file

        return cls(equations_file.load(path), source=str(path))

    @property
    def name(self) -> str:
        """Return the name of the model."""
        return self.core.name

    @property
    def inputs(self) -> tuple[str, ...]:
        """Return the names of the inputs."""
        return tuple(s.name for s in self.core.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Return the names of the outputs."""
        return tuple(s.name for s in self.core.outputs)

    @property
    def states(self) -> tuple[str, ...]:
        """Return the names of the states."""
        return tuple(s.name for s in self.core.states)

    @property
    def parameters(self) -> Table[Parameter]:
        """Return the parameters: value, unit, range, whether a diagnosis may fit them, declared deviation."""
        return Table("parameters", self.core.parameters, _parameter_row)

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters as a pandas.DataFrame."""
        return self.parameters.to_frame()

    def to_text(self) -> str:
        """Return the content of model.toml."""
        from aeolid.models.equations_file import to_toml

        return to_toml(self.core)

    @public
    def simulate(self, record: Record) -> Simulation:
        """Run the equations on the inputs of a recording, as `aeolid.simulate` does.

        Parameters
        ----------
        record : Record
            The recording.

        Returns
        -------
        Simulation
        """
        from aeolid.api.simulation import simulate

        return simulate(self, record)

    @public
    def validate(self, record: Record, *, steps: Sequence[int] = (5, 10, 50)) -> Validation:
        """Hold the equations against a recording, as `aeolid.validate` does.

        Parameters
        ----------
        record : Record
            The recording.
        steps : sequence of int
            Horizons of the k-step prediction in samples; equations have no predictor, so their free run is scored.

        Returns
        -------
        Validation
        """
        from aeolid.api.validation import validate

        return validate(self, record, steps=steps)

    @public
    def fit(self, records: Record | Sequence[Record], *, progress: Progress = None) -> EquationsFit:
        """Fit the free values to recordings by prediction errors, as `aeolid identify --structure` does.

        A part of the recordings is left out of a first fit and says how well its values foretell; then all are fitted.

        Parameters
        ----------
        records : Record or sequence of Record
            One recording, or several of the same machine.
        progress : bool or callable, optional
            By default a bar on a terminal and in a notebook; True shows it always, False never; a function is called
            with a text and the share done.

        Returns
        -------
        EquationsFit

        Raises
        ------
        DataError
            Where recordings and equations do not go together: a missing channel, another unit.
        UsageError
            Where no parameter is free.
        NotIdentifiable
            Where the data are too few, or the model diverges on them.
        """
        import hashlib

        from aeolid.api.fitted import EquationsFit
        from aeolid.api.from_diagnose import estimate, make_case
        from aeolid.api.models import as_records
        from aeolid.api.progress import shown

        name = self.source or self.name
        digest = hashlib.sha256(self.to_text().encode()).hexdigest()
        case = make_case(as_records(records), self.core, title=name, source=name, sha256=digest)
        with shown(progress) as show:
            found = estimate(case, lambda text: show(text, None))
        return EquationsFit(found, Equations(found.model, source=name))

    @public
    def save(self, path: str | Path) -> None:
        """Write model.toml.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.

        Raises
        ------
        UsageError
            Where the suffix is not .toml or the file cannot be written.
        """
        from aeolid import output
        from aeolid.errors import UsageError

        if Path(path).suffix != ".toml":
            raise UsageError(f"{path}: equations are written as .toml")
        output.write_text(path, self.to_text())

    @public
    def to_fmu(self, path: str | Path, *, sample_time: float = 0.0) -> tuple[str, ...]:
        """Write a functional mock-up unit: FMI 2.0, co-simulation, with sources and a library for this machine.

        Parameters
        ----------
        path : str or pathlib.Path
            The file, .fmu; another of this name is replaced.
        sample_time : float
            Time between two samples in s, of the recordings as a rule; 0 for equations in discrete time, which have
            their own.

        Returns
        -------
        tuple of str
            What the unit leaves out, a sentence each.

        Raises
        ------
        UsageError
            Where the suffix is not .fmu, the sample time is missing or an input acts early, or where the file cannot be
            written.
        """
        from aeolid.api.mock_up import written_unit

        return written_unit(Path(path), self.core, sample_time, self.source or self.name)

    def __repr__(self) -> str:
        sizes = ((self.states, "state"), (self.inputs, "input"), (self.outputs, "output"),
                 (self.core.parameters, "parameter"))  # fmt: skip
        name = markup.title(self.name)
        return f"<Equations: {name}, {', '.join(markup.count(len(found), what) for found, what in sizes)}>"

    def _repr_html_(self) -> str:
        return markup.shown(repr(self)[1:-1], self.parameters._repr_html_())


def _parameter_row(parameter: Parameter) -> dict[str, Any]:
    p = parameter
    return {
        "parameter": p.name, "value": p.value, "unit": p.unit, "minimum": p.minimum, "maximum": p.maximum,
        "free": p.free, "prior_std": p.prior_std,
    }  # fmt: skip
