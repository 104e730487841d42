"""Turn the plain text of comments and docstrings into reStructuredText that says the same."""

from __future__ import annotations

import re
import textwrap

NAMES = re.compile(r"`([^`]+)`|\b((?:AEO|aeo)_\w+)")
SPECIAL = re.compile(r"([\\*|_`])")


def to_rst(text: str) -> list[str]:
    """Return lines of markup: paragraphs stay prose, indented lines (matrices, code) stay as they are written."""
    lines: list[str] = []
    for block in re.split(r"\n\s*\n", textwrap.dedent(text).strip("\n")):
        for literal, part in _runs(block.splitlines()):
            if literal:
                lines += ["::", "", *textwrap.indent(textwrap.dedent("\n".join(part)), "   ").splitlines(), ""]
            else:
                lines += [inline(" ".join(line.strip() for line in part)), ""]
    return lines


def inline(text: str) -> str:
    """Return one paragraph: names in backquotes and names of the C library as literals, all else as it is."""
    parts, end = [], 0
    for match in NAMES.finditer(text):
        parts.append(SPECIAL.sub(r"\\\1", text[end : match.start()]))
        name = (match[1] or match[2]).strip()
        parts.append(f"\\ ``{name}``\\ ")
        end = match.end()
    result = "".join([*parts, SPECIAL.sub(r"\\\1", text[end:])]).strip()
    result = result.removeprefix("\\ ")
    # a line that begins like a list, a title or a comment is none
    return "\\" + result if re.match(r"([-+•]|\.\.|::|\(?\w{1,3}[.)])(\s|$)|[=~^\"'#:-]{3,}", result) else result


def _runs(lines: list[str]) -> list[tuple[bool, list[str]]]:
    """Group a block's lines: literal where indented by two or more, prose elsewhere."""
    runs: list[tuple[bool, list[str]]] = []
    for line in lines:
        literal = line.startswith("  ")
        if runs and runs[-1][0] == literal:
            runs[-1][1].append(line)
        else:
            runs.append((literal, [line]))
    return runs
