"""Identify scheduled systems that are known: exact without noise, the same in other units, clear on what is lacking."""

from dataclasses import replace

import numpy as np
import pytest

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.identify.lpv import identify_lpv
from aeolid.models import lpv
from aeolid.models.lpv_prediction import estimate_initial_state, predict, predictor_states
from aeolid.models.model_file import Signal
from aeolid.models.prediction import vaf
from aeolid.plants.lpv import (
    benchmark,
    benchmark_signals,
    bilinear_input,
    bilinear_system,
    record_of,
    simulate_blade_in_loop,
    simulate_open,
)
from aeolid.record import Channel


def random_system(seed=0, n=2, r=2, outputs=2, varying="ABK", feedthrough=False, constant=False):
    """Return a stable system scheduled by one channel s in −1 … 1, with what does not vary at zero."""
    random = np.random.default_rng(seed)
    m = 2

    def stack(shape, size, letter):
        out = size * random.standard_normal((m, *shape))
        out[1:] *= 0.6 if letter in varying else 0.0
        return out

    A = stack((n, n), 0.3, "A")
    C, D = stack((outputs, n), 1.0, "C"), stack((outputs, r), 1.0, "D") * feedthrough
    B, K = stack((n, r), 1.0, "B"), stack((n, outputs), 0.05, "K")
    names = [tuple(Signal(f"{c}{i + 1}", "V") for i in range(k)) for c, k in (("u", r), ("y", outputs), ("x", n))]
    b = random.standard_normal((m, n)) * constant
    return lpv.LpvStateSpace(
        A, B, C, D, K, b, np.zeros(n), None, 0.1, *names, (Signal("s", "m/s"),)
    )  # fmt: skip


def run(model, samples, seed, noise=0.0, mean=0.0):
    """Return a recording of the innovation form driven by white inputs and noise, and its innovations."""
    random = np.random.default_rng(seed)
    s = random.uniform(-1, 1, (samples, 1)) + mean
    u, e = random.standard_normal((samples, len(model.inputs))), noise * random.standard_normal((samples, 2))
    mu = lpv.with_one(s)
    forced = lpv.apply_at(model.B, mu, u) + lpv.apply_at(model.K, mu, e) + mu @ model.b
    x = lpv.run_scheduled(model.A, mu, forced, model.x0)[:-1]
    y = lpv.apply_at(model.C, mu, x) + lpv.apply_at(model.D, mu, u) + e + model.y_offset
    return record_of(model, u, s, y, f"run {seed}"), e


def fresh_vaf(result, record):
    """Return the smallest VAF of a free run over a recording, from an estimated first state."""
    model = result.model
    u, y, s = (record.columns([c.name for c in group]) for group in (model.inputs, model.outputs, model.scheduling))
    x0 = estimate_initial_state(model, u - model.u_offset, y - model.y_offset, lpv.with_one(s))
    return float(vaf(y, model.simulate(u, s, x0)).min())


CASES = {
    "paper": ({}, {}),
    "only A": ({"varying": "A"}, {"varying": "A"}),
    "only B": ({"varying": "B"}, {"varying": ("B",)}),
    "feedthrough": ({"varying": "AB", "feedthrough": True}, {"varying": "A,B", "feedthrough": ("u1", "u2")}),
    "outputs": ({"varying": "ABC"}, {"varying": "A,B,C"}),
    "outputs and feedthrough": (
        {"varying": "ABCD", "feedthrough": True}, {"varying": "A,B,C,D", "feedthrough": ("u1", "u2")}),
    "constants": ({"constant": True}, {"offsets": True}),
}  # fmt: skip


@pytest.mark.parametrize("method", ["lpv", "lpv-kernel"])
@pytest.mark.parametrize("case", CASES)
def test_noise_free_data_are_explained_exactly(case, method):
    """Fresh data, other seed; the past window is shorter than the memory of A, and still nothing is lost."""
    system, options = CASES[case]
    model = random_system(**system)
    result = identify_lpv([run(model, 700, 1)[0]], past=5, method=method, order=2, regularization="none", **options)
    assert result.gain_method.startswith("none")  # innovations that are rounding give no gain
    fresh = run(model, 300, 2)[0]
    assert fresh_vaf(result, fresh) > 99.999
    for at in (-0.5, 0.8):
        poles = [np.sort_complex(np.linalg.eigvals(m.frozen([at]).A)) for m in (model, result.model)]
        np.testing.assert_allclose(*poles, atol=2e-3)


@pytest.mark.parametrize("method", ["lpv", "lpv-kernel"])
def test_the_bilinear_system_is_exact_with_its_input_as_scheduling(method):
    """Section 7.3 without noise, p = 4: 100 % for every regularisation."""
    random, model = np.random.default_rng(0), bilinear_system()
    u, v = bilinear_input(500, random), bilinear_input(500, random)
    record, fresh = (simulate_open(model, w, w, random)[0] for w in (u, v))
    for regularization in ("gcv", "none"):
        result = identify_lpv(
            [record], past=4, method=method, order=2, scheduling=("u1",), varying="A,K", regularization=regularization
        )
        assert fresh_vaf(result, fresh) > 99.99


def noisy_pair(seed=1):
    return [run(random_system(), 500, s, noise=0.2)[0] for s in (seed, seed + 1)]


def in_other_units(record):
    """Return the recording with other units and origins: u in mV, s in km/h about another zero, y times 40."""
    scale = {"u1": 1000.0, "u2": 1e-3, "s": 3.6, "y1": 40.0, "y2": 1.0}
    shift = {"s": 12.0}
    values = np.column_stack([record.column(c.name) * scale[c.name] + shift.get(c.name, 0) for c in record.channels])
    return replace(record, values=values, channels=tuple(Channel(c.name, "", c.role) for c in record.channels))


@pytest.mark.parametrize("method", ["lpv", "lpv-kernel"])
def test_units_and_origin_of_the_scheduling_change_nothing_but_numbers(method):
    records = noisy_pair()
    plain = identify_lpv(records, past=3, method=method, order=2)
    other = identify_lpv([in_other_units(r) for r in records], past=3, method=method, order=2)
    np.testing.assert_allclose(other.singular_values, plain.singular_values, rtol=1e-6)
    np.testing.assert_allclose(np.sort_complex(other.eigenvalues), np.sort_complex(plain.eigenvalues), atol=1e-8)
    u, s = records[0].matrix("input"), records[0].matrix("scheduling")
    again = in_other_units(records[0])
    y = plain.model.simulate(u, s) * [40.0, 1.0]
    np.testing.assert_allclose(
        other.model.simulate(again.matrix("input"), again.matrix("scheduling"), other.model.x0), y, atol=1e-5 * y.std()
    )


@pytest.mark.parametrize("method", ["lpv", "lpv-kernel"])
def test_recordings_merge_and_their_order_does_not_matter(method):
    records = noisy_pair()
    both = identify_lpv(records, past=3, method=method, order=2)
    turned = identify_lpv(records[::-1], past=3, method=method, order=2)
    one = identify_lpv(records[:1], past=3, method=method, order=2)
    np.testing.assert_allclose(both.singular_values, turned.singular_values, rtol=1e-8)
    assert both.windows == 2 * (500 - 3) and one.windows == 497
    fresh = run(random_system(), 2000, 9)[0]  # noise-free
    assert fresh_vaf(both, fresh) > fresh_vaf(one, fresh) > 90


def test_missing_samples_cost_their_windows_only():
    record = noisy_pair()[0]
    values = record.values.copy()
    values[100, 0] = values[200:205, 3] = values[300, 2] = np.nan
    holed = identify_lpv([replace(record, values=values)], past=3, method="lpv-kernel", order=2)
    assert holed.windows == 497 - 4 - (5 + 3) - 4 and holed.skipped == 16
    assert "16 windows with a missing sample" in holed.notes[0]
    full = identify_lpv([record], past=3, method="lpv-kernel", order=2)
    np.testing.assert_allclose(np.sort_complex(holed.eigenvalues), np.sort_complex(full.eigenvalues), atol=0.05)


def test_the_order_is_found_and_its_reason_told():
    for method in ("lpv", "lpv-kernel"):
        result = identify_lpv(noisy_pair(), past=4, method=method)
        assert result.order == 2 and "held-out" in result.order_choice.reason
    short = identify_lpv([noisy_pair()[0].slice(0, 120)], past=2, method="lpv-kernel")
    assert "too few samples to hold some out" in short.order_choice.reason


def test_the_flapping_blade_in_closed_loop():
    """Section 7.2: white excitation, time-varying feedback, process noise; N = 2000, p = 10."""
    result = identify_lpv([simulate_blade_in_loop(2000, 1)], past=10, method="lpv-kernel", order=2, varying="A,K")
    first, second = (np.linalg.eigvals(a) for a in result.model.A)
    true = np.roots([1, 0.4997, 6.5229 * 0.0734])  # of the printed A1
    np.testing.assert_allclose(np.sort_complex(first), np.sort_complex(true), atol=0.02)
    np.testing.assert_allclose(np.sort(second.real), [-0.0021, 0.5196], atol=0.02)
    assert result.estimate.rank <= 300 and result.to_json()["kernel"]["of"] == 1990
    reduced = identify_lpv(
        [simulate_blade_in_loop(2000, 1)], past=10, method="lpv-kernel", order=2, varying="A,K", kernel_rows=100,
        kernel_selection="first",
    )  # fmt: skip
    kernel = {"rows": 100, "of": 1990, "rank": 100, "selection": "first", "tolerance": None}
    assert reduced.to_json()["kernel"] == kernel
    np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(reduced.model.A[0])), np.sort_complex(true), atol=0.02)


def test_a_gain_is_found_where_it_pays():
    """Innovation noise with a strong gain: the one-step prediction is near the innovations themselves."""
    model = replace(random_system(), K=np.array([[[0.6, 0.1], [-0.3, 0.5]], np.zeros((2, 2))]))
    record, e = run(model, 3000, 5, noise=1.0)
    result = identify_lpv([record], past=4, method="lpv", order=2)
    assert result.gain_method.startswith("least squares")
    assert np.trace(result.model.innovation_covariance) < 1.05 * np.trace(np.cov(e.T))


def test_predictions_with_the_true_model_leave_its_innovations():
    model = random_system(varying="ABK")
    record, e = run(model, 400, 3, noise=0.5)
    u, y, s = record.matrix("input"), record.matrix("output"), record.matrix("scheduling")
    np.testing.assert_allclose(y - predict(model, u, y, s, 1, model.x0), e, atol=1e-12)
    states = predictor_states(model, u, y, lpv.with_one(s), model.x0)
    for steps in (3, 7):
        ahead = predict(model, u, y, s, steps, model.x0)
        k = 50
        by_hand = model.simulate(u[k - steps + 1 :], s[k - steps + 1 :], states[k - steps + 1])
        np.testing.assert_allclose(ahead[k], by_hand[steps - 1], atol=1e-12)
    free = model.simulate(u, s)
    for steps in (400, 1000):
        np.testing.assert_allclose(predict(model, u, y, s, steps, model.x0), free, atol=1e-12)
    np.testing.assert_allclose(predict(model, u, y, s, 7, model.x0)[:7], free[:7], atol=1e-12)
    noise_free = replace(model, K=None)
    started = estimate_initial_state(noise_free, u, model.simulate(u, s, np.array([1.0, -2.0])), lpv.with_one(s))
    np.testing.assert_allclose(started, [1.0, -2.0], atol=1e-9)


def test_the_file_keeps_the_model():
    for options in ({}, {"varying": "ABCD", "feedthrough": True}, {"constant": True}):
        model = random_system(**options)
        again = lpv.from_json(model.to_json(), "model.json")
        for key in "ABCDKb":
            np.testing.assert_array_equal(getattr(again, key), getattr(model, key))
        assert (again.scheduling, again.inputs, again.sample_time_s) == (model.scheduling, model.inputs, 0.1)
    facts = random_system().to_json()
    assert facts["scheduling"] == {"channels": ["s"], "units": ["m/s"], "first_is_one": True}
    assert np.shape(facts["A"]) == (2, 2, 2) and np.shape(facts["C"]) == (2, 2)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"A": [[[1.0]], [[1.0]], [[1.0]]]}, "A is 3x1x1, needed is 2x1x1"),
        ({"A": None}, "A is not a matrix|A is"),
        ({"B": "text"}, "B is not a matrix of numbers"),
        ({"K": [[[1.0]], [["x"]]]}, "K is not a matrix of numbers"),
        ({"C": [[float("nan"), 1.0]]}, "C holds a value that is not finite|C is"),
        ({"scheduling": {"channels": ["s"], "first_is_one": False}}, "first_is_one is False"),
        ({"scheduling": {"channels": [], "first_is_one": True}}, "not a list of channel names"),
        ({"scheduling": {"channels": ["s"], "first_is_one": True, "offset": 1}}, "unknown key 'offset'"),
        ({"scheduling": {"channels": ["s"], "units": ["m", "s"], "first_is_one": True}}, "a unit for each of 1"),
        ({"sample_time_s": 0}, "sample_time_s = 0 is not"),
        ({"kind": "lpv"}, "kind is 'lpv'"),
        ({"state_constant": [[1.0]]}, "state_constant is 1x1"),
        ({"states": ["x1", "x2", "x3"]}, "3 states are named"),
    ],
)
def test_a_broken_file_is_named(change, words):
    data = random_system().to_json() | change
    if change.get("A") is not None:
        data = lpv.LpvStateSpace(
            np.zeros((2, 1, 1)), np.zeros((2, 1, 2)), np.zeros((2, 2, 1)), np.zeros((2, 2, 2)), None, np.zeros((2, 1)),
            np.zeros(1), None, 0.1, (Signal("a"), Signal("b")), (Signal("c"), Signal("d")), (Signal("x"),),
            (Signal("s"),),
        ).to_json() | change  # fmt: skip
    with pytest.raises(DataError, match=words):
        lpv.from_json(data, "broken.json")


def flat(record, name, value):
    values = record.values.copy()
    values[:, [c.name for c in record.channels].index(name)] = value
    return replace(record, values=values, source="flat.csv")


def benchmark_record(samples=300):
    random, model = np.random.default_rng(2), benchmark()
    u, s = benchmark_signals(samples, random)
    return simulate_open(model, u, s, random, 40)[0]


@pytest.mark.parametrize(
    "make, options, error, words",
    [
        (lambda r: [flat(r, "s", 7.0)], {}, NotIdentifiable, "channel 's' is constant at 7 m/s; record over"),
        (lambda r: [flat(r, "u2", 1.0)], {}, NotIdentifiable, "'u2' is constant at 1 V"),
        (lambda r: [flat(r, "s", np.nan)], {}, NotIdentifiable, "scheduling s: no sample with a value"),
        (lambda r: [flat(r, "s", np.inf)], {}, DataError, "flat.csv: channel 's' is infinite at sample 1"),
        (lambda r: [flat(r, "u1", np.sin(np.arange(500)))], {"past": 9, "method": "lpv-kernel"}, NotIdentifiable,
         "input 'u1' is not persistently exciting: over past window 9 it spans 2 of 10"),
        (lambda r: [r.slice(0, 8)], {}, NotIdentifiable, "5 complete windows of 4 samples; a model of order 2"),
        (lambda r: [benchmark_record()], {"past": 5, "order": 4}, NotIdentifiable,
         "295 complete windows.*q = 6820 columns; record more than 6825 samples.*lpv-kernel"),
        (lambda r: [r], {"method": "lpv-kernel", "memory_gb": 0.001}, NotIdentifiable,
         "497 rows by 497 windows needs 0.0 GB, the limit is 0.0 GB; use at most 83 rows"),
        (lambda r: [r], {"memory_gb": 1e-5}, NotIdentifiable, "q = 56 columns need 0.0 GB"),
        (lambda r: [r, replace(r, channels=(*r.channels[:-1], Channel("y9", "V", "output")))], {}, DataError,
         "channels, units or roles differ"),
        (lambda r: [r], {"order": 7}, UsageError, "order 7 is not within 1 … 6"),
        (lambda r: [r], {"scheduling": ("wind",)}, UsageError, "scheduling 'wind': no such channel"),
        (lambda r: [r], {"scheduling": ("y1",)}, UsageError, "role 'output'; a free run needs"),
        (lambda r: [r], {"scheduling": ("s", "s")}, UsageError, "named twice"),
        (lambda r: [r], {"feedthrough": ("u9",)}, UsageError, "'u9': no such input"),
        (lambda r: [r], {"future": 9}, UsageError, "future window 9"),
        (lambda r: [r], {"past": 0}, UsageError, "past window 0"),
        (lambda r: [r], {"method": "lpv2"}, UsageError, "'lpv2' is none of"),
        (lambda r: [r], {"kernel_rows": 9}, UsageError, "belongs to method lpv-kernel"),
        (lambda r: [r], {"method": "lpv-kernel", "kernel_rows": 0}, UsageError, "0 kernel rows"),
        (lambda r: [], {}, UsageError, "at least one recording"),
    ],
)  # fmt: skip
def test_what_is_lacking_is_named(make, options, error, words):
    record = run(random_system(), 500, 1, noise=0.1)[0]
    with pytest.raises(error, match=words):
        identify_lpv(make(record), **({"past": 3, "order": 2} | options))


def test_collinear_scheduling_is_named():
    record = benchmark_record()
    values = record.values.copy()
    values[:, 3] = 2 * values[:, 2] + 1
    with pytest.raises(NotIdentifiable, match=r"mu2, mu3, mu4 are collinear.*span 3 of 4 directions"):
        identify_lpv([replace(record, values=values)], past=2, order=2)


def test_scheduling_that_hardly_moves_together_with_the_input_is_refused():
    """The scheduling leaves its value in four samples only: A(μ) acts on too few of them."""
    record = run(random_system(), 500, 1)[0]
    s = np.zeros(500)
    s[[100, 250]] = 1.0
    with pytest.raises(NotIdentifiable, match="not persistently exciting: states and inputs times the scheduling span"):
        identify_lpv([flat(record, "s", s)], past=2, method="lpv-kernel", order=2)


@pytest.mark.parametrize("method", ["lpv", "lpv-kernel"])
def test_an_order_beyond_what_the_data_carry_is_refused(method):
    with pytest.raises(NotIdentifiable, match="order 3 asked for, the data carry 2 singular values above rounding"):
        identify_lpv([run(random_system(), 500, 1)[0]], past=3, method=method, order=3)


@pytest.mark.parametrize("seed", range(12))
def test_data_without_a_system_end_in_a_model_or_a_sentence(seed):
    """Noise of any length, random walks, steps, huge and tiny units: no crash."""
    random = np.random.default_rng(seed)
    samples = int(random.choice([12, 40, 150, 400]))
    values = random.standard_normal((samples, 5))
    if seed % 3 == 0:
        values = values.cumsum(axis=0)
    if seed % 3 == 1:
        values[:, :3] = np.sign(values[:, :3])
    values *= 10.0 ** random.integers(-9, 9, 5)
    if seed % 2:
        values[random.integers(samples), random.integers(5)] = np.nan
    record = replace(run(random_system(), samples, 0)[0], values=values)
    order = None if seed % 4 else 3
    try:
        method = "lpv" if seed % 5 == 0 else "lpv-kernel"
        result = identify_lpv([record], past=3 if seed % 2 else 6, method=method, order=order)
        assert np.isfinite(result.model.A).all() and result.summary()
    except (NotIdentifiable, DataError) as error:
        assert len(str(error)) > 20
