"""Identify models from recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from aeolid.api.linear import LinearModel
from aeolid.api.models import as_records
from aeolid.api.progress import Progress, shown
from aeolid.api.scheduled import ScheduledModel
from aeolid.api.session import public
from aeolid.identify.request import Request

if TYPE_CHECKING:
    from aeolid.record import Record


@public
def identify(
    records: Record | Sequence[Record],
    *,
    past: int | str = "auto",
    method: str = "varx",
    future: int | None = None,
    order: int | str | None = "auto",
    order_criterion: str | None = None,
    feedthrough: Sequence[str] | str | None = None,
    regularize: str | float = "gcv",
    missing: str | None = None,
    detrend: str | None = None,
    robust: str | None = None,
    solution: str | None = None,
    decimate: int = 1,
    passes: int | None = None,
    forget: float | None = None,
    delay: Mapping[str, int] | str | None = None,
    angle: Sequence[str] | str | None = None,
    scheduling: Sequence[str] | None = None,
    varying: str | Sequence[str] | None = None,
    kernel_rows: int | None = None,
    kernel_selection: str | None = None,
    kernel_tolerance: float | None = None,
    scheduling_scaling: str | None = None,
    offsets: bool | None = None,
    refine: bool | None = None,
    memory: float | None = None,
    joint_order: int | None = None,
    deterministic_order: int | None = None,
    response: str | None = None,
    stable: bool = False,
    allow_unstable: bool = False,
    uncertainty: str | None = None,
    bootstrap_runs: int | None = None,
    bootstrap_seed: int | None = None,
    outputs: Sequence[str] | str | None = None,
    reference: str | None = None,
    blades: Sequence[str] | str | None = None,
    markov: str | Path | None = None,
    progress: Progress = None,
) -> LinearModel | ScheduledModel:
    """Identify a model by predictor-based subspace identification, from open- or closed-loop recordings.

    The same as `aeolid identify`, whose options have the names of the parameters; same settings, same numbers.

    Parameters
    ----------
    records : Record or sequence of Record
        One recording, or several of one experiment set.
    past : int or str
        Past window p: samples, seconds ("12s"), or "auto" (varx, varmax); about a period of the slowest mode.
    method : {"varx", "varmax", "lpv", "lpv-kernel", "ort", "fir"}
        varmax: a short window does; lpv and lpv-kernel: depends on a measured scheduling; ort: a measured disturbance
        as instrument; fir: open loop, coloured noise.
    future : int, optional
        Future window f, 1 to p; default p.
    order : int or "auto"
        Number of states; by default the data decide.
    order_criterion : {"held-out", "aic", "bic", "gap"}, optional
        varx, varmax: what decides on the order.
    feedthrough : sequence of str, or str, optional
        Inputs that act within the sample; "auto" (default; of lpv "none") or "none". Of ort: disturbances that do.
    regularize : {"gcv", "none"} or float
        Regularisation of the Markov parameters, or a relative λ of 0 to 1.
    missing : {"auto", "leave-out"}, optional
        varx, varmax: "auto" (default) draws single missing cells from the others.
    detrend : {"none", "offset", "linear", "high-pass"}, optional
        varx, varmax: what is taken out of each recording; default its offset.
    robust : {"auto", "always", "never"}, optional
        varx, varmax: whether spikes of outputs are taken for missing.
    solution : {"auto", "smallest", "pivoted"}, optional
        varx, singular data: which Markov parameters are taken.
    decimate : int
        Factor by which the sample rate is lowered first.
    passes : int, optional
        varmax: passes of extended least squares, 0 to 1000; default 3.
    forget : float, optional
        varmax: forgetting of the first pass, 0.9 to 1; default 1.
    delay : mapping of str to int, or str, optional
        varx, varmax, fir: samples by which inputs act late; "auto" (default) or "none".
    angle : sequence of str, or str, optional
        Channels to replace by cosine and sine; "auto" (default: those that wrap) or "none".
    scheduling : sequence of str, optional
        lpv: channels to schedule with; default those of the role.
    varying : str or sequence of str, optional
        lpv: matrices that depend on it, of A, B, C, D, K; default A, B, K.
    kernel_rows : int, optional
        lpv-kernel: rows of the kernel to use; default all.
    kernel_selection : {"greedy", "first"}, optional
        lpv-kernel: which rows.
    kernel_tolerance : float, optional
        lpv-kernel: take rows until what is left is below this share of the largest.
    scheduling_scaling : {"range", "none", "centre", "standard", "auto"}, optional
        lpv: how the scheduling is scaled.
    offsets : bool, optional
        lpv: whether constants are free; default where means matter.
    refine : bool, optional
        Whether prediction-error steps follow; lpv: default yes; varx, varmax: default no.
    memory : float, optional
        lpv: refuse what needs more gigabytes; default 4.
    joint_order : int, optional
        ort: states of plant and controller together; by default the data decide.
    deterministic_order : int, optional
        ort: states of what the disturbance explains; default the joint order.
    response : {"fit", "theorem"}, optional
        ort: response to the disturbance.
    stable : bool
        Whether poles on or outside the unit circle are moved inside.
    allow_unstable : bool
        Whether a model that is unstable or whose free run diverges is returned too.
    uncertainty : {"asymptotic", "bootstrap", "none"}, optional
        varx, varmax: how standard deviations are found.
    bootstrap_runs : int, optional
        Runs of the bootstrap, 20 to 10000; default 200.
    bootstrap_seed : int, optional
        Seed of the bootstrap; default 0.
    outputs : sequence of str, or str, optional
        varx, varmax: channels to identify by themselves, without inputs (operational modal analysis); "all" for those
        of the role. Recordings without a channel of the role input are identified so anyhow.
    reference : str, optional
        varx, varmax: output that mode shapes are scaled to; default the one that moves most in each.
    blades : sequence of str, or str, optional
        Sets of blade channels that go to the fixed frame first (collective, cosine and sine part), each as
        "RootMyb1..3" or as names in the order of the blades, "A,B,C"; "auto" finds those called alike but for 1, 2, 3
        at the end, "none" leaves all. Default those that the roles file gives by `blade`.
    markov : str or pathlib.Path, optional
        Streamed Markov parameters (markov.npz) in place of those of the recordings.
    progress : bool or callable, optional
        By default what takes time is shown on a terminal and in a notebook; True shows it always, False never; a
        function is called with a text and the share done.

    Returns
    -------
    LinearModel or ScheduledModel
        ScheduledModel of lpv and lpv-kernel.

    Raises
    ------
    UsageError
        On settings that do not go together, or an argument of another type.
    DataError
        Where the recordings are inconsistent.
    NotIdentifiable
        Where they do not carry the answer; the text says which condition failed and what is needed.
    """
    request = Request(
        past=past, method=method, future=future, order=order, order_criterion=order_criterion, feedthrough=feedthrough,
        regularize=regularize, missing=missing, detrend=detrend, robust=robust, solution=solution, decimate=decimate,
        passes=passes, forget=forget, delay=delay, angle=angle, scheduling=scheduling, varying=varying,
        kernel_rows=kernel_rows, kernel_selection=kernel_selection, kernel_tolerance=kernel_tolerance,
        scheduling_scaling=scheduling_scaling, offsets=offsets, refine=refine, memory=memory, joint_order=joint_order,
        deterministic_order=deterministic_order, response=response, stable=stable, allow_unstable=allow_unstable,
        uncertainty=uncertainty, bootstrap_runs=bootstrap_runs, bootstrap_seed=bootstrap_seed,
        outputs=outputs, reference=reference, blades=blades,
    )  # fmt: skip
    request.check(streamed=markov is not None)
    return _identified(as_records(records), request, markov, progress)


def _identified(
    records: list[Record], request: Request, markov: str | Path | None, progress: Progress
) -> LinearModel | ScheduledModel:
    from aeolid.identify.lpv import LpvIdentification
    from aeolid.identify.run import identify_records
    from aeolid.identify.streamed import StreamedMarkov

    streamed = None if markov is None else StreamedMarkov.load(markov)
    with shown(progress) as show:

        @contextmanager
        def tell(text: str) -> Iterator[None]:
            show(text, None)
            yield

        result = identify_records(records, request, streamed, tell)
    source = ", ".join(record.source for record in records)
    if isinstance(result, LpvIdentification):
        return ScheduledModel(result.model, result=result, source=source)
    return LinearModel(result.model, result=result, source=source)
