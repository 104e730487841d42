"""Hold the result of a scheduled identification: the model and everything that says how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.fit import Fit
from aeolid.identify.lpv.states import Estimate
from aeolid.identify.order import OrderChoice
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.modes import Mode, modes_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LpvSettings:
    """Hold what was asked for; the result carries it."""

    method: str
    past: int
    future: int
    order: int | None
    scheduling: tuple[str, ...]
    varying: tuple[str, ...]
    feedthrough: tuple[str, ...]
    regularization: str | float
    offsets: bool
    decimation: int
    kernel_rows: int | None
    kernel_selection: str
    memory_gb: float

    def to_json(self) -> dict[str, Any]:
        """Return the settings as JSON facts."""
        lists = {key: list(self.__dict__[key]) for key in ("scheduling", "varying", "feedthrough")}
        return self.__dict__ | lists | {"order": self.order or "auto"}


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """Hold the model frozen at one operating point: `where` says which, scheduling maps channels to values."""

    where: str
    scheduling: dict[str, float]
    eigenvalues: NDArray[np.complex128]
    modes: tuple[Mode, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the operating point as JSON facts."""
        return {
            "where": self.where,
            "scheduling": self.scheduling,
            "eigenvalues": [[z.real, z.imag] for z in self.eigenvalues],
            "modes": [m.to_json() for m in self.modes],
        }


@dataclass(frozen=True, eq=False)
class LpvIdentification:
    """Hold an identified scheduled model and everything that says how far to trust it.

    estimate: states, singular values of Γ𝒦Z/√N in scaled units, rank and penalty of the regression. points: the model
    frozen at the mean of the scheduling, first, and at the extremes of each channel; modes have no standard deviation.
    """

    model: LpvStateSpace
    points: tuple[OperatingPoint, ...]
    estimate: Estimate
    order_choice: OrderChoice
    fit: Fit
    settings: LpvSettings
    data: tuple[dict[str, Any], ...]
    windows: int
    skipped: int
    gain_method: str
    notes: tuple[str, ...]
    version: str

    @property
    def order(self) -> int:
        """Return the number of states."""
        return self.model.order

    @property
    def singular_values(self) -> Array:
        """Return the singular values (f l,) the order was judged by."""
        return self.estimate.states.singular_values

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Return the poles (n,) at the mean operating point, largest magnitude first."""
        return self.points[0].eigenvalues

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Return the modes at the mean operating point."""
        return self.points[0].modes

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
            "rank": {"found": self.estimate.rank, "of": self.estimate.regressors},
            "penalty": self.estimate.penalty.tolist(),
            "effective_parameters": self.estimate.freedom.tolist(),
            "singular_values": self.singular_values.tolist(),
            "order": self.order,
            "order_reason": self.order_choice.reason,
            "eigenvalues": [[z.real, z.imag] for z in self.eigenvalues],
            "modes": [m.to_json() for m in self.modes],
            "operating_points": [p.to_json() for p in self.points],
            "gain": self.gain_method,
            "fit": self.fit.to_json(),
            "notes": list(self.notes),
            **self.estimate.facts,
        }

    def model_json(self) -> dict[str, Any]:
        """Return the content of model.json: the model, and under "identification" how it came about."""
        return self.model.to_json() | {"identification": self.to_json()}

    def summary(self) -> str:
        """Return the result as a few lines of text."""
        lines = [self.order_choice.reason]
        if "kernel" in self.estimate.facts:
            kernel = self.estimate.facts["kernel"]
            lines.append(f"kernel: {kernel['rows']} of {kernel['of']} rows, rank {kernel['rank']}")
        for point in self.points:
            values = ", ".join(f"{name} = {value:.4g}" for name, value in point.scheduling.items())
            lines += [f"at the {point.where} ({values})", "  frequency Hz   damping  mostly in"]
            for mode in point.modes:
                where = max(mode.shares, key=lambda n: mode.shares[n])
                share = mode.shares[where]
                lines.append(f"  {mode.frequency_hz:12.4f}  {mode.damping:8.4f}  {where} ({share:.0%})")
        for name in self.fit.one_step.vaf:
            lines.append(f"{name}: one step {self.fit.one_step.text(name)}, free run {self.fit.free_run.text(name)}")
        return "\n".join([*lines, *self.notes])


def operating_points(
    model: LpvStateSpace, spread: tuple[Array, Array, Array], output_scale: Array
) -> tuple[OperatingPoint, ...]:
    """Freeze the model at the mean of the scheduling and at the extremes of each channel, the others at their mean.

    spread: mean, low, high (m − 1,), in the channels' units; output_scale (l,) makes outputs comparable in the modes'
    shares.
    """
    mean, low, high = spread
    names = [s.name for s in model.scheduling]
    places = [("mean of the scheduling", mean)]
    for i, name in enumerate(names):
        for word, extreme in (("least", low), ("largest", high)):
            at = mean.copy()
            at[i] = extreme[i]
            places.append((f"{word} {name}", at))
    points = []
    for where, at in places:
        frozen = model.frozen(at)
        values = np.linalg.eigvals(frozen.A).astype(complex)
        values = values[np.argsort(-abs(values), kind="stable")]
        modes = modes_of(frozen, output_scale=output_scale)
        scheduling = {n: float(v) for n, v in zip(names, at, strict=True)}
        points.append(OperatingPoint(where, scheduling, values, modes))
    return tuple(points)
