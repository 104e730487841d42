"""List what may separate a run from a recording: a catalogue entry at a place, as an operator on the data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior import operators as op
from aeolid.diagnose.run_prior.pair import Change, Pair, Side
from aeolid.diagnose.run_prior.steady_lines import grown_line
from aeolid.models import input_filters

Array = NDArray[np.float64]
Values = tuple[float, ...]
LAGS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # time constants and delays that are tried, in fortieths of the window
_DELAYS = (1, 2, 3, 4, 5, 6, 8, 11, 15)  # in samples: between them a delay interpolates, and the evidence ripples
_WIDTHS = (0.05, 0.1, 0.2, 0.4, 0.8)  # of play and dead bands from end to end, in deviations of the input
_RATES = (0.7, 0.5, 0.35, 0.25, 0.15)  # of the steepest slope of the input that all but a thousandth keep to
_PASSING = (1, 2, 3)  # orders, in blades, of a load that is short against a revolution, as a blade's before the tower
_TURNS = (5.0, 10.0, 20.0)  # time constants of the wake, in windows / 5


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Hold one effect at one place.

    entry: id of the catalogue; place: `input:name`, `output:name` or `rotor`; names, units, low, high: of its values,
    as the catalogue has them; grid: values to begin at; change: what the values do to the data; scaled: which values
    are searched on a logarithmic scale (all but shares and factors); steps: widths of the first search, on that scale;
    of: frequency in Hz and damping of the run's mode that moves; parts: how many loads it is, each of which must be
    worth a name; fault: how the recording was taken is at fault, not the simulation; words: one sentence of it, a
    format string over its values.
    """

    entry: str
    place: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    low: Values
    high: Values
    grid: tuple[Values, ...]
    change: Callable[[Values], Change]
    scaled: bool = True
    steps: Values = ()
    of: Values = ()
    parts: int = 1
    fault: bool = False
    words: str = ""

    @property
    def wired(self) -> bool:
        """Tell whether it is a fault of units, names or zeros, which no physics looks like: a late clock may."""
        return self.fault and self.entry != "data_time_offset"

    @property
    def key(self) -> str:
        """Return what tells this hypothesis from all others of a pair."""
        mode = f"{self.of[0]:.3g} Hz" if self.of else ""
        return f"{self.entry} {self.place} {mode}".strip()


def all_hypotheses(pair: Pair, units: dict[str, str]) -> list[Hypothesis]:
    """Return every hypothesis that the channels of a pair allow."""
    found: list[Hypothesis] = []
    for i, name in enumerate(pair.inputs):
        found += _of_input(pair, i, name, units.get(name, ""))
    found.append(_clock(pair))
    for j, name in enumerate(pair.outputs):
        found += _of_output(pair, j, name)
    found += _of_rotor(pair)
    return found


def _of_input(pair: Pair, i: int, name: str, unit: str) -> list[Hypothesis]:
    block, place = pair.grain_s, f"input:{name}"
    u = np.concatenate([s.u[:, i] for s in pair.recordings])
    ways = ways_of(u)

    def on(f: Callable[..., Array], values: Values) -> Change:
        return Change(inputs={i: lambda x, step: f(x, *values, step)})

    def timeless(f: Callable[..., Array], values: Values) -> Change:
        return Change(inputs={i: lambda x, step: f(x, *values)})

    taus = tuple((k * block,) for k in LAGS)
    longest = pair.past * block
    slow = tuple((k * longest / 5, share) for k in _TURNS for share in (0.2, 0.5))
    found = [
        Hypothesis("actuator_lag", place, ("tau_s",), ("s",), (1e-3 * block,), (longest,), taus,
                   partial(on, ways.lag)),
        Hypothesis("transport_delay", place, ("delay_s",), ("s",), (1e-3 * block,), (longest / 2,),
                   tuple((k * pair.step,) for k in _DELAYS),
                   partial(on, ways.delay)),
        Hypothesis("actuator_second_order", place, ("omega_rad_s", "damping"), ("rad/s", "1"), (0.3 / block, 0.2),
                   (30 / block, 1.2), tuple((w / block, z) for w in (0.35, 0.7, 1.4, 2.8) for z in (0.5, 0.9)),
                   partial(on, ways.drive)),
        Hypothesis("dynamic_inflow", place, ("tau_s", "overshoot"), ("s", "1"), (longest / 4, 0.02),
                   (6 * longest, 2.0), slow, partial(on, _overshoot)),
        Hypothesis("unsteady_aero", place, ("tau_s", "lagging_share"), ("s", "1"), (0.2 * block, 0.02),
                   (longest / 4, 0.6),
                   tuple((k * block, share) for k in (1.0, 3.0) for share in (0.15, 0.4)), partial(on, _partly)),
        Hypothesis("parameter_error", place, ("factor",), ("1",), (0.2,), (5.0,), ((0.8,), (0.9,), (1.1,), (1.25,)),
                   partial(timeless, _scaled)),
    ]  # fmt: skip
    return found + _nonlinear(pair, i, unit, u)


def _nonlinear(pair: Pair, i: int, unit: str, u: Array) -> list[Hypothesis]:
    """Return what is no linear element between an input u (N,) and the plant: play, a dead band, a limit of rate."""
    place, found = f"input:{pair.inputs[i]}", []
    spread = float(u.std())
    slope = float(np.quantile(np.abs(np.diff(u)), 0.999)) / pair.step

    def on(f: Callable[..., Array], values: Values) -> Change:
        return Change(inputs={i: lambda x, step: f(x, *values, step)})

    def timeless(f: Callable[..., Array], values: Values) -> Change:
        return Change(inputs={i: lambda x, step: f(x, *values)})

    if spread > 0:
        widths = tuple((k * spread,) for k in _WIDTHS)
        halves = tuple((0.5 * k * spread,) for k in _WIDTHS)  # a dead band's width is that to either side
        found += [
            Hypothesis("backlash", place, ("width",), (unit,), (1e-3 * spread,), (4 * spread,), widths,
                       partial(timeless, op.play)),
            Hypothesis("deadband", place, ("width",), (unit,), (5e-4 * spread,), (2 * spread,), halves,
                       partial(timeless, op.dead_band)),
        ]  # fmt: skip
    if slope > 0:
        found.append(
            Hypothesis("rate_limit", place, ("rate_per_s",), (f"{unit}/s",), (0.02 * slope,), (2 * slope,),
                       tuple((k * slope,) for k in _RATES), partial(on, op.rate_limited))
        )  # fmt: skip
    return found


@dataclass(frozen=True)
class Ways:
    """Hold how a lag, a delay and a second-order drive act on an input: (x, values …, step) → x."""

    lag: Callable[..., Array]
    delay: Callable[..., Array]
    drive: Callable[..., Array]


def ways_of(u: Array) -> Ways:
    """Return how drives act on an input: a held one is what it is over a step on average, another one point by point.

    Taken as smooth, a held input would come half a sample early behind a drive.
    """
    if np.mean(np.diff(u) == 0) < in_force().data.repeats_share:
        return Ways(op.first_order, op.delayed, op.second_order)

    def held(kind: str, *values: float, x: Array, step: float) -> Array:
        return input_filters.KINDS[kind].rule(x, np.array(values), step, input_filters.WHOLE)

    return Ways(
        lambda x, tau, step: held("actuator_lag", tau, x=x, step=step),
        lambda x, delay, step: held("transport_delay", delay, x=x, step=step),
        lambda x, omega, zeta, step: held("actuator_second_order", 1 / omega, zeta, x=x, step=step),
    )


def _overshoot(x: Array, tau: float, k: float, step: float) -> Array:
    """Return an input that acts more at once than in the end, as on a wake that takes its time."""
    return x + k * (x - op.first_order(x, tau, step))


def _partly(x: Array, tau: float, k: float, step: float) -> Array:
    """Return an input of which a part acts late, as circulation builds up."""
    return x - k * (x - op.first_order(x, tau, step))


def _scaled(x: Array, factor: float) -> Array:
    middle = float(np.median(x))
    return middle + factor * (x - middle)


def _clock(pair: Pair) -> Hypothesis:
    def change(values: Values) -> Change:
        return Change(inputs=dict.fromkeys(range(len(pair.inputs)), lambda x, step: op.delayed(x, values[0], step)))

    far = pair.past * pair.block_s / 2
    starts = tuple((sign * k * pair.grain_s,) for k in LAGS[:4] for sign in (-1.0, 1.0))
    return Hypothesis("data_time_offset", "data", ("offset_s",), ("s",), (-far,), (far,), starts, change, scaled=False)


def _of_output(pair: Pair, j: int, name: str) -> list[Hypothesis]:
    block, place = pair.grain_s, f"output:{name}"
    y = np.concatenate([s.y[:, j] for s in pair.recordings])
    low, high = float(y.min()), float(y.max())

    def on(f: Callable[..., Array], values: Values) -> Change:
        return Change(outputs={j: lambda x, step: f(x, *values, step)})

    def timeless(f: Callable[..., Array], values: Values) -> Change:
        return Change(outputs={j: lambda x, step: f(x, *values)})

    found = [
        Hypothesis("sensor_lag", place, ("tau_s",), ("s",), (1e-3 * block,), (pair.past * block / 2,),
                   tuple((k * block,) for k in LAGS), partial(on, op.first_order_of_past)),
        Hypothesis("sensor_scale", place, ("factor",), ("1",), (0.02,), (50.0,),
                   ((0.7,), (0.85,), (0.93,), (1.08,), (1.18,), (1.4,)), partial(timeless, np.multiply)),
        Hypothesis("sensor_sign", place, (), (), (), (), ((),), lambda values: Change(outputs={j: lambda x, s: -x})),
    ]  # fmt: skip
    if low >= 0.0:
        found.append(
            Hypothesis("sensor_rectified", place, (), (), (), (), ((),),
                       lambda values: Change(outputs={j: lambda x, s: np.abs(x)}))
        )  # fmt: skip
    if np.mean((y <= low) | (y >= high)) > in_force().data.rail_share:
        found.append(
            Hypothesis("sensor_saturation", place, (), (), (), (), ((),),
                       lambda values: Change(outputs={j: lambda x, s: np.clip(x, low, high)}))
        )  # fmt: skip
    return found


def _of_rotor(pair: Pair) -> list[Hypothesis]:
    if any(s.turned is None for s in pair.recordings):
        return []

    def harmonic(orders: tuple[int, ...], values: Values) -> Change:
        def waves(side: Side) -> Array:
            angle = side.turned if side.turned is not None else np.zeros(len(side))
            return np.column_stack([f(order * angle) for order in orders for f in (np.cos, np.sin)])

        return Change(extra=waves)

    passing = tuple(k * pair.passing for k in _PASSING)
    grown = grown_line(pair, passing[0])  # less than it was, it is no load that the runs lack
    short = [("tower_shadow", passing)] if grown > in_force().run_prior.shadow_growth else []
    return [
        Hypothesis(entry, "rotor", (), (), (), (), ((),), partial(harmonic, orders), parts=len(orders))
        for entry, orders in (("mass_imbalance", (1,)), ("rotational_sampling", passing[:1]), *short)
    ]
