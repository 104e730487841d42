"""Choose what the user left to the data before a fit: past window and feedthrough; check the window that was taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

from aeolid.errors import DataError, UsageError
from aeolid.identify.choose_feedthrough import choose_feedthrough
from aeolid.identify.choose_past import (
    Ladder,
    check_window,
    choose_past,
    ladder_of,
    longest_past,
    others_of,
    read_past,
    shows,
)
from aeolid.identify.delay import AUTO, find_delays
from aeolid.identify.delay_states import without_delays
from aeolid.identify.feedthrough import Feedthrough
from aeolid.identify.missing import Completed
from aeolid.identify.prepare import slower
from aeolid.identify.result import Identification
from aeolid.identify.settings import check_feedthrough
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.truncation import APART, WindowCheck, WindowFit
from aeolid.identify.windows import Scaling, find_scaling, require_windows
from aeolid.models.modes import Mode
from aeolid.record import Record
from aeolid.wording import counted

Result = TypeVar("Result")
CONFIRMED = (
    "the data allow no past window much longer than {} samples to hold it against: modes are those of prediction-error "
    "steps, which have no window, and their innovations are white"
)
NEAR = 0.1  # relative: a pole that a window moves by less is still found in the list by its frequency
TESTED = 0.3  # of the longest window allowed, in which feedthrough is tested where the window is not given


@dataclass(frozen=True)
class Choices:
    """Hold the window and the inputs with feedthrough that are taken, and what is to be said of them.

    tested: the answer for each input, empty where not asked; missing: inputs that act within the sample against what
    was given; check: of the window, None where it was not checked; delays: samples by which inputs act late, None for
    none; others: models of other windows, that the window was held against.
    """

    past: int
    feedthrough: tuple[str, ...]
    notes: tuple[str, ...] = ()
    tested: tuple[Feedthrough, ...] = ()
    check: WindowCheck | None = None
    past_reason: str | None = None
    missing: tuple[str, ...] = ()
    delays: Mapping[str, int] | None = None
    others: tuple[WindowFit, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the choices as JSON facts."""
        return {
            "past": {"value": self.past, "reason": self.past_reason},
            "feedthrough": {"value": list(self.feedthrough), "inputs": [t.to_json() for t in self.tested]},
            "delays": dict(self.delays or {}),
        }


def choose(
    records: Sequence[Record], past: str | int, feedthrough: Sequence[str] | str, *, decimation: int = 1,
    regularization: str | float = "gcv", checked: bool = True, markov: StreamedMarkov | None = None,
    delays: Mapping[str, int] | str | None = None, followed: bool = False, completed: Completed | None = None,
) -> Choices:  # fmt: skip
    """Return window, feedthrough and dead times, those given as they are, "auto" by the data.

    past: samples, seconds as "12s" (of the decimated samples), or "auto"; feedthrough: names, () or "auto"; checked:
    whether the window is checked (the methods varx and varmax); delays: as in `find_delays`, after feedthrough, for an
    input that acts at once is not late; followed: as in `choose_past`; completed: the recordings with their
    missing cells drawn, where they have some. With a stream of Markov parameters "auto" is what its filter had. Raises
    UsageError or NotIdentifiable as `identify_varx`.
    """
    if markov is not None:
        return _of_stream(records, past, feedthrough, markov)
    given = read_past(str(past), records[0].sample_time_s * decimation)
    if feedthrough != "auto":
        check_feedthrough(records, feedthrough)
    known = (completed or Completed(records)).each(partial(slower, factor=decimation))
    scaling, ladder = _climbed(known, given)
    tested: tuple[Feedthrough, ...] = ()
    at = min(given if given is not None else max(round(TESTED * ladder.longest), 1), ladder.longest)
    if scaling.inputs and (checked or feedthrough == "auto"):
        halves, whole = ladder.at(at)
        tested = choose_feedthrough(known.records, scaling, whole, halves)
    on = tuple(t.name for t in tested if t.on) if feedthrough == "auto" else tuple(feedthrough)
    missing = () if feedthrough == "auto" else tuple(t for t in tested if t.on and t.name not in on)
    said = _said(tested, missing, feedthrough == "auto")
    late = find_delays(known.records, at, on, delays)
    if late:
        scaling, ladder = _climbed(known.each(partial(without_delays, delays=late)), given)
        said += [f"the delay of {n} is estimated; --delay none leaves it to the model" for n in late if delays == AUTO]
    through = tuple(n in on for n in scaling.inputs)
    made = _with_past(ladder, given, through, regularization, checked, followed)
    made = replace(
        made, feedthrough=on, notes=(*made.notes, *said, *_say_short(known.records, made.past)), tested=tested
    )
    return replace(made, missing=tuple(t.name for t in missing), delays=late or None)


def _climbed(known: Completed, given: int | None) -> tuple[Scaling, Ladder]:
    """Return scaling and windows of the recordings, as long as the given one needs to be checked, or all it allows."""
    records = known.records
    scaling = find_scaling(records)
    if given is not None and given < 1:
        raise UsageError(f"past window {given} is not at least 1")
    most = longest_past(records, scaling.channels)
    require_windows(records, most if given is None else given, scaling.channels)
    return scaling, ladder_of(known, scaling, most if given is None else max(min(4 * given, most), given))


def _say_short(records: Sequence[Record], past: int) -> list[str]:
    short = sum(len(r) <= past for r in records)
    if not short:
        return []
    return [
        f"{short} of {counted(len(records), 'recording', ('is', 'are'))} no longer than the past window of "
        f"{past} samples: not used"
    ]


def _said(tested: tuple[Feedthrough, ...], missing: tuple[Feedthrough, ...], auto: bool) -> list[str]:
    return [_say(t) for t in tested if t.on or not t.sure] if auto else [_say_missing(t) for t in missing]


def with_choices_made(result: Result, made: Choices) -> Result:
    """Return the result with the notes and facts of the choices.

    bands_hold is False where the window is too short, where prediction-error steps find poles elsewhere and have no end
    to take, where innovations at their end are not white (`contrast`), where more states find a mode elsewhere
    (`crowded`), where there are few windows a parameter (`enough`), and where poles were moved inside the unit circle
    (`sound`). Where nothing longer than the window could be tried, an end that is taken stands in for it. Results of
    methods that leave nothing to choose are returned as they are.
    """
    if not isinstance(result, Identification):
        return result
    check, held = made.check, result.extra.get("contrast", {})
    facts: dict[str, Any] = {"choices": made.to_json()}
    notes = list(made.notes)
    scarce = result.extra.get("scarce", "")
    if check is not None:
        stands = held.get("taken", False) and held.get("ended", True) and not held.get("reason")
        limited = held.get("limited") or ""
        confirmed = check.holds is None and stands and not scarce and not limited
        alone = _alone(made.others, result) if confirmed else ""
        window = "" if confirmed else check.reason
        window += _unlisted(check, result.modes) if window else ""
        window += f"; {limited}" if window and limited and check.holds is None else ""
        near = result.extra.get("crowded", {}).get("reason", "")
        reasons = [r for r in (scarce, window, held.get("reason"), near, alone, result.extra.get("moved")) if r]
        notes += [f"WARNING: {window}; lengthen --past, or --decimate"] if window else []
        notes += [f"WARNING: {held['reason']}; record longer, or name a higher order"] if held.get("reason") else []
        notes += [f"WARNING: {near}; name a higher order, or record longer"] if near else []
        notes += [f"WARNING: {alone}; name a lower order, shorten --past, or record longer"] if alone else []
        notes += [CONFIRMED.format(check.past)] if confirmed and not alone else []
        reasons += [f"input {name!r} acts within the sample and has no feedthrough" for name in made.missing]
        holds = (check.holds is True or confirmed) and not reasons
        facts |= {"bands_hold": holds, "bands_reason": "; ".join(reasons) or None, "window": check.to_json()}
    own = (f"WARNING: {n}" if scarce and n == scarce else n for n in result.notes)
    return replace(result, notes=(*own, *notes), extra=result.extra | facts)


def _alone(others: Sequence[WindowFit], result: Identification) -> str:
    """Return what is to be said of modes with deviations that no model of another window shows, else nothing."""
    if not others:
        return ""
    told = [m for m in result.modes if m.eigenvalue.imag and m.frequency_std_hz is not None]
    lone = [f"{m.frequency_hz:.3g} Hz" for m in told if not any(shows(o, m.eigenvalue) for o in others)]
    if not lone:
        return ""
    windows = " or ".join(str(w) for w in sorted({f.past for f in others}))
    return (
        f"the {'mode' if len(lone) == 1 else 'modes'} near {', '.join(lone)} {'is' if len(lone) == 1 else 'are'} in no "
        f"model of a past window of {windows} samples and may be noise: standard deviations do not hold"
    )


def _unlisted(check: WindowCheck, modes: Sequence[Mode]) -> str:
    """Return what is to be said where the pole that a window's check names is none of the modes told, else nothing."""
    hertz = check.frequency_hz
    if hertz is None or check.apart <= APART:
        return ""
    if any(abs(m.frequency_hz - hertz) <= NEAR * max(hertz, m.frequency_hz) for m in modes):
        return ""
    why = (
        "only models of the longer window have it"
        if check.missed
        else ("the check fits models of its own, whose order held-out samples choose")
    )
    return f"; no pole near {hertz:.3g} Hz is listed, since {why}"


def _with_past(
    ladder: Ladder, given: int | None, through: tuple[bool, ...], regularization: str | float, checked: bool,
    followed: bool,
) -> Choices:  # fmt: skip
    """Return the window alone, chosen or as given, with the check of it."""
    if given is None:
        choice = choose_past(ladder, through, regularization, followed)
        check, others = choice.check, choice.others
        return Choices(choice.past, (), (choice.reason,), check=check, past_reason=choice.reason, others=others)
    if not checked or ladder.longest < given:
        return Choices(given, ())
    fits: dict[tuple[int, int | None], WindowFit] = {}
    check = check_window(ladder, given, through, regularization, fits)
    return Choices(given, (), check=check, others=others_of(fits, given))


def _say(found: Feedthrough) -> str:
    return f"feedthrough of {found.name}: {found.reason}" if found.sure else f"WARNING: {found.warning()}"


def _say_missing(found: Feedthrough) -> str:
    return (
        f"WARNING: input {found.name!r} acts on {found.output!r} within the sample and has no feedthrough: modes and "
        f"deviations do not hold; give --feedthrough {found.name}, or auto"
    )


def _of_stream(
    records: Sequence[Record], past: str | int, feedthrough: Sequence[str] | str, markov: StreamedMarkov
) -> Choices:
    """Return what the filter of a stream had, where that is asked for."""
    origin, window = markov.origin, read_past(str(past), records[0].sample_time_s)
    if origin is None and window is None:
        raise DataError(f"{markov.source}: it does not say which past window its filter had; give --past")
    if window is None and origin is not None:
        window = origin.past
    names = records[0].names("input")
    if feedthrough == "auto":
        have = () if origin is None else origin.feedthrough
        feedthrough = tuple(names[i] for i in have if i < len(names))
    reason = f"past window {window} and feedthrough are those of the filter" if str(past) == "auto" else None
    return Choices(int(window or 1), tuple(feedthrough), () if reason is None else (reason,), past_reason=reason)
