"""Gate: the text of each object stays below its committed size, and on a Cortex-M4F the filters below 16 kB.

The filters with all they need are one group, what streams is another. No object has data or bss.
"""

import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

STREAMING = {"describe", "frame", "spread", "stream"}
FILTERS_MOST, STREAMING_MOST = 16 * 1024, 6 * 1024  # bytes, Cortex-M4F


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
            size, data, bss, *_, path = line.split()
            text[Path(path).stem] = int(size)
            if data != "0" or bss != "0":
                findings.append(f"{name}: {Path(path).name} has {data} bytes of data and {bss} of bss")
        for stem, size in text.items():
            limit = table[name].get(stem)
            if limit is None:
                findings.append(f"{name}: {stem}.o ({size} bytes) has no line in sizes.toml")
            elif size > limit:
                findings.append(f"{name}: {stem}.o has {size} bytes of text, at most {limit}")
        groups = [sum(n for stem, n in text.items() if (stem in STREAMING) == streams) for streams in (False, True)]
        for what, size, most in zip(("filters", "streaming"), groups, (FILTERS_MOST, STREAMING_MOST), strict=True):
            if name == "cortex-m4f" and size > most:
                findings.append(f"{name}: {size} bytes of text for {what}, at most {most}")
        figures.append(f"{name}: filters {groups[0]}, streaming {groups[1]} bytes of text")
    gate.finish(findings, "; ".join(figures))


if __name__ == "__main__":
    main()
