"""Where a sensor may be one that does not show the direction."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.entries.sensor_rectified import noise_of

TIME_S = 0.02 * np.arange(3000)


def offered(y: NDArray[np.float64]) -> bool:
    site: Any = SimpleNamespace(output_names=("speed",), y=y[:, None])
    return bool(entry("sensor_rectified").attach(site))


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.04])
@pytest.mark.parametrize("gap", [False, True])
def test_noise_on_top_of_an_absolute_value_may_read_below_zero(noise: float, gap: bool) -> None:
    """Noise of a 70th of the range took a folded speed 3 % below zero: told as a mode, of which the model had none."""
    rng = np.random.default_rng(2)
    y = np.abs(2.8 * np.sin(1.3 * TIME_S)) + noise * rng.standard_normal(len(TIME_S))
    y[40:50] = np.nan if gap else y[40:50]
    assert offered(y)


@pytest.mark.parametrize("lowest", [-0.4, -0.15])
def test_what_goes_below_zero_by_more_than_its_noise_is_no_absolute_value(lowest: float) -> None:
    rng = np.random.default_rng(2)
    y = 1.4 + lowest / 2 + (1.4 - lowest / 2) * np.sin(1.3 * TIME_S)
    assert not offered(y) and not offered(y + 0.002 * rng.standard_normal(len(y)))


def test_noise_alone_is_no_absolute_value() -> None:
    """Its own deviation is no excuse: a tenth of the range is the most."""
    assert not offered(np.random.default_rng(2).standard_normal(3000))
    assert not offered(np.full(100, 3.0)) and not offered(np.full(100, np.nan))


def test_the_noise_is_that_of_the_second_differences() -> None:
    rng = np.random.default_rng(2)
    y = np.sin(1.3 * TIME_S) + 0.03 * rng.standard_normal(len(TIME_S))
    assert noise_of(y) == pytest.approx(0.03, rel=0.1) and noise_of(y[:2]) == 0.0
