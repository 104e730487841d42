"""Gate: instructions, memory, text and stack of every filter are those of the committed table, which a page shows.

python costs.py ROOT checks, with the word board only what the board counts; python costs.py ROOT --write measures anew
and writes costs.toml and the page's table.
Instructions of one update with 4 outputs: on a Cortex-M4F board in QEMU, where SysTick counts them, and on this PC in
callgrind; both are deterministic: 2 % is for the compiler's libraries, and another version of it may differ by 20 %.
Exit code 77 when a tool is missing, with its name.
"""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate
import linked
import stack
import targets

TABLE = Path(__file__).with_name("costs.toml")
PAGE = gate.ROOT / "docs/results/costs.md"
BEGIN, END = "<!-- costs: written by tests/gates/costs.py -->\n", "<!-- costs end -->\n"
TOOLS = ("arm-none-eabi-gcc", "qemu-system-arm", "valgrind")
SAME, OTHER = 0.02, 0.20  # share by which a count may differ, with this and with another version of the compiler
SPEED = {"rls": {44: 20_000, 124: 140_000}}  # instructions on a Cortex-M4F that the design allows


def versions() -> dict[str, str]:
    """Return the versions of the compilers that count."""
    commands = {"gcc": "gcc", "cortex_m4f": "arm-none-eabi-gcc"}
    return {name: gate.output(command, "-dumpfullversion").strip() for name, command in commands.items()}


def count_on_board(directory: Path) -> list[tuple[str, int, int, int]]:
    """Return filter, n, words and instructions an update, from the board."""
    target, path = targets.TARGETS["cortex-m4f"], directory / "board"
    messages = targets.build(target, "costs.c", "float", path)
    if messages:
        gate.finish([messages], "")
    code, lines = targets.run(target, path)
    if code or not lines:
        gate.finish([f"cortex-m4f: exit code {code}, {' '.join(lines)[:300]}"], "")
    rows = [line.split() for line in lines]
    return [(name, int(n), int(words), int(count)) for name, n, words, count in rows]


def count_on_pc(rows: int, directory: Path) -> list[int]:
    """Return the instructions of an update for each row of the board's table, from callgrind."""
    target, path = targets.TARGETS["pc"], directory / "pc"
    messages = targets.build(target, "costs.c", "float", path, "-DCOSTS_ON_PC")
    if messages:
        gate.finish([messages], "")
    counts = []
    for row in range(rows):
        command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--toggle-collect=measure_update"]
        command += [str(path), str(row // 2), str(row % 2)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        collected = re.search(r"Collected : (\d+)", done.stderr)
        updates = re.search(r"MEASURED = (\d+)", (targets.FIRMWARE / "costs.c").read_text())
        counts.append(int(collected[1]) // int(updates[1]) if collected and updates else 0)
    return counts


def read_text_and_stack(directory: Path) -> tuple[dict[str, int], dict[str, int]]:
    """Return by filter, on a Cortex-M4F: text as linked, and deepest chain of calls of an update."""
    folder = directory / "objects"
    flags = gate.LIBRARY
    messages = gate.compile_sources(gate.compilers()["cortex-m4f"], flags, folder)
    if messages:
        gate.finish([messages], "")
    objects = sorted(folder.glob("*.o"))
    frames, calls = stack.read_graph(folder)
    deepest = {
        name: stack.deepest(f"aeo_{name}_update", frames, calls)
        for name in linked.PARTS
        if f"aeo_{name}_update" in frames
    }
    return linked.add_text(objects), deepest


def measure(pc: bool) -> dict[str, dict[str, int]]:
    """Return the table: a section a filter and size."""
    directory = gate.scratch()
    rows = count_on_board(directory)
    counts = count_on_pc(len(rows), directory) if pc else [0] * len(rows)
    text, deepest = read_text_and_stack(directory)
    return {
        f"{name}_{n}": {
            "n": n,
            "words": words,
            "cortex_m4f": board,
            **({"pc": count} if pc else {}),
            "text": text.get(f"{name}_with_saving", text.get(name, 0)),
            "stack": deepest.get(name, 0),
        }
        for (name, n, words, board), count in zip(rows, counts, strict=True)
    }


def write_page_table(table: dict[str, dict[str, int]]) -> str:
    """Return the page's table."""
    lines = [
        "| float, 4 outputs | RAM | instructions an update, Cortex-M4F | x86-64 | text | stack |",
        "|---|---|---|---|---|---|",
    ]
    for section, row in table.items():
        name = section.rsplit("_", 1)[0]
        lines.append(
            f"| `{name}`, n = {row['n']} | {row['words']:,} words, {4 * row['words'] / 1000:.1f} kB "
            f"| {row['cortex_m4f']:,} | {row['pc']:,} | {row['text']:,} B | {row['stack']} B |"
        )
    return "\n".join(lines) + "\n"


def compare(table: dict[str, dict[str, int]], committed: dict[str, dict[str, int]], same: bool) -> list[str]:
    """Return where measurement and committed table differ."""
    findings = [f"{section} has no section in costs.toml" for section in table if section not in committed]
    findings += [
        f"costs.toml tells of {section}, which does not exist" for section in committed if section not in table
    ]
    for section, row in table.items():
        for key, value in row.items():
            told = committed.get(section, {}).get(key, value)
            exact = key in ("n", "words")
            share = 0.0 if exact else SAME if same else OTHER
            if abs(value - told) > share * told:
                findings.append(f"{section}: {key} is {value}, costs.toml says {told}")
        name, _, n = section.rpartition("_")
        limit = SPEED.get(name, {}).get(int(n))
        if limit and row["cortex_m4f"] > limit:
            findings.append(f"{section}: {row['cortex_m4f']} instructions on a Cortex-M4F, the design allows {limit}")
    return findings


def write(table: dict[str, dict[str, int]]) -> None:
    """Write costs.toml and the page's table."""
    lines = [
        "# Written by costs.py ROOT --write, checked by costs.py. Float, 4 outputs, -O2 -ffp-contract=off, forgetting",
        "# 0.999. Instructions of one update. Cortex-M4F, in bytes: text, as linked, of the filter with saving and the",
        "# regressor; stack: the deepest chain of calls of an update.",
    ]
    lines += ["[compilers]", *(f'{name} = "{version}"' for name, version in versions().items())]
    for section, row in table.items():
        lines += ["", f"[{section}]", *(f"{key} = {value}" for key, value in row.items())]
    TABLE.write_text("\n".join(lines) + "\n")
    text = PAGE.read_text()
    if BEGIN in text:
        head, rest = text.split(BEGIN)
        PAGE.write_text(head + BEGIN + write_page_table(table) + END + rest.split(END)[1])


def main() -> None:
    for tool in TOOLS:
        if shutil.which(tool) is None:
            print(f"skipped: {tool} is not installed")
            sys.exit(77)
    board_alone = "board" in sys.argv
    committed = tomllib.loads(TABLE.read_text())
    same = committed.pop("compilers") == versions()
    if "--write" in sys.argv:
        write(measure(True))
        return
    findings = []
    if PAGE.exists() and BEGIN + write_page_table(committed) + END not in PAGE.read_text():
        findings.append("the table of docs/results/costs.md is not that of costs.toml; run costs.py . --write")
        gate.finish(findings, "")
    table = measure(not board_alone)
    findings = compare(table, committed, same)
    here = {} if board_alone else {section: f", {row['pc']} here" for section, row in table.items()}
    figures = [
        f"{section}: {row['cortex_m4f']} on a Cortex-M4F{here.get(section, '')}" for section, row in table.items()
    ]
    gate.finish(findings, "; ".join(figures))


if __name__ == "__main__":
    main()
