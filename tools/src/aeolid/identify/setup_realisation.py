"""Merge set-ups to one realisation by their references (modular PreGER) and find its modes.

The models are those of the longest window of each set-up, whose bias is the least, and of SURE states more than
predict, or more where the realisation has more; `global_basis` joins them. The order of the realisation is the largest
that predicts in a set-up, made even, unless it is given. Its poles are modes where at least two set-ups show them by
themselves: matched by frequency and by the shape on the references as in `setups`. The others describe noise, or what
shakes one set-up alone. The deviations are those of the models, pushed through the merging; where set-ups differ in a
mode by more than chance explains they are widened as in `setups`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.identify.diagram import SURE, Pole
from aeolid.identify.global_basis import Joint, Part, join, spreads
from aeolid.identify.modal import Modal
from aeolid.identify.setup_matching import (
    FAR,
    Seen,
    Setup,
    combined,
    disagreements,
    distance,
    least_assurance,
    matched,
    set_up,
)
from aeolid.identify.setup_shapes import PartShape
from aeolid.identify.setups import MergedModal, MergedMode, gathered, in_units
from aeolid.identify.shape_spread import shape_covariance
from aeolid.identify.uncertainty import covariance_of, matrix_spread, pole_covariance
from aeolid.models.modes import Mode, continuous_poles, frequency_and_damping, pushed_to_modes
from aeolid.models.shapes import assurance, reference_outputs, scaled_to

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
SAME_STEP = 1e-6  # relative: of sample times that are one
CONFIRMED = 2  # set-ups that show a mode by themselves


@dataclass(frozen=True, eq=False)
class Found:
    """Hold a pole of the realisation, its shape of all sensors, the entry that is 1, covariances (L, 2, 2)."""

    pole: Pole
    part: PartShape
    reference: int
    covariance: Array


def realise(
    modals: Sequence[Modal], references: Sequence[str], reference: str | None = None, order: int | None = None
) -> MergedModal:
    """Merge set-ups to one realisation; parameters as in `setups.merge`; order: its states, default by the data.

    Raises UsageError where sample times differ or a set-up has no model of such an order, NotIdentifiable where the
    references do not observe the states.
    """
    setups = set_up(modals, references)
    steps = [s.modal.diagram.sample_time_s for s in setups]
    other = next((i for i, h in enumerate(steps) if abs(h / steps[0] - 1) > SAME_STEP), None)
    if other is not None:
        raise UsageError(
            f"set-up 1 has a sample time of {steps[0]:g} s and set-up {other + 1} of {steps[other]:g} s: one "
            "realisation has one; resample the recordings, or merge mode by mode (--merge-by poser)"
        )
    states = _order(setups, order)
    names = [*references, *(n for s in setups for n in s.outputs[len(references) :])]
    at = names.index(reference) if reference in names else None
    poles = _poles(setups, states, len(references), at)
    return gathered(_confirmed(poles, setups, references, names), setups, references, by="preger", order=states)


def _order(setups: Sequence[Setup], order: int | None) -> int:
    """Return the order of the realisation: the given one, or the largest that predicts, even, as far as models go."""
    most = [max(s.modal.diagram.sources[s.modal.diagram.windows[-1]].orders) for s in setups]
    least = int(np.argmin(most))
    if order is None:
        wanted = max(s.modal.diagram.order for s in setups)
        return min(wanted + wanted % 2, max(most[least] - SURE, 2))
    if order < 2:
        raise UsageError(f"--order {order} is not at least 2: a mode has two states")
    if order > most[least]:
        raise UsageError(
            f"--order {order}: set-up {least + 1} ({setups[least].source}) has models of up to {most[least]} states, "
            "and all set-ups need one order; lower --order, or raise --largest-order or --past"
        )
    return order


def _joint(setups: Sequence[Setup], states: int, references: int, back: int, known: bool) -> tuple[list[Part], Joint]:
    """Return the models of the window that is `back` before the longest, and their realisation; known: with spread."""
    windows = [s.modal.diagram.windows[-1 - min(back, len(s.modal.diagram.windows) - 1)] for s in setups]
    parts = [_part(s, w, states, known) for s, w in zip(setups, windows, strict=True)]
    blocks = max(min(windows), -(-states // references) + 1)
    return parts, join(parts, references, states, blocks)


def _part(setup: Setup, window: int, states: int, known: bool) -> Part:
    """Return the model of a set-up, outputs with the references first in comparable scales, and its spread."""
    diagram = setup.modal.diagram
    source = diagram.sources[window]
    order = min(states + SURE, max(source.orders))
    model = diagram.model(window, order).model
    places = [diagram.outputs.index(n) for n in setup.outputs]
    unit = diagram.scaling.scale[places] / setup.scale
    size = np.sqrt(source.basis.singular_values[:order] * np.sqrt(source.whole.windows))  # of the rows of X = S ΓK Z
    part = Part(model.A, model.C[places] * unit[:, None], np.diag(size), source.whole.windows)
    if not known:
        return part
    spread = matrix_spread(source.whole, source.basis, model, source.estimate, (), states=True)
    root = spread.root.reshape(len(spread.root), -1, order)
    of_A, of_C, of_X = np.split(root, [order, order + len(places)], axis=1)
    root = np.concatenate([of_A, of_C[:, places] * unit[:, None], of_X / size], axis=1)  # ΔS Sᵀ = ΔX Xᵀ
    return replace(part, root=root if np.isfinite(root).all() else None)


def _poles(setups: Sequence[Setup], states: int, references: int, reference: int | None) -> list[Found]:
    """Return the poles above the real axis with shapes of all sensors and covariances.

    Added to these is the square of what the next shorter windows move a pole by: what a window leaves out falls with
    its length, so that the difference bounds what the longest still leaves out.
    """
    parts, joint = _joint(setups, states, references, 0, True)
    step = setups[0].modal.diagram.sample_time_s
    n, (values, shapes, at) = len(joint.A), _eigen(joint, reference)
    around, beside = np.zeros((n, 2, 2)), np.zeros((n, len(joint.C), 2, 2))
    for spread in spreads(parts, joint):
        around += pole_covariance(joint.A, spread)
        beside += shape_covariance(joint.model, spread, reference)
    if any(p.root is None for p in parts):
        around[:], beside[:] = np.nan, np.nan
    others, turned, _ = _eigen(_joint(setups, states, references, 1, False)[1], reference)
    found = []
    for i in np.flatnonzero((values.imag > 0) & np.isfinite(shapes).all(axis=0)):
        alike = assurance(shapes[:, i : i + 1], turned)[0]
        near = int(np.argmin(abs(others - values[i]) + 1 - alike))
        around[i] += covariance_of(np.array([others[near] - values[i]]))
        beside[i] += covariance_of((turned[:, near] / turned[at[i], near] - shapes[:, i])[None])
        s = complex(continuous_poles(values[i : i + 1], step)[0])
        told = (*frequency_and_damping(s), *pushed_to_modes(complex(values[i]), s, step, around[i]))
        pole = Pole(0, n, complex(values[i]), *told, shapes[:, i])
        found.append(Found(pole, _part_shape(shapes[:, i], beside[i], references), int(at[i]), beside[i]))
    return found


def _eigen(joint: Joint, reference: int | None) -> tuple[ComplexArray, ComplexArray, NDArray[np.intp]]:
    """Return eigenvalues, shapes (L, n) that are 1 at their reference, and these."""
    values, right = np.linalg.eig(joint.A)
    raw = joint.C @ right
    at = reference_outputs(raw, reference)
    return values.astype(complex), scaled_to(raw.astype(complex), at), at


def _part_shape(shape: ComplexArray, around: Array, references: int) -> PartShape:
    covariance = np.diag(np.concatenate([around[:, 0, 0], around[:, 1, 1]]))
    return PartShape(shape, np.nan_to_num(covariance), references)


def _confirmed(
    poles: Sequence[Found], setups: Sequence[Setup], references: Sequence[str], names: Sequence[str]
) -> list[MergedMode]:
    """Return the modes of the realisation that at least two set-ups show by themselves, by frequency."""
    from scipy.optimize import linear_sum_assignment  # half a second to load

    count = len(references)
    groups = [g for g in matched(setups, count) if len(g) >= CONFIRMED]
    criteria, duration = setups[0].modal.criteria, min(s.modal.diagram.duration_s for s in setups)
    poles = [p for p in poles if criteria.admits(p.pole, duration)]
    if not groups or not poles:
        return []
    mine = [Seen(setups[0], _mode(p.pole, names), p.part) for p in poles]
    far = np.array([[distance(one, group) for group in groups] for one in mine])
    scale = np.concatenate([setups[0].scale[:count], *(s.scale[count:] for s in setups)])
    found = []
    for i, j in zip(*linear_sum_assignment(far), strict=True):
        if far[i, j] < FAR:
            one = poles[i]
            mode = replace(mine[i].mode, shape=in_units(names, scale, one.part.values, one.covariance, one.reference))
            found.append(_merged(mode, one.part, groups[j], setups, references, 2 * len(groups)))
    return sorted(found, key=lambda m: m.mode.frequency_hz)


def _mode(pole: Pole, names: Sequence[str]) -> Mode:
    size = abs(pole.shape)
    shares = dict(zip(names, map(float, size / size.sum()), strict=True))
    return Mode(
        pole.frequency_hz, pole.damping, pole.eigenvalue, pole.frequency_std_hz, pole.damping_std, shares
    )  # fmt: skip


def _merged(
    mode: Mode, part: PartShape, group: Sequence[Seen], setups: Sequence[Setup], references: Sequence[str], tests: int
) -> MergedMode:
    """Return a mode with what each set-up says of it, widened where they disagree, and its sentences."""
    group = sorted(group, key=lambda s: s.setup.number)
    hertz, damping = (combined(group, quantity, tests)[2] for quantity in ("frequency_hz", "damping"))
    mode = replace(
        mode,
        frequency_std_hz=None if mode.frequency_std_hz is None else mode.frequency_std_hz * hertz,
        damping_std=None if mode.damping_std is None else mode.damping_std * damping,
    )
    notes = _notes(mode, part, group, setups, references) + disagreements(mode, group, hertz, damping)
    return MergedMode(mode, tuple(group), least_assurance(group), tuple(notes))


def _notes(
    mode: Mode, part: PartShape, group: Sequence[Seen], setups: Sequence[Setup], references: Sequence[str]
) -> list[str]:
    """Say which set-ups do not show the mode by themselves, and whether the references are at a node of it."""
    notes, here = [], f"mode at {mode.frequency_hz:.4g} Hz"
    met = {s.setup.number for s in group}
    for setup in setups:
        others = ", ".join(setup.outputs[len(references) :])
        if setup.number not in met:
            weak = f"; its shape at {others} rests on what is common to the set-ups" if others else ""
            notes.append(f"{here}: not found in set-up {setup.number} ({setup.source}) by itself{weak}")
    if not part.shows:
        notes.append(
            f"{here}: the references hardly move, a node of the mode; its shape at the other sensors is little "
            "known; choose a reference elsewhere"
        )
    return notes
