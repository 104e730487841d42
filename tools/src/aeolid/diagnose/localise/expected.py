"""Hold horizons, control effort and inferred inputs against what the model itself leads one to expect (S2)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch
from scipy.special import stdtrit

from aeolid.diagnose.baseline import alongside
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.hypotheses.parts.wind import winds
from aeolid.diagnose.localise.loop import Controller, can_close, controller_of, imitate_in_loop
from aeolid.diagnose.predictor.point import Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.predictor.quiet import silent_forces
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.sums import written_out
from aeolid.models import expressions as ex

Array = NDArray[np.float64]
Facts = dict[str, Any]
_IMITATIONS = 39
_HORIZONS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # rows
_STARTS, _SHARE = 60, 10  # predictions of the longest horizon, in all; of a segment, what that horizon may be
_ROWS = 512  # of one spectrum
_BANDS = 10  # a decade: third octaves
_ROOT = 1 / 3  # of a power: nearly normal (Wilson & Hilferty 1931)


def evidence_in_loop(prepared: Prepared, seed: int) -> dict[str, list[Facts]]:
    """Return three maps, each empty where it cannot be drawn.

    horizon: errors of predictions k rows ahead, the inputs known; effort: power of the inputs that a controller
    computes; inferred: power of what the model takes its unmeasured inputs (wind, forces with memory) to have been.
    Each against 39 imitations of the baseline in the loop of the recording: the fitted model, a linear controller
    fitted to the recording, drawn anew each time, what was added to the inputs as recorded. In closed loop an input
    answers past errors, so that the model's covariances alone do not say how large errors k rows ahead are. Marked is
    what Student's t of the cube root puts beyond 1 % for a whole map, and 10 % of the power at the least. Cost: some 80
    filter passes.
    """
    bare = prepared.only(())
    nothing: dict[str, list[Facts]] = {"horizon": [], "effort": [], "inferred": []}
    predictor, point = bare.predictor, bare.fit.point
    controller, is_run = _loop(bare)
    if not is_run:
        return nothing
    computed = [] if controller is None else controller.places
    hidden = _inferred(bare)
    rng, made = np.random.default_rng((seed, 3)), []
    for _ in range(_IMITATIONS):
        drawn = None if controller is None else controller.drawn(rng)
        imitation = imitate_in_loop(predictor, bare.fit, point, drawn, rng)
        if imitation is None:
            return nothing
        made.append(_powers(predictor.on(imitation), point, computed, hidden))
    recorded = _powers(predictor, point, computed, hidden)
    step, model = predictor.segments[0].step, bare.extended
    ahead = [{"horizon_s": k * step} for k in _horizons(predictor.segments)]
    starts, length = _lines(predictor.segments)
    bands = [{"frequency_hz": [(k - 0.5) / (length * step) for k in pair]} for pair in pairwise(starts)]
    inputs = [bare.declared.inputs[j].name for j in computed]
    states = [model.states[i].name for i in hidden]
    rows = ([o.name for o in model.outputs], inputs, states)
    return {
        kind: _cells(recorded[i], np.stack([m[i] for m in made]), rows[i], bands if i else ahead)
        for i, kind in enumerate(nothing)
    }


def _loop(bare: Prepared) -> tuple[Controller | None, bool]:
    """Return what computes inputs from outputs, and whether the loop with it can be run."""
    model, inputs = bare.extended, len(bare.declared.inputs)
    symbols = set(model.symbols[:inputs])
    looks = [bool(model.memories) or bool(symbols & ex.names_in(written_out(o.equation, model))) for o in model.outputs]
    controller = controller_of(bare.predictor.segments, inputs, ~np.array(looks))
    copied = any(s.name.startswith(alongside.PREFIX) for s in model.states)
    return controller, controller is None or (can_close(bare.predictor) and not copied)


def _inferred(bare: Prepared) -> list[int]:
    """Return the states that stand for unmeasured inputs: the model's winds, and forces that the fit kept."""
    model, point = bare.extended, bare.fit.point
    own = {s.name for s in winds(bare.declared)} | set(bare.frame.forces)
    asleep = {i for i, _ in silent_forces(model, point)}
    return [i for i, s in enumerate(model.states) if s.name in own and i not in asleep]


_Powers = tuple[Array, Array, Array]  # horizons (H, l), bands of inputs (B, f), bands of states (B, h)


def _powers(predictor: Predictor, point: Point, computed: Sequence[int], hidden: Sequence[int]) -> _Powers:
    runs = [predictor.run(point, i)[2] for i in range(len(predictor.segments))]
    inputs = [s.u[s.burn * s.stride :, list(computed)] for s in predictor.segments]
    states = [X[s.burn : -1, list(hidden)] for X, s in zip(runs, predictor.segments, strict=True)]
    lines = _lines(predictor.segments)
    return _ahead(predictor, point, runs), _bands(inputs, lines), _bands(states, lines)


def _horizons(segments: Sequence[Segment]) -> list[int]:
    longest = max(len(s.y) - s.burn for s in segments) // _SHARE
    return [k for k in _HORIZONS if k <= longest]


def _ahead(predictor: Predictor, point: Point, runs: Sequence[Array]) -> Array:
    """Return mean squared errors (H, l) of predictions k rows ahead from starts spread over the data.

    NaN where an output was measured in none of these rows, as one of two that a logger writes in turn may be.
    """
    horizons = _horizons(predictor.segments)
    rows = sum(len(s.y) - s.burn for s in predictor.segments)
    if not horizons:
        return np.zeros((0, predictor.segments[0].y.shape[1]))
    most, zero, squares = horizons[-1], np.zeros_like(predictor.gain(point)), []
    apart = max(1, (rows - most) // _STARTS)
    for i, segment in enumerate(predictor.segments):
        ready = predictor.ready(point, i)
        blank = np.full((most, segment.y.shape[1]), np.nan)
        for start in range(segment.burn, len(segment.y) - most, apart):
            predicted = predictor.run_rows(point, i, start, blank, runs[i][start], zero, ready=ready)[1]
            squares.append((segment.y[start : start + most] - predicted)[[k - 1 for k in horizons]] ** 2)
    errors = np.array(squares)  # (starts, H, l)
    known = ~np.isnan(errors)
    with np.errstate(all="ignore"):
        result: Array = np.where(known, errors, 0.0).sum(axis=0) / known.sum(axis=0)
    return result


def _lines(segments: Sequence[Segment]) -> tuple[list[int], int]:
    """Return the lines at which third octaves begin, no mean, and the rows of one spectrum; none of short data."""
    rows = min(_ROWS, max(len(s.y) - s.burn for s in segments) // 4)
    if rows < in_force().localise.spectrum_rows:
        return [], rows
    count = int(_BANDS * np.log10(rows // 2)) + 1
    return np.unique(np.round(np.geomspace(1, rows // 2, count)).astype(int)).tolist(), rows


def _bands(signals: Sequence[Array], lines: tuple[list[int], int]) -> Array:
    """Return mean power (B, c) of signals (N, c) of several segments in bands of lines, by Welch's spectra."""
    (starts, rows), width = lines, signals[0].shape[1]
    if not starts or not width:
        return np.zeros((0, width))
    total = np.zeros((rows // 2 + 1, width))
    for x in signals:
        if len(x) >= rows:
            total += len(x) * welch(x, nperseg=rows, axis=0)[1]
    return np.array([total[a:b].mean(axis=0) for a, b in pairwise(starts)])


def _cells(recorded: Array, made: Array, names: Sequence[str], places: Sequence[Facts]) -> list[Facts]:
    """Return one cell for each name and place: power against the imitations' mean, t over its limit."""
    rules = in_force().localise
    ratio = rules.material_ratio
    root, others = recorded**_ROOT, made**_ROOT
    spread = others.std(axis=0, ddof=1) * np.sqrt(1 + 1 / len(made))
    t = (root - others.mean(axis=0)) / np.maximum(spread, 1e-300)
    limit = -float(stdtrit(len(made) - 1, 0.5 * (1 - (1 - rules.false_alarm_level) ** (1 / max(t.size, 1)))))
    mean = made.mean(axis=0)
    return [
        {"output": name, **place, "kind": "power", "value": float(recorded[i, j] / mean[i, j]),
         "statistic": float(abs(t[i, j])), "threshold": limit,
         "significant": bool(abs(t[i, j]) > limit and not 1 / ratio < recorded[i, j] / mean[i, j] < ratio)}
        for j, name in enumerate(names)
        for i, place in enumerate(places)
        if mean[i, j] > 0 and np.isfinite(t[i, j])
    ]  # fmt: skip
