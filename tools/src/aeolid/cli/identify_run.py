"""Choose what `aeolid identify` leaves to the data, and run the method that was asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.cli.common import waiting
from aeolid.cli.identify_channels import of_parts, say_rival, turn_angles
from aeolid.cli.identify_options import CHOOSING, SCHEDULED
from aeolid.errors import UsageError

if TYPE_CHECKING:
    from aeolid.identify.choices import Choices
    from aeolid.identify.lpv import LpvIdentification
    from aeolid.identify.ort import OrtIdentification
    from aeolid.identify.result import Identification
    from aeolid.identify.streamed import StreamedMarkov
    from aeolid.record import Record

    Result = Identification | LpvIdentification | OrtIdentification

PREPARED = {"missing": "auto", "detrend": "offset", "robust": "auto"}  # what varx and varmax do unless asked otherwise


@dataclass(frozen=True, eq=False)
class Asked:
    """Hold what the command was asked for.

    past, feedthrough, angle, delays: as given, for each of them may be left to the data; common: options of every
    method; first: what is done to recordings before; others: options of this method, with those of `first`.
    """

    method: str
    past: str
    feedthrough: list[str] | None
    angle: list[str] | None
    delays: Mapping[str, int] | str | None
    common: dict[str, Any]
    first: dict[str, Any]
    others: dict[str, Any]
    stable: bool
    allow_unstable: bool


def identify_recordings(recordings: Sequence[Path], roles: Path, markov: Path | None, asked: Asked) -> Result:
    """Read the recordings, choose what is left to them, identify; shows what takes its time."""
    from aeolid.formats import read_record
    from aeolid.identify.choices import with_choices_made
    from aeolid.identify.sound import identify_soundly
    from aeolid.identify.streamed import StreamedMarkov
    from aeolid.record import Roles

    with waiting("reading"):
        records = [read_record(path, table) for table in [Roles.load(roles)] for path in recordings]
    others = dict(asked.others)
    records, turned = turn_angles(records, asked.angle, others, markov)
    through = of_parts(asked.feedthrough, turned)
    with waiting(f"looking at {sum(map(len, records))} samples for feedthrough, dead times and past window"):
        streamed = None if markov is None else StreamedMarkov.load(markov)
        seen = _at_a_glance(asked, records, streamed)
        made = choose_for(asked, seen, through, streamed)
        common = asked.common | {"past": made.past, "feedthrough": mask_of(asked.method, through, made)}
        others |= {} if made.delays is None else {"delays": made.delays}
        others |= contrast_for(asked.method, made)
    with waiting(f"identifying with a past window of {made.past} samples"):
        run = partial(run_method, asked.method, records, common, others, streamed)
        result = with_choices_made(identify_soundly(run, seen, asked.stable, asked.allow_unstable), made)
        return replace(result, notes=(*result.notes, *turned.notes, *say_rival(asked.method, records, result)))


def _at_a_glance(asked: Asked, records: Sequence[Record], streamed: StreamedMarkov | None) -> Sequence[Record]:
    """Return the recordings as varx and varmax will take them, for choices before the fit and the free run after it."""
    from aeolid.identify.prepare import at_a_glance

    if asked.method not in CHOOSING[:2] or streamed is not None:
        return records
    first = PREPARED | asked.first
    return at_a_glance(records, first["missing"], first["detrend"], first["robust"])


def choose_for(
    asked: Asked, records: Sequence[Record], through: Sequence[str] | None, streamed: StreamedMarkov | None
) -> Choices:
    """Return window, dead times and feedthrough; of ort, whose mask is of its own, and of lpv the window alone.

    records: as `_at_a_glance` gives them.
    """
    from aeolid.identify.choices import Choices, choose
    from aeolid.identify.choose_past import read_past

    method, past, common, given = asked.method, asked.past, asked.common, list(through or ())
    named: list[str] | str = "auto" if through is None or given == ["auto"] else given
    if named == ["none"]:
        named = []
    if method not in CHOOSING[:2] and past == "auto":
        raise UsageError(f"--past auto is for --method varx and varmax; give --method {method} a window, 30 or 12s")
    if method in CHOOSING:
        return choose(
            records, past, named, decimation=common["decimation"], regularization=common["regularization"],
            checked=method != "fir", markov=streamed, delays=asked.delays,
        )  # fmt: skip
    window = read_past(past, records[0].sample_time_s * common["decimation"]) or 0
    return Choices(window, () if named == "auto" else tuple(named))


def contrast_for(method: str, made: Choices) -> dict[str, str]:
    """Return when prediction-error steps take the subspace model's place: always where no window could be compared."""
    if method not in CHOOSING[:2]:
        return {}
    return {"contrast": "always" if made.check is not None and made.check.holds is None else "apart"}


def mask_of(method: str, feedthrough: Sequence[str] | None, made: Choices) -> Sequence[str] | None:
    """Return the inputs with feedthrough; with ort the disturbances, None for all."""
    if method != "ort":
        return made.feedthrough
    return () if feedthrough is not None and list(feedthrough) == ["none"] else feedthrough


def run_method(
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
