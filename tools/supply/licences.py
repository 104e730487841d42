"""Write docs/reference/licences.md: the licence of every package that tools/constraints.txt names.

python tools/supply/licences.py          write the page
python tools/supply/licences.py --check  compare it and say what differs, exit code 1

It reads the metadata of the packages installed in .venv (sh tools/setup tests). A package whose licence it cannot tell,
or does not know, ends it with a sentence: a person decides, and writes the decision into this file.
"""

from __future__ import annotations

import re
import sys
from importlib import metadata
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from lock import ROOT, read_lock

PAGE = ROOT / "docs/reference/licences.md"
# What a licence's name in metadata is as an SPDX expression, where the metadata has no expression of their own.
NAMES = {
    "Apache License": "Apache-2.0",
    "Apache License 2.0": "Apache-2.0",
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD-3-Clause",
    "ISC License (ISCL)": "ISC",
    "LGPLv3+": "LGPL-3.0-or-later",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
    "BSD": "BSD-3-Clause",
    "BSD 3-Clause License": "BSD-3-Clause",
    "Apache 2.0": "Apache-2.0",
}
# Read by hand in the package, where its metadata says too little, too much or nothing.
READ = {
    "docutils": "BSD-2-Clause AND LicenseRef-public-domain",
    "fmpy": "BSD-2-Clause",
    "cmake": "BSD-3-Clause",
    "pyserial": "BSD-3-Clause",
}
PERMISSIVE = {
    "0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "BSL-1.0", "CC0-1.0", "HPND", "ISC", "LLVM-exception",
    "LicenseRef-public-domain", "MIT", "MIT-0", "MIT-CMU", "PSF-2.0", "Python-2.0", "Unlicense", "Zlib",
}  # fmt: skip
LESSER = (
    "used as a separate, unmodified package that a user can replace, so nothing follows for your own code; "
    "who passes it on gives its licence and its source along"
)
# Licences with conditions on passing on, and what follows for this repository and for who passes it on.
COPYLEFT = {
    "LGPL-3.0-only": LESSER,
    "LGPL-3.0-or-later": LESSER,
    "MPL-2.0": "changed files of the package itself stay under it; nothing follows for your own code",
}
NEEDED = {"pip": "set-up", "build": "build", "cmake": "build", "ninja": "build", "demo": "use", "docs": "pages",
          "tests": "tests"}  # fmt: skip
HEAD = """# Licences

aeolid itself is under the MIT licence (`LICENSE`). The C library needs nothing but a C compiler's own library, so
firmware that links it takes on the MIT licence alone. The Python tool stands on the packages below, none of which
this repository contains: pip fetches them from the package index. Written by
`.venv/bin/python tools/supply/licences.py` from the metadata of the packages that `tools/constraints.txt` names; a
test compares. It is a list, and no legal advice.

## With conditions on passing on

{copyleft}

Some packages carry libraries inside: numpy's and scipy's wheels OpenBLAS (BSD-3-Clause) with GCC's libgfortran
(GPL-3.0 with the runtime library exception) and libquadmath (LGPL-2.1), llvmlite's LLVM (Apache-2.0 WITH
LLVM-exception), pyarrow's Apache Arrow (Apache-2.0), plotly's plotly.js (MIT), pillow's and lxml's image and XML
libraries; their licence texts are in the packages. fmpy runs simulators that you bring, under their own licences.

## All

*Needed for*: use (the tool), build (the package), pages (`sh tools/docs`), tests (`sh tests/run`), set-up.

| package | version | licence | needed for |
| --- | --- | --- | --- |
"""


def licence_of(name: str) -> str:
    """Return the SPDX expression of an installed package, '' where its metadata tells none that we know."""
    if name in READ:
        return READ[name]
    told = metadata.metadata(name)
    expression = told.get("License-Expression")
    if expression:
        return str(expression)
    classified = [c.split(" :: ")[-1] for c in told.get_all("Classifier", []) if c.startswith("License ::")]
    short = (told.get("License") or "").split("\n")[0].strip()
    if short in PERMISSIVE | set(COPYLEFT):
        return short
    names = sorted({NAMES.get(text, "") for text in [*classified, short] if text and text in NAMES})
    return " AND ".join(names)


def parts(expression: str) -> set[str]:
    """Split an SPDX expression into the licences that it names."""
    return {word for word in re.findall(r"[\w.+-]+", expression) if word not in ("AND", "OR", "WITH")}


def table() -> list[tuple[str, str, str, str]]:
    """Return name, version, licence and purpose of every package of the lock; ninja may be the system's."""
    rows = []
    for name, (version, _, group) in sorted(read_lock().items()):
        try:
            licence = licence_of(name)
        except metadata.PackageNotFoundError:
            licence = {"ninja": "Apache-2.0"}.get(name, "")
        unknown = parts(licence) - PERMISSIVE - set(COPYLEFT)
        if not licence or unknown:
            told = ", ".join(sorted(unknown)) or "nothing we can read"
            raise SystemExit(f"{name} {version}: the licence is {told}; read it and put it into {Path(__file__).name}")
        rows.append((name, version, licence, NEEDED[group]))
    return rows


def page() -> str:
    """Return the page's text."""
    rows = table()
    lines = []
    for name, version, licence, needed in rows:
        lines += [f"- **{name}** {version} ({licence}, for {needed}): {COPYLEFT[part]}."
                  for part in sorted(parts(licence) & set(COPYLEFT))]  # fmt: skip
    return HEAD.format(copyleft="\n".join(lines)) + "".join(f"| {' | '.join(row)} |\n" for row in rows)


def main(check: bool) -> int:
    """Write the page, or compare it."""
    text = page()
    if check:
        there = PAGE.read_text(encoding="utf-8").splitlines() if PAGE.exists() else []
        differing = sorted(set(text.splitlines()) ^ set(there))
        if differing:
            print("\n".join([f"{PAGE.relative_to(ROOT)} differs; run tools/supply/licences.py:", *differing]))
        return int(bool(differing))
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
