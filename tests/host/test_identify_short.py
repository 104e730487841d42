"""Hold sets of short recordings: what they are too short for is said, and one takes nothing from long ones."""

from dataclasses import replace

import numpy as np
import pytest

from aeolid.identify.choices import Choices, with_choices_made
from aeolid.identify.choose_past import longest_past
from aeolid.identify.contrast import MEMORY, STARTS
from aeolid.identify.missing import complete
from aeolid.identify.modal import find_modal
from aeolid.identify.refine import Descent, Stretch, run_model
from aeolid.identify.request import Request
from aeolid.identify.run import identify_records
from aeolid.identify.sensitivity import Coordinates
from aeolid.identify.spikes import remove_spikes
from aeolid.identify.subspace import ScaledModel
from aeolid.identify.truncation import WindowCheck
from aeolid.models.recursion import run_states
from aeolid.record import Channel, Record

STEP = 0.1  # s
SIGMA = 0.3  # of the innovations


def turning(hertz, damping):
    """Return a mode's block of A."""
    w = 2 * np.pi * hertz * STEP
    return np.exp(-damping * w) * np.array([[np.cos(w), np.sin(w)], [-np.sin(w), np.cos(w)]])


def two_modes():
    """Return an innovation form whose predictor remembers seventy samples, 0.3 Hz at 5 % beside 2.2 Hz."""
    A = np.zeros((4, 4))
    A[:2, :2], A[2:, 2:] = turning(0.3, 0.05), turning(2.228, 0.0218)
    B, C = np.array([[0.3, 0.2, 0.3, -0.2]]).T, np.array([[0.7, 0.2, 0.6, 0.1]])
    return ScaledModel(A, B, C, np.zeros((1, 1)), np.array([[0.1, 0.05, 0.1, 0.1]]).T, np.eye(1) * SIGMA**2, "drawn")


def drawn(model, samples, random):
    """Return u and y (N, 1) of an innovation form from a random first state."""
    u, e = random.standard_normal((samples, 1)), SIGMA * random.standard_normal((samples, 1))
    x = run_states(model.A, u @ model.B.T + e @ model.K.T, random.standard_normal(len(model.A)))[:-1]
    return u, x @ model.C.T + e


def record_of(model, samples, random):
    channels = (Channel("u", "", "input"), Channel("y", "", "output"))
    return Record(STEP * np.arange(samples), np.hstack(drawn(model, samples, random)), channels, STEP, "drawn", "0")


def test_recordings_shorter_than_the_memory_of_the_noise_confirm_no_window():
    """25 samples hold a third of the predictor's memory: steps end at the longest that they show, far from the mode."""
    random, model = np.random.default_rng(0), two_modes()
    records = [record_of(model, 25, random) for _ in range(240)]
    found = identify_records(records, Request(order=4, feedthrough="none", detrend="none"))
    assert found.extra["contrast"]["limited"] == MEMORY and found.extra["window"]["holds"] is None
    assert found.extra["bands_hold"] is False and MEMORY in found.extra["bands_reason"]


def test_first_states_of_many_stretches_leave_too_little_to_confirm_a_window():
    """A predictor that forgets within five samples, one in twelve numbers spent on first states."""
    random = np.random.default_rng(1)
    A, C = turning(1.0, 0.1), np.array([[1.0, 0.3]])
    K = np.array([[1.2, -0.2]]).T
    model = ScaledModel(A, np.array([[0.3, 0.2]]).T, C, np.zeros((1, 1)), K, np.eye(1) * SIGMA**2, "drawn")
    assert abs(np.linalg.eigvals(A - K @ C)).max() < 0.8 and STARTS < 2 / 24
    records = [record_of(model, 24, random) for _ in range(260)]
    found = identify_records(records, Request(order=2, feedthrough="none", detrend="none"))
    assert "first states" in found.extra["contrast"]["limited"]
    check = WindowCheck(None, 4, 3, None, 0.0, "whether it is long enough cannot be said")
    for limited, holds in ((found.extra["contrast"]["limited"], False), (None, True)):
        facts = {"contrast": {"taken": True, "ended": True, "reason": None, "limited": limited}}
        told = with_choices_made(replace(found, extra=facts), Choices(4, (), check=check))
        assert told.extra["bands_hold"] is holds


def test_deviations_know_what_first_states_have_taken_of_the_errors():
    """Four first states to 25 errors: those of the fit have 84 % of the noise's power, deviations go by all of it."""
    random, model, through = np.random.default_rng(2), two_modes(), (False,)
    stretches = [Stretch(*drawn(model, 25, random), 17) for _ in range(240)]
    descent, run = Descent(stretches, through, False), run_model(model, stretches, np.eye(1))
    at = Coordinates.at(model, through)
    R = descent.information(model, run, np.eye(1) / SIGMA, at)[:-1, :-1]
    expected = at.basis @ np.linalg.inv(R.T @ R) @ at.basis.T
    root = descent.result([model, model], None, "").root
    ratio = np.sum(root**2) / np.trace(expected)
    chance = 4 * np.sqrt(2 / (240 * 21))
    assert abs(ratio - 1) < chance


@pytest.mark.parametrize("short", [12, 40])
def test_one_short_recording_takes_no_window_from_a_long_one(short):
    random, model = np.random.default_rng(3), two_modes()
    long, brief = record_of(model, 6000, random), record_of(model, short, random)
    assert longest_past([long, brief], 2) == longest_past([long], 2)
    alone, both = (identify_records(r, Request(feedthrough="none")) for r in ([long], [long, brief]))
    assert both.settings.past == alone.settings.past and len(both.modes) == len(alone.modes)
    assert any("1 of 2 recordings" in n for n in both.notes) == (both.settings.past >= short)
    assert find_modal([long, brief]).diagram.windows == find_modal([long]).diagram.windows


def test_one_long_recording_takes_no_samples_from_many_short_ones():
    """A window that only the one in five samples of the long recording can fill is not tried."""
    random, model = np.random.default_rng(4), two_modes()
    many = [record_of(model, 40, random) for _ in range(100)]
    assert longest_past([*many, record_of(model, 1000, random)], 2) == longest_past(many, 2) == 10


@pytest.mark.parametrize("samples", [2, 3, 15, 20])
def test_recordings_as_short_as_the_order_that_spikes_are_looked_for_with_are_taken(samples):
    random, model = np.random.default_rng(5), two_modes()
    records = [record_of(model, samples, random) for _ in range(150)]
    spoilt = records[7].values.copy()
    spoilt[samples // 2, 1] += 500.0
    cleaned = remove_spikes([*records[:7], replace(records[7], values=spoilt), *records[8:]], 20)
    assert cleaned.cells == (samples > 3)  # of three none has a sample told by others before and after it
    assert remove_spikes(records, 20).cells == 0


def test_missing_cells_of_short_recordings_are_drawn_by_an_autoregression_that_has_windows():
    """Of order 20 only one of 151 recordings has windows, fewer than there are coefficients: it would fit chance."""
    random, model = np.random.default_rng(6), two_modes()
    records = [*(record_of(model, 16, random) for _ in range(150)), record_of(model, 40, random)]
    spoilt = []
    for record in records:
        values = record.values.copy()
        values[2::5, 1] = np.nan
        spoilt.append(replace(record, values=values))
    done = complete(spoilt, 20)
    off = np.concatenate([d.values[2::5, 1] - r.values[2::5, 1] for d, r in zip(done.records, records, strict=True)])
    assert off.std() < 0.7 * np.vstack([r.values for r in records])[:, 1].std()
