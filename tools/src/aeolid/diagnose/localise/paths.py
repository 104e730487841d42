"""Ask which recorded channel's past the innovations still follow, and at which frequencies (S3)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.fft import irfft, rfft
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter
from scipy.special import chdtrc

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.data.shaft_angle import ROLE as SHAFT_ANGLE
from aeolid.diagnose.localise.cells import Cell
from aeolid.diagnose.predictor.noise import touched
from aeolid.diagnose.rules import in_force

Array = NDArray[np.float64]
Facts = dict[str, Any]
_MOST_LAGS, _ROWS_A_LAG = 512, 16  # lags looked at: as many at most, and one for so many rows
_ORDER, _ROWS_A_POLE = 30, 50  # of the autoregression that takes a channel's colour: at most, one for so many rows
_MOST_CHANNELS = 8
_AROUND = 101  # rows by whose size a sample is measured


def evidence_paths(prepared: Prepared) -> list[Facts]:
    """Test the whitened innovations of the baseline's fit against the past of each recorded channel, by third octave.

    Channels: the inputs, and what the model has no use for (time and rotor angle aside), eight at most.
    """
    predictor, fit, site = prepared.predictor, prepared.fit, prepared.site
    others = [c.name for c in site.exogenous if c.role not in ("time", "azimuth", SHAFT_ANGLE)]
    names = [*site.input_names, *others][:_MOST_CHANNELS]
    places = [[s.name for s in prepared.extended.inputs].index(n) for n in names]
    outputs = [o.name for o in prepared.extended.outputs]
    white = fit.residual.reshape(-1, len(outputs)).copy()
    heard, start = [], 0
    for s in predictor.segments:
        stop = start + len(s.y) - s.burn
        white[start:stop][touched(s.y, len(fit.noise.var))[s.burn :]] = 0.0
        heard.append(s.u[:: s.stride, places][s.burn :])
        start = stop
    ends = np.cumsum([len(h) for h in heard])[:-1]
    cells, edges = path_cells(np.split(white, ends), heard)
    hertz = edges / predictor.segments[0].step
    return [
        {"output": outputs[c.output], "channel": names[c.place // len(edges)], "kind": c.kind, "value": c.value,
         "frequency_hz": [float(f) for f in hertz[c.place % len(edges) : c.place % len(edges) + 2]], "statistic": c.z,
         "threshold": c.limit, "significant": c.significant}
        for c in cells
    ]  # fmt: skip


def path_cells(white: Sequence[Array], heard: Sequence[Array]) -> tuple[list[Cell], Array]:
    """Return the cells, their place channel · len(edges) + band, and the bands' edges in cycles a sample.

    white: innovations (N, l) of each segment, heard: channels (N, c) there. A channel's own colour is taken off by an
    autoregression, and both are made as loud throughout (few loud stretches that come together are few samples). Their
    correlations at 1 … L samples, each over its own deviation, are then standard normal where nothing is left, and the
    power of their transform in a band of m lines is chi² of 2 m. Only the past is asked: in closed loop what a channel
    does after an innovation is the controller's answer to it. Value: power over what chance gives. Šidák over all.
    Cost O(c l N log N).
    """
    rules = in_force().localise
    rows = sum(len(w) for w in white)
    lags = 2 ** int(np.log2(max(min(_MOST_LAGS, rows // _ROWS_A_LAG), 1)))
    moving = [i for i in range(heard[0].shape[1]) if np.ptp(np.concatenate([h[:, i] for h in heard])) > 0]
    if lags < rules.least_lags or not moving:
        return [], np.zeros(0)
    edges = _edges(lags)
    apart = [np.vstack([_even(w), np.zeros((lags, w.shape[1]))]) for w in white]
    e = np.vstack(apart)
    squares, found = e**2, []
    for i in moving:
        own = [h[:, i] for h in heard]
        v = np.concatenate([np.r_[_even(x), np.zeros(lags)] for x in colourless(own)])
        first, second = rfft(v), rfft(v**2)
        for j in range(e.shape[1]):
            sums = irfft(rfft(e[:, j]) * np.conj(first), n=len(v))[1 : lags + 1]
            spread = np.sqrt(np.maximum(irfft(rfft(squares[:, j]) * np.conj(second), n=len(v))[1 : lags + 1], 0.0))
            power = np.abs(rfft(sums / np.maximum(spread, 1e-300))) ** 2 / (lags / 2)
            for b, (low, high) in enumerate(pairwise((edges * lags).round().astype(int).tolist())):
                total, freedom = float(power[low:high].sum()), 2 * (high - low)
                chance = float(chdtrc(freedom, total))
                found.append((j, i * len(edges) + b, total / freedom, float(-np.log10(max(chance, 1e-300)))))
    limit = float(-np.log10(1 - (1 - rules.false_alarm_level / rules.tail_ratio) ** (1 / len(found))))
    return [Cell(j, place, "path", value, z, limit) for j, place, value, z in found], edges


def _edges(lags: int) -> Array:
    """Return edges of third octaves in cycles a sample, each with a line of the transform at least; no mean, no end."""
    lines = np.unique(np.round(np.geomspace(1, lags // 2, 3 * int(np.log2(lags // 2)) + 1)).astype(int))
    return np.asarray(lines / lags, dtype=np.float64)


def colourless(channel: Sequence[Array]) -> list[Array]:
    """Return a channel's segments less what their own past foretells, by one autoregression (Yule and Walker)."""
    centred = [x - np.mean(np.concatenate(channel)) for x in channel]
    rows = sum(len(x) for x in centred)
    order = max(1, min(_ORDER, rows // _ROWS_A_POLE))
    r = np.zeros(order + 1)
    for x in centred:
        r += [float(x[: len(x) - k] @ x[k:]) if len(x) > k else 0.0 for k in range(order + 1)]
    r[0] *= 1 + 1e-9  # a channel that its past foretells exactly has a matrix without an inverse
    poles = np.r_[1.0, -solve_toeplitz(r[:-1], r[1:])]
    return [_settled(lfilter(poles, 1.0, x), order) for x in centred]


def _even(values: Array) -> Array:
    """Return a signal (N, …) over its own size in the hundred rows around each sample."""
    size = uniform_filter1d(values**2, _AROUND, axis=0, mode="nearest")
    result: Array = values / np.sqrt(np.maximum(size, 1e-12 * max(float(np.mean(values**2)), 1e-300)))
    return result


def _settled(values: Array, order: int) -> Array:
    """Return a filtered segment with nothing where the filter had no past yet."""
    values[:order] = 0.0
    return values
