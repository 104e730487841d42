"""Identify a linear model by VARMAX-based PBSIDopt: paper 000, with innovations as regressors and a short window."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from aeolid.errors import UsageError
from aeolid.identify.assemble import assemble
from aeolid.identify.compressed import Windows, compress
from aeolid.identify.extended import Samples, collect
from aeolid.identify.markov import estimate_markov, with_theta
from aeolid.identify.missing import Completed
from aeolid.identify.positive_real import PositiveReal, check_positive_real, least_moving_average
from aeolid.identify.prepare import prepare, with_preparation
from aeolid.identify.quantify import BOOTSTRAP_RUNS, with_uncertainty
from aeolid.identify.result import Identification
from aeolid.identify.settings import make_settings, with_choices
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.whitening import Whitening, extend, follow, start_again, whiten
from aeolid.identify.windows import Scaling, find_scaling, require_windows
from aeolid.record import Record

PASSES, FORGETTING = 3, 1.0
MOST_PASSES = 1000


def identify_varmax(
    records: Sequence[Record],
    *,
    past: int,
    future: int | None = None,
    order: int | None = None,
    feedthrough: Sequence[str] = (),
    regularization: str | float = "gcv",
    markov: StreamedMarkov | None = None,
    decimation: int = 1,
    delays: Mapping[str, int] | str | None = None,
    stable: bool = False,
    passes: int = PASSES,
    forgetting: float = FORGETTING,
    uncertainty: str = "asymptotic",
    bootstrap_runs: int = BOOTSTRAP_RUNS,
    bootstrap_seed: int = 0,
    order_criterion: str = "held-out",
    refined: bool = False,
    missing: str = "auto",
    detrend: str = "offset",
    robust: str = "auto",
    contrast: str = "none",
    reference: str | None = None,
) -> Identification:
    """Identify x⁺ = A x + B u + K e, y = C x + D u + e by VARMAX-based PBSIDopt (paper 000), open or closed loop.

    The predictor y_k = Ξ z_k + e_k, z of blocks [u; y; e], eq. (12)–(14), needs as much past as the outputs take to
    show every state (n/l samples at best, n at most) and not the memory of A − K C: a window of 10 does the work of a
    VARX window of 30. e is found from VARX (23) of the same
    window, then by `passes` passes of extended least squares (24), each started from the solution of the one before,
    then by residual whitening where that helps. States and matrices follow as in VARX, (17)–(22), (26), (27).

    records … stable: as in `identify_varx`, but the default regularization "gcv" takes Ξ from the last pass, which
    weighs 1/10 of a sample against leaving the Ξ before (cross-validation does not know that e is an estimate) where
    noise reaches every direction of the outputs. Where it does not (`positive_real.RANK`), e_k is nearly a combination
    of fewer numbers, a sample's weight tells its columns apart by what recursion leaves in them, and Ξ is taken by
    least squares with the last e, as the other choices always take it. markov: Ξ of a VARMAX filter, with its
    innovations; no pass is run then. passes: 0 … 1000, default 3; more change nothing on the papers' systems.
    forgetting: λ of the first pass, 0.9 … 1; pass i uses λ^{1/i}, the last one 1, so that less than 1 takes two passes.
    Default 1: less forgets the wrong e of the start sooner and changes little; what the data leave open (fewer noise
    sources than outputs) is held at the start of the pass. uncertainty … robust: as in `identify_varx`, with e as
    found; missing cells are drawn once. contrast, reference: as there.
    Raises as `identify_varx`. Cost: N (5/2 n² + 4 l n) operations a pass, n = p (r + 2 l), and 2 N n² an iteration.
    """
    settings = make_settings(
        "varmax", records, past, future, order, feedthrough, regularization, markov, decimation, stable
    )
    settings = with_uncertainty(settings, uncertainty, bootstrap_runs, bootstrap_seed)
    settings = with_choices(settings, refined, order_criterion, contrast, reference)
    settings = with_preparation(settings, missing, detrend, robust)
    _check_passes(passes, forgetting)
    if markov is None:
        settings = replace(settings, passes=passes, forgetting=forgetting)
    prepared = prepare(records, settings, delays)
    records = prepared.records
    scaling = find_scaling(records)
    through = tuple(name in settings.feedthrough for name in scaling.inputs)
    extended = extend(scaling)
    require_windows(records, past, extended.channels, lead=2 * past)
    known = replace(prepared.completed, others=())
    plain = compress(records, scaling, past, known)
    samples = collect(records, scaling, past)
    start = estimate_markov(plain.whole, through, regularization)
    if markov is None:
        found = whiten(records, samples, extended, plain.whole, start, through, regularization, passes, forgetting)
    else:
        theta = markov.scaled(extended, past, through)
        found = follow(records, samples, extended, plain.whole, start, theta, markov)
    windows, verdict = _judge(records, samples, found, plain, extended, through, known)
    if not verdict.holds and markov is None:
        again = start_again(records, samples, extended, scaling, found, past, through, regularization)
        if again is not None:
            found = again
            windows, verdict = _judge(records, samples, found, plain, extended, through, known)
    estimate = estimate_markov(windows.whole, through, regularization)
    if found.theta is not None and regularization == "gcv" and verdict.rank == verdict.outputs:
        estimate = with_theta(estimate, found.theta, windows.whole)
    notes = [*prepared.notes, *found.notes, verdict.text]
    if markov is not None:
        estimate, more = markov.replace_in(estimate, windows.records, windows.whole, extended, through)
        notes += more
    extra = prepared.facts | {"varmax": {**found.to_json(), "positive_real": verdict.to_json()}}
    return prepared.finish(assemble(windows, records, estimate, settings, notes, extra))


def _check_passes(passes: int, forgetting: float) -> None:
    if not 0 <= passes <= MOST_PASSES:
        raise UsageError(f"passes {passes} is not within 0 … {MOST_PASSES}")
    if not 0.9 <= forgetting <= 1:
        raise UsageError(f"forgetting {forgetting} of the first pass is not within 0.9 … 1")
    if forgetting < 1 and passes < 2:
        raise UsageError(f"forgetting {forgetting} needs at least 2 passes, not {passes}: the last one does not forget")


def _judge(
    records: Sequence[Record], samples: Samples, found: Whitening, plain: Windows, extended: Scaling,
    through: tuple[bool, ...], known: Completed,
) -> tuple[Windows, PositiveReal]:  # fmt: skip
    """Return the VARMAX windows and the verdict on (25); windows whose e is not known count as no missing sample."""
    past = plain.whole.past
    windows = compress(found.records, extended, past, known)
    windows = replace(windows, whole=replace(windows.whole, skipped=plain.whole.skipped))
    e = found.e[samples.used(past)]
    theta = least_moving_average(windows.whole, through)
    covariance = e.T @ e / max(len(e), 1)
    return windows, check_positive_real(theta, past, windows.whole.inputs, covariance, records[0].sample_time_s)
