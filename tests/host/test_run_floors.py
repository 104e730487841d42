"""White noise of sensors that a recording has and a simulator's run has not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_run_prior import rig, told

from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.floors import in_blocks, noise_findings, sensor_noise
from aeolid.diagnose.run_prior.grams import lagged_gram, with_noisy_outputs
from aeolid.record import Record


def noisy(record: Record, share: float, seed: int = 1) -> Record:
    """Return a recording with white noise of a share of each output's deviation."""
    values, places = record.values.copy(), [k for k, c in enumerate(record.channels) if c.role == "output"]
    spread = share * values[:, places].std(axis=0)
    values[:, places] += spread * np.random.default_rng(seed).standard_normal((len(values), len(places)))
    return replace(record, values=values)


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_the_noise_of_each_output_is_known(share: float) -> None:
    recording = rig(2)
    true = share * recording.matrix("output").std(axis=0)
    pair = pair_of([noisy(recording, share)], [rig(1)], {})
    np.testing.assert_allclose(np.sqrt(sensor_noise(pair)), true, rtol=0.1)  # some 50 segments, a fifth's quantile
    assert pair.noise is not None
    assert [(f.channel, f.severity) for f in noise_findings(pair, {})] == [("speed", "info"), ("acc", "info")]
    np.testing.assert_allclose(in_blocks(pair, true**2), true / np.sqrt(pair.stride))


def test_other_wind_and_a_run_that_swings_less_are_no_noise() -> None:
    assert pair_of([rig(2)], [rig(1)], {}).noise is None
    calm = replace(rig(1), values=rig(1).values * np.array([1.0, 1.0, 0.01]))
    assert pair_of([rig(2)], [calm], {}).noise is None


def test_moments_are_those_that_noise_gives_on_average() -> None:
    rng = np.random.default_rng(3)
    z, past, held, deviations = rng.standard_normal((20_000, 4)), 5, 2, np.array([0.3, 0.7])
    told_of = with_noisy_outputs(lagged_gram(z, past, held), deviations, held)
    z[:, held:] += deviations * rng.standard_normal((len(z), 2))
    made = lagged_gram(z, past, held)
    for a, b in ((told_of.Z, made.Z), (told_of.ZY, made.ZY), (told_of.YY, made.YY)):
        np.testing.assert_allclose(a / made.count, b / made.count, atol=6 / np.sqrt(made.count) * 1.5)


def test_noise_of_sensors_is_nothing_that_a_simulation_lacks() -> None:
    """A twentieth on every sensor of a turbine cost 925 nats, and hid a lag that was there."""
    assert told(noisy(rig(2), 0.1), rig(1))["verdict"] == "no_mismatch"
    found = told(noisy(rig(3, lag=0.15), 0.1), rig(1))
    effect = found["effects"][0]  # type: ignore[index]
    assert (found["verdict"], effect["id"]) == ("named", "actuator_lag"), found["statement"]
    value = effect["parameters"]["tau_s"]
    assert abs(value["value"] - 0.15) < 3 * value["std"]
