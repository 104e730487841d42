"""The study of rounding: what counts as the same answer, what a set of instructions is, and that nothing is silent."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from study_modules import load_study

study = load_study("rounding")


def answer(verdict: str, ids: list[str], **values: tuple[float | None, float | None]) -> dict[str, Any]:
    return {"set": "K", "verdict": verdict, "ids": ids, "gain": None, "values": {k: list(v) for k, v in values.items()}}


def row(*answers: dict[str, Any]) -> dict[str, Any]:
    return {"case": "a", "answers": list(answers)}


def test_names_and_verdict_make_an_answer_not_their_order() -> None:
    both = row(answer("multiple", ["x", "y"]), answer("multiple", ["y", "x"]))
    assert study.is_the_same(both)
    assert not study.is_the_same(row(answer("named", ["x"]), answer("named", ["y"])))
    assert not study.is_the_same(row(answer("named", ["x"]), answer("ambiguous", ["x"])))
    assert study.line(row(answer("named", ["x"]), answer("unnamed", []))).startswith(
        "DIFFERS a: K: named x, 0.0 nats; K: unnamed –"
    )


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ((2.0, 0.1), (2.009, 0.1), True), ((2.0, 0.1), (2.011, 0.1), False), ((2.0, 0.1), (None, None), False),
        ((None, None), (None, None), True), ((2.0, None), (2.0, None), True), ((2.0, 0.0), (2.0001, 0.0), False),
    ],
)  # fmt: skip
def test_a_value_may_move_a_tenth_of_its_deviation(
    one: tuple[float | None, float | None], other: tuple[float | None, float | None], same: bool
) -> None:
    pair = row(answer("named", ["x"], tau=one), answer("named", ["x"], tau=other))
    assert study.is_the_same(pair) is same and ("DIFFERS" in study.line(pair)) is not same


def test_a_set_without_an_answer_differs() -> None:
    assert not study.is_the_same(row(answer("named", ["x"], tau=(1.0, 0.1)), answer("no answer", [])))


def test_cases_are_what_has_a_case_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert study.main([str(tmp_path), "--out", str(tmp_path / "o" / "rows.jsonl")]) == 2
    assert study.main([str(tmp_path / "nowhere"), "--out", str(tmp_path / "o" / "rows.jsonl")]) == 2
    assert study.main(["--out", str(tmp_path / "o" / "rows.jsonl")]) == 2
    assert capsys.readouterr().err.count("no case.toml") == 3
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "case.toml").touch()
    assert study.cases_in([tmp_path]) == study.cases_in([tmp_path / "b"]) == [tmp_path / "b"]


@pytest.mark.slow
def test_what_cannot_be_read_is_an_answer_with_its_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "case.toml").write_text("[case]\n")
    out = tmp_path / "rows.jsonl"
    assert study.main([str(tmp_path), "--sets", "native", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "exit code 3" in said and "1 of 1 answers are the same with native" in said
    assert study.main([str(tmp_path), "--sets", "native", "--out", str(out)]) == 0  # goes on where it stopped
    assert len(out.read_text().splitlines()) == 1
    assert study.main([str(tmp_path), "--sets", "sse", "--out", str(out)]) == 0  # another question
    assert len(out.read_text().splitlines()) == 2


LOOK = """
import hashlib, json, numpy
from aeolid.models.machine_code import _processor
from numba.core import config
A = numpy.random.default_rng(1).standard_normal((200, 200))
print(json.dumps([_processor(), config.CPU_NAME, hashlib.sha256((A @ A).tobytes()).hexdigest(), float((A @ A).sum())]))
"""


def test_a_set_reaches_every_library() -> None:
    """LLVM has the named processor and none of this one's features; sums round in another way."""
    told = {}
    for name in ("sse", "avx2"):
        if not study.can_run(name):
            pytest.skip(f"this processor has no {name}")
        done = subprocess.run(
            [sys.executable, "-c", LOOK], env=study.surroundings(name), capture_output=True, text=True, check=True
        )
        told[name] = json.loads(done.stdout)
    assert told["sse"][:2] == [["nehalem", ""], "nehalem"] and told["avx2"][:2] == [["haswell", ""], "haswell"]
    assert told["sse"][2] != told["avx2"][2] and told["sse"][3] == pytest.approx(told["avx2"][3], rel=1e-9)


def test_what_the_user_has_set_is_no_part_of_a_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Prescott")
    monkeypatch.setenv("NUMBA_CPU_NAME", "nehalem")
    assert "OPENBLAS_CORETYPE" not in study.surroundings("native")
    assert study.surroundings("avx512")["OPENBLAS_CORETYPE"] == "SkylakeX"
    assert os.environ["OPENBLAS_CORETYPE"] == "Prescott"


A_TEST = """
import json
import os

import pytest


@pytest.mark.diagnosis
@pytest.mark.parametrize("other", [1.005, 2.0])
def test_an_answer(other, tmp_path):
    tau = other if "NUMBA_CPU_NAME" in os.environ else 1.0
    effect = {"id": "lag", "location": {"entry": "input:u"}, "parameters": {"tau_s": {"value": tau, "std": 0.1}}}
    (tmp_path / "diagnosis.json").write_text(json.dumps({"verdict": "named", "effects": [effect], "sealed": None}))
"""


@pytest.mark.slow
@pytest.mark.nightly  # the study itself, which the nightly run makes
def test_the_tests_answers_are_held_against_each_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two tests whose answers depend on the set, one of them by more than anybody should see."""
    file = Path(study.ROOT) / "tests" / "host" / f"test_rounding_probe_{os.getpid()}.py"
    out = ["--workers", "1", "--out", str(tmp_path / "rows.jsonl"), "--", str(file)]
    try:
        file.write_text(A_TEST)
        assert study.main(["--tests", "--sets", "native", "sse", *out]) == 1
    finally:
        file.unlink(missing_ok=True)
    said = capsys.readouterr().out
    assert said.count("DIFFERS") == 1 and "tau_s 1, 2: 10 deviations apart" in said
    assert "tau_s 1, 1.005: 0.05 deviations apart" in said and "1 of 2 answers are the same with native, sse" in said
