"""Run the study of the propagator in its shortest form."""

import json

import numpy as np
from study_modules import load_study


def test_study_writes_table_figure_and_facts(tmp_path, capsys, monkeypatch):
    """One run, every 40th sample, the jump only: the propagator is as near as the refit, the published form is not."""
    study = load_study("propagator")
    monkeypatch.setattr(study, "EVERY", 40)
    monkeypatch.setattr(study, "LENGTH", {"jump": 1400})
    assert study.main(["--runs", "2", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said == (tmp_path / "propagator.txt").read_text() and "SVD refit" in said
    assert (tmp_path / "propagator.png").stat().st_size > 20_000
    rows = json.loads((tmp_path / "propagator.json").read_text())["rows"]
    before = {row["method"]: np.array(row["scatter"]) for row in rows if row["part"] == "before"}
    assert set(before) == set(study.METHODS)
    bias = {(row["part"], row["method"]): np.array(row["bias"]) for row in rows}
    for name in ("rls", "fast-rls", "lattice", "SVD refit"):
        assert abs(bias["after", name]).max() < 0.04
    assert abs(bias["after", "rls"] - bias["after", "SVD refit"]).max() < 0.02
