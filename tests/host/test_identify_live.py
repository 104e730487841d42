"""Check the live modes: batches against single samples, deviations by trials, holes, numbers, bad streams."""

from itertools import pairwise

import numpy as np
import pytest

from aeolid.cli.listen_modes import _why_no_deviations
from aeolid.errors import UsageError
from aeolid.filters import replay_filter
from aeolid.identify.live import LiveModes, LiveSettings
from aeolid.identify.propagator import BATCH, Propagator
from aeolid.identify.small_rls import SmallRls
from aeolid.models.modes import modes_of
from aeolid.plants import hawt
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.plants.moving_poles import simulate_moving_poles

TRUE = modes_of(fourth_order())


def settings(record, past=6, forgetting=1.0, order=4, **changes):
    values = record.matrix("input", "output")
    defaults = {"regularisation": 0.1, "feedthrough": (), "model_set": "varx", "offset": values.mean(axis=0),
                "scale": values.std(axis=0), "order": order}  # fmt: skip
    names = record.names("input"), record.names("output")
    return LiveSettings(*names, past, record.sample_time_s, forgetting, **(defaults | changes))


def theta(record, s, stop, method="rls"):
    u, y = record.matrix("input")[:stop], record.matrix("output")[:stop]
    result = replay_filter(
        u, y, past=s.past, forgetting=s.forgetting, offset=s.offset, scale=s.scale, method=method, precision="f64",
        regularisation=s.regularisation, feedthrough=s.feedthrough, sample_time_s=s.sample_time_s,
    )  # fmt: skip
    return result.theta


def feed(live, record, start=0, stop=None, batch=100):
    u, y, stop = record.matrix("input"), record.matrix("output"), len(record) if stop is None else stop
    for k in range(start, stop, batch):
        part = slice(k, min(k + batch, stop))
        live.add(np.arange(part.start, part.stop), u[part], y[part])


@pytest.mark.parametrize("forgetting", [0.95, 1.0])
def test_many_samples_at_once_are_the_same_least_squares(forgetting):
    random = np.random.default_rng(1)
    phi, target = random.standard_normal((60, 4)), random.standard_normal((60, 2))
    one, many = (SmallRls(2, 4, forgetting, regularisation=0.1) for _ in range(2))
    for i in range(60):
        one.update(phi[i], target[i])
    for part in (slice(0, 1), slice(1, 40), slice(40, 60)):
        residual = many.update_many(phi[part], target[part])
    np.testing.assert_allclose(many.theta, one.theta, atol=1e-10)
    np.testing.assert_allclose(many.root @ many.root.T, one.root @ one.root.T, atol=1e-10)
    np.testing.assert_allclose(residual, target[40:] - phi[40:] @ one.theta.T, atol=1e-10)


@pytest.mark.parametrize("model_set", ["varx", "varmax"])
def test_batches_of_a_propagator_are_its_single_samples(model_set):
    """Windows, counts and C are the same, across missing samples; A differs by when e is taken."""
    record = simulate_moving_poles(900, 3, "none")
    u, y = record.matrix("input"), record.matrix("output")
    y[[300, 301, 500]] = np.nan
    method = "els" if model_set == "varmax" else "rls"
    found = replay_filter(u[:290], y[:290], past=5, method=method, precision="f64").theta
    options = {"inputs": 2, "outputs": 2, "past": 5, "order": 3, "forgetting": 0.98, "model_set": model_set}
    one, many = Propagator(**options), Propagator(**options)
    one.update_markov(found)
    many.update_markov(found)
    moved = sum(one.update(u[k], y[k]) for k in range(900))
    parts = [0, 1, 7, 40, 303, 303 + BATCH, 600, 900]
    rows = [many.update_many(u[a:b], y[a:b]) for a, b in pairwise(parts)]
    assert many.updates == one.updates == moved == 900 - 5 - (2 + 5) - (1 + 5) == sum(map(len, rows))
    np.testing.assert_allclose(many.matrices[2], one.matrices[2], atol=1e-8)
    np.testing.assert_allclose(many.A, one.A, atol=3e-3)
    width = 6 * (4 if model_set == "varx" else 6)
    assert rows[0].shape == (0, width) and all(np.isfinite(r).all() and r.shape[1] == width for r in rows)


@pytest.mark.parametrize("past, forgetting", [(2, 0.9), (1, 0.5), (2, 0.99)])
def test_a_batch_longer_than_the_memory_loses_no_sample(past, forgetting):
    """A short memory bounds what a snapshot computes anew, not what the least squares take from a batch."""
    record = simulate_fourth_order(1000, 3, feedback=0.25)
    s = settings(record, past=past, forgetting=forgetting, order=2)
    one, many = (Propagator(inputs=2, outputs=2, past=past, order=2, forgetting=forgetting) for _ in range(2))
    u, y, early = record.matrix("input"), record.matrix("output"), theta(record, s, 500)
    for tracker in (one, many):
        tracker.update_markov(early)
    for k in range(len(u)):
        one.update(u[k], y[k])
    rows = [many.update_many(u[k : k + 300], y[k : k + 300]) for k in range(0, 1000, 300)]
    assert one.updates == many.updates == sum(map(len, rows)) == 1000 - past
    np.testing.assert_allclose(many.matrices[2], one.matrices[2], atol=1e-8)
    live = LiveModes(s)
    feed(live, record, batch=250)
    assert live._moments.weight == pytest.approx(float((forgetting ** np.arange(1000.0 - past)).sum()))


@pytest.mark.parametrize("samples, forgetting", [(700, 1.0), (1200, 0.99)])
def test_told_deviations_are_those_of_trials(samples, forgetting):
    """95 % intervals of both modes cover what 80 trials scatter, less 4 deviations of a count."""
    errors, told = [], []
    for seed in range(80):
        record = simulate_fourth_order(samples, seed, feedback=0.25, noise_variance=0.49)
        live = LiveModes(settings(record, forgetting=forgetting))
        feed(live, record)
        live.snapshot(theta(record, live.settings, samples), samples - 1)
        assert live.note == "" and live.waiting == "" and live.order == 4
        for true in TRUE:
            mode = min((m.mode for m in live.modes()), key=lambda m: abs(m.frequency_hz - true.frequency_hz))
            errors.append((mode.frequency_hz - true.frequency_hz, mode.damping - true.damping))
            told.append((mode.frequency_std_hz, mode.damping_std))
    errors, told = np.array(errors), np.array(told)
    assert np.all((abs(errors) < 1.96 * told).mean(axis=0) > 0.95 - 4 * np.sqrt(0.95 * 0.05 / 160))
    np.testing.assert_allclose(errors.std(axis=0) / told.mean(axis=0), 1.0, atol=0.25)


@pytest.mark.parametrize("forgetting", [1.0, 0.995])
def test_a_late_snapshot_is_judged_by_the_samples_in_it(forgetting):
    """What arrived after it was taken, across a hole, leaves sums and share as they were; long after, those of now."""
    record = simulate_fourth_order(1200, 3, feedback=0.25, noise_variance=0.49)
    values = record.values.copy()
    values[730, 2] = np.nan
    record = type(record)(record.time_s, values, record.channels, 1.0, "", "")
    then, now = (LiveModes(settings(simulate_fourth_order(1200, 3), forgetting=forgetting)) for _ in range(2))
    feed(then, record, stop=700)
    feed(now, record, stop=760)
    feed(now, record, start=800, stop=900)
    found, wanted = now._moments_at(699), then._moments
    for name in ("gram", "first", "square", "weight", "weight_square"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), rtol=1e-9, atol=1e-9)
    assert now._moments_at(899) is now._moments and then._moments_at(2000) is then._moments
    snapshot = theta(record, now.settings, 700)
    for live in (then, now):
        live.snapshot(snapshot, 699)
    for a, b in zip(then.modes(), now.modes(), strict=True):
        assert 0.8 < b.mode.frequency_std_hz / a.mode.frequency_std_hz < 1.05
    if forgetting < 1:
        feed(now, record, start=900)
        assert now._moments_at(699) is now._moments  # 0.995⁵⁰⁰ = 0.08 is left of its newest sample


def test_deviations_of_late_snapshots_are_those_of_trials():
    """λ = 1, 400 samples in the snapshot, 400 more when it arrives: 60 trials of both modes."""
    errors, told = [], []
    for seed in range(60):
        record = simulate_fourth_order(800, seed, feedback=0.25, noise_variance=0.49)
        live = LiveModes(settings(record))
        feed(live, record)
        live.snapshot(theta(record, live.settings, 400), 399)
        for true in TRUE:
            mode = min((m.mode for m in live.modes()), key=lambda m: abs(m.frequency_hz - true.frequency_hz))
            errors.append((mode.frequency_hz - true.frequency_hz, mode.damping - true.damping))
            told.append((mode.frequency_std_hz, mode.damping_std))
    covered = (abs(np.array(errors)) < 1.96 * np.array(told)).mean(axis=0)
    assert np.all(covered > 0.95 - 4 * np.sqrt(0.95 * 0.05 / 120)), covered


def test_varmax_is_followed_with_and_without_the_residuals_of_the_filter():
    errors, told = [], []
    for seed in range(15):
        record = simulate_fourth_order(1200, seed, feedback=0.25, noise_variance=0.49)
        s = settings(record, past=4, model_set="varmax")
        u, y = record.matrix("input"), record.matrix("output")
        found = replay_filter(u, y, past=4, method="els", offset=s.offset, scale=s.scale, precision="f64")
        for e in (found.innovation, None):
            live = LiveModes(s)
            early = replay_filter(u[:400], y[:400], past=4, method="els", offset=s.offset, scale=s.scale).theta
            for part, theta_then in ((slice(0, 400), early), (slice(400, 1200), found.theta)):
                live.add(np.arange(part.start, part.stop), u[part], y[part], None if e is None else e[part])
                live.snapshot(theta_then, part.stop - 1)
            for true in TRUE:
                mode = min((m.mode for m in live.modes()), key=lambda m: abs(m.frequency_hz - true.frequency_hz))
                errors.append((mode.frequency_hz - true.frequency_hz, mode.damping - true.damping))
                told.append((mode.frequency_std_hz or np.nan, mode.damping_std or np.nan))
    errors, told = np.array(errors), np.array(told, dtype=float)
    known = np.isfinite(told).all(axis=1)
    assert known.any() and abs(errors).max() < 0.02
    assert np.all((abs(errors[known]) < 3 * told[known]).mean(axis=0) > 0.85)


def test_a_hole_is_bridged_and_counts_as_missing():
    """Samples 600 … 699 never come, nor does one value of 900: deviations widen a little, modes stay."""
    record = simulate_fourth_order(1500, 5, feedback=0.25, noise_variance=0.49)
    whole, holed = (LiveModes(settings(record, forgetting=0.995)) for _ in range(2))
    feed(whole, record)
    feed(holed, record, stop=600)
    values = record.values.copy()
    values[900, 1] = np.nan
    broken = type(record)(record.time_s, values, record.channels, 1.0, "", "")
    feed(holed, broken, start=700)
    assert (holed.missing, whole.missing, holed.last) == (101, 0, 1499)
    k = np.arange(1500)
    good = ((k >= 6) & (k < 600)) | ((k >= 706) & ((k < 900) | (k > 906)))  # the window is full and spans no hole
    assert holed._moments.weight == pytest.approx(float((0.995 ** (1499.0 - k[good])).sum()))
    for live in (whole, holed):
        live.snapshot(theta(record, live.settings, 1500), 1499)
    for a, b in zip(whole.modes(), holed.modes(), strict=True):
        assert abs(a.mode.frequency_hz - b.mode.frequency_hz) < a.mode.frequency_std_hz
        assert 1.0 < b.mode.frequency_std_hz / a.mode.frequency_std_hz < 1.1


def test_who_listens_late_is_told_that_deviations_are_not_known():
    record = simulate_fourth_order(1500, 5, feedback=0.25)
    for forgetting, known in ((1.0, False), (0.99, True)):
        live = LiveModes(settings(record, forgetting=forgetting))
        feed(live, record, start=500)
        live.snapshot(theta(record, live.settings, 1500), 1499)
        assert (live.modes()[0].mode.frequency_std_hz is not None) is known
        assert ("66% of what the filter has learnt from was heard" in live.note) is not known
    live.snapshot(theta(record, live.settings, 1500), None)
    assert "did not say which sample" in live.note and live.modes()[0].mode.frequency_std_hz is None
    assert _why_no_deviations(live, 0) == live.note
    told = _why_no_deviations(live, 7)  # a listener that is too slow for the stream says so
    assert told is not None and told.startswith(live.note) and "7 samples came faster" in told
    live.note = ""
    assert _why_no_deviations(live, 7) is None


def test_the_order_is_chosen_once_there_are_samples_and_again_with_twice_as_many():
    record = hawt.simulate_closed_loop(3000, 2)
    live = LiveModes(settings(record, past=15, order=None, feedthrough=(0,)))
    needed, seen = 4 * 16 * 5, []
    for stop in (200, 400, 600, 1000, 3000):
        feed(live, record, start=live.samples, stop=stop)
        live.snapshot(theta(record, live.settings, stop), stop - 1)
        seen.append((live.order, live._chosen_at))
    assert seen[0][0] == 0 and [at for _, at in seen] == [0, 385, 385, 985, 2985]
    assert 6 <= live.order <= 9
    early = LiveModes(settings(record, past=15, order=None))
    feed(early, record, stop=200)
    early.snapshot(theta(record, early.settings, 200), 199)
    assert early.modes() == () and early.waiting == f"waiting for samples: 185 of {needed} windows"
    frequencies = [m.mode.frequency_hz for m in live.modes() if m.mode.damping < 0.5]
    for true in (0.444, 1.6795):
        assert min(abs(f - true) for f in frequencies) < 0.01


def test_modes_keep_their_numbers():
    record = simulate_fourth_order(2000, 6, feedback=0.25, noise_variance=0.49)
    live = LiveModes(settings(record, forgetting=0.99))
    numbers = []
    for stop in range(500, 2001, 250):
        feed(live, record, start=live.samples, stop=stop)
        live.snapshot(theta(record, live.settings, stop), stop - 1)
        numbers.append({m.number: m.mode.frequency_hz for m in live.modes()})
    assert all(set(n) == {1, 2} for n in numbers)
    for number, true in zip((1, 2), TRUE, strict=True):
        assert all(abs(n[number] - true.frequency_hz) < 0.02 for n in numbers)


def test_numbers_follow_relative_distances_and_never_change_kind():
    """Slow modes part where fast ones are still the same; a pair is no real pole, however near."""
    live = LiveModes(settings(simulate_fourth_order(100, 1)))
    assert live._numbers([-0.01 + 0.1j, -0.1 + 8j, -0.3 + 0j]) == [1, 2, 3]
    assert live._numbers([-0.01 + 0.2j, -0.1 + 9j, -0.31 + 0j]) == [4, 2, 3]
    assert live._numbers([-0.3 + 0.01j, -0.01 + 0.11j]) == [5, 1]
    assert live._numbers([-0.31 + 0j, -0.1 + 9.5j, -0.01 + 0.21j]) == [3, 2, 4]


def test_what_cannot_be_followed_is_said():
    record = simulate_fourth_order(600, 1)
    with pytest.raises(UsageError, match="order 13 is not within 1 … 12"):
        LiveModes(settings(record, order=13))
    live = LiveModes(settings(record, order=10))
    feed(live, record)
    live.snapshot(np.zeros((2, 24)), 599)
    assert "show 0 states above rounding, 10 were asked for" in live.waiting and live.modes() == ()
    live.snapshot(np.full((2, 24), np.nan), 599)
    assert "not finite" in live.waiting
    live.snapshot(theta(record, live.settings, 600), 599)
    assert live.waiting == "" and len(live.modes()) >= 5
