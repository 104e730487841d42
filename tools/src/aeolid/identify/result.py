"""Hold the result of an identification: the model and everything that says how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.bands import Band
from aeolid.identify.fit import Fit
from aeolid.identify.free_run_reason import free_run_reason
from aeolid.identify.markov import MarkovEstimate
from aeolid.identify.mode_names import mode_lines
from aeolid.identify.order import OrderChoice
from aeolid.identify.outcome import common_facts, fit_lines, model_facts, poles_of
from aeolid.identify.windows import Scaling
from aeolid.models.modes import Mode
from aeolid.models.state_space import StateSpace
from aeolid.wording import counted

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """Hold what was asked for; the result carries it.

    passes and forgetting are those of VARMAX; None for VARX and with a streamed Ξ, where no pass is run. uncertainty
    says how deviations were found; bootstrap_runs and bootstrap_seed are None without a bootstrap. order_criterion
    decides where order is None; refined: whether prediction-error steps follow. delays: inputs with the
    samples by which they act late. missing, detrend and robust say what was done to the recordings first. solution:
    which Ξ is taken where data are singular. unexcited: "refuse" or "take" loops that nothing moves from outside.
    contrast: with prediction-error steps from the model: "none", "apart" (their end is taken where it is told apart) or
    "always" (it is taken). reference: the output that mode shapes are scaled to, None for the one that moves most.
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
    uncertainty: str = "asymptotic"
    bootstrap_runs: int | None = None
    bootstrap_seed: int | None = None
    refined: bool = False
    order_criterion: str = "held-out"
    delays: tuple[tuple[str, int], ...] = ()
    missing: str = "leave-out"
    detrend: str = "none"
    robust: str = "never"
    unexcited: str = "refuse"
    solution: str = "smallest"
    contrast: str = "none"
    reference: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the settings as JSON facts."""
        return self.__dict__ | {
            "feedthrough": list(self.feedthrough), "order": self.order or "auto", "delays": dict(self.delays)
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Identification:
    """Hold an identified model and everything that says how far to trust it.

    singular_values (f l,) of ΓK Z/√N in scaled units; markov_parameters (l, p m + r) in the channels' units, order of
    paper 000 eq. (9) or (14); data lists source, SHA-256 and length of each recording; notes are plain warnings; extra
    holds JSON facts of the method beyond those; band is the frequency response with its deviation, in the channels'
    units, None where it is not known.
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
    band: Band | None = None

    @property
    def order(self) -> int:
        """Return the number of states."""
        return self.model.order

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Return the poles (n,) in the z-plane, largest magnitude first."""
        return poles_of(self.model.A)

    def to_json(self) -> dict[str, Any]:
        """Return the facts of the result for machines."""
        own: dict[str, Any] = {
            "rank": {"found": self.markov.rank, "of": self.markov.regressors, "condition": self.markov.condition},
            "penalty": self.markov.penalty.tolist(),
            "order_criteria": self.order_choice.answers,
        }
        if self.band is not None:
            inputs, outputs = ([s.name for s in group] for group in (self.model.inputs, self.model.outputs))
            own["frequency_response"] = self.band.to_json(inputs, outputs)
        return common_facts(self) | own | self.extra

    def model_json(self) -> dict[str, Any]:
        """Return the content of model.json: the model, and under "identification" how it came about."""
        return model_facts(self)

    def summary(self) -> str:
        """Return the result as a few lines of text."""
        why = free_run_reason(self.model, self.fit, tuple(s.name for s in self.model.inputs))
        used = f"{counted(self.windows, 'window')} used, {self.skipped} left out for missing samples"
        return "\n".join(
            [
                self.order_choice.reason,
                used,
                *mode_lines(self.modes, self.model.sample_time_s),
                *fit_lines(self.fit),
                *why,
                *self.notes,
            ]
        )
