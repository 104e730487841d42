"""Hold the scheduled algorithms to their laws: kernels are products of Z, the dual is the primal, data are exact."""

from dataclasses import replace

import numpy as np
import pytest

from aeolid.errors import UsageError
from aeolid.identify.lpv.data import LpvData, feedthrough_columns, find_lpv_scaling, gather
from aeolid.identify.lpv.dual import select_rows, solve_dual
from aeolid.identify.lpv.kernel import Kernel
from aeolid.identify.lpv.primal import extended_rows, factorise_lpv, gamma_k, lag_blocks, solve_primal
from aeolid.identify.lpv.structure import Structure
from aeolid.identify.ridge import Spectrum, choose_penalty, filter_factors, gcv_score
from aeolid.plants.lpv import benchmark, benchmark_signals, blade_scheduling, flapping_blade, simulate_open

PAST = 3
STRUCTURES = {
    "paper": Structure(frozenset("ABK"), 3, 2, 2, (False, False), False),
    "bilinear": Structure(frozenset("AK"), 3, 2, 2, (False, False), False),
    "only A, feedthrough": Structure(frozenset("A"), 3, 2, 2, (True, False), False),
    "only B": Structure(frozenset("B"), 3, 2, 2, (False, True), False),
    "all of the gain": Structure(frozenset("K"), 3, 2, 2, (True, True), False),
    "outputs": Structure(frozenset("ABCD"), 3, 2, 2, (True, False), False),
    "constants": Structure(frozenset("ABK"), 3, 2, 2, (False, False), True),
    "constants, only B": Structure(frozenset("B"), 3, 2, 2, (True, False), True),
    "constants, outputs": Structure(frozenset("AC"), 3, 2, 2, (False, False), True),
}


def some_data(samples=120, seed=0, gaps=True):
    """Return two recordings' worth of random samples; windows miss the border and, with gaps, some samples."""
    random = np.random.default_rng(seed)
    good = np.ones(samples, bool)
    if gaps:
        good[[40, 41, 90]] = False
    valid = np.convolve(good, np.ones(PAST + 1))[:samples] > PAST + 0.5
    valid[60 : 60 + PAST] = False  # a second recording begins at 60
    targets = np.flatnonzero(valid)
    mu = np.hstack([np.ones((samples, 1)), random.uniform(-0.5, 0.5, (samples, 2))])
    u, y = random.standard_normal((samples, 2)), random.standard_normal((samples, 2))
    return LpvData(u, y, mu, targets, targets / samples, PAST, 0)


def by_definition(data, structure, k):
    """Return one row of Z of the paper's structure straight from Definitions 5 and 6, lag 1 first."""
    row = []
    for lag in range(1, PAST + 1):
        product = np.concatenate([data.u[k - lag], data.y[k - lag]])
        for j in range(lag, 0, -1):
            product = np.kron(data.mu[k - j], product)
        row.append(product)
    return np.concatenate(row)


def test_rows_are_those_of_the_paper():
    data, structure = some_data(), STRUCTURES["paper"]
    rows = extended_rows(data, structure, data.targets)
    assert rows.shape[1] == structure.regressors(PAST) == 4 * (3 + 9 + 27)
    for i in (0, 7, len(rows) - 1):
        np.testing.assert_allclose(rows[i], by_definition(data, structure, data.targets[i]), rtol=1e-13)


TABLE_1 = {2: [40, 80, 120, 160, 200], 3: [168, 336, 504, 672, 840], 4: [680, 1360, 2040, 2720, 3400],
           5: [2728, 5456, 8184, 10912, 13640]}  # fmt: skip


@pytest.mark.parametrize("p, widths", TABLE_1.items())
def test_table_1_counts_the_rows(p, widths):
    """m = 4 and r = l = 1 … 5, as printed."""
    found = [Structure(frozenset("ABK"), 4, c, c, (False,) * c, False).regressors(p) for c in range(1, 6)]
    assert found == widths


@pytest.mark.parametrize("name", STRUCTURES)
def test_kernels_are_the_products_of_the_data_matrix(name):
    data, structure = some_data(), STRUCTURES[name]
    rows = np.hstack([extended_rows(data, structure, data.targets), feedthrough_columns(data, structure, data.targets)])
    assert rows.shape[1] == structure.regressors(PAST) + structure.feedthrough_width
    kernel = Kernel.of(data, structure)
    np.testing.assert_allclose(kernel.full(), rows @ rows.T, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(kernel.diagonal(), (rows**2).sum(axis=1), rtol=1e-12)
    some = np.array([5, 2, 40])
    np.testing.assert_allclose(kernel.regressor_rows(some), rows[some] @ rows.T, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("name", STRUCTURES)
def test_the_sums_of_25_are_gamma_k_times_z(name):
    """With C𝒦 = α Z the kernel sums and the block matrix (14) times Z agree, row by row."""
    data, structure = some_data(), STRUCTURES[name]
    alpha = np.random.default_rng(1).standard_normal((2, data.windows))
    rows, plain = extended_rows(data, structure, data.targets), np.hstack(lag_blocks(data, structure, data.targets))
    stacked = gamma_k((alpha @ rows)[:, : plain.shape[1]], structure, PAST, PAST)
    expected = stacked @ plain.T
    kernel = Kernel.of(data, structure)
    np.testing.assert_allclose(kernel.states_rows(alpha, PAST), expected, rtol=1e-9, atol=1e-9 * abs(expected).max())
    some = np.array([9, 3, 55])
    part = np.zeros_like(alpha)
    part[:, some] = alpha[:, some]
    np.testing.assert_allclose(kernel.states_rows(alpha[:, some], 2, some), kernel.states_rows(part, 2), atol=1e-9)


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("penalty", [0.02, 0.3])
def test_dual_and_primal_agree_at_the_same_penalty(name, penalty):
    data, structure = some_data(samples=400, gaps=False), STRUCTURES[name]
    primal = solve_primal(data, structure, PAST, penalty)
    dual = solve_dual(data, structure, PAST, penalty, None, "greedy")
    np.testing.assert_allclose(
        dual.states.singular_values, primal.states.singular_values[: len(dual.states.singular_values)], rtol=1e-7
    )
    compare_spans(dual.states.X[:, :3], primal.states.X[:, :3])
    np.testing.assert_allclose(dual.freedom, primal.freedom, rtol=1e-6)


def compare_spans(one, other, tolerance=1e-6):
    signs = np.sign((one * other).sum(axis=0))
    np.testing.assert_allclose(one * signs, other, atol=tolerance * abs(other).max())


def benchmark_data(samples=300, ratio=np.inf, seed=3, past=PAST):
    random = np.random.default_rng(seed)
    model = benchmark()
    u, scheduling = benchmark_signals(samples, random)
    record, _ = simulate_open(model, u, scheduling, random, ratio)
    scaling = find_lpv_scaling([record], ("mu2", "mu3", "mu4"), centre=False)
    structure = Structure(frozenset("ABK"), 4, 2, 3, (False, False), False)
    return gather([record], scaling, past), structure


def test_as_many_rows_as_the_rank_say_what_all_rows_say():
    """Periodic scheduling: the kernel lacks rank, and the rows that span it are enough (section 6.1)."""
    random = np.random.default_rng(4)
    model, scheduling = flapping_blade(), blade_scheduling(900)
    record, _ = simulate_open(model, random.standard_normal((900, 1)), scheduling, random, 100)
    data = gather([record], find_lpv_scaling([record], ("mu2",), centre=False), 6)
    structure = Structure(frozenset("AK"), 2, 1, 2, (False,), False)
    whole = solve_dual(data, structure, 6, 0.01, None, "greedy")
    assert whole.rank <= 10 * 3 * 6  # P (r + l) p
    rows = solve_dual(data, structure, 6, 0.01, whole.rank + 50, "greedy")
    assert rows.facts["kernel"]["rows"] <= whole.rank + 50
    compare_spans(rows.states.X[:, :2], whole.states.X[:, :2], 1e-5)
    first = solve_dual(data, structure, 6, 0.01, 400, "first")
    compare_spans(first.states.X[:, :2], whole.states.X[:, :2], 1e-5)


@pytest.mark.parametrize("selection", ["greedy", "first"])
def test_the_partial_factor_reproduces_its_rows(selection):
    data, structure = benchmark_data()
    kernel = Kernel.of(data, structure)
    G = kernel.full()
    L, rows = select_rows(kernel, 40, selection)
    assert L.shape == (data.windows, 40) and len(set(rows)) == 40
    np.testing.assert_allclose((L @ L.T)[rows], G[rows], atol=1e-9 * G.max())
    left = np.diag(G) - (L**2).sum(axis=1)
    assert left.min() > -1e-9 * G.max()
    if selection == "first":
        assert rows.tolist() == list(range(40))


def test_a_greedy_selection_leaves_less_than_the_first_rows():
    data, structure = benchmark_data()
    kernel = Kernel.of(data, structure)
    left = {
        s: np.sum(kernel.diagonal() - (select_rows(kernel, 60, s)[0] ** 2).sum(axis=1)) for s in ("greedy", "first")
    }
    assert left["greedy"] < left["first"]


def test_factors_merge_as_if_measured_in_one_go():
    data, structure = some_data(samples=500, gaps=False), STRUCTURES["paper"]
    early = data.targets < 200
    merged = factorise_lpv(data.take(early), structure).merge(factorise_lpv(data.take(~early), structure))
    whole = factorise_lpv(data, structure)
    np.testing.assert_allclose(merged.R.T @ merged.R, whole.R.T @ whole.R, rtol=1e-9, atol=1e-9)
    assert merged.windows == whole.windows


def test_the_order_of_recordings_does_not_matter():
    """Kernels stack: two recordings in either order give the same model."""
    data, structure = some_data(gaps=False), STRUCTURES["paper"]
    half = 60
    swapped = LpvData(
        *(np.roll(v, half, axis=0) for v in (data.u, data.y, data.mu)),
        np.sort((data.targets + half) % 120), data.place, PAST, 0,
    )  # fmt: skip
    for solve in (lambda d: solve_dual(d, structure, PAST, 0.1, None, "greedy"),):
        one, other = solve(data), solve(swapped)
        np.testing.assert_allclose(one.states.singular_values, other.states.singular_values, rtol=1e-9)


def test_gcv_scores_the_filter_that_is_applied():
    """Against the definition with the filter matrix written out."""
    random = np.random.default_rng(5)
    Z, y = random.standard_normal((60, 20)), random.standard_normal((60, 1))
    P, s, _ = np.linalg.svd(Z, full_matrices=False)
    projected = P.T @ y
    spectrum = Spectrum(s, projected, (y**2).sum(axis=0) - (projected**2).sum(axis=0), 60)
    for penalty in (0.1, 2.0, 10.0):
        F = Z @ np.linalg.solve(Z.T @ Z + penalty**2 * np.eye(20), Z.T)
        expected = 60 * np.sum((y - F @ y) ** 2) / (60 - np.trace(F)) ** 2
        assert gcv_score(spectrum, 0, penalty) == pytest.approx(expected, rel=1e-10)
    best = choose_penalty(spectrum, 0)
    grid = [gcv_score(spectrum, 0, p) for p in np.geomspace(1e-3, s[0], 400)]
    assert gcv_score(spectrum, 0, best) <= min(grid) * (1 + 1e-6)


@pytest.mark.parametrize("past", [4, 5])
def test_gcv_leaves_data_alone_that_are_interpolated_exactly(past):
    """More regressors than windows and no noise: the penalty stays far below what would bias the model."""
    data, structure = benchmark_data(past=past)
    estimate = solve_dual(data, structure, past, "gcv", None, "greedy")
    assert estimate.penalty.max() < 1e-2
    assert (estimate.freedom < data.windows).all()


def test_wrong_penalties_and_selections_are_named():
    data, structure = benchmark_data()
    spectrum = Spectrum(np.ones(3), np.ones((3, 1)), np.ones(1), 10)
    for bad, words in (("ridge", "'ridge' is none of"), (1.5, "1.5 is not within")):
        with pytest.raises(UsageError, match=words):
            filter_factors(spectrum, bad)
    with pytest.raises(UsageError, match="'best' is none of greedy, first"):
        select_rows(Kernel.of(data, structure), 3, "best")


def test_structures_that_no_predictor_has_are_refused():
    base = STRUCTURES["paper"]
    for varying, words in (("CK", "C and K cannot both"), ("DK", "D and K cannot both"), ("X", "'X' is none of"),
                           ("", "no matrix depends"), ("AD", "no input has feedthrough")):  # fmt: skip
        with pytest.raises(UsageError, match=words):
            replace(base, varying=frozenset(varying))
