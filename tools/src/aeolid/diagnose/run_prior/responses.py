"""Compare how the outputs of both sides answer their inputs, where what excites the control loop is recorded.

H = S_zu⁻¹ S_zy, the recorded excitation z in the place of the inputs u (the indirect method; Pintelon, Schoukens 2012):
wind has no part in z, so that the loop, which answers wind as well, does not bend the responses. What the responses
leave of the outputs' spectra, S_ee, is what wind does. Both are averages over bands between multiples of the rotor's
frequency.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from aeolid.decompositions import lstsq, pinv
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.pair import Pair, Side
from aeolid.models.multiblade import fixed_frame
from aeolid.record import Record

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
_TURNS = 4.0  # revolutions of a segment
_MOST_GAIN = 10.0  # of the logarithm of a gain: beyond it nothing is an answer
_LOWEST, _HIGHEST, _RATIO = 0.75, 25.0, 1.2  # of the bands, in multiples of the rotor's frequency
_LEAST_BANDS = 6  # through which a lateness is a slope
_NYQUIST = 0.8  # part of the Nyquist frequency up to which bands reach


@dataclass(frozen=True, eq=False)
class Answers:
    """Hold one side's responses H (k, r, l) with variances V, and what they leave of the spectra, rest (k, l), by band.

    count (k,): independent averages of a band.
    """

    H: ComplexArray
    V: Array
    rest: Array
    count: Array


@dataclass(frozen=True, eq=False)
class Answering:
    """Hold the answers of recordings and runs of a pair.

    orders (k,): middles of the bands in multiples of the rotor's frequency; hz: that frequency; chosen, sealed: the
    recordings' first and last part; whole: all of them.
    """

    orders: Array
    hz: float
    whole: Answers
    chosen: Answers
    sealed: Answers
    run: Answers


@dataclass(frozen=True, eq=False)
class Fit:
    """Hold H_recording = g exp(−s T) H_run of one input: T in s, log g (m,) by output, and their deviations."""

    delay_s: float
    delay_std_s: float
    gain: Array
    gain_std: Array


def answering_of(
    pair: Pair, records: Sequence[Record], runs: Sequence[Record], context: Mapping[str, Any], fit: float
) -> Answering | None:
    """Return the answers of both sides; None where they cannot be compared.

    As many excitations must be recorded as there are inputs, all sides lie in one region of operation, and hold enough
    segments without gaps. fit: part of each recording that is not sealed.
    """
    rules, names = in_force().run_prior, records[0].names("excitation")
    turn = context.get("rated_speed_rad_s")
    if not turn or len(names) != len(pair.inputs) or any(not _moves(r, names) for r in (*records, *runs)):
        return None
    if len(pair.offset) > 1 or len(pair.recordings) != len(records) or len(pair.runs) != len(runs):
        return None
    if any(s.missing.mean() > rules.answer_gaps for s in (*pair.recordings, *pair.runs)):
        return None
    hz = float(turn) / (2 * np.pi)
    edges = _edges(min(_HIGHEST, _NYQUIST / (2 * pair.step * hz)))
    if len(edges) <= _LEAST_BANDS:
        return None

    def of(group: Sequence[Side], told: Sequence[Record], first: float, last: float) -> Answers | None:
        parts = []
        for s, r in zip(group, told, strict=True):
            z = np.nan_to_num(r.columns(names))
            table = np.hstack([z, s.u, fixed_frame(s.y, s.azimuth, pair.blades)])
            a, b = round(first * len(s)), round(last * len(s))
            parts.append(_spectra(table[a:b], pair.step, hz))
        return _answers(parts, len(names), len(pair.inputs), edges * hz, pair.step)

    made = [
        of(pair.recordings, records, 0.0, 1.0), of(pair.recordings, records, 0.0, fit),
        of(pair.recordings, records, fit, 1.0), of(pair.runs, runs, 0.0, 1.0),
    ]  # fmt: skip
    whole, chosen, sealed, run = made
    if whole is None or chosen is None or sealed is None or run is None:
        return None
    return Answering(np.sqrt(edges[:-1] * edges[1:]), hz, whole, chosen, sealed, run)


def _moves(record: Record, names: Sequence[str]) -> bool:
    if any(n not in record.names("excitation") for n in names):
        return False
    return bool(np.all(np.nanstd(record.columns(names), axis=0) > 0))


def _edges(top: float) -> Array:
    found = [_LOWEST]
    while found[-1] * _RATIO <= top:
        found.append(max(found[-1] * _RATIO, found[-1] + 1 / _TURNS))
    return np.array(found)


def _spectra(table: Array, step: float, hz: float) -> tuple[ComplexArray, int, int]:
    """Return the sum of conj(X_i) X_j (f, c, c) over Hann windows that overlap by half, their number and length."""
    length = round(_TURNS / (hz * step))
    starts = range(0, len(table) - length + 1, length // 2)
    window = np.hanning(length)[:, None]
    total = np.zeros((length // 2 + 1, table.shape[1], table.shape[1]), complex)
    for a in starts:
        x = table[a : a + length]
        X = np.fft.rfft(window * (x - x.mean(axis=0)), axis=0)
        total += X.conj()[:, :, None] * X[:, None, :]
    return total, len(starts), length


def _answers(
    parts: Sequence[tuple[ComplexArray, int, int]], z: int, u: int, edges_hz: Array, step: float
) -> Answers | None:
    segments, length = sum(n for _, n, _ in parts), parts[0][2]
    if segments < in_force().run_prior.answer_segments:
        return None
    total = np.sum([s for s, _, _ in parts], axis=0) / segments
    f = np.fft.rfftfreq(length, step)
    seconds = (segments + len(parts)) * length * step / 2
    made = []
    for low, high in pairwise(edges_hz):
        inside = (f >= low) & (f < high)
        S = total[inside].mean(axis=0)
        made.append((*_one(S, z, u, max(seconds * (high - low), 1.0)), max(seconds * (high - low), 1.0)))
    H, V, rest, count = (np.array(x) for x in zip(*made, strict=True))
    return Answers(H, V, rest, count)


def _one(S: ComplexArray, z: int, u: int, count: float) -> tuple[ComplexArray, Array, Array]:
    """Return response (r, l), its variance and what it leaves (l,) of one band's spectra S (c, c) of z, u and y."""
    Zu, Zy, Zz = S[:z, z : z + u], S[:z, z + u :], S[:z, :z]
    H: ComplexArray = lstsq(Zu, Zy).astype(np.complex128)
    Uu, Uy, Yy = S[z : z + u, z : z + u], S[z : z + u, z + u :], S[z + u :, z + u :]
    rest = np.diag(Yy - H.conj().T @ Uy - Uy.conj().T @ H + H.conj().T @ Uu @ H).real
    rest = np.maximum(rest, 1e-9 * np.diag(Yy).real)
    P = pinv(Zu.conj().T @ lstsq(Zz, Zu))
    return H, np.outer(np.abs(np.diag(P)), rest) / count, rest


def fitted(
    recorded: Answers, run: Answers, at: NDArray[np.bool_], orders: Array, hz: float, place: tuple[int, Sequence[int]],
    slack: float,
) -> Fit:  # fmt: skip
    """Fit a gain of every output and one delay to how outputs answer an input in bands `at` (k,), a mask.

    place: of the input and of the outputs; slack: part of a response that no such form need explain.
    """
    i, outputs = place
    a, b, v, w = (x[at, i][:, list(outputs)] for x in (recorded.H, run.H, recorded.V, run.V))
    s = 2j * np.pi * hz * orders[at][:, None]
    deviation = np.sqrt(v + w + (slack * np.abs(b)) ** 2)

    def errors(x: Array) -> Array:
        r = (a - np.exp(x[1:] - s * x[0]) * b) / deviation
        return np.asarray(np.sqrt(2.0) * np.concatenate([r.real.ravel(), r.imag.ravel()]))

    starts = [np.array([t / (2 * np.pi * hz), *np.zeros(len(outputs))]) for t in (0.0, 0.1, 0.3)]
    far = np.array([0.5 / hz, *[_MOST_GAIN] * len(outputs)])
    fits = (least_squares(errors, x, x_scale="jac", bounds=(-far, far)) for x in starts)
    best = min(fits, key=lambda r: float(r.cost))
    std = np.sqrt(np.diag(pinv(best.jac.T @ best.jac)))
    return Fit(float(best.x[0]), float(std[0]), best.x[1:], std[1:])
