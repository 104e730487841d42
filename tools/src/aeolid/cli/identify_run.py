"""Choose what `aeolid identify` leaves to the data, and run the method that was asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from aeolid.cli.identify_options import CHOOSING, SCHEDULED
from aeolid.errors import UsageError

if TYPE_CHECKING:
    from aeolid.identify.choices import Choices
    from aeolid.identify.lpv import LpvIdentification
    from aeolid.identify.ort import OrtIdentification
    from aeolid.identify.result import Identification
    from aeolid.identify.streamed import StreamedMarkov
    from aeolid.record import Record

PREPARED = {"missing": "auto", "detrend": "offset", "robust": "auto"}  # what varx and varmax do unless asked otherwise


def choose_for(
    method: str, records: Sequence[Record], past: str, feedthrough: Sequence[str] | None, common: dict[str, Any],
    first: dict[str, Any], streamed: StreamedMarkov | None, delays: Mapping[str, int] | str | None,
) -> Choices:  # fmt: skip
    """Return window, dead times and feedthrough; of ort, whose mask is of its own, and of lpv the window alone.

    first: what is done to recordings before, as asked for; varx and varmax do it, so that they are looked at like that.
    """
    from aeolid.identify.choices import Choices, choose
    from aeolid.identify.choose_past import read_past
    from aeolid.identify.prepare import at_a_glance

    given = list(feedthrough or ())
    named: list[str] | str = "auto" if feedthrough is None or given == ["auto"] else given
    if named == ["none"]:
        named = []
    if method not in CHOOSING[:2] and past == "auto":
        raise UsageError(f"--past auto is for --method varx and varmax; give --method {method} a window, 30 or 12s")
    if method in CHOOSING:
        if method in CHOOSING[:2] and streamed is None:
            asked = PREPARED | first
            records = at_a_glance(records, asked["missing"], asked["detrend"], asked["robust"])
        return choose(
            records, past, named, decimation=common["decimation"], regularization=common["regularization"],
            checked=method != "fir", markov=streamed, delays=delays,
        )  # fmt: skip
    window = read_past(past, records[0].sample_time_s * common["decimation"]) or 0
    return Choices(window, () if named == "auto" else tuple(named))


def mask_of(method: str, feedthrough: Sequence[str] | None, made: Choices) -> Sequence[str] | None:
    """Return the inputs with feedthrough; with ort the disturbances, None for all."""
    if method != "ort":
        return made.feedthrough
    return () if feedthrough is not None and list(feedthrough) == ["none"] else feedthrough


def run_method(
    method: str, records: Sequence[Record], common: dict[str, Any], own: dict[str, Any],
    streamed: StreamedMarkov | None, stable: bool,
) -> Identification | LpvIdentification | OrtIdentification:  # fmt: skip
    """Identify; common: options of every method, own: those of this one."""
    if method in SCHEDULED:
        from aeolid.identify.lpv import identify_lpv

        return identify_lpv(records, method=method, **common, **own)
    if method == "ort":
        from aeolid.identify.ort import identify_ort

        common = {key: value for key, value in common.items() if key != "regularization"}
        return identify_ort(records, stable=stable, **common, **own)
    if method == "fir":
        from aeolid.identify.fir import identify_fir

        return identify_fir(records, **common, **own)
    from aeolid.identify.varmax import identify_varmax
    from aeolid.identify.varx import identify_varx

    run: Callable[..., Identification] = identify_varx if method == "varx" else identify_varmax
    return run(records, markov=streamed, stable=stable, **common, **own)
