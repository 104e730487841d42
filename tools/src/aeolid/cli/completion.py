"""aeolid completion: the script by which a shell completes commands, options and their values."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from aeolid.cli.common import one_of
from aeolid.errors import UsageError

EXAMPLES = (
    'eval "$(aeolid completion bash)"    # in ~/.bashrc; zsh in ~/.zshrc',
    "aeolid completion fish > ~/.config/fish/completions/aeolid.fish",
)
SHELLS = ("bash", "zsh", "fish")


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command("completion")(run)


def run(
    shell: Annotated[str, typer.Argument(help="bash, zsh or fish.", autocompletion=one_of(*SHELLS))],
) -> None:
    """Print the script by which a shell completes commands, options and their values."""
    if shell not in SHELLS:
        raise UsageError(f"there is no completion for {shell}; there is for {', '.join(SHELLS)}")
    from aeolid.cli.app import build_app

    os.environ["_AEOLID_COMPLETE"] = f"source_{shell}"  # the protocol of the scripts themselves
    build_app()(args=[], prog_name="aeolid")
