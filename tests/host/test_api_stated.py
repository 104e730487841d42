"""Hold what Python states and asks: modes as the file has them, whole numbers, tables without rows, frequencies."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import aeolid as ae
from aeolid.api.facts import modes_table, stated_modes
from aeolid.identify.frequency import default_frequencies
from aeolid.identify.modal import find_modal
from aeolid.models.modes import Mode
from aeolid.models.multiblade import Whirl
from aeolid.plants.lti import fourth_order


def test_what_a_mode_states_of_whirl_and_folding_is_read_back():
    whirl = Whirl("RootMyb", "backward", -0.9, 0.01, None)
    mode = Mode(1.2, 0.01, 0.9 + 0.2j, 0.01, 0.001, {"y": 1.0}, None, 3.7, "blade edgewise", False, None, whirl)
    for known in (mode, replace(mode, whirl=replace(whirl, blade_hz=0.7)), replace(mode, whirl=None)):
        assert stated_modes({"modes": [known.to_json()]}) == (known,)
    spoilt = mode.to_json() | {"whirl": {"blades": "RootMyb", "direction": 3}, "folded_from_hz": "high"}
    assert stated_modes({"modes": [spoilt]}) == (replace(mode, whirl=None, folded_from_hz=None),)


def recorded():
    random = np.random.default_rng(1)
    u = random.standard_normal(500)
    y = lfilter([0.0, 1.0], [1.0, -0.7], u) + 0.1 * random.standard_normal(500)
    return ae.Record.from_arrays({"u": u, "y": y}, inputs=["u"], outputs=["y"], sample_time=0.1)


@pytest.mark.parametrize("given", [{"decimate": 1.5}, {"future": 5.0}, {"decimate": "2"}, {"bootstrap_seed": True}])
def test_numbers_that_are_not_whole_are_refused_by_name(given):
    with pytest.raises(ae.UsageError, match=rf"{next(iter(given))} .* is not a whole number"):
        ae.identify(recorded(), past=10, **given)


@pytest.mark.parametrize("given", [{"decimate": 1.5}, {"largest_order": 7.5}, {"decimate": "2"}])
def test_modes_refuse_them_too(given):
    with pytest.raises(ae.UsageError, match="is not a whole number"):
        ae.modes(recorded(), **given)


def test_whole_numbers_of_numpy_are_whole():
    assert ae.identify(recorded(), past=10, order=1, decimate=np.int64(1), future=np.int32(5)).order == 1


def test_a_window_that_is_not_whole_is_refused_below_the_interface():
    with pytest.raises(ae.UsageError, match=r"past 5\.5 is not a whole number"):
        find_modal([recorded()], past=5.5)


def test_an_empty_table_has_its_columns():
    frame, full = (modes_table(m).to_frame() for m in ((), [Mode(1.0, 0.1, 0.5j, None, None, {"y": 1.0})]))
    assert list(frame.columns) == list(full.columns) and len(frame["frequency_hz"]) == 0
    assert list(modes_table(())[:0].to_frame().columns) == list(full.columns)


def test_real_poles_have_a_time_constant_and_neither_frequency_nor_damping():
    """A decay of 8 s, a growth, an integrator; beside a mode whose deviations are not known."""
    slow = 1 / (2 * np.pi * 8.0)
    modes = [
        Mode(0.0, 0.0, 1 + 0j, None, None, {"y": 1.0}), Mode(slow, 1.0, 0.9 + 0j, 0.1 * slow, 0.0, {"y": 1.0}),
        Mode(slow, -1.0, 1.1 + 0j, None, None, {"y": 1.0}), Mode(0.3, 0.05, 0.9 + 0.2j, None, None, {"y": 1.0}),
    ]  # fmt: skip
    frame = modes_table(modes).to_frame()
    numbers = [name for name in frame.columns if name.endswith(("_hz", "_s")) or name.startswith("damping")]
    assert all(frame[name].dtype == float for name in numbers) and len(numbers) == 6
    assert frame["frequency_hz"].isna().tolist() == frame["damping"].isna().tolist() == [True, True, True, False]
    np.testing.assert_allclose(frame["time_constant_s"], [np.inf, 8.0, -8.0, np.nan])
    np.testing.assert_allclose(frame["time_constant_std_s"], [np.nan, 0.8, np.nan, np.nan])
    assert "time_constant_s" in modes_table(modes)._repr_html_()


def test_frequencies_of_a_model_of_continuous_time_are_those_of_its_poles():
    """A mode at 3 kHz, a decay of an hour and an integrator: the range ends a decade beyond the first two."""
    base = fourth_order()
    w, slow = 2 * np.pi * 3000.0, 1 / 3600
    A = np.zeros((4, 4))
    A[:2, :2], A[2, 2] = [[0, 1], [-(w**2), -0.02 * w]], -slow
    hertz = default_frequencies(replace(base, A=A, sample_time_s=0.0))
    assert hertz[0] == pytest.approx(slow / (2 * np.pi) / 10) and hertz[-1] == pytest.approx(30_000)
    assert len(default_frequencies(replace(base, A=np.zeros((4, 4)), sample_time_s=0.0))) == 400
    assert default_frequencies(base)[-1] < 0.5 / base.sample_time_s
