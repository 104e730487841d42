"""Gate: sources stay readable: files under 450 lines, functions under 40, one kernel a file up to 70."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

FILE, FUNCTION, KERNEL = 450, 40, 70


def functions(text: str) -> list[tuple[str, int]]:
    """Return name and length in lines of every function; the formatter puts both braces in the first column."""
    found, lines = [], text.splitlines()
    start = None
    for i, line in enumerate(lines):
        if line == "{":
            start = i
        elif line == "}" and start is not None:
            head = " ".join(lines[max(0, start - 4) : start])
            found.append((re.findall(r"(\w+)\(", head)[-1] if "(" in head else "?", i - start + 1))
            start = None
    return found


def main() -> None:
    findings, longest = [], 0
    for source in gate.SOURCES + sorted((gate.ROOT / "src").glob("*.h")) + gate.HEADERS:
        text = source.read_text()
        if text.count("\n") > FILE:
            findings.append(f"{source.name}: {text.count(chr(10))} lines, at most {FILE}")
        long = [(name, n) for name, n in functions(text) if n > FUNCTION]
        findings += [f"{source.name}: {name} has {n} lines" for name, n in long if n > KERNEL or len(long) > 1]
        longest = max([longest, *(n for _, n in functions(text))])
        if re.search(r"\b(malloc|calloc|realloc|free|printf|alloca)\s*\(|<stdio\.h>|<stdlib\.h>", text):
            findings.append(f"{source.name}: uses the heap or stdio")
    gate.finish(findings, f"{len(gate.SOURCES)} sources, longest function {longest} lines")


if __name__ == "__main__":
    main()
