"""Prove a correction on sealed data, and the procedure on recordings that have nothing to find (S6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import periodogram

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.evaluation import RUN_AWAY
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.gains import row_matrix
from aeolid.diagnose.predictor.noise import colour_var
from aeolid.diagnose.predictor.point import Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.stats.blocks import block_interval
from aeolid.diagnose.validation.forecast import Forecast, errors_ahead, restarted

Array = NDArray[np.float64]
_LEAST_ROWS = 20  # of a prediction restarted from the filtered state
_SETTLED = 0.15  # of a stretch at most, and 10 rows at least, before it is scored
_HORIZONS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)


@dataclass(frozen=True, eq=False)
class Proof:
    """Hold the comparison of two fitted predictors on sealed data; worse: see `_errs_more`."""

    gain: float
    interval: tuple[float, float]
    difference: Array
    nrmse_before: dict[str, float]
    nrmse_after: dict[str, float]
    horizon_s: float
    profile: dict[str, dict[str, list[float]]]
    series: dict[str, dict[str, object]]
    spectra: dict[str, dict[str, list[float]]]
    worse: bool


def prove(
    before: tuple[Predictor, Fit], after: tuple[Predictor, Fit], sealed: Sequence[Segment], settle_s: float, seed: int
) -> Proof:
    """Score both predictors on the sealed segments: log-likelihood gain with a block-bootstrap 90 % interval.

    Fit errors are those of predictions restarted from the filtered state, and from what the noise model foretells from
    the innovations before, every settling time (three of the model's slowest decaying time constants, at most a
    twentieth of the sealed data, at least 20 samples): long enough to show the dynamics, short enough for a model that
    integrates. Where a linear one grows, it starts again before errors of its start have grown by e: they would hide
    all else.
    """
    runs = []
    for predictor, fit in (before, after):
        density, other, point = predictor.score_elsewhere(fit, sealed)
        runs.append((np.where(np.isfinite(density), density, RUN_AWAY), other, point))
    difference = runs[1][0] - runs[0][0]
    interval = block_interval(difference, seed)
    rows = sum(len(s.y) for s in sealed)
    most = min(settle_s / sealed[0].step, rows // 20, *(_memory(*pair) for pair in (before, after)))
    horizon = max(_LEAST_ROWS, int(most))
    names = [o.name for o in before[0].compiled.model.outputs]
    fits, longest = (before[1], after[1]), max(horizon, _HORIZONS[-1])
    ahead = [Forecast(other, point, fit, longest) for (_, other, point), fit in zip(runs, fits, strict=True)]
    long_run = [restarted(a, horizon) for a in ahead]
    measured = np.vstack([s.y[s.burn :] for s in sealed])
    nrmse = [_nrmse(measured, np.vstack(r)) for r in long_run]
    profile = _profile(ahead, measured, names)
    series = _series(sealed, names, before[0], long_run)
    return Proof(
        float(difference.sum()), interval, difference, dict(zip(names, nrmse[0], strict=True)),
        dict(zip(names, nrmse[1], strict=True)), horizon * sealed[0].step, profile, series,
        _spectra(sealed, long_run, names, horizon), _errs_more(measured, long_run, seed),
    )  # fmt: skip


def is_material(proof: Proof, static: bool = False) -> bool:
    """Tell whether some output is predicted visibly better at some horizon: relatively and against its own spread.

    Where a model errs by no more than its constants' usual inaccuracy makes it err, nothing better matters.

    static: of a law without states, over the settling time alone. Its one-step errors are what its noise foretells:
    a lag of 5 s behind a torque law, whose constant is 17 % off, gained 7,500 nats and erred more than the law.
    """
    rules = in_force().validation
    pairs = [(proof.nrmse_before[k], proof.nrmse_after[k]) for k in proof.nrmse_before]
    for rows in () if static else proof.profile.values():
        pairs += list(zip(rows["before"], rows["after"], strict=True))
    least, visible, adequate = rules.material_error_share, rules.visible_spread_share, rules.adequate_spread_share
    return any(
        before > adequate and after < before * (1 - least) and before - after > visible for before, after in pairs
    )


def is_adequate(proof: Proof) -> bool:
    """Tell whether, after the correction, every output is predicted as well as any need be over the settling time."""
    return all(after <= in_force().validation.adequate_spread_share for after in proof.nrmse_after.values())


def beyond(more: Proof, less: Proof) -> Proof:
    """Return a proof whose errors before are those after another one on the same data: what it shows beyond that."""
    profile = {
        name: rows | {"before": less.profile[name]["after"]}
        for name, rows in more.profile.items()
        if name in less.profile
    }
    return replace(more, nrmse_before=less.nrmse_after, profile=profile)


def seen_before(segments: Sequence[Segment], settle_s: float) -> list[Segment]:
    """Return stretches that a fit has seen as they are scored elsewhere: behind a start to settle in."""
    return [
        s if s.burn else replace(s, burn=int(min(max(10.0, settle_s / s.step), _SETTLED * len(s.y)))) for s in segments
    ]


def _memory(predictor: Predictor, fit: Fit) -> float:
    """Return in how many rows a linear model lets an error of its start grow by e; infinite where none grows.

    Other models are not asked: what grows about one state (a friction that falls with speed) is bounded elsewhere.
    """
    if not predictor.compiled.model.sample_time_s:
        return np.inf
    A = row_matrix(predictor.compiled, predictor.middle, fit.point.theta, predictor.segments[0].step)
    if not len(A) or not np.all(np.isfinite(A)):
        return np.inf
    growth = float(np.max(np.abs(np.linalg.eigvals(A))))
    return 1.0 / np.log(growth) if growth > 1.0 else np.inf


def _nrmse(measured: Array, predicted: Array) -> list[float]:
    error = np.sqrt(np.nanmean((measured - predicted) ** 2, axis=0))
    return [
        float(min(v, 1e6)) if np.isfinite(v) else 1e6 for v in error / np.maximum(np.nanstd(measured, axis=0), 1e-300)
    ]


def _errs_more(measured: Array, runs: Sequence[list[Array]], seed: int) -> bool:
    """Tell whether predictions over the settling time err more with the effect, beyond what blocks of rows differ by.

    One-step errors may all the same be smaller elsewhere: a sensor's lag beside one that rectifies was borne out by
    two of three recordings in turn, 102 nats, and let the third be foretold with 0.82 of its spread for 0.60.
    """
    spread = np.maximum(np.nanvar(measured, axis=0), 1e-300)
    before, after = (np.square(measured - np.vstack(r)) / spread for r in runs)
    lost = np.nan_to_num(after - before, nan=0.0, posinf=1e12, neginf=-1e12).sum(axis=1)
    return block_interval(lost, seed)[0] > 0


def _profile(runs: Sequence[Forecast], measured: Array, names: list[str]) -> dict[str, dict[str, list[float]]]:
    """Return the normalised error k samples ahead, sampled at starts spread over the sealed data."""
    longest = max(len(s.y) - s.burn for s in runs[0].predictor.segments)
    steps = [k for k in _HORIZONS if k < min(len(measured) // 5, longest)]
    errors = [[errors_ahead(run, k) for k in steps] for run in runs]
    return {
        name: {
            "steps": [float(k) for k in steps],
            "before": [float(v[j]) for v in errors[0]],
            "after": [float(v[j]) for v in errors[1]],
        }
        for j, name in enumerate(names)
    }


def _series(
    sealed: Sequence[Segment], names: list[str], predictor: Predictor, runs: Sequence[list[Array]]
) -> dict[str, dict[str, object]]:
    """Return by output what was measured and foretold in all sealed stretches, one after another.

    Keys: time_s, stretch (from 1, in the order of the sealed stretches), measured, before, after, unit.
    """
    measured, before, after = (np.vstack(parts) for parts in ([s.y[s.burn :] for s in sealed], *runs))
    time = np.concatenate([s.scored_s for s in sealed])
    stretch = np.repeat(np.arange(1, len(sealed) + 1), [len(s.y) - s.burn for s in sealed])
    units = [o.unit for o in predictor.compiled.model.outputs]
    return {
        name: {
            "time_s": time.tolist(),
            "stretch": stretch.tolist(),
            "measured": _plain(measured[:, j]),
            "before": _plain(before[:, j]),
            "after": _plain(after[:, j]),
            "unit": units[j],
        }
        for j, name in enumerate(names)
    }


def _plain(values: Array) -> list[float | None]:
    return [float(v) if np.isfinite(v) and abs(v) < 1e12 else None for v in values]


def _spectra(
    sealed: Sequence[Segment], runs: Sequence[list[Array]], names: list[str], horizon: int
) -> dict[str, dict[str, list[float]]]:
    """Return error spectra: mean periodograms of the stretches predicted at one go, each with its line taken off.

    No window of the average holds the edge at which a prediction starts again: its power is not the model's error.
    """
    step, result = sealed[0].step, {}
    for j, name in enumerate(names):
        found = []
        for run in runs:
            errors = [s.y[s.burn :, j] - r[:, j] for s, r in zip(sealed, run, strict=True)]
            cut = [e[k : k + horizon] for e in errors for k in range(0, len(e) - horizon + 1, horizon)]
            cut = cut or [max(errors, key=len)]
            stretches = np.nan_to_num(np.clip(np.array(cut), -1e9, 1e9))
            found.append(periodogram(stretches, 1 / step, window="hann", detrend="linear"))
        (f, before), (_, after) = found
        columns = {"before": before.mean(axis=0), "after": after.mean(axis=0)}
        result[name] = {"frequency_hz": f[1:].tolist()} | {k: v[1:].tolist() for k, v in columns.items()}
    return result


def imitate(
    predictor: Predictor, fit: Fit, segments: Sequence[Segment], point: Point, rng: np.random.Generator
) -> list[Segment]:
    """Generate recordings from the fitted baseline: the recorded inputs, innovations resampled.

    Innovations are the whitened residuals in random order with random signs, coloured by the noise model again;
    nothing that the baseline lacks is in the result.
    """
    outputs = segments[0].y.shape[1]
    pool = fit.residual.reshape(-1, outputs)
    unwhiten = np.linalg.inv(fit.noise.factor)
    result = []
    other = predictor.on(segments)
    K = other.gain(point)
    for i, segment in enumerate(segments):
        rows = rng.integers(0, len(pool), size=len(segment.y))
        e = colour_var(pool[rows] * rng.choice([-1.0, 1.0], size=(len(rows), 1)) @ unwhiten, fit.noise.var)
        made, predicted, _ = other.run_rows(point, i, 0, e, point.x0[i], K, generate=True)
        y = np.where(np.isfinite(segment.y), predicted + made, np.nan)
        result.append(replace(segment, y=np.ascontiguousarray(y)))
    return result
