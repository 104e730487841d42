"""The time limit of a diagnosis, with a clock that counts how often it is asked: no test here knows the real time."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from aeolid.cli import common
from aeolid.cli.main import main
from aeolid.diagnose.conclude import conclude
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.deadline import PHASES, Deadline
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.plants.examples import write_examples


class Counter:
    """A clock that is a second later at every look."""

    def __init__(self) -> None:
        self.now = 0

    def __call__(self) -> float:
        self.now += 1
        return float(self.now)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("limit")
    write_examples(folder, samples=500)
    return folder / "stage"


def run(case: Path, out: Path, deadline: Deadline | None) -> dict[str, Any]:
    said, _ = conclude(load_case(case), out, sham=1, seed=1, progress=lambda *_: None, deadline=deadline)
    written: dict[str, Any] = json.loads((out / "diagnosis.json").read_text())
    assert written == said
    return written


@pytest.fixture
def no_late_steps(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[float]]:
    """Let no fit take a step after its time; the clock moves only when it is asked, so this is exact."""
    late: list[float] = []
    step = Predictor._step

    def watched(self: Predictor, *given: Any) -> Any:
        clock: Any = self.deadline._clock
        if clock.now >= self.deadline._end:
            late.append(clock.now)
        return step(self, *given)

    monkeypatch.setattr(Predictor, "_step", watched)
    yield late


@pytest.mark.parametrize("looks", [40, 1100])
def test_the_limit_gives_the_best_answer_so_far_and_says_what_was_not_tried(
    looks: int, case: Path, tmp_path: Path, no_late_steps: list[float]
) -> None:
    """A whole run looks at the clock some 2,200 times: the limits are in the baseline's fit, and in the search."""
    found = run(case, tmp_path, Deadline(float(looks), Counter()))
    assert no_late_steps == []
    if looks == 40:
        assert found["verdict"] == "not_testable" and "time limit" in found["statement"]
        return
    late = found["time_limit"]
    assert late["reached"] and late["not_tried"] and late["limit_s"] == looks
    assert found["warnings"] and found["warnings"][0].startswith("The time limit of ")
    assert all(what.split(" (")[0] in found["warnings"][0] for what in late["not_tried"])
    assert found["verdict"] not in ("no_mismatch", "immaterial")
    assert "time limit" in found["statement"]
    assert (tmp_path / "model" / "model.toml").exists() and (tmp_path / "evidence.json").exists()


def test_no_time_at_all_is_not_testable_and_writes_its_files(case: Path, tmp_path: Path) -> None:
    found = run(case, tmp_path, Deadline(1.0, Counter()))
    assert found["verdict"] == "not_testable" and "before the baseline was fitted" in found["statement"]
    assert (tmp_path / "sealed_before_after.csv").exists()


def test_each_step_has_its_share_and_leaves_what_it_does_not_need() -> None:
    clock = Counter()
    late = Deadline(1000.0, clock)
    shares = list(PHASES.values())
    assert shares == sorted(shares) and shares[-1] == 1.0
    late.enter("full fits")
    clock.now = int(1000 * PHASES["full fits"])
    assert late.passed and not late.reached
    assert late.skips("a") and late.skips("a") and late.cut_search
    late.enter("baseline predictor")  # a second look has no less time than the first one had
    assert late.passed
    late.enter("sealed proof")
    assert not late.passed and not late.skips("b")
    assert late.not_tried == ("a (2 times)",)
    assert Deadline().to_json() is None and not Deadline().passed


def test_a_cut_in_the_proof_is_no_cut_in_the_search() -> None:
    clock = Counter()
    late = Deadline(100.0, clock)
    late.enter("sham runs")
    clock.now = 99
    assert late.skips("sham runs") and not late.cut_search


@pytest.mark.parametrize("value", ["0", "-3", "nan", "inf"])
def test_a_limit_that_is_no_time_is_refused(
    value: str, case: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["diagnose", str(case), "--out", str(tmp_path / "out"), "--time-limit", value]) == 2
    assert "--time-limit" in capsys.readouterr().err


def test_a_long_run_is_never_silent_where_there_is_no_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    times = iter([0.0, 0.0, 1.0, 5.0, 40.0, 40.0, 50.0, 80.0, 80.0])
    told: list[str] = []
    monkeypatch.setattr(common.progress_console, "print", lambda text, **_: told.append(text))
    lines = common.Milestones(lambda: next(times))
    lines.reach("full fits")  # at 1 s
    for what in ("a", "b", "c", "d"):
        lines.at = what  # at 5, 40, 50 and 80 s: half a minute of silence ends with the second and the fourth
        lines.still()
    assert told == ["1 s: full fits", "40 s: b", "80 s: d"]
