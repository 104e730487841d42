"""Ask whether anything at all is left in the innovations, and how much could be explained (S2, the ceiling of S6)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, welch

from aeolid.compiled import njit
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.baseline.simulated import Surrogate
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.noise import filter_var, touched
from aeolid.diagnose.predictor.point import Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.stats.blocks import block_interval

Array = NDArray[np.float64]
PAST_INNOVATIONS = "past innovations"  # the group of features that only the colour of the noise needs
_LAGS = 12
_RIDGES = 10.0 ** np.arange(-3, 7)


@dataclass(frozen=True, eq=False)
class Ceiling:
    """Hold what a model-free correction of the innovations gains: per-sample gains (N,) on each part in nats.

    Of a simulator's run as the baseline, that is beyond what it gains on the run itself.

    groups: share of the fitted correction's variance by kind of feature, largest first.
    """

    select: Array
    sealed: Array
    groups: tuple[tuple[str, float], ...]


def ceiling(prepared: Prepared, sealed: tuple[Segment, ...]) -> Ceiling:
    """Regress whitened innovations on past inputs, innovations and functions of the predicted states.

    A ridge regression fitted on the fit part, its strength chosen on the select part: what no named effect explains
    but the data would allow. Features: `lags` of inputs and innovations; signs, squares,
    cubes, sizes and plays of inputs and states. Cost O(N q²).
    """
    predictor, fit = prepared.predictor, prepared.fit
    sizes = _sizes(predictor, fit.point, len(prepared.declared.inputs))
    X, R, groups = _features(predictor, fit.point, fit, sizes)
    parts = []
    for segments in (prepared.split.select, sealed):
        _, other, point = predictor.score_elsewhere(fit, segments)
        parts.append(_features(other, point, fit, sizes)[:2])
    top = _correct((X, R), parts[0], parts[1], groups)
    expected = 0.0 if prepared.surrogate is None else expected_gain(prepared.surrogate)
    return replace(top, select=top.select - expected, sealed=top.sealed - expected)


def expected_gain(known: Surrogate) -> float:
    """Return what a correction gains on a simulator's run that lacks nothing, in nats a sample.

    A linear model of finite order leaves something over on any run. Fitted to the first half, strength chosen on the
    next fifth, gained on the rest; the upper end of its 90 % interval.
    """
    sizes = _sizes(known.predictor, known.fit.point, len(known.form.model.inputs))
    X, R, groups = _features(known.predictor, known.fit.point, known.fit, sizes)
    a, b = round(0.5 * len(X)), round(0.7 * len(X))
    gains = _correct((X[:a], R[:a]), (X[a:b], R[a:b]), (X[b:], R[b:]), groups).sealed
    return max(0.0, block_interval(gains, 0)[1] / len(gains))


_Part = tuple[Array, Array]  # features (N, q), whitened innovations (N, l)


def _correct(fitted: _Part, select: _Part, sealed: _Part, groups: list[str]) -> Ceiling:
    """Fit the ridge regression, choose its strength on `select`, return the gains on both other parts."""
    X, R = fitted
    mean, spread = X.mean(axis=0), X.std(axis=0)
    keep = spread > 1e-9 * max(float(spread.max(initial=0.0)), 1e-300)
    scale = np.where(keep, spread, np.inf)
    Z, others = (X - mean) / scale, [((x - mean) / scale, r) for x, r in (select, sealed)]
    gram, cross = Z.T @ Z, Z.T @ R
    best, weights = -np.inf, np.zeros((Z.shape[1], R.shape[1]))
    for ridge in _RIDGES:
        w = np.linalg.solve(gram + ridge * np.eye(len(gram)), cross)
        gain = float(_gain(*others[0], w).sum())
        if gain > best:
            best, weights = gain, w
    if best <= 0:
        weights = np.zeros_like(weights)
    share: dict[str, float] = {}
    for column, group in enumerate(groups):
        share[group] = share.get(group, 0.0) + float(np.sum((Z[:, column : column + 1] * weights[column]) ** 2))
    total = sum(share.values()) or 1.0
    ranked = tuple(sorted(((g, v / total) for g, v in share.items()), key=lambda p: -p[1]))
    return Ceiling(_gain(*others[0], weights), _gain(*others[1], weights), ranked)


def _gain(Z: Array, R: Array, w: Array) -> Array:
    """Return per-sample nats gained by the correction, each side at its own noise level."""
    squares = [np.sum(r**2, axis=1) for r in (R, R - Z @ w)]
    levels = [max(float(np.mean(q)) / R.shape[1], 1e-300) for q in squares]
    before, after = (-0.5 * (q / v + R.shape[1] * np.log(v)) for q, v in zip(squares, levels, strict=True))
    result: Array = after - before
    return result


def _features(
    predictor: Predictor, point: Point, fit: Fit, sizes: tuple[Array, Array, Array, Array]
) -> tuple[Array, Array, list[str]]:
    rows, targets = [], []
    groups: list[str] = []
    model = predictor.compiled.model
    before = 0 if set(model.symbols[: len(sizes[2])]) & model.names_seen() else 1
    for i, segment in enumerate(predictor.segments):
        e, _, X = predictor.run(point, i)
        white = filter_var(np.where(np.isfinite(e), e, 0.0), fit.noise.var) @ fit.noise.factor
        u = _coarse(segment, len(sizes[2]))
        columns, groups = _columns(u, white, X[: len(e), : len(sizes[0])], sizes, before)
        rows.append(np.nan_to_num(columns)[segment.burn :])
        good = ~touched(segment.y, len(fit.noise.var))
        good[: len(fit.noise.var)] = False
        targets.append(np.where(good[segment.burn :, None], white[segment.burn :], 0.0))
    return np.clip(np.vstack(rows), -1e6, 1e6), np.vstack(targets), groups


def _coarse(segment: Segment, inputs: int) -> Array:
    mean: Array = segment.u[:, :inputs].reshape(len(segment.y), segment.stride, -1).mean(axis=1)
    return mean


def _sizes(predictor: Predictor, point: Point, inputs: int) -> tuple[Array, Array, Array, Array]:
    """Return means and spreads of the states (n,) and of the inputs (r,) over the fit part."""
    n = len(predictor.compiled.model.states)
    X = np.vstack([predictor.run(point, i)[2][s.burn :, :n] for i, s in enumerate(predictor.segments)])
    u = np.vstack([_coarse(segment, inputs) for segment in predictor.segments])
    return X.mean(axis=0), X.std(axis=0), u.mean(axis=0), u.std(axis=0)


def _columns(
    u: Array, white: Array, X: Array, sizes: tuple[Array, Array, Array, Array], before: int
) -> tuple[Array, list[str]]:
    """Return the features (N, q) and their groups; curves are of the input `before` samples ago.

    What an input does shows one sample later, unless an output looks at it. A controller that answers a measurement
    within the sample puts the error of the prediction into the input: of it at once, the error looks foretold.
    """
    columns, groups = [], []
    known = np.where(sizes[3] > 0, sizes[3], np.inf)
    scaled = (u - sizes[2]) / known  # in sizes of each input, so that no unit decides
    for lag in range(1, _LAGS + 1):
        for source, name in ((scaled, "past inputs"), (white, PAST_INNOVATIONS)):
            for j in range(source.shape[1]):
                columns.append(lfilter(np.eye(lag + 1)[lag], 1.0, source[:, j]))
                groups.append(name)
    for j, (centre, size) in enumerate(zip(sizes[2], sizes[3], strict=True)):
        if size > 0:  # as in the fit part, so that every part has the same columns
            own = lfilter(np.eye(before + 1)[before], 1.0, (u[:, j] - centre) / size)
            bent, names = _bent(own, "an input")
            columns += bent
            groups += names
    moving = sizes[1] > 1e-9 * max(float(sizes[1].max(initial=0.0)), 1e-300)
    raw = X[:, moving] / sizes[1][moving]
    S = raw - sizes[0][moving] / sizes[1][moving]
    for j in range(S.shape[1]):
        columns.append(S[:, j])
        groups.append("states")
        bent, names = _bent(raw[:, j], "a state")
        columns += bent
        groups += names
    return np.column_stack(columns), groups


def _bent(values: Array, what: str) -> tuple[list[Array], list[str]]:
    """Return functions that a linear model cannot make of a signal of unit size, and what each is called."""
    plain = np.ascontiguousarray(np.nan_to_num(values))
    columns = [np.tanh(10 * plain), plain**2, plain**3, np.abs(plain), play(plain, 0.2), play(plain, 0.6)]
    names = [f"sign of {what}", f"square of {what}", f"cube of {what}", f"size of {what}"]
    return columns, [*names, f"play of {what}", f"play of {what}"]


@njit(cache=True)
def play(values: Array, width: float) -> Array:
    """Return the play (backlash) operator of a signal: it follows only after `width` of slack has been taken up."""
    out = np.empty_like(values)
    at = values[0]
    for k in range(len(values)):
        at = min(max(at, values[k] - width), values[k] + width)
        out[k] = at
    return out


def band_power(predictor: Predictor, fit: Fit, seed: int, draws: int = 200) -> list[dict[str, object]]:
    """Compare the power of the whitened innovations in third octaves with white noise; family-wise over all cells.

    Returns one entry a channel and band: ratio to white noise, and whether it exceeds the family-wise limit.
    """
    step = predictor.segments[0].step
    outputs = predictor.segments[0].y.shape[1]
    white = fit.residual.reshape(-1, outputs)
    length = min(len(white), 1024)
    rules = in_force().localise
    if length < rules.spectrum_rows:
        return []
    rng = np.random.default_rng(seed)
    f, power = welch(white, 1 / step, nperseg=length, axis=0)
    edges = np.geomspace(max(f[2], f[-1] / 100), f[-1], 3 * 6 + 1)
    null_rows = []
    for _ in range(draws):
        noise_f, noise_power = welch(rng.standard_normal((len(white), 1)), 1 / step, nperseg=length, axis=0)
        null_rows.append(_bands(noise_f, noise_power, edges)[:, 0])
    null = np.stack(null_rows)
    centre, spread = null.mean(axis=0), np.maximum(null.std(axis=0), 1e-12)
    limit = float(np.quantile(np.max(np.abs(null - centre) / spread, axis=1), 1 - rules.false_alarm_level)) * (
        1 + 0.1 * np.log(outputs)
    )
    measured = _bands(f, power, edges)
    apart = np.abs(measured - centre[:, None]) / spread[:, None]
    return [
        {
            "output": predictor.compiled.model.outputs[j].name,
            "frequency_hz": [float(edges[b]), float(edges[b + 1])],
            "ratio": float(measured[b, j] / centre[b]),
            "statistic": float(apart[b, j]),
            "threshold": limit,
            "significant": bool(apart[b, j] > limit),
        }
        for j in range(outputs)
        for b in range(len(edges) - 1)
        if centre[b] > 0
    ]


def _bands(f: Array, power: Array, edges: Array) -> Array:
    rows = []
    for low, high in itertools.pairwise(edges.tolist()):
        inside = (f >= low) & (f <= high)
        rows.append(power[inside].mean(axis=0) if np.any(inside) else np.zeros(power.shape[1]))
    return np.array(rows)
