"""Decompose the windows of a loop into what the disturbance explains and the rest: paper 002 eq. (24), (25), (27).

A block is z = [u; y] as everywhere, the disturbances r among its inputs; the joint process is w = [y; u], u the inputs
under feedback. One window factor of p + f + 1 samples holds everything the paper asks of the data: its LQ
decomposition (24) is a second, small QR of the same columns in the order r future, r past, w past, w future, and the
states one sample later are the same function of the columns one sample later. Nothing of the recording's length is
formed, and recordings merge as factors do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from aeolid.decompositions import singular_values, svd
from aeolid.errors import NotIdentifiable
from aeolid.identify.windows import Scaling, WindowFactor, triangularise

Array = NDArray[np.float64]
OWN_NOISE = 1e-5  # smallest singular value of the stochastic component, relative to the whole: below, it is rounding,
# of binary32 too with means of 100 deviations; dither and noise as small as that show no plant


@dataclass(frozen=True)
class Layout:
    """Say which channels of a block are what: places of r (q,) and u (m,) among its inputs, and of y (l,).

    past, future: p and f samples of the two halves of a window. through (q,): disturbances that act on the outputs
    within the sample.
    """

    disturbances: tuple[int, ...]
    controls: tuple[int, ...]
    outputs: tuple[int, ...]
    past: int
    future: int
    through: tuple[bool, ...]

    @property
    def joint(self) -> tuple[int, ...]:
        """Return the places of w = [y; u], (l + m,)."""
        return self.outputs + self.controls

    @property
    def block(self) -> int:
        """Return the number of channels of a block."""
        return len(self.joint) + len(self.disturbances)

    @property
    def block_through(self) -> tuple[bool, ...]:
        """Return for each input of a block whether it acts within the sample: some disturbances do, u never."""
        acting = {place for place, through in zip(self.disturbances, self.through, strict=True) if through}
        return tuple(place in acting for place in range(len(self.disturbances) + len(self.controls)))

    def columns(self, places: tuple[int, ...], start: int, stop: int) -> list[int]:
        """Return the columns of these channels in samples start … stop − 1 of a window, sample by sample."""
        return [sample * self.block + place for sample in range(start, stop) for place in places]


@dataclass(frozen=True, eq=False)
class Lq:
    """Hold the blocks of eq. (24) that are used, and Π with W = Π' R in the columns of the window factor.

    s = l + m joint channels, q disturbances: L11 (f q, f q), L41 (f s, f q), L42 (f s, p q), L33 (p s, p s),
    L43 (f s, p s), L44 (f s, f s); Π ((p + f) q, (p + f) s) for rows r future, r past.
    """

    L11: Array
    L41: Array
    L42: Array
    L33: Array
    L43: Array
    L44: Array
    projection: Array


def decompose_windows(factor: WindowFactor, layout: Layout) -> Lq:
    """Return the LQ decomposition (24) of the windows behind the factor. Cost: 2/3 ((p + f)(l + m + q))³."""
    p, f, r, w = layout.past, layout.future, layout.disturbances, layout.joint
    order = [
        *layout.columns(r, p, p + f), *layout.columns(r, 0, p), *layout.columns(w, 0, p), *layout.columns(w, p, p + f),
    ]  # fmt: skip
    R = triangularise(factor.R[:, order])
    a, b = f * len(r), (p + f) * len(r)
    c = b + p * len(w)
    L = R.T
    projection = solve_triangular(R[:b, :b], R[:b, b:])
    return Lq(L[:a, :a], L[c:, :a], L[c:, a:b], L[b:c, b:c], L[c:, b:c], L[c:, c:], projection)


def stochastic_rows(factor: WindowFactor, layout: Layout, lq: Lq, places: slice, shift: int) -> Array:
    """Return the stochastic component of rows of W_{0|p+f−1} moved on by `shift` samples, (columns of R, rows)."""
    p, f, r, w = layout.past, layout.future, layout.disturbances, layout.joint
    explained = [*layout.columns(r, p + shift, p + f + shift), *layout.columns(r, shift, p + shift)]
    rows = layout.columns(w, shift, p + f + shift)[places]
    out: Array = factor.R[:, rows] - factor.R[:, explained] @ lq.projection[:, places]
    return out


def require_disturbance(factor: WindowFactor, layout: Layout, scaling: Scaling, source: str) -> float:
    """Refuse a disturbance that does not excite every direction of the windows (assumption A3).

    Returns the condition of R_{0|p+f−1}. Raises NotIdentifiable with the order of persistent excitation found and the
    one needed.
    """
    needed, q = layout.past + layout.future, len(layout.disturbances)

    def values(order: int) -> Array:
        return svd(triangularise(factor.R[:, layout.columns(layout.disturbances, 0, order)]))[1]

    floor = max(factor.windows, needed * q) * np.finfo(float).eps
    full = values(needed)
    if full[-1] > floor * full[0]:
        return float(full[0] / full[-1])
    low, high = 0, needed  # excited of order `low`, not of order `high`
    while high - low > 1:
        middle = (low + high) // 2
        some = values(middle)
        low, high = (middle, high) if some[-1] > floor * full[0] else (low, middle)
    names = ", ".join(scaling.inputs[i] for i in layout.disturbances)
    raise NotIdentifiable(
        f"{source}: disturbance {names} is persistently exciting of order {low}, past and future window together need "
        f"{needed}; take shorter windows, or a recording in which it moves over more frequencies"
    )


def require_own_noise(lq: Lq, layout: Layout, scaling: Scaling, source: str) -> None:
    """Refuse a loop whose inputs follow from outputs and disturbance alone: the plant is then one of many.

    Raises NotIdentifiable with the rank found and the one needed.
    """
    s = singular_values(lq.L33)
    size = np.sqrt(np.linalg.norm(lq.L33) ** 2 + np.linalg.norm(lq.projection) ** 2)
    rank = int(np.count_nonzero(s > OWN_NOISE * size))
    if rank == len(s):
        return
    names = ", ".join(scaling.inputs[i] for i in layout.controls)
    raise NotIdentifiable(
        f"{source}: what the disturbance leaves open of inputs and outputs has rank {rank} in a past window of "
        f"{layout.past} samples, {len(s)} is needed: {names} must move by more than the disturbance and a feedback of "
        "the outputs (a set point, a dither, noise), and each output by noise of its own"
    )
