"""Say whether a past window is long enough: the poles of the same windows at twice the length must agree.

(A − K C)ᵖ is what a window of p samples leaves of the state before it. Where it is not small the predictor is biased,
and its poles with it, by more than deviations say, which assume it away. The window of 2 p samples has its square.
Poles of the two that differ by more than the deviations of either explain are a finding, and so is a mode that only the
longer window shows. Both are fitted to the same windows, so that their noise is alike and chance moves them little.
Where even twice the window is too short, both may agree on the same wrong pole: a window that is shorter than the
slowest period, and whose error a longer one lowers, is too short too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.markov import estimate_markov
from aeolid.identify.order import worth_a_state
from aeolid.identify.subspace import StateBasis, find_states, largest_useful_order, least_squares, system_matrices
from aeolid.identify.uncertainty import matrix_spread, pole_covariance
from aeolid.identify.windows import WindowFactor
from aeolid.models.modes import pole_words
from aeolid.wording import counted

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
APART = 4.0  # deviations between poles of two windows; by chance, for several poles, one in a few hundred recordings
MATERIAL = 2e-4  # of |log z|: poles that differ by less are the same, whatever their deviations
FAST = 0.45  # of the sample rate: modes above are not compared
LOWERED = 0.02  # of the error power: what a longer window must gain for it to be missed
SLOW = 2.0  # periods in the window: a mode that has more of them does not go missing for want of a longer window
KNOWN = 0.2  # of |log z|: a pole of a larger deviation is not known well enough to be missed
LARGEST_ORDER = 40


@dataclass(frozen=True, eq=False)
class WindowFit:
    """Hold the poles (n,) of the model of one window, their covariance (n, 2, 2), and the window p.

    log_power: mean log power per output of the held-out one-step errors of the window's predictor.
    """

    past: int
    poles: ComplexArray
    covariance: Array
    log_power: float

    @property
    def order(self) -> int:
        """Return the number of states."""
        return len(self.poles)


@dataclass(frozen=True)
class WindowCheck:
    """Hold whether the deviations hold for a window: holds is None where nothing longer could be tried.

    past, compared: the windows in samples; frequency_hz, apart: of the pole that moves most, and by how many
    deviations; reason: a sentence, empty where they hold; missed: whether the window has no such pole, and only the
    longer one shows it.
    """

    holds: bool | None
    past: int
    compared: int | None
    frequency_hz: float | None
    apart: float
    reason: str
    missed: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return the check as JSON facts."""
        return dict(self.__dict__)


def fit_window(
    whole: WindowFactor, halves: tuple[WindowFactor, WindowFactor], through: tuple[bool, ...],
    regularization: str | float, order: int | None = None,
) -> WindowFit:  # fmt: skip
    """Fit a model of one window to a factor, with the covariance of its poles.

    halves: factors of the same window of the part that is fitted and of the held-out part, which chooses the order
    where none is given. Cost: a few q³ operations, none of the length of the recording.
    """
    estimate = estimate_markov(whole, through, regularization)
    basis = find_states(whole, estimate.theta, whole.past)
    most = max(min(LARGEST_ORDER, largest_useful_order(basis), whole.windows // (4 * whole.channels)), 1)
    if order is None:
        order = _order(halves, through, regularization, most)
    T = basis.state_map(min(order, most))
    model = system_matrices(whole, T, through)
    spread = matrix_spread(whole, basis, model, estimate, through)
    poles = np.linalg.eigvals(model.A).astype(complex)
    power = held_out_power(halves, through, regularization)
    return WindowFit(whole.past, poles, pole_covariance(model.A, spread), power)


def held_out_power(
    halves: tuple[WindowFactor, WindowFactor], through: tuple[bool, ...], regularization: str | float
) -> float:
    """Return the mean log power per output of the one-step errors, on the second factor, of Ξ of the first."""
    fitted, held_out = halves
    theta = estimate_markov(fitted, through, regularization).theta
    error = held_out.y_now - held_out.R[:, : theta.shape[1]] @ theta.T
    power = (error**2).sum(axis=0) / max(held_out.windows, 1)
    return float(np.mean(np.log(np.maximum(power, 1e-10))))


def compare_windows(short: WindowFit, longer: Sequence[WindowFit], sample_time_s: float) -> WindowCheck:
    """Compare the poles of a window with those of longer ones: every mode of either must be in both.

    longer: fits of the longer window, of the order of the short one and of its own; a mode of the short window must be
    in one of them, and the known modes of the last one in the short window.
    """
    missed = [(p, d) for p, d in _distances(longer[-1], short) if _pace(p) * short.past < SLOW * 2 * np.pi]
    worst, apart = max(_moved(short, longer), key=_second, default=(0j, 0.0))
    only = apart <= APART  # a pole of the window's own is named before one that it has not
    if only:
        worst, apart = max([(worst, apart), *missed], key=_second)
    slowest = min((complex(p) for p in short.poles if abs(p) > 0), key=_pace, default=0j)
    gain = short.log_power - longer[-1].log_power
    if apart <= APART:
        period = 2 * np.pi / max(_pace(slowest), 1e-12) if slowest else 0.0
        if gain <= LOWERED or period <= short.past:
            return WindowCheck(True, short.past, longer[-1].past, None, float(apart), "")
        worst = slowest
    return WindowCheck(
        False, short.past, longer[-1].past, float(_pace(worst) / (2 * np.pi * sample_time_s)), float(apart),
        _too_short((short, longer[-1]), worst, apart, gain, sample_time_s, only), only,
    )  # fmt: skip


def _too_short(
    fits: tuple[WindowFit, WindowFit], worst: complex, apart: float, gain: float, step: float, missed: bool
) -> str:
    """Return why the first of two windows is too short, with the pole that moves most, or that it misses."""
    (short, long), pole = fits, pole_words(_pace(worst) / (2 * np.pi * step), worst.imag == 0)
    slowest = min((_pace(p) for p in (*short.poles, worst) if abs(p) > 0), default=0.0)
    if apart <= APART:
        found = f"the error power is lower by {-np.expm1(-gain):.0%}"
    elif missed:
        found = f"{pole} appears, {min(apart, 999):.0f} standard deviations from all that this window shows"
    else:
        found = f"{pole} differs by {min(apart, 999):.0f} standard deviations"
    return (
        f"the past window of {counted(short.past, 'sample')} ({short.past * step:.4g} s; the slowest period is near "
        f"{2 * np.pi * step / max(slowest, 1e-9):.3g} s) is too short: with {counted(long.past, 'sample')} {found}; "
        "standard deviations do not hold"
    )


def _pace(pole: complex) -> float:
    """Return |log z|, the natural frequency in radians a sample."""
    return float(abs(np.log(pole))) if pole else np.inf


def _moved(short: WindowFit, longer: Sequence[WindowFit]) -> list[tuple[complex, float]]:
    """Return each mode of the short window with the least distance to the longer ones' nearest pole."""
    by_fit = [_distances(short, other) for other in longer]
    return [min(options, key=_second) for options in zip(*by_fit, strict=True)]


def _second(item: tuple[complex, float]) -> float:
    return item[1]


def _distances(here: WindowFit, there: WindowFit) -> list[tuple[complex, float]]:
    """Return the modes of one fit that are known, each with its distance to the nearest pole of another, in deviations.

    The covariance is the larger of the pole's own and that of the one nearest to it.
    """
    out = []
    for pole, covariance in zip(here.poles, here.covariance, strict=True):
        if not _is_mode(pole) or not np.isfinite(covariance).all():
            continue
        if np.sqrt(np.trace(covariance)) > KNOWN * abs(np.log(pole)):
            continue
        apart = []
        for other, spread in zip(there.poles, there.covariance, strict=True):
            difference = np.array([other.real - pole.real, other.imag - pole.imag])
            if abs(other - pole) <= MATERIAL * abs(np.log(pole)):
                apart.append(0.0)
                continue
            own = covariance if float(np.trace(covariance)) >= float(np.nan_to_num(np.trace(spread))) else spread
            own = own + (MATERIAL * abs(np.log(pole))) ** 2 * np.eye(2)
            apart.append(float(np.sqrt(max(float(difference @ np.linalg.solve(own, difference)), 0.0))))
        out.append((pole, min(apart, default=np.inf)))
    return out


def _is_mode(pole: complex) -> bool:
    """Say whether a pole is compared: one of each pair, not near Nyquist."""
    return bool(pole.imag >= 0 and _pace(pole) < 2 * np.pi * FAST)


def _order(
    halves: tuple[WindowFactor, WindowFactor], through: tuple[bool, ...], regularization: str | float, most: int
) -> int:
    """Return the smallest order whose one-step error on the held-out factor is no more than chance above the least."""
    fitted, held_out = halves
    basis = find_states(fitted, estimate_markov(fitted, through, regularization).theta, fitted.past)
    most = max(min(most, largest_useful_order(basis)), 1)
    losses = np.array([order_loss(fitted, held_out, basis, n, through) for n in range(1, most + 1)])
    allowed = worth_a_state(held_out.windows)
    return int(np.flatnonzero(losses <= losses.min() + allowed)[0]) + 1


def order_loss(
    fitted: WindowFactor, held_out: WindowFactor, basis: StateBasis, order: int, through: tuple[bool, ...]
) -> float:
    """Return the mean log error power per output of C x + D u, x of the window, on the held-out factor."""
    T, on = basis.state_map(order), np.flatnonzero(through)
    width = fitted.past * fitted.channels
    rows, unseen = (np.hstack([f.R[:, :width] @ T.T, f.u_now[:, on]]) for f in (fitted, held_out))
    error = held_out.y_now - unseen @ least_squares(rows, fitted.y_now).T
    power = (error**2).sum(axis=0) / max(held_out.windows, 1)
    return float(np.mean(np.log(np.maximum(power, 1e-10))))
