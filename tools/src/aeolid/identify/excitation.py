"""Refuse inputs from which a model cannot be told, whatever the noise: they name condition, found and needed.

Rank alone does not say it: under noise the outputs' past excites its own regressors, and what the inputs leave open
would be filled by the smallest solution.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq, singular_values
from aeolid.errors import NotIdentifiable
from aeolid.identify.windows import WindowFactor

Array = NDArray[np.float64]
EXCITED = 1e-10  # of the largest singular value of an input's windows; smooth inputs fall far and still serve
OWN = 1e-5  # of an input's size, what the others must leave of it: more than binary32 does, with means of 100 sizes


def require_own_excitation(
    factor: WindowFactor, names: Sequence[str], order: int, feedthrough: Sequence[bool], source: str
) -> None:
    """Refuse an input that spans fewer directions than it has coefficients, or that the others determine.

    A transfer function of order n has n numerator coefficients an input, one more with feedthrough: so many directions
    of its past must be excited, which leaves out a sine for n > 2. An input that is a fixed combination of the others
    and their past has no effect of its own. names: inputs in the factor's order. Raises NotIdentifiable.
    """
    columns = input_columns(factor)
    for i, name in enumerate(names):
        s = singular_values(columns[:, :, i])
        rank, needed = int(np.count_nonzero(s > EXCITED * s[0])), min(order + bool(feedthrough[i]), factor.past + 1)
        if rank < needed:
            raise NotIdentifiable(
                f"{source}: input {name!r} is not persistently exciting: over past window {factor.past} it spans "
                f"{rank} of {factor.past + 1} directions, order {order} needs {needed}; excite it over the frequencies "
                "of interest, or lower the order"
            )
    require_told_apart(columns, names, source)
    require_no_bare_feedback(factor, names, feedthrough, source)


def require_no_bare_feedback(
    factor: WindowFactor, names: Sequence[str], feedthrough: Sequence[bool], source: str
) -> None:
    """Refuse an input that is a fixed combination of the outputs of its sample: a feedback to which nothing is added.

    The columns of u in eq. (23) then repeat those of y, and the smallest Ξ shares the plant out between them: with
    y⁺ = .9 y + .5 u + e under u = −.4 y a pole of .35. With feedthrough the plant itself may be that combination.
    """
    now = np.hstack([factor.u_now, factor.y_now])
    for i, name in enumerate(names):
        if not feedthrough[i] and share_left(np.delete(now, i, axis=1), now[:, i]) < OWN:
            raise NotIdentifiable(
                f"{source}: input {name!r} is a fixed combination of outputs and other inputs of the same sample, a "
                "feedback to which nothing is added: it shows no plant; move it by a dither or set points, or give the "
                "role 'ignore' to what only repeats it"
            )


def require_states(factor: WindowFactor, rank: int, order: int, feedthrough: Sequence[bool], source: str) -> None:
    """Refuse windows without noise that inputs and states do not fill.

    The windows of a system of order n span a direction for each sample of the inputs in them and n more, if the inputs
    excite p + n directions (the fundamental lemma of Willems et al.); noise on the outputs only adds. With fewer, Ξ is
    one of many, and the smallest has other poles. rank: directions of the regressors above rounding.
    """
    inputs = factor.past * factor.inputs + sum(feedthrough)
    if rank < inputs + order:
        raise NotIdentifiable(
            f"{source}: the data excite {rank} directions of past window {factor.past}; its {inputs} samples of inputs "
            f"and order {order} need {inputs + order}; excite every input over more frequencies, or use a shorter past "
            "window"
        )


def require_told_apart(columns: Array, names: Sequence[str], source: str) -> None:
    """Refuse an input that the others and their past determine; columns (rows, p + 1, r): oldest sample first."""
    for i, name in enumerate(names):
        others = [j for j in range(len(names)) if j != i]
        if others and share_left(columns[:, :, others].reshape(len(columns), -1), columns[:, -1, i]) < OWN:
            rest, past = ", ".join(names[j] for j in others), columns.shape[1] - 1
            raise NotIdentifiable(
                f"{source}: input {name!r} is a fixed combination of {rest} over past window {past}: their effects "
                "cannot be told apart; excite each by itself, or give one the role 'ignore'"
            )


def input_columns(factor: WindowFactor) -> Array:
    """Return the inputs of a window in the coordinates of R, (q, p + 1, r), oldest first."""
    m, r, R = factor.channels, factor.inputs, factor.R
    return np.stack([R[:, k * m : k * m + r] for k in range(factor.past + 1)], axis=1)


def share_left(regressors: Array, target: Array) -> float:
    """Return what least squares leaves of a target (q,), relative to its size."""
    norm = np.sqrt((regressors**2).sum(axis=0))
    rows = regressors / np.where(norm > 0, norm, 1.0)
    left = target - rows @ lstsq(rows, target, rcond=1e-12)
    return float(np.linalg.norm(left)) / max(float(np.linalg.norm(target)), 1e-300)
