"""Hold poles outside the unit circle to what the recordings say of them: moved inside, or refused; three samples."""

import numpy as np
import pytest

from aeolid.errors import NotIdentifiable
from aeolid.identify.request import Request
from aeolid.identify.run import identify_records
from aeolid.identify.subspace import StateBasis
from aeolid.record import Channel, Record

STEP = 0.1  # s


def held_by_its_controller(pole, samples, seed):
    """Return a recording of x⁺ = a x + 0.2 u + w, y = x + v under u = r − 0.35 y of the sample before."""
    random, x, values = np.random.default_rng(seed), 0.0, np.zeros((samples, 2))
    for k in range(samples):
        values[k, 1] = x + 0.1 * random.standard_normal()
        values[k, 0] = -0.35 * (values[k - 1, 1] if k else 0) + 0.5 * random.standard_normal()
        x = pole * x + 0.2 * values[k, 0] + 0.05 * random.standard_normal()
    return recorded(values)


def recorded(values):
    inputs = values.shape[1] - 1
    names = [Channel("u", "V", "input")] * inputs + [Channel("y", "m", "output")]
    return Record(STEP * np.arange(len(values)), values, tuple(names), STEP, "bench", "")


@pytest.mark.parametrize("past", ["auto", "10", "20", "40"])
def test_a_plant_that_plainly_grows_is_refused_whatever_the_window(past):
    """1.03 a sample, 13 deviations outside: windows of less than 34 samples do not make an integrator of it."""
    record = held_by_its_controller(1.03, 4000, 3)
    with pytest.raises(NotIdentifiable, match="plant that only its controller holds"):
        identify_records([record], Request(past=past))


def test_a_plant_that_plainly_grows_is_kept_as_it_is_where_that_is_allowed():
    record = held_by_its_controller(1.03, 4000, 3)
    found = identify_records([record], Request(past="20", allow_unstable=True))
    assert found.eigenvalues[0].real == pytest.approx(1.03, abs=0.01)


def test_an_integrator_is_moved_inside_and_nobody_relies_on_its_deviations():
    """Whichever side of the circle noise puts it; where it is moved, that is a warning and bands do not hold."""
    moved = 0
    for seed in range(6):
        found = identify_records([held_by_its_controller(1.0, 2000, seed)], Request(past="10"))
        assert abs(found.eigenvalues[0]) < 1.002  # what grows less than tenfold is left
        said = [n for n in found.notes if "moved inside" in n]
        assert len(said) <= 1 and all(n.startswith("WARNING") for n in said)
        if said:
            assert found.extra["bands_hold"] is False and "moved inside" in found.extra["bands_reason"]
        moved += len(said)
    assert moved > 0


@pytest.mark.parametrize("driven", [True, False])
def test_three_samples_are_refused_with_what_is_needed(driven):
    values = np.array([[0.3, 1.0], [-0.2, 2.0], [0.5, 0.7]])[:, 0 if driven else 1 :]
    with pytest.raises(NotIdentifiable, match="needs at least") as caught:
        identify_records([recorded(values)], Request())
    assert "bench" in str(caught.value)


def test_states_beyond_the_singular_values_are_refused():
    basis = StateBasis(np.array([2.0, 1.0, 0.0]), np.eye(3), np.ones((3, 4)), 10)
    assert np.isfinite(basis.state_map(2)).all()
    with pytest.raises(NotIdentifiable, match="2 singular values above zero"):
        basis.state_map(3)
