"""A run with headings, sample time and channels of its own is brought to the recordings', or refused in a sentence."""

from __future__ import annotations

import numpy as np
import pytest

from aeolid.diagnose.data.match import matched
from aeolid.errors import DataError
from aeolid.record import Channel, Record


def record(step: float, *channels: Channel, samples: int = 101) -> Record:
    values = np.arange(samples)[:, None] * step + np.arange(len(channels))
    return Record(step * np.arange(samples), values, channels, step, "file", "")


PITCH, SPEED, SWAY = Channel("pitch", "deg", "input"), Channel("speed", "rpm", "output"), Channel("sway", "m", "output")
AZIMUTH = Channel("azimuth", "deg", "azimuth")


def test_channels_of_both_sides_in_one_order_at_the_longer_step() -> None:
    run = record(
        0.05, Channel("speed", "rpm", "output", "GenSpeed"), Channel("pitch", "deg", "input", "BlPitchC1"), SWAY
    )
    (logged,), (simulated,) = matched([record(0.1, PITCH, SPEED, AZIMUTH)], [run])
    assert (
        logged.names("input", "output", "azimuth")
        == simulated.names("input", "output", "azimuth")
        == ("pitch", "speed")
    )
    assert logged.sample_time_s == simulated.sample_time_s == 0.1
    np.testing.assert_allclose(simulated.column("speed"), 0.1 * np.arange(51))  # picked, not averaged
    np.testing.assert_allclose(np.diff(simulated.time_s), 0.1)


def test_a_recording_that_is_finer_than_the_run_is_thinned() -> None:
    (logged,), (simulated,) = matched([record(0.05, PITCH, SPEED)], [record(0.2, PITCH, SPEED)])
    assert (len(logged), logged.sample_time_s, len(simulated)) == (26, 0.2, 101)


@pytest.mark.parametrize(
    ("run", "words"),
    [
        (record(0.1, SPEED), "'pitch'"),
        (record(0.1, PITCH, SWAY), "no output"),
        (record(0.07, PITCH, SPEED), "resample"),
    ],
)
def test_what_does_not_match_is_one_sentence(run: Record, words: str) -> None:
    with pytest.raises(DataError, match=words):
        matched([record(0.1, PITCH, SPEED)], [run])
