"""Wire effects of drives and sensors into a model: what several entries share."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.rules import in_force
from aeolid.errors import DataError
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, InputFilter, Memory, Output, Parameter
from aeolid.models.integrate import Compiled, compile_equations, simulate

Array = NDArray[np.float64]
SHARE_SIZE = 0.1  # the effects are blended in linearly, so that any step will do that stands above rounding


def with_filter(model: Equations, channel: str, kind: str, parameters: Sequence[Parameter]) -> Equations:
    """Return the model with one more filter on an input, and the parameters the filter takes."""
    return replace(
        model,
        parameters=(*model.parameters, *parameters),
        filters=(*model.filters, InputFilter(channel, kind, tuple(p.name for p in parameters))),
    )


def with_reading(
    model: Equations, output: str, form: str, parameters: Sequence[Parameter], *,
    slope: str | None = None, memories: Sequence[tuple[str, str, str]] = (),
    others: Mapping[str, ast.expr] | None = None,
) -> Equations:  # fmt: skip
    """Return the model with one output read through `form`, an expression in `reading`, what the output was before.

    slope: factor on the sensor's sign of action, same language; memories: (name, next, settled), same language;
    others: further words of the language.
    """
    old = next(o for o in model.outputs if o.name == output)
    words = {"reading": old.equation, **(others or {})}

    def filled(text: str) -> ast.expr:
        return ex.substitute(ex.parse(text, "sensor"), words)

    action = old.slope
    if slope is not None:
        action = filled(slope) if action is None else ex.combine("*", action, filled(slope))
    new = Output(old.name, old.unit, filled(form), action)
    added = tuple(Memory(n, old.unit, filled(a), filled(b)) for n, a, b in memories)
    return replace(
        model,
        outputs=tuple(new if o.name == output else o for o in model.outputs),
        parameters=(*model.parameters, *parameters),
        memories=(*model.memories, *added),
    )


def blended_filter(
    site: Site, number: int, kind: str, slots: Sequence[Slot], *,
    entry: str, grid: Sequence[Mapping[str, float]], starts: Sequence[Mapping[str, float]], equation: str,
    statement: Callable[[Mapping[str, float]], str], form: str = "",
) -> Attachment:  # fmt: skip
    """Return a hypothesis that blends a filter on one input in by a share; slots are the filter's own parameters."""
    name = site.input_names[number]
    share = f"{kind}_share_{number + 1}"
    own = [Parameter(s.name, dict(grid[0])[s.name], s.unit, s.low, s.high) for s in slots]

    def edit(model: Equations) -> Equations:
        return with_filter(model, name, kind, (*own, Parameter(share, 0.0, "", 0.0, 1.0)))

    return Attachment(
        entry, f"{entry} input:{name}{form}", location(f"input:{name}", inputs=(name,)), edit,
        (*slots, Slot(share, None, "", 0.0, 0.0, 1.0, SHARE_SIZE)),
        fixed={share: 1.0}, grid=tuple(grid), starts=tuple(starts), share=share,
        equation=equation, statement=statement,
    )  # fmt: skip


def unit_of_input(site: Site, number: int) -> str:
    """Return the unit of an input: the model's, that of the recordings where it has none, empty where these have none.

    An input that equations know by its name alone has no unit of its own.
    """
    recorded = (c.unit for c in site.channels if c.name == site.input_names[number])
    return site.model.inputs[number].unit or next(recorded, "")


def commanded(site: Site) -> list[int]:
    """Return the numbers of the inputs that a drive may stand behind: all but measured disturbances.

    Nobody commands these, so nothing of a drive's mechanics lies between: behind a wind that is measured with noise a
    limit of its rate smoothed it, and had the name instead of a wrong power coefficient.
    """
    free = {c.name for c in site.channels if c.role == "disturbance"}
    return [i for i, name in enumerate(site.input_names) if name not in free]


def unit_of_output(site: Site, name: str) -> str:
    """Return the unit of an output of the model, empty where it has none."""
    return next(o.unit for o in site.model.outputs if o.name == name)


def spread_of(values: Array) -> float:
    """Return the standard deviation of what was measured; 0 where nothing was, or nothing moves."""
    finite = values[np.isfinite(values)]
    return float(np.std(finite)) if len(finite) else 0.0


def is_continuous(values: Array) -> bool:
    """Tell whether a signal takes many values, also where it holds each for a while; two-level test signals do not."""
    return len(np.unique(values)) >= in_force().hypotheses.signal_values


def likeness(site: Site) -> Array:
    """Return (l, 2): correlation of each output with a free run of the model, and its spread over that of the run.

    Zeros where the model cannot run free over the data.
    """
    return _likeness(site, int(in_force().data.compared_rows))


@lru_cache(maxsize=4)
def _likeness(site: Site, least_rows: int) -> Array:
    none = np.zeros((len(site.output_names), 2))
    try:
        if site.linear is not None:
            free = site.linear.simulate(site.u)
        else:
            compiled = compiled_of(site)
            free = simulate(compiled, site.u, compiled.model.theta, compiled.model.x0, site.step)
    except DataError:
        return none
    stride = max(round(site.row_step / site.step), 1)
    free = free[::stride][: len(site.y)]
    for j, (y, m) in enumerate(zip(site.y[: len(free)].T, free.T, strict=True)):
        good = np.isfinite(y)
        if np.all(np.isfinite(m)) and good.sum() > least_rows and spread_of(m) > 0 and spread_of(y) > 0:
            none[j] = np.corrcoef(y[good], m[good])[0, 1], spread_of(y) / spread_of(m)
    return none


@lru_cache(maxsize=4)
def compiled_of(site: Site) -> Compiled:
    """Return the model without the filters of its inputs, compiled."""
    return compile_equations(replace(site.model, filters=()))
