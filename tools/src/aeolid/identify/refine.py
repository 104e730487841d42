"""Refine a subspace model by its prediction errors: the maximum likelihood of the innovation form.

Damped Gauss–Newton steps on log det of the errors' covariance Λ (`error_weight`), in the tangent space of models that
differ in more than their basis (`sensitivity`). For every model tried, what it is free to choose of the recordings is
solved for exactly: the first state of each stretch of complete samples, and a constant error of each output, which is
all that constants in both equations can do to a stable predictor. A model is admitted while A − K C is stable and
forgets within the recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.identify.descent import ENOUGH, MOST_STEPS, column_scale, covariance_root, descend, usable
from aeolid.identify.error_weight import RESOLVED, least_of, log_det, weight_of
from aeolid.identify.extended import Samples
from aeolid.identify.sensitivity import Coordinates, chunk_length, error_derivatives, unpack
from aeolid.identify.split import FIT_PART, border
from aeolid.identify.subspace import ScaledModel, move_inside, rest_of, spectral_radius
from aeolid.identify.uncertainty import MatrixSpread
from aeolid.identify.windows import triangularise
from aeolid.models.recursion import run_states

Array = NDArray[np.float64]
DECAYED = 1e-12  # of a first state's size in the errors, below which it is forgotten
LONGEST_ANSWER = 50_000  # samples that are asked for a first state
HELD_OUT_LEAST = 20  # samples per channel that must be held out
MEMORIES = 3.0  # time constants of the predictor's slowest pole that a recording must hold: e⁻³ = 5 % are left of it
AT_END = 0.01  # of log |z| of that pole: steps come this near to the bound where the errors fall beyond it


@dataclass(frozen=True, eq=False)
class Stretch:
    """Hold u (N, r) and y (N, l), scaled, of complete samples in a row; the first `early` belong to the fit part."""

    u: Array
    y: Array
    early: int

    def head(self) -> Stretch:
        """Return the fit part alone."""
        return Stretch(self.u[: self.early], self.y[: self.early], self.early)


@dataclass(frozen=True, eq=False)
class Run:
    """Hold the errors e (N, l) of a model along each stretch, its states (N, n) and the constant error (l,)."""

    errors: tuple[Array, ...]
    states: tuple[Array, ...]
    constant: Array

    def covariance(self) -> Array:
        """Return the errors' covariance (l, l) about the constant."""
        total: Array = sum((e.T @ e for e in self.errors), np.zeros((1, 1))) / max(sum(map(len, self.errors)), 1)
        return total


@dataclass(frozen=True, eq=False)
class Refinement:
    """Hold a refined model, how it was found and how far it can be trusted.

    constant (l,): mean error that belongs to it; steps taken; held_out: by which part the steps lowered the error power
    of the fit part's model on what is held out, and gain that of everything, mean over outputs, 0 … 1; held_out_error:
    that error before and after them, in standard deviations, None where none is held out; root (npar, ·): cov θ = root
    rootᵀ of θ = [A B K], [C D] row by row, None where the data are exact or the information is not finite; samples: of
    all stretches.
    """

    model: ScaledModel
    constant: Array
    steps: int
    held_out: float | None
    gain: float
    root: Array | None
    feedthrough: tuple[bool, ...]
    stopped: str
    held_out_error: tuple[float, float] | None = None
    samples: int = 0

    def to_json(self) -> dict[str, float | str | None]:
        """Return the facts for JSON."""
        before, after = self.held_out_error or (None, None)
        return {
            "steps": self.steps,
            "held_out_error_before": before,
            "held_out_error_after": after,
            "held_out_error_power_lower_by": self.held_out,
            "error_power_lower_by": self.gain,
            "stopped": self.stopped,
        }

    def text(self) -> str:
        """Return one sentence for the user."""
        if self.steps == 0:
            return f"not refined: {self.stopped}"
        return (
            f"refined in {self.steps} prediction-error steps: error power {self.held_out or 0:.2%} lower on the "
            f"held-out last {1 - FIT_PART:.0%}{self._pair}, {self.gain:.2%} on everything"
        )

    @property
    def _pair(self) -> str:
        if self.held_out_error is None:
            return ""
        return f" (error {self.held_out_error[0]:.4g} before, {self.held_out_error[1]:.4g} after)"

    def spread(self) -> MatrixSpread | None:
        """Return the covariance of the entries of [A B; C D] in scaled units, None where it is not known."""
        if self.root is None:
            return None
        (n, r), outputs = self.model.B.shape, len(self.model.C)
        A, B, _, C, D = unpack(self.model, np.flatnonzero(self.feedthrough), self.root)
        rows = [np.concatenate([A, B], axis=1), np.concatenate([C, D], axis=1)]
        return MatrixSpread(np.concatenate(rows).reshape((n + outputs) * (n + r), -1).T, n, r)

    def equilibrium(self) -> Array:
        """Return the outputs at rest (l,) under the mean input, scaled units; see `subspace.equilibrium`."""
        m = self.model
        out: Array = m.C @ rest_of(m.A, m.K @ self.constant, self.samples) + self.constant
        return out


def cut_stretches(samples: Samples) -> list[Stretch]:
    """Return the stretches of an experiment set, with the samples of each that lie in the fit part of its recording."""
    edges = np.cumsum([0, *samples.lengths])
    known = np.where(samples.used(0)[:, None], samples.x, np.nan)
    borders = [a + border(known[a:b], 0) for a, b in pairwise(edges)]
    out = []
    for a, b in zip(samples.starts, samples.stops, strict=True):
        record = int(np.searchsorted(edges, a, side="right")) - 1
        z = samples.x[a:b]
        out.append(Stretch(z[:, : samples.inputs], z[:, samples.inputs :], int(np.clip(borders[record] - a, 0, b - a))))
    return out


def refine(
    stretches: Sequence[Stretch], start: ScaledModel, head: ScaledModel, feedthrough: tuple[bool, ...], stable: bool
) -> Refinement:
    """Refine a model as far as that predicts better what it was not refined on.

    start: subspace model of everything; head: that of the first 70 % of each recording, of the same order. The steps
    are first taken from `head` on that part; the number after which the rest is predicted best, none included, is then
    taken from `start` on everything. stable: keep the poles inside the unit circle too. Cost: two descents of some
    steps, each 4 N n (n + r + l) f + 2 N l f² operations with f = n (r + 2 l) + what D has free.
    """
    descent = Descent(stretches, feedthrough, stable)
    early = [s.head() for s in stretches if s.early > len(start.A)]
    late = sum(len(s.y) - s.early for s in stretches)
    if not early or late < HELD_OUT_LEAST * (start.B.shape[1] + len(start.C)):
        return descent.result([start], None, "too few samples to hold some out")
    trial = Descent(early, feedthrough, stable).path(head, MOST_STEPS)
    losses = [held_out_loss(model, stretches) for model in trial]
    best = int(np.argmin(losses))
    if best == 0:
        same = (_size(losses[0]),) * 2 if np.isfinite(losses[0]) else None
        return replace(
            descent.result([start], 0.0, "no step lowers the error on what is held out"), held_out_error=same
        )
    ended = best == len(trial) - 1  # the descent itself ended: so it may on everything
    path = descent.path(start, MOST_STEPS if ended else best)
    gain = 1 - float(np.exp(losses[best] - losses[0])) if np.isfinite(losses[0]) else 1.0
    stopped = "no step gains" if ended else f"the held-out error is least after {best} steps"
    if len(path) > MOST_STEPS:
        stopped = f"{MOST_STEPS} steps are the most"
    pair = (_size(losses[0]), _size(losses[best])) if np.isfinite(losses[0]) else None
    return replace(descent.result(path, gain, stopped), held_out_error=pair)


def _size(loss: float) -> float:
    """Return the error in standard deviations of the outputs, from its mean log power."""
    return float(np.exp(loss / 2))


@dataclass(frozen=True, eq=False)
class Descent:
    """Hold the stretches that a model is refined on."""

    stretches: Sequence[Stretch]
    feedthrough: tuple[bool, ...]
    stable: bool

    def path(self, start: ScaledModel, steps: int, enough: float = ENOUGH) -> list[ScaledModel]:
        """Return the start and the models after each step; enough: gain in mean log error power that ends them."""
        if not admitted(start):
            return [start]
        slowest = max(self._slowest(), spectral_radius(start.A - start.K @ start.C))
        covariance = run_model(start, self.stretches, np.eye(len(start.C))).covariance()
        least = least_of(covariance)
        weight = weight_of(covariance)
        at = lru_cache(maxsize=1)(lambda model: Coordinates.at(model, self.feedthrough))  # one for all damped steps

        def loss(model: ScaledModel) -> float:
            if not admitted(model, slowest):
                return np.inf
            return log_det(run_model(model, self.stretches, weight).covariance(), least)

        def factor(model: ScaledModel) -> Array:
            run = run_model(model, self.stretches, weight)
            return self.information(model, run, weight_of(run.covariance(), least), at(model))

        def move(model: ScaledModel, delta: Array) -> ScaledModel:
            moved = at(model).move(model, delta)
            return replace(moved, A=move_inside(moved.A)) if self.stable else moved

        return list(descend(start, loss, factor, move, steps=steps, floor=np.log(RESOLVED) + 1e-9, enough=enough))

    def _slowest(self) -> float:
        """Return the largest magnitude of a predictor's pole that the longest stretch can show, below 1.

        A memory longer than the recording is a second constant for every stretch: it lowers the errors there and
        nowhere else.
        """
        return float(np.exp(-MEMORIES / max(len(s.y) for s in self.stretches)))

    def is_bounded(self, model: ScaledModel) -> bool:
        """Say whether the predictor's slowest pole lies where the recordings are too short to show it, or next to it.

        Steps that end there would have gone on: the noise has a longer memory than a stretch holds.
        """
        radius = spectral_radius(model.A - model.K @ model.C)
        return bool(radius >= self._slowest() ** (1 + AT_END))

    def result(self, path: Sequence[ScaledModel], held_out: float | None, stopped: str) -> Refinement:
        """Return the end of a path, its gain over the start and the covariance of its numbers."""
        start, model = path[0], path[-1]
        if len(path) == 1:
            return Refinement(start, np.zeros(len(start.C)), 0, held_out, 0.0, None, self.feedthrough, stopped)
        even = np.eye(len(start.C))
        before = run_model(start, self.stretches, even).covariance()
        run = run_model(model, self.stretches, weight_of(run_model(model, self.stretches, even).covariance()))
        powers = [np.log(np.maximum(c.diagonal(), RESOLVED)) for c in (before, run.covariance())]
        gain = 1 - float(np.exp(np.mean(powers[1] - powers[0])))
        model = replace(model, covariance=run.covariance(), gain_method="prediction error")
        root, samples = self._root(model, run), sum(map(len, run.errors))
        done = Refinement(model, run.constant, len(path) - 1, held_out, gain, root, self.feedthrough, stopped)
        return replace(done, samples=samples)

    def _root(self, model: ScaledModel, run: Run) -> Array | None:
        covariance = run.covariance()
        if float(np.linalg.eigvalsh(covariance)[-1]) < RESOLVED:
            return None
        coordinates = Coordinates.at(model, self.feedthrough)
        R = self.information(model, run, weight_of(covariance), coordinates)
        if not usable(R) or column_scale(R).min() <= 1e-300:
            return None
        numbers = coordinates.free + len(model.A) * len(self.stretches) + len(covariance)  # first states, constant
        spent = numbers / max(sum(map(len, run.errors)) * len(covariance), 1)
        root: Array = coordinates.basis @ covariance_root(R, coordinates.free) / np.sqrt(max(1 - spent, 0.1))
        return root

    def information(self, model: ScaledModel, run: Run, weight: Array, coordinates: Coordinates) -> Array:
        """Return the triangular factor (free + 1, free + 1) of the weighted [∂e/∂θ, e].

        The first states and the constant are nuisances: their columns are eliminated. weight (l, l): what the errors
        are multiplied with from the right; coordinates: of the model.
        """
        n, outputs, chunk = len(model.A), len(model.C), chunk_length(model, coordinates)
        whole = np.zeros((0, outputs + coordinates.free + 1))
        for stretch, x, e in zip(self.stretches, run.states, run.errors, strict=True):
            dx = np.hstack([np.eye(n), np.zeros((n, coordinates.free))])
            R = np.zeros((0, n + whole.shape[1]))
            for a in range(0, len(e), chunk):
                part = slice(a, a + chunk)
                J = error_derivatives(model, coordinates, weight, x[part], stretch.u[part], e[part], dx)
                rows = np.empty((len(J), outputs, R.shape[1]))
                rows[:, :, :n] = J[:, :, :n]
                rows[:, :, n : n + outputs] = -weight.T
                rows[:, :, n + outputs : -1] = J[:, :, n:]
                rows[:, :, -1] = e[part] @ weight
                R = triangularise(np.vstack([R, rows.reshape(-1, R.shape[1])]))
            whole = triangularise(np.vstack([whole, R[n:, n:]]))
        return whole[outputs:, outputs:]


def admitted(model: ScaledModel, slowest: float = 1.0) -> bool:
    """Return whether the predictor is stable, and no pole of it larger than `slowest`, 0 … 1."""
    closed = model.A - model.K @ model.C
    if not np.isfinite(closed).all():
        return False
    radius = spectral_radius(closed)
    return radius < 1 and radius <= slowest * (1 + 1e-12)


def run_model(model: ScaledModel, stretches: Sequence[Stretch], weight: Array) -> Run:
    """Run the predictor along the stretches; the first states and the constant make the weighted errors least.

    weight (l, l): what errors are multiplied with from the right. With the constants K c and c in the two equations the
    states are those of the raw recursion, and the errors lower by c.
    """
    n, outputs = len(model.A), len(model.C)
    closed, forcing = model.A - model.K @ model.C, model.B - model.K @ model.D
    answer = first_state_answer(closed, model.C, max(len(s.y) for s in stretches))
    forced = [s.u @ forcing.T + s.y @ model.K.T for s in stretches]
    total, factors = np.zeros((0, outputs + 1)), []
    for stretch, f in zip(stretches, forced, strict=True):
        raw = stretch.y - run_states(closed, f, np.zeros(n))[:-1] @ model.C.T - stretch.u @ model.D.T
        R = _nuisance_factor(answer[: len(raw)], raw, weight)
        total = triangularise(np.vstack([total, R[n:, n:]]))
        factors.append(R)
    constant = np.asarray(lstsq(total[:, :outputs], total[:, outputs], rcond=1e-12), np.float64)
    errors, states = [], []
    for stretch, f, R in zip(stretches, forced, factors, strict=True):
        x0 = np.asarray(lstsq(R[:n, :n], R[:n, -1] - R[:n, n:-1] @ constant, rcond=1e-10), np.float64)
        x = run_states(closed, f, x0)[:-1]
        states.append(x)
        errors.append(stretch.y - x @ model.C.T - stretch.u @ model.D.T - constant)
    return Run(tuple(errors), tuple(states), constant)


def first_state_answer(closed: Array, C: Array, most: int) -> Array:
    """Return C Āᵏ (·, l, n), k = 0, 1, …, until it has decayed, `most` samples or LONGEST_ANSWER at the longest."""
    answer, power, size = C[None], closed, float(abs(C).max())
    while len(answer) < min(most, LONGEST_ANSWER) and abs(answer[-1]).max() > DECAYED * size:
        answer = np.concatenate([answer, answer @ power])
        power = power @ power
    return answer[: min(most, LONGEST_ANSWER)]


def _nuisance_factor(answer: Array, errors: Array, weight: Array) -> Array:
    """Return the factor (n + l + 1, n + l + 1) of the weighted [what x_0 answers, constant, errors] of one stretch.

    Where x_0 is forgotten, only the constant is left, and the mean of the errors says all about it.
    """
    (count, outputs, n), left = answer.shape, len(errors) - len(answer)
    rows = np.zeros((count + (left > 0), outputs, n + outputs + 1))
    rows[:count, :, :n] = np.matmul(weight.T, answer)
    rows[:, :, n : n + outputs] = weight.T
    rows[:count, :, -1] = errors[:count] @ weight
    if left:
        rows[count, :, -1] = errors[count:].mean(axis=0) @ weight
        rows[count] *= np.sqrt(left)
    return triangularise(rows.reshape(-1, n + outputs + 1))


def held_out_loss(model: ScaledModel, stretches: Sequence[Stretch]) -> float:
    """Return the mean log error power per output behind the fit parts, about its mean."""
    if not admitted(model):
        return float(np.inf)
    run = run_model(model, stretches, np.eye(len(model.C)))
    e = np.concatenate([part[s.early :] for part, s in zip(run.errors, stretches, strict=True)])
    return float(np.mean(np.log(np.maximum(e.var(axis=0), RESOLVED))))
