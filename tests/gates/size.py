"""Gate: the text of each object stays below its committed size, and on a Cortex-M4F at -Os that of each part as linked.

A part is what a device carries: what the linker keeps of one filter with its regressor, with saving or without, or of
the stream, for a program that calls these; unused functions of an object are not in it. A sum over filters that nobody
links together said nothing about any device. No object has data or bss.
"""

import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate
import linked


def measure(name: str, command: list[str], level: str) -> tuple[dict[str, int], list[str], list[Path]]:
    """Return the text of each object compiled at an optimisation level, which have data or bss, and the objects."""
    directory, findings, text = gate.scratch(), [], {}
    messages = gate.compile_sources(
        command, [*gate.LIBRARY, *([level] if level not in gate.LIBRARY else [])], directory
    )
    if messages:
        gate.finish([messages], "")
    tool = "arm-none-eabi-size" if name == "cortex-m4f" else "size"
    objects = sorted(directory.glob("*.o"))
    for line in gate.output(tool, *objects).splitlines()[1:]:
        size, data, bss, *_, path = line.split()
        text[Path(path).stem] = int(size)
        if data != "0" or bss != "0":
            findings.append(f"{name}: {Path(path).name} has {data} bytes of data and {bss} of bss")
    return text, findings, objects


def judge_parts(limits: dict[str, int], command: list[str]) -> tuple[str, list[str]]:
    """Return the text of each part as linked on a Cortex-M4F at -Os, and which exceed their limits."""
    _, _, objects = measure("cortex-m4f", command, "-Os")
    parts = linked.add_text(objects)
    findings = [
        f"cortex-m4f -Os: {part} as linked has {size} bytes of text, at most {limits.get(part, 0)}"
        for part, size in parts.items()
        if size > limits.get(part, 0)
    ]
    return "cortex-m4f -Os, as linked: " + ", ".join(f"{part} {size}" for part, size in parts.items()), findings


def main() -> None:
    findings, figures = [], []
    table = tomllib.loads(Path(__file__).with_name("sizes.toml").read_text())
    for name, command in gate.compilers().items():
        if name not in table:
            continue
        text, wrong, _ = measure(name, command, "-O2")
        findings += wrong
        for stem, size in text.items():
            limit = table[name].get(stem)
            if limit is None:
                findings.append(f"{name}: {stem}.o ({size} bytes) has no line in sizes.toml")
            elif size > limit:
                findings.append(f"{name}: {stem}.o has {size} bytes of text, at most {limit}")
        figures.append(f"{name} -O2: {sum(text.values())} bytes of text in all")
        if name == "cortex-m4f":
            said, wrong = judge_parts(table["linked"], command)
            figures.append(said)
            findings += wrong
    gate.finish(findings, "; ".join(figures))


if __name__ == "__main__":
    main()
