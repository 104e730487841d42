"""What a page shows of both sides of a pair: means over the rotor's turn are those of the signals."""

from __future__ import annotations

import numpy as np

from aeolid.diagnose.run_prior.modal import Modal
from aeolid.diagnose.run_prior.pair import Pair, Side
from aeolid.diagnose.run_prior.shown import series_of, sides_of, turning_mean

STEP, SPEED = 0.05, 1.27


def side(samples: int, amplitude: float, seed: int, azimuth: bool = True, gap: bool = False) -> Side:
    rng = np.random.default_rng(seed)
    angle = SPEED * STEP * np.arange(samples) + 0.3
    y = 3.0 + amplitude * np.cos(angle - 0.5) + 0.1 * rng.standard_normal(samples)
    missing = np.zeros(samples, dtype=bool)
    if gap:
        missing[100:300] = True
        y[100:300] = 1e6  # what stands in for missing samples must not count
    return Side(rng.standard_normal((samples, 1)), y[:, None], np.mod(angle, 2 * np.pi) if azimuth else None, missing,
                STEP, "a.csv")  # fmt: skip


def test_what_turns_with_the_rotor_is_found_at_its_angle() -> None:
    """A mean over 10 degrees of a wave is the wave at the middle, times sin(x)/x of 5 degrees: 0.9987."""
    found = turning_mean([side(6000, 2.0, 1, gap=True), side(4000, 2.0, 2)])
    assert found is not None and found.shape == (36, 1)
    middle = np.radians(10.0 * np.arange(36) + 5.0)
    np.testing.assert_allclose(found[:, 0], 2.0 * np.cos(middle - 0.5), atol=0.05)  # 260 samples a bin: 0.1/16
    assert abs(found.mean()) < 1e-12


def test_nothing_is_said_without_an_angle_or_of_half_a_turn() -> None:
    assert turning_mean([side(500, 1.0, 1, azimuth=False)]) is None and turning_mean([]) is None
    assert turning_mean([side(40, 1.0, 1)]) is None  # 40 samples of 3.6 degrees


def test_both_sides_are_written_by_output_with_units() -> None:
    recorded, simulated = side(6000, 2.0, 1), side(6000, 0.0, 2)
    one = np.ones(2)
    pair = Pair(("pitch",), ("tower",), ("tower",), (recorded,), (simulated,), STEP, 2, 10, (), one[None] * 0, one)
    band = {"frequency_hz": [0.1], "pairs": []}
    facts = sides_of(pair, Modal((), (), (), (band, band)), {"tower": "m/s^2", "pitch": "deg"})
    assert facts["modes"] == {"recorded": [], "simulated": []}
    assert facts["responses"] == {"recorded": band, "simulated": band, "units": {"tower": "m/s^2", "pitch": "deg"}}
    turn = facts["turning"]["tower"]
    assert turn["unit"] == "m/s^2" and np.ptp(turn["recorded"]) > 3.5 > 0.2 > np.ptp(turn["simulated"])
    alone = sides_of(pair, Modal((), (), ()), {})
    assert "responses" not in alone


def test_series_of_a_set_of_blades_have_the_unit_of_the_blades() -> None:
    """Blades stand between other outputs; their parts come behind all others."""
    outputs, zero = ("flap_1", "speed", "flap_2", "flap_3"), np.zeros((1, 7))
    shown = ("speed", "flap_collective", "flap_cosine", "flap_sine")
    one = side(100, 1.0, 1)
    pair = Pair(("pitch",), outputs, shown, (one,), (one,), STEP, 2, 10, ((0, 2, 3),), zero, zero[0])
    units = {"speed": "rpm", "flap_1": "kN m", "flap_2": "kN m", "flap_3": "kN m"}
    found = series_of(pair, {n: {"measured": [1.0]} for n in shown}, units)
    assert [found[n]["unit"] for n in shown] == ["rpm", "kN m", "kN m", "kN m"]
    assert found["flap_sine"]["measured"] == [1.0] and series_of(pair, {}, units) == {}
