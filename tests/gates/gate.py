"""What the gates share: where the sources are, how to compile them, how to end.

Every gate is called as `python NAME.py [ROOT]`; ROOT holds src/ and include/, by default this repository. It ends with
exit code 0 and one line of figures, or with 1 and a line for each finding. The environment variable AEOLID_GATE_OBJECTS
names a folder where objects stay: each is made once for the same command and text, for all gates and seeded defects.
"""

import contextlib
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[2]).resolve()
SOURCES = sorted((ROOT / "src").glob("*.c"))
HEADERS = sorted((ROOT / "include/aeolid").glob("*.h"))
WARNINGS = [
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wsign-conversion",
    "-Wdouble-promotion",
    "-Wfloat-equal",
    "-Wundef",
    "-Wswitch-enum",
    "-Wcast-align",
    "-Wmissing-declarations",
    "-Wshadow",
    "-Werror",
]
PRECISIONS: dict[str, list[str]] = {"float": [], "double": ["-DAEO_REAL_DOUBLE"]}
# What symbols, memory, stack and size look at, with the flags of CMakeLists.txt; the last two write files.
LIBRARY = ["-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fstack-usage", "-fcallgraph-info=su"]
CORTEX_M4F = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-ffunction-sections"]


def compilers() -> dict[str, list[str]]:
    """List the compilers present, with what they always need: gcc, clang, and one for a Cortex-M4F."""
    known = {"gcc": ["gcc"], "clang": ["clang"], "cortex-m4f": ["arm-none-eabi-gcc", *CORTEX_M4F]}
    found = {name: command for name, command in known.items() if shutil.which(command[0])}
    # a cross compiler without its C library has no <string.h> and is of no use here
    if "cortex-m4f" in found and try_compile(found["cortex-m4f"], "#include <string.h>\n#include <math.h>\n"):
        del found["cortex-m4f"]
    return found


def try_compile(command: list[str], text: str) -> str:
    """Compile a piece of C; returns the messages, empty when it compiled."""
    done = subprocess.run(
        [*command, "-x", "c", "-fsyntax-only", "-"], input=text, capture_output=True, text=True, check=False
    )
    return "" if done.returncode == 0 else done.stderr


def compile_sources(command: list[str], flags: list[str], directory: Path) -> str:
    """Compile every source into `directory`; returns the messages, empty when all compiled."""
    return compile_each(command, flags, [ROOT / "include", ROOT / "src"], SOURCES, directory)


def compile_each(
    command: list[str], flags: list[str], include: list[Path], sources: list[Path], directory: Path
) -> str:
    """Compile sources, with folders of headers, into `directory`; returns the messages, empty when all compiled."""
    directory.mkdir(parents=True, exist_ok=True)
    kept = Path(os.environ.get("AEOLID_GATE_OBJECTS") or scratch())
    words = [*command, *flags, "-c"]
    messages = ""
    for source in sources:
        place = kept / f"{source.stem}-{digest(source, words, include)}"
        if not place.exists():
            messages += _compile([*words, *(f"-I{folder}" for folder in include), str(source)], place)
        if place.exists():
            shutil.copytree(place, directory, dirs_exist_ok=True)
    return messages


def digest(source: Path, words: list[str], include: list[Path]) -> str:
    """Return a hash of all that an object depends on: words of the command, the source, and the headers it includes."""
    config = [name for word in words for name in re.findall(r'AEO_CONFIG_HEADER="(.+)"', word)]
    texts, wanted, seen = [" ".join(words), source.name], [source.name, *config], set[str]()
    while wanted:
        name = wanted.pop()
        if name not in seen:
            seen.add(name)
            places = [source.parent / name, *(folder / name for folder in include)]
            text = next((path.read_text(encoding="utf-8") for path in places if path.is_file()), "")
            texts.append(text)
            wanted += re.findall(r'^\s*#\s*include\s+["<]([^">]+)[">]', text, re.M)
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:24]


def _compile(command: list[str], place: Path) -> str:
    """Compile one source into a folder of its own, which appears whole; another gate may be at the same."""
    place.parent.mkdir(parents=True, exist_ok=True)
    making = Path(tempfile.mkdtemp(dir=place.parent))
    done = subprocess.run(command, cwd=making, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        with contextlib.suppress(OSError):
            making.rename(place)
    shutil.rmtree(making, ignore_errors=True)
    return "" if done.returncode == 0 else done.stderr or "compiler failed"


def output(*command: object) -> str:
    """Return what a command prints."""
    return subprocess.run([str(c) for c in command], capture_output=True, text=True, check=True).stdout


def scratch() -> Path:
    """Return a new directory under the system's temporary one; `finish` removes it."""
    path = Path(tempfile.mkdtemp(prefix="aeolid-gate-"))
    _scratch.append(path)
    return path


_scratch: list[Path] = []


def finish(findings: list[str], good: str) -> None:
    """End the gate: print the findings and fail, or print the figures and succeed."""
    for path in _scratch:
        shutil.rmtree(path, ignore_errors=True)
    if not SOURCES or not HEADERS:
        findings = [f"{ROOT} holds no sources", *findings]
    print("\n".join(findings) if findings else good)
    sys.exit(1 if findings else 0)
