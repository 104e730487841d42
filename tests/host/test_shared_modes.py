"""Laws of one mode that several outputs show: what a model of fewer modes lacks has one frequency, not one a sensor."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eigh, expm
from small_cases import write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site
from aeolid.diagnose.hypotheses.parts.shared_modes import seen_in_all
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.scoring.scores import score_bank
from aeolid.diagnose.structure.baseline import equations_of
from aeolid.models.integrate import compile_equations, simulate
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
STEP, ZETA = 0.02, 0.015
STIFFNESS = 400.0 * np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]])  # three storeys of 1 kg
SQUARES, SHAPES = eigh(STIFFNESS)
LACKING = 1  # the second mode, 3.97 Hz
UNITS = ("m", "m/s", "m/s^2")


def structure(modes: list[int], pushed: list[int], units: tuple[str, ...]) -> StateSpace:
    """Return these modes of the storeys, pushed at some of them, read by a sensor of each unit on each, exactly."""
    n, r = len(modes), len(pushed)
    omega = np.sqrt(SQUARES[modes])
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(omega**2), -2 * ZETA * np.diag(omega)]])
    B = np.vstack([np.zeros((n, r)), SHAPES[np.ix_(pushed, modes)].T])
    read = {"m": np.hstack([np.eye(n), np.zeros((n, n))]), "m/s": np.hstack([np.zeros((n, n)), np.eye(n)])}
    read["m/s^2"] = A[n:]
    C = np.vstack([SHAPES[k, modes] @ read[unit] for k, unit in enumerate(units)])
    D = np.vstack([SHAPES[k, modes] @ B[n:] * (unit == "m/s^2") for k, unit in enumerate(units)])
    whole = np.zeros((2 * n + r, 2 * n + r))
    whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n :] = A, B
    held = expm(whole * STEP)
    inputs = tuple(Signal(f"push{k + 1}", "N") for k in pushed)
    outputs = tuple(Signal(f"storey{k + 1}", unit) for k, unit in enumerate(units))
    states = tuple(Signal(f"x{k}", "1") for k in range(2 * n))
    return StateSpace(held[: 2 * n, : 2 * n], held[: 2 * n, 2 * n :], C, D, None, np.zeros(2 * n), None, STEP, inputs,
                      outputs, states)  # fmt: skip


def pushes(samples: int, count: int) -> Array:
    return np.repeat(np.random.default_rng(3).uniform(-10, 10, (samples // 8 + 1, count)), 8, axis=0)[:samples]


def site_of(model: StateSpace, u: Array, y: Array, **context: str) -> Site:
    equations = equations_of(model, shaped_noise=False)
    names = tuple(s.name for s in model.inputs)
    return Site(
        equations, model, (), STEP, STEP, u, y, names, tuple(s.name for s in model.outputs), equations.symbols, (),
        np.zeros((len(u), 0)), context,
    )  # fmt: skip


def with_mode(a: Attachment, model: StateSpace, values: dict[str, float], u: Array) -> Array:
    compiled = compile_equations(a.edit(equations_of(model, shaped_noise=False)))
    theta = np.array([values.get(p.name, p.value) for p in compiled.model.parameters])
    return simulate(compiled, u, theta, compiled.model.x0, STEP)


@pytest.mark.parametrize("units", [("m", "m", "m"), UNITS])
@pytest.mark.parametrize("pushed", [[2], [2, 0]])
def test_a_mode_that_was_left_out_is_put_back_exactly(units: tuple[str, ...], pushed: list[int]) -> None:
    """Inputs held, any number of them, and sensors of displacement, velocity and acceleration side by side."""
    whole, model = structure([0, 1, 2], pushed, units), structure([0, 2], pushed, units)
    u = pushes(1500, len(pushed))
    y = whole.simulate(u)
    hypotheses = seen_in_all(site_of(model, u, y))
    assert [a.location["inputs"] for a in hypotheses] == [[s.name] for s in model.inputs]
    omega = np.sqrt(SQUARES[LACKING])
    for i, a in enumerate(hypotheses):
        tag, shape = f"shared{i + 1}", SHAPES[:, LACKING]
        drive = shape[pushed[i]] / omega**2
        orders = {"m": 1.0, "m/s": omega, "m/s^2": omega**2}
        values = {f"{tag}_frequency_hz": omega / (2 * np.pi), f"{tag}_damping": ZETA}
        values |= {f"{tag}_c{j + 1}": shape[j] * drive * orders[unit] for j, unit in enumerate(units)}
        values |= {f"{tag}_b{k + 1}": shape[p] / shape[pushed[i]] for k, p in enumerate(pushed) if k != i}
        assert set(values) <= {s.name for s in a.slots}
        got = with_mode(a, model, values, u)
        np.testing.assert_allclose(got / y.std(axis=0), y / y.std(axis=0), atol=1e-9)
        none = with_mode(a, model, {}, u)
        np.testing.assert_allclose(none / y.std(axis=0), model.simulate(u) / y.std(axis=0), atol=1e-12)


def test_one_output_and_modes_of_a_turbine_are_left_to_modes_of_their_own() -> None:
    model = structure([0, 2], [2], UNITS)
    u = pushes(1500, 1)
    y = model.simulate(u)
    assert len(seen_in_all(site_of(model, u, y))) == 1
    assert seen_in_all(site_of(model, np.zeros_like(u), y)) == []  # nothing drives it
    alone = structure([0, 2], [2], UNITS[:1])
    assert seen_in_all(site_of(alone, u, y[:, :1])) == []
    (a,) = seen_in_all(site_of(model, u, y))
    omega, own = np.sqrt(SQUARES[2]) / (2 * np.pi), {"frequency_hz": 0.0, "damping": ZETA}
    assert "the model has this mode" in a.credible(own | {"frequency_hz": omega})
    assert a.credible(own | {"frequency_hz": 3.97}) == ""
    broad = own | {"frequency_hz": 0.9 * omega, "damping": 0.2}  # a correction of the model's own mode
    assert "its half-power band holds the model's own mode" in a.credible(broad)


def test_a_mode_that_three_sensors_show_has_one_name(tmp_path: Path) -> None:
    """With one mode a sensor the answer was three effects, of the same frequency and damping within a hundredth."""
    whole, model = structure([0, 1, 2], [2], ("m",) * 3), structure([0, 2], [2], ("m",) * 3)
    u = pushes(2000, 1)
    clean = whole.simulate(u)
    y = clean + 0.01 * clean.std(axis=0) * np.random.default_rng(4).standard_normal(clean.shape)
    channels = (("push3", "N", "input"), *((s.name, "m", "output") for s in model.outputs))
    write_case(tmp_path, json.dumps(model.to_json()), STEP, channels, np.column_stack([u, y]), kind="state_space")
    found = study(load_case(tmp_path), sham=0, seed=0, progress=lambda words, share: None)
    assert found.winner is not None and found.second is None
    (told,) = found.winner.attachments
    assert told.key == "structural_mode input:push3, all outputs"
    frequency, deviation = found.winner.values[told.key]["frequency_hz"]
    assert frequency == pytest.approx(np.sqrt(SQUARES[LACKING]) / (2 * np.pi), abs=3 * deviation)
    assert found.proof is not None and found.proof.interval[0] > 0


def test_a_fit_starts_from_every_peak_of_a_score(tmp_path: Path) -> None:
    """Beside the own mode, fitted too soft, scores are highest near that: the mode of 4 Hz was never reached."""
    whole, model = structure([0, 1], [2], ("m",)), structure([0], [2], ("m",))
    u = pushes(3000, 1)
    clean = whole.simulate(u)
    y = clean + 0.01 * clean.std() * np.random.default_rng(4).standard_normal(clean.shape)
    channels = (("push3", "N", "input"), ("storey1", "m", "output"))
    write_case(tmp_path, json.dumps(model.to_json()), STEP, channels, np.column_stack([u, y]), kind="state_space")
    prepared = prepare(load_case(tmp_path))
    (wanted,) = (a for a in prepared.hypotheses if a.key == "structural_mode output:storey1")
    bank = score_bank(prepared, [wanted], 1)
    true = np.sqrt(SQUARES[1]) / (2 * np.pi)
    assert abs(bank.rows[0].grid["mode1_frequency_hz"] / true - 1) > 0.3 and len(bank.rows[0].others) > 1
    (found,) = fit_rows(prepared, bank.rows)
    frequency, _ = found.values[wanted.key]["frequency_hz"]
    assert frequency == pytest.approx(true, rel=0.01)
