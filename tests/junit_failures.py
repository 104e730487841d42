"""Print what each failed test of JUnit XML files said last, so that the end of a long log names the causes.

python junit_failures.py FILE…: a file that is missing or damaged is passed over, for counting tells of it.
"""

import sys
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

sys.path.insert(0, str(Path(__file__).parent))  # PYTHONSAFEPATH leaves it out

from junit_counts import is_failed

LINES, LETTERS, TESTS = 6, 160, 20  # shown of a test, of a line, of a file: what fails has often one cause


def list_failures(path: str) -> list[tuple[str, list[str]]]:
    """List the failed tests of a file, each with the last lines of what it said."""
    found = []
    for case in ElementTree.parse(path).iter("testcase"):
        if is_failed(case):
            told = [child for child in case if child.tag in ("failure", "error")]
            texts = [child.text or child.get("message") or "" for child in told]
            texts += [child.text or "" for child in case if child.tag == "system-out" and not any(texts)]
            lines = [line.strip() for text in texts for line in text.splitlines() if line.strip()]
            name = ".".join(filter(None, (case.get("classname"), case.get("name"))))
            found.append((name, [line[:LETTERS] for line in lines[-LINES:]]))
    return found


def main() -> None:
    """Print the failed tests of every file."""
    for path in sys.argv[1:]:
        with suppress(OSError, ElementTree.ParseError):
            found = list_failures(path)
            before: list[str] = []
            for name, lines in found[:TESTS]:
                print(f"failed: {name}")
                for line in lines if lines != before else ["as before"]:
                    print(f"    {line}")
                before = lines
            if len(found) > TESTS:
                print(f"and {len(found) - TESTS} more in {Path(path).name}")


if __name__ == "__main__":
    main()
