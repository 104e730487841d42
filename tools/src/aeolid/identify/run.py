"""Choose what an identification leaves to the data, and run the method that was asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from aeolid.errors import UsageError
from aeolid.identify.output_only import NOTE, of_outputs_alone
from aeolid.identify.request import Request, names
from aeolid.identify.request_checks import CHOOSING, SCHEDULED
from aeolid.models.angles import renamed, split_angles
from aeolid.models.blade_sets import in_fixed_frame
from aeolid.models.fill_values import told_with, without_fill_values
from aeolid.models.rate import decimate_causally
from aeolid.models.shapes import index_of_reference
from aeolid.record import require_distinct

if TYPE_CHECKING:
    from aeolid.identify.choices import Choices
    from aeolid.identify.lpv import LpvIdentification
    from aeolid.identify.missing import Completed
    from aeolid.identify.ort import OrtIdentification
    from aeolid.identify.result import Identification
    from aeolid.identify.streamed import StreamedMarkov
    from aeolid.record import Record

    Result = Identification | LpvIdentification | OrtIdentification

Tell = Callable[[str], AbstractContextManager[object]]  # shows what is being done while a block runs
PREPARED = {"missing": "auto", "detrend": "offset", "robust": "auto"}  # what varx and varmax do unless asked otherwise


@dataclass(frozen=True)
class Turned:
    """Hold the angles whose cosine and sine took their place, and a sentence for each."""

    angles: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def of_parts(self, channels: Sequence[str] | None) -> list[str] | None:
        """Return channels with each angle replaced by its two parts, None for None."""
        return None if channels is None else renamed(channels, self.angles)


def identify_records(
    records: Sequence[Record], request: Request, streamed: StreamedMarkov | None = None, tell: Tell = nullcontext
) -> Result:
    """Choose what is left to the recordings of one experiment set, identify, and refuse what is unsound on them.

    streamed: Markov parameters of a filter in place of the recordings' own; tell: called with what takes its time.
    Samples that read a fill value count as missing, and a note says so (`fill_values`).
    Raises UsageError on settings that do not go together, DataError and NotIdentifiable as the methods do.
    """
    request.check(streamed=streamed is not None)
    require_distinct(records)
    records, filled = without_fill_values(records)
    with told_with(filled):
        result = _identified(records, request, streamed, tell)
    return replace(result, notes=(*filled, *result.notes))


def _identified(records: Sequence[Record], request: Request, streamed: StreamedMarkov | None, tell: Tell) -> Result:
    """Identify as `identify_records`, fill values missing already."""
    from aeolid.identify.choices import with_choices_made
    from aeolid.identify.sound import identify_soundly

    records = list(records) if streamed is not None else in_fixed_frame(records, names(request.blades))
    records, own = of_outputs_alone(records, names(request.outputs)), request.own()
    index_of_reference(records[0].names("output"), request.reference)
    records, turned = _turn_angles(records, request, own, streamed)
    through = turned.of_parts(names(request.feedthrough))
    with tell(f"looking at {sum(map(len, records))} samples for feedthrough, dead times and past window"):
        seen = _at_a_glance(request, records, streamed)
        made = _choose(request, seen, through, streamed)
        common = request.common() | {"past": made.past, "feedthrough": _mask_of(request.method, through, made)}
        own |= {} if made.delays is None else {"delays": made.delays}
        own |= _contrast_for(request, made)
    with tell(f"identifying with a past window of {made.past} samples"):
        run = partial(_run_method, request.method, records, common, own, streamed)
        result = with_choices_made(identify_soundly(run, seen.records, request.stable, request.allow_unstable), made)
        alone = () if records[0].names("input") else (NOTE,)
        told = (
            *result.notes,
            *turned.notes,
            *alone,
            *_unused(request.method, records),
            *_say_rival(request.method, records, result),
        )
        return _with_spectra(replace(result, notes=told), records)


def _unused(method: str, records: Sequence[Record]) -> tuple[str, ...]:
    """Say which recorded disturbances a method leaves aside: ort alone has a use for them."""
    left = records[0].names("disturbance") if method != "ort" else ()
    if not left:
        return ()
    them, is_ = ("it", "is") if len(left) == 1 else ("them", "are")
    told = f"{', '.join(left)} (role disturbance) {is_} not used by {method}"
    return (f"{told}; give {them} the role input, or --method ort",)


def _with_spectra(result: Result, records: Sequence[Record]) -> Result:
    """Return a result of one frequency response with what spectra of the same samples say of it.

    A decimated model maps the mean of an input over each of its samples to the output at its start: so do they.
    """
    from aeolid.identify.result import Identification
    from aeolid.identify.spectral import estimate_spectra

    if not isinstance(result, Identification):
        return result
    found = estimate_spectra([decimate_causally(r, result.settings.decimation) for r in records])
    return result if found is None else replace(result, extra=result.extra | {"spectral": found.to_json()})


def _turn_angles(
    records: list[Record], request: Request, own: dict[str, Any], streamed: StreamedMarkov | None
) -> tuple[list[Record], Turned]:
    """Return the recordings with angles as cosine and sine; in the options of scheduled models they are renamed.

    A stream of Markov parameters belongs to the channels as they are: with one only what is asked for is split.
    """
    asked = names(request.angle)
    alone = None if asked is None or asked == ["auto"] else asked
    if asked == ["none"] or (alone is None and streamed is not None):
        return records, Turned()
    records, angles, notes = split_angles(records, alone, own.get("scheduling", ()))
    if "scheduling" in own:
        own["scheduling"] = renamed(own["scheduling"], angles)
    return records, Turned(angles, notes)


def _at_a_glance(
    request: Request, records: Sequence[Record], streamed: StreamedMarkov | None
) -> Completed:  # fmt: skip
    """Return the recordings as varx and varmax will take them, for choices before the fit and the free run after it."""
    from aeolid.identify.missing import Completed
    from aeolid.identify.prepare import at_a_glance

    if request.method not in CHOOSING[:2] or streamed is not None:
        return Completed(records)
    first = PREPARED | request.given(*PREPARED)
    return at_a_glance(records, first["missing"], first["detrend"], first["robust"])


def _choose(
    request: Request, seen: Completed, through: Sequence[str] | None, streamed: StreamedMarkov | None
) -> Choices:
    """Return window, dead times and feedthrough; of ort, whose mask is of its own, and of lpv the window alone.

    seen: recordings as `_at_a_glance` gives them.
    """
    from aeolid.identify.choices import Choices, choose
    from aeolid.identify.choose_past import read_past

    method, past, given, records = request.method, str(request.past), list(through or ()), seen.records
    named: list[str] | str = "auto" if through is None or given == ["auto"] else given
    if named == ["none"]:
        named = []
    if method not in CHOOSING[:2] and past == "auto":
        raise UsageError(f"--past auto is for --method varx and varmax; give --method {method} a window, 30 or 12s")
    if method in CHOOSING:
        return choose(
            records, past, named, decimation=request.decimate, regularization=request.common()["regularization"],
            checked=method != "fir", markov=streamed, delays=request.delays(streamed=streamed is not None),
            followed=_followed(request, streamed), completed=seen,
        )  # fmt: skip
    window = read_past(past, records[0].sample_time_s * request.decimate) or 0
    return Choices(window, () if named == "auto" else tuple(named))


def _followed(request: Request, streamed: StreamedMarkov | None) -> bool:
    """Say whether prediction-error steps follow the subspace model, see `assemble`."""
    plain = not request.refine and (request.uncertainty or "asymptotic") == "asymptotic"
    return request.method in CHOOSING[:2] and streamed is None and plain


def _contrast_for(request: Request, made: Choices) -> dict[str, str]:
    """Return when prediction-error steps take the subspace model's place.

    Always where the window was left to the data, for it then is that of their start, and where none could be compared.
    """
    if request.method not in CHOOSING[:2]:
        return {}
    always = str(request.past) == "auto" or (made.check is not None and made.check.holds is None)
    return {"contrast": "always" if always else "apart"}


def _mask_of(method: str, feedthrough: Sequence[str] | None, made: Choices) -> Sequence[str] | None:
    """Return the inputs with feedthrough; with ort the disturbances, None for all."""
    if method != "ort":
        return made.feedthrough
    return () if feedthrough is not None and list(feedthrough) == ["none"] else feedthrough


def _run_method(
    method: str, records: Sequence[Record], common: dict[str, Any], own: dict[str, Any],
    streamed: StreamedMarkov | None, stable: bool,
) -> Result:  # fmt: skip
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


def _say_rival(method: str, records: Sequence[Record], result: Any) -> tuple[str, ...]:
    """Return what is to be said of varx beside ort, whose work it does better on most recordings; else nothing."""
    if method != "ort":
        return ()
    from aeolid.identify.ort.compare import compare_with_varx

    return (compare_with_varx(records, result),)
