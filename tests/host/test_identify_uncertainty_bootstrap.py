"""Check the block multiplier bootstrap: scores, signs, perturbations, and that it says what many runs scatter."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from study_modules import load_study

from aeolid.cli.main import main
from aeolid.errors import UsageError
from aeolid.identify.bootstrap import block_length, collect_scores, perturbations, perturbed, signs
from aeolid.identify.markov import estimate_markov, regressor_columns
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.subspace import find_states, regressed_matrices, system_matrices
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import factorise, find_scaling
from aeolid.plants.lti import simulate_fourth_order

PAST, THROUGH = 6, (True, False)
KEEP = [*range(24), 24]  # the past, and u1 now


@pytest.fixture(scope="module")
def records():
    first, second = (simulate_fourth_order(n, n, feedback=0.25, noise_variance=0.49) for n in (900, 700))
    values = second.values.copy()
    values[300:303, 1] = np.nan
    return [first, replace(second, values=values)]


@pytest.fixture(scope="module")
def parts(records):
    scaling = find_scaling(records)
    factor = factorise(records, scaling, PAST)
    estimate = estimate_markov(factor, THROUGH, "none")
    return scaling, factor, estimate, collect_scores(records, scaling, factor, estimate.theta, KEEP)


def test_scores_are_those_of_every_window(records, parts):
    """Sample by sample; they sum to nothing (the normal equations), and windows with a hole count nothing."""
    scaling, factor, estimate, scores = parts
    assert regressor_columns(factor, THROUGH) == KEEP
    cells = []
    for record in records:
        z = scaling.apply(record.columns(scaling.names))
        for k in range(PAST, len(z)):
            row = z[k - PAST : k + 1].ravel() - factor.mean
            e = row[26:] - estimate.theta @ row[:26]
            cells.append(np.outer(e, row[KEEP]) if np.isfinite(row).all() else np.zeros((2, 25)))
    assert scores.length == 1 and np.flatnonzero(scores.first).tolist() == [0, 894]
    np.testing.assert_allclose(scores.sums, cells, atol=1e-10)
    assert abs(scores.sums.sum(axis=0)).max() < 1e-9 * abs(scores.sums).sum()


def test_long_recordings_are_summed_in_stretches_that_add_up(monkeypatch, records, parts):
    scaling, factor, estimate, scores = parts
    monkeypatch.setattr("aeolid.identify.bootstrap.MOST_CELLS", 100)
    coarse = collect_scores(records, scaling, factor, estimate.theta, KEEP)
    assert coarse.length == 16 and len(coarse.first) == 56 + 44  # ⌈894/16⌉ + ⌈694/16⌉
    np.testing.assert_allclose(coarse.sums[:3], scores.sums[:48].reshape(3, 16, 2, 25).sum(axis=1), atol=1e-10)
    np.testing.assert_allclose(coarse.sums.sum(axis=0), scores.sums.sum(axis=0), atol=1e-9)


def test_signs_hold_for_blocks_of_the_mean_length(parts):
    scores = parts[3]
    drawn = signs(scores, 20.0, 400, 3)
    assert set(np.unique(drawn)) == {-1.0, 1.0}
    inside = np.flatnonzero(~scores.first)
    changes = (drawn[:, inside] != drawn[:, inside - 1]).mean()
    assert changes == pytest.approx(0.5 / 20, rel=0.05)  # a fresh sign is the old one half of the time
    for lag in (1, 10, 20):
        correlation = (drawn[:, : 800 - lag] * drawn[:, lag:800]).mean()
        assert correlation == pytest.approx(0.95**lag, abs=0.03)
    assert abs((drawn[:, 893] * drawn[:, 894]).mean()) < 0.2  # nothing reaches from one recording into the next
    np.testing.assert_array_equal(drawn, signs(scores, 20.0, 400, 3))
    assert (drawn != signs(scores, 20.0, 400, 4)).any()
    assert set(np.unique(signs(scores, 1.0, 3, 0)[:, :50])) == {-1.0, 1.0}


def test_a_perturbation_is_another_regression_with_the_same_windows(parts):
    """ΔΞ Ψ in the outputs gives Ξ + ΔΞ by least squares; none gives the model itself."""
    scaling, factor, estimate, _ = parts
    delta = np.zeros_like(estimate.theta)
    delta[:, KEEP] = 0.01 * np.random.default_rng(0).standard_normal((2, 25))
    full = factor.full.copy()
    full[1:, 27:29] += factor.R[:, :26] @ delta.T
    moved = replace(factor, full=full)
    again = estimate_markov(moved, THROUGH, "none")
    np.testing.assert_allclose(again.theta, estimate.theta + delta, atol=1e-10)
    direct = regressed_matrices(moved, find_states(moved, again.theta, 4).state_map(3), THROUGH)
    found = perturbed(factor, estimate, delta, 3, THROUGH, 4)
    T = find_states(factor, estimate.theta, 4).state_map(3)
    same, own = perturbed(factor, estimate, 0 * delta, 3, THROUGH, 4), system_matrices(factor, T, THROUGH)
    for name in "ABCD":
        np.testing.assert_allclose(getattr(found, name), getattr(direct, name), atol=1e-8)
        np.testing.assert_allclose(getattr(same, name), getattr(own, name), atol=1e-10)
    assert abs(found.A - same.A).max() > 1e-3 and scaling.channels == 4


@pytest.mark.parametrize("samples", [900, 130])
def test_perturbations_scatter_as_the_sandwich_says(records, samples):
    """Blocks of one window: the covariance of ΔΞ is G (Σ s sᵀ) G N/(N − rank), scores s, G = (Ψ Ψᵀ)⁻¹.

    Of 124 windows 25 regressors take 12 % of a deviation away, which the factor gives back.
    """
    record = records[0].slice(0, samples)
    scaling = find_scaling([record])
    factor = factorise([record], scaling, PAST)
    estimate = estimate_markov(factor, THROUGH, "none")
    scores = collect_scores([record], scaling, factor, estimate.theta, KEEP)
    drawn = signs(scores, 1.0, 4000, 1)
    deltas = np.array([d[0, KEEP] for d in perturbations(factor, estimate, scores, KEEP, drawn)])
    inverse = np.linalg.inv(factor.R[:, KEEP].T @ factor.R[:, KEEP])
    s = scores.sums[:, 0]
    expected = inverse @ (s.T @ s) @ inverse * factor.windows / (factor.windows - 25)
    np.testing.assert_allclose(deltas.std(axis=0), np.sqrt(np.diag(expected)), rtol=0.05)
    asymptotic = estimate.residual_covariance[0, 0] * (estimate.spread @ estimate.spread.T)[KEEP][:, KEEP]
    ratio = np.diag(expected) / np.diag(asymptotic)
    assert ratio.mean() == pytest.approx(1, abs=0.15) and np.all((ratio > 0.5) & (ratio < 1.6))


@pytest.mark.parametrize("identify", [identify_varx, identify_varmax])
def test_white_noise_gives_the_asymptotic_deviations(identify):
    """400 runs leave 3.5 % on a deviation, blocks of a tenth of a percent of 6000 windows as much."""
    record = simulate_fourth_order(6000, 2, feedback=0.25, noise_variance=0.49)
    base, other, again = (
        identify([record], past=6, order=4, uncertainty=u, bootstrap_runs=400, bootstrap_seed=s)
        for u, s in (("asymptotic", 0), ("bootstrap", 1), ("bootstrap", 1))
    )
    for first, second in zip(base.modes, other.modes, strict=True):
        assert first.frequency_hz == pytest.approx(second.frequency_hz, rel=1e-12)
        assert second.frequency_std_hz == pytest.approx(first.frequency_std_hz, rel=0.2)
        assert second.damping_std == pytest.approx(first.damping_std, rel=0.2)
    assert np.median(other.band.gain_std / base.band.gain_std) == pytest.approx(1, abs=0.1)
    assert other.extra["bootstrap"] == {"runs": 400, "failed": 0, "mean_block": 6.0, "seed": 1}
    assert json.dumps(other.to_json()) == json.dumps(again.to_json())  # the seed decides


def test_noise_that_comes_with_the_excitation_is_seen_by_the_bootstrap_alone():
    """Gusts: Σ e² ψ ψᵀ exceeds Λ Σ ψ ψᵀ by E a⁴/(E a²)² = 1.88: asymptotic deviations are 0.73 of the scatter."""
    study = load_study("coverage")
    found, said = [], {"asymptotic": [], "bootstrap": []}
    for seed in range(50):
        record = study.simulate_gusts(seed)
        for uncertainty, rows in said.items():
            result = identify_varx(
                [record], past=10, order=4, uncertainty=uncertainty, bootstrap_runs=60, regularization="none"
            )
            rows.append([[m.frequency_std_hz, m.damping_std] for m in result.modes])
        found.append([[m.frequency_hz, m.damping] for m in result.modes])
    scatter = np.std(found, axis=0, ddof=1)
    assert np.mean(np.mean(said["asymptotic"], axis=0) / scatter) == pytest.approx(0.73, abs=0.09)
    assert np.mean(np.mean(said["bootstrap"], axis=0) / scatter) == pytest.approx(1.0, abs=0.12)


def test_block_length_follows_window_and_data():
    assert block_length(20, 5000) == 20.0 and block_length(30, 600) == 20.0


def test_none_leaves_deviations_and_band_out():
    result = identify_varx([simulate_fourth_order(1000, 1)], past=8, order=4, uncertainty="none")
    assert result.band is None and "frequency_response" not in result.to_json()
    assert all(m.frequency_std_hz is None and m.damping_std is None for m in result.modes)
    assert "±" not in result.summary()


def test_what_cannot_be_is_refused(records):
    base = identify_varx(records, past=PAST, order=4, feedthrough=("u1",), regularization="none")
    streamed = StreamedMarkov(base.markov_parameters[:, :25], "stream")
    for wrong, word in (
        ({"uncertainty": "guess"}, "asymptotic, bootstrap, none"),
        ({"uncertainty": "bootstrap", "bootstrap_runs": 5}, "20 … 10000"),
        ({"uncertainty": "bootstrap", "bootstrap_seed": -1}, "negative"),
        ({"uncertainty": "bootstrap", "markov": streamed, "feedthrough": ("u1",)}, "streamed"),
    ):
        with pytest.raises(UsageError, match=word):
            identify_varx(records, past=PAST, order=4, **wrong)


def test_command_offers_and_refuses(tmp_path, capsys, records):
    rows = ["u1,u2,y1,y2", *(",".join(f"{v:.9g}" for v in row) for row in records[0].values)]
    (tmp_path / "rec.csv").write_text("\n".join(rows))
    channels = "".join(
        f'[[channel]]\nname = "{n}"\nunit = "V"\nrole = "{"input" if n[0] == "u" else "output"}"\n'
        for n in ("u1", "u2", "y1", "y2")
    )
    (tmp_path / "roles.toml").write_text(f"[recording]\nsample_time_s = 0.1\n{channels}")
    common = ["identify", str(tmp_path / "rec.csv"), "--roles", str(tmp_path / "roles.toml"), "--past", "6",
              "--order", "4", "--out", str(tmp_path / "m.json")]  # fmt: skip
    asked = ["--uncertainty", "bootstrap", "--bootstrap-runs", "30", "--bootstrap-seed", "7"]
    assert main([*common, *asked, "--json", str(tmp_path / "f.json"), "--report", str(tmp_path / "page.html")]) == 0
    facts = json.loads((tmp_path / "f.json").read_text())
    assert facts["settings"]["uncertainty"] == "bootstrap" and facts["settings"]["bootstrap_seed"] == 7
    assert facts["bootstrap"]["runs"] == 30 and len(facts["frequency_response"]["pairs"]) == 4
    pair = facts["frequency_response"]["pairs"][0]
    assert len(pair["gain_std"]) == len(facts["frequency_response"]["frequency_hz"]) >= 60
    assert "Grey: 95 %" in (tmp_path / "page.html").read_text()
    capsys.readouterr()
    for bad, word in (
        (["--uncertainty", "bootstrap", "--method", "fir"], "varx and varmax"),
        (["--uncertainty", "none", "--method", "ort"], "varx and varmax"),
        (["--bootstrap-runs", "30"], "need --uncertainty bootstrap"),
        (["--uncertainty", "often"], "none of asymptotic"),
        (["--uncertainty", "bootstrap", "--bootstrap-runs", "1"], "20 … 10000"),
        (["--uncertainty", "bootstrap", "--markov", "m.npz"], "--markov"),
    ):
        assert main([*common, *bad]) == 2
        said = " ".join(capsys.readouterr().err.split())
        assert word in said, (bad, said)
