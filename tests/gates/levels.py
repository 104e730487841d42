"""Gate: the libraries of the test build, each at its level, compute the bits of the library as gcc makes it at -O2.

python levels.py ROOT PRECISION=ARCHIVE…, by day and by night. The archives hold what other levels, wider vectors or
none make of the same sources (tests/CMakeLists.txt): only the digest of tests/firmware is compiled and linked here.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate
import targets

PC = targets.TARGETS["pc"]


def digest(precision: str, archive: Path, path: Path) -> tuple[str, list[str]]:
    """Return what is wrong with an archive, empty when it computes, and the lines of its digest."""
    objects = gate.scratch()
    messages = targets.compile_program(PC, "digest.c", precision, objects)
    messages = messages or targets.link(PC, precision, [*sorted(objects.glob("*.o")), archive], path)
    if messages:
        return messages, []
    code, lines = targets.run(PC, path)
    return f"exit code {code}, {' '.join(lines)[:300]}" if code or not lines else "", lines


def main() -> None:
    findings, directory = [], gate.scratch()
    asked = [word.split("=", 1) for word in sys.argv[2:]]
    expected: dict[str, list[str]] = {}
    for precision in sorted({precision for precision, _ in asked}):
        wrong, expected[precision] = targets.digest("pc", precision, directory)
        findings += wrong if expected[precision] else [*wrong, "pc: prints nothing"]
    for k, (precision, name) in enumerate(asked):
        archive = Path(name)
        wrong_here, lines = digest(precision, archive, directory / f"level{k}")
        if wrong_here:
            findings.append(f"{archive.name}: {wrong_here}")
        elif lines != expected[precision]:
            pairs = zip(lines, expected[precision], strict=False)
            first = next((f"{a} where -O2 has {b}" for a, b in pairs if a != b), f"{len(lines)} lines")
            findings.append(f"{archive.name}: {first}")
    gate.finish(findings, f"{len(asked)} libraries, {', '.join(expected)}: the bits of -O2")


if __name__ == "__main__":
    main()
