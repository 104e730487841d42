"""Identify a plant in closed loop from a measured disturbance by orthogonal decomposition: paper 002."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import aeolid
from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.identify.assemble import find_modes, model_in_units, with_innovations, with_start
from aeolid.identify.fit import Fit
from aeolid.identify.folding import tell_of_folding
from aeolid.identify.jackknife import jackknife, merged
from aeolid.identify.order import OrderChoice, held_out_stretches
from aeolid.identify.ort.estimate import RESPONSES, Loop, compatibility
from aeolid.identify.ort.feedback import FeedbackTest, check_feedback
from aeolid.identify.ort.joint import Layout, require_disturbance, require_own_noise
from aeolid.identify.ort.order import choose_joint_order, choose_plant_order
from aeolid.identify.ort.plant import predictor_map
from aeolid.identify.ort.result import OrtIdentification, OrtSettings
from aeolid.identify.quantify import in_order_of
from aeolid.identify.settings import check_feedthrough, require_some
from aeolid.identify.split import cut
from aeolid.identify.subspace import ScaledModel, equilibrium, stabilise
from aeolid.identify.windows import Scaling, WindowFactor, factorise, find_scaling, require_windows
from aeolid.models.rate import decimate_causally
from aeolid.models.state_space import StateSpace
from aeolid.record import Record
from aeolid.wording import counted

Array = NDArray[np.float64]
GROUPS = 20  # stretches of each recording that are left out, one at a time
ILL_CONDITIONED = 1e6  # of the disturbance's windows: noise in B and D of the disturbance grows by as much


def identify_ort(
    records: Sequence[Record],
    *,
    past: int,
    future: int | None = None,
    order: int | None = None,
    joint_order: int | None = None,
    deterministic_order: int | None = None,
    feedthrough: Sequence[str] | None = None,
    response: str = "fit",
    decimation: int = 1,
    stable: bool = False,
) -> OrtIdentification:
    """Identify x⁺ = A x + B [u; r] + K e, y = C x + D r + e in closed loop by ORT (paper 002).

    What the disturbance r explains of inputs and outputs and what it leaves are two subsystems, each realised on its
    own, joined by Theorem 5. For loops without a test signal; u acts in the next sample at the earliest, r is free of
    feedback (tested, a note says so where it is not), and u moves by noise of its own too.

    records: one experiment set with at least one channel each of role input, disturbance and output, merged exactly; no
    window spans two of them. past, future: p and f samples of the two halves of a window, f default p, f above the
    order of plant and controller together; (A − K C)ᵖ should be negligible, for K (A − K C)ᵖ⁺ᶠ: PBSIDopt of the same
    windows gives it where that predicts better. order: n of the plant; joint_order: n of
    plant and controller together, of both subsystems; both by default chosen on held-out data. deterministic_order: n_d
    of what the disturbance explains, default that of the rest, n_s = joint_order (footnote 2 of the paper lets them
    differ: modes that the disturbance hardly moves, or noise filters with modes of their own). feedthrough: names of
    disturbances that act on the outputs within the sample, default all (D of a feedback-free signal has no bias).
    response: "fit" (default) fits B and D of the disturbances again given the rest, which halves their scatter on the
    paper's example; "theorem" keeps those of Theorem 5. decimation: whole factor by which the sample rate is lowered
    first. stable: move poles on or outside the unit circle inside. The poles' deviations come from leaving out a
    twentieth of each recording at a time.
    Raises NotIdentifiable where disturbance or inputs lack excitation, windows are too few or an order is too large;
    DataError on missing roles; UsageError on bad options. Cost: 2 N q² + 60 q³, q = (p + f + 1) channels.
    """
    settings = _settings(records, past, future, order, joint_order, feedthrough, response, decimation, stable)
    settings = _with_deterministic(settings, deterministic_order)
    raw, records = records, [decimate_causally(r, decimation) for r in records]
    scaling, layout, groups, fitted, held_out = _gather(records, settings)
    whole, source = merged(groups), records[0].source
    require_windows(records, layout.past + layout.future, scaling.channels, whole.windows)
    condition = require_disturbance(whole, layout, scaling, source)
    loop = Loop.of(whole, layout, settings.deterministic_order)
    require_own_noise(loop.lq, layout, scaling, source)
    _require_orders(loop, settings, source)
    part = _fit_part(fitted, layout, scaling, settings.deterministic_order)
    orders = _choose(loop, part, held_out, settings)
    scaled, values, gap = _solve(loop, orders, settings)
    spread = jackknife(
        groups, np.linalg.eigvals(scaled.A).astype(complex), _poles(layout, orders, settings.deterministic_order)
    )
    final, model, fit = _finish(scaled, whole, scaling, records, settings.stable)
    spread = in_order_of(spread, scaled.A, final.A)
    tests = check_feedback(whole, layout, settings.disturbances)
    result = OrtIdentification(
        model=model,
        modes=find_modes(model, scaling.scale[len(scaling.inputs) :], spread, records),
        singular_values=values,
        deterministic=loop.spectra.values_d,
        correlations=loop.spectra.correlations,
        compatibility=gap,
        condition=condition,
        feedback=tests,
        joint_choice=orders[0],
        order_choice=orders[1],
        fit=fit,
        settings=settings,
        data=tuple({"source": r.source, "sha256": r.sha256, "samples": len(r)} for r in records),
        windows=whole.windows,
        skipped=whole.skipped,
        gain_method=final.gain_method,
        notes=_notes(whole, model, fit, past, condition, tests),
        version=aeolid.__version__,
    )
    return _told(result, raw)


def _told(result: OrtIdentification, raw: Sequence[Record]) -> OrtIdentification:
    """Return the result with what decimation folds down; raw: the recordings before it."""
    modes, notes = tell_of_folding(result.modes, result.notes, raw, result.settings.decimation)
    return replace(result, modes=modes, notes=notes)


def _settings(
    records: Sequence[Record], past: int, future: int | None, order: int | None, joint_order: int | None,
    feedthrough: Sequence[str] | None, response: str, decimation: int, stable: bool,
) -> OrtSettings:  # fmt: skip
    """Check what was asked for; raises UsageError that names the option, DataError where a role is missing."""
    require_some(records)
    chosen = past if future is None else future
    if past < 1 or chosen < 2:
        raise UsageError(f"past window {past} and future window {chosen}: at least 1 and 2 are needed")
    if response not in RESPONSES:
        raise UsageError(f"response {response!r} is none of {', '.join(RESPONSES)}")
    for name, value in (("order", order), ("joint order", joint_order)):
        if value is not None and value < 1:
            raise UsageError(f"{name} {value} is not at least 1")
    if order is not None and joint_order is not None and joint_order < order:
        raise UsageError(f"joint order {joint_order} is below order {order}; it counts the plant's states too")
    disturbances = records[0].names("disturbance")
    if not disturbances:
        raise DataError(
            f"{records[0].source}: no channel has the role 'disturbance'; ort needs one that is measured and free of "
            "feedback; without one, use method varx"
        )
    through = disturbances if feedthrough is None else tuple(feedthrough)
    for name in through:
        if name in records[0].names("input"):
            raise UsageError(
                f"feedthrough of {name!r}: with ort an input under feedback acts in the next sample at the earliest; "
                "use method varx"
            )
    check_feedthrough(records, through, "disturbance")
    return OrtSettings(past, chosen, order, joint_order, disturbances, through, response, decimation, stable)


def _with_deterministic(settings: OrtSettings, asked: int | None) -> OrtSettings:
    """Return the settings with n_d; raises UsageError on one that leaves the plant no response to the disturbance."""
    if asked is not None and asked < 1:
        raise UsageError(f"deterministic order {asked} is not at least 1")
    return replace(settings, deterministic_order=asked)


def _gather(
    records: Sequence[Record], settings: OrtSettings
) -> tuple[Scaling, Layout, list[WindowFactor], WindowFactor, list[Array]]:
    """Return scaling, layout of a block, factors of each twentieth of the recordings and their fit part, the rest.

    Disturbances count among the inputs of a block, in the order of the roles file.
    """
    joint = [
        replace(r, channels=tuple(replace(c, role="input") if c.role == "disturbance" else c for c in r.channels))
        for r in records
    ]
    scaling, span = find_scaling(joint, driven=True), settings.past + settings.future
    r = tuple(i for i, name in enumerate(scaling.inputs) if name in settings.disturbances)
    u = tuple(i for i in range(len(scaling.inputs)) if i not in r)
    if not u:
        raise DataError(
            f"{records[0].source}: no channel has the role 'input'; "
            "with disturbances alone, give them that role and use method fir"
        )
    y = tuple(range(len(scaling.inputs), scaling.channels))
    through = tuple(scaling.inputs[i] in settings.feedthrough for i in r)
    layout = Layout(r, u, y, settings.past, settings.future, through)
    require_windows(joint, span, scaling.channels)
    groups = [factorise(joint, scaling, span, first=g / GROUPS, last=(g + 1) / GROUPS) for g in range(GROUPS)]
    fitted = factorise(cut(joint, scaling, span)[0], scaling, span)
    return scaling, layout, groups, fitted, held_out_stretches(joint, scaling, span)


def _require_orders(loop: Loop, settings: OrtSettings, source: str) -> None:
    asked = (
        ("joint order", settings.joint_order, loop.most),
        ("order", settings.order, loop.most_plant),
        ("deterministic order", settings.deterministic_order, loop.most),
    )
    for name, value, most in asked:
        if value is not None and value > most:
            raise NotIdentifiable(
                f"{source}: {name} {value} asked for, past window {settings.past} and future window {settings.future} "
                f"carry {most} with these channels; lower it or lengthen the windows"
            )


def _fit_part(fitted: WindowFactor, layout: Layout, scaling: Scaling, deterministic_order: int | None) -> Loop | None:
    """Return the loop of the part that chooses the orders; None where it does not determine the windows by itself."""
    if fitted.windows <= 2 * len(fitted.R):
        return None
    try:
        require_disturbance(fitted, layout, scaling, "the fit part")
        part = Loop.of(fitted, layout, deterministic_order)
        require_own_noise(part.lq, layout, scaling, "the fit part")
    except NotIdentifiable:  # a disturbance or a dither that begins late
        return None
    return part


def _choose(
    loop: Loop, fitted: Loop | None, held_out: Sequence[Array], settings: OrtSettings
) -> tuple[OrderChoice, OrderChoice]:
    """Return the choices of the joint order and of the plant's; without a fit part the whole chooses by itself."""
    asked, joint = settings.order, settings.joint_order
    part, samples = (loop, ()) if fitted is None else (fitted, held_out)
    if joint is not None:
        first = OrderChoice(joint, f"joint order {joint}: as asked for", ())
    else:
        first = choose_joint_order(part, samples, asked or 1)
    if asked is not None:
        return first, OrderChoice(asked, f"order {asked}: as asked for", ())
    return first, choose_plant_order(part, first.order, samples, settings.response)


def _solve(
    loop: Loop, orders: tuple[OrderChoice, OrderChoice], settings: OrtSettings
) -> tuple[ScaledModel, Array, float]:
    """Return the plant, the values by which its states were kept, and how well the two subsystems agree."""
    joint = loop.subsystems(orders[0].order)
    model, values = loop.plant(joint, orders[1].order, settings.response)
    return model, values, compatibility(*joint)


def _finish(
    scaled: ScaledModel, whole: WindowFactor, scaling: Scaling, records: Sequence[Record], stable: bool
) -> tuple[ScaledModel, StateSpace, Fit]:
    """Return the model, scaled and in the channels' units with start and covariance of its innovations, and its fit."""
    T = predictor_map(scaled, whole.past)
    if stable:
        scaled = stabilise(whole, scaled, T)
    model = with_start(model_in_units(scaled, equilibrium(whole, T, scaled), scaling, records[0]), records)
    return scaled, *with_innovations(model, records)


def _poles(
    layout: Layout, orders: tuple[OrderChoice, OrderChoice], deterministic_order: int | None
) -> Callable[[WindowFactor], NDArray[np.complex128]]:
    """Return what estimates the poles of these orders from another factor."""
    return lambda factor: Loop.of(factor, layout, deterministic_order).poles(orders[0].order, orders[1].order)


def _notes(
    factor: WindowFactor, model: StateSpace, fit: Fit, past: int, condition: float, tests: Sequence[FeedbackTest]
) -> tuple[str, ...]:
    notes = [test.text for test in tests if test.alarms]
    if factor.skipped:
        notes.append(
            f"{counted(factor.skipped, 'window')} with a missing sample "
            f"{'was' if factor.skipped == 1 else 'were'} left out, {factor.windows} used"
        )
    if condition > ILL_CONDITIONED:
        notes.append(
            f"the disturbance hardly moves in some directions of the windows (condition {condition:.0e}): its part of "
            "the model is uncertain there; shorter windows or a lower sample rate help"
        )
    worse = [name for name in fit.one_step.nrmse if fit.one_step.nrmse[name] > fit.free_run.nrmse[name]]
    if worse:  # a gain of zero would predict better: what (A − K C)ᵖ leaves has gone into K
        notes.append(
            f"one-step prediction of {', '.join(worse)} is worse than a free run: past window {past} is too short "
            "for the gain K (poles and responses suffer less); lengthen it"
        )
    growing = int(np.count_nonzero(abs(np.linalg.eigvals(model.A)) > 1))
    if growing:
        notes.append(
            f"{growing} of {model.order} poles lie outside the unit circle, a free run diverges unless the plant is "
            "unstable too; lengthen the windows, or ask for a stable model"
        )
    return tuple(notes)
