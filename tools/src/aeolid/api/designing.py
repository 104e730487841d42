"""Design excitations before recordings are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.api import facts as told
from aeolid.api import markup
from aeolid.api.linear import LinearModel
from aeolid.api.models import load_model
from aeolid.api.session import public
from aeolid.api.table import Table
from aeolid.durations import seconds_given
from aeolid.errors import UsageError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from aeolid.excitation.forecast import ChannelForecast, ModeForecast
    from aeolid.excitation.result import Candidate
    from aeolid.excitation.result import Design as CoreDesign
    from aeolid.models.modes import Mode


class Excitation:
    """Hold a designed signal, and what it will show.

    Attributes
    ----------
    result : aeolid.excitation.result.Design
        All numbers of the design.
    """

    def __init__(self, result: CoreDesign) -> None:
        """Hold a design.

        Parameters
        ----------
        result : aeolid.excitation.result.Design
            The design.
        """
        self.result = result

    @property
    def values(self) -> NDArray[np.float64]:
        """Return the signal (rows, inputs) in the model's units."""
        return self.result.signals.values

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Return the instants (rows,) in seconds, from 0."""
        return self.result.time_s

    @property
    def inputs(self) -> tuple[str, ...]:
        """Return the names of the inputs."""
        return tuple(b.name for b in self.result.bounds)

    @property
    def duration_s(self) -> float:
        """Return the length of the signal in seconds."""
        return self.result.duration_s

    @property
    def relative_deviation(self) -> float:
        """Return the relative deviation of the goal, which the best candidate has least."""
        return self.result.score

    @property
    def modes(self) -> Table[ModeForecast]:
        """Return the modes with the standard deviations that are foretold."""
        return Table("modes", self.result.forecast.modes, _mode_row)

    @property
    def channels(self) -> Table[ChannelForecast]:
        """Return inputs and outputs with their rms by noise alone, and with the excitation."""
        return Table("channels", self.result.forecast.channels, lambda c: dict(c.__dict__))

    @property
    def candidates(self) -> Table[Candidate]:
        """Return the signals that were tried, the best one first."""
        return Table("candidates", self.result.candidates, lambda c: c.to_json())

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what was assumed, and what should be known of the forecast."""
        return (*self.result.notes, *self.result.remarks())

    def summary(self) -> str:
        """Return a few lines of text, as the command prints them."""
        return self.result.summary()

    def to_json(self) -> dict[str, Any]:
        """Return the facts of the design, without the signal."""
        return self.result.to_json()

    @public
    def to_frame(self) -> pd.DataFrame:
        """Return the signal as a pandas.DataFrame, its index the time in seconds."""
        import pandas as pd

        return pd.DataFrame(self.values, index=pd.Index(self.time_s, name="time_s"), columns=list(self.inputs))

    @public
    def save(self, path: str | Path) -> None:
        """Write the signal as a table (.csv, .csv.gz or .parquet): time_s and a column an input.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.
        """
        self.result.write(path)

    @public
    def wrapper(self, start_s: float = 0.0) -> str:
        """Return the settings with which `port/discon` plays the signal within a controller.

        Parameters
        ----------
        start_s : float
            When it begins, in simulated seconds.

        Returns
        -------
        str

        Raises
        ------
        UsageError
            Where it plays no such signal, or `demand` was not given.
        """
        return self.result.wrapper(start_s)

    def __repr__(self) -> str:
        signals = self.result.signals
        return (
            f"<Excitation: {signals.shape.text(signals.step_s)}; {markup.count(len(self.inputs), 'input')}, "
            f"{self.duration_s:.6g} s, relative deviation {self.relative_deviation:.2%}>"
        )

    def _repr_html_(self) -> str:
        tables = [t._repr_html_() for t in (self.modes, self.channels, self.candidates)]
        return markup.shown(repr(self)[1:-1], *tables, lines=[f"Note: {note}" for note in self.notes])


def _mode_row(m: ModeForecast) -> dict[str, Any]:
    return {"name": m.mode.name, "frequency_hz": m.mode.frequency_hz, "damping": m.mode.damping} | {
        k: v for k, v in m.__dict__.items() if k != "mode"
    }


def linear_model(given: Any) -> LinearModel:
    """Return a linear model of the interface, or read one; raises UsageError on any other."""
    found = load_model(given) if isinstance(given, str | Path) else given
    if not isinstance(found, LinearModel):
        raise UsageError(f"{given if isinstance(given, str | Path) else 'model'}: a linear model is needed, found "
                         f"{type(found).__name__}")  # fmt: skip
    return found


def known_of(model: LinearModel) -> tuple[tuple[Mode, ...], Mapping[str, Any] | None]:
    """Return the modes that an identification stated, none where there is none, and its facts."""
    found = told.stated_modes(model.facts) if model.result is None else model.result.modes
    return found or (), model.facts


@public
def design(
    model: LinearModel | str | Path,
    *,
    bound: Mapping[str, float | str],
    duration: float | str | None = None,
    deviation: float | None = None,
    rate: Mapping[str, float | str] | None = None,
    limit: Mapping[str, float | str] | None = None,
    on_top: bool = False,
    goal: float | str | None = None,
    quantity: str = "both",
    signal: str = "auto",
    clock: float | str | None = None,
    band: tuple[float, float] | None = None,
    lines: int | None = None,
    phases: str | None = None,
    sample_time: float | str | None = None,
    controller: LinearModel | str | Path | None = None,
    past: int | None = None,
    seed: int = 1,
    demand: Mapping[str, str | Sequence[float]] | None = None,
) -> Excitation:
    """Design an excitation within bounds, and foretell how well the modes will be known.

    The same as `aeolid design`, whose options have the names of the parameters; same settings, same numbers.

    Parameters
    ----------
    model : LinearModel or name of a file
        The plant with its noise, as `identify` returns it.
    bound : mapping of str to float or str
        Largest amplitude of each input that is excited: in the model's unit, or a text such as "2deg".
    duration : float or str, optional
        Length of the experiment in seconds, or with a unit as the command takes it ("10min", "1h"); this or `deviation`
        is needed.
    deviation : float, optional
        Relative deviation of the goal that is wanted, 1e-6 to 1; the shortest duration is sought.
    rate : mapping of str to float or str, optional
        Largest change of an input a second, such as "5deg/s".
    limit : mapping of str to float or str, optional
        Largest predicted rms of outputs.
    on_top : bool
        Whether limits are on what the excitation adds, not on the whole with the plant's noise.
    goal : float or str, optional
        Mode to be known best, by frequency in Hz or name; default all, the worst counts.
    quantity : {"both", "frequency", "damping"}
        What of it; both: the larger relative deviation.
    signal : {"auto", "prbs", "multisine", "filtered"}
        Kind of signal; auto: the best of all.
    clock : float or str, optional
        prbs: seconds a bit, or with a unit ("500ms").
    band : tuple of float, optional
        multisine, filtered: lowest and highest frequency in Hz.
    lines : int, optional
        multisine: most lines an input, default 64.
    phases : {"schroeder", "random"}, optional
        multisine: phases of its lines, default Schroeder's.
    sample_time : float or str, optional
        Seconds between values, or with a unit ("50ms"): a multiple or a whole part of the model's, default the model's.
    controller : LinearModel or name of a file, optional
        Linear model from outputs to inputs, to which the excitation is added; default open loop.
    past : int, optional
        Past window of the identification to come, in samples; default that of the model's own identification.
    seed : int
        Of phases, registers and noise, 0 to 4294967295.
    demand : mapping of str to str or sequence of float, optional
        Least and most of the whole demand, such as "0..90deg", which `Excitation.wrapper` needs.

    Returns
    -------
    Excitation

    Raises
    ------
    UsageError
        Where settings do not go together, or the model has no input or no noise.
    NotIdentifiable
        Where plant or loop is unstable, or the goal is out of reach.
    """
    from aeolid.excitation.candidates import Wanted
    from aeolid.excitation.design import DesignRequest, design_excitation

    plant = linear_model(model)
    stated, facts = known_of(plant)
    holder = None if controller is None else linear_model(controller).state_space
    pair = None if band is None else (float(band[0]), float(band[1]))
    wanted = Wanted(None if signal == "auto" else signal, seconds_given("clock", clock), pair, lines, phases)
    for name, pairs in (("bound", bound), ("rate", rate), ("limit", limit), ("demand", demand)):
        if pairs is not None and not isinstance(pairs, Mapping):
            raise UsageError(
                f"{name} is a {type(pairs).__name__}; a mapping of channels is needed, such as {{'pitch': 1}}"
            )
    request = DesignRequest(
        dict(bound), dict(rate or {}), dict(limit or {}), dict(demand or {}),
        seconds_given("duration", duration), deviation, seconds_given("sample_time", sample_time), wanted,
        goal, quantity, on_top, past, seed,
    )  # fmt: skip
    return Excitation(
        design_excitation(plant.state_space, request, controller=holder, stated=stated, facts=facts,
                          source=plant.source or "the model")
    )  # fmt: skip
