"""Run the command line and turn errors into one sentence and an exit code."""

from __future__ import annotations

import importlib
import os
import pkgutil
import sys

import typer

import aeolid.cli
from aeolid.errors import AeolidError

PLUMBING = {"main", "common", "listen_facts", "listen_modes", "listen_view", "receiving"}


def build_app() -> typer.Typer:
    """Collect the sub-commands: every module of aeolid.cli but the plumbing offers `register(app)`."""
    app = typer.Typer(
        name="aeolid",
        help="Identify and diagnose wind-turbine models from controller recordings.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
    )

    @app.callback()
    def root() -> None:
        """Identify and diagnose wind-turbine models from controller recordings."""

    for info in sorted(pkgutil.iter_modules(aeolid.cli.__path__), key=lambda m: m.name):
        if info.name not in PLUMBING:
            importlib.import_module(f"aeolid.cli.{info.name}").register(app)
    return app


def main(arguments: list[str] | None = None) -> int:
    """Run one command; exit codes 0 done, 1 bad news asked for, 2 usage, 3 data, 4 not informative."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on matrices this small a second thread only waits
    try:
        build_app()(args=arguments, prog_name="aeolid")  # ends in SystemExit; usage errors are reported there, code 2
    except AeolidError as error:
        print(f"aeolid: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("aeolid: stopped", file=sys.stderr)
        return 130
    except SystemExit as done:
        return done.code if isinstance(done.code, int) else 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
