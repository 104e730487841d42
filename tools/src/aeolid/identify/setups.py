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

from aeolid.geometry import Geometry, united
from aeolid.identify.modal import Modal
from aeolid.identify.mode_names import mode_lines, named
from aeolid.identify.setup_matching import (
    NEAR,
    Seen,
    Setup,
    combined,
    disagreements,
    least_assurance,
    matched,
    mean,
    set_up,
)
from aeolid.identify.setup_references import compared_references
from aeolid.identify.setup_shapes import joined
from aeolid.models.modes import Mode
from aeolid.models.shapes import Shape
from aeolid.models.wire_frame import complexity_lines, geometry_facts
from aeolid.wording import counted

Array = NDArray[np.float64]


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
    """Hold the modes of several set-ups, merged by their references.

    geometry: of the sensors of all, where known; order: of the realisation, by "preger".
    """

    modes: tuple[MergedMode, ...]
    setups: tuple[Setup, ...]
    references: tuple[str, ...]
    outputs: tuple[str, ...]
    notes: tuple[str, ...]
    by: str = "poser"
    order: int | None = None
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
            "merged_by": self.by, "order": self.order, "modes": [m.to_json() for m in self.modes],
            "notes": list(self.notes),
            "setups": [s.modal.to_json() | {"level": s.level} for s in self.setups],
        } | geometry_facts(self.geometry, self.listed)  # fmt: skip

    def summary(self) -> str:
        """Return the result as a few lines of text."""
        lines = [
            f"{len(self.setups)} set-ups, {counted(len(self.outputs), 'sensor')}, references "
            f"{', '.join(self.references)}"
        ]
        for s in self.setups:
            others = ", ".join(s.outputs[len(self.references) :]) or "none besides"
            lines.append(
                f"  set-up {s.number} ({s.source}): {others}; {counted(len(s.modal.listed), 'mode')}, "
                f"{len(s.modal.modes) - len(s.modal.listed)} harmonics and steady sines, level {s.level:.2g}"
            )
        if self.order is not None:
            lines.append(f"  one realisation of {counted(self.order, 'state')} (PreGER)")
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

    reference: the sensor that shapes are scaled to, default the one that moves most in each mode. Raises DataError
    where a reference has another sign or gain in one set-up than in others.
    """
    setups = set_up(modals, references)
    notes = compared_references(setups, references)
    groups = matched(setups, len(references))
    groups.sort(key=lambda group: mean(group, "frequency_hz"))
    modes = [_merged(group, setups, references, reference, 2 * len(groups)) for group in groups]
    found = gathered(modes, setups, references)
    return replace(found, notes=(*found.notes, *notes))


def gathered(
    modes: Sequence[MergedMode], setups: Sequence[Setup], references: Sequence[str], *, by: str = "poser",
    order: int | None = None,
) -> MergedModal:  # fmt: skip
    """Return merged modes by frequency as the result, with names and what is to be said of the set-ups."""
    names = named([m.mode for m in modes], None)
    modes = [replace(m, mode=mode) for m, mode in zip(modes, names, strict=True)]
    outputs = [*references, *(name for s in setups for name in s.outputs[len(references) :])]
    notes = [note for s in setups for note in s.modal.notes]
    notes += [f"set-up {s.number} ({s.source}) shows no mode" for s in setups if not s.modal.listed]
    if len(references) == 1 and _crowded(modes):
        notes.append("with one reference near modes are told apart by frequency alone; two or more are better")
    geometry = united(s.modal.geometry for s in setups)
    return MergedModal(
        tuple(modes), tuple(setups), tuple(references), tuple(outputs), tuple(notes), by, order, geometry
    )


def _crowded(modes: Sequence[MergedMode]) -> bool:
    hertz = np.array([m.mode.frequency_hz for m in modes])
    return bool((np.diff(hertz) < 2 * NEAR * hertz[1:]).any())


def _merged(
    group: Sequence[Seen], setups: Sequence[Setup], references: Sequence[str], reference: str | None, tests: int
) -> MergedMode:
    group = sorted(group, key=lambda s: s.setup.number)
    hertz, hertz_std, apart = combined(group, "frequency_hz", tests)
    damping, damping_std, uneven = combined(group, "damping", tests)
    stds = (hertz_std * apart, damping_std * uneven)
    step = min(s.setup.modal.diagram.sample_time_s for s in group)
    s = 2 * np.pi * hertz * (-damping + 1j * np.sqrt(max(1 - damping**2, 0.0)))
    shape, shares, parts = _shape(group, references, reference)
    mode = Mode(hertz, damping, complex(np.exp(s * step)), *stds, shares, shape=shape)
    notes = _notes(mode, group, setups, len(references)) + disagreements(mode, group, apart, uneven)
    return MergedMode(mode, tuple(group), least_assurance(parts), tuple(notes))


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
    return in_units(names, scale, values, around, at), shares, parts


def in_units(names: Sequence[str], scale: Array, values: NDArray[np.complex128], around: Array, at: int) -> Shape:
    """Return a shape in the sensors' units: values (L,), covariances (L, 2, 2) in their scales, 1 at an index."""
    unit = scale / scale[at]
    spread = {
        name: (float(c[0, 0] * u**2), float(c[0, 1] * u**2), float(c[1, 1] * u**2))
        for name, c, u in zip(names, around, unit, strict=True)
    }
    known = spread if np.isfinite(around).all() else None
    return Shape(names[at], dict(zip(names, map(complex, values * unit), strict=True)), known)


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
