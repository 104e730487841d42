"""Gate: no bytes given as saved state, configuration, sample or frame make filters, regressor or streamer misbehave.

python fuzz.py ROOT [SECONDS [CORPUS]]: without SECONDS a fixed number of inputs from a fixed seed, mostly the same, in
float (the tests have the sanitizers in double); with it so many seconds for each fuzzer and precision, from a seed of
its own, on inputs kept in the folder CORPUS.
libFuzzer with AddressSanitizer and UndefinedBehaviorSanitizer; exit code 77 where clang has none. An input that fails
is left in the present folder; the program named in the message replays it.
"""

import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

TESTS = Path(__file__).resolve().parents[1]
# Inputs by day; `sh tests/run nightly` has minutes. With a quarter of the filters' a seeded defect went unseen; one for
# the wire takes five times as long, and unit tests send damaged and lost frames.
RUNS = {"filters": 40_000, "wire": 10_000}
FUZZERS = {
    "filters": [TESTS / "fuzz/fuzz.c", TESTS / "family/family.c"],
    "wire": [TESTS / "fuzz/fuzz_wire.c"],
}
FLAGS = ["-std=c99", "-g", "-O1", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all"]


def build(sources: list[Path], precision: str, path: Path) -> str:
    """Build a fuzzer; returns the compiler's messages, empty when built."""
    include, objects = [gate.ROOT / "include", gate.ROOT / "src", TESTS / "family"], gate.scratch()
    flags = [*FLAGS, *gate.PRECISIONS[precision]]
    messages = gate.compile_each(["clang"], flags, include, [*sources, *gate.SOURCES], objects)
    if messages:
        return messages
    command = ["clang", *flags, *map(str, sorted(objects.glob("*.o"))), "-lm", "-o", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else done.stderr or "compiler failed"


def has_fuzzer() -> bool:
    """Return whether clang is installed with libFuzzer's run-time library."""
    if shutil.which("clang") is None:
        return False
    probe = gate.scratch() / "probe"
    text = "int LLVMFuzzerTestOneInput(const void *d, unsigned long n); "
    text += "int LLVMFuzzerTestOneInput(const void *d, unsigned long n) { return d != 0 && n > 5; }"
    command = ["clang", *FLAGS, "-x", "c", "-", "-o", str(probe)]
    return subprocess.run(command, input=text, capture_output=True, text=True, check=False).returncode == 0


def main() -> None:
    if not has_fuzzer():
        print("skipped: clang with libFuzzer (libclang-rt) is not installed")
        sys.exit(77)
    findings, figures = [], []
    seconds = sys.argv[2] if len(sys.argv) > 2 else None
    corpus = Path(sys.argv[3]).resolve() if len(sys.argv) > 3 else gate.scratch()
    for name, precision in product(FUZZERS, gate.PRECISIONS if seconds else ["float"]):
        path = gate.scratch() / f"fuzz-{name}-{precision}"
        messages = build(FUZZERS[name], precision, path)
        if messages:
            gate.finish([messages], "")
        own = corpus / name / precision
        own.mkdir(parents=True, exist_ok=True)
        until = [f"-max_total_time={seconds}"] if seconds else [f"-runs={RUNS[name]}", "-seed=1"]
        command = [str(path), *until, "-max_len=4096", "-print_final_stats=1", str(own)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, errors="replace")
        lines = done.stderr.splitlines()
        ran = next((line.split()[-1] for line in lines if "number_of_executed_units" in line), "0")
        figures.append(f"{name} {precision}: {ran} inputs")
        if done.returncode:
            marks = ("ERROR", "runtime error", "SUMMARY", "Test unit written")
            told = [lines[i - 1] for i, line in enumerate(lines) if "ERROR: libFuzzer" in line and i > 0]
            told += [line for line in lines if any(mark in line for mark in marks)]
            findings.append(f"{name} {precision}: " + "; ".join(told)[:900])
            break
    gate.finish(findings, "; ".join(figures))


if __name__ == "__main__":
    main()
