"""Check identification from outputs alone: modes, shapes and their deviations against laws and other methods."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from aeolid.api.facts import stated_modes
from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.formats import write_table
from aeolid.identify.bootstrap import collect_scores, run_bootstrap
from aeolid.identify.compressed import compress
from aeolid.identify.fir import identify_fir
from aeolid.identify.markov import estimate_markov, regressor_columns
from aeolid.identify.output_only import of_outputs_alone
from aeolid.identify.request import Request
from aeolid.identify.run import identify_records
from aeolid.identify.shape_spread import shape_covariance
from aeolid.identify.subspace import ScaledModel, find_states, system_matrices
from aeolid.identify.uncertainty import MatrixSpread, matrix_spread
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import find_scaling
from aeolid.models.shapes import assurance, reference_outputs, scaled_to, shape_from_json
from aeolid.plants.structure import shaken, shear_building

STEP = 0.1
BUILDING = shear_building()


@pytest.fixture(scope="module")
def record():
    return shaken(BUILDING, 12_000, STEP, 3)


@pytest.fixture(scope="module")
def found(record):
    return identify_varx([record], past=12, order=8)


def covariance_driven(y, order, lags):
    """Return the poles and shapes of covariance-driven subspace identification (Peeters and De Roeck 1999)."""
    y, count, outputs = y - y.mean(axis=0), len(y), y.shape[1]
    R = [y[k:].T @ y[: count - k] / (count - k) for k in range(2 * lags)]
    hankel = np.block([[R[i + j + 1] for j in range(lags)] for i in range(lags)])
    U, s, _ = np.linalg.svd(hankel)
    observability = U[:, :order] * np.sqrt(s[:order])
    A = np.linalg.lstsq(observability[:-outputs], observability[outputs:], rcond=None)[0]
    values, vectors = np.linalg.eig(A)
    return values, observability[:outputs] @ vectors


def swinging(result):
    return [m for m in result.modes if not m.is_real]


def shape_of(mode, names=BUILDING.names):
    return np.array([mode.shape.values[n] for n in names])


def test_a_recording_of_outputs_alone_gives_the_innovation_form(found, record):
    model = found.model
    assert model.B.shape == (8, 0) and model.D.shape == (4, 0) and model.K.shape == (8, 4)
    assert max(abs(np.linalg.eigvals(model.A - model.K @ model.C))) < 1
    assert found.band is None and found.to_json()["fit"]["free_run"] is None
    assert "free run" not in found.summary()
    assert model.to_json()["inputs"] == [] and json.loads(json.dumps(found.to_json()))["modes"][0]["shape"]


def test_modes_and_shapes_are_those_of_the_structure_within_their_deviations(found):
    hertz, damping, shapes = BUILDING.modes()
    assert len(swinging(found)) == 4
    for mode, f, d, true in zip(swinging(found), hertz, damping, shapes.T, strict=True):
        assert abs(mode.frequency_hz - f) < 4 * mode.frequency_std_hz < 0.01 * f
        assert abs(mode.damping - d) < 4 * mode.damping_std
        assert assurance(shape_of(mode)[:, None], true[:, None])[0, 0] > 0.995
        true = true / true[BUILDING.names.index(mode.shape.reference)]
        for name, value in zip(BUILDING.names, true, strict=True):
            rr, ri, ii = mode.shape.covariance[name]
            off = mode.shape.values[name] - value
            off = np.array([off.real, off.imag])
            around = np.array([[rr, ri], [ri, ii]]) + 1e-12 * np.eye(2)
            assert off @ np.linalg.solve(around, off) < 25


def test_covariance_driven_identification_finds_the_same_modes(found, record):
    values, shapes = covariance_driven(record.values, 8, 20)
    mine = np.array([m.eigenvalue for m in swinging(found)])
    up = values.imag > 0
    distance = abs(mine[:, None] - values[up][None])
    for i, j in zip(*linear_sum_assignment(distance), strict=True):
        assert distance[i, j] < 0.02 * abs(np.log(mine[i]))
        assert assurance(shape_of(swinging(found)[i])[:, None], shapes[:, up][:, j : j + 1])[0, 0] > 0.98


def random_model(random, n=6, outputs=3):
    A, T = np.zeros((n, n)), random.standard_normal((n, n)) + 3 * np.eye(n)
    for i, (size, angle) in enumerate([(0.9, 0.3), (0.8, 0.9), (0.7, 1.6)]):  # well apart: derivatives are moderate
        c, d = size * np.cos(angle), size * np.sin(angle)
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[c, d], [-d, c]]
    A = T @ A @ np.linalg.inv(T)
    C, K = random.standard_normal((outputs, n)), np.zeros((n, outputs))
    none = np.zeros((outputs, 0))
    return ScaledModel(A, np.zeros((n, 0)), C, none, K, np.eye(outputs), "")


def shapes_at(A, C, reference):
    values, right = np.linalg.eig(A)
    at = reference_outputs(C @ right, reference)
    return values, scaled_to((C @ right).astype(complex), at), at


@pytest.mark.parametrize("reference", [None, 1])
def test_the_deviation_of_a_shape_is_its_derivative(reference):
    random = np.random.default_rng(5)
    model = random_model(random)
    n, outputs = 6, 3
    change = random.standard_normal((n + outputs, n))
    spread = MatrixSpread(change.reshape(1, -1), n, 0)
    covariance = shape_covariance(model, spread, reference)
    values, shapes, at = shapes_at(model.A, model.C, reference)
    h, moved = 1e-6, []
    for sign in (1, -1):
        A, C = model.A + sign * h * change[:n], model.C + sign * h * change[n:]
        others, right = np.linalg.eig(A)
        order = linear_sum_assignment(abs(values[:, None] - others[None]))[1]
        moved.append(scaled_to((C @ right[:, order]).astype(complex), at))
    slope = (moved[0] - moved[1]) / (2 * h)
    for i in range(n):
        for j in range(outputs):
            d = np.array([slope[j, i].real, slope[j, i].imag])
            np.testing.assert_allclose(covariance[i, j], np.outer(d, d), rtol=1e-4, atol=1e-6)
    assert np.allclose(shapes[at, np.arange(n)], 1)


def test_deviations_of_shapes_do_not_hang_on_the_basis_of_the_states():
    random = np.random.default_rng(6)
    model = random_model(random)
    n, outputs = 6, 3
    root = random.standard_normal((20, n + outputs, n))
    T = random.standard_normal((n, n)) + 3 * np.eye(n)
    inverse = np.linalg.inv(T)
    left = np.block([[T, np.zeros((n, outputs))], [np.zeros((outputs, n)), np.eye(outputs)]])
    other = replace(model, A=T @ model.A @ inverse, C=model.C @ inverse)
    first = shape_covariance(model, MatrixSpread(root.reshape(20, -1), n, 0), 0)
    second = shape_covariance(other, MatrixSpread((left @ root @ inverse).reshape(20, -1), n, 0), 0)
    here, there = np.linalg.eigvals(model.A), np.linalg.eigvals(other.A)
    order = linear_sum_assignment(abs(here[:, None] - there[None]))[1]
    np.testing.assert_allclose(first, second[order], rtol=1e-6, atol=1e-9)


def test_another_unit_of_a_channel_scales_its_shape_and_nothing_else(found, record):
    values = record.values * np.array([1.0, 100.0, 1.0, 1.0])
    other = identify_varx([replace(record, values=values)], past=12, order=8)
    for one, two in zip(swinging(found), swinging(other), strict=True):
        assert two.frequency_hz == pytest.approx(one.frequency_hz, rel=1e-8)
        assert two.damping_std == pytest.approx(one.damping_std, rel=1e-6)
        assert one.shape.reference == two.shape.reference
        unit = 1 / 100 if one.shape.reference == "floor_2" else 1.0
        factor = {n: unit * (100.0 if n == "floor_2" else 1.0) for n in BUILDING.names}
        for name in BUILDING.names:
            assert two.shape.values[name] == pytest.approx(factor[name] * one.shape.values[name], rel=1e-6, abs=1e-9)
            assert two.shape.amplitude_std(name) == pytest.approx(
                factor[name] * one.shape.amplitude_std(name), rel=1e-5, abs=1e-9
            )


def test_shapes_scaled_to_another_reference_are_the_same_shapes(found, record):
    other = identify_varx([record], past=12, order=8, reference="floor_1")
    for one, two in zip(swinging(found), swinging(other), strict=True):
        assert two.shape.reference == "floor_1" and two.shape.values["floor_1"] == pytest.approx(1)
        assert two.shape.phase_std("floor_1") == pytest.approx(0, abs=1e-9)
        assert assurance(shape_of(one)[:, None], shape_of(two)[:, None])[0, 0] == pytest.approx(1)
    with pytest.raises(UsageError, match="reference 'roof' is no output"):
        identify_records([record], Request(past=12, order=8, reference="roof"))


def test_the_bootstrap_finds_the_same_deviations_of_shapes(record):
    scaling = find_scaling([record])
    windows = compress([record], scaling, 12)
    factor, estimate = windows.whole, estimate_markov(windows.whole, (), "none")
    basis = find_states(factor, estimate.theta, 12)
    model = system_matrices(factor, basis.state_map(8), ())
    formula = shape_covariance(model, matrix_spread(factor, basis, model, estimate, ()), 0)
    scores = collect_scores([record], scaling, factor, estimate.theta, regressor_columns(factor, ()))
    draws = run_bootstrap(factor, estimate, model, scores, (), 12, np.ones(1, dtype=complex), 60, 0, 0)
    scatter = draws.shapes.var(axis=0)  # (n, l)
    expected = formula[..., 0, 0] + formula[..., 1, 1]
    ratio = np.sqrt(scatter[:, 1:] / expected[:, 1:])
    assert 0.6 < np.median(ratio) < 1.5


def test_shapes_survive_the_file(found):
    told = json.loads(json.dumps(found.to_json()))
    for mode, read in zip(found.modes, stated_modes(told), strict=True):
        assert read.shape == mode.shape and read.tone == mode.tone
    assert shape_from_json({"reference": "a", "outputs": {"a": {"re": "x"}}}) is None


def test_roles_alone_decide_unless_outputs_are_named(record):
    named = of_outputs_alone([record], ["floor_3", "floor_1"])[0]
    assert named.names("output") == ("floor_1", "floor_3") and named.names("input") == ()
    as_input = replace(record, channels=(replace(record.channels[0], role="input"), *record.channels[1:]))
    assert of_outputs_alone([as_input], ["all"])[0].names("output") == BUILDING.names[1:]
    assert of_outputs_alone([as_input], None)[0] is as_input
    with pytest.raises(UsageError, match="no such channel"):
        of_outputs_alone([record], ["attic"])
    with pytest.raises(UsageError, match="twice"):
        of_outputs_alone([record], ["floor_1", "floor_1"])
    with pytest.raises(DataError, match="no channel has the role 'input'"):
        identify_fir([record], past=10)
    with pytest.raises(UsageError, match="--outputs is for --method varx and varmax"):
        Request(method="lpv", past=10, outputs="all").check()


@pytest.fixture(scope="module")
def folder(tmp_path_factory, record):
    where = tmp_path_factory.mktemp("alone")
    record = record.slice(0, 3000)
    columns = {"time_s": record.time_s} | {c.name: record.column(c.name) for c in record.channels}
    write_table(where / "shaken.csv", columns, {"time_s": "s"})
    roles = ['[recording]\ntime = "time_s"']
    for name in BUILDING.names:
        role = "input" if name == "floor_4" else "output"
        roles.append(f'[[channel]]\nname = "{name}"\nunit = "m"\nrole = "{role}"')
    (where / "roles.toml").write_text("\n".join(roles))
    return where


def test_the_command_says_what_a_model_of_outputs_alone_cannot_do(folder, capsys):
    base = [str(folder / "shaken.csv"), "--roles", str(folder / "roles.toml")]
    model = str(folder / "model.json")
    page = folder / "page.html"
    own = ["--outputs", "all", "--past", "12", "--order", "8", "--reference", "floor_2", "--report", str(page)]
    assert main(["identify", *base, *own, "--out", model]) == 0
    assert "identified from outputs alone" in " ".join(capsys.readouterr().out.split())
    told = json.loads((folder / "model.json").read_text())
    assert told["inputs"] == [] and [s["name"] for s in told["outputs"]] == ["floor_1", "floor_2", "floor_3"]
    assert "Mode shapes" in page.read_text() and "Frequency response" not in page.read_text()
    assert main(["simulate", model, *base, "--out", str(folder / "sim.csv")]) == 2
    assert "the model has no input" in " ".join(capsys.readouterr().err.split())
    assert main(["validate", model, *base, "--json", str(folder / "fit.json")]) == 0
    assert "free run" not in capsys.readouterr().out
    assert json.loads((folder / "fit.json").read_text())["free_run"] is None
    assert main(["validate", model, *base, "--fail-above", "0.5"]) == 2
    assert "--metric one-step" in " ".join(capsys.readouterr().err.split())
