"""Put the command line together: every sub-command, and how an error of one ends the process."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from typing import Annotated

import typer
from rich.markup import escape

import aeolid.cli
from aeolid import output
from aeolid.cli import guard

PLUMBING = {
    "app", "main", "challenge_rescore", "common", "diagnose_many", "diagnose_piece", "durations", "guard",
    "identify_structure", "listen_facts", "listen_modes", "listen_rules", "listen_view", "merged_modes", "pictures",
    "pools", "publishing", "receiving", "reference",
}  # fmt: skip
HELP = """Identify and diagnose wind-turbine models from controller recordings.

No recording at hand? aeolid example writes some. Each command says more: aeolid identify --help."""
ENDING = (
    "Exit codes: 0 done; 1 done, and the answer is the bad news asked for; 2 wrong usage; 3 unreadable or inconsistent "
    "data; 4 the data do not carry the answer; 70 a defect of aeolid itself; 130 stopped. --json FILE writes the facts "
    "of a command for machines."
)


def build_app() -> typer.Typer:
    """Collect the sub-commands: every module of aeolid.cli but the plumbing offers `register(app)`."""
    app = typer.Typer(name="aeolid", help=HELP, epilog=ENDING, no_args_is_help=True, pretty_exceptions_enable=False)

    @app.callback()
    def root(
        version: Annotated[
            bool, typer.Option("--version", help="Say the version and exit.", callback=_say_version, is_eager=True)
        ] = False,
    ) -> None:
        """Take what goes before the command."""

    for info in sorted(pkgutil.iter_modules(aeolid.cli.__path__), key=lambda m: m.name):
        if info.name not in PLUMBING:
            module = importlib.import_module(f"aeolid.cli.{info.name}")
            module.register(app)
            command = app.registered_commands[-1]
            assert command.callback is not None
            command.callback = guard.carrying(command.callback)
            command.help = _paragraphs(inspect.getdoc(command.callback) or "")
            command.epilog = escape("\n".join(["Examples:", *getattr(module, "EXAMPLES", ())]))
    return app


def _paragraphs(text: str) -> str:
    """Return the text with each paragraph on one line, so that it is wrapped to the terminal and nowhere else."""
    return "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))


def _say_version(wanted: bool) -> None:
    if wanted:
        print(f"aeolid {aeolid.__version__}")
        raise typer.Exit


def run(arguments: list[str] | None) -> int:
    """Run one command; returns its exit code. Whatever it raises ends as one sentence on standard error."""
    with guard.standard_streams() as stream, guard.interrupts():
        try:
            code = _run(arguments)
        except BaseException as error:
            code = guard.explain(error)
        finally:
            output.finished()
        return guard.end_of(stream, code)


def _run(arguments: list[str] | None) -> int:
    try:
        build_app()(args=arguments, prog_name="aeolid")  # ends in SystemExit; usage errors are reported there, code 2
    except SystemExit as done:
        return done.code if isinstance(done.code, int) else 0
    return 0
