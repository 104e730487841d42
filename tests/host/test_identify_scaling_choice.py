"""Check choices of the papers: scaling of a scheduling, tolerance of a kernel, orders of a loop, block recursions."""

import numpy as np
import pytest
from test_identify_varx import REFERENCE, needs_reference

from aeolid.errors import UsageError
from aeolid.identify.block_markov import BLOCK_METHODS, estimate_block, save_block_markov
from aeolid.identify.lpv import identify_lpv
from aeolid.identify.ort import identify_ort
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.varx import identify_varx
from aeolid.models.prediction import vaf
from aeolid.plants.disturbed_loop import simulate_disturbed_loop
from aeolid.plants.lpv import benchmark, record_of
from aeolid.plants.lti import fourth_order, simulate_fourth_order


@needs_reference
def test_the_exact_benchmark_of_table_2_is_explained_as_printed_without_scaling() -> None:
    data, model, found = np.load(REFERENCE / "data" / "lpv4c_N500.npz"), benchmark(), {}
    record = record_of(model, data["u"][0], data["mu"][0][:, 1:], data["y0"][0], "lpv4c")
    for rule in ("none", "range", "standard"):
        result = identify_lpv([record], past=3, order=4, regularization="none", refined=False, scheduling_scaling=rule)
        run = result.model.simulate(data["uv"][0], data["muv"][0][:, 1:], np.zeros(4))
        found[rule] = vaf(data["yv"][0], run).min()
    assert found["none"] > 99.9995  # printed 100.0
    assert 100 - found["range"] > 5 * (100 - found["none"])
    assert found["standard"] < found["range"]


@needs_reference
def test_scaling_is_chosen_by_what_it_predicts_and_said() -> None:
    data, model = np.load(REFERENCE / "data" / "lpv4c_N500.npz"), benchmark()
    record = record_of(model, data["u"][0], data["mu"][0][:, 1:], data["y40"][0], "lpv4c")
    options = {"past": 2, "order": 4, "refined": False}
    auto = identify_lpv([record], scheduling_scaling="auto", **options)
    chosen = auto.settings.scheduling_scaling
    assert auto.notes[-1].startswith(f"scheduling scaled by {chosen}: log error power range ")
    same = identify_lpv([record], scheduling_scaling=chosen, **options)
    np.testing.assert_array_equal(auto.model.A, same.model.A)
    with pytest.raises(UsageError, match="scheduling scaling 'odd' is none of auto, range"):
        identify_lpv([record], scheduling_scaling="odd", **options)


@needs_reference
@pytest.mark.parametrize("selection", ["greedy", "first"])
def test_a_tolerance_takes_the_rows_that_lie_apart(selection: str) -> None:
    data, model, rows = np.load(REFERENCE / "data" / "lpv4c_N500.npz"), benchmark(), []
    record = record_of(model, data["u"][0][:200], data["mu"][0][:200, 1:], data["y40"][0][:200], "lpv4c")
    options = {"past": 2, "order": 4, "method": "lpv-kernel", "refined": False, "kernel_selection": selection}
    for tolerance in (0.0, 1e-3, 0.3):
        result = identify_lpv([record], kernel_tolerance=tolerance, **options)
        rows.append(result.to_json()["kernel"]["rows"])
    assert rows[0] > rows[1] > rows[2] >= 1
    with pytest.raises(UsageError, match="kernel tolerance 2 is not within"):
        identify_lpv([record], kernel_tolerance=2.0, **options)
    with pytest.raises(UsageError, match="belongs to method lpv-kernel"):
        identify_lpv([record], past=2, kernel_tolerance=0.1)


def test_the_two_subsystems_of_a_loop_may_have_orders_of_their_own() -> None:
    record = simulate_disturbed_loop(2000, 1)
    options = {"past": 15, "order": 2, "joint_order": 3}
    same, asked = identify_ort([record], **options), identify_ort([record], deterministic_order=3, **options)
    np.testing.assert_array_equal(same.model.B, asked.model.B)
    true = np.array([0.9 + 0.2j, 0.9 - 0.2j])  # of z² − 1.8 z + 0.85
    for order in (2, 4):
        found = identify_ort([record], deterministic_order=order, **options)
        assert found.to_json()["settings"]["deterministic_order"] == order
        poles = np.linalg.eigvals(found.model.A)
        assert abs(true[:, None] - poles).min(axis=1).max() < 0.05
    with pytest.raises(UsageError, match="deterministic order 0"):
        identify_ort([record], deterministic_order=0, **options)


@pytest.mark.parametrize("method", sorted(BLOCK_METHODS))
def test_block_recursions_write_what_identification_reads(method: str, tmp_path) -> None:
    record, path = simulate_fourth_order(4000, 3, noise_variance=0.01), tmp_path / "markov.npz"
    result = estimate_block(record, past=20, method=method)
    with path.open("wb") as handle:
        save_block_markov(handle, result, record)
    found = identify_varx([record], past=20, order=4, markov=StreamedMarkov.load(path))
    plain = identify_varx([record], past=20, order=4)
    true = np.linalg.eigvals(fourth_order().A)

    def error(model) -> float:
        return float(abs(true[:, None] - np.linalg.eigvals(model.A)).min(axis=1).max())

    assert error(found.model) < 2 * error(plain.model) + 2e-3
    assert np.isnan(result.innovation[:20]).all() and np.isfinite(result.innovation[20:]).all()
    residual = np.sqrt(np.diag(plain.markov.residual_covariance)) * plain.scaling.scale[len(plain.scaling.inputs) :]
    np.testing.assert_allclose(result.innovation[20:].std(axis=0), residual, rtol=0.05)
    with pytest.raises(UsageError, match="method 'rls' is none of"):
        estimate_block(record, past=20, method="rls")
