"""Make a case from a recording and a baseline: survey both, guess, write nothing yet."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from aeolid.begin.context import Fact, facts_of
from aeolid.begin.guess import Guesses, guess, paired
from aeolid.begin.survey import Survey, survey
from aeolid.begin.texts import case_text, roles_text
from aeolid.errors import DataError
from aeolid.text_files import parse_toml

ROLES, RUN_ROLES, CASE = "roles.toml", "run_roles.toml", "case.toml"
_MODELS = {".json": "state_space", ".toml": "equations", ".fmu": "fmu"}


@dataclass(frozen=True, eq=False)
class Beginning:
    """Hold what a new case starts with.

    files: name to text, of roles.toml, case.toml and, for a simulator's run, run_roles.toml; outside: whether a file of
    the case lies outside its folder.
    """

    sides: tuple[tuple[Survey, Guesses], ...]
    facts: tuple[Fact, ...]
    files: dict[str, str]
    outside: bool

    @property
    def missing(self) -> tuple[str, ...]:
        """Return the roles without which nothing can be identified and that nothing was found for."""
        roles = {g.role for g in self.sides[0][1].used}
        return tuple(r for r in ("input", "output") if r not in roles)


def begin(recording: Path, baseline: Path | None, folder: Path) -> Beginning:
    """Guess roles, units and a case. Raises DataError where a file cannot be read or the two share nothing."""
    first = survey(recording)
    guesses = guess(first)
    kind = None if baseline is None else _MODELS.get(baseline.suffix.lower(), "run")
    sides = [(first, guesses)]
    if baseline is not None and kind == "run":
        other = survey(baseline)
        mine, its = paired(first, guesses, other, guess(other))
        if not any(g.role == "input" for g in mine.used) or not any(g.role == "output" for g in mine.used):
            raise DataError(
                f"{baseline}: no input or no output is recognised in both files ({_told(guesses)}; there:"
                f" {_told(guess(other))}); write the roles by hand, {recording} alone helps to begin"
            )
        sides = [(first, mine), (other, its)]
    facts = facts_of(sides)
    names = {p: _within(p, folder) for p in (recording, baseline) if p is not None}
    own = RUN_ROLES if kind == "run" else None
    held = None if kind is None or baseline is None else (kind, names[baseline])
    files = {ROLES: roles_text(*sides[0])}
    if own is not None:
        files[own] = roles_text(*sides[1])
    files[CASE] = case_text(_title(recording, baseline), names[recording], held, own, facts)
    for name, content in files.items():
        parse_toml(content, name)  # a defect here must not reach the user as an unreadable file
    return Beginning(tuple(sides), facts, files, any(n.startswith("..") or os.path.isabs(n) for n in names.values()))


def _told(guesses: Guesses) -> str:
    return ", ".join(f"{g.name} from {g.heading}" for g in guesses.used[:6]) or "nothing"


def _title(recording: Path, baseline: Path | None) -> str:
    return recording.name if baseline is None else f"{recording.name} against {baseline.name}"


def _within(path: Path, folder: Path) -> str:
    """Return the name of a file as a case in `folder` gives it."""
    return Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()
