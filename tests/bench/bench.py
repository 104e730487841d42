"""Time and count one update of every filter against the textbook RLS with Eigen and in plain C.

python tests/bench/bench.py [--smoke] [--repetitions N]   (a minute or two, one core; nothing else should run)

Prints for each set of flags and each precision, for n = 44 and 124 with 4 outputs and for p = 5 ... 100 with r = 2,
l = 3: nanoseconds an update (smallest of N repetitions), instructions (callgrind), both as ratios to the best of five
forms in Eigen, and how cost grows with p: the exponent between p = 20 and 100, 1 being linear. Textbook rivals have
VARX's n at each p; VARMAX filters (els) have 3/5 more regressors there.
"""

import argparse
import math
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
EIGEN = [Path("/usr/include/eigen3"), Path("/usr/local/include/eigen3")]
PRECISIONS = {"float": [], "double": ["-DAEO_REAL_DOUBLE"]}
# callgrind knows no AVX-512: counts of the native blocks come from a build for AVX2, times from the machine's own
STRICT = ["-ffp-contract=off"]
BLOCKS = {
    "-O2, strict IEEE": ["-O2", *STRICT],
    "-O3 -march=native, strict IEEE": ["-O3", "-march=native", *STRICT],
    "-O3 -march=native": ["-O3", "-march=native"],
}


@dataclass(frozen=True)
class Row:
    """One contestant at one size."""

    name: str
    inputs: int
    outputs: int
    past: int
    n: int

    @property
    def size(self) -> tuple[int, int]:
        """What rows of one group share: outputs, and n or p."""
        return (4, 44 if self.n < 80 else 124) if self.outputs == 4 else (3, self.past)


def read_row(words: list[str]) -> Row:
    """Read the label of a row."""
    return Row(words[0], *(int(word) for word in words[1:5]))


def build(directory: Path, name: str, flags: list[str]) -> Path:
    """Build the benchmark; ends the program when it does not compile."""
    eigen = next((path for path in EIGEN if path.is_dir()), None)
    if eigen is None:
        print("skipped: Eigen 3 is not installed")
        sys.exit(77)
    include = [f"-I{path}" for path in (ROOT / "include", ROOT / "src", HERE, ROOT / "tests/family")]
    sources = [*(ROOT / "src").glob("*.c"), HERE / "bench.c", HERE / "naive.c", ROOT / "tests/family/family.c"]
    folder = directory / f"{name}-objects"
    folder.mkdir()
    commands = [
        ["gcc", "-std=c99", *flags, *include, "-c", *map(str, sources)],
        ["g++", "-std=c++14", "-DNDEBUG", *flags, *include, f"-isystem{eigen}", "-c", str(HERE / "eigen.cpp")],
        ["g++", *flags, *(f"{s.stem}.o" for s in sources), "eigen.o", "-lm", "-o", str(directory / name)],
    ]
    for command in commands:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(done.stderr)
    return directory / name


def measure_time(program: Path, *arguments: str) -> dict[Row, float]:
    """Return nanoseconds an update."""
    done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)
    lines = [line.split() for line in done.stdout.splitlines()]
    return {read_row(words): float(words[5]) for words in lines}


def count_instructions(program: Path, directory: Path) -> dict[Row, float]:
    """Return instructions an update; nothing without valgrind."""
    if shutil.which("valgrind") is None:
        return {}
    out = directory / "callgrind"
    out.mkdir(exist_ok=True)
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out / 'out'}", str(program), "1"]
    subprocess.run(command, capture_output=True, text=True, check=True)
    counts = {}
    timed = re.search(r"TIMED = (\d+)", (HERE / "bench.c").read_text())
    for path in out.glob("out*"):
        text = path.read_text()
        label = re.search(r"^desc: Trigger: Client Request: (.*)$", text, re.M)
        total = re.search(r"^(?:summary|totals): (\d+)", text, re.M)
        if label and total and timed:
            counts[read_row(label[1].split())] = int(total[1]) / int(timed[1])
        path.unlink()
    return counts


def print_group(times: dict[Row, float], counts: dict[Row, float], title: str) -> None:
    """Print one table: contestants of one size."""
    print(f"\n{title}\n  {'':16} {'n':>4} {'ns':>9} {'instr.':>10} {'time/Eigen':>11} {'instr./Eigen':>13}")
    eigen = [row for row in times if row.name.startswith("eigen")]
    fastest, fewest = min(times[row] for row in eigen), min(counts.get(row, math.nan) for row in eigen)
    for row, took in times.items():
        count = counts.get(row, math.nan)
        print(f"  {row.name:16} {row.n:4} {took:9.0f} {count:10.0f} {took / fastest:11.2f} {count / fewest:13.2f}")


def print_block(times: dict[Row, float], counts: dict[Row, float]) -> None:
    """Print all tables of one set of flags and one precision."""
    for outputs, size in dict.fromkeys(row.size for row in times):
        group = {row: took for row, took in times.items() if row.size == (outputs, size)}
        name = f"n = {size}, 4 outputs" if outputs == 4 else f"p = {size}, r = 2, l = 3"
        print_group(group, counts, name)
    ladder = {row.name: {r.past: t for r, t in times.items() if r.name == row.name and r.outputs == 3} for row in times}
    print("\ngrowth with p, and times as fast as rls at p = 50")
    for name, by_past in ladder.items():
        if {20, 50, 100} <= by_past.keys():
            slope = math.log(by_past[100] / by_past[20]) / math.log(5.0)
            print(f"  {name:16} p^{slope:.2f} {ladder['rls'][50] / by_past[50]:9.2f}")


def run_smoke(directory: Path) -> None:
    """See that everything builds, runs and agrees; no figure is judged."""
    times = measure_time(build(directory, "smoke", ["-O2", "-Wall", "-Wextra", "-Werror"]), "1", "2")
    names = {row.name for row in times}
    if not {"rls", "eigen", "eigen_lazy", "eigen_triangular", "naive"} <= names or len(times) != 2 * len(names):
        sys.exit(f"contestants are missing: {sorted(names)}")
    print(f"{len(names)} contestants ran: {', '.join(sorted(names))}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--smoke", action="store_true", help="build and run once, judge nothing")
    parser.add_argument("--repetitions", type=int, default=15, help="the smallest of so many counts")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="aeolid-bench-") as name:
        directory = Path(name)
        if options.smoke:
            run_smoke(directory)
            return
        for title, flags in BLOCKS.items():
            for precision, define in PRECISIONS.items():
                label = f"{precision}-{len(list(directory.iterdir()))}"
                counted = ["-march=haswell" if flag == "-march=native" else flag for flag in flags]
                program = build(directory, label, [*flags, *define])
                counting = build(directory, f"{label}-counted", [*counted, *define, "-DBENCH_CALLGRIND"])
                print(f"\n==== gcc {title}, {precision} ====")
                print_block(measure_time(program, str(options.repetitions)), count_instructions(counting, directory))
                sys.stdout.flush()


if __name__ == "__main__":
    main()
