"""The concealed effect is in the recording, and nothing else is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from aeolid.errors import UsageError
from aeolid.formats import read_record
from aeolid.models import state_space
from aeolid.plants.concealed import LaggedLoop, write_case
from aeolid.plants.hawt import ClosedLoop, Excitation, build_turbine
from aeolid.record import Roles


def run(loop: ClosedLoop, samples: int) -> tuple[np.ndarray, np.ndarray]:
    steps = [loop.step() for _ in range(samples)]
    return np.array([u for _, u, _ in steps]), np.array([y for _, _, y in steps])


def test_without_a_lag_the_loop_is_the_turbine_itself() -> None:
    for a, b in zip(run(LaggedLoop(3, lag_s=0.0), 300), run(ClosedLoop(3), 300), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("lag", [0.1, 0.3, 1.0])
def test_the_plant_answers_to_the_lagged_demand(lag: float) -> None:
    """Without wind and noise the outputs are those of the turbine under the drive's bilinear answer."""
    u, y = run(LaggedLoop(5, lag_s=lag, excitation=Excitation(wind_m_per_s=0.0)), 500)
    b, a, _ = signal.cont2discrete(([1.0], [lag, 1.0]), 0.1, method="bilinear")
    acting = u.copy()
    acting[:, 0] = signal.lfilter(b.ravel(), a, u[:, 0])
    np.testing.assert_allclose(build_turbine().model().simulate(acting), y, rtol=1e-8, atol=1e-12)


def test_a_case_is_complete_and_readable(tmp_path: Path) -> None:
    folder = write_case(tmp_path / "case", samples=200)
    record = read_record(folder / "recording.csv", Roles.load(folder / "roles.toml"))
    model = state_space.load(folder / "model.json")
    assert len(record) == 200 and record.sample_time_s == 0.1
    assert [s.name for s in model.inputs] == list(record.names("input"))
    assert [s.name for s in model.outputs] == list(record.names("output"))
    np.testing.assert_array_equal(model.A, build_turbine().A)
    assert "lag" not in (folder / "case.toml").read_text()


def test_an_impossible_lag_is_refused() -> None:
    with pytest.raises(UsageError, match="0 to 5 s"):
        LaggedLoop(1, lag_s=-0.1)
