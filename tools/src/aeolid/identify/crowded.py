"""Ask whether one or two more states find a mode elsewhere: two near modes that are told as one are found so.

A held-out error does not miss the second of two near modes, and the steps of `contrast` keep the number of states. With
k more states the log-likelihood of the same recordings grows by half a χ² of k (2 l + r) numbers by chance; where it
grows by far more and a mode that is told moves by more than its deviation explains, that mode is not one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from aeolid.identify.compressed import Windows
from aeolid.identify.contrast import BESIDE, NATS, Contrast, farthest
from aeolid.identify.error_weight import least_of, log_det
from aeolid.identify.result import Settings
from aeolid.identify.subspace import ScaledModel, StateBasis, largest_useful_order, system_matrices
from aeolid.models.modes import pole_words

if TYPE_CHECKING:
    from aeolid.identify.refine import Stretch

Array = NDArray[np.float64]
MORE = (1, 2)  # states that are added
CHANCE = 1e-5  # of such a gain where nothing is missing: more states also fit what no law of the plant is
APART = 4.0  # deviations: by chance one pole in three thousand
STEPS = 30  # at most, of each richer model
WORK = 4e10  # operations of all its steps, some ten seconds at the very most; where they cost more nothing is asked


@dataclass(frozen=True)
class Crowded:
    """Hold what more states find: how many, nats they gain, and the mode that moves most, Hz and deviations.

    is_real: whether that mode is a real pole.
    """

    states: int
    nats: float
    frequency_hz: float
    apart: float
    is_real: bool = False

    @property
    def reason(self) -> str:
        """Return why the deviations do not hold."""
        return (
            f"with {self.states} more {'state' if self.states == 1 else 'states'}"
            f" {pole_words(self.frequency_hz, self.is_real)} moves by {min(self.apart, 999):.0f} standard deviations"
            f" and the fit gains {self.nats:.0f} nats: two modes may be told as one"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the JSON facts."""
        return {"crowded": {"states": self.states, "nats": self.nats, "frequency_hz": self.frequency_hz,
                            "apart": self.apart, "reason": self.reason}}  # fmt: skip


def is_cheap(model: ScaledModel, samples: int) -> bool:
    """Tell whether the question costs at most WORK operations for a model of as many states and its recordings."""
    (n, r), outputs = model.B.shape, len(model.C)
    free = n * (2 * outputs + r)
    each = samples * (2.0 * (n * (n + outputs) * (n + free) + outputs * free**2) + BESIDE)
    return bool(len(MORE) * STEPS * each <= WORK)


def crowded(
    stretches: Sequence[Stretch], told: ScaledModel, ended: ScaledModel, poles: Array, richer: Sequence[ScaledModel],
    through: tuple[bool, ...], step_s: float, information: float,
) -> Crowded | None:  # fmt: skip
    """Return what the richer models find that the told one hides, None where they find nothing.

    told: the model with the covariance (n, 2, 2) of its poles; ended: where prediction-error steps from it end; richer:
    models of more states, from which steps are taken; information: part of what complete recordings tell, 0 … 1.
    """
    from aeolid.identify.refine import Descent, admitted, run_model

    outputs, samples = len(told.C), sum(len(s.y) for s in stretches)
    descent = Descent(stretches, through, False)

    def nats(model: ScaledModel) -> float:
        covariance = run_model(model, stretches, np.eye(outputs)).covariance()
        return -0.5 * samples * information * outputs * log_det(covariance, least_of(covariance))

    if not admitted(ended):
        return None
    known, found = nats(ended), []
    for model in richer:
        if not admitted(model):
            continue
        end = descent.path(model, STEPS, 2 * NATS / (samples * outputs))[-1]
        gain, states = nats(end) - known, len(model.A) - len(told.A)
        pole, apart = farthest(told, end, poles)
        sure = bool(chdtrc(states * (2 * outputs + model.B.shape[1]), 2 * max(gain, 0.0)) < CHANCE)
        if sure and apart > APART:
            found.append(Crowded(states, gain, float(abs(np.log(pole)) / (2 * np.pi * step_s)), apart, pole.imag == 0))
    return max(found, key=lambda c: c.apart, default=None)


def crowding(
    windows: Windows, settings: Settings, through: tuple[bool, ...], basis: StateBasis,
    models: tuple[ScaledModel, Contrast], poles: Array | None, extra: dict[str, Any],
) -> dict[str, Any]:  # fmt: skip
    """Return the facts of what one or two more states find, where the order was chosen and nothing is in doubt."""
    from aeolid.identify.extended import collect
    from aeolid.identify.refine import cut_stretches

    (told, held), order = models, len(models[0].A)
    asked = settings.order is None and poles is not None and not held.doubt and not settings.stable
    if not asked or order + max(MORE) > largest_useful_order(basis):
        return {}
    stretches = cut_stretches(collect(windows.records, windows.scaling.without_innovations(), settings.past))
    if not is_cheap(told, sum(len(s.y) for s in stretches)):
        return {}
    assert poles is not None
    richer = [system_matrices(windows.whole, basis.state_map(order + k), through) for k in MORE]
    information = float(extra.get("preparation", {}).get("information", 1.0))
    step_s = windows.records[0].sample_time_s
    found = crowded(stretches, told, held.done.model, poles, richer, through, step_s, information)
    return {} if found is None else found.to_json()
