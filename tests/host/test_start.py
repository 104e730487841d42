"""What a command does not use it does not load: a listener starts on small computers, too."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

LOG = Path(__file__).resolve().parents[1] / "vectors/wire_v1/stream.log"
PROGRAM = """
import sys
from aeolid.cli.main import main
code = main(sys.argv[1:])
print(code, *sorted({"asammdf", "numba", "pandas", "pyarrow", "scipy"} & set(sys.modules)))
"""


def test_a_listener_loads_no_more_than_it_uses(tmp_path: Path) -> None:
    """python-can would bring asammdf and pandas along, Arrow pandas, and a line through the clocks all of scipy."""
    words = ["listen", "--bus", str(LOG), "--record", str(tmp_path / "r.csv"), "--no-modes"]
    done = subprocess.run([sys.executable, "-c", PROGRAM, *words], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "0", done.stdout


def test_a_program_that_uses_the_package_keeps_python_cans_reader_of_mdf4() -> None:
    program = "import aeolid.can, can; assert can.io.mf4.asammdf is not None"
    subprocess.run([sys.executable, "-c", program], check=True)
