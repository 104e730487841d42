"""Join the parts of a mode's shape that several set-ups measured, by the references that all of them share.

Set-up i knows the shape φ_i of its own sensors up to a complex factor, references first. A factor a_i brings its
references to the common ones ρ by least squares, and ρ is their mean (PoSER: Reynders, Magalhães, De Roeck and Cunha
2009, "Merging strategies for multi-setup operational modal analysis"):
    a_i = φ_i,refᴴ ρ / φ_i,refᴴ φ_i,ref,      ρ = Σ w_i a_i φ_i,ref / Σ w_i,      ψ = [ρ; a_i φ_i,rest …],
with w_i the size of the references in φ_i, squared, over the sum of their variances. The covariance of ψ/ψ_r follows
by linearisation from those of all entries of all φ_i together, which are independent between set-ups.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.clusters import Cluster
from aeolid.identify.diagram import Diagram

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
APPARENT = 5.0  # deviations that references must move by: below, least squares shrink the factor by more than 4 %
STEP = 1e-6  # of the differences that linearise; entries are of size 1


@dataclass(frozen=True, eq=False)
class PartShape:
    """Hold the shape of a mode in one set-up: values (l,), 1 at the output that moves most, references first.

    covariance (2 l, 2 l): of [real parts; imaginary parts], all entries together.
    """

    values: ComplexArray
    covariance: Array
    references: int

    @property
    def shared(self) -> ComplexArray:
        """Return the entries of the references."""
        return self.values[: self.references]

    @property
    def clearness(self) -> float:
        """Return the size of the references beside the root of the sum of their variances."""
        spread = np.diag(self.covariance).reshape(2, -1)[:, : self.references].sum()
        return float(np.linalg.norm(self.shared) / np.sqrt(max(spread, np.finfo(float).tiny)))

    @property
    def shows(self) -> bool:
        """Tell whether the references move enough for the others to be scaled by them: not at a node of the mode."""
        return self.clearness > APPARENT and float(np.linalg.norm(self.shared)) > 1e-3


def part_shape(cluster: Cluster, diagram: Diagram, order: Sequence[int], scale: Array, references: int) -> PartShape:
    """Return the shape of a mode that was found in a set-up, with the covariance of all entries together.

    order: places of the outputs, references first; scale (l,): of the outputs in that order, comparable over set-ups.
    The median over the models that count; spread of the nearest model, and what the models differ by.
    """
    poles, places = cluster.counted, list(order)
    unit = diagram.scaling.scale[places] / scale
    size = np.median([abs(p.shape[places]) for p in poles], axis=0) * unit
    at = int(np.argmax(size))
    every = np.array([p.shape[places] * unit / (p.shape[places[at]] * unit[at]) for p in poles])
    middle = np.median(every.real, axis=0) + 1j * np.median(every.imag, axis=0)
    hertz = float(np.median([p.frequency_hz for p in poles]))
    nearest = min(poles, key=lambda p: abs(p.frequency_hz - hertz))
    model = diagram.model(nearest.past, nearest.order)
    reached = model.shape_reach(nearest.eigenvalue, places[at])[places] * (unit / unit[at])[:, None]
    apart = (every - every.mean(axis=0)).T / np.sqrt(len(every))
    rows = np.hstack([_parts(reached), _parts(apart)])
    return PartShape(middle, rows @ rows.T, references)


def _parts(values: ComplexArray) -> Array:
    return np.vstack([values.real, values.imag])


def joined(parts: Sequence[PartShape], reference: int | None) -> tuple[ComplexArray, Array, int]:
    """Return the whole shape (L,): references, then the other sensors of each part, with covariances (L, 2, 2).

    reference: the entry that is 1, default the largest, which is returned too.
    """
    weights = np.array([min(p.clearness, 1e6) ** 2 for p in parts])
    counts, shared = [len(p.values) for p in parts], parts[0].references
    middle = _whole([p.values for p in parts], shared, weights)
    at = int(np.argmax(abs(middle))) if reference is None else reference
    given = np.concatenate([p.values for p in parts])

    def shape(values: ComplexArray) -> ComplexArray:
        whole = _whole(np.split(values, np.cumsum(counts)[:-1]), shared, weights)
        out: ComplexArray = whole / whole[at]
        return out

    rows = []
    for turn in (1.0, 1j):
        moved = [(shape(given + STEP * turn * e) - shape(given - STEP * turn * e)) / (2 * STEP)
                 for e in np.eye(len(given))]  # fmt: skip
        rows.append(np.array(moved).T)
    covariance, start = np.zeros((len(middle), 2, 2)), 0
    for part, count in zip(parts, counts, strict=True):
        own = slice(start, start + count)
        J = np.hstack([rows[0][:, own], rows[1][:, own]])  # (L, 2 l): of what the entry of ψ moves by
        both = np.stack([J.real, J.imag], axis=1)
        covariance += both @ part.covariance @ both.transpose(0, 2, 1)
        start += count
    values = shape(given)
    values[at], covariance[at] = 1.0, 0.0  # but for rounding
    return values, covariance, at


def _whole(parts: Sequence[ComplexArray], shared: int, weights: Array) -> ComplexArray:
    """Return the shape up to a factor; the part of the largest weight begins."""
    rho = parts[int(np.argmax(weights))][:shared]
    for _ in range(2):
        factors = [np.vdot(p[:shared], rho) / np.vdot(p[:shared], p[:shared]).real for p in parts]
        rho = sum(
            (w * a * p[:shared] for w, a, p in zip(weights, factors, parts, strict=True)), start=np.zeros(shared)
        ) / weights.sum()  # fmt: skip
    return np.concatenate([rho, *(a * p[shared:] for a, p in zip(factors, parts, strict=True))])
