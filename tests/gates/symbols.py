"""Gate: the library calls nothing but sqrt(f), memcpy and memset, keeps no state, and its names say its precision."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

ALLOWED = {"float": {"sqrtf", "memcpy", "memset"}, "double": {"sqrt", "memcpy", "memset"}}


def read_symbols(directory: Path) -> tuple[set[str], set[str], set[str]]:
    """Return the symbols undefined, defined global, and in writable memory, of all objects in a directory."""
    undefined, defined, state = set(), set(), set()
    for line in gate.output("nm", *sorted(directory.glob("*.o"))).splitlines():
        match = re.match(r"[0-9a-f ]{16} ([A-Za-z]) (\S+)$", line)
        if not match:
            continue
        kind, name = match.groups()
        if kind in "Uw":
            undefined.add(name)
        if kind in "TRDBCVW":
            defined.add(name)
        if kind in "BbDdCc":
            state.add(name)
    return undefined - defined, defined, state


def functions_of_real() -> set[str]:
    """Return the public functions whose prototype mentions aeo_real_t."""
    names = set()
    for header in gate.HEADERS:
        text = re.sub(r"/\*.*?\*/|#.*?(?<!\\)\n", "", header.read_text(), flags=re.S)
        for returned, name, arguments in re.findall(r"([\w\s*]+?)\b(aeo_\w+)\(([^;{]*?)\);", text):
            if "aeo_real_t" in returned + arguments:
                names.add(name)
    return names


def main() -> None:
    findings, figures = [], []
    defined = {}
    for precision, flags in gate.PRECISIONS.items():
        directory = gate.scratch()
        messages = gate.compile_sources(["gcc"], [*gate.LIBRARY, *flags], directory)
        if messages:
            gate.finish([messages], "")
        undefined, defined[precision], state = read_symbols(directory)
        findings += [f"{precision}: calls {name}" for name in sorted(undefined - ALLOWED[precision])]
        findings += [f"{precision}: keeps state in {name}" for name in sorted(state)]
        findings += [f"{precision}: {name} has no aeo_" for name in sorted(defined[precision]) if name[:4] != "aeo_"]
        figures.append(f"{precision} needs {', '.join(sorted(undefined))}")
    for name in sorted(functions_of_real()):
        if name not in defined["float"]:
            findings.append(f"{name} is declared but not in the float library")
        if name in defined["double"] or f"{name}_f64" not in defined["double"]:
            findings.append(f"{name} takes or gives aeo_real_t but keeps its name in double: a mix would link")
    gate.finish(findings, "; ".join(figures))


if __name__ == "__main__":
    main()
