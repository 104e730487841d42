"""Gate: no function takes more than 256 bytes of stack, and on a Cortex-M4F no chain of calls does.

An estimator is started and announced once, before control begins, and is judged before anything of it is written.
"""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

LIMIT = 256  # bytes
SET_UP = {"aeo_estimator_announce": 352, "aeo_estimator_init": 288, "aeo_estimator_init_f64": 288}


def read_graph(directory: Path) -> tuple[dict[str, int], dict[str, set[str]]]:
    """Return the frame of each function and whom it calls, from the compiler's call graphs."""
    frames: dict[str, int] = {}
    calls: dict[str, set[str]] = {}
    for graph in directory.glob("*.ci"):
        text = graph.read_text()
        for title, label in re.findall(r'node: \{ title: "([^"]+)" label: "([^"]+)"', text):
            frame = re.search(r"(\d+) bytes \((\w+)", label)
            if frame:
                frames[title] = int(frame[1])
                if frame[2] != "static":
                    frames[title] = 10**6  # alloca or a variable-length array: no bound is known
        for caller, callee in re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', text):
            calls.setdefault(caller, set()).add(callee)
    return frames, calls


def find_limit(name: str) -> int:
    """Return the bytes that a function, as the compiler's graph calls it, may take."""
    return SET_UP.get(name.split(":")[-1], LIMIT)


def deepest(name: str, frames: dict[str, int], calls: dict[str, set[str]], above: tuple[str, ...] = ()) -> int:
    """Return the bytes of the deepest chain that starts here; a function that reaches itself has no bound."""
    if name in above:
        return 10**6
    below = (deepest(c, frames, calls, (*above, name)) for c in calls.get(name, ()) if c in frames)
    return frames[name] + max(below, default=0)


def main() -> None:
    findings, figures = [], []
    for name, command in gate.compilers().items():
        if name == "clang":  # writes no call graph
            continue
        for precision, flags in gate.PRECISIONS.items():
            if name == "cortex-m4f" and precision == "double":
                continue  # no double unit: nobody runs it there
            directory = gate.scratch()
            messages = gate.compile_sources(command, [*gate.LIBRARY, *flags], directory)
            if messages:
                gate.finish([messages], "")
            frames, calls = read_graph(directory)
            chains = {f: deepest(f, frames, calls) for f in frames}
            measured = chains if name == "cortex-m4f" else frames
            findings += [f"{name} {precision}: {f} takes {b} bytes" for f, b in measured.items() if b > find_limit(f)]
            findings += [f"{name} {precision}: {f} calls itself" for f, b in chains.items() if b >= 10**6]
            worst = max(chains, key=lambda f: chains[f])
            figures.append(f"{name} {precision}: deepest chain {chains[worst]} bytes from {worst.split(':')[-1]}")
    gate.finish(findings, "; ".join(figures))


if __name__ == "__main__":
    main()
