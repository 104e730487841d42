"""Tell what the commands are, from the very declarations they run by: for the documentation and its tests."""

from __future__ import annotations

import inspect
import textwrap
import types
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from typer.models import ArgumentInfo, OptionInfo

from aeolid.cli.app import ENDING, HELP, build_app

WIDTH = 100
KINDS = {int: "INT", float: "NUMBER", str: "TEXT", Path: "PATH"}


@dataclass(frozen=True)
class Parameter:
    """Hold an argument or an option. names: empty for an argument; value: what follows the name, empty for a switch."""

    names: tuple[str, ...]
    value: str
    help: str
    required: bool
    default: str | None
    repeatable: bool

    @property
    def head(self) -> str:
        """Return the parameter as one writes it."""
        return " ".join(part for part in (", ".join(self.names), self.value) if part)

    @property
    def notes(self) -> str:
        """Return the help with what the declaration itself says."""
        facts = ["required"] if self.required and self.names else []
        facts += [] if self.default is None else [f"default {self.default}"]
        return self.help + (f" [{'; '.join(facts)}]" if facts else "")


@dataclass(frozen=True)
class Command:
    """Hold a sub-command: name, paragraphs of help, arguments first, examples."""

    name: str
    paragraphs: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    examples: tuple[str, ...]

    @property
    def usage(self) -> str:
        """Return the line of usage."""
        arguments = [p.value for p in self.parameters if not p.names]
        needed = [p.head for p in self.parameters if p.names and p.required]
        return " ".join(["aeolid", self.name, *arguments, *needed, "[OPTIONS]"])


def commands() -> list[Command]:
    """Return all sub-commands by name."""
    found = []
    for info in build_app().registered_commands:
        assert info.callback is not None and info.name is not None
        paragraphs = tuple((info.help or "").split("\n\n"))
        module = inspect.getmodule(info.callback)
        examples = tuple(getattr(module, "EXAMPLES", ()))
        found.append(Command(info.name, paragraphs, _parameters(info.callback), examples))
    return found


def _parameters(callback: Any) -> tuple[Parameter, ...]:
    """Read the parameters from the function's annotations."""
    hints = typing.get_type_hints(callback, include_extras=True)
    found = []
    for name, declared in inspect.signature(callback).parameters.items():
        kind, info = typing.get_args(hints[name])[:2]
        if isinstance(info, ArgumentInfo | OptionInfo):
            found.append(_parameter(name, declared.default, kind, info))
    return tuple(sorted(found, key=lambda p: bool(p.names)))


def _parameter(name: str, default: Any, kind: Any, info: ArgumentInfo | OptionInfo) -> Parameter:
    """Put one annotation into words."""
    plain, repeatable = _plain(kind)
    required = default is inspect.Parameter.empty
    option = isinstance(info, OptionInfo)
    written = (info.default, *(info.param_decls or ()))  # in an annotation the first name stands where a default would
    names = tuple(n for n in written if isinstance(n, str) and n.startswith("-"))
    value = info.metavar or (KINDS.get(plain, "TEXT") if option else name.upper())
    shown = None if required or default is None or default == "" or isinstance(default, bool) else f"{default}"
    switch = plain is bool
    return Parameter(names, "" if switch else value, info.help or "", required, shown, repeatable)


def _plain(kind: Any) -> tuple[Any, bool]:
    """Return the type of one value, and whether it may be given several times."""
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        kind = next(part for part in typing.get_args(kind) if part is not type(None))
    if typing.get_origin(kind) is list:
        return typing.get_args(kind)[0], True
    return kind, False


def text() -> str:
    """Write the whole command line as text of a fixed width."""
    parts = [_filled(HELP.replace("\n\n", " "), "")]
    for command in commands():
        parts += ["", command.usage, *(_filled(p, "  ") for p in command.paragraphs)]
        for parameter in command.parameters:
            parts.append(f"    {parameter.head}")
            parts.append(_filled(parameter.notes, "        "))
        parts += [f"    $ {example}" for example in command.examples]
    return "\n".join([*parts, "", _filled(ENDING, "")]) + "\n"


def _filled(content: str, indent: str) -> str:
    return textwrap.fill(
        content, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False
    )
