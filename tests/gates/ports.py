"""Gate: the FDCAN port builds for the processors of the families that have it, without warnings, heap or data.

python ports.py [ROOT]. Exit code 77 when the cross compiler is missing, with its name. Each processor at -O2 and -Os;
the header also as C++. How the port behaves is for tests/unity/test_port_fdcan.c.
"""

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

COMPILER = "arm-none-eabi-gcc"
PROCESSORS = {
    "cortex-m0plus": ["-mcpu=cortex-m0plus"],  # G0
    "cortex-m4f": ["-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"],  # G4
    "cortex-m7": ["-mcpu=cortex-m7", "-mfloat-abi=hard", "-mfpu=fpv5-d16"],  # H7
}
# memory functions, and the division of a core that has none
ALLOWED = {"memcpy", "memset", "__aeabi_uidiv", "__aeabi_uidivmod", "__gnu_thumb1_case_uqi"}


def read_objects(objects: list[Path]) -> tuple[list[str], int]:
    """Return what objects call, and hold, that they must not, and their bytes of text."""
    undefined, defined, findings = set(), set(), []
    for line in gate.output("arm-none-eabi-nm", *objects).splitlines():
        kind, name = line.split()[-2:] if len(line.split()) > 1 else ("", "")
        (undefined if kind == "U" else defined).add(name)
        if kind in set("BbDdCc"):
            findings.append(f"keeps state in {name}")
    findings += [f"calls {name}" for name in sorted(undefined - defined - ALLOWED)]
    rows = [line.split() for line in gate.output("arm-none-eabi-size", *objects).splitlines()[1:]]
    return findings, sum(int(row[0]) for row in rows)


def main() -> None:
    if subprocess.run(["sh", "-c", f"command -v {COMPILER}"], capture_output=True, check=False).returncode != 0:
        print(f"skipped: {COMPILER} is not installed")
        sys.exit(77)
    port = gate.ROOT / "port/fdcan"
    findings, figures = [], []
    for name, flags in PROCESSORS.items():
        for level in ("-O2", "-Os"):
            folder = gate.scratch()
            words = [COMPILER, "-mthumb", *flags, "-std=c99", level, *gate.WARNINGS]
            messages = gate.compile_each(words, [], [gate.ROOT / "include", port], sorted(port.glob("*.c")), folder)
            if messages:
                findings.append(f"{name} {level}: {messages}")
                continue
            wrong, text = read_objects(sorted(folder.glob("*.o")))
            findings += [f"{name} {level}: {what}" for what in wrong]
            figures.append(f"{name} {level} {text} bytes")
    done = subprocess.run(
        ["g++", "-x", "c++", "-std=c++11", "-fsyntax-only", f"-I{gate.ROOT / 'include'}", port / "fdcan_port.h"],
        capture_output=True,
        text=True,
        check=False,
    )
    findings += [done.stderr] if done.returncode else []
    gate.finish(findings, ", ".join(figures))


if __name__ == "__main__":
    main()
