"""Gate: the sources compile without a warning under every compiler here, in the builds users choose.

python compilers.py [ROOT [all] [NAME…]]: by default every compiler that is installed, in its builds by day; `all`: in
every build.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

C11_DOUBLE = ["-std=c11", "-DAEO_REAL_DOUBLE"]
# C99 with -O0, -Os and -O3 -ffast-math, and C11 in float: the test build, where warnings are errors
BUILDS = {
    # by day what it warns of as it reads: the test build compiles double in C99 and C11 in float, warnings are errors
    "gcc": [["-fsyntax-only", *C11_DOUBLE], ["-O2", *C11_DOUBLE]],
    # clang warns of what it reads, whatever it makes of it; the level shows in the macros that a source may ask for
    "clang": [
        ["-fsyntax-only", *build, *flags]
        for build, flags in [
            (["-std=c99", "-O3", "-ffast-math"], gate.PRECISIONS["float"]),
            (["-std=c11", "-Os"], gate.PRECISIONS["double"]),
            *((["-std=c99", "-O0"], flags) for flags in gate.PRECISIONS.values()),
            (["-std=c99", "-O3", "-ffast-math"], gate.PRECISIONS["double"]),
            (["-std=c11", "-Os"], gate.PRECISIONS["float"]),
        ]
    ],
    "cortex-m4f": [["-fsyntax-only", *C11_DOUBLE], ["-O2", *C11_DOUBLE], ["-std=c99", "-Os"]],
}
# The first so many; the gates that measure build float on the Cortex-M4F, target_cortex-m7 double with its compiler.
BY_DAY = {"gcc": 1, "clang": 2, "cortex-m4f": 1}


def builds(name: str) -> list[list[str]]:
    """Return the builds of a compiler that are asked for."""
    return BUILDS[name] if "all" in sys.argv[2:] else BUILDS[name][: BY_DAY.get(name)]


def compile_all(name: str, command: list[str]) -> str:
    """Return what the first build of a compiler that has something to say, says."""
    for build in builds(name):
        messages = gate.compile_sources(command, [*build, *gate.WARNINGS], gate.scratch())
        if messages:
            return f"{name} {' '.join(build)}:\n{messages}"
    return ""


def main() -> None:
    asked = [word for word in sys.argv[2:] if word not in ("", "all")]  # CMake leaves an empty word
    told = {name: compile_all(name, c) for name, c in gate.compilers().items() if not asked or name in asked}
    done = [f"{name} ({len(builds(name))} builds)" for name in told]
    gate.finish([messages for messages in told.values() if messages], "no warning: " + ", ".join(done))


if __name__ == "__main__":
    main()
