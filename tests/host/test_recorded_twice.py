"""One recording given twice is no second one: what is sealed of it would have been fitted."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from small_cases import swinging

from aeolid.diagnose.data.case import load_case
from aeolid.errors import DataError
from aeolid.formats import read_table, write_table
from aeolid.identify.request import Request
from aeolid.identify.run import identify_records
from aeolid.record import Channel, Record


def _noise(source: str, seed: int) -> Record:
    values = np.random.default_rng(seed).standard_normal((400, 2))
    values[7, 1] = np.nan
    channels = (Channel("u", "", "input"), Channel("y", "", "output"))
    return Record(0.1 * np.arange(400.0), values, channels, 0.1, source, "")


@pytest.mark.parametrize("name", ["recording.csv", "copy.csv", "copy.parquet"])
def test_a_case_refuses_the_same_recording_twice(tmp_path: Path, name: str) -> None:
    """Also a copy, and the same samples in another format."""
    folder = swinging(tmp_path)
    if name == "copy.csv":
        shutil.copy(folder / "recording.csv", folder / name)
    if name == "copy.parquet":
        write_table(folder / name, read_table(folder / "recording.csv").columns)
    text = (folder / "case.toml").read_text()
    (folder / "case.toml").write_text(text.replace('"recording.csv"', f'"recording.csv", "{name}"'))
    with pytest.raises(DataError, match=rf"{name}: the same samples as in \S*recording\.csv; leave one of them out"):
        load_case(folder)


def test_an_identification_refuses_the_same_recording_twice() -> None:
    first, other = _noise("first.csv", 1), _noise("other.csv", 2)
    with pytest.raises(DataError, match="copy.csv: the same samples as in first.csv".replace(".", r"\.")):
        identify_records([first, other, _noise("copy.csv", 1)], Request(past="5"))
    half = first.slice(0, 200), first.slice(200, 400)
    assert identify_records([*half, other], Request(past="5")).model.inputs[0].name == "u"
