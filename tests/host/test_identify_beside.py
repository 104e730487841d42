"""Hold what stands beside a model to the model's own convention: spectra, residuals, rest."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import aeolid as ae
from aeolid.identify.extended import collect
from aeolid.identify.frequency import frequency_response
from aeolid.identify.refine import Refinement, cut_stretches, run_model
from aeolid.identify.subspace import ScaledModel
from aeolid.identify.windows import find_scaling
from aeolid.plants.lti import simulate_fourth_order

TANK = """
[model]
name = "tank"
time = "continuous"
[parameters]
k = { value = 0.5, unit = "1/s" }
[[state]]
name = "h"
derivative = "-k*h + u"
initial = { value = 0.0, free = true }
[[output]]
name = "y"
equation = "h"
"""


def test_spectra_beside_a_decimated_model_map_the_mean_input_to_the_output_at_its_start():
    """A mode at 0.25 Hz and a rate lowered from 10 to 2 Hz: the raw recording's phase is up to 70 degrees off."""
    random, step, w = np.random.default_rng(0), 0.1, 2 * np.pi * 0.25
    top, bottom, _ = cont2discrete(([w * w], [1, 0.2 * w, w * w]), step, "zoh")
    u = lfilter([1.0], [1.0, -0.9], random.standard_normal(40_000))
    y = lfilter(top[0], bottom, u) + 0.05 * random.standard_normal(40_000)
    record = ae.Record.from_arrays({"u": u, "y": y}, inputs=["u"], outputs=["y"], sample_time=step)
    model = ae.identify(record, decimate=5, order=2, past=10)
    told = model.facts["spectral"]
    hertz, pair = np.array(told["frequency_hz"]), told["pairs"][0]
    assert hertz.max() <= 1.0
    at = (hertz > 0.05) & (hertz < 0.7)
    own = frequency_response(model.state_space, hertz[at]).response[:, 0, 0]
    apart = np.angle(own * np.exp(-1j * np.radians(np.array(pair["phase_deg"])[at])), deg=True)
    assert np.median(abs(apart)) < 5 and np.percentile(abs(apart), 90) < 15


def test_residuals_of_equations_are_those_of_the_run_that_is_scored(tmp_path):
    """The first state is free: at eight where the file has zero."""
    (tmp_path / "model.toml").write_text(TANK)
    random, decay = np.random.default_rng(0), np.exp(-0.05)
    u, y, h = random.standard_normal(600), np.empty(600), 8.0
    for k in range(600):
        y[k] = h + 1e-3 * random.standard_normal()
        h = decay * h + (1 - decay) / 0.5 * u[k]
    record = ae.Record.from_arrays({"u": u, "y": y}, inputs=["u"], outputs=["y"], sample_time=0.1)
    found = ae.validate(ae.Equations.load(tmp_path / "model.toml"), record)
    rms = np.sqrt(np.mean(found.residuals**2))
    assert rms / y.std() == pytest.approx(found.result.free_run.nrmse["y"], rel=1e-9)


def test_a_refined_model_rests_where_its_slow_mode_shows_a_rest():
    """An output that rests higher moves the rest by as much, also where I − A has a direction of 0.2 %."""
    A, C = np.diag([0.998, 0.3, -0.4]), np.array([[1.0, 0.5, 0.2], [0.3, -0.4, 1.0]])
    K, B = np.array([[0.05, 0.1, 0.0], [0.02, 0.0, 0.1]]).T, np.ones((3, 2))
    model, through = ScaledModel(A, B, C, np.zeros((2, 2)), K, np.eye(2), "drawn"), (False, False)
    record, move = simulate_fourth_order(4000, 3), np.array([0.7, -0.4])
    parts = cut_stretches(collect([record], find_scaling([record]), 8))
    rests = []
    for step in (np.zeros(2), move):
        run = run_model(model, [replace(s, y=s.y + step) for s in parts], np.eye(2))
        rests.append(Refinement(model, run.constant, 1, 0.0, 0.0, None, through, "", samples=4000).equilibrium())
    np.testing.assert_allclose(rests[1] - rests[0], move, atol=1e-6)
