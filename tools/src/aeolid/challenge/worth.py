"""Measure how well an effect is hidden: how far it moves the baseline's fit, and how many nats its truth would gain.

Both come from one predictor of the plant without the effect: linearised by differences, discretised exactly for held
inputs, with the Kalman gain of its own disturbances and sensor noise. It runs on the recording with the effect (e₁) and
on the same recording, same seeds, without it (e₀). A truth that is known exactly leaves e₀, so d = e₁ − e₀ is the
effect's signature, both before the converter, whose rounding differs between them and is no signature. The measurement
chain colours e₀, and a slow effect is worth less below slow noise: an autoregression of e₀ as recorded whitens d. What
the baseline's free values, gains and offsets can imitate of it on the first 70 % of the recording is taken off, and
½ Σ d² over the last 30 % is the expected gain on sealed data. It is a proxy: noise models could imitate more, nonlinear
baselines less. For an effect that is itself random, d holds what nobody can foretell; there the gain is what a further
linear prediction of e₁ from its own past gains on the same samples, less that of e₀.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cholesky, expm, solve_discrete_are, solve_triangular

from aeolid.challenge.chain import NONE
from aeolid.challenge.plants import Setup
from aeolid.compiled import njit
from aeolid.decompositions import lstsq

Array = NDArray[np.float64]
SEALED, SETTLE, PAST = 0.7, 50, 12  # where the sealed share begins; samples and lags


@dataclass(frozen=True, eq=False)
class Linear:
    """Hold x' = A x + B u, y = C x + D u about (x0, u0, y0) in continuous time; the last states are disturbances."""

    A: Array
    B: Array
    C: Array
    D: Array
    kicks: Array  # intensity of the white noise that drives each state
    noise: Array  # deviation of each output's sensor
    u0: Array
    y0: Array


@dataclass(frozen=True)
class Worth:
    """Hold nats gained on sealed data, and points of the one-step VAF that the effect moves at most in an output."""

    nats: float
    vaf_points: float
    vaf: float


def core_of(setup: Setup) -> tuple[int, ...]:
    """Return the places of the states that the model without the effect has."""
    return (1,) if getattr(setup.base, "rigid", 0.0) else setup.plant.core


def linearise(setup: Setup, physics: Any) -> Linear:
    """Differentiate the plant at its operating point, disturbances as states of their own."""
    plant, core = setup.plant, core_of(setup)
    flow, see, _ = plant.parts
    shown = [setup.number(o) for o in setup.outputs]
    s0, u0 = plant.start(physics), np.array(plant.rest)
    places = [d[0] for d in plant.disturbances]

    def at(x: Array, u: Array) -> tuple[Array, Array]:
        s, w, ds, y = s0.copy(), np.zeros(plant.width), np.zeros(plant.states), np.zeros(len(plant.outputs))
        s[list(core)], w[places] = x[: len(core)], x[len(core) :]
        if plant.name == "turbine":
            s[2] = s[1]
        flow(physics, 0.0, s, u, w, ds)
        see(physics, s, u, w, y)
        return ds[list(core)], y[shown]

    x0 = np.concatenate([s0[list(core)], np.zeros(len(places))])
    sizes = 1e-4 * np.maximum(np.abs(np.concatenate([x0, u0])), 0.1)
    flows, views = [], []
    for i, h in enumerate(sizes):
        step = np.zeros(len(sizes))
        step[i] = h
        (f1, y1), (f2, y2) = (at(x0 + k * step[: len(x0)], u0 + k * step[len(x0) :]) for k in (1, -1))
        flows.append((f1 - f2) / (2 * h))
        views.append((y1 - y2) / (2 * h))
    F, H, n, c = np.transpose(flows), np.transpose(views), len(x0), len(core)
    A = np.zeros((n, n))
    A[:c] = F[:, :n]
    rates = [1 / (m * setup.memory) for _, _, m in plant.disturbances]
    A[range(c, n), range(c, n)] = -np.array(rates)
    B = np.vstack([F[:, n:], np.zeros((n - c, len(u0)))])
    kicks = [(setup.gusts * s) ** 2 * 2 * r for (_, s, _), r in zip(plant.disturbances, rates, strict=True)]
    noise = np.array([plant.outputs[i].noise for i in shown])
    return Linear(A, B, H[:, :n], H[:, n:], np.array([0.0] * c + kicks), noise, u0, at(x0, u0)[1])


def discrete(model: Linear, step: float) -> tuple[Array, Array, Array]:
    """Return A, B for held inputs and the covariance of what the noise adds in a sample (Van Loan 1978)."""
    n, m = model.B.shape
    held = expm(np.block([[model.A, model.B], [np.zeros((m, n + m))]]) * step)
    pair = expm(np.block([[-model.A, np.diag(model.kicks)], [np.zeros((n, n)), model.A.T]]) * step)
    A = held[:n, :n]
    Q = A @ pair[:n, n:]
    return A, held[:n, n:], (Q + Q.T) / 2


@njit(cache=True)
def _innovations(A: Array, B: Array, C: Array, D: Array, K: Array, u: Array, y: Array) -> Array:
    x, e = np.zeros(len(A)), np.empty(y.shape)
    for k in range(len(y)):
        e[k] = y[k] - C @ x - D @ u[k]
        x = A @ x + B @ u[k] + K @ e[k]
    return e


class Predictor:
    """Predict a recording one step ahead with the model without the effect."""

    def __init__(self, setup: Setup) -> None:
        """Find the gain; raises ValueError where there is none."""
        self.setup = setup
        A, _, Q, self.model = self._matrices(setup.base)
        R = np.diag(self.model.noise**2) + 1e-12 * np.eye(len(self.model.noise))
        floor = 1e-9 * np.diag(np.diag(Q).max() * np.ones(len(Q)))
        try:
            P = solve_discrete_are(A.T, self.model.C.T, Q + floor, R)
        except (LinAlgError, ValueError) as error:
            raise ValueError(f"{setup.plant.name}: no Kalman gain ({error})") from None
        S = self.model.C @ P @ self.model.C.T + R
        self.K = A @ P @ self.model.C.T @ np.linalg.inv(S)

    def _matrices(self, physics: Any) -> tuple[Array, Array, Array, Linear]:
        model = linearise(self.setup, physics)
        return (*discrete(model, self.setup.plant.step_s), model)

    def innovations(self, columns: dict[str, Array], physics: Any = None, gain: int = -1) -> Array:
        """Return what the model does not foretell (N, l); physics: changed constants; gain: an input 1 % stronger."""
        A, B, _, model = self._matrices(self.setup.base if physics is None else physics)
        u = np.column_stack([columns[c.name] for c in self.setup.plant.inputs]) - model.u0
        y = np.column_stack([columns[o] for o in self.setup.outputs]) - model.y0
        if gain >= 0:
            u = u.copy()
            u[:, gain] *= 1.01
        parts = (A, B, model.C, model.D, self.K, u, y)
        found: Array = _innovations(*(np.ascontiguousarray(x) for x in parts))
        return found


def worth(
    setup: Setup, hidden: dict[str, Array], bare: dict[str, Array], recorded: dict[str, Array] | None = None, *,
    random: bool = False, loose: bool = False,
) -> Worth:  # fmt: skip
    """Compare the recording with the effect to that without.

    recorded: that without the effect behind the converter, where hidden and bare are before it; random: the effect
    itself is noise; loose: input gains and output offsets of the baseline are free, too.
    """
    predictor = Predictor(setup.bare)
    e1, e0 = predictor.innovations(hidden), predictor.innovations(bare)
    first = int(SEALED * len(e0))
    y1, y0 = (np.column_stack([c[o] for o in setup.outputs])[first:] for c in (hidden, bare))
    vaf1, vaf0 = (100 * (1 - e[first:].var(axis=0) / y.var(axis=0)) for e, y in ((e1, y1), (e0, y0)))
    moved = float(np.max(np.abs(vaf1 - vaf0)))
    if random:
        root = cholesky(np.cov(e0[SETTLE:].T).reshape(e0.shape[1], -1), lower=True)
        white1, white0 = (solve_triangular(root, e.T, lower=True).T for e in (e1, e0))
        return Worth(max(0.0, _foretold(white1) - _foretold(white0)), moved, float(vaf1.min()))
    noise = e0 if recorded is None else predictor.innovations(recorded)
    whiten = Whitening(noise[SETTLE:], in_time=setup.chain is not NONE)  # without a chain innovations are white
    d = whiten(e1 - e0)
    rows = _imitations(predictor, hidden, whiten, e1, loose)
    fit = slice(SETTLE, first)
    flat = [r[fit].ravel() for r in rows]
    weights = lstsq(np.column_stack(flat), d[fit].ravel(), rcond=1e-10)
    rest = d - np.tensordot(weights, np.array(rows), axes=1)
    return Worth(float(0.5 * np.sum(rest[first:] ** 2)), moved, float(vaf1.min()))


class Whitening:
    """Whiten in time and over the outputs, as the noise e (N, l) asks for: its autoregression of PAST samples.

    in_time: False where e is white in time.
    """

    def __init__(self, e: Array, *, in_time: bool = True) -> None:
        self.theta: Array = np.zeros((PAST * e.shape[1], e.shape[1]))
        if in_time:
            self.theta = lstsq(_past(e), e[PAST:], rcond=1e-10)
        left = e[PAST:] - _past(e) @ self.theta if in_time else e
        self.root = cholesky(np.cov(left.T).reshape(e.shape[1], -1), lower=True)

    def __call__(self, d: Array) -> Array:
        """Return d (N, l) so that it counts in deviations of the noise; nothing is known before its first sample."""
        left = d - _past(np.vstack([np.zeros((PAST, d.shape[1])), d])) @ self.theta
        return np.asarray(solve_triangular(self.root, left.T, lower=True).T)


def _past(e: Array) -> Array:
    """Return the PAST samples before each sample of e (N, l) but the first PAST, the last first (N − PAST, PAST·l)."""
    return np.hstack([e[PAST - 1 - j : len(e) - 1 - j] for j in range(PAST)])


def _imitations(
    predictor: Predictor, columns: dict[str, Array], whiten: Whitening, e: Array, loose: bool
) -> list[Array]:  # fmt: skip
    """Return how the whitened innovations move with each free value, input gain and output offset."""
    setup, rows = predictor.setup, []
    for field in setup.plant.free:
        value = getattr(setup.base, field)
        if value and not (setup.declared.get("held") and field[:2] in ("q_", "t_")):
            moved = predictor.innovations(columns, setup.base._replace(**{field: 1.01 * value}))
            rows.append(moved - e)
    if loose:
        rows += [predictor.innovations(columns, gain=i) - e for i in range(len(setup.plant.inputs))]
        rows += [np.eye(e.shape[1])[i] * np.std(e[:, i]) * np.ones((len(e), 1)) for i in range(e.shape[1])]
    white = [whiten(r) for r in rows]
    return [w / max(float(np.sqrt(np.mean(w**2))), 1e-300) for w in white]


def _foretold(e: Array) -> float:
    """Return the nats that a linear prediction of e from its last samples, found on the fit part, gains when sealed."""
    first, past = int(SEALED * len(e)), _past(e)
    now, cut = e[PAST:], first - PAST
    ridge = 1e-3 * cut * np.eye(past.shape[1])
    theta = np.linalg.solve(past[:cut].T @ past[:cut] + ridge, past[:cut].T @ now[:cut])
    left = now[cut:] - past[cut:] @ theta
    before, after = (np.linalg.slogdet(x.T @ x / len(x))[1] for x in (now[cut:], left))
    return float(0.5 * len(left) * (before - after))
