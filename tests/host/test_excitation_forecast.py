"""What a design foretells: information and deviations against closed forms, differences, and identifications."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from random_plants import Drawn, draw_plant
from scipy.linalg import solve_discrete_are
from study_modules import load_study

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.excitation.candidates import Wanted
from aeolid.excitation.design import DesignRequest, design_excitation
from aeolid.excitation.expected import noise_gram, window_gram
from aeolid.excitation.experiment import experiment_on
from aeolid.excitation.information import information, least_covariance
from aeolid.excitation.setup import hold_integrators
from aeolid.identify.subspace import ScaledModel
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import factorise, find_scaling
from aeolid.models.model_file import Signal
from aeolid.models.modes import modes_of
from aeolid.models.recursion import run_states
from aeolid.models.state_space import StateSpace
from aeolid.plants.hawt import build_turbine
from aeolid.plants.lti import fourth_order, simulate_fourth_order

N = 2000


def model_of(A, B, C, K, covariance=None, D=None, h=1.0) -> StateSpace:
    """Return a plant with channels u0 … and y0 …"""
    A, B, C, K = (np.atleast_2d(np.asarray(m, float)) for m in (A, B, C, K))
    count, r = len(C), B.shape[1]
    D = np.zeros((count, r)) if D is None else D
    covariance = np.eye(count) if covariance is None else covariance
    inputs, outputs = tuple(Signal(f"u{i}") for i in range(r)), tuple(Signal(f"y{i}") for i in range(count))
    return StateSpace(A, B, C, D, K, np.zeros(len(A)), covariance, h, inputs, outputs, ())


def scaled(m: StateSpace) -> ScaledModel:
    assert m.K is not None and m.innovation_covariance is not None
    return ScaledModel(m.A, m.B, m.C, m.D, m.K, m.innovation_covariance, "known")


def plant_of(drawn: Drawn) -> StateSpace:
    covariance = 0.5 * np.eye(len(drawn.C)) + 0.1
    return model_of(drawn.A, drawn.B, drawn.C, drawn.K, covariance, h=0.1)


@pytest.mark.parametrize(("a", "c"), [(0.9, 0.2), (0.5, -0.4), (-0.7, 0.3)])
def test_the_bound_is_that_of_the_textbook_where_noise_alone_tells_the_pole(a, c):
    """ARMA(1, 1): var a = (1 − a²)(1 − a c)²/((a − c)² N) (Box and Jenkins, Time Series Analysis, 1976, chapter 7)."""
    m = model_of(a, 1.0, 1.0, a - c)
    experiment, silent = experiment_on(m), np.zeros((N, 3))
    found = least_covariance(scaled(m), information(scaled(m), experiment, silent, (False,)), (False,))
    assert found.covariance[0, 0, 0] == pytest.approx((1 - a**2) * (1 - a * c) ** 2 / ((a - c) ** 2 * N), rel=1e-6)


@pytest.mark.parametrize(("a", "b", "gain"), [(0.9, 0.5, 0.0), (0.6, 2.0, 0.0)])
def test_the_bound_is_that_of_the_textbook_where_an_input_tells_it(a, b, gain):
    """y = b/(q − a) u + e, u white: the information of [a, b] by the two filters' covariance, by hand."""
    m = model_of(a, b, 1.0, gain)
    u = np.random.default_rng(0).choice([-1.0, 1.0], (N, 1))
    u -= u.mean()
    experiment = experiment_on(m)
    found = least_covariance(scaled(m), information(scaled(m), experiment, experiment.answer(u), (False,)), (False,))
    q = 1 - a**2  # ψ_b = 1/(q − a) u, ψ_a = b/(q − a)² u: 1/q, b a/q², b² (1 + a²)/q³
    M = np.array([[b**2 * (1 + a**2) / q**3, b * a / q**2], [b * a / q**2, 1 / q]])
    expected = np.linalg.inv(N * M)[0, 0]
    assert found.covariance[0, 0, 0] == pytest.approx(expected, rel=0.1)  # u is one draw of N values


def errors_of(m: StateSpace, u: np.ndarray, y: np.ndarray) -> np.ndarray:
    assert m.K is not None
    forced = u @ (m.B - m.K @ m.D).T + y @ m.K.T
    x = run_states(m.A - m.K @ m.C, forced, np.zeros(m.order))[:-1]
    return y - x @ m.C.T - u @ m.D.T


@pytest.mark.parametrize("seed", [1, 2])
def test_the_information_is_the_second_derivative_of_the_likelihood(seed):
    """Σ ψ Λ⁻¹ ψᵀ of one run of 20,000 samples, ψ by differences of its prediction errors, inverted on all directions
    but the nine that change the basis only: each pole within 6 %, what chance leaves."""
    rng = np.random.default_rng(seed)
    m = plant_of(draw_plant(rng, 3, 2, 2))
    m = replace(m, D=np.array([[0.3, 0.0], [-0.2, 0.0]]))
    samples, through = 20_000, (True, False)
    u = np.sign(rng.standard_normal((samples, 2)))
    y = load_study("excitation").open_run(m, u, seed)[:, 2:]
    base, rows = errors_of(m, u, y), []
    shapes = {"A": m.A.shape, "B": m.B.shape, "K": (3, 2), "C": m.C.shape, "D": m.D.shape}
    places = [(n, i, j) for n, s in shapes.items() for i in range(s[0]) for j in range(s[1]) if n != "D" or through[j]]
    L = np.linalg.inv(np.linalg.cholesky(m.innovation_covariance))
    for name, i, j in places:
        moved = getattr(m, name).copy()
        moved[i, j] += 1e-6
        rows.append(((errors_of(replace(m, **{name: moved}), u, y) - base) / 1e-6 @ L.T).ravel())
    psi = np.array(rows)
    values, vectors = np.linalg.eigh(psi @ psi.T)
    keep = vectors[:, 9:] / np.sqrt(values[9:])  # n² = 9 directions change the basis only
    poles, right = np.linalg.eig(m.A)
    left = np.linalg.inv(right)
    experiment = experiment_on(m)
    found = least_covariance(scaled(m), information(scaled(m), experiment, experiment.answer(u), through), through)
    for k, pole in enumerate(poles):
        gradient = np.array([left[k, i] * right[j, k] if name == "A" else 0 for name, i, j in places])
        expected = (abs(gradient @ keep) ** 2).sum()
        assert np.trace(found.near(pole)) == pytest.approx(expected, rel=0.06)


def test_the_gram_matrix_of_windows_is_that_of_the_factor():
    record = simulate_fourth_order(400, 3)
    scaling = find_scaling([record])
    factor = factorise([record], scaling, 6)
    found = window_gram(scaling.apply(record.values), 6)
    np.testing.assert_allclose(found, factor.R.T @ factor.R, atol=1e-9 * abs(found).max())


def test_the_noise_of_windows_is_that_of_its_impulse_responses():
    """E v vᵀ summed over innovations one by one, as far back as they are felt."""
    m, p = fourth_order(), 3
    assert m.K is not None
    answers = np.zeros((400 + p + 1, 4, 2))  # of z = [u; y] to a unit innovation
    answers[0, 2:] = np.eye(2)
    state = m.K
    for k in range(1, len(answers)):
        answers[k, 2:] = m.C @ state
        state = m.A @ state
    total = np.zeros((4 * (p + 1), 4 * (p + 1)))
    for age in range(-p, 400):  # of an innovation at the first sample of the window
        row = np.concatenate([answers[age + i] if age + i >= 0 else np.zeros((4, 2)) for i in range(p + 1)])
        total += row @ row.T
    found = noise_gram(experiment_on(m).noise_covariances(p), 1)
    np.testing.assert_allclose(found, total, atol=1e-8 * abs(total).max())


@pytest.mark.parametrize("kind", ["prbs", "multisine", "filtered"])
def test_what_is_foretold_is_what_an_identification_states(kind):
    """One run of 3000 samples: deviations within 15 % (chance in the Gram matrix; the spread over runs is the study's),
    and the rms of every channel within 8 %."""
    study = load_study("excitation")
    plant = study.plants()["fourth"]
    design = design_excitation(plant.model, replace(plant.request, wanted=Wanted(kind)))
    record = study.recorded(plant.model, plant.simulate(design.signals.values, 7))
    result = identify_varx([record], past=15, order=4)
    for told in design.forecast.modes:
        near = min(result.modes, key=lambda m: abs(m.eigenvalue - told.mode.eigenvalue))
        assert told.frequency_std_hz == pytest.approx(near.frequency_std_hz, rel=0.15)
        assert told.damping_std == pytest.approx(near.damping_std, rel=0.15)
        assert 0.85 < told.least_frequency_std_hz / told.frequency_std_hz < 1.02 and told.reached
    rms = record.values.std(axis=0)
    assert [c.total for c in design.forecast.channels] == pytest.approx(rms.tolist(), rel=0.08)


def test_a_closed_loop_moves_as_foretold(monkeypatch):
    """The turbine under its controllers, which have 14 states: sample by sample without wind, and in its spread."""
    study = load_study("excitation")
    plant = study.plants()["turbine"]
    request = replace(plant.request, wanted=Wanted("prbs", clock_s=0.3))
    design = design_excitation(plant.model, request, controller=plant.controller)
    assert design.closed_loop and [c.name for c in design.forecast.channels][:2] == ["pitch", "generator_torque"]
    rms = plant.simulate(design.signals.values, 5).std(axis=0)
    told = [c.total for c in design.forecast.channels]
    assert told[:4] == pytest.approx(rms[:4].tolist(), rel=0.1)
    assert told[4] == pytest.approx(rms[4], rel=0.4)  # 0.3 % of damping: 600 s hold five of its memories
    monkeypatch.setattr(study, "WIND", 0.0)
    monkeypatch.setattr(study, "NOISE", 0.0)
    still = plant.simulate(design.signals.values, 5)
    answer = experiment_on(plant.model, plant.controller).answer(design.signals.values)[:, 7:]
    np.testing.assert_allclose(answer, still, atol=1e-6 * abs(still).max(axis=0).max())
    np.testing.assert_allclose(answer[:, 2:], still[:, 2:], atol=1e-6)


def test_long_signals_tell_as_much_as_their_parts():
    """The information of a signal that is cut into transforms is that of its parts, and grows with its length."""
    m = fourth_order()
    u = np.sign(np.random.default_rng(4).standard_normal((2 * 32768, 2)))
    experiment = experiment_on(m)
    whole = information(scaled(m), experiment, experiment.answer(u), (False, False))
    halves = sum(information(scaled(m), experiment, experiment.answer(u)[k : k + 32768], (False, False)) for k in
                 (0, 32768))  # fmt: skip
    short = information(scaled(m), experiment, experiment.answer(u[:32768]), (False, False))
    np.testing.assert_allclose(whole, halves, rtol=1e-9, atol=1e-9 * abs(whole).max())
    assert np.trace(whole) == pytest.approx(2 * np.trace(short), rel=0.02)


@pytest.mark.nightly
def test_spreads_of_fifty_identifications_are_as_foretold(tmp_path, capsys):
    """Three plants, three kinds of signal, each mode's frequency and damping: within 1.3, and chance of 10 % each.

    The largest of 48 chances is 2.5 deviations, so single ones may reach 1.45; their mean leaves 3 %.
    """
    study = load_study("excitation")
    only = ["fourth", "turbine", "rotor"]
    assert study.main(["--runs", "50", "--only", *only, "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out == (tmp_path / "excitation.txt").read_text()
    rows = json.loads((tmp_path / "excitation.json").read_text())["rows"]
    ratios = np.array([[m[q]["foretold"] for q in ("frequency", "damping")] for row in rows for m in row["modes"]])
    assert len(rows) == 9 and ratios.size == 48
    assert np.all((ratios < 1.45) & (ratios > 1 / 1.45)) and np.mean((ratios < 1.3) & (ratios > 1 / 1.3)) > 0.9
    assert abs(np.log(ratios).mean()) < 0.1


def pair(b1: float = 1.0, b2: float = 1.0) -> StateSpace:
    """Return two modes, 0.05 and 0.2 Hz at 1 Hz, each seen in an output of its own with some noise; b: of the input."""
    blocks, K, B = np.zeros((4, 4)), np.zeros((4, 2)), np.zeros((4, 1))
    for i, (f, b) in enumerate(((0.05, b1), (0.2, b2))):
        z = 0.95 * np.exp(2j * np.pi * f)
        blocks[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[z.real, z.imag], [-z.imag, z.real]]
        K[2 * i : 2 * i + 2, i], B[2 * i, 0] = (0.2, 0.1), b
    return model_of(blocks, B, [[1, 0, 0, 0], [0, 0, 1, 0]], K)


REQUEST = DesignRequest({"u0": 1.0}, duration_s=2000.0, past=20)


def test_a_mode_that_no_input_reaches_is_said():
    """Its deviation is that of noise alone, with or without the excitation; as a goal it is refused."""
    found = design_excitation(pair(b2=0.0), REQUEST)
    slow, fast = found.forecast.modes
    assert slow.reached and fast.reached is False
    assert fast.least_damping_std == pytest.approx(fast.noise_damping_std, rel=1e-3)
    assert any("0.2002 Hz is not reached by u0" in n for n in found.remarks())
    assert [m.frequency_hz for m in found.goals] == pytest.approx([0.05], rel=0.02)
    with pytest.raises(NotIdentifiable, match=r"u0 within the bounds does not reach the mode at 0\.2"):
        design_excitation(pair(b2=0.0), replace(REQUEST, goal=0.2))


def test_the_best_candidate_is_the_one_with_the_least_deviation_of_the_goal():
    for goal, place in ((0.05, 0), (0.2, 1)):
        found = design_excitation(pair(), replace(REQUEST, goal=goal))
        assert found.score == min(c.score for c in found.candidates if c.firm) == found.candidates[0].score
        told = found.forecast.modes[place]
        assert found.score == pytest.approx(max(told.frequency_std_hz / told.mode.frequency_hz,
                                                told.damping_std / told.mode.damping))  # fmt: skip
    by_frequency = design_excitation(pair(), replace(REQUEST, goal="0.05 Hz", quantity="frequency"))
    assert by_frequency.score < 0.2 * design_excitation(pair(), replace(REQUEST, goal=0.05)).score


def test_a_band_too_narrow_for_the_windows_is_said_and_never_preferred():
    """Without the penalty deviations are ten times as large; the study shows a spread of seven times what is stated."""
    m = replace(fourth_order(), innovation_covariance=0.49 * np.eye(2))
    request = DesignRequest({"u1": 1.0, "u2": 1.0}, duration_s=3000.0, past=15, goal=0.125)
    narrow = design_excitation(m, replace(request, wanted=Wanted("multisine", band_hz=(0.1, 0.15))))
    assert not narrow.candidates[0].firm and any("not firm" in n for n in narrow.remarks())
    both = design_excitation(m, replace(request, wanted=Wanted(band_hz=(0.1, 0.15))))
    assert [c.firm for c in both.candidates] == [True, False] and both.signals.shape.kind == "filtered"


def test_outputs_stay_within_their_limits():
    free = design_excitation(pair(), REQUEST)
    rms = {c.name: c.total for c in free.forecast.channels}
    noise = {c.name: c.noise for c in free.forecast.channels}
    limit = 0.5 * (rms["y0"] + noise["y0"])
    held = design_excitation(pair(), replace(REQUEST, limit={"y0": limit}))
    sizes = {c.name: c.total for c in held.forecast.channels}
    assert sizes["y0"] <= limit and held.signals.played[0].amplitude <= 1.0
    on_top = design_excitation(pair(), replace(REQUEST, limit={"y0": 0.3}, on_top=True))
    total = {c.name: c.total for c in on_top.forecast.channels}["y0"]
    assert math.sqrt(total**2 - noise["y0"] ** 2) <= 0.3 and on_top.score > free.score
    with pytest.raises(UsageError, match="its own noise is"):
        design_excitation(pair(), replace(REQUEST, limit={"y0": 0.9 * noise["y0"]}))


def test_the_shortest_duration_reaches_the_deviation_and_a_shorter_one_does_not(monkeypatch):
    request = replace(REQUEST, duration_s=None, deviation=0.05, wanted=Wanted("prbs", clock_s=2.0))
    found = design_excitation(pair(), request)
    assert 0.045 < found.score <= 0.05
    shorter = replace(request, deviation=None, duration_s=round(0.8 * found.duration_s))
    assert design_excitation(pair(), shorter).score > 0.05
    monkeypatch.setattr("aeolid.excitation.design.MOST_ROWS", 20_000)
    with pytest.raises(NotIdentifiable, match="is not reached within 2e"):
        design_excitation(pair(), replace(request, deviation=1e-5))


def test_a_signal_that_is_held_or_finer_than_the_model_is_foretold_alike():
    """Values held for two samples are the clock of two; a row every half sample, held for whole ones, changes none."""
    same = replace(REQUEST, wanted=Wanted("prbs", clock_s=2.0))
    scores = [design_excitation(pair(), replace(same, sample_time_s=h)).score for h in (1.0, 2.0, 0.5)]
    assert scores == pytest.approx([scores[0]] * 3, rel=0.05)
    with pytest.raises(UsageError, match="neither a multiple nor a whole part"):
        design_excitation(pair(), replace(same, sample_time_s=0.7))


def test_an_integrator_is_held_and_the_modes_that_swing_stay():
    m = load_study("excitation").with_wind(build_turbine().model())
    held, said = hold_integrators(m, 30.0)
    before, after = (sorted(x.eigenvalue.real for x in modes_of(q) if not x.is_real) for q in (m, held))
    assert after == pytest.approx(before, abs=1e-9) and "--controller" in said
    poles = np.linalg.eigvals(held.A)
    assert abs(poles).max() < 1 and np.isclose(poles, math.exp(-0.1 / 30)).sum() == 1
    assert hold_integrators(pair(), 30.0)[1] == ""


def test_a_controller_that_does_not_fit_is_refused():
    m = pair()
    good = model_of(np.zeros((1, 1)), np.ones((1, 2)), np.ones((1, 1)), np.zeros((1, 1)))
    good = replace(good, inputs=m.outputs, outputs=m.inputs, D=np.zeros((1, 2)))
    assert design_excitation(m, REQUEST, controller=replace(good, C=np.array([[1e-3]]))).closed_loop
    with pytest.raises(NotIdentifiable, match="loop of model and controller is unstable"):
        design_excitation(m, REQUEST, controller=replace(good, C=np.array([[50.0]])))
    with pytest.raises(DataError, match=r"sample time is 0\.5 s"):
        design_excitation(m, REQUEST, controller=replace(good, sample_time_s=0.5))
    with pytest.raises(DataError, match="its input 'speed' is none of the model's outputs"):
        design_excitation(m, REQUEST, controller=replace(good, inputs=(Signal("speed"), m.outputs[1])))


@pytest.mark.parametrize(
    ("change", "more", "said"),
    [
        ({"inputs": (), "B": np.zeros((4, 0)), "D": np.zeros((2, 0))}, {}, "the model has no input"),
        ({"K": None}, {}, "no noise"),
        ({"sample_time_s": 0.0}, {}, "continuous time"),
        ({"innovation_covariance": np.ones((2, 2))}, {}, "singular"),
        ({}, {"bound": {}}, "no input has a bound"),
        ({}, {"duration_s": 10.0}, "shorter than a period of the slowest mode, 19.7"),
        ({}, {"duration_s": 100.0}, "needs 168 for deviations"),
        ({}, {"duration_s": 1e8}, "at most 1000000"),
        ({}, {"duration_s": float("nan")}, "--duration"),
        ({}, {"duration_s": None}, "either --duration or --deviation"),
        ({}, {"deviation": 0.1}, "either --duration or --deviation"),
        ({}, {"goal": 0.4}, "no mode within a fifth"),
        ({}, {"goal": "tower"}, "neither the name of a mode nor a frequency"),
        ({}, {"quantity": "phase"}, "--quantity"),
        ({}, {"seed": -1}, "--seed"),
        ({}, {"past": 0}, "--past"),
        ({}, {"past": 900}, "1 to 399 samples"),
        ({}, {"limit": {"u0": 1}}, "no such channel"),
        ({}, {"wanted": Wanted("chirp")}, "--signal"),
        ({}, {"wanted": Wanted("prbs", band_hz=(0.1, 0.2))}, "prbs has --clock"),
        ({}, {"wanted": Wanted(band_hz=(0.2, 0.1))}, "the lower first"),
        ({}, {"wanted": Wanted(band_hz=(0.1, 0.6))}, "at most 0.49"),
        ({}, {"wanted": Wanted("multisine", band_hz=(0.1001, 0.1002))}, "no two lines"),
        ({}, {"wanted": Wanted(clock_s=1.5)}, "whole multiples"),
        ({}, {"wanted": Wanted(clock_s=100.0)}, "fewer than 31 bits"),
        ({}, {"wanted": Wanted(lines=10**9)}, "--lines"),
        ({}, {"wanted": Wanted("multisine", lines=20_000), "duration_s": 5e5}, "at 500000 instants are too many"),
    ],
)  # fmt: skip
def test_what_cannot_be_designed_is_refused(change, more, said):
    with pytest.raises((UsageError, NotIdentifiable), match=said):
        design_excitation(replace(pair(), **change), replace(REQUEST, **more))


def test_an_unstable_plant_is_refused():
    m = pair()
    A = m.A / 0.94  # poles of 1.01
    P = solve_discrete_are(A.T, m.C.T, np.eye(4), np.eye(2))
    covariance = m.C @ P @ m.C.T + np.eye(2)
    K = np.linalg.solve(covariance, m.C @ P @ A.T).T
    with pytest.raises(NotIdentifiable, match="unstable in open loop; --controller"):
        design_excitation(replace(m, A=A, K=K, innovation_covariance=covariance), REQUEST)
    with pytest.raises(NotIdentifiable, match="predictor A − K C is unstable"):
        design_excitation(replace(m, A=A), REQUEST)
