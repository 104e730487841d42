"""Gate: every public header compiles alone as C99, C11, C++11 and C++20, and is laid out like a manual page.

python headers.py [ROOT [HEADER…]]: by default every header.
"""

import re
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

DIALECTS = [["gcc", "-x", "c", "-std=c99"], ["gcc", "-x", "c", "-std=c11"]]
CXX = [["g++", "-x", "c++", "-std=c++11"], ["g++", "-x", "c++", "-std=c++20"]]
C_ONLY = {"-Wmissing-declarations"}


def compile_alone(header: Path) -> list[str]:
    """Include one header twice in an otherwise empty file, in every dialect and precision."""
    findings = []
    include = f'#include "aeolid/{header.name}"\n'
    for command in DIALECTS + CXX:
        warnings = [w for w in gate.WARNINGS if command[0] == "gcc" or w not in C_ONLY]
        for precision, flags in gate.PRECISIONS.items():
            done = subprocess.run(
                [*command, "-fsyntax-only", *warnings, *flags, f"-I{gate.ROOT / 'include'}", "-"],
                input=include * 2,
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode:
                findings.append(f"{header.name}, {' '.join(command)}, {precision}: {done.stderr.splitlines()[0]}")
    return findings


def read_layout(header: Path) -> list[str]:
    """Check the order: manual with model and contract, guard, code, guard's end, licence."""
    text = header.read_text()
    manual = text.split("*/")[0]
    findings = []
    if not manual.startswith(f"/* {header.name}: "):
        findings.append(f"{header.name}: does not begin with its name and one sentence")
    for part in ("MODEL", "CONTRACT"):
        if f" * {part}" not in manual:
            findings.append(f"{header.name}: no {part} before the first include")
    guard = f"AEOLID_{header.stem.upper()}_H"
    if not re.search(rf"\*/\n#ifndef {guard}\n#define {guard}\n", text):
        findings.append(f"{header.name}: no guard {guard} right after the manual")
    if not text.endswith("#endif\n/* SPDX-License-Identifier: MIT */\n"):
        findings.append(f"{header.name}: does not end with the guard and the licence line")
    return findings


def refuse_narrow(directory: Path) -> list[str]:
    """Pretend that sizes or integers have 16 bits: sizes would wrap, so nothing may be compiled."""
    findings = []
    for limit in ("SIZE_MAX", "UINT_MAX"):
        settings = f"#include <limits.h>\n#include <stdint.h>\n#undef {limit}\n#define {limit} 0xFFFFu\n"
        (directory / "narrow.h").write_text(settings)
        narrow = [f"-I{directory}", '-DAEO_CONFIG_HEADER="narrow.h"', f"-I{gate.ROOT / 'include'}"]
        done = subprocess.run(
            [*DIALECTS[0], "-fsyntax-only", *narrow, "-"],
            input='#include "aeolid/config.h"\n',
            capture_output=True,
            text=True,
            check=False,
        )
        if "sizes of 32 bits" not in done.stderr:
            findings.append(f"config.h: {limit} of 16 bits is not refused")
    return findings


def main() -> None:
    findings, asked = [], sys.argv[2:]
    headers = [h for h in gate.HEADERS if not asked or h.name in asked]
    for header in headers:
        findings += compile_alone(header) + read_layout(header)
        if header.name == "config.h":
            findings += refuse_narrow(gate.scratch())
    gate.finish(findings, f"{len(headers)} headers alone in C99, C11, C++11, C++20, both precisions")


if __name__ == "__main__":
    main()
