"""The node's program, which reads what others send, is built with what the compiler has against memory errors."""

from __future__ import annotations

import platform
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from aeolid.native import find_native

pytestmark = pytest.mark.skipif(
    platform.system() != "Linux" or shutil.which("readelf") is None, reason="readelf is not installed"
)
SOURCE = "#include <string.h>\nint main(int c, char **v) { char b[9]; strcpy(b, v[c - 1]); return b[0]; }\n"
ALL = {"position-independent", "bind now", "relro", "stack not executable", "stack protector", "fortified calls"}


def measures(program: Path) -> set[str]:
    """Return the measures that can be read in a program's file."""
    command = ["readelf", "--wide", "--file-header", "--program-headers", "--dynamic", "--dyn-syms", str(program)]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    patterns = {
        "position-independent": r"Flags: .*\bPIE\b",
        "bind now": r"Flags: .*\bNOW\b",
        "relro": r"^ +GNU_RELRO ",
        "stack not executable": r"^ +GNU_STACK .* RW ",
        "stack protector": r"__stack_chk_fail",
        "fortified calls": r"__(?!stack)\w+_chk@",
    }
    return {name for name, pattern in patterns.items() if re.search(pattern, text, re.MULTILINE)}


def test_the_node_has_all_measures() -> None:
    """Full RELRO is a relocation table that is bound at the start and read-only from then on."""
    assert measures(Path(find_native("aeolid-node"))) == ALL


def test_the_check_sees_what_is_absent(tmp_path: Path) -> None:
    """A program that is built without a measure lacks it in the list, and no other."""
    (tmp_path / "a.c").write_text(SOURCE)
    bare = {
        "-no-pie": {"position-independent"},
        "-Wl,-z,lazy": {"bind now"},
        "-Wl,-z,norelro": {"relro"},
        "-Wl,-z,execstack": {"stack not executable"},
        "-fno-stack-protector": {"stack protector"},
        "-U_FORTIFY_SOURCE": {"fortified calls"},
    }
    full = ["-O2", "-fPIE", "-pie", "-fstack-protector-strong", "-U_FORTIFY_SOURCE", "-D_FORTIFY_SOURCE=2"]
    full += ["-Wl,-z,relro", "-Wl,-z,now", "-Wl,-z,noexecstack", "-w"]
    for flag, lost in {"": set[str](), **bare}.items():
        program = tmp_path / "a"
        words = ["gcc", *full, *([flag] if flag else []), str(tmp_path / "a.c"), "-o", str(program)]
        subprocess.run(words, check=True)
        assert measures(program) == ALL - lost, flag
