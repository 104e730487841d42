"""Against a run: rotors of any number of blades, recordings that begin at any time, results without a model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import aeolid.diagnose.run_prior.conclude as concluding
from aeolid.diagnose.data.case import make_case
from aeolid.diagnose.deadline import unlimited
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.conclude import conclude_run, diagnosis_of, study_run
from aeolid.diagnose.run_prior.hypotheses import all_hypotheses
from aeolid.diagnose.run_prior.naming import Name, effect_of
from aeolid.diagnose.run_prior.pair import NOTHING, Pair
from aeolid.diagnose.run_prior.search import FIT, Search
from aeolid.errors import NotIdentifiable
from aeolid.record import Channel, Record

STEP, SAMPLES, SPEED, START = 0.1, 6000, 1.2, 3600.0
CHANNELS = (
    Channel("pitch", "deg", "input"), Channel("acceleration", "m/s^2", "output"), Channel("azimuth", "rad", "azimuth"),
)  # fmt: skip
CONTEXT = {"machine": "wind turbine", "blades": 2, "rated_speed_rad_s": SPEED}


def rotor(seed: int, load: float, start: float = 0.0) -> Record:
    """Return a rotor of two blades, with a short load whenever one of them passes."""
    rng = np.random.default_rng(seed)
    pitch, wind = rng.standard_normal((2, SAMPLES))
    azimuth = np.cumsum(SPEED + 0.02 * np.sin(0.02 * np.arange(SAMPLES))) * STEP
    answer = np.convolve(pitch, [0.0, 0.5, 0.3, 0.1])[:SAMPLES]
    output = answer + 0.5 * wind + load * np.exp(6 * (np.cos(2 * azimuth) - 1))
    time_s = start + STEP * np.arange(SAMPLES)
    return Record(time_s, np.column_stack([pitch, output, azimuth]), CHANNELS, STEP, "made.csv", "")


def test_two_blades_pass_twice_a_revolution() -> None:
    pair = pair_of([rotor(1, 0.6)], [rotor(2, 0.0)], CONTEXT)
    side = pair.recordings[0]
    loads = {h.entry: h for h in all_hypotheses(pair, {}) if h.place == "rotor"}
    for entry, orders in (("rotational_sampling", (2,)), ("tower_shadow", (2, 4, 6)), ("mass_imbalance", (1,))):
        waves = loads[entry].change(()).extra
        assert waves is not None
        turning = [f(k * side.turned) for k in orders for f in (np.cos, np.sin)]  # type: ignore[operator]
        np.testing.assert_allclose(waves(side), np.column_stack(turning))
    assert pair_of([rotor(1, 0.6)], [rotor(2, 0.0)], {}).passing == 3


def test_a_shadow_of_two_blades_is_found_and_told_with_its_order_and_time() -> None:
    study = study_run([rotor(1, 0.6, START)], [rotor(2, 0.0)], CONTEXT, lambda text, share: None, unlimited())
    diagnosis = diagnosis_of(study, "rotor", {})
    shadow = next(e for e in diagnosis["effects"] if e["id"] == "tower_shadow")
    assert "twice a revolution" in shadow["statement"] and "twice a revolution" in diagnosis["statement"]
    assert shadow["location"]["azimuth_order"] == 2
    assert diagnosis["sealed"]["data"] == "made.csv from 4020 s to 4200 s"
    times = study.proof.series["acceleration"]["time_s"]
    assert isinstance(times, list) and times[0] >= START + 0.7 * SAMPLES * STEP - study.pair.block_s


@pytest.mark.parametrize(("blades", "times"), [(1, "once"), (2, "twice"), (3, "three times"), (4, "4 times")])
def test_how_often_blades_pass_is_said_in_words(blades: int, times: str) -> None:
    effect = effect_of(Name("rotational_sampling", "rotor", {}, {}, 1.0), {}, [], blades)
    assert f"loads come {times} a revolution" in effect["statement"]
    assert effect["location"]["azimuth_order"] == blades


def test_predictions_are_at_the_times_of_the_recording() -> None:
    early, late = (pair_of([rotor(1, 0.0, s)], [rotor(2, 0.0)], CONTEXT) for s in (0.0, START))
    theta = np.zeros((early.regressors(), 1))
    times = [p.predicted(p.recordings[0], NOTHING, theta, 0.7)[0] for p in (early, late)]
    np.testing.assert_allclose(times[1] - times[0], START)


def test_a_diagnosis_stands_where_no_corrected_model_can_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*rest: object) -> None:
        raise NotIdentifiable("too few rows")

    monkeypatch.setattr(concluding, "corrected_model", refused)
    records, runs = [rotor(1, 0.6)], [rotor(2, 0.0)]
    case = make_case(records, runs[0], title="rotor", source="run", sha256="", context=CONTEXT)
    diagnosis, _ = conclude_run(case, tmp_path, (), lambda text, share: None, unlimited())
    assert any(e["id"] == "tower_shadow" for e in diagnosis["effects"]) and "model" not in diagnosis
    assert diagnosis["warnings"] == ["no corrected model was written: too few rows"]
    assert (tmp_path / "diagnosis.json").exists() and not (tmp_path / "model").exists()


def test_what_an_output_alone_explains_needs_no_moments_of_the_recordings(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are those of what stands already, to the last bit."""
    pair = pair_of([rotor(1, 0.6)], [rotor(2, 0.0)], CONTEXT)
    every = {h.key: h for h in all_hypotheses(pair, {})}
    standing = every["actuator_lag input:pitch"].change((0.2,))
    search, asked = Search(pair, standing), 0
    scale, lag = every["sensor_scale output:acceleration"], every["transport_delay input:pitch"]
    again = pair.of_recordings(scale.change((1.2,)).after(standing), 0.0, FIT)
    for mine, other in zip(search.recorded.regions, again.regions, strict=True):
        np.testing.assert_array_equal(mine.Z, other.Z)
        np.testing.assert_array_equal(mine.ZY, other.ZY)
        np.testing.assert_array_equal(mine.YY, other.YY)

    def counted(self: Pair, *rest: object) -> object:
        nonlocal asked
        asked += 1
        return plain(self, *rest)

    plain: Callable[..., object] = Pair.of_recordings
    monkeypatch.setattr(Pair, "of_recordings", counted)
    search.gain(scale, (1.2,))
    assert asked == 0
    search.gain(lag, (0.2,))
    assert asked == 1
