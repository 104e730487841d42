"""Merge the modes of set-ups: `aeolid modes SETUP... --references CH1,CH2`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from aeolid.cli.common import console, emit_json, extent, load_roles, waiting
from aeolid.cli.pictures import write_picture
from aeolid.errors import UsageError

if TYPE_CHECKING:
    from aeolid.api.setups import MergedModes
    from aeolid.record import Record


def read_merged(
    recordings: Sequence[Path], roles: Sequence[Path], references: Sequence[str], resample: str | None,
    blades: Sequence[str] | None, *, outputs: list[str] | None, past: str, largest: int | None, decimate: int,
    reference: str | None, by: str, quiet: bool,
) -> MergedModes:  # fmt: skip
    """Read one recording a set-up and merge their modes; roles: one of all, or one a set-up in the same order.

    Raises UsageError where there are as many roles as neither, and on options that do not go together. quiet: print
    nothing.
    """
    from aeolid.api.setups import merge_setups

    if blades:
        raise UsageError("--blades does not go with --references: sets of blade channels are not brought together yet")
    names = [name.strip() for text in references for name in text.split(",")]
    if not all(names):
        raise UsageError(f"--references {','.join(references)!r} names a channel of no letters; write CH1,CH2")
    with waiting("reading"):
        records = _records(recordings, roles, resample)
    if not quiet:
        for record in records:
            console.print(extent(record), markup=False, soft_wrap=True)
    with waiting("finding the modes of each set-up"):
        return merge_setups(
            records, names, outputs=outputs, past=past, largest_order=largest, decimate=decimate, reference=reference,
            by=by,
        )  # fmt: skip


def _records(recordings: Sequence[Path], roles: Sequence[Path], resample: str | None) -> list[Record]:
    from aeolid.formats import read_record
    from aeolid.formats.partly import read_setups

    layouts = [load_roles(path, resample) for path in roles]
    if len(layouts) == 1:
        return read_setups(recordings, layouts[0])
    if len(layouts) != len(recordings):
        raise UsageError(
            f"{len(layouts)} --roles for {len(recordings)} set-ups; give one that names all sensors, or one a "
            "set-up in the order of the recordings"
        )
    return [read_record(path, layout) for path, layout in zip(recordings, layouts, strict=True)]


def show_merged(merged: MergedModes, report: Path | None, picture: Path | None, json_target: str | None) -> None:
    """Print the merged modes and write what is asked for."""
    facts = merged.to_json()
    if json_target != "-":
        console.print(merged.summary(), markup=False, soft_wrap=True)
    if report is not None:
        merged.report(report)
    if picture is not None:
        from aeolid.api.frames import draw_below, height_of
        from aeolid.api.pictures import draw_setups

        count = len(facts["setups"])
        write_picture(
            picture, (10.6, 3.4 * count + height_of(facts)),
            lambda figure: draw_below(
                facts, figure, lambda upper: draw_setups(facts, upper.subplots(count, squeeze=False))
            ),
        )  # fmt: skip
    emit_json(facts, json_target)
