"""Choose the coordinates in which the recursive state space keeps its states: S of x_k = S ΓK z̄_k."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from aeolid.decompositions import svd
from aeolid.errors import NotIdentifiable
from aeolid.identify.windows import triangularise

Array = NDArray[np.float64]
INDEPENDENT = 1e-9  # least singular value of ΓK Z that is not rounding, beside the largest


def choose_states(stacked: Array, windows: Array, order: int, combined: bool) -> Array:
    """Return S (n, f l) from ΓK (f l, p m) and the windows so far (N, p m).

    combined: S = Σ^{−1/2} U' of ΓK Z/√N = U Σ V', the state of paper 000 eq. (27). Else n rows, by QR with pivoting of
    (U Σ)', which weighs how independent a row is against how large; rows chosen from ΓK alone, far ahead and small,
    gave poles off by 0.06. Few windows count as unit noise. Raises NotIdentifiable with fewer than n independent rows.
    """
    width = stacked.shape[1]
    root = triangularise(np.vstack([windows, np.eye(width)])) / np.sqrt(len(windows) + 1)
    left, values, _ = svd(stacked @ root.T)
    rank = int(np.count_nonzero(values > INDEPENDENT * max(float(values[0]), 1e-300)))
    if rank < order:
        raise NotIdentifiable(
            f"the Markov parameters show {rank} states above rounding, {order} were asked for; lower the order or wait"
            " until the filter has converged"
        )
    if combined:
        scaled: Array = left[:, :order].T / np.sqrt(values[:order])[:, None]
        return scaled
    _, _, pivots = qr((left[:, :order] * values[:order]).T, mode="economic", pivoting=True)
    rows: Array = np.eye(len(stacked))[np.sort(pivots[:order])]
    return rows
