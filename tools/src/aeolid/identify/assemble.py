"""Turn Markov parameters and a window factor into an identified model: the half that VARX and VARMAX share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import aeolid
from aeolid.identify.closed_loop import require_outside_excitation
from aeolid.identify.compressed import Windows
from aeolid.identify.enough import require_enough
from aeolid.identify.excitation import require_own_excitation, require_states
from aeolid.identify.fit import Fit, measure_fit, stretches
from aeolid.identify.harmonics import marked
from aeolid.identify.markov import MarkovEstimate, estimate_markov
from aeolid.identify.order import (
    OrderChoice,
    choose_held_out,
    decide,
    information_costs,
    require_order,
)
from aeolid.identify.parsimony import guard_order
from aeolid.identify.quantify import Uncertainty, quantify
from aeolid.identify.result import Identification, Settings
from aeolid.identify.split import FIT_PART
from aeolid.identify.streamed import theta_in_units
from aeolid.identify.subspace import (
    ScaledModel,
    StateBasis,
    equilibrium,
    find_states,
    largest_useful_order,
    stabilise,
    system_matrices,
)
from aeolid.identify.windows import Scaling, WindowFactor
from aeolid.models.model_file import Signal
from aeolid.models.modes import Mode, modes_of
from aeolid.models.prediction import estimate_initial_state
from aeolid.models.shaped_modes import with_shapes
from aeolid.models.shapes import index_of_reference
from aeolid.models.state_space import StateSpace
from aeolid.record import Record
from aeolid.wording import counted

if TYPE_CHECKING:
    from aeolid.identify.contrast import Contrast
    from aeolid.identify.refine import Refinement

Array = NDArray[np.float64]
LARGEST_AUTO_ORDER = 60


def assemble(
    windows: Windows, records: Sequence[Record], estimate: MarkovEstimate, settings: Settings,
    notes: Sequence[str] = (), extra: dict[str, Any] | None = None,
) -> Identification:  # fmt: skip
    """Find states, order, system matrices, modes and fit from Ξ: paper 000 eq. (20)–(27).

    records: as measured, on which the fit is taken; estimate: Ξ from windows.whole, or from a stream; notes and extra
    are what the method itself has to say. Raises NotIdentifiable on an order beyond the singular values above rounding.
    """
    scaling, factor = windows.scaling, windows.whole
    through = tuple(name in settings.feedthrough for name in scaling.inputs)
    basis = find_states(factor, estimate.theta, settings.future)
    choice = _order(windows, settings, through, basis)
    require_order(choice.order, largest_useful_order(basis), records[0].source)
    lost = factor.skipped > 0 or bool((extra or {}).get("preparation", {}).get("cells_drawn"))
    few = require_enough(factor.windows, choice.order, factor.inputs, factor.outputs, records[0].source, lost)
    require_own_excitation(factor, scaling.inputs, choice.order, through, records[0].source)
    require_states(factor, estimate.excited, choice.order, through, records[0].source)
    _require_loop_shows(windows, settings, choice.order, through)
    T = basis.state_map(choice.order)
    fitted = system_matrices(factor, T, through)
    before = stabilise(factor, fitted, T) if settings.stable else fitted
    known, scaled, rest, said = _settled(windows, settings, through, basis, (fitted, before), estimate, records, extra)
    model = with_start(model_in_units(scaled, rest, scaling, records[0]), records)
    model, fit = with_innovations(model, records)
    return Identification(
        model=model,
        modes=find_modes(model, windows.output_scale, known.poles, records, known.shapes, settings.reference),
        singular_values=basis.singular_values,
        order_choice=choice,
        fit=fit,
        markov=estimate,
        markov_parameters=theta_in_units(estimate.theta, scaling, settings.past),
        scaling=scaling,
        settings=settings,
        data=tuple({"source": r.source, "sha256": r.sha256, "samples": len(r)} for r in records),
        windows=factor.windows,
        skipped=factor.skipped,
        gain_method=scaled.gain_method,
        notes=(*_notes(factor, estimate, model), *((few,) if few else ()), *notes, *said),
        version=aeolid.__version__,
        extra=(extra or {}) | known.facts | ({"scarce": few} if few else {}),
        band=None if known.band is None else known.band.in_units(windows.output_scale, windows.input_scale),
    )


def _settled(
    windows: Windows, settings: Settings, through: tuple[bool, ...], basis: StateBasis,
    models: tuple[ScaledModel, ScaledModel], estimate: MarkovEstimate, records: Sequence[Record],
    extra: dict[str, Any] | None,
) -> tuple[Uncertainty, ScaledModel, Array, list[str]]:  # fmt: skip
    """Return the model with the steps that were asked for or are needed, its rest, what is known and said of it.

    models: as the regressions gave it, and that with poles moved inside, or the same.
    """
    fitted, scaled = models
    rest = equilibrium(windows.whole, basis.state_map(len(fitted.A)), scaled)
    done = _kept(_refine(windows, settings, through, scaled), (scaled, rest), records, windows.scaling)

    def quantified() -> Uncertainty:
        return quantify(
            windows.records, windows.scaling, windows.whole, basis, fitted, scaled, estimate, through, settings, done
        )

    if done is not None and done.steps:
        scaled, rest = done.model, done.equilibrium()
    said, known = _say_refinement(settings, done), quantified()
    facts = {} if done is None else {"refinement": done.to_json()}
    held = _contrasted(windows, settings, through, (scaled, rest), known.poles, records, extra or {})
    if held is not None and held.taken:
        scaled, rest, done = held.done.model, held.done.equilibrium(), held.done
        known = quantified()
    if held is not None:
        said, facts = [*said, *held.notes()], facts | held.to_json()
        from aeolid.identify.crowded import crowding

        facts |= crowding(windows, settings, through, basis, (scaled, held), known.poles, extra or {})
    return replace(known, facts=known.facts | facts), scaled, rest, said


def _require_loop_shows(windows: Windows, settings: Settings, order: int, through: tuple[bool, ...]) -> None:
    if settings.unexcited == "take":
        return
    names, source = windows.scaling.inputs, windows.records[0].source
    require_outside_excitation(windows.whole, names, order, settings.future, through, settings.regularization, source)


def _kept(
    done: Refinement | None, before: tuple[ScaledModel, Array], records: Sequence[Record], scaling: Scaling
) -> Refinement | None:
    if done is None:
        return None
    from aeolid.identify.keep_better import keep_better

    return keep_better(done, before, records, lambda m, at: model_in_units(m, at, scaling, records[0]))


def _contrasted(
    windows: Windows, settings: Settings, through: tuple[bool, ...], before: tuple[ScaledModel, Array],
    poles: Array | None, records: Sequence[Record], extra: dict[str, Any],
) -> Contrast | None:  # fmt: skip
    """Hold the model against prediction-error steps from it, where the settings ask for that; see `contrast`."""
    always = settings.contrast == "always"
    asked = always or (settings.contrast != "none" and not settings.stable)
    if not asked or settings.refined or settings.markov is not None:
        return None
    if poles is None or settings.uncertainty != "asymptotic":
        return None
    from aeolid.identify.contrast import contrast
    from aeolid.identify.extended import collect  # brings the compiled loops along, which others do without
    from aeolid.identify.refine import cut_stretches

    def kept(done: Refinement) -> Refinement:
        return _kept(done, before, records, windows.scaling) or done

    stretches = cut_stretches(collect(windows.records, windows.scaling.without_innovations(), settings.past))
    information = float(extra.get("preparation", {}).get("information", 1.0))
    step_s = records[0].sample_time_s
    return contrast(stretches, before[0], poles, through, step_s, kept, information, always, settings.stable)


def _head_states(windows: Windows, settings: Settings, through: tuple[bool, ...]) -> StateBasis:
    """Return the states by the part that chooses the order alone, whatever Ξ the model is made of.

    Ξ of a stream has learnt from every sample, with forgetting from the held-out ones most: its error on them falls
    with every order, and would choose another one than the samples do.
    """
    theta = estimate_markov(windows.fitted, through, settings.regularization, windows.solution).theta
    return find_states(windows.fitted, theta, settings.future)


def _order(windows: Windows, settings: Settings, through: tuple[bool, ...], basis: StateBasis) -> OrderChoice:
    if settings.order is not None:
        return OrderChoice(settings.order, f"order {settings.order}: as asked for", ())
    most = min(LARGEST_AUTO_ORDER, largest_useful_order(basis))
    require_order(1, most, windows.records[0].source)
    if windows.trial is not None and windows.trial.states is not None:
        most = min(most, windows.trial.states)
    head, held_out = _head_states(windows, settings, through), windows.held_out()
    unseen = choose_held_out(windows.fitted, head, held_out, through, most)
    if unseen is not None:
        unseen = guard_order(unseen, windows.fitted, head, windows.whole, basis, held_out, through)
    information = information_costs(windows.whole, basis, windows.held_out(everything=True), through, most)
    return decide(settings.order_criterion, unseen, information, basis.singular_values, most)


def _refine(windows: Windows, settings: Settings, through: tuple[bool, ...], scaled: ScaledModel) -> Refinement | None:
    """Refine the model where that was asked for; the model of the fit part, of the same order, says how far.

    None where it was not asked for, and where the fit part shows no state.
    """
    if not settings.refined:
        return None
    head = _head_states(windows, settings, through)
    order = min(len(scaled.A), largest_useful_order(head))
    if order == 0:
        return None
    T = head.state_map(order)
    first = system_matrices(windows.fitted, T, through)
    if settings.stable:
        first = stabilise(windows.fitted, first, T)
    from aeolid.identify.extended import collect  # brings the compiled loops along, which others do without
    from aeolid.identify.refine import cut_stretches, refine

    samples = collect(windows.records, windows.scaling.without_innovations(), settings.past)
    return refine(cut_stretches(samples), scaled, first, through, settings.stable)


def _say_refinement(settings: Settings, done: Refinement | None) -> list[str]:
    if not settings.refined:
        return []
    nothing = f"not refined: the first {FIT_PART:.0%} of the recordings, on which steps would be tried, show no state"
    return [nothing if done is None else done.text()]


def with_innovations(model: StateSpace, records: Sequence[Record]) -> tuple[StateSpace, Fit]:
    """Return the model with the covariance of its innovations as measured, and its fit."""
    fit = measure_fit(model, records)
    covariance = fit.covariance(model.order)
    if covariance is None:  # the one of the Riccati equation stays
        return model, fit
    return replace(model, innovation_covariance=covariance), fit


def find_modes(
    model: StateSpace, output_scale: Array, spread: Array | None, records: Sequence[Record],
    shapes: Array | None = None, reference: str | None = None,
) -> tuple[Mode, ...]:  # fmt: skip
    """List the modes with their shapes; those on harmonics of the rotor, where its speed is known, are marked.

    spread, shapes: covariances as in `Uncertainty`; reference: the output that shapes are scaled to.
    """
    modes = modes_of(model, output_scale=output_scale, pole_covariance=spread)
    at = index_of_reference([s.name for s in model.outputs], reference)
    return marked(with_shapes(modes, model, output_scale, at, shapes), records, not model.inputs)


def model_in_units(scaled: ScaledModel, rest: Array, scaling: Scaling, record: Record) -> StateSpace:
    """Undo the scaling: u, y in the channels' units, u about its mean, y about its rest (l,) under that mean."""
    names = scaling.inputs + scaling.outputs
    r, count = len(scaling.inputs), len(names)
    offset = scaling.offset[:count] + scaling.scale[:count] * np.concatenate([np.zeros(r), rest])
    su, sy = scaling.scale[:r], scaling.scale[r:count]
    signals = [Signal(n, record.unit(n), float(o)) for n, o in zip(names, offset, strict=True)]
    n = len(scaled.A)
    return StateSpace(
        scaled.A, scaled.B / su, sy[:, None] * scaled.C, sy[:, None] * scaled.D / su, scaled.K / sy, np.zeros(n),
        sy[:, None] * scaled.covariance * sy, record.sample_time_s, tuple(signals[:r]), tuple(signals[r:]),
        tuple(Signal(f"x{i + 1}") for i in range(n)),
    )  # fmt: skip


def with_start(model: StateSpace, records: Sequence[Record]) -> StateSpace:
    """Return the model with the estimated state at the first complete sample of the first recording."""
    for _, u, y in stretches(model, records[0]):
        return replace(model, x0=estimate_initial_state(model, u - model.u_offset, y - model.y_offset))
    return model


def _notes(factor: WindowFactor, estimate: MarkovEstimate, model: StateSpace) -> tuple[str, ...]:
    notes = []
    if factor.skipped:
        notes.append(
            f"{counted(factor.skipped, 'window')} with a missing sample "
            f"{'was' if factor.skipped == 1 else 'were'} left out, {factor.windows} used"
        )
    if estimate.rank < estimate.regressors:
        notes.append(
            f"the data tell {estimate.rank} of {estimate.regressors} regressors apart (fewer noise sources than "
            "outputs, or an input without excitation); "
            + ("as many columns were taken" if estimate.columns else "the smallest solution was taken")
        )
    growing = int(np.count_nonzero(abs(np.linalg.eigvals(model.A)) > 1))
    if growing:
        notes.append(
            f"{growing} of {model.order} poles lie outside the unit circle, a free run diverges: "
            "lengthen the past window (or decimate), or ask for a stable model"
        )
    return tuple(notes)
