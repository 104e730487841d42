"""The study of the rules counts which stored answers owe something to one, and diagnoses only those again."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from study_modules import load_study

from aeolid.cli.main import main
from aeolid.diagnose.rules import every_rule, rules_of

ablation = load_study("ablation")
Stored, changes, one = ablation.Stored, ablation.changes, ablation.one
NATS = "evidence.clear_nats"  # 20 by default


def answer(verdict: str, *ids: str) -> dict[str, Any]:
    return {"verdict": verdict, "effects": [{"id": i} for i in ids]}


def answers(*margins: Sequence[float | None]) -> list[Any]:
    """Return answers that named an effect and were right in it."""
    said = answer("named", "backlash")
    return [
        Stored("own", Path(f"case-{k}"), {NATS: list(ends)}, said, lambda d: (bool(d["effects"]), False))
        for k, ends in enumerate(margins)
    ]


def test_every_change_of_every_rule_is_one_that_a_file_may_ask_for() -> None:
    for rule in every_rule():
        for how, value in changes(rule).items():
            rules_of(one(rule.name, value), f"{rule.name} {how}")


def test_an_answer_is_counted_where_a_rule_leaves_its_margins(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ablation.table(answers((None, 30.0), (5.0, None), (15.0, 25.0), (None, None)), tmp_path / "table.json")
    counts = json.loads((tmp_path / "table.json").read_text())
    assert counts["answers"] == {"own": 4}
    assert {how: by["own"] for how, by in counts["rules"][NATS].items()} == {
        "lowest": 2, "half": 1, "twice": 2, "highest": 2
    }  # fmt: skip
    text = capsys.readouterr().out
    idle, alone = text.split("no stored answer needs")[1].split("own alone needs")
    assert f"| `{NATS}` | 2 1 2 2 |" in text and NATS not in idle and "selection.vuong_z" in idle and NATS in alone


def test_only_what_may_change_is_diagnosed_and_what_is_lost_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def diagnose(s: Any, rules: Path, folder: Path) -> dict[str, Any]:
        asked.append((s.case.name, rules.read_text()))
        return answer("unnamed") if s.case.name == "case-0" else s.diagnosis

    monkeypatch.setattr(ablation, "diagnose", diagnose)
    ablation.attempt(answers((None, 30.0), (5.0, None), (15.0, 25.0)), one(NATS, 40.0), tmp_path, 10, 1)
    assert sorted(asked) == [(f"case-{k}", "[evidence]\nclear_nats = 40.0\n") for k in (0, 2)]
    text = capsys.readouterr().out
    assert "| own | 3 | 2 | 2 | 1 | 0 | 1 | 0 → 0 |" in text
    assert "- own case-0: named: backlash → unnamed (lost)" in text


def test_the_corpus_is_made_once_and_run_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    corpus = load_study("corpus")
    args = argparse.Namespace(
        folder=tmp_path, own=2, foreign=0, seed=3, samples=1000, workers=1, known=tmp_path / "none", pairs=["more:held"]
    )
    (own, commands), (pairs, scored) = corpus.steps(args)
    assert own == f"challenge:{tmp_path / 'own'}" and [c[4] for c in commands] == ["make", "run"]
    assert pairs == "pairs:more:held" and scored[0][2:] == ("score", "more", "--part", "held")
    assert main([*commands[0][3:]]) == 0
    assert [c[4] for c in corpus.steps(args)[0][1]] == ["run"]
    assert "2 cases in" in capsys.readouterr().out


def test_a_rule_that_one_source_asks_for_is_told_with_it():
    ways = {"own": (3, 2), "real": (4, 0)}
    counts = {
        "alone": {"lowest": {s: n[0] for s, n in ways.items()}, "highest": {s: n[1] for s, n in ways.items()}},
        "both": {"lowest": {"own": 1, "real": 1}, "highest": {"own": 2, "real": 5}},
        "idle": {"lowest": {"own": 0, "real": 0}, "highest": {"own": 2, "real": 5}},
    }
    assert ablation.asked_by_one(counts) == {"own": ["alone"]}
