"""Cases carry no hint, answers stay sealed, runs go on where they stopped, and every failure is a result."""

from __future__ import annotations

import gzip
import json
import re
import shutil
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aeolid.challenge.draw import draw_all, sorts
from aeolid.challenge.families import FAMILIES
from aeolid.challenge.run import read_results, run
from aeolid.challenge.score import score
from aeolid.challenge.write import ANSWERS, SEAL, make, open_answers
from aeolid.cli.main import main
from aeolid.errors import DataError
from aeolid.fleet.workers import Inline, Pool

pytestmark = pytest.mark.slow  # its fixtures are

CASES, SAMPLES = 6, 1000


@pytest.fixture(scope="module")
def challenge(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("challenge") / "small"
    make(folder, cases=CASES, seed=3, samples=SAMPLES, chained=False)
    return folder


@pytest.fixture
def copy(challenge: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(challenge, tmp_path / "copy"))


class Idle(Pool):
    """Do nothing; fail when asked to."""

    def run(self, function: Any, items: Sequence[Any], *shared: Any) -> Iterator[tuple[int, Any]]:
        assert not items, [i.case for i in items]
        yield from ()


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_the_same_seed_makes_the_same_bytes_and_another_does_not(challenge: Path, tmp_path: Path) -> None:
    make(tmp_path / "again", cases=CASES, seed=3, samples=SAMPLES, chained=False)
    assert files(tmp_path / "again") == files(challenge)
    make(tmp_path / "other", cases=2, seed=4, samples=SAMPLES, chained=False)
    ours, other = files(challenge), files(tmp_path / "other")
    assert all(other[n] != ours[n] for n in other if n.endswith(("recording.csv", ANSWERS)))


@pytest.mark.parametrize("cases", [20, 60, 480])
def test_the_mix_is_as_promised(cases: int) -> None:
    counts = Counter(sorts(cases, np.random.default_rng(0)))
    assert counts["null"] + counts["parameter"] >= 0.25 * cases
    assert counts["outside"] >= 0.1 * cases
    assert min(counts[k] for k in ("double", "fault", "impossible")) >= 1
    assert counts["single"] >= 0.3 * cases and sum(counts.values()) == cases


def test_single_effects_take_turns_by_family() -> None:
    firsts = [items[0].accepted[0] for sort, items, _ in draw_all(480, 11) if sort == "single"]
    of = {i: f for f, ids in FAMILIES.items() for i in ids}
    counts = Counter(of[i] for i in firsts)
    assert len(counts) == len(FAMILIES) - 1  # all but wrong declared values, which are a class of their own
    assert max(counts.values()) - min(counts.values()) <= 2  # impossible cases take some turns, too
    assert len(set(firsts)) >= 50


def test_a_case_holds_no_hint(challenge: Path) -> None:
    """Nothing a case says names an effect, and what is recorded beside is recorded in cases of every class."""
    ids = {i for names in FAMILIES.values() for i in names} - {"tower_fore_aft", "tower_side_side"}  # channels, too
    answers = open_answers(challenge)["answers"]
    for name, answer in answers.items():
        case = challenge / name
        assert {p.name for p in case.iterdir()} <= {"case.toml", "roles.toml", "recording.csv", "simulation.csv",
                                                    "model.toml", "model.json"}  # fmt: skip
        text = "".join(p.read_text() for p in case.iterdir() if p.suffix != ".csv")
        words = [i for i in ids if i in text] + [e["what"] for e in answer["effects"] if e["what"] in text]
        assert words == []
        assert not re.search(r"hidden|effect|seed|strength|truth", text)


def test_extra_channels_do_not_tell_the_class() -> None:
    from aeolid.challenge.draw import build

    seen: Counter[tuple[str, str]] = Counter()
    for sort, items, own in draw_all(120, 5):
        if sort in ("null", "parameter"):
            seen.update(("null", r) for r in build(sort, items, own, SAMPLES).setup.roles)
    assert {r for _, r in seen} >= {"azimuth", "wind", "seen", "warmth"}


def test_a_broken_seal_is_said(copy: Path) -> None:
    raw = bytearray((copy / ANSWERS).read_bytes())
    raw[len(raw) // 2] ^= 1
    (copy / ANSWERS).write_bytes(raw)
    with pytest.raises(DataError, match=r"answers\.json\.gz: the seal is broken"):
        open_answers(copy)
    with pytest.raises(DataError, match="the seal is broken"):
        score(copy, copy / "results")


def test_answers_written_anew_do_not_fit_the_seal(copy: Path) -> None:
    content = json.loads(gzip.decompress((copy / ANSWERS).read_bytes()))
    content["answers"]["case-0001"]["class"] = "null"
    (copy / ANSWERS).write_bytes(gzip.compress(json.dumps(content).encode(), mtime=0))
    with pytest.raises(DataError, match="the seal is broken"):
        open_answers(copy)


def test_a_changed_case_is_not_run(copy: Path) -> None:
    with (copy / "case-0002" / "case.toml").open("a") as handle:
        handle.write("\n")
    with pytest.raises(DataError, match=r"case-0002: is not the case that was sealed"):
        run(copy, copy / "results", Idle())


def test_what_was_done_is_not_done_again_and_the_answers_are_not_needed(copy: Path) -> None:
    """A run without the answers beside it; then one that must find everything done; then a scored whole."""
    answers = (copy / ANSWERS).read_bytes()
    (copy / ANSWERS).unlink()
    seal = json.loads((copy / SEAL).read_text())
    keep = dict(list(seal["cases"].items())[:1])
    (copy / SEAL).write_text(json.dumps({**seal, "cases": keep}))
    told: list[int] = []
    first = run(copy, copy / "results", Inline(), notice=lambda done, of, r: told.append(done))
    assert told == [0, 1] and [r["outcome"] for r in first] == ["done"]
    assert run(copy, copy / "results", Idle()) == first
    assert not (copy / "results" / "case-0001" / "diagnosis").exists()
    (copy / ANSWERS).write_bytes(answers)
    facts = score(copy, copy / "results")
    assert len(facts["cases"]) == 1 and {r["outcome"] for r in read_results(copy, copy / "results")} == {"done"}
    with pytest.raises(DataError, match=r"no result; 5 of 6 cases are left"):
        (copy / SEAL).write_text(json.dumps(seal))
        read_results(copy, copy / "results")


def test_a_time_out_and_a_crash_are_results(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seal = json.loads((copy / SEAL).read_text())
    (copy / SEAL).write_text(json.dumps({**seal, "cases": dict(list(seal["cases"].items())[:1])}))
    late = run(copy, copy / "results", Inline(), most_s=0.05)
    assert [r["outcome"] for r in late] == ["time-out"] and "0.05 s" in late[0]["reason"]
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    broken = run(copy, copy / "results", Inline())  # a time-out is tried again
    assert [r["outcome"] for r in broken] == ["crash"]

    class Lost(Pool):
        def run(self, function: Any, items: Sequence[Any], *shared: Any) -> Iterator[tuple[int, Any]]:
            yield from ((k, RuntimeError("the worker died")) for k in range(len(items)))

    lost = run(copy, copy / "results", Lost())
    assert [(r["outcome"], r["reason"]) for r in lost] == [("crash", "the worker died")]
    facts = score(copy, copy / "results")
    row = next(r for r in facts["table"] if r["metric"].startswith("crashed"))
    assert (row["count"], row["of"]) == (1, 1)


def test_bad_input_ends_in_one_sentence(
    copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("x")
    (tmp_path / "odd").mkdir()
    (tmp_path / "odd" / SEAL).write_text("[]")
    cases = [
        (["make", "copy"], 2, "copy: is not empty; name a new folder"),
        (["make", "file/below"], 2, "file/below: cannot be written (Not a directory)"),
        (["make", "new", "--cases", "0"], 2, "greater than or equal to 1"),
        (["make", "new", "--samples", "10"], 2, "1000"),
        (["draw", "new"], 2, "no step 'draw'; make, run and score follow each other"),
        (["make", "new", "--workers", "2"], 2, "--workers goes with run and rescore, not with make"),
        (["run", "copy", "--fail-below", "0.5"], 2, "--fail-below goes with score, not with run"),
        (["run", "empty"], 3, "`aeolid challenge make empty` writes a challenge"),
        (["run", "odd"], 3, "is not a seal of this version"),
        (["run", "copy", "--out", "copy"], 2, "holds the cases themselves"),
        (["score", "empty"], 3, "seal.json"),
        (["score", "copy"], 3, "6 of 6 cases are left: `aeolid challenge run copy`"),
        (["score", "copy", "--fail-below", "2"], 2, "or equal to 1"),
    ]
    for words, code, sentence in cases:
        found, said = main(["challenge", *words]), capsys.readouterr().err
        said = re.sub(r"\s*│?\s*\n\s*│?\s*", " ", said)
        assert (found, "Traceback" in said) == (code, False), (words, said)
        assert sentence in said, (words, said)
