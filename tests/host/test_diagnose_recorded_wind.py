"""What a recorded wind tells the model's own wind: its laws, and what it keeps from having a name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from small_cases import write_case as write_small

from aeolid.challenge.draw import build, draw_all
from aeolid.challenge.write import write_case
from aeolid.diagnose import prepare as stage
from aeolid.diagnose.case import Case, load_case
from aeolid.diagnose.correction import corrected_model
from aeolid.diagnose.exogenous import Exogenous, with_exogenous
from aeolid.diagnose.recorded_wind import GAIN, with_recorded_wind
from aeolid.diagnose.scores import score_bank
from aeolid.models import equations_file
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, simulate

STEP, SAMPLES, MEMORY, BETWEEN = 0.1, 6000, 4.0, 20
VANES = """[model]
name = "two vanes in one wind"
[[input]]
name = "push"
unit = "N"
[[state]]
name = "wind"
unit = "m/s"
derivative = "(rest - wind)/4.0"
initial = { value = rest }
[[state]]
name = "a"
unit = "m"
derivative = "wind - rest - 0.5*a + push"
[[state]]
name = "b"
unit = "m"
derivative = "0.5*(wind - rest) - 2.0*b"
[[output]]
name = "first"
unit = "m"
equation = "a"
[[output]]
name = "second"
unit = "m"
equation = "b"
"""
MEAN, GUSTS, SEEN = 12.0, 1.0, 0.05
LINEAR = """{"kind": "state_space", "sample_time_s": 0.1, "inputs": [{"name": "push", "unit": "N"}],
"outputs": [{"name": "first", "unit": "m"}, {"name": "second", "unit": "m"}],
"states": [{"name": "wind", "unit": "m/s"}, {"name": "a", "unit": "m"}, {"name": "b", "unit": "m"}],
"A": %s, "B": %s, "C": [[0, 1, 0], [0, 0, 1]], "D": [[0], [0]], "K": null, "x0": [0, 0, 0],
"innovation_covariance": null, "scheduling": null}"""


def exact(step: float) -> NDArray[np.float64]:
    """Return A of wind, a, b over a step, by the series of the exponential."""
    rates = np.array([[-1 / MEMORY, 0, 0], [1.0, -0.5, 0], [0.5, 0, -2.0]])
    A, term = np.eye(3), np.eye(3)
    for k in range(1, 30):
        term = term @ rates * step / k
        A = A + term
    return A


def blown(folder: Path, kind: str, rest: float = 0.0, *, error: float | None = 0.3, role: str = "scheduling") -> Case:
    """Write 600 s of two vanes in a wind of memory 4 s; twenty exact steps a sample.

    The anemometer errs by `error` m/s in each sample; None: it stands in another wind.
    """
    rng = np.random.default_rng(5)
    A, fine = exact(STEP / BETWEEN), GUSTS * np.sqrt(1 - np.exp(-2 * STEP / BETWEEN / MEMORY))
    push = np.repeat(rng.uniform(-1, 1, SAMPLES // 10), 10)
    x, rows = np.zeros(3), np.empty((SAMPLES, 3))
    for k in range(SAMPLES):
        rows[k] = x
        for noise in fine * rng.standard_normal(BETWEEN):
            x = A @ x + np.array([noise, push[k] * STEP / BETWEEN, 0.0])
    seen = rows[:, 1:] + SEEN * rng.standard_normal((SAMPLES, 2))
    noise = rng.standard_normal(SAMPLES)
    elsewhere = lfilter([np.sqrt(1 - np.exp(-2 * STEP / MEMORY))], [1, -np.exp(-STEP / MEMORY)], noise)
    vane = MEAN + (GUSTS * elsewhere if error is None else rows[:, 0] + error * noise)
    channels = (("push", "N", "input"), ("first", "m", "output"), ("second", "m", "output"), ("vane", "m/s", role))
    folder.mkdir(exist_ok=True)
    text = VANES.replace("rest", repr(rest))
    if kind == "state_space":
        B = np.linalg.solve(np.array([[-0.25, 0, 0], [1.0, -0.5, 0], [0.5, 0, -2.0]]), exact(STEP) - np.eye(3))[:, 1:2]
        text = LINEAR % (exact(STEP).tolist(), B.tolist())
    return load_case(write_small(folder, text, STEP, channels, np.column_stack([push, seen, vane]), kind=kind))


@pytest.mark.parametrize("kind", ["equations", "state_space"])
def test_a_true_anemometer_is_the_wind_and_a_strange_one_tells_nothing(kind: str, tmp_path: Path) -> None:
    """A parameter that tells nothing gains half a nat in the mean, four in one recording of two hundred.

    A gust that is known before the vanes answer is worth a sixth of a nat in each of 3000 rows and more.
    """
    true, strange = (stage.prepare(blown(tmp_path / str(e), kind, error=e)) for e in (0.0, None))
    deaf = stage.prepare(blown(tmp_path / "deaf", kind, role="ignore"))
    shares = [1 - np.exp(-p.fit.point.theta[p.extended.index(GAIN)] * STEP) for p in (true, strange)]
    assert shares[0] > 0.9 and shares[1] < 0.05
    assert true.fit.log_likelihood > deaf.fit.log_likelihood + 500
    assert strange.fit.log_likelihood == pytest.approx(deaf.fit.log_likelihood, abs=4)


@pytest.mark.parametrize("kind", ["equations", "state_space"])
def test_without_a_gain_nothing_is_told(kind: str, tmp_path: Path) -> None:
    model, case = model_of(blown(tmp_path, kind)), (Exogenous("vane", "ch_vane", "m/s", "scheduling"),)
    told = with_exogenous(with_recorded_wind(model, case, np.full((3, 1), MEAN), STEP), case)
    u = np.random.default_rng(1).standard_normal((200, 2))
    start = model.x0 + 0.3
    want = simulate(compile_equations(model), u[:, :1], model.theta, start, STEP)
    compiled, theta = compile_equations(told), told.theta
    np.testing.assert_allclose(simulate(compiled, u, theta, start, STEP), want, rtol=1e-9, atol=1e-9)
    theta[told.index(GAIN)] = 1.0
    assert np.max(np.abs(simulate(compiled, u, theta, start, STEP) - want)) > 1e-2


def test_a_wind_that_rests_at_its_mean_is_told_the_same(tmp_path: Path) -> None:
    """The wind of a model may be the gust alone or all of it: the same predictions, the same gain."""
    gust, whole = (stage.prepare(blown(tmp_path / str(rest), "equations", rest)) for rest in (0.0, 9.0))
    kappa = [p.fit.point.theta[p.extended.index(GAIN)] for p in (gust, whole)]
    assert kappa[1] == pytest.approx(kappa[0], rel=0.02)
    assert whole.fit.log_likelihood == pytest.approx(gust.fit.log_likelihood, abs=1.0)


def model_of(case: Case) -> Equations:
    return stage.baseline_of(case).equations


@pytest.mark.parametrize(
    "channel",
    [
        Exogenous("vane", "ch_vane", "m/s", "disturbance"),
        Exogenous("vane", "ch_vane", "deg", "scheduling"),
    ],
)
def test_what_is_no_recorded_wind_tells_nothing(channel: Exogenous, tmp_path: Path) -> None:
    """A disturbance that the model ignores is something that is missing, a pitch angle is no wind."""
    model = model_of(blown(tmp_path, "equations"))
    assert with_recorded_wind(model, (channel,), np.full((3, 1), MEAN), STEP) is model
    vane = (replace(channel, unit="m/s", role="scheduling"),)
    assert with_recorded_wind(model, vane, np.full((3, 1), MEAN), STEP) is not model
    calm = tuple(
        replace(s, derivative=ex.substitute(s.derivative, {"wind": ex.parse("0.0", "")})) for s in model.states
    )
    still = replace(model, states=calm)
    assert with_recorded_wind(still, vane, np.full((3, 1), MEAN), STEP) is still


def test_the_corrected_model_reads_the_recorded_wind_from_its_file(tmp_path: Path) -> None:
    """What is written can be read and run, and the wind in it follows the anemometer."""
    prepared = stage.prepare(blown(tmp_path, "equations"))
    text = equations_file.to_toml(corrected_model(prepared, prepared.fit, None))
    (tmp_path / "corrected.toml").write_text(text)
    model = equations_file.load(tmp_path / "corrected.toml")
    assert [s.name for s in model.inputs] == ["push", "vane"]
    values = np.loadtxt(tmp_path / "recording.csv", delimiter=",", skiprows=1)
    y = simulate(compile_equations(model), values[:, [1, 4]], model.theta, model.x0, STEP)
    explained = 1 - np.var(values[300:, 2] - y[300:, 0]) / np.var(values[300:, 2])
    assert explained > 0.9  # without the anemometer the pushes alone give half


def test_a_gain_that_switches_with_the_wind_foretells_no_gusts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A turbine of the challenge with a wrong mass, in closed loop, in a wind rougher than its model's.

    Whatever follows the recorded wind foretells what the model has to guess, and a switched gain had the name.
    """
    sort, items, own = draw_all(480, 11)[300]
    write_case(tmp_path / "case", build(sort, items, own, 3000), 3000)
    found = []
    for told in (with_recorded_wind, lambda model, *_: model):
        monkeypatch.setattr(stage, "with_recorded_wind", told)
        prepared = stage.prepare(load_case(tmp_path / "case"))
        rows = score_bank(prepared, prepared.hypotheses, 1).rows
        z = next(r.z for r in rows if r.attachment.entry == "operating_region_switch")
        found.append((prepared.fit.log_likelihood, z))
    (likelihood, z), (before, foretold) = found
    assert likelihood > before + 100
    assert foretold > 3 > 2.5 > z
