"""Identify a model that depends on a measured scheduling sequence by LPV-PBSIDopt: paper 001."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import aeolid
from aeolid.decompositions import singular_values
from aeolid.errors import NotIdentifiable, UsageError
from aeolid.identify.excitation import require_told_apart
from aeolid.identify.fit import Fit
from aeolid.identify.lpv.choose_scaling import AUTO, check_scaling, choose_scaling
from aeolid.identify.lpv.data import LpvData, LpvScaling, find_lpv_scaling, gather, scheduling_names
from aeolid.identify.lpv.dual import SELECTIONS, kernel_bytes, require_kernel, solve_dual
from aeolid.identify.lpv.fit import is_white, measure_lpv_fit
from aeolid.identify.lpv.matrices import ScaledLpv, choose_gain, require_distinct
from aeolid.identify.lpv.order import Head, choose_lpv_order, head_trial, solve_head, step_down, unseen_loss
from aeolid.identify.lpv.primal import require_primal, solve_primal
from aeolid.identify.lpv.refine import Refinement, refine
from aeolid.identify.lpv.result import LpvIdentification, LpvSettings, doubt_of, operating_points
from aeolid.identify.lpv.states import Estimate
from aeolid.identify.lpv.structure import Structure, parse_varying
from aeolid.identify.lpv.turning import turning_of
from aeolid.identify.order import OrderChoice, require_order
from aeolid.identify.settings import check_feedthrough, check_windows, require_some
from aeolid.models.lpv import LpvStateSpace, with_one
from aeolid.models.lpv_prediction import estimate_initial_state, lpv_stretches
from aeolid.models.model_file import Signal
from aeolid.models.periodic import angle_of
from aeolid.models.rate import decimate_causally
from aeolid.record import Record
from aeolid.wording import counted

Array = NDArray[np.float64]
METHODS = ("lpv", "lpv-kernel")
MEMORY_GB = 4.0
EXCITED = 1e-7  # singular value of an input's samples over the past window, relative to the largest


def identify_lpv(
    records: Sequence[Record],
    *,
    past: int,
    method: str = "lpv",
    future: int | None = None,
    order: int | None = None,
    scheduling: Sequence[str] = (),
    varying: str | Sequence[str] = ("A", "B", "K"),
    feedthrough: Sequence[str] = (),
    regularization: str | float = "gcv",
    offsets: bool | None = None,
    decimation: int = 1,
    kernel_rows: int | None = None,
    kernel_selection: str = "greedy",
    kernel_tolerance: float | None = None,
    memory_gb: float = MEMORY_GB,
    refined: bool = True,
    scheduling_scaling: str = "range",
) -> LpvIdentification:
    """Identify x⁺ = A(μ) x + B(μ) u + K(μ) e, y = C x + D u + e with a measured scheduling μ, open or closed loop.

    records: one experiment set, merged exactly; no window spans two of them. past: p ≥ 1 samples; the number of
    regressors grows like mᵖ. method: "lpv" (Algorithm 1: cost 2 N q², q regressors; N > q) or "lpv-kernel" (Algorithm
    2: cost p N² + N³, memory N²; any q). future: f ≤ p, default p. order: n, default chosen on held-out data.
    scheduling: channels of μ, default those of the role; an input among them gives a bilinear model. varying: matrices
    that depend on μ, out of A, B, C, D, K (C or D not with K). feedthrough: names of inputs that act on the outputs
    within the sample, default none. regularization: "gcv" (Tikhonov's penalty by generalised cross-validation on the
    filter applied), "none" or a number, λ relative to the largest singular value. offsets: whether signals are taken
    about their mean with free constants b(μ) and c; default: where a mean exceeds 0.3 standard deviations. decimation:
    whole factor by which the sample rate is lowered first. kernel_rows: M rows of the kernel (Algorithm 3; memory M N),
    default all; kernel_selection: "greedy" or "first". kernel_tolerance: the ε of Algorithm 3, 0 … 1 of the largest
    squared feature: rows are taken until no other is farther from their span, at most kernel_rows. memory_gb: refuse
    what would need more. refined: whether the subspace model is the start of prediction-error steps, default because
    the bias of a short past window goes away with them and the modes get standard deviations; False is the paper's
    algorithm. scheduling_scaling: how the scheduling enters μ, which changes what penalty and smallest solution spare:
    "range" (default: about its mean, |μ_i| ≤ 1/10), "none" (as recorded, as the paper prints its algorithms), "centre",
    "standard", or "auto": the one whose subspace model of the first 70 % of each recording predicts the rest best
    (costs a fit each).
    Raises NotIdentifiable where scheduling or inputs do not vary enough, windows are too few, the order is too large or
    memory too small; DataError on missing roles or recordings that differ; UsageError on bad options.
    """
    names = _check(
        records, method, past, future, order, scheduling, feedthrough, kernel_rows, kernel_selection, memory_gb
    )
    _check_tolerance(method, kernel_tolerance)
    check_scaling(scheduling_scaling)
    settings = LpvSettings(
        method, past, past if future is None else future, order, names, tuple(sorted(parse_varying(varying))),
        tuple(feedthrough), regularization, False, decimation, kernel_rows, kernel_selection, memory_gb,
        refined, kernel_tolerance=kernel_tolerance,
    )  # fmt: skip
    records = [decimate_causally(r, decimation) for r in records]
    chosen, said = _rule(records, settings, offsets, scheduling_scaling)
    scaling, settings, structure, data = _prepare(records, settings, offsets, chosen)
    estimate = _solve(data, structure, settings, records[0].source)
    choice, scaled, gain_method, refinement = _model(data, structure, settings, estimate, records[0].source)
    model, fit, white = _measured(_in_units(scaled, scaling, records[0]), records)
    s = np.concatenate([r.columns(names) for r in records])
    spread = (scaling.mu_mean, np.nanmin(s, axis=0), np.nanmax(s, axis=0))
    covariance, offset, scale = getattr(refinement, "covariance", None), scaling.mu_offset, scaling.mu_scale
    points = operating_points(model, spread, scaling.signals.scale[structure.inputs :], covariance, scale, offset)
    doubt = doubt_of(model, points, refinement, white, scale, offset)
    return LpvIdentification(
        model=model,
        points=points,
        estimate=estimate,
        order_choice=choice,
        fit=fit,
        settings=settings,
        data=tuple({"source": r.source, "sha256": r.sha256, "samples": len(r)} for r in records),
        windows=data.windows,
        skipped=data.skipped,
        gain_method=gain_method,
        refinement=refinement,
        doubt=doubt,
        turning=turning_of(records, names, covariance, offset, scale),
        notes=(*_notes(data, settings, model, spread), *said, *((f"WARNING: {doubt}",) if doubt else ())),
        version=aeolid.__version__,
    )


def _prepare(
    records: Sequence[Record], settings: LpvSettings, offsets: bool | None, rule: str
) -> tuple[LpvScaling, LpvSettings, Structure, LpvData]:
    """Return scaling, settings as they are then, structure and windows; raises NotIdentifiable on unfit data."""
    scaling = find_lpv_scaling(records, settings.scheduling, centre=offsets, scaling=rule)
    settings = replace(settings, offsets=bool(scaling.signals.offset.any()), scheduling_scaling=rule)
    structure = _structure(settings, scaling)
    data = gather(records, scaling, settings.past)
    _require_data(data, structure, settings, scaling.signals.inputs, records[0].source)
    return scaling, settings, structure, data


def _rule(
    records: Sequence[Record], settings: LpvSettings, offsets: bool | None, asked: str
) -> tuple[str, tuple[str, ...]]:
    """Return the scaling of the scheduling and, where it was left to choose, why."""
    if asked != AUTO:
        return asked, ()
    chosen, text = choose_scaling(lambda rule: _try_scaling(records, settings, offsets, rule))
    return chosen, (text,)


def _try_scaling(records: Sequence[Record], settings: LpvSettings, offsets: bool | None, rule: str) -> float:
    """Return the held-out log error power of the subspace model with this scaling of the scheduling.

    Where too few windows could be held out, that of the model of all windows: of one order all have as many numbers.
    """
    _, settings, structure, data = _prepare(records, settings, offsets, rule)
    head = solve_head(data, structure, lambda part: _solve(part, structure, settings, records[0].source))
    if head is None:
        head = Head(data, _solve(data, structure, settings, records[0].source))
    return unseen_loss(data, structure, head, settings.order)


def _check(
    records: Sequence[Record], method: str, past: int, future: int | None, order: int | None,
    scheduling: Sequence[str], feedthrough: Sequence[str], kernel_rows: int | None, selection: str,
    memory_gb: float,
) -> tuple[str, ...]:  # fmt: skip
    """Check the options against the recordings; returns the scheduling channels."""
    require_some(records)
    if method not in METHODS:
        raise UsageError(f"method {method!r} is none of {', '.join(METHODS)}")
    check_windows(records, past, future, order)
    check_feedthrough(records, feedthrough)
    if not 0 < memory_gb < 1e6:
        raise UsageError(f"a memory of {memory_gb:g} GB is not above 0")
    if method == "lpv" and kernel_rows is not None:
        raise UsageError("a number of kernel rows belongs to method lpv-kernel")
    if selection not in SELECTIONS:
        raise UsageError(f"kernel selection {selection!r} is none of {', '.join(SELECTIONS)}")
    return scheduling_names(records, scheduling)


def _check_tolerance(method: str, tolerance: float | None) -> None:
    if tolerance is None:
        return
    if method == "lpv":
        raise UsageError("a kernel tolerance belongs to method lpv-kernel")
    if not 0 <= tolerance < 1:
        raise UsageError(
            f"kernel tolerance {tolerance:g} is not within 0 … 1 (relative to the largest squared feature)"
        )


def _kernel_rows(data: LpvData, settings: LpvSettings) -> int | None:
    """Return the rows a kernel may have: with a tolerance alone, what memory holds."""
    if settings.kernel_tolerance is None or settings.kernel_rows is not None:
        return settings.kernel_rows
    return max(min(data.windows, int(settings.memory_gb * 1e9 / kernel_bytes(data, 1))), 1)


def _structure(settings: LpvSettings, scaling: LpvScaling) -> Structure:
    inputs, outputs = scaling.signals.inputs, scaling.signals.outputs
    through = tuple(name in settings.feedthrough for name in inputs)
    return Structure(
        frozenset(settings.varying), scaling.parameters, len(inputs), len(outputs), through, settings.offsets
    )


def _require_data(
    data: LpvData, structure: Structure, settings: LpvSettings, names: Sequence[str], source: str
) -> None:
    """Refuse too few windows, inputs that excite too little, and sizes beyond the memory limit."""
    n = settings.order or 1
    needed = structure.parameters * (n + structure.inputs + structure.outputs) + 1
    if data.windows < needed:
        lost = f" ({data.skipped} more hold a missing sample)" if data.skipped else ""
        raise NotIdentifiable(
            f"{source}: {data.windows} complete windows of {data.past + 1} samples{lost}; a model of order {n} with "
            f"{structure.parameters} scheduling entries needs at least {needed}; record longer or use a shorter past "
            "window"
        )
    lagged = np.stack([data.u[data.targets - j] for j in range(data.past, -1, -1)], axis=1)  # (N, p + 1, r)
    lagged = lagged - lagged.mean(axis=0)
    for i, name in enumerate(names):
        s = singular_values(lagged[:, :, i])
        rank = int(np.count_nonzero(s > EXCITED * s[0]))
        if 2 * rank < data.past + 1:
            raise NotIdentifiable(
                f"{source}: input {name!r} is not persistently exciting: over past window {data.past} it spans {rank} "
                f"of {data.past + 1} directions, half of them are needed; excite it over the frequencies of interest, "
                "or use a shorter past window"
            )
    require_told_apart(lagged, names, source)
    if settings.method == "lpv":
        require_primal(data, structure, source, settings.memory_gb * 1e9)
    else:
        require_kernel(data, structure, source, _kernel_rows(data, settings), settings.memory_gb * 1e9)


def _solve(data: LpvData, structure: Structure, settings: LpvSettings, source: str) -> Estimate:
    if settings.method == "lpv":
        require_primal(data, structure, source, np.inf)
        return solve_primal(data, structure, settings.future, settings.regularization)
    return solve_dual(
        data, structure, settings.future, settings.regularization, _kernel_rows(data, settings),
        settings.kernel_selection, settings.kernel_tolerance,
    )  # fmt: skip


def _order(
    data: LpvData, structure: Structure, settings: LpvSettings, solved: tuple[Head | None, Estimate], source: str
) -> OrderChoice:
    head, estimate = solved
    usable = estimate.states.X.shape[1]
    if settings.order is None and usable:
        return choose_lpv_order(data, structure, head, estimate)
    order = settings.order or 1
    require_order(order, usable, source)
    return OrderChoice(order, f"order {order}: as asked for", ())


def _model(
    data: LpvData, structure: Structure, settings: LpvSettings, estimate: Estimate, source: str
) -> tuple[OrderChoice, ScaledLpv, str, Refinement | None]:
    """Return the order, the scaled model, how its gain was found and its refinement."""
    head = None
    if settings.order is None or settings.refined:
        head = solve_head(data, structure, lambda part: _solve(part, structure, settings, source))
    choice = _order(data, structure, settings, (head, estimate), source)
    trial = None
    if settings.refined and settings.order is None and choice.losses:
        choice, trial = step_down(data, structure, head, choice)
    elif settings.refined:
        trial = head_trial(data, structure, head, choice.order)
    X = estimate.states.X[:, : choice.order]
    require_distinct(data, X, structure, source)
    scaled, gain_method = choose_gain(data, X, structure)
    if not settings.refined:
        return choice, scaled, gain_method, None
    refinement = refine(data, structure, scaled, trial)
    return choice, refinement.model, gain_method, refinement


def _in_units(scaled: ScaledLpv, scaling: LpvScaling, record: Record) -> LpvStateSpace:
    """Undo the scaling of signals and scheduling: M(s) = M⁽¹⁾ + Σ M⁽ⁱ⁺¹⁾ (s_i − o_i)/c_i."""
    signals, r = scaling.signals, len(scaling.signals.inputs)
    su, sy = signals.scale[:r], signals.scale[r:]
    offset = signals.offset + np.concatenate([np.zeros(r), sy * scaled.c])
    named = [Signal(n, record.unit(n), float(o)) for n, o in zip(signals.names, offset, strict=True)]

    def spoken(M: Array) -> Array:
        slope = M[1:] / scaling.mu_scale.reshape(-1, *[1] * (M.ndim - 1))
        return np.concatenate([[M[0] - np.tensordot(scaling.mu_offset, slope, axes=1)], slope])

    n = scaled.A.shape[1]
    return LpvStateSpace(
        spoken(scaled.A), spoken(scaled.B) / su, sy[:, None] * spoken(scaled.C), sy[:, None] * spoken(scaled.D) / su,
        spoken(scaled.K) / sy, spoken(scaled.b), np.zeros(n), None, record.sample_time_s, tuple(named[:r]),
        tuple(named[r:]), tuple(Signal(f"x{i + 1}") for i in range(n)),
        tuple(Signal(name, record.unit(name)) for name in scaling.scheduling),
    )  # fmt: skip


def _measured(model: LpvStateSpace, records: Sequence[Record]) -> tuple[LpvStateSpace, Fit, bool]:
    """Return the model with first state and covariance of innovations as measured, its fit, whether they are white."""
    fit, inputs = measure_lpv_fit(model, records)
    white, covariance = is_white(model, fit, inputs), fit.covariance(model.order)
    if covariance is not None:
        model = replace(model, innovation_covariance=covariance)
    for u, y, s in lpv_stretches(model, records[0], 1):
        x0 = estimate_initial_state(model, u - model.u_offset, y - model.y_offset, with_one(s))
        return replace(model, x0=x0), fit, white
    return model, fit, white


def _notes(
    data: LpvData, settings: LpvSettings, model: LpvStateSpace, spread: tuple[Array, Array, Array]
) -> tuple[str, ...]:
    notes = []
    if data.skipped:
        notes.append(
            f"{counted(data.skipped, 'window')} with a missing sample "
            f"{'was' if data.skipped == 1 else 'were'} left out, {data.windows} used"
        )
    if settings.offsets:
        notes.append("signals are taken about their mean, with a free constant for each scheduling entry")
    if any(map(angle_of, settings.scheduling)):
        notes.append("poles at single angles are not the modes of a rotor that turns; aeolid floquet finds those")
    growing = [
        word
        for word, at in zip(("mean", "smallest values", "largest values"), spread, strict=True)
        if abs(np.linalg.eigvals(model.frozen(at).A)).max() > 1
    ]
    if growing:
        notes.append(
            f"frozen at the {' and the '.join(growing)} of the scheduling the model has poles outside the unit circle; "
            "a free run that stays there diverges"
        )
    return tuple(notes)
