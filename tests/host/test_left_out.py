"""Leaving one source out sets the rules by right answers of the others and diagnoses the source's own again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from study_modules import load_study

from aeolid.diagnose.rules import every_rule

study = load_study("left_out")
NATS = "evidence.clear_nats"  # 20 by default
LAGS = "localise.least_lags"  # 16, a whole number
RULES = {rule.name: rule for rule in every_rule()}


def answers(rule: str, *margins: Sequence[float | None], right: bool = True) -> list[Any]:
    said = {"verdict": "named", "effects": [{"id": "backlash"}]}

    def judged(diagnosis: dict[str, Any]) -> tuple[bool, bool]:
        return bool(diagnosis["effects"]) and right, False

    return [study.Stored("any", Path(f"case-{k}"), {rule: list(ends)}, said, judged) for k, ends in enumerate(margins)]


def test_a_rule_lies_in_the_middle_of_what_all_answers_of_others_allow() -> None:
    found = study.calibrated(answers(NATS, (10.0, 90.0), (5.0, 30.0), (None, None)))
    assert found == {NATS: pytest.approx(math.sqrt(10 * 30))}
    assert study.as_file(found) == {"evidence": {"clear_nats": pytest.approx(math.sqrt(10 * 30))}}


def test_a_rule_that_others_leave_open_to_a_side_stays() -> None:
    assert study.calibrated(answers(NATS, (10.0, None), (5.0, None))) == {}


def test_a_rule_that_answers_hold_to_one_value_stays_at_it() -> None:
    found = study.calibrated(answers(NATS, (20.0, 20.0)))
    assert found == {NATS: 20.0} and study.as_file(found) == {}


@pytest.mark.parametrize(("low", "high", "expected"), [(9.5, 40.2, 20), (16.2, 17.9, 17), (-4.0, 10.0, 3)])
def test_a_whole_number_stays_whole_and_inside(low: float, high: float, expected: int) -> None:
    value = study.middle(RULES[LAGS], low, high)
    assert isinstance(value, int) and value == expected


def test_wrong_answers_of_others_hold_no_rule_and_the_source_left_out_is_diagnosed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def diagnose(s: Any, rules: Path, folder: Path) -> dict[str, Any]:
        assert "clear_nats" in rules.read_text()
        return {"verdict": "unnamed", "effects": []}

    monkeypatch.setattr(study.ablation, "diagnose", diagnose)
    groups = {
        "mine": answers(NATS, (18.0, None), (15.0, 25.0), (17.5, None)),
        "theirs": answers(NATS, (10.0, 30.0)),
        "wrong": answers(NATS, (19.9, 20.1), right=False),
    }
    cells = study.row("mine", groups, tmp_path, 1000, 1)  # the rule goes to the root of 300, 17.3
    named = dict(zip(study.HEAD, cells, strict=True))
    assert named["answers that may change"] == named["tried"] == named["lost"] == "2"
    assert named["rules that others hold"] == "1" and named["rules that it alone needs"] == "0"
    assert "case-0: named: backlash → unnamed (lost)" in capsys.readouterr().err


def test_a_rule_that_nobody_else_needs_is_told() -> None:
    assert study.needed_alone(answers(NATS, (5.0, None)), answers(LAGS, (3, 40))) == [NATS]


def test_one_source_is_not_enough(tmp_path: Path) -> None:
    assert study.main([str(tmp_path), f"own=known:{tmp_path}"]) == 2
