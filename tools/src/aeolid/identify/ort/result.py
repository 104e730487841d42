"""Hold the result of an identification with a measured disturbance: the model and what says how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.fit import Fit
from aeolid.identify.order import OrderChoice
from aeolid.identify.ort.feedback import FeedbackTest
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
        values = np.linalg.eigvals(self.model.A).astype(complex)
        return values[np.argsort(-abs(values), kind="stable")]

    def to_json(self) -> dict[str, Any]:
        """Return the facts of the result for machines."""
        return {
            "method": "ort",
            "version": self.version,
            "settings": self.settings.to_json(),
            "data": list(self.data),
            "sample_time_s": self.model.sample_time_s,
            "windows": self.windows,
            "windows_skipped": self.skipped,
            "singular_values": self.singular_values.tolist(),
            "order": self.order,
            "order_reason": self.order_choice.reason,
            "joint_order": self.joint_choice.order,
            "joint_order_reason": self.joint_choice.reason,
            "deterministic_singular_values": self.deterministic.tolist(),
            "canonical_correlations": self.correlations.tolist(),
            "compatibility": self.compatibility,
            "disturbance_condition": self.condition,
            "feedback": [test.to_json() for test in self.feedback],
            "eigenvalues": [[z.real, z.imag] for z in self.eigenvalues],
            "modes": [m.to_json() for m in self.modes],
            "gain": self.gain_method,
            "fit": self.fit.to_json(),
            "notes": list(self.notes),
        }

    def model_json(self) -> dict[str, Any]:
        """Return the content of model.json: the model, and under "identification" how it came about."""
        return self.model.to_json() | {"identification": self.to_json()}

    def summary(self) -> str:
        """Return the result as a few lines of text."""
        lines = [self.joint_choice.reason, self.order_choice.reason]
        lines.append("  frequency Hz     damping           mostly in")
        for mode in self.modes:
            where = max(mode.shares, key=lambda n: mode.shares[n])
            lines.append(
                f"  {mode.frequency_hz:8.4f} ± {mode.frequency_std_hz or 0:.4f}"
                f"  {mode.damping:7.4f} ± {mode.damping_std or 0:.4f}  {where} ({mode.shares[where]:.0%})"
            )
        for name in self.fit.one_step.vaf:
            lines.append(f"{name}: one step {self.fit.one_step.text(name)}, free run {self.fit.free_run.text(name)}")
        return "\n".join([*lines, *self.notes])
