"""Gate: the sources compile without a warning under every compiler here, in the builds users choose."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

BUILDS = {
    "gcc": [["-std=c99", "-O0"], ["-std=c99", "-Os"], ["-std=c99", "-O3", "-ffast-math"], ["-std=c11", "-O2"]],
    "clang": [["-std=c99", "-O0"], ["-std=c99", "-O3", "-ffast-math"], ["-std=c11", "-Os"]],
    "cortex-m4f": [["-std=c99", "-Os"], ["-std=c11", "-O2"]],
}


def main() -> None:
    findings, done = [], []
    for name, command in gate.compilers().items():
        for build in BUILDS[name]:
            for precision, flags in gate.PRECISIONS.items():
                messages = gate.compile_sources(command, [*build, *flags, *gate.WARNINGS], gate.scratch())
                if messages:
                    findings.append(f"{name} {' '.join(build)} {precision}:\n{messages}")
        done.append(f"{name} ({2 * len(BUILDS[name])} builds)")
    gate.finish(findings, "no warning: " + ", ".join(done))


if __name__ == "__main__":
    main()
