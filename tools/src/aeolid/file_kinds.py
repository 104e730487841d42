"""Tell the files of a case apart, so that one given in the place of another is refused by what it is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aeolid.errors import DataError
from aeolid.text_files import check_keys, load_toml

SUFFIXES = (  # of what is taken for a recording in a folder: others are read by name
    ".csv", ".csv.gz", ".parquet", ".mat", ".npz", ".mf4", ".out", ".outb", ".blf", ".asc", ".log", ".sel", ".tdms",
)  # fmt: skip
NAMED = (".txt", ".tsv", ".dbg", ".xlsx", ".h5", ".hdf5", ".dat")
_TABLES: dict[str, frozenset[str]] = {
    "roles": frozenset({"recording", "channel", "point", "line"}),
    "equations": frozenset(
        {"model", "parameters", "state", "output", "input", "input_filter", "auxiliary", "memory"}
    ),
    "case": frozenset({"case", "recordings", "baseline", "context"}),
}  # fmt: skip
_CALLED = {
    "roles": "a roles file", "equations": "a model file (equations)", "case": "a case file", "linear": "a model file",
    "recording": "a recording",
}  # fmt: skip
_REMEDIES = {
    "roles": "give the TOML file with [[channel]] tables; aeolid init RECORDING writes one",
    "equations": "give model.toml; a case names its model under [baseline] file",
    "case": "give the folder that holds case.toml",
}
_OF_A_CASE = (
    "a case is a folder with case.toml, recordings, their roles and a model: aeolid init RECORDING writes one,"
    " aeolid example . two"
)


def check_tables(data: Mapping[str, Any], wanted: str, source: str) -> None:
    """Refuse tables that a TOML file of the wanted kind ("roles", "equations", "case") does not have.

    Raises DataError, which names the kind of file that it is where its tables are those of another.
    """
    other = _kind_of_tables(data)
    if other is not None and other != wanted:
        raise DataError(f"{source}: {_CALLED[other]}, where {_CALLED[wanted]} is needed; {_REMEDIES[wanted]}")
    check_keys(data, set(_TABLES[wanted]), source)


def suffix_of(path: Path) -> str:
    """Return the ending of a file's name in small letters, that of packed text with what it is packed of."""
    return ".csv.gz" if path.name.lower().endswith(".csv.gz") else path.suffix.lower()


def called(path: Path) -> str | None:
    """Return what a file is called by its ending and its tables, None where that is not known."""
    known = suffix_of(path) in (*SUFFIXES, *NAMED)
    kind: str | None = "linear" if path.suffix in (".json", ".lin") else "recording" if known else None
    if path.suffix == ".toml":
        try:
            kind = _kind_of_tables(load_toml(path))
        except DataError:
            kind = None
    return None if kind is None else _CALLED[kind]


def require_case(folder: Path) -> None:
    """Raise DataError where a path is no folder of a case: by what it is, and with what to give."""
    if (folder / "case.toml").is_file():
        return
    if folder.is_file():
        what = called(folder) or "a file"
        beside = folder.parent / "case.toml"
        remedy = f"give its folder: {folder.parent}" if beside.is_file() else _OF_A_CASE
        raise DataError(f"{folder}: {what}, where the folder of a case is needed; {remedy}")
    if not folder.exists():
        raise DataError(f"{folder}: no such folder; {_OF_A_CASE}")
    raise DataError(f"{folder / 'case.toml'}: no such file; {_OF_A_CASE}")


def _kind_of_tables(data: Mapping[str, Any]) -> str | None:
    """Return the only kind of file that has every table of this one; None where there is none, or several."""
    fitting = [kind for kind, tables in _TABLES.items() if data and data.keys() <= tables]
    return fitting[0] if len(fitting) == 1 else None
