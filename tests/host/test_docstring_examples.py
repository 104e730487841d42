"""Run the examples that stand in docstrings: what a reader sees there is what the function returns."""

import doctest
import importlib
from pathlib import Path

import pytest

import aeolid

ROOT = Path(aeolid.__file__).parent
WITH_EXAMPLES = sorted(p for p in ROOT.rglob("*.py") if ">>>" in p.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", WITH_EXAMPLES, ids=lambda p: str(p.relative_to(ROOT)))
def test_examples_of_docstrings_show_what_is_returned(path: Path) -> None:
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    module = importlib.import_module(".".join(parts).removesuffix(".__init__"))
    found = doctest.testmod(module)
    assert found.attempted > 0 and found.failed == 0
