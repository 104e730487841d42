"""Refuse options of an identification that do not go together, before anything is read."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from typing import Any

from aeolid.errors import UsageError

METHODS = ("varx", "varmax", "lpv", "lpv-kernel", "ort", "fir")
SCHEDULED = METHODS[2:4]
CHOOSING = ("varx", "varmax", "fir")  # the methods with --feedthrough auto; of them varx and varmax with --past auto


def check_method(method: str, past: str) -> None:
    """Refuse a method that `identify` does not have, saying what a filter's name is for, and a window that is none."""
    if method in METHODS:
        from aeolid.identify.choose_past import read_past

        read_past(past, 1.0)
        return
    from aeolid.filters import METHODS as FILTERS
    from aeolid.identify.block_markov import BLOCK_METHODS

    if method in (*FILTERS, *BLOCK_METHODS):
        raise UsageError(f"{method} is a filter: aeolid filter --method {method}, and what it writes to --markov here")
    raise UsageError(f"method {method!r} is unknown; this release has {', '.join(METHODS)}")


def check_scheduled(given: dict[str, Any], method: str, streamed: bool, stable: bool) -> None:
    """Refuse options of scheduled models elsewhere, and with them what only time-invariant ones have."""
    if given and method not in SCHEDULED:
        option = "--" + next(iter(given)).replace("_", "-")
        raise UsageError(f"{option} belongs to --method lpv and lpv-kernel")
    if method in SCHEDULED and (streamed or stable):
        option = "--stable" if stable else "--markov"
        raise UsageError(f"{option} is for time-invariant models; leave it out with --method {method}")


def check_ort_and_fir(
    given: dict[str, Any], method: str, streamed: bool, regularize: str | float, stable: bool
) -> None:
    """Refuse options of ort elsewhere, and with ort and fir what they do not have."""
    if given and method != "ort":
        raise UsageError(f"--{next(iter(given)).replace('_', '-')} belongs to --method ort")
    if method in ("ort", "fir") and streamed:
        raise UsageError(f"--markov holds a predictor with outputs; --method {method} takes recordings only")
    if method == "ort" and regularize != "gcv":
        raise UsageError("--regularize has no meaning with --method ort; leave it out")
    if method == "fir" and stable:
        raise UsageError("--stable is not for --method fir: a plant it can identify forgets, lengthen --past instead")


def check_passes(given: dict[str, Any], method: str, streamed: bool) -> None:
    """Refuse options of the VARMAX passes where no pass is run."""
    if given and method != "varmax":
        raise UsageError("--passes and --forget belong to --method varmax")
    if given and streamed:
        raise UsageError("with --markov no pass is run; leave --passes and --forget out")


def check_uncertainty(given: dict[str, Any], method: str, streamed: bool) -> None:
    """Refuse a choice of uncertainty where the method has its own, and options of a bootstrap without one."""
    if given and method not in METHODS[:2]:
        option = "--" + next(iter(given)).replace("_", "-")
        raise UsageError(f"{option} is for --method varx and varmax; --method {method} has deviations of its own")
    chosen = given.get("uncertainty", "asymptotic")
    if chosen != "bootstrap" and len(given) > ("uncertainty" in given):
        raise UsageError(f"--bootstrap-runs and --bootstrap-seed need --uncertainty bootstrap, not {chosen}")
    if chosen == "bootstrap" and streamed:
        raise UsageError("--uncertainty bootstrap needs the recording's own regression; leave it or --markov out")


def check_preparation(given: dict[str, Any], method: str, streamed: bool) -> None:
    """Refuse what is done to recordings first where the method, or the stream, does not have it."""
    if given and method not in METHODS[:2]:
        raise UsageError(f"--{next(iter(given))} is for --method varx and varmax, not {method}; leave it out")
    for name in ("missing", "robust"):
        if name in given and streamed:
            raise UsageError(f"--{name} changes samples that the filter of --markov has used; leave one of them out")


def check_output_only(given: dict[str, Any], method: str, streamed: bool) -> None:
    """Refuse outputs alone, and a reference of the shapes, where the method has no such thing."""
    if given and method not in METHODS[:2]:
        raise UsageError(f"--{next(iter(given))} is for --method varx and varmax, not {method}; leave it out")
    if "outputs" in given and streamed:
        raise UsageError("--outputs changes the channels that the filter of --markov has used; leave one of them out")


def check_blades(sets: list[str] | None, streamed: bool) -> None:
    """Refuse sets of blades where the channels are those of a filter that has seen them on the blades."""
    if streamed and sets not in (None, ["none"]):
        raise UsageError("--blades changes the channels that the filter of --markov has used; leave one of them out")


def check_finish(given: dict[str, Any], method: str, order: str) -> None:
    """Refuse criteria and prediction-error steps where the method has none, and a criterion where it cannot decide."""
    if "solution" in given and method != "varx":
        raise UsageError(f"--solution is for --method varx; leave it out with --method {method}")
    if "refine" in given and method not in METHODS[:4]:
        raise UsageError(f"--refine is for --method varx, varmax, lpv and lpv-kernel, not {method}; leave it out")
    if "order_criterion" not in given:
        return
    if method not in METHODS[:2]:
        raise UsageError(f"--order-criterion is for --method varx and varmax; --method {method} chooses its own way")
    if order != "auto":
        raise UsageError(f"--order-criterion decides where --order is auto, not {order}; leave one of them out")


def check_whole(given: Mapping[str, object]) -> None:
    """Refuse a number that is not whole, by the name of its option."""
    for option, value in given.items():
        try:
            whole = not isinstance(value, bool) and operator.index(value) is not None  # type: ignore[arg-type]
        except TypeError:
            whole = False
        if not whole:
            raise UsageError(f"--{option.replace('_', '-')} {value!r} is not a whole number")


def read_order(given: str | int | None) -> int | None:
    """Return the order asked for, None for auto; raises UsageError on anything else."""
    if given is None or given == "auto":
        return None
    try:
        order = int(given)
    except (TypeError, ValueError):
        order = None
    if order is None or isinstance(given, bool) or (isinstance(given, float) and given != order):
        raise UsageError(f"--order {given!r} is neither a whole number nor auto")
    return order


def read_regularization(given: str | float) -> str | float:
    """Return gcv, none, or the number asked for; raises UsageError on anything else."""
    if given in ("gcv", "none"):
        return given
    try:
        return float(given)
    except (TypeError, ValueError):
        raise UsageError(f"--regularize {given!r} is none of gcv, none or a number") from None
