"""How inputs go on between their samples: laws of the means, the response of a plant, roles and model files."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.signal import cont2discrete, lfilter, lfilter_zi

from aeolid.errors import DataError
from aeolid.models import equations_file
from aeolid.models.equations import Equations, InputFilter, Parameter
from aeolid.models.input_filters import KINDS, QUARTERS, SPLIT, WHOLE
from aeolid.models.integrate import compile_equations, driven, free_run
from aeolid.models.load import LinearModel
from aeolid.models.machine_code import LANES
from aeolid.models.model_file import Signal
from aeolid.models.smooth_curve import smooth_curve
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record, Roles

Array = NDArray[np.float64]
STEP, G, C, K = 0.0016384, 1.8e5, 42.7, 1.825e5  # s, 1, 1/s, 1/s^2: 68 Hz, a tenth of the sampling rate
MODEL = f"""[model]
name = "resonator"
time = "continuous"
[parameters]
late = {{ value = 0.0, unit = "s" }}
[[state]]
name = "x"
derivative = "v"
[[state]]
name = "v"
derivative = "{G}*force - {C}*v - {K}*x"
[[output]]
name = "x"
equation = "x"
"""


def read(tmp_path: Path, kind: str | None, text: str = MODEL) -> Equations:
    """Return the resonator with its input read in one of the ways."""
    (tmp_path / "model.toml").write_text(text)
    model = equations_file.load(tmp_path / "model.toml")
    return model if kind is None else replace(model, filters=(InputFilter("force", f"intersample_{kind}", ("late",)),))


def smooth_noise(count: int) -> Array:
    """Return a sum of sines up to a fifth of the sampling rate."""
    rng = np.random.default_rng(3)
    t = np.arange(count)
    return np.sum([rng.normal() * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in rng.uniform(0, 0.2, 12)], 0)


@pytest.mark.parametrize("kind", ["foh", "band_limited", "zoh"])
def test_an_offset_of_a_sample_is_the_row_before(kind: str) -> None:
    u, rule = smooth_noise(300), KINDS[f"intersample_{kind}"].rule
    now, late = (rule(u, np.array([o]), 0.1, WHOLE) for o in (0.0, 0.1))
    assert late[1:] == pytest.approx(now[:-1], abs=1e-9)


@pytest.mark.parametrize("count", [16, 55, 60, 400])
@pytest.mark.parametrize("shift", [0.0, -1e-17, 0.7, -0.3, -5.5, 12.25, -40.9, 403.0, -900.5, 1e9])
def test_the_smooth_curve_is_the_spline_through_the_samples(count: int, shift: float) -> None:
    u = np.random.default_rng(4).normal(size=count).cumsum()
    spline, last = make_interp_spline(np.arange(float(count)), u, k=7), count - 1.0

    def integral(t: Array) -> Array:
        beyond = np.minimum(t, 0.0) * u[0] + np.maximum(t - last, 0.0) * u[-1]
        total: Array = spline.antiderivative()(np.clip(t, 0.0, last)) + beyond
        return total

    at, size = np.arange(count + 1) + shift, float(np.max(np.abs(u)))
    curve = smooth_curve(u)
    assert curve.values(shift) == pytest.approx(spline(np.clip(at[:-1], 0.0, last)), abs=1e-10 * size)
    # of a time of 1e9 samples the integral, a billion times as large, has lost nine digits
    assert curve.means(shift) == pytest.approx(np.diff(integral(at)), abs=max(1e-10, 1e-15 * abs(shift)) * size)


def test_an_offset_that_is_no_number_gives_none() -> None:
    assert np.all(np.isnan(smooth_curve(smooth_noise(100)).means(np.nan)))


@pytest.mark.parametrize("kind", ["foh", "band_limited"])
@pytest.mark.parametrize("offset", [-0.07, 0.0, 0.03])
def test_two_pieces_make_up_the_mean_and_begin_with_what_is_read(kind: str, offset: float) -> None:
    u, rule = smooth_noise(300), KINDS[f"intersample_{kind}"].rule
    mean = rule(u, np.array([offset]), 0.1, WHOLE)
    pieces = rule(np.repeat(u, 2), np.array([offset]), 0.1, SPLIT)
    assert SPLIT[0] * pieces[::2] + SPLIT[1] * pieces[1::2] == pytest.approx(mean, abs=1e-12)
    if offset == 0.0:
        assert pieces[::2] == pytest.approx(u, abs=1e-12)


def behind_a_filter(u: Array, offset: float, delay: float, fine: int) -> Array:
    """Return held samples, late by `offset` samples, behind the filter, at every fine step."""
    w = np.sqrt(2) / delay * fine**-1.0
    a, b, *_ = cont2discrete(([w * w], [1.0, np.sqrt(2) * w, w * w]), 1.0)
    at = np.floor((np.arange(len(u) * fine) + 0.5) / fine - offset).astype(int)
    held = u[np.clip(at, 0, len(u) - 1)]
    a = a.ravel()
    found: Array = lfilter(a, b, held, zi=lfilter_zi(a, b) * held[0])[0]
    return found


@pytest.mark.parametrize(("offset", "delay"), [(0.0, 0.5), (0.3, 0.5), (-0.4, 0.6), (2.6, 0.9), (0.2, 0.05)])
def test_the_means_behind_a_filter_are_those_of_its_answer(offset: float, delay: float) -> None:
    u, fine = np.random.default_rng(5).standard_normal(60), 1000
    answer = behind_a_filter(u, offset, delay, fine).reshape(60, fine)
    for pieces, ends in ((WHOLE, [0, 1000]), (SPLIT, [0, 100, 1000]), (QUARTERS, [0, 250, 500, 750, 1000])):
        expected = np.column_stack([answer[:, a:b].mean(1) for a, b in itertools.pairwise(ends)]).ravel()
        values = np.array([offset, delay]) * 0.1
        means = KINDS["intersample_filtered"].rule(np.repeat(u, len(pieces)), values, 0.1, pieces)
        assert means[40:] == pytest.approx(expected[40:], abs=0.02)  # a fine step late is 2 % of so short a piece


def test_a_filter_without_delay_is_the_offset_alone() -> None:
    u = smooth_noise(300)
    alone = KINDS["intersample_zoh"].rule(u, np.array([0.03]), 0.1, WHOLE)
    both = KINDS["intersample_filtered"].rule(u, np.array([0.03, 0.0]), 0.1, WHOLE)
    assert both == pytest.approx(alone, abs=1e-5)


@pytest.mark.parametrize("values", [(np.nan, 0.1), (0.1, np.inf)])
def test_no_number_gives_no_number(values: tuple[float, float]) -> None:
    assert np.all(np.isnan(KINDS["intersample_filtered"].rule(smooth_noise(50), np.array(values), 0.1, WHOLE)))


def test_an_offset_beyond_the_recording_is_bounded() -> None:
    u = smooth_noise(50)
    assert KINDS["intersample_filtered"].rule(u, np.array([1e12, 1e12]), 0.1, WHOLE) == pytest.approx(u[0], abs=1e-2)


@pytest.mark.parametrize(("offset", "delay"), [(0.5, 0.0), (0.2, 0.45), (-0.5, 0.0)])
def test_a_plant_answers_a_late_command_as_it_does_in_fine_steps(tmp_path: Path, offset: float, delay: float) -> None:
    """By its mean alone the input acts as if each sample's part of it were in the sample's middle."""
    rng, fine, count = np.random.default_rng(6), 200, 400
    u = rng.standard_normal(count)
    signal = behind_a_filter(u, offset, max(delay, 1e-3), fine)
    system = cont2discrete(([G], [1.0, C, K]), STEP / fine)
    expected = lfilter(system[0].ravel(), system[1], signal)[::fine]
    model = read(tmp_path, None, MODEL.replace("[[state]]", "filter = { value = 0.0 }\n[[state]]", 1))
    kind, names = ("zoh", ("late",)) if not delay else ("filtered", ("late", "filter"))
    model = replace(model, filters=(InputFilter("force", f"intersample_{kind}", names),))
    theta = np.array([offset, delay]) * STEP
    y = free_run(compile_equations(model), u[:, None], theta, model.x0, STEP)[:, 0]
    alone = np.std(expected) * (2 * np.pi * 68 * STEP) ** 2 / 12  # what the first moment of a sample is worth
    assert np.std((y - expected)[5:-5]) < 0.1 * alone


def test_straight_lines_have_the_mean_of_their_ends() -> None:
    u = smooth_noise(100)
    mean = KINDS["intersample_foh"].rule(u, np.zeros(1), 0.1, WHOLE)
    assert mean[:-1] == pytest.approx(0.5 * (u[1:] + u[:-1]), abs=1e-12)


def test_the_means_of_a_band_limited_signal_are_those_of_its_integral() -> None:
    t = np.arange(400.0)
    u, w = np.sin(0.7 * t), 0.7
    mean = KINDS["intersample_band_limited"].rule(u, np.array([0.3]), 1.0, WHOLE)
    exact = (np.cos(w * (t - 0.3)) - np.cos(w * (t + 0.7))) / w
    assert mean[20:-20] == pytest.approx(exact[20:-20], abs=5 / 384 * w**4)  # Hall and Meyer 1976


@pytest.mark.parametrize("frequency", [20.0, 68.0])
def test_a_plant_answers_as_it_does_to_the_signal_itself(tmp_path: Path, frequency: float) -> None:
    """Straight lines let sinc²(ωh/2) of a sine through, the smooth curve all of it, a held one comes h/2 late."""
    t, w = np.arange(4000) * STEP, 2 * np.pi * frequency
    H = G / (K - w * w + 1j * w * C)
    rows, basis = slice(3000, 3990), np.exp(1j * w * t)
    half = 0.5 * w * STEP
    sinc = np.sin(half) / half
    for kind, factor in ((None, sinc * np.exp(-1j * half)), ("foh", sinc**2), ("band_limited", 1.0)):
        model = read(tmp_path, kind)
        y = free_run(compile_equations(model), np.sin(w * t)[:, None], model.theta, model.x0, STEP)[:, 0]
        expected = np.imag(factor * H * basis)
        error = np.std((y - expected)[rows]) / np.std(expected[rows])
        assert error < 0.1 * half**2, kind  # each of the others is off by half**2 / 3 or more


def test_held_without_an_offset_is_as_recorded(tmp_path: Path) -> None:
    u = smooth_noise(200)[:, None]
    plain, held = read(tmp_path, None), read(tmp_path, "zoh")
    a, b = (free_run(compile_equations(m), u, m.theta, m.x0, STEP) for m in (plain, held))
    assert np.array_equal(a, b)


@pytest.mark.parametrize("kind", ["foh", "band_limited"])
def test_an_output_that_reads_the_input_sees_the_sample(tmp_path: Path, kind: str) -> None:
    model = read(tmp_path, kind, MODEL.replace('equation = "x"', 'equation = "force"'))
    u = smooth_noise(200)[:, None]
    y = free_run(compile_equations(model), u, model.theta, model.x0, STEP)
    assert y == pytest.approx(u, abs=1e-12)


@pytest.mark.parametrize(("hold", "share"), [("band_limited", 1.0), ("foh", 2 * (1 - np.cos(0.8)) / 0.8**2)])
def test_in_discrete_time_inputs_move_within_the_sample(tmp_path: Path, hold: str, share: float) -> None:
    """x⁺ = e^{-ah} x + (1 − e^{-ah}) u of a lag that a sine drives: its answer; straight lines let sinc² of it through.

    Without what the ramp within the sample adds the answer is off by ψ ωh = 3 %, with 1 + θ²/12 besides by 5 %.
    """
    decay = float(np.exp(-0.5))
    text = (
        '[model]\nname = "lag"\ntime = "discrete"\nsample_time_s = 1.0\n[parameters]\nlate = { value = 0.0 }\n'
        f'[[state]]\nname = "x"\nnext = "{decay}*x + {1 - decay}*force"\n[[output]]\nname = "x"\nequation = "x"\n'
    )
    model, t, w = read(tmp_path, hold, text), np.arange(600.0), 0.8
    y = free_run(compile_equations(model), np.sin(w * t)[:, None], model.theta, model.x0, 1.0)[:, 0]
    exact = share * np.imag(np.exp(1j * w * t) / (1 + 1j * w / 0.5))
    assert y[100:-10] == pytest.approx(exact[100:-10], abs=2e-3 * np.max(np.abs(exact)))


def test_lanes_of_a_discrete_model_have_ramps_of_their_own(tmp_path: Path) -> None:
    text = (
        '[model]\nname = "lag"\ntime = "discrete"\nsample_time_s = 1.0\n[parameters]\nlate = { value = 0.0 }\n'
        'a = { value = 0.6 }\n[[state]]\nname = "x"\nnext = "a*x + (1 - a)*force"\n'
        '[[output]]\nname = "x"\nequation = "x"\n'
    )
    compiled = compile_equations(read(tmp_path, "foh", text))
    u, rng = smooth_noise(80)[:, None], np.random.default_rng(5)
    theta = np.repeat(compiled.model.theta[:, None], LANES, axis=1)
    theta[compiled.model.index("a")] = np.linspace(0.3, 0.9, LANES)
    U, Y = driven(compiled, u, compiled.model.theta, 1.0), rng.standard_normal((80, 1))
    K, x0 = rng.uniform(0.0, 0.3, (1, 1, LANES)), rng.standard_normal((1, LANES))
    wide = compiled.predict_wide(U, Y, theta, K, x0, 1.0, 1, 1)
    for lane in range(LANES):
        own = compiled.innovations(U, Y, theta[:, lane], K[:, :, lane], x0[:, lane], 1.0, 1, 1)
        np.testing.assert_array_equal(wide[:, :, lane], own)


def test_slopes_stand_only_where_an_input_moves(tmp_path: Path) -> None:
    u = smooth_noise(50)[:, None]
    for kind, width in ((None, 1), ("zoh", 2), ("foh", 2), ("band_limited", 2)):
        model = read(tmp_path, kind)
        assert driven(compile_equations(model), u, model.theta, STEP).shape == (50, width)


def test_a_model_file_keeps_how_its_inputs_are_read(tmp_path: Path) -> None:
    model = read(tmp_path, "band_limited")
    model = replace(model, parameters=(*model.parameters, Parameter("more", 1.0)))
    (tmp_path / "again.toml").write_text(equations_file.to_toml(model))
    assert equations_file.load(tmp_path / "again.toml").filters == model.filters


ROLES = '[[channel]]\nname = "u"\nunit = "V"\nrole = "input"\n{}[[channel]]\nname = "y"\nunit = "V"\nrole = "output"\n'


def test_the_roles_file_says_how_an_input_goes_on(tmp_path: Path) -> None:
    file = tmp_path / "roles.toml"
    for line, hold in (("", "auto"), ('hold = "foh"\n', "foh")):
        file.write_text(ROLES.format(line))
        assert Roles.load(file).channels[0].hold == hold


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (ROLES.format('hold = "linear"\n'), r"hold = .linear. is none of zoh, foh, band_limited, auto"),
        (ROLES.format("hold = 1\n"), "hold = 1 is none of"),
        (ROLES.format("").replace('role = "output"', 'role = "output"\nhold = "foh"'), "not for output"),
    ],
)
def test_what_is_no_hold_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "roles.toml").write_text(text)
    with pytest.raises(DataError, match=said):
        Roles.load(tmp_path / "roles.toml")


def recorded(hold: str, u: Array) -> Record:
    """Return a recording of an input read in one of the ways, its output unknown."""
    channels = (Channel("force", "", "input", hold=hold), Channel("y", "", "ignore"))
    values = np.column_stack([u, np.zeros(len(u))])
    return Record(np.arange(len(u)) * STEP, values, channels, STEP, "recording", "")


@pytest.mark.parametrize("hold", ["zoh", "foh", "band_limited"])
def test_equations_and_a_linear_model_read_a_recording_alike(tmp_path: Path, hold: str) -> None:
    """Equations are integrated with what lies between the samples, the linear model is discretised for it."""
    u = smooth_noise(900)
    matrices = (np.array([[0, 1], [-K, -C]]), np.array([[0.0], [G]]), np.array([[1.0, 0]]), np.array([[0.0]]))
    signals = [(Signal(n),) for n in ("force", "x")]
    linear = StateSpace(*matrices, None, np.zeros(2), None, 0.0, *signals, (Signal("x"), Signal("v")))
    a = read(tmp_path, None).simulate(recorded(hold, u))
    b = LinearModel(linear, "zero").simulate(recorded(hold, u))
    half = np.pi * 0.2  # ωh/2 at the highest frequency of the input
    assert np.std((a - b)[300:-10]) < half**4 / 15 * np.std(a)  # what δ² leaves of 1/sinc²
