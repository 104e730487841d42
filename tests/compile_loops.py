"""Compile the diagnosis' loops into numba's cache, beside the C build: each worker of a fresh clone would do it alone.

A small diagnosis takes 25 s of processor without a cache and 5 s with one.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "host"))
from aeolid.cli.main import main  # isort: skip — before numpy: it chooses the instructions
from api_cases import write_folder


def compile_loops(folder: Path) -> int:
    """Diagnose a small case; returns the exit code."""
    write_folder(folder)
    (folder / "case.toml").write_text(
        '[case]\ntitle = "loops"\n[recordings]\nfiles = ["monday.outb"]\nroles = "roles.toml"\n'
        '[baseline]\nkind = "equations"\nfile = "model.toml"\n'
    )
    return main(["diagnose", str(folder), "--out", str(folder / "out"), "--sham", "0", "--no-report"])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        sys.exit(compile_loops(Path(place)))
