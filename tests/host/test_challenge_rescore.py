"""Stored results are decided again under other rules: at once inside their margins, by a diagnosis outside."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from aeolid import __version__
from aeolid.challenge import rescore as module
from aeolid.challenge.rescore import folder_of, out_of_margins, rescore
from aeolid.challenge.run import RESULT, Rules
from aeolid.challenge.write import hash_of, make, open_answers, read_seal
from aeolid.cli.main import main
from aeolid.diagnose.rules import every_rule
from aeolid.errors import DataError, UsageError
from aeolid.fleet.workers import Pool

Facts = dict[str, Any]
NATS, Z = "evidence.clear_nats", "evidence.one_percent_z"  # 20 and 2.33 by default
TWICE = {"evidence": {"clear_nats": 40.0}}
DEFAULTS = {r.name: r.value for r in every_rule()}


def result(margins: Any, rules: Facts | None = None, **facts: Any) -> Facts:
    settings = {"version": __version__, "sham": 0, "seed": 1} | ({"rules": rules} if rules else {})
    return {"settings": settings, "outcome": "done", "margins": margins, "reason": "", "seconds": 1.0} | facts


@pytest.mark.parametrize(
    ("margins", "own", "wanted", "open_"),
    [
        ({NATS: [None, 50.0]}, {}, TWICE, ()),
        ({NATS: [10.0, 40.0]}, {}, TWICE, ()),
        ({NATS: [10.0, 39.0]}, {}, TWICE, (NATS,)),
        ({NATS: [20.0, 20.0]}, {}, TWICE, (NATS,)),
        ({}, {}, TWICE, ()),  # never asked for
        (None, {}, TWICE, (NATS,)),  # a crash, or an older version
        (5, {}, TWICE, (NATS,)),
        ({NATS: "wide"}, {}, TWICE, (NATS,)),
        ({NATS: [None, "1e9"]}, {}, TWICE, (NATS,)),
        ({NATS: [None]}, {}, TWICE, (NATS,)),
        (None, TWICE, TWICE, ()),  # as it was made
        ({NATS: [30.0, 50.0]}, TWICE, {}, (NATS,)),  # back to the default
        ({NATS: [10.0, 50.0]}, TWICE, {}, ()),
        ({NATS: [10.0, 50.0], Z: [2.0, 3.0]}, {},
         {"evidence": {"clear_nats": 60.0, "one_percent_z": 3.5, "proven_nats": 9.0}}, (NATS, Z)),
    ],
)  # fmt: skip
def test_only_a_rule_out_of_its_margins_leaves_an_answer_open(
    margins: Any, own: Facts, wanted: Facts, open_: tuple[str, ...]
) -> None:
    assert out_of_margins(result(margins, own), wanted, DEFAULTS) == open_


@pytest.fixture
def challenge(tmp_path: Path) -> Path:
    """Make three cases, and results of which the second is open where one asks for 40 nats."""
    folder = tmp_path / "proof"
    make(folder, cases=3, seed=3, samples=1000, chained=False)
    for k, (name, digest) in enumerate(read_seal(folder)["cases"].items()):
        out = folder / "results" / name
        out.mkdir(parents=True)
        stored = result(
            {NATS: [5.0, 30.0 if k == 1 else None]}, case=name, case_sha256=digest, diagnosis=answer("unnamed")
        )
        (out / RESULT).write_text(json.dumps(stored))
    return folder


def answer(verdict: str) -> Facts:
    return {"verdict": verdict, "effects": [], "statement": "…", "sealed": {"recovered_fraction": 0.5}}


class Idle(Pool):
    """A pool that must not be asked."""

    def run(self, function: Any, items: Sequence[Any], *shared: Any) -> Iterator[tuple[int, Any]]:
        assert not items, "nothing was to be diagnosed"
        return iter(())


class Saying(Pool):
    """A pool whose diagnoses all find nothing."""

    asked: list[Any]

    def run(self, function: Any, items: Sequence[Any], *shared: Any) -> Iterator[tuple[int, Any]]:
        self.asked = list(items)
        for k, job in enumerate(items):
            name = Path(job.case).name
            found = result({}, TWICE, case=name, case_sha256=hash_of(Path(job.case)), diagnosis=answer("no_mismatch"))
            Path(job.out).mkdir(parents=True, exist_ok=True)
            (Path(job.out) / RESULT).write_text(json.dumps(found))
            yield k, found


def test_what_margins_leave_open_is_in_neither_table(challenge: Path) -> None:
    found = rescore(challenge, challenge / "results", Rules("mine.toml", TWICE, DEFAULTS))
    assert (found.stay, found.diagnosed, found.open) == (2, 0, {"case-0002": (NATS,)})
    assert [j.case for j in found.before] == ["case-0001", "case-0003"] and found.before == found.after
    facts = found.to_json()
    assert facts["before"] == facts["after"] and facts["changed"] == []


def test_open_cases_are_diagnosed_once_and_their_change_is_told(challenge: Path) -> None:
    rules, pool = Rules("mine.toml", TWICE, DEFAULTS), Saying()
    found = rescore(challenge, challenge / "results", rules, pool)
    assert [Path(job.case).name for job in pool.asked] == ["case-0002"]
    assert pool.asked[0].rules == rules and pool.asked[0].sham == 0
    assert (found.stay, found.diagnosed, found.open) == (2, 1, {})
    (change,) = found.to_json()["changed"]
    assert (change["case"], change["before"], change["after"]) == ("case-0002", ["unnamed"], ["no_mismatch"])
    assert change["hidden"] == [e["what"] for e in open_answers(challenge)["answers"]["case-0002"]["effects"]]
    for again in (Idle(), None):  # what was diagnosed is used again, with a pool and without
        assert rescore(challenge, challenge / "results", rules, again) == found
    stored = folder_of(challenge / "results", rules) / "case-0002" / RESULT
    stored.write_text("{")
    with pytest.raises(DataError, match=r"case-0002/result\.json: is no result"):
        rescore(challenge, challenge / "results", rules)


def test_results_of_another_version_are_not_mixed_with_fresh_ones(
    challenge: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "__version__", "9.9.9")
    rules = Rules("mine.toml", TWICE, DEFAULTS)
    assert rescore(challenge, challenge / "results", rules).stay == 2  # margins hold for the code that noted them
    with pytest.raises(UsageError, match=r"diagnosed by version .*challenge run .* again"):
        rescore(challenge, challenge / "results", rules, Idle())


def test_the_command_prints_both_tables(challenge: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[evidence]\nclear_nats = 40.0\n")
    facts = tmp_path / "facts.json"
    assert main(["challenge", "rescore", str(challenge), "--rules", str(file), "--json", str(facts)]) == 0
    text = capsys.readouterr().out
    assert "2 answers stay by their margins, 0 diagnosed under these rules, 1 open" in text
    assert text.count("recall of concealed decidable effects") == 2 and f"case-0002: {NATS}" in text
    assert json.loads(facts.read_text())["open"] == {"case-0002": [NATS]}
    file.write_text("[evidence]\nclear_nats = 25.0\n")
    assert main(["challenge", "rescore", str(challenge), "--rules", str(file)]) == 0
    text = capsys.readouterr().out
    assert "3 answers stay by their margins" in text and "open, and in neither" not in text
    assert main(["challenge", "rescore", str(challenge)]) == 2
    assert "--rules FILE" in capsys.readouterr().err
    assert main(["challenge", "rescore", str(challenge), "--rules", str(file), "--cases", "3"]) == 2
    assert main(["challenge", "score", str(challenge), "--fits"]) == 2
