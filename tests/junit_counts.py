"""Print how many tests of a JUnit XML file passed, failed and were skipped."""

import sys
from xml.etree import ElementTree


def is_failed(case: ElementTree.Element) -> bool:
    """Tell whether a test failed; ctest says it as an attribute, pytest as an element."""
    return any(child.tag in ("failure", "error") for child in case) or case.get("status") == "fail"


def count(path: str) -> tuple[int, int, int]:
    """Count the test cases themselves: the programs' own totals differ in what they include."""
    passed = failed = skipped = 0
    for case in ElementTree.parse(path).iter("testcase"):
        if is_failed(case):
            failed += 1
        elif any(child.tag == "skipped" for child in case) or case.get("status") in ("notrun", "disabled"):
            skipped += 1
        else:
            passed += 1
    return passed, failed, skipped


if __name__ == "__main__":
    print(*count(sys.argv[1]))
