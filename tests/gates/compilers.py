"""Gate: the sources compile without a warning under every compiler here, in the builds users choose."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

BUILDS = {
    "gcc": [["-std=c11", "-O2"]],  # C99 with -O0, -Os and -O3 -ffast-math: the test build, where warnings are errors
    "clang": [["-std=c99", "-O0"], ["-std=c99", "-O3", "-ffast-math"], ["-std=c11", "-Os"]],
    "cortex-m4f": [["-std=c99", "-Os"], ["-std=c11", "-O2"]],
}


def compile_all(name: str, command: list[str]) -> str:
    """Return what the first build of a compiler that has something to say, says."""
    for build in BUILDS[name]:
        for precision, flags in gate.PRECISIONS.items():
            messages = gate.compile_sources(command, [*build, *flags, *gate.WARNINGS], gate.scratch())
            if messages:
                return f"{name} {' '.join(build)} {precision}:\n{messages}"
    return ""


def main() -> None:
    told = {name: compile_all(name, command) for name, command in gate.compilers().items()}
    done = [f"{name} ({2 * len(BUILDS[name])} builds)" for name in told]
    gate.finish([messages for messages in told.values() if messages], "no warning: " + ", ".join(done))


if __name__ == "__main__":
    main()
