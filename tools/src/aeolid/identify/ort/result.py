"""Hold the result of an identification with a measured disturbance: the model and what says how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.fit import Fit
from aeolid.identify.mode_names import mode_lines
from aeolid.identify.order import OrderChoice
from aeolid.identify.ort.feedback import FeedbackTest
from aeolid.identify.outcome import common_facts, fit_lines, model_facts, poles_of
from aeolid.models.modes import Mode
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OrtSettings:
    """Hold what was asked for; the result carries it."""

    past: int
    future: int
    order: int | None
    joint_order: int | None
    disturbances: tuple[str, ...]
    feedthrough: tuple[str, ...]
    response: str
    decimation: int
    stable: bool
    deterministic_order: int | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the settings as JSON facts."""
        lists = {key: list(self.__dict__[key]) for key in ("disturbances", "feedthrough")}
        orders = {key: self.__dict__[key] or "auto" for key in ("order", "joint_order")}
        return {"method": "ort"} | self.__dict__ | lists | orders


@dataclass(frozen=True, eq=False)
class OrtIdentification:
    """Hold an identified plant, its inputs those under feedback and the disturbances.

    singular_values (n_s,): by which states of the joint process were kept for the plant, scaled units; deterministic
    and correlations: singular values of L42/√N and canonical correlations, from which the joint order was judged;
    compatibility: |Γ_d − Γ_s T|/|Γ_d|, 0 where both subsystems show the same poles; condition of the disturbance's
    windows; feedback: a test for each disturbance.
    """

    model: StateSpace
    modes: tuple[Mode, ...]
    singular_values: Array
    deterministic: Array
    correlations: Array
    compatibility: float
    condition: float
    feedback: tuple[FeedbackTest, ...]
    order_choice: OrderChoice
    joint_choice: OrderChoice
    fit: Fit
    settings: OrtSettings
    data: tuple[dict[str, Any], ...]
    windows: int
    skipped: int
    gain_method: str
    notes: tuple[str, ...]
    version: str

    @property
    def order(self) -> int:
        """Return the number of states of the plant."""
        return self.model.order

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Return the poles (n,) in the z-plane, largest magnitude first."""
        return poles_of(self.model.A)

    def to_json(self) -> dict[str, Any]:
        """Return the facts of the result for machines."""
        return common_facts(self) | {
            "joint_order": self.joint_choice.order,
            "joint_order_reason": self.joint_choice.reason,
            "deterministic_singular_values": self.deterministic.tolist(),
            "canonical_correlations": self.correlations.tolist(),
            "compatibility": self.compatibility,
            "disturbance_condition": self.condition,
            "feedback": [test.to_json() for test in self.feedback],
        }

    def model_json(self) -> dict[str, Any]:
        """Return the content of model.json: the model, and under "identification" how it came about."""
        return model_facts(self)

    def summary(self) -> str:
        """Return the result as a few lines of text."""
        reasons = [self.joint_choice.reason, self.order_choice.reason]
        return "\n".join(
            [*reasons, *mode_lines(self.modes, self.model.sample_time_s), *fit_lines(self.fit), *self.notes]
        )
