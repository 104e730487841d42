"""Mutation testing: change one thing in one source at a time, and see whether a C test notices.

python mutate.py UNITY_DIR [--sample N] [--seed S] [--only SOURCE…] [--jobs J] [--most PERCENT] [--list]

UNITY_DIR holds unity.c. Each mutant is one line with one operator, constant, condition or call changed. The library is
built as a shared one, so a mutant costs one compilation, and the C tests of tests/unity and tests/vectors, in float,
are run against it, those that bear the source's name first, until one fails, crashes or takes ten times its processor
time. A mutant whose object is the same is none. What is left alive is printed with its line; those in EQUIVALENT are
known to change nothing that a caller can see. Exit code 1 when others are alive, more than --most in a hundred.
"""

import argparse
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
EQUIVALENT = Path(__file__).with_name("mutants_equivalent.toml")
FLAGS = ["-std=c99", "-O1", "-ffp-contract=off", "-fPIC", "-fno-math-errno"]
LEAST_SECONDS, SLOWER = 2, 10  # of processor: a test that takes longer than so many times its own is ended
SAME, ALIVE, KILLED = "same code", "ALIVE", "killed"

# What is replaced by what; each match on a line is a mutant of its own.
SWAPS = [
    (r"(?<![<>=!\-+*/&|])<(?![<=])(?=[ ])", "<="),
    (r"(?<![<>=!\-])>(?![>=])(?=[ ])", ">="),
    (r"<=", "<"),
    (r">=", ">"),
    (r"==", "!="),
    (r"!=", "=="),
    (r"&&", "||"),
    (r"\|\|", "&&"),
    (r" \+ ", " - "),
    (r" - ", " + "),
    (r" \* ", " / "),
    (r" / ", " * "),
    (r"\+=", "-="),
    (r"-=", "+="),
    (r"\*=", "/="),
    (r"<<", ">>"),
    (r">>", "<<"),
    (r" \^ ", " | "),
    (r" \^= ", " |= "),
    (r"(?<=[ (])!(?=[a-z(])", ""),
    (r"\? AEO_REAL\(1\)", "? AEO_REAL(2)"),
    (r"return 1;", "return 0;"),
    (r"return 0;", "return 1;"),
]
NUMBER = re.compile(r"(?<![\w.\[])(\d+)(u?)(?![\w.\]])")
REAL = re.compile(r"AEO_REAL\((\d+(?:\.\d*)?(?:e-?\d+)?)\)")
CALL = re.compile(r"^(\s+)(?:\(void\))?[a-z]\w*(?:->\w+|\.\w+)*\(.*\);$")
STORE = re.compile(r"^(\s+)(?:self->)\w+(?:->\w+|\.\w+|\[[^\]]+\])* [-+*|&]?= .*;$")


@dataclass(frozen=True)
class Mutant:
    """One changed line of one source; number counts from 1."""

    source: str
    number: int
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.source}:{self.number}: {self.old.strip()}  -->  {self.new.strip() or '(nothing)'}"


def code_lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield number and text of the lines that hold code inside functions: no comments, directives, file scope."""
    inside, comment = False, False
    for number, line in enumerate(text.splitlines(), 1):
        if line in ("{", "}"):
            inside = line == "{"
        begins, bare = comment, line.strip()
        comment = (comment or "/*" in bare) and "*/" not in bare
        if inside and not begins and not bare.startswith(("/*", "#", "*", "static const", "AEO_ASSERT", "{", "}")):
            yield number, line


def change(line: str) -> Iterator[str]:
    """Yield every way to change one line once; what follows a comment's start is left alone."""
    head, tail = (line.split("/*")[0], line[line.find("/*") :]) if "/*" in line else (line, "")
    for pattern, new in SWAPS:
        for found in re.finditer(pattern, head):
            yield head[: found.start()] + new + head[found.end() :] + tail
    truth = re.fullmatch(r"\s*return [01];\s*", head)  # has been swapped; any truth but 0 is the same
    for found in () if truth else NUMBER.finditer(head):
        yield head[: found.start()] + f"{int(found[1]) + 1}{found[2]}" + head[found.end() :] + tail
    for found in REAL.finditer(head):
        value = float(found[1]) * 1.5 if float(found[1]) > 0 else 0.5
        yield head[: found.start()] + f"AEO_REAL({value!r})" + head[found.end() :] + tail
    for pattern_whole in (CALL, STORE):
        whole = pattern_whole.match(head.rstrip())
        if whole:
            yield whole[1] + ";" + tail


def list_mutants(sources: list[Path]) -> list[Mutant]:
    """Return every mutant of the sources, in order."""
    return [
        Mutant(path.name, number, line, new)
        for path in sources
        for number, line in code_lines(path.read_text(encoding="utf-8"))
        for new in change(line)
    ]


@dataclass(frozen=True)
class Test:
    """One test program and the processor seconds it takes unharmed."""

    program: Path
    seconds: float


class Bench:
    """The library as objects, the tests that load it, and what is needed to try a mutant."""

    def __init__(self, unity: Path, folder: Path, jobs: int) -> None:
        self.folder, self.unity, self.jobs = folder, unity, jobs
        self.include = [REPOSITORY / "include", REPOSITORY / "src", REPOSITORY / "tests/unity/support", unity]
        self.sources = sorted((REPOSITORY / "src").glob("*.c"))
        with ThreadPoolExecutor(jobs) as pool:
            self.objects = dict(zip(self.sources, pool.map(self.compile_whole, self.sources), strict=True))
        self.link(list(self.objects.values()), folder / "whole")
        self.tests = self.build_tests()

    def compile(self, source: Path, target: Path) -> bool:
        """Compile one source; returns whether it is C."""
        words = ["gcc", *FLAGS, "-DUNITY_INCLUDE_DOUBLE", "-w", *(f"-I{d}" for d in self.include)]
        return subprocess.run([*words, "-c", source, "-o", target], capture_output=True, check=False).returncode == 0

    def compile_whole(self, source: Path) -> Path:
        """Return the object of an unharmed file; the program ends when there is none."""
        target = self.folder / f"{source.stem}.o"
        if not self.compile(source, target):
            sys.exit(f"{source} does not compile")
        return target

    def link(self, objects: list[Path], folder: Path) -> None:
        """Make the shared library in a folder."""
        folder.mkdir(exist_ok=True)
        subprocess.run(["gcc", "-shared", *objects, "-lm", "-o", folder / "libaeolid.so"], check=True)

    def build_tests(self) -> list[Test]:
        """Build every test of the library and measure it."""
        unit = REPOSITORY / "tests/unity"
        shared = [*sorted((unit / "support").glob("*.c")), self.unity / "unity.c"]
        names = [p for p in sorted(unit.glob("test_*.c")) if not p.name.startswith("test_port")]
        names += sorted((REPOSITORY / "tests/vectors").glob("test_*.c"))
        with ThreadPoolExecutor(self.jobs) as pool:
            common = list(pool.map(self.compile_whole, shared))
            objects = list(pool.map(self.compile_whole, names))
        tests = []
        for made in objects:
            program = made.with_suffix("")
            where = [f"-L{self.folder / 'whole'}", "-laeolid", "-lm"]
            subprocess.run(["gcc", made, *common, *where, "-o", program], check=True)
            before = os.times().children_user
            if self.run(program, self.folder / "whole", 600) != 0:
                sys.exit(f"{program.name} fails without a mutant")
            tests.append(Test(program, os.times().children_user - before))
        return tests

    def run(self, program: Path, library: Path, seconds: int) -> int:
        """Run a test against a library; returns its exit code."""
        done = subprocess.run(
            [program],
            env={**os.environ, "LD_LIBRARY_PATH": str(library)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds)),
            check=False,
        )
        return done.returncode

    def order(self, source: str) -> list[Test]:
        """Return the tests, those that bear the source's name or its beginning first, then the fastest first."""
        stem = source.removesuffix(".c")
        return sorted(
            self.tests,
            key=lambda t: (stem not in t.program.name, stem.split("_")[0] not in t.program.name, t.seconds),
        )

    def judge(self, mutant: Mutant) -> str:
        """Return what became of a mutant: same code, killed (and by what), or alive."""
        path = REPOSITORY / "src" / mutant.source
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        lines[mutant.number - 1] = mutant.new + "\n"
        folder = Path(tempfile.mkdtemp(dir=self.folder))
        try:
            changed, made = folder / mutant.source, folder / "mutant.o"
            changed.write_text("".join(lines), encoding="utf-8")
            if not self.compile(changed, made):
                return f"{KILLED} by the compiler"
            if made.read_bytes() == self.objects[path].read_bytes():
                return SAME
            self.link([made if p == path else o for p, o in self.objects.items()], folder)
            for test in self.order(mutant.source):
                if self.run(test.program, folder, int(LEAST_SECONDS + SLOWER * test.seconds)) != 0:
                    return f"{KILLED} by {test.program.name}"
            return ALIVE
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def read_equivalent() -> set[tuple[str, str, str]]:
    """Return the mutants known to change nothing: source, line and its replacement, without blanks around them."""
    entries = tomllib.loads(EQUIVALENT.read_text(encoding="utf-8")).get("mutant", [])
    return {(e["source"], e["old"], e["new"]) for e in entries}


def read_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("unity", type=Path, help="folder that holds unity.c")
    parser.add_argument("--sample", type=int, default=0, help="try so many, drawn evenly; by default all")
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    parser.add_argument("--only", nargs="+", help="these sources alone: rls.c …")
    parser.add_argument("--jobs", type=int, default=2, help="mutants tried at once")
    parser.add_argument("--most", type=float, default=0.0, help="so many in a hundred may live")
    parser.add_argument("--list", action="store_true", help="list the mutants and try none")
    return parser.parse_args()


def main() -> None:
    asked = read_arguments()
    sources = [p for p in sorted((REPOSITORY / "src").glob("*.c")) if not asked.only or p.name in asked.only]
    mutants = list_mutants(sources)
    if asked.sample:
        mutants = random.Random(asked.seed).sample(mutants, min(asked.sample, len(mutants)))
    if asked.list:
        print("\n".join(map(str, mutants)))
        return
    known, fates = read_equivalent(), []
    with tempfile.TemporaryDirectory(prefix="aeolid-mutants-") as folder:
        bench = Bench(asked.unity, Path(folder), asked.jobs)
        with ThreadPoolExecutor(asked.jobs) as pool:
            for mutant, fate in zip(mutants, pool.map(bench.judge, mutants), strict=True):
                if fate == ALIVE and (mutant.source, mutant.old.strip(), mutant.new.strip()) in known:
                    fate = SAME
                fates.append(fate)
                if fate == ALIVE:
                    print(f"alive: {mutant}", flush=True)
    alive, counted = fates.count(ALIVE), len(fates) - fates.count(SAME)
    share = 100.0 * alive / counted if counted else 0.0
    print(f"{len(fates)} mutants, {fates.count(SAME)} the same code, {alive} of {counted} alive ({share:.0f} %)")
    sys.exit(1 if share > asked.most else 0)


if __name__ == "__main__":
    main()
