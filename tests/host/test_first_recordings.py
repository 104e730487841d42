"""What a first recording may hold: wild values in a channel, minutes for seconds, a wind that no method takes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aeolid import Record as Recording
from aeolid import identify, validate
from aeolid.diagnose.data.case import _context
from aeolid.diagnose.data.folded import folded_of
from aeolid.diagnose.data.forensics import examine
from aeolid.errors import DataError
from aeolid.formats import read_record, write_table
from aeolid.identify.request import Request
from aeolid.identify.run import identify_records
from aeolid.plants import hawt
from aeolid.record import Channel, Record, Roles


def _output(values: np.ndarray) -> Record:
    return Record(0.1 * np.arange(len(values)), values[:, None], (Channel("y", "m", "output"),), 0.1, "a.csv", "")


def _told(values: np.ndarray) -> dict[str, str]:
    return {f.check: f.finding for f in examine([_output(values)])}


def test_wild_values_do_not_stretch_the_range_that_piles_are_sought_in() -> None:
    """A code for "no value" or a single spike makes all the rest neither a pile nor an absolute value."""
    noise = np.random.default_rng(1).standard_normal(2000)
    coded, spiked = noise.copy(), noise.copy()
    coded[100:2000:160], spiked[700] = -9999.0, 5000.0
    assert "a usual code for a missing value" in _told(coded)["code"]
    assert not {"rail", "folded"} & set(_told(coded)) and not {"rail", "folded"} & set(_told(spiked))


def test_an_end_that_noise_blurs_is_told_with_the_true_least_value() -> None:
    rng = np.random.default_rng(2)
    values = np.maximum(np.cumsum(rng.standard_normal(4000)) * 0.1, 0.0) + 0.002 * rng.standard_normal(4000)
    values -= values.min() + 1.0
    said = _told(values)["rail"]
    assert "near the lowest value -1" in said and "sit at the lowest" not in said


def test_negative_samples_are_not_called_never_negative() -> None:
    t = np.arange(4000)
    values = 10 * np.abs(np.sin(0.0101 * t)) - 0.03
    said = folded_of(values)
    assert (values < 0).any() and said is not None and "never negative" not in said and "negative)" in said
    assert (plain := folded_of(np.abs(values))) is not None and plain.startswith("never negative")


def test_minutes_taken_for_seconds_are_told(tmp_path: Path) -> None:
    write_table(tmp_path / "a.csv", {"time": np.arange(50) * 0.1 / 60, "y": np.sin(np.arange(50.0))})
    roles = Roles((Channel("y", "m", "output"),), 0.1, "time", "roles.toml", "s")
    with pytest.raises(DataError, match='set time_unit = "min"'):
        read_record(tmp_path / "a.csv", roles)
    assert read_record(tmp_path / "a.csv", replace(roles, time_unit="min")).sample_time_s == pytest.approx(0.1)


def test_a_recorded_disturbance_that_no_method_takes_is_said() -> None:
    record = hawt.simulate_closed_loop(1500, 2, excitation=hawt.Excitation(noise=0.1))
    wind = np.random.default_rng(4).standard_normal(len(record))
    channels = (*record.channels, Channel("wind_speed", "m/s", "disturbance"))
    record = replace(record, values=np.column_stack([record.values, wind]), channels=channels)
    notes = identify_records([record], Request(method="varx", past="10")).notes
    told = "wind_speed (role disturbance) is not used by varx; give it the role input, or --method ort"
    assert told in notes


def test_a_mistyped_fact_of_the_machine_is_refused() -> None:
    assert _context({"blades": 3, "gearbox_ratio": 97.0}, "case.toml") == {"blades": 3, "gearbox_ratio": 97.0}
    with pytest.raises(
        DataError, match=r"case.toml \[context\]: unknown key 'blade'; did you mean 'blades'\? allowed are blades"
    ):
        _context({"blade": 3}, "case.toml")


def test_no_horizon_is_longer_than_the_recording() -> None:
    record = hawt.simulate_closed_loop(1500, 2, excitation=hawt.Excitation(noise=0.1))
    whole = Recording.of_core(record)
    short = Recording.of_core(record.slice(0, 19))
    told = validate(identify(whole, past=10), short, steps=(5, 10, 50)).to_json()
    assert "50" not in str(sorted(told["k_step"])) and "10" in str(sorted(told["k_step"]))
