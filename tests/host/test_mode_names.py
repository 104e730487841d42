"""Modes bear the names engineers give them, real poles are time constants, and a poor free run says why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aeolid.api.diagnosis import Effect
from aeolid.fleet import campbell
from aeolid.identify.fit import measure_fit
from aeolid.identify.free_run_reason import disturbance_variance, free_run_reason
from aeolid.identify.mode_names import mode_lines, named
from aeolid.models.modes import Mode, mark_harmonics, modes_of
from aeolid.models.state_space import Signal, StateSpace
from aeolid.record import Channel, Record
from aeolid.report.identification import render_identification
from aeolid.report.numbers import with_std

STEP = 0.1
OUTPUTS = ("generator_speed", "tower_acc_fore_aft", "tower_acc_side_side", "flap_moment_1")


def mode(frequency: float, damping: float, output: str, share: float = 0.8) -> Mode:
    rest = (1 - share) / (len(OUTPUTS) - 1)
    shares = {o: share if o == output else rest for o in OUTPUTS}
    s = 2 * np.pi * frequency * complex(-damping, np.sqrt(max(1 - damping**2, 0.0)))
    return Mode(frequency, damping, complex(np.exp(s * STEP)), None, None, shares)


def test_modes_are_called_after_what_they_move() -> None:
    modes = [
        mode(0.08, 0.3, "generator_speed"), mode(0.201, 0.01, "flap_moment_1"), mode(0.33, 0.05, "tower_acc_fore_aft"),
        mode(0.34, 0.01, "tower_acc_side_side"), mode(0.9, 0.7, "flap_moment_1"), mode(1.1, 0.05, "flap_moment_1"),
        mode(1.7, 0.01, "generator_speed"), mode(2.9, 0.02, "tower_acc_fore_aft"),
    ]  # fmt: skip
    found = named(mark_harmonics(modes, 0.2), 0.2)
    assert [m.name for m in found] == [
        "rotor speed", "1P", "tower fore-aft", "tower side-side", "", "blade flapwise", "drive train",
        "2nd tower fore-aft",
    ]  # fmt: skip


def test_a_third_of_a_kind_has_no_name() -> None:
    """Of three, which is the tower's second cannot be told: the first alone is named."""
    found = named([mode(f, 0.02, "tower_acc_side_side") for f in (0.3, 0.9, 2.1)], None)
    assert [m.name for m in found] == ["tower side-side", "", ""]


def test_a_pole_of_the_noise_beside_a_mode_does_not_bear_its_name() -> None:
    """The better known of two poles within a half is the structure's; of two that are known alike, the slower."""
    beside, tower, above = (mode(f, z, "tower_acc_fore_aft") for f, z in ((0.337, 0.09), (0.399, 0.02), (2.9, 0.02)))
    sure = replace(tower, frequency_std_hz=0.001, damping_std=0.002)
    loose = replace(beside, frequency_std_hz=0.01, damping_std=0.03)
    alike = replace(beside, frequency_std_hz=0.001, damping_std=0.03)
    assert [m.name for m in named([loose, sure, above], None)] == ["", "tower fore-aft", "2nd tower fore-aft"]
    assert [m.name for m in named([alike, sure], None)] == ["tower fore-aft", "2nd tower fore-aft"]


def test_the_table_has_no_damping_of_one_and_nothing_beyond_nyquist() -> None:
    swing = 0.9 * np.exp(0.2j)
    A = np.diag([np.exp(-STEP / 4.0), -0.4, swing.real, swing.real, 1e-14])
    A[2, 3], A[3, 2] = -swing.imag, swing.imag
    names = tuple(Signal(o) for o in OUTPUTS[:2])
    states = tuple(Signal(f"x{i}") for i in range(5))
    model = StateSpace(A, np.ones((5, 1)), np.ones((2, 5)), np.zeros((2, 1)), None, np.zeros(5), None, STEP,
                       (Signal("u"),), names, states)  # fmt: skip
    text = "\n".join(mode_lines(named(modes_of(model), None), STEP))
    assert "1.0000" not in text
    assert "real poles: 4 s in" in text
    assert "2 poles lie beyond the Nyquist frequency (5 Hz)" in text


def test_harmonics_stand_apart_also_in_the_page(tmp_path: Path) -> None:
    modes = named(mark_harmonics([mode(0.2, 0.01, "flap_moment_1"), mode(0.33, 0.05, "tower_acc_fore_aft")], 0.2), 0.2)
    lines = mode_lines(modes, STEP)
    assert "tower fore-aft" in lines[1] and "harmonics" in lines[2] and lines[3].split()[0] == "1P"
    slow = replace(mode(0.05, 1.0, "flap_moment_1"), frequency_std_hz=0.002)
    others = [mode(7.0, 0.2, "generator_speed"), slow, mode(0.01, -1.0, "generator_speed")]
    facts = {"modes": [m.to_json() for m in [*modes, *others]], "model": plant(10, 1.0, 1)[0].to_json()}
    render_identification(facts, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert page.index("tower fore-aft") < page.index("more likely its harmonics") < page.index("1P")
    assert "Left out: one pole beyond the Nyquist frequency of 5.00 Hz" in page
    assert "3.18 ± 0.13 s in flap_moment_1" in page and "grows with 15.9 s in generator_speed" in page


def plant(samples: int, noise: float, seed: int) -> tuple[StateSpace, Record]:
    """Return a model of a swing in innovation form and a recording of it."""
    rng = np.random.default_rng(seed)
    A = 0.97 * np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    B, C, K = np.array([[0.1], [0.0]]), np.array([[1.0, 0.0]]), np.array([[0.6], [0.3]])
    u, e = rng.standard_normal(samples), noise * rng.standard_normal(samples)
    x, y = np.zeros(2), np.zeros(samples)
    for k in range(samples):
        y[k] = (C @ x)[0] + e[k]
        x = A @ x + B[:, 0] * u[k] + K[:, 0] * e[k]
    model = StateSpace(A, B, C, np.zeros((1, 1)), K, np.zeros(2), np.array([[noise**2]]), STEP, (Signal("pitch"),),
                       (Signal("speed"),), (Signal("x1"), Signal("x2")))  # fmt: skip
    channels = (Channel("pitch", "", "input"), Channel("speed", "", "output"))
    return model, Record(STEP * np.arange(samples), np.column_stack([u, y]), channels, STEP, "a", "")


def test_the_stated_variance_is_that_of_the_disturbance() -> None:
    model, record = plant(200_000, 1.0, 3)
    stated = disturbance_variance(model)
    assert stated is not None
    quiet = record.column("speed") - plant(200_000, 0.0, 3)[1].column("speed")
    assert np.var(quiet) == pytest.approx(stated[0], rel=0.05)  # 200,000 samples of a swing with 33 samples of memory


@pytest.mark.parametrize(("gain", "told"), [(1.0, "not wrong by this"), (-40.0, "are not determined")])
def test_a_poor_free_run_says_whose_fault_it_is(gain: float, told: str) -> None:
    """Noise alone: the right model errs by its own disturbances, one with a wrong gain by more."""
    from dataclasses import replace

    model, record = plant(20_000, 1.0, 4)
    fit = measure_fit(model, [record])
    if gain != 1.0:
        wrong = measure_fit(replace(model, B=gain * model.B), [record])
        fit = replace(fit, free_run=wrong.free_run)
        model = replace(model, B=gain * model.B)
    (line,) = free_run_reason(model, fit, ("pitch",))
    assert told in line and "speed (" in line
    assert free_run_reason(model, replace(fit, one_step=fit.free_run), ("pitch",)) == []


def test_deviations_have_two_digits_and_values_end_where_they_do() -> None:
    """A deviation below one of the fourth decimal was told as ± 0.0000."""
    slow = replace(mode(0.330123, 0.0123, "tower_acc_fore_aft"), frequency_std_hz=3.14e-5, damping_std=0.0021)
    fast = replace(mode(12.3456, 0.02, "flap_moment_1"), frequency_std_hz=0.0996, damping_std=4e-6)
    lines = mode_lines([slow, fast])
    assert "0.330123 ± 0.000031" in lines[1] and "0.0123 ± 0.0021" in lines[1]
    assert "12.35 ± 0.10" in lines[2] and "0.0200000 ± 0.0000040" in lines[2]
    assert lines[1].index(".") == lines[2].index(".") and "± 0.0000 " not in "".join(lines)
    ends = [line.index("tower_acc_fore_aft (") for line in lines[1:2]] + [lines[2].index("flap_moment_1 (")]
    assert ends[0] == ends[1] == lines[0].index("mostly in")


def test_a_time_constant_ends_where_its_deviation_does() -> None:
    real = replace(mode(0.02, 1.0, "generator_speed"), frequency_std_hz=0.00021)
    assert "real poles: 7.958 ± 0.084 s" in mode_lines([real])[0]


def test_no_table_or_sentence_tells_a_deviation_of_nothing() -> None:
    found = Mode(0.330123, 0.0123, 0.9 + 0.2j, 3.14e-5, 2.1e-7, {"y": 1.0})
    assert campbell._hertz(found) == "0.330123 ± 0.000031"
    assert campbell._damping(found) == "1.230000 ± 0.000021 %"
    assert Effect("x", "", "", {"k": {"value": 2.0, "std": 3e-7, "unit": "1"}}, "", 1.0, ()).told() == [
        "k = 2.00000000 ± 0.00000030"
    ]
    assert with_std(0.5, 0.0996) == "0.50 ± 0.10"
