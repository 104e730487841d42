"""Hold the choice of the order to what each criterion says by its definition."""

import json
from dataclasses import replace

import numpy as np
import pytest
from study_modules import load_study

from aeolid.cli.main import main
from aeolid.errors import NotIdentifiable, UsageError
from aeolid.identify.compressed import compress
from aeolid.identify.lpv.matrices import least_squares as shared
from aeolid.identify.markov import estimate_markov
from aeolid.identify.order import (
    OrderChoice,
    decide,
    held_out_stretches,
    information_costs,
    require_order,
    smallest_sufficient,
)
from aeolid.identify.subspace import find_states, least_squares, system_matrices
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import find_scaling
from aeolid.plants.lti import simulate_fourth_order


@pytest.fixture(scope="module")
def record():
    return simulate_fourth_order(1500, 3, feedback=0.25)


def test_the_smallest_within_the_tolerance_is_taken_and_said():
    losses = [0.0, -1.0, -1.19, -1.2, -1.205, np.inf]
    choice = smallest_sufficient(losses)
    assert choice.order == 3 and choice.losses == tuple(losses)
    assert choice.reason == (
        "order 3: the smallest whose one-step error on the held-out last 30% is within 2% per output of the best "
        "(order 5 of 1 to 6)"
    )
    other = smallest_sufficient(losses, tolerance=0.001, what="joint order", of=" of all", each="channel", tail="; so")
    assert other.order == 5 and other.reason.startswith("joint order 5: the smallest whose one-step error of all on")
    assert other.reason.endswith("within 0.1% per channel of the best (joint order 5 of 1 to 6); so")
    assert shared is least_squares


def plain_criteria(factor, basis, z, through, most):
    """Return N Σ log P + cost (n (2 l + r) + l d + l), the predictor stepped sample by sample."""
    past, costs = factor.past, {"aic": [], "bic": []}
    for n in range(1, most + 1):
        T = basis.state_map(n)
        m = system_matrices(factor, T, through)
        x, errors = T @ z[:past].ravel(), []
        for row in z[past:]:
            errors.append(row[2:] - m.C @ x - m.D @ row[:2])
            x = m.A @ x + m.B @ row[:2] + m.K @ errors[-1]
        N, k = len(errors), n * (2 * 2 + 2) + 2 * sum(through) + 2
        power = N * np.log(np.var(errors, axis=0)).sum()
        costs["aic"].append(power + 2 * k)
        costs["bic"].append(power + np.log(N) * k)
    return costs


def test_information_criteria_are_those_of_the_predictors_run_in_plain_words():
    record, through = simulate_fourth_order(300, 1, feedback=0.25), (True, False)
    scaling = find_scaling([record])
    factor = compress([record], scaling, 4).whole
    basis = find_states(factor, estimate_markov(factor, through, "gcv").theta, 4)
    (z,) = held_out_stretches([record], scaling, 4, everything=True)
    found, expected = information_costs(factor, basis, [z], through, 7), plain_criteria(factor, basis, z, through, 7)
    assert set(found) == set(expected) == {"aic", "bic"} and len(z) == 300
    for name, values in found.items():
        np.testing.assert_allclose(values, expected[name], rtol=1e-9)
    assert information_costs(factor, basis, [], through, 7) == {}


@pytest.mark.parametrize("method", [identify_varx, identify_varmax])
def test_every_criterion_decides_when_asked_and_the_others_are_said(record, method):
    for criterion, start in (
        ("held-out", "order 4: the smallest whose one-step error on the held-out last 30%"),
        ("bic", "order 4: of least BIC among 1 to 12"),
        ("gap", "order 4: the singular values fall most after 4"),
    ):
        result = method([record], past=6, order_criterion=criterion, uncertainty="none")
        reason, answers = result.order_choice.reason, result.to_json()["order_criteria"]
        assert reason.startswith(start) and set(answers) == {"held-out", "aic", "bic", "gap"}
        assert result.order == answers[criterion] == 4 and result.settings.order_criterion == criterion
        words = {"held-out": "the held-out error says 4", "aic": f"AIC says {answers['aic']}", "bic": "BIC says 4"}
        assert all((text in reason) == (name != criterion) for name, text in words.items())
        assert "the singular values fall most after 4 (factor" in reason


def test_where_nothing_can_be_held_out_bic_decides_and_without_it_the_gap():
    values = np.array([9.0, 8.0, 1.0, 0.5])
    choice = decide("held-out", None, {"aic": [3, 2, 1, 0], "bic": [3, 2, 0, 1]}, values, 4)
    assert choice.order == 3 and choice.reason == (
        "order 3: of least BIC among 1 to 4; too few samples to hold some out; AIC says 4; "
        "the singular values fall most after 2 (factor 8.0)"
    )
    choice = decide("held-out", None, {}, values, 4)
    assert choice.order == 2 and choice.reason.endswith("after 2 (factor 8.0); too few samples to hold some out")
    short = identify_varx([simulate_fourth_order(150, 1)], past=6).order_choice
    assert set(short.answers) == {"aic", "bic", "gap"} and short.order == short.answers["bic"]
    kept = OrderChoice(5, "order 5: because", (0.0,) * 5)
    assert decide("held-out", kept, {}, values, 4).reason.startswith("order 5: because; the singular values")


def test_the_run_in_of_a_stretch_does_not_count_as_held_out():
    """p = 20, 200 samples: 60 are predicted, 80 would be needed; the 20 before them choose nothing."""
    choices = [
        identify_varx([simulate_fourth_order(n, 1)], past=20, uncertainty="none").order_choice for n in (200, 270)
    ]
    assert "held-out" not in choices[0].answers and "too few samples to hold some out" in choices[0].reason
    assert "held-out" in choices[1].answers


@pytest.mark.parametrize("method", [identify_varx, identify_varmax])
def test_a_channel_that_begins_late_is_cut_behind_its_beginning(method):
    """What lies before holds no complete window: the answer is that of the rest alone, held-out error and steps too."""
    whole = simulate_fourth_order(3000, 1, feedback=0.25)
    values = whole.values.copy()
    values[:2300, 0] = np.nan
    late, cut = replace(whole, values=values), whole.slice(2300, 3000)
    first, second = (method([r], past=6, uncertainty="none").order_choice for r in (late, cut))
    assert first.order == second.order == 4 and first.answers["held-out"] == second.answers["held-out"] == 4
    first, second = (method([r], past=6, order=4, uncertainty="none", refined=True) for r in (late, cut))
    said = (next(n for n in r.notes if "refined" in n).split(":")[0] for r in (first, second))
    assert len(set(said)) == 1 and not any("on which steps would be tried" in n for n in first.notes)
    assert first.windows == second.windows


def test_exact_data_have_the_exact_order_by_every_criterion():
    """No order beyond the singular values above rounding is tried."""
    clean = simulate_fourth_order(600, 2, noise_variance=0.0)
    answers = identify_varx([clean], past=6, regularization="none", uncertainty="none").order_choice.answers
    assert answers == {"held-out": 4, "aic": 4, "bic": 4, "gap": 4}


def test_bad_choices_are_named(record):
    with pytest.raises(UsageError, match="order criterion 'mdl' is none of held-out, aic, bic, gap"):
        identify_varx([record], past=6, order_criterion="mdl")
    clean = simulate_fourth_order(600, 2, noise_variance=0.0)
    with pytest.raises(NotIdentifiable, match="order 8 asked for, the data carry 4 singular values above rounding"):
        identify_varx([clean], past=6, order=8, regularization="none")


def test_outputs_that_follow_from_nothing_are_refused():
    with pytest.raises(NotIdentifiable, match="no state: nothing of the outputs follows from the past, 0 singular"):
        require_order(1, 0, "a.csv")
    require_order(2, 2, "a.csv")


ROLES = "[recording]\nsample_time_s = 1.0\n" + "".join(
    f'[[channel]]\nname = "{n}"\nunit = "V"\nrole = "{role}"\n'
    for n, role in (("u1", "input"), ("u2", "input"), ("y1", "output"), ("y2", "output"))
)


def test_the_command_takes_criterion_and_refinement(tmp_path, record, capsys):
    (tmp_path / "roles.toml").write_text(ROLES)
    np.savetxt(tmp_path / "rec.csv", record.values, delimiter=",", header="u1,u2,y1,y2", comments="")
    base = ["identify", str(tmp_path / "rec.csv"), "--roles", str(tmp_path / "roles.toml"), "--past", "6", "--out",
            str(tmp_path / "model.json")]  # fmt: skip
    facts = tmp_path / "facts.json"
    assert main([*base, "--order-criterion", "bic", "--refine", "--json", str(facts)]) == 0
    found = json.loads(facts.read_text())
    assert found["order_reason"].startswith("order 4: of least BIC") and found["order_criteria"]["held-out"] == 4
    assert found["settings"]["refined"] is True and found["settings"]["order_criterion"] == "bic"
    assert found["refinement"]["held_out_error_power_lower_by"] >= 0
    assert any("refined" in note for note in found["notes"])
    capsys.readouterr()
    for options, words in (
        (["--order-criterion", "mdl"], "'mdl' is none of"),
        (["--order-criterion", "bic", "--order", "4"], "decides where --order is auto, not 4"),
        (["--order-criterion", "bic", "--method", "fir"], "--method fir chooses its own way"),
        (["--refine", "--method", "ort"], "--refine is for --method varx, varmax, lpv and lpv-kernel, not ort"),
        (["--no-refine", "--method", "fir"], "not fir"),
        (["--refine", "--uncertainty", "bootstrap"], "repeats the subspace estimate"),
    ):
        assert main([*base, *options]) == 2
        assert words in " ".join(capsys.readouterr().err.split())


def test_the_study_counts_and_writes(tmp_path, capsys):
    study = load_study("orders")
    assert study.main(["--runs", "2", "--case", "example N 500", "--out", str(tmp_path)]) == 0
    (row,) = json.loads((tmp_path / "orders.json").read_text())
    assert row["bic"] == {"hit": 2, "above": 0, "of": 2} and row["held-out"]["of"] == 2
    assert (tmp_path / "orders.txt").read_text() == capsys.readouterr().out
    assert study.random_record(50, 3).values.shape == (50, 4)
