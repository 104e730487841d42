"""Gate: the text of each object stays below its committed size, and all of them below 16 kB on a Cortex-M4F."""

import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

TOTAL = 16 * 1024  # bytes, Cortex-M4F


def main() -> None:
    findings, figures = [], []
    table = tomllib.loads(Path(__file__).with_name("sizes.toml").read_text())
    for name, command in gate.compilers().items():
        if name not in table:
            continue
        directory = gate.scratch()
        messages = gate.compile_sources(command, ["-std=c99", "-O2"], directory)
        if messages:
            gate.finish([messages], "")
        tool = "arm-none-eabi-size" if name == "cortex-m4f" else "size"
        text = {}
        for line in gate.output(tool, *sorted(directory.glob("*.o"))).splitlines()[1:]:
            text[Path(line.split()[-1]).stem] = int(line.split()[0])
        for stem, size in text.items():
            limit = table[name].get(stem)
            if limit is None:
                findings.append(f"{name}: {stem}.o ({size} bytes) has no line in sizes.toml")
            elif size > limit:
                findings.append(f"{name}: {stem}.o has {size} bytes of text, at most {limit}")
        if name == "cortex-m4f" and sum(text.values()) > TOTAL:
            findings.append(f"{name}: {sum(text.values())} bytes of text in all, at most {TOTAL}")
        figures.append(f"{name}: {sum(text.values())} bytes of text")
    gate.finish(findings, "; ".join(figures))


if __name__ == "__main__":
    main()
