"""The study of both ways against a simulator's run: what it asks, that it goes on, and what its table says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from study_modules import load_study

surrogate = load_study("surrogate")


def case(folder: Path, name: str, kind: str, ids: list[str]) -> None:
    (folder / name).mkdir(parents=True)
    (folder / name / "case.toml").write_text(f'[baseline]\nkind = "{kind}"\n')
    truth = {"verdict": ["named"] if ids else ["no_mismatch"], "ids": ids}
    (folder / name / "truth.json").write_text(json.dumps(truth))


def said(name: str | None) -> dict[str, Any]:
    effects = [] if name is None else [{"id": name, "location": {"entry": "input:pitch"}, "parameters": {}}]
    verdict = "named" if effects else "no_mismatch"
    return {"verdict": verdict, "effects": effects, "sealed": {"log_likelihood_gain": 40.0}}


def test_both_ways_are_asked_of_every_run_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Cases of other baselines are left out; a second call asks nothing again; the surrogate's false name is marked."""
    case(tmp_path / "cases", "lag", "run", ["actuator_lag"])
    case(tmp_path / "cases", "null", "run", [])
    case(tmp_path / "cases", "rig", "equations", ["stiction"])
    asked = []

    def diagnosed(folder: Path, way: str, out: Path, patience: float) -> dict[str, Any]:
        asked.append((folder.name, way))
        name = "actuator_lag" if folder.name == "lag" else "drivetrain_torsion" if way == "surrogate" else None
        return {"said": said(name), "seconds": 9.0, "processor_s": 8.0 if way == "prior" else 80.0, "memory_mb": 300.0}

    monkeypatch.setattr(surrogate, "diagnosed", diagnosed)
    for _ in range(2):
        assert surrogate.main([str(tmp_path / "out"), "--cases", str(tmp_path / "cases")]) == 0
    assert sorted(asked) == [(n, w) for n in ("lag", "null") for w in ("prior", "surrogate")]
    table = capsys.readouterr().out
    assert "| null | – | named: drivetrain_torsion ✗ | 40 | 80 | 300 | no_mismatch: – | 40 | 8 | 300 |" in table
    assert "surrogate: 1 of 2 right" in table and "prior: 2 of 2 right" in table


def test_a_folder_without_runs_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case(tmp_path / "cases", "rig", "equations", [])
    assert surrogate.main([str(tmp_path / "out"), "--cases", str(tmp_path / "cases")]) == 2
    assert "no case with a simulator's run" in capsys.readouterr().err


def test_a_diagnosis_that_takes_too_long_or_ends_badly_is_no_answer(tmp_path: Path) -> None:
    """The child is ended at its limit; one that cannot read its case is a crash, which is never right."""
    late = surrogate.diagnosed(tmp_path, "surrogate", tmp_path / "out", patience=0.0)
    assert late["said"]["verdict"] == "time-out"
    broken = surrogate.diagnosed(tmp_path, "surrogate", tmp_path / "out", patience=60.0)
    assert broken["said"]["verdict"] == "crash" and broken["memory_mb"] > 1
