"""Find inputs that act on the outputs within the sample, and tell them from inputs computed from those outputs.

What the past does not tell of y_k and what it does not tell of u_k hang together where u acts on y within the sample
(D ≠ 0), and also where a controller computes u_k from y_k (F ≠ 0): the correlation alone does not say which. Five
questions do, in this order, for each input:

1. Is there a correlation? Without one, D and F are below what the recording shows, and the mask does not matter.
2. Is the input in a loop at all? Past innovations of the outputs that tell of u_k, beyond its own past, are a loop.
   Without one the correlation is D, unless question 4 says that the input is computed from y_k.
3. Is what moves the input recorded (role excitation or disturbance)? It is no consequence of y, and what is left of the
   input's innovation besides hangs together with what is left of the outputs' by D alone, or by F too.
4. Does a short memory tell u_k as well as the long one? A controller has few states. With F the short memory does so
   where y_k is in it, and not where it is left out, since y_k has then to be predicted, which takes a long one; with a
   sample of delay it does without y_k.

5. Few states (`plant_states`): asked of inputs that are still without feedthrough.

Where none answers, the input has no feedthrough and a sentence says what to do. The rule fails for a controller of as
many states as the window, for noise in the controller that is coloured (no short memory is enough: undecided), and for
D and F of the same input together where F is too small to show in question 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from aeolid.decompositions import lstsq, pinv
from aeolid.identify.correlation import lagged_correlation, whiten
from aeolid.identify.windows import WindowFactor

Array = NDArray[np.float64]
LEVEL = 0.01  # chance that any input of a recording is said to act within the sample when none does
LOOP_LEVEL = 0.01  # of the test of a loop, for each input: a loop missed biases D, one too many asks questions 3 and 4
LOOP_LAGS = 2, 20  # a controller that shows at once, and one that shows over many samples
MOVES = 0.05  # of an input's innovation power, that a recorded excitation must explain to answer question 3
BIASED = 0.02  # correlation of what is left: below it D is hardly biased
SHORTEST, WEAK = 1, 1e-8  # shares of power below WEAK are rounding
POSSIBLE, EXCLUDED = 1e-2, 1e-6  # p-values: above the one a short memory may do, below the other it does not


@dataclass(frozen=True)
class Feedthrough:
    """Hold the answer for one input: on, sure (False where data do not tell), the p-value of the correlation, why."""

    name: str
    on: bool
    sure: bool
    p_value: float
    output: str
    reason: str

    def to_json(self) -> dict[str, Any]:
        """Return the answer as JSON facts."""
        return dict(self.__dict__)

    def warning(self) -> str:
        """Return the sentence for an input that could not be decided, empty for the others."""
        if self.sure:
            return ""
        return (
            f"input {self.name!r} and output {self.output!r} hang together within the sample, and the recording does "
            f"not tell whether the input acts at once or is computed from that output: taken without feedthrough. Give "
            f"--feedthrough {self.name} where the loop has a sample of delay, --feedthrough none where it has not, or "
            "record what moves the input with the role excitation"
        )


def lag_zero(e: Array, v: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return p-values (r,) of e (N, l) hanging together with columns of v (N, r), and the outputs (r,) that do most.

    Each input is judged given the others; the l tests of an input are one χ² test with l degrees of freedom, given the
    outputs' own correlation, and the r p-values are to be compared with a level over r.
    """
    N, outputs = e.shape
    e, v = e - e.mean(axis=0), v - v.mean(axis=0)
    p, most = np.ones(v.shape[1]), np.zeros(v.shape[1], dtype=np.intp)
    for i in range(v.shape[1]):
        others = np.delete(v, i, axis=1)
        own, left = (a - others @ lstsq(others, a, rcond=1e-10) for a in (v[:, i], e))
        if not own @ own > WEAK * N * 1e-4:
            continue
        size = left / np.maximum(np.sqrt((left**2).sum(axis=0)), 1e-300)
        rho = size.T @ own / np.sqrt(own @ own)
        share = min(float(rho @ pinv(size.T @ size, rcond=1e-10, hermitian=True) @ rho), 1 - 1e-12)
        p[i] = chdtrc(outputs, -N * np.log1p(-share))
        most[i] = int(np.argmax(abs(rho)))
    return p, most


def loop_p_value(e: Array, u: Array) -> float:
    """Return the p-value of innovations e (N, l) of the past telling of an input u (N,) beyond its own past.

    χ² over 2 and over 20 lags, the smallest over both and over the outputs times their number.
    """
    white = whiten(u)
    values = []
    for column in (e / np.maximum(e.std(axis=0), 1e-300)).T:
        rho = lagged_correlation(white, column, min(max(LOOP_LAGS), max(len(u) // 20, 1)))
        values += [float(chdtrc(min(lags, len(rho)), len(u) * float(np.sum(rho[:lags] ** 2)))) for lags in LOOP_LAGS]
    return float(min(1.0, len(values) * min(values)))


def ask_excitation(e: Array, v: Array, i: int, x: Array) -> bool | None:
    """Say whether input i acts within the sample and is not computed from the outputs; None where x does not tell.

    e (N, l), v (N, r): what the past leaves of outputs and inputs; x (N, q): recorded excitations. True: D shows and
    nothing says F; False: F shows, or D does not.
    """
    white = np.column_stack([whiten(column) for column in x.T])
    explained = white @ lstsq(white, v, rcond=1e-10)
    share = (explained**2).sum(axis=0) / np.maximum((v**2).sum(axis=0), 1e-300)
    moved = np.flatnonzero(share > MOVES)
    if i not in moved:
        return None
    gain = lstsq(explained[:, moved], e, rcond=1e-10)  # (moved, l)
    rest, own = e - v[:, moved] @ gain, (v - explained)[:, i]
    scale = np.sqrt((rest**2).sum(axis=0))
    rho = rest.T @ own / np.maximum(scale * np.sqrt((v[:, i] ** 2).sum()), 1e-300)
    noise = np.sqrt(max(float(own @ own), 0.0) / float((v[:, i] ** 2).sum()) / len(v))
    if np.any(abs(rho) > np.maximum(4 * noise, BIASED)):
        return False
    p, _ = lag_zero(e, explained[:, moved])
    return bool(p[moved.tolist().index(i)] < LEVEL)


def ask_memory(factor: WindowFactor, i: int) -> bool | None:
    """Say whether a short memory without the present outputs tells input i (True) or only one with them (False).

    None where neither does, or both do. factor: of a window long enough to predict the outputs.
    """
    m, width = factor.channels, factor.past * factor.channels
    target = factor.u_now[:, i]
    for lags in range(SHORTEST, max(factor.past // 3, SHORTEST) + 1):
        past = factor.R[:, width - lags * m : width]
        values = []
        for now in (np.zeros((len(target), 0)), factor.y_now):
            long, short = (_power(np.hstack([a, now]), target) for a in (factor.R[:, :width], past))
            freedom = max(factor.windows - width - now.shape[1] - 1, 1)
            statistic = freedom * np.log(max(short, 1e-300) / max(long, 1e-300))
            values.append(float(chdtrc(max(width - lags * m, 1), max(statistic, 0.0))))
        without, with_now = values
        if without > POSSIBLE and with_now < EXCLUDED:
            return True
        if with_now > POSSIBLE and without < EXCLUDED:
            return False
        if without > POSSIBLE and with_now > POSSIBLE:
            return None
    return None


def _power(rows: Array, target: Array) -> float:
    left = target - rows @ lstsq(rows, target, rcond=1e-12)
    return float(left @ left)
