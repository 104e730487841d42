"""Foretell what an experiment with given signals shows: sizes of the channels, deviations of the modes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.excitation.expected import PoleSpread, expected_factor, noise_gram, predicted_poles, window_gram
from aeolid.excitation.experiment import Experiment, experiment_on, scaled_plant
from aeolid.excitation.information import information, least_covariance
from aeolid.excitation.setup import Setup
from aeolid.excitation.signals import Signals
from aeolid.models.modes import Mode, continuous_poles, pushed_to_modes
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
MOST_BOUND = 24  # states up to which the Cramér–Rao bound is computed: its equations grow with the sixth power
LEANS = 1.5  # times by which a deviation may be larger without the penalty
LOST = 0.05  # of |log z|: an expected model whose pole is farther off does not show the mode
NOTHING = 0.98  # of the deviation by noise alone: a signal that leaves more of it does not reach the mode


@dataclass(frozen=True)
class ModeForecast:
    """Hold a mode with the deviations that an identification will have.

    frequency_std_hz, damping_std: of PBSIDopt with the window of the method; firm: whether they are nearly the same
    without the penalty of its regression: where they are not, the signal leaves directions of the windows to that
    penalty, and the spread may be several times as large. Infinite and not firm where the model of the expected windows
    has no such pole. least_*: Cramér–Rao bound of any method;
    noise_*: the same bound where nothing is excited and the plant's own noise alone tells the mode. None: not computed,
    inf: told by nothing.
    """

    mode: Mode
    frequency_std_hz: float
    damping_std: float
    firm: bool
    least_frequency_std_hz: float | None = None
    least_damping_std: float | None = None
    noise_frequency_std_hz: float | None = None
    noise_damping_std: float | None = None

    @property
    def reached(self) -> bool | None:
        """Tell whether the signals tell of the mode what the noise alone does not; None where not computed."""
        pairs = ((self.least_frequency_std_hz, self.noise_frequency_std_hz), (self.least_damping_std,
                  self.noise_damping_std))  # fmt: skip
        if any(a is None or b is None for a, b in pairs):
            return None
        return any(math.isfinite(a) and a < NOTHING * b for a, b in pairs if a is not None and b is not None)

    def relative(self, quantity: str) -> float:
        """Return the deviation over the value: of "frequency", "damping", or the larger of "both"."""
        by_frequency = self.frequency_std_hz / self.mode.frequency_hz if self.mode.frequency_hz > 0 else math.inf
        by_damping = self.damping_std / abs(self.mode.damping) if self.mode.damping else math.inf
        found = {"frequency": by_frequency, "damping": by_damping, "both": max(by_frequency, by_damping)}[quantity]
        return found if math.isfinite(found) else math.inf

    def to_json(self) -> dict[str, Any]:
        """Return JSON facts; what is infinite or not known as null."""
        numbers = {k: v for k, v in self.__dict__.items() if k not in ("mode", "firm")}
        told = {k: v if v is not None and math.isfinite(v) else None for k, v in numbers.items()}
        mode = {"name": self.mode.name, "frequency_hz": self.mode.frequency_hz, "damping": self.mode.damping}
        return mode | told | {"reached": self.reached, "firm": self.firm}


@dataclass(frozen=True)
class ChannelForecast:
    """Hold the rms of an input or output about its mean: by noise alone, and with the excitation on top."""

    name: str
    unit: str
    noise: float
    total: float


@dataclass(frozen=True, eq=False)
class Forecast:
    """Hold modes and channels of one experiment; samples of the model it lasts for."""

    modes: tuple[ModeForecast, ...]
    channels: tuple[ChannelForecast, ...]
    samples: int


class Forecaster:
    """Hold what does not depend on the signals: the covariances by noise."""

    def __init__(self, setup: Setup) -> None:
        """Take a set-up."""
        self.setup = setup
        try:
            self.noise = setup.experiment.noise_covariances(setup.method.past)
        except (np.linalg.LinAlgError, ValueError):
            raise NotIdentifiable(
                "the model has a pole on the unit circle, so that no spread of its outputs exists; --controller says "
                "what holds it"
            ) from None

    def output_sizes(self, signals: Signals) -> tuple[Array, Array]:
        """Return the rms (l,) of the outputs by noise alone and by the signals alone."""
        setup = self.setup
        answer = setup.experiment.answer(setup.samples_of(signals.values))
        first = setup.experiment.states + setup.experiment.inputs
        by_noise = np.sqrt(np.maximum(self.noise[0].diagonal()[setup.experiment.inputs :], 0.0))
        return by_noise, np.sqrt((answer[:, first:] ** 2).mean(axis=0))

    def forecast(self, signals: Signals, *, bound: bool = False) -> Forecast:
        """Return what the signals will show; bound: whether the Cramér–Rao bounds are wanted, too."""
        setup = self.setup
        u = setup.samples_of(signals.values)
        answer = setup.experiment.answer(u)
        z = answer[:, setup.experiment.states :]
        past, windows = setup.method.past, len(z) - setup.method.past
        size = np.sqrt(np.maximum(self.noise[0].diagonal(), 0.0) + (z**2).mean(axis=0))
        scale = np.where(size > 0, size, 1.0)
        gram = window_gram(z / scale, past) + noise_gram(self.noise / scale[:, None] / scale, windows)
        factor = expected_factor(gram, past, windows, setup.experiment.inputs)
        poles, bare = (predicted_poles(factor, setup.method, way) for way in ("gcv", "none"))
        modes = [_with_spread(m, poles, bare, setup.plant.sample_time_s) for m in setup.modes]
        if bound and setup.plant.order <= MOST_BOUND:
            modes = self._bounded(modes, answer, scale)
        signals_in = [(s.name, s.unit) for s in (*setup.plant.inputs, *setup.plant.outputs)]
        by_noise = np.sqrt(np.maximum(self.noise[0].diagonal(), 0.0))
        channels = [ChannelForecast(n, unit, float(a), float(b))
                    for (n, unit), a, b in zip(signals_in, by_noise, size, strict=True)]  # fmt: skip
        return Forecast(tuple(modes), tuple(channels), len(u))

    def _bounded(self, modes: Sequence[ModeForecast], answer: Array, scale: Array) -> list[ModeForecast]:
        setup, n = self.setup, self.setup.plant.order
        plant, experiment = scaled_plant(setup.plant, scale), _scaled(setup, scale)
        answer = answer / np.concatenate([np.ones(n), scale])
        found = []
        for seen in (answer, np.zeros_like(answer)):
            M = information(plant, experiment, seen, setup.method.feedthrough)
            found.append(least_covariance(plant, M, setup.method.feedthrough))
        out, h = [], setup.plant.sample_time_s
        for mode in modes:
            least, noise = (_pushed(mode.mode, poles, h) for poles in found)
            out.append(replace(mode, least_frequency_std_hz=least[0], least_damping_std=least[1],
                               noise_frequency_std_hz=noise[0], noise_damping_std=noise[1]))  # fmt: skip
        return out


def _scaled(setup: Setup, scale: Array) -> Experiment:
    """Return the experiment with [u; y] in units of scale."""
    m, plant = scaled_plant(setup.plant, scale), setup.plant
    in_units: StateSpace = replace(plant, B=m.B, C=m.C, D=m.D, K=m.K, innovation_covariance=m.covariance)
    r = plant.B.shape[1]
    su, sy = scale[:r], scale[r:]
    c = setup.controller
    if c is not None:
        c = replace(c, B=c.B * sy, C=c.C / su[:, None], D=c.D * sy / su[:, None])
    return experiment_on(in_units, c)


def _with_spread(mode: Mode, poles: PoleSpread, bare: PoleSpread, step_s: float) -> ModeForecast:
    """Return the forecast by poles found with a penalty; bare: without one."""
    frequency, damping = _pushed(mode, poles, step_s)
    z = mode.eigenvalue
    off, spread = float(abs(poles.values - z).min()), float(np.sqrt(np.trace(poles.near(z))))
    if not mode.is_real and not off <= max(LOST * abs(np.log(z)), 3 * spread):
        return ModeForecast(mode, math.inf, math.inf, False)
    plain = _pushed(mode, bare, step_s)
    firm = plain[0] <= LEANS * frequency and plain[1] <= LEANS * max(damping, 1e-300)
    return ModeForecast(mode, frequency, damping, firm or mode.is_real)


def _pushed(mode: Mode, poles: PoleSpread, step_s: float) -> tuple[float, float]:
    """Return the deviations of frequency in Hz and damping."""
    z = mode.eigenvalue
    covariance = poles.near(z)
    if not np.isfinite(covariance).all():
        return math.inf, math.inf
    s = complex(continuous_poles(np.array([z]), step_s)[0])
    return pushed_to_modes(z, s, step_s, covariance)
