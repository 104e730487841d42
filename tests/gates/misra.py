"""Gate: cppcheck's MISRA addon finds no more than docs/reference/misra.md lists, rule by rule.

python misra.py [ROOT]. Exit code 77 without cppcheck; counts are of scalar code in float, of cppcheck 2.10.
"""

import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

PAGE = gate.ROOT / "docs/reference/misra.md"
# without the limits of the number types cppcheck meets config.h's #error and analyses nothing
DEFINES = ["-UAEO_CONFIG_HEADER", "-UAEO_REAL_DOUBLE", "-DAEO_NO_VECTORS", "-DFLT_RADIX=2", "-DFLT_MANT_DIG=24"]
DEFINES += ["-DSIZE_MAX=0xFFFFFFFF", "-DUINT_MAX=0xFFFFFFFF"]


def count_findings() -> Counter[str]:
    """Return how often each rule is found, each place once."""
    words = ["cppcheck", "--quiet", "--std=c99", "--addon=misra", "--suppress=missingIncludeSystem", *DEFINES]
    command = [*words, "-DDBL_MANT_DIG=53", "-I", "include", "-I", "src", "src"]
    done = subprocess.run(command, cwd=gate.ROOT, capture_output=True, text=True, check=False)
    return Counter(re.findall(r"misra-c2012-(\d+\.\d+)\]", done.stderr))


def main() -> None:
    if shutil.which("cppcheck") is None:
        print("skipped: cppcheck is not installed")
        sys.exit(77)
    listed = {rule: int(n) for rule, n in re.findall(r"^\| (\d+\.\d+) \| \w+ \| (\d+) \|", PAGE.read_text(), re.M)}
    found = count_findings()
    findings = [
        f"rule {rule} is found {count} times, the page lists {listed.get(rule, 0)}"
        for rule, count in sorted(found.items())
        if count > listed.get(rule, 0)
    ]
    if not found:
        findings.append("cppcheck finds nothing at all: the addon did not run")
    gate.finish(findings, f"{sum(found.values())} findings of {len(found)} rules, none of them new")


if __name__ == "__main__":
    main()
