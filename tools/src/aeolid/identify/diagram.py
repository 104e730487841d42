"""Find the poles of many orders and windows from one factor: what a stabilisation diagram shows.

The factor of the longest window holds those of all shorter ones, one singular value decomposition of ΓK Z holds the
states of all orders (the first n rows of the largest state map are the map of order n), and the deviations of each pole
come straight from those of Ξ (`pole_spread`): a model more costs regressions on a few columns of the small factor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.choose_past import Ladder, climb, longest_past, window_within_chance
from aeolid.identify.markov import MarkovEstimate, estimate_markov
from aeolid.identify.missing import Completed
from aeolid.identify.order import worth_a_state
from aeolid.identify.pole_spread import Spreader
from aeolid.identify.split import FIT_PART
from aeolid.identify.subspace import StateBasis, find_states, largest_useful_order, regressed_matrices
from aeolid.identify.truncation import order_loss
from aeolid.identify.windows import Scaling, WindowFactor, require_windows
from aeolid.models.modes import continuous_poles, frequency_and_damping, pushed_to_modes
from aeolid.wording import counted

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
REGULARIZATION = "gcv"
LARGEST_ORDER = 60
SURE = 4  # states above the order that predicts, from which models count
BEYOND = 10  # states above the order that predicts best, up to which poles are looked at
LONGER = (1.0, 2**0.5, 2.0)  # windows of a diagram, of the one that predicts


@dataclass(frozen=True, eq=False)
class Pole:
    """Hold one pole of one model: of a window in samples and an order, with standard deviations (NaN: not known).

    shape (l,): outputs in their scales, 1 at the output that moves most.
    """

    past: int
    order: int
    eigenvalue: complex
    frequency_hz: float
    damping: float
    frequency_std_hz: float
    damping_std: float
    shape: ComplexArray


@dataclass(frozen=True, eq=False)
class Source:
    """Hold what the models of all orders of one window come from."""

    whole: WindowFactor
    basis: StateBasis
    estimate: MarkovEstimate
    orders: tuple[int, ...]

    def model(self, order: int) -> Spreader:
        """Return the model of an order."""
        matrices = regressed_matrices(self.whole, self.basis.state_map(order), ())
        return Spreader(self.whole, self.basis, matrices, self.estimate)


@dataclass(frozen=True, eq=False)
class Diagram:
    """Hold the poles of all orders and windows.

    windows, orders: those tried; past, order: the window and the order that predict the held-out part; scaling: of the
    outputs; sources: what the models of each window come from; samples, sample_time_s: of recordings.
    """

    poles: tuple[Pole, ...]
    windows: tuple[int, ...]
    orders: tuple[int, ...]
    past: int
    order: int
    scaling: Scaling
    sources: dict[int, Source]
    samples: int
    sample_time_s: float

    @property
    def outputs(self) -> tuple[str, ...]:
        """Return the names of the outputs."""
        return self.scaling.outputs

    @property
    def duration_s(self) -> float:
        """Return the length of all recordings together, seconds."""
        return self.samples * self.sample_time_s

    @property
    def counting(self) -> frozenset[tuple[int, int]]:
        """Return windows and orders of the models that count: SURE states above the order that predicts.

        What a state gains in prediction falls below chance before the poles have settled: over 64 simulated recordings
        frequencies at that order were off by 0.8 %, with two pairs more by 0.5 %, and no better with further ones.
        """
        return frozenset(
            (w, n) for w, source in self.sources.items()
            for n in source.orders if n >= min(self.order + SURE, max(source.orders) - SURE)
        )  # fmt: skip

    def model(self, past: int, order: int) -> Spreader:
        """Return a model again, with what finds the deviations of its shapes."""
        return self.sources[past].model(order)


def draw_up(ladder: Ladder, scaling: Scaling, past: int, largest: int | None = None) -> Diagram:
    """Find the poles of all orders over the windows LONGER times `past`, as far as the ladder goes.

    past: p, samples. largest: order, default BEYOND and half as much again above the one that predicts, at most
    LARGEST_ORDER. Cost: some q³ operations a window, none of the length of the recording.
    """
    windows = tuple(sorted({min(round(past * k), ladder.longest) for k in LONGER}))
    order = _predicting_order(ladder.at(past)[0])
    most = largest or min(order + BEYOND + order // 2, LARGEST_ORDER)
    sources = {w: _source(ladder.at(w)[1], most) for w in windows}
    found = [
        pole for w, source in sources.items() for n in source.orders
        for pole in _poles_of(source.model(n), w, n, ladder.sample_time_s)
    ]  # fmt: skip
    orders = tuple(sorted({n for source in sources.values() for n in source.orders}))
    return Diagram(
        tuple(found), windows, orders, past, min(order, orders[-1]), scaling, sources,
        ladder.whole.windows + ladder.longest, ladder.sample_time_s,
    )  # fmt: skip


def shortest_window(ladder: Ladder) -> int:
    """Return the shortest window whose held-out one-step error is within what chance explains of the least."""
    return window_within_chance(ladder, (), REGULARIZATION)


def ladder_of(known: Completed, scaling: Scaling, past: int | None) -> Ladder:
    """Return the factors of all windows of outputs alone: up to twice a given one, else as long as the data allow.

    Raises NotIdentifiable where there are too few samples. Cost: 2 N m q operations.
    """
    records = known.records
    most = longest_past(records, scaling.channels)
    longest = most if past is None else max(min(round(past * LONGER[-1]), most), past)
    require_windows(records, longest if past is None else past, scaling.channels)
    ladder = climb(records, scaling, longest, known.trial)
    while longest > (past or 1) and ladder.fitted.windows < 2 * (longest + 1) * scaling.channels:
        longest = max(longest // 2, past or 1)  # missing samples left fewer windows than lengths promise
        ladder = climb(records, scaling, longest, known.trial)
    if ladder.fitted.windows <= (longest + 1) * scaling.channels or ladder.held_out.windows == 0:
        raise NotIdentifiable(
            f"{records[0].source}: {counted(ladder.fitted.windows, 'complete window')} of {longest + 1} samples "
            "in the first "
            f"{FIT_PART:.0%} are too few for {counted(scaling.channels, 'output')}; record longer, or without gaps"
        )
    return ladder


def _predicting_order(halves: tuple[WindowFactor, WindowFactor]) -> int:
    """Return the smallest order whose held-out one-step error is no more than chance above the least."""
    fitted, held_out = halves
    basis = find_states(fitted, estimate_markov(fitted, (), REGULARIZATION).theta, fitted.past)
    most = min(LARGEST_ORDER, largest_useful_order(basis))
    if most == 0:
        raise NotIdentifiable("nothing of the outputs follows from their past: there are no modes to find")
    losses = np.array([order_loss(fitted, held_out, basis, n, ()) for n in range(1, most + 1)])
    return int(np.flatnonzero(losses <= losses.min() + worth_a_state(held_out.windows))[0]) + 1


def _source(whole: WindowFactor, most: int) -> Source:
    """Return what the models of a window come from, of orders 2 to `most` as far as there are singular values."""
    estimate = estimate_markov(whole, (), REGULARIZATION)
    basis = find_states(whole, estimate.theta, whole.past)
    return Source(whole, basis, estimate, tuple(range(2, max(min(most, largest_useful_order(basis)), 2) + 1)))


def _poles_of(model: Spreader, past: int, order: int, step: float) -> list[Pole]:
    poles = model.poles()
    out = []
    for value, s, covariance, shape in zip(
        poles.values, continuous_poles(poles.values, step), poles.covariance, poles.shapes.T, strict=True
    ):
        spread = pushed_to_modes(complex(value), complex(s), step, covariance)
        out.append(Pole(past, order, complex(value), *frequency_and_damping(complex(s)), *spread, shape))
    return out
