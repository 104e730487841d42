"""Check that harmonics of the rotor and other steady sines are told from modes."""

from dataclasses import replace

import numpy as np
import pytest

from aeolid.identify.harmonics import is_tone, steady_share
from aeolid.identify.mode_names import mode_lines
from aeolid.identify.rotor import rotation
from aeolid.identify.varx import identify_varx
from aeolid.models.modes import Mode, mark_harmonics
from aeolid.plants.structure import Harmonics, shaken, shear_building
from aeolid.record import Channel, Record

STEP = 0.1
LINES = Harmonics(0.31, (1, 3, 6), (0.6, 0.6, 0.3))
HERTZ = shear_building().modes()[0]


def listed(result):
    return [m for m in result.modes if not m.is_real and not m.rotor_order and not m.tone and m.damping < 0.1]


@pytest.mark.parametrize("uneven", [0.0, 0.004])
def test_with_the_azimuth_lines_on_multiples_are_harmonics_and_no_modes(uneven):
    record = shaken(shear_building(), 8000, STEP, 1, harmonics=replace(LINES, uneven=uneven))
    result = identify_varx([record], past=25, order=14)
    assert {1, 3, 6} <= {m.rotor_order for m in result.modes}
    assert [m.frequency_hz for m in listed(result)] == pytest.approx(list(HERTZ), rel=0.02)


def test_without_it_they_are_steady_sines_and_the_modes_are_not():
    record = shaken(shear_building(), 8000, STEP, 1, harmonics=LINES, azimuth=False)
    result = identify_varx([record], past=25, order=14)
    tones = [m for m in result.modes if m.tone]
    assert [m.frequency_hz / 0.31 for m in tones] == pytest.approx([1, 3, 6], rel=1e-3)
    assert [m.frequency_hz for m in listed(result)] == pytest.approx(list(HERTZ), rel=0.02)
    assert "poles whose damping cannot be told from zero" in "\n".join(mode_lines(result.modes, STEP))
    assert [m.to_json()["tone"] for m in result.modes] == [m.tone for m in result.modes]


def test_the_share_of_a_sine_is_one_of_a_pure_one_and_little_of_noise():
    t, random = np.arange(3000), np.random.default_rng(0)
    sine = np.cos(2 * np.pi * 0.0371234 * t + 1.0)
    assert steady_share(sine, 0.0371, 1e-4) > 0.9999
    assert steady_share(3 + 7 * sine, 0.0371, 1e-4) > 0.9999  # free of offset and size
    shares = [steady_share(random.standard_normal(3000), f, 0.0) for f in np.linspace(0.05, 0.45, 20)]
    assert max(shares) < 0.8


def test_a_mode_of_a_twentieth_of_a_percent_that_noise_drives_is_none_of_them():
    """Its amplitude wanders within the recording: 30 cycles a decay time of 6000 samples' tenth."""
    random, pole = np.random.default_rng(4), np.exp((-0.005 + 1j) * 0.3)
    from scipy.signal import lfilter

    y = lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], random.standard_normal((10, 7000)))[:, 1000:]
    assert sum(steady_share(row, 0.3 / (2 * np.pi), 0.0) > 0.8 for row in y) <= 1


def mode(frequency, damping, damping_std=0.001, frequency_std=0.0005):
    s = 2 * np.pi * frequency * (-damping + 1j)
    return Mode(frequency, damping, complex(np.exp(s * STEP)), frequency_std, damping_std, {"y": 1.0})


def test_a_damped_mode_on_a_multiple_that_is_none_of_the_blades_stays_a_mode():
    steady = mark_harmonics([mode(0.8, 0.02), mode(0.8, 0.0005), mode(0.6, 0.02), mode(0.66, 0.0)], 0.2, 0.0, 600.0)
    assert [m.rotor_order for m in steady] == [None, 4, 3, None]
    uneven = mark_harmonics([mode(0.81, 0.012)], 0.2, 0.003, 600.0)  # a speed that varies widens a line
    assert uneven[0].rotor_order == 4
    unknown = mark_harmonics([mode(0.8, 0.02, None, None)], 0.2)
    assert unknown[0].rotor_order == 4


def test_what_a_recording_cannot_resolve_may_vanish():
    assert mode(0.5, 0.001, 0.0).vanishes(300.0) and not mode(0.5, 0.001, 0.0).vanishes(1000.0)
    assert not mode(0.5, 0.001, None).vanishes(1.0)
    assert mode(0.5, 0.01, 0.0).vanishes(np.inf, 0.006) and not mode(0.5, 0.01, 0.0).vanishes(np.inf, 0.004)


def test_a_rotor_speed_says_what_the_azimuth_says():
    t = np.arange(6000) * 0.05
    speed = 0.2 * (1 + 0.01 * np.sin(2 * np.pi * t / 60))
    angle = np.mod(np.cumsum(360 * speed * 0.05), 360)
    both = {}
    for name, unit, role, values in (
        ("azimuth", "deg", "azimuth", angle), ("rotor_speed", "rpm", "output", 60 * speed),
        ("rotor_speed", "rad/s", "scheduling", 2 * np.pi * speed),
    ):  # fmt: skip
        both[unit] = rotation(Record(t, values[:, None], (Channel(name, unit, role),), 0.05, "", ""))
    for unit in ("deg", "rpm", "rad/s"):
        assert both[unit].frequency_hz == pytest.approx(0.2, rel=1e-3)
        assert both[unit].deviation_hz == pytest.approx(0.2 * 0.01 / np.sqrt(2), rel=0.03)
    other = Record(t, speed[:, None], (Channel("rotor_speed", "V", "output"),), 0.05, "", "")
    assert rotation(other) is None


def test_a_mode_without_deviations_is_never_a_steady_sine():
    record = shaken(shear_building(), 1000, STEP, 1)
    assert not is_tone(mode(0.45, 0.0, None), [record])


def test_a_line_that_a_mode_drowns_in_one_output_is_known_by_another():
    """The output that a pole moves most need not be the one in which it is plain: 9P beside a shaft's mode.

    Noise in the band takes half of the power of one output and a hundredth of that of the other.
    """
    t = np.arange(6000) * STEP
    line, noise = np.sin(2 * np.pi * 1.8 * t), np.random.default_rng(1).standard_normal((len(t), 2))
    values = np.column_stack([line + 0.5 * noise[:, 0], 1.5 * line + 15 * noise[:, 1]])
    record = Record(t, values, (Channel("plain", "m", "output"), Channel("drowned", "m", "output")), STEP, "", "")
    pole = replace(mode(1.8, 0.0001, 0.0005), shares={"plain": 0.4, "drowned": 0.6})
    assert is_tone(pole, [record])
    assert not is_tone(replace(pole, shares={"drowned": 1.0}), [record])
    assert not is_tone(replace(pole, shares={"plain": 0.2, "drowned": 0.8}), [record])  # hardly moved by it
