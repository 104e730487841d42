"""Gate: the RAM of a filter is its structure and its words, counted in a linked image; sizes in headers hold."""

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

# Filters as firmware would hold them: words as the manuals promise, in numbers, so that a macro that grew is found, and
# named there, so that the manual is; and settings. rls has n = 44, l = 4, the others r = 2, l = 3, p = 10.
FILTERS = {
    "rls": (48 * (44 + 4 - 24) + 44 * 4 + 24 * 6 + 4 * 4 + 3, "{44, 4, 1, 1, 0, 4}"),
    "els": (80 * (80 + 4 - 40) + 80 * 3 + 24 * 10 + 4 * 3 + 3 + 5 * 3, "{80, 3, 10, 0, 500, 1, 1, 0, 1, 0, 4, 4}"),
    "fast_rls": (50 * (4 * 5 + 3 + 8) + 3 * 25 + 10 * 5 + 4 * 3 + 8, "{10, 5, 3, 0, 0.999, 1, 10}"),
    "lattice": (1637, "{10, 5, 0, 3, 1, 1, 0, 4}"),
}
PROGRAM = """
#include "aeolid/markov.h"
#include "aeolid/FILTER.h"
aeo_regressor_t regressor;
aeo_FILTER_t filter;
aeo_real_t window[77];
aeo_real_t words[WORDS];
int main(void)
{
    static const aeo_regressor_config_t layout = {.inputs = 2, .outputs = 3, .past = 10, .period_us = 1};
    static const aeo_FILTER_config_t settings = SETTINGS;
    static const aeo_real_t z[80], y[4];
    return aeo_regressor_init(&regressor, &layout, window, sizeof window / sizeof *window) ||
           aeo_FILTER_init(&filter, &settings, words, sizeof words / sizeof *words) ||
           aeo_FILTER_update(&filter, z, y);
}
"""
# What headers say of sizes with 64-bit pointers: header, what is included, the size, the words about it.
STATED = [
    ("include/aeolid/estimator.h", "aeolid/estimator.h", "AEO_ESTIMATOR_RLS_WORDS(2, 3, 10, 0, 0)", "rls {:,} words"),
    ("include/aeolid/estimator.h", "aeolid/estimator.h", "AEO_ESTIMATOR_ELS_WORDS(2, 3, 10, 0)", "e=1 {:,} words"),
    ("include/aeolid/estimator.h", "aeolid/estimator.h", "sizeof(aeo_estimator_t)", "any filter: {} bytes"),
    ("include/aeolid/stream.h", "aeolid/stream.h", "sizeof(aeo_stream_t)", "structure itself {} bytes"),
    ("port/j1939/claim.h", "claim.h", "sizeof(aeo_claim_t)", "the structure, {} bytes"),
    ("port/fdcan/fdcan_port.h", "fdcan_port.h", "sizeof(aeo_fdcan_t) - AEO_FDCAN_RING * 72", "{} (64-bit pointers)"),
    ("port/discon/bus.h", "bus.h", "(sizeof(posix_bus_t) + 50000) / 100000 / 10.0", "({} MB)"),
    ("port/discon/discon.h", "bus.h", "(sizeof(posix_bus_t) + 50000) / 100000 / 10.0", "pty {} MB more"),
]
OURS = {"regressor", "filter", "window", "words"}


def measure(name: str, precision: str, directory: Path) -> tuple[list[str], int]:
    """Link a program with one filter over compiled objects; return findings and bytes of writable memory."""
    words, settings = FILTERS[name]
    text = PROGRAM.replace("FILTER", name).replace("WORDS", str(words)).replace("SETTINGS", settings)
    (directory / f"{name}.program").write_text(text)
    command = ["gcc", "-std=c99", *gate.PRECISIONS[precision], f"-I{gate.ROOT / 'include'}", "-x", "c"]
    command += [f"{name}.program", "-x", "none", *map(str, sorted(directory.glob("*.o"))), "-lm", "-o", "p"]
    built = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=False)
    if built.returncode:
        return [f"{precision} {name}: {built.stderr}"], 0
    findings = []
    if f"{words:,} words" not in (gate.ROOT / f"include/aeolid/{name}.h").read_text():
        findings.append(f"{name}.h does not say that it takes {words:,} words")
    if subprocess.run([directory / "p"], check=False).returncode:
        findings.append(f"{precision} {name}: the memory of the manual is refused")
    used = {}
    for line in gate.output("nm", "-S", directory / "p").splitlines():
        parts = line.split()
        if len(parts) == 4 and parts[2] in "BbDdC" and not parts[3].startswith(("_", "completed")):
            used[parts[3]] = int(parts[1], 16)
    more = {symbol: size for symbol, size in used.items() if symbol not in OURS}
    findings += [f"{precision} {name}: {symbol} takes {size} bytes beyond the formula" for symbol, size in more.items()]
    return findings, sum(used.values())


def read_words(header: str) -> str:
    """Return a header's text on one line, without the stars that begin a comment's lines."""
    lines = (gate.ROOT / header).read_text().splitlines()
    return " ".join(" ".join(line.strip().removeprefix("*") for line in lines).split())


def judge_stated(directory: Path) -> list[str]:
    """Measure what headers state; return those that say another figure."""
    findings = []
    for header, included, size, words in STATED:
        program = f'#include <stdio.h>\n#include "{included}"\nint main(void)\n{{\n'
        program += f'    printf("%.10g", (double)({size}));\n    return 0;\n}}\n'
        folders = [f"-I{gate.ROOT / part}" for part in ("include", Path(header).parent)]
        command = ["gcc", "-std=c99", "-D_DEFAULT_SOURCE", *folders, "-x", "c", "-", "-o", "stated"]
        subprocess.run(command, cwd=directory, input=program, text=True, check=True)
        found = float(gate.output(directory / "stated"))
        told = words.format(int(found) if found.is_integer() else found)
        if told not in read_words(header):
            findings.append(f"{header} does not say: {told}")
    return findings


def main() -> None:
    findings, figures = [], []
    if sys.maxsize > 2**32:
        findings += judge_stated(gate.scratch())
    for precision, flags in gate.PRECISIONS.items():
        directory = gate.scratch()
        messages = gate.compile_sources(["gcc"], [*gate.LIBRARY, *flags], directory)
        if messages:
            gate.finish([messages], "")
        for name in FILTERS:
            wrong, size = measure(name, precision, directory)
            findings += wrong
            figures.append(f"{precision} {name} {size}")
    gate.finish(findings, "bytes in all: " + ", ".join(figures))


if __name__ == "__main__":
    main()
