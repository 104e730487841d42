"""Hold the poles of a subspace model against those of the maximum likelihood that steps from it lead to.

Both estimates are consistent where the order is right and the window long enough, and one is efficient: their
difference then has the covariance P − I⁻¹ ≤ P, P that of the subspace estimate, I the information (Hausman 1978). A
pole that the steps move by more than its deviation explains is therefore a finding: the window was too short for the
noise, the singular values of a weak mode lie in those of the noise, or there are too few windows for their
coefficients. First-order deviations know of none of these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.outcome import nearest
from aeolid.identify.subspace import ScaledModel
from aeolid.identify.truncation import KNOWN, MATERIAL
from aeolid.models.modes import pole_words

if TYPE_CHECKING:
    from aeolid.identify.refine import Descent, Refinement, Run, Stretch

Array = NDArray[np.float64]
WORK = 4e10  # operations of all steps, some ten seconds: no more are taken
BESIDE = 1e4  # operations a sample of each step beside its derivatives: a few runs of the predictor
APART = 3.0  # deviations: of a pair of numbers by chance one in ninety, and less as P − I⁻¹ is below P
MOST = 80  # steps: from a start far off they are many; no model is taken before they end
STARTS = 0.02  # of the numbers recorded: where first states take more, errors on short stretches look white at any end
MEMORY = "the recordings are too short for the memory of the noise"
NATS = 0.02  # of log-likelihood: a step that gains less moves no number by more than a fifth of its deviation


def farthest(before: ScaledModel, after: ScaledModel, covariance: Array) -> tuple[complex, float]:
    """Return the pole that moves most from one model to the other, and by how many of its deviations.

    covariance (n, 2, 2): of the poles of `before`, in the order of eig(A). Poles that are not known within KNOWN of
    their |log z| are left out; those that move by MATERIAL of it do not count as moved.
    """
    here, there = (np.linalg.eigvals(m.A).astype(complex) for m in (before, after))
    worst, most = 0j, 0.0
    for pole, other, spread in zip(here, there[nearest(here, there)], covariance, strict=True):
        size = abs(np.log(pole)) if pole else np.inf
        if pole.imag < 0 or not np.isfinite(spread).all() or np.sqrt(np.trace(spread)) > KNOWN * size:
            continue
        step = np.array([other.real - pole.real, other.imag - pole.imag])
        apart = float(np.sqrt(step @ np.linalg.solve(spread + (MATERIAL * size) ** 2 * np.eye(2), step)))
        worst, most = (complex(pole), apart) if apart > most else (worst, most)
    return worst, most


@dataclass(frozen=True, eq=False)
class Contrast:
    """Hold a subspace model beside the end of the steps from it.

    done, steps: the steps and their number; apart, frequency_hz: of the pole that moves most, deviations told and Hz;
    is_real: whether it is real; failed: why the end of the steps cannot be taken, empty where it can or need not be;
    taken: whether it takes the place of the subspace model; white: whether its innovations on the longest stretch are
    white and free of the inputs' past (`residuals`); ended: whether no step gained more; limited: why the end confirms
    no window, empty where it may: it lies where the recordings show no longer memory, or first states take many of
    their numbers. Taken is what the steps end at, if it fits the recordings no worse and, where poles differ, has ended
    and is white.
    """

    done: Refinement
    steps: int
    apart: float
    frequency_hz: float
    failed: str
    taken: bool
    white: bool
    ended: bool = True
    limited: str = ""
    is_real: bool = False

    @property
    def doubt(self) -> str:
        """Return why the deviations do not hold, empty where they do."""
        if self.limited == MEMORY and self.apart > APART:
            return (
                f"prediction-error steps move {pole_words(self.frequency_hz, self.is_real)} by "
                f"{min(self.apart, 999):.0f} standard deviations and end where {MEMORY}: "
                "standard deviations do not hold"
            )
        if self.white and (self.taken or self.apart <= APART):
            return ""
        if self.apart <= APART:
            return (
                f"after {self.steps} prediction-error steps innovations still follow their own past or that of the "
                "inputs, so that modes may be missing: standard deviations may not hold"
            )
        return (
            f"prediction-error steps move {pole_words(self.frequency_hz, self.is_real)} by {min(self.apart, 999):.0f} "
            f"standard deviations and {self.failed}: standard deviations do not hold"
        )

    def notes(self) -> list[str]:
        """Return what is to be said of it."""
        if not self.taken:
            return []
        if self.apart <= APART:
            return [
                f"{self.steps} prediction-error steps were taken from the subspace model; they move no mode by more "
                f"than {self.apart:.1f} of its standard deviations, and their model predicts best"
            ]
        return [
            f"{self.steps} prediction-error steps move {pole_words(self.frequency_hz, self.is_real)} by "
            f"{min(self.apart, 999):.1f} of its standard deviations: their model is taken, with the deviations it has"
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the JSON facts."""
        facts = {"apart": self.apart, "frequency_hz": self.frequency_hz, "steps": self.steps, "taken": self.taken,
                 "white": self.white, "ended": self.ended, "limited": self.limited or None}  # fmt: skip
        return {"contrast": facts | {"failed": self.failed or None, "reason": self.doubt or None}}


def contrast(
    stretches: Sequence[Stretch], start: ScaledModel, poles: Array, through: tuple[bool, ...], step_s: float,
    kept: Callable[[Refinement], Refinement], information: float, always: bool,
    stable: bool = False,
) -> Contrast | None:  # fmt: skip
    """Take the prediction-error steps from a subspace model, and their end in its place where it is told apart.

    poles (n, 2, 2): covariance of its poles; step_s: sample time; kept: returns steps as they are or, where they fit
    the recordings worse, with none left; information: part of what complete recordings would tell, 0 … 1; always: take
    the end where poles agree too; stable: keep poles inside the unit circle. None where one step costs more than WORK,
    which bounds the cost.
    """
    from aeolid.identify.refine import Descent, run_model  # brings the compiled loops along, which others do without

    (n, r), outputs, samples = start.B.shape, len(start.C), sum(len(s.y) for s in stretches)
    steps = steps_to_pay((n, r, outputs, sum(through)), samples)
    if steps == 0:
        return None
    descent = Descent(stretches, through, stable)
    path = descent.path(start, steps, 2 * NATS / (samples * outputs))
    found = descent.result(path, None, "no step gains")
    pole, apart = farthest(start, found.model, poles)
    hertz = float(abs(np.log(pole)) / (2 * np.pi * step_s)) if pole else 0.0
    white = _white(run_model(found.model, stretches, np.eye(outputs)), stretches)
    limited = _limit(descent, found.model, n * len(stretches) / (samples * outputs))
    met = Contrast(found, len(path) - 1, apart, hertz, "", False, white, len(path) <= steps, limited, pole.imag == 0)
    if apart <= APART and not always:
        return met
    if len(path) == 1 or found.root is None:
        return replace(met, failed="cannot be taken")
    if apart > APART and not met.ended:
        return replace(met, failed="do not converge")
    if apart > APART and not white:
        return replace(met, failed="leave innovations that are not white")
    done = kept(found)
    if not done.steps or done.root is None:
        return replace(met, failed="fit the recordings worse")
    return replace(met, done=replace(done, root=done.root / np.sqrt(information)), taken=True)


def _limit(descent: Descent, end: ScaledModel, starts: float) -> str:
    """Return why the end of the steps confirms no window; starts: part of the numbers that first states take."""
    if descent.is_bounded(end):
        return MEMORY
    if starts > STARTS:
        return f"the recordings are too short: their first states take {starts:.0%} of the numbers in them"
    return ""


def steps_to_pay(size: tuple[int, int, int, int], samples: int) -> int:
    """Return how many steps are taken at most, MOST or what WORK pays for.

    size: states, inputs, outputs, inputs with feedthrough. A step takes derivatives, their factor, and what runs over
    the samples beside them.
    """
    n, r, outputs, through = size
    free = n * (2 * outputs + r) + outputs * through
    each = n * (n + outputs) * (n + free) + outputs * free**2
    return min(MOST, int(WORK / (samples * (2.0 * each + BESIDE))))


def _white(run: Run, stretches: Sequence[Stretch]) -> bool:
    """Say whether the errors on the longest stretch follow neither their own past nor that of the inputs."""
    from aeolid.identify.residuals import run_residual_tests

    i = int(np.argmax([len(e) for e in run.errors]))
    e, u = run.errors[i], stretches[i].u
    names = [tuple(map(str, range(k, k + count))) for k, count in ((0, e.shape[1]), (e.shape[1], u.shape[1]))]
    return run_residual_tests(e, u, names[0], names[1]).verdict != "fail"
