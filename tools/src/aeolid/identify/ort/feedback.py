"""Test whether a disturbance is free of feedback: the assumption everything else in paper 002 rests on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from aeolid.identify.ort.joint import Layout
from aeolid.identify.windows import WindowFactor, triangularise

Array = NDArray[np.float64]
LEVEL = 0.01  # chance of an alarm over all disturbances together where there is no feedback
MATERIAL = 0.01  # part of a disturbance's own news; below it feedback is there but does not matter
MOST_LAGS = 20
PREDICTABLE = 1e-12  # of its power: a disturbance that follows from its own past to here leaves nothing to test


@dataclass(frozen=True)
class FeedbackTest:
    """Hold the test of one disturbance.

    predictable: part of what its own past leaves open that past inputs and outputs explain beyond chance; p_value: the
    chance of so much where there is no feedback, corrected for the number of disturbances.
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

    The likelihood ratio N log(RSS/RSS′) is χ² with lags · (l + m) degrees of freedom where nothing comes back. Lags: p,
    at most 20. names: those of the disturbances.
    """
    lags = min(layout.past, MOST_LAGS)
    r, w = layout.disturbances, layout.joint
    own, others = layout.columns(r, 0, lags), layout.columns(w, 0, lags)
    now = layout.columns(r, lags, lags + 1)
    R = triangularise(factor.R[:, [*own, *others, *now]])
    a, b = len(own), len(own) + len(others)
    alone, with_past = ((R[start:, b:] ** 2).sum(axis=0) for start in (a, b))
    total = (R[:, b:] ** 2).sum(axis=0)
    N, count = factor.windows, len(others)
    tests = []
    for i, name in enumerate(names):
        if alone[i] <= PREDICTABLE * total[i] or b + 1 >= N:
            tests.append(FeedbackTest(name, 0.0, 1.0, lags))
            continue
        # Bartlett: regressors already spent, and half of those tested, come off the samples
        statistic = (N - a - 1 - count / 2) * float(np.log(alone[i] / max(with_past[i], 1e-300)))
        p_value = float(min(chi2.sf(statistic, count) * len(names), 1.0))
        share = 1.0 - (with_past[i] / (N - b - 1)) / (alone[i] / (N - a - 1))
        tests.append(FeedbackTest(name, max(float(share), 0.0), p_value, lags))
    return tuple(tests)
