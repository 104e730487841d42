"""Test whether a disturbance is free of feedback: the assumption everything else in paper 002 rests on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from aeolid.identify.ort.joint import Layout
from aeolid.identify.windows import WindowFactor, triangularise

Array = NDArray[np.float64]
LEVEL = 0.01  # chance of an alarm over all disturbances together where there is no feedback
MATERIAL = 0.01  # part of a disturbance's own news; below it feedback is there but does not matter
LAGS = (1, 2, 5, 10, 20)
MOST_LAGS = LAGS[-1]
PREDICTABLE = 1e-12  # of its power: a disturbance that follows from its own past to here leaves nothing to test


@dataclass(frozen=True)
class FeedbackTest:
    """Hold the test of one disturbance.

    predictable: part of what its own past leaves open that past inputs and outputs explain beyond chance; p_value: the
    chance of so much where there is no feedback, corrected for the number of disturbances and of lags tried; lags: past
    samples that tell most.
    """

    name: str
    predictable: float
    p_value: float
    lags: int

    @property
    def alarms(self) -> bool:
        """Return whether feedback is both certain and large enough to matter."""
        return self.p_value < LEVEL and self.predictable > MATERIAL

    @property
    def text(self) -> str:
        """Return the finding as one sentence."""
        return (
            f"disturbance {self.name!r} is not free of feedback: past inputs and outputs explain "
            f"{self.predictable:.1%} of what its own past leaves open (by chance: p = {self.p_value:.1g}); "
            "the model is biased, give it the role input and use method varx"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the test as JSON facts."""
        return {**self.__dict__, "feedback": self.alarms}


def check_feedback(factor: WindowFactor, layout: Layout, names: tuple[str, ...]) -> tuple[FeedbackTest, ...]:
    """Regress each disturbance on the past of all disturbances, with and without the past of inputs and outputs.

    The likelihood ratio is a function of F = (RSS/RSS′ − 1) (N − own − c − 1)/c, c = lags · (l + m), whose law is known
    at any N where nothing returns and the news are Gaussian. Own past: p samples, at most 20. Inputs and outputs: the
    last 1, 2, 5, 10 and 20 of them one after the other, since feedback mostly shows in the youngest samples and old
    ones only add chance (a loop with 5 % of y in r, 1000 samples: found in 100 of 100 with 5 lags, in 42 with 20); the
    smallest p-value counts, times the number tried. names: those of the disturbances.
    """
    most = min(layout.past, MOST_LAGS)
    r, w = layout.disturbances, layout.joint
    own, now = layout.columns(r, 0, most), layout.columns(r, most, most + 1)
    others = [c for sample in range(most - 1, -1, -1) for c in layout.columns(w, sample, sample + 1)]  # youngest first
    R = triangularise(factor.R[:, [*own, *others, *now]])
    a, end = len(own), len(own) + len(others)
    rest = np.array([(R[start:, end:] ** 2).sum(axis=0) for start in range(end + 1)])  # (columns taken, q): power left
    tried = sorted({min(lags, most) for lags in LAGS})
    tests = []
    for i, name in enumerate(names):
        if rest[a, i] <= PREDICTABLE * rest[0, i] or end + 1 >= factor.windows:
            tests.append(FeedbackTest(name, 0.0, 1.0, most))
            continue
        found = [_compare(rest[a, i], rest[a + n * len(w), i], a, n * len(w), factor.windows) for n in tried]
        best = int(np.argmin([p for p, _ in found]))
        p_value, share = found[best]
        tests.append(FeedbackTest(name, share, min(p_value * len(tried) * len(names), 1.0), tried[best]))
    return tuple(tests)


def _compare(alone: float, with_past: float, own: int, count: int, N: int) -> tuple[float, float]:
    """Return the p-value of `count` more regressors beside `own`, and the part they explain beyond chance."""
    free = N - own - count - 1
    statistic = (alone / max(with_past, 1e-300) - 1.0) * free / count
    share = 1.0 - (with_past / free) / (alone / (N - own - 1))
    return float(fdtrc(count, free, statistic)), max(float(share), 0.0)
