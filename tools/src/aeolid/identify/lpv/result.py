"""Hold the result of a scheduled identification: the model and everything that says how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import pinv
from aeolid.identify.fit import Fit
from aeolid.identify.lpv.refine import Refinement
from aeolid.identify.lpv.states import Estimate
from aeolid.identify.lpv.turning import Turning
from aeolid.identify.mode_names import mode_lines
from aeolid.identify.order import OrderChoice
from aeolid.identify.outcome import common_facts, fit_lines, model_facts, pole_facts, poles_of
from aeolid.identify.truncation import KNOWN
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.modes import Mode, modes_of, pole_words
from aeolid.wording import counted

Array = NDArray[np.float64]
APART = 1.0  # deviations by which a further step moves a pole: more, and deviations are those of that step


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
    refined: bool
    scheduling_scaling: str = "range"
    kernel_tolerance: float | None = None

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
            "eigenvalues": pole_facts(self.eigenvalues),
            "modes": [m.to_json() for m in self.modes],
        }


@dataclass(frozen=True, eq=False)
class LpvIdentification:
    """Hold an identified scheduled model and everything that says how far to trust it.

    estimate: states, singular values of Γ𝒦Z/√N in scaled units, rank and penalty of the regression. points: the model
    frozen at the mean of the scheduling, first, and at the extremes of each channel; their modes have standard
    deviations where the model was refined. refinement: what prediction-error steps did, None where not asked for.
    doubt: why the deviations do not hold, empty where they do, None where there are none. turning: speeds of the angles
    that schedule, with the covariance of A for an analysis of the periodic model.
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
    refinement: Refinement | None
    doubt: str | None
    turning: Turning
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
        return (
            common_facts(self)
            | {
                "rank": {"found": self.estimate.rank, "of": self.estimate.regressors},
                "penalty": self.estimate.penalty.tolist(),
                "effective_parameters": self.estimate.freedom.tolist(),
                "operating_points": [p.to_json() for p in self.points],
                "refinement": None if self.refinement is None else self.refinement.to_json(),
            }
            | ({} if self.doubt is None else {"bands_hold": not self.doubt, "bands_reason": self.doubt or None})
            | self.estimate.facts
            | self.turning.to_json()
        )

    def model_json(self) -> dict[str, Any]:
        """Return the content of model.json: the model, and under "identification" how it came about."""
        facts = model_facts(self)
        facts["identification"] |= self.turning.covariance_json()
        return facts

    def summary(self) -> str:
        """Return the result as a few lines of text."""
        lines = [self.order_choice.reason]
        if "kernel" in self.estimate.facts:
            kernel = self.estimate.facts["kernel"]
            lines.append(f"kernel: {kernel['rows']} of {kernel['of']} rows, rank {kernel['rank']}")
        if self.refinement is not None:
            done = self.refinement
            lines.append(f"refined in {done.steps} steps: prediction error power {done.gain:.1%} lower")
        for point in self.points:
            values = ", ".join(f"{name} = {value:.4g}" for name, value in point.scheduling.items())
            lines += [f"at the {point.where} ({values})", *mode_lines(point.modes, self.model.sample_time_s)]
        return "\n".join([*lines, *fit_lines(self.fit), *self.notes])


def operating_points(
    model: LpvStateSpace,
    spread: tuple[Array, Array, Array],
    output_scale: Array,
    covariance: Array | None,
    mu_scale: Array,
    mu_offset: Array,
) -> tuple[OperatingPoint, ...]:
    """Freeze the model at the mean of the scheduling and at the extremes of each channel, the others at their mean.

    spread: mean, low, high (m − 1,), in the channels' units; output_scale (l,) makes outputs comparable in the modes'
    shares; covariance of the entries of [A⁽¹⁾ A⁽²⁾ …] for the scheduling about mu_offset over mu_scale, or None.
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
        mu = np.concatenate([[1.0], (at - mu_offset) / mu_scale])
        uncertain = None if covariance is None else pole_covariance(frozen.A, mu, covariance)
        modes = modes_of(frozen, output_scale=output_scale, pole_covariance=uncertain)
        scheduling = {n: float(v) for n, v in zip(names, at, strict=True)}
        points.append(OperatingPoint(where, scheduling, poles_of(frozen.A), modes))
    return tuple(points)


def pole_covariance(A: Array, mu: Array, covariance: Array) -> Array:
    """Return the covariance (n, 2, 2) of real and imaginary part of each eigenvalue of Σ μ_i A⁽ⁱ⁾, by linearisation.

    dλ = wᴴ dA v/(wᴴ v) with the left and right eigenvectors; in the order of numpy.linalg.eig.
    """
    _, right = np.linalg.eig(A)
    left = np.linalg.inv(right)  # rows wᴴ with wᴴ v = 1
    n, out = len(A), []
    blocks = covariance.shape[0] // n**2
    for i in range(n):
        # entry (a, j n + b) of [A⁽¹⁾ A⁽²⁾ …] acts by μ_j w_a* v_b
        g = np.einsum("a,j,b->ajb", left[i], mu[:blocks], right[:, i]).ravel()
        parts = np.stack([g.real, g.imag])
        out.append(parts @ covariance @ parts.T)
    return np.array(out)


def doubt_of(
    model: LpvStateSpace, points: tuple[OperatingPoint, ...], done: Refinement | None, white: bool,
    mu_scale: Array, mu_offset: Array,
) -> str | None:  # fmt: skip
    """Return why the deviations of the modes do not hold, empty where they do, None where there are none.

    white: whether the innovations follow neither their own past nor that of the inputs; scheduling as in
    `operating_points`.
    """
    if done is None or done.covariance is None or done.further is None:
        return None
    worst, most = 0j, 0.0
    for point in points:
        at = np.array(list(point.scheduling.values()))
        mu = np.concatenate([[1.0], (at - mu_offset) / mu_scale])
        pole, apart = farthest_step(model.frozen(at).A, mu, done.covariance, done.further)
        worst, most = (pole, apart) if apart > most else (worst, most)
    steps = counted(done.steps, "prediction-error step")
    if most > APART:
        hertz = float(abs(np.log(worst)) / (2 * np.pi * model.sample_time_s))
        return (
            f"a further step after {steps} would move {pole_words(hertz, worst.imag == 0)} by {min(most, 999):.1f} "
            "standard deviations: deviations include that step and may not hold; lengthen --past, or record longer"
        )
    if not white:
        return (
            f"after {steps} innovations still follow their own past or that of the inputs, so that modes may be "
            "missing: standard deviations may not hold; lengthen --past, or name a higher order"
        )
    return ""


def farthest_step(A: Array, mu: Array, covariance: Array, further: Array) -> tuple[complex, float]:
    """Return the pole of Σ μ_i A⁽ⁱ⁾ that a step of the entries moves most, and by how many deviations.

    covariance: with the square of the step in it. Poles that are not known within KNOWN of |log z| without it are left
    out.
    """
    worst, most = 0j, 0.0
    whole, moves = (pole_covariance(A, mu, c) for c in (covariance, np.outer(further, further)))
    for pole, all_of_it, move in zip(np.linalg.eigvals(A).astype(complex), whole, moves, strict=True):
        size = abs(np.log(pole)) if pole else np.inf
        if not np.isfinite(all_of_it).all() or np.trace(all_of_it - move) > (KNOWN * size) ** 2:
            continue
        share = min(float(np.trace(pinv(all_of_it, 1e-12, hermitian=True) @ move)), 1 - 1e-12)
        apart = float(np.sqrt(max(share, 0.0) / (1 - share)))
        worst, most = (complex(pole), apart) if apart > most else (worst, most)
    return worst, most
