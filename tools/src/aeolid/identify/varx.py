"""Identify a linear model by VARX-based PBSIDopt from recordings, or from streamed Markov parameters and samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import aeolid
from aeolid.errors import NotIdentifiable, UsageError
from aeolid.identify.decimate import decimate
from aeolid.identify.fit import Fit, measure_fit, stretches
from aeolid.identify.markov import MarkovEstimate, estimate_markov, require_excitation
from aeolid.identify.order import FIT_PART, OrderChoice, choose_order, held_out_stretches
from aeolid.identify.result import Identification, Settings
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.subspace import (
    ScaledModel,
    StateBasis,
    equilibrium,
    find_states,
    largest_useful_order,
    stabilise,
    system_matrices,
)
from aeolid.identify.uncertainty import pole_covariance
from aeolid.identify.windows import Scaling, WindowFactor, factorise, find_scaling, require_windows
from aeolid.models.modes import Mode, mark_harmonics, modes_of
from aeolid.models.prediction import estimate_initial_state
from aeolid.models.state_space import Signal, StateSpace
from aeolid.record import Record

Array = NDArray[np.float64]
LARGEST_AUTO_ORDER = 60


def identify_varx(
    records: Sequence[Record],
    *,
    past: int,
    future: int | None = None,
    order: int | None = None,
    feedthrough: Sequence[str] = (),
    regularization: str | float = "gcv",
    markov: StreamedMarkov | None = None,
    decimation: int = 1,
    stable: bool = False,
) -> Identification:
    """Identify x⁺ = A x + B u + K e, y = C x + D u + e by PBSIDopt (papers 000 and 001), open or closed loop.

    records: one experiment set; recordings are merged as if measured in one go, no window spans two of them.
    past: p ≥ 1 samples; (A − K C)ᵖ should be negligible: about one period of the slowest mode. future: f ≤ p, default
    p. order: n, default chosen on held-out data. feedthrough: names of inputs that act on the outputs within the
    sample, default none because D of an input cannot be identified without bias when its controller has feedthrough
    itself. regularization: "gcv" (default: costs nothing where data are rich), "none" or a number, λ relative to the
    largest singular value. markov: Ξ from a stream in place of eq. (23). decimation: whole factor by which the sample
    rate is lowered first. stable: move poles on or outside the unit circle inside.
    Raises NotIdentifiable on constant channels, too few samples or missing excitation; UsageError on bad options.
    Cost: 2 N q² operations, q = (p + 1)(r + l); memory q² beside the recordings.
    """
    settings = _settings(records, past, future, order, feedthrough, regularization, markov, decimation, stable)
    records = [decimate(r, decimation) for r in records]
    scaling = find_scaling(records)
    through = tuple(name in settings.feedthrough for name in scaling.inputs)
    fitted, factor = _compress(records, scaling, past)
    estimate = _markov(factor, scaling, through, regularization, markov, past)
    require_excitation(estimate, records[0].source)
    basis = find_states(factor, estimate.theta, settings.future)
    choice = _order(records, scaling, fitted, settings, through, estimate)
    _require_order(choice, basis, records[0].source)
    T = basis.state_map(choice.order)
    scaled = system_matrices(factor, T, through)
    spread = pole_covariance(factor, basis, scaled, estimate)
    if stable:
        scaled = stabilise(factor, scaled, T)
    model = _with_start(_in_units(scaled, equilibrium(factor, T, scaled), scaling, records[0]), records)
    model, fit = _measured(model, records)
    return Identification(
        model=model,
        modes=_find_modes(model, scaling, spread, records),
        singular_values=basis.singular_values,
        order_choice=choice,
        fit=fit,
        markov=estimate,
        markov_parameters=_theta_in_units(estimate.theta, scaling, past),
        scaling=scaling,
        settings=settings,
        data=tuple({"source": r.source, "sha256": r.sha256, "samples": len(r)} for r in records),
        windows=factor.windows,
        skipped=factor.skipped,
        gain_method=scaled.gain_method,
        notes=_notes(factor, estimate, model),
        version=aeolid.__version__,
    )


def _settings(
    records: Sequence[Record], past: int, future: int | None, order: int | None, feedthrough: Sequence[str],
    regularization: str | float, markov: StreamedMarkov | None, decimation: int, stable: bool,
) -> Settings:  # fmt: skip
    if not records:
        raise UsageError("at least one recording is needed")
    if past < 1:
        raise UsageError(f"past window {past} is not at least 1")
    chosen = past if future is None else future
    if not 1 <= chosen <= past:
        raise UsageError(f"future window {chosen} is not within 1 … past window {past}")
    largest = chosen * len(records[0].names("output"))
    if order is not None and not 1 <= order <= max(largest, 1):
        raise UsageError(f"order {order} is not within 1 … {largest} (future window times outputs)")
    unknown = [n for n in feedthrough if n not in records[0].names("input")]
    if unknown:
        have = ", ".join(records[0].names("input"))
        raise UsageError(f"feedthrough of {unknown[0]!r}: no such input; the inputs are {have}")
    source = None if markov is None else markov.source
    return Settings("varx", past, chosen, order, tuple(feedthrough), regularization, decimation, stable, source)


def _markov(
    factor: WindowFactor, scaling: Scaling, through: tuple[bool, ...], regularization: str | float,
    markov: StreamedMarkov | None, past: int,
) -> MarkovEstimate:  # fmt: skip
    estimate = estimate_markov(factor, through, regularization)
    return estimate if markov is None else markov.replace_in(estimate, factor, scaling, past, through)


def _order(
    records: Sequence[Record], scaling: Scaling, fitted: WindowFactor, settings: Settings, through: tuple[bool, ...],
    estimate: MarkovEstimate,
) -> OrderChoice:  # fmt: skip
    if settings.order is not None:
        return OrderChoice(settings.order, f"order {settings.order}: as asked for", ())
    # with few samples the fit part alone may not determine the predictor; its own estimate keeps the rest unseen
    theta = estimate.theta if settings.markov else estimate_markov(fitted, through, settings.regularization).theta
    held_out = held_out_stretches(records, scaling, settings.past)
    return choose_order(fitted, find_states(fitted, theta, settings.future), held_out, through, LARGEST_AUTO_ORDER)


def _compress(records: Sequence[Record], scaling: Scaling, past: int) -> tuple[WindowFactor, WindowFactor]:
    """Return the factor of the part that chooses the order from what is held out, and the factor of everything."""
    require_windows(records, past, scaling.channels)
    fitted = factorise(records, scaling, past, last=FIT_PART)
    factor = fitted.merge(factorise(records, scaling, past, first=FIT_PART))
    require_windows(records, past, scaling.channels, factor.windows)
    return fitted, factor


def _measured(model: StateSpace, records: Sequence[Record]) -> tuple[StateSpace, Fit]:
    """Return the model with the covariance of its innovations as measured, and its fit."""
    fit = measure_fit(model, records)
    covariance = np.atleast_2d(np.cov(fit.innovations.T))
    if not np.isfinite(covariance).all():  # the one of the Riccati equation stays
        return model, fit
    return replace(model, innovation_covariance=covariance), fit


def _require_order(choice: OrderChoice, basis: StateBasis, source: str) -> None:
    usable = largest_useful_order(basis)
    if choice.order > usable:
        raise NotIdentifiable(
            f"{source}: order {choice.order} asked for, the data carry {usable} singular values above rounding; "
            "lower the order or lengthen the windows"
        )


def _find_modes(model: StateSpace, scaling: Scaling, spread: Array, records: Sequence[Record]) -> tuple[Mode, ...]:
    """List the modes; where the rotor's azimuth is recorded, those on its harmonics are marked."""
    modes = modes_of(model, output_scale=scaling.scale[len(scaling.inputs) :], pole_covariance=spread)
    rotor_hz = rotor_frequency(records[0])
    return modes if rotor_hz is None else mark_harmonics(modes, rotor_hz)


def rotor_frequency(record: Record) -> float | None:
    """Return the mean rotor speed in Hz from the azimuth channel, None where there is none or it stands still."""
    for channel in record.of("azimuth"):
        turn = 360.0 if channel.unit == "deg" else 2 * np.pi
        steps = np.diff(record.column(channel.name))
        steps = steps[np.isfinite(steps)]
        turned = np.mod(steps / turn + 0.5, 1.0) - 0.5 if len(steps) else np.zeros(1)
        speed = abs(float(turned.mean())) / record.sample_time_s
        return speed if speed > 1e-4 else None
    return None


def _in_units(scaled: ScaledModel, rest: Array, scaling: Scaling, record: Record) -> StateSpace:
    """Undo the scaling: u, y in the channels' units, u about its mean, y about its rest (l,) under that mean."""
    r = len(scaling.inputs)
    offset = scaling.offset + scaling.scale * np.concatenate([np.zeros(r), rest])
    su, sy = scaling.scale[:r], scaling.scale[r:]
    signals = [
        Signal(n, record.unit(n), float(o)) for n, o in zip(scaling.inputs + scaling.outputs, offset, strict=True)
    ]
    n = len(scaled.A)
    return StateSpace(
        scaled.A, scaled.B / su, sy[:, None] * scaled.C, sy[:, None] * scaled.D / su, scaled.K / sy, np.zeros(n),
        sy[:, None] * scaled.covariance * sy, record.sample_time_s, tuple(signals[:r]), tuple(signals[r:]),
        tuple(Signal(f"x{i + 1}") for i in range(n)),
    )  # fmt: skip


def _theta_in_units(theta: Array, scaling: Scaling, past: int) -> Array:
    """Undo the scaling of Ξ (l, p m + r)."""
    r = len(scaling.inputs)
    columns = np.concatenate([np.tile(scaling.scale, past), scaling.scale[:r]])
    out: Array = scaling.scale[r:, None] * theta / columns
    return out


def _with_start(model: StateSpace, records: Sequence[Record]) -> StateSpace:
    """Return the model with the estimated state at the first complete sample of the first recording."""
    for _, u, y in stretches(model, records[0]):
        return replace(model, x0=estimate_initial_state(model, u - model.u_offset, y - model.y_offset))
    return model


def _notes(factor: WindowFactor, estimate: MarkovEstimate, model: StateSpace) -> tuple[str, ...]:
    notes = []
    if factor.skipped:
        notes.append(f"{factor.skipped} windows with a missing sample were left out, {factor.windows} used")
    if estimate.rank < estimate.regressors:
        notes.append(
            f"the data excite {estimate.rank} of {estimate.regressors} regressors (fewer noise sources than outputs, "
            "or an input without excitation); the smallest solution was taken"
        )
    growing = int(np.count_nonzero(abs(np.linalg.eigvals(model.A)) > 1))
    if growing:
        notes.append(
            f"{growing} of {model.order} poles lie outside the unit circle, a free run diverges: "
            "lengthen the past window (or decimate), or ask for a stable model"
        )
    return tuple(notes)
