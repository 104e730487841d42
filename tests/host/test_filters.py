"""The C filters from Python: equal to least squares, honest about bad samples, clear about bad requests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.cli.common import FILTERS
from aeolid.cli.main import main
from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.filters import METHODS, REGRESSORS_MAX, FilterResult, filter_record, replay_filter
from aeolid.filters.settings import least_forgetting
from aeolid.native import find_native, load_library
from aeolid.record import Channel, Record

TURBINE = Path(__file__).resolve().parents[2].parent / "shared/reference/data"
OK, FILLING, NOT_FINITE, RANGE, TIME, GAP = 0, 1, -3, -4, -5, -6


def simulate(samples: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Simulate two inputs in newton-metres and degrees, two outputs, one sample of delay and feedback."""
    rng = np.random.default_rng(seed)
    u, y, x = np.zeros((samples, 2)), np.zeros((samples, 2)), np.zeros(2)
    a, b = np.array([[0.8, 0.3], [-0.3, 0.7]]), np.array([[1.0, 0.2], [0.0, 0.5]])
    for k in range(samples):
        y[k] = x + 0.05 * rng.standard_normal(2)
        u[k] = rng.standard_normal(2) - 0.2 * (y[k - 1] if k else 0.0)
        x = a @ x + b @ u[k] + 0.05 * rng.standard_normal(2)
    return u * [2e4, 1.5] + [1e5, 10.0], y * [0.01, 3.0] + [1.2, -4.0]


def window_of(u: np.ndarray, y: np.ndarray, past: int, feedthrough: tuple[int, ...] = ()) -> np.ndarray:
    """Stack the regressors of eq. (9) by rows, oldest block first."""
    z = np.hstack([u, y])
    n = len(z)
    return np.hstack([z[j : n - past + j] for j in range(past)] + [u[past:, list(feedthrough)]])


def solve(z: np.ndarray, y: np.ndarray, forgetting: float, rho: float) -> np.ndarray:
    """Return theta (l, n) of the weighted, regularised batch problem by QR."""
    k, n = z.shape
    weight = np.sqrt(forgetting) ** np.arange(k - 1, -1, -1)
    rows = np.vstack([np.sqrt(rho * forgetting**k) * np.eye(n), weight[:, None] * z])
    q, r = np.linalg.qr(rows)
    return np.linalg.solve(r, q[n:].T @ (weight[:, None] * y)).T


def scaled(result: FilterResult, u: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Apply the filter's scales in double."""
    offset, scale = np.array(result.settings.offset), np.array(result.settings.scale)
    x = (np.hstack([u, y]) - offset) / scale
    return x[:, : u.shape[1]], x[:, u.shape[1] :]


def distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


@pytest.mark.parametrize("precision,bound", [("f32", 1e-3), ("f64", 1e-10)])
@pytest.mark.parametrize("forgetting", [1.0, 0.998])
@pytest.mark.parametrize("feedthrough", [(), (1,), (0, 1)])
def test_equals_batch_least_squares(
    precision: str, bound: float, forgetting: float, feedthrough: tuple[int, ...]
) -> None:
    u, y = simulate(1500)
    result = replay_filter(
        u, y, past=4, forgetting=forgetting, precision=precision, feedthrough=feedthrough, excitation_min=0.0
    )
    assert result.health == 0
    us, ys = scaled(result, u, y)
    exact = float(np.float32(forgetting)) if precision == "f32" else forgetting
    rho = float(np.float32(0.1)) if precision == "f32" else 0.1
    theta = solve(window_of(us, ys, 4, feedthrough), ys[4:], exact, rho)
    assert distance(result.theta_scaled, theta) < bound


@pytest.mark.parametrize("case", range(4))
@pytest.mark.parametrize("past", [10, 30])
def test_float_is_within_a_thousandth_on_turbine_data(case: int, past: int) -> None:
    path = TURBINE / f"hawt_{case:02d}.npz"
    if not path.exists():
        pytest.skip(f"{path.name} is not at {TURBINE}")
    data = np.load(path)
    u, y = data["u"], data["y"]
    result = replay_filter(u, y, past=past, sample_time_s=0.1)
    us, ys = scaled(result, u, y)
    z = window_of(us, ys, past)
    theta = solve(z, ys[past:], 1.0, float(np.float32(0.1)))
    assert distance(result.theta_scaled, theta) < 1e-3
    assert distance(z @ result.theta_scaled.T, z @ theta.T) < 1e-4
    assert result.health == 0


def test_units_are_undone() -> None:
    u, y = simulate(800)
    result = replay_filter(u, y, past=3, precision="f64")
    scale = np.array(result.settings.scale)
    factor = scale[2:, None] / np.tile(scale, 3)[None, :]
    np.testing.assert_allclose(result.theta, result.theta_scaled * factor, rtol=1e-12)
    deviation = np.hstack([u, y]) - np.array(result.settings.offset)
    z = np.hstack([deviation[j : 800 - 3 + j] for j in range(3)])
    # the residual of the last sample, with the last parameters, from unscaled numbers
    np.testing.assert_allclose(deviation[-1, 2:] - result.theta @ z[-1], result.residual[-1], atol=1e-9)


def test_same_input_gives_the_same_bits() -> None:
    u, y = simulate(500)
    first, second = (replay_filter(u, y, past=5, forgetting=0.99) for _ in range(2))
    assert first.theta.tobytes() == second.theta.tobytes()
    assert first.innovation.tobytes() == second.innovation.tobytes()


@settings(max_examples=25, deadline=None)
@given(bad=st.lists(st.integers(0, 199), min_size=1, max_size=12, unique=True), past=st.integers(1, 6))
def test_bad_samples_are_counted_and_never_used(bad: list[int], past: int) -> None:
    u, y = simulate(200)
    for i, k in enumerate(bad):
        (u if i % 2 else y)[k, i % 2] = (np.nan, np.inf, -np.inf)[i % 3]
    clean = [k for k in range(200) if k not in bad]
    expected = []
    for k in range(200):
        history = [i not in bad for i in range(max(0, k - past), k)]
        if k in bad:
            expected.append(NOT_FINITE)
        elif k - 1 in bad and k > clean[0]:
            expected.append(GAP)
        else:
            expected.append(OK if len(history) == past and all(history) else FILLING)
    try:
        result = replay_filter(u, y, past=past)
    except NotIdentifiable:
        assert OK not in expected
        return
    assert result.status.tolist() == expected
    assert result.counters["rejected_not_finite"] == len(bad)
    assert result.counters["updates"] == expected.count(OK)
    used = result.status == OK
    assert np.isfinite(result.innovation[used]).all() and np.isnan(result.innovation[~used]).all()
    # the same answer as batch least squares over the good windows alone
    us, ys = scaled(result, u, y)
    rows = [k for k in range(200) if used[k]]
    z = np.array([np.hstack([us[k - past : k], ys[k - past : k]]).ravel() for k in rows])
    assert distance(result.theta_scaled, solve(z, ys[rows], 1.0, 0.1)) < 1e-3


def test_time_is_judged() -> None:
    u, y = simulate(100)
    time = 0.1 * np.arange(100)
    time[50:] += 1.0  # a hole of ten samples
    time[70] = time[69] - 0.05  # backwards
    result = replay_filter(u, y, past=3, sample_time_s=0.1, time_s=time)
    assert result.status[50] == GAP and result.status[53] == OK and result.status[52] == FILLING
    assert result.status[70] == TIME and result.status[71] == GAP
    assert result.counters["gaps"] == 2 and result.counters["rejected_time"] == 1


def test_plausible_range_is_judged() -> None:
    u, y = simulate(100)
    y[40, 1] = 1e4
    result = replay_filter(u, y, past=3, minimum=[-1e9, -1e9, -1e9, -100.0], maximum=[1e9, 1e9, 1e9, 100.0])
    assert result.status[40] == RANGE and result.counters["rejected_range"] == 1


def test_a_still_turbine_does_not_forget() -> None:
    u, y = simulate(3000)
    offset, scale = np.r_[u.mean(0), y.mean(0)], np.r_[u.std(0), y.std(0)]
    results = []
    for still in (100, 20000):  # the step to standstill is news; what follows is not
        rest = np.tile(offset, (still, 1))
        stacked = np.vstack([np.hstack([u, y]), rest])
        results.append(
            replay_filter(stacked[:, :2], stacked[:, 2:], past=4, forgetting=0.99, offset=offset, scale=scale)
        )
    assert results[1].health == 1 and results[1].counters["forgetting_withheld"] > 19900
    assert results[0].theta.tobytes() == results[1].theta.tobytes()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("precision,bound", [("f32", 1e-2), ("f64", 1e-4)])
@pytest.mark.parametrize("feedthrough", [(), (1,)])
def test_every_method_forgets_its_start_and_equals_least_squares(
    method: str, precision: str, bound: float, feedthrough: tuple[int, ...]
) -> None:
    """λ = 0.995 over 4000 samples leaves 2e-9 of any start: what is left is the batch solution, whatever the prior."""
    u, y = simulate(4000)
    options: dict[str, Any] = {"forgetting": 0.995, "precision": precision, "feedthrough": feedthrough}
    options |= {"excitation_min": 0.0, "growth_max": 1e4}  # e is small and nearly foretold: keep the bound out of it
    if method == "els":  # its guard and schedule are not least squares; the same regressors in rls are
        result = replay_filter(u, y, past=3, method="rls", model_set="varmax", **options)
        z = window_with_noise(result, u, y, 3, feedthrough)
    else:
        result = replay_filter(u, y, past=3, method=method, **options)
        z = window_of(*scaled(result, u, y), 3, feedthrough)
    exact = float(np.float32(0.995)) if precision == "f32" else 0.995
    theta = solve(z, scaled(result, u, y)[1][3:], exact, 0.1)
    assert distance(result.theta_scaled, theta) < bound
    assert result.counters["reinitialised"] == 0


def window_with_noise(result: FilterResult, u: np.ndarray, y: np.ndarray, past: int, through: tuple[int, ...]) -> Any:
    """Stack the regressors of eq. (14), with the residuals that the filter fed back; zeros while the window filled."""
    us, ys = scaled(result, u, y)
    e = np.nan_to_num(result.residual / np.array(result.settings.scale)[u.shape[1] :])
    z, n = np.hstack([us, ys, e]), len(u)
    return np.hstack([z[j : n - past + j] for j in range(past)] + [us[past:, list(through)]])


def arma(samples: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Simulate y = 1.6 y₁ − 0.8 y₂ + u₁ + 0.5 u₂ + e − 0.7 e₁ + 0.2 e₂ (indices: samples back)."""
    random = np.random.default_rng(seed)
    u, e, y = random.standard_normal(samples), 0.5 * random.standard_normal(samples), np.zeros(samples)
    for k in range(2, samples):
        y[k] = 1.6 * y[k - 1] - 0.8 * y[k - 2] + u[k - 1] + 0.5 * u[k - 2] + e[k] - 0.7 * e[k - 1] + 0.2 * e[k - 2]
    return u[:, None], y[:, None]


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_els_finds_the_moving_average(precision: str) -> None:
    u, y = arma(20000, 3)
    result = replay_filter(u, y, past=2, method="els", precision=precision)
    np.testing.assert_allclose(result.theta[0], [0.5, -0.8, 0.2, 1.0, 1.6, -0.7], atol=0.05)
    assert result.settings.model_set == "varmax" and result.settings.varx_samples == 60
    assert {"fell_back", "feedback_limited"} <= set(result.counters) and "windows_restarted" not in result.counters
    plain = replay_filter(u, y, past=2, precision=precision)
    assert np.nanvar(result.innovation) == pytest.approx(0.25, rel=0.03) and np.nanvar(plain.innovation) > 0.3


def test_els_starts_as_varx_with_the_recorded_schedule() -> None:
    """During its VARX start e is not fed back: the printed recursion with λ moving from 0.99 to 1 gives the same."""
    u, y = simulate(1200)
    result = replay_filter(u, y, past=2, method="els", precision="f64", excitation_min=0.0)
    told = result.settings
    assert (told.varx_samples, told.forgetting_start, told.forgetting_rate) == (120, 0.99, 0.99)
    z, outputs = window_of(*scaled(result, u, y), 2), scaled(result, u, y)[1][2:]
    theta, P, forgetting, expected = np.zeros((2, 8)), np.eye(8) / 0.1, 0.99, []
    for k in range(120):
        expected.append(outputs[k] - theta @ z[k])
        gain = P @ z[k] / (forgetting + z[k] @ P @ z[k])
        theta, P = theta + np.outer(expected[-1], gain), (P - np.outer(gain, z[k] @ P)) / forgetting
        forgetting = 0.99 * forgetting + 0.01
    innovation = result.innovation[2:122] / np.array(told.scale)[2:]
    np.testing.assert_allclose(innovation, expected, atol=1e-9)


@pytest.mark.parametrize("method", ["fast-rls", "lattice"])
def test_a_hole_restarts_the_window_and_says_so(method: str) -> None:
    u, y = simulate(2000)
    y[1000] = np.nan
    result = replay_filter(u, y, past=3, method=method, forgetting=0.995)
    assert result.counters["windows_restarted"] == 1 and "window restarted" in result.health_text()
    whole = replay_filter(u, y, past=3, method="rls", forgetting=0.995)
    assert distance(result.theta_scaled, whole.theta_scaled) < 0.1  # a thousand samples later


@pytest.mark.parametrize(
    "change,word",
    [
        ({"past": 0}, "past"),
        ({"past": 10**6}, "past"),
        ({"past": 2, "precision": "f16"}, "precision"),
        ({"past": 2, "method": "kalman"}, "rls, els, fast-rls, lattice"),
        ({"past": 2, "model_set": "arx"}, "varx, varmax"),
        ({"past": 2, "method": "els", "model_set": "varx"}, "VARMAX"),
        ({"past": 171, "method": "els"}, "must be 1 to 170"),
        ({"past": 2, "method": "lattice", "forgetting": 0.3}, "forgetting"),
        ({"past": 2, "forgetting": 0.4}, "forgetting"),
        ({"past": 2, "forgetting": float("nan")}, "forgetting"),
        ({"past": 2, "regularisation": 0.0}, "regularisation"),
        ({"past": 2, "feedthrough": (2,)}, "feedthrough"),
        ({"past": 2, "sample_time_s": 0.0}, "sample_time_s"),
        ({"past": 2, "offset": [0.0]}, "offset"),
        ({"past": 2, "scale": [1.0, 1.0, 0.0, 1.0]}, "scale"),
        ({"past": 2, "maximum": [np.inf] * 4}, "maximum"),
        ({"past": 2, "time_s": np.zeros(3)}, "time_s"),
        ({"past": 2, "growth_max": 1.0}, "growth_max = 1 is not between 4 and 1e"),
        ({"past": 2, "growth_max": 1e5, "regularisation": 1e-6}, "growth_max / regularisation"),
        ({"past": 2, "regularisation": float("inf")}, "regularisation = inf is not between"),
        (
            {"past": 30, "method": "fast-rls", "forgetting": 0.97},
            r"0\.97 remembers 33\.3 samples; fast-rls with 120 regressors needs 40: take at least 0\.9750",
        ),
        ({"past": 30, "method": "lattice", "forgetting": 0.6}, r"lattice needs 1e-06: take at least 0\.6210"),
    ],
)
def test_bad_settings_are_named(change: dict[str, object], word: str) -> None:
    u, y = simulate(50)
    with pytest.raises(UsageError, match=word):
        replay_filter(u, y, **change)  # type: ignore[arg-type]


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("past", [3, 7, 30, 75])
def test_the_least_forgetting_told_is_taken_and_the_next_below_is_not(past: int, precision: str) -> None:
    u, y = simulate(100)
    least = least_forgetting(4 * past, 3.0)
    replay_filter(u, y, past=past, method="fast-rls", forgetting=least, precision=precision)
    with pytest.raises(UsageError, match=f"take at least {least:.4f}"):
        replay_filter(u, y, past=past, method="fast-rls", forgetting=least - 1e-4, precision=precision)


def test_bad_arrays_are_named() -> None:
    u, y = simulate(50)
    with pytest.raises(UsageError, match="u has shape"):
        replay_filter(u[:, 0], y, past=2)
    with pytest.raises(UsageError, match="u has 49 samples"):
        replay_filter(u[:-1], y, past=2)
    with pytest.raises(UsageError, match="y has shape"):
        replay_filter(u, np.zeros((50, 33)), past=2)
    with pytest.raises(NotIdentifiable, match="constant"):
        replay_filter(np.ones((50, 2)), y, past=2)
    with pytest.raises(NotIdentifiable, match="4 good ones in a row"):
        replay_filter(u[:3], y[:3], past=3)
    assert REGRESSORS_MAX == 1024


def test_missing_library_is_explained(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no_such_file\.so is in none of"):
        find_native("no_such_file.so")
    (tmp_path / "aeolid-thing").write_text("")
    monkeypatch.setenv("AEOLID_NATIVE", str(tmp_path))
    assert find_native("aeolid-thing") == tmp_path / "aeolid-thing"
    assert load_library("f32") is load_library("f32")


def as_record(u: np.ndarray, y: np.ndarray) -> Record:
    names = [
        ("torque", "N m", "input"),
        ("pitch", "deg", "input"),
        ("speed", "rad/s", "output"),
        ("acc", "m/s2", "output"),
    ]
    channels = tuple(Channel(*n) for n in names)
    return Record(0.1 * np.arange(len(u)), np.hstack([u, y]), channels, 0.1, "rec.csv", "0" * 64)


def test_record_errors_name_the_channel() -> None:
    u, y = simulate(60)
    record = as_record(np.column_stack([u[:, 0], np.full(60, 4.0)]), y)
    with pytest.raises(NotIdentifiable, match=r"rec\.csv: channel 'pitch' is constant \(4\)"):
        filter_record(record, past=2)
    fine = as_record(u, np.column_stack([y[:, 0], 1e6 + 1e-3 * y[:, 1]]))  # a float's next number is 0.06 away
    with pytest.raises(NotIdentifiable, match=r"channel 'acc' varies by 0\.\d+ about 1e\+06, less than f32 shows"):
        filter_record(fine, past=2)
    assert np.isfinite(filter_record(fine, past=2, precision="f64").theta).all()
    record = as_record(u, np.column_stack([y[:, 0], np.full(60, np.nan)]))
    with pytest.raises(DataError, match="channel 'acc' holds no finite sample"):
        filter_record(record, past=2)
    with pytest.raises(UsageError, match="feedthrough 'wind' is no input; the inputs are torque, pitch"):
        filter_record(as_record(u, y), past=2, feedthrough=("wind",))
    result = filter_record(as_record(u, y), past=2, feedthrough=("pitch",))
    assert result.settings.feedthrough == (1,) and result.theta.shape == (2, 9)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Write a recording with one missing sample and its roles."""
    u, y = simulate(400)
    rows = [f"{0.1 * k:.1f},{u[k, 0]},{u[k, 1]},{'' if k == 200 else y[k, 0]},{y[k, 1]}" for k in range(400)]
    (tmp_path / "rec.csv").write_text("time_s,torque,pitch,speed,acc\n" + "\n".join(rows) + "\n")
    roles = '[recording]\ntime = "time_s"\n'
    units = {"torque": "N m", "pitch": "deg", "speed": "rad/s", "acc": "m/s^2"}
    for i, (name, unit) in enumerate(units.items()):
        roles += f'[[channel]]\nname = "{name}"\nunit = "{unit}"\nrole = "{"input" if i < 2 else "output"}"\n'
    (tmp_path / "roles.toml").write_text(roles)
    return tmp_path


def call(folder: Path, *options: str) -> int:
    return main(["filter", str(folder / "rec.csv"), "--roles", str(folder / "roles.toml"), *options])


def test_command_writes_what_the_contract_names(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = recording / "markov.npz"
    code = call(recording, "--method", "rls", "--past", "5", "--precision", "f64", "--out", str(out), "--json", "-")
    assert code == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["counters"]["rejected_not_finite"] == 1 and facts["settings"]["past"] == 5
    with np.load(out) as markov:
        assert markov["theta"].shape == (2, 20) and markov["innovation"].shape == (400, 2)
        assert int(markov["health"]) == 0 and json.loads(str(markov["settings"]))["precision"] == "f64"
        assert markov["outputs"].tolist() == ["speed", "acc"]


def test_command_offers_what_there_is() -> None:
    assert FILTERS == METHODS


def test_command_refuses_in_one_sentence(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--out", str(recording / "m.npz")]
    for options, code, word in [
        (["--method", "kalman", "--past", "5", *out], 2, "there are rls, els, fast-rls, lattice"),
        (["--method", "lattice", "--past", "5", "--forget", "0.4", *out], 2, "forgetting"),
        (["--method", "els", "--past", "171", *out], 2, "past = 171"),
        (["--method", "rls", "--past", "0", *out], 2, "past = 0"),
        (["--method", "rls", "--past", "5", "--forget", "2", *out], 2, "forgetting"),
        (["--method", "rls", "--past", "5", "--precision", "f16", *out], 2, "precision"),
        (["--method", "rls", "--past", "200", *out], 4, "201 good ones in a row"),
        (["--method", "rls", "--past", "5", "--out", str(recording / "none" / "m.npz")], 2, "cannot be written"),
        (["--method", "rls", "--past", "5", *out[:1], str(recording / "n.npz"), "--json", "/none/x"], 2, "/none/x"),
    ]:
        assert call(recording, *options) == code
        said = capsys.readouterr().err
        assert word in said and said.count("\n") == 1 and "Traceback" not in said
    assert not (recording / "m.npz").exists()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_command_runs_every_method(
    method: str, precision: str, recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = recording / "markov.npz"
    options = ("--method", method, "--past", "3", "--precision", precision, "--out", str(out), "--json", "-")
    assert call(recording, *options) == 0
    facts = json.loads(capsys.readouterr().out)
    width = 18 if method == "els" else 12
    assert facts["settings"]["method"] == method and facts["regressors"] == width
    assert facts["settings"]["forgetting"] == (0.999 if method == "fast-rls" else 1.0)
    with np.load(out) as markov:
        assert markov["theta"].shape == (2, width) and np.isfinite(markov["theta"]).all()
        assert markov["innovation"].shape == markov["residual"].shape == (400, 2)
        assert np.isfinite(markov["innovation"][300:]).all()


def test_parameters_of_els_are_identified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """filter --method els | identify --method varmax --markov: the poles of the system come out."""
    u, y = arma(8000, 4)
    rows = "\n".join(f"{k},{u[k, 0]!r},{y[k, 0]!r}" for k in range(len(u))).replace("np.float64(", "").replace(")", "")
    (tmp_path / "rec.csv").write_text("time_s,u,y\n" + rows + "\n")
    roles = '[recording]\ntime = "time_s"\n'
    roles += "".join(
        f'[[channel]]\nname = "{n}"\nunit = ""\nrole = "{r}"\n' for n, r in (("u", "input"), ("y", "output"))
    )
    (tmp_path / "roles.toml").write_text(roles)
    markov, model = tmp_path / "m.npz", tmp_path / "model.json"
    assert call(tmp_path, "--method", "els", "--past", "2", "--out", str(markov)) == 0
    identify = ["identify", str(tmp_path / "rec.csv"), "--roles", str(tmp_path / "roles.toml"), "--past", "2"]
    identify += ["--order", "2", "--markov", str(markov), "--out", str(model)]
    assert main([*identify, "--method", "varx"]) == 3
    assert "VARMAX filter: --method varmax" in capsys.readouterr().err
    assert main([*identify, "--method", "varmax"]) == 0
    facts = json.loads(model.read_text())
    poles = np.array([complex(*z) for z in facts["identification"]["eigenvalues"]])
    assert np.abs(np.sort_complex(poles) - np.sort_complex(np.roots([1, -1.6, 0.8]))).max() < 0.02
    assert facts["identification"]["varmax"]["stopped"] == "Ξ as streamed"


@pytest.mark.parametrize(
    ("size", "precision", "told"),
    [
        (1e90, "f32", "f32 holds; give it in a larger unit or take f64"),
        (1e300, "f64", "give the channel in a larger unit"),  # when it is read: the filter need not tell
    ],
)
def test_a_channel_whose_deviation_overflows_is_named(
    size: float, precision: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values = np.random.default_rng(2).standard_normal((60, 2)) * [1.0, size]
    rows = [f"{0.1 * k:.1f},{u!r},{y!r}" for k, (u, y) in enumerate(values.tolist())]
    (tmp_path / "a.csv").write_text("\n".join(["time_s,u,y", *rows]) + "\n")
    entries = [f'[[channel]]\nname = "{n}"\nunit = ""\nrole = "{r}"\n' for n, r in (("u", "input"), ("y", "output"))]
    (tmp_path / "r.toml").write_text("".join(entries))
    asked = ["filter", str(tmp_path / "a.csv"), "--roles", str(tmp_path / "r.toml"), "--method", "rls", "--past", "3"]
    assert main([*asked, "--precision", precision, "--out", str(tmp_path / "x.npz")]) == 3
    said = capsys.readouterr().err
    assert f"{tmp_path / 'a.csv'}: channel 'y'" in said and told in said
