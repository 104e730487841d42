"""The benchmark of identification runs on small data and names every must-show; its times are for people."""

import subprocess
import sys

import pytest
from study_modules import STUDIES

BENCH = STUDIES.parent / "bench" / "identify.py"


@pytest.mark.nightly  # its times are for people, what it calls has tests
def test_every_case_runs_on_small_data(tmp_path):
    command = [sys.executable, str(BENCH), "--smoke", "--out", str(tmp_path / "table.md")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=3600, check=False)
    assert done.returncode == 0, done.stderr
    rows = [row.split("|") for row in done.stdout.splitlines() if row.startswith("|")][2:]
    assert len(rows) == 10 and all(float(row[2]) > 0 and 50 < float(row[4]) < 1000 for row in rows)
    assert "met" not in done.stdout.lower()  # small data are held against no target
    assert done.stdout.strip() in (tmp_path / "table.md").read_text()
