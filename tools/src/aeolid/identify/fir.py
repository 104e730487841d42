"""Identify a linear model from a predictor with inputs only: PBSID for output-error settings in open loop.

With past inputs alone as regressors, y_k = Σ_j C A^{j−1} B u_{k−j} + D u_k + noise, and all that PBSIDopt does with Ξ
follows from these impulse-response coefficients: the rows of ΓK are theirs, x = S ΓK u past. When to use it: in open
loop, where outputs carry strong noise of unknown colour (waves, turbulence, a drifting sensor) that a VARX window of
bearable length cannot whiten, and the plant forgets within the window: Aᵖ must be negligible here, not (A − K C)ᵖ.
Under feedback the noise reaches the inputs and the estimate is biased; lightly damped and integrating modes need too
long a window: varx or varmax there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import aeolid
from aeolid.identify.assemble import LARGEST_AUTO_ORDER, find_modes, model_in_units, with_start
from aeolid.identify.excitation import require_own_excitation
from aeolid.identify.fit import measure_fit
from aeolid.identify.jackknife import jackknife, merged
from aeolid.identify.markov import MarkovEstimate, estimate_markov, require_excitation
from aeolid.identify.missing import Completed
from aeolid.identify.order import (
    OrderChoice,
    about_mean,
    errors_of,
    held_out_stretches,
    known_of,
    largest_gap,
    require_order,
)
from aeolid.identify.prepare import prepare
from aeolid.identify.result import Identification, Settings
from aeolid.identify.settings import make_settings
from aeolid.identify.split import FIT_PART, cut
from aeolid.identify.subspace import (
    ScaledModel,
    StateBasis,
    equilibrium,
    find_states,
    largest_useful_order,
    least_squares,
)
from aeolid.identify.windows import Scaling, WindowFactor, factorise, find_scaling, require_windows, triangularise
from aeolid.models.recursion import run_states
from aeolid.models.state_space import StateSpace
from aeolid.record import Record
from aeolid.wording import counted

Array = NDArray[np.float64]
GROUPS = 20  # stretches of each recording that are left out, one at a time
BLOCKS_LEAST = 4  # of p samples that must be held out
FORGOTTEN = 0.02  # of the slowest mode after the past window; with more left the window is too short


@dataclass(frozen=True, eq=False)
class InputFactor(WindowFactor):
    """Hold the factor of rows [1, u_{k−p} … u_{k−1}, u_k, y_k]: blocks hold the inputs only."""

    @property
    def channels(self) -> int:
        """Return r, the length of a block."""
        return self.inputs

    @classmethod
    def of(cls, factor: WindowFactor) -> InputFactor:
        """Take past outputs out of a window factor."""
        m, r, p = factor.channels, factor.inputs, factor.past
        past = [1 + k * m + i for k in range(p + 1) for i in range(r)]
        now = [1 + p * m + r + j for j in range(factor.outputs)]
        full = triangularise(factor.full[:, [0, *past, *now]])
        return cls(full, p, r, factor.outputs, factor.windows, factor.skipped)


def identify_fir(
    records: Sequence[Record],
    *,
    past: int,
    future: int | None = None,
    order: int | None = None,
    feedthrough: Sequence[str] = (),
    regularization: str | float = "gcv",
    decimation: int = 1,
    delays: Mapping[str, int] | str | None = None,
) -> Identification:
    """Identify x⁺ = A x + B u, y = C x + D u + noise of any colour, in open loop.

    records: one experiment set, merged exactly. past: p samples after which the plant has forgotten (Aᵖ negligible; a
    note says so where the last coefficients are not small). future, order, feedthrough, regularization, decimation,
    delays: as in `identify_varx`; the order by the held-out error of a free run, the smallest within one standard error
    of the best. The model has no K: the noise is not modelled. Deviations of the poles come from leaving out a
    twentieth of each recording at a time, since coloured noise voids the formula of varx.
    Raises as `identify_varx`. Cost: 2 N q² operations, q = (p + 1)(r + l).
    """
    asked = make_settings("fir", records, past, future, order, feedthrough, regularization, None, decimation, False)
    settings = replace(asked, uncertainty="jackknife")
    prepared = prepare(records, settings, delays)
    records = prepared.records
    scaling, source = find_scaling(records, driven=True), records[0].source
    through = tuple(name in feedthrough for name in scaling.inputs)
    require_windows(records, past, len(scaling.inputs))
    spans = [(g / GROUPS, (g + 1) / GROUPS) for g in range(GROUPS)]
    parts = [InputFactor.of(factorise(records, scaling, past, first=a, last=b)) for a, b in spans]
    whole = merged(parts)
    require_windows(records, past, len(scaling.inputs), whole.windows)
    estimate = estimate_markov(whole, through, regularization)
    require_excitation(estimate, source)
    basis = find_states(whole, estimate.theta, settings.future)
    choice = _order(settings, prepared.completed, scaling, through, basis)
    require_order(choice.order, largest_useful_order(basis), source)
    require_own_excitation(whole, scaling.inputs, choice.order, through, source)
    T = basis.state_map(choice.order)
    scaled, count = fit_matrices(whole, T, through), len(scaling.inputs)
    spread = jackknife(parts, np.linalg.eigvals(scaled.A).astype(complex), _poles(settings, choice.order, through))
    model = model_in_units(scaled, equilibrium(whole, T, scaled), scaling, records[0])
    model = with_start(replace(model, K=None, innovation_covariance=None), records)
    result = Identification(
        model=model,
        modes=find_modes(model, scaling.scale[count:], spread, records),
        singular_values=basis.singular_values,
        order_choice=choice,
        fit=measure_fit(model, records),
        markov=estimate,
        markov_parameters=_in_units(estimate.theta, scaling, past),
        scaling=scaling,
        settings=settings,
        data=tuple({"source": r.source, "sha256": r.sha256, "samples": len(r)} for r in records),
        windows=whole.windows,
        skipped=whole.skipped,
        gain_method="none: the noise is not modelled",
        notes=_notes(whole, estimate, model),
        version=aeolid.__version__,
    )
    return prepared.finish(result)


def _order(
    settings: Settings, completed: Completed, scaling: Scaling, through: tuple[bool, ...], basis: StateBasis
) -> OrderChoice:
    if settings.order is not None:
        return OrderChoice(settings.order, f"order {settings.order}: as asked for", ())
    trial = completed.trial
    records, measured = (completed.records, ()) if trial is None else (trial.sets[0], trial.measured)
    fitted = InputFactor.of(factorise(cut(records, scaling, settings.past)[0], scaling, settings.past))
    theta = estimate_markov(fitted, through, settings.regularization).theta
    held_out = held_out_stretches(records, scaling, settings.past, measured=measured)
    return choose_order(fitted, find_states(fitted, theta, settings.future), held_out, through, basis)


def _poles(
    settings: Settings, order: int, through: tuple[bool, ...]
) -> Callable[[WindowFactor], NDArray[np.complex128]]:
    """Return what estimates the poles of this order from another factor."""

    def estimate(factor: WindowFactor) -> NDArray[np.complex128]:
        theta = estimate_markov(factor, through, settings.regularization).theta
        T = find_states(factor, theta, settings.future).state_map(order)
        return np.linalg.eigvals(fit_matrices(factor, T, through).A).astype(complex)

    return estimate


def fit_matrices(factor: WindowFactor, T: Array, feedthrough: tuple[bool, ...]) -> ScaledModel:
    """Return A, B, C, D for the state map T (n, p r) by two regressions without innovations; K is zero."""
    R, m, r, n = factor.R, factor.channels, factor.inputs, len(T)
    width, outputs = factor.past * m, factor.outputs
    now, following = R[:, :width] @ T.T, R[:, m : width + m] @ T.T
    u, y, through = factor.u_now, factor.y_now, np.flatnonzero(feedthrough)
    first, second = least_squares(np.hstack([now, u[:, through]]), y), least_squares(np.hstack([now, u]), following)
    A, B, C = second[:, :n], second[:, n:], first[:, :n]
    D = np.zeros((outputs, r))
    D[:, through] = first[:, n:]
    noise = y - now @ C.T - u @ D.T
    covariance = noise.T @ noise / max(factor.windows - n, 1)
    return ScaledModel(A, B, C, D, np.zeros((n, outputs)), covariance, "none")


def choose_order(
    fitted: WindowFactor, basis: StateBasis, held_out: Sequence[Array], feedthrough: tuple[bool, ...],
    whole: StateBasis,
) -> OrderChoice:  # fmt: skip
    """Choose the smallest order whose free run of the held-out part is within one standard error of the best.

    A share of the error power, as for one-step predictions, would not do: the power is that of the noise, and a poor
    model may add little to it. The standard error is that of the difference between two models over blocks of p samples
    (each output's error in its standard deviations). fitted, basis: of the fit part; whole: of everything, whose gap
    decides where too little is held out or fitted.
    """
    gap = largest_gap(whole.singular_values, min(LARGEST_AUTO_ORDER, largest_useful_order(whole)))
    most = min(LARGEST_AUTO_ORDER, largest_useful_order(basis))
    if most == 0 or sum(max(len(z) - fitted.past, 0) // fitted.past for z in held_out) < BLOCKS_LEAST:
        return OrderChoice(
            gap, f"order {gap}: the singular values fall most there; too few samples to hold some out", ()
        )
    blocks = np.array(
        [_block_errors(fitted, basis.state_map(n), held_out, feedthrough) for n in range(1, most + 1)]
    )  # (most, blocks)
    losses = blocks.mean(axis=1)
    best = int(np.argmin(losses))
    difference = blocks - blocks[best]
    error = difference.std(axis=1, ddof=1) / np.sqrt(blocks.shape[1]) if blocks.shape[1] > 1 else np.zeros(most)
    order = next(i for i in range(most) if losses[i] <= losses[best] + error[i]) + 1
    reason = (
        f"order {order}: the smallest whose free run over the held-out last {1 - FIT_PART:.0%} is within one standard "
        f"error of the best (order {best + 1} of 1 to {most}); the singular values fall most after {gap}"
    )
    return OrderChoice(order, reason, tuple(losses.tolist()))


def _block_errors(factor: WindowFactor, T: Array, held_out: Sequence[Array], feedthrough: tuple[bool, ...]) -> Array:
    """Return the mean squared error of free runs in blocks of p samples, infinite where a run diverges."""
    model, p, r, found = fit_matrices(factor, T, feedthrough), factor.past, factor.inputs, []
    for z in held_out:
        u, y = z[p:, :r], z[p:, -factor.outputs :]  # as measured
        with np.errstate(all="ignore"):
            x = run_states(model.A, u @ model.B.T, T @ z[:p, :r].ravel())[:-1]
            e = errors_of(y, x @ model.C.T + u @ model.D.T)
            squares = about_mean(e) ** 2
        blocks = [slice(k, k + p) for k in range(0, len(e) - p + 1, p)]
        found.append(np.array([squares[b].sum() / max(known_of(e[b]).sum(), 1.0) for b in blocks]))
    errors = np.concatenate(found)
    return np.where(np.isfinite(errors), errors, 1e300)


def _in_units(theta: Array, scaling: Scaling, past: int) -> Array:
    r = len(scaling.inputs)
    out: Array = scaling.scale[r:, None] * theta / np.tile(scaling.scale[:r], past + 1)
    return out


def _notes(factor: WindowFactor, estimate: MarkovEstimate, model: StateSpace) -> tuple[str, ...]:
    notes, p = [], factor.past
    if factor.skipped:
        notes.append(
            f"{counted(factor.skipped, 'window')} with a missing sample "
            f"{'was' if factor.skipped == 1 else 'were'} left out, {factor.windows} used"
        )
    if estimate.rank < estimate.regressors:
        notes.append(
            f"the inputs tell {estimate.rank} of {estimate.regressors} regressors apart; "
            "the smallest solution was taken"
        )
    left = float(abs(np.linalg.eigvals(model.A)).max()) ** p
    if left > FORGOTTEN:
        notes.append(
            f"after the past window of {p} samples the slowest mode has {min(left, 1.0):.0%} of its size left: "
            "lengthen the window, decimate, or use varx"
        )
    return tuple(notes)
