"""Follow the modes of one controller while its samples and Markov parameters arrive.

The recursive state space of `propagator` with what a listener needs besides: an order chosen from the samples so far
and again whenever their number has doubled, samples that got lost, numbers by which modes keep their names, and
standard deviations. These come with each snapshot, from sums that are updated with every sample: Ξ owes its noise to
all samples the filter remembers, the fit of step 3 to those in its memory, both to the same e (`recursive_spread`).
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.identify.assemble import LARGEST_AUTO_ORDER
from aeolid.identify.heard import Heard
from aeolid.identify.markov import MarkovEstimate, estimate_markov
from aeolid.identify.order import choose_order
from aeolid.identify.outcome import nearest
from aeolid.identify.propagator import BATCH, LONGEST_MEMORY, Propagator
from aeolid.identify.recursive_spread import LEAST_SHARE, FilterMemory, Moments, joint_spread, known_share, remainder
from aeolid.identify.split import FIT_PART
from aeolid.identify.streamed import GROWTH_MAX
from aeolid.identify.subspace import ScaledModel, StateBasis, find_states, gamma_k
from aeolid.identify.uncertainty import matrix_spread, pole_covariance
from aeolid.identify.windows import WindowFactor, triangularise
from aeolid.models.model_file import Signal
from aeolid.models.modes import Mode, continuous_poles, modes_of
from aeolid.record import Channel

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
FARTHEST = 0.25  # relative distance of two continuous-time poles beyond which they are not one mode
ENOUGH = 4  # windows a parameter before an order is chosen
FADED = 0.1  # weight, of the newest sample a snapshot holds, below which the sums have become those of later samples
MOST_ENDS = LONGEST_MEMORY + 2 * BATCH  # as many windows as the tracker keeps
PLACES_MAX = 512  # numbers that are given to modes; data without any may bring new poles for ever
BUSY = 20  # deviations are worked out again after so many times what they took


@dataclass(frozen=True, eq=False)
class LiveSettings:
    """Hold what a node says of its filter. order: number of states, None to choose it.

    inputs, outputs: names; inputs may be none; offset, scale (r + l,) in the channels' units, inputs first; others:
    channels that are sent besides; units: of the outputs, "" where not known; the rest as in `Propagator`.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    past: int
    sample_time_s: float
    forgetting: float
    regularisation: float
    feedthrough: tuple[int, ...]
    model_set: str
    offset: Array
    scale: Array
    order: int | None = None
    others: tuple[Channel, ...] = ()
    units: tuple[str, ...] = ()


@dataclass(frozen=True)
class LiveMode:
    """Hold a mode as it is now; number: by which it was known before."""

    number: int
    mode: Mode

    @property
    def is_shown(self) -> bool:
        """Tell whether it swings, and is neither a harmonic of the rotor nor a steady sine."""
        return abs(self.mode.damping) < 1 and not self.is_harmonic

    @property
    def is_harmonic(self) -> bool:
        """Tell whether it is a harmonic of the rotor or another steady sine: no structure swings there."""
        return bool(self.mode.rotor_order) or self.mode.tone


class LiveModes:
    """Track the modes of one uninterrupted run of a filter.

    samples, missing: taken so far, and not there; order 0 and `waiting` say that there are no modes yet and why; note
    why there are no standard deviations; seconds: computing time so far.
    """

    def __init__(self, settings: LiveSettings) -> None:
        """Prepare. Raises UsageError where an order was asked for that the window cannot hold."""
        s = settings
        self.settings = s
        self._tracker = Propagator(
            inputs=len(s.inputs), outputs=len(s.outputs), past=s.past, order=s.order or 1, forgetting=s.forgetting,
            feedthrough=s.feedthrough, model_set=s.model_set, offset=s.offset, scale=s.scale,
        )  # fmt: skip
        self._regressors = s.past * self._tracker.block + len(s.feedthrough)
        self._moments = Moments(self._regressors, len(s.outputs))
        units = s.units or ("",) * len(s.outputs)
        channels = [Channel(n, u, "output") for n, u in zip(s.outputs, units, strict=True)]
        self._heard = Heard([*channels, *s.others], s.sample_time_s, output_only=not s.inputs)
        self.order, self.order_reason = 0, ""
        self.waiting, self.note = "waiting for Markov parameters", "no Markov parameters yet"
        self.samples = self.missing = self.snapshots = 0
        self.last: int | None = None  # index of the newest sample
        self.seconds = 0.0
        self._good = 0  # samples since the last missing one
        self._ends: Integers = np.zeros(0, np.int64)  # indices at which the newest complete windows ended
        self._chosen_at = 0  # windows when the order was chosen
        self._windows = 0
        self._quiet_until = 0.0
        self._spread: tuple[NDArray[np.complex128], Array] | None = None  # poles and their covariances
        self._places: list[complex] = []  # of each number, where it was last
        self._next_place = 0

    def add(self, index: Integers, u: Array, y: Array, e: Array | None = None, s: Array | None = None) -> None:
        """Take samples u (N, r), y (N, l), index rising by one; NaN where lost. A hole before them is bridged.

        e (N, l): innovations the node sent, for VARMAX; NaN or None where it did not. s (N, k): of `others`.
        """
        began = time.thread_time()
        if self.last is not None and index[0] > self.last + 1:
            hole = int(index[0]) - self.last - 1
            self._moments.fade(self.settings.forgetting**hole)
            self._tracker.update(np.full(u.shape[1], np.nan), np.full(y.shape[1], np.nan))
            self._heard.skip()
            self._good = 0
            self.missing += hole
        whole: NDArray[np.bool_] = np.asarray(np.isfinite(np.hstack([u, y])).all(axis=1), dtype=np.bool_)
        places = np.flatnonzero(self._complete(whole))
        rows = self._tracker.update_many(u, y, e)
        self._heard.add(y, s)
        lam, N = self.settings.forgetting, len(index)
        self._moments.fade(lam**N)
        if len(rows) == len(places) > 0:
            self._moments.add(*self._parts(rows), np.asarray(lam ** (N - 1.0 - places), dtype=np.float64))
        self._ends = np.concatenate([self._ends, index[places]])[-MOST_ENDS:]
        self._windows += len(places)
        self.samples += N
        self.missing += int(np.count_nonzero(~whole))
        self.last = int(index[-1])
        self.seconds += time.thread_time() - began

    def _parts(self, rows: Array) -> tuple[Array, Array]:
        """Return regressors (N, p m + d) and targets (N, l) of windows (N, (p + 1) m)."""
        p, r, m = self.settings.past, len(self.settings.inputs), self._tracker.block
        phi = np.hstack([rows[:, : p * m], rows[:, p * m + np.array(self.settings.feedthrough, int)]])
        return phi, rows[:, p * m + r : p * m + r + len(self.settings.outputs)]

    def _moments_at(self, last: int) -> Moments:
        """Return the sums as they were at the sample `last`; where that cannot be told any more, those of now.

        A snapshot arrives some time after it was taken, and what came meanwhile is not in it. With λ < 1 the sums of
        now are much the same once that is long ago.
        """
        rows, newest = self._tracker.windows(), last if self.last is None else self.last
        count, left = int(np.count_nonzero(self._ends > last)), self.settings.forgetting ** (newest - last)
        if not 0 < count <= len(rows) or left < FADED:
            return self._moments
        newer = Moments(self._regressors, len(self.settings.outputs))
        newer.add(*self._parts(rows[-count:]), self.settings.forgetting ** (newest - self._ends[-count:]).astype(float))
        then = self._moments.without(newer)
        then.fade(1 / left)
        return then

    def _complete(self, whole: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which samples end p + 1 good ones in a row."""
        count = np.arange(1, len(whole) + 1)
        last_bad = np.maximum.accumulate(np.where(whole, 0, count))
        run = count - last_bad + np.where(last_bad == 0, self._good, 0)
        self._good = int(run[-1])
        complete: NDArray[np.bool_] = run > self.settings.past
        return complete

    def snapshot(self, theta: Array, sample_index: int | None) -> None:
        """Take Markov parameters Ξ (l, p m + d) in the channels' units; sample_index: the last sample in them."""
        began = time.thread_time()
        self.snapshots += 1
        try:
            if self._choose():
                self._tracker.update_markov(theta)
                self.waiting = ""
                self._find_spread(sample_index)
                self._heard.look([(m.number, m.mode) for m in self.modes()])
        except (NotIdentifiable, DataError, UsageError) as error:
            self.waiting = str(error)
        spent = time.thread_time() - began
        self._quiet_until = max(self._quiet_until, time.monotonic() + (BUSY - 1) * spent)
        self.seconds += spent

    def _choose(self) -> bool:
        """Choose the order where that is due; returns whether there is one."""
        s, needed = self.settings, ENOUGH * (self.settings.past + 1) * self._tracker.block
        if self._windows < (1 if s.order else needed):
            self.waiting = f"waiting for samples: {self._windows} of {needed} windows"
            return False
        if self._chosen_at and self._windows < 2 * self._chosen_at:
            return True
        order, reason = (s.order, "as asked for") if s.order else self._best_order()
        # with another order, and with twice the samples, S is chosen anew
        self._tracker = self._tracker.with_order(order)
        self.order, self.order_reason, self._chosen_at = order, reason, self._windows
        self._quiet_until = 0.0
        return True

    def _best_order(self) -> tuple[int, str]:
        """Choose the order on the last samples kept, as `identify` does."""
        s, rows = self.settings, self._tracker.windows()
        cut = round(FIT_PART * len(rows))
        fitted = self._factor(rows[:cut], np.ones(cut))
        held_out = rows[cut:, -self._tracker.block :]
        held_out = np.vstack([rows[cut, : -self._tracker.block].reshape(s.past, -1), held_out])
        mask = tuple(i in s.feedthrough for i in range(len(s.inputs)))
        # Ξ of the stream has seen what is held out
        basis = find_states(fitted, estimate_markov(fitted, mask, "gcv").theta, s.past)
        choice = choose_order(fitted, basis, [held_out], mask, LARGEST_AUTO_ORDER)
        return choice.order, choice.reason

    def _factor(self, rows: Array, w: Array) -> WindowFactor:
        """Return the factor of windows (N, (p + 1) m) of weights (N,)."""
        s, innovations = self.settings, self._tracker.block - len(self.settings.inputs) - len(self.settings.outputs)
        full = triangularise(np.hstack([np.ones((len(rows), 1)), rows]) * np.sqrt(w)[:, None])
        return WindowFactor(full, s.past, len(s.inputs), len(s.outputs), round(float(w.sum())), 0, innovations)

    def _find_spread(self, sample_index: int | None) -> None:
        """Work out the covariances of the poles, or say why they cannot be had."""
        s, tracker = self.settings, self._tracker
        if sample_index is None:
            self._spread, self.note = None, "the stream did not say which sample the parameters end with"
            return
        memory = FilterMemory(s.forgetting, s.regularisation, s.offset, s.scale, GROWTH_MAX, sample_index)
        moments = self._moments_at(sample_index)
        share = known_share(moments, memory)
        if share < LEAST_SHARE or not tracker.ready:
            self._spread = None
            self.note = f"{share:.0%} of what the filter has learnt from was heard, {LEAST_SHARE:.0%} are needed"
        elif time.monotonic() >= self._quiet_until:
            self._spread = self._poles_of(moments, memory, share, tracker.windows()[-max(tracker.memory, 1) :])
            self.note = ""

    def _poles_of(
        self, moments: Moments, memory: FilterMemory, share: float, rows: Array
    ) -> tuple[NDArray[np.complex128], Array]:
        s, tracker = self.settings, self._tracker
        width, r = s.past * tracker.block, len(s.inputs)
        keep = [*range(width), *(width + i for i in s.feedthrough)]
        start, floor = remainder(memory, float((memory.last or 0) + 1))
        theta = tracker.theta
        P, covariance, bias = moments.noise(theta, start, floor, np.ones(len(keep)))
        # the fit knows the samples in its memory, by the filter's own weights
        w = s.forgetting ** np.arange(len(rows), dtype=np.float64)[::-1]
        factor = self._factor(rows, w)
        psi = rows[:, : width + r] - factor.mean[: width + r]
        weighted = psi * w[:, None]
        age = (memory.last or 0) - self._ends[-len(rows) :].astype(float)  # below 0: the filter had not seen it yet
        phi = self._parts(rows)[0] * np.where(age >= 0, s.forgetting ** np.maximum(age, 0.0), 0.0)[:, None]
        full = np.zeros((len(theta), width + r))
        off = full.copy()
        full[:, keep], off[:, keep] = theta, bias
        found = joint_spread(
            moments, P, phi.T @ weighted, weighted.T @ weighted, weighted.T @ psi, keep, covariance, off, share
        )
        nothing = np.zeros(len(theta))
        estimate = MarkovEstimate(
            full, len(keep), len(keep), 1.0, nothing, found.spread, covariance, found.direct, found.bias
        )
        A, B, C, D, K = tracker.matrices
        assert tracker.selection is not None
        stacked = gamma_k(full, s.past, tracker.future, tracker.block)
        basis = StateBasis(np.ones(len(A)), tracker.selection.T, stacked, 1)
        model = ScaledModel(A, B, C, D, K, covariance, "least squares")
        mask = tuple(i in s.feedthrough for i in range(r))
        matrices = matrix_spread(factor, basis, model, estimate, mask)
        return np.linalg.eigvals(A).astype(complex), pole_covariance(A, matrices)

    def modes(self) -> tuple[LiveMode, ...]:
        """Return the modes as they are now, by frequency, named and marked; none while `waiting`. Cost: n³."""
        if self.waiting or not self._tracker.ready:
            return ()
        s = self.settings
        names = [tuple(Signal(name) for name in group) for group in (s.inputs, s.outputs)]
        model = self._tracker.model(names[0], names[1], s.sample_time_s)
        scale = s.scale[len(s.inputs) :]
        modes = modes_of(
            model, output_scale=scale, pole_covariance=self._covariances(np.linalg.eigvals(model.A).astype(complex))
        )
        numbers = self._numbers(
            [complex(continuous_poles(np.array([m.eigenvalue]), s.sample_time_s)[0]) for m in modes]
        )
        marked = self._heard.marked(list(zip(numbers, modes, strict=True)), self.samples * s.sample_time_s)
        return tuple(LiveMode(number, mode) for number, mode in zip(numbers, marked, strict=True))

    def _covariances(self, poles: NDArray[np.complex128]) -> Array:
        """Return the covariance (n, 2, 2) of each pole: that of the nearest pole at the last snapshot."""
        if self._spread is None or len(self._spread[0]) != len(poles):
            return np.full((len(poles), 2, 2), np.nan)
        before, covariances = self._spread
        found: Array = covariances[nearest(poles, before)]
        return found

    def _numbers(self, poles: list[complex]) -> list[int]:
        """Return the number of each continuous-time pole: that of the nearest place one was last at, or a new one."""
        given = [-1] * len(poles)
        if self._places and poles:
            here, there = np.array(poles), np.array(self._places)
            size = np.maximum(np.maximum(abs(here)[:, None], abs(there)[None]), 1e-12)
            cost = abs(here[:, None] - there[None]) / size
            cost[(here.imag > 0)[:, None] != (there.imag > 0)[None]] = np.inf
            rows, columns = linear_sum_assignment(np.where(cost <= FARTHEST, cost, 1e6))
            for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
                given[i] = j if cost[i, j] <= FARTHEST else -1
        for i, place in enumerate(poles):
            if given[i] < 0:  # a new number; of very many the first is given again
                given[i] = len(self._places) if len(self._places) < PLACES_MAX else self._next_place
                self._next_place = (given[i] + 1) % PLACES_MAX
                self._places[given[i] : given[i] + 1] = [place]
            self._places[given[i]] = place
        return [number + 1 for number in given]
