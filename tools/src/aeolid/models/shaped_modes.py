"""Give the modes of a state-space model their shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.models.modes import Mode
from aeolid.models.shapes import Shape, reference_outputs, scaled_to
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]


def with_shapes(
    modes: Sequence[Mode], model: StateSpace, output_scale: Array, reference: int | None, covariance: Array | None
) -> tuple[Mode, ...]:
    """Return the modes with their shapes; real poles, which only decay, get none.

    output_scale (l,): by which outputs of different units are compared; reference: index of the output that scales, by
    default the one that moves most; covariance (n, l, 2, 2): of real and imaginary part, of outputs in their scales, in
    the order of eig(A), None where it is not known.
    """
    eigenvalues, vectors = np.linalg.eig(model.A)
    raw = (model.C @ vectors / output_scale[:, None]).astype(complex)
    at = reference_outputs(raw, reference)
    shapes, names = scaled_to(raw, at), [s.name for s in model.outputs]
    out = []
    for mode in modes:
        i = int(np.argmin(abs(eigenvalues - mode.eigenvalue)))
        if mode.is_real or not np.isfinite(shapes[:, i]).all():
            out.append(mode)
            continue
        unit = output_scale / output_scale[at[i]]
        values = dict(zip(names, map(complex, shapes[:, i] * unit), strict=True))
        known = None if covariance is None or not np.isfinite(covariance[i]).all() else covariance[i]
        spread = None if known is None else {
            name: (float(s[0, 0] * u**2), float(s[0, 1] * u**2), float(s[1, 1] * u**2))
            for name, s, u in zip(names, known, unit, strict=True)
        }  # fmt: skip
        out.append(replace(mode, shape=Shape(names[at[i]], values, spread)))
    return tuple(out)
