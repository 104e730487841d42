"""Gate: the text of each object stays below its committed size, and on a Cortex-M4F at -Os the filters below 16 kB.

The filters with all they need are one group, what streams is another; the texts of status belong to neither. No object
has data or bss.
"""

import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

STREAMING = {"describe", "frame", "spread", "stream", "stream_send", "stream_values"}
NEITHER = {"status"}
FILTERS_MOST, STREAMING_MOST = 16 * 1024, 6 * 1024  # bytes, Cortex-M4F


def measure(name: str, command: str, level: str) -> tuple[dict[str, int], list[str]]:
    """Return the text of each object compiled at an optimisation level, and which have data or bss."""
    directory, findings, text = gate.scratch(), [], {}
    messages = gate.compile_sources(command, ["-std=c99", level], directory)
    if messages:
        gate.finish([messages], "")
    tool = "arm-none-eabi-size" if name == "cortex-m4f" else "size"
    for line in gate.output(tool, *sorted(directory.glob("*.o"))).splitlines()[1:]:
        size, data, bss, *_, path = line.split()
        text[Path(path).stem] = int(size)
        if data != "0" or bss != "0":
            findings.append(f"{name}: {Path(path).name} has {data} bytes of data and {bss} of bss")
    return text, findings


def add_groups(text: dict[str, int]) -> tuple[int, int]:
    """Return the text of the filters and of what streams."""
    counted = {stem: size for stem, size in text.items() if stem not in NEITHER}
    streaming = sum(size for stem, size in counted.items() if stem in STREAMING)
    return sum(counted.values()) - streaming, streaming


def main() -> None:
    findings, figures = [], []
    table = tomllib.loads(Path(__file__).with_name("sizes.toml").read_text())
    for name, command in gate.compilers().items():
        if name not in table:
            continue
        text, wrong = measure(name, command, "-O2")
        findings += wrong
        for stem, size in text.items():
            limit = table[name].get(stem)
            if limit is None:
                findings.append(f"{name}: {stem}.o ({size} bytes) has no line in sizes.toml")
            elif size > limit:
                findings.append(f"{name}: {stem}.o has {size} bytes of text, at most {limit}")
        filters, streaming = add_groups(text)
        figures.append(f"{name} -O2: filters {filters}, streaming {streaming} bytes of text")
        if name != "cortex-m4f":
            continue
        smallest, _ = add_groups(measure(name, command, "-Os")[0])
        figures.append(f"{name} -Os: filters {smallest}")
        for what, size, most in (("filters", smallest, FILTERS_MOST), ("streaming", streaming, STREAMING_MOST)):
            if size > most:
                findings.append(f"{name}: {size} bytes of text for {what}, at most {most}")
    gate.finish(findings, "; ".join(figures))


if __name__ == "__main__":
    main()
