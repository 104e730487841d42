"""Diagnose pairs of turbines that the diagnosis was not made on: a direct drive of 15 MW and a small turbine.

    python tests/studies/other_turbines.py make FOLDER [--simulator ../shared/openfast]
    python tests/studies/other_turbines.py score FOLDER [--json FILE] [--before FILE]

`make` brings the decks of the ROSCO package from the package index and runs them in the simulator of
`../shared/openfast`, 24 runs of 500 s at 16 m/s, two to three minutes of a core each; it goes on where it stopped.
`score` diagnoses the 48 cases, each with all channels and with two outputs, and prints the table of the corpus
(tests/studies/openfast_corpus.py). Exit code 2 where there is no simulator or no case, 1 where something is missing.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

from campbell_openfast import SIMULATOR, load_kit  # noqa: E402
from openfast_pairs import others, scoring  # noqa: E402


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main(arguments: list[str] | None = None) -> int:
    """Make the runs and cases or score them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="make runs and cases")
    score = commands.add_parser("score", help="diagnose the cases that are there and print the table")
    for command in (make, score):
        command.add_argument("folder", type=Path, help="folder of runs, cases and answers")
    make.add_argument("--simulator", type=Path, default=SIMULATOR, help="folder with run.py")
    scoring.add_options(score)
    options = parser.parse_args(arguments)
    if options.command == "score":
        return scoring.score(options, others.PART, _say)
    if not (options.simulator / "run.py").is_file():
        _say(f"{options.simulator / 'run.py'}: no such file, so no run can be made; name it with --simulator")
        return 2
    return 0 if others.make(options.folder, load_kit(options.simulator.resolve()), _say) else 1


if __name__ == "__main__":
    sys.exit(main())
