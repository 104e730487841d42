"""Have a corpus of cases diagnosed with the margins of the rules, whatever their source, and go on where it stopped.

    python tests/studies/corpus.py FOLDER [--own 480] [--foreign 120] [--seed 31] [--samples 6000] [--workers N]
                                   [--known ../shared/cases/known] [--pairs CORPUS:PART …]

Own and foreign challenges are made with a seal and run; the recordings and simulator runs of others, where the folder
is there, are diagnosed as one table of cases; pairs that `openfast_corpus.py` or `other_turbines.py` made are scored.
What is done is not done again: the same command goes on. It ends with what `ablation.py` is to be given. All of it
takes about 40 s of a core a case. Exit code 1 where a step failed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
KNOWN = HERE.parents[1].parent / "shared" / "cases" / "known"
AEOLID = (sys.executable, "-m", "aeolid.cli.main")


def steps(args: argparse.Namespace) -> list[tuple[str, list[Sequence[str]]]]:
    """Return the sources of the corpus, as ablation.py names them, each with the commands that are left."""
    workers = ("--workers", str(args.workers))
    found: list[tuple[str, list[Sequence[str]]]] = []
    for physics, count in (("own", args.own), ("foreign", args.foreign)):
        folder = args.folder / physics
        if not count:
            continue
        numbers = ("--cases", str(count), "--seed", str(args.seed), "--samples", str(args.samples))
        make = (*AEOLID, "challenge", "make", str(folder), "--physics", physics, *numbers)
        run = (*AEOLID, "challenge", "run", str(folder), *workers)
        found.append((f"challenge:{folder}", [run] if (folder / "seal.json").is_file() else [make, run]))
    cases = sorted(str(p.parent) for p in args.known.glob("*/truth.json"))
    if len(cases) > 1:
        options = ("--out", str(args.folder / "known"), "--sham", "0", "--no-report", "--margins")
        found.append((f"known:{args.folder / 'known'}", [(*AEOLID, "diagnose", *cases, *options, *workers)]))
    for pair in args.pairs:
        folder, _, part = pair.rpartition(":")
        script, own = ("other_turbines.py", ()) if part == "others" else ("openfast_corpus.py", ("--part", part))
        found.append((f"pairs:{pair}", [(sys.executable, str(HERE / script), "score", folder, *own)]))
    return found


def main(arguments: list[str] | None = None) -> int:
    """Do what is left, source by source."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of the corpus, outside the repository")
    parser.add_argument("--own", type=int, default=480, metavar="N", help="cases of the own challenge; 0 for none")
    parser.add_argument("--foreign", type=int, default=120, metavar="N", help="cases of foreign physics; 0 for none")
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--samples", type=int, default=6000, help="length of each recording of a challenge")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)), metavar="N")
    parser.add_argument("--known", type=Path, default=KNOWN, help="folder of the cases of others")
    parser.add_argument("--pairs", nargs="*", default=[], metavar="CORPUS:PART", help="pairs that have been made")
    args = parser.parse_args(arguments)
    args.folder.mkdir(parents=True, exist_ok=True)
    failed, sources = 0, []
    for source, commands in steps(args):
        print(f"{source} …", file=sys.stderr, flush=True)
        codes = [subprocess.run(command, check=False).returncode for command in commands]
        failed += any(codes)
        sources.append(source)
    print("python tests/studies/ablation.py table " + " ".join(sources))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
