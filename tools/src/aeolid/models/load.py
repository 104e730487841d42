"""Load a model of any kind and simulate it on a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError, UsageError
from aeolid.models import lpv, state_space
from aeolid.models.angles import with_parts
from aeolid.models.blade_sets import with_multiblade
from aeolid.models.divergence import Divergence, divergence_of
from aeolid.models.equations import TIME
from aeolid.models.exchange.files import FOREIGN, read_state_space
from aeolid.models.intersample import straightened
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.model_file import Signal
from aeolid.models.prediction import complete_stretches, estimate_initial_state
from aeolid.models.rate import holds_of, same_step
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record
from aeolid.units import conversion
from aeolid.wording import did_you_mean

Array = NDArray[np.float64]


class Named(Protocol):
    """Say what a model's input or output tells about itself."""

    @property
    def name(self) -> str:
        """Return the name of the channel."""
        ...

    @property
    def unit(self) -> str:
        """Return its unit, empty where the model does not say."""
        ...


class Model(Protocol):
    """Say what every model offers: named inputs and outputs and a free run on a recording."""

    @property
    def inputs(self) -> Sequence[Named]:
        """Return the inputs."""
        ...

    @property
    def outputs(self) -> Sequence[Named]:
        """Return the outputs."""
        ...

    def simulate(self, record: Record) -> Array:
        """Run the model free on the recorded inputs; returns the outputs (N, l) in the model's units."""
        ...


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Run a state-space model on recordings; initial is "estimate", "model" (x0 of the file) or "zero"."""

    state_space: StateSpace
    initial: str = "estimate"

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Return the inputs."""
        return self.state_space.inputs

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """Return the outputs."""
        return self.state_space.outputs

    def simulate(self, record: Record) -> Array:
        """Run free on the recorded inputs; where the outputs are recorded too, the first state is estimated."""
        holds = holds_of(record, [s.name for s in self.inputs])
        model = discretise(self.state_space, record.sample_time_s, holds)
        require_sample_time(model, record)
        u = require_complete(record, model.inputs)
        if not self.state_space.sample_time_s:  # discretised for straight lines
            u = straightened(u, np.array([h == "band_limited" for h in holds], dtype=bool))
        with np.errstate(all="ignore"):  # an unstable model may overflow; the caller sees what is not finite
            start = self._estimated(model, record, u)
            if start is None:
                start = np.zeros(model.order) if self.initial == "zero" else model.x0
                start = start - present_part(self.state_space, record.sample_time_s, holds) @ (u[0] - model.u_offset)
            return model.simulate(u, start)

    def _estimated(self, model: StateSpace, record: Record, u: Array) -> Array | None:
        """Return the first state (n,) of the discrete-time model as the outputs show it; None where it is given."""
        names = [c.name for c in record.channels]
        if self.initial != "estimate" or not all(s.name in names for s in model.outputs):
            return None
        y = matched(record, model.outputs)
        runs = complete_stretches(y, max(2 * model.order, 10))
        if not runs or runs[0][0] != 0:
            return None  # nothing recorded at the start to estimate from
        stop = runs[0][1]
        return estimate_initial_state(model, u[:stop] - model.u_offset, y[:stop] - model.y_offset)


def load_model(path: str | Path) -> Model:
    """Read model.json (state space), model.toml (equations), the one of them that a folder holds, .mat or .lin.

    A .mat or .lin file holds a linear model of MATLAB or of an OpenFAST linearisation. Raises DataError
    that names file and key or line, UsageError on another suffix.
    """
    source = Path(path)
    if source.is_dir():
        found = [p for p in (source / "model.json", source / "model.toml") if p.exists()]
        if len(found) != 1:
            raise DataError(f"{path}: the folder holds {len(found)} of model.json and model.toml, one is needed")
        source = found[0]
    if source.suffix == ".toml":
        from aeolid.models import equations_file  # brings the compiled loops along, which linear models do without

        return equations_file.load(source)
    if source.suffix == ".json":
        data = state_space.read_json(source)
        if data.get("scheduling"):
            from aeolid.models.lpv_prediction import LpvModel  # it stands on this module

            return LpvModel(lpv.from_json(data, str(source)))
        return LinearModel(state_space.from_json(data, str(source)))
    if source.suffix.lower() in FOREIGN:
        return LinearModel(read_state_space(source))
    raise UsageError(f"{path}: a model is a .json, .mat, .lin (linear) or .toml (equations) file")


def discretise(model: StateSpace, sample_time_s: float, holds: Sequence[str] = ()) -> StateSpace:
    """Return a continuous-time model in discrete time; a discrete-time one as it is.

    holds: of each input, "zoh" (held over a sample, as all are by default) or else (straight from one sample to the
    next). Straight, B and D are those of the state less the part that the present sample already is (Franklin, Powell
    and Workman 1998, section 6.3.2); x0 stays the state itself, which is the same only where the first inputs stand at
    the operating point (`present_part`). A Kalman gain of continuous time is dropped: its discrete counterpart needs
    the noise intensities.
    """
    if model.sample_time_s > 0:
        return model
    from scipy.signal import cont2discrete

    continuous = (model.A, model.B, model.C, model.D)
    A, B, C, D, _ = cont2discrete(continuous, sample_time_s, method="zoh")
    moving = [i for i, h in enumerate(holds) if h != "zoh"]
    if moving:
        B[:, moving] = cont2discrete(continuous, sample_time_s, method="foh")[1][:, moving]
        D = D + C @ present_part(model, sample_time_s, holds)
    return replace(model, A=A, B=B, C=C, D=D, K=None, innovation_covariance=None, sample_time_s=sample_time_s)


def present_part(model: StateSpace, sample_time_s: float, holds: Sequence[str]) -> Array:
    """Return Γ₂ (n, r): the state of `discretise` is x − Γ₂ u, u the deviations of the present sample.

    Φ₂ B h of the inputs that go straight from one sample to the next, zero of those that are held and of a model that
    is in discrete time already.
    """
    moving = [i for i, h in enumerate(holds) if h != "zoh"]
    result = np.zeros_like(model.B)
    if model.sample_time_s > 0 or not moving or not model.order:
        return result
    from scipy.signal import cont2discrete

    states = (model.A, model.B, np.eye(model.order), np.zeros_like(model.B))
    result[:, moving] = cont2discrete(states, sample_time_s, method="foh")[3][:, moving]
    return result


def diverged(model: Model, record: Record, y: Array) -> Divergence | None:
    """Return how the free run y (N, l) of a model on a recording diverges; None where it does not."""
    linear = discretise(model.state_space, record.sample_time_s) if isinstance(model, LinearModel) else None
    return divergence_of(y, record, model.outputs, linear)


def matched(record: Record, signals: Sequence[Named], own: Sequence[str] = ()) -> Array:
    """Return the samples (N, k) of a model's signals; raises DataError on a missing channel or another unit.

    own: the names that the model itself defines: one of them may have been meant by a channel that is missing. A
    signal called time_s that is no channel is the time itself: every recording has it. The cosine and sine of a
    recorded angle, and the fixed-frame channels of blades, are made where a model asks for them (see `angles`,
    `blade_sets`).
    """
    record = with_multiblade(with_parts(record, [s.name for s in signals]), [s.name for s in signals])
    names = [c.name for c in record.channels]
    if any(s.name == TIME for s in signals) and TIME not in names:
        values = np.column_stack([record.values, record.time_s])
        record = replace(record, values=values, channels=(*record.channels, Channel(TIME, "s", "ignore")))
        names.append(TIME)
    for s in signals:
        if s.name not in names:
            have = ", ".join(names)
            hint = did_you_mean(s.name, [*names, *own]) or ";"
            raise DataError(
                f"{record.source}: the model's channel {s.name!r} is missing{hint} the recording has {have}"
            )
        unit = record.unit(s.name)
        if s.unit and unit != s.unit:
            raise DataError(
                f"{record.source}: channel {s.name!r} is in {unit or 'no unit'!r}, the model has it in {s.unit!r}; "
                f"{conversion(unit, s.unit)} or correct its unit in the roles file"
            )
    return record.columns([s.name for s in signals])


def require_complete(record: Record, signals: Sequence[Named]) -> Array:
    """Return the samples of a model's inputs; a free run cannot go over a missing one."""
    values = matched(record, signals)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        sample, column = bad[0]
        raise DataError(
            f"{record.source}: input {signals[column].name!r} is missing at sample {sample + 1}; "
            "a free run needs every input sample, cut the recording or fill it"
        )
    return values


def require_sample_time(model: StateSpace | LpvStateSpace, record: Record) -> None:
    """Refuse a discrete-time model on a recording of another sample time."""
    if model.sample_time_s > 0 and not same_step(model.sample_time_s, record.sample_time_s):
        raise DataError(
            f"{record.source}: sample time {record.sample_time_s:g} s, the model has {model.sample_time_s:g} s; "
            "decimate or resample the recording"
        )
