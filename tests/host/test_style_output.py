"""No module but those of aeolid.output opens a file for writing, makes a folder or renames anything."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "tools" / "src" / "aeolid"
MODULES = [p for p in sorted(PACKAGE.rglob("*.py")) if p.parent.name != "output"]
NEVER = {"write_text", "savefig", "write_bytes", "tofile", "savetxt", "to_csv", "to_parquet", "touch", "mkdir",
         "makedirs", "copyfile", "copytree", "copy2", "rename", "mknod", "symlink_to", "hardlink_to",
         "print_figure", "print_png", "print_pdf"}  # fmt: skip
TO_A_HANDLE = {"savez": 0, "savez_compressed": 0, "save": 0, "savemat": 0, "write_table": 1, "ParquetWriter": 0}
SUSPECT = {*NEVER, *TO_A_HANDLE, "open", "dump", "replace", "link", "symlink", "move", "copy"}
HANDLES = {"handle", "target", "packed", "self._file", "self._target"}  # what `replacing` gives, or a SpareFile
OURS = ("output.", "formats.")
# (module, call): why it may stand there
ALLOWED = {
    ("formats/growing.py", "os.replace"): "out of a private folder over a file that `create` has made",
    ("can/raw_mf4.py", "os.replace"): "out of a private folder over a file that `create` has made",
    ("formats/growing.py", "self._mdf.save"): "into a private folder",
    ("can/raw_mf4.py", "self._mdf.save"): "into a private folder",
    ("formats/archive.py", "self._zip.open"): "reads",
    ("formats/tdms.py", "TdmsFile.open"): "reads",
    ("cli/diagnose_many.py", "where.open"): "opens a pool of workers",
    ("cli/fleet.py", "where.open"): "the same",
    ("cli/pictures.py", "figure.savefig"): "into memory, then through `output`",
    ("publish/target.py", "opener.open"): "asks a server",
    ("models/exchange/fmu_write.py", "target.write_bytes"): "for a compiler, into a folder that goes again",
    ("compiled.py", "path.mkdir"): "the cache of machine code, a private folder",
    ("confined/probe.py", "open"): "what a confined process must not be able to do",
    ("confined/probe.py", "os.rename"): "the same",
    ("confined/probe.py", "os.mkdir"): "the same",
    ("confined/probe.py", "os.symlink"): "the same",
    ("models/exchange/fmu_unpack.py", "target.parent.mkdir"): "within the private folder of a confined process",
    ("models/exchange/fmu_unpack.py", "archive.open"): "reads",
    ("models/exchange/fmu_unpack.py", "open"): "within the private folder of a confined process",
}  # fmt: skip


def writes(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield (line, call) of all that could make or change a file by its name."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        last = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if last not in SUSPECT:
            continue
        name = ast.unparse(node.func)
        if last == "open":
            mode = next((k.value for k in node.keywords if k.arg == "mode"), None)
            if mode is None:  # open(path, mode), path.open(mode), gzip.open(path, mode)
                at = 0 if name.count(".") and not name.startswith(("gzip.", "io.", "bz2.", "lzma.", "os.")) else 1
                mode = node.args[at] if len(node.args) > at else ast.Constant("r")
            told = mode.value if isinstance(mode, ast.Constant) else None
            if node.args and ast.unparse(node.args[0]) == "os.devnull":
                continue
            if name == "os.open" and "O_RDONLY" in (flags := ast.unparse(mode)) and "O_CREAT" not in flags:
                continue
            if name == "os.open" or not isinstance(told, str) or set(told) & set("wax+"):
                yield node.lineno, name
        elif name.startswith(OURS) or name == "write_table":
            continue
        elif (last in NEVER and name.count(".")) or name in (
            "json.dump",
            "os.replace",
            "os.link",
            "os.symlink",
            "shutil.move",
            "shutil.copy",
        ):
            yield node.lineno, name
        elif last in TO_A_HANDLE and name.count(".") + (last != "save") and not name.startswith("self._writer"):
            place = TO_A_HANDLE[last]
            if len(node.args) <= place or ast.unparse(node.args[place]) not in HANDLES:
                yield node.lineno, name


def test_files_are_written_by_one_module() -> None:
    found = {(str(p.relative_to(PACKAGE)), n, call) for p in MODULES for n, call in writes(ast.parse(p.read_bytes()))}
    wrong = sorted(f"{m}:{n}: {call}: use aeolid.output" for m, n, call in found if (m, call) not in ALLOWED)
    assert wrong == []
    assert set(ALLOWED) - {(m, call) for m, _, call in found} == set()  # no exception outlives its reason


@pytest.mark.parametrize(
    "line",
    ["open(p, 'w')", "open(p, mode='ab')", "open(p, 'r+b')", "open(p, mode)", "p.open('x')", "gzip.open(p, 'wb')",
     "p.write_text(t)", "q.parent.write_bytes(b)", "fig.savefig(p)", "np.savez(path, a=a)", "np.save('x.npy', a)",
     "numpy.savez_compressed(str(p))", "json.dump(d, f)", "os.replace(a, b)", "a.rename(b)", "os.open(p, f)",
     "os.open(p, os.O_RDONLY | os.O_CREAT)",
     "parquet.write_table(t, path)", "savemat(path, c)", "frame.to_csv(p)", "array.tofile(p)", "shutil.move(a, b)",
     "p.touch()", "p.mkdir()", "os.makedirs(p)", "parquet.ParquetWriter(path, s)"],
)  # fmt: skip
def test_the_walk_can_fail(line: str) -> None:
    assert len(list(writes(ast.parse(line)))) == 1
    for good in (
        "open(p, 'rb')",
        "open(p)",
        "p.open()",
        "np.savez(handle, a=a)",
        "json.dumps(d)",
        "gzip.open(p, 'rb')",
    ):
        assert list(writes(ast.parse(good))) == []
