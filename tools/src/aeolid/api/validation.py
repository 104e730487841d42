"""Hold models against recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aeolid.api import markup
from aeolid.api.models import AnyModel, as_record, core_of, load_model
from aeolid.api.session import in_python, public
from aeolid.api.table import Table
from aeolid.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.identify.residuals import ResidualTest
    from aeolid.identify.validation import Validation as CoreValidation
    from aeolid.record import Record

Array = NDArray[np.float64]
_LAGS = 50  # shown of an autocorrelation
_NORMAL = 2.576  # 99 %, the level of the tests


@dataclass(frozen=True, eq=False, repr=False)
class Validation:
    """Hold the fit of a model on one recording, and the tests of its innovations.

    Attributes
    ----------
    result : aeolid.identify.validation.Validation
        All numbers.
    residuals : ndarray, shape (M, l)
        Innovations of the predictor, stretches one after the other, not a number where an output is missing; without a
        noise model the errors of the free run.
    outputs, units : tuple of str
        Names of the outputs and their units.
    sample_time_s : float
        Sample time in seconds.
    """

    result: CoreValidation
    residuals: Array
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    sample_time_s: float

    @property
    def has_predictor(self) -> bool:
        """Tell whether the model has a noise model: without one only its free run is scored."""
        return self.result.fit is not None

    @property
    def verdict(self) -> str | None:
        """Return the verdict on the innovations: pass, immaterial, fail, or undecided where there are too few samples.

        None without a noise model.
        """
        return None if self.result.residuals is None else self.result.residuals.verdict

    @property
    def fit(self) -> Table[dict[str, Any]]:
        """Return VAF in percent and NRMSE of each output: free run, one step and k steps ahead."""
        runs = [("free run", self.result.free_run)] if self.result.driven else []
        if self.result.fit is not None:
            runs += [("1 step", self.result.fit.one_step)]
            runs += [(f"{k} steps", score) for k, score in self.result.fit.steps.items()]
        rows = [
            {"output": name, "prediction": what, "vaf_percent": score.vaf[name], "nrmse": score.nrmse[name]}
            for name in self.outputs for what, score in runs
        ]  # fmt: skip
        return Table("scores", rows, dict)

    @property
    def tests(self) -> Table[ResidualTest]:
        """Return the tests of the innovations; empty without a noise model."""
        from aeolid.identify.residuals import ResidualTest

        tests = () if self.result.residuals is None else self.result.residuals.tests
        return Table("tests", tests, lambda t: dict(t.__dict__), tuple(f.name for f in fields(ResidualTest)))

    @property
    def advice(self) -> tuple[str, ...]:
        """Return what failed tests mean and what to do."""
        return tuple(map(in_python, self.result.advice))

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what was done to the samples first, such as fill values that were taken for missing."""
        return self.result.notes

    @property
    def divergence(self) -> str | None:
        """Return how the free run leaves the recorded range; None where it does not."""
        return None if self.result.divergence is None else self.result.divergence.text()

    def summary(self) -> str:
        """Return a few lines of text."""
        return in_python(self.result.summary())

    def to_frame(self) -> pd.DataFrame:
        """Return the scores as a pandas.DataFrame."""
        return self.fit.to_frame()

    def to_json(self) -> dict[str, Any]:
        """Return the facts as `aeolid validate --json` writes them."""
        return self.result.to_json()

    @public
    def save(self, path: str | Path) -> None:
        """Write the facts as JSON.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.
        """
        from aeolid import output

        output.write_json(path, self.to_json())

    @public
    def plot_residuals(self, axes: Any = None) -> Any:
        """Draw the residuals of each output over time, and their autocorrelation with the 99 % bounds of white noise.

        Parameters
        ----------
        axes : array of matplotlib.axes.Axes, shape (l, 2), optional
            Where to draw; default a new figure.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, shape (l, 2)
        """
        from aeolid.api import axes as places

        found = places.grid(axes, len(self.outputs), 2, size=(5.0, 2.0))
        what = "innovation" if self.has_predictor else "free-run error"
        for i, (name, unit) in enumerate(zip(self.outputs, self.units, strict=True)):
            series, lags = found[i]
            e = self.residuals[:, i]
            series.plot(self.sample_time_s * np.arange(len(e)), e, linewidth=0.7)
            series.set_ylabel(places.label(f"{name} ({unit or '1'})"))
            rho = autocorrelation(e, _LAGS)
            bound = _NORMAL / np.sqrt(max(int(np.isfinite(e).sum()), 1))
            lags.vlines(np.arange(1, len(rho) + 1), 0, rho, linewidth=1.2)
            lags.axhspan(-bound, bound, color="0.6", alpha=0.3, linewidth=0)
            lags.set_ylabel("autocorrelation")
        found[0, 0].set_title(f"{what}s")
        found[-1, 0].set_xlabel("time in complete stretches (s)")
        found[-1, 1].set_xlabel("lag (samples)")
        return found

    def __repr__(self) -> str:
        parts = [markup.count(len(self.outputs), "output")]
        if self.result.driven:
            parts += [markup.fit_of("free-run", self.result.free_run.worst_vaf)]
        if self.result.fit is not None:
            parts += [markup.fit_of("one-step", self.result.fit.one_step.worst_vaf), f"innovations {self.verdict}"]
        return f"<Validation: {', '.join(parts)}{'' if self.divergence is None else ', DIVERGES'}>"

    def _repr_html_(self) -> str:
        warned = [] if self.divergence is None else [f"WARNING: {self.divergence}"]
        return markup.shown(repr(self)[1:-1], self.fit._repr_html_(), lines=[*self.notes, *warned, *self.advice])


def autocorrelation(e: Array, lags: int) -> Array:
    """Return ρ_k = Σ e_t e_{t+k} / Σ e_t² of e (N,) less its mean for k = 1 … lags, fewer where N is less.

    A sample that is not finite counts as the mean.
    """
    known = np.isfinite(e)
    centred = np.where(known, e - (e[known].mean() if known.any() else 0.0), 0.0)
    power = float(centred @ centred) or 1.0
    return np.array([centred[k:] @ centred[:-k] / power for k in range(1, min(lags, len(e) - 1) + 1)])


@public
def validate(model: AnyModel, record: Record, *, steps: Sequence[int] = (5, 10, 50)) -> Validation:
    """Measure one-step, k-step and free-run fit of a model on a recording, and test the innovations of its predictor.

    Parameters
    ----------
    model : LinearModel, ScheduledModel, Equations, or name of a model file
        The model; a recording with a shorter sample time is brought to that of the model.
    record : Record
        The recording, best one that the model has not seen; samples that read a fill value (−9999) count as missing.
    steps : sequence of int
        Horizons of the k-step prediction in samples, 1 to 100000.

    Returns
    -------
    Validation

    Raises
    ------
    DataError
        Where a channel is missing, incomplete or in another unit than the model has it in.
    UsageError
        Where an argument has another type or value.
    """
    from aeolid.identify.free_run import started
    from aeolid.identify.stated import stated_windows
    from aeolid.identify.validation import validate_recording
    from aeolid.models.load import matched

    model = load_model(model) if isinstance(model, str | Path) else model
    core, windows = core_of(model), stated_windows(getattr(model, "facts", None))
    result, slow = validate_recording(core, as_record(record), _horizons(steps), windows)
    names, units = tuple(s.name for s in core.outputs), tuple(s.unit for s in core.outputs)
    if result.fit is None:  # of the run that is scored
        residuals = matched(slow, core.outputs) - started(core, slow).simulate(slow)
    else:
        residuals = result.fit.innovations
    return Validation(result, residuals, names, units, slow.sample_time_s)


def _horizons(steps: Sequence[int]) -> tuple[int, ...]:
    from aeolid.identify.validation import horizons

    if isinstance(steps, str) or not all(isinstance(k, int | np.integer) for k in steps):
        raise UsageError(f"steps = {steps!r} is not a list of whole numbers such as [5, 10, 50]")
    return horizons([int(k) for k in steps])
