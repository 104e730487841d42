"""Gate: mutants that once lived and were killed by a test written against them stay dead.

python mutants.py UNITY_DIR LIBRARY; UNITY_DIR holds unity.c, LIBRARY is libaeolid.a in float. A sample of mutate.py
that is cheap and the same every time: mutants_killed.toml names source, line, its replacement and the test that
objects. A line that is gone is passed over, and told; when half of them are gone the list is to be renewed.
"""

import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
FLAGS = ["-std=c99", "-O1", "-ffp-contract=off", "-fno-math-errno", "-w", "-DUNITY_INCLUDE_DOUBLE"]
FOLDERS = ["include", "src", "tests/unity/support"]


def compile_one(source: Path, target: Path, unity: Path) -> bool:
    """Compile one source; returns whether it is C."""
    include = [*(f"-I{REPOSITORY / folder}" for folder in FOLDERS), f"-I{unity}"]
    done = subprocess.run(["gcc", *FLAGS, *include, "-c", source, "-o", target], capture_output=True, check=False)
    return done.returncode == 0


def judge(entry: dict[str, str], objects: dict[str, Path], common: list[Path], unity: Path, library: Path) -> str:
    """Return what is wrong with one mutant, empty when its test objects; "gone" when its line is not there."""
    source = REPOSITORY / "src" / entry["source"]
    lines = source.read_text(encoding="utf-8").splitlines(keepends=True)
    found = [i for i, line in enumerate(lines) if line.strip() == entry["old"]]
    if not found:
        return "gone"
    with tempfile.TemporaryDirectory(prefix="aeolid-mutant-") as folder:
        changed, program = Path(folder) / source.name, Path(folder) / "test"
        lines[found[0]] = entry["new"] + "\n"
        changed.write_text("".join(lines), encoding="utf-8")
        said = f"{entry['source']}: {entry['old']}  -->  {entry['new'] or '(nothing)'}"
        if not compile_one(changed, Path(folder) / "mutant.o", unity):
            return f"does not compile: {said}"
        # before the library, whose own object of this source is then not asked for
        words = [objects[entry["test"]], Path(folder) / "mutant.o", *common, library, "-lm", "-o", program]
        if subprocess.run(["gcc", *words], capture_output=True, check=False).returncode != 0:
            return f"does not link: {said}"
        killed = subprocess.run([program], capture_output=True, check=False, timeout=3600).returncode != 0
        return "" if killed else f"lives: {said} ({entry['test']})"


def main() -> None:
    unity, library = Path(sys.argv[1]), Path(sys.argv[2])
    entries = tomllib.loads((HERE / "mutants_killed.toml").read_text(encoding="utf-8"))["mutant"]
    with tempfile.TemporaryDirectory(prefix="aeolid-mutants-") as folder, ThreadPoolExecutor(2) as pool:
        unit = REPOSITORY / "tests/unity"
        shared = [*sorted((unit / "support").glob("*.c")), unity / "unity.c"]
        tests = [unit / f"{name}.c" for name in sorted({entry["test"] for entry in entries})]
        made = [Path(folder) / f"{source.stem}.o" for source in [*shared, *tests]]
        built = pool.map(lambda pair: compile_one(pair[0], pair[1], unity), zip([*shared, *tests], made, strict=True))
        findings = [f"{path.stem} does not compile" for path, good in zip(made, built, strict=True) if not good]
        objects = {path.stem: path for path in made[len(shared) :]}
        common = made[: len(shared)]
        fates = list(pool.map(lambda e: judge(e, objects, common, unity, library), entries)) if not findings else []
    gone = fates.count("gone")
    findings += [fate for fate in fates if fate not in ("", "gone")]
    if 2 * gone > len(entries):
        findings.append(f"{gone} of {len(entries)} lines are gone: renew mutants_killed.toml by mutate.py")
    print("\n".join(findings) if findings else f"{len(entries) - gone} mutants dead, {gone} lines gone")
    sys.exit(1 if findings else 0)


if __name__ == "__main__":
    main()
