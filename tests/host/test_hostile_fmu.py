"""Functional mock-up units of others: not run unasked, run confined when asked, never unpacked beyond the bounds."""

from __future__ import annotations

import hashlib
import stat
import subprocess
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmu_build import CO_SIMULATION, DESCRIPTION, build_fmu

from aeolid.cli.main import main
from aeolid.diagnose.data.case import load_case
from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.models.exchange import fmu, fmu_unpack
from aeolid.models.exchange.fmu import open_fmu, run_fmu

LIBRARY = "binaries/linux64/a.so"
XML = DESCRIPTION.format(drive_unit="V", **CO_SIMULATION)
U = {"drive": np.ones(20)}
# What a library does as it is loaded: run a command, write a file, never end, take memory without end, crash.
DEEDS = {
    "command": 'system("id > {mark}");',
    "file": 'FILE *f = fopen("{mark}", "w"); if (f) fclose(f);',
    "loop": "for (volatile int i = 0; ; i = 1 - i) {{}}",
    "memory": "for (;;) {{ char *p = malloc(1 << 24); if (!p) abort(); memset(p, 1, 1 << 24); }}",
    "crash": "*(volatile int *)8 = 1;",
}


def evil(folder: Path, deed: str) -> Path:
    """Build a unit whose library does a deed when it is loaded; it has no function of the standard."""
    head = "".join(f"#include <{name}.h>\n" for name in ("stdio", "stdlib", "string"))
    body = DEEDS[deed].format(mark=folder / "mark")
    code = f"{head}__attribute__((constructor)) static void go(void) {{ {body} }}\n"
    (folder / "e.c").write_text(code)
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-o", str(folder / "e.so"), str(folder / "e.c")], check=True, timeout=3600
    )
    target = folder / "evil.fmu"
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("modelDescription.xml", XML)
        archive.write(folder / "e.so", "binaries/linux64/oscillator.so")
    return target


def with_entry(folder: Path, name: str, content: bytes, **info: int) -> Path:
    """Pack a unit with one more entry."""
    target = folder / "unit.fmu"
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", XML)
        archive.writestr("binaries/linux64/oscillator.so", b"\x7fELF")
        entry = zipfile.ZipInfo(name)
        entry.compress_type = info.get("compress", zipfile.ZIP_DEFLATED)
        entry.external_attr = info.get("mode", 0) << 16
        archive.writestr(entry, content)
    return target


def test_a_unit_is_not_run_unasked_and_its_name_and_hash_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    unit = evil(tmp_path, "command")
    (tmp_path / "roles.toml").write_text(
        '[recording]\nsample_time_s = 0.1\n[[channel]]\nname = "drive"\nunit = "V"\nrole = "input"\n'
        '[[channel]]\nname = "position"\nunit = "m"\nrole = "output"\n'
    )
    (tmp_path / "rec.csv").write_text("drive,position\n" + "1,2\n2,1\n" * 30)
    (tmp_path / "case.toml").write_text(
        '[recordings]\nfiles = ["rec.csv"]\nroles = "roles.toml"\n[baseline]\nkind = "fmu"\nfile = "evil.fmu"\n'
    )
    with pytest.raises(UsageError, match=hashlib.sha256(unit.read_bytes()).hexdigest()):
        load_case(tmp_path)
    assert main(["diagnose", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "evil.fmu" in said and "--allow-fmu" in said
    assert load_case(tmp_path, allow_fmu=True).kind == "fmu"  # looking at it runs nothing either
    assert not (tmp_path / "mark").exists()


@pytest.mark.parametrize("deed", DEEDS)
def test_a_unit_that_was_allowed_can_only_compute(deed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limits = replace(fmu.RUNNING, memory=600 << 20, cpu_s=3, patience_s=120.0)
    monkeypatch.setattr(fmu, "RUNNING", limits)
    with pytest.raises(NotIdentifiable, match=r"evil\.fmu: ") as refused:
        run_fmu(open_fmu(evil(tmp_path, deed)), U, ["position"], 0.1)
    assert not (tmp_path / "mark").exists() and "\n" not in str(refused.value)


def test_an_honest_unit_runs_under_the_limits_and_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "t"))
    (tmp_path / "t").mkdir()
    assert run_fmu(open_fmu(build_fmu(tmp_path)), U, ["position", "speed"], 0.02).shape == (20, 2)
    assert list((tmp_path / "t").iterdir()) == []


REFUSED: dict[str, tuple[Callable[[Path], Path], str]] = {
    "outside": (lambda d: with_entry(d, "resources/../../../out.txt", b"x"), "outside of the unit"),
    "absolute": (lambda d: with_entry(d, "resources/../../" * 3 + "tmp/out.txt", b"x"), "outside of the unit"),
    "link": (lambda d: with_entry(d, "resources/l", b"/etc/passwd", mode=stat.S_IFLNK | 0o777), "is a link"),
    "backslash": (lambda d: with_entry(d, "resources/..\\..\\out.txt", b"x"), "outside of the unit"),
    "another packing": (lambda d: with_entry(d, "resources/a", b"x" * 99, compress=zipfile.ZIP_LZMA), "deflated"),
    "a bomb": (lambda d: with_entry(d, "resources/zeros", bytes(9 << 20)), "unpacks to 9 MiB"),
    "a bomb of a description": (lambda d: lying(d, 17 << 20), "more than the 16777216 allowed"),
    "many files": (lambda d: many(d, 210), "212 files"),
    "many entries": (lambda d: many(d, 2_000, "sources/"), "2002 entries"),
    "sources only": (lambda d: packed(d, {"modelDescription.xml": XML, "sources/a.c": ""}), "C sources only"),
    "no description": (lambda d: packed(d, {"binaries/linux64/a.so": ""}), "holds no modelDescription"),
    "no XML": (lambda d: packed(d, {"modelDescription.xml": "<a", LIBRARY: ""}), "not a functional"),
    "entities": (lambda d: packed(d, {"modelDescription.xml": LAUGHS, LIBRARY: ""}), "not a functional"),
    "a folder": (lambda d: d, "folder"),
}  # fmt: skip
LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "ha">'
    + "".join(f'<!ENTITY {c} "{f"&{b};" * 10}">' for b, c in zip("abcdefghij", "bcdefghijk", strict=True))
    + ']><fmiModelDescription fmiVersion="2.0" modelName="&k;"/>'
)


def packed(folder: Path, content: dict[str, str]) -> Path:
    with zipfile.ZipFile(folder / "unit.fmu", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in content.items():
            archive.writestr(name, text)
    return folder / "unit.fmu"


def lying(folder: Path, size: int) -> Path:
    return packed(folder, {"modelDescription.xml": " " * size, "binaries/linux64/a.so": ""})


def many(folder: Path, count: int, below: str = "resources/") -> Path:
    more = {f"{below}{i}": "" for i in range(count)}
    return packed(folder, {"modelDescription.xml": XML, "binaries/linux64/a.so": ""} | more)


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_honest_unit_is_refused_before_it_is_written(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make, reason = REFUSED[case]
    unit = make(tmp_path)
    written: list[int] = []
    copy = fmu_unpack._copy

    def counted(path: Path, source: object, file: object, left: int) -> int:
        after = copy(path, source, file, left)  # type: ignore[arg-type]
        written.append(left - after)
        return after

    monkeypatch.setattr(fmu_unpack, "_copy", counted)
    for bound in ("MOST_BYTES", "MOST_FILES", "_MOST_ENTRIES"):  # smaller, for the sake of this test's time
        monkeypatch.setattr(fmu_unpack, bound, getattr(fmu_unpack, bound) // (32 if bound == "MOST_BYTES" else 10))
    with pytest.raises(DataError, match=reason) as refused:
        open_fmu(unit)
    assert str(refused.value).startswith(str(unit)) and len(str(refused.value)) < 400
    assert sum(written) < 1 << 20 and not (tmp_path.parent / "out.txt").exists()


def test_a_directory_that_lies_about_a_size_does_not_get_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu_unpack, "MOST_BYTES", 4096)
    monkeypatch.setattr(fmu_unpack, "_wanted", lambda path, archive: archive.infolist())
    with pytest.raises(DataError, match="more than it says"):
        fmu_unpack.unpack(with_entry(tmp_path, "resources/a", bytes(9000)), tmp_path / "to")
