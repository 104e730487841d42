"""Say how uncertain an identified model is: covariance of its poles, and the band of its frequency response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.identify.bands import Band, curvature_covariance, frequency_response, grid, on_circle, response_covariance
from aeolid.identify.bootstrap import collect_scores, run_bootstrap
from aeolid.identify.markov import MarkovEstimate, regressor_columns
from aeolid.identify.outcome import nearest
from aeolid.identify.result import Settings
from aeolid.identify.shape_spread import shape_covariance
from aeolid.identify.subspace import ScaledModel, StateBasis
from aeolid.identify.uncertainty import MatrixSpread, covariance_of, matrix_spread, pole_covariance
from aeolid.identify.windows import Scaling, WindowFactor
from aeolid.models.shapes import index_of_reference
from aeolid.record import Record

if TYPE_CHECKING:
    from aeolid.identify.refine import Refinement

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
METHODS = ("asymptotic", "bootstrap", "none")
BOOTSTRAP_RUNS = 200
FEWEST_RUNS, MOST_RUNS = 20, 10_000


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Hold what is known of a model's uncertainty.

    poles (n, 2, 2): covariance of real and imaginary part of each, in the order of eig(A); band: of the model in scaled
    units; shapes (n, l, 2, 2): covariance of each entry of the mode shapes, outputs in their scales; all None where
    nothing is known. facts: JSON facts beyond the settings.
    """

    poles: Array | None = None
    band: Band | None = None
    shapes: Array | None = None
    facts: dict[str, Any] = field(default_factory=dict)


def with_uncertainty(
    settings: Settings, method: str, bootstrap_runs: int = BOOTSTRAP_RUNS, bootstrap_seed: int = 0
) -> Settings:
    """Return the settings with the way to find uncertainty; raises UsageError on what cannot be."""
    if method not in METHODS:
        raise UsageError(f"uncertainty {method!r} is none of {', '.join(METHODS)}")
    if method != "bootstrap":
        return replace(settings, uncertainty=method)
    if settings.markov is not None:
        raise UsageError("a bootstrap needs the recording's own regression; leave it or the streamed Ξ out")
    if not FEWEST_RUNS <= bootstrap_runs <= MOST_RUNS:
        raise UsageError(f"{bootstrap_runs} bootstrap runs are not within {FEWEST_RUNS} … {MOST_RUNS}")
    if bootstrap_seed < 0:
        raise UsageError(f"bootstrap seed {bootstrap_seed} is negative")
    return replace(settings, uncertainty=method, bootstrap_runs=bootstrap_runs, bootstrap_seed=bootstrap_seed)


def quantify(
    records: Sequence[Record], scaling: Scaling, factor: WindowFactor, basis: StateBasis, fitted: ScaledModel,
    model: ScaledModel, markov: MarkovEstimate, through: tuple[bool, ...], settings: Settings,
    refined: Refinement | None = None,
) -> Uncertainty:  # fmt: skip
    """Find the uncertainty as the settings ask.

    fitted: as the regressions gave it; model: the same, or with poles moved inside, whose response the band is around.
    refined: how the model was refined, whose information then says all. A bootstrap takes one more pass through the
    records. Raises NotIdentifiable where it led to no model too often.
    """
    if settings.uncertainty == "none":
        return Uncertainty()
    h, reference = records[0].sample_time_s, index_of_reference(scaling.outputs, settings.reference)
    frequency = grid(h, np.linalg.eigvals(model.A).astype(complex))
    z = on_circle(frequency, h)
    facts: dict[str, Any] = {}
    if settings.uncertainty == "bootstrap":
        keep = markov.columns or regressor_columns(factor, through)
        scores = collect_scores(records, scaling, factor, markov.theta, keep)
        runs, seed = settings.bootstrap_runs or BOOTSTRAP_RUNS, settings.bootstrap_seed or 0
        draws = run_bootstrap(factor, markov, fitted, scores, through, settings.future, z, runs, seed, reference)
        poles, responses = in_order_of(_scatter(draws.poles), fitted.A, model.A), _scatter(draws.responses)
        shapes = in_order_of(_scatter(draws.shapes), fitted.A, model.A)
        facts["bootstrap"] = {"runs": runs, "failed": draws.failed, "mean_block": draws.block, "seed": seed}
    elif refined is not None and refined.steps:
        own = refined.spread()
        if own is None:
            return Uncertainty()
        poles, responses, shapes = _pushed(model, model, own, z, reference)
    else:
        spread = matrix_spread(factor, basis, fitted, markov, through)
        poles, responses, shapes = _pushed(fitted, model, spread, z, reference)
    known = factor.inputs > 0 and bool(np.isfinite(responses).all())
    band = Band(frequency, frequency_response(model, z), responses) if known else None
    return Uncertainty(poles, band, shapes, facts)


def _pushed(
    fitted: ScaledModel, model: ScaledModel, spread: MatrixSpread, z: ComplexArray, reference: int | None
) -> tuple[Array, Array, Array]:
    """Return the covariance of the poles (n, 2, 2), of the response, with its second order, at z, and of the shapes.

    Shapes: (n, l, 2, 2), outputs in their scales.
    """
    poles = in_order_of(pole_covariance(fitted.A, spread), fitted.A, model.A)
    shapes = in_order_of(shape_covariance(fitted, spread, reference), fitted.A, model.A)
    return poles, response_covariance(model, spread, z) + curvature_covariance(model, poles, z), shapes


def _scatter(draws: ComplexArray) -> Array:
    """Return the covariance (…, 2, 2) of real and imaginary part of draws (runs, …)."""
    return covariance_of((draws - draws.mean(axis=0)) / np.sqrt(len(draws) - 1))


def in_order_of(covariance: Array, before: Array, after: Array) -> Array:
    """Return covariances (n, …) of poles in the order of eig(after): each pole's goes to the nearest one."""
    if after is before:
        return covariance
    here, there = (np.linalg.eigvals(A).astype(complex) for A in (after, before))
    out: Array = covariance[nearest(here, there)]
    return out
