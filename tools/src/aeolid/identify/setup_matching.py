"""Match the modes of several set-ups by frequency and by their shapes on the references, and compare them.

Modes of two set-ups are one where frequency and, on the references, the modal assurance criterion agree. Whether
set-ups differ by more than chance explains is told by χ² of their deviations over all modes and both quantities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from aeolid.identify.clusters import Cluster
from aeolid.identify.modal import Modal
from aeolid.identify.setup_shapes import PartShape, part_shape
from aeolid.models.modes import Mode
from aeolid.models.shapes import assurance
from aeolid.wording import plus_minus

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


def set_up(modals: Sequence[Modal], references: Sequence[str]) -> tuple[Setup, ...]:
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


def seen_in(setup: Setup, references: int) -> list[Seen]:
    """Return what a set-up shows of the modes that it lists."""
    pairs = zip(setup.modal.modes, setup.modal.stability, strict=True)
    return [_seen(setup, m, c, references) for m, c in pairs if m in setup.modal.listed]


def matched(setups: Sequence[Setup], references: int) -> list[list[Seen]]:
    """Return the modes as groups of at most one of each set-up; the set-up with most modes begins."""
    from scipy.optimize import linear_sum_assignment  # half a second to load

    groups: list[list[Seen]] = []
    for setup in sorted(setups, key=lambda s: -len(s.modal.listed)):
        mine = seen_in(setup, references)
        taken: set[int] = set()
        if groups and mine:
            far = np.array([[distance(one, group) for group in groups] for one in mine])
            for i, j in zip(*linear_sum_assignment(far), strict=True):
                if far[i, j] < FAR:
                    groups[j].append(mine[i])
                    taken.add(int(i))
        groups += [[one] for i, one in enumerate(mine) if i not in taken]
    return groups


def distance(one: Seen, group: Sequence[Seen]) -> float:
    """Return how far a mode is from a group in units of what is allowed, FAR beyond: the mean over its members."""
    told = []
    for other in group:
        middle = (one.mode.frequency_hz + other.mode.frequency_hz) / 2
        spread = float(np.hypot(one.mode.frequency_std_hz or 0.0, other.mode.frequency_std_hz or 0.0))
        hertz = abs(one.mode.frequency_hz - other.mode.frequency_hz) / (NEAR * middle + DEVIATIONS * spread)
        agree = alike(one, other)
        told.append(FAR if hertz > 1 or (agree is not None and agree < ALIKE) else hertz + 1 - (agree or 1.0))
    return float(np.mean(told)) if max(told) < FAR else FAR


def alike(one: Seen, other: Seen) -> float | None:
    """Return the assurance on the references, None where they are at a node in either."""
    if not (one.part.shows and other.part.shows):
        return None
    return float(assurance(one.part.shared[:, None], other.part.shared[:, None])[0, 0])


def least_assurance(group: Sequence[Seen]) -> float | None:
    """Return the least assurance of two members on the references, None where no two show them."""
    told = [v for i, a in enumerate(group) for b in group[:i] if (v := alike(a, b)) is not None]
    return min(told, default=None)


def weights_of(group: Sequence[Seen], quantity: str) -> tuple[Array, Array, Array]:
    """Return values, deviations and weights ζ_i/σ_i² of a quantity in a group."""
    std = "frequency_std_hz" if quantity == "frequency_hz" else "damping_std"
    values = np.array([getattr(s.mode, quantity) for s in group])
    spread = np.array([getattr(s.mode, std) for s in group], dtype=float)
    spread = np.maximum(spread, 1e-9 * np.maximum(abs(values), 1e-9))
    damping = np.array([max(s.mode.damping, s.mode.damping_std or 0.0, 1e-9) for s in group])
    return values, spread, damping / spread**2


def mean(group: Sequence[Seen], quantity: str) -> float:
    """Return the weighted mean of a quantity, "frequency_hz" or "damping"."""
    values, _, weights = weights_of(group, quantity)
    return float(weights @ values / weights.sum())


def combined(group: Sequence[Seen], quantity: str, tests: int) -> tuple[float, float, float]:
    """Return mean and deviation of a quantity, and by how much it is to be widened: 1 unless beyond chance."""
    values, spread, weights = weights_of(group, quantity)
    middle = float(weights @ values / weights.sum())
    deviation = float(np.sqrt(weights**2 @ spread**2) / weights.sum())
    free = len(values) - 1
    best = (values / spread**2).sum() / (1 / spread**2).sum()
    unlike = float((((values - best) / spread) ** 2).sum())
    apart = free > 0 and float(chdtrc(free, unlike)) < CHANCE / tests
    return middle, deviation, float(np.sqrt(unlike / free)) if apart else 1.0


def disagreements(mode: Mode, group: Sequence[Seen], frequency: float, damping: float) -> list[str]:
    """Return sentences on what set-ups disagree in, where the factor of its deviation is above 1."""
    notes = []
    for quantity, widened, factor, unit in (("frequency", frequency, 1.0, "Hz"), ("damping", damping, 100.0, "%")):
        if widened > 1:
            notes.append(_disagreement(mode, group, quantity, factor, unit))
    return notes


def _disagreement(mode: Mode, group: Sequence[Seen], quantity: str, factor: float, unit: str) -> str:
    name, std = ("frequency_hz", "frequency_std_hz") if quantity == "frequency" else ("damping", "damping_std")
    told = ", ".join(
        f"{plus_minus(factor * getattr(s.mode, name), factor * getattr(s.mode, std))} in {s.setup.number}"
        for s in group
    )
    return (
        f"mode at {mode.frequency_hz:.4g} Hz: set-ups differ in {quantity} by more than their deviations explain "
        f"({told} {unit}); the structure or its load changed between them, and the band is widened"
    )
