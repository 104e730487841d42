"""Run translated models through a recording: one after another, or several parameter sets side by side."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

from aeolid.compiled import intrinsic, njit, types

Array = NDArray[np.float64]
_WORD = 8  # bytes a double


def _pointers(count: int, last_is_number: bool) -> Any:
    """Return a numba function call(address, p1 …) for machine code that takes pointers (and a last number)."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kinds = [ir.IntType(64)] * (count - last_is_number) + [ir.DoubleType()] * last_is_number
        kind = ir.FunctionType(ir.VoidType(), kinds)
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), list(args[1:]))
        return context.get_dummy_value()

    return generate


def _four(typing: Any, address: Any, x: Any, u: Any, th: Any, d: Any) -> Any:
    return types.void(*[types.int64] * 5), _pointers(4, False)


def _five(typing: Any, address: Any, x: Any, u: Any, th: Any, y: Any, s: Any) -> Any:
    return types.void(*[types.int64] * 6), _pointers(5, False)


def _six(typing: Any, address: Any, x: Any, z: Any, y: Any, e: Any, K: Any, s: Any) -> Any:
    return types.void(*[types.int64] * 7), _pointers(6, False)


def _three_and_number(typing: Any, address: Any, x: Any, u: Any, th: Any, step: Any) -> Any:
    return types.void(*[types.int64] * 4, types.float64), _pointers(4, True)


_call4: Any = intrinsic(_four)
_call5: Any = intrinsic(_five)
_call6: Any = intrinsic(_six)
_renew4: Any = intrinsic(_three_and_number)


@njit(cache=True, error_model="numpy", nogil=True)
def _at(U: Array, row: int, ramp: int, share: float, now: Array) -> int:
    """Return where the inputs at a share of a row, 0 … 1, lie: in U where none changes, else written into `now`."""
    if not ramp:
        return U.ctypes.data + _WORD * U.shape[1] * row  # type: ignore[no-any-return]
    for i in range(len(now)):
        now[i] = U[row, i] + (share - 0.5) * U[row, ramp + i]
    return now.ctypes.data


@njit(cache=True, error_model="numpy", nogil=True)
def _advance(
    flow: int, U: Array, row: int, ramp: int, h: float, count: int, th: int, x: Array, mid: Array, slopes: Array,
    now: Array,
) -> None:  # fmt: skip
    """Carry x on over a row by `count` classical Runge–Kutta steps of h; mid as x, slopes (4, n): room to work."""
    k1, k2, k3, k4, n = slopes[0], slopes[1], slopes[2], slopes[3], slopes.shape[1]
    at, at_mid = x.ctypes.data, mid.ctypes.data
    for part in range(count):
        _call4(flow, at, _at(U, row, ramp, part / count, now), th, k1.ctypes.data)
        for i in range(n):
            mid[i] = x[i] + 0.5 * h * k1[i]
        middle = _at(U, row, ramp, (part + 0.5) / count, now)
        _call4(flow, at_mid, middle, th, k2.ctypes.data)
        for i in range(n):
            mid[i] = x[i] + 0.5 * h * k2[i]
        _call4(flow, at_mid, middle, th, k3.ctypes.data)
        for i in range(n):
            mid[i] = x[i] + h * k3[i]
        _call4(flow, at_mid, _at(U, row, ramp, (part + 1.0) / count, now), th, k4.ctypes.data)
        for i in range(n):
            x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])


@njit(cache=True, error_model="numpy", nogil=True)
def _add_ramps(ramped: Array, U: Array, row: int, ramp: int, x: Array) -> None:
    """Add to x what the changes of the inputs within a row have moved, ramped (n, r, lanes)."""
    n, inputs, lanes = ramped.shape
    for j in range(inputs):
        change = U[row, ramp + j]
        if change != 0.0:
            for i in range(n):
                for p in range(lanes):
                    x[i * lanes + p] += ramped[i, j, p] * change


@njit(cache=True, error_model="numpy", nogil=True)
def march(
    code: tuple[int, int, int, int], lanes: int, discrete: bool, U: Array, Y: Array, th: Array, K: Array, x0: Array,
    parts: tuple[int, int], ramped: Array, step: float, count: int, stride: int, generate: bool, whole: bool,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Predict through a recording: e_k = y_k − h(x_k, u_k), then x runs on to the next row and K s e_k is added.

    U (N · stride, r) and Y (N, l) are the same for all lanes; of parts (seen, ramp) outputs read U from column `seen`
    on, and from `ramp` on (0: nowhere) stands by how much each input changes within a row about its mean. th
    (np, lanes), K (n, l, lanes), x0 (n + memories, lanes); ramped (n, r, lanes): what such a change adds to the states
    of a discrete model, r of 0 for nothing. The model runs at the inputs' rate, `count` classical
    Runge–Kutta steps a row of U (or one step of a discrete model), the outputs correct it at theirs; a missing y (NaN)
    corrects nothing. s is the slope of a folding sensor. With `generate` Y holds innovations and the states follow from
    them. All arrays C-contiguous.
    Returns innovations (N, l · lanes), predictions (N, l · lanes), states (N + 1, (n + memories) · lanes); of the last
    two only the last row unless `whole`: megabytes that several lanes would write for nobody.
    """
    flow, read, renew, correct = code
    N, m, n = len(Y), Y.shape[1], K.shape[0] * lanes
    rows = N if whole else 1
    E, P, X = np.empty((N, m * lanes)), np.empty((rows, m * lanes)), np.empty((rows + whole, x0.size))
    x, s, nothing = x0.copy().ravel(), np.empty(m * lanes), np.zeros(m * lanes)
    mid, slopes, (seen, ramp) = x.copy(), np.empty((4, n)), parts
    now = np.empty(U.shape[1] - ramp if ramp else 0)
    at, at_s, thetas, at_nothing = x.ctypes.data, s.ctypes.data, th.ctypes.data, nothing.ctypes.data
    width, h = _WORD * m * lanes, step / count
    for k in range(N):
        row = k if whole else 0
        if whole:
            X[k] = x
        u = U.ctypes.data + _WORD * U.shape[1] * k * stride
        _renew4(renew, at, u + _WORD * seen, thetas, step * stride)
        _call5(read, at, u + _WORD * seen, thetas, P.ctypes.data + width * row, at_s)
        if discrete:
            for part in range(stride):
                _call4(flow, at, u + _WORD * U.shape[1] * part, thetas, at)
                _add_ramps(ramped, U, k * stride + part, ramp, x)
        else:
            mid[:] = x
            for part in range(stride):
                _advance(flow, U, k * stride + part, ramp, h, count, thetas, x, mid, slopes, now)
        y = at_nothing if generate else P.ctypes.data + width * row
        _call6(correct, at, Y.ctypes.data + _WORD * m * k, y, E.ctypes.data + width * k, K.ctypes.data, at_s)
    X[-1] = x
    s[:] = nothing  # used to the last: numba frees an array after the last line that names it
    return E, P, X


@njit(cache=True, error_model="numpy")
def slope(flow: int, x: Array, u: Array, th: Array, out: Array) -> None:
    """Write dx/dt (or the next state in discrete time) of one lane into `out` (n,)."""
    _call4(flow, x.ctypes.data, u.ctypes.data, th.ctypes.data, out.ctypes.data)


@njit(cache=True, error_model="numpy")
def outputs(read: int, x: Array, u: Array, th: Array, out: Array, s: Array) -> None:
    """Write outputs and the sign of action of each sensor of one lane into `out` and `s` (l,)."""
    _call5(read, x.ctypes.data, u.ctypes.data, th.ctypes.data, out.ctypes.data, s.ctypes.data)


@njit(cache=True, error_model="numpy")
def settle(renew: int, x: Array, u: Array, th: Array, step: float) -> None:
    """Renew the memories at the end of x (n + memories,) of one lane, in place; NaN starts settled."""
    _renew4(renew, x.ctypes.data, u.ctypes.data, th.ctypes.data, step)


@njit(cache=True, error_model="numpy")
def state_jacobian(flow: int, n: int, x: Array, u: Array, th: Array) -> Array:
    """Return ∂f/∂x (n, n) by central differences, steps 1e-6 of each state's size; x (n + memories,) settled."""
    result, up, down = np.empty((n, n)), np.empty(n), np.empty(n)
    moved = x.copy()
    for i in range(n):
        h = 1e-6 * max(1.0, abs(x[i]))
        moved[i] = x[i] + h
        slope(flow, moved, u, th, up)
        moved[i] = x[i] - h
        slope(flow, moved, u, th, down)
        moved[i] = x[i]
        result[:, i] = (up - down) / (2 * h)
    return result


@njit(cache=True, error_model="numpy")
def input_jacobian(flow: int, n: int, x: Array, u: Array, th: Array) -> Array:
    """Return ∂f/∂u (n, r) by central differences, steps 1e-6 of each input's size; x (n + memories,) settled."""
    result, up, down, moved = np.empty((n, len(u))), np.empty(n), np.empty(n), u.copy()
    for j in range(len(u)):
        h = 1e-6 * max(1.0, abs(u[j]))
        moved[j] = u[j] + h
        slope(flow, x, moved, th, up)
        moved[j] = u[j] - h
        slope(flow, x, moved, th, down)
        moved[j] = u[j]
        result[:, j] = (up - down) / (2 * h)
    return result


@njit(cache=True, error_model="numpy")
def eigenvalues_at_most(J: Array) -> float:
    """Return what no eigenvalue of J (n, n) exceeds, ‖J⁴‖^(1/4) in Frobenius' norm; not finite where it overflows."""
    n = len(J)
    for _ in range(2):
        square = np.zeros((n, n))
        for i in range(n):
            for k in range(n):
                for j in range(n):
                    square[i, j] += J[i, k] * J[k, j]
        J = square
    total = 0.0
    for i in range(n):
        for j in range(n):
            total += J[i, j] * J[i, j]
    return math.sqrt(math.sqrt(math.sqrt(total)))


@njit(cache=True, error_model="numpy")
def fastest_at_most(flow: int, n: int, X: Array, u: Array, th: Array) -> float:
    """Return what no eigenvalue of ∂f/∂x exceeds at any row of X (places, n + memories), memories settled.

    At a fraction of the eigenvalues' cost; not finite where a Jacobian or its fourth power is not.
    """
    bound = 0.0
    for place in range(len(X)):
        own = eigenvalues_at_most(state_jacobian(flow, n, X[place], u, th))
        if not math.isfinite(own):
            return own
        bound = max(bound, own)
    return bound


@njit(cache=True, error_model="numpy")
def reading_jacobian(
    read: int, renew: int, sizes: tuple[int, int], x: Array, u: Array, th: Array, step: float
) -> Array:
    """Return s ∂h/∂x (l, n), sizes (n, l), by central differences through settled memories x (n + memories,)."""
    n, m = sizes
    result, up, down, s = np.empty((m, n)), np.empty(m), np.empty(m), np.empty(m)
    for i in range(n):
        h = 1e-6 * max(1.0, abs(x[i]))
        for side in range(2):
            moved = x.copy()
            moved[i] += h if side == 0 else -h
            settle(renew, moved, u, th, step)
            outputs(read, moved, u, th, up if side == 0 else down, s)
        result[:, i] = s * (up - down) / (2 * h)
    return result
