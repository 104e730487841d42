"""Write the C library as two files, aeolid.h and aeolid.c: python tools/amalgamate.py FOLDER.

The header is the public ones in the order in which they need one another, the source the internal headers and sources.
Names that a source keeps to itself (static functions, its types and enumerators) get its name in front, since several
sources have one of the same name, and its macros end with it. Both files compile as C99, C11 and C++11, and give the
same bits as the library.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
INCLUDE = re.compile(r'^#include [<"](?:aeolid/)?([\w.]+)[">].*\n', re.M)
LICENCE = "/* SPDX-License-Identifier: MIT */\n"
# What a name of a source's own looks like where it is made; a member behind a point or an arrow is another name.
FUNCTION = re.compile(r"^static (?:inline )?(?:const )?[\w ]+?\**\s?\**(\w+)(?:\(|\[|\s=)", re.M)
TYPE = re.compile(r"^(?:typedef [^;{]*?|\} )(\w+)(?:, (\w+))?;", re.M)
ENUM = re.compile(r"^(?:typedef )?enum \{(.*?)\}", re.M | re.S)
MACRO = re.compile(r"^#define (\w+)", re.M)


def find_names(text: str) -> set[str]:
    """Return the names at file scope that only this source knows."""
    names = set(FUNCTION.findall(text)) | {n for pair in TYPE.findall(text) for n in pair if n}
    for body in ENUM.findall(re.sub(r"/\*.*?\*/", "", text, flags=re.S)):
        names |= {part.split("=")[0].strip() for part in body.split(",") if part.strip()}
    return {name for name in names if not name.startswith(("aeo_", "AEO_"))}


def set_apart(text: str, stem: str) -> str:
    """Put the source's name in front of its own names, and end its macros behind it."""
    for name in sorted(find_names(text)):
        mine = f"{stem}_{name}" if name.islower() else f"{stem.upper()}_{name}"
        text = re.sub(rf"(?<![\w.])(?<!->){name}\b", mine, text)
    macros = sorted({name for name in MACRO.findall(text) if not name.startswith("AEO_")})
    return text + "".join(f"#undef {name}\n" for name in macros)


def sort_headers(folder: Path) -> list[Path]:
    """Return a folder's headers, each behind those it includes."""
    done: list[Path] = []

    def add(path: Path) -> None:
        for name in INCLUDE.findall(path.read_text(encoding="utf-8")):
            if (folder / name).is_file() and folder / name not in done:
                add(folder / name)
        if path not in done:
            done.append(path)

    for path in sorted(folder.glob("*.h")):
        add(path)
    return done


def strip(text: str, ours: set[str]) -> str:
    """Leave out includes of our own and the licence line, which stands once."""
    return INCLUDE.sub(lambda m: "" if m[1] in ours else m[0], text).replace(LICENCE, "")


def read_version() -> str:
    """Return major.minor.patch."""
    text = (ROOT / "include/aeolid/aeolid.h").read_text(encoding="utf-8")
    return ".".join(re.findall(r"#define AEO_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", text))


def write(folder: Path) -> None:
    """Write both files and the licence."""
    public, internal = sort_headers(ROOT / "include/aeolid"), sort_headers(ROOT / "src")
    ours = {path.name for path in public + internal}
    head = f"{LICENCE}/* aeolid {read_version()} in two files, made by tools/amalgamate.py: do not edit. */\n"
    header = [strip(path.read_text(encoding="utf-8"), ours) for path in public]
    source = [strip(path.read_text(encoding="utf-8"), ours) for path in internal]
    for path in sorted((ROOT / "src").glob("*.c")):
        source.append(set_apart(strip(path.read_text(encoding="utf-8"), ours), path.stem))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "aeolid.h").write_text("\n".join([head, *header]), encoding="utf-8")
    (folder / "aeolid.c").write_text("\n".join([head, '#include "aeolid.h"\n', *source]), encoding="utf-8")
    (folder / "LICENSE").write_text((ROOT / "LICENSE").read_text(encoding="utf-8"), encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python tools/amalgamate.py FOLDER")
    write(Path(sys.argv[1]))
