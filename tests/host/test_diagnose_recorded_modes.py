"""A mode that a simulator's run lacks has the frequency and damping that the recording alone shows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates import reestimate
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.candidates.recorded_modes import recorded_modes
from aeolid.diagnose.candidates.reestimate import estimated_on_all
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.scoring.scores import score_bank
from aeolid.models.equations import Equations

pytestmark = pytest.mark.slow  # its fixtures are

Array = NDArray[np.float64]
STEP, SAMPLES, HZ, DAMPING = 0.1, 6000, 0.33, 0.06
CASE = """[case]
title = "a rigid tower"
[recordings]
files = ["recording.csv"]
roles = "roles.toml"
[baseline]
kind = "run"
file = "simulation.csv"
same_inputs = false
[context]
machine = "wind turbine"
"""
ROLES = """[recording]
sample_time_s = 0.1
time = "time_s"
[[channel]]
name = "pitch_demand"
unit = "rad"
role = "input"
[[channel]]
name = "generator_speed"
unit = "rad/s"
role = "output"
[[channel]]
name = "tower_acc_fore_aft"
unit = "m/s^2"
role = "output"
"""


def turbine(seed: int, *, rigid: bool) -> Array:
    """Return time, pitch, speed and the tower's acceleration (N, 4), sampled exactly; noise on both sensors.

    Ω' = −0.2 Ω − p + 0.6 w; thrust T = −0.3 Ω − p + 0.5 w; q'' = ω² (T − q) − 2 ζ ω q'; w has a memory of 5 s.
    """
    rng, omega, thrust = np.random.default_rng(seed), 2 * np.pi * HZ, np.array([-0.3, -1.0, 0.5, 0.0, 0.0])
    M = np.zeros((5, 5))  # Ω, p, w, q, q'
    M[0, :3] = -0.2, -1.0, 0.6
    M[3, 4] = 1.0
    M[4] = omega**2 * thrust
    M[4, 3:] = -(omega**2), -2 * DAMPING * omega
    over, decay = expm(M * STEP), np.exp(-STEP / 5)
    pitch = np.repeat(rng.choice([-0.5, 0.5], SAMPLES // 8 + 1), 8)[:SAMPLES]
    x, rows = np.zeros(5), np.empty((SAMPLES, 4))
    for k in range(SAMPLES):
        x[1], x[2] = pitch[k], decay * x[2] + np.sqrt(1 - decay**2) * rng.standard_normal()
        rows[k] = k * STEP, pitch[k], x[0], 0.05 * thrust @ x + (0.0 if rigid else M[4] @ x)
        x = over @ x
    rows[:, 2:] += rng.standard_normal((SAMPLES, 2)) * (0.02, 0.01)
    return rows


def write_pair(folder: Path, spoilt_from: int = SAMPLES) -> Path:
    """Write a recording (noise from a sample on) and the simulation without a tower, under other wind."""
    folder.mkdir()
    for name, seed, rigid in (("recording", 1, False), ("simulation", 2, True)):
        rows = turbine(seed, rigid=rigid)
        if not rigid:
            rows[spoilt_from:, 2:] = np.random.default_rng(0).standard_normal((SAMPLES - spoilt_from, 2))
        head = "time_s,pitch_demand,generator_speed,tower_acc_fore_aft"
        np.savetxt(folder / f"{name}.csv", rows, "%.9g", ",", header=head, comments="")
    (folder / "roles.toml").write_text(ROLES)
    (folder / "case.toml").write_text(CASE)
    return folder


def fitted(folder: Path) -> tuple[Prepared, Candidate]:
    """Return the stage, and the tower's mode fitted on the fit data."""
    stage = prepare(load_case(folder))
    bank = score_bank(stage, [a for a in stage.hypotheses if a.entry == "tower_fore_aft"], 1)
    (found,) = fit_rows(stage, bank.rows)
    return stage, found


def told(candidate: Candidate) -> dict[str, tuple[float, float]]:
    return dict(candidate.values["tower_fore_aft output:tower_acc_fore_aft"])


def at(fit: Fit, model: Equations, damping: float) -> Fit:
    """Return the fit with another damping of the mode, as sure of it as before."""
    theta = fit.point.theta.copy()
    theta[model.index("mode2_damping")] = damping
    return replace(fit, point=replace(fit.point, theta=theta))


@dataclass(frozen=True, eq=False)
class Found:
    """Hold the stage, the tower's mode fitted on the fit data, and its fit and model on all but the sealed data."""

    stage: Prepared
    mode: Candidate
    fit: Fit
    model: Equations

    def recorded(self, damping: float) -> dict[str, tuple[float, float]]:
        """Return what PBSID says where a fit says this damping."""
        return recorded_modes(self.stage, self.mode.attachments, at(self.fit, self.model, damping), self.model)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Found:
    stage, mode = fitted(write_pair(tmp_path_factory.mktemp("pair") / "case"))
    predictor = mode.predictor.on((*stage.split.fit, *stage.split.select))
    starts = mode.predictor.score_elsewhere(mode.fit, stage.split.select)[2].x0
    fit = predictor.fit(replace(mode.fit.point, x0=(*mode.fit.point.x0, *starts)), mode.fit.free, iterations=10)
    assert fit is not None
    return Found(stage, mode, fit, predictor.compiled.model)


def test_where_the_structure_is_right_the_fit_has_the_word(found: Found) -> None:
    """It is ten times as sharp; PBSID's 0.064 ± 0.007 does not contradict it."""
    frequency, damping = (found.fit.point.theta[found.model.index(f"mode2_{w}")] for w in ("frequency_hz", "damping"))
    assert found.recorded(float(damping)) == {}
    values = told(estimated_on_all(found.stage, found.mode))
    assert list(values) == ["frequency_hz", "damping"]
    assert values["frequency_hz"][0] == pytest.approx(frequency, abs=1e-3) == pytest.approx(HZ, rel=0.01)
    assert values["damping"][0] == pytest.approx(damping, abs=1e-3) == pytest.approx(DAMPING, rel=0.05)


@pytest.mark.parametrize("damping", [0.02, 0.15])
def test_where_a_fit_is_off_the_recording_has_the_word(found: Found, damping: float) -> None:
    """The truth within 2.6 deviations (1 in 100), which are no more than a fifth of the damping."""
    known = found.recorded(damping)
    assert list(known) == ["mode2_frequency_hz", "mode2_damping"]
    for (value, std), true in zip(known.values(), (HZ, DAMPING), strict=True):
        assert abs(value - true) < 2.6 * std and std < 0.2 * true


def test_what_is_told_is_what_the_corrected_model_has(found: Found, monkeypatch: pytest.MonkeyPatch) -> None:
    known = {"mode2_frequency_hz": (0.331, 0.002), "mode2_damping": (0.061, 0.003)}
    monkeypatch.setattr(reestimate, "recorded_modes", lambda *_: known)
    last = estimated_on_all(found.stage, found.mode)
    assert list(told(last)) == ["frequency_hz", "damping"]
    for (label, (value, deviation)), (name, (held, std)) in zip(told(last).items(), known.items(), strict=True):
        index = last.predictor.compiled.model.index(name)
        assert name.endswith(label) and value == held == last.fit.point.theta[index]
        assert deviation == pytest.approx(np.hypot(std, 0.01 * held))  # a hundredth for the form
        assert index in found.mode.fit.free.theta and index not in last.fit.free.theta


def test_a_mode_that_costs_much_of_what_the_effect_gains_is_another(
    found: Found, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = told(estimated_on_all(found.stage, found.mode))
    known = {"mode2_frequency_hz": (0.6, 0.002), "mode2_damping": (0.02, 0.003)}
    monkeypatch.setattr(reestimate, "recorded_modes", lambda *_: known)
    assert told(estimated_on_all(found.stage, found.mode)) == fit


def test_sealed_data_have_no_say_in_it(found: Found, tmp_path: Path) -> None:
    first = round(found.stage.split.sealed[0].start_s / STEP)
    spoilt = prepare(load_case(write_pair(tmp_path / "spoilt", first)))
    assert replace(found, stage=spoilt).recorded(0.02) == found.recorded(0.02)


def test_no_run_no_mode_and_no_long_recording_ask_for_nothing(found: Found) -> None:
    """Without a run the structure is the user's; half a minute holds no windows of two modes' periods."""
    assert (
        replace(found, stage=replace(found.stage, frame=replace(found.stage.frame, surrogate=None))).recorded(0.02)
        == {}
    )
    split = found.stage.split
    short = replace(split, fit=tuple(cut(s, 300) for s in split.fit), select=())
    assert replace(found, stage=replace(found.stage, split=short)).recorded(0.02) == {}
    assert recorded_modes(found.stage, (), found.fit, found.model) == {}


def cut(segment: Segment, rows: int) -> Segment:
    return replace(segment, u=segment.u[:rows], y=segment.y[:rows])
