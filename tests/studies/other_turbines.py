"""Diagnose pairs of turbines that the diagnosis was not made on: a direct drive of 15 MW and two more.

    python tests/studies/other_turbines.py make FOLDER [--set first …] [--simulator ../shared/openfast]
    python tests/studies/other_turbines.py score FOLDER [--json FILE] [--before FILE]

`make` brings the decks of the ROSCO package from the package index and runs them in the simulator of
`../shared/openfast`, two to five minutes of a core for a run of 500 s; it goes on where it stopped. Sets of effects
(tests/studies/openfast_pairs/crossings.py): first, 24 runs; crossed, 24; field, 18, in full fields of turbulence;
third, 14, a turbine of 5 MW with slender blades; sea, 14, on a monopile in waves; floating, 12, each of 800 s. `score`
diagnoses the cases that are there, each with all channels and with two outputs, and prints the table of the corpus
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
from openfast_pairs.crossings import SETS  # noqa: E402


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
    make.add_argument("--set", nargs="+", choices=list(SETS), default=["first"], help="sets of effects (first)")
    scoring.add_options(score)
    options = parser.parse_args(arguments)
    if options.command == "score":
        return scoring.score(options, others.PART, _say)
    if not (options.simulator / "run.py").is_file():
        _say(f"{options.simulator / 'run.py'}: no such file, so no run can be made; name it with --simulator")
        return 2
    kit = load_kit(options.simulator.resolve())
    made = [others.make(options.folder, kit, of, _say) for of in options.set]
    return 0 if all(made) else 1


if __name__ == "__main__":
    sys.exit(main())
