"""Functional mock-up units: run as their own mathematics says, and refused in one sentence where they cannot."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmu_build import build_fmu
from scipy.linalg import expm

from aeolid.errors import Contradiction, DataError
from aeolid.models.exchange.fmu import open_fmu, run_fmu

STEP = 0.02


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_fmu(tmp_path_factory.mktemp("fmu"))


@pytest.mark.parametrize("exchange", [False, True])
def test_a_run_follows_the_differential_equation(unit: Path, tmp_path: Path, exchange: bool) -> None:
    """Against the exact solution for a held force; the unit's own rule errs by its sub-step, 0.4 ms: 1e-3.

    In model exchange events of the unit's own fall between the samples, and the solver's tolerance leaves as much.
    """
    unit = build_fmu(tmp_path, exchange=True) if exchange else unit
    u = np.repeat(np.random.default_rng(1).choice([-1.0, 1.0], 60), 5)
    y = run_fmu(open_fmu(unit), {"drive": u}, ["speed", "position"], STEP)
    held = expm(np.array([[0, 1, 0], [-40.0, -0.75, 2.0], [0, 0, 0]]) * STEP)
    x, expected = np.zeros(2), np.empty((len(u), 2))
    for k, value in enumerate(u):
        expected[k] = x[1], x[0]
        x = held[:2, :2] @ x + held[:2, 2] * value
    assert y.shape == (300, 2)
    np.testing.assert_allclose(y, expected, atol=5e-3 * np.abs(expected).max())


def test_names_and_units_are_checked(unit: Path, tmp_path: Path) -> None:
    opened = open_fmu(unit)
    opened.require(["drive"], "input", {"drive": "V"})
    with pytest.raises(DataError, match=r"oscillator\.fmu: no input 'force'; the unit's inputs are drive"):
        opened.require(["force"], "input", {})
    with pytest.raises(DataError, match="'position' is output, no input of the unit"):
        opened.require(["position"], "input", {})
    with pytest.raises(Contradiction, match="drive is in 'm', the roles file says 'V'; convert the column"):
        open_fmu(build_fmu(tmp_path, "m")).require(["drive"], "input", {"drive": "V"})


def test_what_is_no_unit_is_refused(tmp_path: Path, unit: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        open_fmu(tmp_path / "none.fmu")
    (tmp_path / "text.fmu").write_text("not a zip file")
    with pytest.raises(DataError, match=r"text\.fmu: not a functional mock-up unit"):
        open_fmu(tmp_path / "text.fmu")
    with zipfile.ZipFile(unit) as whole, zipfile.ZipFile(tmp_path / "windows.fmu", "w") as other:
        other.writestr("modelDescription.xml", whole.read("modelDescription.xml"))
        other.writestr("binaries/win64/oscillator.dll", b"")
    with pytest.raises(DataError, match=r"windows\.fmu: built for win64; a Linux 64-bit binary is needed"):
        open_fmu(tmp_path / "windows.fmu")
