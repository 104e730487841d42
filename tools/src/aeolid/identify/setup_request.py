"""Check set-ups before they are merged: references in each of them, sensors under names of their own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from aeolid.errors import DataError, UsageError
from aeolid.geometry import united
from aeolid.identify.modal import Modal, find_modal
from aeolid.identify.setup_realisation import realise
from aeolid.identify.setups import MergedModal, merge
from aeolid.record import Record

MOST = 200  # set-ups
WAYS = ("poser", "preger")  # of merging: mode by mode, or to one realisation


def find_merged(
    setups: Sequence[Sequence[Record]], references: Sequence[str], *, outputs: Sequence[str] | None = None,
    past: Sequence[int | None] | None = None, largest: int | None = None, decimation: int = 1,
    reference: str | None = None, by: str = "poser",
) -> MergedModal:  # fmt: skip
    """Find the modes of each set-up by its outputs alone and merge them; each is a sequence of recordings.

    references: outputs that every set-up has; outputs: which to use, default all of the role; past: window of each
    set-up in samples; largest, decimation: as in `find_modal`; reference: sensor that shapes are scaled to; by:
    "poser", mode by mode, or "preger", to one realisation. Sample times may differ. Raises UsageError, DataError and
    NotIdentifiable. Cost: that of `find_modal` for each set-up.
    """
    if by not in WAYS:
        raise UsageError(f"--merge-by {by}: set-ups are merged by {' or '.join(WAYS)}")
    used = outputs_of(setups, references, outputs)
    if reference is not None and not any(reference in names for names in used):
        raise UsageError(f"--reference {reference}: no set-up has such an output in use")
    united(r.geometry for records in setups for r in records)  # refused before the work, not after
    windows = past or [None] * len(setups)
    found: list[Modal] = [
        find_modal(records, outputs=names, past=window, largest=largest, decimation=decimation, blades="none")
        for records, names, window in zip(setups, used, windows, strict=True)
    ]
    return (realise if by == "preger" else merge)(found, references, reference)


def outputs_of(
    setups: Sequence[Sequence[Record]], references: Sequence[str], outputs: Sequence[str] | None
) -> list[list[str]]:
    """Return the outputs of each set-up that are used; raises where they do not make set-ups of one structure."""
    if not 2 <= len(setups) <= MOST:
        raise UsageError(f"{len(setups)} set-ups: 2 to {MOST} are merged by references")
    if not references:
        raise UsageError("no reference: name the sensors that every set-up has, --references CH1,CH2")
    twice = [n for n, count in Counter(references).items() if count > 1]
    if twice:
        raise UsageError(f"--references names {twice[0]!r} twice")
    have = [list(records[0].names("output")) for records in setups]
    unknown = [n for n in outputs or [] if not any(n in names for names in have)]
    if unknown:
        raise UsageError(f"--outputs {unknown[0]}: no set-up has such an output")
    _require_references(setups, references, have)
    wanted = None if outputs is None else {*references, *outputs}
    used = [[n for n in names if wanted is None or n in wanted] for names in have]
    _require_one_place(setups, references, used)
    return used


def _require_references(setups: Sequence[Sequence[Record]], references: Sequence[str], have: list[list[str]]) -> None:
    for name in references:
        for i, (records, names) in enumerate(zip(setups, have, strict=True)):
            if name not in names:
                shared = [n for n in have[0] if all(n in others for others in have)]
                told = f"all have {', '.join(shared)}" if shared else "no output is in all set-ups"
                raise UsageError(
                    f"--references {name}: set-up {i + 1} ({records[0].source}) has no such output, "
                    f"only {', '.join(names) or 'none'}; {told}"
                )
        units = [records[0].unit(name) for records in setups]
        other = next((i for i, unit in enumerate(units) if unit != units[0]), None)
        if other is not None:
            raise DataError(
                f"reference {name!r} is in {units[0] or 'no unit'} in set-up 1 and in {units[other] or 'no unit'} in "
                f"set-up {other + 1} ({setups[other][0].source}); bring it to one unit"
            )


def _require_one_place(setups: Sequence[Sequence[Record]], references: Sequence[str], used: list[list[str]]) -> None:
    """Refuse a sensor that roams under one name: whether it stayed cannot be told, and shapes have one entry a name."""
    counts = Counter(n for names in used for n in names if n not in references)
    for name, count in counts.items():
        if count > 1:
            places = " and ".join(str(i + 1) for i, names in enumerate(used) if name in names)
            remedy = "name it in --references" if count == len(setups) else "leave it out of all but one (role ignore)"
            raise UsageError(
                f"output {name!r} is in set-ups {places} and no reference; if it stayed, {remedy}; if it was moved, "
                "give each place a name of its own, with a roles file for each set-up"
            )
