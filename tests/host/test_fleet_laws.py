"""Check what a fleet rests on: summaries merge to the stacked problem, whatever their scaling and order."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from study_modules import load_study

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.fleet import modelling, tasks
from aeolid.fleet.modelling import choose_common_order, model_summary
from aeolid.fleet.onset import conclusions, find_onset, notable, say_change, untested
from aeolid.fleet.plan import Plan, find_recordings, parse_window
from aeolid.fleet.summary import load, merge_all, save, summarise
from aeolid.fleet.tasks import Period
from aeolid.fleet.tracking import drift, in_common_scales, mac, track
from aeolid.identify.split import cut
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import factorise, find_scaling
from aeolid.plants.lti import simulate_fourth_order
from aeolid.record import Channel, Record, Roles

PAST = 8


def shifted(record, seed):
    """Return the recording with other levels and sizes of its channels, so that its own scaling is another."""
    random = np.random.default_rng(seed)
    values = record.values + 5 * random.standard_normal(4)
    values[seed % 3 * 50 : seed % 3 * 55] = np.nan  # none, 5 or 10 missing samples
    return replace(record, values=values)


@pytest.fixture(scope="module")
def records():
    return [shifted(simulate_fourth_order(300 + 40 * seed, seed, feedback=0.25), seed) for seed in range(7)]


@pytest.fixture(scope="module")
def plan(records):
    return Plan(Roles(records[0].channels, None, "time_s", "roles.toml"), PAST, 4, (), None, None)


def gram(full):
    return full.T @ full


def test_merged_summaries_equal_the_stacked_problem(records):
    total = merge_all(summarise(r, PAST) for r in records)
    scaling = find_scaling(records)
    np.testing.assert_allclose(total.offset, scaling.offset, rtol=1e-12)
    np.testing.assert_allclose(total.scale, scaling.scale, rtol=1e-12)
    whole, stacked = total.factor(), factorise(records, scaling, PAST)
    np.testing.assert_allclose(gram(whole.full), gram(stacked.full), rtol=1e-9, atol=1e-9)
    assert (whole.windows, whole.skipped) == (stacked.windows, stacked.skipped)
    fitted = factorise(cut(records, scaling, PAST)[0], scaling, PAST)
    np.testing.assert_allclose(gram(total.fitted), gram(fitted.full), rtol=1e-9, atol=1e-9)
    assert total.recordings == 7


@settings(max_examples=25, deadline=None)
@given(order=st.permutations(range(7)), cut=st.integers(1, 6))
def test_the_order_and_the_nesting_of_merging_do_not_matter(records, order, cut):
    parts = [summarise(records[i], PAST) for i in order]
    tree = merge_all([merge_all(parts[:cut]), merge_all(parts[cut:])])
    plain = merge_all(summarise(r, PAST) for r in records)
    np.testing.assert_allclose(gram(tree.factor().full), gram(plain.factor().full), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(tree.square, plain.square, rtol=1e-12)


@settings(max_examples=25, deadline=None)
@given(scale=st.floats(1e-3, 1e3), offset=st.floats(-1e2, 1e2))
def test_another_scaling_is_the_factor_of_the_samples_so_scaled(records, scale, offset):
    summary = summarise(records[0], PAST)
    to = (np.full(4, offset), np.full(4, scale) * [1, 2, 3, 4])
    expected = factorise([records[0]], replace(find_scaling([records[0]]), offset=to[0], scale=to[1]), PAST)
    found = gram(summary.rescaled(*to).factor().full)
    np.testing.assert_allclose(found, gram(expected.full), rtol=1e-9, atol=1e-9 * np.max(abs(found)))


def test_a_sensor_lost_in_the_last_third_leaves_windows_that_choose():
    """The held-out part is that of the samples that count, not of the clock."""
    record = simulate_fourth_order(1000, 4)
    values = record.values.copy()
    values[650:, -1] = np.nan
    fitted, held_out = summarise(replace(record, values=values), PAST).windows
    assert fitted + held_out == 650 - PAST
    assert held_out == pytest.approx(0.3 * 650, abs=PAST)


def test_a_recording_cut_in_two_loses_only_the_windows_across_the_cut():
    whole = simulate_fourth_order(2000, 3)
    parts = merge_all([summarise(whole.slice(0, 900), PAST), summarise(whole.slice(900, 2000), PAST)])
    assert parts.factor().windows == len(whole) - 2 * PAST
    scaling = find_scaling([whole])
    lost = factorise([whole.slice(900 - PAST, 900 + PAST)], scaling, PAST)
    complete = gram(factorise([whole], scaling, PAST).full)
    found = gram(parts.rescaled(scaling.offset, scaling.scale).factor().full) + gram(lost.full)
    np.testing.assert_allclose(found, complete, rtol=1e-9, atol=1e-8)


def test_the_model_of_a_merge_is_the_model_of_the_recordings(records, plan):
    facts = model_summary(merge_all(summarise(r, PAST) for r in records), plan, 4, "all")
    expected = identify_varx(records, past=PAST, order=4, detrend="none", missing="leave-out", robust="never")
    assert [m["frequency_hz"] for m in facts["modes"]] == pytest.approx([m.frequency_hz for m in expected.modes])
    for key in ("damping", "damping_std", "frequency_std_hz"):
        assert [m[key] for m in facts["modes"]] == pytest.approx([getattr(m, key) for m in expected.modes], rel=1e-6)
    np.testing.assert_allclose(facts["model"]["inputs"][0]["offset"], expected.model.inputs[0].offset, rtol=1e-9)


def test_the_fit_of_a_period_is_that_of_its_worst_output(plan):
    record = simulate_fourth_order(3000, 1, feedback=0.25)
    noisy = replace(record, values=record.values + [0, 0, 0, 3] * np.random.default_rng(0).standard_normal((3000, 4)))
    fits = identify_varx([noisy], past=PAST, order=4).fit.one_step.vaf
    assert fits["y2"] + 5 < fits["y1"]
    assert model_summary(summarise(noisy, PAST), plan, 4, "all")["vaf_percent"] == pytest.approx(fits["y2"], abs=1.5)


def test_periods_choose_an_order_by_their_windows(plan, monkeypatch):
    """Nine parts of the windows want two states, one part one: the mean over windows decides, not over periods."""
    long, short = (summarise(simulate_fourth_order(n, n), PAST) for n in (3600, 400))
    losses = {long.windows: [0.0, -0.5], short.windows: [0.0, 0.6, 0.7]}
    monkeypatch.setattr(modelling, "_held_out_losses", lambda summary, *_: losses[summary.windows])
    assert choose_common_order([long, short], plan)[0] == 2
    assert choose_common_order([short], plan)[0] == 1


def test_few_of_many_periods_choose_and_are_spread_evenly(plan, monkeypatch):
    periods = [Period("T", f"{k}", float(k), (f"f{k}",)) for k in range(100)]
    place = {p.merged: int(p.start_s) for p in periods}
    monkeypatch.setattr(tasks, "load", lambda path: place[path.stem])
    monkeypatch.setattr(tasks, "choose_common_order", lambda chosen, plan: (len(chosen), str(chosen)))
    count, said = tasks.order_of(periods, plan, "cache")
    gaps = np.diff(json.loads(said))
    assert count == tasks.MOST_PERIODS and gaps.min() >= 4 and gaps.max() <= 5
    assert tasks.order_of(periods[:3], plan, "cache") == (3, "[0, 1, 2]")


def test_rotor_speeds_are_averaged_over_samples():
    """3 P of the mean speed of both recordings, weighted by their lengths, is marked where a mode lies on it."""
    parts = []
    for samples, hertz in ((3000, 0.030), (1000, 0.050)):
        record = simulate_fourth_order(samples, samples, feedback=0.25)
        turned = np.mod(360 * hertz * np.arange(samples), 360)[:, None]
        channels = (*record.channels, Channel("azimuth", "deg", "azimuth"))
        parts.append(summarise(replace(record, values=np.hstack([record.values, turned]), channels=channels), PAST))
    assert parts[0].merged(parts[1]).rotor_hz == pytest.approx(0.035, rel=1e-3)
    assert parts[1].merged(parts[0]).rotor_hz == pytest.approx(0.035, rel=1e-3)
    still = summarise(simulate_fourth_order(500, 1), PAST)
    assert still.rotor_hz is None and still.merged(parts[0]).rotor_hz == pytest.approx(0.030, rel=1e-3)


def test_the_order_of_the_true_system_is_chosen(plan):
    records = [simulate_fourth_order(2000, seed, feedback=0.25) for seed in range(4)]
    order, reason = choose_common_order([merge_all(summarise(r, PAST) for r in records)], plan)
    assert order == 4 and reason.startswith("order 4: ") and reason.endswith(", 1 period")
    with pytest.raises(NotIdentifiable, match="no period carries a choice"):
        choose_common_order([summarise(records[0].slice(0, 60), PAST)], plan)


def test_a_period_without_a_window_to_fit_is_left_out_of_the_choice(plan):
    """Each of its recordings is one window long: the other periods choose; alone it says why it cannot."""
    records = [simulate_fourth_order(2000, seed, feedback=0.25) for seed in range(3)]
    short = merge_all(summarise(records[0].slice(9 * i, 9 * i + PAST + 1), PAST) for i in range(40))
    assert short.windows == (0, 40)
    order, reason = choose_common_order([short, *(summarise(r, PAST) for r in records[1:])], plan)
    assert order == 4 and reason.endswith(", 2 periods")
    with pytest.raises(NotIdentifiable, match="no complete window in the first part"):
        choose_common_order([short], plan)


def test_samples_in_binary32_are_summed_in_binary64():
    record = simulate_fourth_order(50_000, 1)
    lifted = replace(record, values=record.values + np.array([1e4, 0.0, 3e4, 0.0]))
    double, single = (summarise(r, 4) for r in (lifted, replace(lifted, values=lifted.values.astype(np.float32))))
    np.testing.assert_allclose(single.mean, double.mean, atol=1e-3)
    np.testing.assert_allclose(single.scale, double.scale, rtol=1e-3)


def test_modes_that_move_between_periods_cost_no_states(plan):
    """The periods have inputs of opposite sign: together a model of them needs more states, apart four do."""
    records = [simulate_fourth_order(3000, seed) for seed in range(4)]
    turned = [replace(r, values=r.values * [(-1) ** k, 1, 1, (-1) ** k]) for k, r in enumerate(records)]
    apart = [summarise(r, PAST) for r in turned]
    assert choose_common_order(apart, plan)[0] == 4
    assert choose_common_order([merge_all(apart)], plan)[0] > 4


def test_a_channel_at_rest_in_one_recording_is_no_fault_but_in_all(records, plan):
    still = [replace(r, values=np.where(np.arange(4) == 0, 3.0, r.values)) for r in records]
    mixed = merge_all([summarise(still[0], PAST), *(summarise(r, PAST) for r in records[1:])])
    scaling = find_scaling([still[0], *records[1:]])
    np.testing.assert_allclose(mixed.scale, scaling.scale, rtol=1e-12)
    with pytest.raises(NotIdentifiable, match="'u1' is constant at 3"):
        model_summary(merge_all(summarise(r, PAST) for r in still), plan, 4, "all")


def test_recordings_without_a_window_or_with_infinity_are_refused(records):
    with pytest.raises(DataError, match="none of 8 samples"):
        summarise(records[0].slice(0, PAST), PAST)
    values = records[1].values.copy()
    values[20, 2] = np.inf
    with pytest.raises(DataError, match="'y1' is infinite at sample 21"):
        summarise(replace(records[1], values=values), PAST)


def test_a_summary_reads_back_bit_for_bit(records, tmp_path):
    summary = summarise(records[2], PAST)
    save(summary, tmp_path / "a.npz")
    back = load(tmp_path / "a.npz")
    for key, value in summary.__dict__.items():
        assert np.array_equal(value, getattr(back, key)), key
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def mode(frequency, damping, shape):
    s = 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))
    z = np.exp(0.1 * s)
    return {"eigenvalue": [z.real, z.imag], "shape": [[v.real, v.imag] for v in np.asarray(shape, dtype=complex)]}


def test_slow_motion_of_another_size_breaks_no_track(plan):
    """In every second period the level of another output wanders by thirty deviations; modes and shapes stay."""
    plain, found = simulate_fourth_order(4000, 1, feedback=0.25), []
    for k in range(4):
        slow = lfilter([1.0], [1.0, -0.995], np.random.default_rng(k).standard_normal(4000))
        record = simulate_fourth_order(4000, k, feedback=0.25)
        column = 2 + k % 2
        size = 30 * np.std(plain.values[:, column]) / np.std(slow)
        values = record.values + size * slow[:, None] * (np.arange(4) == column)
        found.append(model_summary(summarise(replace(record, values=values), PAST), plan, 5, "a day"))
    kept = [[m for m in p["modes"] if m["eigenvalue"][1] > 0.1] for p in found]  # not the slow motion
    periods = [p | {"modes": modes} for p, modes in zip(found, kept, strict=True)]
    assert track([(1.0, p["modes"]) for p in periods]) != [[0, 1]] * 4
    in_common_scales(periods)
    assert track([(1.0, p["modes"]) for p in periods]) == [[0, 1]] * 4
    shapes = np.array([[[complex(*v) for v in m["shape"]] for m in p["modes"]] for p in periods])
    for mode in range(2):
        assert all(mac(shapes[0, mode], shapes[k, mode]) > 0.95 for k in range(1, 4))


def test_common_scales_leave_shapes_in_units_as_they_are():
    """Whatever scales shapes are told in: times these they are what they were, up to a factor each."""
    random = np.random.default_rng(2)
    scales = np.exp(random.standard_normal((3, 2)))
    units = random.standard_normal((3, 2, 2)) + 1j * random.standard_normal((3, 2, 2))  # (periods, modes, outputs)
    told = [[mode(1.0, 0.01, shape / scale) for shape in of] for of, scale in zip(units, scales, strict=True)]
    periods = [{"output_scale": scale.tolist(), "modes": modes} for scale, modes in zip(scales, told, strict=True)]
    in_common_scales(periods)
    assert all(p["output_scale"] == periods[0]["output_scale"] for p in periods)
    for p, of in zip(periods, units, strict=True):
        for m, shape in zip(p["modes"], of, strict=True):
            found = np.array([complex(*v) for v in m["shape"]])
            assert np.max(abs(found)) == pytest.approx(1.0)
            assert mac(found * p["output_scale"], shape) == pytest.approx(1.0)


def test_modes_that_cross_keep_their_track_by_shape():
    periods = [(0.1, [mode(0.8 + 0.02 * k, 0.02, [1, 0.1]), mode(1.0 - 0.02 * k, 0.02, [0.1, 1])]) for k in range(11)]
    assert track(periods) == [[0, 1]] * 11


def test_where_frequencies_meet_the_likeness_of_shapes_decides():
    pairs = [(mode(0.8 + 0.02 * k, 0.02, [1, 0.7]), mode(1.0 - 0.02 * k, 0.02, [0.7, 1])) for k in range(11)]
    periods = [(0.1, pair if k < 5 else pair[::-1]) for k, pair in enumerate(pairs)]
    assert track(periods) == [[0, 1]] * 5 + [[1, 0]] * 6


def test_a_mode_that_is_missing_keeps_its_number_and_a_new_one_gets_its_own():
    first, second, far = mode(0.3, 0.01, [1, 0]), mode(1.0, 0.01, [0, 1]), mode(3.0, 0.01, [1, 1])
    periods = [(0.1, [first, second]), (0.1, [second]), (0.1, [first, second, far]), (0.1, [])]
    assert track(periods) == [[0, 1], [1], [0, 1, 2], []]


def test_mac_is_one_for_a_turned_shape_and_nil_for_an_orthogonal_one():
    a = np.array([1 + 2j, 3.0, -1j])
    assert mac(a, 2j * a) == pytest.approx(1)
    assert mac(np.array([1, 0j]), np.array([0j, 1])) == 0


def test_drift_is_the_weighted_line():
    t, s = np.arange(5.0), [0.1, 0.2, 0.1, 0.3, 0.1]
    found = drift(t, 2 + 0.5 * t, s)
    design = np.column_stack([np.ones(5), t]) / np.array(s)[:, None]
    assert found["slope"] == pytest.approx(0.5)
    assert found["slope_std"] == pytest.approx(np.sqrt(np.linalg.inv(design.T @ design)[1, 1]))
    assert found["change"] == pytest.approx(2.0)
    assert drift(t[:2], t[:2], s[:2]) is None
    assert drift(t, 2 + 0.5 * t, [*s[:4], None]) == drift(t[:4], 2 + 0.5 * t[:4], s[:4])
    assert drift(t, t, [*s[:2], None, np.nan, 0.0]) is None


def test_names_of_periods_and_turbines(plan, tmp_path, monkeypatch):
    daily = replace(plan, window_s=parse_window("1d"))
    assert daily.period_of(1.7e9) == "2023-11-14"
    assert replace(plan, window_s=parse_window("6h")).period_of(1.7e9) == "2023-11-14T18:00:00"
    assert daily.period_of(90000.0) == "86400 s"
    short = replace(plan, window_s=parse_window("30s"))
    assert [short.period_of(s) for s in (12345600.0, 12345630.0)] == ["12345600 s", "12345630 s"]
    named = replace(plan, group=r"(?P<turbine>WT\d+)_(?P<start>\d{8}_\d{4})")
    assert named.place(tmp_path / "WT07_20231114_2213.csv") == ("WT07", None, 1699999980.0)
    assert plan.place(tmp_path / "WT1" / "a.csv") == ("WT1", None, None)
    for where, file in (("WT1", "a.csv"), ("WT1/b", "../a.csv"), (".", "WT1/a.csv")):  # from wherever it is asked
        (tmp_path / where).mkdir(parents=True, exist_ok=True)
        monkeypatch.chdir(tmp_path / where)
        assert plan.place(Path(file))[0] == "WT1"
    with pytest.raises(DataError, match="does not match"):
        named.place(tmp_path / "other.csv")


@pytest.mark.parametrize(
    "change, words",
    [
        ({"past": 0}, "past window 0"), ({"order": 99}, "not within 1 … 16"), ({"feedthrough": ("w",)}, "no such"),
        ({"group": "("}, "no regular expression"), ({"group": "a(b)"}, "names nothing"),
        ({"group": "(?P<period>x)", "window_s": 60.0}, "both say"),
    ],
)  # fmt: skip
def test_bad_settings_are_named(plan, change, words):
    with pytest.raises(UsageError, match=words):
        replace(plan, **change)


@pytest.mark.parametrize("text", ["", "1", "d", "0d", "-1d", "1y", "0.5s"])
def test_bad_windows_are_named(text):
    with pytest.raises(UsageError, match="no length of time"):
        parse_window(text)


def test_recordings_are_found_once_and_results_never(tmp_path):
    for name in ("a/x.csv", "a/b/y.parquet", "a/notes.txt", "a/out/modes.parquet"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    found = find_recordings([str(tmp_path / "a"), str(tmp_path / "a" / "*.csv")], tmp_path / "a" / "out")
    assert [p.name for p in found] == ["y.parquet", "x.csv"]
    with pytest.raises(DataError, match="no recording there"):
        find_recordings([str(tmp_path / "nothing*")], tmp_path)


def test_the_onset_of_a_change_is_found_with_its_interval():
    """100 series that stay for 30 of 52 weeks and then fall: onset and change are covered by their intervals."""
    rng, t, s = np.random.default_rng(4), np.arange(52.0), np.full(52, 0.02)
    inside = changed = 0
    for _ in range(100):
        found = find_onset(t, 5 - 0.01 * np.maximum(t - 30, 0) + s * rng.standard_normal(52), s)
        inside += found["since_low"] <= 30 <= found["since_high"]
        changed += abs(found["change"] + 0.21) < 3 * found["change_std"]
        assert not found["from_start"] and abs(found["before"] - 5) < 0.03
    assert inside >= 85 and changed >= 90
    line = find_onset(t, 5 - 0.01 * t + s * rng.standard_normal(52), s)
    assert line["from_start"] and line["change"] == pytest.approx(-0.51, abs=0.05)
    assert find_onset(t[:4], t[:4], s[:4]) is None and find_onset(t[:5], t[:5], [None, *s[1:5]]) is None
    assert find_onset(t, t, [None, *s[1:]]) == find_onset(t[1:], t[1:], s[1:])


@pytest.mark.parametrize(("periods", "trials"), [(5, 1500), (10, 600), (20, 200)])
def test_scatter_beyond_the_deviations_names_no_change(periods, trials):
    """Modes that stay and scatter by twice their deviations: next to none of 100 is named, however few periods."""
    rng, t = np.random.default_rng(1), np.arange(float(periods))
    named = 0
    for _ in range(trials):
        s = 1e-3 * rng.uniform(0.8, 1.2, periods)
        onset = find_onset(t, 0.33 + 2 * s * rng.standard_normal(periods), s)
        facts = {"frequency_hz": {"onset": onset}, "damping": {"first": 0.02, "last": 0.02}, "periods": periods}
        named += notable(facts, periods)
    assert named <= trials * 1e-3


def test_scatter_beyond_the_deviations_widens_the_interval_of_the_onset():
    """Values scatter three times as much as they are told to: the intervals still cover what they should."""
    rng, t, told = np.random.default_rng(6), np.arange(52.0), np.full(52, 0.02)
    inside = changed = 0
    for _ in range(100):
        found = find_onset(t, 5 - 0.02 * np.maximum(t - 30, 0) + 0.06 * rng.standard_normal(52), told)
        inside += found["since_low"] <= 30 <= found["since_high"]
        changed += abs(found["change"] + 0.42) < 3 * found["change_std"]
    assert inside >= 85 and changed >= 85


def test_changes_by_chance_are_not_named():
    """Of 500 modes that stay next to none is named, though each onset is the best of fifty."""
    rng, t, s = np.random.default_rng(5), np.arange(52.0), np.full(52, 0.02)
    damping = {"first": 0.02, "last": 0.02}
    tracks = [
        {
            "frequency_hz": {"onset": find_onset(t, 5 + s * rng.standard_normal(52), s)},
            "damping": damping,
            "periods": 52,
        }
        for _ in range(500)
    ]
    assert sum(notable(track, 52) for track in tracks) <= 2
    moved = {"frequency_hz": {"onset": find_onset(t, 5 + 0.01 * t, s), "last": 5.51}, "damping": damping,
             "periods": 52, "turbine": "T7", "track": 3, "per": "period"}  # fmt: skip
    assert notable(moved, 52) and not notable(moved, 80)
    assert not notable(moved | {"damping": {"first": 0.5, "last": 0.5}}, 52)
    assert say_change(moved) == "T7, mode 3: rises from 5 Hz by 10.20 ± 0.19 % all along, 52 periods"


def test_the_plant_of_the_study_falls_by_three_percent_from_day_120_on():
    study = load_study("fleet")
    assert [study.frequency_at(day) for day in (0, 120, 365)] == pytest.approx([0.32, 0.32, 0.3104])
    for day in (0.0, 364.9):
        columns = study.simulate(day, 3)
        roles = (("a", "input"), ("b", "input"), ("c", "output"), ("d", "output"))
        values = np.column_stack([columns[name] for name, _ in roles])
        channels = tuple(Channel(name, "", role) for name, role in roles)
        record = Record(columns["time_s"], values, channels, study.STEP, "study", "0")
        modes = identify_varx([record], past=20, order=4).modes
        for mode, true in zip(modes, (study.frequency_at(day), 0.9), strict=True):
            assert abs(mode.frequency_hz - true) < 4 * mode.frequency_std_hz < 0.02


def test_what_could_not_be_tested_is_said():
    """Too few periods, or too few deviations: not "no mode moved", which holds of the other turbines alone."""
    t, s = np.arange(8.0), [0.01] * 8

    def own(turbine, periods, deviations):
        onset = find_onset(t[:periods], 5 + 0 * t[:periods], deviations)
        facts = {"frequency_hz": {"onset": onset}, "damping": {"first": 0.02, "last": 0.02}, "periods": periods}
        return facts | {"turbine": turbine}

    tracks, count = [own("A", 8, s), own("B", 3, s[:3]), own("C", 8, [None] * 8)], {"A": 8, "B": 3, "C": 8}
    left = untested(tracks, count)
    assert (
        left[0] == "B: not tested: 3 periods, 5 are needed" and len(left) == 2 and left[1].startswith("C: not tested")
    )
    assert conclusions({"moved": [], "untested": left, "turbines": 3})[0] == "no mode moved by more than chance"
    assert conclusions({"moved": [], "untested": left, "turbines": 2}) == left
