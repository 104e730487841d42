"""Write equations as a C99 header that simulates them: for a mock-up unit, a test bench or a model in another tool."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from aeolid.errors import DataError, UsageError
from aeolid.models.equations import TIME, Equations, Output, Parameter, State
from aeolid.models.exchange.c_expressions import functions_of, number
from aeolid.models.exchange.c_filters import Filters, filters_of
from aeolid.models.exchange.c_filters_template import FUNCTIONS, PAST
from aeolid.models.exchange.c_observer import comment, require_name
from aeolid.models.exchange.c_simulation_template import (
    DISCRETE,
    DISCRETE_RAMPS,
    FAST,
    HELPERS,
    RESTING,
    RUNGE_KUTTA,
    STRIDE,
    TEMPLATE,
    WHOLE,
)
from aeolid.models.input_filters import CHANGING
from aeolid.models.integrate import compile_equations
from aeolid.models.integration_steps import substeps
from aeolid.models.intersample import PREFIX
from aeolid.models.model_file import Signal

_PIECES = 4  # steps of integration a sample at least, where an input changes within it


def c_simulation(model: Equations, step_s: float, *, name: str, source: str = "model") -> tuple[str, tuple[str, ...]]:
    """Return the text of a C99 header with a free run of the equations, and notes on what it leaves out.

    step_s: time between two samples, s; a longer step is cut into such. Continuous time is integrated as
    `Equations.simulate` does it: classical Runge–Kutta steps, as many a sample as the model's start asks for, and more
    where its states become faster; memories renewed once a sample, inputs held over it but for the time. A model in
    discrete time has its own step. name: prefix of everything in the header. Raises UsageError on a name or step,
    DataError where the start is not finite.
    """
    require_name(name)
    model = model.pruned()
    step_s = checked_step(model, step_s)
    if not np.all(np.isfinite([s.initial for s in model.states])):
        raise DataError(f"{source}: a state starts at no finite number")
    count = _count(model, step_s)
    filters = filters_of(model, _piece_s(model, step_s, count), name)
    words = _functions(model, filters, name) | {
        "@STEP@": number(step_s), "@PIECE@": number(step_s / count), "@COUNT@": str(count),
        "@SOURCE@": comment(source), "@SIGNALS@": "\n".join(_signals(model, filters.longest)),
        "@START@": row_of(s.initial for s in model.states), "@VALUES@": row_of(model.theta),
        "@N@": str(len(model.states)), "@M@": str(len(model.memories)), "@R@": str(len(model.inputs)),
        "@L@": str(len(model.outputs)), "@P@": str(len(model.parameters)), "@F@": str(filters.words),
        "@GUARD@": f"{name.upper()}_H", "@UPPER@": name.upper(), "@name@": name,
    }  # fmt: skip
    text = TEMPLATE
    for mark, word in words.items():
        text = text.replace(mark, word)
    return text, filters.notes


def longest_dead_times(model: Equations, step_s: float) -> dict[str, float]:
    """Return the parameters that are dead times of inputs and up to what the simulation has room for them, s."""
    return filters_of(model, _piece_s(model, step_s, _count(model, step_s)), "model").longest


def _functions(model: Equations, filters: Filters, name: str) -> dict[str, str]:
    """Return what stands for the marks of the template's functions; some have marks of their own."""
    kinds = {*filters.used, *(["actuator_lag"] if filters.used & {"lead_lag", "indicial"} else [])}
    parts = [*([PAST] if filters.delays else []), *(text for kind, text in FUNCTIONS.items() if kind in kinds)]
    rooms = (f"\n    {name}_past past_{k};\n    double room_{k}[{2 * r}];" for k, r in enumerate(filters.delays, 1))
    times = (f"    v[{i}] = s->time_s;\n" for i, s in enumerate(model.inputs) if s.name == TIME)
    discrete = model.sample_time_s > 0
    integrated = bool(model.states) and not discrete
    return {
        "@FILTERS@": "\n".join(parts), "@FUNCTIONS@": functions_of(model, name), "@ROOMS@": "".join(rooms),
        "@FIRST@": filters.first, "@SETTLE@": filters.settle, "@NOW@": filters.now, "@MEAN@": filters.mean,
        "@HELPERS@": HELPERS, "@ADVANCE@": _advance(model), "@WHOLE@": WHOLE if discrete else "",
        "@TIME@": "".join(times), "@LIMITS@": _limits(model, filters.longest),
        "@STRIDE@": STRIDE.replace("@MOVES@", _moves(model)) + "\n" if integrated else "",
        "@FAST@": FAST if integrated else "",
    }  # fmt: skip


def _ramps(model: Equations) -> bool:
    """Tell whether the states of a model in discrete time follow what inputs do within a sample."""
    changing = any(f.kind in CHANGING and not f.kind.startswith(PREFIX) for f in model.filters)
    return model.sample_time_s > 0 and bool(model.states) and changing


def _advance(model: Equations) -> str:
    """Return how a sample passes."""
    if not model.states:
        return RESTING
    if not _ramps(model):
        return DISCRETE if model.sample_time_s else RUNGE_KUTTA
    rows = (row_of(row) for row in compile_equations(model).ramped(model.theta))
    return DISCRETE_RAMPS.replace("@RAMPED@", "{" + ", ".join(rows) + "}")


def checked_step(model: Equations, step_s: float) -> float:
    """Return the time between two samples, s: a discrete-time model's own, else the one that was asked for."""
    if not model.sample_time_s:
        if not 0 < step_s < 1e6:
            raise UsageError("equations in continuous time need the time between two samples in s (--sample-time)")
        return step_s
    if step_s and abs(step_s - model.sample_time_s) > 1e-9 * model.sample_time_s:
        raise UsageError(f"the model has a sample time of {model.sample_time_s:g} s; it takes no other")
    return model.sample_time_s


def _piece_s(model: Equations, step_s: float, count: int) -> float:
    """Return the time that one mean of the inputs spans, s."""
    return step_s / (_PIECES if _ramps(model) else count)


def _moves(model: Equations) -> str:
    """Return how the time goes on within a step, where it passes no filter."""
    behind = {f.channel for f in model.filters}
    times = [i for i, s in enumerate(model.inputs) if s.name == TIME and TIME not in behind]
    return "\n".join(["    (void)(v);", "    (void)(time_s);", *(f"    v[{i}] = time_s;" for i in times)])


def _limits(model: Equations, longest: Mapping[str, float]) -> str:
    """Return the refusal of dead times that there is no room for."""
    return "".join(
        f"    if (!(s->parameter[{i}] >= 0.0 && s->parameter[{i}] <= {number(limit)})) {{\n        return -2;\n    }}\n"
        for name, limit in longest.items()
        for i in [model.index(name)]
    )


def _count(model: Equations, step_s: float) -> int:
    """Return the steps of integration a sample: as a free run from the model's start takes them."""
    if model.sample_time_s:
        return 1
    compiled = compile_equations(model)
    count = substeps(compiled, np.zeros(len(model.inputs)), compiled.model.theta, compiled.model.x0, step_s)
    return max(count, _PIECES) if any(f.kind in CHANGING for f in model.filters) else count


def row_of(values: Iterable[float]) -> str:
    """Return the initialiser of an array in C, of one zero where there is nothing in it."""
    texts = [number(v) for v in values]
    return "{" + ", ".join(texts or ["0.0"]) + "}"


def _signals(model: Equations, longest: Mapping[str, float]) -> list[str]:
    groups: Sequence[tuple[str, Sequence[Signal | Output | State | Parameter]]] = (
        ("u", model.inputs), ("y", model.outputs), ("x", model.states), ("parameter", model.parameters),
    )  # fmt: skip
    return [
        f" *   {letter}[{i}]  {comment(s.name)}, {comment(s.unit) or '-'}"
        + (f"; 0 to {longest[s.name]:.6g}" if letter == "parameter" and s.name in longest else "")
        for letter, group in groups
        for i, s in enumerate(group)
    ]


def as_identifier(text: str) -> str:
    """Return a name in C that resembles a text."""
    found = re.sub(r"\W", "_", text, flags=re.ASCII)[:40].lstrip("_")
    return found if found and found[0].isalpha() else f"model_{found}"
