"""Write a case for each turbine of a fleet, with the baseline of one case and the turbine's own recordings."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from aeolid.errors import DataError
from aeolid.output import make_folder, write_text
from aeolid.text_files import load_toml

_MOST_FILES = 20  # of a turbine, the newest: what a diagnosis can use


def write_cases(template: Path, roles: Path, members: Mapping[str, Sequence[Path]], folder: Path) -> dict[str, Path]:
    """Write folder/TURBINE/case.toml for each turbine and return these folders by turbine.

    template: a case whose baseline and context all turbines share; its own recordings are left out. Raises DataError
    where it is none.
    """
    source = template / "case.toml"
    data = load_toml(source)
    if not isinstance(data.get("baseline"), dict):
        raise DataError(f"{source}: no [baseline] that turbines could be compared with")
    shared = {k: v for k, v in data.items() if k in ("baseline", "context")}
    shared["baseline"] = _absolute(dict(shared["baseline"]), template)
    cases: dict[str, Path] = {}
    for turbine, files in members.items():
        name = re.sub(r"^\.|[^\w.+-]", "_", turbine)
        while name in cases:  # names that differ in what no file name holds
            name += "_"
        listed = [str(f.resolve()) for f in files[-_MOST_FILES:]]
        files_of = {"files": listed, "roles": str(roles.resolve())}
        own: dict[str, Any] = {"case": {"title": f"turbine {turbine}"}, "recordings": files_of} | shared
        make_folder(folder / name)
        write_text(folder / name / "case.toml", toml_of(own))
        cases[name] = folder / name
    return cases


def _absolute(baseline: dict[str, Any], template: Path) -> dict[str, Any]:
    """Return a baseline whose files are found from anywhere."""
    for key in ("file", "roles"):
        if isinstance(baseline.get(key), str):
            baseline[key] = str((template / baseline[key]).resolve())
    if isinstance(baseline.get("files"), list):
        baseline["files"] = [str((template / str(f)).resolve()) for f in baseline["files"]]
    return baseline


def toml_of(tables: Mapping[str, Mapping[str, Any]]) -> str:
    """Return tables of plain values as TOML.

    >>> print(toml_of({"case": {"title": "a", "files": ["b", "c"], "share": 0.5, "same": True}}), end="")
    [case]
    title = "a"
    files = ["b", "c"]
    share = 0.5
    same = true
    """
    lines: list[str] = []
    for name, table in tables.items():
        lines += [f"[{name}]", *(f"{key} = {_value(value)}" for key, value in table.items() if value is not None)]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=True).replace("\x7f", "\\u007f")
    return repr(value)
