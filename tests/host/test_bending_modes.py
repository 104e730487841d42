"""Laws of a mode within a motion: a body that the model has as one and that bends, seen from either of its ends.

The two coupled inertias are simulated here apart from the catalogue, by the matrix exponential of their own equations.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site
from aeolid.diagnose.hypotheses.parts.bending_modes import within_motions
from aeolid.diagnose.hypotheses.parts.lateness import lateness, later_than_a_reading
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.structure.anatomy import motions_of_equations
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, simulate

Array = NDArray[np.float64]
STEP = 0.01
DRIVEN, FAR, SHAFT, TWISTING, BRAKE = 0.02, 0.05, 20.0, 0.03, 0.08  # kg m^2, kg m^2, N m/rad, N m s/rad, N m s/rad
OMEGA2 = SHAFT * (1 / DRIVEN + 1 / FAR)
FREQUENCY = np.sqrt(OMEGA2) / (2 * np.pi)  # 5.95 Hz
DAMPING = TWISTING * (1 / DRIVEN + 1 / FAR) / (2 * np.sqrt(OMEGA2))

MODEL = """[model]
name = "one body"
[parameters]
J = { value = 0.07, unit = "kg m^2" }
b = { value = BRAKE, unit = "N m s/rad", min = 0.0, max = 1.0, free = true }
[[state]]
name = "q"
derivative = "w"
unit = "rad"
[[state]]
name = "w"
derivative = "(torque - b*w)/J"
unit = "rad/s"
"""
ANGLE = '[[output]]\nname = "angle"\nequation = "q"\nunit = "rad"\n'
SPEED = '[[output]]\nname = "speed"\nequation = "w"\nunit = "rad/s"\n'
LOAD = '[[output]]\nname = "load_speed"\nequation = "w"\nunit = "rad/s"\n'


def model_of(outputs: str, folder: Path, brake: float = 0.0) -> Equations:
    path = folder / "model.toml"
    path.write_text(MODEL.replace("BRAKE", repr(brake)) + outputs)
    return equations_file.load(path)


def site_of(model: Equations, context: dict[str, str] | None = None) -> Site:
    u = np.random.default_rng(1).standard_normal((2000, 1))
    y = np.ones((2000, len(model.outputs)))
    motions = motions_of_equations(model, np.ones(2), np.ones(2))
    names = tuple(o.name for o in model.outputs)
    return Site(
        model, None, tuple(motions), STEP, STEP, u, y, ("torque",), names, model.symbols, (), np.zeros((2000, 0)),
        context or {},
    )  # fmt: skip


def two_bodies(torque: Array, brake: float = 0.0) -> Array:
    """Return angle and speed of the driven body and speed of the far one (N, 3), the torque held over each sample."""
    A = np.array([
        [0, 0, 1, 0], [0, 0, 0, 1],
        [-SHAFT / DRIVEN, SHAFT / DRIVEN, -(TWISTING + brake) / DRIVEN, TWISTING / DRIVEN],
        [SHAFT / FAR, -SHAFT / FAR, TWISTING / FAR, -TWISTING / FAR],
    ])  # fmt: skip
    whole = np.zeros((5, 5))
    whole[:4, :4], whole[2, 4] = A, 1 / DRIVEN
    held = expm(whole * STEP)
    x, found = np.zeros(4), np.empty((len(torque), 3))
    for k, u in enumerate(torque):
        found[k] = x[0], x[2], x[3]
        x = held[:4, :4] @ x + held[:4, 4] * u
    return found


def bent(model: Equations, a: Attachment, values: dict[str, float], torque: Array) -> Array:
    """Return the outputs (N, l) of the model with the mode."""
    compiled = compile_equations(a.edit(model))
    theta = np.array([values.get(p.name, p.value) for p in compiled.model.parameters])
    return simulate(compiled, torque[:, None], theta, compiled.model.x0, STEP)


def torque_of(samples: int, seed: int = 3) -> Array:
    return 0.5 * np.repeat(np.random.default_rng(seed).choice([-1.0, 1.0], samples // 10), 10)


TRUE = {"bend1_frequency_hz": FREQUENCY, "bend1_damping": DAMPING}


def test_either_end_of_two_coupled_bodies_is_the_rigid_one_and_a_share_of_the_mode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The driven end sees the ratio of the inertias, the far one minus one; with none nothing changes.

    At a fifth of the step, so that the errors of integration, of fourth order, are below a hundred-thousandth.
    """
    monkeypatch.setattr(sys.modules[__name__], "STEP", 0.002)
    torque = torque_of(600)
    exact = two_bodies(torque)
    model = model_of(ANGLE + SPEED + LOAD, tmp_path)
    (a,) = within_motions(site_of(model))
    got = bent(model, a, TRUE | {"bend1_b1": FAR / DRIVEN, "bend1_b2": -1.0}, torque)
    np.testing.assert_allclose(got / np.abs(exact).max(axis=0), exact / np.abs(exact).max(axis=0), atol=1e-5)
    rigid = simulate(compile_equations(model), torque[:, None], model.theta, model.x0, STEP)
    np.testing.assert_allclose(bent(model, a, TRUE, torque), rigid, atol=1e-9)


def test_one_body_has_one_share_and_needs_two_readings(tmp_path: Path) -> None:
    """Position and speed of one body show one share; a single output is served by a mode of its own."""
    (one,) = within_motions(site_of(model_of(ANGLE + SPEED, tmp_path)))
    assert [s.name for s in one.slots] == ["bend1_frequency_hz", "bend1_damping", "bend1_b1"]
    (two,) = within_motions(site_of(model_of(SPEED + LOAD, tmp_path)))
    assert [s.name for s in two.slots][2:] == ["bend1_b1", "bend1_b2"]
    assert within_motions(site_of(model_of(SPEED, tmp_path))) == []


def test_a_turbine_and_a_model_in_discrete_time_are_left_to_modes_of_their_own(tmp_path: Path) -> None:
    model = model_of(SPEED.replace("speed", "rotor_speed") + LOAD.replace("load", "generator"), tmp_path)
    assert within_motions(site_of(model, {"machine": "wind turbine"})) == []
    assert within_motions(site_of(replace(model, sample_time_s=STEP))) == []


@pytest.mark.parametrize("columns", [(0, 1), pytest.param((1, 2), marks=pytest.mark.nightly)])
def test_a_body_that_bends_is_named_with_its_frequency(columns: tuple[int, int], tmp_path: Path) -> None:
    """Angle and speed of the driven end; speeds of both ends. A mode of one output alone explains half of either."""
    torque = torque_of(1500, seed=5)
    outputs = [(ANGLE, "angle", "rad"), (SPEED, "speed", "rad/s"), (LOAD, "load_speed", "rad/s")]
    chosen = [outputs[c] for c in columns]
    clean = two_bodies(torque, brake=BRAKE)[:, columns]
    y = clean + 0.01 * clean.std(axis=0) * np.random.default_rng(6).standard_normal(clean.shape)
    model_of("".join(c[0] for c in chosen), tmp_path, BRAKE)
    roles = "".join(f'[[channel]]\nname = "{n}"\nunit = "{u}"\nrole = "output"\n' for _, n, u in chosen)
    torque_role = '[[channel]]\nname = "torque"\nunit = "N m"\nrole = "input"\n'
    (tmp_path / "roles.toml").write_text(f"[recording]\nsample_time_s = {STEP}\n{torque_role}{roles}")
    (tmp_path / "case.toml").write_text(
        '[case]\ntitle = "a shaft that twists"\n[recordings]\nfiles = ["recording.csv"]\nroles = "roles.toml"\n'
        '[baseline]\nkind = "equations"\nfile = "model.toml"\n[context]\nmachine = "rig"\nclosed_loop = false\n'
    )
    heading = ",".join(["torque", *(n for _, n, _ in chosen)])
    np.savetxt(tmp_path / "recording.csv", np.column_stack([torque, y]), "%.9g", ",", header=heading, comments="")
    found = study(load_case(tmp_path), sham=0, seed=0, progress=lambda text, share: None)
    assert found.winner is not None
    (told,) = found.winner.attachments  # at the driven end a part that a spring carries is the same
    same = ("state:w", "state:w, carried", "input:torque, all outputs")
    assert told.key in [f"structural_mode {place}" for place in same], told.key
    frequency, deviation = found.winner.values[told.key]["frequency_hz"]
    assert frequency == pytest.approx(FREQUENCY, abs=3 * deviation)
    assert deviation < 0.02 * FREQUENCY
    assert found.proof is not None and found.proof.interval[0] > 0


def test_what_is_late_by_less_than_a_quarter_of_a_row_is_no_finding() -> None:
    """At low frequencies a lag, a dead time and a second-order filter of one delay are the same."""
    tau = 0.002
    slow = 2 * np.pi * 0.1
    for values, response in (
        ({"tau_s": tau}, 1 / (1 + 1j * slow * tau)),
        ({"delay_s": tau}, np.exp(-1j * slow * tau)),
        ({"offset_s": -tau}, np.exp(-1j * slow * tau)),
        ({"omega_rad_s": 800.0, "damping": 0.8}, 1 / (1 + 2 * 0.8 * 1j * slow / 800.0 + (1j * slow / 800.0) ** 2)),
    ):
        assert lateness(values) == pytest.approx(-np.angle(response) / slow, rel=1e-4)
        assert "sample" in later_than_a_reading(tau / 0.24)(values)
        assert later_than_a_reading(tau / 0.26)(values) == ""
        assert "sample" in later_than_a_reading(tau / 0.59, "sensor_lag")(values)
        assert later_than_a_reading(tau / 0.61, "sensor_second_order")(values) == ""
    assert later_than_a_reading(1.0)({"damping": 0.7}) == ""  # nothing is known of it
    assert later_than_a_reading(1.0)({"omega_rad_s": np.inf}) != ""
