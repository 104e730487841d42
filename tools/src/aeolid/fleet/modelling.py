"""Make a model and its modes from a summary alone: no sample of any recording is read again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.errors import NotIdentifiable
from aeolid.fleet.plan import Plan
from aeolid.fleet.summary import Summary
from aeolid.identify.assemble import LARGEST_AUTO_ORDER, model_in_units
from aeolid.identify.markov import estimate_markov, require_excitation
from aeolid.identify.mode_names import named
from aeolid.identify.order import smallest_sufficient
from aeolid.identify.subspace import StateBasis, equilibrium, find_states, largest_useful_order, system_matrices
from aeolid.identify.uncertainty import matrix_spread, pole_covariance
from aeolid.identify.windows import Scaling, WindowFactor
from aeolid.models.modes import Mode, mark_harmonics, modes_of
from aeolid.models.state_space import StateSpace
from aeolid.record import Record
from aeolid.wording import counted

Array = NDArray[np.float64]
REGULARIZATION = "gcv"  # costs nothing where data are rich


def model_summary(summary: Summary, plan: Plan, order: int, what: str) -> dict[str, Any]:
    """Identify a model of a given order by PBSIDopt and return its facts: model, modes with shapes, one-step VAF.

    what: names the summary in messages. Raises NotIdentifiable on a channel at rest, too few windows, missing
    excitation or an order beyond the singular values above rounding.
    """
    factor, through = summary.factor(), _through(plan)
    _require(summary, plan, factor, what)
    estimate = estimate_markov(factor, through, REGULARIZATION)
    require_excitation(estimate, what)
    basis = find_states(factor, estimate.theta, plan.past)
    usable = largest_useful_order(basis)
    if order > usable:
        raise NotIdentifiable(
            f"{what}: order {order} needed, the data carry {usable} singular values above rounding; lower the order"
        )
    T = basis.state_map(order)
    scaled = system_matrices(factor, T, through)
    spread = pole_covariance(scaled.A, matrix_spread(factor, basis, scaled, estimate, through))
    record, scaling = _empty_record(summary, plan), _scaling(summary, plan)
    model = model_in_units(scaled, equilibrium(factor, T, scaled), scaling, record)
    outputs = summary.scale[summary.inputs :]
    modes = modes_of(model, output_scale=outputs, pole_covariance=spread)
    modes = named(modes if summary.rotor_hz is None else mark_harmonics(modes, summary.rotor_hz), summary.rotor_hz)
    return {
        "recordings": summary.recordings, "windows": factor.windows, "windows_skipped": factor.skipped, "order": order,
        "sample_time_s": summary.sample_time_s, "vaf_percent": _vaf(factor, T, through), "rotor_hz": summary.rotor_hz,
        "output_scale": outputs.tolist(), "singular_values": basis.singular_values[: 2 * order].tolist(),
        "model": model.to_json(),
        "modes": [m.to_json() | {"shape": s} for m, s in zip(modes, _shapes(model, outputs, modes), strict=True)],
    }  # fmt: skip


def choose_common_order(periods: Sequence[Summary], plan: Plan) -> tuple[int, str]:
    """Choose one order for all periods as `identify.order` does, from held-out factors in place of samples.

    The predictor of order n is y = C T z̄ + D u with T and C from the fitted part; its error power over the held-out
    windows is read off their factor, so that the choice costs no pass through the recordings. Each period is held
    against a model of its own and the losses are averaged over windows: one model of all periods would spend states on
    modes that moved. Periods too short for that are left out. Raises NotIdentifiable where all are.
    """
    through, scored, weights = _through(plan), [], []
    reason = ""
    for summary in periods:
        try:
            _require(summary, plan, summary.factor(), "a period")
            scored.append(_held_out_losses(summary, plan, through))
            weights.append(summary.windows[1])
        except NotIdentifiable as error:
            reason = str(error)
    if not scored:
        raise NotIdentifiable(f"no period carries a choice of the order; the last: {reason}")
    most = min(map(len, scored))
    losses = np.average([each[:most] for each in scored], axis=0, weights=weights)
    choice = smallest_sufficient(losses.tolist(), tail=f", {counted(len(scored), 'period')}")
    return choice.order, choice.reason


def _held_out_losses(summary: Summary, plan: Plan, through: tuple[bool, ...]) -> list[float]:
    """Return the losses of the orders from 1; raises NotIdentifiable without state or with too little held out."""
    fitted, rest = summary.factor("fitted"), summary.factor("rest")
    if fitted.windows == 0:
        raise NotIdentifiable(
            "a period: no complete window in the first part of its recordings, which an order is fitted to; use longer "
            "periods or name the order"
        )
    basis = find_states(fitted, estimate_markov(fitted, through, REGULARIZATION).theta, plan.past)
    most = min(LARGEST_AUTO_ORDER, largest_useful_order(basis))
    if most == 0 or rest.windows < 20 * fitted.channels:
        raise NotIdentifiable(
            f"a period: {rest.windows} held-out windows, {20 * fitted.channels} are needed to choose an order; "
            "use longer periods or name the order"
        )
    return [_held_out_loss(fitted, rest, basis, order, through) for order in range(1, most + 1)]


def _held_out_loss(
    fitted: WindowFactor, rest: WindowFactor, basis: StateBasis, order: int, through: tuple[bool, ...]
) -> float:
    """Return the mean log error power of an order's predictor over the held-out windows, per output."""
    T = basis.state_map(order)
    solution = lstsq(_regressors(fitted, T, through), fitted.y_now, rcond=1e-11)
    e = rest.y_now - _regressors(rest, T, through) @ solution
    return float(np.mean(np.log(np.maximum((e**2).sum(axis=0) / rest.windows, 1e-30))))


def _regressors(factor: WindowFactor, T: Array, through: tuple[bool, ...]) -> Array:
    """Return state and inputs with feedthrough (q, n + …) in the coordinates of the factor."""
    return np.hstack([factor.R[:, : T.shape[1]] @ T.T, factor.u_now[:, np.flatnonzero(through)]])


def _vaf(factor: WindowFactor, T: Array, through: tuple[bool, ...]) -> float:
    """Return the least one-step variance accounted for of all outputs, in percent."""
    regressors = _regressors(factor, T, through)
    e = factor.y_now - regressors @ lstsq(regressors, factor.y_now, rcond=1e-11)
    return float((100 * (1 - (e**2).sum(axis=0) / (factor.y_now**2).sum(axis=0))).min())


def _require(summary: Summary, plan: Plan, factor: WindowFactor, what: str) -> None:
    still = [i for i, spread in enumerate(summary.deviation()) if spread == 0]
    if still:
        names = _scaling(summary, plan).names
        raise NotIdentifiable(
            f"{what}: channel {names[still[0]]!r} is constant at {summary.mean[still[0]]:g}; "
            "give it the role 'ignore' or record with excitation"
        )
    needed = (plan.past + 1) * factor.channels + 1
    if factor.windows < needed:
        raise NotIdentifiable(
            f"{what}: {factor.windows} complete windows of {plan.past + 1} samples, at least {needed} are needed; "
            "use longer periods or a shorter past window"
        )


def _through(plan: Plan) -> tuple[bool, ...]:
    return tuple(c.name in plan.feedthrough for c in plan.roles.channels if c.role == "input")


def _scaling(summary: Summary, plan: Plan) -> Scaling:
    names = [tuple(c.name for c in plan.roles.channels if c.role == role) for role in ("input", "output")]
    return Scaling(names[0], names[1], summary.offset, summary.scale)


def _empty_record(summary: Summary, plan: Plan) -> Record:
    """Return a recording without samples: names, units and sample time are all a model needs of one."""
    channels = tuple(c for c in plan.roles.channels if c.role != "ignore")
    return Record(np.zeros(0), np.zeros((0, len(channels))), channels, summary.sample_time_s, plan.roles.source, "")


def _shapes(model: StateSpace, scale: Array, modes: tuple[Mode, ...]) -> list[list[list[float]]]:
    """Return each mode's outputs [real, imaginary] in units of their scales: what tells modes of one frequency apart.

    Scales are those of the period; `tracking.in_common_scales` makes shapes of several comparable. The largest is 1, so
    that the numbers do not depend on the length LAPACK gives an eigenvector.
    """
    values, vectors = np.linalg.eig(model.A)
    shapes = []
    for mode in modes:
        shape = (model.C @ vectors[:, int(np.argmin(abs(values - mode.eigenvalue)))]) / scale
        largest = shape[int(np.argmax(abs(shape)))]
        shape = shape / largest if abs(largest) > 0 else shape
        shapes.append([[float(v.real), float(v.imag)] for v in shape.astype(complex)])
    return shapes
