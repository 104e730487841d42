"""Hold the answers that prediction-error steps stand behind: tight bands over wrong modes end, right ones stay."""

from dataclasses import replace

import numpy as np
import pytest
from study_modules import load_study

from aeolid.errors import UsageError
from aeolid.identify.choices import CONFIRMED, Choices, with_choices_made
from aeolid.identify.contrast import APART, farthest
from aeolid.identify.error_weight import log_det, weight_of
from aeolid.identify.order import TOLERANCE, worth_a_state
from aeolid.identify.positive_real import RANK
from aeolid.identify.subspace import ScaledModel
from aeolid.identify.truncation import WindowCheck
from aeolid.identify.varx import identify_varx
from aeolid.models.prediction import predict, vaf
from aeolid.plants.hawt import simulate_closed_loop
from aeolid.record import Channel, Record

stress = load_study("identify_stress")
from stress_plants import draw  # noqa: E402  # the study names its folder


def records_of(drawn):
    """Return the recordings of a drawn plant."""
    inputs = drawn.plant.B.shape[1]
    names = [f"u{i}" for i in range(inputs)] + [f"y{i}" for i in range(len(drawn.plant.C))]
    channels = tuple(Channel(n, "", "input" if n[0] == "u" else "output") for n in names)
    step = drawn.plant.sample_time_s
    return [Record(np.arange(len(v)) * step, v, channels, step, "drawn", "0") for v in drawn.recordings]


def furthest_off(found, plant, poles):
    """Return by how many deviations the nearest identified mode is off the worst of these poles of the plant."""
    off = []
    for pole in poles:
        s = np.log(pole) / plant.sample_time_s
        hz, zeta = abs(s) / (2 * np.pi), -s.real / abs(s)
        near = min(found.modes, key=lambda m: abs(np.log(m.eigenvalue / pole)))
        off += [abs(near.frequency_hz - hz) / near.frequency_std_hz, abs(near.damping - zeta) / near.damping_std]
    return max(off)


@pytest.fixture(scope="module")
def overfitted():
    """Return a recording of 633 samples whose window takes 152 coefficients, and the plant."""
    drawn = draw(1, 146)
    return records_of(drawn), drawn


def test_a_window_with_too_many_coefficients_for_its_samples_gets_the_likeliest_modes(overfitted):
    """With 591 windows for 152 coefficients the deviations know nothing of what Ξ is off by; the steps do."""
    records, drawn = overfitted
    plain = identify_varx(records, past=38, order=6)
    held = identify_varx(records, past=38, order=6, contrast="apart")
    told = drawn.poles[np.array(drawn.share) > 0.05]
    assert furthest_off(plain, drawn.plant, told) > 5 > 3 > furthest_off(held, drawn.plant, told)
    facts = held.to_json()["contrast"]
    assert facts["taken"] and facts["failed"] is None and facts["apart"] > APART and "contrast" not in plain.to_json()
    assert held.model.K.any() and any("prediction-error steps" in n for n in held.notes)


def test_an_answer_that_the_steps_agree_with_stays_as_it_is():
    """Open loop, white excitation, 2000 samples: subspace and likelihood differ by less than the deviations."""
    drawn = draw(1, 32)
    records = records_of(drawn)
    plain, held = (identify_varx(records, past=20, contrast=how) for how in ("none", "apart"))
    facts = held.to_json()["contrast"]
    assert facts["apart"] < APART and not facts["taken"] and facts["reason"] is None
    np.testing.assert_array_equal(plain.model.A, held.model.A)
    assert identify_varx(records, past=20, contrast="always").to_json()["contrast"]["taken"]
    with pytest.raises(UsageError, match="contrast"):
        identify_varx(records, past=20, contrast="often")


def test_steps_stand_in_for_a_window_that_cannot_be_longer_only_where_their_end_is_taken(overfitted):
    found = identify_varx(overfitted[0], past=38, order=6)
    check = WindowCheck(None, 38, 25, None, 0.0, "whether it is long enough cannot be said")
    short = WindowCheck(False, 38, 76, 1.0, 9.0, "the past window is too short")

    few = "100 windows of 1 outputs are 3.0 a parameter of a model of order 6, fewer than 10: the answer may be chance"
    scarce = replace(found, notes=(few,), extra={"contrast": {"taken": True, "reason": None}, "scarce": few})

    def told(facts, check=check):
        result = found if facts is None else replace(found, extra={"contrast": facts})
        return with_choices_made(result, Choices(38, (), check=check))

    taken, said = {"taken": True, "reason": None}, CONFIRMED.format(38)
    assert told(taken).extra["bands_hold"] is True and said in told(taken).notes
    doubtful = [told(None), told({"taken": False, "reason": None}), told(taken, short)]
    doubtful += [told({"taken": False, "reason": "steps do not converge"}, WindowCheck(True, 38, 76, None, 0.5, ""))]
    doubtful.append(with_choices_made(scarce, Choices(38, (), check=check)))
    for result in doubtful:
        assert result.extra["bands_hold"] is False and result.extra["bands_reason"]
        assert any(n.startswith("WARNING") for n in result.notes) and said not in result.notes


def test_an_order_too_low_is_said_and_the_model_stays():
    """The turbine has more than two states: what is left over is not white, and no end of steps has bands that hold."""
    record = simulate_closed_loop(4000, 5)
    found = identify_varx([record], past=20, order=2, contrast="apart")
    facts = found.to_json()["contrast"]
    assert not facts["taken"] and "white" in facts["failed"] and "do not hold" in facts["reason"]
    np.testing.assert_array_equal(found.model.A, identify_varx([record], past=20, order=2).model.A)


def test_the_end_is_taken_where_nothing_else_was_asked_and_stands_in_for_no_window_without_an_end():
    """Without measurement noise one combination of the turbine's outputs is exact: the subspace model predicts the next
    recording worse in every output. The poles agree, so that the end is taken whatever the steps had left."""
    record, following = simulate_closed_loop(2000, 34), simulate_closed_loop(2000, 35)
    both = record.names("input")
    plain, held = (
        identify_varx([record], past=20, order=7, feedthrough=both, contrast=how) for how in ("none", "always")
    )
    facts = held.to_json()["contrast"]
    assert facts["taken"] and facts["ended"] and facts["apart"] < APART
    u, y = following.matrix("input"), following.matrix("output")
    assert (vaf(y, predict(held.model, u, y)) > vaf(y, predict(plain.model, u, y))).all()
    unended = replace(held, extra={"contrast": {"taken": True, "ended": False, "reason": None}})
    check = WindowCheck(None, 20, 13, None, 0.0, "whether it is long enough cannot be said")
    assert with_choices_made(unended, Choices(20, (), check=check)).extra["bands_hold"] is False


def test_steps_keep_poles_inside_where_the_model_is_to_be_stable():
    """The turbine's speed integrates; with `stable` the pole stays inside and the steps are taken all the same."""
    record = simulate_closed_loop(2000, 33)
    found = identify_varx([record], past=20, order=7, feedthrough=record.names("input"), contrast="always", stable=True)
    assert found.to_json()["contrast"]["steps"] > 0 and abs(np.linalg.eigvals(found.model.A)).max() < 1


def test_the_criterion_is_free_of_units_falls_to_no_end_and_has_the_derivative_of_its_weight():
    random = np.random.default_rng(0)
    root, scale = random.standard_normal((3, 5)), np.diag([1.0, 30.0, 0.2])
    covariance, change = root @ root.T, random.standard_normal((3, 3))
    change = 1e-6 * (change + change.T)
    W = weight_of(covariance, 0.0)
    slope = log_det(covariance + change, 0.0) - log_det(covariance - change, 0.0)
    assert slope == pytest.approx(2 * np.trace(W @ W.T @ change) / 3, rel=1e-6)
    moved = log_det(scale @ covariance @ scale, 0.0) - log_det(covariance, 0.0)
    assert moved == pytest.approx(2 * np.log(np.diag(scale)).mean(), rel=1e-9)
    np.testing.assert_allclose(W @ W.T, np.linalg.inv(covariance), rtol=0.05)
    exact = root[:, :2] @ root[:, :2].T
    assert log_det(exact, 0.0) > np.log(np.diag(exact)).mean() + np.log(RANK) / 3 - 3
    assert log_det(np.full((2, 2), np.nan), 0.0) == np.inf


def model_with(*poles):
    """Return a model with these real poles."""
    n = len(poles)
    return ScaledModel(
        np.diag(poles), np.ones((n, 1)), np.ones((1, n)), np.zeros((1, 1)), np.zeros((n, 1)), np.eye(1), ""
    )


def test_the_distance_is_in_deviations_and_of_known_poles():
    spread = np.zeros((2, 2, 2))
    spread[:, 0, 0] = spread[:, 1, 1] = 0.01**2
    before = model_with(0.9, 0.5)
    order = np.linalg.eigvals(before.A)
    pole, apart = farthest(before, model_with(0.92, 0.5), spread)
    assert pole == pytest.approx(0.9) and apart == pytest.approx(2.0, rel=1e-3)
    spread[int(np.argmax(order))] *= 100  # not known any more
    assert farthest(before, model_with(0.92, 0.51), spread)[1] == pytest.approx(1.0, rel=1e-3)


def test_many_held_out_samples_tell_smaller_modes():
    assert worth_a_state(100) == worth_a_state(1000) == TOLERANCE
    assert worth_a_state(20_000) < TOLERANCE / 5


def test_two_near_modes_told_as_one_are_found_by_more_states():
    """422 samples of fifteen states, of which the held-out error wants fourteen: one more moves a mode by five
    deviations. Where modes are told apart more states move none."""
    facts = stress.identify(draw(3, 143))[1]
    assert facts["crowded"]["apart"] > 4 and facts["crowded"]["nats"] > 10 and not facts["bands_hold"]
    assert "two modes may be told as one" in facts["bands_reason"]
    assert any(n.startswith("WARNING") and "name a higher order" in n for n in facts["notes"])
    facts = stress.identify(draw(1, 32))[1]
    assert "crowded" not in facts and facts["bands_hold"]
