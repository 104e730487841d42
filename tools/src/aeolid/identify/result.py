"""Hold the result of an identification: the model and everything that says how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.fit import Fit
from aeolid.identify.markov import MarkovEstimate
from aeolid.identify.order import OrderChoice
from aeolid.identify.windows import Scaling
from aeolid.models.modes import Mode
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """Hold what was asked for; the result carries it.

    passes and forgetting are those of VARMAX; None for VARX and with a streamed Ξ, where no pass is run.
    """

    method: str
    past: int
    future: int
    order: int | None
    feedthrough: tuple[str, ...]
    regularization: str | float
    decimation: int
    stable: bool
    markov: str | None
    passes: int | None = None
    forgetting: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the settings as JSON facts."""
        return self.__dict__ | {"feedthrough": list(self.feedthrough), "order": self.order or "auto"}


@dataclass(frozen=True, eq=False)
class Identification:
    """Hold an identified model and everything that says how far to trust it.

    singular_values (f l,) of ΓK Z/√N in scaled units; markov_parameters (l, p m + r) in the channels' units, order of
    paper 000 eq. (9) or (14); data lists source, SHA-256 and length of each recording; notes are plain warnings; extra
    holds JSON facts of the method beyond those.
    """

    model: StateSpace
    modes: tuple[Mode, ...]
    singular_values: Array
    order_choice: OrderChoice
    fit: Fit
    markov: MarkovEstimate
    markov_parameters: Array
    scaling: Scaling
    settings: Settings
    data: tuple[dict[str, Any], ...]
    windows: int
    skipped: int
    gain_method: str
    notes: tuple[str, ...]
    version: str
    extra: dict[str, Any] = field(default_factory=dict)

    @property
    def order(self) -> int:
        """Return the number of states."""
        return self.model.order

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Return the poles (n,) in the z-plane, largest magnitude first."""
        values = np.linalg.eigvals(self.model.A).astype(complex)
        return values[np.argsort(-abs(values), kind="stable")]

    def to_json(self) -> dict[str, Any]:
        """Return the facts of the result for machines."""
        return {
            "method": self.settings.method,
            "version": self.version,
            "settings": self.settings.to_json(),
            "data": list(self.data),
            "sample_time_s": self.model.sample_time_s,
            "windows": self.windows,
            "windows_skipped": self.skipped,
            "rank": {"found": self.markov.rank, "of": self.markov.regressors, "condition": self.markov.condition},
            "penalty": self.markov.penalty.tolist(),
            "singular_values": self.singular_values.tolist(),
            "order": self.order,
            "order_reason": self.order_choice.reason,
            "eigenvalues": [[z.real, z.imag] for z in self.eigenvalues],
            "modes": [m.to_json() for m in self.modes],
            "gain": self.gain_method,
            "fit": self.fit.to_json(),
            "notes": list(self.notes),
            **self.extra,
        }

    def model_json(self) -> dict[str, Any]:
        """Return the content of model.json: the model, and under "identification" how it came about."""
        return self.model.to_json() | {"identification": self.to_json()}

    def summary(self) -> str:
        """Return the result as a few lines of text."""
        lines = [f"{self.order_choice.reason}", "  frequency Hz     damping           mostly in"]
        for mode in self.modes:
            where = max(mode.shares, key=lambda n: mode.shares[n])
            harmonic = f", {mode.rotor_order} x rotor speed" if mode.rotor_order else ""
            lines.append(
                f"  {mode.frequency_hz:8.4f} ± {mode.frequency_std_hz or 0:.4f}"
                f"  {mode.damping:7.4f} ± {mode.damping_std or 0:.4f}  {where} ({mode.shares[where]:.0%}){harmonic}"
            )
        for name in self.fit.one_step.vaf:
            lines.append(f"{name}: one step {self.fit.one_step.text(name)}, free run {self.fit.free_run.text(name)}")
        return "\n".join([*lines, *self.notes])
