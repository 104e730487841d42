"""Let a baseline know what a recorded wind tells of the wind that its model has to guess (S1)."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.signal import lfilter
from scipy.special import logit

from aeolid.decompositions import lstsq
from aeolid.diagnose.data.exogenous import Exogenous
from aeolid.diagnose.data.forensics import Finding
from aeolid.diagnose.hypotheses.parts.wind import winds
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.forces import FORCE
from aeolid.diagnose.structure.nuisance import WIND, WIND_PREFIX
from aeolid.diagnose.structure.sums import written_out
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter, State
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
PREFIX = WIND_PREFIX  # of the parameters' names
SHARE, LEVEL, RATE = (f"{PREFIX}{name}" for name in WIND)
SIZES = {SHARE: 0.3, LEVEL: 0.3, RATE: 1.0}  # typical: of one; in the unit of the wind; in 1/s
CHANNEL, AT_ONCE = "recorded wind, smoothed", f"{PREFIX}smoothed"
AHEAD, MEAN = "recorded wind, smoothed, mean of the step to come", f"{PREFIX}mean"
_SPEEDS = ("m/s", "km/h", "kn", "mph", "ft/s")
_FASTEST = 3.0  # of one a sample: what is forgotten faster is white
_MOST = 2.0  # an anemometer behind the rotor reads half the wind, not less
_LAGS = 3  # rows of its past by which a wind is foretold
_TOLD = "it tells the model's wind of gusts (share, level and rate are free)"
_STARTS = ((0.9, 0.3), (0.99, 0.3), (0.99, 0.8), (0.999, 0.9))  # poles of wind and smoother to start from


def with_smoothed_wind(records: Sequence[Record], model: Equations) -> tuple[Record, ...]:
    """Return the recordings with their wind, smoothed, as channels more; as they are where there is no place for it.

    Taken is the first channel of role scheduling, complete and moving, in the unit of the only wind of the model, that
    nobody computed from the model's own inputs and outputs: an estimate knows of the outputs that shall be predicted.
    Nothing is taken where the model has names of its own that begin as those of this file do.
    """
    for channel in records[0].channels:
        if channel.role == "scheduling" and not _refused(channel, records, model):
            return _with(records, channel)
    return tuple(records)


def wind_findings(records: Sequence[Record], model: Equations) -> tuple[Finding, ...]:
    """Say of each recorded speed whether the model's wind is told of it, and if not, why; nothing without a wind."""
    found: list[Finding] = []
    for channel in records[0].channels if winds(model) else ():
        if channel.role != "scheduling" or channel.unit not in _SPEEDS:
            continue
        refused = _refused(channel, records, model) or ("another one is" if _is_told(found) else "")
        text = f"the model's wind is not told of it: {refused}" if refused else _TOLD
        found.append(Finding("wind", channel.name, text, "info"))
    return tuple(found)


def _is_told(found: Sequence[Finding]) -> bool:
    return any(f.finding == _TOLD for f in found)


def _refused(channel: Channel, records: Sequence[Record], model: Equations) -> str:
    """Return why a scheduling channel is not told to the model's wind, "" where it is."""
    units = [s.unit for s in winds(model)]
    seen = [*(s.name for s in model.inputs), *(o.name for o in model.outputs)]
    taken = (*model.symbols, *(x.name for part in (model.parameters, model.states, model.auxiliaries) for x in part))
    values = [r.column(channel.name) for r in records]
    if any(name.startswith(PREFIX) for name in taken):
        return f"names of the model begin with {PREFIX}"
    if [channel.unit] != units or channel.unit not in _SPEEDS:
        return f"it is in {channel.unit or 'no unit'}, the model has {' and '.join(units) or 'none'}"
    if channel.name in seen:
        return "the model has it as an input or output"
    if not np.all(np.isfinite(np.concatenate(values))) or np.ptp(np.concatenate(values)) == 0:
        return "samples are missing, or it never changes"
    if _is_computed(values, [r.columns(seen) for r in records], len(model.inputs)):
        return "it follows from the model's own inputs and outputs, as an estimate does"
    return ""


def _with(records: Sequence[Record], read: Channel) -> tuple[Record, ...]:
    """Return the recordings with the smoothed wind at each sample, and its mean over the step to come."""
    values, mean = [r.column(read.name) for r in records], _mean(records, read.name)
    smooth = smoother([v - mean for v in values])
    more = tuple(Channel(name, read.unit, "ignore", read.name) for name in (CHANNEL, AHEAD))
    found = []
    for record, v in zip(records, values, strict=True):
        smoothed = _both_ways(v - mean, *smooth)
        ahead = np.append(0.5 * (smoothed[1:] + smoothed[:-1]), smoothed[-1])
        table = np.column_stack([record.values, smoothed, ahead])
        found.append(replace(record, values=table, channels=(*record.channels, *more)))
    return tuple(found)


def _is_computed(winds_read: Sequence[Array], seen: Sequence[Array], inputs: int) -> bool:
    """Tell whether inputs and outputs know what a recorded wind does not know of itself; so too where nobody can tell.

    Least squares of the wind on its own last values, then on those, the last inputs, the last and the present outputs:
    an observer's state is such a sum. Its own errors an anemometer shares with nobody, and an input that is computed
    from it does not foretell it. An anemometer that hardly errs beside an output that feels the wind at once is taken
    for computed, too. seen: (N, inputs + outputs); what is mostly missing is left out.
    """
    rules = in_force().baseline
    kept = np.mean(np.isfinite(np.vstack(seen)), axis=0) > rules.present_share
    own, beside = [], []
    for v, values in zip(winds_read, seen, strict=True):
        lagged = [values[_LAGS - k : len(v) - k, kept] for k in range(1, _LAGS + 1)]
        own.append(np.column_stack([v[_LAGS - k : len(v) - k] for k in range(_LAGS + 1)]))
        present = values[_LAGS:, inputs:][:, kept[inputs:]]
        beside.append(np.column_stack([present, *lagged]))
    rows, others = np.vstack(own), np.vstack(beside)
    whole = np.all(np.isfinite(others), axis=1)
    if np.sum(whole) <= 2 * (rows.shape[1] + others.shape[1]):
        return True
    rows, others = rows[whole] - rows[whole].mean(axis=0), others[whole] - others[whole].mean(axis=0)
    others = others / np.maximum(others.std(axis=0), 1e-300)
    left = [_left(rows[:, 0], X) for X in (rows[:, 1:], np.column_stack([rows[:, 1:], others]))]
    return left[1] < (1 - rules.wind_known_share) * left[0]


def _left(y: Array, X: Array) -> float:
    return float(np.sum((y - X @ lstsq(X, y)) ** 2))


def smoother(winds_read: Sequence[Array]) -> tuple[float, float]:
    """Return pole and gain of the smoother that finds a wind of one memory in readings with white errors.

    w+ = a w + q, v = w + n is the ARMA(1, 1) v+ - a v = e+ - b e (its prediction error is least over 0 <= b <= a < 1),
    with var n = b/a var e; the Wiener smoother of w is g/((1 - b z)(1 - b/z)), g = var q / var e. What it leaves of w
    is correlated with nothing that was read, so that nothing else that follows the channel foretells it. An anemometer
    without errors is not smoothed (b = 0, g = 1).
    """

    def errors(at: Array) -> float:
        a, b = _poles(at)
        return sum(float(np.sum(lfilter([1.0, -a], [1.0, -b], v) ** 2)) for v in winds_read)

    starts = [logit(np.array([a, b / a])) for a, b in _STARTS]
    best = min((minimize(errors, s, method="Nelder-Mead") for s in starts), key=lambda r: float(r.fun))
    a, b = _poles(best.x)
    return b, 1 + b * b - b / a * (1 + a * a)


def _poles(at: Array) -> tuple[float, float]:
    a, share = (1 / (1 + np.exp(-np.clip(at, -30, 30)))).tolist()
    return a, a * share


def _both_ways(read: Array, pole: float, gain: float) -> Array:
    """Filter forwards and backwards, each begun as if the value it begins with had lasted."""
    settled = 1 / (1 - pole)
    onwards, _ = lfilter([1.0], [1.0, -pole], read, zi=[pole * settled * read[0]])
    back, _ = lfilter([1.0], [1.0, -pole], onwards[::-1], zi=[pole * settled * onwards[-1]])
    result: Array = gain * back[::-1]
    return result


def _mean(records: Sequence[Record], name: str) -> float:
    return float(np.mean(np.concatenate([r.column(name) for r in records])))


def smoothed_readings(records: Sequence[Record], smoothed: Array) -> dict[str, tuple[str, Array]]:
    """Return, by name of the channel that was smoothed, what a model calls its smoothed value, and that value (N,).

    smoothed (N, k): samples of `smoothed_wind`'s channels. What depends on the wind goes by the wind, not by what an
    anemometer adds to it: a pitch gain 55 % lower above 17 m/s was 17 % lower by readings with errors of a third of the
    gusts, and had 23 nats for 387.
    """
    source = _source(records)
    if source is None:
        return {}
    mean = _mean(records, source)
    return {source: (f"({mean!r} + {AT_ONCE})", mean + smoothed[:, 0])}


def by_readings(model: Equations, records: Sequence[Record], channels: Sequence[Exogenous]) -> Equations:
    """Return a model that goes by the wind as it was read where it went by the smoothed one, which no file has."""
    source = _source(records)
    symbol = next((c.symbol for c in channels if c.name == source), None)
    if source is None or symbol is None:
        return model
    read: dict[str, ast.expr] = {AT_ONCE: ex.parse(f"{symbol} - {_mean(records, source)!r}", "recorded wind")}
    return replace(
        model,
        states=tuple(replace(s, derivative=ex.substitute(s.derivative, read)) for s in model.states),
        outputs=tuple(replace(o, equation=ex.substitute(o.equation, read)) for o in model.outputs),
        auxiliaries=tuple(replace(a, equation=ex.substitute(a.equation, read)) for a in model.auxiliaries),
    )


def _source(records: Sequence[Record]) -> str | None:
    """Return the name of the channel that was smoothed."""
    return next((c.heading for c in records[0].channels if c.name == CHANNEL), None)


def smoothed_wind(records: Sequence[Record]) -> tuple[Exogenous, ...]:
    """Return the channels that `with_smoothed_wind` added, for the model alone: no effect may use them."""
    symbols = {CHANNEL: AT_ONCE, AHEAD: MEAN}
    return tuple(Exogenous(c.name, symbols[c.name], c.unit, c.role) for c in records[0].channels if c.name in symbols)


@dataclass(frozen=True)
class RecordedWind:
    """Hold which state of a model is its wind, its unit, and how it goes on.

    memory: parameters that stand in its equation only and set how fast it forgets; level: a free one that sets where it
    rests, or ""; rests: whether it does.
    """

    name: str
    unit: str
    memory: frozenset[str]
    level: str
    rests: bool

    def told(self, model: Equations, step: float) -> Equations:
        """Return the model, effects and all, with a free share of the smoothed wind and a level in its wind.

        The wind of a model is a state that only noise drives; a predictor learns of a gust when the rotor answers, an
        anemometer knows of it before. Without this whatever else follows its channel foretells gusts: a pitch gain that
        switches with the recorded wind had a name on recordings that lacked nothing. The state is then what the
        anemometer does not tell, which forgets as fast as the smoother does: the rate is free, and what sets the wind's
        memory is held, for it was declared of the whole wind; a free value that says where it rests is the level.
        States feel the mean over the step to come, outputs and memories what is at the instant (with one for both 42 to
        186 nats less on three recordings). Where the channel tells nothing the share is none. step: sample time of the
        inputs in s.
        """
        more = (
            Parameter(SHARE, 0.0, "1", 0.0, _MOST, True),
            Parameter(LEVEL, 0.0, self.unit, free=not self.level),
            Parameter(RATE, 0.0, "1/s", 0.0, _FASTEST / step, True),
        )
        mean, now = (
            {self.name: ex.parse(f"{self.name} + {SHARE}*{symbol} + {LEVEL}", "recorded wind")}
            for symbol in (MEAN, AT_ONCE)
        )

        def at_once(tree: ast.expr) -> ast.expr:
            whole = written_out(tree, model)
            return ex.substitute(whole, now) if self.name in ex.names_in(whole) else tree

        held = tuple(replace(p, free=False) if p.name in self.memory else p for p in model.parameters)
        return replace(
            model,
            parameters=(*held, *more),
            states=tuple(
                replace(
                    s,
                    derivative=self._forgetful(s, model) if s.name == self.name else ex.substitute(s.derivative, mean),
                )
                for s in model.states
            ),
            outputs=tuple(
                replace(o, equation=at_once(o.equation), slope=None if o.slope is None else at_once(o.slope))
                for o in model.outputs
            ),
            auxiliaries=tuple(replace(a, equation=ex.substitute(a.equation, mean)) for a in model.auxiliaries),
            memories=tuple(replace(m, next=at_once(m.next), settled=at_once(m.settled)) for m in model.memories),
        )

    def _forgetful(self, wind: State, model: Equations) -> ast.expr:
        """Return the derivative of the wind's state, that goes to where it rests faster by the free rate."""
        own = written_out(wind.derivative, model)
        quiet: dict[str, ast.expr] = {f"{FORCE}{self.name}": ast.Constant(0.0)}
        still, moved = (ex.substitute(own, quiet | {self.name: ast.Constant(w)}) for w in (0.0, 1.0))
        slope = ex.combine("-", moved, still)
        if model.sample_time_s:
            rest = (
                ex.combine("/", still, ex.combine("-", ast.Constant(1.0), slope)) if self.rests else ast.Constant(0.0)
            )
            less = ex.combine(
                "*", ex.parse(f"exp(-{RATE}*{model.sample_time_s!r})", "rate"), ex.combine("-", own, rest)
            )
            return ex.combine("+", rest, less)
        rest = ex.combine("/", still, slope) if self.rests else ast.Constant(0.0)  # less where it rests
        away = ex.combine("+", ast.Name(id=self.name), rest)
        return ex.combine("-", own, ex.combine("*", ast.Name(id=RATE), away))


def recorded_wind(model: Equations, channels: Sequence[Exogenous]) -> RecordedWind | None:
    """Return the wind of a model that the recording tells of; None where `with_smoothed_wind` found none."""
    if not any(c.name == CHANNEL for c in channels):
        return None
    wind = winds(model)[0]
    others = [s.derivative for s in model.states if s.name != wind.name] + [o.equation for o in model.outputs]
    elsewhere: set[str] = set().union(*(ex.names_in(written_out(tree, model)) for tree in others))
    own = written_out(wind.derivative, model)
    alone = {p.name: p for p in model.parameters if p.name in ex.names_in(own) - elsewhere}
    memory = frozenset(name for name in alone if _sets_memory(name, own, wind.name, model))
    level = next((n for n, p in alone.items() if p.free and n not in memory), "")
    rests = abs(_slope(own, wind.name, model, {}) - (1.0 if model.sample_time_s else 0.0)) > 0
    return RecordedWind(wind.name, wind.unit, memory, level, rests)


def _sets_memory(name: str, derivative: ast.expr, wind: str, model: Equations) -> bool:
    """Tell whether a parameter changes how the wind's derivative changes with the wind."""
    declared = next(p.value for p in model.parameters if p.name == name)
    moved = _slope(derivative, wind, model, {name: 1.1 * declared if declared else 0.1})
    return not np.isclose(_slope(derivative, wind, model, {}), moved, rtol=1e-6, atol=0.0)


def _slope(derivative: ast.expr, wind: str, model: Equations, other: dict[str, float]) -> float:
    """Return what the wind's derivative changes by for a unit of it, at the declared values but these."""
    known = {p.name: np.asarray(p.value) for p in model.parameters} | {s.name: np.asarray(0.0) for s in model.states}
    known |= {n: np.asarray(v) for n, v in other.items()}
    low, high = (float(ex.values_of(derivative, known | {wind: np.asarray(w)})) for w in (0.0, 1.0))
    return high - low
