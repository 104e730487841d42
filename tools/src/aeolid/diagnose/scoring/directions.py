"""Span what each hypothesis moves in the innovations and the baseline cannot: the directions of the score bank (S4)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import shifted
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.predictor.quiet import audible
from aeolid.diagnose.predictor.sensitivity import Variant, columns, gain_variant, noise_variant, theta_variant
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.stats.projection import outside, span

Array = NDArray[np.float64]
_TOGETHER = 10  # attachments in one model of the bank
_DIVERGED = 1e100  # a step of the effect made the model run away: it says nothing near the null


@dataclass(frozen=True, eq=False)
class Cell:
    """Hold one hypothesis at one grid point: what moves, and H R = G̃, what of its directions is nobody else's.

    names, gains: the quantities that say something; basis H (M + p, df) orthonormal, triangle R (df, df); one_sided:
    physics has one sign.
    """

    grid: Mapping[str, float]
    names: tuple[str, ...]
    gains: tuple[tuple[str, int], ...]
    basis: Array
    triangle: Array
    one_sided: bool


@dataclass(frozen=True, eq=False)
class _Direction:
    """Hold what one cell of the bank asks: which quantities move (θ by name, gains by state and output), and where."""

    attachment: Attachment
    grid: Mapping[str, float]
    names: tuple[str, ...]
    gains: tuple[tuple[str, int], ...]
    variants: tuple[Variant, ...]


def _directions(predictor: Predictor, fit: Fit, attachment: Attachment) -> list[_Direction]:
    local = [s for s in attachment.slots if s.local]
    if not local and not attachment.gain_states:
        return []
    model = predictor.compiled.model
    states = [s.name for s in model.states]
    outputs = predictor.segments[0].y.shape[1]
    result = []
    for grid in attachment.grid:
        point = shifted(fit.point, model, grid)
        variants = [theta_variant(point, {model.index(s.name): s.size}) for s in local]
        stirred = () if point.K is None else attachment.gain_states
        gains = [(g, j) for g in stirred for j in range(outputs)]
        variants += [gain_variant(predictor, point, states.index(g), j) for g, j in gains]
        if point.K is None and attachment.gain_states:  # the state that noise drives: the last of the pair
            gains = [(attachment.gain_states[-1], -1)]
            variants.append(noise_variant(point, states.index(gains[0][0])))
        names = tuple(s.name for s in local)
        result.append(_Direction(attachment, grid, names, tuple(gains), tuple(variants)))
    return result


def cells_of(prepared: Prepared, attachments: Sequence[Attachment], baseline: Array) -> Iterator[list[Cell]]:
    """Yield each attachment's cells.

    A few attachments at a time are put into the model: each one makes every pass slower, each model costs its
    translation.
    """
    for first in range(0, len(attachments), _TOGETHER):
        some = attachments[first : first + _TOGETHER]
        yield from _cells_of(prepared.only((*prepared.attachments, *some)), some, baseline)


def _cells_of(stage: Prepared, attachments: Sequence[Attachment], baseline: Array) -> list[list[Cell]]:
    predictor, fit = stage.predictor, stage.fit
    asked = [_directions(predictor, fit, a) for a in attachments]
    variants = [v for of_one in asked for d in of_one for v in d.variants]
    # states at rest may still turn the last digits of the Kalman gain: compare with this model's own null
    base = predictor.whitened(predictor.innovations(fit.point), fit.noise)
    moved = columns(predictor, fit.point, fit.noise, base, variants)
    known = np.zeros((len(fit.prior_residual), len(variants)))  # what was known before says nothing of an effect
    directions, result = np.vstack([moved, known]), []
    projected = outside(directions, baseline)  # all at once: a product of matrices, not of vectors
    first = 0
    for of_one in asked:
        found = []
        for d in of_one:
            own = slice(first, first + len(d.variants))
            cell = _cell(d, directions[:, own], projected[:, own])
            first = own.stop
            found += [cell] if cell else []
        result.append(found)
    return result


def _cell(asked: _Direction, G: Array, projected: Array) -> Cell | None:
    """Span what of one cell's directions the baseline's own leave over; None where they say nothing of their own."""
    rules = in_force().scoring
    if not np.all(np.abs(G) < _DIVERGED):  # NaN too
        return None
    size = np.linalg.norm(G, axis=0)
    keep = np.linalg.norm(projected, axis=0) > rules.absorbed_share * np.maximum(size, 1e-300)
    keep &= size > rules.felt_deviations / _reaches(asked)
    keep[keep] = _independent(projected[:, keep] / size[keep])
    if not np.any(keep):
        return None
    Q, R = np.linalg.qr(projected[:, keep] / size[keep])
    R = R * size[keep]
    if len(R) == 1 and R[0, 0] < 0:
        Q, R = -Q, -R
    labels: list[str | tuple[str, int]] = [*asked.names, *asked.gains]
    kept = [n for n, k in zip(labels, keep, strict=True) if k]
    local = [s for s in asked.attachment.slots if s.local]
    sided = len(kept) == 1 and len(local) == 1 and local[0].low == local[0].null
    return Cell(
        asked.grid, tuple(n for n in kept if isinstance(n, str)), tuple(n for n in kept if not isinstance(n, str)),
        Q, R, sided,
    )  # fmt: skip


def _reaches(asked: _Direction) -> Array:
    """Return how far each direction's quantity can go: a size over its whole range, a noise gain without end."""
    spans = {s.name: s.high - s.low for s in asked.attachment.slots}
    return np.array([*(spans[n] for n in asked.names), *([np.inf] * len(asked.gains))])


def _independent(scaled: Array) -> NDArray[np.bool_]:
    """Tell which columns to keep so that none is a sum of the others, the largest first."""
    if not scaled.shape[1]:
        return np.zeros(0, dtype=bool)
    _, R, order = qr(scaled, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    kept = np.zeros(scaled.shape[1], dtype=bool)
    kept[order[: len(diagonal)][diagonal > in_force().scoring.absorbed_share * diagonal[0]]] = True
    return kept


def deviations(prepared: Prepared, attachments: Sequence[Attachment]) -> dict[str, float]:
    """Return, by key, the smallest deviation of each attachment's first quantity over its grid, in white noise.

    That of its share where it has one; what the baseline absorbs is projected out. Left out is what says nothing here.
    Cost: that of the score bank without its thresholds.
    """
    found = {}
    for attachment, cells in zip(attachments, cells_of(prepared, attachments, own_of(prepared)), strict=True):
        own = []
        for cell in (c for c in cells if c.names):
            place = cell.names.index(attachment.share) if attachment.share in cell.names else 0
            own.append(float(np.linalg.norm(np.linalg.inv(cell.triangle)[place])))
        if own:
            found[attachment.key] = min(own)
    return found


def own_of(prepared: Prepared) -> Array:
    """Return an orthonormal basis (M + p, q) of what the baseline's own parameters can do; silent forces have none."""
    fit = prepared.fit
    return span(np.vstack([fit.jacobian, fit.prior_jacobian])[:, audible(prepared.predictor.compiled.model, fit)])
