"""Check VARMAX where noise reaches fewer directions than there are outputs, with and without forgetting."""

import numpy as np
import pytest
from test_identify_varx import REFERENCE, needs_reference

from aeolid.identify.extended import held_directions
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.models.state_space import StateSpace
from aeolid.plants.hawt import build_turbine, simulate_closed_loop
from aeolid.record import Channel, Record

TURBINE = ("pitch", "generator_torque")
TRUE = np.linalg.eigvals(build_turbine().A)


def pole_error(model: StateSpace, true: np.ndarray) -> float:
    found = np.linalg.eigvals(model.A)
    return float(abs(true[:, None] - found[None]).min(axis=1).max())


def several_outputs(seed: int, outputs: int, sources: int) -> tuple[Record, np.ndarray]:
    """Simulate a random plant with an integrator in a loop: noise of `sources` channels reaches `outputs` outputs.

    Half of the outputs are hardly foretold, as forces beside speeds are.
    """
    random = np.random.default_rng(seed)
    angle, radius = random.uniform(0.3, 1.2, 2), random.uniform(0.95, 0.985, 2)
    A = np.zeros((5, 5))
    A[0, 0] = 1.0
    for i, (a, r) in enumerate(zip(angle, radius, strict=True)):
        A[1 + 2 * i : 3 + 2 * i, 1 + 2 * i : 3 + 2 * i] = r * np.array(
            [[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]
        )
    B, G = (
        random.standard_normal((5, 2)) * 0.2,
        random.standard_normal((5, sources)) * 0.02,
    )
    C, H = (
        random.standard_normal((outputs, 5)),
        random.standard_normal((outputs, sources)),
    )
    C[:, 0] = 0.0
    C[0] = [1.0, 0, 0, 0, 0]
    H[: outputs // 2] *= 0.01
    x, rows = np.zeros(5), []
    for _ in range(5000):
        v = random.standard_normal(sources)
        y = C @ x + H @ v
        u = random.standard_normal(2) - 0.05 * y[0] * np.sign(B[0])
        rows.append(np.concatenate([u, y]))
        x = A @ x + B @ u + G @ v
    channels = [Channel(f"u{i}", "", "input") for i in range(2)]
    channels += [Channel(f"y{i}", "", "output") for i in range(outputs)]
    values = np.array(rows)
    return Record(np.arange(5000) * 0.1, values, tuple(channels), 0.1, f"plant {seed}", ""), np.linalg.eigvals(A)


@pytest.mark.parametrize("forgetting", [0.99, 0.97, 0.95])
def test_forgetting_leaves_the_states_of_degenerate_data(forgetting: float) -> None:
    for seed in (1, 2):
        record = simulate_closed_loop(4000, seed)
        options = {
            "past": 10,
            "order": 7,
            "feedthrough": TURBINE,
            "uncertainty": "none",
        }
        plain = identify_varmax([record], **options)
        found = identify_varmax([record], forgetting=forgetting, **options)
        assert not any("diverged" in note for note in found.notes)
        assert found.singular_values[0] < 2 * plain.singular_values[0]  # 10² … 10¹⁵ times with a fading start
        assert pole_error(found.model, TRUE) < pole_error(plain.model, TRUE) + 1e-3


def test_a_direction_comes_back_before_its_weight_has_faded() -> None:
    for count in (3, 82, 500):
        for forgetting in (0.9, 0.95, 0.999):
            each, weight = held_directions(count, forgetting, 0.1)
            assert 1 <= each <= count
            assert forgetting ** (count / each) >= 0.0999 or each == count
            assert 0 < weight <= 0.1
    assert held_directions(82, 1.0, 0.1) == (0, 0.0)


def test_passes_do_not_worsen_outputs_that_share_their_noise() -> None:
    for outputs, sources, seed in ((5, 3, 0), (6, 2, 1)):
        record, true = several_outputs(seed, outputs, sources)
        plain = identify_varx([record], past=10, order=5, uncertainty="none")
        found = identify_varmax([record], past=10, order=5, uncertainty="none")
        assert found.extra["varmax"]["positive_real"]["innovation_rank"] < outputs
        assert pole_error(found.model, true) < 1.5 * pole_error(plain.model, true) + 2e-3


@needs_reference
@pytest.mark.parametrize("run", [0, 2, 3])
def test_the_integrator_of_six_turbine_outputs_stays_where_varx_puts_it(
    run: int,
) -> None:
    data = np.load(REFERENCE / "data" / f"hawt_{run:02d}.npz")
    channels = [Channel(f"u{i}", "", "input") for i in range(2)] + [Channel(f"y{i}", "", "output") for i in range(6)]
    values = np.hstack([data["u"], data["y6"]])
    record = Record(np.arange(len(values)) * 0.1, values, tuple(channels), 0.1, f"turbine {run}", "")
    errors = []
    for method in (identify_varx, identify_varmax):
        found = method([record], past=10, order=7, feedthrough=("u0", "u1"), uncertainty="none")
        errors.append(abs(np.linalg.eigvals(found.model.A) - 1.0).min())
    assert errors[1] < 1.2 * errors[0]  # 4.5, 10 and 5 times where the last pass says it
