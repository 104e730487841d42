"""The observer written in C computes what the predictor computes, within the rounding its precision allows."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.models.exchange.c_observer import c_observer
from aeolid.models.model_file import Signal
from aeolid.models.prediction import predict
from aeolid.models.state_space import StateSpace
from aeolid.plants.lti import fourth_order, simulate_fourth_order

ROOT = Path(__file__).resolve().parents[2]
COMPILERS = [c for c in ("gcc", "clang") if shutil.which(c)]

# Reads u and y as text, prints the prediction of every output at every sample, then the count of what was left out.
RIG = r"""
#include "plant.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static plant_real number(void) {
    char word[64];
    return scanf("%63s", word) == 1 ? (plant_real)strtod(word, NULL) : (plant_real)0;
}

int main(void) {
    plant_observer o;
    plant_real u[PLANT_INPUTS + 1], y[PLANT_OUTPUTS];
    const int samples = (int)number();
    int left_out = 0;
    plant_reset(&o);
    for (int k = 0; k < samples; k++) {
        for (int i = 0; i < PLANT_INPUTS; i++) {
            u[i] = number();
        }
        for (int i = 0; i < PLANT_OUTPUTS; i++) {
            y[i] = number();
            printf("%.17g ", (double)plant_prediction(&o, u, i));
        }
        left_out += plant_step(&o, u, y);
        printf("\n");
    }
    printf("%d\n", left_out);
    return 0;
}
"""


def warnings() -> list[str]:
    """Take the warnings the library is kept free of from its own build."""
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    found = re.search(r"set\(AEOLID_WARNINGS ([^)]*)\)", text)
    assert found is not None
    return [*found[1].split(), "-Werror"]


def plant(feedthrough: bool = True) -> StateSpace:
    """Build the fourth-order plant with offsets, and with feedthrough where asked."""
    model = fourth_order()
    D = np.array([[0.4, -0.2], [0.0, 0.7]]) if feedthrough else np.zeros((2, 2))
    inputs = (Signal("pitch", "deg", 4.5), Signal("torque */ \\", "N m", -3.0))
    outputs = (Signal("speed", "rpm", 12.1), Signal("Größe", "", 0.25))
    return replace(model, D=D, inputs=inputs, outputs=outputs, x0=np.array([0.3, -0.2, 0.1, 1.0]))


def recording(model: StateSpace, samples: int = 3000) -> tuple[np.ndarray, np.ndarray]:
    record = simulate_fourth_order(samples, 4, feedback=0.25)
    u, y = record.matrix("input"), record.matrix("output")
    return u + model.u_offset, y + u @ model.D.T + model.y_offset


def build(folder: Path, model: StateSpace, precision: str, compiler: str, *flags: str) -> Path:
    (folder / "plant.h").write_text(c_observer(model, name="plant", precision=precision), encoding="utf-8")
    (folder / "rig.c").write_text(RIG, encoding="utf-8")
    command = [compiler, "-std=c99", "-O2", *warnings(), *flags, "rig.c", "-o", "rig", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "rig"


def run(program: Path, u: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, int]:
    rows = "\n".join(" ".join(repr(float(v)) for v in row) for row in np.hstack([u, y]))
    done = subprocess.run([program], input=f"{len(u)}\n{rows}\n", capture_output=True, text=True, check=True)
    *lines, count = done.stdout.splitlines()
    return np.array([[float(v) for v in line.split()] for line in lines]), int(count)


def rounding_bound(model: StateSpace, u: np.ndarray, y: np.ndarray, unit: float) -> np.ndarray:
    """Bound the difference of two predictors (l,), to first order in the unit roundoff.

    Every sum of k products with rounded coefficients and data errs by at most (k + 2) units of the sum of magnitudes.
    Errors of the state go on with A − K C, so they add up by |(A − K C)^j| over all j.
    """
    A, B, C, D, K = (abs(m) for m in (model.A, model.B, model.C, model.D, model.K))
    du = abs(u - model.u_offset).max(axis=0) + abs(model.u_offset)
    size_y = abs(y).max(axis=0) + abs(model.y_offset)
    kept = model.A - model.K @ model.C
    x, big = model.x0.copy(), abs(model.x0)
    for a, b in zip(u - model.u_offset, y - model.y_offset, strict=True):
        x = kept @ x + (model.B - model.K @ model.D) @ a + model.K @ b
        big = np.maximum(big, abs(x))
    terms = model.order + u.shape[1] + y.shape[1] + 4
    missed = terms * unit * (C @ big + D @ du + size_y)
    state = terms * unit * (A @ big + B @ du + K @ (C @ big + D @ du + size_y)) + K @ missed
    total, power = np.zeros(model.order), np.eye(model.order)
    while abs(power).max() > 1e-12:
        total, power = total + abs(power) @ state, kept @ power
    return C @ (total + unit * abs(model.x0)) + missed


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("precision, unit", [("f32", 2.0**-24), ("f64", 2.0**-53)])
@pytest.mark.parametrize("feedthrough", [False, True])
def test_the_observer_predicts_as_the_predictor(tmp_path, compiler, precision, unit, feedthrough):
    model = plant(feedthrough)
    u, y = recording(model)
    predicted, left_out = run(build(tmp_path, model, precision, compiler), u, y)
    expected = predict(model, u, y, 1, model.x0)
    # both sides round: the reference in double as well
    bound = rounding_bound(model, u, y, unit) + rounding_bound(model, u, y, 2.0**-53)
    assert left_out == 0
    assert (bound < 1e-3 * y.std(axis=0)).all()  # else agreement would say little
    assert (abs(predicted - expected).max(axis=0) <= bound).all()


@pytest.mark.skipif(not COMPILERS, reason="no C compiler is installed")
@pytest.mark.parametrize("flags", [(), ("-ffast-math",)])
def test_samples_that_are_missing_do_no_harm(tmp_path, flags):
    model = plant()
    u, y = recording(model, 400)
    bad_u, bad_y = u.copy(), y.copy()
    bad_y[50, 0], bad_y[51] = np.nan, np.inf
    bad_u[52, 1] = -np.inf
    predicted, left_out = run(build(tmp_path, model, "f64", COMPILERS[0], *flags), bad_u, bad_y)
    assert left_out == 3
    x, expected = model.x0, []
    for a, b in zip(bad_u - model.u_offset, bad_y - model.y_offset, strict=True):
        a = np.where(np.isfinite(a), a, 0.0)
        expected.append(model.C @ x + model.D @ a + model.y_offset)
        e = np.where(np.isfinite(b), b - model.C @ x - model.D @ a, 0.0)
        x = model.A @ x + model.B @ a + model.K @ e
    np.testing.assert_allclose(predicted, expected, atol=1e-9)
    np.testing.assert_allclose(predicted[-1], predict(model, u, y, 1, model.x0)[-1], atol=1e-9)  # recovered


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_model_without_inputs_makes_an_observer_too(tmp_path, compiler):
    model = plant()
    alone = replace(model, B=np.zeros((4, 0)), D=np.zeros((2, 0)), inputs=())
    _, y = recording(model, 200)
    u = np.zeros((200, 0))
    predicted, _ = run(build(tmp_path, alone, "f64", compiler), u, y)
    np.testing.assert_allclose(predicted, predict(alone, u, y, 1, alone.x0), atol=1e-9)


def test_coefficients_read_back_as_they_were():
    model = replace(plant(), x0=np.array([1 / 3, 1e-300, 0.0, -7.0]))
    for precision, kind in (("f32", np.float32), ("f64", np.float64)):
        text = c_observer(model, name="plant", precision=precision)
        for label in ("A", "B", "C", "D", "K", "x_start", "u_offset", "y_offset"):
            found = re.search(rf"plant_{label}(?:\[\d+\])+ = (\{{.*?\}});", text, re.S)
            assert found is not None, label
            numbers = [kind(n.rstrip("f")) for n in re.findall(r"[-+.\de]+f?", found[1])]
            wanted = {"x_start": model.x0, "u_offset": model.u_offset, "y_offset": model.y_offset}
            values = wanted[label] if label in wanted else getattr(model, label)
            np.testing.assert_array_equal(numbers, values.ravel().astype(kind))


def test_the_header_allocates_nothing_and_keeps_its_names():
    text = c_observer(plant(), name="plant")
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    assert "@" not in text and not re.search(r"\b(malloc|calloc|printf|double)\b", code)
    assert re.findall(r"#include <(\w+)", code) == ["stdint", "string"]
    declared = re.findall(r"^static (?:inline|const) \w+ (\w+)", code, re.M)
    assert len(declared) == 13 and all(name.startswith("plant_") for name in declared)
    assert max(len(line) for line in text.splitlines() if "{" not in line) <= 120


@pytest.mark.parametrize(
    "change, text",
    [
        ({"K": None}, "no Kalman gain K"),
        ({"sample_time_s": 0.0}, "continuous-time"),
        ({"K": np.full((4, 2), 3.0)}, r"would not settle: A - K C has an eigenvalue of magnitude \d"),
        ({"A": 1e39 * np.eye(4)}, "exceeds the range"),
        ({"x0": np.full(4, 1e39)}, "exceeds the range"),
    ],
)
def test_models_that_cannot_observe_are_refused(change, text):
    with pytest.raises(DataError, match=text):
        c_observer(replace(plant(), **change), name="plant", source="model.json")


def test_an_observer_that_settles_only_in_double_is_refused_in_float():
    edge = replace(plant(), A=(1 - 1e-9) * np.eye(4), K=np.zeros((4, 2)))
    with pytest.raises(DataError, match="would not settle"):
        c_observer(edge, name="plant", precision="f32")
    assert "plant_step" in c_observer(edge, name="plant", precision="f64")


@pytest.mark.parametrize("name, precision", [("1plant", "f32"), ("a b", "f32"), ("", "f32"), ("plant", "f16")])
def test_names_and_precisions_that_c_does_not_know_are_refused(name, precision):
    with pytest.raises(UsageError):
        c_observer(plant(), name=name, precision=precision)


@pytest.mark.skipif(not COMPILERS, reason="no C compiler is installed")
def test_the_command_writes_a_header_that_compiles_under_its_own_name(tmp_path, capsys):
    (tmp_path / "m.json").write_text(json.dumps(plant().to_json()))
    assert main(["convert", str(tmp_path / "m.json"), str(tmp_path / "my-observer.h"), "--precision", "f64"]) == 0
    (tmp_path / "m.c").write_text('#include "my-observer.h"\n#include "my-observer.h"\nmy_observer_observer held;\n')
    command = [COMPILERS[0], "-std=c99", *warnings(), "-c", "m.c", "-o", "m.o"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    capsys.readouterr()
    (tmp_path / "m.json").write_text(json.dumps(replace(plant(), K=None).to_json()))
    assert main(["convert", str(tmp_path / "m.json"), str(tmp_path / "o.h")]) == 3
    assert "m.json: no Kalman gain" in capsys.readouterr().err
