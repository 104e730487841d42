"""Which instructions libraries compute with: those of AVX2 where a processor has them, whatever else it has."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from aeolid import arithmetic

CHOSEN = ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "AEOLID_ARITHMETIC")
PROBE = """
import json, os, sys
{first}
import numpy as np
from threadpoolctl import threadpool_info
kinds = sorted({{lib.get("architecture", "") for lib in threadpool_info() if lib["user_api"] == "blas"}})
from numpy._core._multiarray_umath import __cpu_features__ as features
print(json.dumps([kinds, bool(features.get("AVX512_SKX")), os.environ.get("NUMBA_CPU_NAME")]))
"""
needs_avx2 = pytest.mark.skipif(not {"avx2", "fma"} <= arithmetic.flags_of(), reason="the processor has no AVX2")


@pytest.mark.parametrize(
    ("flags", "names"),
    [
        ("sse4_2", set()),
        ("avx2", set()),
        ("avx2 fma", {"OPENBLAS_CORETYPE", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"}),
        ("avx2 fma avx512f avx512vl", set(CHOSEN) - {"AEOLID_ARITHMETIC"}),
    ],
)
def test_only_what_a_processor_has_is_chosen(flags: str, names: set[str], tmp_path: Path) -> None:
    cpus = tmp_path / "cpuinfo"
    cpus.write_text(f"processor\t: 0\nvendor_id\t: any\nflags\t\t: fpu {flags}\n\nprocessor\t: 1\nflags\t\t: none\n")
    environ: dict[str, str] = {}
    arithmetic.settle(environ, cpus)
    assert environ.keys() == names
    environ = {}
    arithmetic.settle(environ, tmp_path / "absent")
    assert environ == {}


@pytest.mark.parametrize("name", CHOSEN)
def test_what_the_user_has_set_holds(name: str) -> None:
    given = {name: "native" if name == arithmetic.VARIABLE else "other"}
    found = arithmetic.chosen(given, {"avx2", "fma", "avx512f", "avx512vl"}, (2, 4))
    assert name not in found
    assert found == {} or name != arithmetic.VARIABLE
    if name.startswith("NUMBA"):  # a name and the features of another processor would go together
        assert not any(n.startswith("NUMBA") for n in found)


def test_numpys_names_are_those_of_its_version() -> None:
    flags = {"avx2", "fma", "avx512f", "avx512vl", "avx512_vnni"}
    assert arithmetic.chosen({}, flags, (2, 4))["NPY_DISABLE_CPU_FEATURES"] == "X86_V4"
    assert arithmetic.chosen({}, flags, (1, 26))["NPY_DISABLE_CPU_FEATURES"] == "AVX512F AVX512_SKX AVX512_CLX"
    assert "NPY_DISABLE_CPU_FEATURES" not in arithmetic.chosen({}, flags, None)


def probed(first: str, **own: str) -> list[object]:
    env = {k: v for k, v in os.environ.items() if k not in CHOSEN} | own
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROBE.format(first=first)],
        env=env, capture_output=True, text=True, check=True,
    )  # fmt: skip
    found: list[object] = json.loads(done.stdout)
    return found


@needs_avx2
def test_libraries_that_are_loaded_afterwards_do_as_they_are_told() -> None:
    assert probed("import aeolid") == [["Haswell"], False, "haswell"]
    assert probed("import aeolid", AEOLID_ARITHMETIC="native") == probed("")
    assert probed("import aeolid", OPENBLAS_CORETYPE="Prescott")[0] != ["Haswell"]
