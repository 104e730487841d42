"""Merge the modes of several recordings of one structure in which a few sensors stay and the others roam (PoSER).

Each set-up is identified by itself (`modal`), since what shakes the structure differs from one to the next. Modes of
two set-ups are one where frequency and, on the references, the modal assurance criterion agree; `setup_shapes` joins
their shapes. Frequency and damping are means with the weights ζ_i/σ_i²: the variance of both grows with the damping
(Au 2014), whose own error would else pull the means to set-ups that underestimate it. Where set-ups differ by more
than chance explains (χ² of the deviations), the band is widened by √(χ²/(k − 1)) and a sentence says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from aeolid.geometry import Geometry, united
from aeolid.identify.clusters import Cluster
from aeolid.identify.modal import Modal
from aeolid.identify.mode_names import mode_lines, named
from aeolid.identify.setup_shapes import PartShape, joined, part_shape
from aeolid.models.modes import Mode
from aeolid.models.shapes import Shape, assurance
from aeolid.models.wire_frame import complexity_lines, geometry_facts

Array = NDArray[np.float64]
NEAR = 0.03  # relative: temperature and moved cables shift a mode by a percent or two between set-ups
DEVIATIONS = 3.0
ALIKE = 0.8  # assurance on the references
CHANCE = 0.01  # of one sentence about a disagreement that is none, over all modes and both quantities
FAR = 1e3


@dataclass(frozen=True, eq=False)
class Setup:
    """Hold one set-up: its modes, the outputs with the references first, their scales, and its number from 1.

    level: by how much more the references move than in the first set-up.
    """

    number: int
    modal: Modal
    outputs: tuple[str, ...]
    scale: Array
    level: float

    @property
    def source(self) -> str:
        """Return the recording."""
        return ", ".join(str(s["source"]) for s in self.modal.sources)


@dataclass(frozen=True, eq=False)
class Seen:
    """Hold what one set-up shows of a mode."""

    setup: Setup
    mode: Mode
    part: PartShape


@dataclass(frozen=True, eq=False)
class MergedMode:
    """Hold a mode of all set-ups together, what each shows of it, the sensors of its shape's entries, sentences."""

    mode: Mode
    seen: tuple[Seen, ...]
    lowest_assurance: float | None
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the facts of the mode; "setups": what each set-up that has it says."""
        told = [
            {"setup": s.setup.number, "frequency_hz": s.mode.frequency_hz, "damping": s.mode.damping,
             "frequency_std_hz": s.mode.frequency_std_hz, "damping_std": s.mode.damping_std,
             "joined": s.part.shows} for s in self.seen
        ]  # fmt: skip
        own = {"setups": told, "lowest_assurance": self.lowest_assurance, "notes": list(self.notes)}
        return self.mode.to_json() | own


@dataclass(frozen=True, eq=False)
class MergedModal:
    """Hold the modes of several set-ups, merged by their references; geometry: of the sensors of all, where known."""

    modes: tuple[MergedMode, ...]
    setups: tuple[Setup, ...]
    references: tuple[str, ...]
    outputs: tuple[str, ...]
    notes: tuple[str, ...]
    geometry: Geometry | None = None

    @property
    def listed(self) -> tuple[Mode, ...]:
        """Return the merged modes by frequency."""
        return tuple(m.mode for m in self.modes)

    @property
    def sample_time_s(self) -> float:
        """Return the shortest sample time of the set-ups."""
        return min(s.modal.diagram.sample_time_s for s in self.setups)

    def to_json(self) -> dict[str, Any]:
        """Return the facts for machines; "setups" holds those of each set-up as a modal analysis of its own."""
        return {
            "references": list(self.references), "outputs": list(self.outputs), "sample_time_s": self.sample_time_s,
            "modes": [m.to_json() for m in self.modes], "notes": list(self.notes),
            "setups": [s.modal.to_json() | {"level": s.level} for s in self.setups],
        } | geometry_facts(self.geometry, self.listed)  # fmt: skip

    def summary(self) -> str:
        """Return the result as a few lines of text."""
        lines = [f"{len(self.setups)} set-ups, {len(self.outputs)} sensors, references {', '.join(self.references)}"]
        for s in self.setups:
            others = ", ".join(s.outputs[len(self.references) :]) or "none besides"
            lines.append(
                f"  set-up {s.number} ({s.source}): {others}; {len(s.modal.listed)} modes, "
                f"{len(s.modal.modes) - len(s.modal.listed)} harmonics and steady sines, level {s.level:.2g}"
            )
        lines += mode_lines(self.listed, self.sample_time_s)
        if self.listed:
            lines += ["  in set-ups, and shapes (amplitude beside the reference, phase in degrees):"]
        lines += [_shape_line(m) for m in self.modes]
        lines += complexity_lines(self.geometry, self.listed)
        lines += [note for m in self.modes for note in m.notes]
        return "\n".join([*lines, *self.notes])


def _shape_line(merged: MergedMode) -> str:
    mode, numbers = merged.mode, ", ".join(str(s.setup.number) for s in merged.seen)
    if mode.shape is None:
        return f"    {mode.frequency_hz:.4g} Hz (in {numbers}): no shape"
    parts = [
        f"{name} {abs(value):.3g} at {np.degrees(np.angle(value)):.0f}"
        for name, value in mode.shape.values.items() if name != mode.shape.reference
    ]  # fmt: skip
    return f"    {mode.frequency_hz:.4g} Hz (in {numbers}): {', '.join([f'{mode.shape.reference} 1', *parts])}"


def merge(modals: Sequence[Modal], references: Sequence[str], reference: str | None = None) -> MergedModal:
    """Merge the modes of set-ups, each with the references and sensors of its own (checked by `setup_request`).

    reference: the sensor that shapes are scaled to, default the one that moves most in each mode.
    """
    setups = _setups(modals, references)
    groups = _matched(setups, len(references))
    groups.sort(key=lambda group: _mean(group, "frequency_hz"))
    modes = [_merged(group, setups, references, reference, 2 * len(groups)) for group in groups]
    names = named([m.mode for m in modes], None)
    modes = [replace(m, mode=mode) for m, mode in zip(modes, names, strict=True)]
    outputs = [*references, *(name for s in setups for name in s.outputs[len(references) :])]
    notes = [f"set-up {s.number} ({s.source}) shows no mode" for s in setups if not s.modal.listed]
    if len(references) == 1 and _crowded(modes):
        notes.append("with one reference near modes are told apart by frequency alone; two or more are better")
    geometry = united(m.geometry for m in modals)
    return MergedModal(tuple(modes), setups, tuple(references), tuple(outputs), tuple(notes), geometry)


def _crowded(modes: Sequence[MergedMode]) -> bool:
    hertz = np.array([m.mode.frequency_hz for m in modes])
    return bool((np.diff(hertz) < 2 * NEAR * hertz[1:]).any())


def _setups(modals: Sequence[Modal], references: Sequence[str]) -> tuple[Setup, ...]:
    """Return the set-ups with scales that are comparable: what shakes each more or less is taken out of them."""
    sizes = []
    for modal in modals:
        scaling = modal.diagram.scaling
        size = dict(zip(scaling.outputs, map(float, scaling.scale), strict=True))
        names = (*references, *(n for n in scaling.outputs if n not in references))
        sizes.append((names, np.array([size[n] for n in names])))
    count = len(references)
    levels = [float(np.exp(np.mean(np.log(size[:count] / sizes[0][1][:count])))) for _, size in sizes]
    shared = np.exp(np.mean([np.log(s[:count] / v) for (_, s), v in zip(sizes, levels, strict=True)], axis=0))
    return tuple(
        Setup(i + 1, modal, names, np.concatenate([shared, size[count:] / level]), level)
        for i, (modal, (names, size), level) in enumerate(zip(modals, sizes, levels, strict=True))
    )


def _seen(setup: Setup, mode: Mode, cluster: Cluster, references: int) -> Seen:
    diagram = setup.modal.diagram
    places = [diagram.outputs.index(n) for n in setup.outputs]
    return Seen(setup, mode, part_shape(cluster, diagram, places, setup.scale, references))


def _matched(setups: Sequence[Setup], references: int) -> list[list[Seen]]:
    """Return the modes as groups of at most one of each set-up; the set-up with most modes begins."""
    from scipy.optimize import linear_sum_assignment  # half a second to load

    groups: list[list[Seen]] = []
    for setup in sorted(setups, key=lambda s: -len(s.modal.listed)):
        pairs = zip(setup.modal.modes, setup.modal.stability, strict=True)
        mine = [_seen(setup, m, c, references) for m, c in pairs if m in setup.modal.listed]
        taken: set[int] = set()
        if groups and mine:
            far = np.array([[_distance(one, group) for group in groups] for one in mine])
            for i, j in zip(*linear_sum_assignment(far), strict=True):
                if far[i, j] < FAR:
                    groups[j].append(mine[i])
                    taken.add(int(i))
        groups += [[one] for i, one in enumerate(mine) if i not in taken]
    return groups


def _distance(one: Seen, group: Sequence[Seen]) -> float:
    """Return how far a mode is from a group in units of what is allowed, FAR beyond: the mean over its members."""
    told = []
    for other in group:
        middle = (one.mode.frequency_hz + other.mode.frequency_hz) / 2
        spread = float(np.hypot(one.mode.frequency_std_hz or 0.0, other.mode.frequency_std_hz or 0.0))
        hertz = abs(one.mode.frequency_hz - other.mode.frequency_hz) / (NEAR * middle + DEVIATIONS * spread)
        alike = _alike(one, other)
        told.append(FAR if hertz > 1 or (alike is not None and alike < ALIKE) else hertz + 1 - (alike or 1.0))
    return float(np.mean(told)) if max(told) < FAR else FAR


def _alike(one: Seen, other: Seen) -> float | None:
    """Return the assurance on the references, None where they are at a node in either."""
    if not (one.part.shows and other.part.shows):
        return None
    return float(assurance(one.part.shared[:, None], other.part.shared[:, None])[0, 0])


def _weights(group: Sequence[Seen], quantity: str) -> tuple[Array, Array, Array]:
    """Return values, deviations and weights ζ_i/σ_i² of a quantity in a group."""
    std = "frequency_std_hz" if quantity == "frequency_hz" else "damping_std"
    values = np.array([getattr(s.mode, quantity) for s in group])
    spread = np.array([getattr(s.mode, std) for s in group], dtype=float)
    spread = np.maximum(spread, 1e-9 * np.maximum(abs(values), 1e-9))
    damping = np.array([max(s.mode.damping, s.mode.damping_std or 0.0, 1e-9) for s in group])
    return values, spread, damping / spread**2


def _mean(group: Sequence[Seen], quantity: str) -> float:
    values, _, weights = _weights(group, quantity)
    return float(weights @ values / weights.sum())


def _combined(group: Sequence[Seen], quantity: str, tests: int) -> tuple[float, float, bool]:
    """Return mean and deviation of a quantity, and whether the set-ups disagree beyond chance: then it is widened."""
    values, spread, weights = _weights(group, quantity)
    middle = float(weights @ values / weights.sum())
    deviation = float(np.sqrt(weights**2 @ spread**2) / weights.sum())
    free = len(values) - 1
    best = (values / spread**2).sum() / (1 / spread**2).sum()
    unlike = float((((values - best) / spread) ** 2).sum())
    apart = free > 0 and float(chdtrc(free, unlike)) < CHANCE / tests
    return middle, deviation * (np.sqrt(unlike / free) if apart else 1.0), apart


def _merged(
    group: Sequence[Seen], setups: Sequence[Setup], references: Sequence[str], reference: str | None, tests: int
) -> MergedMode:
    group = sorted(group, key=lambda s: s.setup.number)
    hertz, hertz_std, apart = _combined(group, "frequency_hz", tests)
    damping, damping_std, uneven = _combined(group, "damping", tests)
    step = min(s.setup.modal.diagram.sample_time_s for s in group)
    s = 2 * np.pi * hertz * (-damping + 1j * np.sqrt(max(1 - damping**2, 0.0)))
    shape, shares, parts = _shape(group, references, reference)
    mode = Mode(hertz, damping, complex(np.exp(s * step)), hertz_std, damping_std, shares, shape=shape)
    alike = [v for i, a in enumerate(parts) for b in parts[:i] if (v := _alike(a, b)) is not None]
    notes = _notes(mode, group, setups, len(references))
    for quantity, found, factor, unit in (("frequency", apart, 1.0, "Hz"), ("damping", uneven, 100.0, "%")):
        if found:
            notes.append(_disagreement(mode, group, quantity, factor, unit))
    return MergedMode(mode, tuple(group), min(alike, default=None), tuple(notes))


def _shape(
    group: Sequence[Seen], references: Sequence[str], reference: str | None
) -> tuple[Shape | None, dict[str, float], list[Seen]]:
    """Return the joined shape in the sensors' units, the sensors' shares of the motion, and what it was joined from.

    Where the references are at a node in all set-ups the one that shows most of them alone has a shape.
    """
    parts = [s for s in group if s.part.shows] or [max(group, key=lambda s: len(s.part.values))]
    count = len(references)
    names = [*references, *(n for s in parts for n in s.setup.outputs[count:])]
    scale = np.concatenate([parts[0].setup.scale[:count], *(s.setup.scale[count:] for s in parts)])
    chosen = names.index(reference) if reference in names else None
    values, around, at = joined([s.part for s in parts], chosen)
    shares = dict(zip(names, map(float, abs(values) / abs(values).sum()), strict=True))
    unit = scale / scale[at]
    spread = {
        name: (float(c[0, 0] * u**2), float(c[0, 1] * u**2), float(c[1, 1] * u**2))
        for name, c, u in zip(names, around, unit, strict=True)
    }
    known = spread if np.isfinite(around).all() else None
    return Shape(names[at], dict(zip(names, map(complex, values * unit), strict=True)), known), shares, parts


def _notes(mode: Mode, group: Sequence[Seen], setups: Sequence[Setup], references: int) -> list[str]:
    """Say which set-ups do not show the mode, and in which the references are at a node."""
    notes, here = [], f"mode at {mode.frequency_hz:.4g} Hz"
    met = {s.setup.number for s in group}
    for setup in setups:
        if setup.number in met:
            continue
        others = ", ".join(setup.outputs[references:])
        without = f"; its shape is without {others}" if others else ""
        notes.append(f"{here}: not found in set-up {setup.number} ({setup.source}){without}")
    for s in group:
        others = ", ".join(s.setup.outputs[references:])
        if not s.part.shows and others:
            kept = mode.shape is not None and s.setup.outputs[references] in mode.shape.values
            alone = "the shape is that of this set-up alone" if kept else f"the shape is without {others}"
            notes.append(
                f"{here}: the references hardly move in set-up {s.setup.number} ({s.setup.source}), a node of the "
                f"mode; {alone}; choose a reference elsewhere"
            )
    return notes


def _disagreement(mode: Mode, group: Sequence[Seen], quantity: str, factor: float, unit: str) -> str:
    name, std = ("frequency_hz", "frequency_std_hz") if quantity == "frequency" else ("damping", "damping_std")
    told = ", ".join(
        f"{factor * getattr(s.mode, name):.4g} ± {factor * getattr(s.mode, std):.2g} in {s.setup.number}" for s in group
    )
    return (
        f"mode at {mode.frequency_hz:.4g} Hz: set-ups differ in {quantity} by more than their deviations explain "
        f"({told} {unit}); the structure or its load changed between them, and the band is widened"
    )
