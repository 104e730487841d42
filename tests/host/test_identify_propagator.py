"""Check the recursive state space: its least squares against batch solutions, exactness, tracking, gaps, bad input."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.filters import replay_filter
from aeolid.identify.propagator import Propagator, choose_states
from aeolid.identify.small_rls import GROWTH_MAX, REGULARISATION, SmallRls
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.models.model_file import Signal
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.plants.moving_poles import A, B, C, poles_at, simulate_moving_poles


def pole_errors(found, true):
    distance = abs(np.asarray(found)[:, None] - np.asarray(true)[None])
    rows, columns = linear_sum_assignment(distance)
    return distance[rows, columns]


def settings(**changes):
    return {"inputs": 2, "outputs": 2, "past": 8, "order": 4} | changes


def clean_record(samples=1500, seed=0):
    """Return the fourth-order example without noise and its predictor, deadbeat for p ≥ 4."""
    record = simulate_fourth_order(samples, seed, feedback=0.25, noise_variance=0.0)
    theta = identify_varx([record], past=8, order=4, regularization="none").markov_parameters[:, :32]
    return record, theta


def run(tracker, record, start=0):
    moved = [
        tracker.update(u, y)
        for u, y in zip(record.matrix("input")[start:], record.matrix("output")[start:], strict=True)
    ]
    return sum(moved)


@pytest.mark.parametrize("forgetting", [0.95, 1.0])
def test_small_rls_is_weighted_least_squares(forgetting):
    """After every sample Θ is that of Σ λ^{N−i} |y_i − Θ φ_i|² + λ^N ρ |Θ|²; a restart from all samples is the same."""
    random = np.random.default_rng(1)
    phi, target = random.standard_normal((60, 4)), random.standard_normal((60, 2))
    small = SmallRls(2, 4, forgetting, regularisation=0.1)
    for i in range(60):
        residual = small.update(phi[i], target[i])
        weight = forgetting ** np.arange(i, -1, -1)
        gram = (phi[: i + 1] * weight[:, None]).T @ phi[: i + 1] + forgetting ** (i + 1) * 0.1 * np.eye(4)
        expected = np.linalg.solve(gram, (phi[: i + 1] * weight[:, None]).T @ target[: i + 1]).T
        np.testing.assert_allclose(small.theta, expected, atol=1e-10)
        np.testing.assert_allclose(small.root @ small.root.T @ gram, np.eye(4), atol=1e-9)
        np.testing.assert_allclose(residual, target[i] - expected @ phi[i], atol=1e-10)
    again = SmallRls(2, 4, forgetting, regularisation=0.1)
    again.restart(phi, target)
    np.testing.assert_allclose(again.theta, small.theta, atol=1e-10)
    np.testing.assert_allclose(again.root @ again.root.T, small.root @ small.root.T, atol=1e-10)


def test_small_rls_stays_bounded_when_nothing_moves():
    small = SmallRls(1, 3, 0.9)
    for _ in range(5000):
        small.update(np.zeros(3), np.zeros(1))
    assert (small.root**2).sum(axis=1).max() <= GROWTH_MAX / REGULARISATION / 0.9 * 1.01
    small.update(np.array([1.0, 0.0, 0.0]), np.array([2.0]))
    assert np.isfinite(small.theta).all()


def test_a_restart_long_after_its_start_is_solvable_without_excitation():
    """λ^N of a long memory is zero in binary64; a direction that never moved keeps a little of its start."""
    random, small = np.random.default_rng(2), SmallRls(1, 3, 0.5)
    phi = random.standard_normal((4000, 3)) * [1.0, 1.0, 0.0]
    small.restart(phi, phi @ np.array([[2.0], [-1.0], [5.0]]))
    np.testing.assert_allclose(small.theta, [[2.0, -1.0, 0.0]], atol=1e-9)
    for _ in range(200):
        row = random.standard_normal(3)
        small.update(row, np.array([row @ [2.0, -1.0, 5.0]]))
    np.testing.assert_allclose(small.theta, [[2.0, -1.0, 5.0]], atol=1e-6)


@pytest.mark.parametrize("selection", ["combined", "rows"])
@pytest.mark.parametrize("memory", [0, 300])
def test_clean_data_give_the_exact_model(selection, memory):
    """No noise and a deadbeat predictor: poles, impulse response and gain are exact in whatever coordinates."""
    record, theta = clean_record()
    tracker = Propagator(**settings(selection=selection, memory=memory, forgetting=0.99))
    tracker.update_markov(theta)
    assert run(tracker, record) == 1500 - 8
    true = fourth_order()
    assert pole_errors(tracker.poles, np.linalg.eigvals(true.A)).max() < 1e-5
    model = tracker.model((Signal("u1"), Signal("u2")), (Signal("y1"), Signal("y2")), 1.0)
    for k in range(5):
        power = np.linalg.matrix_power
        np.testing.assert_allclose(model.C @ power(model.A, k) @ model.B, true.C @ power(true.A, k) @ true.B, atol=1e-4)
    assert np.linalg.matrix_rank(tracker.selection) == 4
    if selection == "rows":
        assert set(np.unique(tracker.selection)) == {0.0, 1.0} and np.all(tracker.selection.sum(axis=1) == 1)


def test_units_and_offsets_change_nothing_but_the_numbers_units():
    record, theta = clean_record()
    gains, offsets = np.array([1e-3, 57.3, 1e6, 0.02]), np.array([5.0, -3.0, 1e4, 0.0])
    base = Propagator(**settings(forgetting=0.98))
    other = Propagator(**settings(forgetting=0.98, offset=offsets, scale=gains))
    base.update_markov(theta)
    other.update_markov(gains[2:, None] * theta / np.tile(gains, 8))
    run(base, record)
    run(other, replace(record, values=record.values * gains + offsets))
    np.testing.assert_allclose(other.A, base.A, atol=1e-6)
    names = (Signal("a"), Signal("b"))
    here, there = base.model(names, names, 1.0), other.model(names, names, 1.0)
    np.testing.assert_allclose(there.C @ there.B * gains[:2] / gains[2:, None], here.C @ here.B, atol=1e-6)
    assert [s.offset for s in there.inputs] == [5.0, -3.0]


def test_a_snapshot_equal_to_the_last_changes_nothing():
    """States computed anew from the same Ξ are those that were used.

    C is the same to rounding; A and K differ by what e is taken from: the present C for all samples, or the C then.
    """
    record = simulate_moving_poles(900, 3, "none")
    theta = replay_filter(record.matrix("input"), record.matrix("output"), past=5, precision="f64").theta
    tracker = Propagator(inputs=2, outputs=2, past=5, order=3, forgetting=0.97, memory=2000)
    tracker.update_markov(theta)
    run(tracker, record)
    names = (Signal("a"), Signal("b"))
    before = tracker.model(names, names, 1.0)
    tracker.update_markov(theta)
    after = tracker.model(names, names, 1.0)
    np.testing.assert_allclose(after.C, before.C, atol=1e-8)
    np.testing.assert_allclose(after.A, before.A, atol=5e-3)


def test_a_snapshot_gives_the_model_that_its_parameters_would_have_given_all_along():
    """With memory for all samples, what came before the last Ξ is forgotten but S."""
    record = simulate_moving_poles(900, 4, "none")
    u, y = record.matrix("input"), record.matrix("output")
    early, late = (replay_filter(u[:k], y[:k], past=5, precision="f64").theta for k in (100, 900))
    options = {"inputs": 2, "outputs": 2, "past": 5, "order": 3, "forgetting": 0.99, "memory": 2000}
    followed, fresh = Propagator(**options), Propagator(**options)
    followed.update_markov(early)
    run(followed, record)
    fresh.selection = followed.selection
    for theta, tracker in ((early, fresh), (late, followed), (late, fresh)):
        if theta is early:
            run(tracker, record)
        else:
            tracker.update_markov(theta)
    names = (Signal("a"), Signal("b"))
    here, there = (t.model(names, names, 1.0) for t in (followed, fresh))
    for key in "ABCK":
        np.testing.assert_allclose(getattr(here, key), getattr(there, key), atol=1e-9)
    kept = Propagator(**options | {"memory": 0})
    kept.update_markov(early)
    run(kept, record)
    kept.update_markov(late)
    assert abs(kept.A - here.A).max() > 0.01


def test_gap_empties_the_window_and_no_window_spans_it():
    record, theta = clean_record()
    values = record.values.copy()
    values[[400, 401, 700], [0, 3, 2]] = np.nan
    tracker = Propagator(**settings(forgetting=0.98, memory=1400))
    tracker.update_markov(theta)
    broken = replace(record, values=values)
    assert run(tracker, broken) == 1500 - 8 - (2 + 8) - (1 + 8)
    tracker.update_markov(theta)
    assert pole_errors(tracker.poles, np.linalg.eigvals(fourth_order().A)).max() < 1e-5


def test_varmax_takes_the_residuals_of_the_filter():
    """Ξ of blocks [u; y; e], e with each sample, or formed as y − Ξ z."""
    record = simulate_fourth_order(6000, 2, feedback=0.25, noise_variance=0.49)
    found = identify_varmax([record], past=6, order=4)
    theta, u, y = found.markov_parameters[:, : 6 * 6], record.matrix("input"), record.matrix("output")
    replayed = replay_filter(u, y, past=6, method="els", precision="f64")
    for given in (True, False):
        tracker = Propagator(**settings(past=6, model_set="varmax", forgetting=0.999))
        tracker.update_markov(theta)
        for k in range(len(u)):
            tracker.update(u[k], y[k], replayed.residual[k] if given else None)
        assert pole_errors(tracker.poles, np.linalg.eigvals(fourth_order().A)).max() < 0.03


@pytest.mark.parametrize("method", ["rls", "fast-rls", "lattice"])
def test_poles_are_followed_through_a_jump_like_by_a_refit(method):
    """One run, snapshots every 20 samples: 135 samples after the jump the third pole is where it now is."""
    record = simulate_moving_poles(1000, 5, "jump")
    u, y = record.matrix("input"), record.matrix("output")
    tracker = Propagator(inputs=2, outputs=2, past=5, order=3, forgetting=0.98)
    late, early = [], []
    for k in range(1000):
        if k >= 200 and k % 20 == 0:
            tracker.update_markov(
                replay_filter(
                    u[:k], y[:k], past=5, method=method, forgetting=0.98, offset=np.zeros(4), scale=np.ones(4)
                ).theta
            )
            (late if k > 800 else early if k < 665 else []).append(np.sort(tracker.poles.real))
        tracker.update(u[k], y[k])
    np.testing.assert_allclose(np.mean(early[10:], axis=0), np.sort(poles_at(0, "jump")), atol=0.04)
    np.testing.assert_allclose(np.mean(late, axis=0), np.sort(poles_at(900, "jump")), atol=0.06)


def test_plant_of_the_study_is_as_published():
    assert np.allclose(np.sort(np.linalg.eigvals(A).real), [0.3, 0.5, 0.8])
    assert poles_at(2665, "drift") == pytest.approx([0.5, -0.2, 0.7]) and poles_at(665, "jump")[2] == 0.5
    assert abs(np.linalg.eigvals(A - 0.25 * B @ C)).max() < 1
    with pytest.raises(UsageError, match="'leap' is none of none, drift, jump"):
        poles_at(3, "leap")


def test_signal_to_noise_ratio_is_as_asked():
    clean, noisy = (simulate_moving_poles(20_000, 1, "none", snr_db=s).matrix("output") for s in (300.0, 25.0))
    ratio = np.mean(10 * np.log10(clean.var(axis=0) / (noisy - clean).var(axis=0)))
    assert ratio == pytest.approx(25.0, abs=0.3)


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"future": 9}, "future window 9"),
        ({"order": 17}, "order 17 is not within 1 … 16"),
        ({"forgetting": 0.3}, "forgetting 0.3"),
        ({"feedthrough": (2,)}, "names an input that is not within 0 … 1"),
        ({"model_set": "arx"}, "'arx' is none of varx, varmax"),
        ({"selection": "best"}, "'best' is none of combined, rows"),
        ({"memory": 6000}, "memory 6000"),
        ({"scale": [1.0, 1.0, 0.0, 1.0]}, "scale must be above 0"),
        ({"offset": [1.0]}, "offset holds 1 values, 4 are needed"),
    ],
)
def test_bad_settings_are_named(changes, words):
    with pytest.raises(UsageError, match=words):
        Propagator(**settings(**changes))


def test_bad_snapshots_and_samples_are_named():
    tracker = Propagator(**settings())
    with pytest.raises(DataError, match=r"shape \(2, 31\), \(2, 32\) is needed"):
        tracker.update_markov(np.zeros((2, 31)))
    with pytest.raises(DataError, match="not finite"):
        tracker.update_markov(np.full((2, 32), np.inf))
    with pytest.raises(NotIdentifiable, match="show 0 states above rounding, 4 were asked for"):
        tracker.update_markov(np.zeros((2, 32)))
    with pytest.raises(UsageError, match="u holds 3 values, 2 are needed"):
        tracker.update(np.zeros(3), np.zeros(2))
    with pytest.raises(NotIdentifiable, match="0 samples have come with a full window, 8 are needed"):
        tracker.model((), (), 1.0)
    assert np.isnan(tracker.poles).all() and not tracker.update(np.zeros(2), np.zeros(2))


def test_batches_of_another_shape_are_refused_and_no_inputs_are_fine():
    """Transposed samples have as many numbers: they must not be taken for others."""
    tracker, u, y = Propagator(**settings()), np.zeros((40, 2)), np.zeros((40, 2))
    for wrong, words in (
        ((u.T, y.T), r"u has shape \(2, 40\), \(samples, 2\) is needed"),
        ((u, np.zeros((40, 3))), r"y has shape \(40, 3\)"),
        ((u[:30], y), "hold 30, 40 and 30 samples"),
        ((u, y, np.zeros((40, 1))), r"e has shape \(40, 1\)"),
    ):
        with pytest.raises(UsageError, match=words):
            tracker.update_many(*wrong)
    alone = Propagator(inputs=0, outputs=2, past=3, order=2)
    assert alone.update_many(np.zeros((20, 0)), y[:20]).shape == (17, 8)


def test_rows_are_chosen_by_size_too():
    """Of two independent rows and their small multiples the large ones are taken."""
    large = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0]])
    stacked = np.vstack([large, 0.01 * large, 0.001 * large[::-1]])
    chosen = choose_states(stacked, np.random.default_rng(0).standard_normal((500, 4)), 2, False)
    assert set(np.flatnonzero(chosen.sum(axis=0))) == {0, 1}
