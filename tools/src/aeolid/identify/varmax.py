"""Identify a linear model by VARMAX-based PBSIDopt: paper 000, with innovations as regressors and a short window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.errors import UsageError
from aeolid.identify.assemble import Windows, assemble, compress, make_settings
from aeolid.identify.decimate import decimate
from aeolid.identify.extended import collect
from aeolid.identify.markov import estimate_markov, require_excitation
from aeolid.identify.positive_real import check_positive_real
from aeolid.identify.result import Identification
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.whitening import Whitening, extend, follow, whiten
from aeolid.identify.windows import find_scaling
from aeolid.record import Record

PASSES, FORGETTING = 4, 0.999
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
    stable: bool = False,
    passes: int = PASSES,
    forgetting: float = FORGETTING,
) -> Identification:
    """Identify x⁺ = A x + B u + K e, y = C x + D u + e by VARMAX-based PBSIDopt (paper 000), open or closed loop.

    The predictor y_k = Ξ z_k + e_k, z of blocks [u; y; e], eq. (12)–(14), needs p ≥ n/l samples of past and not the
    memory of A − K C: a window of 10 does the work of a VARX window of 30. e is found from VARX (23) of the same
    window, then by `passes` passes of extended least squares (24), each started from the solution of the one before,
    then by residual whitening until it rests. All follows from the last e: Ξ by least squares, (17)–(22), (26), (27).

    records … stable: as in `identify_varx`; markov: Ξ of a VARMAX filter, with its innovations.
    passes: 0 … 1000, default 4; more change nothing on the papers' systems. forgetting: λ of the first pass, 0.9 … 1,
    default 0.999; pass i uses λ^{1/i}, so that the wrong e of the start is forgotten and the end is near 1.
    Raises as `identify_varx`. Cost: N (5/2 n² + 4 l n) operations a pass, n = p (r + 2 l), and 2 N n² an iteration.
    """
    settings = make_settings(
        "varmax", records, past, future, order, feedthrough, regularization, markov, decimation, stable
    )
    if not 0 <= passes <= MOST_PASSES or not 0.9 <= forgetting <= 1:
        raise UsageError(f"passes {passes} and forgetting {forgetting} are not within 0 … {MOST_PASSES} and 0.9 … 1")
    settings = replace(settings, passes=passes, forgetting=forgetting)
    records = [decimate(r, decimation) for r in records]
    scaling = find_scaling(records)
    through = tuple(name in settings.feedthrough for name in scaling.inputs)
    plain = compress(records, scaling, past)
    samples = collect(records, scaling, past)
    start = estimate_markov(plain.whole, through, regularization)
    require_excitation(start, records[0].source)
    extended = extend(scaling)
    if markov is None:
        found = whiten(records, samples, extended, plain.whole, start, through, regularization, passes, forgetting)
    else:
        theta = markov.scaled(extended, past, through)
        found = follow(records, samples, extended, plain.whole, start, theta, markov)
    windows = _windows(records, found, plain, past)
    estimate = estimate_markov(windows.whole, through, regularization)
    if markov is not None:
        estimate = markov.replace_in(estimate, windows.whole, extended, past, through)
    verdict = check_positive_real(
        estimate.theta, past, len(scaling.inputs), estimate.residual_covariance, records[0].sample_time_s
    )
    notes = [*found.notes, verdict.text]
    extra = {"varmax": {**found.to_json(), "positive_real": verdict.to_json()}}
    return assemble(windows, records, estimate, settings, notes, extra)


def _windows(records: Sequence[Record], found: Whitening, plain: Windows, past: int) -> Windows:
    """Return the VARMAX windows; those left out because e is not known yet are not counted as missing samples."""
    windows = compress(found.records, extend(plain.scaling), past)
    return replace(windows, whole=replace(windows.whole, skipped=plain.whole.skipped))
