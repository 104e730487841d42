"""Take the blocks of README.md and docs/howto/port.md, and build each with what a controller adds to it."""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SHOWN = "\n".join((ROOT / page).read_text(encoding="utf-8") for page in ("README.md", "docs/howto/port.md"))
MOST_LINES = 19
CHANNELS, PARAMETERS = 5, 150
SAMPLES = 20_000  # of the reference; a board in an emulator runs on until it is stopped
# filters that the blocks do not use; half of the time to compile
OTHERS = ("els", "fast_", "lattice", "estimator_els", "estimator_fast_", "estimator_lattice")
STRICT = [
    "-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion",
    "-Wdouble-promotion", "-Wfloat-equal", "-Wundef", "-Wswitch-enum", "-Wcast-align", "-Wshadow",
    "-Wmissing-declarations", "-Werror",
]  # fmt: skip
POSIX = ["gcc", "-D_XOPEN_SOURCE=700", "-D_DEFAULT_SOURCE", "-pthread", "-Iport/posix"]
FDCAN = ["gcc", "-Iport/fdcan", "-Itests/unity/fdcan", '-DAEO_FDCAN_HOOKS="fdcan_model.h"']
CORTEX_M4F = ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mthumb", "-mfloat-abi=hard",
              "-fno-math-errno", "-ffunction-sections", "-fdata-sections", "-nostartfiles", "-Wl,--gc-sections",
              "-Tport/mps2/mps2.ld", "-Iport/mps2"]  # fmt: skip


@dataclass(frozen=True)
class Port:
    """Say how one block becomes a program: words of the block that tell it, compiler, further sources."""

    marker: str
    compiler: list[str]
    sources: list[str]


PORTS = {
    "template": Port("port_template.h", ["gcc", "-Iport/template"], ["port/template/port_template.c"]),
    "fdcan": Port(
        "fdcan_port.h",
        FDCAN,
        ["port/fdcan/fdcan_port.c", "port/fdcan/fdcan_setup.c", "tests/unity/fdcan/fdcan_model.c"],
    ),
    "slcan": Port("posix_bus.h", POSIX, ["port/posix/posix_bus.c", "port/posix/slcan.c"]),
    "socketcan": Port("socketcan.h", POSIX, ["port/posix/socketcan.c"]),
    "mps2": Port("mps2_port.h", CORTEX_M4F, ["port/mps2/mps2_port.c", "port/mps2/mps2_board.c", "port/posix/slcan.c"]),
}


def find_block(shown: str, language: str, marker: str) -> str:
    """Return the one fenced block of a language that holds `marker`."""
    found = [b for b in re.findall(rf"```{language}\n(.*?)```", shown, re.S) if marker in b]
    assert len(found) == 1, f"{len(found)} {language} blocks of README.md and docs/howto/port.md hold {marker!r}"
    return str(found[0])


def write_wiring(shown: str, port: Port | None, folder: Path, replaced: tuple[str, str] = ("", "")) -> None:
    """Write wiring.h: the filter, and for a port what is streamed and its own block."""
    blocks = [find_block(shown, "c", "identification_init(void)")]
    if port is not None:
        blocks += [find_block(shown, "c", "#include <aeolid/stream.h>"), find_block(shown, "c", port.marker)]
    assert replaced[0] in blocks[-1], f"{replaced[0]} is not in the block"
    blocks[-1] = blocks[-1].replace(*replaced)
    (folder / "wiring.h").write_text("\n".join(blocks))


def build(
    shown: str, name: str, folder: Path, *, replaced: tuple[str, str] = ("", ""), compile_only: bool = False
) -> Path:
    """Build one port's program, or the reference, warnings as errors; returns it.

    replaced: a word of the block and another one. compile_only: the block and what is around it, without the library.
    Raises RuntimeError with the compiler's words.
    """
    port = PORTS.get(name)
    write_wiring(shown, port, folder, replaced)
    program = folder / name
    main = HERE / (f"run_{name}.c" if port else f"{name}.c")
    library = sorted(str(p.relative_to(ROOT)) for p in (ROOT / "src").glob("*.c") if not p.name.startswith(OTHERS))
    words = [*(port.compiler if port else ["gcc"]), *STRICT, "-Iinclude", f"-I{HERE}", f"-I{folder}", str(main)]
    if compile_only:
        words += ["-c", "-o", str(program)]
    else:
        words += [*(port.sources if port else []), *library, "-lm", "-o", str(program)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=3600, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return program


def make_reference(shown: str, folder: Path) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the samples (N, 5), and theta (N / 100, 150) after every hundredth, from the filter's block alone."""
    program = build(shown, "reference", folder)
    done = subprocess.run([program, str(SAMPLES)], capture_output=True, timeout=3600, check=True)
    table = np.frombuffer(done.stdout, np.float32).reshape(-1, 100 * CHANNELS + PARAMETERS)
    return table[:, : 100 * CHANNELS].reshape(-1, CHANNELS), table[:, 100 * CHANNELS :]
