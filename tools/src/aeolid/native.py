"""Find and load what was compiled: the C library in both precisions and the executables beside it."""

from __future__ import annotations

import os
import sysconfig
from functools import lru_cache
from pathlib import Path
from typing import Any

import aeolid
from aeolid.errors import UsageError

PRECISIONS = {"f32": "float", "f64": "double"}

# The declarations of tools/native/replay.c; sizes are checked on both sides.
DECLARATIONS = """
typedef struct {
    uint64_t samples;
    const double *u; const double *y; const uint64_t *time_us;
    const double *offset; const double *scale; const double *minimum; const double *maximum;
    uint32_t inputs, outputs, past, model_set, feedthrough, period_us, method;
    double forgetting, regularisation, excitation_min, growth_max;
    uint32_t varx_samples; double forgetting_start, forgetting_rate, guard_ratio;
    double *innovation; double *residual; int8_t *status; double *theta; double *theta_scaled;
    uint32_t regressors; uint32_t health; uint32_t count[14];
} aeo_replay_t;
size_t aeo_replay_bytes(const aeo_replay_t *replay);
int aeo_replay_run(aeo_replay_t *replay, void *memory, size_t bytes);
const char *aeo_replay_status_text(int status);
"""


def native_directories() -> list[Path]:
    """List where compiled files may lie, first match first.

    AEOLID_NATIVE names a directory that goes before all others, for libraries built by hand. A normal install has
    them inside the package; an editable one keeps the sources in place and the compiled files in site-packages.
    """
    chosen = os.environ.get("AEOLID_NATIVE")
    places = [Path(chosen)] if chosen else []
    places += [Path(p) / "_native" for p in aeolid.__path__]
    places += [Path(sysconfig.get_path(key)) / "aeolid" / "_native" for key in ("platlib", "purelib")]
    return list(dict.fromkeys(places))


def find_native(name: str) -> Path:
    """Return the path of one compiled file by its name.

    Raises UsageError that lists the places searched and how to build it.
    """
    places = native_directories()
    for place in places:
        if (place / name).is_file():
            return place / name
    raise UsageError(
        f"the compiled file {name} is in none of {', '.join(map(str, places))};"
        " install the package again (pip install ./tools, or sh tools/demo) with a C compiler present"
    )


@lru_cache(maxsize=1)
def foreign_interface() -> Any:
    """Return the one cffi object that knows the declarations."""
    from cffi import FFI

    ffi = FFI()
    ffi.cdef(DECLARATIONS)
    return ffi


@lru_cache(maxsize=2)
def load_library(precision: str) -> Any:
    """Load the C library in one precision, "f32" or "f64".

    Raises UsageError for another precision or when it was not compiled.
    """
    if precision not in PRECISIONS:
        raise UsageError(f"precision {precision!r} is none of {', '.join(PRECISIONS)}")
    path = find_native(f"aeolid_{PRECISIONS[precision]}.so")
    library = foreign_interface().dlopen(str(path))
    if not hasattr(library, "aeo_replay_run"):  # compiled from sources of another version
        raise UsageError(f"{path} belongs to another version of aeolid; install the package again")
    return library
