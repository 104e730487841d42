"""Hold the prediction-error steps of varx and varmax to their laws: derivatives, optimum, gain, honest deviations."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from study_modules import load_study

import aeolid.identify.sensitivity as sensitivity
from aeolid.errors import UsageError
from aeolid.identify.descent import covariance_root
from aeolid.identify.extended import collect
from aeolid.identify.refine import (
    Descent,
    Refinement,
    cut_stretches,
    first_state_answer,
    held_out_loss,
    refine,
    run_model,
)
from aeolid.identify.sensitivity import Coordinates, error_derivatives
from aeolid.identify.subspace import ScaledModel, spectral_radius
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import find_scaling
from aeolid.models.prediction import free_run
from aeolid.plants.hawt import Excitation, build_turbine, simulate_closed_loop
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.record import Channel, Record

THROUGH = (True, False)
WEIGHT = np.array([[1.3, 0.2], [0.0, 0.7]])


def gappy(samples=260, seed=1):
    """Return a recording in closed loop with two holes."""
    record = simulate_fourth_order(samples, seed, feedback=0.25)
    values = record.values.copy()
    values[90:93, 2] = values[150] = np.nan
    return replace(record, values=values + np.array([3.0, 0.0, -2.0, 1.0]))


def stretches_of(*records, past=8):
    return cut_stretches(collect(records, find_scaling(records), past))


def some_model(seed=0):
    """Return a model of order 3 with a stable predictor and feedthrough of the first input."""
    random = np.random.default_rng(seed)
    A, C, K = 0.4 * random.standard_normal((3, 3)), random.standard_normal((2, 3)), 0.1 * random.standard_normal((3, 2))
    D = random.standard_normal((2, 2)) * THROUGH
    return ScaledModel(A, random.standard_normal((3, 2)), C, D, K, np.eye(2), "drawn")


def walk(model, u, y, x, b, c):
    """Run the predictor with constants b and c in plain words."""
    errors = []
    for uk, yk in zip(u, y, strict=True):
        errors.append(yk - model.C @ x - model.D @ uk - c)
        x = model.A @ x + model.B @ uk + model.K @ errors[-1] + b
    return np.array(errors)


def changed(model, T):
    inverse = np.linalg.inv(T)
    return replace(model, A=T @ model.A @ inverse, B=T @ model.B, K=T @ model.K, C=model.C @ inverse)


def test_the_derivatives_are_those_of_the_errors():
    """By central differences along one stretch, for the first state and for every direction."""
    model, stretch = some_model(), stretches_of(gappy())[0]
    at = Coordinates.at(model, THROUGH)
    run = run_model(model, [stretch], np.eye(2))
    x, e = run.states[0], run.errors[0]
    dx = np.hstack([np.eye(3), np.zeros((3, at.free))])
    J = error_derivatives(model, at, WEIGHT, x, stretch.u, e, dx)
    assert at.free == 3 * (2 + 2 * 2) + 2 and J.shape == (len(e), 2, 3 + at.free)

    def errors_at(first, move):
        constant = model.K @ run.constant, run.constant
        return walk(at.move(model, move), stretch.u, stretch.y, x[0] + first, *constant) @ WEIGHT

    np.testing.assert_allclose(errors_at(np.zeros(3), np.zeros(at.free)), e @ WEIGHT, atol=1e-12)
    for i in range(3 + at.free):
        step = np.zeros(3 + at.free)
        step[i] = 1e-5
        found = (errors_at(step[:3], step[3:]) - errors_at(-step[:3], -step[3:])) / 2e-5
        np.testing.assert_allclose(J[:, :, i], found, atol=1e-7 * max(abs(found).max(), 1))


def test_changes_of_basis_change_no_error_and_are_left_out():
    model, parts = some_model(), stretches_of(gappy())
    random = np.random.default_rng(3)
    base = run_model(model, parts, WEIGHT)
    moved = run_model(changed(model, np.eye(3) + 0.3 * random.standard_normal((3, 3))), parts, WEIGHT)
    for a, b in zip(base.errors, moved.errors, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)
    at, size = Coordinates.at(model, THROUGH), 1e-6
    np.testing.assert_allclose(at.basis.T @ at.basis, np.eye(at.free), atol=1e-12)
    turned = changed(model, np.eye(3) + size * random.standard_normal((3, 3)))
    change = sensitivity.pack(turned, at.through) - sensitivity.pack(model, at.through)
    assert np.linalg.norm(at.basis.T @ change) < 1e-4 * np.linalg.norm(change)


def test_first_states_and_constants_are_the_best_there_are():
    """Every first state and both constants free, all at once, by plain least squares."""
    model, parts = some_model(), stretches_of(gappy(), simulate_fourth_order(60, 5))
    model = replace(model, A=0.3 * model.A, K=0.3 * model.K)  # forgets a first state before a stretch ends
    assert len(first_state_answer(model.A - model.K @ model.C, model.C, 109)) < 57
    assert [len(s.y) for s in parts] == [90, 57, 109, 60]
    zero, columns, target = np.zeros(3), [], []
    for i, part in enumerate(parts):
        base = walk(model, part.u, part.y, zero, zero, np.zeros(2))
        unit = [(x, zero, np.zeros(2)) for x in np.eye(3)]
        mine = [walk(model, part.u, part.y, *start) - base for start in unit]
        shared = [walk(model, part.u, part.y, zero, b, np.zeros(2)) - base for b in np.eye(3)]
        shared += [walk(model, part.u, part.y, zero, zero, c) - base for c in np.eye(2)]
        blocks = [np.zeros((len(base) * 2, 3)) for _ in parts]
        blocks[i] = np.stack([(m @ WEIGHT).ravel() for m in mine], axis=1)
        columns.append(np.hstack([*blocks, np.stack([(s @ WEIGHT).ravel() for s in shared], axis=1)]))
        target.append((base @ WEIGHT).ravel())
    rows, y = np.vstack(columns), np.concatenate(target)
    best = y - rows @ np.linalg.lstsq(rows, y, rcond=1e-12)[0]
    found = np.concatenate([(e @ WEIGHT).ravel() for e in run_model(model, parts, WEIGHT).errors])
    np.testing.assert_allclose(found, best, atol=1e-8)


def test_outputs_that_rest_higher_move_the_equilibrium_by_as_much():
    model, parts = some_model(), stretches_of(gappy(700, 2))
    model, step = replace(model, A=0.5 * model.A), np.array([0.7, -0.4])
    rests = []
    for move in (np.zeros(2), step):
        run = run_model(model, [replace(s, y=s.y + move) for s in parts], WEIGHT)
        rests.append(Refinement(model, run.constant, 1, 0.0, 0.0, None, THROUGH, "").equilibrium())
    np.testing.assert_allclose(rests[1] - rests[0], step, atol=1e-9)


def test_the_information_is_that_of_the_derivatives_without_the_nuisances(monkeypatch):
    model, parts = some_model(), stretches_of(gappy(), simulate_fourth_order(60, 5))
    run, at = run_model(model, parts, WEIGHT), Coordinates.at(model, THROUGH)
    blocks = []
    for i, (part, x, e) in enumerate(zip(parts, run.states, run.errors, strict=True)):
        dx = np.hstack([np.eye(3), np.zeros((3, at.free))])
        J = error_derivatives(model, at, WEIGHT, x, part.u, e, dx).reshape(2 * len(e), -1)
        own = [np.zeros((len(J), 3)) for _ in parts]
        own[i] = J[:, :3]
        ones = np.tile(WEIGHT.T, (len(e), 1))
        blocks.append(np.hstack([*own, ones, J[:, 3:], (e @ WEIGHT).reshape(-1, 1)]))
    rows = np.vstack(blocks)
    nuisance, wanted = np.split(rows, [3 * len(parts) + 2], axis=1)
    left = wanted - nuisance @ np.linalg.lstsq(nuisance, wanted, rcond=1e-12)[0]
    descent = Descent(parts, THROUGH, False)
    whole = descent.information(model, run, WEIGHT, at)
    monkeypatch.setattr(sensitivity, "CHUNK_NUMBERS", 1)  # 16 samples at a time
    for R in (whole, descent.information(model, run, WEIGHT, at)):
        np.testing.assert_allclose(R.T @ R, left.T @ left, atol=1e-8 * abs(left.T @ left).max())
    root = covariance_root(whole, at.free)
    information = whole[:, :-1].T @ whole[:, :-1]
    np.testing.assert_allclose(root @ root.T @ information, np.eye(at.free), atol=1e-6)


def test_the_end_is_the_optimum_that_a_general_search_finds():
    """First order, one input, one output: the likelihood by Nelder and Mead over (a, b, k), C = 1."""
    random = np.random.default_rng(4)
    u, e, x, y = random.standard_normal(400), 0.5 * random.standard_normal(400), 0.0, []
    for k in range(400):
        y.append(x + e[k])
        x = 0.8 * x + 0.7 * u[k] + 0.5 * e[k]
    channels = (Channel("u", "", "input"), Channel("y", "", "output"))
    record = Record(np.arange(400.0), np.column_stack([u, y]), channels, 1.0, "first order", "")
    parts = stretches_of(record)

    def model(theta):
        a, b, k = (np.array([[v]]) for v in theta)
        return ScaledModel(a, b, np.eye(1), np.zeros((1, 1)), k, np.eye(1), "")

    def power(theta):
        return float((run_model(model(theta), parts, np.eye(1)).errors[0] ** 2).sum())

    best = minimize(power, [0.7, 0.5, 0.4], method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-10}).x
    path = Descent(parts, (False,), False).path(model([0.7, 0.5, 0.4]), 15)
    end = path[-1]
    np.testing.assert_allclose(
        [end.A[0, 0], (end.C @ end.B)[0, 0], (end.C @ end.K)[0, 0]], best, atol=2e-3
    )  # deviation .05
    losses = [power([m.A[0, 0], (m.C @ m.B)[0, 0], (m.C @ m.K)[0, 0]]) for m in path]
    assert len(path) > 2 and np.all(np.diff(losses) < 0)


def test_units_offsets_and_order_of_recordings_change_nothing():
    records = [gappy(700, 2), gappy(300, 3)]
    gains, offsets = np.array([1e-3, 57.3, 1e6, 0.02]), np.array([5.0, -3.0, 1e4, 0.0])
    scaled = [replace(r, values=r.values * gains + offsets) for r in records]
    options = {"past": 8, "order": 4, "refined": True, "feedthrough": ("u1",)}
    base, other, turned = (identify_varx(r, **options) for r in (records, scaled, records[::-1]))
    assert base.extra["refinement"]["steps"] > 0
    for result in (other, turned):
        assert result.extra["refinement"]["steps"] == base.extra["refinement"]["steps"]
        np.testing.assert_allclose(np.sort_complex(result.eigenvalues), np.sort_complex(base.eigenvalues), atol=1e-6)
    ratio = other.model.D / (gains[2:, None] / gains[:2])
    np.testing.assert_allclose(ratio, base.model.D, atol=1e-6)
    assert not base.model.D[:, 1].any() and base.model.D[:, 0].all()
    assert other.fit.free_run.nrmse["y1"] == pytest.approx(base.fit.free_run.nrmse["y1"], abs=1e-5)


def test_noise_power_falls_towards_that_of_the_innovations_and_offsets_stay():
    """A past window of three leaves a bias, which the steps take away; the free run keeps its level."""
    record = simulate_fourth_order(1500, 7, feedback=0.25)
    record = replace(record, values=record.values + np.array([10.0, -4.0, 30.0, 2.0]))
    plain, better = (identify_varx([record], past=3, order=4, refined=r) for r in (False, True))
    power = [np.linalg.det(r.model.innovation_covariance) for r in (plain, better)]
    assert power[1] < power[0] and power[1] < 1.02  # of unit innovations
    assert better.gain_method == "prediction error" and "refined in" in better.summary()
    left = record.matrix("output") - free_run(better.model, record.matrix("input"), better.model.x0)
    assert np.all(abs(left.mean(axis=0)) < 0.1 * left.std(axis=0))
    assert spectral_radius(better.model.A - better.model.K @ better.model.C) < 1
    assert better.band is not None and all(m.frequency_std_hz for m in better.modes)


def test_poles_of_a_turbine_with_measurement_noise_come_nearer():
    true = np.linalg.eigvals(build_turbine().A)
    errors = []
    for seed in range(4):
        record = simulate_closed_loop(2500, seed, excitation=Excitation(noise=0.1))
        found = [
            identify_varx([record], past=15, order=7, feedthrough=("pitch",), refined=r, uncertainty="none").eigenvalues
            for r in (False, True)
        ]
        errors.append([np.mean([abs(true - z).min() for z in poles]) for poles in found])
    before, after = np.mean(errors, axis=0)
    assert after < 0.8 * before


def test_deviations_cover_the_scatter():
    frequencies, dampings, predicted = [], [], []
    for seed in range(30):
        record = simulate_fourth_order(800, seed, feedback=0.25, noise_variance=0.49)
        result = identify_varx([record], past=4, order=4, refined=True)
        frequencies.append([m.frequency_hz for m in result.modes])
        dampings.append([m.damping for m in result.modes])
        predicted.append([[m.frequency_std_hz, m.damping_std] for m in result.modes])
    scatter = np.column_stack([np.std(frequencies, axis=0), np.std(dampings, axis=0)])
    ratio = np.mean(predicted, axis=0) / scatter
    assert np.all((ratio > 0.7) & (ratio < 1.4)), ratio


def test_a_step_that_does_not_help_unseen_data_is_not_taken():
    """Noise without a system: as many steps as predict what is held out best, none here, some there.

    By a hundredth of the loss or more, which rounding does not turn round.
    """
    start = replace(some_model(), A=0.1 * np.eye(3), B=np.zeros((3, 2)), D=np.zeros((2, 2)), K=np.zeros((3, 2)))
    taken = []
    for seed in (6, 7):
        noise = np.random.default_rng(seed).standard_normal((300, 4))
        parts = stretches_of(replace(simulate_fourth_order(300, 0), values=noise))
        done = refine(parts, start, start, (False, False), False)
        path = Descent([s.head() for s in parts], (False, False), False).path(start, 15)
        losses = [held_out_loss(m, parts) for m in path]
        best = int(np.argmin(losses))
        assert done.steps == best < len(path) - 1 and losses[-1] > losses[0]
        assert done.held_out == pytest.approx(1 - np.exp(losses[best] - losses[0]))
        taken.append(done.steps)
    assert taken[0] == 0 < taken[1]
    for fitted in (lambda s: len(s.y), lambda s: 0):  # nothing to hold out, nothing to fit to
        few = refine([replace(s, early=fitted(s)) for s in parts], start, start, (False, False), False)
        assert few.steps == 0 and "too few samples" in few.text()


def test_exact_data_need_no_step():
    clean = simulate_fourth_order(500, 3, noise_variance=0.0)
    result = identify_varx([clean], past=6, order=4, refined=True, regularization="none")
    assert result.extra["refinement"]["steps"] == 0
    assert min(result.fit.free_run.vaf.values()) > 100 - 1e-8


def test_stable_models_stay_stable_and_unstable_predictors_are_not_admitted():
    record = simulate_closed_loop(2000, 5, excitation=Excitation(noise=0.05))
    result = identify_varx([record], past=12, order=7, stable=True, refined=True)
    assert result.extra["refinement"]["steps"] > 0
    assert spectral_radius(result.model.A) < 1
    assert spectral_radius(result.model.A - result.model.K @ result.model.C) < 1
    wild = replace(some_model(), A=3 * np.eye(3), K=np.zeros((3, 2)))
    parts = stretches_of(gappy())
    assert len(Descent(parts, THROUGH, False).path(wild, 3)) == 1 and held_out_loss(wild, parts) == np.inf


def test_steps_that_leave_the_unit_circle_are_brought_back_on_request():
    """A plant that grows by 2 % a sample under feedback: free steps find it, stable ones end at the border."""
    random, x, rows = np.random.default_rng(2), 0.0, []
    for _ in range(400):
        y = x + 0.1 * random.standard_normal()
        rows.append([random.standard_normal() - 0.5 * y, y])
        x = 1.02 * x + rows[-1][0]
    channels = (Channel("u", "", "input"), Channel("y", "", "output"))
    parts = stretches_of(Record(np.arange(400.0), np.array(rows), channels, 1.0, "growing", ""))
    one = np.eye(1)
    start = ScaledModel(0.98 * one, 0.6 * one, one, 0 * one, 0.3 * one, one, "")
    radius = {
        stable: [abs(m.A[0, 0]) for m in Descent(parts, (False,), stable).path(start, 9)] for stable in (True, False)
    }
    assert max(radius[False]) > 1.005 and len(radius[True]) > 1
    assert 0.99 < radius[True][-1] < 0.9999 + 1e-9 and max(radius[True]) < 1


def test_why_the_steps_ended_is_said(monkeypatch):
    """A step that still gains is the last one only because so many are the most; else nothing gains any more."""
    record, facts = simulate_fourth_order(1500, 7, feedback=0.25), []
    for most in (1, 15):
        monkeypatch.setattr("aeolid.identify.refine.MOST_STEPS", most)
        facts.append(identify_varx([record], past=3, order=4, refined=True).extra["refinement"])
    assert (facts[0]["steps"], facts[0]["stopped"]) == (1, "1 steps are the most")
    assert 1 < facts[1]["steps"] < 15 and "the most" not in facts[1]["stopped"]


def test_varmax_is_refined_too():
    record = simulate_fourth_order(1200, 9, feedback=0.25, noise_variance=0.49)
    true = np.sort_complex(np.linalg.eigvals(fourth_order().A))
    result = identify_varmax([record], past=4, order=4, refined=True)
    assert "refinement" in result.extra and "varmax" in result.extra
    assert abs(np.sort_complex(result.eigenvalues) - true).max() < 0.03


def test_a_bootstrap_of_a_refined_model_is_refused():
    with pytest.raises(UsageError, match="repeats the subspace estimate"):
        identify_varx([gappy()], past=5, refined=True, uncertainty="bootstrap")


def test_the_study_measures_and_writes(tmp_path, capsys):
    study = load_study("refinement")
    assert study.main(["--runs", "2", "--case", "example N 1000 p 4", "--out", str(tmp_path)]) == 0
    (row,) = json.loads((tmp_path / "refinement.json").read_text())
    assert 0 < row["after"] < 0.02 and 0 < row["before"] < 0.02 and row["held_out_gain"] >= 0
    assert (tmp_path / "refinement.txt").read_text() == capsys.readouterr().out


def test_the_study_counts_the_modes_that_oscillate():
    """Three of the turbine: its integrator has no damping to cover, and was once counted as missed in every run."""
    study, true = load_study("refinement"), build_turbine().model()
    hits = []
    for seed in range(4):
        record = simulate_closed_loop(3000, seed, excitation=Excitation(noise=0.1))
        hits.append(study.covered(identify_varx([record], past=20, order=7, feedthrough=("pitch",)), true))
    assert [len(h) for h in hits] == [6] * 4 and np.mean(hits) > 0.75
