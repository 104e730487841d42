"""Hold the prediction-error steps to their laws: derivatives, gain on fresh data, honest standard deviations."""

from dataclasses import replace

import numpy as np
import pytest
from test_identify_lpv import random_system, run
from test_identify_lpv_laws import some_data

from aeolid.identify.lpv import identify_lpv
from aeolid.identify.lpv import refine as lpv_refine
from aeolid.identify.lpv.data import find_lpv_scaling, gather
from aeolid.identify.lpv.matrices import ScaledLpv, prediction_loss, run_stretches
from aeolid.identify.lpv.refine import (
    Layout,
    Trial,
    descend,
    error_derivatives,
    information_factor,
    refine,
    shortened,
    try_steps,
)
from aeolid.identify.lpv.result import farthest_step, pole_covariance
from aeolid.identify.lpv.structure import Structure
from aeolid.models.lpv import apply_at
from aeolid.models.lpv_prediction import predictor_states
from aeolid.models.modes import modes_of
from aeolid.record import Channel, Record

CASES = {
    "all of the gain": Structure(frozenset("ABK"), 3, 2, 2, (True, False), False),
    "constants, a mean gain": Structure(frozenset("AB"), 3, 2, 2, (False, False), True),
    "outputs": Structure(frozenset("ACD"), 3, 2, 2, (True, True), False),
}


def some_model(structure, seed=0):
    """Return a model with random numbers wherever the structure has free ones."""
    random, n = np.random.default_rng(seed), 2

    def stack(name, shape, size):
        out = size * random.standard_normal((3, *shape))
        out[1:] *= name in structure.varying
        return out

    D = stack("D", (2, 2), 1.0) * np.array(structure.feedthrough)
    b = random.standard_normal((3, n)) * structure.constant
    c = random.standard_normal(2) * structure.constant
    return ScaledLpv(
        stack("A", (n, n), 0.3), stack("B", (n, 2), 1.0), stack("C", (2, n), 1.0), D, stack("K", (n, 2), 0.1), b, c
    )  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_the_derivatives_are_those_of_the_errors(case):
    """By differences along one stretch, for the first state and for every number."""
    structure = CASES[case]
    data, model = some_data(samples=60, gaps=False), some_model(structure)
    data = data.take(data.targets < 50)
    layout = Layout(structure, 2, 3 if "K" in structure.varying else 1)
    theta = layout.pack(model)
    again = layout.unpack(*theta, model)
    for name in "ABCDKbc":
        np.testing.assert_array_equal(getattr(again, name), getattr(model, name))
    ((_, mu, u, states, errors),) = run_stretches(model, data)
    J = error_derivatives(layout, model, mu, u, states, errors)
    y, sizes = data.y[data.targets], (2, theta[0].size, theta[1].size)

    def errors_at(move):
        parts = np.split(move, np.cumsum(sizes)[:-1])
        moved = layout.unpack(*(t + part.reshape(t.shape) for t, part in zip(theta, parts[1:], strict=True)), model)
        x = predictor_states(moved.unscaled(), u, y - moved.c, mu, states[0] + parts[0])[:-1]
        return y - moved.c - apply_at(moved.C, mu, x) - apply_at(moved.D, mu, u)

    assert J.shape == (len(mu), 2, sum(sizes))
    for i in range(sum(sizes)):
        step = np.zeros(sum(sizes))
        step[i] = 1e-5
        found = (errors_at(step) - errors_at(-step)) / 2e-5
        np.testing.assert_allclose(J[:, :, i], found, atol=1e-6 * max(abs(found).max(), 1))


def test_the_information_is_that_of_the_weighted_derivatives_without_the_first_states():
    structure = CASES["all of the gain"]
    data, model = some_data(samples=200, gaps=True), some_model(structure)
    layout = Layout(structure, 2, 3)
    parts = [part[1:] for part in run_stretches(model, data)]
    e = np.concatenate([part[-1] for part in parts])
    weight = np.linalg.inv(e.T @ e / len(e))
    expected = 0
    for part in parts:
        J = error_derivatives(layout, model, *part)
        J = np.concatenate([J, part[-1][:, :, None]], axis=2)
        full = np.einsum("kia,ij,kjb->ab", J, weight, J)
        expected += full[2:, 2:] - full[2:, :2] @ np.linalg.solve(full[:2, :2], full[:2, 2:])
    R = information_factor(data, layout, model)
    np.testing.assert_allclose(R.T @ R, expected, atol=1e-8 * abs(expected).max())


def test_steps_lower_the_likelihood_and_end_where_it_is_flat():
    model = replace(random_system(), K=np.array([[[0.5, 0.1], [-0.2, 0.4]], np.zeros((2, 2))]))
    record, e = run(model, 1500, 3, noise=0.4)
    plain = identify_lpv([record], past=2, order=2, refined=False)
    better = identify_lpv([record], past=2, order=2)
    assert plain.refinement is None and better.refinement.steps > 0
    power = [np.linalg.det(r.model.innovation_covariance) for r in (plain, better)]
    floor = np.linalg.det(np.cov(e.T))
    assert power[1] < power[0] and power[1] < 1.03 * floor
    assert all(m.frequency_std_hz is None for m in plain.modes)
    assert "prediction error power" in better.summary()


def test_refined_poles_are_nearer_over_many_runs():
    """A past window of two leaves a bias, which goes with the steps."""
    model, errors = random_system(), []
    true = np.sort_complex(np.linalg.eigvals(model.frozen([0.5]).A))
    for seed in range(16):
        record = run(model, 600, seed, noise=0.3)[0]
        found = [identify_lpv([record], past=2, order=2, refined=r).model.frozen([0.5]).A for r in (False, True)]
        errors.append([abs(np.sort_complex(np.linalg.eigvals(A)) - true).mean() for A in found])
    before, after = np.mean(errors, axis=0)
    assert after < before


def test_standard_deviations_cover_the_true_modes():
    """Twelve runs at two operating points: 95 % intervals hold at least 80 % of the true frequencies and dampings."""
    A = np.array([[[0.6, 0.5], [-0.5, 0.6]], [[0.1, 0.15], [0.0, -0.1]]])
    K = np.array([[[0.3, 0.1], [-0.1, 0.2]], np.zeros((2, 2))])
    model, hits = replace(random_system(), A=A, K=K), []
    for seed in range(12):
        result = identify_lpv([run(model, 500, seed, noise=0.5)[0]], past=4, order=2)
        for point in (result.points[0], result.points[2]):
            (true,), (found,) = modes_of(model.frozen(list(point.scheduling.values()))), point.modes
            hits.append(abs(found.frequency_hz - true.frequency_hz) < 1.96 * found.frequency_std_hz)
            hits.append(abs(found.damping - true.damping) < 1.96 * found.damping_std)
    assert np.mean(hits) >= 0.8


def test_long_recordings_are_refined_as_short_ones(monkeypatch):
    """With more windows than are taken, both sides are: what is refined on and what says when to stop."""
    monkeypatch.setattr(lpv_refine, "LONGEST", 1000)
    model = replace(random_system(), K=np.array([[[0.5, 0.1], [-0.2, 0.4]], np.zeros((2, 2))]))
    records = [run(model, n, seed, noise=0.4)[0] for seed, n in ((3, 1500), (4, 600))]
    data = gather(records, find_lpv_scaling(records, ("s",), centre=False), 2)
    part = data.take(shortened(data))
    early = np.count_nonzero(part.place < 0.7)
    assert part.windows == 1000 and early == 700
    assert shortened(data.take(data.targets < 900)).all()
    result = identify_lpv(records, past=2, order=2)
    assert result.refinement.steps > 0 and result.refinement.gain > 0.02


def test_exact_data_need_no_step_and_a_worse_step_is_not_taken():
    exact = identify_lpv([run(random_system(), 500, 1)[0]], past=5, order=2, regularization="none")
    assert exact.refinement.steps == 0 and exact.refinement.covariance is None
    data, structure = some_data(samples=300, gaps=False), CASES["all of the gain"]
    start = some_model(structure)
    layout = Layout(structure, 2, 3)
    losses = [prediction_loss(m, data, joint=True) for m in descend(data, layout, start, 6)]
    assert len(losses) > 1 and all(np.diff(losses) < 0)
    trial = try_steps(data, structure, start)  # noise without any system: what is held out says when to stop
    noise = refine(data, structure, start, trial)
    assert trial.steps is None or noise.steps <= trial.steps
    assert np.isfinite(prediction_loss(noise.model, data))


def test_steps_that_stop_early_widen_the_deviations_by_the_step_that_is_left():
    """A model off the end of the descent by many of the information's deviations: the told ones cover that."""
    A = np.array([[[0.6, 0.5], [-0.5, 0.6]], [[0.1, 0.15], [0.0, -0.1]]])
    K = np.array([[[0.3, 0.1], [-0.1, 0.2]], np.zeros((2, 2))])
    record = run(replace(random_system(), A=A, K=K), 1000, 4, noise=0.1)[0]
    data = gather([record], find_lpv_scaling([record], ("s",), centre=False), 2)
    structure = Structure(frozenset("ABK"), 2, 2, 2, (False, False), False)
    start = identify_lpv([record], past=2, order=2, refined=False).model
    scaled = ScaledLpv(*(getattr(start, name) for name in "ABCDK"), np.zeros((2, 2)), np.zeros(2))
    end = refine(data, structure, scaled, Trial(0.0, None))
    shift = np.array([[[0.02, 0.0], [0.0, 0.02]], np.zeros((2, 2))])
    early = refine(data, structure, replace(end.model, A=end.model.A + shift), Trial(0.0, 0))
    mu, pole = np.array([1.0, 0.0]), np.linalg.eigvals(end.model.A[0])
    assert farthest_step(end.model.A[0], mu, end.covariance, end.further)[1] < 0.2
    assert farthest_step(early.model.A[0], mu, early.covariance, early.further)[1] > 5
    told, bare = (
        np.sqrt(pole_covariance(early.model.A[0], mu, c)[:, 0, 0])
        for c in (early.covariance, early.covariance - np.outer(early.further, early.further))
    )
    moved = abs(pole.real - np.linalg.eigvals(early.model.A[0]).real)
    assert (moved > 5 * bare).all() and (moved < 2 * told).all()


def test_deviations_say_whether_they_hold():
    model = replace(random_system(), K=np.array([[[0.5, 0.1], [-0.2, 0.4]], np.zeros((2, 2))]))
    record = run(model, 1500, 3, noise=0.4)[0]
    facts = identify_lpv([record], past=2, order=2).to_json()
    assert facts["bands_hold"] is True and facts["bands_reason"] is None
    short = identify_lpv([record], past=2, order=1)
    assert short.to_json()["bands_hold"] is False and any(n.startswith("WARNING") for n in short.notes)
    assert "bands_hold" not in identify_lpv([record], past=2, order=2, refined=False).to_json()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_order_chosen_is_that_of_the_refined_model(seed):
    """A window of four leaves half of a slow state: the subspace model wants further ones in its place."""
    random, x, values = np.random.default_rng(seed), np.zeros(2), np.empty((2000, 4))
    A = np.array([[[0.85, 0.25], [-0.25, 0.85]], [[0.02, 0.05], [-0.08, 0.01]]])
    s = np.zeros(2000)
    for k in range(1, 2000):
        s[k] = 0.95 * s[k - 1] + 0.05 * random.standard_normal()
    s *= 0.9
    for k in range(2000):
        u = random.standard_normal()
        values[k] = u, s[k], *(np.array([[1.0, 0.0], [0.3, 1.0]]) @ x + 0.1 * random.standard_normal(2))
        x = (A[0] + s[k] * A[1]) @ x + np.array([1.0 + 0.3 * s[k], 0.3]) * u
    roles = (("u", "input"), ("s", "scheduling"), ("y1", "output"), ("y2", "output"))
    channels = tuple(Channel(name, "", role) for name, role in roles)
    record = Record(np.arange(2000) * 0.1, values, channels, 0.1, "drawn", "")
    assert identify_lpv([record], past=4).order == 2
