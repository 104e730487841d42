"""Design an excitation: try the candidates within all bounds, and take the one that tells most of the goal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from aeolid.errors import NotIdentifiable, UsageError
from aeolid.excitation.candidates import Wanted, candidates, read_goal, within_reach
from aeolid.excitation.forecast import Forecast, Forecaster, ModeForecast
from aeolid.excitation.quantities import Amounts, Bound, read_bounds, read_limits
from aeolid.excitation.result import Candidate, Design
from aeolid.excitation.setup import MOST_ROWS, Setup, read_step, require_plant, set_up, swinging
from aeolid.excitation.signals import Shape, Signals, make_signals
from aeolid.models.modes import Mode
from aeolid.models.state_space import StateSpace

QUANTITIES = ("frequency", "damping", "both")
TRIES = 12  # of a smaller amplitude, where outputs are limited; of another duration
Trial = tuple[Signals, Forecast]
FIRST_PERIODS = 100  # of the slowest mode: the duration a search begins with


@dataclass(frozen=True)
class DesignRequest:
    """Hold what is asked of a design, by the names of the options of `aeolid design`.

    bound, rate, limit, demand: by channel, numbers in the model's unit or texts with one. duration_s, or deviation: the
    wanted relative deviation of the goal, of which the shortest duration is sought. goal: a mode's name or frequency;
    quantity: what of it, one of QUANTITIES. on_top: limits are on what the excitation alone adds. past: window of the
    identification to come, in samples.
    """

    bound: Amounts = field(default_factory=dict)
    rate: Amounts = field(default_factory=dict)
    limit: Amounts = field(default_factory=dict)
    demand: Mapping[str, str | Sequence[float]] = field(default_factory=dict)
    duration_s: float | None = None
    deviation: float | None = None
    sample_time_s: float | None = None
    wanted: Wanted = field(default_factory=Wanted)
    goal: float | str | None = None
    quantity: str = "both"
    on_top: bool = False
    past: int | None = None
    seed: int = 1

    def check(self) -> None:
        """Refuse what cannot be; raises UsageError that names the option."""
        self.wanted.check()
        for name, value in (("duration", self.duration_s), ("deviation", self.deviation), ("seed", self.seed),
                            ("past", self.past)):  # fmt: skip
            if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
                raise UsageError(f"--{name} {value!r}: a number is needed")
        if (self.duration_s is None) == (self.deviation is None):
            raise UsageError("either --duration or --deviation is needed: how long the recording is, or how good")
        if self.duration_s is not None and not 0 < self.duration_s < 1e9:
            raise UsageError(f"--duration {self.duration_s:g}: a time in seconds above 0 is needed")
        if self.deviation is not None and not 1e-6 <= self.deviation <= 1:
            raise UsageError(f"--deviation {self.deviation:g}: a part of the value is needed, such as 0.05 or 5%")
        if self.quantity not in QUANTITIES:
            raise UsageError(f"--quantity {self.quantity!r} is none of {', '.join(QUANTITIES)}")
        if not 0 <= self.seed <= 0xFFFFFFFF:
            raise UsageError(f"--seed {self.seed}: 0 to 4294967295 are taken")
        if self.past is not None and not 1 <= self.past <= 1000:
            raise UsageError(f"--past {self.past}: 1 to 1000 samples are taken")


def design_excitation(
    model: StateSpace, request: DesignRequest, *, controller: StateSpace | None = None, stated: Sequence[Mode] = (),
    facts: Mapping[str, Any] | None = None, source: str = "the model",
) -> Design:  # fmt: skip
    """Design signals for a model within bounds, and foretell what they show.

    model: discrete, with K and innovation covariance. controller: a linear model from outputs to inputs, which the
    excitation is added to; default open loop. stated, facts: modes and settings that an identification wrote.
    Raises UsageError on a request that cannot be, DataError on a controller that does not fit, NotIdentifiable where
    the plant or loop is unstable, or a goal is out of reach. Cost: for each of up to nine candidates one run of the
    model and O(((p + 1) m)³), p the past window, m channels.
    """
    request.check()
    require_plant(model)
    step = read_step(model, request.sample_time_s)
    bounds = read_bounds(model.inputs, request.bound, request.rate, request.demand)
    limits = read_limits(model.outputs, request.limit)

    def tried(duration_s: float) -> Design:
        rows = _rows(duration_s, step[0])
        setup = set_up(model, bounds, controller, stated, facts, request.past, step, rows * step[0])
        return _Search(setup, request, limits, rows, source).best()

    if request.duration_s is not None:
        slowest = _slowest(model, stated, bounds, controller, facts, request, step)
        _require_long(request.duration_s, slowest)
        return tried(request.duration_s)
    return _shortest(tried, request, _slowest(model, stated, bounds, controller, facts, request, step), step[0])


def _slowest(
    model: StateSpace, stated: Sequence[Mode], bounds: tuple[Bound, ...], controller: StateSpace | None,
    facts: Mapping[str, Any] | None, request: DesignRequest, step: tuple[float, int, int],
) -> float:  # fmt: skip
    """Return the period in seconds of the slowest mode that matters."""
    setup = set_up(model, bounds, controller, stated, facts, request.past, step, 1e4 * model.sample_time_s)
    read_goal(setup.modes, setup.plant.sample_time_s, request.goal)
    return 1 / min(m.frequency_hz for m in swinging(setup.modes, setup.plant.sample_time_s))


def _require_long(duration_s: float, period_s: float) -> None:
    if duration_s < period_s:
        raise UsageError(
            f"--duration {duration_s:g}: shorter than a period of the slowest mode, {period_s:.3g} s; hundreds of "
            "periods tell a damping"
        )


def _rows(duration_s: float, step_s: float) -> int:
    rows = round(duration_s / step_s)
    if rows > MOST_ROWS:
        raise UsageError(
            f"{duration_s:.4g} s at a value every {step_s:g} s are {rows} rows; at most {MOST_ROWS} are taken"
        )
    return rows


def _shortest(tried: Any, request: DesignRequest, period_s: float, step_s: float) -> Design:
    """Return the design of the shortest duration that reaches the wanted deviation, to a few percent.

    Deviations fall with the root of the duration, so each try tells where the next is.
    """
    assert request.deviation is not None
    most = MOST_ROWS * step_s
    duration, enough, short = min(FIRST_PERIODS * period_s, most), None, 0.0
    for _ in range(TRIES):
        found: Design = tried(duration)
        if found.score <= request.deviation:
            enough = found
            if found.score > 0.97 * request.deviation or duration <= 1.05 * max(short, period_s):
                return found
        else:
            short = max(short, duration)
            if duration >= most:
                break
        ratio = (found.score / request.deviation) ** 2 if math.isfinite(found.score) else 4.0
        wanted = duration * min(max(ratio, 0.05), 20.0) * 1.02
        if enough is not None:
            wanted = max(min(wanted, enough.duration_s), 1.02 * short)
        duration = math.ceil(min(max(wanted, period_s), most) / step_s) * step_s
    if enough is None:
        raise NotIdentifiable(
            f"a relative deviation of {request.deviation:.3g} is not reached within {most:.4g} s "
            f"({MOST_ROWS} rows; {found.score:.3g} is); allow larger bounds"
        )
    return enough


class _Search:
    """Try candidates on one set-up and duration."""

    def __init__(self, setup: Setup, request: DesignRequest, limits: Mapping[str, float], rows: int, source: str):
        self.setup, self.request, self.rows, self.source = setup, request, rows, source
        goals = read_goal(setup.modes, setup.plant.sample_time_s, request.goal)
        self.goals, beyond = within_reach(goals, setup.step_s, request.wanted)
        self.notes = (*setup.notes, *([beyond] if beyond else []))
        self.forecaster = Forecaster(setup)
        names = [s.name for s in setup.plant.outputs]
        self.limits = np.array([limits.get(n, math.inf) for n in names])
        self._require_windows()

    def best(self) -> Design:
        """Return the design of the best candidate."""
        signals, tried = self._tried({})
        forecast = self.forecaster.forecast(signals, bound=True)
        if self._leave_out_unreached(forecast):
            again, tried = self._tried(tried)
            if again is not signals:
                signals, forecast = again, self.forecaster.forecast(again, bound=True)
        ranked = sorted(tried.values(), key=self._rank)
        told = [Candidate.of(s, self._score(f), self._rank((s, f))[0] == 0) for s, f in ranked]
        return Design(
            signals, forecast, tuple(told), told[0].score, tuple(self.goals),
            self.request.quantity, self.request.seed, self.setup.bounds,
            {n: v for n, v in zip([s.name for s in self.setup.plant.outputs], self.limits.tolist(), strict=True)
             if math.isfinite(v)},
            self.request.on_top, self.setup.method, self.setup.controller is not None, self.notes, self.source,
        )  # fmt: skip

    def _tried(self, before: Mapping[Shape, Trial]) -> tuple[Signals, dict[Shape, Trial]]:
        """Try the candidates for the goals, beside those that were tried before; returns the best signals, and all."""
        tried = dict(before)
        for shape in candidates(self.setup, self.goals, self.request.wanted, self.rows):
            if shape not in tried:
                signals = self._within_limits(shape)
                tried[shape] = signals, self.forecaster.forecast(signals)
        return min(tried.values(), key=self._rank)[0], tried

    def _of_goal(self, forecast: Forecast) -> list[ModeForecast]:
        chosen = {m.eigenvalue for m in self.goals}
        return [m for m in forecast.modes if m.mode.eigenvalue in chosen]

    def _score(self, forecast: Forecast) -> float:
        return max(m.relative(self.request.quantity) for m in self._of_goal(forecast))

    def _rank(self, trial: Trial) -> tuple[int, float]:
        """Return what trials are sorted by: those whose deviations are firm come first."""
        return int(not all(m.firm for m in self._of_goal(trial[1]))), self._score(trial[1])

    def _within_limits(self, shape: Shape) -> Signals:
        """Return the signals with the largest common part of the amplitudes that keeps all outputs within limits."""
        part = 1.0
        for _ in range(TRIES):
            signals = make_signals(shape, self.setup.bounds, self.rows, self.setup.step_s, self.request.seed, part)
            noise, added = self.forecaster.output_sizes(signals)
            room = self._room(noise)
            with np.errstate(divide="ignore", invalid="ignore"):
                fits = float(np.nanmin(np.where(added > 0, room / added, math.inf), initial=math.inf))
            if fits >= 1:
                return signals
            part *= min(fits * 0.998, 0.998)
        raise NotIdentifiable("no amplitude keeps the outputs within their limits; allow more")

    def _room(self, noise: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
        if self.request.on_top:
            return self.limits
        over = np.flatnonzero(noise >= self.limits)
        if len(over):
            signal = self.setup.plant.outputs[over[0]]
            raise UsageError(
                f"--limit {signal.name}: its own noise is {noise[over[0]]:.4g} {signal.unit} already, which leaves "
                f"nothing below {self.limits[over[0]]:.4g}; allow more, or --on-top limits what the excitation adds"
            )
        with np.errstate(invalid="ignore"):
            out = np.sqrt(self.limits**2 - noise**2)
        return np.asarray(out)

    def _require_windows(self) -> None:
        method, m = self.setup.method, len(self.setup.plant.inputs) + len(self.setup.plant.outputs)
        samples = self.rows * self.setup.row_samples // self.setup.row_parts
        needed = (method.past + 1) * m + 1 + method.past
        if samples < 2 * needed:
            raise NotIdentifiable(
                f"the duration holds {samples} samples; a past window of {method.past} with {m} channels needs "
                f"{2 * needed} for deviations to mean anything: record longer, or identify with a shorter --past"
            )

    def _leave_out_unreached(self, forecast: Forecast) -> bool:
        """Take modes out of reach from the goals, if there are any; raises NotIdentifiable where none is left."""
        lost = {m.mode.eigenvalue for m in self._of_goal(forecast) if m.reached is False}
        kept = tuple(m for m in self.goals if m.eigenvalue not in lost)
        if not kept:
            names = ", ".join(b.name for b in self.setup.bounds)
            modes = ", ".join(f"{m.frequency_hz:.4g}" for m in self.goals)
            raise NotIdentifiable(
                f"{names} within the bounds does not reach the mode at {modes} Hz: what is known of it comes from the "
                "plant's own noise, with or without excitation. Excite another input, or allow more"
            )
        self.goals = kept
        return bool(lost)
