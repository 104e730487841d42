"""aeolid catalogue: the physics a diagnosis can name."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import typer

from aeolid.cli.common import ForceOption, JsonOption, console, emit_json
from aeolid.output import declare

EXAMPLES = (
    "aeolid catalogue",
    "aeolid catalogue --json catalogue.json",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command("catalogue")(run)


def run(json_target: JsonOption = None, force: ForceOption = False) -> None:
    """List the effects a diagnosis can name, with equations, parameters and what they are confused with."""
    declare("catalogue", force=force, files={"--json": json_target})
    from aeolid.diagnose.hypotheses.catalogue import ENTRIES

    facts: list[dict[str, Any]] = [
        {
            "id": e.id, "family": e.family, "name": e.name, "equation": e.equation, "source": e.source,
            "parameters": [{k: _plain(v) for k, v in asdict(q).items()} for q in e.quantities],
            "attaches_to": e.attaches_to, "signature": e.signature,
            "confused_with": [{"id": i, "told_apart_by": t} for i, t in e.confused_with],
        }
        for e in ENTRIES
    ]  # fmt: skip
    emit_json(facts, json_target)
    if json_target == "-":
        return
    for fact in facts:
        console.print(f"[bold]{fact['id']}[/bold]  ({fact['family']})  {fact['name']}")
        console.print(f"  {fact['equation']}", soft_wrap=True)
        for q in fact["parameters"]:
            console.print(
                f"  {q['symbol']} [{q['unit']}] {_end(q['low'])} … {_end(q['high'])}: {q['meaning']}", markup=False
            )
        console.print(f"  attaches to {fact['attaches_to']}; shows as: {fact['signature']}", soft_wrap=True)
        for rival in fact["confused_with"]:
            console.print(f"  not {rival['id']}: {rival['told_apart_by']}", soft_wrap=True)


def _end(value: float | None) -> str:
    """Return an end of a range as text; one that is not finite is open."""
    return "open" if value is None else f"{value:g}"


def _plain(value: Any) -> Any:
    """Return a value as JSON has it; what is not finite is null."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
