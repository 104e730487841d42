"""aeolid example: recordings, roles, models and cases to try the other commands on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aeolid.cli.common import ForceOption, JsonOption, console, emit_json
from aeolid.output import declare

EXAMPLES = ("aeolid example .", "aeolid example tryout --samples 6000 --seed 3")
NEXT = (
    "aeolid identify monday.csv --roles roles.toml --past 30 --out model.json",
    "aeolid validate model.json tuesday.csv --roles roles.toml",
    "aeolid diagnose my_case --out my_case/diagnosis --sham 2",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command("example")(run)


def run(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to write into; it is made where missing.")],
    samples: Annotated[int, typer.Option("--samples", help="Of each turbine recording, ten a second.")] = 3000,
    seed: Annotated[int, typer.Option("--seed", help="Of wind, excitation and noise.", min=0)] = 1,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Write small recordings, roles, models and cases to try the other commands on.

    Two recordings of the built-in turbine and the case my_case with its model; a positioning stage with its equations,
    the case stage. Something is concealed in each.
    """
    from aeolid.plants.examples import EXAMPLE_FILES, write_examples

    declare("example", force=force, folders={"DIR": folder}, files={"--json": json_target}, inside=EXAMPLE_FILES)
    files = write_examples(folder, samples=samples, seed=seed)
    emit_json({"folder": folder, "files": files, "next": NEXT}, json_target)
    if json_target == "-":
        return
    for path in files:
        console.print(str(path), markup=False, soft_wrap=True)
    console.print(f"\nin {folder}, for example:", markup=False, soft_wrap=True)
    for line in NEXT:
        console.print(f"  {line}", markup=False, soft_wrap=True)
