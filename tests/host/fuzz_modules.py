"""Let the tests import the modules of tests/fuzz."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fuzz"))
import forked
import mutations
import readers

__all__ = ["forked", "mutations", "readers"]
