"""Identify a linear model by VARX-based PBSIDopt from recordings, or from streamed Markov parameters and samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from aeolid.identify.assemble import LARGEST_AUTO_ORDER, assemble
from aeolid.identify.compressed import compress
from aeolid.identify.markov import estimate_markov
from aeolid.identify.prepare import prepare, with_preparation
from aeolid.identify.quantify import BOOTSTRAP_RUNS, with_uncertainty
from aeolid.identify.result import Identification
from aeolid.identify.settings import make_settings, with_choices
from aeolid.identify.solution import choose_solution, with_solution
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.windows import find_scaling
from aeolid.record import Record


def identify_varx(
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
    uncertainty: str = "asymptotic",
    bootstrap_runs: int = BOOTSTRAP_RUNS,
    bootstrap_seed: int = 0,
    order_criterion: str = "held-out",
    refined: bool = False,
    missing: str = "auto",
    detrend: str = "offset",
    robust: str = "auto",
    solution: str = "auto",
    unexcited: str = "refuse",
    contrast: str = "none",
    reference: str | None = None,
) -> Identification:
    """Identify x⁺ = A x + B u + K e, y = C x + D u + e by PBSIDopt (papers 000 and 001), open or closed loop.

    records: one experiment set; recordings are merged as if measured in one go, no window spans two of them.
    past: p ≥ 1 samples; (A − K C)ᵖ should be negligible: about one period of the slowest mode. future: f ≤ p, default
    p. order: n, default chosen on held-out data. feedthrough: names of inputs that act on the outputs within the
    sample, default none because D of an input cannot be identified without bias when its controller has feedthrough
    itself. regularization: "gcv" (default: costs nothing where data are rich), "none" or a number, λ relative to the
    largest singular value. markov: Ξ from a stream in place of eq. (23). decimation: whole factor by which the sample
    rate is lowered first. stable: move poles on or outside the unit circle inside. delays: samples by which inputs act
    late, by name, "auto" (see `delay`) or None: the windows are then free of them, the model has them as states.
    uncertainty: of modes and frequency response, "asymptotic" (default: costs nothing), "bootstrap" (see there; also
    where innovations are not white or change their power) or "none". bootstrap_runs: 20 … 10 000, default 200, which
    leave 5 % on a deviation; bootstrap_seed: of its signs. order_criterion: "held-out" (default: needs no assumption on
    the noise), "aic", "bic" or "gap" (see `order`). refined: whether prediction-error steps follow (see `refine`),
    default no: with little noise they gain a few percent for ten times the work.
    missing: "auto" (default) draws single missing cells where they cost more than 5 % of the windows (see `missing`),
    "leave-out" leaves all windows with one out. detrend: "none", "offset" of each recording (default), "linear" or
    "high-pass" (see `detrend`). robust: "auto" (default), "always" or "never" takes spikes for missing (see `spikes`).
    solution: of singular data, "smallest", "pivoted" or "auto" (default: by held-out error; see `solution`).
    unexcited: "refuse" (default) loops whose recordings fit plants that differ, "take" them where no plant is sought.
    contrast: with the end of prediction-error steps, which takes the model's place: "none" (default), "apart" where
    poles differ by more than their deviations explain, or "always" (see `contrast`). reference: output that mode shapes
    are scaled to, default the one that moves most in each.
    Recordings without an input are identified by their outputs alone: B and D have no columns.
    Raises NotIdentifiable on constant channels, too few samples or missing excitation; UsageError on bad options.
    Cost: 2 N q² operations, q = (p + 1)(r + l); memory q² beside the recordings.
    """
    settings = make_settings(
        "varx", records, past, future, order, feedthrough, regularization, markov, decimation, stable
    )
    settings = with_uncertainty(settings, uncertainty, bootstrap_runs, bootstrap_seed)
    settings = with_choices(settings, refined, order_criterion, contrast, reference)
    settings = with_preparation(settings, missing, detrend, robust)
    settings = with_solution(settings, solution, unexcited)
    prepared = prepare(records, settings, delays)
    records = prepared.records
    scaling = find_scaling(records)
    through = tuple(name in settings.feedthrough for name in scaling.inputs)
    windows = compress(records, scaling, past, prepared.completed)
    windows, notes, facts = choose_solution(windows, through, settings, LARGEST_AUTO_ORDER)
    estimate = estimate_markov(windows.whole, through, regularization, windows.solution)
    notes = (*prepared.notes, *notes)
    if markov is not None:
        estimate, more = markov.replace_in(estimate, records, windows.whole, scaling, through)
        notes += tuple(more)
    return prepared.finish(assemble(windows, records, estimate, settings, notes, prepared.facts | facts))
