"""Compile the C headers that simulate a model, and run them."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aeolid.models.equations import Equations
from aeolid.models.equations_file import from_toml
from aeolid.models.exchange.c_simulation import c_simulation
from aeolid.text_files import parse_toml

Array = NDArray[np.float64]
COMPILERS = [c for c in ("gcc", "clang") if shutil.which(c)]
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-ffp-contract=off")
CALLS = """\
#include "rig.h"
int run(int n, double h, const double *u, double *y, const double *th);
int run(int n, double h, const double *u, double *y, const double *th) {
    rig_simulation s;
    rig_reset(&s);
    memcpy(s.parameter, th, sizeof(double) * RIG_PARAMETERS);
    for (int k = 0; k < n; k++) {
        rig_outputs(&s, u + k * RIG_INPUTS, y + k * RIG_OUTPUTS);
        const int failed = rig_step(&s, u + k * RIG_INPUTS, h);
        if (failed != 0) {
            return failed;
        }
    }
    return 0;
}
"""


def equations(text: str) -> Equations:
    """Return the model that a text in the format of model.toml holds."""
    return from_toml(parse_toml(text, "rig"), text, "rig")


def one_state(derivative: str, initial: float = 0.0) -> Equations:
    """Return a model of one state x and an output that shows it."""
    state = f'[[state]]\nname = "x"\nderivative = "{derivative}"\ninitial = {initial!r}\n'
    return equations(f'{state}[[output]]\nname = "y"\nequation = "x"\n')


def in_c(model: Equations, folder: Path, u: Array, step: float, cut: float = 1, compiler: str = "gcc") -> Array:
    """Return the outputs of the header's functions as `run_header` does; NaN behind a step that failed."""
    return run_header(model, folder, u, step, cut, compiler)[0]


def run_header(
    model: Equations, folder: Path, u: Array, step: float, cut: float = 1, compiler: str = "gcc", *,
    values: Mapping[str, float] | None = None, edit: Callable[[str], str] = str,
) -> tuple[Array, int]:  # fmt: skip
    """Run the header's functions, compiled without a warning; returns y (N, l) and what the last step returned.

    u (N, r); cut: samples that one call of step takes; values: of parameters, set after the reset; edit: of the header.
    """
    folder.mkdir(exist_ok=True)
    (folder / "rig.h").write_text(edit(c_simulation(model, step, name="rig")[0]))
    (folder / "rig.c").write_text(CALLS)
    library = folder / f"rig-{compiler}.so"
    command = [compiler, *STRICT, "-shared", "-fPIC", "-o", str(library), str(folder / "rig.c"), "-lm"]
    subprocess.run(command, check=True)
    rows = np.ascontiguousarray(u[:: max(1, int(cut))])
    y, theta = np.full((len(rows), len(model.outputs)), np.nan), model.theta
    for name, value in (values or {}).items():
        theta[model.index(name)] = value
    pointers = [ctypes.c_void_p(a.ctypes.data) for a in (rows, y, theta)]
    failed: int = ctypes.CDLL(str(library)).run(len(rows), ctypes.c_double(step * cut), *pointers)
    return y, failed
