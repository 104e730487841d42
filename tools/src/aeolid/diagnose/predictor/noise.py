"""Describe what the predictor leaves over: a vector autoregression and its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit

Array = NDArray[np.float64]
# BIC chooses the noise-model order among these. A physical noise model needs little colour on top; more would
# learn the very force that is missing (measured: order 8 halves the evidence for friction on the positioning stage).
_VAR_ORDERS = (0, 1, 2)
# Of a law without states, where no force with memory can stand for the noise, its own colour must.
_MORE_ORDERS = (*_VAR_ORDERS, 4, 8)
_BEHIND = 2  # rows behind a gap that are not scored
RICH_ORDERS = (*_MORE_ORDERS, 12)  # of what remains with an effect in the model, which it must outlast


@dataclass(frozen=True, eq=False)
class Noise:
    """Hold the noise model: VAR coefficients (q, l, l), the covariance (l, l) of what remains, that of all (l, l).

    Rows whose lags are not known, the first q of a stretch and those behind a missing measurement, are as likely as the
    whole of the noise has them, so that noise models of different order are compared on the same rows.
    """

    var: Array
    covariance: Array
    whole: Array

    @cached_property
    def factor(self) -> Array:
        """Return L with L Lᵀ = Σ⁻¹, so that ε L is white with unit variance."""
        return np.linalg.cholesky(np.linalg.inv(self.covariance))

    @cached_property
    def early_factor(self) -> Array:
        """Return L with L Lᵀ = Γ⁻¹, Γ the covariance of all of the noise: for rows whose lags are not known."""
        return np.linalg.cholesky(np.linalg.inv(self.whole))


@dataclass(frozen=True, eq=False)
class ScoredRows:
    """Hold which rows of a stretch are scored and of which a lag is not known (N each, `scored_rows`).

    Their numbers, where they are few, count from the first row of the stretch; those of its burn-in are left out.
    """

    masks: tuple[NDArray[np.bool_], NDArray[np.bool_]]
    burn: int

    @cached_property
    def early(self) -> NDArray[np.intp]:
        """Return the rows of which a lag is not known."""
        return self._behind(self.masks[1])

    @cached_property
    def measured_early(self) -> NDArray[np.intp]:
        """Return the scored rows of which a lag is not known."""
        return self._behind(self.masks[0] & self.masks[1])

    @cached_property
    def silent(self) -> NDArray[np.intp]:
        """Return the rows that are not scored."""
        return self._behind(~self.masks[0])

    def _behind(self, mask: NDArray[np.bool_]) -> NDArray[np.intp]:
        return self.burn + np.flatnonzero(mask[self.burn :])


def estimate_noise(innovations: Sequence[Array], burns: Sequence[int], order: int, reach: int | None = None) -> Noise:
    """Fit a VAR(order) to innovations by least squares, to rows that are whole; no colour where there are none.

    reach: rows before each in which nothing may be missing, at least and by default `order`; for orders to be compared.
    """
    outputs, reach = innovations[0].shape[1], max(order, reach or 0)
    complete = [bool(np.isfinite(e).all()) for e in innovations]
    stretches = [(e, max(burn, order), c) for e, burn, c in zip(innovations, burns, complete, strict=True)]
    known = [e[b:] if c else e[b:][scored_rows(e, order)[0][b:]] for e, b, c in stretches]
    var, whole = np.zeros((order, outputs, outputs)), _mean_square(_joined(known))
    y, z = (_joined(p) for p in zip(*(_explained(e, b, order, reach, c) for e, b, c in stretches), strict=True))
    if order and len(y):
        gram = z.T @ z
        coefficients = np.linalg.solve(gram + 1e-12 * np.trace(gram) * np.eye(len(gram)), z.T @ y)
        var = coefficients.reshape(order, outputs, outputs).transpose(0, 2, 1)
        y = y - z @ coefficients
    covariance = _mean_square(y) if len(y) else whole
    # a perfectly predicted output keeps a finite likelihood
    kept = [c + 1e-12 * max(float(np.trace(c)), 1e-300) * np.eye(outputs) for c in (covariance, whole)]
    return Noise(var, *kept)


def _mean_square(y: Array) -> Array:
    found: Array = y.T @ y / max(len(y), 1)
    return found


def _joined(parts: Sequence[Array]) -> Array:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _explained(e: Array, first: int, order: int, reach: int, complete: bool) -> tuple[Array, Array]:
    """Return the rows of e (N, l) from `first` on and the `order` rows before each, side by side.

    Only those in which, and in the `reach` rows before which, nothing is missing; complete: nothing is anywhere.
    """
    y = e[first:]
    z = np.hstack([e[first - i : len(e) - i] for i in range(1, order + 1)]) if order else np.zeros((len(y), 0))
    if complete:
        return y, z
    good = (scored_rows(e, reach)[0] & ~touched(e, reach))[first:]
    return y[good], z[good]


def preferred_order(
    innovations: Sequence[Array], burns: Sequence[int], *, stateless: bool = False, orders: Sequence[int] | None = None
) -> int:
    """Return the order of the noise model that BIC prefers; innovations (N, l) of each segment, `burns` rows unscored.

    Among `orders` (ascending), by default 0, 1 and 2, of a model without states also 4 and 8, as far as there are 20
    rows a value; behind gaps all are compared on the rows that the largest of them can use.
    """
    outputs, count, usable = innovations[0].shape[1], 0, [0]
    for order in orders or (_MORE_ORDERS if stateless else _VAR_ORDERS):
        whole = [scored_rows(e, order)[0] & ~touched(e, order) for e in innovations]
        rows = sum(int(np.sum(good[burn:])) for good, burn in zip(whole, burns, strict=True))
        if rows < 20 * (order * outputs + 1):
            break
        count, usable = rows, [*usable, order]
    best, choice = np.inf, 0
    for order in sorted(set(usable)) if count else ():
        noise = estimate_noise(innovations, burns, order, usable[-1])
        score = 0.5 * count * np.linalg.slogdet(noise.covariance)[1] + 0.5 * order * outputs**2 * np.log(count)
        if score < best:
            best, choice = score, order
    return choice


def filter_var(e: Array, var: Array) -> Array:
    """Return e_t − Σ A_i e_{t−i} (…, N, l); the first q rows use what there is."""
    result = e.copy()
    for i, a in enumerate(var, 1):
        result[..., i:, :] -= e[..., :-i, :] @ a.T
    return result


def touched(y: Array, order: int) -> NDArray[np.bool_]:
    """Tell for each row of y (N, l) whether a missing measurement, its own or one of `order` rows back, touches it."""
    return _rows_since_missing(y) <= order


def scored_rows(y: Array, order: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell of each row of y (N, l) whether it is scored, and whether one of its `order` lags is not known.

    Scored are measured rows, but for the two behind a gap, where the state has gone on without a correction, as long as
    that leaves half of them; the same rows whatever the order. Lags are not known before the first row and where a
    measurement is missing.
    """
    since = _rows_since_missing(y)
    measured, known, early = since > 0, since > _BEHIND, since <= order
    if np.count_nonzero(known) < 0.5 * np.count_nonzero(measured):
        known = measured
    early[:order] = True
    return known, early


@njit(cache=True, error_model="numpy", nogil=True)
def _rows_since_missing(y: Array) -> NDArray[np.int64]:
    """Return how many rows ago a measurement of y (N, l) was last missing, 0 where it is; large where none was."""
    since, last = np.empty(len(y), np.int64), np.int64(1) << 62
    for t in range(len(y)):
        last += 1
        for a in range(y.shape[1]):
            if not np.isfinite(y[t, a]):
                last = np.int64(0)
        since[t] = last
    return since


@njit(cache=True, error_model="numpy", nogil=True)
def whiten_lanes(
    e: Array, rows: tuple[NDArray[np.bool_], NDArray[np.bool_]], var: Array, factor: Array, early: Array, out: Array
) -> None:
    """Write the whitened innovations of several lanes into out (rows · l, lanes); rows are the last ones of e.

    e (N, l, lanes); rows: which are scored, and of which a lag is not known (N each, `scored_rows`); those that are not
    scored are zero; early (l, l) the factor of rows without known lags. What a model that has run away leaves stays
    infinite or NaN.
    """
    m, lanes, order = e.shape[1], e.shape[2], len(var)
    burn = len(e) - len(out) // m
    own = np.empty((m, lanes))
    for t in range(burn, len(e)):
        known, whole = rows[0][t], not rows[1][t]
        own[:] = e[t]
        for i in range(1, order + 1 if whole else 1):
            for b in range(m):
                for c in range(m):
                    for p in range(lanes):
                        own[c, p] -= var[i - 1, c, b] * e[t - i, b, p]
        chosen = factor if whole else early
        for c in range(m):
            row = (t - burn) * m + c
            for p in range(lanes):
                out[row, p] = 0.0
            for b in range(m if known else 0):
                for p in range(lanes):
                    out[row, p] += own[b, p] * chosen[b, c]


def colour_var(white: Array, var: Array) -> Array:
    """Return e with filter_var(e) = white (N, l)."""
    e = white.copy()
    for t in range(len(e)):
        for i, a in enumerate(var, 1):
            if t >= i:
                e[t] += a @ e[t - i]
    return e


def log_density(white: Array, noise: Noise, known: NDArray[np.bool_], early: NDArray[np.bool_]) -> Array:
    """Return the Gaussian log-density (N,) of normalised residuals given as one vector (N·l,).

    known (N,): rows that were measured; nothing is said of the others, whose density is 0 in the logarithm. early (N,):
    rows that were normalised by all of the noise.
    """
    outputs = len(noise.covariance)
    squares = np.sum(white.reshape(-1, outputs) ** 2, axis=1)
    sizes = np.where(early, np.linalg.slogdet(noise.whole)[1], np.linalg.slogdet(noise.covariance)[1])
    result: Array = np.where(known, -0.5 * (squares + outputs * np.log(2 * np.pi) + sizes), 0.0)
    return result


def levelled_density(
    white: Array, noise: Noise, lengths: Sequence[int], known: NDArray[np.bool_], early: NDArray[np.bool_]
) -> Array:
    """Return the log-density (N,) of stretches of these lengths, each at a noise level of its own, estimated here.

    known, early (N,): as in `log_density`; the level is that of the known rows.
    """
    outputs = len(noise.covariance)
    parts, start = [], 0
    for length in lengths:
        own = slice(start, start + length)
        piece, seen = white[start * outputs : own.stop * outputs].reshape(-1, outputs), known[own]
        level = np.sqrt(max(float(np.mean(np.minimum(piece[seen] ** 2, 1e12))), 1e-12)) if np.any(seen) else 1.0
        density = log_density((piece / level).ravel(), noise, seen, early[own])
        parts.append(density - np.where(seen, outputs * np.log(level), 0.0))
        start = own.stop
    return np.concatenate(parts)
