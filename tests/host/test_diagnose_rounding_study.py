"""The study of rounding: what counts as the same answer, and that nothing to ask is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from study_modules import load_study

study = load_study("rounding")


def row(*answers: tuple[str, list[str]]) -> dict[str, Any]:
    return {"case": "a", "answers": [{"kernel": "K", "verdict": v, "ids": ids} for v, ids in answers]}


def test_names_and_verdict_make_an_answer_not_their_order() -> None:
    assert study.is_the_same(row(("multiple", ["x", "y"]), ("multiple", ["y", "x"])))
    assert not study.is_the_same(row(("named", ["x"]), ("named", ["y"])))
    assert not study.is_the_same(row(("named", ["x"]), ("ambiguous", ["x"])))
    assert study.line(row(("named", ["x"]), ("unnamed", []))).startswith(
        "DIFFERS a: K: named x, 0.0 nats; K: unnamed –"
    )


def test_cases_are_what_has_a_case_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert study.main([str(tmp_path), "--out", str(tmp_path / "o" / "rows.jsonl")]) == 2
    assert study.main([str(tmp_path / "nowhere"), "--out", str(tmp_path / "o" / "rows.jsonl")]) == 2
    assert capsys.readouterr().err.count("no case.toml") == 2
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "case.toml").touch()
    assert study.cases_in([tmp_path]) == study.cases_in([tmp_path / "b"]) == [tmp_path / "b"]


def test_what_cannot_be_read_is_an_answer_with_its_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "case.toml").write_text("[case]\n")
    out = tmp_path / "rows.jsonl"
    assert study.main([str(tmp_path), "--kernels", "Haswell", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "exit code 3" in said and "1 of 1 answers are the same with Haswell" in said
    assert study.main([str(tmp_path), "--kernels", "Haswell", "--out", str(out)]) == 0  # goes on where it stopped
    assert len(out.read_text().splitlines()) == 1
    assert study.main([str(tmp_path), "--kernels", "Prescott", "--out", str(out)]) == 0  # another question
    assert len(out.read_text().splitlines()) == 2
