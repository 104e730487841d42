"""Imitate a recording in its own control loop: the baseline, what answers its outputs, the recorded excitation (S2)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit
from aeolid.decompositions import lstsq
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.noise import colour_var
from aeolid.diagnose.predictor.point import Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.models.integrate import addresses
from aeolid.models.march import march, outputs, settle

Array = NDArray[np.float64]
LAGS = 40  # samples of its own past by which an input is foretold, at the most
_SEEN = 10  # samples of an output that a controller remembers, at the most
_ORDERS = (1, 2, 4, _SEEN)
_AROUND = 50  # rows among which innovations change places: loud stretches stay, what is foretold does not
_RUNAWAY = 1e3  # times the recorded spread: the loop does not hold what it is made of


@dataclass(frozen=True, eq=False)
class Answer:
    """Hold how one input answers: its place, weights (q,) of all regressors, root (q, q) of their covariance.

    Regressors: one, the input's last 40 samples, each output's present and last 10.
    """

    place: int
    weights: Array
    root: Array


@dataclass(frozen=True, eq=False)
class Controller:
    """Hold what computes f inputs from the outputs: u_t = c + Σ a_i u_{t−i} + Σ b_i y_{t−i} + v_t.

    v, what was added (excitation, set points, whatever is no filter of the outputs), is as recorded: with the recorded
    outputs these are the recorded inputs.
    """

    answers: tuple[Answer, ...]

    @property
    def places(self) -> list[int]:
        """Return the places of the computed inputs."""
        return [a.place for a in self.answers]

    def drawn(self, rng: np.random.Generator) -> Controller:
        """Return another one that the recording does not tell from this: weights drawn from their covariance."""
        return Controller(
            tuple(replace(a, weights=a.weights + a.root @ rng.standard_normal(len(a.weights))) for a in self.answers)
        )


def controller_of(segments: Sequence[Segment], inputs: int, at_once: NDArray[np.bool_]) -> Controller | None:
    """Fit by least squares what computes inputs from outputs; None where nothing does.

    inputs: how many columns of u are inputs, the first ones, read where the outputs are; at_once (l,): the output looks
    at no input, so that an input may answer it within the row (of others, which feel the input at once, it would be the
    effect). Outputs are taken one after another, each with 1, 2, 4 or 10 of its last samples, as long as they foretell
    the input by more than their coefficients' price (BIC) beyond its own past and those before.

    The own past must be longer than steps are held: of 10 samples beside steps of 10 the outputs tell when the next
    step is due, and were taken for a cause in one of four recordings in open loop; gains of a controller came out 1.1
    to 2.4 times too large, with 40 within 20 % (six recordings).
    """
    rules = in_force().localise
    found = []
    for place in range(inputs):
        X, u = (np.vstack(parts) for parts in zip(*(_regressors(s, place) for s in segments), strict=True))
        if len(u) > rules.rows_a_weight * X.shape[1] and np.ptp(u) > 0:
            weights, root = _weights(X, u[:, 0], at_once)
            if np.any(weights[1 + LAGS :]):
                found.append(Answer(place, weights, root))
    return Controller(tuple(found)) if found else None


def _weights(X: Array, u: Array, at_once: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the weights (q,) of all regressors, 0 where not worth their price, and their covariance's root (q, q)."""
    scale = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    gram, cross, square = (X / scale).T @ (X / scale), (X / scale).T @ u, float(u @ u)

    def fitted(columns: list[int]) -> tuple[float, Array, float]:
        w = lstsq(gram[np.ix_(columns, columns)], cross[columns], rcond=1e-12)
        left = max(square - float(cross[columns] @ w), 1e-12 * square)
        return len(u) * np.log(left) + len(columns) * np.log(len(u)), w, left

    chosen, others = list(range(1 + LAGS)), list(range(len(at_once)))
    best, weights, left = fitted(chosen)
    while others:
        trials = []
        for j, order in itertools.product(others, _ORDERS):
            first = 1 + LAGS + j * (1 + _SEEN)
            columns = [*chosen, *range(first + (not at_once[j]), first + order + 1)]
            trials.append((*fitted(columns), columns, j))
        value, w, square_left, columns, j = min(trials, key=lambda t: t[0])
        if value >= best:
            break
        best, weights, left, chosen = value, w, square_left, columns
        others.remove(j)
    result, root = np.zeros(X.shape[1]), np.zeros((X.shape[1], X.shape[1]))
    result[chosen] = weights / scale[chosen]
    values, vectors = np.linalg.eigh(gram[np.ix_(chosen, chosen)])
    deviation = np.sqrt(left / len(u)) * vectors / np.sqrt(np.maximum(values, 1e-12 * values[-1]))
    root[np.ix_(chosen, chosen)] = deviation / scale[chosen, None]
    return result, root


def _regressors(segment: Segment, place: int) -> tuple[Array, Array]:
    """Return what an input may be computed from (n, q), and the input (n, 1), of the rows that are whole."""
    X, u = _lagged(segment, place), segment.u[:: segment.stride][LAGS:, place, None]
    whole = np.all(np.isfinite(X), axis=1)
    return X[whole], u[whole]


def _lagged(segment: Segment, place: int) -> Array:
    """Return the regressors of an input (N − p, q) from row p on."""
    count, u, y = max(len(segment.y), LAGS), segment.u[:: segment.stride, place, None], segment.y
    own = [u[LAGS - i : count - i] for i in range(1, LAGS + 1)]
    seen = [y[LAGS - i : count - i, j : j + 1] for j in range(y.shape[1]) for i in range(_SEEN + 1)]
    return np.hstack([np.ones((max(len(y) - LAGS, 0), 1)), *own, *seen])


def _added(segment: Segment, answer: Answer) -> Array:
    """Return v (N,): none before the first p rows are known, nor where an output is missing."""
    found = np.zeros(len(segment.y))
    found[LAGS:] = np.nan_to_num(segment.u[LAGS:, answer.place] - _lagged(segment, answer.place) @ answer.weights)
    return found


def can_close(predictor: Predictor) -> bool:
    """Tell whether a loop can be run row by row: one row of inputs a row of outputs, and no filter in front."""
    return predictor.segments[0].stride == 1 and not predictor.compiled.model.filters


def imitate_in_loop(
    predictor: Predictor, fit: Fit, point: Point, controller: Controller | None, rng: np.random.Generator
) -> list[Segment] | None:
    """Make the predictor's recordings anew: other innovations, inputs that answer the outputs; None where it runs away.

    Innovations are the whitened ones of the fit (one row each from `burn` on), signs drawn, order drawn among 50
    neighbours, coloured again. Inputs without a controller are as recorded. Cost: a filter pass, row by row.
    """
    width = predictor.segments[0].y.shape[1]
    white, start, made = fit.residual.reshape(-1, width), 0, []
    unwhiten, K = np.linalg.inv(fit.noise.factor), predictor.gain(point)
    for i, segment in enumerate(predictor.segments):
        stop = start + len(segment.y) - segment.burn
        e = colour_var(_redrawn(white, (start, stop), len(segment.y), rng) @ unwhiten, fit.noise.var)
        start = stop
        if controller is None:
            errors, predicted, _ = predictor.run_rows(point, i, 0, e, point.x0[i], K, generate=True)
            u, y = segment.u, predicted + errors
        else:
            u, y = _closed(predictor, point, i, controller, e)
        moved = np.where(np.isfinite(segment.y), y, np.nan)
        if not _is_held(moved, segment.y) or not _is_held(u, segment.u):
            return None
        made.append(replace(segment, u=np.ascontiguousarray(u), y=np.ascontiguousarray(moved)))
    return made


def _redrawn(white: Array, scored: tuple[int, int], rows: int, rng: np.random.Generator) -> Array:
    """Return innovations for a segment, the scored rows last, each one of its neighbours' with a sign drawn.

    The burn-in takes any of all segments.
    """
    own = white[slice(*scored)]
    places = np.clip(np.arange(len(own)) + rng.integers(-_AROUND, _AROUND + 1, len(own)), 0, max(len(own) - 1, 0))
    before = white[rng.integers(0, len(white), rows - len(own))]
    result: Array = np.vstack([before, own[places]]) * rng.choice(np.array([-1.0, 1.0]), (rows, 1))
    return result


def _is_held(made: Array, recorded: Array) -> bool:
    """Tell whether what was made stays within reach of what was recorded."""
    known = np.isfinite(recorded)
    reach = _RUNAWAY * np.nanstd(recorded) + np.nanmax(np.abs(recorded))
    return bool(np.all(np.abs(made[known]) <= reach))


def _closed(predictor: Predictor, point: Point, index: int, controller: Controller, e: Array) -> tuple[Array, Array]:
    segment, compiled = predictor.segments[index], predictor.compiled
    u = np.ascontiguousarray(segment.u, dtype=np.float64).copy()
    weights = np.stack([a.weights for a in controller.answers])
    added = np.column_stack([_added(segment, a) for a in controller.answers])
    y = run_loop(
        addresses(compiled.code), compiled.model.sample_time_s > 0, u, np.ascontiguousarray(e), point.theta,
        predictor.gain(point), point.x0[index], segment.fine_step, predictor.ready(point, index)[1],
        np.array(controller.places), weights, added,
    )  # fmt: skip
    return u, y


@njit(cache=True, error_model="numpy", nogil=True)
def run_loop(
    code: tuple[int, int, int, int], discrete: bool, U: Array, E: Array, th: Array, K: Array, x0: Array, step: float,
    count: int, places: NDArray[np.int64], weights: Array, added: Array,
) -> Array:  # fmt: skip
    """Return outputs (N, l) from innovations E (N, l), each computed input written into U (N, r) before it acts.

    The first p rows of inputs stay as they are. Outputs that are answered at once look at no input and are read before
    the input of the row is known; the others are read once it is.
    """
    _, read, renew, _ = code
    N, m = len(E), E.shape[1]
    Y, x, predicted, sign = np.empty((N, m)), x0.copy(), np.empty(m), np.empty(m)
    held = np.zeros((len(K), 0, 1))
    for k in range(N):
        if k >= LAGS:
            now = x.copy()
            settle(renew, now, U[k], th, step)
            outputs(read, now, U[k], th, predicted, sign)
            Y[k] = predicted + E[k]
            for f in range(len(places)):
                w = weights[f]
                value = w[0] + added[k, f]
                for i in range(1, LAGS + 1):
                    value += w[i] * U[k - i, places[f]]
                for j in range(m):
                    for i in range(_SEEN + 1):
                        value += w[1 + LAGS + j * (_SEEN + 1) + i] * Y[k - i, j]
                U[k, places[f]] = value
        now_u, now_e = U[k : k + 1], E[k : k + 1]
        found = march(code, 1, discrete, now_u, now_e, th, K, x, (0, 0), held, step, count, 1, True, False)
        Y[k] = found[1][0] + found[0][0]
        x = found[2][-1]
    return Y
