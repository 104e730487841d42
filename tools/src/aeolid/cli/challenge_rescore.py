"""Decide a challenge again under other rules; and what the steps of a challenge share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.cli.common import console, emit_json, progress_console
from aeolid.wording import counted

if TYPE_CHECKING:
    from aeolid.challenge.rescore import Rescored
    from aeolid.challenge.run import Rules


def rescore_step(folder: Path, target: Path, rules: Path, workers: int, most_s: float, json_target: str | None) -> None:
    """Decide every stored result again and print both tables; with workers, what margins leave open is diagnosed."""
    from aeolid.challenge.rescore import rescore
    from aeolid.fleet.workers import open_pool

    own = read_rules(rules)
    pool_of = open_pool(workers, threads=workers > 1) if workers else nullcontext(None)
    try:
        with pool_of as pool, bar_of_cases("diagnosing") as tell:
            found = rescore(folder, target, own, pool, most_s=most_s, notice=lambda done, of, result: tell(done, of))
    except KeyboardInterrupt:
        progress_console.print(f"stopped; finished cases are kept in {target}: the same command goes on there")
        raise
    if json_target != "-":
        console.print(_text(found), markup=False, soft_wrap=True)
    emit_json(found.to_json(), json_target)


def _text(found: Rescored) -> str:
    from aeolid.challenge.page import table_text

    facts = found.to_json()
    lines = [f"{found.stay} answers stay by their margins, {found.diagnosed} diagnosed under these rules, "
             f"{len(found.open)} open"]  # fmt: skip
    for title, key in (("as stored", "before"), ("under these rules", "after")):
        lines += ["", f"{title}, {counted(len(found.before), 'case')}:", *table_text(facts[key])]
    if facts["changed"]:
        lines += ["", f"{len(facts['changed'])} answers changed:"]
        lines += [_change(c) for c in facts["changed"]]
    if found.open:
        lines += ["", "open, and in neither table; --fits diagnoses these under the rules:"]
        lines += [f"  {case}: {', '.join(names)}" for case, names in found.open.items()]
    return "\n".join(lines)


def _change(c: dict[str, Any]) -> str:
    before, after = (f"{', '.join(c[k])}{' (right)' if c['right_' + k] else ''}" for k in ("before", "after"))
    return f"  {c['case']} {' + '.join(c['hidden']) or 'nothing'}: {before} → {after}"


def read_rules(path: Path) -> Rules:
    """Return the decision rules of a file; each diagnosis reads it again, in a process of its own."""
    from aeolid.challenge.run import Rules
    from aeolid.diagnose.rules import differing, every_rule, load_rules

    defaults = {r.name: r.value for r in every_rule()}
    return Rules(str(path.resolve()), dict(differing(load_rules(path))), defaults)


@contextmanager
def bar_of_cases(what: str) -> Iterator[Callable[[int, int], None]]:
    """Show progress with the time left on standard error."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns: Any = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=progress_console, disable=not progress_console.is_terminal) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, of: bar.update(task, completed=done, total=of)
