"""Bound the size of a model's equations before anything is made of them."""

from __future__ import annotations

import ast
from collections.abc import Sized

from aeolid.errors import DataError
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations

MOST_STATES = 200  # memories included: their Jacobian takes twice as many evaluations of all equations
MOST_NAMES = 2_000  # of parameters, inputs, outputs, filters and intermediates each
MOST_OPERATIONS = 20_000  # numbers, names and operations of all equations: their machine code takes seconds
MOST_WRITTEN_OUT = 20_000  # the same with every intermediate written out, as a diagnosis reads them
MOST_LEVELS = 120  # of an equation written out; the depth to which an expression may be nested


def require_few(count: int, what: str, source: str, most: int = MOST_NAMES, remedy: str = "") -> None:
    """Refuse more than `most` of something; raises DataError that names the file and the remedy."""
    if count > most:
        raise DataError(f"{source}: {count} {what}, more than the {most} that are read{remedy}")


def require_small(model: Equations, source: str) -> None:
    """Refuse equations whose machine code would take long to make; raises DataError that names the file.

    Intermediates count once, however often they are used: machine code computes each once a step.
    """
    require_few(len(model.states) + len(model.memories), "states and memories", source, MOST_STATES)
    lists: tuple[tuple[str, Sized], ...] = (("inputs", model.inputs), ("outputs", model.outputs))
    for what, entries in lists:
        require_few(len(entries), what, source)
    trees = [*model.roots(), *(a.equation for a in model.auxiliaries)]
    require_few(sum(_written(t, {})[0] for t in trees), "numbers, names and operations", source, MOST_OPERATIONS)


def require_readable(model: Equations, source: str) -> None:
    """Refuse equations that are too large with every intermediate written out; raises DataError that names the file.

    A diagnosis reads equations so: where a force enters, what depends on what. Thirty intermediates of which each
    uses the one before twice are 10⁹ operations then; this counts them without writing them.
    """
    known: dict[str, tuple[int, int]] = {}
    for a in model.auxiliaries:
        known[a.name] = _written(a.equation, known)
    sizes = [_written(t, known) for t in model.roots()] + list(known.values())
    size, levels = sum(s for s, _ in sizes), max((d for _, d in sizes), default=0)
    if size > MOST_WRITTEN_OUT or levels > MOST_LEVELS:
        found = f"{levels} levels" if levels > MOST_LEVELS else f"{size:.3g} numbers, names and operations"
        raise DataError(
            f"{source}: the equations have {found} with every [[auxiliary]] written out, more than a diagnosis takes"
            f" ({MOST_WRITTEN_OUT} on {MOST_LEVELS} levels); shorten them, or make states of the largest"
        )


def _written(tree: ast.expr, known: dict[str, tuple[int, int]]) -> tuple[int, int]:
    """Return how many nodes an expression has and on how many levels, names of `known` written out."""
    if isinstance(tree, ast.Name):
        return known.get(tree.id, (1, 1))
    parts = [_written(child, known) for child in ex.parts_of(tree)]
    return 1 + sum(size for size, _ in parts), 1 + max((levels for _, levels in parts), default=0)
