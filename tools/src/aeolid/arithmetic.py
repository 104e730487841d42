"""Compute alike on every processor with AVX2: one instruction set, chosen before a library chooses its own.

Sums in another order and fused products differ in the last digits. A fit with many optima, or a score next to its
threshold, can end elsewhere for it: of 60 cases one was `named` on one processor and `no_mismatch` on another. numpy's
loops, OpenBLAS and what LLVM makes of models and loops take the instructions of AVX2 and FMA, which x86-64 processors
have had since 2013, although wider ones may be there; it costs no time that could be measured. The C library's
mathematical functions know no wider ones. Libraries read these variables when they are loaded: what was loaded before
`import aeolid` has made its choice. `AEOLID_ARITHMETIC=native` in the environment leaves it to them; so does each of
the variables by itself where the user has set it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, MutableMapping
from importlib.util import find_spec
from pathlib import Path

VARIABLE, NATIVE = "AEOLID_ARITHMETIC", "native"
_CPUS = Path("/proc/cpuinfo")
_FIRST = 16_384  # bytes of it: all of the first core
# numpy's names of wider loops, from 2.4 on and before, and what Linux calls a processor that has them; numpy warns of
# names that it or the processor does not know
_LOOPS = {"X86_V4": "avx512vl", "AVX512_ICL": "avx512_vbmi2", "AVX512_SPR": "avx512_fp16"}
_OLD_LOOPS = {
    "AVX512F": "avx512f", "AVX512CD": "avx512cd", "AVX512_SKX": "avx512vl", "AVX512_CLX": "avx512_vnni",
    "AVX512_CNL": "avx512vbmi", "AVX512_ICL": "avx512_vbmi2",
}  # fmt: skip
_LLVM = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": ""}  # those of the name, not of this processor


def settle(environ: MutableMapping[str, str] = os.environ, cpus: Path = _CPUS) -> None:
    """Set what makes libraries that are loaded from now on compute alike; nothing where the processor cannot."""
    environ.update(chosen(environ, flags_of(cpus), _numpy_version()))


def chosen(environ: Mapping[str, str], flags: set[str], numpy: tuple[int, int] | None) -> dict[str, str]:
    """Return the variables to set, given those that are set, what the processor has, and which numpy is installed."""
    if environ.get(VARIABLE) == NATIVE or not {"avx2", "fma"} <= flags:
        return {}
    found = {} if "OPENBLAS_CORETYPE" in environ else {"OPENBLAS_CORETYPE": "Haswell"}
    loops = {} if numpy is None else _LOOPS if numpy >= (2, 4) else _OLD_LOOPS
    wide = " ".join(name for name, flag in loops.items() if flag in flags)
    if wide and "NPY_DISABLE_CPU_FEATURES" not in environ:
        found["NPY_DISABLE_CPU_FEATURES"] = wide
    return found if _LLVM.keys() & environ.keys() else found | _LLVM


def flags_of(cpus: Path = _CPUS) -> set[str]:
    """Return what the first core can do, in Linux's words; nothing where nobody tells."""
    try:
        with cpus.open("rb") as file:
            text = file.read(_FIRST).decode("ascii", "replace")
    except OSError:
        return set()
    return next((set(line.split()) for line in text.splitlines() if line.startswith("flags")), set())


def _numpy_version() -> tuple[int, int] | None:
    """Return the first two numbers of the installed numpy's version, without loading it; None where they are hidden."""
    try:
        spec = find_spec("numpy")
        places = [] if spec is None else list(spec.submodule_search_locations or ())
        text = (Path(places[0]) / "version.py").read_text(encoding="utf-8") if places else ""
    except (OSError, ValueError, ImportError):
        return None
    told = re.search(r'^version = "(\d+)\.(\d+)', text, re.M)
    return (int(told[1]), int(told[2])) if told else None
