"""Check what is chosen before a fit: feedthrough and past window, and what is said of a window that is too short."""

import json

import numpy as np
import pytest

from aeolid.cli.main import main
from aeolid.errors import UsageError
from aeolid.identify.choices import choose
from aeolid.identify.choose_past import climb, longest_past, read_past
from aeolid.identify.plant_states import ask_predicted, ask_states
from aeolid.identify.request import Request
from aeolid.identify.residuals import run_residual_tests
from aeolid.identify.run import identify_records
from aeolid.identify.short_factors import product_factor, shorter
from aeolid.identify.windows import factorise, find_scaling
from aeolid.plants.hawt import Excitation, simulate_closed_loop
from aeolid.plants.lti import simulate_fourth_order
from aeolid.record import Channel, Record

ROLES = '[[channel]]\nname = "u"\nunit = "V"\nrole = "input"\n[[channel]]\nname = "y"\nunit = "m"\nrole = "output"\n'


def record_of(u, y, step):
    channels = [Channel(f"u{i + 1}" if u.shape[1] > 1 else "u", "V", "input") for i in range(u.shape[1])]
    channels += [Channel(f"y{i + 1}" if y.shape[1] > 1 else "y", "m", "output") for i in range(y.shape[1])]
    return Record(
        np.arange(len(u)) * step,
        np.hstack([u, y]),
        tuple(channels),
        step,
        "made up",
        "",
    )


def two_modes(samples, step, seed, *, direct=0.0, feedback=0.0, late=True):
    """Return a recording of modes at 0.3 and 1.1 Hz, 2 %, 10 % noise; u = r - feedback y of this sample or the last."""
    random, A = np.random.default_rng(seed), np.zeros((4, 4))
    for i, f in enumerate((0.3, 1.1)):
        z = np.exp(step * 2 * np.pi * f * (-0.02 + 1j * np.sqrt(1 - 0.02**2)))
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[z.real, z.imag], [-z.imag, z.real]]
    B, C = np.array([0.5, 1.0, 1.0, -0.5]), np.array([1.0, 0.3, -0.4, 1.0])
    x, before, u, y = np.zeros(4), 0.0, np.empty((samples, 1)), np.empty((samples, 1))
    for k in range(samples):
        clean, noise, r = (
            C @ x,
            0.5 * random.standard_normal(),
            random.standard_normal(),
        )
        if late:
            u[k] = r - feedback * before
            y[k] = clean + direct * u[k, 0] + noise
        else:
            y[k] = clean + noise
            u[k] = r - feedback * y[k, 0]
        x, before = A @ x + B * u[k], y[k, 0]
    return record_of(u, y, step)


def test_factor_by_products_is_the_factor():
    """Lagged products give the factor of the windows, gaps and parts included, and shorter windows are in it."""
    record = simulate_fourth_order(1500, 1, feedback=0.25)
    record.values[400, 2] = np.nan
    scaling = find_scaling([record])
    for part in ({"last": 0.7}, {"first": 0.7}, {}):
        ours, theirs = (
            product_factor([record], scaling, 8, **part),
            factorise([record], scaling, 8, **part),
        )
        assert ours.windows == theirs.windows
        assert np.allclose(
            ours.full.T @ ours.full,
            theirs.full.T @ theirs.full,
            atol=1e-9 * ours.windows,
        )
    less, width = shorter(ours, 3), 4 * scaling.channels
    assert np.allclose(
        less.R.T @ less.R,
        (ours.R.T @ ours.R)[-width:, -width:],
        atol=1e-9 * ours.windows,
    )


def test_singular_windows_are_factored_by_rotations():
    """Products square the condition: where channels hang together the factor is that of QR."""
    record = simulate_closed_loop(600, 1)
    scaling = find_scaling([record])
    ours, theirs = (
        product_factor([record], scaling, 20),
        factorise([record], scaling, 20),
    )
    assert np.array_equal(ours.full, theirs.full)


@pytest.mark.parametrize(
    ("options", "wanted"),
    [
        ({"direct": 1.0}, ("u",)),  # an accelerometer in open loop
        ({}, ()),
        ({"direct": 1.0, "feedback": 0.1}, ("u",)),  # the loop has a sample of delay
        ({"feedback": 0.1}, ()),
        (
            {"feedback": 0.03, "late": False},
            (),
        ),  # computed from the output of the sample
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_feedthrough_is_on_where_the_input_acts_and_is_not_computed(options, wanted, seed):
    """The mask is right in open loop, with a delayed controller and with one of direct feedthrough."""
    made = choose([two_modes(3000, 0.1, 20 + seed, **options)], 25, "auto", checked=False)
    assert made.feedthrough == wanted
    assert all(answer.sure for answer in made.tested)


@pytest.mark.parametrize("samples", [1000, 4000])
def test_turbine_gets_the_pitch(samples):
    """The pitch is delayed by a sample and has D: on, whether the excitation is recorded or not."""
    record = simulate_closed_loop(samples, 7, excitation=Excitation(noise=0.01))
    bare = Record(
        record.time_s,
        record.values[:, :5],
        record.channels[:5],
        record.sample_time_s,
        "bare",
        "",
    )
    for one in (record, bare):
        assert "pitch" in choose([one], 20, "auto", checked=False).feedthrough


@pytest.mark.parametrize(("seed", "noise"), [(7001, 0.0), (7015, 0.01)])
def test_turbine_gets_the_torque_where_the_excitation_is_not_recorded(seed, noise):
    """The torque is computed from the speed of the sample and acts within it: few states need its feedthrough."""
    record = simulate_closed_loop(4000, seed, excitation=Excitation(noise=noise))
    bare = Record(record.time_s, record.values[:, :5], record.channels[:5], record.sample_time_s, "bare", "")
    assert choose([bare], 30, "auto", checked=False).feedthrough == ("pitch", "generator_torque")


@pytest.mark.parametrize("ask", [ask_states, ask_predicted])
def test_few_states_need_no_feedthrough_of_what_is_computed_from_the_output(ask):
    """Neither question says D where there is F alone, up to where the loop is hardly stable."""
    for feedback, seed in ((0.03, 1), (0.06, 2), (0.08, 3)):
        record = two_modes(3000, 0.1, seed, feedback=feedback, late=False)
        halves = climb([record], find_scaling([record]), 25).at(25)[0]
        assert not ask(halves, (False,), 0, 0.01)


def test_a_mask_that_leaves_out_what_acts_is_said_and_the_bands_do_not_hold(tmp_path, capsys):
    """Without the feedthrough a mode is gone: identify and validate name the option and the input."""
    record = two_modes(3000, 0.1, 3, direct=4.0)
    rows = np.column_stack([record.time_s, record.values])
    np.savetxt(tmp_path / "r.csv", rows, delimiter=",", header="time_s,u,y", comments="")
    (tmp_path / "roles.toml").write_text('[recording]\ntime = "time_s"\n' + ROLES)
    common = [str(tmp_path / "r.csv"), "--roles", str(tmp_path / "roles.toml")]

    def identify(*more):
        target = [
            "--out",
            str(tmp_path / "m.json"),
            "--json",
            str(tmp_path / "f.json"),
            "--past",
            "60",
        ]
        assert main(["identify", *common, *target, *more]) == 0
        return json.loads((tmp_path / "f.json").read_text()), " ".join(capsys.readouterr().out.split())

    facts, text = identify("--feedthrough", "none")
    assert facts["bands_hold"] is False
    assert "--feedthrough u" in text
    assert main(["validate", str(tmp_path / "m.json"), *common]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "--feedthrough u" in text
    assert "do not hold" in text
    facts, text = identify()
    assert facts["choices"]["feedthrough"]["value"] == ["u"]
    assert sorted(round(m["frequency_hz"], 1) for m in facts["modes"] if m["damping"] < 0.1) == [0.3, 1.1]


def test_validation_finds_an_input_that_acts_at_once_and_forgives_feedback():
    """e against u of the same sample: D u is a failure, F e is not, and chance is one in a hundred."""
    random = np.random.default_rng(5)
    u, e = random.standard_normal((2000, 2)), random.standard_normal((2000, 2))
    names = (("y1", "y2"), ("u1", "u2"))
    kinds = [t for t in run_residual_tests(e, u, *names).tests if t.kind == "feedthrough"]
    assert kinds == []
    found = [t for t in run_residual_tests(e + u @ [[0, 0], [1.0, 0]], u, *names).tests if t.kind == "feedthrough"]
    assert [(t.output, t.against, t.verdict) for t in found] == [("y1", "u2", "fail")]
    moved = u - 0.5 * e - 0.4 * np.vstack([np.zeros((1, 2)), e[:-1]])
    assert [t for t in run_residual_tests(e, moved, *names).tests if t.kind == "feedthrough"] == []


def test_a_window_too_short_is_said_and_auto_finds_one_that_does():
    """0.3 Hz at 200 samples a second: 20 samples are a hundredth of a period; auto's window shows both modes."""
    record = two_modes(12000, 0.005, 1)
    short = choose([record], 20, "auto")
    assert short.past == 20
    assert short.check.holds is False
    assert "too short" in short.check.reason
    slower = two_modes(3000, 0.1, 1)
    made = choose([slower], "auto", "auto")
    assert made.check.holds is True
    assert made.past >= 25


def test_a_start_of_steps_is_short_where_they_can_be_paid_for(monkeypatch):
    """Steps have no window: theirs is the shortest that a longer one betters by little, with poles that agree. Where
    they cost too much, or none follow, the window has to do by itself."""
    record = simulate_closed_loop(3000, 41)
    alone, start = (choose([record], "auto", record.names("input"), followed=f) for f in (False, True))
    assert start.past < alone.past and start.check.holds is True and "steps follow" in start.past_reason
    monkeypatch.setattr("aeolid.identify.contrast.WORK", 1e8)
    assert choose([record], "auto", record.names("input"), followed=True).past == alone.past


def test_left_to_the_data_slow_modes_of_a_fast_sample_are_told():
    """0.3 and 1.1 Hz, 2 %, at 200 samples a second: no window holds a period, the steps' end does."""
    found = identify_records([two_modes(12000, 0.005, 1)], Request())
    assert found.extra["bands_hold"] and len(found.modes) == 2
    for mode, hz in zip(sorted(found.modes, key=lambda m: m.frequency_hz), (0.3, 1.1), strict=True):
        assert abs(mode.frequency_hz - hz) < 4 * mode.frequency_std_hz
        assert abs(mode.damping - 0.02) < 4 * mode.damping_std


def test_windows_that_are_long_enough_are_not_called_short():
    """Fresh recordings of the fourth-order example: at most one of twelve is doubted."""
    doubts = [choose([simulate_fourth_order(1000, s)], 12, ()).check.holds is not True for s in range(12)]
    assert sum(doubts) <= 1


def test_past_is_read_as_samples_seconds_or_auto():
    """Seconds are of the samples that are identified."""
    assert read_past("30", 0.1) == 30
    assert read_past("12s", 0.1) == 120
    assert read_past("1.5 s", 0.5) == 3
    assert read_past("auto", 0.1) is None
    with pytest.raises(UsageError, match="neither a number of samples"):
        read_past("long", 0.1)


def test_the_longest_window_is_bounded_by_the_samples():
    """With few samples there are fewer coefficients than a quarter of them."""
    record = simulate_fourth_order(300, 1)
    assert (longest_past([record], 4) + 1) * 4 <= 300 // 4
