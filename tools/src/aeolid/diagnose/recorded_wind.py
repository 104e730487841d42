"""Let a baseline know what a recorded wind tells of the wind that its model has to guess (S1)."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.signal import lfilter

from aeolid.diagnose.catalogue.wind import winds
from aeolid.diagnose.exogenous import Exogenous
from aeolid.diagnose.sums import written_out
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter, State
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
PREFIX = "recorded_wind_"  # of the parameters' names
SHARE, LEVEL, RATE = f"{PREFIX}share", f"{PREFIX}level", f"{PREFIX}rate"
SIZES = {SHARE: 0.3, LEVEL: 0.3, RATE: 1.0}  # typical: of one; in the unit of the wind; in 1/s
CHANNEL, AT_ONCE = "recorded wind, smoothed", f"{PREFIX}smoothed"
AHEAD, MEAN = "recorded wind, smoothed, mean of the step to come", f"{PREFIX}mean"
_SPEEDS = ("m/s", "km/h", "kn", "mph", "ft/s")
_FASTEST = 3.0  # of one a sample: what is forgotten faster is white
_MOST = 2.0  # an anemometer behind the rotor reads half the wind, not less
_LAGS, _COMPUTED = 3, 0.9  # share of what a wind does not foretell of itself that others know: then it is theirs
_STARTS = ((0.9, 0.3), (0.99, 0.3), (0.99, 0.8), (0.999, 0.9))  # poles of wind and smoother to start from


def with_smoothed_wind(records: Sequence[Record], model: Equations) -> tuple[Record, ...]:
    """Return the recordings with their wind, smoothed, as a channel more; as they are where there is no place for it.

    Taken is the first channel of role scheduling, complete and moving, in the unit of the only wind of the model, that
    nobody computed from the model's own inputs and outputs: an estimate knows of the outputs that shall be predicted.
    """
    units = [s.unit for s in winds(model)]
    seen = [*(s.name for s in model.inputs), *(o.name for o in model.outputs)]
    told = [
        c.name for c in records[0].channels
        if c.role == "scheduling" and [c.unit] == units and c.unit in _SPEEDS and c.name not in seen
    ]  # fmt: skip
    values = [r.column(told[0]) for r in records] if told else []
    if not told or not np.all(np.isfinite(np.concatenate(values))) or np.ptp(np.concatenate(values)) == 0:
        return tuple(records)
    if _is_computed(values, [r.columns(seen) for r in records]):
        return tuple(records)
    mean = float(np.mean(np.concatenate(values)))
    smooth = smoother([v - mean for v in values])
    more = (Channel(CHANNEL, units[0], "ignore"), Channel(AHEAD, units[0], "ignore"))
    found = []
    for record, v in zip(records, values, strict=True):
        smoothed = _both_ways(v - mean, *smooth)
        ahead = np.append(0.5 * (smoothed[1:] + smoothed[:-1]), smoothed[-1])
        table = np.column_stack([record.values, smoothed, ahead])
        found.append(replace(record, values=table, channels=(*record.channels, *more)))
    return tuple(found)


def _is_computed(winds_read: Sequence[Array], seen: Sequence[Array]) -> bool:
    """Tell whether inputs and outputs of the same sample know what a recorded wind does not know of itself.

    Least squares of the wind on its own last values, then on those and the other channels, last and present: an
    observer's state is such a sum. Its own errors an anemometer shares with nobody.
    """
    own, all_ = [], []
    for v, others in zip(winds_read, seen, strict=True):
        past = [v[_LAGS - k : len(v) - k] for k in range(_LAGS + 1)]
        beside = [others[_LAGS - k : len(v) - k] for k in range(_LAGS + 1)]
        own.append(np.column_stack(past))
        all_.append(np.column_stack(beside))
    rows, others = np.vstack(own), np.vstack(all_)
    whole = np.all(np.isfinite(others), axis=1)
    rows, others = rows[whole] - rows[whole].mean(axis=0), others[whole] - others[whole].mean(axis=0)
    if len(rows) <= 2 * (rows.shape[1] + others.shape[1]):
        return False
    others = others / np.maximum(others.std(axis=0), 1e-300)
    left = [_left(rows[:, 0], X) for X in (rows[:, 1:], np.column_stack([rows[:, 1:], others]))]
    return left[1] < (1 - _COMPUTED) * left[0]


def _left(y: Array, X: Array) -> float:
    return float(np.sum((y - X @ np.linalg.lstsq(X, y, rcond=None)[0]) ** 2))


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

    starts = [np.array([_logit(a), _logit(b / a)]) for a, b in _STARTS]
    best = min((minimize(errors, s, method="Nelder-Mead") for s in starts), key=lambda r: float(r.fun))
    a, b = _poles(best.x)
    return b, 1 + b * b - b / a * (1 + a * a)


def _poles(at: Array) -> tuple[float, float]:
    a, share = (1 / (1 + np.exp(-np.clip(at, -30, 30)))).tolist()
    return a, a * share


def _logit(share: float) -> float:
    return float(np.log(share / (1 - share)))


def _both_ways(read: Array, pole: float, gain: float) -> Array:
    """Filter forwards and backwards; both begin as if the first, or the last, value had lasted."""
    settled = 1 / (1 - pole)
    onwards, _ = lfilter([1.0], [1.0, -pole], read, zi=[pole * settled * read[0]])
    back, _ = lfilter([1.0], [1.0, -pole], onwards[::-1], zi=[pole * settled * onwards[-1]])
    result: Array = gain * back[::-1]
    return result


def smoothed_wind(records: Sequence[Record]) -> tuple[Exogenous, ...]:
    """Return the channels that `with_smoothed_wind` added, for the model alone: no effect may use them."""
    symbols = {CHANNEL: AT_ONCE, AHEAD: MEAN}
    return tuple(Exogenous(c.name, symbols[c.name], c.unit, c.role) for c in records[0].channels if c.name in symbols)


@dataclass(frozen=True)
class RecordedWind:
    """Hold which state of a model is its wind, its unit, and the parameters that stand in its equation only."""

    name: str
    unit: str
    own: frozenset[str]

    def told(self, model: Equations, step: float) -> Equations:
        """Return the model, effects and all, with a free share of the smoothed wind and a level in its wind.

        The wind of a model is a state that only noise drives; a predictor learns of a gust when the rotor answers, an
        anemometer knows of it before. Without this whatever else follows its channel foretells gusts: a pitch gain that
        switches with the recorded wind had a name on recordings that lacked nothing. The state is then what the
        anemometer does not tell, which forgets as fast as the smoother does: the rate is free, and parameters of the
        wind's equation are held, for they were declared of the whole wind. States feel the mean over the step to come,
        outputs and memories what is at the instant (with one for both 42 to 186 nats less on three recordings). Where
        the channel tells nothing the share is none. step: sample time of the inputs in s.
        """
        more = (
            Parameter(SHARE, 0.0, "1", 0.0, _MOST, True),
            Parameter(LEVEL, 0.0, self.unit, free=True),
            Parameter(RATE, 0.0, "1/s", 0.0, _FASTEST / step, True),
        )
        mean, now = (
            {self.name: ex.parse(f"{self.name} + {SHARE}*{symbol} + {LEVEL}", "recorded wind")}
            for symbol in (MEAN, AT_ONCE)
        )

        def at_once(tree: ast.expr) -> ast.expr:
            whole = written_out(tree, model)
            return ex.substitute(whole, now) if self.name in ex.names_in(whole) else tree

        held = tuple(replace(p, free=False) if p.name in self.own else p for p in model.parameters)
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
        """Return the derivative of the wind's state, forgetting faster by the free rate."""
        if model.sample_time_s:
            return ex.combine("*", ex.parse(f"exp(-{RATE}*{model.sample_time_s!r})", "rate"), wind.derivative)
        return ex.combine("-", wind.derivative, ex.parse(f"{RATE}*{self.name}", "rate"))


def recorded_wind(model: Equations, channels: Sequence[Exogenous]) -> RecordedWind | None:
    """Return the wind of a model that the recording tells of; None where `with_smoothed_wind` found none."""
    if not any(c.name == CHANNEL for c in channels):
        return None
    wind = winds(model)[0]
    others: list[ast.expr] = [s.derivative for s in model.states if s.name != wind.name]
    others += [o.equation for o in model.outputs] + [a.equation for a in model.auxiliaries]
    own = ex.names_in(wind.derivative) & {p.name for p in model.parameters}
    return RecordedWind(wind.name, wind.unit, frozenset(own.difference(*(ex.names_in(tree) for tree in others))))
