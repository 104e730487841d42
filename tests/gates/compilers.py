"""Gate: the sources compile without a warning under every compiler here, in the builds users choose.

python compilers.py [ROOT [NAME…]]: by default every compiler that is installed.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

# C99 with -O0, -Os and -O3 -ffast-math, and C11 in float: the test build, where warnings are errors
BUILDS = {
    "gcc": [["-std=c11", "-O2", "-DAEO_REAL_DOUBLE"]],
    # clang warns of what it reads, whatever it makes of it; the level shows in the macros that a source may ask for
    "clang": [
        ["-fsyntax-only", *build, *flags]
        for build in (["-std=c99", "-O0"], ["-std=c99", "-O3", "-ffast-math"], ["-std=c11", "-Os"])
        for flags in gate.PRECISIONS.values()
    ],
    "cortex-m4f": [["-std=c99", "-Os"], ["-std=c11", "-O2", "-DAEO_REAL_DOUBLE"]],
}


def compile_all(name: str, command: list[str]) -> str:
    """Return what the first build of a compiler that has something to say, says."""
    for build in BUILDS[name]:
        messages = gate.compile_sources(command, [*build, *gate.WARNINGS], gate.scratch())
        if messages:
            return f"{name} {' '.join(build)}:\n{messages}"
    return ""


def main() -> None:
    asked = sys.argv[2:]
    told = {name: compile_all(name, c) for name, c in gate.compilers().items() if not asked or name in asked}
    done = [f"{name} ({len(BUILDS[name])} builds)" for name in told]
    gate.finish([messages for messages in told.values() if messages], "no warning: " + ", ".join(done))


if __name__ == "__main__":
    main()
