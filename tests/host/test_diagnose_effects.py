"""Concealed physics is named, nothing is named where nothing is concealed, and no name is forced on what has none.

A reduced form of tests/studies/diagnosis.py: one recording a trial, seeds fixed beforehand.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest

STUDY = Path(__file__).resolve().parents[1] / "studies" / "diagnosis.py"
SAMPLES = 3000
SEEN = {"null, 0.5 N over 0.5 s, sensor 0.01": 111, "null, position only": 115}  # recordings that once got a name


def load_study():  # type: ignore[no-untyped-def]
    spec = importlib.util.spec_from_file_location("diagnosis_study", STUDY)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


rig = load_study()
TRIALS = {(t.name, t.kind): t for t in rig.trials()}


def run(name: str, kind: str, folder: Path, seed: int = 7) -> dict[str, Any]:
    found: dict[str, Any] = rig.diagnose_one(TRIALS[name, kind], folder, SAMPLES, seed, 0)
    return found


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("lag, first order", "equations"),
        ("dry friction", "equations"),
        ("wire", "equations"),
        ("rectifier", "equations"),
        ("bracket", "equations"),
        ("delay", "state_space"),
        ("bracket", "state_space"),
    ],
)
def test_concealed_physics_is_named(tmp_path: Path, name: str, kind: str) -> None:
    """Tolerances stand beside each trial in the study: how far the rig's form is from the catalogue's."""
    row = run(name, kind, tmp_path)
    assert row["outcome"] == "right" and row["verdict"] in ("named", "ambiguous"), row
    quantity = TRIALS[name, kind].quantity
    if quantity is not None:
        assert abs(row["parameter_error"]) < quantity[2], row
    assert row["recovered"] > 0.6


def test_a_wrong_declared_value_is_a_parameter(tmp_path: Path) -> None:
    row = run("wrong gain", "equations", tmp_path)
    assert row["verdict"] == "parameter" and row["ids"] == ["parameter_error"]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("null, 2 N over 0.1 s, sensor 0.01", "equations"),
        ("null, 0.1 N over 3 s, sensor 0.05", "equations"),
        ("null, 0.5 N over 0.5 s, sensor 0.01", "state_space"),
        ("null, position only", "state_space"),
        ("null, speed only", "state_space"),
    ],
)
def test_nothing_concealed_nothing_named(tmp_path: Path, name: str, kind: str) -> None:
    assert run(name, kind, tmp_path)["verdict"] in ("no_mismatch", "immaterial")


@pytest.mark.parametrize("name", ["null, 0.5 N over 0.5 s, sensor 0.01", "null, position only"])
def test_a_coloured_disturbance_is_no_effect(tmp_path: Path, name: str) -> None:
    row = run(name, "equations", tmp_path, SEEN[name])
    assert row["verdict"] in ("no_mismatch", "immaterial"), row


@pytest.mark.parametrize(
    "name",
    [
        "swinging spring",
        "hysteresis",
        "backlash",
    ],
)
def test_no_name_is_forced_on_what_has_none(tmp_path: Path, name: str) -> None:
    row = run(name, "equations", tmp_path)
    assert row["verdict"] in ("unnamed", "no_mismatch", "immaterial"), row
