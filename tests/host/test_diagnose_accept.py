"""What a fitted candidate must show before it may be held against the sealed data."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aeolid.diagnose.candidates.race import is_accepted

SPREAD = np.random.default_rng(6).standard_normal(400) / 4  # the sum of 400 scatters by 5 nats


def candidate(fit_gain: float, select_gain: float, *, plausible: bool = True, parameters: int = 1) -> Any:
    difference = SPREAD - SPREAD.mean() + select_gain / 400
    return SimpleNamespace(
        fit_gain=fit_gain, select_gain=select_gain, parameters=parameters, plausible=plausible,
        select_difference=difference, handicap=4.0 * parameters,  # of 3000 samples
    )  # fmt: skip


@pytest.mark.parametrize(
    ("fit_gain", "select_gain", "plausible", "accepted"),
    [
        (12.0, 15.0, True, True),
        (12.0, 6.0, True, False),
        (81.0, 7.0, True, True),
        (81.0, -4.5, True, True),
        (81.0, -5.5, True, False),
        (20.5, 7.0, True, False),
        (81.0, 30.0, False, False),
        (-3.0, 30.0, True, False),
        (3.5, 30.0, True, False),
    ],
    ids=["selection proves it", "within its scatter", "clear on the fit", "silent", "refuted", "not clear",
         "not physical", "worse on the fit", "less on the fit than it costs"],
)  # fmt: skip
def test_a_candidate_is_proven_on_selection_data_or_clear_and_not_refuted(
    fit_gain: float, select_gain: float, plausible: bool, accepted: bool
) -> None:
    """A one-sided spring gained 81 nats with one parameter, and 7 ± 5 on the fifth that selects: it went unnoticed."""
    assert is_accepted(candidate(fit_gain, select_gain, plausible=plausible)) is accepted


def test_a_smaller_noise_model_makes_nothing_clear() -> None:
    """Five nats and eighteen parameters less in the noise model: not an effect worth twenty."""
    assert not is_accepted(candidate(5.0, 1.0, parameters=-16))
