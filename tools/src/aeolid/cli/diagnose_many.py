"""Diagnose many cases: one table of all, and a second run does what is new."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from aeolid.cli.common import console, progress_console
from aeolid.cli.diagnose_piece import FILES, Asked, diagnose_piece
from aeolid.cli.pools import Where
from aeolid.errors import AeolidError, DataError, UsageError
from aeolid.inputs import open_regular
from aeolid.output import declare, write_json, write_text
from aeolid.output.ledger import digest
from aeolid.text_files import MOST_JSON, load_json, load_toml
from aeolid.wording import counted, place, plain, plus_minus

TABLE, FACTS, CASE = "cases.csv", "cases.json", "case.toml"
_DONE = "done.json"  # in the folder of a case: what it was diagnosed from
COLUMNS = ("case", "verdict", "effect", "where", "value", "std", "unit", "gain", "low", "statement")

Diagnose = Callable[[Path, Path], dict[str, Any]]
Work = Callable[[Sequence[tuple[str, Path, Path]]], Iterator[tuple[int, Any]]]


def names_of(cases: Sequence[Path]) -> dict[str, Path]:
    """Return a name for each case, that of its folder; raises UsageError where two would be called the same."""
    named: dict[str, Path] = {}
    for case in cases:
        name = case.resolve().name
        if name in named and named[name].resolve() != case.resolve():
            raise UsageError(f"{case}: another case is called {name!r} too ({named[name]}); rename one of the folders")
        named[name] = case
    return named


def in_turn(diagnose: Diagnose) -> Work:
    """Return what diagnoses cases one after the other in this process."""

    def work(pieces: Sequence[tuple[str, Path, Path]]) -> Iterator[tuple[int, Any]]:
        for index, (_, case, folder) in enumerate(pieces):
            try:
                yield index, diagnose(case, folder)
            except AeolidError as error:
                yield index, error

    return work


def diagnose_many(
    cases: Mapping[str, Path], out: Path, settings: Mapping[str, Any], work: Work
) -> list[dict[str, Any]]:
    """Diagnose each case into a folder of its own in `out`; what was done from the same files is taken over.

    settings: what else an answer depends on; work: pieces (name, case, folder) to their diagnoses or exceptions, as
    they are done. A case that cannot be read has its sentence in the table and the others go on. The table is written
    after each case. Returns its rows, in the order of the cases.
    """
    rows: dict[str, dict[str, Any]] = {}
    keys: dict[str, str] = {}
    left: list[tuple[str, Path, Path]] = []

    def enter(name: str, found: Any) -> None:
        if isinstance(found, BaseException):
            empty: dict[str, Any] = dict.fromkeys(COLUMNS)
            told = str(found) if isinstance(found, AeolidError) else f"{type(found).__name__}: {found}"
            rows[name] = empty | {"case": name, "verdict": "not read", "statement": told, "fault": told}
        else:
            rows[name] = row_of(name, found) | {"fault": None}
        listed = [rows[n] for n in cases if n in rows]
        write_text(out / TABLE, csv_of(listed))
        write_json(out / FACTS, {"cases": listed})

    for name, case in cases.items():
        try:
            keys[name] = fingerprint(case, settings)
        except AeolidError as error:
            enter(name, error)
            continue
        if (known := _known(out / name, keys[name])) is not None:
            _tell(len(rows) + 1, cases, name, "as before")
            enter(name, known)
        else:
            left.append((name, case, out / name))
    for index, found in work(left):
        name = left[index][0]
        if not isinstance(found, BaseException):
            write_json(out / name / _DONE, {"key": keys[name]})
        _tell(len(rows) + 1, cases, name, "not read" if isinstance(found, BaseException) else "diagnosed")
        enter(name, found)
    return [rows[name] for name in cases]


def _tell(number: int, cases: Mapping[str, Path], name: str, what: str) -> None:
    progress_console.print(f"case {number} of {len(cases)}, {name}: {what}", markup=False, soft_wrap=True)


def settings_of(asked: Asked) -> dict[str, Any]:
    """Return what an answer depends on beside the files of its case."""
    from aeolid import __version__

    settings = asdict(asked) | {"version": __version__}
    return {k: v for k, v in settings.items() if v or k not in ("rules", "margins")}  # as before there were any


def written_by(cases: Mapping[str, Path]) -> list[str]:
    """Return the names of what a diagnosis of these cases writes."""
    return [TABLE, FACTS, *(f"{name}/{file}" for name in cases for file in FILES)]


def run_many(
    cases: Mapping[str, Path], out: Path, asked: Asked, where: Where, force: bool, json_target: str | None = None
) -> list[dict[str, Any]]:
    """Diagnose cases on the workers that the options name; returns the rows of their table."""
    inside = written_by(cases)
    files = {"--json": json_target}
    declare("diagnose", force=force, inputs=list(cases.values()), folders={"--out": out}, files=files, inside=inside)

    def work(pieces: Sequence[tuple[str, Path, Path]]) -> Iterator[tuple[int, Any]]:
        given = [(name, str(case.resolve())) for name, case, _ in pieces]
        with where.open(len(given)) as pool:
            yield from pool.run(diagnose_piece, given, asked, str(out.resolve()), inside, force)

    return diagnose_many(cases, out, settings_of(asked), work)


def fingerprint(case: Path, settings: Mapping[str, Any]) -> str:
    """Return the SHA-256 of the files in a case's folder, of those below it that it names, and the settings.

    In hexadecimal; a recording may consist of several files, or be a folder of them.
    Files that a case names elsewhere (--allow-outside) are not seen: their case is diagnosed anew where its own files
    change.
    """
    total = hashlib.sha256(json.dumps(dict(settings), sort_keys=True, default=str).encode())
    if not case.is_dir():
        raise DataError(f"{case}: no such folder")
    own = {p for p in case.iterdir() if p.is_file() and not p.name.startswith(".")}
    for path in sorted(own | _named_below(case)):
        with open_regular(path) as handle:
            total.update(f"{path.relative_to(case).as_posix()}\0{digest(handle)}\n".encode())
    return total.hexdigest()


def _named_below(case: Path) -> set[Path]:
    """Return the files in folders below a case's own that its case.toml names; none where that cannot be read."""
    from aeolid.formats.recording import files_of

    try:
        tables = [table for table in load_toml(case / CASE).values() if isinstance(table, dict)]
    except AeolidError:
        return set()  # the diagnosis says what is wrong
    given = [t.get(key) for t in tables for key in ("file", "files", "roles")]
    names = [n for v in given for n in (v if isinstance(v, list) else [v]) if isinstance(n, str) and n]
    found: set[Path] = set()
    for path in (case / n for n in names if not Path(n).is_absolute() and ".." not in Path(n).parts and "\0" not in n):
        with suppress(AeolidError):
            found.update(p for p in files_of(path) if p.is_file())
    return found


def _known(folder: Path, key: str) -> dict[str, Any] | None:
    """Return the diagnosis that stands in a folder where it was made from the same; None otherwise."""
    try:
        if load_json(folder / _DONE) != {"key": key} or (folder / "diagnosis.json").stat().st_size > MOST_JSON:
            return None
        found = load_json(folder / "diagnosis.json")
    except (AeolidError, OSError):
        return None
    return found if isinstance(found, dict) and isinstance(found.get("verdict"), str) else None


def row_of(name: str, diagnosis: Mapping[str, Any]) -> dict[str, Any]:
    """Return a case's row: its verdict, the first effect with its first parameter, and what the sealed data gain."""
    effect = (diagnosis.get("effects") or [{}])[0]
    parameter: Mapping[str, Any] = next(iter((effect.get("parameters") or {}).values()), {})
    sealed = diagnosis.get("sealed") or {}
    low = (sealed.get("interval") or [None])[0]
    values = (
        name, diagnosis["verdict"], effect.get("id"), (effect.get("location") or {}).get("entry"),
        parameter.get("value"), parameter.get("std"), parameter.get("unit"), sealed.get("log_likelihood_gain"), low,
        diagnosis.get("statement", ""),
    )  # fmt: skip
    return dict(zip(COLUMNS, values, strict=True))


def csv_of(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table as CSV; a text that a spreadsheet would take for a formula gets an apostrophe before it."""
    lines = [",".join(COLUMNS)]
    lines += [",".join(_cell(row[c]) for c in COLUMNS) for row in rows]
    return "\n".join(lines) + "\n"


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    text = " ".join(str(value).split())
    text = f"'{text}" if text[:1] in "=+-@" and not isinstance(value, int) else text
    return '"' + text.replace('"', '""') + '"' if any(s in text for s in ',"') else text


def show(rows: Sequence[Mapping[str, Any]], out: Path) -> None:
    """Print the table, what differs first by what it is, then how many cases have which verdict."""
    from collections import Counter

    from rich.table import Table
    from rich.text import Text

    from aeolid.report.numbers import is_loose

    table = Table(box=None, padding=(0, 1))
    for heading in ("case", "verdict", "effect", "value"):
        table.add_column(heading, overflow="fold")
    for row in rows:
        std = None if row["std"] is None or is_loose(row["value"] or 0.0, row["std"]) else row["std"]
        number = "" if row["value"] is None else plain(plus_minus(row["value"], std))
        value = f"{number} {row['unit'] or ''}".strip() if number else ""
        effect = " ".join(
            part for part in (str(row["effect"] or "").replace("_", " "), place(str(row["where"] or ""))) if part
        )
        cells = (row["case"], row["verdict"], effect or row["fault"] or "", value)
        table.add_row(*(Text(str(c)) for c in cells))
    console.print(table)
    verdicts = Counter(row["verdict"] for row in rows)
    told = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.most_common())
    console.print(f"{counted(len(rows), 'case')}: {told}; table: {out / TABLE}", markup=False, soft_wrap=True)
