"""Hold what a filter made of a recording, and write it as markov.npz."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from aeolid.filters.settings import HEALTH, FilterSettings
from aeolid.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FilterResult:
    """Hold what one filter made of one recording.

    theta (l, n) in the channels' units, columns in the order of paper 000 eq. (9) or (14): oldest block [u; y] or
    [u; y; e] first, present inputs of the feedthrough list last; theta_scaled (l, n) as the filter holds it; innovation
    and residual (N, l), a priori and a posteriori, NaN where no update took place; status (N,) the code of status.h for
    each sample; health the sticky flags; counters by name.
    """

    theta: Array
    theta_scaled: Array
    innovation: Array
    residual: Array
    status: NDArray[np.int8]
    health: int
    counters: dict[str, int]
    settings: FilterSettings

    def health_text(self) -> str:
        """Return the raised flags in words."""
        return ", ".join(text for flag, text in HEALTH.items() if self.health & flag) or "no flag raised"

    def to_json(self) -> dict[str, Any]:
        """Return the facts without the long arrays."""
        return {
            "settings": asdict(self.settings),
            "health": self.health,
            "health_text": self.health_text(),
            "counters": self.counters,
            "outputs": int(self.theta.shape[0]),
            "regressors": int(self.theta.shape[1]),
            "innovation_std": np.nanstd(self.innovation, axis=0).tolist(),
        }

    def summary(self) -> str:
        """Return one line for people."""
        rows, columns = self.theta.shape
        return f"{self.counters['updates']} updates, {rows} x {columns} Markov parameters, {self.health_text()}"


def save_markov(target: BinaryIO, result: FilterResult, record: Record) -> None:
    """Write the content of markov.npz: theta, innovation, health, the settings, and the recording they came from."""
    np.savez_compressed(
        target,
        theta=result.theta,
        theta_scaled=result.theta_scaled,
        innovation=result.innovation,
        residual=result.residual,
        status=result.status,
        health=np.uint32(result.health),
        counters=json.dumps(result.counters),
        settings=json.dumps(asdict(result.settings)),
        inputs=np.array(record.names("input")),
        outputs=np.array(record.names("output")),
        input_units=np.array([record.unit(name) for name in record.names("input")]),
        output_units=np.array([record.unit(name) for name in record.names("output")]),
        source=record.source,
        sha256=record.sha256,
    )
