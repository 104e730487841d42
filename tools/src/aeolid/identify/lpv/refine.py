"""Refine a scheduled model by its prediction errors, and say how far its poles can be trusted.

Gauss–Newton steps with Levenberg's damping on log det Σ e eᵀ, the likelihood of white Gaussian innovations, from the
subspace estimate. With θ_s = [A⁽ⁱ⁾ B⁽ⁱ⁾ K⁽ⁱ⁾ b⁽ⁱ⁾] and θ_o = [C D c] the predictor is x⁺ = θ_s φ(x, u, e),
e = y − θ_o ψ(x, u), and its derivatives follow from

    ∂e = −C ∂x − ψᵀ ⊗ I ∂θ_o,     ∂x⁺ = A ∂x + K ∂e + φᵀ ⊗ I ∂θ_s.

A change of the state's basis leaves the errors as they are: those n² directions have no derivative, and the damped step
does not take them. Only matrices that are free are moved: what does not depend on the scheduling stays so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.identify import descent
from aeolid.identify.lpv.data import LpvData, spread
from aeolid.identify.lpv.matrices import RESOLVED, ScaledLpv, prediction_loss, run_stretches
from aeolid.identify.lpv.structure import Structure
from aeolid.identify.split import FIT_PART
from aeolid.identify.windows import triangularise

Array = NDArray[np.float64]
LONGEST = 20_000  # windows that refine; more change little and cost in proportion
MOST_STEPS = 60  # to the end of the descent, where deviations hold
NATS = 0.02  # of log-likelihood: a step that gains less moves no number by more than a fifth of its deviation
FLOOR = 1e-6  # smallest eigenvalue of the innovation covariance relative to the largest, when weighing


@dataclass(frozen=True)
class Layout:
    """Say which numbers of a model are free: how many blocks each of A, B, K, C, D has (m, 1 or 0)."""

    structure: Structure
    order: int
    gain_blocks: int

    def blocks(self, name: str) -> int:
        """Return m for a matrix that depends on the scheduling, 1 for a constant one; K as the gain was chosen."""
        if name == "K":
            return self.gain_blocks
        return self.structure.parameters if name in self.structure.varying else 1

    @property
    def free(self) -> int:
        """Return the number of free numbers, those that change the basis of the state alone left out."""
        s, n = self.structure, self.order
        state = n * self.blocks("A") + s.inputs * self.blocks("B") + s.outputs * self.blocks("K")
        output = n * self.blocks("C") + sum(s.feedthrough) * self.blocks("D")
        constants = (n * s.parameters + s.outputs) * s.constant
        return n * state + s.outputs * output + constants - n**2

    def phi(self, mu: Array, x: Array, u: Array, e: Array) -> Array:
        """Return the regressors (N, ·) of the state equation."""
        parts = [spread(mu[:, : self.blocks(n)], v) for n, v in (("A", x), ("B", u), ("K", e)) if self.blocks(n)]
        return np.hstack([*parts, mu] if self.structure.constant else parts)

    def psi(self, mu: Array, x: Array, u: Array) -> Array:
        """Return the regressors (N, ·) of the output equation."""
        through = u[:, np.array(self.structure.feedthrough, dtype=bool)]
        parts = [spread(mu[:, : self.blocks("C")], x), spread(mu[:, : self.blocks("D")], through)]
        return np.hstack([*parts, np.ones((len(x), 1))] if self.structure.constant else parts)

    def pack(self, model: ScaledLpv) -> tuple[Array, Array]:
        """Return θ_s (n, ·) and θ_o (l, ·)."""
        state = [model_part(getattr(model, n), self.blocks(n)) for n in ("A", "B", "K")]
        through = np.flatnonzero(self.structure.feedthrough)
        output = [model_part(model.C, self.blocks("C")), model_part(model.D[:, :, through], self.blocks("D"))]
        if self.structure.constant:
            state.append(model.b.T)
            output.append(model.c[:, None])
        return np.hstack(state), np.hstack(output)

    def unpack(self, theta_s: Array, theta_o: Array, model: ScaledLpv) -> ScaledLpv:
        """Return the model with these numbers."""
        found, place = {}, 0
        for name in ("A", "B", "K"):
            found[name], place = self._stack(theta_s, place, getattr(model, name), self.blocks(name))
        b = theta_s[:, place:].T if self.structure.constant else model.b
        C, place = self._stack(theta_o, 0, model.C, self.blocks("C"))
        through, D = np.flatnonzero(self.structure.feedthrough), model.D.copy()
        D[:, :, through], place = self._stack(theta_o, place, model.D[:, :, through], self.blocks("D"))
        c = theta_o[:, place] if self.structure.constant else model.c
        return ScaledLpv(found["A"], found["B"], C, D, found["K"], b, c)

    @staticmethod
    def _stack(theta: Array, place: int, like: Array, blocks: int) -> tuple[Array, int]:
        out, width = np.zeros_like(like), like.shape[2]
        for i in range(blocks):
            out[i] = theta[:, place + i * width : place + (i + 1) * width]
        return out, place + blocks * width


def model_part(stack: Array, blocks: int) -> Array:
    """Return the first matrices of a stack (m, a, b) side by side, (a, blocks b)."""
    return np.hstack([np.zeros((stack.shape[1], 0)), *stack[:blocks]])


@dataclass(frozen=True, eq=False)
class Refinement:
    """Hold a refined model, the steps taken, their gain in error power, 0 … 1, and the covariance of its A.

    covariance: of the entries of [A⁽¹⁾ A⁽²⁾ …], row by row, in scaled units; None where the data are exact. further: a
    step of these entries as Gauss and Newton would take next, whose square the covariance holds: nothing at the end
    of the descent.
    """

    model: ScaledLpv
    steps: int
    gain: float
    covariance: Array | None
    further: Array | None

    def to_json(self) -> dict[str, float]:
        """Return the facts for JSON."""
        return {"steps": self.steps, "error_power_lower_by": self.gain}


@dataclass(frozen=True, eq=False)
class Trial:
    """Hold how the steps from a model of the first 70 % of each recording predict the rest.

    loss: the least log error power of the rest; steps: after which it is least, None where all steps cost no more than
    estimating so many numbers does.
    """

    loss: float
    steps: int | None


def try_steps(data: LpvData, structure: Structure, head: ScaledLpv) -> Trial:
    """Take the steps on the first 70 % of each recording and predict the rest; data: all windows, see `shortened`.

    head: model of that part. Estimating q numbers by N errors adds q/N to the log power of others, and fewer steps than
    all spare part of that at the cost of an estimate that is biased by its start.
    """
    early = data.place < FIT_PART
    fitted, layout = data.take(early), layout_of(structure, head)
    losses = [prediction_loss(m, data, ~early) for m in descend(fitted, layout, head, descent.MOST_STEPS)]
    best = int(np.argmin(losses))
    price = layout.free / (fitted.windows * structure.outputs)
    return Trial(losses[best], None if losses[-1] <= losses[best] + price else best)


def refine(data: LpvData, structure: Structure, start: ScaledLpv, trial: Trial | None) -> Refinement:
    """Refine a model to the end of the descent, or as far as that predicts better what it was not refined on.

    trial: of the subspace model of the first 70 % of each recording alone, None where there is none; then all steps are
    taken. Where the rest is predicted best after fewer, none included, so many are taken from `start` on everything.
    """
    part, layout = data.take(shortened(data)), layout_of(structure, start)
    limit = MOST_STEPS if trial is None or trial.steps is None else trial.steps
    path = list(descend(part, layout, start, limit))
    model, before, after = path[-1], prediction_loss(start, part), prediction_loss(path[-1], part)
    gain = 1 - float(np.exp(after - before)) if np.isfinite(before) else 0.0
    return Refinement(model, len(path) - 1, gain, *entry_covariance(part, layout, model))


def shortened(data: LpvData) -> NDArray[np.bool_]:
    """Mark at most LONGEST windows (N,): the first of the fit part and of what is held out, in their proportion."""
    early = data.place < FIT_PART
    if data.windows <= LONGEST:
        return np.ones(data.windows, bool)
    return np.where(early, np.cumsum(early) <= FIT_PART * LONGEST, np.cumsum(~early) <= (1 - FIT_PART) * LONGEST)


def layout_of(structure: Structure, model: ScaledLpv) -> Layout:
    """Return the layout of a model whose gain was chosen before."""
    gain = 0 if not model.K.any() else structure.parameters if model.K[1:].any() else 1
    return Layout(structure, model.A.shape[1], gain)


def descend(data: LpvData, layout: Layout, start: ScaledLpv, steps: int) -> Iterator[ScaledLpv]:
    """Yield the start and the model after each step, until a step gains too little."""

    def move(model: ScaledLpv, delta: Array) -> ScaledLpv:
        theta_s, theta_o = layout.pack(model)
        moved_s = theta_s + delta[: theta_s.size].reshape(theta_s.shape)
        return layout.unpack(moved_s, theta_o + delta[theta_s.size :].reshape(theta_o.shape), model)

    return descent.descend(
        start,
        lambda model: prediction_loss(model, data, joint=True),
        lambda model: information_factor(data, layout, model),
        move,
        steps=steps,
        floor=float(np.log(RESOLVED)) + 1e-9,
        enough=min(descent.ENOUGH, 2 * NATS / (data.windows * layout.structure.outputs)),
    )


def information_factor(data: LpvData, layout: Layout, model: ScaledLpv) -> Array:
    """Return the triangular factor of the weighted [∂e/∂θ, e], (npar + 1, npar + 1).

    The first state of each stretch is a nuisance: its n columns are eliminated. The weight is the inverse root of the
    innovation covariance.
    """
    parts = [part[1:] for part in run_stretches(model, data)]
    e = np.concatenate([part[3] for part in parts])
    values, vectors = np.linalg.eigh(e.T @ e / len(e))
    weight = vectors / np.sqrt(np.maximum(values, FLOOR * values[-1]))
    R = None
    for mu, u, states, errors in parts:
        J = error_derivatives(layout, model, mu, u, states, errors)
        rows = np.concatenate([np.einsum("kij,il->klj", J, weight), (errors @ weight)[:, :, None]], axis=2)
        rows = triangularise(rows.reshape(-1, rows.shape[2]))[layout.order :, layout.order :]
        R = rows if R is None else triangularise(np.vstack([R, rows]))
    assert R is not None
    return triangularise(R)


def error_derivatives(layout: Layout, model: ScaledLpv, mu: Array, u: Array, states: Array, errors: Array) -> Array:
    """Return ∂e/∂(x_0, θ_s, θ_o) along one stretch, (N, l, n + npar); θ row by row."""
    phi, psi = layout.phi(mu, states, u, errors), layout.psi(mu, states, u)
    n, outputs = states.shape[1], errors.shape[1]
    first, second = n, n + n * phi.shape[1]
    width = second + outputs * psi.shape[1]
    A, C, K = (np.tensordot(mu, stack, axes=1) for stack in (model.A, model.C, model.K))
    out = np.empty((len(mu), outputs, width))
    dx = np.zeros((n, width))
    dx[:, :n] = np.eye(n)
    state_part = dx[:, first:second].reshape(n, n, phi.shape[1])
    diagonal, rows = np.arange(n), np.arange(outputs)
    for k in range(len(mu)):
        de = -C[k] @ dx
        de[:, second:].reshape(outputs, outputs, psi.shape[1])[rows, rows] -= psi[k]
        out[k] = de
        dx = A[k] @ dx + K[k] @ de
        state_part = dx[:, first:second].reshape(n, n, phi.shape[1])
        state_part[diagonal, diagonal] += phi[k]
        dx[:, first:second] = state_part.reshape(n, -1)
    return out


def entry_covariance(data: LpvData, layout: Layout, model: ScaledLpv) -> tuple[Array | None, Array | None]:
    """Return the covariance of the entries of A⁽ⁱ⁾, (n, blocks n) row by row, and their next step.

    From the inverse information, and the square of the step that Gauss and Newton would take next: at the end of the
    descent it is nothing, before it an error that the information knows nothing of. Singular by the freedom of basis:
    what does not depend on the basis, such as a pole, has the variance gᵀ cov g. None, None where the data are exact.
    """
    loss = prediction_loss(model, data)
    if not np.isfinite(loss) or loss <= np.log(RESOLVED) + 1e-9:
        return None, None
    R = information_factor(data, layout, model)
    if not descent.usable(R):
        return None, None
    size = R.shape[1] - 1
    free = size - layout.order**2  # the others change the basis only
    root = descent.covariance_root(R, free)
    spent = free / (data.windows * layout.structure.outputs)
    n, width = layout.order, layout.pack(model)[0].shape[1]
    entries = np.arange(n * width).reshape(n, width)[:, : n * layout.blocks("A")].ravel()
    further = -root[entries] @ (root.T @ (R[:size, :size].T @ R[:size, size]))
    return root[entries] @ root[entries].T / max(1 - spent, 0.1) + np.outer(further, further), further
