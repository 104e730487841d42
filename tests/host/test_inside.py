"""Nothing outside a case's folder is read, whatever lies beside the file that the case names."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from aeolid.diagnose.data.inside import resolve
from aeolid.errors import DataError

NAMED = {
    "run.dat": "run.sel", "run.sel": "run.dat", "run.$04": "run.%04", "run.%04": "run.$04", "run.$PJ": "run.%08",
    "parts": "parts/b.parquet",
}  # fmt: skip


def case(folder: Path, name: str, companion: str) -> Path:
    """Make a folder with a recording of which one file is a link to one beside the folder."""
    inside = folder / "case"
    (inside / "parts").mkdir(parents=True)
    for file in ("run.sel", "run.dat", "run.%04", "run.$04", "run.%08", "run.$08", "run.$PJ", "parts/a.parquet"):
        (inside / file).write_text("inside")
    (folder / "secret").write_text("outside")
    (inside / companion).unlink(missing_ok=True)
    os.symlink(folder / "secret", inside / companion)
    return inside


@pytest.mark.parametrize("name", NAMED)
def test_a_file_beside_the_named_one_leads_nowhere_else(tmp_path: Path, name: str) -> None:
    folder = case(tmp_path, name, NAMED[name])
    told = Path(NAMED[name]).name.replace("$", r"\$")
    with pytest.raises(DataError, match=rf"'{told}' is a link that leads out of the case's folder"):
        resolve(folder, name, "case.toml")
    assert resolve(folder, name, "case.toml", allow_outside=True) == folder / name


@pytest.mark.parametrize("name", NAMED)
def test_a_link_within_the_folder_is_followed(tmp_path: Path, name: str) -> None:
    folder = case(tmp_path, name, NAMED[name])
    (folder / "kept").write_text("inside")
    (folder / NAMED[name]).unlink()
    os.symlink(folder / "kept", folder / NAMED[name])
    assert resolve(folder, name, "case.toml") == folder / name


@pytest.mark.parametrize("name", NAMED)
def test_no_output_replaces_a_file_that_is_read_with_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    noted: list[Path] = []
    monkeypatch.setattr("aeolid.diagnose.data.inside.note_input", noted.append)
    folder = case(tmp_path, name, NAMED[name])
    resolve(folder, name, "case.toml", allow_outside=True)
    assert {folder / name, folder / NAMED[name]} <= set(noted)
