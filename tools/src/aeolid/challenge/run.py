"""Have every case diagnosed, each in a process of its own, and keep what became of it.

The answers are never opened here. A diagnosis that crashes, refuses the data or takes too long is a result, too. Beside
each verdict stands within which margins of the decision rules it stays, so that it can be decided again under others.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aeolid import __version__
from aeolid.challenge.write import hash_of, read_seal
from aeolid.children import python_command
from aeolid.errors import DataError, UsageError
from aeolid.fleet.workers import Pool
from aeolid.output import make_folder, write_text

Facts = dict[str, Any]
Notice = Callable[[int, int, Facts], None]
RESULT, OUTCOME, MARGINS = "result.json", "diagnosis", "margins.json"
KEPT = ("verdict", "statement", "effects", "location", "sealed", "false_alarm", "not_excluded", "next_experiment")


@dataclass(frozen=True)
class Rules:
    """Hold the file of decision rules that diagnoses are to go by, and what differs in it from the defaults.

    defaults: of every rule, by section.name; who decides stored results again needs them.
    """

    file: str
    differing: Facts = field(default_factory=dict)
    defaults: Facts = field(default_factory=dict)


@dataclass(frozen=True)
class Job:
    """Name one case to be diagnosed and how."""

    case: str
    out: str
    sham: int
    seed: int
    most_s: float
    keep: bool
    rules: Rules | None = None

    def settings(self) -> Facts:
        """Return what a stored result must agree with to be used again."""
        own = {} if self.rules is None or not self.rules.differing else {"rules": self.rules.differing}
        return {"version": __version__, "sham": self.sham, "seed": self.seed} | own


def run(
    folder: Path, out: Path, pool: Pool, *, sham: int = 0, seed: int = 1, most_s: float = 900.0, keep: bool = False,
    rules: Rules | None = None, notice: Notice | None = None, only: Sequence[str] | None = None,
) -> list[Facts]:  # fmt: skip
    """Diagnose every case of a challenge that has no result yet; returns all results in order.

    only: names of the cases to diagnose, all by default. A result is used again when the case's files, the version and
    the settings are the same and it was no crash. Raises DataError where the cases are not those that were sealed,
    UsageError where `out` cannot be written to.
    """
    tell = notice or (lambda done, of, result: None)
    if out.resolve() == folder.resolve():
        raise UsageError(f"--out {out}: holds the cases themselves; name another folder")
    seal = read_seal(folder)
    jobs = []
    for name, digest in seal["cases"].items():
        if only is not None and name not in only:
            continue
        if not (folder / name).is_dir() or hash_of(folder / name) != digest:
            raise DataError(f"{folder / name}: is not the case that was sealed; make the challenge anew")
        jobs.append(Job(str(folder / name), str(out / name), sham, seed, most_s, keep, rules))
    make_folder(out)
    results: dict[int, Facts] = {}
    for i, job in enumerate(jobs):
        stored = _stored(job, seal["cases"][Path(job.case).name])
        if stored is not None:
            results[i] = stored
    left = [i for i in range(len(jobs)) if i not in results]
    tell(len(results), len(jobs), {})
    try:
        for k, outcome in pool.run(diagnose_case, [jobs[i] for i in left]):
            lost = isinstance(outcome, BaseException)
            results[left[k]] = _ended(jobs[left[k]], "crash", str(outcome), 0.0) if lost else outcome
            tell(len(results), len(jobs), results[left[k]])
    except BaseException:
        for process in list(_RUNNING):  # threads wait for them
            process.kill()
        raise
    return [results[i] for i in range(len(jobs))]


_RUNNING: set[subprocess.Popen[str]] = set()


def diagnose_case(job: Job) -> Facts:
    """Diagnose one case in a process of its own and write its result."""
    out = Path(job.out)
    make_folder(out)
    command = python_command("-m", "aeolid.cli.main", "diagnose", job.case, "--out", str(out / OUTCOME))
    command += ["--sham", str(job.sham), "--seed", str(job.seed), "--margins", *([] if job.keep else ["--no-report"])]
    command += [] if job.rules is None else ["--rules", job.rules.file]
    begun = time.perf_counter()
    try:
        code, told = _call(command, job.most_s)
    except subprocess.TimeoutExpired:
        return _ended(job, "time-out", f"no verdict within {job.most_s:g} s", time.perf_counter() - begun)
    seconds = time.perf_counter() - begun
    last = (told.strip().splitlines() or [f"exit code {code}"])[-1]
    if code:
        return _ended(job, "refused" if code in (3, 4) else "crash", last, seconds)
    try:
        found = json.loads((out / OUTCOME / "diagnosis.json").read_text(encoding="utf-8"))
        kept = {k: found[k] for k in KEPT}
        margins = json.loads((out / OUTCOME / MARGINS).read_text(encoding="utf-8"))["margins"]
    except (OSError, ValueError, KeyError) as error:
        return _ended(job, "crash", f"diagnosis.json, {MARGINS}: {error}", seconds)
    return _ended(job, "done", "", seconds, kept, margins)


def _call(command: list[str], most_s: float) -> tuple[int, str]:
    """Return exit code and standard error of a command; raises subprocess.TimeoutExpired when it has been ended."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        _RUNNING.add(process)
        try:
            told = process.communicate(timeout=most_s)[1]
        finally:
            _RUNNING.discard(process)
            process.kill()
    return process.returncode, told


def _ended(
    job: Job, outcome: str, reason: str, seconds: float, found: Facts | None = None, margins: Facts | None = None
) -> Facts:
    case = Path(job.case)
    result = {
        "case": case.name, "case_sha256": hash_of(case), "settings": job.settings(), "outcome": outcome,
        "reason": reason, "seconds": round(seconds, 1), "diagnosis": found,
        "margins": margins,
    }  # fmt: skip
    out = Path(job.out)
    make_folder(out)
    if not job.keep:  # hundreds of reports and models nobody asked for
        shutil.rmtree(out / OUTCOME, ignore_errors=True)
    write_text(out / RESULT, json.dumps(result, indent=1) + "\n", own=True)
    return result


def _stored(job: Job, digest: str) -> Facts | None:
    """Return an earlier result of the same case and settings, None where there is none or it is of no use."""
    try:
        found: Facts = json.loads((Path(job.out) / RESULT).read_text(encoding="utf-8"))
        same = found["case_sha256"] == digest and found["settings"] == job.settings() and found["outcome"] == "done"
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return found if same else None


def read_results(folder: Path, out: Path) -> list[Facts]:
    """Return the results of every sealed case; raises DataError where one is missing or of another case."""
    found = []
    seal = read_seal(folder)
    for name, digest in seal["cases"].items():
        path = out / name / RESULT
        try:
            result: Facts = json.loads(path.read_text(encoding="utf-8"))
            same = result["case_sha256"] == digest
        except (OSError, ValueError, KeyError, TypeError):
            left = sum(not (out / n / RESULT).is_file() for n in seal["cases"])
            raise DataError(
                f"{path}: no result; {left} of {len(seal['cases'])} cases are left: `aeolid challenge run {folder}`"
            ) from None
        if not same:
            raise DataError(f"{path}: is the result of another case than the sealed one; run the challenge anew")
        found.append(result)
    return found
