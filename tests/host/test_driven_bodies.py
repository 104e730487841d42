"""Laws of the bodies of a linear model: a force on one of them enters where Maxwell's reciprocity says.

Motor and load on a shaft, and the same with a spring to the ground, are written down here with their own matrices and
brought to samples by the matrix exponential, so that the column of a force on either body is known.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm
from small_cases import write_case

from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.hypotheses.parts.base import Attachment, told_apart
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.structure.anatomy import in_digits, motions_of_state_space
from aeolid.diagnose.structure.baseline import equations_of
from aeolid.diagnose.structure.bodies import bodies_of_state_space, column_of_force
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
STEP = 0.01
MOTOR, LOAD, SHAFT, TWISTING, BRAKE = 0.02, 0.05, 20.0, 0.02, (0.04, 0.05)  # kg m^2, N m/rad, N m s/rad


def matrices(ground: float = 0.0, shaft: float = SHAFT) -> tuple[Array, Array]:
    """Return A and B of θ_m, θ_l, ω_m, ω_l under a torque on the motor and one on the load; ground: N m/rad."""
    K = shaft * np.array([[1.0, -1.0], [-1.0, 1.0]]) + ground * np.diag([0.0, 1.0])
    D = TWISTING * np.array([[1.0, -1.0], [-1.0, 1.0]]) + np.diag(BRAKE)
    inverse = np.diag([1 / MOTOR, 1 / LOAD])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ K, -inverse @ D]])
    return A, np.vstack([np.zeros((2, 2)), inverse])


def sampled(A: Array, B: Array) -> tuple[Array, Array]:
    whole = np.zeros((len(A) + B.shape[1],) * 2)
    whole[: len(A), : len(A)], whole[: len(A), len(A) :] = A, B
    held = expm(whole * STEP)
    return held[: len(A), : len(A)], held[: len(A), len(A) :]


def without_the_angle(A: Array, B: Array) -> tuple[Array, Array]:
    """Return the same of twist, ω_m, ω_l: where nothing is held, the angle itself is not to be seen in speeds."""
    T = np.array([[1.0, -1.0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    back = np.array([[1.0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 1]])
    return T @ A @ back, T @ B


def model_of(A: Array, b: Array, C: Array, units: tuple[str, ...], offset: float = 0.0) -> StateSpace:
    signals = tuple(Signal(name, unit, offset) for name, unit in zip(("motor", "load"), units, strict=False))
    states = tuple(Signal(f"x{k}", "1") for k in range(len(A)))
    return StateSpace(A, b[:, None], C, np.zeros((len(C), 1)), None, np.zeros(len(A)), None, STEP,
                      (Signal("torque", "N m"),), signals, states)  # fmt: skip


def drive_train(shaft: float = SHAFT) -> tuple[StateSpace, Array]:
    """Return motor and load seen by their speeds, and the column of a torque on the load."""
    A, B = sampled(*without_the_angle(*matrices(shaft=shaft)))
    return model_of(A, B[:, 0], np.eye(3)[1:], ("rad/s", "rad/s")), B[:, 1]


def moved(model: StateSpace, samples: int = 2000) -> Array:
    u = np.repeat(np.random.default_rng(1).uniform(-1, 1, (samples // 20, 1)), 20, axis=0)
    return model.simulate(u)


def found_in(model: StateSpace, y: Array | None = None) -> list[str]:
    sizes = np.ones(len(model.A))
    bodies, _ = bodies_of_state_space(
        model, equations_of(model, shaped_noise=False), sizes, moved(model) if y is None else y
    )
    return [b.location for b in bodies]


@pytest.mark.parametrize("ground", [0.0, 30.0], ids=["nothing holds it", "a spring holds it"])
def test_a_force_on_the_other_body_enters_as_its_equations_have_it(ground: float) -> None:
    """Exact for symmetric mass, damping and stiffness; eigenvectors of a 4 x 4 matrix lose some digits."""
    A, B = sampled(*matrices(ground)) if ground else sampled(*without_the_angle(*matrices()))
    rows = np.eye(len(A))[-2:]
    np.testing.assert_allclose(column_of_force(A, B[:, 0], rows[0], rows[1]), B[:, 1], rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(column_of_force(A, B[:, 1], rows[1], rows[0]), B[:, 0], rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(column_of_force(A, B[:, 0], rows[0], rows[0]), B[:, 0], rtol=1e-8, atol=1e-10)


def test_bodies_are_those_that_speeds_or_positions_show() -> None:
    assert found_in(drive_train()[0]) == ["state:motor", "state:load"]
    A, B = sampled(*matrices(30.0))
    by_angles = model_of(A, B[:, 0], np.eye(4)[:2], ("rad", "rad"))
    assert found_in(by_angles) == ["state:motor", "state:load"]


def test_a_shaft_that_turns_one_way_has_no_friction_to_find() -> None:
    model, _ = drive_train()
    turning = replace(model, outputs=tuple(replace(s, offset=100.0) for s in model.outputs))
    assert found_in(turning, moved(model) + 100.0) == []


def test_one_mode_is_no_body_and_what_no_drive_moves_at_once_is_none() -> None:
    A, B = sampled(*matrices(30.0))
    spring = np.array([[0.0, 1.0], [-400.0, -0.6]])
    one = sampled(spring, np.array([[0.0], [1.0]]))
    assert found_in(model_of(one[0], one[1][:, 0], np.eye(2)[1:], ("m/s",))) == []
    assert found_in(model_of(A, B[:, 0], np.eye(4)[3:], ("rad/s",))) == []  # the load's speed alone


def test_a_model_without_memory_and_one_of_integrators_alone_are_no_trouble() -> None:
    still = model_of(np.zeros((1, 1)), np.ones(1), np.ones((1, 1)), ("m/s",))
    assert found_in(still) == []
    pushed = model_of(np.eye(1), np.ones(1), np.ones((1, 1)), ("m/s",))
    assert found_in(pushed, np.random.default_rng(1).standard_normal((500, 1))) == ["state:motor"]


def test_two_modes_close_together_have_names_of_their_own() -> None:
    """A tower's modes of 0.3214 and 0.3208 Hz were one name, and the model of one stood for the other's."""
    assert in_digits(np.array([0.3214, 0.3208, 1.3])) == ["0.3214", "0.3208", "1.3"]
    assert in_digits(np.array([2.35])) == ["2.35"]
    assert in_digits(np.zeros(2)) == ["0 (1)", "0 (2)"]
    poles = np.exp(np.array([[-0.02 + 2.0194j, -0.03 + 2.0157j]]).ravel() * STEP)
    A = np.zeros((4, 4))
    for k, pole in enumerate(poles):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
    model = model_of(A, np.ones(4), np.array([[1.0, 0, 0.2, 0], [0.1, 0, 1.0, 0]]), ("m", "m"))
    motions, _ = motions_of_state_space(model, equations_of(model, shaped_noise=False), np.ones(4), np.ones(2))
    assert len({m.location for m in motions}) == 2


def test_attachments_of_one_key_are_told_apart() -> None:
    one = Attachment("coulomb_friction", "key", {}, lambda model: model, ())
    assert [a.key for a in told_apart([one, replace(one, key="other"), one])] == ["key", "other", "key (2)"]


@pytest.mark.slow
def test_dry_friction_of_a_load_is_named_behind_a_shaft_that_is_too_stiff(tmp_path: Path) -> None:
    """The model's shaft is 2 % too stiff, as constants are; the friction is a fifth of the torque's deviation.

    The friction is simulated apart from the catalogue: a sign of the load's own speed, twenty steps a sample.
    """
    A, B = without_the_angle(*matrices(shaft=SHAFT * 0.98))
    random, fine, samples, friction = np.random.default_rng(5), 20, 4000, 0.12
    Af, Bf = (expm(A * STEP / fine), np.linalg.solve(A, (expm(A * STEP / fine) - np.eye(3)) @ B))
    torque = np.repeat(random.uniform(-1, 1, samples // 25), 25)
    x, y = np.zeros(3), np.zeros((samples, 2))
    for k in range(samples):
        y[k] = x[1:]
        for _ in range(fine):
            x = Af @ x + Bf @ np.array([torque[k], -friction * np.tanh(x[2] / 1e-3)])
    y += 0.01 * y.std(axis=0) * random.standard_normal(y.shape)
    model, channels = drive_train()[0], [("torque", "N m", "input"), ("motor", "rad/s", "output")]
    channels.append(("load", "rad/s", "output"))
    rows = np.column_stack([torque, y])
    folder = write_case(tmp_path, json.dumps(model.to_json()), STEP, channels, rows, kind="state_space")
    found = study(load_case(folder), sham=0, seed=0, progress=lambda *_: None)
    assert found.winner is not None and found.proof is not None
    whole = found.second or found.winner
    (own,) = (a for a in whole.attachments if a.entry == "coulomb_friction")
    value, std = whole.values[own.key]["force"]
    assert abs(value - friction) < 3 * std + 0.02 * friction
    assert own.location["entry"] == "state:load"
    assert {a.entry for a in whole.attachments} <= {"coulomb_friction", "parameter_error"}
    assert diagnose(found)["verdict"] == "named"
