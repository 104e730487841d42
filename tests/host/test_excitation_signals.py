"""Laws of designed signals: bounds, rates, crests, bands, repeatability, and the wrapper's own computation of them."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from aeolid.errors import UsageError
from aeolid.excitation.quantities import Bound, read_bounds, read_pairs
from aeolid.excitation.sequences import TAPS, rate_limited, register_bits, schroeder_lines, seed_after
from aeolid.excitation.signals import Shape, lines_of, make_signals
from aeolid.excitation.wrapper import unplayable, wrapper_text
from aeolid.models.model_file import Signal

ROOT = Path(__file__).resolve().parents[2]
ROWS, STEP = 3000, 0.1
BOUNDS = (Bound("pitch", "deg", 1.3, 4.0, (0.0, 90.0)), Bound("torque", "kN m", 2.0, demand=(0.0, 60.0)))
SHAPES = (
    Shape("prbs", 3),
    Shape("multisine", 0, 0.3, 1.2, 1 / 60),
    Shape("multisine", 0, 0.3, 1.2, 1 / 300, "random"),
    Shape("filtered", 0, 0.3, 1.2),
)
PARTS = ("excitation", "settings", "settings_channel", "settings_file", "settings_text", "records")
CONFIGURATION = """controller = libdiscon.so
input  = pitch_command   offset 0.15 scale 0.05
output = generator_speed offset 122 scale 5
past = 20
bus = none
"""


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: f"{s.kind}-{s.phases}")
def test_bounds_and_rates_hold_exactly_for_every_seed(shape):
    """From 0 before the first value to 0 at the last one, no digit beyond; the same seed gives the same bits."""
    for seed in (0, 1, 2, 77, 4294967295):
        for part in (1.0, 0.137):
            signals = make_signals(shape, BOUNDS, ROWS, STEP, seed, part)
            assert signals.values.shape == (ROWS, 2) and not signals.values[-1].any()
            for bound, played, column in zip(BOUNDS, signals.played, signals.values.T, strict=True):
                assert abs(column).max() <= played.amplitude <= bound.amplitude * part
                assert abs(column).max() > 0.5 * bound.amplitude * part or played.amplitude < bound.amplitude * part
                assert (abs(np.diff(column, prepend=0.0)) <= bound.rate * STEP).all()
        again = make_signals(shape, BOUNDS, ROWS, STEP, seed, part)
        assert np.array_equal(signals.values, again.values)
    other = make_signals(shape, BOUNDS, ROWS, STEP, 5)
    assert not np.array_equal(other.values, make_signals(shape, BOUNDS, ROWS, STEP, 6).values)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: f"{s.kind}-{s.phases}")
def test_two_inputs_do_not_tell_the_others_tale(shape):
    """At no shift are they alike: below 0.25, where as many independent values of such a band leave some 0.1."""
    a, b = make_signals(shape, BOUNDS, 6000, STEP, 3).values.T
    norm = np.sqrt((a**2).sum() * (b**2).sum())
    alike = [abs(a[k:] @ b[: len(b) - k]) / norm for k in range(50)]
    assert max(alike) < 0.25


def test_crests_are_low():
    """Binary signals 1; Schroeder's phases, and the best of twenty random ones, near 1.7 and below 3 (a sum of cosines
    in phase has √(2 L) = 7 to 23 here)."""
    free = (Bound("u", "", 1.0),)
    crest = [make_signals(s, free, ROWS, STEP, 1).crest[0] for s in SHAPES]
    assert crest[0] < 1.001 and crest[3] < 1.001 and 1.4 < crest[1] < 2.0 and 2.0 < crest[2] < 3.3


def test_a_rate_lowers_a_multisine_and_makes_ramps_of_a_sequence():
    slow = (Bound("u", "", 1.0, 0.5),)
    multisine, prbs = (make_signals(s, slow, ROWS, STEP, 1) for s in (SHAPES[1], Shape("prbs", 60)))
    assert multisine.played[0].amplitude < 0.2  # 2π 1.2 Hz of one line alone would be 7.5 a second
    steps = abs(np.diff(multisine.values[5:-20, 0]))
    assert steps.max() > 0.5 * 0.5 * STEP  # and no more than is needed
    assert prbs.played[0].amplitude == 1.0 and abs(prbs.values).max() == 1.0


def test_the_spectrum_lies_in_the_band():
    """Multisine: nothing beside its lines but the ramps at both ends; filtered: two thirds of its power, the rest is of
    its edges; prbs: sinc², of which 77 % lie below 0.443 of the clock rate."""
    free = (Bound("u", "", 1.0),)
    frequency = np.fft.rfftfreq(ROWS, STEP)
    inside = (frequency > 0.3 - 1e-9) & (frequency < 1.2 + 1e-9)
    power = [abs(np.fft.rfft(make_signals(s, free, ROWS, STEP, 1).values[:, 0])) ** 2 for s in SHAPES]
    share = [p[inside].sum() / p.sum() for p in power]
    assert share[1] > 0.998 and share[2] > 0.998 and share[3] > 0.6
    low = frequency < 0.443 / 0.3
    assert 0.7 < power[0][low].sum() / power[0].sum() < 0.85
    on_lines = np.isin(np.arange(len(frequency)), np.round(lines_of(SHAPES[1], 0, 1) * ROWS * STEP).astype(int))
    assert power[1][~on_lines].sum() < 0.002 * power[1].sum()


@pytest.mark.parametrize("order", list(TAPS))
def test_registers_run_through_every_state(order):
    """One more 1 than 0, autocorrelation −1 over the period: what makes a maximum-length sequence."""
    bits = np.where(register_bits(order, 11), 1.0, -1.0)
    spectrum = abs(np.fft.fft(bits)) ** 2
    assert bits.sum() == 1 and np.allclose(spectrum[1:], len(bits) + 1)
    assert np.array_equal(register_bits(order, seed_after(order, 11, 7)), np.roll(register_bits(order, 11), -7))


def test_a_sum_of_cosines_stays_within_its_peak_between_the_samples():
    lines = schroeder_lines(np.linspace(0.2, 1.0, 33), 9, 100.0)
    fine = np.linspace(0, 40, 40_001)  # a period of the grid of lines
    true = np.cos(2 * np.pi * np.outer(fine, lines.frequency_hz) + lines.phase).sum(axis=1)
    assert abs(true).max() == pytest.approx(lines.peak, rel=0.01)
    steepest = abs(np.gradient(true, fine[1])).max() / lines.peak
    assert steepest <= lines.steepest() < 1.03 * steepest  # 2 % are for what lies between the instants


def test_a_limited_signal_follows_as_fast_as_it_may():
    assert rate_limited(np.array([0.0, 1, 1, 1, -1]), 0.4).tolist() == pytest.approx([0, 0.4, 0.8, 1.0, 0.6])


@pytest.fixture(scope="module")
def player(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wrapper's excitation and the reader of its settings."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    target = tmp_path_factory.mktemp("player") / "design_player"
    sources = [ROOT / "tests/host/design_player.c", *(ROOT / f"port/discon/{part}.c" for part in PARTS)]
    words = [compiler, "-std=gnu99", "-O1", "-ffp-contract=off", f"-I{ROOT / 'port/discon'}", f"-I{ROOT / 'include'}"]
    subprocess.run([*words, *map(str, sources), "-lm", "-o", str(target)], check=True)
    return target


@pytest.mark.parametrize("start", [0.0, 60.0, 123.4])
@pytest.mark.parametrize("shape", [SHAPES[0], SHAPES[1], Shape("prbs", 7)], ids=["prbs", "multisine", "slow"])
def test_the_wrapper_plays_the_same_signal_from_what_is_written(player, tmp_path, shape, start):
    """Its own reader and its own C code, called once a row: every value but for the rounding of units and cosines."""
    signals = make_signals(shape, BOUNDS, ROWS, STEP, 41)
    target = tmp_path / "libaeolid_discon.cfg"
    target.write_text(CONFIGURATION + wrapper_text(signals, BOUNDS, start))
    done = subprocess.run(
        [str(player), str(target), repr(STEP), repr(start), str(ROWS)], capture_output=True, text=True, check=True
    )
    played = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    assert len(played) == ROWS
    np.testing.assert_allclose(np.degrees(played[:, 1]), signals.values[:, 0], atol=1e-8)
    np.testing.assert_allclose(played[:, 2] / 1e3, signals.values[:, 1], atol=1e-8)


def test_what_the_wrapper_cannot_play_is_said():
    filtered = make_signals(SHAPES[3], BOUNDS, ROWS, STEP, 1)
    with pytest.raises(UsageError, match="not a filtered sequence"):
        wrapper_text(filtered, BOUNDS, 0.0)
    assert "Schroeder" in unplayable(make_signals(SHAPES[2], BOUNDS, ROWS, STEP, 1), BOUNDS)
    dense = make_signals(Shape("multisine", 0, 0.3, 1.2, 1 / 300), BOUNDS, ROWS, STEP, 1)
    assert "64 lines" in unplayable(dense, BOUNDS)
    yaw = (Bound("yaw", "deg", 1.0),)
    prbs = make_signals(SHAPES[0], yaw, ROWS, STEP, 1)
    assert "is neither" in unplayable(prbs, yaw)
    open_ended = (Bound("pitch", "deg", 1.0),)
    with pytest.raises(UsageError, match=r"--demand pitch=LOW\.\.HIGH"):
        wrapper_text(make_signals(SHAPES[0], open_ended, ROWS, STEP, 1), open_ended, 0.0)


INPUTS = (Signal("pitch", "deg"), Signal("torque", "kN m"), Signal("speed", "rad/s"))


def test_amounts_are_read_with_their_units():
    bounds = read_bounds(
        INPUTS, {"torque": "2500 N m", "pitch": "0.01rad", "speed": 0.1}, {"pitch": "5 deg/s", "speed": "2rad/s^2"},
        {"pitch": "0..1.5708rad", "torque": (0, 60)},
    )  # fmt: skip
    assert [b.name for b in bounds] == ["pitch", "torque", "speed"]
    assert bounds[0].amplitude == pytest.approx(np.degrees(0.01)) and bounds[0].rate == 5.0
    assert bounds[0].demand == pytest.approx((0, 90), rel=1e-4) and bounds[1].demand == (0, 60)
    assert bounds[1].amplitude == 2.5 and bounds[1].rate == np.inf and bounds[2].rate == 2.0


@pytest.mark.parametrize(
    ("amplitudes", "rates", "said"),
    [
        ({}, {}, "no input has a bound"),
        ({"pitch": "2kW"}, {}, "'kW' is no unit of pitch"),
        ({"pitch": "much"}, {}, "does not begin with a number"),
        ({"pitch": "0deg"}, {}, "is not an amount above 0"),
        ({"pitch": -1.0}, {}, "is not an amount above 0"),
        ({"pitch": float("nan")}, {}, "is beyond"),
        ({"pitch": "1e99"}, {}, "is beyond"),
        ({"flap": 1}, {}, "no such channel"),
        ({"pitch": 1}, {"torque": 1}, "without --bound torque"),
        ({"pitch": 1}, {"pitch": "2deg"}, "is no rate of pitch"),
        ({"pitch": True}, {}, "a number or a text"),
    ],
)
def test_amounts_that_cannot_be_are_refused(amplitudes, rates, said):
    with pytest.raises(UsageError, match=said):
        read_bounds(INPUTS, amplitudes, rates, {})


def test_pairs_are_read_once():
    assert read_pairs("--bound", ["pitch=2deg", "a=b=3"]) == {"pitch": "2deg", "a=b": "3"}
    for wrong in (["pitch"], ["=2"], ["pitch="], ["pitch=1", "pitch=2"]):
        with pytest.raises(UsageError, match="--bound"):
            read_pairs("--bound", wrong)
    for demand in ("0", "9..1", "a..b"):
        with pytest.raises(UsageError, match="--demand"):
            read_bounds(INPUTS, {"pitch": 1}, {}, {"pitch": demand})
