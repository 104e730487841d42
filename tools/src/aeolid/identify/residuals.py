"""Test whether the innovations of a predictor are white and free of the inputs' past."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.stats import chi2

Array = NDArray[np.float64]
LEVEL = 0.01  # chance that any of the tests alarms on an exact model
MATERIAL = 0.01  # part of an innovation's variance; below it a finding is true but does not matter
EXACT = 1e-6  # of an output's deviation; innovations below it are the rounding of files, whatever they follow
WHITENING_ORDER = 30  # of the autoregression that whitens an input before it is correlated


@dataclass(frozen=True)
class ResidualTest:
    """Hold one test: which innovation against which past signal.

    p_value is corrected for the number of tests (Holm); predictable is the part of the innovation's variance that the
    other signal's past explains beyond chance; verdict is "pass", "immaterial" (significant, but below 1 %, or of an
    innovation that is itself at rounding) or "fail".
    """

    output: str
    against: str
    kind: str
    statistic: float
    p_value: float
    predictable: float
    verdict: str

    def to_json(self) -> dict[str, Any]:
        """Return the test as JSON facts."""
        return dict(self.__dict__)


@dataclass(frozen=True)
class ResidualReport:
    """Hold all tests of one validation; level is the chance of any alarm on an exact model."""

    tests: tuple[ResidualTest, ...]
    lags: int
    level: float

    @property
    def verdict(self) -> str:
        """Return the worst verdict of all tests."""
        found = {t.verdict for t in self.tests}
        return "fail" if "fail" in found else "immaterial" if "immaterial" in found else "pass"

    def to_json(self) -> dict[str, Any]:
        """Return the report as JSON facts."""
        tests = [t.to_json() for t in self.tests]
        return {"verdict": self.verdict, "lags": self.lags, "level": self.level, "tests": tests}


def run_residual_tests(
    innovations: Array, u: Array, outputs: tuple[str, ...], inputs: tuple[str, ...], lags: int = 20,
    nrmse: Mapping[str, float] | None = None,
) -> ResidualReport:  # fmt: skip
    """Correlate each innovation with the past of all innovations and of all inputs.

    innovations (N, l), u (N, r) of one stretch; lags: 1 … 20 samples back. Only the past counts, so feedback from y to
    u is no alarm. Inputs are whitened by an autoregression first: the sum N Σ ρ² is then χ² with `lags` degrees of
    freedom whatever the input's spectrum. Level 1 % over all tests together (Holm). nrmse: rms of each innovation over
    its output's deviation, default: none is at rounding.
    """
    N = len(innovations)
    white = np.column_stack([whiten(u[:, j]) for j in range(u.shape[1])]) if u.shape[1] else np.zeros((N, 0))
    columns = [*innovations.T, *white.T]
    sources = {name: correlation(x, lags) for name, x in zip((*outputs, *inputs), columns, strict=True)}
    found = []
    for i, output in enumerate(outputs):
        for j, other in enumerate(outputs):
            rho = lagged_correlation(innovations[:, i], innovations[:, j], lags)
            found.append((output, other, "whiteness", rho))
        for j, name in enumerate(inputs):
            rho = lagged_correlation(innovations[:, i], white[:, j], lags)
            found.append((output, name, "input", rho))
    statistics = np.array([N * float(np.sum(rho**2)) for *_, rho in found])
    p_values = _holm(chi2.sf(statistics, lags))
    tests = []
    for (output, other, kind, rho), statistic, p in zip(found, statistics, p_values, strict=True):
        predictable = max(explained_share(rho, sources[other]) - lags / N, 0.0)
        material = predictable > MATERIAL and (nrmse is None or not nrmse[output] < EXACT)
        verdict = "pass" if p > LEVEL else "fail" if material else "immaterial"
        tests.append(ResidualTest(output, other, kind, float(statistic), float(p), predictable, verdict))
    return ResidualReport(tuple(tests), lags, LEVEL)


def lagged_correlation(x: Array, past: Array, lags: int) -> Array:
    """Return the correlation of x_k with past_{k−τ}, τ = 1 … lags, as (lags,)."""
    x, past = x - x.mean(), past - past.mean()
    size = float(np.sqrt((x @ x) * (past @ past))) or 1.0
    return np.array([x[t:] @ past[:-t] / size for t in range(1, lags + 1)])


def correlation(x: Array, lags: int) -> Array:
    """Return the autocorrelation of x (N,) at lags 0 … lags − 1, as (lags,)."""
    return np.concatenate([[1.0], lagged_correlation(x, x, lags - 1)])


def explained_share(rho: Array, own: Array) -> float:
    """Return the part of a variance, 0 … 1, that the past of a signal explains by linear regression.

    rho (lags,): correlations with past_{k−τ}; own (lags,): autocorrelation of the past signal at lags 0 … lags − 1.
    R² = ρᵀ T⁻¹ ρ, T the Toeplitz matrix of `own`: Σ ρ² of a signal that is not white counts the same variance several
    times over and is no share.
    """
    weights = np.linalg.lstsq(toeplitz(own), rho, rcond=1e-10)[0]
    return float(np.clip(rho @ weights, 0.0, 1.0))


def whiten(u: Array, order: int = WHITENING_ORDER) -> Array:
    """Return the prediction errors (N,) of an autoregression fitted to u; the first `order` samples are zero."""
    u = u - u.mean()
    order = min(order, len(u) // 10)
    if order == 0 or not u.any():
        return u
    rows = np.lib.stride_tricks.sliding_window_view(u[:-1], order)  # (N − order, order)
    target = u[order:]
    coefficients = np.linalg.lstsq(rows.T @ rows, rows.T @ target, rcond=1e-12)[0]
    return np.concatenate([np.zeros(order), target - rows @ coefficients])


def _holm(p: Array) -> Array:
    """Return the p-values corrected for their number: the family-wise error is at most the level."""
    order = np.argsort(p)
    count = len(p)
    corrected = np.maximum.accumulate(p[order] * (count - np.arange(count)))
    out = np.empty(count)
    out[order] = np.minimum(corrected, 1.0)
    return out
