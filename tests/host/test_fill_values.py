"""Fill values such as −9999 count as missing samples in every command that estimates or runs a model, and are told."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rotor_rig import rotor

import aeolid as ae
from aeolid.cli.common import extent
from aeolid.cli.main import main
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.forensics import examine
from aeolid.diagnose.data.masking import masked_case
from aeolid.diagnose.rules import DecisionRules
from aeolid.errors import DataError
from aeolid.fleet.campbell import find_campbell
from aeolid.formats import Table, write_table
from aeolid.formats.rates import series_of
from aeolid.identify.free_run import run_free
from aeolid.identify.modal import find_modal
from aeolid.identify.request import Request
from aeolid.identify.run import identify_records
from aeolid.identify.setup_request import find_merged
from aeolid.identify.validation import validate_recording
from aeolid.models.fill_values import FILL_VALUES, SPREADS, fill_values_in, without_fill_values
from aeolid.models.load import LinearModel
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.plants.structure import shaken, shear_building
from aeolid.record import ROLES, Channel, Record

LOST = slice(100, 1500, 97)  # rows, and the channel y1, in which the logger has none
COUNT = len(range(*LOST.indices(1500)))


def lost(record: Record, value: float, column: int = 2, rows: slice = LOST) -> Record:
    """Return a recording with a value in some rows of a channel."""
    values = record.values.copy()
    values[rows, column] = value
    return replace(record, values=values)


@cache
def driven() -> Record:
    return simulate_fourth_order(1500, 4)


@cache
def unforced() -> Record:
    return shaken(shear_building(), 3000, 0.1, 3)


def told(notes: Any, name: str, value: str, count: int) -> bool:
    """Tell whether one sentence names channel, value and count."""
    return sum(f"{count} samples of {name} read {value}," in note for note in notes) == 1


@pytest.mark.parametrize("value", FILL_VALUES)
def test_what_is_far_off_and_a_usual_fill_value_is_missing_and_nothing_else_is(value: float) -> None:
    record = lost(driven(), value)
    (known,), notes = without_fill_values([record])
    np.testing.assert_array_equal(known.values, lost(driven(), np.nan).values)
    assert told(notes, "y1", f"{value:g}", COUNT)
    (same,), notes = without_fill_values([driven()])
    assert same is driven() and notes == ()


def test_a_value_that_the_channel_reaches_is_no_fill_value() -> None:
    ramp = np.linspace(-20_000.0, 20_000.0, 401)  # passes -10,000, and every code of a size below once or never
    assert not fill_values_in(np.round(np.append(ramp, [-9999.0, 999.0]))).any()
    switched = np.where(np.arange(100) % 10 == 0, 999.0, 0.0)  # a set point of two levels
    assert not fill_values_in(switched).any()


def test_the_distance_is_that_by_which_a_diagnosis_decides() -> None:
    assert DecisionRules().data.stray_spreads == SPREADS


@pytest.mark.parametrize("method", ["varx", "varmax"])
def test_identify_takes_them_as_it_takes_missing_samples(method: str) -> None:
    request = Request(past=10, method=method, order="4")
    coded, empty = (identify_records([lost(driven(), v)], request) for v in (-9999.0, np.nan))
    np.testing.assert_array_equal(coded.model.A, empty.model.A)  # type: ignore[union-attr]
    assert told(coded.notes, "y1", "-9999", COUNT) and not any("-9999" in n for n in empty.notes)
    assert told(coded.to_json()["notes"], "y1", "-9999", COUNT) and "read -9999" in coded.summary()


def test_validation_takes_them_as_it_takes_missing_samples() -> None:
    model = LinearModel(fourth_order())
    (coded, _), (empty, _) = (validate_recording(model, lost(driven(), v)) for v in (-9999.0, np.nan))
    assert coded.free_run == empty.free_run
    assert told(coded.notes, "y1", "-9999", COUNT) and empty.notes == ()
    assert told(coded.to_json()["notes"], "y1", "-9999", COUNT) and "read -9999" in coded.summary()


def test_modes_of_outputs_alone_take_them_as_missing_samples() -> None:
    rows = slice(50, 2900, 211)
    coded, empty = (find_modal([lost(unforced(), v, 0, rows)], past=10) for v in (-9999.0, np.nan))
    assert [m.eigenvalue for m in coded.modes] == [m.eigenvalue for m in empty.modes]
    name, count = unforced().channels[0].name, len(range(*rows.indices(3000)))
    assert told(coded.notes, name, "-9999", count) and told(coded.to_json()["notes"], name, "-9999", count)
    assert "read -9999" in coded.summary() and empty.notes == ()
    names = unforced().names("output")
    merged = find_merged([[lost(unforced(), -9999.0, 0, rows)], [unforced()]], names, past=[10, 10])
    assert told(merged.notes, name, "-9999", count)


def test_a_campbell_diagram_takes_them_as_missing_samples() -> None:
    """The wind, too: its mean is where a recording stands."""
    records = [rotor(i + 1, rpm, uneven=0.01, wind=w) for i, (rpm, w) in enumerate(((7.0, 6.0), (12.0, 14.0)))]
    column = next(i for i, c in enumerate(records[0].channels) if "wind" in c.name)
    records[0] = lost(records[0], -9999.0, column, slice(10, 20))
    found = find_campbell(records, blades="auto", past=16, largest=16, decimation=2)
    assert found.runs[0].wind_m_s == pytest.approx(6.0, rel=0.2)
    assert "10 samples of" in found.summary() and len(found.to_json()["runs"][0]["notes"]) == 1


@pytest.mark.parametrize("role", [r for r in ROLES if r != "ignore"])
def test_a_diagnosis_takes_them_as_missing_samples_whatever_the_channel_is_for(role: str) -> None:
    """Whether model or catalogue asks for it; told once, and no fault of the recording."""
    cases = []
    for value in (-9999.0, np.nan):
        record = lost(driven(), value)
        channels = tuple(replace(c, role=role) if c.name == "y1" else c for c in record.channels)
        record = replace(record, channels=channels)
        cases.append(Case("a plant", (record,), "state_space", fourth_order(), "model.json", "", {}, Path()))
    coded, empty = (masked_case(c)[0].records[0].values for c in cases)
    np.testing.assert_array_equal(coded, empty)
    said = [f for f in examine(cases[0].records) if "-9999" in f.finding]
    assert [(f.check, f.severity, f.left_out) for f in said] == [("code", "warning", True)]
    assert f"{COUNT} samples read -9999" in said[0].finding


def test_a_free_run_scores_none_of_them_and_names_one_that_an_input_lacks() -> None:
    model = LinearModel(fourth_order())
    coded, empty = (run_free(model, lost(driven(), v)) for v in (-9999.0, np.nan))
    assert coded.score == empty.score and told(coded.notes, "y1", "-9999", COUNT)
    with pytest.raises(DataError, match="samples of u1 read -9999"):
        run_free(model, lost(driven(), -9999.0, 0))


def test_python_tells_them() -> None:
    record = ae.Record.of_core(lost(driven(), -9999.0))
    model = ae.identify(record, past=10, order=4)
    results = model, ae.validate(model, record), ae.simulate(model, record), ae.modes(record, past=10)
    for result in results:
        assert told(result.notes, "y1", "-9999", COUNT)
        assert "read -9999" in result._repr_html_()


def test_the_commands_tell_them_on_the_screen_and_in_the_facts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = lost(driven(), -9999.0)
    names = [c.name for c in record.channels]
    write_table(tmp_path / "rec.csv", {"time_s": record.time_s} | {n: record.column(n) for n in names}, {"time_s": "s"})
    roles = "".join(f'[[channel]]\nname = "{c.name}"\nunit = "{c.unit}"\nrole = "{c.role}"\n' for c in record.channels)
    (tmp_path / "roles.toml").write_text(roles)
    model, facts = str(tmp_path / "model.json"), tmp_path / "facts.json"
    common = [str(tmp_path / "rec.csv"), "--roles", str(tmp_path / "roles.toml"), "--force", "--json", str(facts)]
    for words, options in (
        (["identify"], ["--past", "10", "--out", model]), (["validate", model], []), (["modes"], ["--past", "10"]),
        (["simulate", model], ["--out", str(tmp_path / "sim.csv")]),
    ):  # fmt: skip
        assert main([*words, *common, *options]) == 0
        assert f"{COUNT} samples of y1 read -9999," in capsys.readouterr().out.replace("\n", " ")
        assert told(json.loads(facts.read_text())["notes"], "y1", "-9999", COUNT)


def test_no_straight_line_leads_to_one(caplog: pytest.LogCaptureFixture) -> None:
    """Where channels are resampled, the samples beside would be drawn towards it."""
    values = np.sin(0.1 * np.arange(100.0))
    values[[20, 60]] = -9999.0
    table = Table("rec.mf4", ("u",), {"u": values})
    found = series_of(table, Channel("u", "V", "input"), 0.1 * np.arange(100.0), values)
    assert len(found.values) == 98 and abs(found.values).max() <= 1
    assert "rec.mf4: 2 samples of u read -9999," in caplog.text


def test_one_of_a_kind_is_told_in_the_singular() -> None:
    record = driven().slice(0, 400)
    (known,), notes = without_fill_values([lost(record, -9999.0, 2, slice(100, 101))])
    assert "1 sample of y1 reads -9999," in notes[0]
    assert extent(known).endswith(", 1 cell missing") and ": 1 sample, " in extent(record.slice(0, 1))
