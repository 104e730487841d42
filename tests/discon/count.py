"""Gate: instructions that the wrapper adds to a call, counted by callgrind, against a limit.

Usage: count.py BENCH. Two inputs, three outputs, p = 20, 100 calls and 10 samples a second. Exit code 77 (skipped)
without valgrind.
"""

import re
import shutil
import subprocess
import sys

SECONDS = 60  # of simulated time, six snapshots among them
LIMIT = {"none": 6_850, "file:bench.log": 7_900}  # instructions a call on average, measured and a tenth


def count(bench: str, what: str) -> int:
    """Return the instructions of one run."""
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", bench, str(SECONDS), what]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    found = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode != 0 or found is None:
        sys.exit(f"{' '.join(command)} failed:\n{done.stderr}")
    return int(found[1])


def main() -> None:
    if shutil.which("valgrind") is None:
        print("skipped: valgrind is not installed")
        sys.exit(77)
    plain = count(sys.argv[1], "plain")
    for bus, limit in LIMIT.items():
        added = (count(sys.argv[1], bus) - plain) / (100 * SECONDS)
        print(f"{bus}: {added:.0f} instructions a call, at most {limit}")
        if added > limit:
            sys.exit(f"{bus}: the wrapper adds {added:.0f} instructions to a call, more than {limit}")


if __name__ == "__main__":
    main()
