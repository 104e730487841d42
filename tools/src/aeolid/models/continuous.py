"""Take a linear model from discrete to continuous time, or to another sample time: the inverse of `load.discretise`.

Held inputs: exp(h [A B; 0 0]) = [Φ Γ; 0 I], so that A and B are a matrix logarithm. Straight ones (first-order
hold): Γ = (Φ₁ − Φ₂ + ΦΦ₂) B h, Φ₁ = ∫₀¹ exp(Ahs) ds, Φ₂ = ∫₀¹ (1 − s) exp(Ahs) ds, of which B is the solution
(Franklin, Powell and Workman 1998, section 6.3). There is such a model of the same order, and only one below
the Nyquist frequency, where no pole lies on the negative real axis or at 0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, logm

from aeolid.errors import UsageError
from aeolid.models.load import discretise
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
HOLDS = ("zoh", "foh")
_NONE = 1e-10  # of the largest pole: as far from 0, or from the negative real axis, rounding may take a pole


def to_continuous(model: StateSpace, hold: str = "zoh") -> StateSpace:
    """Return a discrete-time model in continuous time; at the samples it answers its inputs as the model does.

    hold: how inputs go on between samples, "zoh" (held) or "foh" (straight from one to the next). The Kalman gain and
    the covariance of the innovations, which belong to the samples, are dropped. Raises UsageError where the hold is
    another, or where a pole has no counterpart.
    """
    if hold not in HOLDS:
        raise UsageError(f"hold {hold!r}: is neither zoh (held) nor foh (straight from one sample to the next)")
    if model.sample_time_s == 0:
        return model
    _check_poles(model)
    h = model.sample_time_s
    A = _real_logarithm(model.A) / h
    first, second = _integrals(A * h)
    if hold == "zoh":
        B, D = np.linalg.solve(first * h, model.B), model.D
    else:
        B = np.linalg.solve((first - second + model.A @ second) * h, model.B)
        D = model.D - model.C @ second @ B * h
    found = replace(model, A=A, B=np.asarray(B, dtype=np.float64), D=D, sample_time_s=0.0)
    return replace(found, K=None, innovation_covariance=None)


def to_sample_time(model: StateSpace, sample_time_s: float, hold: str = "zoh") -> StateSpace:
    """Return a model with another sample time in seconds, by way of continuous time; as it is where that is its own.

    hold: as in `to_continuous`, on both ways. Raises UsageError on a time that is none.
    """
    if not 0 < sample_time_s < 1e6:
        raise UsageError(f"sample time {sample_time_s:g}: is not a time in seconds above 0")
    if abs(model.sample_time_s - sample_time_s) <= 1e-9 * sample_time_s:
        return model
    return discretise(to_continuous(model, hold), sample_time_s, [hold] * len(model.inputs))


def _check_poles(model: StateSpace) -> None:
    """Raise UsageError that names a pole without a counterpart in continuous time."""
    poles = np.linalg.eigvals(model.A)
    size = max(float(np.max(np.abs(poles), initial=0.0)), 1.0)
    for pole in poles[np.argsort(np.abs(poles))]:
        if abs(pole) <= _NONE * size:
            raise UsageError(
                "a pole at 0, as a delay of whole samples makes it, has no counterpart in continuous time; identify the"
                " model with its delay as an input filter, or with a lower order"
            )
        if pole.real < 0 and abs(pole.imag) <= _NONE * size:
            raise UsageError(
                f"a pole at {pole.real:.4g}, which swings from one sample to the next, has no counterpart in continuous"
                " time; identify with a lower order, or sample faster"
            )


def _real_logarithm(A: Array) -> Array:
    found = np.asarray(logm(A))
    return np.ascontiguousarray(found.real, dtype=float)


def _integrals(X: Array) -> tuple[Array, Array]:
    """Return ∫₀¹ exp(Xs) ds and ∫₀¹ (1 − s) exp(Xs) ds, as blocks of one exponential (Van Loan 1978)."""
    n = len(X)
    block = np.zeros((3 * n, 3 * n))
    block[:n, :n] = X
    block[:n, n : 2 * n] = block[n : 2 * n, 2 * n :] = np.eye(n)
    found = expm(block)
    return found[:n, n : 2 * n], found[:n, 2 * n :]
