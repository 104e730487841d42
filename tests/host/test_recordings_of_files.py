"""A recording of several files is told from others by all of them: in records, in a fleet's cache and among twins."""

from __future__ import annotations

import ast
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from test_formats_of_tools import AT, CHANNELS, COUNT, PITCH, SPEED, as_bladed, as_hawc2

import aeolid
from aeolid.diagnose.data.case import load_case
from aeolid.fleet import tasks
from aeolid.fleet.plan import Plan
from aeolid.formats import read_record
from aeolid.formats.recording import recording_sha256
from aeolid.record import Channel, Roles

pytestmark = pytest.mark.usefixtures("forking_throughout")

SPEED_ALONE = Roles(CHANNELS[1:], None, None, "roles.toml")


def as_folder(folder: Path) -> Path:
    (folder / "set").mkdir()
    table = pd.DataFrame({"time_s": AT, "Blade 1 pitch angle": PITCH, "Generator speed": SPEED})
    for number, part in ((1, table[:30]), (2, table[30:])):
        part.to_parquet(folder / "set" / f"part-{number}.parquet", index=False)
    return folder / "set"


SEVERAL: dict[str, tuple[Callable[[Path], Path], tuple[str, ...]]] = {  # how to write it, and its files
    "Bladed": (as_bladed, ("run.$PJ", "run.$04", "run.%04", "run.$08", "run.%08")),
    "Bladed, one result": (lambda f: as_bladed(f).with_suffix(".%04"), ("run.$04", "run.%04")),
    "Bladed, its numbers": (lambda f: as_bladed(f).with_suffix(".$04"), ("run.$04", "run.%04")),
    "HAWC2": (as_hawc2, ("run.sel", "run.dat")),
    "HAWC2 as text": (lambda f: as_hawc2(f, "ASCII"), ("run.sel", "run.dat")),
    "HAWC2, its numbers": (lambda f: as_hawc2(f).with_suffix(".dat"), ("run.sel", "run.dat")),
    "folder": (as_folder, ("set/part-1.parquet", "set/part-2.parquet")),
}


@pytest.mark.parametrize("name", SEVERAL)
def test_every_file_of_a_recording_tells_it_from_others(name: str, tmp_path: Path) -> None:
    """A copy elsewhere is the same one; a change in any of its files, whichever was named, makes another."""
    writer, parts = SEVERAL[name]
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    first, copy = writer(tmp_path / "a"), writer(tmp_path / "b")
    own = recording_sha256(first)
    assert read_record(first, SPEED_ALONE).sha256 == own == recording_sha256(str(copy))
    seen = {own}
    for part in parts:
        path = tmp_path / "b" / part
        before = path.read_bytes()
        path.write_bytes(before[:-1] + b" \n" if before.endswith(b"\n") else before[:-1] + bytes([before[-1] ^ 1]))
        seen.add(recording_sha256(copy))
        path.write_bytes(before)
    assert len(seen) == 1 + len(parts)
    assert recording_sha256(copy) == own


def test_a_fleet_keeps_apart_what_differs_in_the_numbers_alone(tmp_path: Path) -> None:
    """Runs whose lists of channels are equal; a later run under an earlier one's name is no earlier one."""
    rng = np.random.default_rng(1)
    signals = (Channel("u", "rad", "input", "Blade 1 pitch angle"), Channel("y", "rad/s", "output", "Generator speed"))
    plan = Plan(Roles(signals, None, None, "roles.toml"), 2, 1, (), None, None)
    tasks.prepare_cache(tmp_path / "cache")
    done = []
    for name in ("a", "b", "a"):
        (tmp_path / name).mkdir(exist_ok=True)
        path = as_hawc2(tmp_path / name, "ASCII")
        np.savetxt(path.with_suffix(".dat"), np.column_stack([AT, rng.standard_normal((COUNT, 2))]))
        done.append(tasks.compress_file(str(path), plan, str(tmp_path / "cache")))
    assert [d.reason for d in done] == [None] * 3 and not any(d.reused for d in done)
    assert len({d.sha256 for d in done}) == len({d.factor for d in done}) == 3
    assert tasks.compress_file(str(path), plan, str(tmp_path / "cache")).reused


def test_a_run_of_several_files_is_a_baseline(tmp_path: Path) -> None:
    """Its sum is that of all its files, also where it is a folder."""
    run, recording = as_folder(tmp_path), as_hawc2(tmp_path)
    (tmp_path / "roles.toml").write_text(
        "".join(f'[[channel]]\nname = "{c.name}"\ncolumn = "{c.column}"\nunit = "{c.unit}"\nrole = "{c.role}"\n'
                for c in CHANNELS)
    )  # fmt: skip
    (tmp_path / "case.toml").write_text(
        f'[recordings]\nfiles = ["{recording.name}"]\nroles = "roles.toml"\n'
        f'[baseline]\nkind = "run"\nfile = "{run.name}"\n'
    )
    assert load_case(tmp_path).baseline_sha256 == recording_sha256(run)


def test_the_sum_of_one_file_is_taken_of_recordings_in_one_place() -> None:
    """Elsewhere it is that of models, structures and units, which are one file each."""
    home = Path(aeolid.__file__).parent
    users = {
        path.relative_to(home).as_posix() for path in home.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "file_sha256"
    }  # fmt: skip
    assert users == {"formats/recording.py", "diagnose/data/case.py", "cli/identify_structure.py"}
