"""Compile a model's equations; run them free and as a one-step predictor."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.models import expressions as ex
from aeolid.models.equations import STEP, Equations
from aeolid.models.input_filters import KINDS

Array = NDArray[np.float64]
_MAX_SUBSTEPS = 200  # beyond that the model is stiff and the equations, not the sampling, need a look


@dataclass(frozen=True, eq=False)
class Compiled:
    """Hold the machine code of a model: predict(U, Y, θ, K, x0, step, substeps, stride, generate) → e, ŷ, x."""

    model: Equations
    predict: Callable[..., tuple[Array, Array, Array]]
    slope: Callable[..., None]  # slope(x, u, θ, out): dx/dt, or the next state in discrete time
    read: Callable[..., None]  # read(x, u, θ, y, s): outputs and the sign of action of each sensor
    renew: Callable[..., None]  # renew(x, u, θ, step): the memories at the end of x, in place; NaN starts settled

    def settled(self, x: Array, u: Array, theta: Array, step: float = 1.0) -> Array:
        """Return x (n,) or (n + memories,) with the memories settled for it."""
        n = len(self.model.states)
        result = np.concatenate([x[:n], np.full(len(self.model.memories), np.nan)])
        if self.model.memories:
            self.renew(result, u, theta, step)
        return result


def compile_equations(model: Equations) -> Compiled:
    """Generate and compile the model (about half a second)."""
    model = model.pruned()
    variables = {s.name: f"x[{i}]" for i, s in enumerate(model.states)}
    variables |= {s: f"u[{i}]" for i, s in enumerate(model.symbols)}
    variables |= {p.name: f"th[{i}]" for i, p in enumerate(model.parameters)}
    variables |= {m.name: f"x[{len(model.states) + i}]" for i, m in enumerate(model.memories)}
    variables |= {a.name: f"v{i}" for i, a in enumerate(model.auxiliaries)} | {STEP: "dt"}
    lines = [
        "def flow(x, u, th, d):",
        "    pass",
        *_intermediates(model, variables, [s.derivative for s in model.states]),
    ]
    lines += [f"    d[{i}] = {ex.to_source(s.derivative, variables)}" for i, s in enumerate(model.states)]
    lines += [
        "def read(x, u, th, y, s):",
        "    pass",
        *_intermediates(model, variables, [o.equation for o in model.outputs]),
    ]
    for i, o in enumerate(model.outputs):
        lines.append(f"    y[{i}] = {ex.to_source(o.equation, variables)}")
        lines.append(f"    s[{i}] = {'1.0' if o.slope is None else ex.to_source(o.slope, variables)}")
    lines += ["def renew(x, u, th, dt):", "    pass", *_renewals(model, variables)]
    space: dict[str, Any] = {"np": np}
    exec("\n".join(lines), space)
    flow, read, renew = (njit(error_model="numpy")(space[n]) for n in ("flow", "read", "renew"))
    make = _make_discrete if model.sample_time_s > 0 else _make_continuous
    return Compiled(model, make(flow, read, renew), flow, read, renew)


def _renewals(model: Equations, variables: dict[str, str]) -> list[str]:
    """Write the renewal of the memories: all settle first, then each is renewed; later ones see its new value."""
    trees = [tree for m in model.memories for tree in (m.next, m.settled)]
    lines = _intermediates(model, variables, trees)
    for m in model.memories:
        at = variables[m.name]
        lines += [f"    if {at} != {at}:", f"        {at} = {ex.to_source(m.settled, variables)}"]
    lines += [f"    {variables[m.name]} = {ex.to_source(m.next, variables)}" for m in model.memories]
    return lines


def _intermediates(model: Equations, variables: dict[str, str], roots: list[ast.expr]) -> list[str]:
    """Write the assignments of the intermediates that these equations need."""
    used = set().union(*(ex.names_in(r) for r in roots)) if roots else set()
    lines: list[str] = []
    for a in reversed(model.auxiliaries):
        if a.name in used:
            used |= ex.names_in(a.equation)
            lines.insert(0, f"    {variables[a.name]} = {ex.to_source(a.equation, variables)}")
    return lines


def simulate(compiled: Compiled, u: Array, theta: Array, x0: Array, step: float) -> Array:
    """Run free: inputs u (N, r) held over each step of `step` seconds; returns y (N, l).

    Raises DataError where the model leaves the finite numbers, naming the sample.
    """
    _check_step(compiled.model, step)
    filtered = apply_filters(compiled.model, u, theta, step)
    blank = np.full((len(u), len(compiled.model.outputs)), np.nan)
    gain = np.zeros((len(compiled.model.states), blank.shape[1]))
    count = substeps(compiled, u, theta, x0, step)
    y: Array = compiled.predict(filtered, blank, theta, gain, x0, step, count, 1, False)[1]
    if not np.all(np.isfinite(y)):
        first = int(np.argwhere(~np.isfinite(y))[0][0])
        raise DataError(f"model {compiled.model.name!r}: the free run leaves the finite numbers at sample {first}")
    return y


def substeps(compiled: Compiled, u: Array, theta: Array, x0: Array, step: float) -> int:
    """Return how many Runge–Kutta steps a sample needs: fastest eigenvalue times step at most 0.5.

    0.5 keeps the local error of the fourth-order rule below 3e-4 of the fastest mode (step^5/120). Looked at where the
    run starts and, because dry friction is steepest there, at rest: otherwise two stretches of one recording, one that
    starts at rest and one in motion, would be integrated as two different models.
    """
    if compiled.model.sample_time_s > 0 or not len(x0):
        return 1
    middle = np.median(u, axis=0) if len(u) else np.zeros(u.shape[1])
    places = [x0] if np.array_equal(rest := _at_rest(compiled.model, x0), x0, equal_nan=True) else [x0, rest]
    jacobians = [numeric_jacobian(compiled, x, middle, theta) for x in places]
    if not all(np.all(np.isfinite(j)) for j in jacobians):
        return 4
    fastest = max(float(np.max(np.abs(np.linalg.eigvals(j)), initial=0.0)) for j in jacobians)
    return int(min(_MAX_SUBSTEPS, max(1, math.ceil(fastest * step / 0.5))))


def _at_rest(model: Equations, x: Array) -> Array:
    """Return x with every velocity zero: a state v where some dq/dt = v."""
    rates = {s.derivative.id for s in model.states if isinstance(s.derivative, ast.Name)}
    result = x.copy()
    result[[i for i, s in enumerate(model.states) if s.name in rates]] = 0.0
    return result


def numeric_jacobian(compiled: Compiled, x: Array, u: Array, theta: Array) -> Array:
    """Return ∂f/∂x (n, n) by central differences, steps 1e-6 of each state's size; memories settled."""
    n = len(compiled.model.states)
    x = compiled.settled(x, u, theta)
    result = np.empty((n, n))
    up, down = np.empty(n), np.empty(n)
    for i in range(n):
        h = 1e-6 * max(1.0, abs(x[i]))
        shifted = x.copy()
        shifted[i] += h
        compiled.slope(shifted, u, theta, up)
        shifted[i] -= 2 * h
        compiled.slope(shifted, u, theta, down)
        result[:, i] = (up - down) / (2 * h)
    return result


def output_jacobian(compiled: Compiled, x: Array, u: Array, theta: Array, step: float = 1.0) -> Array:
    """Return s ∂h/∂x (l, n) by central differences through settled memories, s undoing a folding sensor."""
    m, n = len(compiled.model.outputs), len(compiled.model.states)
    x = compiled.settled(x, u, theta, step)
    result = np.empty((m, n))
    up, down, s = np.empty(m), np.empty(m), np.empty(m)
    for i in range(n):
        h = 1e-6 * max(1.0, abs(x[i]))
        for sign, out in ((1.0, up), (-1.0, down)):
            shifted = x.copy()
            shifted[i] += sign * h
            compiled.renew(shifted, u, theta, step)
            compiled.read(shifted, u, theta, out, s)
        result[:, i] = s * (up - down) / (2 * h)
    return result


def apply_filters(model: Equations, u: Array, theta: Array, step: float) -> Array:
    """Pass the recorded inputs (N, r) through what lies in front of the plant, in the order of the model's filters."""
    if not model.filters:
        return np.ascontiguousarray(u)
    result = np.array(u, dtype=float)
    names = [s.name for s in model.inputs]
    for f in model.filters:
        column = names.index(f.channel)
        values = np.array([theta[model.index(p)] for p in f.parameters])
        result[:, column] = KINDS[f.kind].rule(np.ascontiguousarray(result[:, column]), values, step)
    return result


def _check_step(model: Equations, step: float) -> None:
    if model.sample_time_s and abs(step - model.sample_time_s) > 1e-6 * model.sample_time_s:
        raise DataError(
            f"model {model.name!r} has a sample time of {model.sample_time_s:g} s, the recording {step:g} s;"
            " resample the recording"
        )


def _make_continuous(flow: Any, read: Any, renew: Any) -> Callable[..., tuple[Array, Array, Array]]:
    """Build the predictor of a continuous-time model: classical Runge–Kutta steps between corrections.

    e_k = y_k − h(x_k, u_k), then x runs on to the next row and K s e_k is added; a missing y corrects nothing.
    Y has one row for every `stride` rows of U: the model runs at the inputs' rate, the outputs correct it at theirs.
    s is the slope of a folding sensor. With `generate` Y holds innovations and the states follow from them.
    Returns innovations (N, l), predictions (N, l), states (N + 1, n).
    """

    @njit(error_model="numpy", nogil=True)
    def predict(
        U: Array, Y: Array, th: Array, K: Array, x0: Array, step: float, count: int, stride: int, generate: bool
    ) -> Any:
        N, n, m = len(Y), len(K), Y.shape[1]
        E, P, X = np.empty((N, m)), np.empty((N, m)), np.empty((N + 1, len(x0)))
        x, s = x0.copy(), np.empty(m)
        k1, k2, k3, k4, mid = np.empty(n), np.empty(n), np.empty(n), np.empty(n), x0.copy()
        h = step / count
        for k in range(N):
            X[k] = x
            renew(x, U[k * stride], th, step * stride)
            read(x, U[k * stride], th, P[k], s)
            mid[:] = x
            for part in range(stride * count):
                u = U[k * stride + part // count]
                flow(x, u, th, k1)
                for i in range(n):
                    mid[i] = x[i] + 0.5 * h * k1[i]
                flow(mid, u, th, k2)
                for i in range(n):
                    mid[i] = x[i] + 0.5 * h * k2[i]
                flow(mid, u, th, k3)
                for i in range(n):
                    mid[i] = x[i] + h * k3[i]
                flow(mid, u, th, k4)
                for i in range(n):
                    x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
            _correct(x, Y[k], P[k], E[k], K, s, generate)
        X[N] = x
        return E, P, X

    return predict


def _make_discrete(flow: Any, read: Any, renew: Any) -> Callable[..., tuple[Array, Array, Array]]:
    """Build the predictor of a discrete-time model; arguments and results as for a continuous one."""

    @njit(error_model="numpy", nogil=True)
    def predict(
        U: Array, Y: Array, th: Array, K: Array, x0: Array, step: float, count: int, stride: int, generate: bool
    ) -> Any:
        N, n, m = len(Y), len(K), Y.shape[1]
        E, P, X = np.empty((N, m)), np.empty((N, m)), np.empty((N + 1, len(x0)))
        x, after, s = x0.copy(), np.empty(n), np.empty(m)
        for k in range(N):
            X[k] = x
            renew(x, U[k * stride], th, step * stride)
            read(x, U[k * stride], th, P[k], s)
            for part in range(stride):
                flow(x, U[k * stride + part], th, after)
                for i in range(n):
                    x[i] = after[i]
            _correct(x, Y[k], P[k], E[k], K, s, generate)
        X[N] = x
        return E, P, X

    return predict


@njit(error_model="numpy", nogil=True)
def _correct(x: Array, y: Array, p: Array, e: Array, K: Array, s: Array, generate: bool) -> None:
    for j in range(len(y)):
        e[j] = y[j] if generate else y[j] - p[j]
        if e[j] == e[j]:  # a missing output is NaN and corrects nothing
            for i in range(len(K)):
                x[i] += K[i, j] * s[j] * e[j]
