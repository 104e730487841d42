"""Make a corpus of simulated pairs with OpenFAST and score the product's diagnoses of it.

    python tests/studies/openfast_corpus.py make FOLDER [--workers 1] [--part tuning|held] [--time-limit S]
                                            [--simulator ../shared/openfast]
    python tests/studies/openfast_corpus.py score FOLDER --part tuning|held [--json FILE] [--before FILE]

`make` goes on where it stopped: a run (600 s, 75 to 100 s of a core) and a case are there whole or not at all. 82
runs serve 264 cases: 66 where the turbine is as simulated, 12 to 20 m/s, wind the same over the disc and turbulence
over the whole disc; 31 kinds of effects at up to three sizes, six pairs of two at once; all with every channel and
with two outputs. A pair of runs belongs to the tuning or to the held part by a hash of its name; what is tuned is
tuned on the first alone. `score` diagnoses in a process a case and goes on where it stopped, too; answers are kept by
the product's version. Exit code 2 where there is no simulator or no case, 1 where something could not be made.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

from openfast_pairs import design, making, scoring  # noqa: E402

SIMULATOR = HERE.parents[1].parent / "shared" / "openfast"


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _make(options: argparse.Namespace) -> int:
    script = options.simulator / "run.py"
    if not script.is_file():
        _say(f"{script}: no such file, so no run can be made; name the simulator's folder with --simulator")
        return 2
    runner = making.simulator(script.resolve())
    whole = making.make(options.folder, runner, options.workers, options.time_limit, _say, options.part)
    _say(f"{options.folder}: {making.write_cases(options.folder)}{'' if whole else '; the same command goes on'}")
    failed = any((options.folder / "failed").glob("*.txt"))
    return 1 if failed and not whole else 0


def main(arguments: list[str] | None = None) -> int:
    """Make the corpus or score it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="make runs and cases")
    make.add_argument("folder", type=Path, help="folder of the corpus")
    make.add_argument("--workers", type=int, default=1, help="runs at a time")
    make.add_argument("--part", choices=design.PARTS, help="only the runs that this half needs")
    make.add_argument("--time-limit", type=float, metavar="S", help="begin no run after so many seconds")
    make.add_argument("--simulator", type=Path, default=SIMULATOR, help="folder with run.py")
    score = commands.add_parser("score", help="diagnose the cases that are there and print the table")
    score.add_argument("folder", type=Path, help="folder of the corpus")
    score.add_argument("--part", choices=design.PARTS, required=True, help="which half")
    scoring.add_options(score)
    options = parser.parse_args(arguments)
    return _make(options) if options.command == "make" else scoring.score(options, options.part, _say)


if __name__ == "__main__":
    sys.exit(main())
