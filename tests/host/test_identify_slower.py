"""Check causal decimation, recordings brought to a model's rate, unstable models, and orders that do not run away."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag, expm

from aeolid.cli.main import main
from aeolid.diagnose.data.case import load_case
from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.identify.folding import image_of
from aeolid.identify.order import OrderChoice
from aeolid.identify.parsimony import _alike, _warned
from aeolid.identify.residuals import run_residual_tests
from aeolid.identify.sound import judge, require_sound
from aeolid.identify.varx import identify_varx
from aeolid.models.model_file import Signal
from aeolid.models.modes import Mode
from aeolid.models.rate import at_rate_of, decimate_causally
from aeolid.models.recursion import run_states
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record

ROLES = """
[recording]
time = "time_s"
[[channel]]
name = "u"
unit = "V"
role = "input"
[[channel]]
name = "y"
unit = "m"
role = "output"
"""


def held(frequencies, dampings, step):
    """Return A, B, C of oscillators under a held input: continuous-time modes, exactly discretised."""
    blocks, pushes, shows = [], [], []
    for f, z in zip(frequencies, dampings, strict=True):
        w = 2 * np.pi * f
        swing = w * np.sqrt(1 - z * z)
        blocks.append(np.array([[-z * w, swing], [-swing, -z * w]]))
        pushes.append([0.0, w])
        shows.append([2 * z, 0.0])
    A, B, C = block_diag(*blocks), np.concatenate(pushes)[:, None], np.concatenate(shows)[None]
    n = len(A)
    E = expm(np.block([[A, B], [np.zeros((1, n + 1))]]) * step)
    return E[:n, :n], E[:n, n:], C


def loop(system, samples, gain, seed, *, hold, step, noise=0.05):
    """Return a recording of u = r − gain y with process and output noise; r changes every `hold` samples."""
    A, B, C = system
    random = np.random.default_rng(seed)
    r = np.repeat(random.choice([-1.0, 1.0], samples // hold + 1), hold)[:samples]
    size = float((run_states(A, r[:, None] @ B.T, np.zeros(len(A)))[:-1] @ C.T).std())
    x, values = np.zeros(len(A)), np.empty((samples, 2))
    v, w = noise * random.standard_normal(samples), 0.1 * np.sqrt(2 * hold) * random.standard_normal(samples)
    for k in range(samples):
        y = float(C[0] @ x) / size + v[k]
        values[k] = r[k] - gain * y, y
        x = A @ x + B[:, 0] * (values[k, 0] + w[k])
    channels = (Channel("u", "V", "input"), Channel("y", "m", "output"))
    return Record(np.arange(samples) * step, values, channels, step, "bench", "")


def write(path, record):
    with open(path, "w", newline="") as handle:
        table = csv.writer(handle)
        table.writerow(["time_s", "u", "y"])
        table.writerows(
            [f"{t:.6f}", repr(float(u)), repr(float(y))] for t, (u, y) in zip(record.time_s, record.values, strict=True)
        )
    return path


def test_inputs_are_averaged_over_the_block_whose_start_shows_the_outputs():
    channels = (Channel("u", "", "input"), Channel("y", "", "output"), Channel("a", "deg", "azimuth"))
    values = np.column_stack([np.arange(32.0), np.arange(32.0), np.arange(32.0)])
    values[5, 0] = values[9, 1] = np.nan
    low = decimate_causally(Record(np.arange(32) * 0.1, values, channels, 0.1, "r", ""), 3)
    assert len(low) == 10 and low.sample_time_s == pytest.approx(0.3)
    np.testing.assert_allclose(low.time_s, np.arange(10) * 0.3)
    np.testing.assert_array_equal(np.isnan(low.values), [[i == 1, i == 3, False] for i in range(10)])
    np.testing.assert_allclose(low.values[2:3], [[7.0, 6.0, 6.0]])
    with pytest.raises(UsageError):
        decimate_causally(low, 0)
    with pytest.raises(NotIdentifiable, match="10 samples; decimation by 4 needs at least 40"):
        decimate_causally(low, 4)


def test_decimation_of_held_inputs_is_exact():
    """Of an input that holds over the blocks, the samples are those of the plant discretised at the longer sample."""
    step, M = 0.01, 5
    A, B, C = held([0.7, 2.3], [0.02, 0.1], step)
    u = np.repeat(np.random.default_rng(3).standard_normal(300), M)[:, None]
    y = run_states(A, u @ B.T, np.zeros(4))[:-1] @ C.T
    channels = (Channel("u", "V", "input"), Channel("y", "m", "output"))
    low = decimate_causally(Record(np.arange(1500) * step, np.hstack([u, y]), channels, step, "r", ""), M)
    A, B, _ = held([0.7, 2.3], [0.02, 0.1], step * M)
    np.testing.assert_allclose(
        low.values[:, 1:], run_states(A, low.values[:, :1] @ B.T, np.zeros(4))[:-1] @ C.T, atol=1e-9
    )


@pytest.mark.parametrize(("seed", "factor", "gain"), [(1, 4, 0.0), (2, 20, 0.4), (3, 20, 0.8), (4, 10, 0.6)])
def test_damping_in_a_loop_survives_decimation(seed, factor, gain):
    """A symmetric filter brings noise before the input that answers it: 2 % of damping became 4 and more."""
    random = np.random.default_rng(seed)
    step, f = 0.2 / factor, [random.uniform(0.2, 0.5), random.uniform(1.0, 1.6)]
    record = loop(held(f, [0.02, 0.05], step), 4000 * factor, gain, seed, hold=2 * factor, step=step, noise=0.02)
    result = identify_varx([record], past=30, order=4, decimation=factor)
    first = min(result.modes, key=lambda m: abs(m.frequency_hz - f[0]))
    assert first.frequency_hz == pytest.approx(f[0], rel=0.02)
    assert abs(first.damping - 0.02) < max(3 * first.damping_std, 0.002)  # 10 % of what the filter made of it
    assert first.damping_std < 0.003
    assert all(m.damping > 0 for m in result.modes)


@pytest.mark.parametrize("seed", range(3))
def test_a_mode_beyond_nyquist_is_called_an_image(seed):
    random = np.random.default_rng(seed)
    step, factor, f = 0.02, 5, [0.6, 2.1, random.uniform(6.2, 7.2)]
    record = loop(held(f, [0.03, 0.03, 0.02], step), 20_000, 0.0, seed, hold=3, step=step)
    result = identify_varx([record], past=30, order=6, decimation=factor)
    images = [m for m in result.modes if m.folded_from_hz is not None]
    assert len(images) == 1 and images[0].folded_from_hz == pytest.approx(f[2], abs=0.1)
    assert images[0].frequency_hz == pytest.approx(image_of(f[2], step * factor), abs=0.3)
    assert all(m.damping > 0 and m.frequency_hz < 5 for m in result.modes)
    assert "perhaps the image of" in result.summary()
    assert json.dumps(result.to_json()["modes"]).count('"folded_from_hz": null') == len(result.modes) - 1
    assert all(m.folded_from_hz is None for m in identify_varx([record], past=30, order=6).modes)


def test_a_recording_is_brought_to_the_rate_of_the_model(tmp_path, capsys):
    record = loop(held([0.6, 2.1], [0.03, 0.03], 0.02), 12_000, 0.3, 5, hold=4, step=0.02)
    (tmp_path / "roles.toml").write_text(ROLES)
    rec, other = write(tmp_path / "a.csv", record.slice(0, 8000)), write(tmp_path / "b.csv", record.slice(8000, 12_000))
    common = ["--roles", str(tmp_path / "roles.toml")]
    model = str(tmp_path / "m.json")
    assert main(["identify", str(rec), *common, "--past", "20", "--order", "4", "--decimate", "4", "--out", model]) == 0
    told = json.loads((tmp_path / "m.json").read_text())
    assert (told["sample_time_s"], told["intersample"]) == (pytest.approx(0.08), "mean")
    capsys.readouterr()
    assert main(["validate", model, str(other), *common, "--json", "-"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["one_step"]["vaf"]["y"] > 90 and facts["samples"] == 1000
    assert main(["simulate", model, str(other), *common, "--out", str(tmp_path / "s.csv")]) == 0
    assert len((tmp_path / "s.csv").read_text().splitlines()) == 1001
    case = '[recordings]\nfiles = ["a.csv"]\nroles = "roles.toml"\n[baseline]\nkind = "state_space"\nfile = "m.json"\n'
    (tmp_path / "case.toml").write_text(case)
    assert load_case(tmp_path).records[0].sample_time_s == pytest.approx(0.08)
    at_rate = at_rate_of(0.08, record)
    assert at_rate_of(0.08, at_rate) is at_rate and at_rate_of(0.0, record) is record
    for step, remedy in (
        (0.05, "resample the recording to 0.05 s, or identify with --decimate 2"),
        (0.01, "record at 0.01 s or faster"),
    ):
        with pytest.raises(DataError, match="no whole multiple") as caught:
            at_rate_of(step, record)
        assert remedy in str(caught.value)


def unstable_record(samples=3000):
    """Return a plant with a pole at 1.02 that its controller holds, u = r − 0.6 y."""
    system = np.array([[1.02]]), np.array([[0.1]]), np.array([[1.0]])
    random = np.random.default_rng(7)
    x, values = 0.0, np.empty((samples, 2))
    for k in range(samples):
        y = x + 0.02 * random.standard_normal()
        values[k] = random.choice([-1.0, 1.0]) - 1.5 * y, y
        x = float(system[0][0, 0] * x + 0.1 * values[k, 0] + 0.01 * random.standard_normal())
    channels = (Channel("u", "V", "input"), Channel("y", "m", "output"))
    return Record(np.arange(samples) * 0.1, values, channels, 0.1, "bench", "")


def test_an_unstable_model_is_refused_or_written_as_asked(tmp_path, capsys):
    (tmp_path / "roles.toml").write_text(ROLES)
    rec = write(tmp_path / "a.csv", unstable_record())
    asked = ["identify", str(rec), "--roles", str(tmp_path / "roles.toml"), "--past", "60", "--order", "1",
             "--out", str(tmp_path / "m.json")]  # fmt: skip
    assert main(asked) == 4
    said = " ".join(capsys.readouterr().err.split())
    assert "the model is unstable: an eigenvalue of size 1.0" in said and "--allow-unstable" in said
    assert "Traceback" not in said and not (tmp_path / "m.json").exists()
    assert main([*asked, "--allow-unstable"]) == 0
    model = json.loads((tmp_path / "m.json").read_text())
    assert abs(model["A"][0][0] - 1.02) < 0.01
    assert any(note.startswith("UNSTABLE") for note in model["identification"]["notes"])


def test_an_integrator_is_not_refused():
    """A pole at 1 within its band, or beyond what the window shows, is none that makes a model useless."""
    record = unstable_record()
    one = np.array([[1.0005]])
    C = np.array([[1.0]])
    model = StateSpace(one, np.array([[0.0]]), C, np.zeros((1, 1)), None, np.ones(1), None, 0.1,
                       (Signal("u", "V"),), (Signal("y", "m"),), (Signal("x1"),))  # fmt: skip
    mode = Mode(np.log(1.0005) / 0.1 / (2 * np.pi), -1.0, 1.0005 + 0j, 0.001, 0.0, {"y": 1.0})
    assert judge(model, [mode], [record], 20) is None  # grows 4.5-fold
    grown = replace(model, A=np.array([[1.002]]), x0=np.zeros(1))
    for std, past, outside in ((0.002, 200, False), (0.0001, 200, False), (0.0001, 900, True)):
        pole = replace(
            mode, eigenvalue=1.002 + 0j, frequency_hz=np.log(1.002) / 0.1 / (2 * np.pi), frequency_std_hz=std
        )
        found = judge(grown, [pole], [record], past)
        assert found is not None and (found.outside, found.integrates) == (outside, not outside)
    with pytest.raises(NotIdentifiable):
        require_sound(found, allowed=False)


def test_the_share_that_is_predictable_is_a_share():
    """Σ ρ² over lags of a signal that is not white counts the same variance many times over."""
    random = np.random.default_rng(1)
    e = run_states(np.array([[0.97]]), random.standard_normal((5000, 1)), np.zeros(1))[:-1]
    report = run_residual_tests(e, np.zeros((5000, 0)), ("y",), ())
    assert report.tests[0].predictable == pytest.approx(0.97**2, abs=0.02)
    both = np.hstack([e, 0.5 * e + 0.1 * random.standard_normal((5000, 1))])
    assert all(0 <= t.predictable <= 1 for t in run_residual_tests(both, e, ("y1", "y2"), ("u",)).tests)
    white = run_residual_tests(random.standard_normal((5000, 1)), np.zeros((5000, 0)), ("y",), ())
    assert white.tests[0].predictable < 0.01 and white.verdict == "pass"


def test_errors_are_alike_where_their_blocks_differ_by_chance():
    random = np.random.default_rng(2)
    base = random.uniform(0.5, 2.0, (20, 2))
    assert _alike(base * 1.01, base)  # within 2 % whatever the scatter
    assert not _alike(base * 1.2, base)  # every block says so
    assert _alike(base * (1 + random.normal(0.03, 0.3, (20, 2))), base)
    assert not _alike(np.full((20, 2), np.inf), base)
    assert _warned(OrderChoice(58, "why", (0.0,) * 60)).reason.startswith("why; WARNING: that is at the limit")
    assert _warned(OrderChoice(10, "why", (0.0,) * 60)).reason == _warned(OrderChoice(4, "why", (0.0,) * 4)).reason


@pytest.mark.parametrize("seed", [0, 2])
def test_stream_and_samples_lead_to_the_same_order(tmp_path, seed):
    """A filter with forgetting has learnt most from what is held out: its own error there chose 8, not 4."""
    record = loop(held([0.6, 2.1], [0.03, 0.03], 0.1), 1500, 0.3, seed, hold=1, step=0.1, noise=0.3)
    (tmp_path / "roles.toml").write_text(ROLES)
    rec, common = str(write(tmp_path / "a.csv", record)), ["--roles", str(tmp_path / "roles.toml"), "--past", "20"]
    markov, out, facts = (str(tmp_path / name) for name in ("markov.npz", "m.json", "f.json"))
    assert main(["filter", rec, *common, "--method", "rls", "--forget", "0.995", "--out", markov]) == 0
    orders = []
    for options in ([], ["--markov", markov]):
        asked = ["identify", rec, *common, *options, "--feedthrough", "none", "--allow-unstable", "--out", out]
        assert main([*asked, "--json", facts, "--force"]) == 0
        orders.append(json.loads((tmp_path / "f.json").read_text())["order"])
    assert orders == [4, 4]
