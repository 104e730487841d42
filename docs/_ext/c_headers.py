"""Show a C header as its manual: `c-header` reads it with libclang, comments as they are written."""

from __future__ import annotations

import re
import shutil
import subprocess
import textwrap
from functools import lru_cache
from pathlib import Path

import clang.cindex as clang
from docutils import nodes
from prose import inline, to_rst
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

INCLUDE = Path(__file__).resolve().parents[2] / "include"
KIND = clang.CursorKind


class Header:
    """Hold one parsed header."""

    def __init__(self, name: str) -> None:
        self.path = INCLUDE / "aeolid" / name
        self.lines = self.path.read_text(encoding="utf-8").splitlines()
        options = ["-x", "c", "-std=c99", "-fparse-all-comments", f"-I{INCLUDE}", *builtin_headers()]
        unit = clang.Index.create().parse(
            str(self.path), options, options=clang.TranslationUnit.PARSE_DETAILED_PROCESSING_RECORD
        )
        faults = [d.spelling for d in unit.diagnostics if d.severity >= clang.Diagnostic.Error]
        if faults:
            raise RuntimeError(f"{self.path}: {faults[0]}")
        self.cursors = [
            c for c in unit.cursor.get_children() if c.location.file and c.location.file.name == str(self.path)
        ]
        # The declarations come in the order of the file; macros, which libclang lists first, take their place there.
        self.cursors.sort(key=lambda c: c.extent.start.offset)
        comments = [t for t in unit.get_tokens(extent=unit.cursor.extent) if t.kind == clang.TokenKind.COMMENT]
        self.before = {t.extent.end.line: t for t in comments if self.lines[t.extent.start.line - 1].startswith("/*")}
        self.behind = {
            t.extent.start.line: t for t in comments if not self.lines[t.extent.start.line - 1].startswith("/*")
        }
        self.top = body(comments[0].spelling)

    def text(self, cursor: clang.Cursor) -> str:
        """Return a declaration as it is written, on one line."""
        start, end = cursor.extent.start, cursor.extent.end
        lines = self.lines[start.line - 1 : end.line]
        lines[-1] = lines[-1][: end.column - 1]
        lines[0] = lines[0][start.column - 1 :]
        return " ".join(re.sub(r"/\*.*?\*/", "", " ".join(lines).replace("\\", " ")).split())

    def field(self, cursor: clang.Cursor) -> str:
        """Return a member with its type, also where several share a line: `uint16_t a, b`."""
        text = self.text(cursor)
        if "(" in text or "," not in text:
            return text
        return f"{text.split(',')[0].rsplit(None, 1)[0]} {text.rsplit(',', 1)[1].strip()}"

    def macro_comment(self, cursor: clang.Cursor) -> str:
        """Return the comment on a macro: behind it, or above it or above the macros it follows without a gap."""
        line = cursor.extent.start.line
        if line in self.behind:
            return body(self.behind[line].spelling)
        found = self.before.get(line - 1)
        return body(found.spelling) if found else ""


@lru_cache(maxsize=1)
def builtin_headers() -> list[str]:
    """Return where the compiler at hand keeps stddef.h, which libclang's wheel does not bring."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise RuntimeError("a C compiler is needed for its stddef.h; install gcc")
    found = subprocess.run([compiler, "-print-file-name=include"], capture_output=True, text=True, check=True)
    return ["-isystem", found.stdout.strip()]


def body(comment: str) -> str:
    """Return a comment's text without its marks."""
    text = comment.removeprefix("/*").removesuffix("*/").strip("\n ")
    first, *rest = text.split("\n")
    return "\n".join([first, *(re.sub(r"^\s*\* ?", "", line) if line.lstrip().startswith("*") else line.strip()
                               for line in rest)])  # fmt: skip


def describe_top(header: Header) -> list[str]:
    """Return the first comment: its sentence as prose, its sections as written."""
    parts = re.split(r"^([A-Z]{4,}[A-Z ]*)$", header.top, flags=re.M)
    sentence = parts[0].partition(": ")[2].replace("\n", " ").strip()
    lines = [*to_rst(sentence[:1].upper() + sentence[1:]), ""]
    for title, text in zip(parts[1::2], parts[2::2], strict=True):
        literal = textwrap.indent(textwrap.dedent(text.strip("\n")), "   ").splitlines()
        lines += [f".. rubric:: {title.strip().capitalize()}", "", ".. code-block:: none", "", *literal, ""]
    return lines


def describe(header: Header, cursor: clang.Cursor, done: set[str]) -> list[str]:
    """Return the markup of one declaration; empty for what is no part of the interface."""
    name = cursor.spelling
    if cursor.kind == KIND.MACRO_DEFINITION:
        return describe_macro(header, cursor)
    if name in done:
        return []
    comment = body(cursor.raw_comment or "")
    if cursor.kind == KIND.FUNCTION_DECL:
        return entry("function", header.text(cursor).split("{")[0].strip(), comment)
    if cursor.kind in (KIND.STRUCT_DECL, KIND.ENUM_DECL):
        done.add(name)
        return describe_members(header, cursor, comment)
    if cursor.kind == KIND.TYPEDEF_DECL and "{" not in header.text(cursor):
        return entry("type", header.text(cursor).removeprefix("typedef "), comment)
    return []


def describe_members(header: Header, cursor: clang.Cursor, comment: str) -> list[str]:
    """Return the markup of a structure or an enumeration."""
    struct = cursor.kind == KIND.STRUCT_DECL
    name = f"@{header.path.stem}_codes" if cursor.is_anonymous() or "unnamed" in cursor.spelling else cursor.spelling
    lines = entry("struct" if struct else "enum", name, comment)
    for member in cursor.get_children():
        if member.kind in (KIND.FIELD_DECL, KIND.ENUM_CONSTANT_DECL):
            kind = "member" if struct else "enumerator"
            written = header.field(member) if struct else member.spelling
            text = body(member.raw_comment or "")
            if not struct:
                text = f"{member.enum_value}: {text}" if text else f"{member.enum_value}"
            lines += ["   " + line for line in entry(kind, written, " ".join(text.split()))]
    return lines


def describe_macro(header: Header, cursor: clang.Cursor) -> list[str]:
    """Return the markup of a macro; include guards and the names of the double build are no news."""
    text = header.text(cursor)
    name = cursor.spelling
    head = re.match(r"\w+(\([^)]*\))?", text)
    assert head is not None
    value = text[head.end() :].strip()
    if name.endswith("_H") or value == f"{name}_f64":
        return []
    lines = entry("macro", head[0], header.macro_comment(cursor))
    return [*lines, f"   ``{value}``", ""] if value else lines


def entry(kind: str, signature: str, comment: str) -> list[str]:
    """Return one object of the C domain with its text."""
    text = ["   " + line if line else "" for line in to_rst(comment)] if comment else []
    return [f".. c:{kind}:: {signature}", "", *text, ""]


class CHeader(SphinxDirective):
    """Show the header named in the argument."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the header's text and declarations."""
        header = Header(self.arguments[0])
        self.env.note_dependency(str(header.path))
        lines, done = describe_top(header), set[str]()
        lines += [".. rubric:: Declarations", ""]
        for cursor in header.cursors:
            lines += describe(header, cursor, done)
        return self.parse_text_to_nodes("\n".join(lines))


class CHeaders(SphinxDirective):
    """List all headers with their sentences."""

    def run(self) -> list[nodes.Node]:
        """Return a table."""
        rows = [".. list-table::", "   :widths: 20 80", ""]
        for path in sorted((INCLUDE / "aeolid").glob("*.h")):
            sentence = body(path.read_text(encoding="utf-8").partition("*/")[0]).partition("\n\n")[0]
            text = " ".join(sentence.partition(": ")[2].split())
            rows += [f"   * - :doc:`{path.name} </reference/c/{path.stem}>`", f"     - {inline(text)}"]
        return self.parse_text_to_nodes("\n".join(rows))


def write_pages(app: Sphinx) -> None:
    """Write a page for each header into the sources; they are made, not kept."""
    folder = Path(app.srcdir) / "reference" / "c"
    folder.mkdir(parents=True, exist_ok=True)
    wanted = {path.stem: f"{path.name}\n{'=' * len(path.name)}\n\n.. c-header:: {path.name}\n"
              for path in (INCLUDE / "aeolid").glob("*.h")}  # fmt: skip
    for old in folder.glob("*.rst"):
        if old.stem not in wanted:
            old.unlink()
    for stem, text in wanted.items():
        page = folder / f"{stem}.rst"
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("c-header", CHeader)
    app.add_directive("c-headers", CHeaders)
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}
