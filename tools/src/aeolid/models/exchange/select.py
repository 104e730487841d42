"""Keep some inputs and outputs of a model, and name them as a recording does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.errors import DataError, UsageError
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace


def select(model: StateSpace, inputs: Sequence[str], outputs: Sequence[str]) -> StateSpace:
    """Keep the named inputs and outputs, in the order given; an empty list keeps all.

    A name is the signal's own, its end after the first blank (OpenFAST puts the module before it), or NEW=NAME to
    rename it. Inputs left out rest at their operating point. Fewer outputs void the Kalman gain, which is dropped.
    Raises DataError that lists what there is, UsageError on a name given twice.
    """
    u = _choose(model.inputs, inputs, "input")
    y = _choose(model.outputs, outputs, "output")
    rows, columns = [i for i, _ in y], [i for i, _ in u]
    whole = sorted(rows) == list(range(len(model.outputs)))
    S = model.innovation_covariance
    return replace(
        model,
        B=model.B[:, columns],
        C=model.C[rows],
        D=model.D[rows][:, columns],
        K=model.K[:, rows] if whole and model.K is not None else None,
        innovation_covariance=S[rows][:, rows] if whole and S is not None else None,
        inputs=tuple(s for _, s in u),
        outputs=tuple(s for _, s in y),
    )


def _choose(signals: Sequence[Signal], wanted: Sequence[str], kind: str) -> list[tuple[int, Signal]]:
    if not wanted:
        return list(enumerate(signals))
    chosen = []
    for text in wanted:
        index, new = _find(signals, text, kind)
        chosen.append((index, replace(signals[index], name=new)))
    indices, names = [i for i, _ in chosen], [s.name for _, s in chosen]
    for i, signal in chosen:
        if indices.count(i) > 1 or names.count(signal.name) > 1:
            raise UsageError(f"{kind} {signal.name!r} is asked for twice")
    return chosen


def _find(signals: Sequence[Signal], text: str, kind: str) -> tuple[int, str]:
    """Find the index of a signal and its new name; a name that itself holds '=' is tried as it stands first."""
    new, equals, old = text.partition("=")
    for name, label in [(text, None), *([(old, new)] if equals and new else [])]:
        found = [i for i, s in enumerate(signals) if s.name == name]
        found = found or [i for i, s in enumerate(signals) if s.name.partition(" ")[2] == name]
        if len(found) == 1:
            return found[0], label or signals[found[0]].name
        if found:
            both = ", ".join(repr(signals[i].name) for i in found)
            raise DataError(f"{kind} {name!r} may be {both}; give the whole name")
    have = ", ".join(repr(s.name) for s in signals[:20]) + (
        f" and {len(signals) - 20} more" if len(signals) > 20 else ""
    )
    raise DataError(f"the model has no {kind} {text!r}; it has {have or 'none'}")
