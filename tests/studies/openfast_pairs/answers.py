"""Diagnose the cases of a part, each in a process of its own, and keep the answers by the product's version."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

Facts = dict[str, Any]
_SHOWN = 12  # rows of the table of hypotheses that are kept
_VERSION = """
import hashlib, pathlib, aeolid, aeolid.diagnose
found = hashlib.sha256()
for path in sorted(pathlib.Path(aeolid.diagnose.__file__).parent.rglob("*.py")):
    found.update(path.read_bytes())
print(f"{aeolid.__version__}-{found.hexdigest()[:8]}")
"""

Diagnose = Callable[[Path], Facts]  # folder of a case → answer


def version_of(python: str) -> str:
    """Return the version of the product of a Python: its number and a hash of the sources of aeolid.diagnose."""
    return subprocess.run([python, "-c", _VERSION], check=True, capture_output=True, text=True).stdout.strip()


def diagnosed(python: str, patience_s: float) -> Diagnose:
    """Return what diagnoses a case as a user would; the answer has seconds (of clock and processor) and memory, too.

    And the margins of the decision rules, where that product notes them.
    """
    base = [python, "-m", "aeolid.cli.main", "diagnose"]
    told = subprocess.run([*base, "--help"], check=True, capture_output=True, text=True).stdout
    own = ["--margins"] if "--margins" in told else []

    def run(case: Path) -> Facts:
        command = [*base, str(case), "--sham", "0", *own, "--time-limit"]
        with tempfile.TemporaryDirectory() as folder:
            begun = time.perf_counter()
            with open(Path(folder) / "said.txt", "w+", encoding="utf-8") as said:
                process = subprocess.Popen(
                    [*command, f"{patience_s:g}", "--out", f"{folder}/out"], stdout=subprocess.DEVNULL, stderr=said
                )
                _, status, used = os.wait4(process.pid, 0)
                process.returncode = os.waitstatus_to_exitcode(status)
                said.seek(0)
                last = said.read()[-300:]
            answer: Facts = {
                "exit": process.returncode, "said": last if process.returncode else "",
                "seconds": time.perf_counter() - begun, "processor_s": used.ru_utime + used.ru_stime,
                "memory_mb": used.ru_maxrss / 1024,
            }  # fmt: skip
            return answer | _files(Path(folder) / "out")

    return run


def _files(out: Path) -> Facts:
    """Return diagnosis, margins, and of the evidence the first hypotheses and the modes."""
    found: Facts = {"diagnosis": None, "candidates": [], "modes": {}, "margins": None}
    if (out / "diagnosis.json").is_file():
        found["diagnosis"] = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    if (out / "margins.json").is_file():
        found["margins"] = json.loads((out / "margins.json").read_text(encoding="utf-8"))["margins"]
    if (out / "evidence.json").is_file():
        evidence = json.loads((out / "evidence.json").read_text(encoding="utf-8"))
        found["candidates"] = evidence.get("candidates", [])[:_SHOWN]
        found["modes"] = evidence.get("modes", {})
    return found


def cases_of(folder: Path, part: str) -> list[Path]:
    """Return the cases of a part that are there with their truth, in the order of their names."""
    return [c for c in sorted((folder / part).glob("*/")) if truth_file(c).is_file()]


def truth_file(case: Path) -> Path:
    """Return the file that says what is true of a case: beside its folder, no diagnosis reads it."""
    return case.parent / f"{case.name}.truth.json"


def answered(folder: Path, part: str, version: str, diagnose: Diagnose, say: Callable[[str], None]) -> list[Facts]:
    """Return truth and answer of every case of a part; cases without an answer of this version are diagnosed first."""
    kept = folder / "answers" / version
    kept.mkdir(parents=True, exist_ok=True)
    cases, found = cases_of(folder, part), []
    for k, case in enumerate(cases):
        file = kept / f"{case.name}.json"
        if not file.is_file():
            answer = diagnose(case) | {"version": version}
            say(f"{k + 1} of {len(cases)}: {case.name}: {(answer['diagnosis'] or {}).get('verdict', 'no answer')}")
            new = file.with_suffix(f".{os.getpid()}")
            new.write_text(json.dumps(answer) + "\n", encoding="utf-8")
            new.rename(file)
        truth = json.loads(truth_file(case).read_text(encoding="utf-8"))
        found.append({"case": case.name, "truth": truth, "answer": json.loads(file.read_text(encoding="utf-8"))})
    return found
