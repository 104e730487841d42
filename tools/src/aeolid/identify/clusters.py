"""Gather the poles of a stabilisation diagram that are one and the same, and say which of them are physical.

Poles of two models belong together where frequency, damping and shape agree: within a stated relative distance or what
their deviations explain, and with a modal assurance criterion above a stated one. A model gives a cluster one pole at
most; poles are handed out so that distances add up to least. A physical pole stays while states are added and the
window grows; one that describes noise moves. So a cluster is physical where it has a pole in most of the models of
enough states, in every window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.diagram import Diagram, Pole
from aeolid.models.modes import Mode, lone_width
from aeolid.models.shapes import assurance

Array = NDArray[np.float64]
FAR = 1e3  # a distance beyond all that are allowed


@dataclass(frozen=True)
class Criteria:
    """Hold what decides, all of it stated in the result.

    A pole is looked at where its damping is below `most_damping` and not below −3 deviations, and its band is narrow:
    the deviations of frequency, relative, and of damping below `width` times √(ζ/(2π f T)), what a mode of frequency f
    and damping ζ has that stands alone above the noise in a recording of T seconds (Au 2014). So must be those of the
    mode itself. A pole belongs to a cluster where the frequency is within `frequency` of it or `deviations` deviations,
    the damping within `deviations` deviations and `damping`, and the modal assurance criterion of the shapes is above
    `assurance`. A cluster is physical where it is in `share` of the models that count (`Diagram.counting`), and in half
    of those of every window.
    """

    frequency: float = 0.01
    damping: float = 0.005
    deviations: float = 3.0
    assurance: float = 0.8
    width: float = 4.0
    most_damping: float = 0.3
    share: float = 0.75

    def to_json(self) -> dict[str, float]:
        """Return the criteria as JSON facts."""
        return dict(self.__dict__)

    def admits(self, pole: Pole, duration_s: float) -> bool:
        """Tell whether a pole is looked at."""
        damped = -3 * pole.damping_std - self.damping <= pole.damping <= self.most_damping
        return damped and self.is_narrow(pole, duration_s)

    def is_narrow(self, pole: Pole | Mode, duration_s: float) -> bool:
        """Tell whether the deviations of a pole or mode are those of something that stands out of the noise."""
        known = (pole.frequency_hz, pole.frequency_std_hz, pole.damping, pole.damping_std)
        return lone_width(*known, duration_s) <= self.width


@dataclass(eq=False)
class Cluster:
    """Hold poles of different models that are one; counted: those of models that count; share: of these, with one.

    by_window: the same share of each window's models.
    """

    poles: list[Pole]
    counted: list[Pole] = field(default_factory=list)
    share: float = 0.0
    by_window: dict[int, float] = field(default_factory=dict)
    physical: bool = False
    _centre: Pole | None = field(default=None, repr=False)

    @property
    def centre(self) -> Pole:
        """Return the pole of median frequency."""
        if self._centre is None:
            ordered = sorted(self.poles, key=lambda p: p.frequency_hz)
            self._centre = ordered[len(ordered) // 2]
        return self._centre

    def add(self, pole: Pole) -> None:
        """Take one more pole."""
        self.poles.append(pole)
        self._centre = None

    def to_json(self) -> dict[str, Any]:
        """Return the facts: how often, and where its poles lie."""
        hertz, damping = ([getattr(p, name) for p in self.poles] for name in ("frequency_hz", "damping"))
        return {
            "share": self.share, "poles": len(self.poles), "frequency_hz": [min(hertz), max(hertz)],
            "damping": [min(damping), max(damping)],
        }  # fmt: skip


def cluster(diagram: Diagram, criteria: Criteria) -> list[Cluster]:
    """Return the clusters of a diagram by frequency, those that are physical marked."""
    clusters: list[Cluster] = []
    looked_at = [p for p in diagram.poles if criteria.admits(p, diagram.duration_s)]
    # the order that predicts first, then away from it: the first model to open a cluster is the most trusted one
    ranked = sorted(looked_at, key=lambda p: _rank(p, diagram))
    for _, model in groupby(ranked, key=lambda p: _rank(p, diagram)):
        _hand_out(list(model), clusters, criteria)
    for found in clusters:
        _judge(found, diagram.counting, diagram.windows, criteria)
    return sorted(clusters, key=lambda c: c.centre.frequency_hz)


def _rank(pole: Pole, diagram: Diagram) -> tuple[int, int, int, int]:
    below = pole.order < diagram.order
    return int(pole.past != diagram.past), int(below), abs(pole.order - diagram.order), pole.past


def _hand_out(poles: Sequence[Pole], clusters: list[Cluster], criteria: Criteria) -> None:
    """Give each pole of one model to a cluster of its own, an existing one where it belongs to it."""
    from scipy.optimize import linear_sum_assignment  # half a second to load

    taken: set[int] = set()
    if clusters:
        far = np.array([[_distance(p, c.centre, criteria) for c in clusters] for p in poles])
        for i, j in zip(*linear_sum_assignment(far), strict=True):
            if far[i, j] < FAR:
                clusters[j].add(poles[i])
                taken.add(int(i))
    clusters += [Cluster([p]) for i, p in enumerate(poles) if i not in taken]


def _distance(pole: Pole, centre: Pole, criteria: Criteria) -> float:
    """Return how far a pole is from a cluster, in units of what is allowed, FAR where that is exceeded."""
    spread = criteria.deviations * np.hypot(pole.frequency_std_hz, centre.frequency_std_hz)
    hertz = abs(pole.frequency_hz - centre.frequency_hz) / max(criteria.frequency * centre.frequency_hz, spread)
    allowed = criteria.deviations * np.hypot(pole.damping_std, centre.damping_std) + criteria.damping
    ratio = abs(pole.damping - centre.damping) / allowed
    if hertz > 1 or ratio > 1:
        return FAR
    alike = float(assurance(pole.shape[:, None], centre.shape[:, None])[0, 0])
    return float(hertz + ratio + 1 - alike) if alike >= criteria.assurance else FAR


def _judge(found: Cluster, models: frozenset[tuple[int, int]], windows: Sequence[int], criteria: Criteria) -> None:
    """Say in how many of the models that count the cluster is, and whether it is physical."""
    found.counted = [p for p in found.poles if (p.past, p.order) in models]
    mine = [(p.past, p.order) for p in found.counted]
    found.share = len(mine) / max(len(models), 1)
    found.by_window = {w: sum(p == w for p, _ in mine) / max(sum(p == w for p, _ in models), 1) for w in windows}
    found.physical = found.share >= criteria.share and min(found.by_window.values()) >= 0.5
