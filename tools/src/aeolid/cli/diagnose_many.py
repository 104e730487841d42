"""Diagnose many cases after each other: one table of all, and a second run does what is new."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from aeolid.cli.common import console, progress_console
from aeolid.errors import AeolidError, DataError, UsageError
from aeolid.inputs import open_regular
from aeolid.output import write_json, write_text
from aeolid.output.ledger import digest
from aeolid.text_files import MOST_JSON, load_json
from aeolid.wording import place

TABLE, FACTS = "cases.csv", "cases.json"
_DONE = "done.json"  # in the folder of a case: what it was diagnosed from
COLUMNS = ("case", "verdict", "effect", "where", "value", "std", "unit", "gain", "low", "statement")

Diagnose = Callable[[Path, Path], dict[str, Any]]


def names_of(cases: Sequence[Path]) -> dict[str, Path]:
    """Return a name for each case, that of its folder; raises UsageError where two would be called the same."""
    named: dict[str, Path] = {}
    for case in cases:
        name = case.resolve().name
        if name in named and named[name].resolve() != case.resolve():
            raise UsageError(f"{case}: another case is called {name!r} too ({named[name]}); rename one of the folders")
        named[name] = case
    return named


def diagnose_many(
    cases: Mapping[str, Path], out: Path, settings: Mapping[str, Any], diagnose: Diagnose
) -> list[dict[str, Any]]:
    """Diagnose each case into a folder of its own in `out`; what was done from the same files is taken over.

    settings: what else an answer depends on; diagnose: case and folder to a diagnosis. A case that cannot be read has
    its sentence in the table and the others go on. The table is written after each case. Returns its rows.
    """
    rows: list[dict[str, Any]] = []
    for number, (name, case) in enumerate(cases.items(), 1):
        try:
            key = fingerprint(case, settings)
            known = _known(out / name, key)
            again = "as before" if known else "diagnosing"
            progress_console.print(f"case {number} of {len(cases)}, {name}: {again}", markup=False, soft_wrap=True)
            found = known or diagnose(case, out / name)
            if not known:
                write_json(out / name / _DONE, {"key": key})
            rows.append(row_of(name, found) | {"fault": None})
        except AeolidError as error:
            empty: dict[str, Any] = dict.fromkeys(COLUMNS)
            rows.append(empty | {"case": name, "verdict": "not read", "statement": str(error), "fault": str(error)})
        write_text(out / TABLE, csv_of(rows))
        write_json(out / FACTS, {"cases": rows})
    return rows


def fingerprint(case: Path, settings: Mapping[str, Any]) -> str:
    """Return the SHA-256 of the files in a case's folder and the settings, in hexadecimal.

    Files that a case names elsewhere (--allow-outside) are not seen: their case is diagnosed anew where its own files
    change.
    """
    total = hashlib.sha256(json.dumps(dict(settings), sort_keys=True, default=str).encode())
    if not case.is_dir():
        raise DataError(f"{case}: no such folder")
    for path in sorted(p for p in case.iterdir() if p.is_file() and not p.name.startswith(".")):
        with open_regular(path) as handle:
            total.update(f"{path.name}\0{digest(handle)}\n".encode())
    return total.hexdigest()


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

    table = Table(box=None, padding=(0, 1))
    for heading in ("case", "verdict", "effect", "value"):
        table.add_column(heading, overflow="fold")
    for row in rows:
        spread = "" if row["std"] is None else f" ± {row['std']:.2g}"
        value = "" if row["value"] is None else f"{row['value']:.4g}{spread} {row['unit'] or ''}".rstrip()
        effect = " ".join(
            part for part in (str(row["effect"] or "").replace("_", " "), place(str(row["where"] or ""))) if part
        )
        cells = (row["case"], row["verdict"], effect or row["fault"] or "", value)
        table.add_row(*(Text(str(c)) for c in cells))
    console.print(table)
    counted = Counter(row["verdict"] for row in rows)
    told = ", ".join(f"{count} {verdict}" for verdict, count in counted.most_common())
    console.print(f"{len(rows)} cases: {told}; table: {out / TABLE}", markup=False, soft_wrap=True)
