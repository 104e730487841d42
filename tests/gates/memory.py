"""Gate: the RAM of a filter is its structure and its words, and nothing else: counted in a linked image."""

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

# One turbine's filter as firmware would hold it; expected adds up what the header promises.
PROGRAM = """
#include "aeolid/markov.h"
#include "aeolid/rls.h"
aeo_regressor_t regressor;
aeo_rls_t rls;
aeo_real_t window[77];
aeo_real_t words[1 * 50 * 51 / 2 + 50 * 3 + 2 * 50 + 2 * 3];
const unsigned long expected = sizeof regressor + sizeof rls + sizeof window + sizeof words;
int main(void)
{
    static const aeo_regressor_config_t layout = {.inputs = 2, .outputs = 3, .past = 10, .period_us = 1};
    static const aeo_rls_config_t settings = {50, 3, 1, 1, 0, 4};
    return aeo_regressor_init(&regressor, &layout, window, sizeof window / sizeof *window) ||
           aeo_rls_init(&rls, &settings, words, sizeof words / sizeof *words) ||
           aeo_rls_update(&rls, window, window);
}
"""


def main() -> None:
    findings, figures = [], []
    for precision, flags in gate.PRECISIONS.items():
        directory = gate.scratch()
        (directory / "program.c").write_text(PROGRAM)
        messages = gate.compile_sources(["gcc"], ["-std=c99", "-O2", *flags], directory)
        objects = sorted(directory.glob("*.o"))
        built = subprocess.run(
            [
                "gcc",
                "-std=c99",
                *flags,
                f"-I{gate.ROOT / 'include'}",
                "program.c",
                *map(str, objects),
                "-lm",
                "-o",
                "p",
            ],
            cwd=directory,
            capture_output=True,
            text=True,
            check=False,
        )
        if messages or built.returncode:
            gate.finish([messages + built.stderr], "")
        ran = subprocess.run([directory / "p"], check=False)
        if ran.returncode:
            findings.append(f"{precision}: the memory of the formulas is refused")
        used = {}
        for line in gate.output("nm", "-S", directory / "p").splitlines():
            parts = line.split()
            if len(parts) == 4 and parts[2] in "BbDdC":
                used[parts[3]] = int(parts[1], 16)
        ours = {n: b for n, b in used.items() if not n.startswith(("_", "completed"))}
        promised = {"regressor", "rls", "window", "words"}
        findings += [
            f"{precision}: {n} takes {b} bytes beyond the formula" for n, b in ours.items() if n not in promised
        ]
        figures.append(f"{precision}: {sum(ours.values())} bytes for r=2, l=3, p=10")
    gate.finish(findings, "; ".join(figures))


if __name__ == "__main__":
    main()
