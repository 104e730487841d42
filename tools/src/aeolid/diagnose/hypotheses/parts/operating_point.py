"""Find what the gain of an input may depend on, and let an input act with a changed gain."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import pitch_path, rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.wiring import commanded
from aeolid.models import expressions as ex
from aeolid.models.equations import Auxiliary, Equations, Parameter

Array = NDArray[np.float64]
_MOST_CHANNELS, _MOST_INPUTS = 2, 3


@dataclass(frozen=True, eq=False)
class Point:
    """Hold one pair: an input, and the channel (or the input itself) on which its gain may depend.

    deviation: text of the input less its mean, which the gain multiplies.
    """

    tag: str
    input_name: str
    input_symbol: str
    deviation: str
    name: str
    symbol: str
    unit: str
    values: Array
    mean: float
    spread: float


def points(site: Site) -> list[Point]:
    """List a turbine's pitch input with each recorded scheduling channel (at most 2), with itself where there is none.

    Of another machine every commanded input (at most 3) with each such channel: who gives one that role says that the
    operating point is there. A channel goes by its smoothed value where it has one.
    """
    found = []
    channels = [c for c in site.exogenous if c.role == "scheduling"][:_MOST_CHANNELS]
    turbine = is_turbine(site.context)
    inputs = pitch_path.pitch_inputs(site)[:1] if turbine else commanded(site)[:_MOST_INPUTS] if channels else []
    for i in inputs:
        u, name, symbol = site.u[:, i], site.input_names[i], site.symbols[i]
        on = [(c.name, c.unit, *site.smooth.get(c.name, (c.symbol, rotor.samples(site, c)))) for c in channels]
        on = on or [(name, site.model.inputs[i].unit, symbol, u)]
        deviation = f"({symbol} - {float(np.mean(u))!r})"
        for k, (label, unit, text, values) in enumerate(on):
            if float(np.std(values)) > 0:
                found.append(
                    Point(
                        f"{re.sub(r'[^0-9a-zA-Z]', '_', name)}_{k + 1}", name, symbol, deviation, label, text, unit,
                        values, float(np.mean(values)), float(np.std(values)),
                    )
                )  # fmt: skip
    return found


def attachment(
    entry: str, point: Point, slots: tuple[Slot, ...], term: str, *, equation: str, stepped: bool,
    says: Callable[[Mapping[str, float]], str], grid: tuple[Mapping[str, float], ...] = ({},),
) -> Attachment:  # fmt: skip
    """Offer a hypothesis that adds a term to what the input does."""
    where = location(f"input:{point.input_name}", inputs=(point.input_name,)) | {"region": point.name}
    return Attachment(
        entry, f"{entry} input:{point.input_name} on {point.name}", where,
        partial(acting, point.input_symbol, term, slots), slots, grid=grid, equation=equation, statement=says,
        stepped=stepped,
    )  # fmt: skip


def acting(symbol: str, term: str, slots: tuple[Slot, ...], model: Equations) -> Equations:
    """Return the model with input `symbol` replaced by itself plus a term everywhere, slots added as parameters.

    The sum is an intermediate of its own: written out at every place, several such effects would multiply.
    """
    name = f"acting_{slots[0].name}"
    instead: dict[str, ast.expr] = {symbol: ast.Name(id=name)}
    first = Auxiliary(name, ex.parse(f"{symbol} + {term}", "operating point"))

    def changed(tree: ast.expr) -> ast.expr:
        return ex.substitute(tree, instead)

    extra = (Parameter(s.name, s.null, s.unit, s.low, s.high) for s in slots)
    return replace(
        model,
        parameters=(*model.parameters, *extra),
        states=tuple(replace(s, derivative=changed(s.derivative)) for s in model.states),
        outputs=tuple(
            replace(o, equation=changed(o.equation), slope=None if o.slope is None else changed(o.slope))
            for o in model.outputs
        ),
        auxiliaries=(first, *(replace(a, equation=changed(a.equation)) for a in model.auxiliaries)),
        memories=tuple(replace(m, next=changed(m.next), settled=changed(m.settled)) for m in model.memories),
    )
