"""Know what one run of a command reads and writes, and judge by it what an output may replace."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from aeolid.errors import UsageError
from aeolid.output import ledger

FORCE = "--force"
PART = ".part."  # in the name of a file that grows
_MOST_INSIDE = 1000  # files of a folder given as an input that are looked at


@dataclass(frozen=True)
class Output:
    """Hold one place a call writes to, as it was given.

    several: further files get -node1-run2 and the like behind the name's stem.
    """

    option: str
    path: Path
    folder: bool = False
    several: bool = False
    listed: bool = True  # in the ledger: what may not be made again is never replaced by a later call

    @property
    def home(self) -> Path:
        """Return the folder of the ledger (absolute)."""
        return self.whole if self.folder else self.whole.parent

    @property
    def whole(self) -> Path:
        """Return the absolute path."""
        return self.path.absolute()

    def covers(self, path: Path) -> bool:
        """Tell whether a file (absolute) belongs to this output."""
        if self.folder:
            return path.is_relative_to(self.whole)
        return path == self.whole or (self.several and path.parent == self.whole.parent and self.is_of(path.name))

    def is_of(self, name: str) -> bool:
        """Tell whether a name is one of those that several runs and nodes give rise to."""
        stem, _, rest = self.path.name.partition(".")
        tagged = rf"{re.escape(stem)}(-node\d+)?(-run\d+)?\.({re.escape(rest)}|roles\.toml)"
        return re.fullmatch(tagged, name) is not None or re.match(rf"{re.escape(stem)}\b.*\.part\.", name) is not None


@dataclass(eq=False)
class Call:
    """Hold a run of a command: its name, its inputs by device and inode, its outputs, whether it may replace all."""

    command: str
    force: bool
    outputs: list[Output] = field(default_factory=list)
    inputs: dict[tuple[int, int], str] = field(default_factory=dict)
    beside: set[tuple[int, int]] = field(default_factory=set)  # of the inputs, those that only lie in a folder given
    folders: list[Path] = field(default_factory=list)  # given as inputs: links below them are not followed

    def output_of(self, path: Path) -> Output:
        """Return the output that a file belongs to."""
        found = next((o for o in self.outputs if o.covers(path.absolute())), None)
        return found or Output("", path)

    def completes(self, path: Path) -> bool:
        """Tell whether a file is what a call that was killed has left and this one reads; writing to it is refused."""
        facts = path.lstat()
        return PART in path.name and (facts.st_dev, facts.st_ino) in self.inputs

    def label(self, output: Output) -> str:
        """Return what the ledger says of a file of an output."""
        return f"{self.command} {output.option}".rstrip()

    def _wrote(self, path: Path) -> bool:
        """Tell whether this very option wrote a file as it stands: a picture of a case in the case's own folder."""
        output = self.output_of(path)
        name, label = str(path.absolute().relative_to(output.home)), self.label(output)
        own = [e for e in ledger.entries(output.home) if e.file == name and e.label == label]
        if not own:
            return False
        with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC), "rb") as handle:
            found = ledger.digest(handle)
        return any(e.sha256 == found for e in own)

    def may_replace(self, path: Path, facts: os.stat_result) -> None:
        """Raise UsageError unless a regular file may give way."""
        if self.force:
            return
        key = facts.st_dev, facts.st_ino
        if key in self.inputs and not (key in self.beside and self._wrote(path)):
            read = self.inputs[key]
            which = "is" if Path(read).absolute() == path.absolute() else f"is the same file as {read},"
            raise UsageError(f"{path}: {which} an input of this command; name another output, or give {FORCE}")
        if facts.st_size == 0:  # as mktemp leaves it: nothing to lose
            return
        output = self.output_of(path)
        name, label = str(path.absolute().relative_to(output.home)), self.label(output)
        told = [e for e in ledger.entries(output.home) if e.file == name]
        own = [e for e in told if e.label == label]
        with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC), "rb") as handle:
            found = ledger.digest(handle) if told else ""
        if any(e.sha256 == found for e in own):
            return
        why = "exists, and aeolid did not write it"
        if own:
            why = f"was changed since aeolid {label} wrote it"
        elif any(e.sha256 == found for e in told):
            why = f"was written by aeolid {told[-1].label}"
        raise UsageError(f"{path}: {why}; name another output, or replace it with {FORCE}")


class _Now:
    """Hold the call under way in this process; threads of it write too."""

    call: Call | None = None


def current() -> Call | None:
    """Return the call under way; without one, as in a program that uses the package, files are simply replaced."""
    return _Now.call


def finished() -> None:
    """Forget the call."""
    _Now.call = None


def declare(
    command: str, *, force: bool, inputs: Iterable[str | Path | None] = (),
    files: Mapping[str, str | Path | None] | None = None, folders: Mapping[str, str | Path | None] | None = None,
    several: Mapping[str, str | Path | None] | None = None, inside: Iterable[str] = (),
    claimed: bool = False, unrepeatable: bool = False,
) -> Call:  # fmt: skip
    """Say before the work what a command reads and writes, and refuse at once what could not be written after it.

    files, folders, several: option to path; None and "-" are left out; `several` names files that get company, one for
    each node and run. inside: names within the folders that will be written. Folders are made; claimed: they
    must be empty, or made by this very command, for what is in them is its own to remove. unrepeatable: what `several`
    names is never replaced, not even by the same command. Raises UsageError on a
    link, on what is no regular file, on a folder that is missing or not writable, and on a file that must not be
    replaced.
    """
    from aeolid.output.writing import check_file, make_folder, require_room

    call = Call(command, force)
    for path in inputs:
        if path is not None:
            _note(call, Path(path))
    company = {"several": True, "listed": not unrepeatable}
    for given, kind in ((files, {}), (several, company), (folders, {"folder": True})):
        for option, path in (given or {}).items():
            if path is not None and str(path) != "-":
                call.outputs.append(Output(option, Path(path), **kind))
    _refuse_double(call)
    _Now.call = call
    for output in (o for o in call.outputs if o.folder):
        make_folder(output.path)
        if claimed:
            _claim(call, output)
        for target in (output.path / name for name in inside):
            if os.path.lexists(target.parent):
                check_file(target)
    for output in (o for o in call.outputs if not o.folder):
        check_file(output.path)
        require_room(output.path)
        for other in sorted(output.path.parent.iterdir()) if output.several else ():
            if other.name != output.path.name and output.is_of(other.name) and not call.completes(other):
                check_file(other)
    return call


def _claim(call: Call, output: Output) -> None:
    mark = ledger.Entry(".", call.label(output), "")
    if not call.force and mark not in ledger.entries(output.path) and any(output.path.iterdir()):
        raise UsageError(
            f"{output.path}: holds files, and aeolid {call.label(output)} did not make it; name a new folder, or give"
            f" {FORCE}"
        )
    ledger.add(output.path, mark)


def _refuse_double(call: Call) -> None:
    names = [os.path.join(os.path.realpath(o.path.parent), o.path.name) for o in call.outputs]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"{name}: is named twice; each output needs a name of its own")


def free_number(paths: Iterable[Path | None]) -> int:
    """Return the least number k from 1 on such that `numbered` names of these files, and of their company, are free."""
    wanted = [p for p in paths if p is not None]
    k = 1
    while any(_is_taken(numbered(p, k)) for p in wanted):
        k += 1
    return k


def numbered(path: Path, k: int) -> Path:
    """Return the k-th name of a file: received.csv, received-2.csv, received-3.csv."""
    stem, dot, rest = path.name.partition(".")
    return path if k == 1 else path.with_name(f"{stem}-{k}{dot}{rest}")


def _is_taken(path: Path) -> bool:
    output = Output("", path, several=True)
    try:
        others = (name for name in os.listdir(path.parent) if name != path.name)
        if any(output.is_of(name) for name in others):
            return True
        facts = path.lstat()
        return not stat.S_ISREG(facts.st_mode) or facts.st_size > 0
    except OSError:
        return False  # nothing there; a missing folder is told where the file is opened


def note_input(path: str | Path) -> None:
    """Remember that the call under way reads a file, which no output may replace."""
    if _Now.call is not None:
        _note(_Now.call, Path(path))


def _note(call: Call, path: Path) -> None:
    try:
        facts = path.stat()
    except (OSError, ValueError):
        return  # its reader says what is wrong with it
    if stat.S_ISREG(facts.st_mode):
        call.inputs[facts.st_dev, facts.st_ino] = str(path)
        call.beside.discard((facts.st_dev, facts.st_ino))
    elif stat.S_ISDIR(facts.st_mode):
        call.folders.append(path.absolute())
        try:
            for name in sorted(os.listdir(path))[:_MOST_INSIDE]:
                inside = os.stat(path / name)
                if stat.S_ISREG(inside.st_mode):
                    call.inputs[inside.st_dev, inside.st_ino] = str(path / name)
                    call.beside.add((inside.st_dev, inside.st_ino))
        except OSError:
            return
