"""An effect is one file: the page's example, put into a folder beside the others, is listed, attached and named."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from small_cases import swinging

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "add_effect.md"
RUN = """
import sys
from aeolid.diagnose.hypotheses import entries
entries.__path__.append(sys.argv[1])
from aeolid.cli.main import main
sys.exit(main(sys.argv[2:]))
"""


def run(folder: Path, *words: object) -> subprocess.CompletedProcess[str]:
    """Run a command with the entries of a folder beside those of the package."""
    command = [sys.executable, "-P", "-c", RUN, str(folder), *map(str, words)]
    return subprocess.run(command, check=False, capture_output=True, text=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the page's example as the page says."""
    (name,) = re.findall(r"`(\w+\.py)`, adds it", PAGE.read_text(encoding="utf-8"))
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    made = tmp_path_factory.mktemp("more")
    (made / name).write_text(code, encoding="utf-8")
    return made


def test_an_entry_that_is_there_is_in_the_catalogue(folder: Path) -> None:
    done = run(folder, "catalogue", "--json", "-")
    ids = [e["id"] for e in json.loads(done.stdout)]
    assert ids[-1] == "cogging" and len(ids) == len(set(ids)) > 60, done.stderr


def test_a_module_that_is_no_entry_of_its_name_is_told(tmp_path: Path, folder: Path) -> None:
    (tmp_path / "teeth.py").write_text((folder / "cogging.py").read_text(encoding="utf-8"), encoding="utf-8")
    done = run(tmp_path, "catalogue")
    assert done.returncode != 0 and "teeth.py holds the entry 'cogging'" in done.stderr


def test_the_new_effect_is_named_with_its_value(folder: Path, tmp_path: Path) -> None:
    case = swinging(tmp_path / "case", teeth=2.5)
    done = run(folder, "diagnose", case, "--out", tmp_path / "out", "--sham", 0)
    assert done.returncode == 0, done.stderr
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert (said["verdict"], [e["id"] for e in said["effects"]]) == ("named", ["cogging"]), said["statement"]
    assert said["effects"][0]["parameters"]["pitch"]["value"] == pytest.approx(0.05, rel=0.01)
