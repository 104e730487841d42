"""Merge set-ups to one realisation by their references (modular PreGER) and find its modes.

Modes that at least two set-ups show by themselves, matched by frequency and by the shape on the references as in
`setups`, make the order: two states each. Every set-up gives its model of the longest window, whose bias is the least,
restricted to these modes (`setup_states`), and `global_basis` joins them. In each set-up a mode counts by the weight
ζ/σ² of its frequency, as in `setups`, and all modes alike: by their energy weak ones would be lost in what strong ones
disagree by. Poles of noise, and of what colours the excitation of one set-up, have no part in it. A mode of the
realisation is told where it is one of those. The deviations are those of the models, pushed through; where set-ups
differ in a mode by more than chance explains they are widened as in `setups`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.diagram import Pole
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
    mean,
    set_up,
    weights_of,
)
from aeolid.identify.setup_references import compared_references
from aeolid.identify.setup_shapes import PartShape
from aeolid.identify.setup_states import balanced, chosen_model, part_of
from aeolid.identify.setups import MergedModal, MergedMode, gathered, in_units
from aeolid.identify.shape_spread import shape_covariance
from aeolid.identify.uncertainty import covariance_of, pole_covariance
from aeolid.models.modes import Mode, continuous_poles, frequency_and_damping, pushed_to_modes
from aeolid.models.shapes import Shape, assurance

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
CONFIRMED = 2  # set-ups that show a mode by themselves
Groups = Sequence[Sequence[Seen]]


@dataclass(frozen=True, eq=False)
class Found:
    """Hold a pole of the realisation, its shape of all sensors, the entry that is 1, covariances (L, 2, 2).

    place: of the group of modes that it is nearest to; shown (L,): which sensors are of set-ups that have these.
    """

    pole: Pole
    part: PartShape
    reference: int
    covariance: Array
    place: int
    shown: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Realised:
    """Hold a realisation, the parts it is made of, and which set-up's model has which mode (set-ups, modes)."""

    joint: Joint
    parts: list[Part]
    has: NDArray[np.bool_]

    def shown(self, place: int) -> NDArray[np.bool_]:
        """Return at which sensors (L,) a mode is shown: the references, and those of set-ups whose models have it."""
        count = self.joint.references
        moved = [np.full(len(p.C) - count, h) for p, h in zip(self.parts, self.has[:, place], strict=True)]
        return np.concatenate([np.ones(count, dtype=bool), *moved])


def realise(modals: Sequence[Modal], references: Sequence[str], reference: str | None = None) -> MergedModal:
    """Merge set-ups to one realisation; parameters as in `setups.merge`.

    Raises NotIdentifiable where no two set-ups show the same mode, or the references do not observe one that is shown,
    and DataError as there.
    """
    setups, count = set_up(modals, references), len(references)
    compared = compared_references(setups, references)
    groups = [g for g in matched(setups, count) if len(g) >= CONFIRMED]
    groups.sort(key=lambda group: mean(group, "frequency_hz"))
    if not groups:
        told = ", ".join(f"{len(s.modal.listed)} in {s.number}" for s in setups)
        raise NotIdentifiable(
            f"no two set-ups show the same mode by frequency and by its shape on the references (modes: {told}), so "
            "that one realisation has no order; record longer, or choose references that move in the modes"
        )
    used = [s for s in setups if any(one.setup is s for g in groups for one in g)]
    names = [*references, *(n for s in used for n in s.outputs[count:])]
    at = names.index(reference) if reference in names else None
    whole = _realised(used, groups, count, 0, True)
    poles = _poles(whole, _realised(used, groups, count, 1, False).joint, groups, min(_steps(used)), at)
    modes, lost = _confirmed(poles, groups, used, setups, names)
    notes = [
        f"mode at {mean(g, 'frequency_hz'):.4g} Hz: in set-ups {', '.join(str(s.setup.number) for s in g)} by "
        "themselves, and not in their realisation; the references hardly move in it, or two modes are too near"
        for g in lost
    ]
    found = gathered(modes, setups, references, by="preger", order=len(whole.joint.A))
    return replace(found, notes=(*found.notes, *notes, *compared))


def _steps(setups: Sequence[Setup]) -> list[float]:
    return [s.modal.diagram.sample_time_s for s in setups]


def _realised(setups: Sequence[Setup], groups: Groups, references: int, back: int, known: bool) -> Realised:
    """Return the realisation of the models of the window that is `back` before the longest; known: with spreads."""
    parts, reach, shares, step = [], [], [], min(_steps(setups))
    has = np.zeros((len(setups), len(groups)), dtype=bool)
    weights = [weights_of(g, "frequency_hz")[2] for g in groups]
    for i, s in enumerate(setups):
        diagram = s.modal.diagram
        window = diagram.windows[-1 - min(back, len(diagram.windows) - 1)]
        mine = [(j, k, one) for j, g in enumerate(groups) for k, one in enumerate(g) if one.setup is s]
        order, poles = chosen_model(s, [s.modal.modes.index(one.mode) for *_, one in mine], window)
        kept = [(j, k, p) for (j, k, _), p in zip(mine, poles, strict=True) if p is not None]
        has[i, [j for j, *_ in kept]] = True
        parts.append(part_of(s, window, order, [p for *_, p in kept], step, known))
        shares.append([float(np.sqrt(weights[j][k] / weights[j].sum())) for j, k, _ in kept])
        reach.append(window * diagram.sample_time_s)
    states = 2 * len(groups)
    blocks = max(round(min(reach) / step), -(-states // references) + 1)
    parts = [balanced(p, share, references, blocks) for p, share in zip(parts, shares, strict=True)]
    return Realised(join(parts, references, states, blocks), parts, has)


def _poles(whole: Realised, shorter: Joint, groups: Groups, step: float, reference: int | None) -> list[Found]:
    """Return the poles above the real axis with shapes of the sensors that show them, and covariances.

    Added to these is the square of what the next shorter windows move a pole by: what a window leaves out falls with
    its length, so that the difference bounds what the longest still leaves out.
    """
    joint = whole.joint
    values, raw = _eigen(joint)
    others, turned = _eigen(shorter)
    up = np.flatnonzero(values.imag > 0)
    places = [_nearest(values[i], raw[: joint.references, i], groups, step) for i in up]
    shown = [whole.shown(j) for j in places]
    at = [int(np.argmax(abs(raw[:, i]) * keep)) if reference is None or not keep[reference] else reference
          for i, keep in zip(up, shown, strict=True)]  # fmt: skip
    around, beside = _covariances(whole, up, at)
    found = []
    for k, i in enumerate(up):
        shape = raw[:, i] / raw[at[k], i]
        near = int(np.argmin(abs(others - values[i]) + 1 - assurance(shape[:, None], turned)[0]))
        around[k] += covariance_of(np.array([others[near] - values[i]]))
        beside[k] += covariance_of((turned[:, near] / turned[at[k], near] - shape)[None])
        s = complex(continuous_poles(values[i : i + 1], step)[0])
        told = (*frequency_and_damping(s), *pushed_to_modes(complex(values[i]), s, step, around[k]))
        pole = Pole(0, len(values), complex(values[i]), *told, shape)
        part = _part_shape(shape, beside[k], joint.references)
        found.append(Found(pole, part, at[k], beside[k], places[k], shown[k]))
    return found


def _eigen(joint: Joint) -> tuple[ComplexArray, ComplexArray]:
    """Return eigenvalues and shapes (L, n)."""
    values, right = np.linalg.eig(joint.A)
    return values.astype(complex), (joint.C @ right).astype(complex)


def _nearest(value: complex, shared: ComplexArray, groups: Groups, step: float) -> int:
    """Return the place of the modes that a pole is nearest to in frequency and shape (r,) on the references."""
    hertz = abs(np.log(value)) / (2 * np.pi * step)
    far = [
        min(
            abs(s.mode.frequency_hz / hertz - 1) + 1 - assurance(s.part.shared[:, None], shared[:, None])[0, 0]
            for s in g
        )
        for g in groups
    ]
    return int(np.argmin(far))


def _covariances(whole: Realised, up: NDArray[np.intp], at: Sequence[int]) -> tuple[Array, Array]:
    """Return those of poles (k, 2, 2) and of the entries of their shapes (k, L, 2, 2), each beside its own entry."""
    joint = whole.joint
    around, beside = np.zeros((len(up), 2, 2)), np.zeros((len(up), len(joint.C), 2, 2))
    if any(p.root is None for p in whole.parts):
        return around * np.nan, beside * np.nan
    for spread in spreads(whole.parts, joint):
        around += pole_covariance(joint.A, spread)[up]
        for entry in set(at):
            mine = [k for k, a in enumerate(at) if a == entry]
            beside[mine] += shape_covariance(joint.model, spread, entry)[up[mine]]
    return around, beside


def _part_shape(shape: ComplexArray, around: Array, references: int) -> PartShape:
    covariance = np.diag(np.concatenate([around[:, 0, 0], around[:, 1, 1]]))
    return PartShape(shape, np.nan_to_num(covariance), references)


def _confirmed(
    poles: Sequence[Found], groups: Groups, used: Sequence[Setup], setups: Sequence[Setup], names: Sequence[str]
) -> tuple[list[MergedMode], list[Sequence[Seen]]]:
    """Return the modes of the realisation that are those of the groups, by frequency, and the groups without one."""
    criteria, duration = used[0].modal.criteria, min(s.modal.diagram.duration_s for s in used)
    found, lost = [], dict(enumerate(groups))
    for one in sorted(poles, key=lambda p: p.pole.frequency_std_hz):
        mode = _mode(one, used, names)
        group = lost.get(one.place)
        if group is None or not criteria.admits(one.pole, duration):
            continue
        if distance(Seen(used[0], mode, one.part), group) < FAR:
            found.append(_merged(mode, one.part, group, setups, 2 * len(groups)))
            del lost[one.place]
    return sorted(found, key=lambda m: m.mode.frequency_hz), list(lost.values())


def _mode(found: Found, setups: Sequence[Setup], names: Sequence[str]) -> Mode:
    pole, size = found.pole, abs(found.pole.shape) * found.shown
    shares = {n: float(v / size.sum()) for n, v, keep in zip(names, size, found.shown, strict=True) if keep}
    shape = _shape(found, setups, names)
    stds = (pole.frequency_std_hz, pole.damping_std)
    return Mode(pole.frequency_hz, pole.damping, pole.eigenvalue, *stds, shares, shape=shape)


def _shape(found: Found, setups: Sequence[Setup], names: Sequence[str]) -> Shape:
    """Return the shape at the references and at the sensors of set-ups whose models have the mode."""
    count = found.part.references
    scale = np.concatenate([setups[0].scale[:count], *(s.scale[count:] for s in setups)])
    keep = np.flatnonzero(found.shown)
    at = int(np.searchsorted(keep, found.reference))
    kept = [n for n, here in zip(names, found.shown, strict=True) if here]
    return in_units(kept, scale[keep], found.part.values[keep], found.covariance[keep], at)


def _merged(mode: Mode, part: PartShape, group: Sequence[Seen], setups: Sequence[Setup], tests: int) -> MergedMode:
    """Return a mode with what each set-up says of it, widened where they disagree, and its sentences."""
    group = sorted(group, key=lambda s: s.setup.number)
    hertz, damping = (combined(group, quantity, tests)[2] for quantity in ("frequency_hz", "damping"))
    mode = replace(
        mode,
        frequency_std_hz=None if mode.frequency_std_hz is None else mode.frequency_std_hz * hertz,
        damping_std=None if mode.damping_std is None else mode.damping_std * damping,
    )
    notes = _notes(mode, part, group, setups) + disagreements(mode, group, hertz, damping)
    return MergedMode(mode, tuple(group), least_assurance(group), tuple(notes))


def _notes(mode: Mode, part: PartShape, group: Sequence[Seen], setups: Sequence[Setup]) -> list[str]:
    """Say in which set-ups the mode is not found, and whether the references are at a node of it."""
    notes, here = [], f"mode at {mode.frequency_hz:.4g} Hz"
    met = {s.setup.number for s in group}
    for setup in setups:
        others = ", ".join(setup.outputs[part.references :])
        if setup.number not in met:
            without = f"; its shape is without {others}" if others else ""
            notes.append(f"{here}: not found in set-up {setup.number} ({setup.source}){without}")
    if not part.shows:
        notes.append(
            f"{here}: the references move by little more than their deviations, at a node of the mode or because "
            "another is near; its shape is little known; add a reference elsewhere"
        )
    return notes
